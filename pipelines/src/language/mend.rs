//! Reading on behind an error.
//!
//! A text with errors is read piece by piece: each stage, action, edit and command by itself. A
//! piece that cannot be read is mended and read again until it can be: a misspelt name is put
//! right, a key that is not known or whose value is wrong is left out. Each fault is noted where it
//! stands in the text; what follows from the mending alone is not.

use std::collections::HashSet;
use std::ops::Range;

use serde::de::DeserializeOwned;

use super::error::{Fault, FaultKind, Step, error, fault, path_to, show};
use super::parse::Document;
use super::scan::{Member, Node, Value};
use super::{LanguageErrors, Problem, near};
use crate::limits::ERRORS;

/// How often one piece is mended before it is given up.
const MENDINGS: usize = 32;

/// How many faults are kept; of more, only their number.
const KEPT: usize = 100 * ERRORS.most;

/// Reads a text in pieces and collects what is wrong.
pub(super) struct Mender<'a> {
    document: &'a Document<'a>,
    faults: Vec<Fault>,
    more: usize,
    /// The objects that something was left out of.
    lacking: HashSet<Range<usize>>,
}

/// A piece that was read.
pub(super) struct Piece<T> {
    /// The value; `None` where nothing mends the piece.
    pub(super) value: Option<T>,
    /// Whether a setting was left out of it.
    pub(super) lacks: bool,
}

impl<'a> Mender<'a> {
    pub(super) fn new(document: &'a Document<'a>) -> Self {
        Self { document, faults: Vec::new(), more: 0, lacking: HashSet::new() }
    }

    /// The errors in the order of the text; `None` where there are none.
    pub(super) fn into_errors(mut self) -> Option<LanguageErrors> {
        let Document { root, text, file } = self.document;
        self.faults.sort_by_key(|fault| fault.place.start);
        // One place may be found wrong twice: in what was read, and in what is left of it.
        self.faults.dedup_by(|a, b| a.place == b.place && a.message == b.message);
        let more = self.more + self.faults.len().saturating_sub(ERRORS.most);
        let told = self.faults.into_iter().take(ERRORS.most).map(|fault| {
            let Fault { steps, taken, place, message, suggestion, .. } = fault;
            let mut path = path_to(root, &place);
            path.extend_from_slice(steps.get(taken..).unwrap_or_default());
            error(text, file, place.start, show(&path), message, suggestion)
        });
        LanguageErrors::new(told.collect(), more)
    }

    /// Reads a piece, which is mended on the way.
    pub(super) fn read<T: DeserializeOwned>(&mut self, piece: &mut Node) -> Piece<T> {
        let mut lacks = false;
        for _ in 0..MENDINGS {
            let failure = match serde_path_to_error::deserialize(&*piece) {
                Ok(value) => return Piece { value: Some(value), lacks },
                Err(failure) => failure,
            };
            let fault = fault(&failure, piece, self.document.text);
            match self.mend(piece, fault) {
                Mended::Named => {}
                Mended::Lacking => lacks = true,
                Mended::Not => break,
            }
        }
        Piece { value: None, lacks }
    }

    fn mend(&mut self, piece: &mut Node, fault: Fault) -> Mended {
        let steps = fault.steps.get(..fault.taken).unwrap_or_default().to_vec();
        let (kind, suggestion, place) = (fault.kind, fault.suggestion.clone(), fault.place.clone());
        self.note(fault);
        match (kind, suggestion) {
            (FaultKind::Key, suggestion) => {
                let Some((Step::Key(key), above)) = steps.split_last() else { return Mended::Not };
                let Some(object) = at(piece, above) else { return Mended::Not };
                let meant = suggestion.filter(|name| object.member(name).is_none());
                let span = object.span.clone();
                let Some(members) = members(object) else { return Mended::Not };
                let Some(index) = members.iter().position(|member| member.key == *key) else {
                    return Mended::Not;
                };
                match meant {
                    Some(name) => members[index].key = name,
                    None => {
                        members.remove(index);
                        self.lacking.insert(span);
                    }
                }
                Mended::Named
            }
            (FaultKind::Name, Some(name)) => {
                if let Some((Step::Key(key), above)) = steps.split_last()
                    && let Some(members) = at(piece, above).and_then(members)
                    && let Some(member) = members.iter_mut().find(|member| member.key == *key)
                    && member.key_span == place
                {
                    member.key = name;
                    return Mended::Named;
                }
                match at(piece, &steps) {
                    Some(node) if matches!(node.value, Value::String(_)) => {
                        node.value = Value::String(name);
                        Mended::Named
                    }
                    _ => Mended::Not,
                }
            }
            _ => self.leave_out(piece, &steps),
        }
    }

    /// Leaves out the innermost member of an object on the way to what is wrong.
    fn leave_out(&mut self, piece: &mut Node, mut steps: &[Step]) -> Mended {
        while let Some((last, above)) = steps.split_last() {
            if let (Step::Key(key), Some(object)) = (last, at(piece, above)) {
                let span = object.span.clone();
                if let Some(members) = members(object)
                    && let Some(index) = members.iter().position(|member| member.key == *key)
                {
                    members.remove(index);
                    self.lacking.insert(span);
                    return Mended::Lacking;
                }
            }
            steps = above;
        }
        Mended::Not
    }

    /// Notes what is wrong, unless it follows from what was left out.
    fn note(&mut self, fault: Fault) {
        let follows = fault.kind == FaultKind::Other && self.lacking.contains(&fault.place);
        // What stands in for something has no place in the text.
        if follows || fault.place.is_empty() {
            return;
        }
        if self.faults.len() < KEPT {
            self.faults.push(fault);
        } else {
            self.more += 1;
        }
    }

    /// Notes a problem of what was read from a tree.
    pub(super) fn note_problem(&mut self, problem: Problem, tree: &Node) {
        self.note(problem.found_in(tree));
    }

    /// The name of the file.
    pub(super) fn file(&self) -> &'a str {
        self.document.file
    }

    /// Reads the items of a list one by one, and says of each whether a setting was left out; those
    /// that nothing mends are left out of the list.
    pub(super) fn items<T>(
        &mut self,
        list: &mut Node,
        mut read: impl FnMut(&mut Self, &mut Node) -> Piece<T>,
    ) -> Vec<Piece<T>> {
        let Value::Array(items) = &mut list.value else { return Vec::new() };
        let mut pieces = Vec::with_capacity(items.len());
        items.retain_mut(|item| {
            let piece = read(self, item);
            let is_read = piece.value.is_some();
            pieces.push(piece);
            is_read
        });
        pieces
    }
}

/// The outcome of mending.
enum Mended {
    /// Names are put right, or keys that mean nothing are gone.
    Named,
    /// A setting was left out.
    Lacking,
    /// Nothing.
    Not,
}

fn members(node: &mut Node) -> Option<&mut Vec<Member>> {
    match &mut node.value {
        Value::Object(members) => Some(members),
        _ => None,
    }
}

/// The node at the end of a path.
fn at<'n>(mut node: &'n mut Node, steps: &[Step]) -> Option<&'n mut Node> {
    for step in steps {
        node = match (step, &mut node.value) {
            (Step::Key(key), Value::Object(members)) => {
                &mut members.iter_mut().find(|member| member.key == *key)?.node
            }
            (Step::Index(index), Value::Array(items)) => items.get_mut(*index)?,
            _ => return None,
        };
    }
    Some(node)
}

/// A list or an object that was taken out of an object, to be read by itself.
pub(super) struct Taken {
    key: &'static str,
    pub(super) node: Node,
}

/// Takes out the list under a key, or under one that is near it; an empty one stays in its place.
pub(super) fn take_list(object: &mut Node, key: &'static str) -> Option<Taken> {
    let is_list = |value: &Value| matches!(value, Value::Array(_));
    take(object, key, is_list, Value::Array(Vec::new()))
}

/// Takes out what stands under a key, or under one that is near it, where it is of a kind; another
/// value stays in its place.
pub(super) fn take(
    object: &mut Node,
    key: &'static str,
    is_kind: impl Fn(&Value) -> bool,
    instead: Value,
) -> Option<Taken> {
    let node = under(object, key, is_kind)?;
    let value = std::mem::replace(&mut node.value, instead);
    Some(Taken { key, node: Node { span: node.span.clone(), value } })
}

impl Taken {
    /// Puts it back.
    pub(super) fn put_back(self, object: &mut Node) {
        let is_place = |node: &Node| node.span == self.node.span;
        let place = members(object)
            .and_then(|members| members.iter_mut().find(|member| is_place(&member.node)));
        if let Some(member) = place {
            self.key.clone_into(&mut member.key);
            member.node = self.node;
        }
    }
}

fn under<'n>(
    object: &'n mut Node,
    key: &str,
    is_kind: impl Fn(&Value) -> bool,
) -> Option<&'n mut Node> {
    let members = members(object)?;
    let place = |is_key: &dyn Fn(&str) -> bool| {
        members.iter().position(|member| is_key(&member.key) && is_kind(&member.node.value))
    };
    let index = match members.iter().any(|member| member.key == key) {
        true => place(&|other| other == key),
        false => place(&|other| near(other, [key]).next().is_some()),
    };
    members.get_mut(index?).map(|member| &mut member.node)
}

/// Leaves of an object only some members, and adds those that are missing: they stand nowhere in
/// the text.
pub(super) fn rescue(object: &mut Node, keys: &[&str], missing: Vec<(&str, Value)>) -> bool {
    let place = object.span.start..object.span.start;
    let Some(members) = members(object) else { return false };
    members.retain(|member| keys.contains(&member.key.as_str()));
    for (key, value) in missing {
        if members.iter().all(|member| member.key != key) {
            let node = Node { span: place.clone(), value };
            members.push(Member { key: key.to_owned(), key_span: place.clone(), node });
        }
    }
    true
}
