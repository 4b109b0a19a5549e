//! The readers, the inputs that they are given, and what they promise.

use std::fs;

use serde_json::{Value, json};
use tombolo::{
    Adaptor, Checkpoint, Restart, Settings,
    pipelines::{
        encode::{DecodedFrame, Decoder, decode_surface},
        language::{
            Command, LanguageError, LanguageErrors, Message, TimedCommand, check, check_orders,
            parse, parse_journal, parse_message, parse_orders,
        },
    },
    recording::Recording,
};

use crate::{
    client, meshes,
    random::Random,
    relay,
    seeds::{Seeds, run, settings},
};

/// A reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Target {
    /// Files of orders.
    Orders,
    /// Messages of viewers, as the WebSocket carries them.
    Messages,
    /// Frames and surfaces that are streamed.
    Frames,
    /// Configurations.
    Pipelines,
    /// Journals.
    Journal,
    /// Recordings.
    Recordings,
    /// Checkpoints, and runs that go on from them.
    Checkpoints,
    /// Links to runs, and addresses of relays.
    Links,
    /// The messages of a run, which a client reads.
    Events,
    /// The answers of a run to a client's requests.
    Answers,
    /// The messages of viewers to a recording that is played.
    Playback,
    /// The messages of runs, which a relay reads.
    Attach,
    /// The messages of a relay, which a run reads, and the heads of the connections that it makes there.
    Relayed,
    /// Files of Gmsh.
    Msh,
    /// Unstructured grids in VTK's XML.
    Vtu,
    /// Surfaces in VTK's XML.
    Vtp,
    /// VTK's legacy files.
    Vtk,
    /// Texts with displacements of a surface.
    Displacements,
}

impl Target {
    /// All of them.
    pub const ALL: [Self; 18] = [
        Self::Orders,
        Self::Messages,
        Self::Frames,
        Self::Pipelines,
        Self::Journal,
        Self::Recordings,
        Self::Checkpoints,
        Self::Links,
        Self::Events,
        Self::Answers,
        Self::Playback,
        Self::Attach,
        Self::Relayed,
        Self::Msh,
        Self::Vtu,
        Self::Vtp,
        Self::Vtk,
        Self::Displacements,
    ];

    /// The name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Orders => "orders",
            Self::Messages => "messages",
            Self::Frames => "frames",
            Self::Pipelines => "pipelines",
            Self::Journal => "journal",
            Self::Recordings => "recordings",
            Self::Checkpoints => "checkpoints",
            Self::Links => "links",
            Self::Events => "events",
            Self::Answers => "answers",
            Self::Playback => "playback",
            Self::Attach => "attach",
            Self::Relayed => "relayed",
            Self::Msh => "msh",
            Self::Vtu => "vtu",
            Self::Vtp => "vtp",
            Self::Vtk => "vtk",
            Self::Displacements => "displacements",
        }
    }

    pub(crate) fn is_text(self) -> bool {
        !matches!(self, Self::Frames | Self::Recordings | Self::Checkpoints)
    }

    /// The sound inputs.
    pub(crate) fn seeds(self, seeds: &Seeds) -> Vec<Vec<u8>> {
        let documents = || seeds.documents.iter().map(|text| text.clone().into_bytes());
        match self {
            Self::Orders => documents().chain([seeds.journal.clone().into_bytes()]).collect(),
            Self::Pipelines => documents().collect(),
            Self::Messages => documents().chain(messages(seeds)).collect(),
            Self::Journal => vec![seeds.journal.clone().into_bytes()],
            Self::Frames => seeds.frames.clone(),
            Self::Recordings => vec![seeds.recording.clone()],
            Self::Checkpoints => seeds.checkpoints.clone(),
            Self::Links => client::link_seeds(),
            Self::Events => client::event_seeds(seeds),
            Self::Answers => client::answer_seeds(seeds),
            Self::Playback => relay::playback_seeds(),
            Self::Attach => relay::attach_seeds(),
            Self::Relayed => relay::relayed_seeds(),
            Self::Msh | Self::Vtu | Self::Vtp | Self::Vtk => meshes::mesh_seeds(self.name(), seeds),
            Self::Displacements => meshes::displacement_seeds(seeds),
        }
    }

    /// Gives a damaged input checksums that fit, most of the time: else little but the checksums
    /// would be tried.
    pub(crate) fn seal(self, input: &mut [u8], random: &mut Random) {
        if random.below(8) == 0 {
            return;
        }
        match self {
            Self::Recordings => seal_recording(input),
            Self::Checkpoints => seal_checkpoint(input),
            _ => {}
        }
    }

    /// Reads an input. What it is told in a few words; the error says which promise is broken.
    pub(crate) fn check(self, seeds: &Seeds, input: &[u8]) -> Result<String, String> {
        match self {
            Self::Orders => with_text(input, orders),
            Self::Messages => with_text(input, message),
            Self::Pipelines => with_text(input, pipelines),
            Self::Journal => with_text(input, journal),
            Self::Frames => frames(seeds, input),
            Self::Recordings => recording(seeds, input),
            Self::Checkpoints => checkpoint(input),
            Self::Links => with_text(input, client::link),
            Self::Events => with_text(input, client::events),
            Self::Answers => client::answers(input),
            Self::Playback => with_text(input, |text| {
                relay::playback(&seeds.services, &seeds.recording_file(), text)
            }),
            Self::Attach => {
                with_text(input, |text| relay::attach(&seeds.services, seeds.folder.path(), text))
            }
            Self::Relayed => with_text(input, |text| {
                relay::relayed(seeds.folder.path(), &seeds.recording_file(), text)
            }),
            Self::Msh | Self::Vtu | Self::Vtp | Self::Vtk => {
                meshes::mesh(self.name(), seeds, input)
            }
            Self::Displacements => meshes::displacement(seeds, input),
        }
    }
}

/// Messages of viewers.
fn messages(seeds: &Seeds) -> impl Iterator<Item = Vec<u8>> {
    let order = json!({"edits": [{"scale_direction": {"features": ["a"], "fixed": [],
                                                      "factors": [1, 1, 2]}}],
                       "deform": {"method": "elasticity"}, "schedule": {"steps": 4}});
    let others = [
        json!({"id": "a", "order": order}),
        json!({"id": "b", "forecast": order}),
        json!({"withdraw_forecast": {}}),
        json!({"keep": {}}),
        json!({"cancel": {"order": "a"}}),
        json!({"parameter": {"name": "heating", "value": 2.0}}),
        json!({"pause": {}}),
        json!({"resume": {}}),
        json!({"stop": {}}),
        json!({"drive": {}}),
        json!({"here": {}}),
        json!({"hand_over": {"to": "c2"}}),
        json!({"kick": {"client": "c2"}}),
        json!({"id": "l", "link": {"for": "watch"}}),
        json!({"name": {"name": "Anna"}}),
        json!({"follow": {"on": true}}),
        json!({"camera": {"position": [0, 0, 5], "focal_point": [0, 0, 0], "view_up": [0, 1, 0],
                          "parallel": false, "parallel_scale": 1, "view_angle": 30}}),
        json!({"note": {"text": "here\nand there", "at": [1, 2.5, -3], "cycle": 3}}),
        json!({"remove_note": {"number": 1}}),
        json!({"views": {"names": ["boundary"]}}),
        json!({"views": {}}),
        json!({"id": "p", "pipelines": {"remove": ["boundary"]}}),
    ];
    let documents = seeds.documents.iter().filter_map(|text| serde_json::from_str(text).ok());
    let wrapped = documents.map(|document: Value| json!({"id": "c", "order": document}));
    wrapped
        .chain(others)
        .map(|message| message.to_string().into_bytes())
        .collect::<Vec<_>>()
        .into_iter()
}

fn with_text(
    input: &[u8],
    check: impl Fn(&str) -> Result<String, String>,
) -> Result<String, String> {
    // Where bytes come from, what is no text is refused before.
    std::str::from_utf8(input).map_or_else(|_| Ok("no text".into()), check)
}

/// Whether two readings of a text that should agree do, with the outcome.
fn agreed<T, E: ToString, F: ToString>(
    text: &str,
    first: &Result<T, E>,
    second: &Result<T, F>,
) -> Result<(), String> {
    match (first, second) {
        (Ok(_), Err(error)) => {
            Err(format!("one reader takes it, the other says: {}: {text}", error.to_string()))
        }
        (Err(error), Ok(_)) => {
            Err(format!("one reader says: {}, the other takes it: {text}", error.to_string()))
        }
        _ => Ok(()),
    }
}

/// A value that was read must be the same when it was written and read again.
fn returns<T: serde::Serialize + PartialEq>(
    value: &T,
    read: impl Fn(&str) -> Result<T, String>,
) -> Result<(), String> {
    let text =
        serde_json::to_string(value).map_err(|error| format!("it cannot be written: {error}"))?;
    let again =
        read(&text).map_err(|error| format!("what was written is not read: {error}: {text}"))?;
    if again != *value {
        return Err(format!("what was written is read as another: {text}"));
    }
    Ok(())
}

/// Reads a text by both readers of a kind of file, the one that stops at the first error and the one
/// that finds them all.
fn file<T: serde::Serialize + PartialEq>(
    text: &str,
    parse: impl Fn(&str) -> Result<T, LanguageError>,
    check: impl Fn(&str) -> Result<T, LanguageErrors>,
) -> Result<String, String> {
    let read = parse(text);
    agreed(text, &read, &check(text))?;
    match read {
        Ok(value) => {
            returns(&value, |text| parse(text).map_err(|error| error.to_string()))?;
            Ok("read".into())
        }
        Err(error) => Ok(error.to_string()),
    }
}

fn orders(text: &str) -> Result<String, String> {
    let name = "orders.json";
    file(text, |text| parse_orders(text, name), |text| check_orders(text, name))
}

fn pipelines(text: &str) -> Result<String, String> {
    let name = "pipelines.json";
    file(text, |text| parse(text, name), |text| check(text, name))
}

fn message(text: &str) -> Result<String, String> {
    match parse_message(text) {
        (_, Ok(Message::Command(command))) => {
            let name = command.name();
            returns(&command, |text| match parse_message(text) {
                (_, Ok(Message::Command(command))) => Ok(command),
                (_, Ok(_)) => Err("it is no command".into()),
                (_, Err(error)) => Err(error.to_string()),
            })?;
            // It is journaled, and kept in checkpoints.
            timed(command)?;
            Ok(name.into())
        }
        (id, Ok(Message::Question(question))) => {
            returns(&question, |text| match parse_message(text) {
                (_, Ok(Message::Question(question))) => Ok(question),
                (_, Ok(_)) => Err("it is no question".into()),
                (_, Err(error)) => Err(error.to_string()),
            })?;
            Ok(format!("a question, {}", id.is_some()))
        }
        (id, Ok(Message::Wheel(wheel))) => Ok(format!("{}, {}", kind(&wheel), id.is_some())),
        (id, Ok(Message::Together(together))) => {
            Ok(format!("{}, {}", kind(&together), id.is_some()))
        }
        (id, Err(error)) => Ok(format!("{error}, {}", id.is_some())),
    }
}

/// The kind of a message.
fn kind(message: &impl std::fmt::Debug) -> String {
    let text = format!("{message:?}");
    text.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().to_owned()
}

/// A command is the same where it is one of a file.
fn timed(command: Command) -> Result<(), String> {
    let timed = vec![TimedCommand { id: None, at: None, command }];
    returns(&timed, |text| parse_orders(text, "orders.json").map_err(|error| error.to_string()))
}

fn journal(text: &str) -> Result<String, String> {
    let read = parse_journal(text, "journal.jsonl");
    let Ok(recording) = read else { return Ok(format!("{:?}", read.err())) };
    if text.ends_with('\n') {
        // A run that was killed leaves part of a line.
        let torn = format!("{text}{{\"id\":\"torn\",\"status\":\"acc");
        match parse_journal(&torn, "journal.jsonl") {
            Ok(again) if again.commands == recording.commands => {}
            Ok(_) => return Err("half a line at the end changes the commands".into()),
            Err(error) => return Err(format!("half a line at the end is refused: {error}")),
        }
    }
    Ok(format!("{:?} {}", recording.run.is_some(), recording.commands.len().min(9)))
}

fn sound(frame: &DecodedFrame) -> bool {
    frame.view.len() <= 1 << 20
}

fn frames(seeds: &Seeds, input: &[u8]) -> Result<String, String> {
    let mut decoder = Decoder::new();
    let key = seeds.frames.first().ok_or("the run has streamed no frame")?;
    decoder.decode(key).map_err(|error| format!("a sound frame is refused: {error}"))?;
    let outcome = match decoder.decode(input) {
        Ok(frame) if sound(&frame) => "a frame".into(),
        Ok(_) => return Err("the name of the view is longer than the message".into()),
        Err(error) => error.to_string(),
    };
    decoder.decode(key).map_err(|error| format!("refused after a damaged frame: {error}"))?;
    let surface =
        decode_surface(input).map_or_else(|error| error.to_string(), |_| "a surface".into());
    Ok(format!("{outcome} {surface}"))
}

fn recording(seeds: &Seeds, input: &[u8]) -> Result<String, String> {
    let file = seeds.folder.path().join("damaged.tombolo");
    fs::write(&file, input).map_err(|error| error.to_string())?;
    let mut recording = match Recording::open(&file) {
        Ok(recording) => recording,
        Err(error) => return Ok(error.to_string()),
    };
    if recording.lost_bytes() > input.len() as u64 {
        return Err("more bytes are lost than there are".into());
    }
    let mut kinds = [0_u32; 2];
    let last = recording.last();
    for seconds in [0.0, last.seconds / 2.0, last.seconds, -1.0, f64::NAN, f64::INFINITY] {
        recording.seek(seconds);
        while let Ok(Some(message)) = recording.read_next() {
            kinds[usize::from(matches!(
                message.message,
                tombolo::recording::RecordedMessage::Frame { .. }
            ))] += 1;
        }
        let _ = (recording.hello(seconds), recording.orders(seconds));
        let _ = (recording.seconds_of_cycle(last.cycle), recording.seconds_of_time(last.time));
    }
    // As letters, for an outcome is told from others without its numbers.
    let [texts, frames] = kinds.map(|count| "i".repeat(count.min(64) as usize));
    Ok(format!("texts {texts} frames {frames}, lost {}", recording.lost_bytes() > 0))
}

fn checkpoint(input: &[u8]) -> Result<String, String> {
    let checkpoint = match Checkpoint::from_bytes(input) {
        Ok(checkpoint) => checkpoint,
        Err(error) => return Ok(error.to_string()),
    };
    let again = checkpoint.to_bytes();
    let again = Checkpoint::from_bytes(&again)
        .map_err(|error| format!("what was written is not read: {error}"))?;
    let begin = again.cycle().map_or(0, |cycle| cycle.saturating_add(1));
    let output = tempfile::tempdir().map_err(|error| error.to_string())?;
    let restart = Some(Restart::Checkpoint(Box::new(again)));
    let adaptor = Adaptor::initialize(Settings { restart, ..settings(output.path())? });
    let adaptor = match adaptor {
        Ok(adaptor) => adaptor,
        Err(error) => return Ok(error.to_string()),
    };
    let ran = run(adaptor, begin..begin.saturating_add(3), |_, _| {});
    Ok(ran.map_or_else(|error| error, |()| "a run".into()))
}

/// Bytes before what is held in a checkpoint, and before the message in a recording.
const HEADS: [usize; 2] = [20, 41];
/// Bytes at the beginning of a recording.
const MAGIC: usize = 12;

fn seal_checkpoint(input: &mut [u8]) {
    let length = input.len();
    if length < HEADS[0] + 4 {
        return;
    }
    let (head, rest) = input.split_at_mut(HEADS[0]);
    let (held, checksum) = rest.split_at_mut(length - HEADS[0] - 4);
    head[HEADS[0] - 8..].copy_from_slice(&(held.len() as u64).to_le_bytes());
    checksum.copy_from_slice(&crc32fast::hash(held).to_le_bytes());
}

fn seal_recording(input: &mut [u8]) {
    let mut at = MAGIC;
    while let Some(head) = input.get(at..at + HEADS[1]) {
        let length = u32::from_le_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let begin = at + HEADS[1];
        let checksum = input.get(begin..begin.saturating_add(length)).map(crc32fast::hash);
        let head = &mut input[at..begin];
        if let Some(checksum) = checksum {
            head[33..37].copy_from_slice(&checksum.to_le_bytes());
        }
        let checksum = crc32fast::hash(&head[..37]);
        head[37..].copy_from_slice(&checksum.to_le_bytes());
        at = begin.saturating_add(length);
    }
}
