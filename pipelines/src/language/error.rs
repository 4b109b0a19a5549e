//! Errors that point at their token.

use std::collections::HashSet;
use std::hash::Hash;
use std::ops::Range;

use serde_path_to_error::Segment;

use super::nearest;
use super::scan::{Node, Value};

/// An error in a JSON text, with its position.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, thiserror::Error)]
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

/// The text before a suggested name.
const MEANT: &str = "; did you mean `";

fn hint(suggestion: Option<&str>) -> String {
    suggestion.map_or_else(String::new, |name| format!("{MEANT}{name}`?"))
}

/// One step of the path to a value.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) enum Step {
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
    /// The name of the monitor that nothing measures.
    unmeasured: Option<String>,
    /// Whether its message names the value that it is a problem of.
    names_its_value: bool,
}

impl Problem {
    /// A problem of the value at hand.
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            path: Vec::new(),
            message: message.into(),
            suggestion: None,
            unmeasured: None,
            names_its_value: false,
        }
    }

    /// Says that the problem is that nothing measures a monitor of this name.
    pub(super) fn of_unmeasured(self, name: &str) -> Self {
        Self { unmeasured: Some(name.to_owned()), ..self }
    }

    /// The name of the monitor, where the problem is that nothing measures it.
    pub(super) fn unmeasured(&self) -> Option<&str> {
        self.unmeasured.as_deref()
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

    /// The way to the stage or action of a configuration that it is a problem of.
    pub(super) fn part(&self) -> Option<Vec<Step>> {
        // A list of pipelines, which of them, a list of stages, which of them.
        let way: Vec<Step> = self.path.iter().rev().take(4).cloned().collect();
        (way.len() == 4).then_some(way)
    }

    /// Puts words before its message.
    pub(super) fn after(mut self, words: &str) -> Self {
        self.message.insert_str(0, words);
        self
    }

    /// Takes `pipelines` off the way to it, and the index behind it, which it tells.
    pub(super) fn of_pipeline(mut self) -> (Option<usize>, Self) {
        let is_pipelines = |step: &mut Step| *step == Step::Key("pipelines".into());
        if self.path.pop_if(is_pipelines).is_none() {
            return (None, self);
        }
        let index = match self.path.last() {
            Some(Step::Index(index)) => Some(*index),
            _ => None,
        };
        if index.is_some() {
            self.path.pop();
        }
        (index, self)
    }

    pub(super) fn locate(self, root: &Node, text: &str, file: &str) -> LanguageError {
        let Fault { steps, place, message, suggestion, .. } = self.found_in(root);
        error(text, file, place.start, show(&steps), message, suggestion)
    }

    /// The problem at the deepest node on its way.
    pub(super) fn found_in(self, root: &Node) -> Fault {
        let mut steps: Vec<Step> = self.path.into_iter().rev().collect();
        let Walk { mut node, mut taken, .. } = walk(root, &steps);
        if self.names_its_value
            && let Some(value) = named(node, &self.message)
        {
            let below = path_to(node, &value.span);
            steps.splice(taken.., below);
            (node, taken) = (value, steps.len());
        }
        let place = node.span.clone();
        let (message, suggestion) = (self.message, self.suggestion);
        Fault { steps, taken, place, message, suggestion, kind: FaultKind::Other }
    }

    /// The index of the pipeline of a configuration that it is a problem of.
    pub(super) fn pipeline(&self) -> Option<usize> {
        match self.path.iter().rev().take(2).collect::<Vec<_>>()[..] {
            [Step::Key(_), Step::Index(index)] => Some(*index),
            _ => None,
        }
    }

    /// A problem in the words of a run, with the name that was likely meant where they say one. It
    /// is one of the first value that these words name, wherever that stands below.
    #[cfg(feature = "files")]
    pub(crate) fn told(text: &str) -> Self {
        let told = text.strip_suffix("`?").and_then(|text| text.rsplit_once(MEANT));
        let problem = match told {
            Some((message, name)) => Self::new(message).suggest(Some(name)),
            None => Self::new(text),
        };
        Self { names_its_value: true, ..problem }
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

/// Refuses what is not a finite number above 0.
pub(super) fn above_zero(value: f64) -> Result<(), Problem> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(Problem::new(format!("found {value}, expected a number above 0")))
    }
}

/// Refuses a list in which something stands twice; `what` says what is listed.
pub(super) fn none_twice<T: Eq + Hash>(list: &[T], what: &str) -> Result<(), Problem> {
    let mut before = HashSet::new();
    match list.iter().position(|item| !before.insert(item)) {
        Some(index) => Err(Problem::new(format!("found the same {what} twice")).at(index)),
        None => Ok(()),
    }
}

/// The end of a path in a tree.
struct Walk<'a> {
    /// The deepest node on it.
    node: &'a Node,
    /// The key of that node, where the whole path is there and ends at a key.
    key: Option<&'a Range<usize>>,
    /// How many steps lead to the node.
    taken: usize,
}

fn walk<'a>(root: &'a Node, steps: &[Step]) -> Walk<'a> {
    let (mut node, mut key) = (root, None);
    for (taken, step) in steps.iter().enumerate() {
        let next = match step {
            Step::Key(name) => {
                node.member(name).map(|member| (&member.node, Some(&member.key_span)))
            }
            Step::Index(index) => node.item(*index).map(|item| (item, None)),
        };
        let Some(next) = next else { return Walk { node, key: None, taken } };
        (node, key) = next;
    }
    Walk { node, key, taken: steps.len() }
}

/// The path to the node, or to the key, that fills a place of the text.
pub(super) fn path_to(root: &Node, place: &Range<usize>) -> Vec<Step> {
    let holds = |node: &Node| node.span.start <= place.start && place.end <= node.span.end;
    let (mut node, mut steps) = (root, Vec::new());
    while node.span != *place {
        let next = match &node.value {
            Value::Array(items) => {
                items.iter().position(holds).map(|index| (Step::Index(index), Some(&items[index])))
            }
            Value::Object(members) => members.iter().find_map(|member| {
                let key = || Step::Key(member.key.clone());
                match holds(&member.node) {
                    true => Some((key(), Some(&member.node))),
                    false => (member.key_span == *place).then(|| (key(), None)),
                }
            }),
            _ => None,
        };
        let Some((step, below)) = next else { break };
        steps.push(step);
        let Some(below) = below else { break };
        node = below;
    }
    steps
}

pub(super) fn show(steps: &[Step]) -> String {
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

/// A thing that is wrong in a tree.
pub(super) struct Fault {
    /// The path to it.
    pub(super) steps: Vec<Step>,
    /// How many of the steps lead to the node that it was found at.
    pub(super) taken: usize,
    /// The place of that node, or of the key at fault, in the text.
    pub(super) place: Range<usize>,
    pub(super) message: String,
    pub(super) suggestion: Option<String>,
    pub(super) kind: FaultKind,
}

/// How a fault can be mended.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum FaultKind {
    /// A key that is not known: the last step.
    Key,
    /// A name that is not known: a text, or the only key of an object.
    Name,
    /// Anything else.
    Other,
}

/// Translates an error of serde, which names Rust's types, into one that names what stands in the
/// text.
pub(super) fn from_serde(
    failure: &serde_path_to_error::Error<serde_json::Error>,
    root: &Node,
    text: &str,
    file: &str,
) -> LanguageError {
    let Fault { steps, place, message, suggestion, .. } = fault(failure, root, text);
    error(text, file, place.start, show(&steps), message, suggestion)
}

/// The fault that an error of serde stands for, in the words of the text.
pub(super) fn fault(
    failure: &serde_path_to_error::Error<serde_json::Error>,
    root: &Node,
    text: &str,
) -> Fault {
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
    let Walk { node, key, taken } = walk(root, &steps);

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
        let mut place = key.filter(|_| is_field).unwrap_or(&node.span).clone();
        let mut taken = taken;
        if !is_field
            && let Value::Object(members) = &node.value
            && let Some(member) = members.first()
        {
            place = member.key_span.clone();
            steps.push(Step::Key(member.key.clone()));
            taken = steps.len();
        }
        let (what, kind) = match is_field {
            true => ("key", FaultKind::Key),
            false => ("name", FaultKind::Name),
        };
        let message = format!("found the unknown {what} `{name}`, expected {expected}");
        return Fault { steps, taken, place, message, suggestion, kind };
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
    let place = node.span.clone();
    Fault { steps, taken, place, message, suggestion: None, kind: FaultKind::Other }
}

fn split_expected(rest: &str) -> Option<(&str, &str)> {
    rest.rfind(", expected ").map(|at| (&rest[..at], &rest[at + ", expected ".len()..]))
}

/// The names between backticks.
fn backticked(text: &str) -> Vec<&str> {
    text.split('`').skip(1).step_by(2).collect()
}

/// The first text below a node that a message names, or else one that has the name in it.
fn named<'a>(node: &'a Node, message: &str) -> Option<&'a Node> {
    fn find<'a>(node: &'a Node, is_meant: &dyn Fn(&str) -> bool) -> Option<&'a Node> {
        match &node.value {
            Value::String(text) => is_meant(text).then_some(node),
            Value::Array(items) => items.iter().find_map(|item| find(item, is_meant)),
            Value::Object(members) => {
                members.iter().find_map(|member| find(&member.node, is_meant))
            }
            _ => None,
        }
    }
    let names = backticked(message);
    let find_by = |is_meant: &dyn Fn(&str, &str) -> bool| {
        names.iter().find_map(|name| find(node, &|text: &str| is_meant(text, name)))
    };
    // In a formula a name stands by itself, or before that of its component.
    let is_in = |text: &str, name: &str| {
        let is_part = |c: char| c.is_alphanumeric() || c == '_';
        let follows = |at: usize| text[at + name.len()..].starts_with(is_part);
        let leads = |at: usize| text[..at].ends_with(|c: char| is_part(c) || c == '.');
        !name.is_empty() && text.match_indices(name).any(|(at, _)| !follows(at) && !leads(at))
    };
    find_by(&|text, name| text == name).or_else(|| find_by(&is_in))
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
