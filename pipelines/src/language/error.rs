//! Errors that point at their token.

use serde_path_to_error::Segment;

use super::nearest;
use super::scan::{Node, Value};

/// An error in a JSON text, with its position.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{file}:{line}:{column}: {}{message}{}", prefix(path), hint(suggestion.as_deref()))]
pub struct LanguageError {
    /// The file, as the caller named it.
    pub file: String,
    /// The line of the token at fault, from 1.
    pub line: usize,
    /// The column of its first character, from 1.
    pub column: usize,
    /// The path from the outermost value to it, as in `pipelines[1].stages[0].slice.normal`; empty
    /// for the outermost.
    pub path: String,
    /// The thing found, and the thing expected.
    pub message: String,
    /// The known name that is nearest to a misspelt one.
    pub suggestion: Option<String>,
}

fn prefix(path: &str) -> String {
    if path.is_empty() { String::new() } else { format!("{path}: ") }
}

fn hint(suggestion: Option<&str>) -> String {
    suggestion.map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}

/// One step of the path to a value.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Step {
    Key(String),
    Index(usize),
}

/// A well-formed value that means nothing, found after parsing. The path to it is built
/// from the inside outwards.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// From the innermost step to the outermost.
    path: Vec<Step>,
    message: String,
    suggestion: Option<String>,
}

impl Problem {
    /// A problem of the value at hand.
    pub fn new(message: impl Into<String>) -> Self {
        Self { path: Vec::new(), message: message.into(), suggestion: None }
    }

    /// Adds the name that was likely meant.
    #[must_use]
    pub fn suggest(self, suggestion: Option<&str>) -> Self {
        Self { suggestion: suggestion.map(str::to_owned), ..self }
    }

    /// Puts the problem below `key` of an object.
    #[must_use]
    pub fn within(mut self, key: &str) -> Self {
        self.path.push(Step::Key(key.to_owned()));
        self
    }

    /// Puts the problem below `index` of an array.
    #[must_use]
    pub fn at(mut self, index: usize) -> Self {
        self.path.push(Step::Index(index));
        self
    }

    /// Puts the problem below a path in an object, such as `region.box.lower[0]`.
    #[must_use]
    pub fn within_path(mut self, path: &str) -> Self {
        for part in path.rsplit('.') {
            let (key, indices) = part.split_once('[').unwrap_or((part, ""));
            for index in
                indices.rsplit('[').filter_map(|index| index.trim_end_matches(']').parse().ok())
            {
                self.path.push(Step::Index(index));
            }
            self.path.push(Step::Key(key.to_owned()));
        }
        self
    }

    /// Puts words before its message.
    pub(super) fn after(mut self, words: &str) -> Self {
        self.message.insert_str(0, words);
        self
    }

    pub(super) fn locate(self, root: &Node, text: &str, file: &str) -> LanguageError {
        let steps: Vec<Step> = self.path.into_iter().rev().collect();
        let (node, _) = walk(root, &steps);
        error(text, file, node.span.start, show(&steps), self.message, self.suggestion)
    }
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let steps: Vec<Step> = self.path.iter().rev().cloned().collect();
        write!(f, "{}{}{}", prefix(&show(&steps)), self.message, hint(self.suggestion.as_deref()))
    }
}

impl std::error::Error for Problem {}

/// Refuses NaN and infinities.
pub(super) fn finite(value: f64) -> Result<(), Problem> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(Problem::new(format!("found {value}, expected a finite number")))
    }
}

/// The deepest node on a path, and where the key of the last step stands.
fn walk<'a>(root: &'a Node, steps: &[Step]) -> (&'a Node, Option<usize>) {
    let (mut node, mut key) = (root, None);
    for step in steps {
        match step {
            Step::Key(name) => {
                let Some(member) = node.member(name) else { return (node, None) };
                (node, key) = (&member.node, Some(member.key_span.start));
            }
            Step::Index(index) => {
                let Some(item) = node.item(*index) else { return (node, None) };
                (node, key) = (item, None);
            }
        }
    }
    (node, key)
}

fn show(steps: &[Step]) -> String {
    let mut path = String::new();
    for step in steps {
        match step {
            Step::Index(index) => path.push_str(&format!("[{index}]")),
            Step::Key(key) if path.is_empty() => path.push_str(key),
            Step::Key(key) => {
                path.push('.');
                path.push_str(key);
            }
        }
    }
    path
}

/// An error at a byte of the text.
pub(super) fn error(
    text: &str,
    file: &str,
    byte: usize,
    path: String,
    message: String,
    suggestion: Option<String>,
) -> LanguageError {
    let before = text.get(..byte.min(text.len())).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    LanguageError {
        file: file.to_owned(),
        line: before.matches('\n').count() + 1,
        column: before[line_start..].chars().count() + 1,
        path,
        message,
        suggestion,
    }
}

/// Translates an error of serde, which names Rust's types, into one that names what stands in the
/// text.
pub(super) fn from_serde(
    failure: &serde_path_to_error::Error<serde_json::Error>,
    root: &Node,
    text: &str,
    file: &str,
) -> LanguageError {
    let mut steps: Vec<Step> = Vec::new();
    for segment in failure.path().iter() {
        match segment {
            Segment::Seq { index } => steps.push(Step::Index(*index)),
            Segment::Map { key } => steps.push(Step::Key(key.clone())),
            Segment::Enum { variant } => steps.push(Step::Key(variant.clone())),
            Segment::Unknown => {}
        }
    }
    let message = failure.inner().to_string();
    let (node, key) = walk(root, &steps);

    if let Some(rest) =
        message.strip_prefix("unknown field ").or_else(|| message.strip_prefix("unknown variant "))
    {
        let is_field = message.starts_with("unknown field");
        let names = backticked(rest);
        let (name, known) =
            names.split_first().map_or(("", &[][..]), |(name, known)| (*name, known));
        let suggestion = nearest(name, known.iter().copied()).map(str::to_owned);
        let expected = match known {
            [] => "no key at all".to_owned(),
            [one] => format!("`{one}`"),
            [first @ .., last] => {
                let first: Vec<String> = first.iter().map(|name| format!("`{name}`")).collect();
                format!("{} or `{last}`", first.join(", "))
            }
        };
        let mut at = key.unwrap_or(node.span.start);
        if !is_field {
            at = node.span.start;
            if let Value::Object(members) = &node.value
                && let Some(member) = members.first()
            {
                at = member.key_span.start;
                steps.push(Step::Key(member.key.clone()));
            }
        }
        let what = if is_field { "key" } else { "name" };
        let message = format!("found the unknown {what} `{name}`, expected {expected}");
        return error(text, file, at, show(&steps), message, suggestion);
    }

    let message = if let Some(rest) = message.strip_prefix("missing field ") {
        format!("the key {rest} is missing")
    } else if let Some((_, expected)) = message
        .strip_prefix("invalid type: ")
        .or(message.strip_prefix("invalid value: "))
        .and_then(split_expected)
    {
        format!("found {}, expected {}", describe(node, text), humane(expected))
    } else if let Some((length, expected)) =
        message.strip_prefix("invalid length ").and_then(split_expected)
    {
        format!("found {length} values, expected {}", humane(expected))
    } else {
        message
    };
    error(text, file, node.span.start, show(&steps), message, None)
}

fn split_expected(rest: &str) -> Option<(&str, &str)> {
    rest.rfind(", expected ").map(|at| (&rest[..at], &rest[at + ", expected ".len()..]))
}

/// The names between backticks.
fn backticked(text: &str) -> Vec<&str> {
    text.split('`').skip(1).step_by(2).collect()
}

/// A value as it stands in the text, shortened.
fn describe(node: &Node, text: &str) -> String {
    match &node.value {
        Value::Array(items) => format!("an array of {}", items.len()),
        Value::Object(_) => "an object".into(),
        _ => {
            let token = text.get(node.span.clone()).unwrap_or_default();
            match token.char_indices().nth(60) {
                Some((end, _)) => format!("{}...", &token[..end]),
                None => token.to_owned(),
            }
        }
    }
}

/// Says in the words of JSON what serde expected.
fn humane(expected: &str) -> String {
    if let Some((least, most)) = whole_number(expected) {
        return format!("a whole number from {least} to {most}");
    }
    let plain = match expected {
        "f64" | "f32" => "a number",
        "a boolean" => "true or false",
        "a string" | "a borrowed string" | "string or map" => "a string",
        "a sequence" => "an array",
        "unit" => "null",
        "struct variant" | "newtype variant" | "tuple variant" => {
            "an object with this key and its settings"
        }
        other if other.starts_with("struct ") || other == "a map" || other == "map" => "an object",
        other if other.starts_with("enum ") || other.starts_with("variant identifier") => {
            "a name, or an object with one key"
        }
        other => {
            match other.strip_prefix("an array of length ").and_then(|rest| rest.split(' ').next())
            {
                Some(length) => return format!("an array of {length} values"),
                None => other,
            }
        }
    };
    plain.to_owned()
}

/// The least and the greatest number of one of Rust's types of whole numbers.
fn whole_number(name: &str) -> Option<(i64, u64)> {
    let (nonzero, name) = name.strip_prefix("a nonzero ").map_or((0, name), |name| (1, name));
    let bits = |of: &str| match of {
        "8" => Some(8),
        "16" => Some(16),
        "32" => Some(32),
        "64" | "size" => Some(64_u32),
        _ => None,
    };
    match (name.strip_prefix('u').and_then(bits), name.strip_prefix('i').and_then(bits)) {
        (Some(bits), _) => Some((nonzero, u64::MAX >> (64 - bits))),
        (_, Some(bits)) => Some((i64::MIN >> (64 - bits), u64::MAX >> (65 - bits))),
        _ => None,
    }
}
