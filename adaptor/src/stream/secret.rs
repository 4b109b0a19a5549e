//! A text that lets in whoever shows it.

use std::fmt;

/// The least and the most characters of a secret that is given.
const LENGTHS: std::ops::RangeInclusive<usize> = 16..=128;

/// A secret: 128 random bits as 32 hexadecimal digits, or one that was given.
#[derive(Clone)]
pub(super) struct Secret(String);

impl Secret {
    /// A fresh secret from the operating system's random numbers.
    pub(super) fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = [0u8; 16];
        getrandom::fill(&mut bytes)?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// A secret that was given; `None` where it is too short, too long, or has characters that mean
    /// something in a link.
    pub(super) fn given(text: &str) -> Option<Self> {
        let known = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        (LENGTHS.contains(&text.len()) && text.chars().all(known)).then(|| Self(text.to_owned()))
    }

    pub(super) fn as_str(&self) -> &str {
        &self.0
    }

    /// Whether `shown` is this secret, in a time that does not tell how much of it is right.
    pub(super) fn matches(&self, shown: &str) -> bool {
        let (own, shown) = (self.0.as_bytes(), shown.as_bytes());
        let difference = own
            .iter()
            .zip(shown.iter().chain(std::iter::repeat(&0)))
            .fold(0u8, |difference, (a, b)| std::hint::black_box(difference | (a ^ b)));
        difference == 0 && own.len() == shown.len()
    }
}

/// A secret is never printed by accident.
impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(..)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_whole_secret_matches() {
        let secret = Secret::random().expect("random numbers");
        assert_eq!(secret.as_str().len(), 32);
        assert!(secret.matches(secret.as_str()));
        assert!(!secret.matches(""));
        assert!(!secret.matches(&secret.as_str()[..31]));
        assert!(!secret.matches(&format!("{}0", secret.as_str())));
        assert!(!secret.matches(Secret::random().expect("random numbers").as_str()));
        assert!(!format!("{secret:?}").contains(secret.as_str()));
    }

    #[test]
    fn what_could_be_guessed_or_breaks_a_link_is_no_secret() {
        assert!(Secret::given("0123456789abcdef").is_some());
        for text in ["", "short", "0123456789abcdef&", "0123456789 abcdef", &"a".repeat(129)] {
            assert!(Secret::given(text).is_none(), "{text}");
        }
    }
}
