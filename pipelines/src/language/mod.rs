//! The JSON language: configurations, pipelines, stages, orders, and errors that point at their
//! token.
//!
//! Every type is declared once; from it come the parser, the JSON Schema ([`config_schema`],
//! [`order_schema`], [`pipeline_schema`]) and the reference pages. [`parse`] reads a configuration,
//! [`parse_orders`] a file of orders or a journal, [`parse_json`] any other type with the same
//! errors. [`check`] and [`check_orders`] read the same and tell every error at once;
//! [`check_content`] finds out which of both a text is; [`check_pipeline`] reads a pipeline that is
//! to be set in a run.
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
//!      expected `origin`, `normal`, `planes`, `cylinder` or `sphere`; did you mean `normal`?"
//! );
//! ```

mod as_text;
mod cameras;
mod check;
mod check_pipeline;
mod configuration;
mod derived;
mod error;
mod errors;
mod extracts;
mod file_pattern;
mod file_series;
mod glyphs;
mod journal;
mod journal_file;
mod journal_since;
mod kind;
mod mend;
mod message;
mod monitors;
mod order;
mod orders_text;
mod page_origin;
mod parameter;
mod parse;
mod pipeline;
mod pipeline_change;
mod probe;
mod reductions;
mod relative_files;
mod relay_address;
mod render;
mod scan;
mod sinks;
mod stage;
mod streamlines;
mod timed;
mod together;
mod tree;
mod unread;
mod validate;
mod validate_orders;

pub use cameras::{Camera, Orbit, Viewpoint};
pub use check::{Content, Trial, check, check_content, check_orders};
pub use check_pipeline::{Beside, check_pipeline};
pub use configuration::{
    Config, Listen, Steering, StreamLimits, StreamServer, Tls, Unwatched, record_megabytes,
};
pub use derived::{Derived, Formula};
pub(crate) use derived::{GIVEN, PARAMETER};
pub use error::{LanguageError, Problem};
pub use errors::{LanguageErrors, Problems};
pub use extracts::{
    Clip, ClipBy, ClipField, Contour, Cylinder, Plane, Quantifier, Slice, Threshold,
};
pub use file_pattern::file_pattern;
pub(crate) use file_pattern::picture_pattern;
pub(crate) use file_series::series_of;
pub use glyphs::{GlyphShape, Glyphs, GlyphsAt};
pub use journal::{
    CheckpointNote, HandedShape, JournalNote, LostLines, Recording, RefusedRequest, RestartedFrom,
    RunEnd, RunHeader, UnpinnedNote, ViewerMove, ViewerNote, is_journal, parse_journal,
};
pub use journal_file::read_orders_text;
pub use journal_since::{Outcome, Since, SinceError, Taken};
pub use message::{Message, Wheel, parse_message};
pub(crate) use monitors::{Condition, Line, Monitored, Scope, Slot, columns, line, monitors_of};
pub use monitors::{Monitor, check_parameters, monitors};
pub use order::{Cancel, Change, Command, Order, Question};
pub use orders_text::parse_orders;
pub use page_origin::{Embedders, PageOrigin};
pub use parameter::Parameter;
pub use parse::{ReadError, Validate, locate, parse_json, parse_valid, read_text, text};
pub use pipeline::{AgainAfter, At, Budget, Cadence, Due, Pipeline};
pub use pipeline_change::PipelineChange;
pub use probe::{Probe, ProbeAt, ProbeGrid, ProbeLine, ProbeMethod};
pub use reductions::{
    Decimate, Difference, Force, Histogram, Integrate, Measure, Spectrum, Statistics,
    TimeStatistics, Viscosity, WallShearStress, Weight,
};
pub use relative_files::resolve_files;
pub use relay_address::{RelayAddress, RunName, is_fingerprint};
pub use render::{Color, ColorMap, Component, Render, Shading};
pub use sinks::{Csv, Existing, Log, LogLevel};
pub use stage::{Action, ErrorBound, OrderStage, Select, Stage, StreamStage, Write};
pub use streamlines::{Direction, SeedFeatures, SeedPlane, Seeds, Streamlines};
pub use timed::{CommandAuthor, JournalEntry, OrderStatus, TimedCommand};
pub use together::{CameraStand, LinkFor, NewNote, PinnedNote, Together};
pub(crate) use tombolo_deform::names::near;
pub use tombolo_deform::names::nearest;
pub use tombolo_deform::shape::Deformation;

/// Reads and checks a configuration.
///
/// Files that edits name lie beside `file` where they are relative.
///
/// # Errors
/// A [`LanguageError`] at the first token that is wrong; [`check`] tells all that are.
pub fn parse(text: &str, file: &str) -> Result<Config, LanguageError> {
    let mut config: Config = parse_valid(text, file)?;
    relative_files::resolve_pipeline_files(&mut config.pipelines, file);
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

/// The JSON Schema (draft 2020-12) of a pipeline.
#[must_use]
pub fn pipeline_schema() -> serde_json::Value {
    schemars::schema_for!(Pipeline).to_value()
}
