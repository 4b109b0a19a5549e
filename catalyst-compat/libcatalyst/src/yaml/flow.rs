//! The part of YAML in brackets and quotes, which goes over lines without regard to indentation.

use super::{Line, Properties, Reader, fold, plain, wrong};
use crate::error::Result;
use crate::json::Value;
use crate::node::DEEPEST;

/// Reads on from a place in a line; the lines after it are taken from the reader.
pub(super) struct Flow<'r, 'a> {
    reader: &'r mut Reader<'a>,
    number: usize,
    text: &'a str,
    at: usize,
}

impl<'r, 'a> Flow<'r, 'a> {
    pub(super) fn new(reader: &'r mut Reader<'a>, line: Line<'a>, text: &'a str) -> Self {
        Flow { reader, number: line.number, text, at: 0 }
    }

    fn rest(&self) -> &'a str {
        self.text.get(self.at..).unwrap_or_default()
    }

    fn next_line(&mut self) -> bool {
        let Some(line) = self.reader.peek() else {
            return false;
        };
        self.reader.at += 1;
        (self.number, self.text, self.at) = (line.number, line.text, 0);
        true
    }

    /// Goes over blanks, line ends and comments.
    fn skip(&mut self) {
        loop {
            let rest = self.rest();
            let blank = rest.len() - rest.trim_start().len();
            let comment = rest[blank..].starts_with('#') && (blank > 0 || self.at == 0);
            if blank == rest.len() || comment {
                if !self.next_line() {
                    self.at = self.text.len();
                    return;
                }
            } else {
                self.at += blank;
                return;
            }
        }
    }

    fn peek(&self) -> Option<u8> {
        self.rest().bytes().next()
    }

    fn take(&mut self, byte: u8) -> bool {
        let found = self.peek() == Some(byte);
        self.at += usize::from(found);
        found
    }

    /// A `:` after a name, which is part of a plain scalar where more follows at once.
    fn colon(&self, index: usize) -> bool {
        let bytes = self.text.as_bytes();
        bytes.get(index) == Some(&b':')
            && bytes
                .get(index + 1)
                .is_none_or(|next| next.is_ascii_whitespace() || b",[]{}".contains(next))
    }

    #[track_caller]
    fn expected(&self, what: &str) -> crate::error::Error {
        let found = match self.rest().chars().next() {
            Some(character) => format!("'{character}'"),
            None => "the end".to_owned(),
        };
        wrong(self.number, &format!("{what} is expected, not {found}"))
    }

    /// That nothing but a comment follows in the line.
    pub(super) fn end(&mut self) -> Result<()> {
        let rest = self.rest().trim_start();
        if rest.is_empty() || rest.starts_with('#') {
            Ok(())
        } else {
            Err(self.expected("the end of the line"))
        }
    }

    pub(super) fn value(&mut self) -> Result<Value> {
        self.skip();
        self.reader.depth += 1;
        if self.reader.depth > DEEPEST {
            return Err(wrong(self.number, "nested too deeply"));
        }
        let value = match self.peek() {
            Some(b'{') => self.object()?,
            Some(b'[') => self.list()?,
            Some(b'"' | b'\'') => Value::Text(self.quoted()?),
            Some(b'*') => {
                let name = self.word();
                self.reader.alias(self.number, &name[1..])?
            }
            Some(b'&' | b'!') => {
                let Properties { anchor, .. } = Properties::split(self.word());
                let value = self.value()?;
                if let Some(anchor) = anchor {
                    self.reader.anchors.insert(anchor, value.clone());
                }
                value
            }
            _ => match self.plain() {
                text if text.is_empty() => return Err(self.expected("a value")),
                text => plain(&text),
            },
        };
        self.reader.depth -= 1;
        Ok(value)
    }

    fn object(&mut self) -> Result<Value> {
        let mut entries = Vec::new();
        self.at += 1;
        loop {
            self.skip();
            if self.take(b'}') {
                return Ok(Value::Object(entries));
            }
            let name = match self.peek() {
                Some(b'"' | b'\'') => self.quoted()?,
                _ => self.plain(),
            };
            self.skip();
            let value = if self.take(b':') { self.value_or_nothing()? } else { Value::Null };
            if name.is_empty() && value == Value::Null {
                return Err(self.expected("a name"));
            }
            entries.push((name, value));
            self.skip();
            if !self.take(b',') && self.peek() != Some(b'}') {
                return Err(self.expected("',' or '}'"));
            }
        }
    }

    fn list(&mut self) -> Result<Value> {
        let mut values = Vec::new();
        self.at += 1;
        loop {
            self.skip();
            if self.take(b']') {
                return Ok(Value::List(values));
            }
            let value = self.value()?;
            self.skip();
            // A name in a sequence begins a mapping of one entry.
            values.push(match value {
                Value::Text(name) if self.take(b':') => {
                    Value::Object(vec![(name, self.value_or_nothing()?)])
                }
                value => value,
            });
            self.skip();
            if !self.take(b',') && self.peek() != Some(b']') {
                return Err(self.expected("',' or ']'"));
            }
        }
    }

    fn value_or_nothing(&mut self) -> Result<Value> {
        self.skip();
        match self.peek() {
            Some(b',' | b'}' | b']') => Ok(Value::Null),
            _ => self.value(),
        }
    }

    /// An alias, an anchor or a tag.
    fn word(&mut self) -> &'a str {
        let rest = self.rest();
        let length =
            rest.find(|character: char| character.is_whitespace() || ",[]{}".contains(character));
        let word = &rest[..length.unwrap_or(rest.len())];
        self.at += word.len();
        word
    }

    fn plain(&mut self) -> String {
        let mut whole = String::new();
        loop {
            let bytes = self.text.as_bytes();
            let stops = |index: usize| {
                let comment =
                    bytes[index] == b'#' && index > 0 && bytes[index - 1].is_ascii_whitespace();
                b",[]{}".contains(&bytes[index]) || self.colon(index) || comment
            };
            let end = (self.at..bytes.len()).find(|index| stops(*index)).unwrap_or(bytes.len());
            whole.push_str(self.text.get(self.at..end).unwrap_or_default().trim());
            self.at = end;
            if end < bytes.len() || whole.is_empty() || !self.next_line() {
                return whole;
            }
            let mut breaks = 1;
            while self.text.is_empty() && self.next_line() {
                breaks += 1;
            }
            let more = self.peek().is_some_and(|byte| !b",[]{}#".contains(&byte)) && !self.colon(0);
            if !more {
                return whole;
            }
            fold(&mut whole, breaks);
        }
    }

    /// A text in quotes. Within single quotes two stand for one; within double quotes `\` begins an escape.
    pub(super) fn quoted(&mut self) -> Result<String> {
        let quote = if self.take(b'"') { '"' } else { '\'' };
        self.at += usize::from(quote == '\'');
        let mut text = String::new();
        loop {
            let Some(character) = self.rest().chars().next() else {
                let mut breaks = 0;
                while breaks == 0 || self.text.is_empty() {
                    if !self.next_line() {
                        return Err(self.expected("the end of the quoted text"));
                    }
                    breaks += 1;
                }
                text.truncate(text.trim_end_matches(' ').len());
                fold(&mut text, breaks);
                continue;
            };
            self.at += character.len_utf8();
            match character {
                '\'' if quote == '\'' && self.take(b'\'') => text.push('\''),
                '\\' if quote == '"' && self.rest().is_empty() => {
                    // The line end after it is left out.
                    if !self.next_line() {
                        return Err(self.expected("the end of the quoted text"));
                    }
                }
                '\\' if quote == '"' => text.push(self.escaped()?),
                _ if character == quote => return Ok(text),
                _ => text.push(character),
            }
        }
    }

    fn escaped(&mut self) -> Result<char> {
        let character = self.rest().chars().next().unwrap_or('"');
        self.at += character.len_utf8();
        Ok(match character {
            'n' => '\n',
            't' | '\t' => '\t',
            'r' => '\r',
            'b' => '\u{8}',
            'f' => '\u{c}',
            'a' => '\u{7}',
            'v' => '\u{b}',
            'e' => '\u{1b}',
            '0' => '\0',
            'N' => '\u{85}',
            '_' => '\u{a0}',
            'x' => self.code(2)?,
            'u' => self.code(4)?,
            'U' => self.code(8)?,
            '"' | '\\' | '/' | ' ' => character,
            _ => return Err(wrong(self.number, &format!("'\\{character}' is no escape"))),
        })
    }

    /// A character by its number of so many digits; one above 16 bits may be two numbers, as in JSON.
    fn code(&mut self, digits: usize) -> Result<char> {
        let Some(high) =
            self.rest().get(..digits).and_then(|code| u32::from_str_radix(code, 16).ok())
        else {
            return Err(self.expected(&format!("{digits} hexadecimal digits")));
        };
        self.at += digits;
        let code = match high {
            0xd800..0xdc00 if self.rest().starts_with("\\u") => {
                let low = self.rest().get(2..6).and_then(|code| u32::from_str_radix(code, 16).ok());
                self.at += if low.is_some() { 6 } else { 0 };
                low.map_or(high, |low| {
                    0x10000 + ((high - 0xd800) << 10) + (low.wrapping_sub(0xdc00) & 0x3ff)
                })
            }
            _ => high,
        };
        Ok(char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER))
    }
}
