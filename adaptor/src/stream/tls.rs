//! How a server is known, where its connections are encrypted: by a certificate from files, or by one
//! that is made for the run.

use std::{path::Path, sync::Arc};

use rustls::{
    ServerConfig,
    crypto::ring::default_provider,
    pki_types::{
        CertificateDer, PrivateKeyDer,
        pem::{self, PemObject},
    },
    version::TLS13,
};
use tokio_rustls::TlsAcceptor;
use tombolo_pipelines::language::Tls;

use super::{StreamError, credentials::open_private};
use crate::fingerprint::fingerprint;

/// The certificate of a server, with its key.
#[derive(Clone)]
pub(super) struct Identity {
    pub(super) acceptor: TlsAcceptor,
    /// SHA-256 of the certificate, in hexadecimal digits.
    pub(super) fingerprint: String,
}

impl Identity {
    /// The certificate that the settings name; without one, a new one for these names, which nobody
    /// has signed.
    pub(super) fn of(settings: &Tls, names: Vec<String>) -> Result<Self, StreamError> {
        let wrong = |reason: String| StreamError::Tls(reason);
        match (&settings.certificate, &settings.key) {
            (Some(certificate), Some(key)) => {
                let of = |file: &str, error: pem::Error| wrong(format!("{file}: {error}"));
                let chain = CertificateDer::pem_file_iter(certificate)
                    .and_then(Iterator::collect::<Result<Vec<_>, _>>)
                    .map_err(|error| of(certificate, error))?;
                let file = open_private(Path::new(key)).map_err(wrong)?;
                let key = PrivateKeyDer::from_pem_reader(file).map_err(|error| of(key, error))?;
                Self::with(chain, key)
            }
            (None, None) => {
                let made = rcgen::generate_simple_self_signed(names)
                    .map_err(|error| wrong(error.to_string()))?;
                let key = PrivateKeyDer::Pkcs8(made.signing_key.serialize_der().into());
                Self::with(vec![made.cert.der().clone()], key)
            }
            _ => Err(wrong("`certificate` and `key` go together".into())),
        }
    }

    fn with(
        chain: Vec<CertificateDer<'static>>,
        key: PrivateKeyDer<'static>,
    ) -> Result<Self, StreamError> {
        let none = || StreamError::Tls("the file of the certificate holds none".into());
        let fingerprint = fingerprint(chain.first().ok_or_else(none)?);
        let config = ServerConfig::builder_with_provider(Arc::new(default_provider()))
            .with_protocol_versions(&[&TLS13])
            .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, key))
            .map_err(|error| StreamError::Tls(error.to_string()))?;
        Ok(Self { acceptor: Arc::new(config).into(), fingerprint })
    }
}
