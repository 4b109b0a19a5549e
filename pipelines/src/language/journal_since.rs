//! What the journal of a run that was killed holds beyond its checkpoint.

use std::collections::{HashMap, HashSet};
use std::io::BufRead;

use serde::{Deserialize, Serialize};

use super::journal::{HandedShape, JournalNote, RestartedFrom, UnpinnedNote};
use super::journal_file::RUN_LINE;
use super::order::Command;
use super::timed::{CommandAuthor, JournalEntry, OrderStatus};
use super::together::{PinnedNote, pin};
use crate::limits::{DOCUMENT, Exceeded, WAITING};

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
    /// Whether the journal tells of the checkpoint. Where it does not, what was accepted after that is not
    /// known.
    pub has_checkpoint: bool,
}

/// A command that was accepted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Taken {
    /// Its name.
    pub id: String,
    /// Who gave it.
    pub by: CommandAuthor,
    /// The command; `None` where the lines that were read do not have it, which the checkpoint has.
    pub command: Option<Command>,
    /// What became of it.
    pub outcome: Outcome,
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
    /// Reads what a run did after a checkpoint, and what the runs did that have gone on from there
    /// since: each may have been killed before it had a checkpoint of its own. What a later one did
    /// holds; what it had not come to again is still to come. A torn last line is passed over. Of
    /// commands no more is kept in memory than may wait in a run; of shapes what was handed out.
    ///
    /// # Errors
    /// [`SinceError`], which names the line.
    pub fn read(mut journal: impl BufRead, from: &RestartedFrom) -> Result<Self, SinceError> {
        let (mut number, mut line) = (0, Vec::new());
        let mut reader = Reader::default();
        loop {
            line.clear();
            let most = DOCUMENT.most as u64 + 1;
            let read = std::io::Read::take(&mut journal, most).read_until(b'\n', &mut line)?;
            number += 1;
            let wrong = |message: String| SinceError::Line { line: number, message };
            if let Err(exceeded) = DOCUMENT.check(read) {
                if reader.is_among_them {
                    return Err(wrong(exceeded.to_string()));
                }
                // What other runs left in the file is none of this one's trouble.
                if line.last() != Some(&b'\n') {
                    journal.skip_until(b'\n')?;
                }
                continue;
            }
            if read == 0 || line.last() != Some(&b'\n') {
                break;
            }
            if line.starts_with(RUN_LINE) {
                reader.begin(serde_json::from_slice(&line).ok(), from);
                continue;
            }
            if !reader.is_among_them {
                continue;
            }
            let entry = serde_json::from_slice(&line);
            reader.add(
                entry.map_err(|error: serde_json::Error| wrong(error.to_string()))?,
                &from.checkpoint,
            )?;
        }
        Ok(reader.finish())
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
    /// The run that made the checkpoint, and those that have gone on from there.
    runs: HashSet<String>,
    /// Whether the lines are of one of them.
    is_among_them: bool,
    taken: HashMap<String, Taken>,
    /// The names of commands that were accepted, the oldest first.
    accepted: Vec<String>,
    history: History,
    /// The history of the runs before, as far as the one that is read has not come to it again.
    before: History,
    /// The commands of files and pipelines.
    given_again: HashSet<String>,
    notes: Vec<PinnedNote>,
    /// The cycle at which a command that is given again took effect last.
    last_given_again: Option<u64>,
    has_checkpoint: bool,
}

/// What became of commands and of the mesh, in that order.
#[derive(Default)]
struct History {
    /// The names of commands and the cycle at which it was settled what becomes of them.
    settled: Vec<(String, u64)>,
    shapes: Vec<HandedShape>,
    until: Option<u64>,
}

impl History {
    /// Takes the part up to a cycle out.
    fn up_to(&mut self, cycle: u64) -> Self {
        let rest = |settled: &(String, u64)| settled.1 > cycle;
        let (later, settled) = std::mem::take(&mut self.settled).into_iter().partition(rest);
        let (later_shapes, shapes) =
            std::mem::take(&mut self.shapes).into_iter().partition(|shape| shape.cycle > cycle);
        (self.settled, self.shapes) = (later, later_shapes);
        Self { settled, shapes, until: self.until.min(Some(cycle)) }
    }

    /// Puts behind this what a run before it did, as far as this one has not come to it.
    fn go_on_with(&mut self, before: Self) {
        let known: HashSet<&String> = self.settled.iter().map(|(id, _)| id).collect();
        let left: Vec<_> =
            before.settled.into_iter().filter(|(id, _)| !known.contains(id)).collect();
        self.settled.extend(left);
        let last = self.shapes.last().map(|shape| shape.cycle);
        self.shapes.extend(before.shapes.into_iter().filter(|shape| Some(shape.cycle) > last));
        self.until = self.until.max(before.until);
    }
}

impl Reader {
    /// Takes the first line of a run in.
    fn begin(&mut self, header: Option<JournalNote>, from: &RestartedFrom) {
        self.is_among_them = false;
        let Some(JournalNote::Run(header)) = header else { return };
        let goes_on = header
            .restart
            .filter(|restart| self.runs.contains(&restart.run) && restart.cycle >= from.cycle);
        if header.id != from.run && goes_on.is_none() {
            return;
        }
        self.runs.insert(header.id);
        self.is_among_them = true;
        self.given_again.clear();
        self.last_given_again = None;
        self.join();
        if let Some(restart) = goes_on {
            // It has the line about its checkpoint behind it, also where that was lost.
            self.come_to_checkpoint();
            self.before = std::mem::take(&mut self.history);
            self.history = self.before.up_to(restart.cycle);
        }
    }

    /// Makes one history of that of the run which was read and that of those before it.
    fn join(&mut self) {
        let before = std::mem::take(&mut self.before);
        self.history.go_on_with(before);
    }

    /// Lets go of what the checkpoint knows.
    fn come_to_checkpoint(&mut self) {
        if !std::mem::replace(&mut self.has_checkpoint, true) {
            // What still waits is in the checkpoint, whoever gave it.
            self.given_again.clear();
            self.taken.retain(|_, taken| taken.outcome == Outcome::Open {});
            self.history = History::default();
            self.last_given_again = None;
        }
    }

    fn add(&mut self, line: Line, checkpoint: &str) -> Result<(), Exceeded> {
        match line {
            Line::Note(note) => match *note {
                JournalNote::Checkpoint(note) if note.id == checkpoint => {
                    self.come_to_checkpoint();
                }
                JournalNote::Shape(shape) => {
                    self.history.until = self.history.until.max(Some(shape.cycle));
                    self.history.shapes.push(shape);
                }
                JournalNote::Note(note) => {
                    // A run that goes on writes down again what is pinned.
                    self.notes.retain(|known| known.number != note.number);
                    pin(&mut self.notes, note)?;
                }
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
                return Ok(());
            }
            let taken = self.taken(id.clone())?;
            // One that was taken back, as from a disk that did not answer, may have been given again.
            let is_anew = matches!(taken.outcome, Outcome::Rejected { .. });
            if is_anew {
                taken.outcome = Outcome::Open {};
                self.history.settled.retain(|(known, _)| *known != id);
            }
            let taken = self.taken(id)?;
            if taken.command.is_none() || is_anew {
                taken.by = by.unwrap_or(CommandAuthor::Program);
                taken.command = Some(command);
            }
            return Ok(());
        }
        if matches!(status, OrderStatus::NotFollowed | OrderStatus::NotConfirmed) {
            return Ok(());
        }
        self.history.until = self.history.until.max(Some(cycle));
        if self.given_again.remove(&id) {
            self.last_given_again = Some(cycle);
        } else if self.has_checkpoint {
            let comes_late = self.last_given_again == Some(cycle);
            // One that is new here was accepted before, and is in the checkpoint.
            let outcome = match status {
                OrderStatus::Applied => Outcome::Applied { cycle, comes_late },
                _ => Outcome::Rejected { cycle, reason: reason.unwrap_or_default() },
            };
            let taken = self.taken(id.clone())?;
            if std::mem::replace(&mut taken.outcome, outcome) != (Outcome::Open {}) {
                self.history.settled.retain(|(known, _)| *known != id);
            }
            self.history.settled.push((id, cycle));
        } else if self.taken.remove(&id).is_some() {
            // Before the checkpoint what is settled is known to it.
            self.accepted.retain(|known| *known != id);
        }
        Ok(())
    }

    /// The command of this name.
    fn taken(&mut self, id: String) -> Result<&mut Taken, Exceeded> {
        if !self.taken.contains_key(&id) {
            WAITING.check(self.taken.len() + 1)?;
            self.accepted.push(id.clone());
        }
        let (by, command, outcome) = (CommandAuthor::Program, None, Outcome::Open {});
        let new = Taken { id: id.clone(), by, command, outcome };
        Ok(self.taken.entry(id).or_insert(new))
    }

    fn finish(mut self) -> Since {
        self.join();
        if !self.has_checkpoint {
            // The line about the checkpoint was lost, and with it all that came after.
            self.history = History::default();
        }
        let History { settled, shapes, until } = self.history;
        let names = settled.into_iter().map(|(id, _)| id).chain(self.accepted);
        let commands = names.filter_map(|id| self.taken.remove(&id)).collect();
        Since { commands, shapes, notes: self.notes, until, has_checkpoint: self.has_checkpoint }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

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

    fn read(journal: &str, run: &str) -> Result<Since, SinceError> {
        let from = RestartedFrom { run: run.into(), checkpoint: "k".into(), cycle: 2 };
        Since::read(journal.as_bytes(), &from)
    }

    #[test]
    fn what_came_after_a_checkpoint_is_found() {
        let since = read(JOURNAL, "r1").unwrap();
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
        assert_eq!((since.shapes.len(), since.until, since.has_checkpoint), (1, Some(5), true));
        assert_eq!(read(JOURNAL, "r2").unwrap(), Since::default());
    }

    /// A slow disk has an order refused and writes its lines after all; its client then gives it again.
    #[test]
    fn an_order_that_is_given_again_after_it_was_refused_is_open() {
        let again = r#"{"id":"open","status":"accepted","cycle":6,"time":0,"order":{"undo":3},"by":{"viewer":"c2"}}
"#;
        let end = JOURNAL.find("{\"id\":\"torn\"").unwrap();
        let text = format!("{}{again}", &JOURNAL[..end]);
        let since = read(&text, "r1").unwrap();
        assert_eq!(settled(&since), [("b", 4), ("open", 0), ("p", 0)]);
        let open = &since.commands[1];
        assert_eq!(open.by, CommandAuthor::Viewer("c2".into()));
        let Some(Command::Order(order)) = &open.command else { panic!("{open:?}") };
        assert_eq!(serde_json::to_value(order).unwrap()["undo"], 3);
        let done = r#"{"id":"open","status":"applied","cycle":7,"time":0}
"#;
        let since = read(&format!("{text}{done}"), "r1").unwrap();
        assert_eq!(settled(&since), [("b", 4), ("open", 7), ("p", 0)]);
    }

    #[test]
    fn without_the_checkpoints_line_only_what_is_open_counts() {
        let cut = JOURNAL.find("{\"checkpoint\"").unwrap();
        let since = read(&JOURNAL[..cut], "r1").unwrap();
        let ids: Vec<_> = since.commands.iter().map(|taken| &*taken.id).collect();
        assert_eq!((ids, since.shapes.len(), since.until), (vec!["open"], 0, None));
        assert!(!since.has_checkpoint);
    }

    #[test]
    fn a_journal_cut_anywhere_is_read_or_refused() {
        for end in 0..JOURNAL.len() {
            read(&JOURNAL[..end], "r1").unwrap();
        }
        let broken = JOURNAL.replace("\"status\":\"applied\",\"cycle\":4", "\"status\":7");
        let error = read(&broken, "r1").unwrap_err();
        assert!(error.to_string().starts_with("line 9: "), "{error}");
    }

    /// Lines of other runs are passed over, however long they are; one of this run is named.
    #[test]
    fn a_line_that_is_too_long_matters_in_its_own_run_alone() {
        let from = RestartedFrom { run: "r1".into(), checkpoint: "k".into(), cycle: 2 };
        let after = |begin: &'static [u8], end: &'static [u8]| {
            let long = std::io::repeat(b'x').take(DOCUMENT.most as u64);
            Since::read(std::io::BufReader::new(begin.chain(long).chain(end)), &from)
        };
        let other = JOURNAL.lines().next().unwrap().replace("r1", "r0") + "\n\"";
        let end = format!("\"\n{JOURNAL}");
        let since = after(other.leak().as_bytes(), end.leak().as_bytes()).unwrap();
        assert_eq!(since, read(JOURNAL, "r1").unwrap());
        let own = JOURNAL.lines().next().unwrap().to_owned() + "\n\"";
        let error = after(own.leak().as_bytes(), b"\"\n").unwrap_err().to_string();
        assert!(error.starts_with("line 2: "), "{error}");
    }

    #[test]
    fn what_became_of_a_command_is_known_where_the_checkpoint_alone_has_it() {
        let lines = goes_on(
            "r2",
            ("r1", "k", 2),
            r#"{"checkpoint":{"id":"k2","cycle":2,"time":0}}
{"id":"open","status":"applied","cycle":4,"time":0}
{"shape":{"order":"open","shape":1,"cycle":4}}
"#,
        );
        let from = RestartedFrom { run: "r2".into(), checkpoint: "k2".into(), cycle: 2 };
        let since = Since::read(format!("{JOURNAL}\n{lines}").as_bytes(), &from).unwrap();
        assert_eq!(settled(&since), [("open", 4)]);
        assert_eq!(since.commands[0].command, None);
    }

    /// The lines of a run that goes on from the checkpoint, or from one of a run that did.
    fn goes_on(id: &str, from: (&str, &str, u64), lines: &str) -> String {
        let (run, checkpoint, cycle) = from;
        let restart =
            format!(r#""restart":{{"run":"{run}","checkpoint":"{checkpoint}","cycle":{cycle}}}"#);
        let header =
            JOURNAL.lines().next().unwrap().replace("\"id\":\"r1\"", &format!("\"id\":\"{id}\""));
        format!("{}{restart}}}}}\n{lines}", header.replace("}}}", "},"))
    }

    fn settled(since: &Since) -> Vec<(&str, u64)> {
        let cycle = |taken: &Taken| match taken.outcome {
            Outcome::Open {} => 0,
            Outcome::Applied { cycle, .. } | Outcome::Rejected { cycle, .. } => cycle,
        };
        since.commands.iter().map(|taken| (&*taken.id, cycle(taken))).collect()
    }

    #[test]
    fn what_runs_did_that_were_killed_after_it_is_found_too() {
        let whole = &JOURNAL[..JOURNAL.rfind('\n').unwrap() + 1];
        // It came to the cycle 4 again, was killed before that was written whole, and took another in.
        let second = goes_on(
            "r2",
            ("r1", "k", 2),
            r#"{"id":"b","status":"accepted","cycle":4,"time":0,"order":{"undo":1},"by":{"viewer":"c1"}}
{"id":"f","status":"accepted","cycle":4,"time":0,"order":{"undo":1},"by":"file"}
{"id":"f","status":"applied","cycle":4,"time":0}
{"id":"new","status":"accepted","cycle":4,"time":0,"order":{"undo":1},"by":{"viewer":"c2"}}
"#,
        );
        let since = read(&format!("{whole}{second}"), "r1").unwrap();
        assert_eq!(settled(&since), [("b", 4), ("open", 5), ("p", 0), ("new", 0)]);
        assert_eq!((since.shapes.len(), since.until), (1, Some(5)));
        // The next one went on beyond the end of both.
        let third = goes_on(
            "r3",
            ("r1", "k", 2),
            r#"{"id":"b","status":"applied","cycle":4,"time":0}
{"shape":{"order":"f","shape":1,"cycle":4}}
{"id":"open","status":"rejected","cycle":5,"time":0,"reason":"cancelled"}
{"id":"new","status":"applied","cycle":7,"time":0}
{"shape":{"order":"new","shape":1,"cycle":7}}
{"checkpoint":{"id":"k3","cycle":7,"time":0}}
{"id":"lost","status":"accepted","cycle":8,"time":0,"order":{"undo":1},"by":{"viewer":"c2"}}
{"id":"lost","status":"applied","cycle":8,"time":0}
{"shape":{"order":"lost","shape":1,"cycle":8}}
"#,
        );
        let since = read(&format!("{whole}{second}{third}"), "r1").unwrap();
        let expected = [("b", 4), ("open", 5), ("new", 7), ("lost", 8), ("p", 0)];
        assert_eq!(settled(&since), expected);
        let cycles: Vec<u64> = since.shapes.iter().map(|shape| shape.cycle).collect();
        assert_eq!((&cycles[..], since.until), (&[4, 7, 8][..], Some(8)));
        // One that went on from the checkpoint of that one has not done again all that came after it.
        let fourth = goes_on(
            "r4",
            ("r3", "k3", 7),
            r#"{"id":"late","status":"accepted","cycle":8,"time":0,"order":{"undo":1},"by":{"viewer":"c2"}}
"#,
        );
        let since = read(&format!("{whole}{second}{third}{fourth}"), "r1").unwrap();
        let expected = [("b", 4), ("open", 5), ("new", 7), ("lost", 8), ("p", 0), ("late", 0)];
        assert_eq!((settled(&since), since.until), (expected.into(), Some(8)));
        // A run of its own in between is none of them.
        let other = goes_on("r5", ("r0", "k", 2), &third[third.find('\n').unwrap() + 1..]);
        let since = read(&format!("{whole}{other}"), "r1").unwrap();
        assert_eq!(since, read(whole, "r1").unwrap());
    }
}
