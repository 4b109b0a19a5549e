//! The link to a run.

use std::{
    fmt,
    net::Ipv6Addr,
    path::{Path, PathBuf},
    str::FromStr,
};

use tombolo_pipelines::language::is_fingerprint;

/// A text that is no link.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "found the link {found:?}, and {reason}; expected http://HOST:PORT/?token=TOKEN, https:// or unix:/PATH?token=TOKEN, as it stands in the run's file of links"
)]
pub struct LinkError {
    /// The text, without its token.
    pub found: String,
    /// A text that says what is wrong with it.
    pub reason: String,
}

/// Bytes that a link may have.
const LENGTH: usize = 4096;
/// How links begin.
pub(crate) const BEGINNINGS: [&str; 3] = ["http://", "https://", "unix:"];

/// The address of a run and the token that lets a client in, as they stand in its file of links:
/// `http://HOST:PORT/?token=TOKEN`, behind a proxy also with a path before the `?`;
/// `https://HOST:PORT/?token=TOKEN#sha256=FINGERPRINT`, where the certificate of this fingerprint
/// counts, or without it one that this machine trusts; `unix:PATH?token=TOKEN`.
///
/// It prints with the token, and its `Debug` form without.
///
/// ```
/// use tombolo::client::Link;
///
/// let link: Link = "http://127.0.0.1:7070/runs/wing/?token=0123456789abcdef".parse()?;
/// assert_eq!((link.host(), link.port()), ("127.0.0.1", 7070));
/// assert_eq!(link.address(), "127.0.0.1:7070");
/// assert_eq!(link.to_string(), "http://127.0.0.1:7070/runs/wing/?token=0123456789abcdef");
/// let error = "127.0.0.1:7070".parse::<Link>().unwrap_err();
/// assert!(error.to_string().contains("expected http://HOST:PORT/?token=TOKEN"));
/// # Ok::<(), tombolo::client::LinkError>(())
/// ```
#[derive(Clone, PartialEq, Eq)]
pub struct Link {
    host: String,
    port: u16,
    way: Way,
    /// The path without its last slash: empty, or `/...`.
    prefix: String,
    token: String,
}

/// How a connection is made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Way {
    Plain,
    /// Encrypted, by the certificate of this fingerprint, or by one that this machine trusts.
    Encrypted(Option<String>),
    /// Through a socket at a path of this machine.
    Socket(PathBuf),
}

impl Link {
    pub(crate) fn way(&self) -> &Way {
        &self.way
    }

    /// The path of the socket that it leads through, where it leads through one.
    #[must_use]
    pub fn socket_path(&self) -> Option<&Path> {
        match &self.way {
            Way::Socket(path) => Some(path),
            _ => None,
        }
    }

    /// The host: a name, or an address, that of IPv6 in brackets; `localhost` for a socket.
    #[must_use]
    pub fn host(&self) -> &str {
        &self.host
    }

    /// The port; 80 or 443 where the link names none, 0 for a socket.
    #[must_use]
    pub fn port(&self) -> u16 {
        self.port
    }

    /// The host and port, or the path of the socket, as people write them.
    #[must_use]
    pub fn address(&self) -> String {
        match &self.way {
            Way::Socket(path) => format!("unix:{}", path.display()),
            _ => self.authority(),
        }
    }

    /// The host and port for a request's header.
    pub(crate) fn authority(&self) -> String {
        format!("{}:{}", self.host, self.port)
    }

    /// Whether it has no path of its own, as a run behind a relay has one.
    pub(crate) fn is_bare(&self) -> bool {
        self.prefix.is_empty()
    }

    pub(crate) fn token(&self) -> &str {
        &self.token
    }

    /// The host as the system resolves it.
    pub(crate) fn name(&self) -> &str {
        self.host.trim_start_matches('[').trim_end_matches(']')
    }

    /// The path of the page, with the token.
    fn page(&self) -> String {
        format!("{}/?token={}", self.prefix, self.token)
    }

    /// The path of a request. It has no token, for whoever stands between writes paths down: the header
    /// `Authorization` has it.
    pub(crate) fn path(&self, of: &str, query: &[(&str, &str)]) -> String {
        let mut path = format!("{}/{of}", self.prefix);
        for (index, (key, value)) in query.iter().enumerate() {
            path += &format!("{}{key}={value}", if index == 0 { '?' } else { '&' });
        }
        path
    }

    /// The address of the viewer's page with a path behind it, such as `?key=...`.
    pub(crate) fn opened_by(&self, path: &str) -> String {
        let (scheme, usual) = match &self.way {
            Way::Plain => ("http", 80),
            Way::Encrypted(_) => ("https", 443),
            Way::Socket(socket) => return format!("unix:{}{path}", socket.display()),
        };
        let port = if self.port == usual { String::new() } else { format!(":{}", self.port) };
        format!("{scheme}://{}{port}{}/{path}", self.host, self.prefix)
    }

    /// The address of the WebSocket, for a client of a role that had a name before, and what it comes back
    /// by.
    pub(crate) fn socket(
        &self,
        role: Option<&str>,
        client: Option<&str>,
        back: Option<&str>,
        looks: bool,
    ) -> String {
        let known = [("client", client), ("role", role), ("back", back)];
        let mut query: Vec<_> = (known.into_iter())
            .filter_map(|(key, value)| value.map(|value| (key, value)))
            .collect();
        if !looks {
            query.push(("views", "none"));
        }
        format!("ws://{}{}", self.authority(), self.path("ws", &query))
    }
}

impl FromStr for Link {
    type Err = LinkError;

    fn from_str(text: &str) -> Result<Self, LinkError> {
        let text = text.trim();
        // Whoever shows the error shows no token.
        let shown: String = text.split('?').next().unwrap_or_default().chars().take(100).collect();
        let wrong = |reason: &str| LinkError { found: shown.clone(), reason: reason.into() };
        if text.len() > LENGTH {
            return Err(wrong("it is too long"));
        }
        if !text.chars().all(|c| c.is_ascii_graphic()) {
            return Err(wrong("it holds a character that no link has"));
        }
        if !BEGINNINGS.iter().any(|begin| text.starts_with(begin)) {
            return Err(wrong("it does not begin with http://, https:// or unix:/"));
        }
        let (text, fragment) = text.split_once('#').unwrap_or((text, ""));
        let (place, query) = text.split_once('?').ok_or_else(|| wrong("it has no token"))?;
        if query.split('&').any(|pair| pair.starts_with("key=")) {
            return Err(wrong("it opens one browser, once, and lets no program in"));
        }
        let token = query.split('&').find_map(|pair| pair.strip_prefix("token="));
        let known = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        let token = token.filter(|token| !token.is_empty() && token.chars().all(known));
        let token = token.ok_or_else(|| wrong("it has no token"))?.to_owned();
        if let Some(path) = place.strip_prefix("unix:") {
            if !path.starts_with('/') {
                return Err(wrong("the path of its socket does not begin with a slash"));
            }
            let way = Way::Socket(path.into());
            return Ok(Self {
                host: "localhost".into(),
                port: 0,
                way,
                prefix: String::new(),
                token,
            });
        }
        let (way, usual, rest) = match place.split_once("://") {
            Some(("http", rest)) => (Way::Plain, 80, rest),
            Some(("https", rest)) => {
                let digits = fragment.strip_prefix("sha256=");
                let pinned =
                    digits.filter(|text| is_fingerprint(text)).map(str::to_ascii_lowercase);
                if fragment.starts_with("sha256=") && pinned.is_none() {
                    return Err(wrong("its fingerprint has not 64 hexadecimal digits"));
                }
                (Way::Encrypted(pinned), 443, rest)
            }
            _ => return Err(wrong("it does not begin with http://, https:// or unix:/")),
        };
        let (authority, path) = rest.split_once('/').unwrap_or((rest, ""));
        let (host, port) = match authority.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => {
                let port = port.parse().ok().filter(|&port| port != 0);
                (host, port.ok_or_else(|| wrong("its port is not a number from 1 to 65535"))?)
            }
            _ => (authority, usual),
        };
        let is_bracketed = host
            .strip_prefix('[')
            .and_then(|host| host.strip_suffix(']'))
            .is_some_and(|host| host.parse::<Ipv6Addr>().is_ok());
        let known = |c: char| c.is_ascii_alphanumeric() || "-._".contains(c);
        if host.is_empty() || !is_bracketed && !host.chars().all(known) {
            return Err(wrong("it names no host"));
        }
        let path = path.trim_matches('/');
        let prefix = if path.is_empty() { String::new() } else { format!("/{path}") };
        let link = Self { host: host.into(), port, way, prefix, token };
        // With the port that it does not name: what it prints can be read.
        if link.to_string().len() > LENGTH {
            return Err(wrong("it is too long"));
        }
        Ok(link)
    }
}

impl fmt::Display for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.way {
            Way::Plain => write!(f, "http://{}{}", self.authority(), self.page()),
            Way::Encrypted(pinned) => {
                write!(f, "https://{}{}", self.authority(), self.page())?;
                pinned.iter().try_for_each(|fingerprint| write!(f, "#sha256={fingerprint}"))
            }
            Way::Socket(path) => write!(f, "unix:{}?token={}", path.display(), self.token),
        }
    }
}

/// A token is never printed by accident.
impl fmt::Debug for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Link({}{}/?token=..)", self.address(), self.prefix)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_is_read_with_its_path_and_without_its_port() {
        let read = |text: &str| text.parse::<Link>();
        let link = read(" http://[::1]:7070/?token=abc\n").expect("a link");
        assert_eq!(
            (link.name(), &*link.socket(None, None, None, true)),
            ("::1", "ws://[::1]:7070/ws")
        );
        assert_eq!(link.opened_by("?key=k"), "http://[::1]:7070/?key=k");
        let link = read("http://host/a/b/?x=1&token=t-1#page").expect("a link");
        assert_eq!(link.opened_by("?key=k"), "http://host/a/b/?key=k");
        assert_eq!((link.port(), &*link.path("surface", &[])), (80, "/a/b/surface"));
        assert_eq!(
            link.socket(Some("watch"), Some("c3"), None, false),
            "ws://host:80/a/b/ws?client=c3&role=watch&views=none"
        );
        assert!(!format!("{link:?}").contains("t-1"));
        let digits = "0A".repeat(32);
        let pinned = format!("https://host/?token=t-1#sha256={digits}");
        let link = read(&pinned).expect("a link");
        assert_eq!((link.port(), link.way()), (443, &Way::Encrypted(Some(digits.to_lowercase()))));
        assert_eq!(read(&link.to_string()), Ok(link));
        let link = read("https://host/?token=t-1#page").expect("a link");
        assert_eq!(link.way(), &Way::Encrypted(None));
        let link = read("unix:/run/a b.sock?token=t-1");
        assert!(link.is_err(), "a space");
        let link = read("unix:/run/tombolo.sock?token=t-1").expect("a link");
        assert_eq!(link.socket_path(), Some(Path::new("/run/tombolo.sock")));
        assert_eq!(link.address(), "unix:/run/tombolo.sock");
        assert_eq!(read(&link.to_string()), Ok(link));
        for wrong in [
            "",
            "http://",
            "http://host/",
            "http://host/?token=",
            "http://host:0/?token=a",
            "http://host:99999/?token=a",
            "http://a b/?token=a",
            "http://host/?token=a%0d",
            "https://host/?token=a#sha256=12",
            "unix:tombolo.sock?token=a",
            "unix:/tombolo.sock",
            "ftp://host/?token=a",
            "http://[]/?token=a",
            "http://[a@b]/?token=a",
            "http://[::1]:80]/?token=a",
            &format!("http://host/{}/?token=a", "a".repeat(4074)),
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
        let error = read("http://host:x/?token=secret").expect_err("no port").to_string();
        assert!(!error.contains("secret"), "{error}");
        for (wrong, reason) in [
            ("127.0.0.1:7070", "it does not begin with http://"),
            ("http://127.0.0.1:7070/?key=secret", "it opens one browser, once"),
            ("unix:/tombolo.sock?key=secret", "it opens one browser, once"),
            ("http://127.0.0.1:7070/", "it has no token"),
        ] {
            let error = read(wrong).expect_err("no link for programs").to_string();
            assert!(error.contains(reason) && !error.contains("secret"), "{error}");
        }
    }
}
