//! Commands given beforehand: files of orders, and the journals of other runs.

use super::LanguageError;
use super::journal::{is_of_journal, is_torn_entry, parse_lines};
use super::parse::{Document, check_length};
use super::relative_files::resolve_command_files;
use super::timed::{TimedCommand, lines};
use crate::limits::WAITING_BYTES;

/// Reads a file of orders: a JSON array of timed commands, one timed command, or the lines of a
/// journal.
///
/// From a journal come the commands of its newest run that took effect, each at the cycle at which
/// it did; those of pipelines do not, because a run with the same pipelines gives them again. Of a
/// run that was restarted, pauses and stops before the checkpoint do not either. An order that took
/// the place of another (`replaces`) comes without the name of that one, which is not there. A last
/// line that a killed run left half-written is passed over. Where runs are to be the same to the
/// bit, read a journal with [`parse_journal`](super::parse_journal).
///
/// Files that edits name lie beside `file` where they are relative.
///
/// # Errors
/// A [`LanguageError`] at the first token that is wrong;
/// [`check_orders`](super::check_orders) tells all that are.
///
/// # Example
/// ```
/// use tombolo_pipelines::language::{At, parse_orders};
///
/// let journal = r#"{"id":"a","status":"accepted","cycle":3,"time":0.3,"order":{"undo":1}}
/// {"id":"a","status":"applied","cycle":5,"time":0.5}
/// {"id":"b","status":"acc"#;
/// let orders = parse_orders(journal, "journal.jsonl").unwrap();
/// assert_eq!(orders.len(), 1);
/// assert_eq!(orders[0].at, Some(At::Cycle(5)));
/// ```
pub fn parse_orders(text: &str, file: &str) -> Result<Vec<TimedCommand>, LanguageError> {
    check_length(text.len(), file, WAITING_BYTES)?;
    let mut commands = parse_commands(text, file)?;
    commands.iter_mut().for_each(|timed| resolve_command_files(&mut timed.command, file));
    Ok(commands)
}

fn parse_commands(text: &str, file: &str) -> Result<Vec<TimedCommand>, LanguageError> {
    match OrdersText::read(text, file)? {
        OrdersText::Nothing => Ok(Vec::new()),
        OrdersText::List(document) => document.valid(),
        OrdersText::One(document) => document.valid::<TimedCommand>().map(|timed| vec![timed]),
        OrdersText::Lines => parse_lines(text, file),
    }
}

/// A text of orders, by its outer form.
pub(super) enum OrdersText<'a> {
    /// There is none.
    Nothing,
    /// A JSON array.
    List(Document<'a>),
    /// One command.
    One(Document<'a>),
    /// A command or an entry of a journal in each line.
    Lines,
}

impl<'a> OrdersText<'a> {
    pub(super) fn read(text: &'a str, file: &'a str) -> Result<Self, LanguageError> {
        let start = text.trim_start_matches(['\u{feff}', ' ', '\t', '\r', '\n']);
        if start.is_empty() {
            return Ok(OrdersText::Nothing);
        }
        match Document::read(text, file) {
            Ok(document) if start.starts_with('[') => Ok(OrdersText::List(document)),
            Ok(document) if is_of_journal(&document) => Ok(OrdersText::Lines),
            Ok(document) => Ok(OrdersText::One(document)),
            Err(error) if start.starts_with('[') => Err(error),
            // Of what is written over several lines, neither of the first two is a whole value.
            Err(_)
                if lines(text).take(2).any(|(_, line)| Document::read(line, file).is_ok())
                    || is_torn_entry(text) =>
            {
                Ok(OrdersText::Lines)
            }
            Err(error) => Err(error),
        }
    }
}
