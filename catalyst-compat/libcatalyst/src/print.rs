//! Trees as text: JSON, JSON with layouts, and YAML.

use std::fmt::Write;

use crate::datatype::Kind;
use crate::json::quote;
use crate::leaf::{Number, endianness_name};
use crate::node::Node;

/// How a tree is laid out as text.
#[derive(Debug, Clone, PartialEq)]
pub struct Style {
    /// How many pads a level is indented by.
    pub indent: usize,
    /// The level to begin with.
    pub depth: usize,
    /// What indents.
    pub pad: String,
    /// What ends an entry.
    pub end: String,
    /// Of more children than this the middle is left out.
    pub children: usize,
    /// Of more elements than this the middle is left out.
    pub elements: usize,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            indent: 2,
            depth: 0,
            pad: " ".to_owned(),
            end: "\n".to_owned(),
            children: usize::MAX,
            elements: usize::MAX,
        }
    }
}

impl Style {
    /// The style of summaries, which leave out the middle of what is long.
    #[must_use]
    pub fn summary() -> Self {
        Self { children: 7, elements: 5, ..Self::default() }
    }

    fn margin(&self, depth: usize) -> String {
        self.pad.repeat(self.indent.saturating_mul(depth).min(1 << 16))
    }
}

/// The text of a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// Its values.
    Values,
    /// Its type, its layout and its values.
    Everything,
    /// Its type and its layout.
    Layout,
}

/// A number as text that reads back as the same number; a floating point number always shows that it is one.
#[must_use]
pub fn number(number: Number) -> String {
    match number {
        Number::Signed(value) => value.to_string(),
        Number::Unsigned(value) => value.to_string(),
        Number::Single(value) => real(value.into(), &value.to_string(), &format!("{value:e}")),
        Number::Double(value) => real(value, &value.to_string(), &format!("{value:e}")),
    }
}

fn real(value: f64, plain: &str, scientific: &str) -> String {
    if value.is_nan() {
        return "nan".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "inf" } else { "-inf" }.to_owned();
    }
    if value != 0.0 && !(1e-5..1e16).contains(&value.abs()) {
        return match scientific.split_once('e') {
            Some((digits, exponent)) if exponent.starts_with('-') => format!("{digits}e{exponent}"),
            Some((digits, exponent)) => format!("{digits}e+{exponent}"),
            None => scientific.to_owned(),
        };
    }
    if plain.contains('.') { plain.to_owned() } else { format!("{plain}.0") }
}

impl Node {
    /// The values of a leaf; JSON has no words for numbers that are not finite, so there they are in quotes.
    fn values(&self, most: usize, json: bool) -> String {
        if let Some(text) = self.text() {
            return quote(&text);
        }
        let write = |value: Number| {
            let text = number(value);
            if json && text.ends_with(['n', 'f']) { quote(&text) } else { text }
        };
        let count = usize::try_from(self.datatype().elements).unwrap_or(0);
        if count == 1 {
            return self.number(0).map_or_else(|| "null".to_owned(), write);
        }
        let mut values: Vec<String>;
        if count > most {
            let last = i64::try_from(most / 2).unwrap_or(0);
            values = self.numbers().take(most - most / 2).map(write).collect();
            values.push("...".to_owned());
            let from = self.datatype().elements - last;
            values.extend(
                (from..self.datatype().elements).filter_map(|index| self.number(index)).map(write),
            );
        } else {
            values = self.numbers().map(write).collect();
        }
        format!("[{}]", values.join(", "))
    }

    /// The tree as JSON.
    #[must_use]
    pub fn to_json(&self, style: &Style, detail: Detail) -> String {
        let mut text = String::new();
        self.write_json(&mut text, style, style.depth, detail);
        text
    }

    fn write_json(&self, text: &mut String, style: &Style, depth: usize, detail: Detail) {
        let (open, close) = match self.kind() {
            Kind::Object => ('{', '}'),
            Kind::List => ('[', ']'),
            _ => return self.write_leaf(text, style, detail),
        };
        // Writing to a string cannot fail.
        let _ = write!(text, "{}{}{open}{}", style.end, style.margin(depth), style.end);
        for (index, (name, child)) in self.children().enumerate() {
            text.push_str(&style.margin(depth + 1));
            if self.kind() == Kind::Object {
                let _ = write!(text, "{}: ", quote(name));
            }
            child.write_json(text, style, depth + 1, detail);
            let _ =
                write!(text, "{}{}", if index + 1 < self.count() { "," } else { "" }, style.end);
        }
        let _ = write!(text, "{}{close}", style.margin(depth));
    }

    fn write_leaf(&self, text: &mut String, style: &Style, detail: Detail) {
        if detail == Detail::Values {
            let empty = self.kind() == Kind::Empty;
            text.push_str(&if empty {
                "null".to_owned()
            } else {
                self.values(style.elements, true)
            });
            return;
        }
        let datatype = self.datatype();
        let _ = write!(text, "{{\"dtype\":\"{}\"", datatype.kind.name());
        if datatype.kind.is_leaf() {
            let _ = write!(
                text,
                ",\"number_of_elements\": {},\"offset\": {},\"stride\": {},\"element_bytes\": {},\"endianness\": \"{}\"",
                datatype.elements,
                datatype.offset,
                datatype.stride,
                datatype.element_bytes,
                endianness_name(datatype.endianness)
            );
            if detail == Detail::Everything {
                let _ = write!(text, ", \"value\": {}", self.values(style.elements, true));
            }
        }
        text.push('}');
    }

    /// The tree as YAML.
    #[must_use]
    pub fn to_yaml(&self, style: &Style) -> String {
        let mut text = String::new();
        self.write_yaml(&mut text, style, style.depth);
        text
    }

    fn write_yaml(&self, text: &mut String, style: &Style, depth: usize) {
        if !matches!(self.kind(), Kind::Object | Kind::List) {
            if self.kind() != Kind::Empty {
                text.push_str(&self.values(style.elements, false));
            }
            return;
        }
        text.push_str(&style.end);
        let (first, last) = if self.count() > style.children {
            (style.children - style.children / 2, style.children / 2)
        } else {
            (self.count(), 0)
        };
        for (index, (name, child)) in self.children().enumerate() {
            if index >= first && index < self.count() - last {
                if index == first {
                    let left_out = self.count() - first - last;
                    let children = if left_out == 1 { "child" } else { "children" };
                    let _ = write!(
                        text,
                        "{}... ( skipped {left_out} {children} ){}",
                        style.margin(depth),
                        style.end
                    );
                }
                continue;
            }
            text.push_str(&style.margin(depth));
            if self.kind() == Kind::Object {
                let _ = write!(text, "{}: ", key(name));
            } else {
                text.push_str("- ");
            }
            child.write_yaml(text, style, depth + 1);
            if !matches!(child.kind(), Kind::Object | Kind::List) {
                text.push_str(&style.end);
            }
        }
    }
}

/// A name as YAML reads it back.
fn key(name: &str) -> String {
    let plain = !name.is_empty()
        && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"_-./ ()+*".contains(&byte))
        && name.starts_with(|first: char| {
            first.is_ascii_alphanumeric() || first == '_' || first == '/'
        })
        && name.trim() == name;
    if plain { name.to_owned() } else { quote(name) }
}
