//! Runs that go on from a checkpoint: to the bit as if nothing had come between.

mod common;
#[cfg(target_os = "linux")]
#[path = "common/power.rs"]
mod power;

use std::{path::Path, sync::Arc, time::Duration};

use common::{Solver, Viewer, bits, config, squeeze};
use fastrand::Rng;
use serde_json::{Value, json};
use tombolo::{
    Adaptor, Channel, Checkpoint, OrderStatus, Settings, Step,
    communicator::{Communicator, threads},
    deform::{
        distributed::{Part, in_order},
        mesh::Mesh,
        shapes::box_of_tets,
    },
    pipelines::language::{parse_journal, parse_orders},
};

/// Pipelines give orders: every so often, once, and when what they measure over time says so.
const PIPELINES: &str = r#""pipelines": [
    {"name": "shape", "on": "order", "stages": [{"schedule": {"steps": 3, "every": {"steps": 2}}}]},
    {"name": "breathe", "every": {"steps": 17}, "stages": [
        {"translate": {"features": ["x-max"], "fixed": ["x-min"], "by": [0.01, 0.0, 0.0]}},
        {"order": {"schedule": {"steps": 2, "every": {"steps": 3}}}}]},
    {"name": "once", "at": {"time": 0.2}, "stages": [
        {"translate": {"features": ["y-max"], "fixed": ["y-min"], "by": [0.0, 0.05, 0.0]}}, {"order": {}}]},
    {"name": "mean", "stages": [{"statistics": {"field": "speed"}},
        {"time_statistics": {"monitor": "speed.max", "name": "top", "measures": ["mean"]}}],
     "when": "top.mean > 1.9", "again_after": {"steps": 1000}, "then": [{"set": {"name": "heating", "value": 1.75}}]}]"#;

fn settings(output: &Path, serves: bool) -> Settings {
    let stream = if serves { r#""stream": {"listen": "127.0.0.1:0"}, "# } else { "" };
    let text = format!(r#"{{"version": 1, "journal": "journal.jsonl", {stream}{PIPELINES}}}"#);
    let settings = Settings { config: config(&text), output: output.into(), ..Settings::default() };
    settings.parameter("heating", 1.0, 0.0..=2.0)
}

/// The mesh after each cycle, and the value of the parameter.
type Trace = Vec<(Vec<[u64; 3]>, Option<f64>)>;

fn step(solver: &mut Solver, trace: &mut Trace) {
    solver.step();
    trace.push((bits(&solver.mesh), solver.adaptor.parameter("heating")));
}

fn assert_same(found: &[(Vec<[u64; 3]>, Option<f64>)], expected: &Trace, from: usize, what: &str) {
    for (index, state) in found.iter().enumerate() {
        let is_same = *state == expected[from + index];
        assert!(is_same, "{what}: it differs at cycle {}", from + index);
    }
}

/// Overlapping orders, one that folds and is mended, one that is refused, and undoing.
const ORDERS: &str = r#"[
    {"at": {"cycle": 3}, "order": {"edits": [{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -0.2]}}],
                                   "schedule": {"steps": 4, "every": {"steps": 3}}}},
    {"at": {"cycle": 9}, "order": {"edits": [{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -1.5]}}],
                                   "guard": {"otherwise": "clamp"}, "schedule": {"steps": 5, "every": {"steps": 2}}}},
    {"at": {"cycle": 16}, "order": {"undo": 1, "schedule": {"steps": 3, "every": {"time": 0.025}}}},
    {"at": {"cycle": 20}, "order": {"edits": [{"translate": {"features": ["nowhere"], "by": [1, 0, 0]}}]}},
    {"at": {"cycle": 22}, "parameter": {"name": "heating", "value": 1.25}},
    {"at": {"cycle": 26}, "order": {"edits": [{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.3, 0, -0.55]}}],
                                    "guard": {"otherwise": "untangle"}, "schedule": {"steps": 3, "every": {"steps": 2}}}},
    {"at": {"cycle": 34}, "order": {"undo": 1, "schedule": {"steps": 6}}}]"#;

#[test]
fn a_run_that_was_interrupted_anywhere_ends_as_one_that_was_not() {
    const CYCLES: u64 = 46;
    let given = |output: &Path| Settings {
        orders: parse_orders(ORDERS, "orders.json").unwrap(),
        ..settings(output, false)
    };
    let output = tempfile::tempdir().unwrap();
    let mut whole = Trace::new();
    let mut solver = Solver::new(given(output.path()));
    (0..CYCLES).for_each(|_| step(&mut solver, &mut whole));
    let orders = solver.finish().orders;
    assert!(orders.iter().any(|order| order.status == OrderStatus::Rejected), "{orders:?}");
    assert!(orders.iter().any(|order| order.fraction.is_some_and(|it| it < 1.0)), "{orders:?}");
    assert!(whole.windows(2).filter(|pair| pair[0].0 != pair[1].0).count() > 25);
    let mut random = Rng::with_seed(7);
    for interrupted in (0..CYCLES).step_by(5) {
        let output = tempfile::tempdir().unwrap();
        let mut trace = Trace::new();
        let mut solver = Solver::new(given(output.path()));
        (0..interrupted).for_each(|_| step(&mut solver, &mut trace));
        let bytes = solver.adaptor.checkpoint().to_bytes();
        let mesh = solver.mesh.clone();
        // It went on for a while before it was killed.
        let lost = random.u64(..CYCLES - interrupted);
        (0..lost).for_each(|_| step(&mut solver, &mut Trace::new()));
        drop(solver);
        wait_for_lock(&output.path().join("journal.jsonl"));
        let checkpoint = Checkpoint::from_bytes(&bytes).unwrap();
        let mut again = Solver::new(given(output.path()).restart(checkpoint));
        (again.mesh, again.cycle) = (mesh, interrupted);
        (interrupted..CYCLES).for_each(|_| step(&mut again, &mut trace));
        assert_same(&trace, &whole, 0, &format!("after cycle {interrupted}"));
        let statuses: Vec<_> =
            again.finish().orders.into_iter().map(|it| (it.id, it.status)).collect();
        let expected: Vec<_> = orders.iter().map(|it| (it.id.clone(), it.status)).collect();
        assert_eq!(statuses, expected, "after cycle {interrupted}");
        // The journal is one of a whole run.
        let journal = std::fs::read_to_string(output.path().join("journal.jsonl")).unwrap();
        let recording = parse_journal(&journal, "journal.jsonl").unwrap();
        let output = tempfile::tempdir().unwrap();
        let replay = Settings { replay: Some(recording), ..settings(output.path(), false) };
        let mut replayed = Solver::new(replay);
        let mut trace = Trace::new();
        (0..CYCLES).for_each(|_| step(&mut replayed, &mut trace));
        assert_same(&trace, &whole, 0, &format!("replayed, after cycle {interrupted}"));
    }
}

/// The ordinary case: a file of orders gets one more, and the run is submitted again.
#[test]
fn an_order_that_is_added_to_the_file_repeats_none_of_those_before() {
    const CYCLES: u64 = 30;
    const SAVED: u64 = 12;
    let order = |cycle: u64, by: f64| {
        json!({"at": {"cycle": cycle}, "order": {"edits": [{"translate": {"features": ["z-max"],
            "fixed": ["z-min"], "by": [0, 0, by]}}], "schedule": {"steps": 2}}})
    };
    let given = |output: &Path, orders: &Value| Settings {
        orders: parse_orders(&orders.to_string(), "orders.json").unwrap(),
        ..settings(output, false)
    };
    let first = json!({"parameter": {"name": "heating", "value": 1.25}});
    let before = json!([first, order(4, -0.1), {"at": {"cycle": 14}, "stop": {}}]);
    let after = json!([first, order(4, -0.1), order(18, -0.05)]);
    let (mut whole, mut trace) = (Trace::new(), Trace::new());
    let output = tempfile::tempdir().unwrap();
    let mut solver = Solver::new(given(output.path(), &after));
    (0..CYCLES).for_each(|_| step(&mut solver, &mut whole));
    let expected = solver.finish().orders;
    let output = tempfile::tempdir().unwrap();
    let mut solver = Solver::new(given(output.path(), &before));
    (0..SAVED).for_each(|_| step(&mut solver, &mut trace));
    let checkpoint = solver.adaptor.checkpoint();
    let mesh = solver.mesh.clone();
    drop(solver);
    wait_for_lock(&output.path().join("journal.jsonl"));
    let mut again = Solver::new(given(output.path(), &after).restart(checkpoint));
    (again.mesh, again.cycle) = (mesh, SAVED);
    (SAVED..CYCLES).for_each(|_| step(&mut again, &mut trace));
    assert_same(&trace, &whole, 0, "the file has one order more");
    assert_eq!(again.finish().orders.len(), expected.len());
}

/// Messages that a viewer sends at once: one, or a pause and what ends it, without which the run would
/// wait for ever.
fn random_messages(random: &mut Rng, sent: u64) -> Vec<Value> {
    let amount = 0.05 + 0.01 * random.u64(..25) as f64;
    let schedule = json!({"steps": 1 + random.u64(..5), "every": {"steps": 1 + random.u64(..4)}});
    let id = format!("m{sent}");
    let message = match random.u64(..13) {
        0 => json!({"id": id, "order": {"undo": 1 + random.u64(..2), "schedule": schedule}}),
        1 => json!({"id": id, "order": {"stack": squeeze(amount)["edits"], "schedule": schedule}}),
        2 => json!({"id": id, "cancel": {"order": format!("m{}", random.u64(..sent + 1))}}),
        3 => json!({"id": id, "order": {"edits": squeeze(1.5)["edits"], "schedule": schedule,
                    "guard": {"otherwise": "clamp"}}}),
        4 => json!({"id": id, "parameter": {"name": "heating", "value": amount}}),
        5 => json!({"id": id, "pipelines": {"set": [{"name": "shape", "on": "order",
                    "stages": [{"schedule": schedule}]}]}}),
        6 => {
            let resume = json!({"id": format!("{id}-ends"), "resume": {}});
            return vec![json!({"id": id, "pause": {}}), resume];
        }
        // In place of one of the last, which may wait still.
        7 => json!({"id": id, "order": {"edits": squeeze(amount)["edits"], "schedule": schedule,
                    "replaces": format!("m{}", sent.saturating_sub(1 + random.u64(..3)))}}),
        8 => json!({"id": id, "order": {"edits": [{"translate": {"features": ["nowhere"],
                    "by": [0, 0, amount]}}], "schedule": schedule}}),
        _ => json!({"id": id, "order": {"edits": squeeze(amount)["edits"], "schedule": schedule}}),
    };
    vec![message]
}

/// Waits until a run that was let go of has let go of its journal: a thread of its own does.
fn wait_for_lock(file: &Path) {
    let file = std::fs::File::open(file).unwrap();
    while file.try_lock().is_err() {
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The last cycle of which lines that are whole tell.
fn last_cycle(journal: &str) -> usize {
    let whole = journal.rsplit_once('\n').map_or("", |(whole, _)| whole);
    let cycle = |line: &str| {
        let line: Value = serde_json::from_str(line).ok()?;
        let is_settled = line["status"] == "applied" || line["status"] == "rejected";
        let of_command = line["cycle"].as_u64().filter(|_| is_settled);
        of_command.or(line["shape"]["cycle"].as_u64())
    };
    usize::try_from(whole.lines().filter_map(cycle).max().unwrap_or(0)).unwrap()
}

/// A run that is killed, or ends as it should, and goes on, again and again.
struct Killed {
    random: Rng,
    output: tempfile::TempDir,
    seed: u64,
    /// What a run that was never killed would have done so far.
    trace: Trace,
    /// Messages sent so far.
    sent: u64,
    /// Orders of which a viewer was told that they are accepted.
    acknowledged: Vec<String>,
    /// The journal when the last run was killed, or had ended, and everybody had been told that.
    #[cfg(target_os = "linux")]
    on_disk: Option<power::OnDisk>,
    /// The state that the next run goes on from, and its cycle.
    state: Option<(Vec<u8>, Mesh, u64)>,
    /// The line of the journal about it.
    line: String,
}

impl Killed {
    fn new(seed: u64) -> Self {
        Self {
            random: Rng::with_seed(seed),
            output: tempfile::tempdir().unwrap(),
            seed,
            trace: Trace::new(),
            sent: 0,
            acknowledged: Vec::new(),
            #[cfg(target_os = "linux")]
            on_disk: None,
            state: None,
            line: String::new(),
        }
    }

    fn file(&self) -> std::path::PathBuf {
        self.output.path().join("journal.jsonl")
    }

    fn journal(&self) -> String {
        std::fs::read_to_string(self.file()).unwrap_or_default()
    }

    /// The solver that begins, or goes on from the state that was saved.
    fn start(&self) -> Solver {
        let settings = settings(self.output.path(), true);
        let Some((state, mesh, cycle)) = &self.state else { return Solver::new(settings) };
        let checkpoint = Checkpoint::from_bytes(state).unwrap();
        let mut solver = Solver::new(settings.restart(checkpoint));
        (solver.mesh, solver.cycle) = (mesh.clone(), *cycle);
        solver
    }

    /// Compares what a run does again with what was done, as far as the journal tells.
    fn take_over(&mut self, done: Trace, known: usize) -> usize {
        let from = usize::try_from(self.state.as_ref().map_or(0, |state| state.2)).unwrap();
        let again = known.saturating_sub(from).min(done.len());
        let what = format!("seed {}:\n{}", self.seed, self.journal());
        assert_same(&done[..again], &self.trace, from, &what);
        let kept = self.trace.get(from + done.len()..known.max(from + done.len()));
        let rest = kept.unwrap_or_default().to_vec();
        self.trace.truncate(from);
        self.trace.extend(done);
        self.trace.extend(rest);
        again
    }

    /// The last cycle of which the journal tells behind the checkpoint.
    fn known(&self) -> usize {
        let journal = self.journal();
        let (_, after) = journal.split_once(&self.line).unwrap_or_default();
        last_cycle(after)
    }

    /// The line about the checkpoint that was made just now; a slow disk may be late with it.
    fn next_checkpoint(&self) -> String {
        loop {
            let journal = self.journal();
            let begun = journal.rfind("{\"run\":").unwrap_or(0);
            let whole = journal[begun..].rsplit_once('\n').map_or("", |(whole, _)| whole);
            // A run that ends well saves its state at the end, and may have saved it before.
            let is_next =
                |line: &&str| line.starts_with("{\"checkpoint\":") && **line != *self.line;
            if let Some(line) = whole.lines().rfind(is_next) {
                return line.to_owned();
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Saves the state of a run, and takes note of the line of the journal about it.
    fn save(&mut self, solver: &mut Solver) -> (Vec<u8>, Mesh, u64) {
        let bytes = solver.adaptor.checkpoint().to_bytes();
        self.line = self.next_checkpoint();
        (bytes, solver.mesh.clone(), solver.cycle)
    }

    /// Runs with a viewer that asks for this and that; says how many cycles it has done again. It saves
    /// its state at this cycle, if at any, and is killed, or saves its state and ends as it should.
    fn run(&mut self, cycles: u64, saved: Option<u64>) -> usize {
        let known = self.known();
        let mut solver = self.start();
        let mut viewer = Viewer::connect(&solver.adaptor);
        viewer.hello();
        let mut done = Trace::new();
        let mut state = None;
        for cycle in 0..cycles {
            if self.random.u64(..4) == 0 {
                let messages = random_messages(&mut self.random, self.sent);
                messages.iter().for_each(|message| viewer.send(message));
                self.sent += 1;
                if self.random.u64(..2) == 0 {
                    viewer.look_for("order", Duration::from_millis(5), |_| false);
                }
            }
            if Some(cycle) == saved {
                state = Some(self.save(&mut solver));
            }
            step(&mut solver, &mut done);
            std::thread::sleep(Duration::from_micros(self.random.u64(..3000)));
        }
        let ends_well = self.random.u64(..3) == 0;
        if ends_well {
            state = Some(self.save(&mut solver));
        }
        while viewer.look_for("nothing", Duration::from_millis(1), |_| true).is_some() {}
        let accepted = |message: &Value| {
            let order = message.get("order")?;
            (order["status"] == "accepted").then(|| order["id"].as_str().unwrap().to_owned())
        };
        self.acknowledged.extend(viewer.seen.iter().filter_map(accepted));
        self.acknowledged.sort();
        self.acknowledged.dedup();
        let killed = if ends_well {
            solver.finish();
            None
        } else {
            Some(solver)
        };
        #[cfg(target_os = "linux")]
        {
            self.on_disk = Some(power::OnDisk::of(&self.file()));
        }
        drop((killed, viewer));
        wait_for_lock(&self.file());
        let again = self.take_over(done, known);
        if let Some(state) = state {
            self.state = Some(state);
        }
        again
    }

    /// Has the power go when the run is killed: of what was not synced, the disk loses all that came
    /// after some place. Orders that were acknowledged are not among it.
    fn lose_power(&mut self) {
        #[cfg(target_os = "linux")]
        {
            let power::OnDisk { text, synced } = self.on_disk.take().unwrap();
            let end = synced + self.random.u64(..(text.len() - synced) as u64 + 1) as usize;
            let end = (synced..=end).rev().find(|&end| text.is_char_boundary(end)).unwrap();
            std::fs::write(self.file(), &text[..end]).unwrap();
        }
    }

    /// Runs to the end, and checks that each order that was acknowledged is there once.
    fn finish(&mut self) -> usize {
        let (known, journal) = (self.known(), self.journal());
        let mut solver = self.start();
        let from = self.state.as_ref().map_or(0, |state| state.2);
        let mut done = Trace::new();
        for _ in from..(known as u64).max(from) + 60 {
            step(&mut solver, &mut done);
            std::thread::sleep(Duration::from_millis(1));
        }
        let again = self.take_over(done, known);
        let orders = solver.finish().orders;
        // An order that was refused before the end stays refused, and is in the report as the others are.
        let refused =
            |id: &String| journal.contains(&format!("{{\"id\":\"{id}\",\"status\":\"rejected\""));
        for id in &self.acknowledged {
            let found: Vec<_> = orders.iter().filter(|order| order.id == *id).collect();
            let seed = self.seed;
            assert_eq!(found.len(), 1, "seed {seed}: {id} in {orders:?}\n{journal}");
            assert!(!refused(id) || found[0].status == OrderStatus::Rejected, "seed {seed}: {id}");
        }
        again
    }

    /// All runs in one journal are one run.
    fn replay(&self) {
        let journal = self.journal();
        let recording = parse_journal(&journal, "journal.jsonl").unwrap();
        let output = tempfile::tempdir().unwrap();
        let replay = Settings { replay: Some(recording), ..settings(output.path(), true) };
        let mut replayed = Solver::new(replay);
        let mut found = Trace::new();
        self.trace.iter().for_each(|_| step(&mut replayed, &mut found));
        assert_same(&found, &self.trace, 0, &format!("seed {}, replayed:\n{journal}", self.seed));
    }
}

/// What viewers ask for is found in the journal, wherever that was cut off and however often the run
/// was killed; no order that was acknowledged is missing, and none is there twice. Where the power goes
/// too, the disk keeps what was synced and no more: `common/power.rs` stands before `fdatasync`. As many
/// runs as `TOMBOLO_SEEDS` says.
#[test]
fn what_was_accepted_after_the_checkpoint_is_done_again() {
    let seeds = std::env::var("TOMBOLO_SEEDS").ok().and_then(|text| text.parse().ok());
    let mut done_again = 0;
    for seed in 0..seeds.unwrap_or(6) {
        let mut run = Killed::new(seed);
        let (saved, killed) = (5 + run.random.u64(..30), 6 + run.random.u64(..30));
        run.run(saved + killed, Some(saved));
        // The next ones go on from the same state, or have come to one of their own.
        for _ in 0..seed % 3 {
            if run.random.u64(..3) == 0 {
                run.lose_power();
            }
            let cycles = 1 + run.random.u64(..40);
            let saved = (run.random.u64(..3) == 0).then(|| run.random.u64(..cycles));
            done_again += run.run(cycles, saved);
        }
        if run.random.u64(..2) == 0 {
            run.lose_power();
        }
        done_again += run.finish();
        run.replay();
    }
    assert!(done_again > 0, "only {done_again} cycles were done again");
}

#[test]
fn an_order_is_carried_out_once_where_a_restarted_run_is_saved_before_it_has_come_to_it() {
    let output = tempfile::tempdir().unwrap();
    let file = output.path().join("journal.jsonl");
    let mut solver = Solver::new(settings(output.path(), true));
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    solver.step();
    viewer.send(&json!({"id": "squeeze", "order": squeeze(0.2)}));
    viewer.wait_for("order", |order| order["status"] == "accepted");
    // It is being planned.
    solver.step();
    let mut saved = (solver.adaptor.checkpoint(), solver.mesh.clone(), solver.cycle);
    drop((solver, viewer));
    for _ in 0..2 {
        wait_for_lock(&file);
        let mut again = Solver::new(settings(output.path(), true).restart(saved.0.clone()));
        saved.0 = again.adaptor.checkpoint();
    }
    wait_for_lock(&file);
    let mut last = Solver::new(settings(output.path(), true).restart(saved.0));
    (last.mesh, last.cycle) = (saved.1, saved.2);
    for _ in 0..40 {
        last.step();
        std::thread::sleep(Duration::from_millis(1));
    }
    let orders = last.finish().orders;
    let squeezes: Vec<_> = orders.iter().filter(|order| order.id == "squeeze").collect();
    assert_eq!(squeezes.len(), 1, "{orders:?}");
    assert_eq!(squeezes[0].status, OrderStatus::Applied, "{orders:?}");
    let journal = std::fs::read_to_string(&file).unwrap();
    let applied = journal.matches(r#"{"id":"squeeze","status":"applied""#).count();
    assert_eq!(applied, 1, "{journal}");
}

#[test]
fn several_ranks_go_on_from_one_file() {
    const RANKS: usize = 3;
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let output = tempfile::tempdir().unwrap();
    let file = output.path().join("run.checkpoint");
    let orders = parse_orders(ORDERS, "orders.json").unwrap();
    let run = |cycles: std::ops::Range<u64>, saved: Option<u64>, restarts: bool, start: &Mesh| {
        threads::run(RANKS, |ranks| {
            let of_cells = in_order(mesh.cells().len(), RANKS);
            let mut part = Part::cut(start, &of_cells, ranks.rank(), true).unwrap();
            let text = format!(r#"{{"version": 1, {PIPELINES}}}"#);
            let settings =
                Settings { config: config(&text), orders: orders.clone(), ..Settings::default() }
                    .parameter("heating", 1.0, 0.0..=2.0)
                    .on(Arc::new(ranks));
            let settings = if restarts { settings.restart_from_file(&file) } else { settings };
            let mut adaptor = Adaptor::initialize(settings).unwrap();
            let mut states = Vec::new();
            for cycle in cycles.clone() {
                let step = Step { cycle, time: cycle as f64 * 0.01, time_step: 0.01 };
                let speed: Vec<f64> =
                    part.points.iter().map(|[x, y, z]| x + y * z + step.time).collect();
                let fields = [tombolo::FieldView::vertex("speed", &speed)];
                let channel = Channel { name: "fluid", mesh: part.view(), fields: &fields };
                let steering = adaptor.execute(&step, &[channel]).unwrap();
                if let Some(motion) = steering.motion {
                    part.points.copy_from_slice(&motion.coordinates);
                }
                if saved == Some(cycle) {
                    adaptor.write_checkpoint(&file).unwrap();
                }
                let numbers = part.global_vertices.clone().unwrap_or_default();
                states.push((numbers, part.points.clone()));
            }
            states
        })
    };
    let whole = run(0..40, None, false, &mesh);
    for saved in [4, 12, 27] {
        let before = run(0..saved + 1, Some(saved), false, &mesh);
        // The mesh as the solver has saved it.
        let mut points = mesh.points().to_vec();
        for (numbers, values) in before.iter().map(|states| states.last().unwrap()) {
            for (number, value) in numbers.iter().zip(values) {
                points[usize::try_from(*number).unwrap()] = *value;
            }
        }
        let moved = mesh.with_points(points).unwrap();
        let after = run(saved + 1..40, None, true, &moved);
        for (rank, states) in after.iter().enumerate() {
            assert!(states[..] == whole[rank][usize::try_from(saved).unwrap() + 1..], "{saved}");
        }
    }
    let refused = Adaptor::initialize(Settings::default().restart_from_file(&file));
    let refused = refused.err().unwrap().to_string();
    assert!(refused.contains("not written whole") || refused.contains("3 ranks"), "{refused}");
}

#[test]
fn a_restart_that_only_some_ranks_were_given_is_refused_on_all() {
    let output = tempfile::tempdir().unwrap();
    for given in [[Some("a"), None], [None, Some("a")], [Some("a"), Some("b")]] {
        let said = threads::run(2, |ranks| {
            let file = given[ranks.rank()].map(|name| output.path().join(name));
            let settings = Settings::default().on(Arc::new(ranks));
            let settings = match file {
                Some(file) => settings.restart_from_file(file),
                None => settings,
            };
            settings.start().map(drop).unwrap_err().to_string()
        });
        assert_eq!(said[0], said[1]);
        assert!(said[0].contains("rank 1: it is to go on from another checkpoint"), "{said:?}");
    }
}

#[test]
fn another_mesh_or_file_is_refused() {
    let output = tempfile::tempdir().unwrap();
    let orders = parse_orders(ORDERS, "orders.json").unwrap();
    let given = || Settings { orders: orders.clone(), ..settings(output.path(), false) };
    let mut solver = Solver::new(given());
    solver.steps(5);
    let checkpoint = solver.adaptor.checkpoint();
    assert_eq!(checkpoint.cycle(), Some(4));
    drop(solver);
    let mut other = Solver::of_box([3, 4, 4], given().restart(checkpoint.clone()));
    let step = Step { cycle: 5, time: 0.05, time_step: 0.01 };
    let speed = vec![0.0; other.mesh.points().len()];
    let fields = [tombolo::FieldView::vertex("speed", &speed)];
    let channel =
        Channel { name: "fluid", mesh: tombolo::MeshView::from(&other.mesh), fields: &fields };
    let error = other.adaptor.execute(&step, &[channel]).unwrap_err().to_string();
    assert!(error.contains("not the mesh of the checkpoint") && error.contains("cells"), "{error}");
    drop(other);
    let mut bytes = checkpoint.to_bytes();
    bytes[100] ^= 1;
    let file = output.path().join("damaged");
    std::fs::write(&file, &bytes).unwrap();
    let error = Adaptor::initialize(given().restart_from_file(&file)).err().unwrap().to_string();
    assert!(error.contains("damaged"), "{error}");
    let nowhere = output.path().join("nowhere");
    let error = Adaptor::initialize(given().restart_from_file(&nowhere)).err().unwrap().to_string();
    assert!(error.contains("nowhere"), "{error}");
}

/// A restart with other orders takes those, and one with other pipelines these.
#[test]
fn what_a_restart_is_given_anew_takes_the_place_of_what_was() {
    let output = tempfile::tempdir().unwrap();
    let orders = parse_orders(ORDERS, "orders.json").unwrap();
    let mut solver =
        Solver::new(Settings { orders: orders.clone(), ..settings(output.path(), false) });
    solver.steps(2);
    let checkpoint = solver.adaptor.checkpoint();
    let mesh = solver.mesh.clone();
    drop(solver);
    let config = config(r#"{"version": 1}"#);
    let orders = parse_orders(r#"[{"at": {"cycle": 6}, "stop": {}}]"#, "orders.json").unwrap();
    let settings = Settings { config, orders, ..Settings::default() }.restart(checkpoint);
    let mut again = Solver::new(settings.parameter("heating", 1.0, 0.0..=2.0));
    (again.mesh, again.cycle) = (mesh, 2);
    again.steps(40);
    assert!(again.stopped);
    // That of the pipeline at its first step, which was under way.
    let orders = again.finish().orders;
    assert!(orders.len() == 1 && orders[0].status == OrderStatus::Applied, "{orders:?}");
}

/// The settings of a run whose orders come from viewers alone.
fn steered(output: &Path) -> Settings {
    let text = r#"{"version": 1, "journal": "journal.jsonl", "stream": {"listen": "127.0.0.1:0"},
        "pipelines": [{"name": "shape", "on": "order", "stages": [{"schedule": {"steps": 3}}]}]}"#;
    let settings = Settings { config: config(text), output: output.into(), ..Settings::default() };
    settings.parameter("heating", 1.0, 0.0..=2.0)
}

/// Has two orders in the steerer, and one more and a parameter in the queue.
fn let_wait(solver: &mut Solver, trace: &mut Trace) {
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    step(solver, trace);
    let accepted = |viewer: &mut Viewer, id: &str| {
        viewer.wait_for("order", |order| order["id"] == id && order["status"] == "accepted");
    };
    viewer.send(&json!({"id": "a", "order": squeeze(0.1)}));
    viewer.send(&json!({"id": "b", "order": squeeze(0.1)}));
    accepted(&mut viewer, "b");
    step(solver, trace);
    viewer.send(&json!({"id": "p", "parameter": {"name": "heating", "value": 1.5}}));
    viewer.send(&json!({"id": "c", "order": squeeze(0.1)}));
    accepted(&mut viewer, "c");
}

/// A run with orders that wait, which were given after `first`; its folder, and its steps so far.
fn waiting(first: impl Fn(&mut Solver)) -> (tempfile::TempDir, Solver, Trace) {
    for _ in 0..20 {
        let (output, mut trace) = (tempfile::tempdir().unwrap(), Trace::new());
        let mut solver = Solver::new(steered(output.path()));
        first(&mut solver);
        let_wait(&mut solver, &mut trace);
        // A plan may be ready before the step has looked for it; then the order waits no more.
        let waits = |order: &tombolo::OrderReport| {
            matches!(order.status, OrderStatus::Accepted | OrderStatus::Computing)
        };
        if solver.adaptor.orders().iter().all(waits) {
            return (output, solver, trace);
        }
        solver.finish();
    }
    panic!("no order waits in twenty runs");
}

/// A run that is stopped by a signal saves its state and ends well. What waits then is carried out by
/// the run that goes on from there, once.
#[test]
fn what_waits_when_a_run_saves_its_state_and_ends_is_carried_out_by_the_next() {
    let (output, mut solver, mut trace) = waiting(|_| ());
    let file = output.path().join("journal.jsonl");
    let checkpoint = solver.adaptor.checkpoint();
    let (saved, mesh) = (solver.cycle, solver.mesh.clone());
    let orders = solver.finish().orders;
    assert_eq!(orders.len(), 3, "{orders:?}");
    for order in &orders {
        assert_eq!(order.status, OrderStatus::Rejected, "{order:?}");
        let reason = order.reason.as_deref().unwrap_or_default();
        assert!(reason.contains("goes on from its checkpoint"), "{order:?}");
    }
    let journal = std::fs::read_to_string(&file).unwrap();
    assert!(!journal.contains("\"rejected\""), "{journal}");
    assert!(parse_journal(&journal, "journal.jsonl").unwrap().commands.is_empty(), "{journal}");
    let mut again = Solver::new(steered(output.path()).restart(checkpoint));
    (again.mesh, again.cycle) = (mesh, saved);
    while again.adaptor.orders().iter().any(|order| order.status != OrderStatus::Applied) {
        assert!(trace.len() < 100_000, "{:?}", again.adaptor.orders());
        step(&mut again, &mut trace);
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(again.adaptor.parameter("heating"), Some(1.5));
    let ids: Vec<String> = again.finish().orders.into_iter().map(|order| order.id).collect();
    assert_eq!(ids, ["a", "b", "c"]);
    let journal = std::fs::read_to_string(&file).unwrap();
    let recording = parse_journal(&journal, "journal.jsonl").unwrap();
    assert_eq!(recording.commands.len(), 4, "{journal}");
    let output = tempfile::tempdir().unwrap();
    let mut replayed = Solver::new(Settings { replay: Some(recording), ..steered(output.path()) });
    let mut found = Trace::new();
    (0..trace.len()).for_each(|_| step(&mut replayed, &mut found));
    assert_same(&found, &trace, 0, &format!("replayed:\n{journal}"));
}

#[test]
fn what_waits_when_a_run_ends_and_no_checkpoint_has_it_is_rejected() {
    let (output, solver, _) = waiting(|solver| drop(solver.adaptor.checkpoint()));
    let orders = solver.finish().orders;
    assert!(orders.iter().all(|order| order.status == OrderStatus::Rejected), "{orders:?}");
    let journal = std::fs::read_to_string(output.path().join("journal.jsonl")).unwrap();
    for id in ["a", "b", "c", "p"] {
        let rejected = format!("{{\"id\":\"{id}\",\"status\":\"rejected\"");
        assert_eq!(journal.matches(&rejected).count(), 1, "{id} in {journal}");
    }
}

/// Without a journal nobody knows of what came after the checkpoint.
#[test]
fn without_a_journal_only_what_is_in_the_checkpoint_is_said_to_go_on() {
    let output = tempfile::tempdir().unwrap();
    let text = r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": []}"#;
    let settings = Settings { config: config(text), ..steered(output.path()) };
    let mut solver = Solver::new(settings);
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    solver.step();
    let send = |viewer: &mut Viewer, id: &str| {
        viewer.send(&json!({"id": id, "order": squeeze(0.1)}));
        viewer.wait_for("order", |order| order["id"] == id && order["status"] == "accepted");
    };
    send(&mut viewer, "before");
    let _ = solver.adaptor.checkpoint();
    send(&mut viewer, "after");
    let goes_on = |order: &tombolo::OrderReport| {
        order.reason.as_deref().is_some_and(|reason| reason.contains("goes on"))
    };
    let orders = solver.finish().orders;
    assert_eq!(orders.iter().map(goes_on).collect::<Vec<_>>(), [true, false], "{orders:?}");
}
