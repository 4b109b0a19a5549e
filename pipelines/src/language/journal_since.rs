//! What the journal of a run that was killed holds beyond its checkpoint.

use std::collections::{HashMap, HashSet};
use std::io::BufRead;

use serde::{Deserialize, Serialize};

use super::journal::{HandedShape, JournalNote, UnpinnedNote};
use super::order::Command;
use super::timed::{CommandAuthor, JournalEntry, OrderStatus};
use super::together::{PinnedNote, pin};
use crate::limits::{Exceeded, WAITING, WAITING_BYTES};

/// What a run did after its checkpoint, as far as its journal holds it: all that whoever goes on from
/// there would not do by himself.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Since {
    /// The commands that were accepted after the checkpoint, or before it with nothing known of what
    /// became of them; in the order in which they took effect, those that did not at the end.
    /// Commands of files and pipelines are not among them, because these give them again.
    pub commands: Vec<Taken>,
    /// The shapes that the solver was handed, in that order.
    pub shapes: Vec<HandedShape>,
    /// The notes that were pinned at the end of the journal, the oldest first; also those from before
    /// the checkpoint.
    pub notes: Vec<PinnedNote>,
    /// The last cycle of which the journal tells what the solver did.
    pub until: Option<u64>,
}

/// A command that was accepted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Taken {
    /// Its name.
    pub id: String,
    /// Who gave it.
    pub by: CommandAuthor,
    /// The command.
    pub command: Command,
    /// What became of it.
    pub outcome: Outcome,
    /// Whether it was accepted before the checkpoint.
    pub is_before: bool,
}

/// What became of a command.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Nothing that is known.
    Open {},
    /// It took effect.
    Applied {
        /// The cycle.
        cycle: u64,
        /// Whether a command of a file or a pipeline took effect before it in the same call.
        comes_late: bool,
    },
    /// It changed nothing.
    Rejected {
        /// The cycle.
        cycle: u64,
        /// Why.
        reason: String,
    },
}

/// Why a journal cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SinceError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] std::io::Error),
    /// A line is no line of a journal.
    #[error("line {line}: {message}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        message: String,
    },
    /// There is more of something than a run takes.
    #[error(transparent)]
    Limit(#[from] Exceeded),
}

impl Since {
    /// Reads what `run` did after a checkpoint. A torn last line is passed over. No more is kept in
    /// memory than what may wait in a run.
    ///
    /// # Errors
    /// [`SinceError`], which names the line.
    pub fn read(
        mut journal: impl BufRead,
        run: &str,
        checkpoint: &str,
    ) -> Result<Self, SinceError> {
        let most = WAITING_BYTES.most as u64;
        let (mut number, mut line) = (0, Vec::new());
        let mut found: Option<Reader> = None;
        loop {
            line.clear();
            let read = std::io::Read::take(&mut journal, most).read_until(b'\n', &mut line)?;
            number += 1;
            if read == 0 || line.last() != Some(&b'\n') {
                break;
            }
            let header = line.starts_with(b"{\"run\":").then(|| serde_json::from_slice(&line));
            if let Some(header) = header {
                if found.is_some() {
                    break;
                }
                if matches!(header, Ok(JournalNote::Run(header)) if header.id == run) {
                    found = Some(Reader::default());
                }
                continue;
            }
            let Some(reader) = &mut found else { continue };
            let entry = serde_json::from_slice(&line);
            reader.add(
                entry.map_err(|error: serde_json::Error| SinceError::Line {
                    line: number,
                    message: error.to_string(),
                })?,
                checkpoint,
            )?;
        }
        Ok(found.unwrap_or_default().finish())
    }
}

/// A line about a command or about the run.
#[derive(Deserialize)]
#[serde(untagged)]
enum Line {
    Entry(Box<JournalEntry>),
    Note(Box<JournalNote>),
}

#[derive(Default)]
struct Reader {
    /// Each with the number of the line that says what became of it.
    taken: HashMap<String, (usize, Taken)>,
    order: Vec<String>,
    /// The commands of files and pipelines.
    given_again: HashSet<String>,
    shapes: Vec<HandedShape>,
    notes: Vec<PinnedNote>,
    until: Option<u64>,
    /// The cycle at which a command that is given again took effect last.
    last_given_again: Option<u64>,
    has_checkpoint: bool,
    lines: usize,
}

impl Reader {
    fn add(&mut self, line: Line, checkpoint: &str) -> Result<(), Exceeded> {
        self.lines += 1;
        match line {
            Line::Note(note) => match *note {
                JournalNote::Checkpoint(note) if note.id == checkpoint => {
                    self.has_checkpoint = true;
                    self.taken.retain(|_, (_, taken)| taken.outcome == Outcome::Open {});
                    self.shapes.clear();
                    (self.until, self.last_given_again) = (None, None);
                }
                JournalNote::Shape(shape) => {
                    self.until = self.until.max(Some(shape.cycle));
                    self.shapes.push(shape);
                }
                JournalNote::Note(note) => pin(&mut self.notes, note)?,
                JournalNote::NoteRemoved(UnpinnedNote { number }) => {
                    self.notes.retain(|note| note.number != number);
                }
                _ => {}
            },
            Line::Entry(entry) => return self.add_entry(*entry),
        }
        Ok(())
    }

    fn add_entry(&mut self, entry: JournalEntry) -> Result<(), Exceeded> {
        let JournalEntry { id, status, cycle, command, by, reason, .. } = entry;
        let is_given_again =
            matches!(by, Some(CommandAuthor::File | CommandAuthor::Pipeline(_)) | None);
        if let Some(command) = command.filter(|_| status == OrderStatus::Accepted) {
            if is_given_again {
                self.given_again.insert(id);
            } else if !self.taken.contains_key(&id) {
                let by = by.unwrap_or(CommandAuthor::Program);
                let (outcome, is_before) = (Outcome::Open {}, !self.has_checkpoint);
                let taken = Taken { id: id.clone(), by, command, outcome, is_before };
                self.order.push(id.clone());
                self.taken.insert(id, (usize::MAX, taken));
                WAITING.check(self.taken.len())?;
            }
            return Ok(());
        }
        if matches!(status, OrderStatus::NotFollowed | OrderStatus::NotConfirmed) {
            return Ok(());
        }
        self.until = self.until.max(Some(cycle));
        let comes_late = self.last_given_again == Some(cycle);
        if let Some((line, taken)) = self.taken.get_mut(&id) {
            *line = self.lines;
            taken.outcome = match status {
                OrderStatus::Applied => Outcome::Applied { cycle, comes_late },
                _ => Outcome::Rejected { cycle, reason: reason.unwrap_or_default() },
            };
            if !self.has_checkpoint {
                // Before the checkpoint what is settled is known to it.
                self.taken.remove(&id);
                self.order.retain(|known| *known != id);
            }
        } else if self.given_again.remove(&id) {
            self.last_given_again = Some(cycle);
        }
        Ok(())
    }

    fn finish(mut self) -> Since {
        if !self.has_checkpoint {
            // The line about the checkpoint was lost, and with it all that came after.
            (self.shapes, self.until) = (Vec::new(), None);
        }
        let taken = self.order.iter().filter_map(|id| self.taken.remove(id));
        let mut taken: Vec<(usize, Taken)> = taken.collect();
        taken.sort_by_key(|(line, _)| *line);
        let commands = taken.into_iter().map(|(_, taken)| taken).collect();
        Since { commands, shapes: self.shapes, notes: self.notes, until: self.until }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOURNAL: &str = r#"{"run":{"id":"r1","version":"0","began":0,"deform":{},"guard":{},"schedule":{"steps":1}}}
{"id":"a","status":"accepted","cycle":1,"time":0,"order":{"undo":1},"by":{"viewer":"c1"}}
{"id":"a","status":"applied","cycle":2,"time":0}
{"id":"open","status":"accepted","cycle":2,"time":0,"order":{"undo":1},"by":{"viewer":"c1"}}
{"shape":{"order":"a","shape":1,"cycle":2}}
{"checkpoint":{"id":"k","cycle":2,"time":0}}
{"id":"f","status":"accepted","cycle":4,"time":0,"order":{"undo":1},"by":"file"}
{"id":"b","status":"accepted","cycle":3,"time":0,"order":{"undo":1},"by":{"viewer":"c1"}}
{"id":"f","status":"applied","cycle":4,"time":0}
{"shape":{"order":"f","shape":1,"cycle":4}}
{"id":"b","status":"applied","cycle":4,"time":0}
{"id":"open","status":"rejected","cycle":5,"time":0,"reason":"cancelled"}
{"id":"p","status":"accepted","cycle":5,"time":0,"parameter":{"name":"x","value":1},"by":{"viewer":"c1"}}
{"id":"torn","sta"#;

    #[test]
    fn what_came_after_a_checkpoint_is_found() {
        let since = Since::read(JOURNAL.as_bytes(), "r1", "k").unwrap();
        let outcomes: Vec<_> =
            since.commands.iter().map(|taken| (&*taken.id, taken.outcome.clone())).collect();
        assert_eq!(
            outcomes,
            [
                ("b", Outcome::Applied { cycle: 4, comes_late: true }),
                ("open", Outcome::Rejected { cycle: 5, reason: "cancelled".into() }),
                ("p", Outcome::Open {}),
            ]
        );
        assert_eq!((since.shapes.len(), since.until), (1, Some(5)));
        assert_eq!(Since::read(JOURNAL.as_bytes(), "r2", "k").unwrap(), Since::default());
    }

    #[test]
    fn without_the_checkpoints_line_only_what_is_open_counts() {
        let cut = JOURNAL.find("{\"checkpoint\"").unwrap();
        let since = Since::read(&JOURNAL.as_bytes()[..cut], "r1", "k").unwrap();
        let ids: Vec<_> = since.commands.iter().map(|taken| &*taken.id).collect();
        assert_eq!((ids, since.shapes.len(), since.until), (vec!["open"], 0, None));
    }

    #[test]
    fn a_journal_cut_anywhere_is_read_or_refused() {
        for end in 0..JOURNAL.len() {
            Since::read(&JOURNAL.as_bytes()[..end], "r1", "k").unwrap();
        }
        let broken = JOURNAL.replace("\"status\":\"applied\",\"cycle\":4", "\"status\":7");
        let error = Since::read(broken.as_bytes(), "r1", "k").unwrap_err();
        assert!(error.to_string().starts_with("line 9: "), "{error}");
    }
}
