//! The fingerprint by which a certificate is known that nobody has signed.

use ring::digest::{SHA256, digest};

/// SHA-256 of a certificate, in 64 hexadecimal digits.
pub(crate) fn fingerprint(certificate: &[u8]) -> String {
    digest(&SHA256, certificate).as_ref().iter().map(|byte| format!("{byte:02x}")).collect()
}
