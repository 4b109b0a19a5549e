//! The relay that a run connects to, and the name that the run has there.

use std::{fmt, str::FromStr};

use super::as_text::as_text;

/// The hosts that are this machine itself.
const LOOPBACK: [&str; 3] = ["localhost", "127.0.0.1", "[::1]"];
/// Bytes that an address may have.
const LENGTH: usize = 400;

/// The address of a relay: `HOST:PORT`, where the certificate of the relay must be signed by one whom
/// this machine trusts; `HOST:PORT#sha256=FINGERPRINT`, where the certificate of this fingerprint
/// counts; or `http://HOST:PORT` without encryption, for a host that is this machine itself.
///
/// ```
/// use tombolo_pipelines::language::RelayAddress;
///
/// let relay: RelayAddress = "relay.example.org:7400".parse()?;
/// assert!(relay.is_encrypted() && relay.sha256().is_none());
/// assert_eq!(relay.authority(), "relay.example.org:7400");
/// assert_eq!(relay.host(), ("relay.example.org", 7400));
/// let error = "http://relay.example.org:7400".parse::<RelayAddress>().unwrap_err();
/// assert!(error.contains("a relay on another machine is reached over https"));
/// # Ok::<(), String>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RelayAddress {
    authority: String,
    is_encrypted: bool,
    sha256: Option<String>,
}

impl RelayAddress {
    /// The host and port.
    #[must_use]
    pub fn authority(&self) -> &str {
        &self.authority
    }

    /// The host as the system resolves it, without brackets, and the port.
    #[must_use]
    pub fn host(&self) -> (&str, u16) {
        let (host, port) = self.authority.rsplit_once(':').unwrap_or((&self.authority, ""));
        let host = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host);
        (host, port.parse().unwrap_or_default())
    }

    /// Whether connections to it are encrypted.
    #[must_use]
    pub fn is_encrypted(&self) -> bool {
        self.is_encrypted
    }

    /// The SHA-256 fingerprint of the relay's certificate, in lower-case hexadecimal digits, where it is
    /// known by that.
    #[must_use]
    pub fn sha256(&self) -> Option<&str> {
        self.sha256.as_deref()
    }
}

/// Whether a text names one host: by name, by an IPv4 address, or by an IPv6 address in brackets.
pub(super) fn is_host(text: &str) -> bool {
    let bracketed = text.strip_prefix('[').and_then(|text| text.strip_suffix(']'));
    let known = |c: char| c.is_ascii_alphanumeric() || "-._".contains(c);
    match bracketed {
        Some(address) => address.parse::<std::net::Ipv6Addr>().is_ok(),
        None => !text.is_empty() && text.chars().all(known),
    }
}

impl FromStr for RelayAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let shown: String = text.chars().take(100).collect();
        let wrong = |reason: &str| {
            format!(
                "found {shown:?}, expected HOST:PORT or HOST:PORT#sha256=FINGERPRINT, such as relay.example.org:7400: {reason}"
            )
        };
        if text.len() > LENGTH {
            return Err(wrong("it is too long"));
        }
        let (place, fragment) = match text.split_once('#') {
            Some((place, fragment)) => (place, Some(fragment)),
            None => (text, None),
        };
        let (is_encrypted, authority) = match place.split_once("://") {
            None => (true, place),
            Some(("https", authority)) => (true, authority),
            Some(("http", authority)) => (false, authority),
            Some(_) => return Err(wrong("it begins with neither https:// nor http://")),
        };
        let authority = authority.strip_suffix('/').unwrap_or(authority);
        let (host, port) = authority.rsplit_once(':').ok_or_else(|| wrong("it names no port"))?;
        if !port.parse::<u16>().is_ok_and(|port| port > 0) {
            return Err(wrong("its port is not a number from 1 to 65535"));
        }
        if !is_host(host) {
            return Err(wrong("it names no host"));
        }
        if !is_encrypted && !LOOPBACK.contains(&host) {
            return Err(wrong("a relay on another machine is reached over https"));
        }
        let sha256 = match fragment.map(|fragment| fragment.strip_prefix("sha256=")) {
            None => None,
            Some(Some(digits)) if is_fingerprint(digits) => Some(digits.to_ascii_lowercase()),
            Some(_) => {
                return Err(wrong("its fingerprint is not sha256= and 64 hexadecimal digits"));
            }
        };
        if sha256.is_some() && !is_encrypted {
            return Err(wrong("without encryption there is no certificate"));
        }
        Ok(Self { authority: authority.into(), is_encrypted, sha256 })
    }
}

impl fmt::Display for RelayAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scheme = if self.is_encrypted { "https" } else { "http" };
        write!(f, "{scheme}://{}", self.authority)?;
        self.sha256.iter().try_for_each(|digits| write!(f, "#sha256={digits}"))
    }
}

/// The name of a run at a relay: 1 to 48 letters, digits, `-`, `_` or `.`, of which the first is a letter
/// or digit.
///
/// ```
/// use tombolo_pipelines::language::RunName;
///
/// let name: RunName = "nozzle".parse()?;
/// assert_eq!(name.numbered(2).as_str(), "nozzle-2");
/// assert!("../etc".parse::<RunName>().is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RunName(String);

impl RunName {
    /// Characters that a name may have.
    pub const LENGTH: usize = 48;

    /// The name as a text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The name of another run that would have this one, shortened where it would be too long.
    #[must_use]
    pub fn numbered(&self, number: usize) -> Self {
        let ending = format!("-{number}");
        let kept: String = self.0.chars().take(Self::LENGTH.saturating_sub(ending.len())).collect();
        Self(kept + &ending)
    }
}

/// Gives the name `run`.
impl Default for RunName {
    fn default() -> Self {
        Self("run".into())
    }
}

impl FromStr for RunName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        let is_name = text.starts_with(|c: char| c.is_ascii_alphanumeric())
            && text.len() <= Self::LENGTH
            && text.chars().all(known);
        if !is_name {
            let shown: String = text.chars().take(Self::LENGTH).collect();
            return Err(format!(
                "found {shown:?}, expected 1 to {} letters, digits, '-', '_' or '.', of which the first is a letter or digit",
                Self::LENGTH
            ));
        }
        Ok(Self(text.into()))
    }
}

impl fmt::Display for RunName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

as_text!(RelayAddress, RunName);

/// Whether a text is the SHA-256 fingerprint of a certificate, in 64 hexadecimal digits.
#[must_use]
pub fn is_fingerprint(text: &str) -> bool {
    text.len() == 64 && text.chars().all(|c| c.is_ascii_hexdigit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_written_as_it_is_read() {
        let digits = "0a".repeat(32);
        for (text, written) in [
            ("relay.host:7400".to_owned(), "https://relay.host:7400".to_owned()),
            (
                format!("[::1]:1#sha256={}", "0A".repeat(32)),
                format!("https://[::1]:1#sha256={digits}"),
            ),
            ("http://127.0.0.1:7400/".into(), "http://127.0.0.1:7400".into()),
        ] {
            let address: RelayAddress = text.parse().expect("an address");
            assert_eq!(address.to_string(), written);
            assert_eq!(written.parse(), Ok(address));
        }
    }

    #[test]
    fn what_leads_nowhere_or_in_the_open_is_refused() {
        for wrong in [
            "",
            "relay.host",
            "relay.host:0",
            "relay.host:7400/path",
            ":7400",
            "a b:7400",
            "ftp://relay.host:7400",
            "http://relay.host:7400",
            "http://10.0.0.1:7400",
            "http://localhost.evil.example:7400",
            "relay.host:7400#sha256=12",
            "relay.host:7400#",
            "http://localhost:7400#sha256=00",
            "[x]:7400",
            "user@relay.host:7400",
        ] {
            assert!(wrong.parse::<RelayAddress>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_name_stays_a_name_however_many_want_it() {
        let longest: RunName = "a".repeat(RunName::LENGTH).parse().expect("a name");
        assert_eq!(longest.numbered(12).as_str().parse(), Ok(longest.numbered(12)));
        for wrong in ["", "-", ".hidden", "a/b", "a b", "é", &"a".repeat(49)] {
            assert!(wrong.parse::<RunName>().is_err(), "{wrong}");
        }
    }
}
