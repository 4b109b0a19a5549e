//! How a server is known, where its connections are encrypted: by a certificate from files, or by one
//! that is made for the run.

use std::{io::Read, net::SocketAddr, path::Path, sync::Arc};

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
use tombolo_pipelines::language::{StreamServer, Tls};

use super::{
    StreamError,
    credentials::{create_private, open_private},
    socket::Place,
};
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

    /// The certificate that is kept in a directory, which is made for these names where it is missing.
    pub(super) fn kept(directory: &Path, names: Vec<String>) -> Result<Self, StreamError> {
        let [certificate, key] = ["certificate.der", "key.der"].map(|file| directory.join(file));
        let wrong =
            |path: &Path, reason: &str| StreamError::Tls(format!("{}: {reason}", path.display()));
        if !key.exists() {
            let made = rcgen::generate_simple_self_signed(names)
                .map_err(|error| StreamError::Tls(error.to_string()))?;
            let write = |path: &Path, bytes: &[u8]| {
                create_private(path, bytes).map_err(|error| wrong(path, &error.to_string()))
            };
            // The key last: where it is there, the certificate is. One without a key is of no use.
            let _ = std::fs::remove_file(&certificate);
            write(&certificate, made.cert.der())?;
            write(&key, &made.signing_key.serialize_der())?;
        }
        let chain =
            std::fs::read(&certificate).map_err(|error| wrong(&certificate, &error.to_string()))?;
        let mut bytes = Vec::new();
        let mut file = open_private(&key).map_err(StreamError::Tls)?;
        file.read_to_end(&mut bytes).map_err(|error| wrong(&key, &error.to_string()))?;
        Self::with(vec![chain.into()], PrivateKeyDer::Pkcs8(bytes.into()))
    }

    /// The certificate of a server, where its connections are to be encrypted: always where others than
    /// this machine reach it, unless that was expressly not wanted.
    pub(super) fn of_server(
        settings: &StreamServer,
        place: &Place,
    ) -> Result<Option<Self>, StreamError> {
        let wrong = |reason: &str| Err(StreamError::Tls(reason.into()));
        let address = match (place, &settings.tls, settings.insecure) {
            (_, Some(_), true) => return wrong("`insecure` says that nothing is encrypted"),
            (Place::Socket(_), Some(_), _) => {
                return wrong("what goes through a socket at a path never leaves the machine");
            }
            (Place::Socket(_), None, _) => return Ok(None),
            (Place::Address(address), _, _) => address,
        };
        let is_open = !address.ip().is_loopback();
        if settings.tls.is_none() && (!is_open || settings.insecure) {
            if is_open {
                tracing::warn!(
                    %address,
                    "viewers reach {address} from other machines, and what they send and see can be \
                     read on the way, because `stream.insecure` says so"
                );
            }
            return Ok(None);
        }
        Self::of(&settings.tls.clone().unwrap_or_default(), names_of(*address)).map(Some)
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

/// The names and addresses by which a server that listens there is reached.
pub(super) fn names_of(address: SocketAddr) -> Vec<String> {
    let names = [Some("localhost".to_owned()), machine(), Some(address.ip().to_string())];
    names.into_iter().flatten().collect()
}

/// The machine's name in its network, as far as the system tells it.
pub(super) fn machine() -> Option<String> {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok()?;
    let name = name.trim();
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '.';
    (!name.is_empty() && name.chars().all(is_name)).then(|| name.to_owned())
}
