//! The part of YAML that configurations are written in: block and flow mappings and sequences, quoted and plain scalars, `|` and
//! `>` texts, comments. Anchors, tags and several documents in one text are errors.

use crate::error::{Error, Result};
use crate::json::{self, Value};
use crate::node::DEEPEST;

/// Reads a text.
///
/// # Errors
/// It is not the part of YAML that is understood; the message has the line.
pub fn parse(text: &str) -> Result<Value> {
    let start = text.trim_start();
    if start.starts_with(['{', '[']) {
        return json::parse(text);
    }
    let lines: Vec<Line<'_>> = text.lines().enumerate().map(|(number, line)| Line::new(number + 1, line)).collect();
    let mut reader = Reader { lines, at: 0, depth: 0 };
    reader.skip();
    if reader.peek().is_some_and(|line| line.content() == "---") {
        reader.at += 1;
        reader.skip();
    }
    let value = match reader.peek() {
        None => Value::Null,
        Some(line) => {
            let indent = line.indent;
            reader.block(indent)?
        }
    };
    reader.skip();
    match reader.peek() {
        None => Ok(value),
        Some(line) if line.content() == "..." => Ok(value),
        Some(line) => Err(wrong(line.number, "less indentation than the lines before, or another document")),
    }
}

#[track_caller]
fn wrong(line: usize, what: &str) -> Error {
    Error::new(format!("YAML, line {line}: {what}"))
}

#[derive(Clone, Copy)]
struct Line<'a> {
    number: usize,
    indent: usize,
    text: &'a str,
}

impl<'a> Line<'a> {
    fn new(number: usize, line: &'a str) -> Self {
        let text = line.trim_start_matches(' ');
        Line { number, indent: line.len() - text.len(), text: text.trim_end() }
    }

    /// The text without its comment.
    fn content(&self) -> &'a str {
        without_comment(self.text)
    }
}

fn without_comment(text: &str) -> &str {
    let bytes = text.as_bytes();
    let mut quote = None;
    for (index, byte) in bytes.iter().enumerate() {
        match (quote, byte) {
            (None, b'#') if index == 0 || bytes[index - 1].is_ascii_whitespace() => return text[..index].trim_end(),
            (None, b'"' | b'\'') if opens(bytes, index) => quote = Some(*byte),
            (Some(b'"'), b'"') if bytes[index - 1] == b'\\' => {}
            (Some(open), _) if open == *byte => quote = None,
            _ => {}
        }
    }
    text.trim_end()
}

/// Whether a quote at this place opens a quoted scalar, and is not a letter of a plain one.
fn opens(bytes: &[u8], index: usize) -> bool {
    bytes[..index].iter().rev().find(|byte| !byte.is_ascii_whitespace()).is_none_or(|byte| b":-[{,".contains(byte))
}

struct Reader<'a> {
    lines: Vec<Line<'a>>,
    at: usize,
    depth: usize,
}

impl<'a> Reader<'a> {
    fn peek(&self) -> Option<Line<'a>> {
        self.lines.get(self.at).copied()
    }

    fn skip(&mut self) {
        while self.peek().is_some_and(|line| line.content().is_empty()) {
            self.at += 1;
        }
    }

    /// A mapping, a sequence or a scalar whose lines are indented by `indent`.
    fn block(&mut self, indent: usize) -> Result<Value> {
        self.depth += 1;
        let Some(line) = self.peek() else {
            return Ok(Value::Null);
        };
        if self.depth > DEEPEST {
            return Err(wrong(line.number, "nested too deeply"));
        }
        let content = line.content();
        let value = if is_entry(content) {
            self.sequence(indent)
        } else if split_key(content).is_some() {
            self.mapping(indent)
        } else {
            self.at += 1;
            self.scalar(line, content, indent)
        };
        self.depth -= 1;
        value
    }

    fn sequence(&mut self, indent: usize) -> Result<Value> {
        let mut values = Vec::new();
        loop {
            self.skip();
            let Some(line) = self.peek().filter(|line| line.indent == indent && is_entry(line.content())) else {
                return Ok(Value::List(values));
            };
            let rest = line.text[1..].trim_start();
            if without_comment(rest).is_empty() {
                self.at += 1;
                values.push(self.below(indent, false)?);
                continue;
            }
            // What follows the dash is a block of its own, indented to where it stands.
            let inner = indent + (line.text.len() - rest.len());
            self.lines[self.at] = Line { number: line.number, indent: inner, text: rest };
            let value = self.block(inner)?;
            values.push(value);
        }
    }

    fn mapping(&mut self, indent: usize) -> Result<Value> {
        let mut entries: Vec<(String, Value)> = Vec::new();
        loop {
            self.skip();
            let Some(line) = self.peek().filter(|line| line.indent == indent) else {
                return Ok(Value::Object(entries));
            };
            let Some((key, rest)) = split_key(line.content()) else {
                return if is_entry(line.content()) && !entries.is_empty() {
                    Ok(Value::Object(entries))
                } else {
                    Err(wrong(line.number, "'name: value' is expected"))
                };
            };
            let name = match json::parse(key) {
                Ok(Value::Text(text)) if key.starts_with(['"', '\'']) => text,
                _ => key.to_owned(),
            };
            self.at += 1;
            let value = if rest.is_empty() { self.below(indent, true)? } else { self.scalar(line, rest, indent)? };
            entries.push((name, value));
        }
    }

    /// The block after a line that ends in `:` or `-`; sequences may stand below their name without indentation.
    fn below(&mut self, indent: usize, named: bool) -> Result<Value> {
        self.skip();
        match self.peek() {
            Some(line) if line.indent > indent => self.block(line.indent),
            Some(line) if named && line.indent == indent && is_entry(line.content()) => self.sequence(indent),
            _ => Ok(Value::Null),
        }
    }

    fn scalar(&mut self, line: Line<'a>, text: &str, indent: usize) -> Result<Value> {
        match text.as_bytes().first() {
            Some(b'|' | b'>') => Ok(Value::Text(self.long_text(text, indent))),
            Some(b'&' | b'*' | b'!') => Err(wrong(line.number, "anchors and tags are not understood")),
            Some(b'[' | b'{') => {
                let mut flow = text.to_owned();
                // A flow collection goes on until its brackets are closed.
                while json::parse(&flow).is_err() {
                    let Some(next) = self.peek().filter(|_| flow.len() < 1 << 26 && open_brackets(&flow) > 0) else {
                        return json::parse(&flow).map_err(|error| wrong(line.number, &error.to_string()));
                    };
                    flow.push('\n');
                    flow.push_str(next.content());
                    self.at += 1;
                }
                json::parse(&flow)
            }
            Some(b'"') => json::parse(text).map_err(|error| wrong(line.number, &error.to_string())),
            Some(b'\'') => match text[1..].strip_suffix('\'') {
                Some(inner) => Ok(Value::Text(inner.replace("''", "'"))),
                None => Err(wrong(line.number, "the quote is not closed")),
            },
            _ => Ok(plain(text)),
        }
    }

    fn long_text(&mut self, header: &str, indent: usize) -> String {
        let folded = header.starts_with('>');
        let mut lines = Vec::new();
        let mut inner = None;
        while let Some(line) = self.peek() {
            if !line.text.is_empty() && line.indent <= indent {
                break;
            }
            let margin = *inner.get_or_insert(line.indent);
            lines.push(format!("{}{}", " ".repeat(line.indent.saturating_sub(margin)), line.text));
            self.at += 1;
        }
        while lines.last().is_some_and(|line| line.trim().is_empty()) {
            lines.pop();
        }
        let mut text = lines.join(if folded { " " } else { "\n" });
        if !header.contains('-') && !text.is_empty() {
            text.push('\n');
        }
        text
    }
}

/// How many brackets are open at the end of a text, quotes aside.
fn open_brackets(text: &str) -> i64 {
    let mut open = 0;
    let mut quote = None;
    for character in text.chars() {
        match (quote, character) {
            (None, '[' | '{') => open += 1,
            (None, ']' | '}') => open -= 1,
            (None, '"' | '\'') => quote = Some(character),
            (Some(mark), _) if mark == character => quote = None,
            _ => {}
        }
    }
    open
}

fn is_entry(text: &str) -> bool {
    text == "-" || text.starts_with("- ")
}

/// The name and the rest of `name: rest`.
fn split_key(text: &str) -> Option<(&str, &str)> {
    let bytes = text.as_bytes();
    let start = match bytes.first()? {
        quote @ (b'"' | b'\'') => bytes.iter().skip(1).position(|byte| byte == quote)? + 2,
        b'[' | b'{' => return None,
        _ => 0,
    };
    let colon = (start..bytes.len())
        .find(|index| bytes[*index] == b':' && bytes.get(index + 1).is_none_or(u8::is_ascii_whitespace))?;
    Some((text[..colon].trim(), text[colon + 1..].trim()))
}

fn plain(text: &str) -> Value {
    match text {
        "" | "~" | "null" | "Null" | "NULL" => Value::Null,
        ".nan" | ".NaN" | "nan" => Value::Real(f64::NAN),
        ".inf" | "inf" => Value::Real(f64::INFINITY),
        "-.inf" | "-inf" => Value::Real(f64::NEG_INFINITY),
        _ => json::number(text).unwrap_or_else(|| Value::Text(text.to_owned())),
    }
}
