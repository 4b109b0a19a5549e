//! What a JSON text is likely to be.

use std::collections::HashSet;

use tombolo_deform::edit::Edit;

use super::order::Order;
use super::scan::{Node, Value};
use super::timed::TimedCommand;
use super::{Config, near};

/// A kind of text.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Configuration,
    Orders,
    /// Edits, or an order of them.
    Edits,
}

impl Kind {
    /// The kind that knows most of the keys.
    pub(super) fn of(root: &Node) -> Self {
        let (objects, kinds) = match &root.value {
            Value::Array(items) => (
                &items[..],
                [(Kind::Orders, keys_of::<TimedCommand>()), (Kind::Edits, keys_of::<Edit>())],
            ),
            _ => (
                std::slice::from_ref(root),
                [(Kind::Orders, keys_of::<TimedCommand>()), (Kind::Edits, keys_of::<Order>())],
            ),
        };
        let configuration = (Kind::Configuration, keys_of::<Config>());
        let count = |known: &HashSet<String>| {
            let keys = objects.iter().flat_map(Node::members).map(|member| &member.key);
            let is_known = |key: &&String| near(key, known.iter().map(String::as_str)).count() > 0;
            // A key that is there is worth more than one that is misspelt.
            keys.clone().filter(is_known).count() + keys.filter(|key| known.contains(*key)).count()
        };
        // An array is no configuration; of kinds that know as many keys the first counts.
        let mut best = (Kind::Configuration, count(&configuration.1));
        if let Value::Array(_) = root.value {
            best = (Kind::Orders, 0);
        }
        for (kind, known) in &kinds {
            let known = count(known);
            if known > best.1 {
                best = (*kind, known);
            }
        }
        best.0
    }
}

/// The keys that an object of a type may have.
fn keys_of<T: schemars::JsonSchema>() -> HashSet<String> {
    let schema = schemars::schema_for!(T).to_value();
    let keys = |schema: &serde_json::Value| -> Vec<String> {
        let properties = schema.get("properties").and_then(serde_json::Value::as_object);
        properties.map_or_else(Vec::new, |properties| properties.keys().cloned().collect())
    };
    let choices = schema.get("oneOf").and_then(serde_json::Value::as_array);
    keys(&schema).into_iter().chain(choices.into_iter().flatten().flat_map(keys)).collect()
}
