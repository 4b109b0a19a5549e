//! The steering service beside a solver that steps: many viewers, some of them slow or deaf; many
//! orders and large ones; and how soon the mesh moves.
//!
//! The viewers are a process of their own ([`crate::service_viewers`]), so that the memory measured
//! here is the run's, and one with a core of its own ([`Desk`]), as real ones have machines of their own.

use std::{
    collections::{HashMap, VecDeque},
    error::Error,
    fs::File,
    io::{Read, Seek},
    process::Child,
    time::{Duration, Instant},
};

use serde::Serialize;
use serde_json::json;
use tombolo::{
    Adaptor, Step,
    deform::{
        features::FeatureSettings,
        mesh::{Mesh, MeshView},
        surface::Surface,
        vector::Vector,
    },
    pipelines::{
        extract::{Channel, FieldView},
        language,
    },
};
use tombolo_flow::{Motion, Solver};

use crate::{
    desk::Desk,
    measure::{Times, memory},
    overhead::{LARGE, SMALL, TIME_STEP, channel, solver},
    peer,
    report::{Line, Report, Target},
    service_viewers::{EVERY, Seen, Task, now},
};

/// What docs/operations.md lets commands, the stack, the views and the viewers take, in MiB, as far as
/// this run can fill it: commands that wait four times over, the stack, and what the viewers have
/// not read.
const BOUND: f64 = 4.0 * 64.0 + 256.0 + 50.0;

/// How long a part may take.
const MOST: Duration = Duration::from_secs(3600);

/// Vertices that an edit of a large order moves.
const LISTED: usize = 2000;

/// How many of the last steps beside orders are repeated without orders.
const KEPT: usize = 40;

/// How often the viewers come and go: within a minute a machine's own speed drifts by more than they
/// cost.
const TURNS: u32 = 10;

/// A figure of one part.
#[derive(Debug, Serialize)]
pub struct Row {
    part: &'static str,
    what: &'static str,
    value: f64,
    unit: &'static str,
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] = &["part", "what", "value", "unit"];

    fn cells(&self) -> Vec<String> {
        let Self { part, what, value, unit } = *self;
        vec![part.into(), what.into(), format!("{value:.4}"), unit.into()]
    }
}

/// A run of the flow solver with its adaptor.
pub struct Run {
    adaptor: Adaptor,
    solver: Solver,
    mesh: Mesh,
    cycle: u64,
    /// When each order moved the mesh first.
    moved: HashMap<String, f64>,
    /// When each cycle was shown.
    shown: HashMap<u64, f64>,
    /// The shapes of the last steps, at most [`KEPT`], the newest first; `None` where the mesh rested.
    last: VecDeque<Option<Vec<Vector>>>,
}

/// What the steps of a part took.
pub struct Steps {
    /// The whole step, and the part of it inside `execute`.
    pub whole: Times,
    execute: Times,
    /// The most memory that was seen, in MiB.
    memory: f64,
}

/// Steps beside viewers by turns, and before and after each.
struct Watched {
    alone: Vec<Steps>,
    beside: Vec<(Steps, Seen)>,
}

impl Watched {
    /// The median over the turns of what `of` a turn is in parts of the mean before and after it.
    fn against_alone(&self, of: impl Fn(&Steps) -> f64) -> f64 {
        let quiet = self.alone.windows(2).map(|around| around.iter().map(&of).sum::<f64>() / 2.0);
        let turns = self.beside.iter().zip(quiet).map(|((beside, _), quiet)| of(beside) / quiet);
        turns.collect::<Times>().median()
    }

    /// The median over the turns.
    fn beside(&self, of: impl Fn(&Steps) -> f64) -> f64 {
        self.beside.iter().map(|(beside, _)| of(beside)).collect::<Times>().median()
    }

    /// The median over the times between them.
    fn alone(&self, of: impl Fn(&Steps) -> f64) -> f64 {
        self.alone.iter().map(of).collect::<Times>().median()
    }

    fn seen(&self) -> impl Iterator<Item = &Seen> {
        self.beside.iter().map(|(_, seen)| seen)
    }
}

impl Run {
    /// A run on the channel of so many boxes along each side.
    ///
    /// # Errors
    /// Where the mesh, the adaptor or the solver cannot be made.
    pub fn new(counts: [usize; 3]) -> Result<Self, Box<dyn Error>> {
        let mesh = channel(counts)?;
        let view = |name: &str, stage: serde_json::Value| {
            json!({"name": name, "every": {"steps": EVERY}, "stages": [
                stage, {"select": {"fields": ["velocity", "pressure"]}}, {"stream": {"error": {"relative": 1e-3}}}]})
        };
        let config = json!({"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [
            view("surface", json!({"surface": {}})),
            view("slice", json!({"slice": {"origin": [0, 0, 0], "normal": [1, 0, 0]}})),
        ]});
        let config = language::parse(&config.to_string(), "benchmark")?;
        let adaptor = Adaptor::initialize(tombolo::Settings { config, ..Default::default() })?;
        let solver = solver(&mesh)?;
        let (moved, shown, last) = (HashMap::new(), HashMap::new(), VecDeque::new());
        Ok(Self { adaptor, solver, mesh, cycle: 0, moved, shown, last })
    }

    /// Steps until something holds, for so long at least and at most.
    ///
    /// # Errors
    /// The first error of a step, or where it does not hold in time.
    pub fn steps(
        &mut self,
        mut is_over: impl FnMut() -> bool,
        [least, most]: [Duration; 2],
    ) -> Result<Steps, Box<dyn Error>> {
        let begun = Instant::now();
        let mut steps = Steps { whole: Times::new(), execute: Times::new(), memory: 0.0 };
        while begun.elapsed() < least || !is_over() {
            if begun.elapsed() > most {
                return Err("the viewers do not come to their end".into());
            }
            let start = Instant::now();
            let (velocity, pressure) = (self.solver.velocity(), self.solver.pressure());
            let fields = [
                FieldView::vertex("velocity", &velocity),
                FieldView::vertex("pressure", &pressure),
            ];
            let fluid =
                Channel { name: "fluid", mesh: MeshView::from(&self.mesh), fields: &fields };
            let time = TIME_STEP * self.cycle as f64;
            let step = Step { cycle: self.cycle, time, time_step: TIME_STEP };
            self.shown.insert(self.cycle, now());
            let begun = Instant::now();
            let steering = self.adaptor.execute(&step, &[fluid])?;
            steps.execute.add(begun.elapsed().as_secs_f64());
            let moved = match &steering.motion {
                Some(motion) => {
                    self.moved.entry(motion.order.to_owned()).or_insert_with(now);
                    self.solver.step(TIME_STEP, Some(Motion { points: &motion.coordinates }))?;
                    Some(motion.coordinates.to_vec())
                }
                None => {
                    self.solver.step(TIME_STEP, None)?;
                    None
                }
            };
            self.last.truncate(KEPT - 1);
            self.last.push_front(moved.clone());
            if let Some(points) = moved {
                self.mesh = self.mesh.with_points(points)?;
            }
            self.cycle += 1;
            steps.whole.add(start.elapsed().as_secs_f64());
            steps.memory = steps.memory.max(memory()? / f64::from(1 << 20));
        }
        Ok(steps)
    }

    /// Repeats steps with the same motion, without an adaptor, and measures what the solver itself
    /// takes. It ends in the shape in which it began.
    fn repeat(
        &mut self,
        last: &VecDeque<Option<Vec<Vector>>>,
        least: Duration,
    ) -> Result<Times, Box<dyn Error>> {
        let now = self.mesh.points().to_vec();
        let (begun, mut times) = (Instant::now(), Times::new());
        while begun.elapsed() < least {
            for points in last.iter().rev() {
                let start = Instant::now();
                let fields = (self.solver.velocity(), self.solver.pressure());
                self.step_solver(points.as_deref())?;
                times.add(start.elapsed().as_secs_f64());
                drop(fields);
            }
        }
        self.step_solver(Some(&now))?;
        Ok(times)
    }

    /// A step of the solver, with or without a motion.
    fn step_solver(&mut self, points: Option<&[Vector]>) -> Result<(), Box<dyn Error>> {
        self.solver.step(TIME_STEP, points.map(|points| Motion { points }))?;
        if let Some(points) = points {
            self.mesh = self.mesh.with_points(points.to_vec())?;
        }
        Ok(())
    }

    /// Steps while so many orders are given, and then with the same motion without them.
    fn given(&mut self, desk: &Desk, task: &Task) -> Result<(Steps, Seen, Times), Box<dyn Error>> {
        let (steps, seen) = self.beside(desk, task, MOST)?;
        let rejected = seen.rejected.len();
        if let Some(reason) = seen.rejected.first().filter(|_| rejected * 10 > seen.sent.len()) {
            let given = seen.sent.len();
            return Err(format!("{rejected} orders of {given} were rejected: {reason}").into());
        }
        let last = self.last.clone();
        let without = self.repeat(&last, Duration::from_secs(20))?;
        Ok((steps, seen, without))
    }

    /// The link of those who may drive.
    ///
    /// # Errors
    /// Where the run has no server.
    pub fn link(&self) -> Result<String, Box<dyn Error>> {
        Ok(self.adaptor.link().ok_or("a run has a link")?)
    }

    /// Ends the run.
    ///
    /// # Errors
    /// Where a file could not be written.
    pub fn finish(self) -> Result<(), Box<dyn Error>> {
        self.adaptor.finalize()?;
        Ok(())
    }

    /// Steps beside viewers in a process of their own, until that has ended.
    fn beside(
        &mut self,
        desk: &Desk,
        task: &Task,
        most: Duration,
    ) -> Result<(Steps, Seen), Box<dyn Error>> {
        let link = self.link()?;
        let mut viewers = Viewers::start(&link, task, desk)?;
        let steps = self.steps(|| viewers.has_ended(), [Duration::ZERO, most])?;
        Ok((steps, viewers.seen()?))
    }

    /// Steps beside 50 viewers by turns, for so many seconds in all, and alone between the turns.
    fn watched(&mut self, desk: &Desk, seconds: f64) -> Result<Watched, Box<dyn Error>> {
        let turn = Duration::from_secs_f64(seconds / f64::from(TURNS));
        let alone = [turn / 2, Duration::from_secs(600)];
        let task = Task::Watch { fast: 35, slow: 10, deaf: 5, seconds: turn.as_secs_f64() };
        let mut watched = Watched { alone: vec![self.steps(|| true, alone)?], beside: Vec::new() };
        for _ in 0..TURNS {
            watched.beside.push(self.beside(desk, &task, MOST)?);
            watched.alone.push(self.steps(|| true, alone)?);
        }
        Ok(watched)
    }

    /// Seconds from each of so many orders to the first mesh that it moved.
    fn delays(&mut self, desk: &Desk, count: usize) -> Result<Times, Box<dyn Error>> {
        let (_, seen) = self.beside(desk, &Task::Latency { count }, MOST)?;
        let delay = |(id, at): &(String, f64)| self.moved.get(id).map(|moved| moved - at);
        Ok(seen.sent.iter().filter_map(delay).collect())
    }
}

/// The process of the viewers, which ends with this.
struct Viewers {
    process: Child,
    /// The file that the viewers print into; they would wait at a pipe, which nobody reads while the
    /// run steps.
    printed: File,
}

impl Viewers {
    fn start(link: &str, task: &Task, desk: &Desk) -> Result<Self, Box<dyn Error>> {
        let mut command = desk.command(std::env::current_exe()?);
        let task = serde_json::to_string(task)?;
        let printed = tempfile::tempfile()?;
        // Not among its arguments: the link is a secret.
        command.args(["service", "--viewers", &task]).env("TOMBOLO_LINK", link);
        Ok(Self { process: command.stdout(printed.try_clone()?).spawn()?, printed })
    }

    fn has_ended(&mut self) -> bool {
        !matches!(self.process.try_wait(), Ok(None))
    }

    fn seen(mut self) -> Result<Seen, Box<dyn Error>> {
        self.process.wait()?;
        let mut printed = String::new();
        self.printed.rewind()?;
        self.printed.read_to_string(&mut printed)?;
        Ok(serde_json::from_str(peer::answer(&printed)?)?)
    }
}

impl Drop for Viewers {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The median and the 95th percentile.
fn spread(times: &Times) -> [(&'static str, f64); 2] {
    [("median", times.median()), ("95th percentile", times.percentile(0.95))]
}

/// The cost of orders: the median step beside them against that with the same motion without them. A
/// mesh that moves costs the solver more, whoever moves it.
fn against_motion(part: &str, steps: &Steps, without: &Times) -> Target {
    let ratio = steps.whole.median() / without.median();
    Target::at_most(format!("{part}: step, median, against the same motion unasked"), ratio, 1.05)
}

/// Measures all parts; some minutes, or one where it is only to be seen that it works.
///
/// # Errors
/// The first error of a part.
pub fn run(short: bool) -> Result<Report<Row>, Box<dyn Error>> {
    let seconds = if short { 15.0 } else { 60.0 };
    let alone = [Duration::from_secs_f64(seconds / 3.0), Duration::from_secs(600)];
    let mut rows = Vec::new();
    let mut targets = Vec::new();
    // Told at once: the whole takes a quarter of an hour, and who stops it keeps what was measured.
    let mut push = |part, what, value, unit| {
        eprintln!("{part}: {what}: {value:.4} {unit}");
        rows.push(Row { part, what, value, unit });
    };

    let desk = Desk::set_apart()?;
    let mut run = Run::new(SMALL)?;
    let before = run.steps(|| true, alone)?;
    let watched = run.watched(&desk, seconds)?;
    let [whole, execute] =
        [|steps: &Steps| steps.whole.median(), |steps: &Steps| steps.execute.median()];
    let (quiet, quiet_execute) = (watched.alone(whole), watched.alone(execute));
    let most = |memory: f64, (beside, _): &(Steps, Seen)| memory.max(beside.memory);
    let memory = watched.beside.iter().fold(0.0, most);
    let least_part = watched.seen().map(|seen| seen.least_part).fold(1.0, f64::min);
    push("alone", "step, median", quiet, "s");
    push("alone", "memory", before.memory, "MiB");
    push("50 viewers", "step, median", watched.beside(whole), "s");
    let mean = watched.against_alone(|steps| steps.whole.mean());
    push("50 viewers", "step, mean, against none, no core free", mean, "");
    push("50 viewers", "execute, median", watched.beside(execute), "s");
    push("50 viewers", "memory", memory, "MiB");
    push("50 viewers", "frames of fast viewers, least part", least_part, "");
    let ages: Times = watched
        .seen()
        .flat_map(|seen| &seen.slow)
        .filter_map(|(cycle, at)| run.shown.get(cycle).map(|shown| at - shown))
        .collect();
    push("50 viewers", "age of what a 10 kB/s viewer sees, median", ages.median(), "s");
    push("50 viewers", "the same, 95th percentile", ages.percentile(0.95), "s");
    let beyond = |memory: f64| memory - before.memory;
    targets.push(Target::at_most(
        "50 viewers, no core free: step, median, against none",
        watched.against_alone(whole),
        1.01,
    ));
    targets.push(Target::at_most("50 viewers: memory beyond [MiB]", beyond(memory), BOUND));
    targets.push(Target::at_most("50 viewers: frames missed by fast ones", 1.0 - least_part, 0.05));

    let count = if short { 20 } else { 100 };
    let delays = run.delays(&desk, count)?;
    for (what, value) in spread(&delays) {
        push("order to first moved mesh, 60 840 cells", what, value, "s");
    }

    let surface = Surface::extract(&run.mesh, &FeatureSettings::default())?;
    let vertices: Vec<u32> = surface.vertices().iter().copied().take(LISTED).collect();
    let [small, large] = if short { [50, 12] } else { [1000, 60] };
    let tasks = |names: [&'static str; 2]| {
        let vertices = vertices.clone();
        names
            .into_iter()
            .zip([Task::Small { count: small }, Task::Large { count: large, vertices }])
    };
    for (part, task) in tasks(["small orders", "orders of 0.94 MB"]) {
        let (steps, seen, without) = run.given(&desk, &task)?;
        push(part, "orders", seen.sent.len() as f64, "");
        push(part, "step, median", steps.whole.median(), "s");
        push(part, "the same motion without orders, median", without.median(), "s");
        push(part, "execute, median", steps.execute.median(), "s");
        push(part, "execute, 99th percentile", steps.execute.percentile(0.99), "s");
        push(part, "memory", steps.memory, "MiB");
        push(part, "longest text that a viewer was sent", seen.longest as f64, "bytes");
        let added = (steps.execute.median() - quiet_execute) / quiet;
        targets.push(Target::at_most(format!("{part}: `execute`, of the step alone"), added, 0.05));
        targets.push(against_motion(&format!("{part}, no core free"), &steps, &without));
        targets.push(Target::at_most(
            format!("{part}: memory beyond [MiB]"),
            beyond(steps.memory),
            BOUND,
        ));
    }
    run.adaptor.finalize()?;

    let mut run = Run::new(SMALL)?;
    desk.let_in("tombolo-")?;
    run.steps(|| true, alone)?;
    let watched = run.watched(&desk, seconds)?;
    let mean = watched.against_alone(|steps| steps.whole.mean());
    push("50 viewers", "step, mean, against none, a core free", mean, "");
    targets.push(Target::at_most(
        "50 viewers, a core free: step, median, against none",
        watched.against_alone(whole),
        1.01,
    ));
    for (part, task) in tasks(["small orders, a core free", "orders of 0.94 MB, a core free"]) {
        let (steps, _, without) = run.given(&desk, &task)?;
        push(part, "step, median", steps.whole.median(), "s");
        push(part, "the same motion without orders, median", without.median(), "s");
        targets.push(against_motion(part, &steps, &without));
    }
    run.adaptor.finalize()?;

    let mut run = Run::new(LARGE)?;
    run.steps(|| true, alone)?;
    let delays = run.delays(&desk, count)?;
    for (what, value) in spread(&delays) {
        push("order to first moved mesh, 486 720 cells", what, value, "s");
    }
    run.adaptor.finalize()?;
    Ok(Report { rows, targets })
}
