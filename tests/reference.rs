//! `docs/json-reference.md` is what the types say, rendered; it is never written by hand.
//!
//! `TOMBOLO_UPDATE=1 cargo test -p tombolo-tests --test reference` writes the page anew, and the
//! viewer's copy of the schema.

use std::collections::{BTreeSet, VecDeque};
use std::fmt::Write as _;

use serde_json::Value;
use tombolo_pipelines::language::{TimedCommand, config_schema, order_schema, pipeline_schema};
use tombolo_pipelines::limits;
use tombolo_tests::project;

const PAGE: &str = "docs/json-reference.md";

const HEAD: &str = "# JSON reference

Generated from the types of the program; do not edit. `tombolo schema` prints the same as a JSON Schema.

A stage, an edit or a command is an object with exactly one key, its name: `{\"surface\": {}}`. A key that is not listed is an error, and so
is one that stands twice. Every number must be finite.

`tombolo check FILE` tells every error of a configuration or a file of orders at once, each with its line, column and path, what was
expected and the nearest name; with `--mesh MESH` also the fields, features and regions that the mesh does not have. A run that does not
start for such errors tells them all as well.

";

#[test]
fn the_reference_is_what_the_types_say() {
    let mut renderer = Renderer::default();
    renderer.limits();
    renderer.render("Pipelines", &config_schema());
    renderer.render("Orders", &schemars::schema_for!(Vec<TimedCommand>).to_value());
    renderer.render("Cases of flow", &schemars::schema_for!(tombolo_flow::case::Case).to_value());
    let page = format!("{HEAD}{}\n", renderer.page.trim_end());
    let path = project().join(PAGE);
    if std::env::var_os("TOMBOLO_UPDATE").is_some() {
        std::fs::write(&path, &page).expect("the page can be written");
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        found == page,
        "{PAGE} is out of date; write it anew: TOMBOLO_UPDATE=1 cargo test -p tombolo-tests --test reference"
    );
}

/// The viewer's tests read schemas as a server sends them.
#[test]
fn the_viewer_has_the_schemas_of_orders_and_pipelines() {
    let schemas = [("order", order_schema()), ("pipeline", pipeline_schema())];
    for (name, schema) in schemas {
        let file = format!("viewer/test/{name}-schema.json");
        let path = project().join(&file);
        let schema = serde_json::to_string_pretty(&schema).expect("a schema can be written") + "\n";
        if std::env::var_os("TOMBOLO_UPDATE").is_some() {
            std::fs::write(&path, &schema).expect("the schema can be written");
        }
        assert!(
            std::fs::read_to_string(&path).unwrap_or_default() == schema,
            "{file} is out of date; write it anew: TOMBOLO_UPDATE=1 cargo test -p tombolo-tests --test reference"
        );
    }
}

#[derive(Default)]
struct Renderer {
    page: String,
    queue: VecDeque<String>,
    met: BTreeSet<String>,
}

impl Renderer {
    fn limits(&mut self) {
        self.line(
            "## Limits\n\nThe same in files, for programs, and over the network. What is beyond one is refused, and nothing has \
             happened.\n",
        );
        self.line("| at most | of |\n|---|---|");
        for limit in limits::ALL {
            self.line(&format!("| {} {} | {} |", limit.most, limit.what, limit.of));
        }
        self.line("");
    }

    /// Renders a schema and every definition it reaches that no schema before it did, in the order
    /// they are met.
    fn render(&mut self, title: &str, schema: &Value) {
        self.definition(title, schema);
        while let Some(name) = self.queue.pop_front() {
            self.definition(&name, &schema["$defs"][&name]);
        }
    }

    fn definition(&mut self, name: &str, definition: &Value) {
        self.line(&format!("## {name}\n"));
        self.description(definition);
        self.body(definition);
    }

    fn body(&mut self, definition: &Value) {
        if let Some(variants) = definition["oneOf"].as_array().or(definition["anyOf"].as_array()) {
            // A variant without a type says only which keys go together; the description says it
            // better.
            let variants: Vec<&Value> = variants
                .iter()
                .filter(|variant| {
                    variant.get("required").is_none() || variant.get("type").is_some()
                })
                .collect();
            for variant in &variants {
                self.variant(variant);
            }
            if !variants.is_empty() {
                self.line("");
            }
        }
        if definition["properties"].is_object() {
            self.properties(definition);
        } else if definition["oneOf"].is_null() && definition["anyOf"].is_null() {
            let kind = self.kind(definition);
            self.line(&format!("{}.\n", capital(&kind)));
        }
    }

    fn variant(&mut self, variant: &Value) {
        if let Some(word) = variant["const"].as_str() {
            self.line(&format!("- `\"{word}\"`: {}", sentence(variant)));
            return;
        }
        if let Some(words) = variant["enum"].as_array() {
            for word in words {
                self.line(&format!("- `{word}`"));
            }
            return;
        }
        let tagged = variant["properties"].as_object().filter(|properties| properties.len() == 1);
        match tagged.and_then(|properties| properties.iter().next()) {
            Some((tag, content))
                if variant["required"].as_array().is_some_and(|required| required.len() == 1) =>
            {
                let kind = self.kind(content);
                self.line(&format!("- `{tag}`: {kind}. {}", sentence(variant)));
            }
            _ => {
                let kind = self.kind(variant);
                self.line(&format!("- {kind}. {}", sentence(variant)));
                if variant["properties"].is_object() {
                    self.line("");
                    self.properties(variant);
                }
            }
        }
    }

    fn properties(&mut self, definition: &Value) {
        let Some(properties) = definition["properties"].as_object() else { return };
        if properties.is_empty() {
            self.line("An empty object: `{}`.\n");
            return;
        }
        self.line("| key | value | default | meaning |\n|---|---|---|---|");
        let required: Vec<&str> = definition["required"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_str)
            .collect();
        for (key, value) in properties {
            let default = match &value["default"] {
                Value::Null if required.contains(&key.as_str()) => "required".to_owned(),
                Value::Null => String::new(),
                default => format!("`{default}`"),
            };
            let kind = self.kind(value);
            self.line(&format!(
                "| `{key}` | {kind} | {default} | {} |",
                sentence(value).replace('|', "\\|")
            ));
        }
        self.line("");
    }

    /// A type in words, with links to definitions, which it notes as met.
    fn kind(&mut self, value: &Value) -> String {
        if let Some(reference) = value["$ref"].as_str() {
            let name = reference.rsplit('/').next().unwrap_or(reference).to_owned();
            if self.met.insert(name.clone()) {
                self.queue.push_back(name.clone());
            }
            return format!("[{name}](#{})", name.to_lowercase());
        }
        if let Some(word) = value.get("const") {
            return format!("`{word}`");
        }
        if let Some(words) = value["enum"].as_array() {
            return words.iter().map(|word| format!("`{word}`")).collect::<Vec<_>>().join(" or ");
        }
        if let Some(all) = value["allOf"].as_array().filter(|all| all.len() == 1) {
            return self.kind(&all[0]);
        }
        if let Some(any) = value["anyOf"].as_array().or(value["oneOf"].as_array()) {
            let kinds: Vec<String> =
                any.iter().filter(|one| one["type"] != "null").map(|one| self.kind(one)).collect();
            return kinds.join(" or ");
        }
        let range = range(value);
        match &value["type"] {
            Value::String(kind) => self.simple(kind, value) + &range,
            Value::Array(kinds) => {
                let kinds: Vec<&str> =
                    kinds.iter().filter_map(Value::as_str).filter(|kind| *kind != "null").collect();
                kinds.iter().map(|kind| self.simple(kind, value)).collect::<Vec<_>>().join(" or ")
                    + &range
            }
            _ => "any value".to_owned(),
        }
    }

    fn simple(&mut self, kind: &str, value: &Value) -> String {
        match kind {
            "array" => {
                let items = if value["items"].is_object() {
                    self.kind(&value["items"])
                } else {
                    "any value".to_owned()
                };
                match (value["minItems"].as_u64(), value["maxItems"].as_u64()) {
                    (Some(least), Some(most)) if least == most => format!("{least} × {items}"),
                    (Some(least), _) if least > 0 => format!("list of {items}, at least {least}"),
                    _ => format!("list of {items}"),
                }
            }
            "object" if value["additionalProperties"].is_object() => {
                format!("object of {}", self.kind(&value["additionalProperties"]))
            }
            "object" if value["properties"].as_object().is_none_or(serde_json::Map::is_empty) => {
                "`{}`".to_owned()
            }
            other => other.to_owned(),
        }
    }

    fn description(&mut self, definition: &Value) {
        let text = prose(definition["description"].as_str().unwrap_or_default());
        if !text.is_empty() {
            self.line(&format!("{text}\n"));
        }
    }

    fn line(&mut self, text: &str) {
        let _ = writeln!(self.page, "{text}");
    }
}

fn range(value: &Value) -> String {
    let mut bounds = Vec::new();
    for (key, word) in [
        ("minimum", "at least"),
        ("exclusiveMinimum", "above"),
        ("maximum", "at most"),
        ("exclusiveMaximum", "below"),
    ] {
        if let Some(bound) = value[key].as_f64() {
            bounds.push(format!("{word} {bound}"));
        }
    }
    if bounds.is_empty() { String::new() } else { format!(", {}", bounds.join(", ")) }
}

fn sentence(value: &Value) -> String {
    prose(value["description"].as_str().unwrap_or_default())
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

/// A description up to its first example in Rust, without links into the Rust documentation.
fn prose(text: &str) -> String {
    let end = ["```", "\n# "].iter().filter_map(|mark| text.find(mark)).min().unwrap_or(text.len());
    let paragraphs =
        text[..end].trim_end().split("\n\n").filter(|paragraph| !paragraph.ends_with(':'));
    paragraphs
        .collect::<Vec<_>>()
        .join("\n\n")
        .replace("[`", "`")
        .replace("`]", "`")
        .trim()
        .to_owned()
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().collect::<String>() + letters.as_str()
    })
}
