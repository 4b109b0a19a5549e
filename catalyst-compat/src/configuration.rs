//! What `catalyst_initialize` says: pipelines, parameters, orders, the ranks.

use std::path::{Path, PathBuf};

use serde_json::json;
use tombolo::Parameter;
use tombolo::pipelines::language::{self, Config, TimedCommand};
use tombolo::pipelines::limits::{DOCUMENT, Limit, WAITING_BYTES};

use crate::error::CatalystError;
use crate::node::{Kind, Node};
use crate::results::RESERVED;

/// The variable that names a configuration, for a solver whose own input names none.
const PIPELINES: &str = "TOMBOLO_PIPELINES";
/// The variable that names a file of orders.
const ORDERS: &str = "TOMBOLO_ORDERS";
/// The variable that names the directory of what is written.
const OUTPUT: &str = "TOMBOLO_OUTPUT";

/// The variable that names the file of the report at the end.
const REPORT: &str = "TOMBOLO_REPORT";

/// What a run is set up with.
#[derive(Debug)]
pub(crate) struct Configuration {
    /// What to watch; `None` where nobody says.
    pub(crate) config: Option<Config>,
    /// The pipelines of each script and pipeline of the node, by its name there; none where the node names no configuration.
    pub(crate) groups: Groups,
    pub(crate) parameters: Vec<Parameter>,
    pub(crate) orders: Vec<TimedCommand>,
    pub(crate) output: PathBuf,
    /// The Fortran handle of the communicator.
    pub(crate) communicator: Option<i32>,
    /// What is not done, for the log.
    pub(crate) notes: Vec<String>,
}

/// Names, each with those of the pipelines that it stands for.
pub(crate) type Groups = Vec<(String, Vec<String>)>;

/// What is found on the way through the node.
#[derive(Default)]
struct Found {
    /// The names that the node gives them, and the files.
    files: Vec<(String, String)>,
    /// The names of scripts that are not run.
    others: Vec<String>,
    pipelines: Vec<serde_json::Value>,
    notes: Vec<String>,
}

impl Configuration {
    /// Reads `catalyst` of the node of `catalyst_initialize`; without one everything is the default.
    pub(crate) fn read(root: &Node<'_, '_>) -> Result<Self, CatalystError> {
        let mut found = Found::default();
        let (mut parameters, mut communicator, mut orders) = (Vec::new(), None, Vec::new());
        if let Some(catalyst) = root.child(c"catalyst") {
            if let Some(scripts) = catalyst.child(c"scripts") {
                each(&scripts, |child| script(child, &mut found))?;
            }
            if let Some(pipelines) = catalyst.child(c"pipelines") {
                each(&pipelines, |child| pipeline(child, &mut found))?;
            }
            if let Some(node) = catalyst.child(c"parameters") {
                each(&node, |child| parameter(child, &mut parameters))?;
            }
            if let Some(handle) = catalyst.child(c"mpi_comm") {
                let value = handle.array().ok().filter(|array| array.len() == 1).and_then(|array| array.integer(0));
                let value = value.and_then(|value| i32::try_from(value).ok());
                communicator = Some(value.ok_or_else(|| handle.wrong("the Fortran handle of a communicator".into()))?);
            }
        }
        let named_here = !found.files.is_empty() || !found.pipelines.is_empty();
        if !named_here {
            found.files.extend(variable(PIPELINES).map(|file| (String::new(), file)));
        }
        if let Some(file) = variable(ORDERS) {
            orders = language::parse_orders(&text(&file, WAITING_BYTES)?, &file).map_err(unreadable)?;
        }
        let is_default = found.files.is_empty() && found.pipelines.is_empty();
        let (config, groups) = if is_default {
            (None, Groups::new())
        } else {
            let (config, groups) = merged(&found)?;
            (Some(config), groups)
        };
        Ok(Self {
            config,
            groups: if named_here { groups } else { Groups::new() },
            parameters,
            orders,
            output: variable(OUTPUT).map_or_else(|| PathBuf::from("."), PathBuf::from),
            communicator,
            notes: found.notes,
        })
    }
}

fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok().filter(|value| !value.is_empty())
}

/// Where the report of the run goes.
pub(crate) fn report_file() -> Option<String> {
    variable(REPORT)
}

fn text(file: &str, limit: Limit) -> Result<String, CatalystError> {
    language::read_text(file.as_ref(), limit).map_err(unreadable)
}

fn unreadable(error: impl ToString) -> CatalystError {
    CatalystError::Configuration(error.to_string())
}

/// The surface of each channel, for whoever opens the link.
pub(crate) fn default_config(channels: &[String]) -> Result<Config, CatalystError> {
    let stages = json!([{"surface": {}}, {"stream": {}}]);
    let view = |channel: &String| match channels {
        // One channel needs no name beside what is seen of it.
        [_] => json!({"name": "surface", "every": {"steps": 1}, "stages": stages}),
        _ => json!({"name": channel, "channel": channel, "every": {"steps": 1}, "stages": stages}),
    };
    let pipelines: Vec<_> = channels.iter().map(view).collect();
    let config = json!({"version": 1, "stream": {}, "pipelines": pipelines});
    language::parse(&config.to_string(), "the default configuration").map_err(unreadable)
}

/// The configurations of all files as one, and what the node itself asks for; and which pipelines each name in the node stands for.
fn merged(found: &Found) -> Result<(Config, Groups), CatalystError> {
    let own = json!({"version": 1, "pipelines": found.pipelines});
    let mut config: Option<Config> = None;
    let mut groups: Groups = found.others.iter().map(|name| (name.clone(), Vec::new())).collect();
    for (name, file) in &found.files {
        let next = language::parse(&text(file, DOCUMENT)?, file).map_err(unreadable)?;
        groups.push((name.clone(), next.pipelines.iter().map(|pipeline| pipeline.name.clone()).collect()));
        match &mut config {
            None => config = Some(next),
            Some(config) => {
                config.stream = config.stream.take().or(next.stream);
                config.journal = config.journal.take().or(next.journal);
                config.pipelines.extend(next.pipelines);
            }
        }
    }
    let own = language::parse(&own.to_string(), "catalyst/pipelines").map_err(unreadable)?;
    let config = match config {
        None => own,
        Some(mut config) => {
            config.pipelines.extend(own.pipelines);
            config
        }
    };
    // A pipeline stands for itself too, unless something in the node has its name.
    for pipeline in &config.pipelines {
        if !groups.iter().any(|(name, _)| *name == pipeline.name) {
            groups.push((pipeline.name.clone(), vec![pipeline.name.clone()]));
        }
    }
    Ok((config, groups))
}

fn each(
    node: &Node<'_, '_>,
    mut visit: impl FnMut(&Node<'_, '_>) -> Result<(), CatalystError>,
) -> Result<(), CatalystError> {
    if !matches!(node.kind(), Kind::Object | Kind::List | Kind::Empty) {
        return Err(node.wrong("an object or a list".into()));
    }
    for (index, name) in node.names().iter().enumerate() {
        if let Some(child) = node.at(index, name) {
            visit(&child)?;
        }
    }
    Ok(())
}

fn is_json(file: &str) -> bool {
    Path::new(file).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"))
}

/// A script is a file, or an object with `filename`; ours are JSON.
fn script(node: &Node<'_, '_>, found: &mut Found) -> Result<(), CatalystError> {
    let file = match node.kind() {
        Kind::Text => node.text()?.into_owned(),
        _ => node.need(c"filename", "the script's file")?.text()?.into_owned(),
    };
    if is_json(&file) {
        found.files.push((node.name().into_owned(), file));
    } else {
        let path = node.path();
        found.others.push(node.name().into_owned());
        found.notes.push(format!("'{path}': {file} is not run: a configuration is a file that ends in .json"));
    }
    Ok(())
}

/// A pipeline of Catalyst: `io` writes files; a text, or an object with `filename` and no other type, names a configuration.
fn pipeline(node: &Node<'_, '_>, found: &mut Found) -> Result<(), CatalystError> {
    if node.kind() == Kind::Text {
        return script(node, found);
    }
    let kind = node.child(c"type").map_or(Ok("".into()), |kind| kind.text())?;
    let file_node = node.need(c"filename", "the file to write, or the configuration to read")?;
    let file = file_node.text()?.into_owned();
    match &*kind {
        "io" => {
            let channel = node.need(c"channel", "the name of the channel to write")?.text()?;
            let (file, note) = written_file(&file);
            if let Some(note) = note {
                found.notes.push(format!("'{}': {note}", file_node.path()));
            }
            found.pipelines.push(json!({
                "name": node.name(), "channel": channel, "every": {"steps": 1}, "stages": [{"write": {"file": file}}]
            }));
            Ok(())
        }
        _ if is_json(&file) => script(node, found),
        "" => {
            Err(file_node
                .wrong_found(format!("'{file}'"), "a file that ends in .json, or the type 'io' beside it".into()))
        }
        other => {
            let kind = node.need(c"type", "'io'")?;
            Err(kind.wrong_found(format!("'{other}'"), "'io', or a filename that ends in .json".into()))
        }
    }
}

/// ParaView's pattern as ours: `{timestep:04d}` of today and `%04ts` of before, `{time:.3f}` and `%.3t`. Files of VTK's other kinds
/// are written as .vtpd, which holds any mesh.
fn written_file(file: &str) -> (String, Option<String>) {
    let mut pattern = String::new();
    let mut rest = file;
    while let Some(at) = rest.find(['{', '%']) {
        pattern.push_str(&rest[..at]);
        let behind = &rest[at + 1..];
        let (name, format, length) = if rest[at..].starts_with('{') {
            let inside = behind.split_once('}').map_or(behind, |(inside, _)| inside);
            let (name, format) = inside.split_once(':').unwrap_or((inside, ""));
            (name, format, (inside.len() + 1).min(behind.len()))
        } else {
            let digits = behind.len() - behind.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.').len();
            let (name, letters) = match &behind[digits..] {
                text if text.starts_with("ts") => ("timestep", 2),
                text if text.starts_with('t') => ("time", 1),
                _ => ("", 0),
            };
            (name, &behind[..digits], digits + letters)
        };
        match name {
            "timestep" | "cycle" => pattern.push_str(&format!("{{cycle:{}}}", digits(format).max(1))),
            "time" if format.contains('.') => {
                pattern
                    .push_str(&format!("{{time:{}}}", digits(format.split_once('.').map_or("", |(_, after)| after))));
            }
            "time" => pattern.push_str("{time}"),
            // Not one of ParaView's: what checks the configuration tells what may stand in braces.
            _ => pattern.push_str(&rest[at..=at + length]),
        }
        rest = &behind[length..];
    }
    pattern.push_str(rest);
    let extension = Path::new(&pattern).extension().map(|extension| extension.to_string_lossy().into_owned());
    match extension.as_deref() {
        Some("vtu" | "vtp" | "vtpd" | "pvtu" | "pvtp") => (pattern, None),
        Some(other) if other.starts_with("vt") || other.starts_with("pvt") => {
            let stem = pattern.trim_end_matches(other);
            let written = format!("{stem}vtpd");
            let note = format!("a .{other} file is written as {written}");
            (written, Some(note))
        }
        _ => (pattern, None),
    }
}

/// The number at the head of a format such as `06d`; 20 at most.
fn digits(format: &str) -> usize {
    let end = format.find(|c: char| !c.is_ascii_digit()).unwrap_or(format.len());
    format[..end].parse().map_or(0, |digits: usize| digits.min(20))
}

/// A number that can be steered: `{value, minimum, maximum}`, or a number without bounds. Texts are those of others.
fn parameter(node: &Node<'_, '_>, parameters: &mut Vec<Parameter>) -> Result<(), CatalystError> {
    let name = node.name().into_owned();
    if RESERVED.contains(&name.as_str()) {
        return Err(
            node.wrong_found(format!("the name '{name}'"), format!("a name that is none of {}", RESERVED.join(", ")))
        );
    }
    let bound = |child: &std::ffi::CStr, default: f64| node.child(child).map_or(Ok(default), |child| child.number());
    let (value, minimum, maximum) = match node.kind() {
        Kind::Numbers => (node.number()?, -f64::MAX, f64::MAX),
        Kind::Object => (
            node.need(c"value", "the parameter's value")?.number()?,
            bound(c"minimum", -f64::MAX)?,
            bound(c"maximum", f64::MAX)?,
        ),
        _ => return Ok(()),
    };
    parameters.push(Parameter { name, value, minimum, maximum });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_is_seen_where_nobody_says_what_is() {
        let names = |channels: &[&str]| -> Vec<(String, Option<String>)> {
            let channels: Vec<String> = channels.iter().map(|&name| name.to_owned()).collect();
            let pipelines = default_config(&channels).expect("a configuration").pipelines;
            pipelines.into_iter().map(|pipeline| (pipeline.name, pipeline.channel)).collect()
        };
        let some = |name: &str| Some(name.to_owned());
        assert_eq!(names(&["grid"]), [("surface".to_owned(), None)]);
        assert_eq!(
            names(&["fluid", "solid"]),
            [("fluid".to_owned(), some("fluid")), ("solid".to_owned(), some("solid"))]
        );
    }

    #[test]
    fn patterns_of_paraview_become_ours() {
        for (theirs, ours) in [
            ("out-{timestep}.vtu", "out-{cycle:1}.vtu"),
            ("out-{timestep:06d}-{time}.vtp", "out-{cycle:6}-{time}.vtp"),
            ("out-%04ts.vtpd", "out-{cycle:4}.vtpd"),
            ("%ts-%t-%.3t-{time:.2f}.pvtu", "{cycle:1}-{time}-{time:3}-{time:2}.pvtu"),
            ("100%-{other}-{.vtu", "100%-{other}-{.vtu"),
            ("%", "%"),
            ("über-%03tsß.vtu", "über-{cycle:3}ß.vtu"),
        ] {
            assert_eq!(written_file(theirs), (ours.into(), None));
        }
        let (file, note) = written_file("out-{timestep}.vtm");
        assert_eq!(file, "out-{cycle:1}.vtpd");
        assert!(note.is_some_and(|note| note.contains(".vtm")));
        assert_eq!(written_file("plain.vtu"), ("plain.vtu".into(), None));
    }
}
