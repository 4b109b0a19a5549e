//! YAML: block and flow mappings and sequences, quoted and plain scalars, `|` and `>` texts, comments, anchors and aliases. Of
//! several documents the first is read. Tags are passed over, but for `!!str`. Names that are no scalars (`? `) are errors.

mod flow;

use std::collections::HashMap;

use crate::error::{Error, Result};
use crate::json::{self, Value};
use crate::node::DEEPEST;
use flow::Flow;

/// How many values the aliases of a text may stand for in all.
const MOST_ALIASED: usize = 1 << 20;

/// Reads a text.
///
/// # Errors
/// It is not the YAML that is understood; the message has the line.
pub fn parse(text: &str) -> Result<Value> {
    let mut lines: Vec<Line<'_>> =
        text.lines().enumerate().map(|(number, line)| Line::new(number + 1, line)).collect();
    let skipped = |line: &&Line<'_>| line.content().is_empty() || line.is_directive();
    let mut at = lines.iter().take_while(skipped).count();
    if let Some(first) = lines.get_mut(at).filter(|line| line.is_boundary("---")) {
        let rest = first.text[3..].trim_start();
        *first = Line { number: first.number, indent: first.text.len() - rest.len(), text: rest };
    } else {
        at = 0;
    }
    let ends = |line: &Line<'_>| line.is_boundary("---") || line.is_boundary("...");
    if let Some(end) = lines.iter().skip(at).position(ends) {
        lines.truncate(at + end);
    }
    let mut reader = Reader { lines, at, depth: 0, anchors: HashMap::new(), aliased: 0 };
    let value = reader.below(None, false)?;
    reader.skip();
    match reader.peek() {
        None => Ok(value),
        Some(line) => Err(wrong(line.number, "less indentation than the lines before")),
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

    fn is_directive(&self) -> bool {
        self.indent == 0 && self.text.starts_with('%')
    }

    /// Whether a document begins or ends here.
    fn is_boundary(&self, mark: &str) -> bool {
        let rest = self.text.strip_prefix(mark).filter(|_| self.indent == 0);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with([' ', '\t']))
    }
}

fn without_comment(text: &str) -> &str {
    let bytes = text.as_bytes();
    let mut quote = None;
    for (index, byte) in bytes.iter().enumerate() {
        match (quote, byte) {
            (None, b'#') if index == 0 || bytes[index - 1].is_ascii_whitespace() => {
                return text[..index].trim_end();
            }
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
    bytes[..index]
        .iter()
        .rev()
        .find(|byte| !byte.is_ascii_whitespace())
        .is_none_or(|byte| b":-[{,".contains(byte))
}

struct Reader<'a> {
    lines: Vec<Line<'a>>,
    at: usize,
    depth: usize,
    anchors: HashMap<&'a str, Value>,
    aliased: usize,
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

    /// A mapping, a sequence or a scalar whose lines are indented by `indent`, in a block that is indented by `parent`.
    fn block(&mut self, indent: usize, parent: Option<usize>) -> Result<Value> {
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
        } else if content.starts_with("? ") {
            Err(wrong(line.number, "names that are no scalars are not understood"))
        } else {
            self.at += 1;
            self.value(line, content, parent, false)
        };
        self.depth -= 1;
        value
    }

    fn sequence(&mut self, indent: usize) -> Result<Value> {
        let mut values = Vec::new();
        loop {
            self.skip();
            let Some(line) =
                self.peek().filter(|line| line.indent == indent && is_entry(line.content()))
            else {
                return Ok(Value::List(values));
            };
            let rest = line.text[1..].trim_start();
            if without_comment(rest).is_empty() {
                self.at += 1;
                values.push(self.below(Some(indent), false)?);
                continue;
            }
            // What follows the dash is a block of its own, indented to where it stands.
            let inner = indent + (line.text.len() - rest.len());
            self.lines[self.at] = Line { number: line.number, indent: inner, text: rest };
            let value = self.block(inner, Some(indent))?;
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
            let key = Properties::split(key).rest;
            self.at += 1;
            let name = if key.starts_with(['"', '\'']) {
                Flow::new(self, line, key).quoted()?
            } else {
                key.to_owned()
            };
            let value = self.value(line, rest, Some(indent), true)?;
            entries.push((name, value));
        }
    }

    /// The block after a line that ends in `:` or `-`; sequences may stand below their name without indentation.
    fn below(&mut self, indent: Option<usize>, named: bool) -> Result<Value> {
        self.skip();
        match self.peek() {
            Some(line) if indent.is_none_or(|indent| line.indent > indent) => {
                self.block(line.indent, indent)
            }
            Some(line) if named && Some(line.indent) == indent && is_entry(line.content()) => {
                self.sequence(line.indent)
            }
            _ => Ok(Value::Null),
        }
    }

    /// A value with what stands before it; without a text it is the block below.
    fn value(
        &mut self,
        line: Line<'a>,
        text: &'a str,
        parent: Option<usize>,
        named: bool,
    ) -> Result<Value> {
        let Properties { anchor, is_text, rest } = Properties::split(text);
        let mut value = match rest.strip_prefix('*') {
            Some(name) => self.alias(line.number, name)?,
            None if rest.is_empty() => self.below(parent, named)?,
            None => self.scalar(line, rest, parent)?,
        };
        if is_text && !matches!(value, Value::List(_) | Value::Object(_)) {
            value = match value {
                Value::Text(text) => Value::Text(text),
                _ => Value::Text(rest.to_owned()),
            };
        }
        if let Some(anchor) = anchor {
            self.anchors.insert(anchor, value.clone());
        }
        Ok(value)
    }

    /// A copy of the value of an anchor. What a text of few bytes may stand for is bounded.
    fn alias(&mut self, line: usize, name: &str) -> Result<Value> {
        let Some(value) = self.anchors.get(name) else {
            return Err(wrong(line, &format!("there is no anchor '{name}' before")));
        };
        let (count, height) = extent(value);
        self.aliased += count;
        if self.aliased > MOST_ALIASED || height + self.depth > DEEPEST {
            return Err(wrong(line, "the aliases stand for too much"));
        }
        Ok(value.clone())
    }

    fn scalar(&mut self, line: Line<'a>, text: &'a str, parent: Option<usize>) -> Result<Value> {
        match text.as_bytes().first() {
            Some(b'|' | b'>') => Ok(Value::Text(self.long_text(text, parent))),
            Some(b'[' | b'{' | b'"' | b'\'') => {
                let mut flow = Flow::new(self, line, text);
                let value = flow.value()?;
                flow.end()?;
                Ok(value)
            }
            _ if split_key(text).is_some() => Err(wrong(
                line.number,
                "a name is not expected here; a text with ': ' in it stands in quotes",
            )),
            _ => self.plain(text, parent),
        }
    }

    /// A plain scalar, which goes on in lines that are indented further than the block it is in.
    fn plain(&mut self, text: &'a str, parent: Option<usize>) -> Result<Value> {
        let mut whole = text.to_owned();
        let mut breaks = 1;
        let mut next = self.at;
        while let Some(line) = self.lines.get(next).copied() {
            if line.text.is_empty() {
                breaks += 1;
            } else if parent.is_some_and(|parent| line.indent <= parent)
                || line.text.starts_with('#')
            {
                break;
            } else if split_key(line.content()).is_some() {
                return Err(wrong(
                    line.number,
                    "a name is not expected here; is it indented too far?",
                ));
            } else {
                fold(&mut whole, breaks);
                whole.push_str(line.content());
                breaks = 1;
                self.at = next + 1;
            }
            next += 1;
        }
        Ok(plain(&whole))
    }

    /// A text of lines, after `|` or `>`, perhaps with its indentation, and `-` or `+` for the line ends at its end.
    fn long_text(&mut self, header: &str, parent: Option<usize>) -> String {
        let folded = header.starts_with('>');
        let around = parent.map_or(0, |parent| parent + 1);
        let stated = header
            .bytes()
            .find(u8::is_ascii_digit)
            .map(|digit| around.saturating_sub(1) + usize::from(digit - b'0'));
        let mut margin = stated;
        let mut lines: Vec<String> = Vec::new();
        while let Some(line) = self.peek() {
            if !line.text.is_empty() && line.indent < margin.unwrap_or(around) {
                break;
            }
            if !line.text.is_empty() {
                margin.get_or_insert(line.indent);
            }
            let inner = line.indent.saturating_sub(margin.unwrap_or(line.indent));
            lines.push(if line.text.is_empty() {
                String::new()
            } else {
                " ".repeat(inner) + line.text
            });
            self.at += 1;
        }
        let blank = lines.iter().rev().take_while(|line| line.is_empty()).count();
        lines.truncate(lines.len() - blank);
        let mut text = String::new();
        let mut breaks = 0;
        let mut kept = true;
        for line in &lines {
            // Lines that are indented further, and those next to them, are not folded.
            let further = line.starts_with(' ');
            if line.is_empty() {
                breaks += 1;
                continue;
            }
            if folded && !kept && !further && !text.is_empty() {
                fold(&mut text, breaks);
            } else {
                text.push_str(&"\n".repeat(breaks));
            }
            text.push_str(line);
            (breaks, kept) = (1, further);
        }
        if header.contains('+') {
            text.push_str(&"\n".repeat(blank + usize::from(!lines.is_empty())));
        } else if !header.contains('-') && !text.is_empty() {
            text.push('\n');
        }
        text
    }
}

/// Appends line ends as YAML folds them: one is a space, of more the first is left out.
fn fold(text: &mut String, breaks: usize) {
    if breaks == 1 {
        text.push(' ');
    } else {
        text.push_str(&"\n".repeat(breaks.saturating_sub(1)));
    }
}

/// What may stand before a value: an anchor and a tag.
struct Properties<'a> {
    anchor: Option<&'a str>,
    is_text: bool,
    rest: &'a str,
}

impl<'a> Properties<'a> {
    fn split(text: &'a str) -> Self {
        let mut properties = Properties { anchor: None, is_text: false, rest: text };
        while let Some(mark @ ('&' | '!')) = properties.rest.chars().next() {
            let (word, rest) =
                properties.rest.split_once(char::is_whitespace).unwrap_or((properties.rest, ""));
            if mark == '&' {
                properties.anchor = Some(&word[1..]);
            }
            properties.is_text |= word == "!!str";
            properties.rest = rest.trim_start();
        }
        properties
    }
}

/// How many values there are in a value, and how deep it is.
fn extent(value: &Value) -> (usize, usize) {
    let of_children = |mut children: Box<dyn Iterator<Item = &Value> + '_>| {
        let whole = children.try_fold((1_usize, 0), |(count, height), child| {
            let (more, below) = extent(child);
            (count < MOST_ALIASED).then_some((count + more, below.max(height)))
        });
        whole.map_or((MOST_ALIASED, DEEPEST), |(count, height)| (count, height + 1))
    };
    match value {
        Value::List(values) => of_children(Box::new(values.iter())),
        Value::Object(entries) => of_children(Box::new(entries.iter().map(|(_, value)| value))),
        _ => (1, 1),
    }
}

fn is_entry(text: &str) -> bool {
    text == "-" || text.starts_with("- ")
}

/// The name and the rest of `name: rest`.
fn split_key(text: &str) -> Option<(&str, &str)> {
    let bytes = text.as_bytes();
    let start = match bytes.first()? {
        quote @ (b'"' | b'\'') => closing(bytes, *quote)? + 1,
        b'[' | b'{' => return None,
        _ => 0,
    };
    let colon = (start..bytes.len()).find(|index| {
        bytes[*index] == b':' && bytes.get(index + 1).is_none_or(u8::is_ascii_whitespace)
    })?;
    if start > 0 && !text[start..colon].trim().is_empty() {
        return None;
    }
    Some((text[..colon].trim(), text[colon + 1..].trim()))
}

/// Where the quote closes that opens a text.
fn closing(bytes: &[u8], quote: u8) -> Option<usize> {
    let mut index = 1;
    while let Some(byte) = bytes.get(index) {
        match (*byte, bytes.get(index + 1)) {
            (b'\\', _) if quote == b'"' => index += 1,
            (b'\'', Some(b'\'')) if quote == b'\'' => index += 1,
            (byte, _) if byte == quote => return Some(index),
            _ => {}
        }
        index += 1;
    }
    None
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
