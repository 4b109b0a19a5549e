//! Walks over a file's bytes: words, lines and blocks, never beyond the end.

use super::error::{Flaw, Position, Problem};

/// A position in a file, whose text and binary parts may alternate.
#[derive(Clone)]
pub(super) struct Scanner<'a> {
    bytes: &'a [u8],
    position: usize,
    /// Whether errors name bytes rather than lines.
    pub binary: bool,
}

impl<'a> Scanner<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, position: 0, binary: false }
    }

    /// The bytes that have not been read yet.
    pub fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.position..).unwrap_or(&[])
    }

    pub fn position(&self) -> usize {
        self.position
    }

    /// This problem, here.
    pub fn flaw(&self, problem: impl Into<Problem>) -> Flaw {
        self.flaw_at(self.position, problem)
    }

    /// This problem, there.
    pub fn flaw_at(&self, position: usize, problem: impl Into<Problem>) -> Flaw {
        let position = if self.binary {
            Position::Byte(position)
        } else {
            let before = self.bytes.get(..position).unwrap_or(self.bytes);
            Position::Line(1 + before.iter().filter(|&&byte| byte == b'\n').count())
        };
        Flaw { position, problem: problem.into() }
    }

    pub fn skip_spaces(&mut self) {
        self.position += self.rest().iter().take_while(|byte| byte.is_ascii_whitespace()).count();
    }

    /// The next word; empty at the end of the file.
    pub fn word(&mut self) -> &'a [u8] {
        self.skip_spaces();
        let rest = self.rest();
        let length = rest.iter().take_while(|byte| !byte.is_ascii_whitespace()).count();
        self.position += length;
        rest.get(..length).unwrap_or(&[])
    }

    /// The next word, which is left where it is.
    pub fn peek_word(&self) -> &'a [u8] {
        self.clone().word()
    }

    /// The next word as a string.
    pub fn text(&mut self, expected: &str) -> Result<&'a str, Flaw> {
        let word = self.word();
        let start = self.position - word.len();
        match std::str::from_utf8(word) {
            Ok(text) if !text.is_empty() => Ok(text),
            _ => Err(self.flaw_at(start, Problem::unexpected(word, expected))),
        }
    }

    /// The next word as a number.
    pub fn number<T: std::str::FromStr>(&mut self, expected: &str) -> Result<T, Flaw> {
        let word = self.word();
        let start = self.position - word.len();
        std::str::from_utf8(word)
            .ok()
            .and_then(|text| text.parse().ok())
            .ok_or_else(|| self.flaw_at(start, Problem::unexpected(word, expected)))
    }

    /// The rest of this line, without its end.
    pub fn line(&mut self) -> &'a [u8] {
        let rest = self.rest();
        let length = rest.iter().position(|&byte| byte == b'\n');
        self.position += length.map_or(rest.len(), |length| length + 1);
        let line = rest.get(..length.unwrap_or(rest.len())).unwrap_or(&[]);
        line.strip_suffix(b"\r").unwrap_or(line)
    }

    /// The next `count` bytes.
    pub fn take(&mut self, count: u64, what: &str) -> Result<&'a [u8], Flaw> {
        let rest = self.rest();
        let taken =
            usize::try_from(count).ok().and_then(|count| rest.get(..count)).ok_or_else(|| {
                self.flaw(Problem::Truncated {
                    what: what.to_owned(),
                    needed: count,
                    left: rest.len(),
                })
            })?;
        self.position += taken.len();
        Ok(taken)
    }

    /// A count of things that take at least `bytes_each` bytes of what is left, so that memory may
    /// be set aside for them.
    pub fn check_count(&self, count: u64, bytes_each: usize, what: &str) -> Result<usize, Flaw> {
        let left = self.rest().len();
        let needed = count.saturating_mul(bytes_each as u64);
        usize::try_from(count).ok().filter(|_| needed <= left as u64 + 1).ok_or_else(|| {
            self.flaw(Problem::Truncated { what: format!("{count} {what}"), needed, left })
        })
    }

    /// Goes behind the next line that is `marker`; whether there is one.
    pub fn skip_behind(&mut self, marker: &[u8]) -> bool {
        let rest = self.rest();
        let found = rest.windows(marker.len()).enumerate().position(|(at, window)| {
            window == marker
                && (at == 0 || rest.get(at - 1) == Some(&b'\n'))
                && rest.get(at + marker.len()).is_none_or(u8::is_ascii_whitespace)
        });
        match found {
            Some(at) => {
                self.position += at + marker.len();
                true
            }
            None => false,
        }
    }
}
