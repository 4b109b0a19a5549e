//! What a run pays for being followed in ParaView.
//!
//! ParaView has a core of its own ([`Desk`]), as a real one has a machine of its own.

use std::error::Error;
use std::fs::File;
use std::io::Write as _;
use std::os::unix::fs::FileExt;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::Duration;

use tombolo_tests::{project, target};

use crate::desk::Desk;
use crate::measure::Times;
use crate::overhead::SMALL;
use crate::peer;
use crate::report::{Report, Row, Target};
use crate::service::Run;

/// How often each has its turn, and how long that is: short, since a machine becomes a little faster or
/// slower within a minute.
const ROUNDS: usize = 30;
const TURN: Duration = Duration::from_secs(3);
/// How long ParaView may take until it has shown a step, or until its connection has ended.
const CHANGE: Duration = Duration::from_secs(120);
/// How long the run steps before it is measured.
const WARM_UP: Duration = Duration::from_secs(20);

/// Steps a run alone and followed in ParaView, in turn; some five minutes.
///
/// # Errors
/// The first error of building and running; a ParaView that is missing is an error.
pub fn run() -> Result<Report, Box<dyn Error>> {
    peer::run(Command::new(project().join("scripts/python")).arg("--release"))?;
    peer::run(Command::new(project().join("scripts/fetch-paraview")).arg("--program"))?;
    let desk = Desk::set_apart()?;
    let mut run = Run::new(SMALL)?;
    let mut paraview = Paraview::start(&run.link()?, &desk)?;
    run.steps(|| true, [WARM_UP; 2])?;
    let (mut alone, mut followed, mut shown) = (Times::new(), Times::new(), 0);
    let mut ratios = Times::new();
    for _ in 0..ROUNDS {
        paraview.leave()?;
        run.steps(|| paraview.has_left(), [Duration::ZERO, CHANGE])?;
        let without = run.steps(|| true, [TURN, 2 * TURN])?.whole.median();
        paraview.follow()?;
        let before = paraview.shown()?;
        let has_come = || paraview.shown().is_ok_and(|shown| shown > before);
        run.steps(has_come, [Duration::ZERO, CHANGE])?;
        let with = run.steps(|| true, [TURN, 2 * TURN])?.whole.median();
        shown += paraview.shown()? - before;
        alone.add(without);
        followed.add(with);
        ratios.add(with / without);
    }
    run.finish()?;
    let rows = vec![
        Row::new("median step, nobody connected", alone.median()),
        Row::new(
            format!(
                "the same, followed in ParaView {}: {} steps shown in each {} s",
                desk.description(),
                shown / ROUNDS,
                TURN.as_secs()
            ),
            followed.median(),
        ),
    ];
    let ratio = Target::at_most("median step, followed / alone", ratios.median(), 1.01);
    Ok(Report { rows, targets: vec![ratio] })
}

/// ParaView's Python, which follows a run when it is told to; it ends when this is dropped.
struct Paraview {
    process: Child,
    /// The pipe by which it is told.
    told: ChildStdin,
    /// The file that it prints into: nobody reads a pipe while the run steps.
    printed: File,
}

impl Paraview {
    fn start(link: &str, desk: &Desk) -> Result<Self, Box<dyn Error>> {
        let clients = project().join("clients/paraview");
        let paths = [project().join("bindings/python/python"), clients.join("debian"), clients];
        let printed = tempfile::tempfile()?;
        let mut command = desk.command(target().join("third-party/paraview/pvpython"));
        command
            .arg(project().join("benchmarks/peers/follow_in_paraview.py"))
            // Not among its arguments: the link is a secret.
            .env("TOMBOLO_LINK", link)
            .env("PYTHONPATH", std::env::join_paths(paths)?)
            .stdin(Stdio::piped())
            .stdout(printed.try_clone()?);
        let mut process = command.spawn()?;
        let told = process.stdin.take().ok_or("a program with a pipe has its end")?;
        Ok(Self { process, told, printed })
    }

    /// Has it follow the run.
    fn follow(&mut self) -> Result<(), Box<dyn Error>> {
        Ok(self.told.write_all(b"follow\n")?)
    }

    /// Has it end its connection.
    fn leave(&mut self) -> Result<(), Box<dyn Error>> {
        Ok(self.told.write_all(b"leave\n")?)
    }

    /// How many steps it has shown.
    fn shown(&self) -> Result<usize, Box<dyn Error>> {
        Ok(self.lines()?.iter().filter(|line| line.parse::<usize>().is_ok()).count())
    }

    /// Whether it has no connection, as it has said last.
    fn has_left(&self) -> bool {
        self.lines().is_ok_and(|lines| lines.last().is_some_and(|line| line == "left"))
    }

    /// The lines that ParaView's Python has printed so far.
    fn lines(&self) -> Result<Vec<String>, Box<dyn Error>> {
        let mut printed = vec![0; usize::try_from(self.printed.metadata()?.len())?];
        // Where it writes stays where it is: both have the same file.
        self.printed.read_exact_at(&mut printed, 0)?;
        Ok(String::from_utf8(printed)?.lines().map(str::to_owned).collect())
    }
}

impl Drop for Paraview {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
