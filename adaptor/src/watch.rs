//! Looks at the file of the configuration again while the run goes on.

use std::{
    path::{Path, PathBuf, absolute},
    sync::{
        Arc,
        mpsc::{RecvTimeoutError, Sender, channel},
    },
    thread::JoinHandle,
    time::{Duration, SystemTime},
};

use serde_json::{Value, json};
use tombolo_pipelines::{
    language::{
        self, Config, Pipeline, PipelineChange, ReadError, check_parameters, locate, read_text,
    },
    limits::DOCUMENT,
};

use crate::{changes::Changes, steering::Source, stream::Hub};

/// How often the file is looked at. One that was changed is read once it has stayed the same for as
/// long, so that none is read half written.
const PERIOD: Duration = Duration::from_secs(1);

/// A configuration and the file that it was read from, by which a run finds out what is changed in the
/// file from then on.
#[derive(Debug, Clone)]
pub struct ConfigurationFile {
    path: PathBuf,
    stamp: Stamp,
    config: Config,
}

impl ConfigurationFile {
    /// Reads a file.
    pub(crate) fn read(path: &Path) -> Result<Self, ReadError> {
        // Before it is read: whoever writes it meanwhile is heard.
        let stamp = Stamp::of(path);
        let text = read_text(path, DOCUMENT)?;
        let config = language::check(&text, &path.display().to_string())?;
        Ok(Self { path: path.into(), stamp, config })
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The configuration that was read.
    #[must_use]
    pub fn config(&self) -> &Config {
        &self.config
    }
}

/// A thread that looks at a file; dropping it ends the thread.
pub(crate) struct Watch {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Watch {
    /// Begins with the file as it was read for the run.
    pub(crate) fn start(
        file: &ConfigurationFile,
        parameters: Vec<String>,
        changes: Arc<Changes>,
        hub: Option<Arc<Hub>>,
    ) -> std::io::Result<Self> {
        let ConfigurationFile { path, stamp, config } = file.clone();
        let file = absolute(path)?;
        let watched = Watched { known: Some(config), taken: None, seen: stamp, read: stamp };
        let mut watcher = Watcher { file, parameters, changes, hub, watched };
        let (stop, stopped) = channel();
        let watching = move || {
            while stopped.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                watcher.look();
            }
        };
        let thread = std::thread::Builder::new().name("tombolo-watch".into()).spawn(watching)?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// By what a file is known to have been changed; `None` where it is not there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stamp(Option<(SystemTime, u64)>);

impl Stamp {
    fn of(file: &Path) -> Self {
        let of = |found: std::fs::Metadata| Some((found.modified().ok()?, found.len()));
        Self(std::fs::metadata(file).ok().and_then(of))
    }
}

/// The file as it was.
struct Watched {
    /// As it was when it was read last and its pipelines were taken.
    known: Option<Config>,
    /// The change that was made of it then, and the file as it was before.
    taken: Option<(String, Option<Config>)>,
    /// As it was seen last, and read last.
    seen: Stamp,
    read: Stamp,
}

struct Watcher {
    file: PathBuf,
    parameters: Vec<String>,
    changes: Arc<Changes>,
    hub: Option<Arc<Hub>>,
    watched: Watched,
}

impl Watcher {
    fn look(&mut self) {
        let stamp = Stamp::of(&self.file);
        let has_settled = stamp == std::mem::replace(&mut self.watched.seen, stamp);
        if !has_settled || stamp == self.watched.read {
            return;
        }
        self.watched.read = stamp;
        match parse(&self.file, &self.parameters) {
            Ok(config) => self.take(config),
            Err(reason) => self.tell(&format!("{reason}; the pipelines go on as they were")),
        }
    }

    /// Makes of what was changed in the file a change of the pipelines.
    fn take(&mut self, config: Config) {
        if let Some((id, before)) = self.watched.taken.take()
            && self.changes.was_refused(&id)
        {
            // What it would have changed is changed now, if it is still so.
            self.watched.known = before;
        }
        let before = self.watched.known.as_ref();
        let needs_restart = before.map_or(Vec::new(), |before| other_keys(before, &config));
        if !needs_restart.is_empty() {
            self.tell(&format!(
                "{}: {} needs a restart; of a file that is watched only `pipelines` takes effect",
                self.file.display(),
                needs_restart.join(", ")
            ));
        }
        let before = before.map_or(&[][..], |before| &before.pipelines);
        let ahead = self.changes.ahead();
        let pipelines = merged(before, &config.pipelines, &ahead.pipelines);
        if pipelines == ahead.pipelines {
            self.watched.known = Some(config);
            return;
        }
        let change = PipelineChange::All(pipelines);
        match self.changes.take(None, Source::Configuration, change, 0) {
            Ok(id) => {
                self.watched.taken = Some((id, self.watched.known.replace(config)));
            }
            Err(problem) => self.tell(&format!(
                "{}: {problem}; the pipelines go on as they were",
                self.file.display()
            )),
        }
    }

    fn tell(&self, message: &str) {
        let (run, path) = (self.changes.run(), self.file.display());
        tracing::warn!(run, %path, "{message}");
        if let Some(hub) = &self.hub {
            let message = message.to_owned();
            hub.tell(move || json!({"error": {"message": message}}));
        }
    }
}

fn parse(file: &Path, parameters: &[String]) -> Result<Config, String> {
    let name = file.display().to_string();
    let text = read_text(file, DOCUMENT).map_err(|error| error.to_string())?;
    let config = language::check(&text, &name).map_err(|errors| errors.to_string())?;
    let known: Vec<&str> = parameters.iter().map(String::as_str).collect();
    check_parameters(&config, &known)
        .map_err(|problems| locate(problems.into_first(), &text, &name).to_string())?;
    Ok(config)
}

/// The pipelines as they are, with the changes of a file made in them: pipelines that the file did
/// not change stay, whoever brought them.
fn merged(before: &[Pipeline], after: &[Pipeline], now: &[Pipeline]) -> Vec<Pipeline> {
    if before == now {
        return after.to_vec();
    }
    fn find<'a>(all: &'a [Pipeline], name: &str) -> Option<&'a Pipeline> {
        all.iter().find(|pipeline| pipeline.name == name)
    }
    let mut merged: Vec<Pipeline> = now
        .iter()
        .filter(|now| find(before, &now.name).is_none() || find(after, &now.name).is_some())
        .cloned()
        .collect();
    for pipeline in after.iter().filter(|it| find(before, &it.name) != Some(it)) {
        match merged.iter_mut().find(|known| known.name == pipeline.name) {
            Some(place) => place.clone_from(pipeline),
            None => merged.push(pipeline.clone()),
        }
    }
    merged
}

/// The keys besides the pipelines whose values differ, in backticks.
fn other_keys(before: &Config, after: &Config) -> Vec<String> {
    let keys = |config: &Config| match json!(Config { pipelines: Vec::new(), ..config.clone() }) {
        Value::Object(keys) => keys,
        _ => Default::default(),
    };
    let (before, after) = (keys(before), keys(after));
    let all = before.keys().chain(after.keys().filter(|key| !before.contains_key(*key)));
    all.filter(|key| *key != "description" && before.get(*key) != after.get(*key))
        .map(|key| format!("`{key}`"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(keys: &str, pipelines: &[(&str, u32)]) -> Config {
        let pipeline = |(name, steps): &(&str, u32)| {
            format!(r#"{{"name": "{name}", "every": {{"steps": {steps}}}, "stages": []}}"#)
        };
        let pipelines: Vec<String> = pipelines.iter().map(pipeline).collect();
        let text = format!(r#"{{"version": 1, {keys} "pipelines": [{}]}}"#, pipelines.join(", "));
        language::parse(&text, "test.json").unwrap()
    }

    #[test]
    fn what_the_file_did_not_change_stays() {
        let of = |pipelines: &[(&str, u32)]| config("", pipelines).pipelines;
        let before = of(&[("a", 1), ("b", 1), ("c", 1)]);
        let after = of(&[("d", 1), ("c", 2), ("a", 1)]);
        assert_eq!(merged(&before, &after, &before), after, "in the order of the file");
        // Meanwhile somebody has added `e`, changed `a` and removed `c`.
        let now = of(&[("a", 9), ("b", 1), ("e", 9)]);
        let expected = of(&[("a", 9), ("e", 9), ("d", 1), ("c", 2)]);
        assert_eq!(merged(&before, &after, &now), expected);
    }

    #[test]
    fn other_keys_that_were_changed_are_named() {
        let before = config(r#""journal": "a.jsonl", "watch": true,"#, &[]);
        let after = config(r#""description": "b", "stream": {}, "watch": true,"#, &[]);
        assert_eq!(other_keys(&before, &after), ["`journal`", "`stream`"]);
        assert!(other_keys(&before, &before).is_empty());
    }
}
