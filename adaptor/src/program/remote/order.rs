//! `tombolo order`, `tombolo forecast` and `tombolo undo`.

use std::{
    io::{IsTerminal, Read, Write},
    num::NonZeroU32,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use crate::{
    OrderReport, OrderStatus,
    client::{Client, Event, Foretold, Received},
    deform::{edit::Edit, shape::Outcome},
    pipelines::{
        files::read_displacements,
        language::{self, Change, Command, Content, Order, check_content},
        limits::DOCUMENT,
    },
};
use clap::Args;

use super::{ANSWER, NOT_YET, Target, WAIT, failed, refused, steer};
use crate::program::{Failure, read, say};

/// How long a forecast is waited for without a word.
const LONG: Duration = Duration::from_secs(5);
/// How long the bar is, in characters.
const BAR: usize = 30;

#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    pub(super) target: Target,
    /// An order or a list of edits as JSON; `-` reads it from the input
    file: PathBuf,
    /// Wait until the solver has been given the last shape. Else the run has taken the order when
    /// this task ends, and may still reject it
    #[arg(long)]
    wait: bool,
    /// Have it rejected where it has waited for its turn for so long, and the run does not say less
    #[arg(long, value_name = "SECONDS")]
    deadline: Option<NonZeroU32>,
}

#[derive(Debug, Args)]
pub(crate) struct ForecastOptions {
    #[command(flatten)]
    pub(super) target: Target,
    /// An order or a list of edits as JSON; `-` reads it from the input
    file: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct UndoOptions {
    #[command(flatten)]
    pub(super) target: Target,
    /// How many of the last orders to take back
    #[arg(default_value = "1")]
    count: NonZeroU32,
    /// Wait until the solver has been given the last shape
    #[arg(long)]
    wait: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ReplaceOptions {
    #[command(flatten)]
    pub(super) target: Target,
    /// The id of the order that waits, as `tombolo queue` tells it
    order: String,
    /// The order that takes its place, or a list of edits, as JSON; `-` reads it from the input
    file: PathBuf,
    /// Wait until the solver has been given the last shape
    #[arg(long)]
    wait: bool,
}

pub(crate) fn order(options: &Options) -> Result<(), Failure> {
    let order = read_order(&options.file)?;
    let client = steer(&options.target)?;
    let mut order = with_displacements(order, &client)?;
    order.deadline = options.deadline.or(order.deadline);
    give(&client, &order, options.wait, options.target.json)
}

/// Gives an order in the place of another. Without waiting for its shapes it ends once the run has put
/// it there, or says that the solver has not come so far.
pub(crate) fn replace(options: &ReplaceOptions) -> Result<(), Failure> {
    let order = read_order(&options.file)?;
    let client = steer(&options.target)?;
    let mut order = with_displacements(order, &client)?;
    order.replaces = Some(options.order.clone());
    give(&client, &order, options.wait, options.target.json)
}

pub(crate) fn undo(options: &UndoOptions) -> Result<(), Failure> {
    let client = steer(&options.target)?;
    give(&client, &Change::Undo(options.count).into(), options.wait, options.target.json)
}

pub(crate) fn forecast(options: &ForecastOptions) -> Result<(), Failure> {
    let order = read_order(&options.file)?;
    let client = steer(&options.target)?;
    let order = with_displacements(order, &client)?;
    let id = client.forecast(&order).map_err(failed)?;
    let (asked, mut has_told) = (Instant::now(), false);
    loop {
        let told = next(&client, WAIT)?;
        if asked.elapsed() > LONG && !std::mem::replace(&mut has_told, true) {
            eprintln!("tombolo: not found yet; the shapes of orders come before forecasts");
        }
        match &told.event {
            Event::Forecast(forecast) if forecast.id.as_ref() == Some(&id) => {
                if options.target.json {
                    say(&told.text)?;
                } else {
                    print(forecast)?;
                }
                return match (forecast.order.outcome, options.target.json) {
                    (Outcome::Rejected, true) => Err(Failure::Reported),
                    (Outcome::Rejected, false) => {
                        Err(Failure::Wrong("the order would be rejected".into()))
                    }
                    _ => Ok(()),
                };
            }
            Event::Lost { reason } => eprintln!("tombolo: connection lost: {reason}"),
            event => refused(event, &id)?,
        }
    }
}

/// Reads an order and checks it as `tombolo check` does.
fn read_order(file: &Path) -> Result<Order, Failure> {
    let (name, text) = if file.as_os_str() == "-" {
        let mut bytes = Vec::new();
        std::io::stdin().take(DOCUMENT.most as u64 + 1).read_to_end(&mut bytes)?;
        DOCUMENT.check(bytes.len()).map_err(|error| Failure::NoConnection(error.to_string()))?;
        ("input".to_owned(), language::text(&bytes, "input")?.to_owned())
    } else {
        (file.display().to_string(), read(file)?)
    };
    let wrong = |found: &str| {
        Failure::NoConnection(format!(
            "{name}: found {found}, expected an order of a new shape or a list of edits"
        ))
    };
    match check_content(&text, &name, None)? {
        Content::Order(order) => Ok(*order),
        Content::Edits(edits) => Ok(Change::Edits(edits).into()),
        Content::Configuration(_) => Err(wrong("a configuration")),
        // As one of edits and as one of orders an empty list looks alike.
        Content::Orders(commands) if commands.is_empty() && text.trim_start().starts_with('[') => {
            Err(Failure::NoConnection(format!("{name}: expected at least one edit")))
        }
        Content::Orders(commands) => match <[_; 1]>::try_from(commands) {
            Ok([language::TimedCommand { at: None, command: Command::Order(order), .. }]) => {
                Ok(order)
            }
            _ => Err(wrong("commands of a file of orders")),
        },
    }
}

/// The order with the numbers of the displacements whose files it names: a run reads none.
fn with_displacements(mut order: Order, client: &Client) -> Result<Order, Failure> {
    let names_file =
        |edit: &Edit| matches!(edit, Edit::Displacement(import) if import.file.is_some());
    if order.edits().iter().any(names_file) {
        let surface = client.surface().map_err(failed)?;
        read_displacements(order.edits_mut(), &surface)?;
    }
    Ok(order)
}

fn give(client: &Client, order: &Order, wait: bool, as_json: bool) -> Result<(), Failure> {
    let id = client.order(order).map_err(failed)?;
    let is_drawn = wait && !as_json && std::io::stderr().is_terminal();
    let mut bar = is_drawn.then(|| Bar::new(std::io::stderr()));
    // The run first takes the order, and then has it take the place of another.
    let mut is_placed = order.replaces.is_none();
    let (mut is_taken, mut was_lost) = (false, false);
    let begun = Instant::now();
    loop {
        // Other events do not extend the time that the order has to be placed.
        let left = if wait { WAIT } else { ANSWER.saturating_sub(begun.elapsed()) };
        let told = match client.next(left).map_err(failed)? {
            Some(told) => told,
            None if is_taken && !wait => {
                return if as_json { Ok(()) } else { say(NOT_YET) };
            }
            None => return Err(no_answer(if wait { WAIT } else { ANSWER })),
        };
        let report = match &told.event {
            Event::Order(report) if report.id == id => report,
            Event::Order(other) if order.replaces.as_ref() == Some(&other.id) => {
                is_placed |= is_taken && other.status == OrderStatus::Rejected;
                if is_placed && !wait {
                    return Ok(());
                }
                continue;
            }
            // The connection was made again, and the run has the order.
            Event::Hello(hello) => match hello.orders.iter().find(|report| report.id == id) {
                Some(report) => report,
                None if is_taken && was_lost => {
                    return Err(Failure::Wrong(format!(
                        "the run there does not know the order {id}, which another run took"
                    )));
                }
                None => continue,
            },
            Event::Lost { reason } => {
                was_lost = true;
                eprintln!(
                    "tombolo: connection lost ({reason}); it is made again, and the run keeps orders that it has taken"
                );
                continue;
            }
            event => {
                refused(event, &id)?;
                continue;
            }
        };
        is_taken = true;
        let has_ended = matches!(report.status, OrderStatus::Applied | OrderStatus::Rejected);
        if let Some(bar) = &mut bar {
            bar.draw(report);
        }
        if has_ended {
            // The bar ends its line before the outcome is printed.
            drop(bar.take());
        }
        match report.status {
            _ if as_json => say(serde_json::json!({"order": report}))?,
            // The failure tells it.
            OrderStatus::Rejected => {}
            _ if has_ended || !is_drawn => say(line(report))?,
            _ => {}
        }
        match report.status {
            OrderStatus::Rejected if as_json => return Err(Failure::Reported),
            OrderStatus::Rejected => return Err(Failure::Wrong(line(report))),
            OrderStatus::Applied => return Ok(()),
            OrderStatus::Accepted if !is_placed => {}
            _ if !wait => return Ok(()),
            _ => {}
        }
    }
}

fn next(client: &Client, patience: Duration) -> Result<Received, Failure> {
    let told = client.next(patience).map_err(failed)?;
    told.ok_or_else(|| no_answer(patience))
}

fn no_answer(patience: Duration) -> Failure {
    Failure::Wrong(format!("no answer within {} seconds", patience.as_secs()))
}

/// How far an order has come, in one line.
pub(super) fn line(report: &OrderReport) -> String {
    let mut line = format!("order {}: ", report.id);
    line += match (report.status, report.not_followed) {
        (OrderStatus::Accepted, _) => "accepted",
        (OrderStatus::Computing, _) => "computing",
        (OrderStatus::Applying, _) => "applying",
        (OrderStatus::Applied, None) => "applied",
        (OrderStatus::Applied, Some(_)) => "applied, not followed",
        (OrderStatus::Rejected, _) => "rejected",
    };
    if let (OrderStatus::Computing, Some(reason)) = (report.status, &report.waits_for) {
        line += &format!(", waits for {reason}");
    }
    if report.shapes > 0 {
        line += &format!(", shape {} of {}", report.shape, report.shapes);
    }
    if let Some(cycle) = report.cycle_applied {
        line += &format!(", from cycle {cycle}");
    }
    if let Some(least) = report.min_scaled_jacobian {
        line += &format!(", least scaled Jacobian {least:.4}");
    }
    if let Some(reason) = &report.reason {
        line += &format!(": {reason}");
    }
    line
}

/// A bar of the shapes that were handed out, which is drawn over and over in one line of a terminal.
struct Bar<W: Write> {
    terminal: W,
    is_begun: bool,
}

impl<W: Write> Bar<W> {
    fn new(terminal: W) -> Self {
        Self { terminal, is_begun: false }
    }

    /// Draws how far an order is, from when it is known how many shapes there are.
    fn draw(&mut self, report: &OrderReport) {
        let (done, all) = (report.shape as usize, report.shapes as usize);
        if all == 0 || report.status == OrderStatus::Rejected {
            return;
        }
        self.is_begun = true;
        let full = (BAR * done / all).min(BAR);
        let bar = "#".repeat(full) + &".".repeat(BAR - full);
        // A bar that cannot be drawn is no reason to give up.
        let _ = write!(self.terminal, "\r[{bar}] {done}/{all} shapes");
        let _ = self.terminal.flush();
    }
}

impl<W: Write> Drop for Bar<W> {
    fn drop(&mut self) {
        if self.is_begun {
            let _ = writeln!(self.terminal);
        }
    }
}

fn print(forecast: &Foretold) -> Result<(), Failure> {
    let order = &forecast.order;
    let percent = order.fraction.map(|fraction| format!("{:.2} %", 100.0 * fraction));
    match (order.outcome, percent) {
        (Outcome::Applied, _) => say("would be applied")?,
        (Outcome::Clamped, percent) => {
            say(format_args!(
                "would be clamped to {} of the edits' amounts",
                percent.unwrap_or_default()
            ))?;
        }
        (Outcome::Rejected, percent) => {
            say(format_args!(
                "would be rejected: {}",
                order.reason.as_deref().unwrap_or("no reason given")
            ))?;
            if let Some(percent) = percent {
                say(format_args!("{percent} of the amounts would pass"))?;
            }
        }
    }
    if let Some(least) = order.min_scaled_jacobian {
        say(format_args!("scaled Jacobian on the way: least {least:.4}"))?;
    }
    if let Some(quality) = &order.quality {
        say(format_args!(
            "scaled Jacobian after: least {:.4}, mean {:.4}, {} inverted",
            quality.min, quality.mean, quality.inverted
        ))?;
    }
    say(format_args!("{} shape(s)", order.shapes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_begins_with_a_known_count_and_ends_its_line() {
        let drawn = |reports: &[(OrderStatus, u32, u32)]| {
            let mut terminal = Vec::new();
            let mut bar = Bar::new(&mut terminal);
            for &(status, shape, shapes) in reports {
                bar.draw(&OrderReport { status, shape, shapes, ..OrderReport::default() });
            }
            drop(bar);
            String::from_utf8(terminal).expect("a text")
        };
        let (computing, applying) = (OrderStatus::Computing, OrderStatus::Applying);
        assert_eq!(drawn(&[(computing, 0, 0), (OrderStatus::Rejected, 0, 4)]), "");
        let text = drawn(&[(computing, 0, 0), (applying, 1, 2), (OrderStatus::Applied, 2, 2)]);
        let (half, rest) = ("#".repeat(BAR / 2), ".".repeat(BAR / 2));
        let whole = "#".repeat(BAR);
        assert_eq!(text, format!("\r[{half}{rest}] 1/2 shapes\r[{whole}] 2/2 shapes\n"));
        let left = drawn(&[(applying, 1, 2)]);
        assert!(left.ends_with(" 1/2 shapes\n"), "{left:?}");
    }
}
