//! The JSON language: configurations, pipelines, stages, orders, and errors that point at their token.
//!
//! Every type is declared once; from it come the parser, the JSON Schema ([`config_schema`], [`order_schema`]) and the reference
//! pages. [`parse`] reads a configuration, [`parse_orders`] a file of orders or a journal, [`parse_json`] any other type with the
//! same errors.
//!
//! ```
//! let failure = tombolo_pipelines::language::parse(
//!     r#"{"version": 1, "pipelines": [
//!         {"name": "mid", "stages": [{"slice": {"origin": [0, 0, 0], "nromal": [1, 0, 0]}}]}]}"#,
//!     "views.json",
//! )
//! .unwrap_err();
//! assert_eq!(
//!     failure.to_string(),
//!     "views.json:2:68: pipelines[0].stages[0].slice.nromal: found the unknown key `nromal`, \
//!      expected `origin` or `normal`; did you mean `normal`?"
//! );
//! ```

mod beside;
mod config;
mod deform;
mod error;
mod message;
mod order;
mod parse;
mod scan;
mod tree;
mod validate;

pub use beside::place_beside;
pub use config::{
    Action, At, Config, Due, ErrorBound, OrderStage, Pipeline, Select, Slice, Stage, Statistics,
    Steering, StreamServer, StreamStage, Write,
};
pub use deform::DeformStage;
pub use error::{LanguageError, Problem, nearest};
pub use message::{Message, parse_message};
pub use order::{
    Change, Command, JournalEntry, Order, OrderStatus, Parameter, Question, TimedCommand,
    parse_orders,
};
pub use parse::{ReadError, Validate, parse_json, parse_valid, read_text, text};
pub(crate) use validate::monitor_names;
pub use validate::{check_stack, file_pattern};

/// Reads and checks a configuration.
///
/// Files that edits name lie beside `file` where they are relative.
///
/// # Errors
/// A [`LanguageError`] at the first token that is wrong.
pub fn parse(text: &str, file: &str) -> Result<Config, LanguageError> {
    let mut config = parse_valid(text, file)?;
    beside::place_config(&mut config, file);
    Ok(config)
}

/// The JSON Schema (draft 2020-12) of a configuration.
#[must_use]
pub fn config_schema() -> serde_json::Value {
    schemars::schema_for!(Config).to_value()
}

/// The JSON Schema (draft 2020-12) of an order.
#[must_use]
pub fn order_schema() -> serde_json::Value {
    schemars::schema_for!(Order).to_value()
}
