//! Reading JSON with the span of every key and value.
//!
//! serde_json tells at best where it stopped reading, which is past the token at fault, and lets a
//! key stand twice where a type does not mind. This reader keeps the span of each key and value, so
//! that an error of meaning can point at its token.

use std::collections::HashSet;
use std::ops::Range;

use serde_json::Number;

use crate::limits::{DEPTH, Exceeded, TEXT, VALUES};

/// Keys of an object up to which a new one is compared with each.
const FEW: usize = 16;

/// A value and where it stands, in bytes.
#[derive(Debug, Clone)]
pub(super) struct Node {
    pub(super) span: Range<usize>,
    pub(super) value: Value,
}

/// A value of JSON.
#[derive(Debug, Clone)]
pub(super) enum Value {
    Null,
    Boolean(bool),
    Number(Number),
    String(String),
    Array(Vec<Node>),
    Object(Vec<Member>),
}

/// A member of an object.
#[derive(Debug, Clone)]
pub(super) struct Member {
    pub(super) key: String,
    pub(super) key_span: Range<usize>,
    pub(super) node: Node,
}

impl Node {
    /// The member of an object that has this key.
    pub(super) fn member(&self, key: &str) -> Option<&Member> {
        match &self.value {
            Value::Object(members) => members.iter().find(|member| member.key == key),
            _ => None,
        }
    }

    /// The members of an object; none of anything else.
    pub(super) fn members(&self) -> &[Member] {
        match &self.value {
            Value::Object(members) => members,
            _ => &[],
        }
    }

    /// The item of an array with this index.
    pub(super) fn item(&self, index: usize) -> Option<&Node> {
        match &self.value {
            Value::Array(items) => items.get(index),
            _ => None,
        }
    }
}

/// An error where the text is not JSON.
#[derive(Debug)]
pub(super) struct SyntaxError {
    pub(super) at: usize,
    pub(super) path: String,
    pub(super) message: String,
}

/// Reads one JSON value that fills the text.
pub(super) fn scan(text: &str) -> Result<Node, SyntaxError> {
    let mut scanner = Scanner { text, at: 0, values: 0, way: Vec::new() };
    scanner.skip_space();
    let node = scanner.value()?;
    scanner.skip_space();
    if scanner.at < text.len() {
        return Err(scanner.error(format!("found {} after the end of the value", scanner.found())));
    }
    Ok(node)
}

struct Scanner<'a> {
    text: &'a str,
    at: usize,
    /// How many values have been begun.
    values: usize,
    /// The way to the value at hand.
    way: Vec<Step>,
}

/// A step of the way: an item's index, or where a member's key stands.
enum Step {
    Item(usize),
    Member(Range<usize>),
}

impl Scanner<'_> {
    fn peek(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    fn skip_space(&mut self) {
        while matches!(self.peek(), Some(b' ' | b'\t' | b'\n' | b'\r')) {
            self.at += 1;
        }
    }

    /// The next character of the text, in words.
    fn found(&self) -> String {
        match self.text.get(self.at..).and_then(|rest| rest.chars().next()) {
            None => "the end of the text".into(),
            Some('\'') => "a single quote (strings stand in double quotes)".into(),
            Some('/' | '#') => "a comment (JSON has none)".into(),
            Some(other) => format!("{other:?}"),
        }
    }

    fn error(&self, message: String) -> SyntaxError {
        self.error_at(self.at, message)
    }

    fn error_at(&self, at: usize, message: String) -> SyntaxError {
        SyntaxError { at, path: self.path(), message }
    }

    fn exceeded(&self, exceeded: Exceeded) -> SyntaxError {
        self.error(exceeded.to_string())
    }

    /// The way in words.
    fn path(&self) -> String {
        let mut path = String::new();
        for step in &self.way {
            match step {
                Step::Item(index) => path.push_str(&format!("[{index}]")),
                Step::Member(key) => {
                    if !path.is_empty() {
                        path.push('.');
                    }
                    let quoted = self.text.get(key.clone()).unwrap_or_default();
                    path.push_str(&serde_json::from_str::<String>(quoted).unwrap_or_default());
                }
            }
        }
        path
    }

    fn expect(&mut self, byte: u8, expected: &str) -> Result<(), SyntaxError> {
        if self.peek() == Some(byte) {
            self.at += 1;
            return Ok(());
        }
        Err(self.error(format!("found {}, expected {expected}", self.found())))
    }

    fn value(&mut self) -> Result<Node, SyntaxError> {
        self.values += 1;
        VALUES.check(self.values).map_err(|exceeded| self.exceeded(exceeded))?;
        let start = self.at;
        let value = match self.peek() {
            Some(b'{') => self.object()?,
            Some(b'[') => self.array()?,
            Some(b'"') => Value::String(self.string()?),
            Some(b'-' | b'0'..=b'9') => self.number()?,
            Some(b'a'..=b'z' | b'A'..=b'Z') => self.word()?,
            _ => return Err(self.error(format!("found {}, expected a value", self.found()))),
        };
        Ok(Node { span: start..self.at, value })
    }

    fn word(&mut self) -> Result<Value, SyntaxError> {
        let rest = &self.text[self.at..];
        let end = rest.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(rest.len());
        let word = &rest[..end];
        let known = match word {
            "true" => Some(Value::Boolean(true)),
            "false" => Some(Value::Boolean(false)),
            "null" => Some(Value::Null),
            _ => None,
        };
        if let Some(value) = known {
            self.at += end;
            return Ok(value);
        }
        let shown: String = word.chars().take(40).collect();
        let message = match word.to_ascii_lowercase().as_str() {
            "nan" | "infinity" | "inf" => format!("found {shown}, expected a finite number"),
            "true" | "false" | "null" => {
                format!("found {shown}, expected {}", word.to_ascii_lowercase())
            }
            _ => format!("found {shown}, expected a value (a string stands in double quotes)"),
        };
        Err(self.error(message))
    }

    fn number(&mut self) -> Result<Value, SyntaxError> {
        let rest = &self.text[self.at..];
        let is_part = |c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | 'e' | 'E');
        let token = &rest[..rest.find(|c| !is_part(c)).unwrap_or(rest.len())];
        let failure = match serde_json::from_str(token) {
            Ok(number) => {
                self.at += token.len();
                return Ok(Value::Number(number));
            }
            Err(failure) => failure,
        };
        if token.parse::<f64>().is_ok_and(f64::is_infinite) {
            let shown: String = token.chars().take(40).collect();
            return Err(self.error(format!("{shown} is beyond the range of double precision")));
        }
        let digits = token.strip_prefix('-').unwrap_or(token).as_bytes();
        if let [b'0', b'0'..=b'9', ..] = digits {
            return Err(self.error("found a number that starts with 0".into()));
        }
        self.at += if failure.is_eof() { token.len() } else { failure.column().saturating_sub(1) };
        if token == "-" && self.text[self.at..].starts_with(['I', 'i']) {
            return Err(self.error("found an infinity, expected a finite number".into()));
        }
        Err(self.error(format!("found {}, expected a digit", self.found())))
    }

    /// The text between the quotes, its escapes resolved.
    fn string(&mut self) -> Result<String, SyntaxError> {
        let start = self.at;
        let mut is_plain = true;
        self.at += 1;
        loop {
            match self.peek() {
                None => {
                    self.at = start;
                    return Err(self.error(
                        "found a string that does not end, expected a closing '\"'".into(),
                    ));
                }
                Some(b'"') => break,
                Some(b'\\') => {
                    // The byte after may be the first of several; the others are skipped one by one
                    // as any are.
                    self.at += 2;
                    is_plain = false;
                }
                Some(0..=0x1f) => {
                    return Err(self.error(format!(
                        "found {} in a string, expected its escape",
                        self.found()
                    )));
                }
                Some(_) => self.at += 1,
            }
        }
        self.at += 1;
        let inside = &self.text[start + 1..self.at - 1];
        TEXT.check(inside.len()).map_err(|exceeded| self.error_at(start, exceeded.to_string()))?;
        if is_plain {
            return Ok(inside.to_owned());
        }
        serde_json::from_str(&self.text[start..self.at]).map_err(|_| {
            self.error_at(start, "found a string with an escape that JSON does not know".into())
        })
    }

    /// Goes into an array or object.
    fn enter(&mut self, step: Step) -> Result<(), SyntaxError> {
        DEPTH.check(self.way.len() + 1).map_err(|exceeded| self.exceeded(exceeded))?;
        self.at += 1;
        self.way.push(step);
        self.skip_space();
        Ok(())
    }

    /// Leaves an array or object, whose value this is.
    fn leave(&mut self, value: Value) -> Value {
        self.at += 1;
        self.way.pop();
        value
    }

    fn array(&mut self) -> Result<Value, SyntaxError> {
        let mut items = Vec::new();
        self.enter(Step::Item(0))?;
        if self.peek() == Some(b']') {
            return Ok(self.leave(Value::Array(items)));
        }
        loop {
            self.skip_space();
            if self.peek() == Some(b']') {
                self.way.pop();
                return Err(self.error("found ']' after a comma, expected a value".into()));
            }
            items.push(self.value()?);
            self.skip_space();
            match self.peek() {
                Some(b',') => self.at += 1,
                Some(b']') => return Ok(self.leave(Value::Array(items))),
                _ => {
                    self.way.pop();
                    return Err(self.error(format!("found {}, expected ',' or ']'", self.found())));
                }
            }
            if let Some(step) = self.way.last_mut() {
                *step = Step::Item(items.len());
            }
        }
    }

    fn object(&mut self) -> Result<Value, SyntaxError> {
        let mut members: Vec<Member> = Vec::new();
        let mut keys: HashSet<String> = HashSet::new();
        self.enter(Step::Member(0..0))?;
        if self.peek() == Some(b'}') {
            return Ok(self.leave(Value::Object(members)));
        }
        loop {
            let (key, key_span) = self.outside(|scanner| {
                scanner.skip_space();
                if scanner.peek() != Some(b'"') {
                    return Err(scanner.error(format!(
                        "found {}, expected a key in double quotes",
                        scanner.found()
                    )));
                }
                let start = scanner.at;
                let key = scanner.string()?;
                let end = scanner.at;
                if members.len() == FEW {
                    keys.extend(members.iter().map(|member| member.key.clone()));
                }
                let is_known = match members.len() {
                    0..FEW => members.iter().any(|member| member.key == key),
                    _ => !keys.insert(key.clone()),
                };
                if is_known {
                    return Err(scanner.error_at(start, format!("found the key `{key}` twice")));
                }
                scanner.skip_space();
                scanner.expect(b':', "':'")?;
                scanner.skip_space();
                Ok((key, start..end))
            })?;
            if let Some(step) = self.way.last_mut() {
                *step = Step::Member(key_span.clone());
            }
            let node = self.value()?;
            members.push(Member { key, key_span, node });
            self.skip_space();
            match self.peek() {
                Some(b',') => self.at += 1,
                Some(b'}') => return Ok(self.leave(Value::Object(members))),
                _ => {
                    self.way.pop();
                    return Err(self.error(format!("found {}, expected ',' or '}}'", self.found())));
                }
            }
        }
    }

    /// Reads what belongs to an object itself: what is wrong there is wrong with the object.
    fn outside<T>(
        &mut self,
        read: impl FnOnce(&mut Self) -> Result<T, SyntaxError>,
    ) -> Result<T, SyntaxError> {
        let step = self.way.pop();
        let done = read(self)?;
        self.way.extend(step);
        Ok(done)
    }
}
