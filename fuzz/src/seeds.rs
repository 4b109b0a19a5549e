//! Sound inputs: what the documents show, and what a small run leaves behind.

use std::{
    fs,
    path::{Path, PathBuf},
};

use serde_json::json;
use tombolo::{
    Adaptor, Channel, FieldView, MeshView, Settings, Step,
    deform::shapes::box_of_tets,
    pipelines::language::{parse, parse_orders},
    recording::{RecordedMessage, Recording},
};

use crate::relay::Services;

/// Sound inputs of all kinds.
pub struct Seeds {
    /// The JSON of the documents and of the examples.
    pub(crate) documents: Vec<String>,
    /// The journal of the run.
    pub(crate) journal: String,
    /// Its recording.
    pub(crate) recording: Vec<u8>,
    /// The frames in the recording, as viewers are sent them.
    pub(crate) frames: Vec<Vec<u8>>,
    /// The texts behind its greeting.
    pub(crate) texts: Vec<String>,
    /// Checkpoints of the run: in the midst of a schedule, and behind it.
    pub(crate) checkpoints: Vec<Vec<u8>>,
    /// Servers that are begun where they are needed.
    pub(crate) services: Services,
    /// A folder for files.
    pub(crate) folder: tempfile::TempDir,
}

/// The configuration of the run.
const PIPELINES: &str = r#"{"version": 1, "record": "run.tombolo", "journal": "journal.jsonl", "pipelines": [
    {"name": "boundary", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]},
    {"name": "health", "every": {"steps": 2}, "stages": [{"quality": {}}]}]}"#;
/// The recording of the run, as the configuration names it.
const RECORDING: &str = "run.tombolo";
/// Steps of the run.
const STEPS: u64 = 12;

/// Takes so many steps of a solver that does nothing but what it is asked for.
pub(crate) fn run(
    mut adaptor: Adaptor,
    steps: std::ops::Range<u64>,
    mut between: impl FnMut(u64, &mut Adaptor),
) -> Result<(), String> {
    let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let (mut points, tets) = (mesh.points().to_vec(), mesh.cells().connectivity().to_vec());
    let temperature: Vec<f64> = points.iter().map(|point| point[2]).collect();
    for cycle in steps {
        let fields = [FieldView::vertex("temperature", &temperature)];
        let solid = Channel::new("solid", MeshView::tets(&points, &tets), &fields);
        let step = Step { cycle, time: 0.01 * cycle as f64, time_step: 0.01 };
        let steering = adaptor.execute(&step, &[solid]).map_err(|error| error.to_string())?;
        if let Some(motion) = steering.motion {
            points.copy_from_slice(&motion.coordinates);
        }
        between(cycle, &mut adaptor);
    }
    adaptor.finalize().map(drop).map_err(|error| error.to_string())
}

/// The settings of the run, whose files lie in a folder.
pub(crate) fn settings(output: &Path) -> Result<Settings, String> {
    let config = parse(PIPELINES, "pipelines.json").map_err(|error| error.to_string())?;
    Ok(Settings { config, output: output.into(), ..Settings::default() })
}

impl Seeds {
    /// Reads the documents, and carries out the run.
    ///
    /// # Errors
    /// The reason why that cannot be done.
    pub fn new() -> Result<Self, String> {
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let squeeze = |by: f64| {
            json!({"edits": [{"translate": {"features": ["feature-6"], "fixed": ["feature-1"], "by": [0, 0, -by]}}],
                   "schedule": {"steps": 3}})
        };
        let orders = json!([
            {"at": {"cycle": 2}, "order": squeeze(0.1)}, {"at": {"cycle": 3}, "order": squeeze(0.9)},
            {"at": {"cycle": 8}, "order": {"undo": 1}}, {"at": {"time": 0.5}, "order": squeeze(0.2)}]);
        let orders = parse_orders(&orders.to_string(), "orders.json");
        let orders = orders.map_err(|error| error.to_string())?;
        let settings = Settings { orders, ..settings(folder.path())? };
        let adaptor = Adaptor::initialize(settings).map_err(|error| error.to_string())?;
        let mut checkpoints = Vec::new();
        run(adaptor, 0..STEPS, |cycle, adaptor| {
            if [3, 9].contains(&cycle) {
                checkpoints.push(adaptor.checkpoint().to_bytes());
            }
            // So that the frames are taken up one by one.
            std::thread::sleep(std::time::Duration::from_millis(5));
        })?;
        let read =
            |name: &str| fs::read(folder.path().join(name)).map_err(|error| error.to_string());
        let journal =
            String::from_utf8(read("journal.jsonl")?).map_err(|error| error.to_string())?;
        let recording = read(RECORDING)?;
        let mut recorded =
            Recording::open(folder.path().join(RECORDING)).map_err(|error| error.to_string())?;
        let (mut frames, mut texts) = (Vec::new(), Vec::new());
        while let Ok(Some(message)) = recorded.read_next() {
            match message.message {
                RecordedMessage::Frame { bytes, .. } => frames.push(bytes),
                RecordedMessage::Text(text) if text.starts_with("{\"hello\"") => {}
                RecordedMessage::Text(text) => texts.push(text),
            }
        }
        let (documents, services) = (documents(), Services::default());
        Ok(Self { documents, journal, recording, frames, texts, checkpoints, services, folder })
    }

    /// The file of the recording.
    pub(crate) fn recording_file(&self) -> PathBuf {
        self.folder.path().join(RECORDING)
    }
}

/// The JSON in the documents, and the files of the examples.
fn documents() -> Vec<String> {
    let house = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut files = Vec::new();
    for folder in ["docs", "docs/pipelines", "examples/flow/cases", "examples/heat"] {
        let entries = fs::read_dir(house.join(folder)).into_iter().flatten().flatten();
        files.extend(entries.map(|entry| entry.path()));
    }
    files.sort();
    let text = |file: &PathBuf| fs::read_to_string(file).unwrap_or_default();
    let has = |file: &&PathBuf, kind| file.extension().is_some_and(|it| it == kind);
    let shown = files.iter().filter(|file| has(file, "md")).map(text).flat_map(|text| {
        let blocks = text.split("```json").skip(1);
        let blocks = blocks.filter_map(|block| block.split("```").next().map(str::to_owned));
        blocks.collect::<Vec<_>>()
    });
    let given = files.iter().filter(|file| has(file, "json")).map(text);
    shown.chain(given).filter(|text| text.len() < 20_000).collect()
}
