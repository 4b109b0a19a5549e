//! The link that a run prints.

use std::{fmt, str::FromStr};

use super::ClientError;

/// Bytes that a link may have.
const LENGTH: usize = 4096;

/// The address of a run and the token that lets a client in, as the run prints them:
/// `http://HOST:PORT/?token=TOKEN`, behind a proxy also with a path before the `?`.
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
/// # Ok::<(), tombolo::client::ClientError>(())
/// ```
#[derive(Clone, PartialEq, Eq)]
pub struct Link {
    host: String,
    port: u16,
    /// The path without its last slash: empty, or `/...`.
    prefix: String,
    token: String,
}

impl Link {
    /// The host: a name, or an address, that of IPv6 in brackets.
    #[must_use]
    pub fn host(&self) -> &str {
        &self.host
    }

    /// The port; 80 where the link names none.
    #[must_use]
    pub fn port(&self) -> u16 {
        self.port
    }

    /// The host and port, as people write them.
    #[must_use]
    pub fn address(&self) -> String {
        format!("{}:{}", self.host, self.port)
    }

    pub(super) fn token(&self) -> &str {
        &self.token
    }

    /// The host as the system resolves it.
    pub(super) fn name(&self) -> &str {
        self.host.trim_start_matches('[').trim_end_matches(']')
    }

    /// The path of a request, with the token.
    pub(super) fn path(&self, of: &str) -> String {
        format!("{}/{of}?token={}", self.prefix, self.token)
    }

    /// The address of the WebSocket, for a client that had a name before, and what it comes back by.
    pub(super) fn socket(&self, watches: bool, client: Option<&str>, back: Option<&str>) -> String {
        let mut client = client.map_or_else(String::new, |name| format!("&client={name}"));
        if watches {
            client += "&role=watch";
        }
        if let Some(back) = back {
            client += &format!("&back={back}");
        }
        format!("ws://{}{}{client}", self.address(), self.path("ws"))
    }
}

impl FromStr for Link {
    type Err = ClientError;

    fn from_str(text: &str) -> Result<Self, ClientError> {
        let text = text.trim();
        // Whoever shows the error shows no token.
        let shown: String = text.split('?').next().unwrap_or_default().chars().take(100).collect();
        let wrong =
            |reason: &str| ClientError::Link { found: shown.clone(), reason: reason.into() };
        if text.len() > LENGTH {
            return Err(wrong("it is too long"));
        }
        if !text.chars().all(|c| c.is_ascii_graphic()) {
            return Err(wrong("it holds a character that no link has"));
        }
        let rest = match text.split_once("://") {
            Some(("http", rest)) => rest,
            Some(("https", _)) => return Err(wrong("https is not supported yet")),
            _ => return Err(wrong("it does not begin with http://")),
        };
        let rest = rest.split('#').next().unwrap_or_default();
        let (place, query) = rest.split_once('?').ok_or_else(|| wrong("it has no token"))?;
        let (authority, path) = place.split_once('/').unwrap_or((place, ""));
        let (host, port) = match authority.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => {
                let port = port.parse().ok().filter(|&port| port != 0);
                (host, port.ok_or_else(|| wrong("its port is not a number from 1 to 65535"))?)
            }
            _ => (authority, 80),
        };
        let is_bracketed = host.starts_with('[') && host.ends_with(']');
        let known = |c: char| c.is_ascii_alphanumeric() || "-._".contains(c);
        if host.is_empty() || !is_bracketed && !host.chars().all(known) {
            return Err(wrong("it names no host"));
        }
        let token = query.split('&').find_map(|pair| pair.strip_prefix("token="));
        let known = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        let token = token.filter(|token| !token.is_empty() && token.chars().all(known));
        let token = token.ok_or_else(|| wrong("it has no token"))?;
        let path = path.trim_matches('/');
        let prefix = if path.is_empty() { String::new() } else { format!("/{path}") };
        Ok(Self { host: host.into(), port, prefix, token: token.into() })
    }
}

impl fmt::Display for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "http://{}{}", self.address(), self.path(""))
    }
}

/// A token is never printed by accident.
impl fmt::Debug for Link {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Link(http://{}{}/?token=..)", self.address(), self.prefix)
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
            (link.name(), &*link.socket(false, None, None)),
            ("::1", "ws://[::1]:7070/ws?token=abc")
        );
        let link = read("http://host/a/b/?x=1&token=t-1#page").expect("a link");
        assert_eq!((link.port(), &*link.path("surface")), (80, "/a/b/surface?token=t-1"));
        assert_eq!(link.socket(false, Some("c3"), None), "ws://host:80/a/b/ws?token=t-1&client=c3");
        assert!(!format!("{link:?}").contains("t-1"));
        for wrong in [
            "",
            "http://",
            "http://host/",
            "http://host/?token=",
            "http://host:0/?token=a",
            "http://host:99999/?token=a",
            "http://a b/?token=a",
            "http://host/?token=a%0d",
            "https://host/?token=a",
            "ftp://host/?token=a",
        ] {
            assert!(matches!(read(wrong), Err(ClientError::Link { .. })), "{wrong}");
        }
        let error = read("http://host:x/?token=secret").expect_err("no port").to_string();
        assert!(!error.contains("secret"), "{error}");
    }
}
