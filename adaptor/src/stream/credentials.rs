//! What lets a client in: two secrets, and what was given out for them.

use std::{
    fs::{File, Metadata, OpenOptions},
    io::{Read, Write},
    path::Path,
};

use axum::http::{HeaderMap, Uri, header};
use serde::{Deserialize, Serialize};
use tombolo_pipelines::language::{StreamLimits, StreamServer};

pub(super) use super::sessions::{Access, Holder};
use super::{StreamError, secret::Secret, sessions::Sessions};

/// The variables of the environment that give the secrets.
const DRIVING_VARIABLE: &str = "TOMBOLO_DRIVING_SECRET";
const WATCHING_VARIABLE: &str = "TOMBOLO_WATCHING_SECRET";
const RELAY_VARIABLE: &str = "TOMBOLO_RELAY_SECRET";
/// The beginning of the names of a run's cookies.
const COOKIE: &str = "tombolo";
const EXPECTED: &str = "expected a secret of 16 to 128 letters, digits, '-' or '_'";
/// The longest file of secrets that is read, in bytes.
const FILE: u64 = 4096;

/// The credentials of a request.
pub(super) enum Shown {
    Nothing,
    Wrong,
    Right(Holder),
}

/// The secrets of a run, and what was given out for them.
pub(super) struct Credentials {
    drive: (Secret, Holder),
    watch: (Secret, Holder),
    /// The keys and sessions that were given out.
    pub(super) sessions: Sessions,
    /// The name of the cookie, before its port.
    cookie: &'static str,
}

/// A file of secrets.
#[derive(Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct SecretsFile {
    #[serde(skip_serializing_if = "Option::is_none")]
    drive: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    watch: Option<String>,
    /// The secret that a relay asks runs for.
    #[serde(skip_serializing_if = "Option::is_none")]
    relay: Option<String>,
}

/// One of the secrets of a file, which is made where the file is missing.
#[derive(Debug, Clone, Copy)]
pub(super) enum KeptSecret {
    Watch,
    Relay,
}

impl KeptSecret {
    /// The secret in a file that nobody but its owner can read; the message says why there is none.
    pub(super) fn kept(self, path: &Path) -> Result<Secret, String> {
        if !path.exists() {
            let secret = Secret::random().map_err(|error| error.to_string())?;
            let text = Some(secret.as_str().to_owned());
            let kept = match self {
                Self::Watch => SecretsFile { watch: text, ..SecretsFile::default() },
                Self::Relay => SecretsFile { relay: text, ..SecretsFile::default() },
            };
            let text = serde_json::to_string(&kept).map_err(|error| error.to_string())? + "\n";
            create_private(path, text.as_bytes()).map_err(|error| error.to_string())?;
        }
        let file = read(path).map_err(|error| error.to_string())?;
        let (name, text) = match self {
            Self::Watch => ("watch", file.watch),
            Self::Relay => ("relay", file.relay),
        };
        let text = text.ok_or_else(|| format!("it holds no secret `{name}`"))?;
        Secret::given(&text).ok_or_else(|| format!("{name}: {EXPECTED}"))
    }
}

/// The secret that a run shows a relay.
pub(super) fn relay_secret(settings: &StreamServer) -> Result<Secret, StreamError> {
    let file = match &settings.secrets {
        Some(file) => read(Path::new(file))?.relay,
        None => None,
    };
    let named = settings.secrets.as_deref().unwrap_or_default();
    given([(RELAY_VARIABLE, variable(RELAY_VARIABLE)), (named, file)])?.ok_or_else(|| {
        StreamError::Relay(format!(
            "the relay's secret for runs is missing: give it as `relay` in the file that `stream.secrets` names, or as {RELAY_VARIABLE}"
        ))
    })
}

impl Credentials {
    /// The secrets that the environment, the file of secrets or the configuration gives, in this
    /// order, and fresh ones for those that none of them gives.
    pub(super) fn of(settings: &StreamServer) -> Result<Self, StreamError> {
        let file = match &settings.secrets {
            Some(file) => read(Path::new(file))?,
            None => SecretsFile::default(),
        };
        let named = settings.secrets.as_deref().unwrap_or_default();
        let drive = first([
            (DRIVING_VARIABLE, variable(DRIVING_VARIABLE)),
            (named, file.drive),
            ("stream.token", settings.token.clone()),
        ])?;
        let watch = first([(WATCHING_VARIABLE, variable(WATCHING_VARIABLE)), (named, file.watch)])?;
        if drive.matches(watch.as_str()) {
            return Err(StreamError::Secrets(
                "the secret for driving and the one for watching are the same".into(),
            ));
        }
        Ok(Self::new(drive, watch, COOKIE, settings.limits))
    }

    /// Two secrets: of a run those for driving and for watching, of a relay that for runs and that for its
    /// page. The names of cookies begin with `cookie`.
    pub(super) fn new(
        drive: Secret,
        watch: Secret,
        cookie: &'static str,
        limits: StreamLimits,
    ) -> Self {
        Self {
            drive: (drive, Holder::new(Access::Drive, &limits)),
            watch: (watch, Holder::new(Access::Watch, &limits)),
            sessions: Sessions::new(limits),
            cookie,
        }
    }

    pub(super) fn secret(&self, access: Access) -> &Secret {
        match access {
            Access::Drive => &self.drive.0,
            Access::Watch => &self.watch.0,
        }
    }

    /// Who shows this secret.
    pub(super) fn holder(&self, secret: &str) -> Option<Holder> {
        let mut known = [&self.drive, &self.watch].into_iter();
        known.find(|(own, _)| own.matches(secret)).map(|(_, holder)| holder.clone())
    }

    /// The credentials of a request. A secret in its header or query counts alone, also where it is wrong;
    /// the cookie counts where there is none.
    pub(super) fn shown(&self, headers: &HeaderMap, uri: &Uri) -> Shown {
        let bearer = headers
            .get(header::AUTHORIZATION)
            .map(|value| value.to_str().ok().and_then(bearer_of).unwrap_or_default());
        if let Some(secret) = bearer.or_else(|| parameter(uri, "token")) {
            return self.holder(secret).map_or(Shown::Wrong, Shown::Right);
        }
        self.visitor(headers).map_or(Shown::Nothing, Shown::Right)
    }

    /// Who shows a cookie of this run.
    pub(super) fn visitor(&self, headers: &HeaderMap) -> Option<Holder> {
        let name = self.cookie_name(headers);
        let mut pairs = cookies(headers).filter_map(|pair| pair.split_once('='));
        pairs.find_map(|(key, id)| if key == name { self.sessions.holder(id) } else { None })
    }

    /// The cookies of a request but for the one of this server; `None` where there are no others.
    pub(super) fn without_own_cookie(&self, headers: &HeaderMap) -> Option<String> {
        let own = self.cookie_name(headers);
        let is_other = |pair: &&str| pair.split('=').next() != Some(&own);
        let others: Vec<&str> = cookies(headers).filter(is_other).collect();
        (!others.is_empty()).then(|| others.join("; "))
    }

    /// The name of the cookie. Cookies do not know ports, so that it has the one that the browser sees
    /// in it: several runs on one machine, or behind several tunnels, keep apart.
    pub(super) fn cookie_name(&self, headers: &HeaderMap) -> String {
        let host = headers.get(header::HOST).and_then(|host| host.to_str().ok());
        let port = host.unwrap_or_default().rsplit_once(':');
        let port = port.and_then(|(_, port)| port.parse::<u16>().ok());
        format!("{}-{}", self.cookie, port.unwrap_or(80))
    }
}

/// The secret in an `Authorization` header, the scheme of which is written in any case.
fn bearer_of(text: &str) -> Option<&str> {
    let (scheme, secret) = text.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| secret.trim_start_matches(' '))
}

/// The cookies of a request, each as it stands there.
fn cookies(headers: &HeaderMap) -> impl Iterator<Item = &str> {
    let cookies = headers.get_all(header::COOKIE).iter();
    cookies.filter_map(|value| value.to_str().ok()).flat_map(|text| text.split(';')).map(str::trim)
}

/// A parameter of the query, as it stands there.
pub(super) fn parameter<'a>(uri: &'a Uri, name: &str) -> Option<&'a str> {
    let mut pairs = uri.query()?.split('&').filter_map(|pair| pair.split_once('='));
    pairs.find(|(key, _)| *key == name).map(|(_, value)| value)
}

fn variable(name: &str) -> Option<String> {
    std::env::var_os(name).map(|value| value.to_string_lossy().into_owned())
}

/// The first secret that is given, or a fresh one.
fn first<const N: usize>(sources: [(&str, Option<String>); N]) -> Result<Secret, StreamError> {
    match given(sources)? {
        None => Secret::random().map_err(StreamError::Token),
        Some(secret) => Ok(secret),
    }
}

/// The first secret that is given.
fn given<const N: usize>(
    sources: [(&str, Option<String>); N],
) -> Result<Option<Secret>, StreamError> {
    let found = sources.into_iter().find_map(|(source, text)| Some((source, text?)));
    let Some((source, text)) = found else { return Ok(None) };
    let wrong = || StreamError::Secrets(format!("{source}: {EXPECTED}"));
    Secret::given(&text).ok_or_else(wrong).map(Some)
}

/// How a file is made that nobody but its owner may read.
pub(super) fn private() -> OpenOptions {
    let mut options = OpenOptions::new();
    options.write(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options
}

/// Makes a file that nobody but its owner can read, whole or not at all. Where somebody else makes it
/// meanwhile, theirs stays.
pub(super) fn create_private(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut file = tempfile::NamedTempFile::new_in(folder.unwrap_or(Path::new(".")))?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    match file.persist_noclobber(path) {
        Err(error) if error.error.kind() != std::io::ErrorKind::AlreadyExists => Err(error.error),
        _ => Ok(()),
    }
}

/// Opens a file that holds a secret, which nobody but its owner may read; the message says why not.
pub(super) fn open_private(path: &Path) -> Result<File, String> {
    let wrong = |reason: &str| format!("{}: {reason}", path.display());
    let failed = |error: std::io::Error| wrong(&error.to_string());
    let file = File::open(path).map_err(failed)?;
    let metadata = file.metadata().map_err(failed)?;
    if !metadata.is_file() {
        return Err(wrong("it is no file"));
    }
    if is_open_to_others(&metadata) {
        return Err(wrong("others than its owner can get at it; `chmod 600` it"));
    }
    Ok(file)
}

/// Whether others than its owner can get at a file.
#[cfg(unix)]
fn is_open_to_others(metadata: &Metadata) -> bool {
    std::os::unix::fs::PermissionsExt::mode(&metadata.permissions()) & 0o077 != 0
}

#[cfg(not(unix))]
fn is_open_to_others(_: &Metadata) -> bool {
    false
}

/// Warns of a secret in a configuration that others than its owner can read.
pub(crate) fn warn_of_readable_token(run: &str, settings: &StreamServer, file: &Path) {
    let is_open = || std::fs::metadata(file).is_ok_and(|metadata| is_open_to_others(&metadata));
    if settings.token.is_some() && is_open() {
        let path = file.display();
        tracing::warn!(
            run,
            %path,
            "others than its owner can get at {path}, and with `stream.token` in it at the run: `chmod 600` it, or give the \
             secret in the file that `stream.secrets` names"
        );
    }
}

/// Reads a file of secrets.
fn read(path: &Path) -> Result<SecretsFile, StreamError> {
    let wrong = |reason: &str| StreamError::Secrets(format!("{}: {reason}", path.display()));
    let failed = |error: std::io::Error| wrong(&error.to_string());
    let file = open_private(path).map_err(StreamError::Secrets)?;
    let mut text = String::new();
    file.take(FILE).read_to_string(&mut text).map_err(failed)?;
    // The parser's own words could quote a secret.
    serde_json::from_str(&text)
        .map_err(|_| wrong(r#"expected {"drive": "SECRET", "watch": "SECRET", "relay": "SECRET"}, or some of them"#))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn credentials() -> Credentials {
        Credentials::of(&StreamServer::default()).expect("secrets")
    }

    fn access(
        credentials: &Credentials,
        uri: &str,
        headers: &[(&'static str, &str)],
    ) -> Option<Access> {
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.insert(*name, value.parse().expect("a header"));
        }
        match credentials.shown(&map, &uri.parse().expect("a URL")) {
            Shown::Right(holder) => Some(holder.access),
            _ => None,
        }
    }

    #[test]
    fn each_way_of_showing_a_secret_gives_what_it_is_for() {
        let credentials = credentials();
        for wanted in [Access::Drive, Access::Watch] {
            let secret = credentials.secret(wanted).as_str().to_owned();
            assert_eq!(access(&credentials, &format!("/ws?a=b&token={secret}"), &[]), Some(wanted));
            let bearer = format!("Bearer {secret}");
            assert_eq!(access(&credentials, "/ws", &[("authorization", &bearer)]), Some(wanted));
            let bearer = format!("bearer  {secret}");
            assert_eq!(access(&credentials, "/ws", &[("authorization", &bearer)]), Some(wanted));
            let here = std::net::Ipv4Addr::LOCALHOST.into();
            let id = credentials.sessions.begin(wanted, here).expect("a session");
            let cookie = format!("other=1; tombolo-7070={}", id.as_str());
            let host = ("host", "localhost:7070");
            assert_eq!(access(&credentials, "/ws", &[host, ("cookie", &cookie)]), Some(wanted));
            // The cookie of another port, and a wrong secret beside a right cookie.
            let other = ("host", "localhost:7071");
            assert_eq!(access(&credentials, "/ws", &[other, ("cookie", &cookie)]), None);
            let both = [host, ("cookie", &*cookie)];
            assert_eq!(access(&credentials, "/ws?token=0", &both), None);
            let both = [host, ("cookie", &*cookie), ("authorization", "Basic x")];
            assert_eq!(access(&credentials, "/ws", &both), None);
        }
    }

    #[test]
    fn a_secret_is_made_once_and_whole() {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("runs.json");
        let made = KeptSecret::Relay.kept(&path).expect("made");
        let again = KeptSecret::Relay.kept(&path).expect("read");
        assert_eq!(made.as_str(), again.as_str());
        // Another relay made one meanwhile.
        create_private(&path, b"{}").expect("left as it is");
        assert!(KeptSecret::Relay.kept(&path).is_ok());
        let names: Vec<_> = std::fs::read_dir(directory.path()).expect("it").flatten().collect();
        assert_eq!(names.len(), 1, "nothing is left beside it");
    }

    #[cfg(unix)]
    #[test]
    fn a_file_of_secrets_that_others_can_read_is_refused() {
        use std::os::unix::fs::PermissionsExt;
        let directory = tempfile::tempdir().expect("a directory");
        let file = directory.path().join("secrets.json");
        let settings = StreamServer {
            secrets: Some(file.display().to_string()),
            token: Some("0123456789abcdef-token".into()),
            ..StreamServer::default()
        };
        let write = |text: &str, mode: u32| {
            std::fs::write(&file, text).expect("written");
            std::fs::set_permissions(&file, PermissionsExt::from_mode(mode)).expect("set");
        };
        let refused = || Credentials::of(&settings).err().expect("refused").to_string();
        assert!(refused().contains("secrets.json"), "a file that is missing");
        let good = r#"{"watch": "0123456789abcdef-watch"}"#;
        write(good, 0o640);
        assert!(refused().contains("chmod 600"));
        write(good, 0o600);
        let credentials = Credentials::of(&settings).expect("read");
        assert_eq!(credentials.secret(Access::Watch).as_str(), "0123456789abcdef-watch");
        assert_eq!(credentials.secret(Access::Drive).as_str(), "0123456789abcdef-token");
        for wrong in ["", r#"{"watch": "short-one"}"#, r#"{"wotch": "0123456789abcdef-watch"}"#] {
            write(wrong, 0o600);
            let told = refused();
            assert!(!told.contains("short-one") && !told.contains("0123456789"), "{told}");
        }
        write(r#"{"watch": "0123456789abcdef-token"}"#, 0o600);
        assert!(refused().contains("the same"));
    }
}
