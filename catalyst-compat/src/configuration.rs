//! What `catalyst_initialize` says: pipelines, parameters, orders, the ranks.

use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use serde_json::json;
use tombolo::foreign::{RunError, declare};
use tombolo::pipelines::language::{self, Config, Pipeline, Steering, StreamServer, TimedCommand};
use tombolo::{ConfigurationFile, Parameter};

use crate::node::{Kind, Node};
use crate::results::RESERVED;

/// The variable that names a configuration, for a solver whose own input names none.
const PIPELINES: &str = "TOMBOLO_PIPELINES";
/// The variable that names a file of orders.
const ORDERS: &str = "TOMBOLO_ORDERS";
/// The variable that names a checkpoint to go on from.
const RESTART: &str = "TOMBOLO_RESTART";
/// The variable that names the directory of what is written.
const OUTPUT: &str = "TOMBOLO_OUTPUT";

/// The variable that names the file of the report at the end.
const REPORT: &str = "TOMBOLO_REPORT";

/// The set-up of a run.
#[derive(Debug)]
pub(crate) struct Configuration {
    /// The pipelines, and how they are served.
    pub(crate) config: Config,
    /// Whether no file names a pipeline: then the surface of every channel is watched besides.
    pub(crate) is_default: bool,
    /// The pipelines of each script and pipeline of the node, by its name there; none where the
    /// node names no pipelines.
    pub(crate) groups: Groups,
    pub(crate) parameters: Vec<Parameter>,
    pub(crate) orders: Vec<TimedCommand>,
    pub(crate) output: PathBuf,
    /// The file that is watched.
    pub(crate) file: Option<ConfigurationFile>,
    /// The checkpoint that the run goes on from.
    pub(crate) restart: Option<String>,
    /// Requests that are not carried out, for the log.
    pub(crate) notes: Vec<String>,
}

/// Names, each with those of the pipelines that it stands for.
pub(crate) type Groups = Vec<(String, Vec<String>)>;

/// The pipelines and files found on the way through the node.
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
    /// Reads `catalyst` of the node of `catalyst_initialize`; without one everything is the
    /// default.
    pub(crate) fn read(root: &Node<'_, '_>) -> Result<Self, RunError> {
        let mut found = Found::default();
        let (mut parameters, mut orders) = (Vec::new(), Vec::new());
        let mut restart = variable(RESTART);
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
            if let Some(file) = catalyst.child(c"restart") {
                restart = Some(file.text()?.into_owned());
            }
        }
        let mut of_user = None;
        if let Some(file) = variable(PIPELINES) {
            if found.files.is_empty() {
                of_user = Some(file);
            } else {
                found.notes.push(format!(
                    "{PIPELINES}={file} is passed over: the solver names a configuration itself"
                ));
            }
        }
        if let Some(file) = variable(ORDERS) {
            orders = tombolo::Settings::default().orders_from_file(&file)?.orders;
        }
        let is_default = found.files.is_empty() && of_user.is_none();
        let (config, groups, file) = merged(&mut found, of_user.as_deref())?;
        Ok(Self {
            config,
            is_default,
            groups,
            parameters,
            orders,
            output: variable(OUTPUT).map_or_else(|| PathBuf::from("."), PathBuf::from),
            file,
            restart,
            notes: found.notes,
        })
    }
}

/// The Fortran handle of the communicator that the node of `catalyst_initialize` names.
pub(crate) fn communicator(root: &Node<'_, '_>) -> Result<Option<i32>, RunError> {
    let Some(catalyst) = root.child(c"catalyst") else { return Ok(None) };
    let Some(handle) = catalyst.child(c"mpi_comm") else { return Ok(None) };
    let expected = "the Fortran handle of a communicator";
    let value = i32::try_from(handle.integer(expected)?);
    value.map(Some).map_err(|_| handle.wrong(expected))
}

fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok().filter(|value| !value.is_empty())
}

/// Where the report of the run goes.
pub(crate) fn report_file() -> Option<String> {
    variable(REPORT)
}

/// The surface of each channel, for whoever opens the link, beside the pipelines of a
/// configuration.
pub(crate) fn with_default_views(config: &Config, channels: &[String]) -> Result<Config, RunError> {
    let mut views = default_config(channels)?;
    for view in &mut views.pipelines {
        while config.pipelines.iter().any(|pipeline| pipeline.name == view.name) {
            view.name.insert_str(0, "view of ");
        }
    }
    views.pipelines.extend(config.pipelines.iter().cloned());
    Ok(views)
}

/// The surface of each channel.
fn default_config(channels: &[String]) -> Result<Config, RunError> {
    let stages = json!([{"surface": {}}, {"stream": {}}]);
    let view = |channel: &String| match channels {
        // One channel needs no name beside what is seen of it.
        [_] => json!({"name": "surface", "every": {"steps": 1}, "stages": stages}),
        _ => json!({"name": channel, "channel": channel, "every": {"steps": 1}, "stages": stages}),
    };
    let pipelines: Vec<_> = channels.iter().map(view).collect();
    let config = json!({"version": 1, "stream": {}, "pipelines": pipelines});
    Ok(language::check(&config.to_string(), "the default configuration")?)
}

/// The configurations of all files as one, and what the node itself asks for; which pipelines each
/// name in the node stands for; and the file that is watched. The user's file has no such name: no
/// solver chooses what it says.
fn merged(
    found: &mut Found,
    of_user: Option<&str>,
) -> Result<(Config, Groups, Option<ConfigurationFile>), RunError> {
    let own = json!({"version": 1, "pipelines": found.pipelines});
    let mut config = language::check(&own.to_string(), "catalyst/pipelines")?;
    let mut groups: Groups = found.others.iter().map(|name| (name.clone(), Vec::new())).collect();
    let mut of_solver: Vec<String> =
        config.pipelines.iter().map(|pipeline| pipeline.name.clone()).collect();
    let mut settings = Settings::default();
    let mut pipelines = Vec::new();
    for (name, file) in &found.files {
        let next = settings.take(file, &mut found.notes)?;
        let names: Vec<String> = next.iter().map(|pipeline| pipeline.name.clone()).collect();
        of_solver.extend_from_slice(&names);
        groups.push((name.clone(), names));
        pipelines.extend(next);
    }
    if let Some(file) = of_user {
        pipelines.extend(settings.take(file, &mut found.notes)?);
    }
    pipelines.append(&mut config.pipelines);
    config.pipelines = pipelines;
    config.stream = settings.stream.map(|(stream, _)| stream);
    config.journal = settings.journal.map(|(journal, _)| journal);
    if let Some(((record, megabytes), _)) = settings.record {
        (config.record, config.record_megabytes) = (Some(record), megabytes);
    }
    config.watch = settings.watch.is_some();
    config.steering = settings.steering.map(|(steering, _)| steering).unwrap_or_default();
    // Where there is nothing to choose from, the names are those of another implementation's
    // scripts.
    if of_solver.is_empty() {
        groups.clear();
    }
    // A pipeline stands for itself too, unless something in the node has its name.
    for name in of_solver {
        if !groups.iter().any(|(known, _)| *known == name) {
            groups.push((name.clone(), vec![name]));
        }
    }
    Ok((config, groups, settings.watch))
}

/// Settings that a run has once, each with the file that says it: the first that does.
#[derive(Default)]
struct Settings {
    stream: Option<(StreamServer, String)>,
    journal: Option<(String, String)>,
    /// The recording, and how long it may be.
    record: Option<((String, NonZeroU32), String)>,
    steering: Option<(Steering, String)>,
    /// The file that is watched.
    watch: Option<ConfigurationFile>,
}

impl Settings {
    /// Takes in what a file says that none has said before, and gives its pipelines. What it says
    /// otherwise is told.
    fn take(&mut self, file: &str, notes: &mut Vec<String>) -> Result<Vec<Pipeline>, RunError> {
        fn first<T: PartialEq>(
            known: &mut Option<(T, String)>,
            said: Option<T>,
            what: &str,
            file: &str,
            notes: &mut Vec<String>,
        ) {
            match (&known, said) {
                (None, Some(said)) => *known = Some((said, file.to_owned())),
                (Some((held, before)), Some(said)) if *held != said => {
                    notes
                        .push(format!("'{what}' of {file} is passed over: that of {before} holds"));
                }
                _ => {}
            }
        }
        let tombolo::Settings { config, file: read, .. } = tombolo::Settings::from_file(file)?;
        // What a file does not say is what it would be by itself.
        let steering = Some(config.steering).filter(|steering| *steering != Steering::default());
        first(&mut self.stream, config.stream, "stream", file, notes);
        first(&mut self.journal, config.journal, "journal", file, notes);
        let record = config.record.map(|record| (record, config.record_megabytes));
        first(&mut self.record, record, "record", file, notes);
        first(&mut self.steering, steering, "steering", file, notes);
        if config.watch {
            match &self.watch {
                None => self.watch = read,
                Some(before) => {
                    let before = before.path().display();
                    notes.push(format!("'watch' of {file} is passed over: {before} is watched"));
                }
            }
        }
        Ok(config.pipelines)
    }
}

fn each(
    node: &Node<'_, '_>,
    visit: impl FnMut(&Node<'_, '_>) -> Result<(), RunError>,
) -> Result<(), RunError> {
    if !matches!(node.kind(), Kind::Object | Kind::List | Kind::Empty) {
        return Err(node.wrong("an object or a list"));
    }
    node.each(visit)
}

fn is_json(file: &str) -> bool {
    Path::new(file).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"))
}

/// A script is a file, or an object with `filename`; ours are JSON.
fn script(node: &Node<'_, '_>, found: &mut Found) -> Result<(), RunError> {
    let file = match node.kind() {
        Kind::Text => node.text()?.into_owned(),
        _ => node.need(c"filename", "the script's file")?.text()?.into_owned(),
    };
    if is_json(&file) {
        found.files.push((node.name().into_owned(), file));
    } else {
        let path = node.path();
        found.others.push(node.name().into_owned());
        found.notes.push(format!(
            "'{path}': {file} is not run: a configuration is a file that ends in .json"
        ));
    }
    Ok(())
}

/// A pipeline of Catalyst: `io` writes files; a text, or an object with `filename` and no other
/// type, names a configuration.
fn pipeline(node: &Node<'_, '_>, found: &mut Found) -> Result<(), RunError> {
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
        "" => Err(file_node.wrong_found(
            format!("'{file}'"),
            "a file that ends in .json, or the type 'io' beside it",
        )),
        other => {
            let kind = node.need(c"type", "'io'")?;
            Err(kind.wrong_found(format!("'{other}'"), "'io', or a filename that ends in .json"))
        }
    }
}

/// ParaView's pattern as ours: `{timestep:04d}` of today and `%04ts` of before, `{time:.3f}` and
/// `%.3t`. Files of VTK's other kinds are written as .vtpd, which holds any mesh.
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
            let digits = behind.len()
                - behind.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.').len();
            let (name, letters) = match &behind[digits..] {
                text if text.starts_with("ts") => ("timestep", 2),
                text if text.starts_with('t') => ("time", 1),
                _ => ("", 0),
            };
            (name, &behind[..digits], digits + letters)
        };
        match name {
            "timestep" | "cycle" => {
                pattern.push_str(&format!("{{cycle:{}}}", digits(format).max(1)))
            }
            "time" if format.contains('.') => {
                pattern.push_str(&format!(
                    "{{time:{}}}",
                    digits(format.split_once('.').map_or("", |(_, after)| after))
                ));
            }
            "time" => pattern.push_str("{time}"),
            // Not one of ParaView's: what checks the configuration tells what may stand in braces.
            _ => pattern.push_str(&rest[at..=at + length]),
        }
        rest = &behind[length..];
    }
    pattern.push_str(rest);
    let extension =
        Path::new(&pattern).extension().map(|extension| extension.to_string_lossy().into_owned());
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

/// A number that can be steered: `{value, minimum, maximum}`, or a number without bounds. Texts are
/// those of others.
fn parameter(node: &Node<'_, '_>, parameters: &mut Vec<Parameter>) -> Result<(), RunError> {
    let name = node.name().into_owned();
    if RESERVED.contains(&name.as_str()) {
        return Err(node.wrong_found(
            format!("the name '{name}'"),
            format!("a name that is none of {}", RESERVED.join(", ")),
        ));
    }
    let bound = |child: &std::ffi::CStr, default: f64| {
        node.child(child).map_or(Ok(default), |child| child.number())
    };
    let (value, minimum, maximum) = match node.kind() {
        Kind::Numbers => (node.number()?, -f64::MAX, f64::MAX),
        Kind::Object => (
            node.need(c"value", "the parameter's value")?.number()?,
            bound(c"minimum", -f64::MAX)?,
            bound(c"maximum", f64::MAX)?,
        ),
        _ => return Ok(()),
    };
    Ok(declare(parameters, Parameter { name, value, minimum, maximum })?)
}

#[cfg(test)]
mod tests {
    use tombolo::pipelines::language::Listen;

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
    fn configurations_are_one_and_what_is_passed_over_is_told() {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let file = |name: &str, text: &str| {
            let path = directory.path().join(name);
            std::fs::write(&path, text).expect("can be written");
            path.to_string_lossy().into_owned()
        };
        let pipeline = |name: &str| {
            format!(r#""pipelines": [{{"name": "{name}", "stages": [{{"quality": {{}}}}]}}]"#)
        };
        let one = file(
            "one.json",
            &format!(r#"{{"version": 1, "journal": "a.jsonl", {}}}"#, pipeline("one")),
        );
        let two = file(
            "two.json",
            &format!(
                r#"{{"version": 1, "watch": true, "journal": "b.jsonl", "stream": {{"listen": "127.0.0.1:0"}}, "steering": {{"background": false}}, {}}}"#,
                pipeline("two")
            ),
        );
        let three = file(
            "three.json",
            &format!(
                r#"{{"version": 1, "watch": true, "steering": {{"poll_steps": 4}}, {}}}"#,
                pipeline("three")
            ),
        );
        let files = [("a", &one), ("b", &two)].map(|(name, file)| (name.to_owned(), file.clone()));
        let io = json!({"name": "io", "channel": "grid", "every": {"steps": 1}, "stages": [{"write": {"file": "a.vtu"}}]});
        let mut found = Found { files: files.to_vec(), pipelines: vec![io], ..Found::default() };
        let (config, groups, watched) = merged(&mut found, Some(&three)).expect("a configuration");
        let names: Vec<&str> =
            config.pipelines.iter().map(|pipeline| pipeline.name.as_str()).collect();
        assert_eq!(names, ["one", "two", "three", "io"]);
        assert!(
            !config.steering.background && config.steering.poll_steps.get() == 1,
            "the second file's steering holds"
        );
        assert_eq!(config.journal.as_deref(), Some("a.jsonl"));
        assert!(config.stream.as_ref().is_some_and(
            |stream| matches!(stream.listen, Some(Listen::Address(address)) if address.port() == 0)
        ));
        assert_eq!(
            found.notes,
            [
                format!("'journal' of {two} is passed over: that of {one} holds"),
                format!("'steering' of {three} is passed over: that of {two} holds"),
                format!("'watch' of {three} is passed over: {two} is watched"),
            ]
        );
        assert!(config.watch && watched.is_some_and(|file| file.path().ends_with("two.json")));
        // No solver chooses among what the user asks for.
        let known: Vec<&str> = groups.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(known, ["a", "b", "io", "one", "two"]);
        let views = with_default_views(&config, &["one".to_owned(), "grid".to_owned()])
            .expect("a configuration");
        let names: Vec<&str> =
            views.pipelines.iter().map(|pipeline| pipeline.name.as_str()).collect();
        assert_eq!(names, ["view of one", "grid", "one", "two", "three", "io"]);
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
