//! Journals: every command of a run and what became of it, and each shape that the solver was
//! handed.

use std::collections::HashMap;
use std::num::NonZeroU64;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tombolo_deform::quality::Guard;
use tombolo_deform::schedule::Schedule;

use super::order::Command;
use super::parse::{Document, check_length};
use super::relative_files::resolve_command_files;
use super::scan::Member;
use super::timed::{CommandAuthor, JournalEntry, OrderStatus, TimedCommand, lines, torn_line};
use super::together::{PinnedNote, pin};
use super::{At, Deformation, LanguageError, Problem, near};
use crate::limits::{WAITING, WAITING_BYTES};

/// A line of a journal that is about the run and not about one command.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum JournalNote {
    /// A run begins. Lines of earlier runs may stand above it.
    Run(RunHeader),
    /// The solver was handed a shape.
    Shape(HandedShape),
    /// A viewer came or left.
    Viewer(ViewerNote),
    /// A request was refused; told once a minute for each address.
    Refused(RefusedRequest),
    /// Lines are missing here.
    Lost(LostLines),
    /// A note was pinned in the picture.
    Note(PinnedNote),
    /// A note was taken away.
    NoteRemoved(UnpinnedNote),
    /// A checkpoint was made here, from which another run can go on where it was then saved.
    Checkpoint(CheckpointNote),
    /// The run came to its end.
    End(RunEnd),
}

/// The first line of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunHeader {
    /// The run, told apart from all others by a random number.
    pub id: String,
    /// The version of the library.
    pub version: String,
    /// When it began, in seconds since 1970-01-01 UTC.
    pub began: u64,
    /// How the motion of the surface is carried into the volume by orders that do not say so.
    pub deform: Deformation,
    /// The guard of orders that bring none.
    pub guard: Guard,
    /// The schedule of orders that bring none.
    pub schedule: Schedule,
    /// The checkpoint that the run goes on from, where it is a restart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub restart: Option<RestartedFrom>,
}

/// The checkpoint that a run goes on from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RestartedFrom {
    /// The run that made it.
    pub run: String,
    /// The checkpoint.
    pub checkpoint: String,
    /// The cycle that it was made after.
    pub cycle: u64,
}

/// A checkpoint, made after the lines above it. Whether it was then saved the journal does not know.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckpointNote {
    /// The checkpoint, told apart from all others by a random number.
    pub id: String,
    /// The cycle of the last call before it.
    pub cycle: u64,
    /// The simulated time then.
    pub time: f64,
}

/// A shape that the solver was handed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HandedShape {
    /// The id of its order.
    pub order: String,
    /// Which shape of the order it is, counted from 1; 2.5 lies half way from the second to the
    /// third.
    pub shape: f64,
    /// The cycle over whose step the mesh moves there.
    pub cycle: u64,
}

/// Who came or left.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewerNote {
    /// The viewer's name in the run.
    pub name: String,
    /// The address that it came from.
    pub address: String,
    /// The name that it has given itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub called: Option<String>,
    /// Whether it came with the secret or link for driving.
    pub may_drive: bool,
    /// The action.
    pub did: ViewerMove,
    /// How many lines about viewers with the same rights were left out before this one, because there
    /// were too many.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<NonZeroU64>,
}

/// An action of a viewer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ViewerMove {
    /// It was let in.
    Came,
    /// Its connection has ended.
    Left,
    /// It was given a link for a browser that watches.
    TookWatchingLink,
    /// It was given a link for a browser that may drive.
    TookDrivingLink,
}

/// A note that was taken away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnpinnedNote {
    /// The number of the note.
    pub number: u64,
}

/// Who was not let in.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RefusedRequest {
    /// The address that the request came from.
    pub address: String,
}

/// Lines that could neither be written nor kept until they could.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LostLines {
    /// How many.
    pub lines: u64,
}

/// The last line of a run that was not killed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunEnd {
    /// The cycle of its last call.
    pub cycle: u64,
    /// The simulated time then.
    pub time: f64,
}

/// The newest run of a journal, as it is carried out again: the same shapes at the same cycles. Of a
/// run that was restarted it holds what was before the checkpoint too.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Recording {
    /// Its first line; `None` in a journal without one.
    pub run: Option<RunHeader>,
    /// The commands that took effect, in that order, each at its cycle. The commands of pipelines
    /// are among them.
    pub commands: Vec<TimedCommand>,
    /// The shapes that the solver was handed, in that order.
    pub shapes: Vec<HandedShape>,
    /// The notes that were pinned at its end, the oldest first.
    pub notes: Vec<PinnedNote>,
    /// The lines that are missing.
    pub lost: u64,
}

/// Reads a journal as a recording of its newest run.
///
/// Orders that were rejected, cancelled or still waiting when the run ended are not in it. A run that
/// goes on from a checkpoint of an earlier one begins with the lines of that one up to there, but for
/// its pauses and stops. A last line that a killed run left half-written is passed over. Files that
/// edits name lie beside `file` where they are relative.
///
/// # Errors
/// A [`LanguageError`] at the first line that is wrong.
///
/// # Example
/// ```
/// use tombolo_pipelines::language::parse_journal;
///
/// let journal = r#"{"id":"a","status":"accepted","cycle":3,"time":0.3,"order":{"undo":1}}
/// {"id":"b","status":"accepted","cycle":4,"time":0.4,"order":{"undo":1}}
/// {"id":"a","status":"applied","cycle":5,"time":0.5}
/// {"shape":{"order":"a","shape":0.5,"cycle":7}}
/// {"id":"c","status":"acc"#;
/// let recording = parse_journal(journal, "journal.jsonl").unwrap();
/// assert_eq!((recording.commands.len(), recording.shapes[0].cycle), (1, 7));
/// ```
pub fn parse_journal(text: &str, file: &str) -> Result<Recording, LanguageError> {
    check_length(text.len(), file, WAITING_BYTES)?;
    let KnownLines { run, commands, shapes, notes, lost } = read_lines(text, file)?;
    let commands = commands.into_iter().filter(|known| known.is_carried_out);
    let mut commands: Vec<_> = commands.collect();
    commands.sort_by_key(|known| known.took_effect);
    let mut commands: Vec<TimedCommand> = commands.into_iter().map(|known| known.timed).collect();
    commands.iter_mut().for_each(|timed| resolve_command_files(&mut timed.command, file));
    Ok(Recording { run, commands, shapes, notes, lost })
}

/// The commands of a text whose lines are those of a journal, timed commands, or both.
pub(super) fn parse_lines(text: &str, file: &str) -> Result<Vec<TimedCommand>, LanguageError> {
    let is_given_again = |known: &Known| matches!(known.by, Some(CommandAuthor::Pipeline(_)));
    let known = read_lines(text, file)?.commands.into_iter();
    let mut commands: Vec<Known> =
        known.filter(|known| known.is_carried_out && !is_given_again(known)).collect();
    commands.sort_by_key(|known| known.took_effect);
    Ok(commands.into_iter().map(Known::alone).collect())
}

/// A command of a journal.
struct Known {
    timed: TimedCommand,
    by: Option<CommandAuthor>,
    /// The number of the line that says when it took effect.
    took_effect: usize,
    is_carried_out: bool,
    /// Whether it stands in lines of a journal.
    is_entry: bool,
}

impl Known {
    /// The command as one of a file of orders.
    fn alone(mut self) -> TimedCommand {
        if let (true, Command::Order(order)) = (self.is_entry, &mut self.timed.command) {
            // The order whose place it took is not among those that were carried out.
            order.replaces = None;
        }
        self.timed
    }
}

/// The lines of the newest run.
#[derive(Default)]
struct KnownLines {
    run: Option<RunHeader>,
    commands: Vec<Known>,
    shapes: Vec<HandedShape>,
    notes: Vec<PinnedNote>,
    lost: u64,
}

/// A line and its number from 0.
type Numbered<'a> = (usize, &'a str);

/// The lines of a run, those before its checkpoint among them.
#[derive(Default)]
struct RunLines<'a> {
    lines: Vec<Numbered<'a>>,
    known: KnownLines,
    indices: HashMap<String, usize>,
}

fn read_lines(text: &str, file: &str) -> Result<KnownLines, LanguageError> {
    let mut earlier: HashMap<String, Vec<Numbered<'_>>> = HashMap::new();
    let mut newest = RunLines::default();
    let mut id = None;
    for (number, content) in lines(text) {
        let moved = at_line(number);
        let line = match Document::read(content, file) {
            Err(_) if torn_line(text) == Some(number) => break,
            line => line.map_err(&moved)?,
        };
        if let [member] = line.root.members()
            && member.key == "run"
        {
            let JournalNote::Run(run) = line.value().map_err(&moved)? else { continue };
            let RunLines { lines, .. } = std::mem::take(&mut newest);
            id.replace(run.id.clone()).map(|before| earlier.insert(before, lines));
            if let Some(from) = &run.restart {
                let Some(lines) = earlier.get(&from.run) else {
                    let message = format!(
                        "the run goes on from a checkpoint of run {}, whose lines are not above; \
                         expected the journal that both have written",
                        from.run
                    );
                    let problem = Problem::new(message).within("restart").within("run");
                    return Err(moved(line.locate(problem)));
                };
                for (number, content) in before(lines, &from.checkpoint).to_vec() {
                    newest.add(&Document::read(content, file).map_err(at_line(number))?, number)?;
                    newest.lines.push((number, content));
                }
                let of_job = newest.known.commands.iter_mut();
                let of_job = of_job.filter(|known| known.timed.command.is_of_job());
                of_job.for_each(|known| known.is_carried_out = false);
            }
        }
        newest.add(&line, number)?;
        newest.lines.push((number, content));
    }
    Ok(newest.known)
}

/// Puts a failure in the line of this number, from 0, where it says the first.
fn at_line(number: usize) -> impl Fn(LanguageError) -> LanguageError {
    move |failure| LanguageError { line: failure.line + number, ..failure }
}

/// The lines up to a checkpoint; all where a run was killed before it had written that down.
fn before<'l, 'a>(lines: &'l [Numbered<'a>], checkpoint: &str) -> &'l [Numbered<'a>] {
    let is_it = |(_, content): &Numbered<'_>| {
        let note = || serde_json::from_str(content).ok();
        content.contains(checkpoint)
            && matches!(note(), Some(JournalNote::Checkpoint(note)) if note.id == checkpoint)
    };
    let end = lines.iter().position(is_it).map_or(lines.len(), |index| index + 1);
    &lines[..end]
}

impl RunLines<'_> {
    /// Takes the next line in.
    fn add(&mut self, line: &Document<'_>, number: usize) -> Result<(), LanguageError> {
        let moved = at_line(number);
        let Self { known, indices, .. } = self;
        if is_note(line) {
            match line.value().map_err(&moved)? {
                // The settings of orders are those that the whole run began with.
                JournalNote::Run(run) => {
                    // One that goes on from another writes down again what is still pinned.
                    known.notes.clear();
                    _ = known.run.get_or_insert(run);
                }
                JournalNote::Shape(shape) => known.shapes.push(shape),
                JournalNote::Lost(LostLines { lines }) => known.lost += lines,
                JournalNote::Note(note) => pin(&mut known.notes, note)
                    .map_err(|exceeded| moved(line.locate(exceeded.into())))?,
                JournalNote::NoteRemoved(UnpinnedNote { number }) => {
                    known.notes.retain(|note| note.number != number);
                }
                JournalNote::Viewer(_)
                | JournalNote::Refused(_)
                | JournalNote::Checkpoint(_)
                | JournalNote::End(_) => {}
            }
            return Ok(());
        }
        WAITING
            .check(known.commands.len() + 1)
            .map_err(|exceeded| moved(line.locate(exceeded.into())))?;
        if !is_entry(line) {
            let timed = line.valid().map_err(moved)?;
            known.commands.push(Known {
                timed,
                by: None,
                took_effect: number,
                is_carried_out: true,
                is_entry: false,
            });
            return Ok(());
        }
        let entry: JournalEntry = line.valid().map_err(moved)?;
        let at = Some(At::Cycle(entry.cycle));
        let index = indices.get(&entry.id).copied();
        match (entry.status, entry.command, index) {
            (status @ (OrderStatus::Accepted | OrderStatus::Applied), Some(command), None) => {
                indices.insert(entry.id.clone(), known.commands.len());
                // What it did stands in what became of the order that it took back.
                let is_carried_out =
                    status == OrderStatus::Applied && !matches!(command, Command::Cancel(_));
                known.commands.push(Known {
                    timed: TimedCommand { at, id: Some(entry.id), command },
                    by: entry.by,
                    took_effect: number,
                    is_carried_out,
                    is_entry: true,
                });
            }
            // Given again, perhaps with another text, after it was taken back.
            (OrderStatus::Accepted, Some(command), Some(index))
                if !known.commands[index].is_carried_out =>
            {
                let again = &mut known.commands[index];
                again.timed.command = command;
                (again.timed.at, again.by, again.took_effect) = (at, entry.by, number);
            }
            (OrderStatus::Applied, _, Some(index)) => {
                let command = &mut known.commands[index];
                command.timed.at = at;
                command.took_effect = number;
                command.is_carried_out = !matches!(command.timed.command, Command::Cancel(_));
            }
            (OrderStatus::Rejected, _, Some(index)) => {
                known.commands[index].is_carried_out = false;
            }
            // What became of the mesh; the replaying solver does with it what it does.
            _ => {}
        }
        Ok(())
    }
}

/// Whether a line is one of a journal: it holds a status, or is a note.
pub(super) fn is_of_journal(line: &Document<'_>) -> bool {
    is_entry(line) || is_note(line)
}

fn is_entry(line: &Document<'_>) -> bool {
    line.root.member("status").is_some()
}

const NOTES: [&str; 9] =
    ["run", "shape", "viewer", "refused", "lost", "note", "note_removed", "checkpoint", "end"];

/// Whether a line is a note.
pub(super) fn is_note(line: &Document<'_>) -> bool {
    matches!(line.root.members(), [member] if NOTES.contains(&&*member.key))
}

/// Whether a line is one of a journal about a command, whose key may be misspelt.
pub(super) fn is_like_entry(line: &Document<'_>) -> bool {
    let is_like = |member: &Member| near(&member.key, ["status"]).next().is_some();
    line.root.members().iter().any(is_like)
}

/// Whether a text could be a journal that is continued: it is empty, or its first line is one of a
/// journal or torn.
#[must_use]
pub fn is_journal(text: &str) -> bool {
    match lines(text).next() {
        None => true,
        Some((_, line)) => match Document::read(line, "journal") {
            Ok(line) => is_of_journal(&line),
            Err(_) => is_torn_entry(text),
        },
    }
}

/// Whether a text is nothing but the beginning of a journal's first line: that of a run that was
/// killed while it wrote it.
pub(super) fn is_torn_entry(text: &str) -> bool {
    let begins = |start: &&str| text.starts_with(start);
    text.lines().count() == 1
        && !text.ends_with('\n')
        && ["{\"run\":{", "{\"id\":\""].iter().any(begins)
}

#[cfg(test)]
mod tests;
