//! Files of orders and journals, however long a journal has become.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use super::LanguageError;
use super::error::error;
use super::journal::{JournalNote, RunHeader};
use super::parse::{ReadError, check_length, read_text, text};
use crate::limits::{DOCUMENT, Limit, WAITING_BYTES};

/// What the first line of a run begins with.
pub(super) const RUN_LINE: &[u8] = b"{\"run\":";

/// Reads the text of a file of orders or of a journal, as [`parse_orders`](super::parse_orders) and
/// [`parse_journal`](super::parse_journal) take it.
///
/// A file of up to [`WAITING_BYTES`](crate::limits::WAITING_BYTES) is read whole. Of a longer journal
/// the lines of its newest run are, and those of the runs that it goes on from. They may have so many
/// bytes, and any other line one: it is empty in the text, so that errors tell the line of the file.
///
/// # Errors
/// [`ReadError`], which names the file; where a line is longer than
/// [`DOCUMENT`](crate::limits::DOCUMENT) also that.
pub fn read_orders_text(file: &Path) -> Result<String, ReadError> {
    read_within(file, WAITING_BYTES)
}

fn read_within(file: &Path, limit: Limit) -> Result<String, ReadError> {
    let unreadable = |source| ReadError::Unreadable { file: file.into(), source };
    let mut opened = File::open(file).map_err(unreadable)?;
    let stated = opened.metadata().map_err(unreadable)?.len();
    if stated <= limit.most as u64 {
        return read_text(file, limit);
    }
    let name = file.display().to_string();
    let runs = Run::all_of(BufReader::new(&mut opened), &name);
    let mut runs = runs.map_err(unreadable)??;
    if !runs.iter().any(|run| run.header.is_some()) {
        // No journal, or one of which no run is known.
        check_length(usize::try_from(stated).unwrap_or(usize::MAX), &name, limit)?;
    }
    choose_newest(&mut runs);
    let found = runs.iter().fold(0, |sum: usize, run| sum.saturating_add(run.length()));
    limit.check(found).map_err(|exceeded| {
        let message = format!("the newest run of the journal is too long: {exceeded}");
        error("", &name, 0, String::new(), message, None)
    })?;
    let mut bytes = Vec::with_capacity(found);
    for run in &runs {
        run.read(&mut opened, &mut bytes).map_err(unreadable)?;
    }
    text(&bytes, &name)?;
    // Looked at above; nothing is copied here.
    Ok(String::from_utf8(bytes).unwrap_or_default())
}

/// The lines of a run in a file; the first ones may be of none.
#[derive(Default)]
struct Run {
    header: Option<RunHeader>,
    begins_at: u64,
    bytes: u64,
    lines: usize,
    is_wanted: bool,
}

impl Run {
    /// The runs of a journal. No more than a line is kept of it.
    fn all_of(
        mut journal: impl BufRead,
        name: &str,
    ) -> io::Result<Result<Vec<Self>, LanguageError>> {
        let mut runs = vec![Self::default()];
        let (mut number, mut line, mut at) = (0, Vec::new(), 0);
        loop {
            line.clear();
            let most = DOCUMENT.most as u64 + 1;
            Read::take(&mut journal, most).read_until(b'\n', &mut line)?;
            if line.is_empty() {
                return Ok(Ok(runs));
            }
            if let Err(exceeded) = DOCUMENT.check(line.len()) {
                let failure = error("", name, 0, String::new(), exceeded.to_string(), None);
                return Ok(Err(LanguageError { line: failure.line + number, ..failure }));
            }
            if line.starts_with(RUN_LINE) && line.ends_with(b"\n") {
                let header = match serde_json::from_slice(&line) {
                    Ok(JournalNote::Run(header)) => Some(header),
                    _ => None,
                };
                runs.push(Self { header, begins_at: at, ..Self::default() });
            }
            if let Some(run) = runs.last_mut() {
                run.bytes += line.len() as u64;
                run.lines += 1;
            }
            at += line.len() as u64;
            number += 1;
        }
    }

    /// The length of what is read of it, in bytes.
    fn length(&self) -> usize {
        if self.is_wanted { usize::try_from(self.bytes).unwrap_or(usize::MAX) } else { self.lines }
    }

    /// Reads its lines, or as many that are empty.
    fn read(&self, file: &mut File, to: &mut Vec<u8>) -> io::Result<()> {
        if !self.is_wanted {
            to.resize(to.len() + self.lines, b'\n');
            return Ok(());
        }
        file.seek(SeekFrom::Start(self.begins_at))?;
        Read::take(file, self.bytes).read_to_end(to).map(drop)
    }
}

/// Marks the newest run, and those that it goes on from.
fn choose_newest(runs: &mut [Run]) {
    let mut next = runs.len().checked_sub(1);
    while let Some(index) = next {
        let (above, rest) = runs.split_at_mut(index);
        let Some(run) = rest.first_mut() else { return };
        run.is_wanted = true;
        let from = run.header.as_ref().and_then(|header| header.restart.as_ref());
        next = from.and_then(|from| {
            let is_it = |run: &Run| run.header.as_ref().is_some_and(|it| it.id == from.run);
            above.iter().rposition(is_it)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::{check_content, parse_journal};
    use super::*;

    const LIMIT: Limit = Limit { most: 1000, ..WAITING_BYTES };

    fn header(id: &str, restart: &str) -> String {
        format!(
            r#"{{"run":{{"id":"{id}","version":"0","began":0,"deform":{{}},"guard":{{}},"schedule":{{"steps":1}}{restart}}}}}"#
        )
    }

    fn restart(run: &str, checkpoint: &str) -> String {
        format!(r#","restart":{{"run":"{run}","checkpoint":"{checkpoint}","cycle":3}}"#)
    }

    fn applied(id: &str) -> String {
        format!(r#"{{"id":"{id}","status":"applied","cycle":2,"time":0,"order":{{"undo":1}}}}"#)
    }

    fn read(lines: &[String]) -> Result<String, String> {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("journal.jsonl");
        std::fs::write(&file, format!("{}\n{{\"id\":\"torn\",\"sta", lines.join("\n"))).unwrap();
        let name = file.display().to_string();
        read_within(&file, LIMIT).map_err(|error| error.to_string().replace(&name, "FILE"))
    }

    #[test]
    fn of_a_long_journal_the_newest_run_is_read_with_those_it_goes_on_from() {
        let long: Vec<String> = (0..30).map(|count| applied(&format!("long-{count}"))).collect();
        let mut lines = vec!["no line of a journal".to_owned(), header("r1", "")];
        lines.push(applied("a"));
        lines.push(r#"{"checkpoint":{"id":"k1","cycle":3,"time":0}}"#.into());
        lines.push(header("other", ""));
        lines.extend(long.clone());
        lines.push(header("r2", &restart("r1", "k1")));
        lines.push(applied("b"));
        let text = read(&lines).unwrap();
        assert!(text.len() < LIMIT.most, "{}", text.len());
        let recording = parse_journal(&text, "FILE").unwrap();
        let ids: Vec<_> = recording.commands.iter().flat_map(|timed| timed.id.clone()).collect();
        assert_eq!(ids, ["a", "b"]);
        assert_eq!(text.lines().count(), lines.len() + 1);
        assert!(check_content(&text, "FILE", None).is_ok());
        // An error is told with the line of the file.
        lines.push(r#"{"id":"c","status":"aplied"}"#.into());
        let error = parse_journal(&read(&lines).unwrap(), "FILE").unwrap_err();
        assert_eq!(error.line, lines.len());
    }

    #[test]
    fn a_newest_run_beyond_the_limit_and_what_is_no_journal_are_refused() {
        let long: Vec<String> = (0..30).map(|count| applied(&format!("long-{count}"))).collect();
        let lines = [vec![header("r1", "")], long.clone()].concat();
        let refused = read(&lines).unwrap_err();
        assert!(refused.contains("the newest run of the journal is too long: found "), "{refused}");
        assert!(refused.ends_with("bytes, expected at most 1000"), "{refused}");
        let refused = read(&long).unwrap_err();
        assert!(refused.starts_with("FILE:1:1: found "), "{refused}");
        assert!(refused.ends_with("bytes, expected at most 1000"), "{refused}");
    }

    #[test]
    fn a_line_beyond_the_limit_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("journal.jsonl");
        std::fs::write(&file, format!("{}\n", header("r1", ""))).unwrap();
        let sparse = File::options().write(true).open(&file).unwrap();
        sparse.set_len(DOCUMENT.most as u64 + 4096).unwrap();
        let refused = read_within(&file, LIMIT).unwrap_err().to_string();
        assert!(refused.contains(":2:1: found 67108865 bytes, expected at most"), "{refused}");
    }
}
