//! What a run pays for being followed in ParaView.
//!
//! ParaView has a core of its own ([`Desk`]), as a real one has a machine of its own.

use std::error::Error;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::process::{Child, Command};
use std::time::Duration;

use tombolo_tests::{project, target};

use crate::desk::Desk;
use crate::measure::Times;
use crate::overhead::SMALL;
use crate::peer;
use crate::report::{Report, Row, Target};
use crate::service::Run;

/// How often each has its turn, and how long that is.
const ROUNDS: usize = 5;
const TURN: Duration = Duration::from_secs(20);
/// How long ParaView may take to show the first step.
const BEGINNING: Duration = Duration::from_secs(120);

/// Steps a run alone and followed in ParaView, in turn; some five minutes.
///
/// # Errors
/// The first error of building and running; a ParaView that is missing is an error.
pub fn run() -> Result<Report, Box<dyn Error>> {
    peer::run(Command::new(project().join("scripts/python")).arg("--release"))?;
    peer::run(Command::new(project().join("scripts/fetch-paraview")).arg("--program"))?;
    let desk = Desk::set_apart()?;
    let mut run = Run::new(SMALL)?;
    run.steps(|| true, [TURN; 2])?;
    let link = run.link()?;
    let (mut alone, mut followed, mut shown) = (Times::new(), Times::new(), usize::MAX);
    let mut ratios = Times::new();
    for _ in 0..ROUNDS {
        let without = run.steps(|| true, [TURN, 2 * TURN])?.whole.median();
        let paraview = Paraview::follow(&link, &desk)?;
        run.steps(|| paraview.shown().is_ok_and(|shown| shown > 0), [Duration::ZERO, BEGINNING])?;
        let before = paraview.shown()?;
        let with = run.steps(|| true, [TURN, 2 * TURN])?.whole.median();
        shown = shown.min(paraview.shown()? - before);
        alone.add(without);
        followed.add(with);
        ratios.add(with / without);
    }
    run.finish()?;
    let seconds = TURN.as_secs();
    let rows = vec![
        Row::new("median step, nobody connected", alone.median()),
        Row::new(
            format!(
                "the same, followed in ParaView {}: {shown} steps shown in {seconds} s, or more",
                desk.description()
            ),
            followed.median(),
        ),
    ];
    let ratio = Target::at_most("median step, followed / alone", ratios.median(), 1.01);
    Ok(Report { rows, targets: vec![ratio] })
}

/// ParaView's Python, which follows a run until this is dropped.
struct Paraview {
    process: Child,
    /// The file that it prints into: nobody reads a pipe while the run steps.
    printed: File,
}

impl Paraview {
    fn follow(link: &str, desk: &Desk) -> Result<Self, Box<dyn Error>> {
        let clients = project().join("clients/paraview");
        let paths = [project().join("bindings/python/python"), clients.join("debian"), clients];
        let printed = tempfile::tempfile()?;
        let mut command = desk.command(target().join("third-party/paraview/pvpython"));
        command
            .arg(project().join("benchmarks/peers/follow_in_paraview.py"))
            // Not among its arguments: the link is a secret.
            .env("TOMBOLO_LINK", link)
            .env("PYTHONPATH", std::env::join_paths(paths)?)
            .stdout(printed.try_clone()?);
        Ok(Self { process: command.spawn()?, printed })
    }

    /// How many steps it has shown.
    fn shown(&self) -> Result<usize, Box<dyn Error>> {
        let mut printed = vec![0; usize::try_from(self.printed.metadata()?.len())?];
        // Where it writes stays where it is: both have the same file.
        self.printed.read_exact_at(&mut printed, 0)?;
        let printed = String::from_utf8(printed)?;
        Ok(printed.lines().filter_map(|line| line.parse().ok()).next_back().unwrap_or(0))
    }
}

impl Drop for Paraview {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
