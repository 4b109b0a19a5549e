//! The secret that a viewer shows to be let in.

use std::fmt;

/// The secret that viewers must show: 128 random bits as 32 hexadecimal digits, or the
/// configuration's own.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// A fresh token from the operating system's random numbers.
    ///
    /// # Errors
    /// Where the operating system has none to give.
    pub fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = [0u8; 16];
        getrandom::fill(&mut bytes)?;
        Ok(Self(bytes.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// The token that the configuration gives.
    #[must_use]
    pub fn given(text: &str) -> Self {
        Self(text.to_owned())
    }

    /// The token as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Whether `shown` is this token, in a time that does not tell how much of it is right.
    #[must_use]
    pub fn matches(&self, shown: &str) -> bool {
        let (own, shown) = (self.0.as_bytes(), shown.as_bytes());
        let difference = own
            .iter()
            .zip(shown.iter().chain(std::iter::repeat(&0)))
            .fold(0u8, |difference, (a, b)| std::hint::black_box(difference | (a ^ b)));
        difference == 0 && own.len() == shown.len()
    }
}

/// A token is never printed by accident.
impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(..)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_whole_token_matches() {
        let token = Token::random().expect("random numbers");
        assert_eq!(token.as_str().len(), 32);
        assert!(token.matches(token.as_str()));
        assert!(!token.matches(""));
        assert!(!token.matches(&token.as_str()[..31]));
        assert!(!token.matches(&format!("{}0", token.as_str())));
        assert!(!token.matches(Token::random().expect("random numbers").as_str()));
        assert!(!format!("{token:?}").contains(token.as_str()));
    }
}
