//! Other pipelines while a run goes on: what stays, what starts anew, what is refused.
#![allow(clippy::unwrap_used, reason = "a test")]

use tombolo_deform::{
    communicator::{Communicator, threads},
    distributed::Part,
    mesh::{Mesh, MeshView},
    shapes::box_of_tets,
};
use tombolo_pipelines::{
    extract::{Channel, FieldView, Snapshot},
    language::{Command, Config, parse},
    run::{Output, ReplaceError, Runner},
};

fn config(pipelines: &[&str]) -> Config {
    let text = format!(r#"{{"version": 1, "pipelines": [{}]}}"#, pipelines.join(", "));
    parse(&text, "test.json").unwrap_or_else(|error| panic!("{error}"))
}

const SPEED: &str = r#"{"name": "speed", "stages": [{"statistics": {"field": "speed"}},
    {"time_statistics": {"name": "so far", "monitor": "speed.max", "measures": ["mean", "max"]}}]}"#;
/// Acts once, as soon as the speed has been above 2 for three steps.
const ALARM: &str = r#"{"name": "alarm", "stages": [], "when": "speed.max > 2", "for": {"steps": 2},
    "again_after": {"steps": 100}, "then": [{"stop": {}}]}"#;
const HEALTH: &str = r#"{"name": "health", "stages": [{"quality": {}}]}"#;
const LATE: &str = r#"{"name": "late", "at": {"cycle": 1}, "stages": [{"quality": {}}]}"#;

struct Run {
    mesh: Mesh,
    runner: Runner,
    cycle: u64,
}

impl Run {
    fn new(pipelines: &[&str]) -> Self {
        let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
        Self { mesh, runner: Runner::new(&config(pipelines)).unwrap(), cycle: 0 }
    }

    fn with<T>(&mut self, speed: f64, work: impl FnOnce(&mut Runner, &Snapshot) -> T) -> T {
        let speed = vec![speed; self.mesh.points().len()];
        let fields = [FieldView::vertex("speed", &speed)];
        let channels =
            [Channel { name: "fluid", mesh: MeshView::from(&self.mesh), fields: &fields }];
        let (cycle, time) = (self.cycle, 0.1 * self.cycle as f64);
        work(&mut self.runner, &Snapshot { cycle, time, channels: &channels })
    }

    /// Takes a step; whether anything asked the solver to stop.
    fn step(&mut self, speed: f64) -> bool {
        let outputs = self.with(speed, |runner, snapshot| runner.run(snapshot));
        self.cycle += 1;
        outputs
            .iter()
            .any(|output| matches!(output, Output::Command { command: Command::Stop {}, .. }))
    }

    fn replace(&mut self, pipelines: &[&str]) -> Result<[Vec<String>; 3], ReplaceError> {
        let config = config(pipelines);
        self.with(1.0, |runner, snapshot| {
            let next = runner.prepare(&config, snapshot)?;
            let changed = [next.added(), next.replaced(), next.removed()].map(<[String]>::to_vec);
            runner.replace(next, snapshot.channels);
            Ok(changed)
        })
    }

    fn count(&self, pipeline: &str) -> Option<u64> {
        self.runner.history(pipeline).map(|history| history.count())
    }
}

#[test]
fn what_stays_the_same_goes_on_wherever_it_stands() {
    let mut run = Run::new(&[HEALTH, SPEED, ALARM]);
    let mut alone = Run::new(&[SPEED, ALARM]);
    for cycle in 0..12 {
        let speed = if cycle > 4 { 3.0 } else { 1.0 };
        assert_eq!(run.step(speed), alone.step(speed), "cycle {cycle}");
        if cycle == 5 {
            // In the middle of the two steps for which the condition must hold.
            let changed = run.replace(&[LATE, ALARM, SPEED]).unwrap();
            assert_eq!(changed, [vec!["late".to_owned()], vec![], vec!["health".to_owned()]]);
        }
        if cycle == 9 {
            let other = HEALTH.replace("health", "late");
            let changed = run.replace(&[&other, SPEED, ALARM]).unwrap();
            assert_eq!(changed, [vec![], vec!["late".to_owned()], vec![]]);
        }
    }
    let [these, those] = [&run, &alone].map(|run| run.runner.history("speed").unwrap());
    assert!(these.measured().eq(those.measured()), "mean and maximum over all steps");
    assert_eq!((these.count(), run.count("health")), (12, None));
    // Once as its moment had passed, then at every step of its second life.
    assert_eq!(run.count("late"), Some(2));
    let cost = run.runner.costs().find(|(name, _)| *name == "speed").unwrap().1;
    assert_eq!(cost.runs, 12);
}

#[test]
fn what_is_replaced_starts_anew() {
    let mut run = Run::new(&[SPEED, ALARM]);
    (0..3).for_each(|_| assert!(!run.step(1.0)));
    (0..2).for_each(|_| assert!(!run.step(3.0)));
    run.replace(&[SPEED, &ALARM.replace(r#""steps": 100"#, r#""steps": 3"#)]).unwrap();
    let acts: Vec<bool> = (0..7).map(|_| run.step(3.0)).collect();
    assert_eq!(acts, [false, false, true, false, false, true, false]);
    run.replace(&[&SPEED.replace("mean", "min"), ALARM]).unwrap();
    assert_eq!(run.count("speed"), Some(0));
}

#[test]
fn a_trial_leaves_no_trace_and_says_what_is_wrong() {
    let mut run = Run::new(&[HEALTH]);
    run.step(1.0);
    let cases = [
        (r#"[{"statistics": {"field": "sped"}}]"#, "statistics: "),
        (r#"[{"surface": {}}, {"select": {"fields": ["sped"]}}, {"stream": {}}]"#, "select: "),
        (
            r#"[{"magnitude": {"field": "sped"}}, {"statistics": {"field": "sped_magnitude"}}]"#,
            "magnitude: ",
        ),
        (
            r#"[{"surface": {}}, {"force": {"name": "drag", "pressure": "sped", "features": ["z-max"]}}]"#,
            "force `drag`: ",
        ),
        (r#"[{"surface": {}}, {"render": {"file": "a.png", "field": "sped"}}]"#, "render: "),
    ];
    for (stages, expected) in cases {
        let new = format!(r#"{{"name": "new", "stages": {stages}}}"#);
        let error = run.replace(&[HEALTH, &new]).unwrap_err().to_string();
        let start = format!("pipeline `new` cannot run on this mesh: {expected}");
        assert!(error.starts_with(&start) && error.contains("speed"), "{error}");
        // The same where only `then` draws it.
        assert!(!run.step(1.0));
    }
    let then = r#"{"name": "new", "stages": [{"surface": {}}], "then": [{"render": {"file": "a.png", "field": "sped"}}]}"#;
    assert!(run.replace(&[HEALTH, then]).is_err());
    let elsewhere = r#"{"name": "new", "channel": "solid", "stages": [{"quality": {}}]}"#;
    assert!(run.replace(&[HEALTH, elsewhere]).unwrap_err().to_string().contains("solid"));
    assert_eq!(run.count("health"), Some(run.cycle));
    assert_eq!(run.runner.costs().count(), 1);
    // What the numbers are at this step is no reason; nor is there a mesh at the end.
    let end = r#"{"name": "end", "on": "end", "stages": [{"csv": {"file": "a.csv", "monitors": ["quality.min"]}}]}"#;
    let next = config(&[HEALTH, SPEED, end]);
    let not_finite = run.with(f64::NAN, |runner, snapshot| {
        let next = runner.prepare(&next, snapshot)?;
        assert_eq!(next.tables().count(), 1);
        assert!(next.keeps("health") && !next.keeps("speed"));
        runner.replace(next, snapshot.channels);
        Ok::<(), ReplaceError>(())
    });
    not_finite.unwrap();
    // What streams is seen at once.
    let view =
        r#"{"name": "view", "every": {"steps": 50}, "stages": [{"surface": {}}, {"stream": {}}]}"#;
    let frames = run.with(1.0, |runner, snapshot| {
        let mut next = runner.prepare(&config(&[HEALTH, SPEED, end, view]), snapshot).unwrap();
        next.take_frames()
    });
    assert!(
        matches!(&frames[..], [frame] if &*frame.pipeline == "view" && frame.cycle == run.cycle)
    );
    // A monitor that a table names is gone.
    let error = run.with(1.0, |runner, snapshot| {
        let mut next = next.clone();
        next.pipelines.remove(0);
        runner.prepare(&next, snapshot).err().unwrap()
    });
    assert!(matches!(error, ReplaceError::Configuration(_)), "{error}");
}

#[test]
fn a_trial_knows_the_parameters() {
    let mut run = Run::new(&[HEALTH]);
    run.runner.set_parameters([("inflow", 2.0)]);
    run.step(1.0);
    let scaled = r#"{"name": "scaled", "stages": [
        {"expression": {"name": "twice", "formula": "speed * parameter.inflow"}},
        {"statistics": {"field": "twice"}}]}"#;
    assert_eq!(run.replace(&[HEALTH, scaled]).unwrap()[0], ["scaled"]);
    let error = run.replace(&[HEALTH, &scaled.replace("inflow", "outflow")]).unwrap_err();
    assert!(error.to_string().contains("parameter"), "{error}");
}

#[test]
fn ranks_agree_on_what_cannot_run() {
    let mesh = box_of_tets([3, 2, 2], [0.0; 3], [1.0; 3]);
    let count = mesh.cells().len();
    let outcomes = threads::run(3, |ranks| {
        let rank = ranks.rank();
        // The first rank has nothing of the mesh.
        let of_cells: Vec<usize> = (0..count).map(|cell| 1 + cell * 2 / count).collect();
        let part = Part::cut(&mesh, &of_cells, rank, true).unwrap();
        let speed = vec![1.0; part.points.len()];
        let fields = [FieldView::vertex("speed", &speed)];
        let lent = if rank == 0 { &[][..] } else { &fields[..] };
        let channels = [Channel::new("fluid", part.view(), lent)];
        let mut runner =
            Runner::with_communicator(&config(&[HEALTH]), std::sync::Arc::new(ranks)).unwrap();
        let snapshot = Snapshot { cycle: 1, time: 0.1, channels: &channels };
        let wrong = config(&[
            HEALTH,
            &SPEED.replace("\"field\": \"speed\"", "\"field\": \"sped\", \"name\": \"speed\""),
        ]);
        let error = runner.prepare(&wrong, &snapshot).err().unwrap().to_string();
        let right = runner.prepare(&config(&[HEALTH, SPEED]), &snapshot).unwrap();
        runner.replace(right, &channels);
        runner.run(&snapshot);
        (error, runner.history("speed").unwrap().last().cloned())
    });
    assert!(outcomes.iter().all(|outcome| *outcome == outcomes[0]), "{outcomes:?}");
    assert!(outcomes[0].0.contains("pipeline `speed` cannot run on this mesh: rank 1: statistics"));
    assert_eq!(outcomes[0].1.as_ref().map(|last| last.values[1]), Some(1.0));
}
