//! JSON as people write it by hand: names without quotes, comments, and a comma too many are understood.

use crate::error::{Error, Result};
use crate::node::DEEPEST;

/// A value that was read from JSON or YAML.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Nothing.
    Null,
    /// True or false.
    Boolean(bool),
    /// An integer of 64 bits.
    Integer(i64),
    /// An integer that needs the 64th bit for its value.
    Unsigned(u64),
    /// Any other number.
    Real(f64),
    /// A text.
    Text(String),
    /// Values in order.
    List(Vec<Value>),
    /// Values with names, in order.
    Object(Vec<(String, Value)>),
}

impl Value {
    /// The value of a name in an object.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Value> {
        match self {
            Value::Object(entries) => {
                entries.iter().find(|(key, _)| key == name).map(|(_, value)| value)
            }
            _ => None,
        }
    }

    /// The integer.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "only whole numbers well inside the range are converted"
    )]
    pub fn integer(&self) -> Option<i64> {
        match self {
            Value::Integer(value) => Some(*value),
            Value::Real(value) if value.fract() == 0.0 && value.abs() < 9e15 => Some(*value as i64),
            Value::Boolean(value) => Some((*value).into()),
            _ => None,
        }
    }

    /// The number.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "the nearest is what is asked for")]
    pub fn real(&self) -> Option<f64> {
        match self {
            Value::Integer(value) => Some(*value as f64),
            Value::Unsigned(value) => Some(*value as f64),
            Value::Real(value) => Some(*value),
            Value::Boolean(value) => Some(f64::from(u8::from(*value))),
            Value::Text(text) => special(text),
            _ => None,
        }
    }
}

/// The numbers that JSON has no words for, as they are written here.
fn special(text: &str) -> Option<f64> {
    Some(match text {
        "nan" | "-nan" | "NaN" | ".nan" => f64::NAN,
        "inf" | "Infinity" | ".inf" => f64::INFINITY,
        "-inf" | "-Infinity" | "-.inf" => f64::NEG_INFINITY,
        _ => return None,
    })
}

/// The number that a word spells, if it spells one.
#[must_use]
pub fn number(word: &str) -> Option<Value> {
    let digits = word.strip_prefix(['-', '+']).unwrap_or(word);
    let first = digits.as_bytes().first()?;
    let second = digits.as_bytes().get(1).copied().unwrap_or(b' ');
    if !(first.is_ascii_digit() || (*first == b'.' && second.is_ascii_digit())) {
        return None;
    }
    let plain = word.strip_prefix('+').unwrap_or(word);
    if digits.bytes().all(|byte| byte.is_ascii_digit()) {
        if let Ok(value) = plain.parse() {
            return Some(Value::Integer(value));
        }
        if let Ok(value) = plain.parse() {
            return Some(Value::Unsigned(value));
        }
    }
    if digits
        .bytes()
        .all(|byte| byte.is_ascii_digit() || matches!(byte, b'.' | b'e' | b'E' | b'+' | b'-'))
    {
        return plain.parse().ok().map(Value::Real);
    }
    None
}

/// Reads a text.
///
/// # Errors
/// It is no JSON; the message has the line and the column.
pub fn parse(text: &str) -> Result<Value> {
    let mut reader = Reader { bytes: text.as_bytes(), at: 0, depth: 0 };
    let value = reader.value()?;
    reader.skip()?;
    if reader.at < reader.bytes.len() {
        return Err(reader.wrong("the end"));
    }
    Ok(value)
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    depth: usize,
}

impl Reader<'_> {
    #[track_caller]
    fn wrong(&self, expected: &str) -> Error {
        let before = self.bytes.get(..self.at).unwrap_or_default();
        let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
        let column = before.iter().rev().take_while(|byte| **byte != b'\n').count() + 1;
        let found = match self.bytes.get(self.at) {
            Some(byte) if byte.is_ascii_graphic() => format!("'{}'", char::from(*byte)),
            Some(byte) => format!("byte {byte}"),
            None => "the end".to_owned(),
        };
        Error::new(format!(
            "JSON, line {line}, column {column}: {expected} is expected, not {found}"
        ))
    }

    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn skip(&mut self) -> Result<()> {
        loop {
            let rest = self.bytes.get(self.at..).unwrap_or_default();
            match rest {
                [byte, ..] if byte.is_ascii_whitespace() => self.at += 1,
                [b'#', ..] | [b'/', b'/', ..] => {
                    self.at += rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
                }
                [b'/', b'*', ..] => match rest.windows(2).position(|pair| pair == b"*/") {
                    Some(end) => self.at += end + 2,
                    None => return Err(self.wrong("the end of the comment")),
                },
                _ => return Ok(()),
            }
        }
    }

    fn take(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    fn value(&mut self) -> Result<Value> {
        self.skip()?;
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(Error::new(format!("JSON nested deeper than {DEEPEST} levels")));
        }
        let value = match self.peek() {
            Some(b'{') => self.object()?,
            Some(b'[') => self.list()?,
            Some(b'"' | b'\'') => Value::Text(self.quoted()?),
            Some(_) => {
                let word = self.word();
                match word.as_str() {
                    "" => return Err(self.wrong("a value")),
                    "null" => Value::Null,
                    "true" => Value::Boolean(true),
                    "false" => Value::Boolean(false),
                    _ => number(&word).unwrap_or(Value::Text(word)),
                }
            }
            None => return Err(self.wrong("a value")),
        };
        self.depth -= 1;
        Ok(value)
    }

    fn object(&mut self) -> Result<Value> {
        let mut entries = Vec::new();
        self.at += 1;
        loop {
            self.skip()?;
            if self.take(b'}') {
                return Ok(Value::Object(entries));
            }
            let name = match self.peek() {
                Some(b'"' | b'\'') => self.quoted()?,
                _ => self.word(),
            };
            self.skip()?;
            if !self.take(b':') {
                return Err(self.wrong(if name.is_empty() { "a name" } else { "':'" }));
            }
            entries.push((name, self.value()?));
            self.skip()?;
            if !self.take(b',') && self.peek() != Some(b'}') {
                return Err(self.wrong("',' or '}'"));
            }
        }
    }

    fn list(&mut self) -> Result<Value> {
        let mut values = Vec::new();
        self.at += 1;
        loop {
            self.skip()?;
            if self.take(b']') {
                return Ok(Value::List(values));
            }
            values.push(self.value()?);
            self.skip()?;
            if !self.take(b',') && self.peek() != Some(b']') {
                return Err(self.wrong("',' or ']'"));
            }
        }
    }

    fn word(&mut self) -> String {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let ends = |byte: &u8| byte.is_ascii_whitespace() || b",:{}[]\"'#".contains(byte);
        let length = rest.iter().position(ends).unwrap_or(rest.len());
        self.at += length;
        String::from_utf8_lossy(rest.get(..length).unwrap_or_default()).into_owned()
    }

    fn quoted(&mut self) -> Result<String> {
        let quote = self.peek();
        self.at += 1;
        let mut text = Vec::new();
        loop {
            let Some(byte) = self.peek() else {
                return Err(self.wrong("the end of the text"));
            };
            self.at += 1;
            match byte {
                // As in YAML, two single quotes stand for one.
                b'\'' if quote == Some(b'\'') && self.take(b'\'') => text.push(b'\''),
                _ if Some(byte) == quote => return Ok(String::from_utf8_lossy(&text).into_owned()),
                b'\\' => {
                    let character = self.escaped()?;
                    text.extend_from_slice(character.encode_utf8(&mut [0; 4]).as_bytes());
                }
                _ => text.push(byte),
            }
        }
    }

    fn escaped(&mut self) -> Result<char> {
        let Some(byte) = self.peek() else {
            return Err(self.wrong("the end of the text"));
        };
        self.at += 1;
        Ok(match byte {
            b'n' => '\n',
            b't' => '\t',
            b'r' => '\r',
            b'b' => '\u{8}',
            b'f' => '\u{c}',
            b'u' => {
                let high = self.hexadecimal()?;
                let pair = (0xd800..0xdc00).contains(&high)
                    && self.bytes.get(self.at..self.at + 2) == Some(b"\\u");
                let code = if pair {
                    self.at += 2;
                    let low = self.hexadecimal()?;
                    0x10000 + ((high - 0xd800) << 10) + (low.wrapping_sub(0xdc00) & 0x3ff)
                } else {
                    high
                };
                char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER)
            }
            b'"' | b'\'' | b'\\' | b'/' => char::from(byte),
            _ => return Err(self.wrong("an escape")),
        })
    }

    fn hexadecimal(&mut self) -> Result<u32> {
        let digits = self
            .bytes
            .get(self.at..self.at + 4)
            .and_then(|digits| std::str::from_utf8(digits).ok());
        let Some(code) = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok()) else {
            return Err(self.wrong("four hexadecimal digits"));
        };
        self.at += 4;
        Ok(code)
    }
}

/// A text in quotes, as JSON wants it.
#[must_use]
pub fn quote(text: &str) -> String {
    use std::fmt::Write;
    let mut quoted = String::with_capacity(text.len() + 2);
    quoted.push('"');
    for character in text.chars() {
        match character {
            '"' => quoted.push_str("\\\""),
            '\\' => quoted.push_str("\\\\"),
            '\n' => quoted.push_str("\\n"),
            '\t' => quoted.push_str("\\t"),
            '\r' => quoted.push_str("\\r"),
            '\u{8}' => quoted.push_str("\\b"),
            '\u{c}' => quoted.push_str("\\f"),
            control if u32::from(control) < 0x20 => {
                // Writing to a string cannot fail.
                let _ = write!(quoted, "\\u{:04x}", u32::from(control));
            }
            other => quoted.push(other),
        }
    }
    quoted.push('"');
    quoted
}
