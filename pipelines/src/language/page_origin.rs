//! The pages that may show the viewer inside of them.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Deserializer, Serialize};

use super::as_text::as_text;
use super::relay_address::is_host;
use crate::limits::EMBEDDERS;

/// Bytes that an origin may have.
const LENGTH: usize = 260;

/// The origin of a web page: its scheme, its host, and its port where that is not the usual one.
///
/// ```
/// use tombolo_pipelines::language::PageOrigin;
///
/// let notebook: PageOrigin = "http://localhost:8888".parse()?;
/// assert_eq!(notebook.as_str(), "http://localhost:8888");
/// let error = "localhost:8888".parse::<PageOrigin>().unwrap_err();
/// assert!(error.starts_with("found \"localhost:8888\", expected http://HOST:PORT"), "{error}");
/// # Ok::<(), String>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PageOrigin(String);

impl PageOrigin {
    /// The origin as browsers write it, without a path.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for PageOrigin {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = |reason: &str| {
            let shown: String = text.chars().take(100).collect();
            format!(
                "found {shown:?}, expected http://HOST:PORT or https://HOST:PORT, such as http://localhost:8888: {reason}"
            )
        };
        if text.len() > LENGTH {
            return Err(wrong("it is too long"));
        }
        let (scheme, authority) =
            text.split_once("://").ok_or_else(|| wrong("it has no scheme"))?;
        if !matches!(scheme, "http" | "https") {
            return Err(wrong("it begins with neither http:// nor https://"));
        }
        let authority = authority.strip_suffix('/').unwrap_or(authority);
        if authority.contains(['/', '?', '#']) {
            return Err(wrong("an origin has no path"));
        }
        // What browsers do not write down: they leave out the usual port, and write in small letters.
        let (host, port) = match authority.rsplit_once(':') {
            Some((host, port)) if !port.ends_with(']') => (host, Some(port)),
            _ => (authority, None),
        };
        let port = port.map(|port| port.parse::<u16>().ok().filter(|port| *port > 0));
        if port == Some(None) {
            return Err(wrong("its port is not a number from 1 to 65535"));
        }
        if !is_host(host) {
            return Err(wrong("it names no host; a name stands for no other, and there is no *"));
        }
        let usual = if scheme == "http" { 80 } else { 443 };
        let port = port.flatten().filter(|port| *port != usual);
        let port = port.map_or_else(String::new, |port| format!(":{port}"));
        Ok(Self(format!("{scheme}://{}{port}", host.to_ascii_lowercase())))
    }
}

impl fmt::Display for PageOrigin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

as_text!(PageOrigin);

/// The pages that may show a viewer inside of them, [`EMBEDDERS`] at most.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Embedders(Vec<PageOrigin>);

impl Embedders {
    /// Whether no page may.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The pages, in the order in which they were named.
    pub fn iter(&self) -> impl Iterator<Item = &PageOrigin> {
        self.0.iter()
    }
}

impl<'de> Deserialize<'de> for Embedders {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let origins = Vec::<PageOrigin>::deserialize(deserializer)?;
        EMBEDDERS.check(origins.len()).map_err(serde::de::Error::custom)?;
        Ok(Self(origins))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_is_as_browsers_write_it() {
        for (text, expected) in [
            ("http://localhost:8888", "http://localhost:8888"),
            ("http://localhost:8888/", "http://localhost:8888"),
            ("https://Hub.Example.org", "https://hub.example.org"),
            ("https://hub.example.org:443", "https://hub.example.org"),
            ("http://hub.example.org:443", "http://hub.example.org:443"),
            ("http://[::1]:8888", "http://[::1]:8888"),
            ("http://[::1]", "http://[::1]"),
        ] {
            assert_eq!(text.parse::<PageOrigin>().map(|it| it.0), Ok(expected.into()), "{text}");
        }
    }

    #[test]
    fn what_is_no_origin_is_refused_with_its_reason() {
        for (text, reason) in [
            ("*", "no scheme"),
            ("localhost:8888", "no scheme"),
            ("file://x", "neither http:// nor https://"),
            ("http://*", "names no host"),
            ("http://*.example.org", "names no host"),
            ("http://", "names no host"),
            ("http://a b", "names no host"),
            ("http://a; script-src *", "names no host"),
            ("http://a\r\nX-Y: z", "port"),
            ("http://a\r\n", "names no host"),
            ("http://user@a", "names no host"),
            ("http://[::g]", "names no host"),
            ("http://a:0", "port"),
            ("http://a:99999", "port"),
            ("http://a/lab", "no path"),
            ("http://a?x", "no path"),
            (&format!("http://{}", "a".repeat(300)), "too long"),
        ] {
            let error = text.parse::<PageOrigin>().expect_err(text);
            assert!(error.contains(reason), "{text}: {error}");
        }
        let many = serde_json::json!(vec!["http://a"; EMBEDDERS.most + 1]);
        let error = serde_json::from_value::<Embedders>(many).expect_err("too many");
        assert!(error.to_string().contains("found 17 pages, expected at most 16"), "{error}");
    }
}
