//! When pipelines run and act, what they write of monitors, and what they may cost.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use tombolo_deform::communicator::{Communicator, threads};
use tombolo_deform::distributed::Part;
use tombolo_deform::mesh::MeshView;
use tombolo_deform::shapes::box_of_tets;
use tombolo_pipelines::extract::{Channel, FieldView, Snapshot};
use tombolo_pipelines::language::{Command, Config, Existing, check_parameters, parse};
use tombolo_pipelines::run::{Audience, Output, Runner};

fn config(pipelines: &str) -> Config {
    let text = format!(r#"{{"version": 1, "pipelines": [{pipelines}]}}"#);
    parse(&text, "test.json").unwrap_or_else(|error| panic!("{error}"))
}

fn runner(pipelines: &str) -> Runner {
    Runner::new(&config(pipelines)).unwrap()
}

/// The outputs of a step in which the field `p` has this value everywhere.
fn step(runner: &mut Runner, cycle: u64, value: f64) -> Vec<Output> {
    step_of(0, runner, cycle, value)
}

/// The same on a rank: rank 0 has all of the mesh.
fn step_of(rank: usize, runner: &mut Runner, cycle: u64, value: f64) -> Vec<Output> {
    let mesh = box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]);
    let values = vec![value; mesh.points().len()];
    let fields = [FieldView::vertex("p", &values)];
    let (all, none) = (MeshView::from(&mesh), Part::default());
    let channel = match rank {
        0 => Channel::new("fluid", all, &fields),
        _ => Channel::new("fluid", none.view(), &[]),
    };
    runner.run(&Snapshot { cycle, time: 0.5 * cycle as f64, channels: &[channel] })
}

/// What the outputs ask for besides monitors, in words.
fn words(outputs: &[Output]) -> Vec<String> {
    let said = outputs.iter().filter_map(|output| match output {
        Output::Monitor(_) => None,
        Output::Command { command, .. } => Some(match command {
            Command::Parameter(parameter) => format!("{} = {}", parameter.name, parameter.value),
            other => format!("{other:?}"),
        }),
        Output::Row { table, cycle, time, values, .. } => {
            Some(format!("{}: {cycle} {time} {values:?}", table.file))
        }
        Output::Log { level, message, .. } => Some(format!("{level:?}: {message}")),
        Output::Error { message, .. } => Some(message.clone()),
        other => panic!("{other:?}"),
    });
    said.collect()
}

#[test]
fn a_trigger_does_not_flap_and_sets_parameters() {
    let mut runner = runner(
        r#"{"name": "p", "every": {"steps": 2}, "stages": [{"statistics": {"field": "p", "unit": "Pa"}}]},
           {"name": "relief", "stages": [], "when": "p.max > 10 * parameter.valve", "for": {"steps": 2},
            "again_after": {"condition": "p.max < 5"},
            "then": [{"set": {"name": "valve", "value": 0.5}}, {"log": {"message": "open at {time} s, {p/p.max} Pa"}}]}"#,
    );
    assert!(words(&step(&mut runner, 0, 50.0)).is_empty(), "no valve was told of");
    runner.set_parameters([("valve", 1.0)]);
    let mut said = Vec::new();
    for (cycle, value) in (2..).zip([50.0, 60.0, 70.0, 80.0, 90.0, 1.0, 1.0, 2.0, 30.0, 30.0, 30.0])
    {
        let words = words(&step(&mut runner, cycle, value));
        said.extend(words.into_iter().map(|word| format!("{cycle} {word}")));
    }
    // From 2 on it holds; at 8 it is known to be over, and from 10 on it holds again.
    assert_eq!(
        said,
        [
            "4 valve = 0.5",
            "4 Warning: open at 2 s, 70 Pa",
            "12 valve = 0.5",
            "12 Warning: open at 6 s, 30 Pa"
        ]
    );
}

/// A step without the channel makes every monitor NaN and begins the wait of `for` anew.
#[test]
fn a_channel_that_is_missing_is_no_value() {
    let mut runner = runner(
        r#"{"name": "watch", "stages": [{"statistics": {"field": "p"}}], "when": "p.max > 1", "for": {"steps": 3},
            "then": [{"pause": {}}]}"#,
    );
    let mut paused = Vec::new();
    for cycle in 0..9 {
        let outputs = if cycle == 2 {
            let outputs = runner.run(&Snapshot { cycle, time: 1.0, channels: &[] });
            let told = outputs.iter().find_map(|output| match output {
                Output::Monitor(monitor) => Some(monitor.values.clone()),
                _ => None,
            });
            let told = told.expect("the monitors are told of");
            assert!(!told.is_empty() && told.iter().all(|(_, value)| value.is_nan()), "{told:?}");
            assert!(matches!(&outputs[..], [.., Output::Error { .. }]), "{outputs:?}");
            outputs
        } else {
            step(&mut runner, cycle, 2.0)
        };
        if words(&outputs).contains(&"Pause".to_owned()) {
            paused.push(cycle);
        }
    }
    // From step 3 on it has held for three steps at step 6, not at step 3.
    assert_eq!(paused.first(), Some(&6));
}

#[test]
fn tables_and_lines_show_what_was_measured_so_far() {
    let pipelines = r#"
        {"name": "p", "stages": [{"statistics": {"field": "p", "name": "all", "unit": "Pa"}}, {"csv": {"file": "p.csv"}},
            {"log": {"level": "info"}}]},
        {"name": "some", "stages": [{"difference": {"name": "zero", "of": "all.max", "minus": "all.min"}},
            {"csv": {"file": "some.csv", "monitors": ["zero", "all.mean", "parameter.valve", "later.x"], "existing": "continue"}}]},
        {"name": "later", "stages": [{"difference": {"name": "later.x", "of": "all.max", "minus": "all.min"}}]},
        {"name": "end", "on": "end", "stages": [{"difference": {"name": "last", "of": "all.max", "minus": "zero"}},
            {"log": {"message": "in the end {last}"}}], "when": "last > 3", "then": [{"csv": {"file": "end.csv"}}]}"#;
    let mut one = runner(pipelines);
    one.set_parameters([("valve", 0.25)]);
    let outputs = step(&mut one, 3, 4.0);
    assert_eq!(
        words(&outputs),
        [
            "p.csv: 3 1.5 [4.0, 4.0, 4.0, 4.0, 0.0]",
            "Info: cycle 3, time 1.5, all.min [Pa] 4, all.max [Pa] 4, all.mean [Pa] 4, all.l2 [Pa] 4, all.non_finite 0",
            "some.csv: 3 1.5 [0.0, 4.0, 0.25, NaN]",
        ]
    );
    let table = outputs.iter().find_map(|output| match output {
        Output::Row { table, .. } if table.file == "some.csv" => Some(table),
        _ => None,
    });
    let table = table.unwrap();
    assert_eq!(table.titles, ["zero", "all.mean [Pa]", "parameter.valve", "later.x"]);
    assert_eq!(table.existing, Existing::Continue);
    assert_eq!(words(&one.finish(3, 1.5)), ["Warning: in the end 4", "end.csv: 3 1.5 [4.0]"]);
    let history = one.history("p").unwrap();
    assert_eq!((history.count(), history.last().unwrap().values[1]), (1, 4.0));
    assert_eq!(history.monitors()[0].titled(), "all.min [Pa]");

    // Rank 0 alone writes.
    let written = threads::run(3, |ranks| {
        let ranks: Arc<dyn Communicator> = Arc::new(ranks);
        let rank = ranks.rank();
        let mut runner = Runner::with_communicator(&config(pipelines), ranks).unwrap();
        let outputs = step_of(rank, &mut runner, 0, 1.0);
        let is_written =
            |output: &&Output| matches!(output, Output::Row { .. } | Output::Log { .. });
        let ended = runner.finish(0, 0.0).len();
        (outputs.iter().filter(is_written).count(), ended)
    });
    assert_eq!(written, [(3, 2), (0, 1), (0, 1)]);
}

#[test]
fn the_clock_and_viewers_make_pipelines_due() {
    let mut runner = runner(
        r#"{"name": "slow", "every": {"seconds": 10}, "stages": [{"log": {"message": "slow"}}]},
           {"name": "hello", "on": "viewer", "stages": [{"log": {"message": "hello"}}]}"#,
    );
    assert!(runner.listens());
    let mut said = Vec::new();
    for (cycle, (seconds, viewers)) in
        (0..).zip([(0.0, 0), (4.0, 1), (9.9, 1), (10.1, 3), (19.0, 3), (45.0, 3), (46.0, 3)])
    {
        runner.tell(seconds, viewers);
        assert_eq!(runner.is_due(cycle, 0.0), [0, 1, 3, 5].contains(&cycle), "{cycle}");
        said.extend(
            words(&step(&mut runner, cycle, 0.0)).into_iter().map(|word| format!("{cycle} {word}")),
        );
    }
    assert_eq!(
        said,
        [
            "0 Warning: slow",
            "1 Warning: hello",
            "3 Warning: slow",
            "3 Warning: hello",
            "5 Warning: slow"
        ]
    );
}

#[test]
fn a_budget_thins_the_cadence_alike_on_all_ranks() {
    let pipelines = r#"
        {"name": "dear", "budget": {"percent": 2}, "stages": [{"quality": {}}]},
        {"name": "free", "stages": [{"quality": {}}]}"#;
    let made = threads::run(3, |ranks| {
        let ranks: Arc<dyn Communicator> = Arc::new(ranks);
        // A clock of its own for each rank; those of the others say that it costs nothing.
        let rank = ranks.rank();
        let ticks = Arc::new(AtomicU64::new(0));
        let read = Arc::clone(&ticks);
        let clock = move || {
            let own = if rank == 0 { 50 } else { 0 };
            read.fetch_add(own, Ordering::Relaxed) as f64 * 1e-3
        };
        let runner = Runner::with_communicator(&config(pipelines), ranks).unwrap();
        let mut runner = runner.with_clock(clock);
        let (mut ran, mut said) = (Vec::new(), Vec::new());
        for cycle in 0..200 {
            ticks.fetch_add(1000, Ordering::Relaxed);
            assert!(runner.is_due(cycle, 0.0));
            for output in step_of(rank, &mut runner, cycle, 0.0) {
                match output {
                    Output::Monitor(monitor) if &*monitor.pipeline == "dear" => ran.push(cycle),
                    Output::Error { message, .. } => said.push(message),
                    _ => {}
                }
            }
        }
        let cost = runner.costs().find(|(name, _)| *name == "dear").unwrap().1;
        assert_eq!((cost.runs, cost.every), (ran.len() as u64, 4), "{ran:?}");
        assert!(cost.memory > 0 && cost.bytes == 0);
        if rank == 0 {
            assert!((cost.seconds - 0.05 * cost.runs as f64).abs() < 1e-9);
        }
        (ran, said)
    });
    assert!(made[1].0 == made[0].0 && made[2].0 == made[0].0);
    let said = &made[0].1;
    assert!(said.len() == 2 && said[1].contains("runs at one in 4 of its times"), "{said:?}");
    assert!(made[1].1.is_empty() && made[2].1.is_empty(), "rank 0 speaks for all");
    let last: Vec<u64> =
        made[0].0.windows(2).rev().take(20).map(|pair| pair[1] - pair[0]).collect();
    assert_eq!(last, [4; 20]);
}

/// A view rests while nobody looks, on all ranks; what measures, and what comes once, does not.
#[test]
fn views_rest_while_nobody_looks() {
    let pipelines = r#"
        {"name": "view", "every": {"steps": 2}, "stages": [{"surface": {}}, {"stream": {}}]},
        {"name": "health", "every": {"steps": 2}, "stages": [{"surface": {}}, {"statistics": {"field": "p"}}, {"stream": {}}]},
        {"name": "limited", "every": {"steps": 2}, "budget": {"percent": 0.1}, "stages": [{"surface": {}}, {"stream": {}}]},
        {"name": "once", "at": {"cycle": 7}, "stages": [{"surface": {}}, {"stream": {}}]}"#;
    let made = threads::run(3, |ranks| {
        let rank = ranks.rank();
        // A run takes 45 milliseconds on the clock of rank 0, and none by those of the others.
        let ticks = AtomicU64::new(0);
        let clock = move || {
            let own = if rank == 0 { 45 } else { 0 };
            ticks.fetch_add(own, Ordering::Relaxed) as f64 * 1e-3
        };
        let runner = Runner::with_communicator(&config(pipelines), Arc::new(ranks)).unwrap();
        let mut runner = runner.with_clock(clock);
        assert!(runner.listens());
        let ran_at = |cycle: u64| {
            runner.tell(10.0 * cycle as f64, 0);
            // Somebody who looks at another view wakes none of these.
            let is_away = (4..19).contains(&cycle);
            let looks_at: &[&str] = if is_away { &["other"] } else { &["view", "limited"] };
            runner.set_audience(Audience::of(looks_at.iter().copied()));
            let before: Vec<u64> = runner.costs().map(|(_, cost)| cost.runs).collect();
            step_of(rank, &mut runner, cycle, 0.0);
            let ran = runner.costs().zip(before).filter(|((_, cost), runs)| cost.runs > *runs);
            ran.map(|((name, _), _)| (name.to_owned(), cycle)).collect::<Vec<_>>()
        };
        (0..26).flat_map(ran_at).collect::<Vec<_>>()
    });
    let of = |ran: &[(String, u64)], name: &str| -> Vec<u64> {
        ran.iter().filter(|(of, _)| of == name).map(|(_, cycle)| *cycle).collect()
    };
    for ran in made {
        // It is taken when the last viewer has left, then no more often than a thousandth of the time
        // allows, and at once when somebody comes.
        assert_eq!(of(&ran, "view"), [0, 2, 4, 10, 16, 19, 20, 22, 24]);
        assert_eq!(of(&ran, "health"), (0..26).step_by(2).collect::<Vec<_>>());
        assert_eq!(of(&ran, "once"), [7]);
        // One that its budget thins is fresh for whoever comes, too.
        let limited = of(&ran, "limited");
        assert!(limited.contains(&19) && limited.len() < of(&ran, "view").len(), "{limited:?}");
    }
}

#[test]
fn what_means_nothing_is_refused_with_its_place() {
    let p = r#"{"name": "p", "stages": [{"statistics": {"field": "p"}}]}"#;
    let more = r#"{"name": "q", "stages": [{"statistics": {"field": "p"}}]}"#;
    for (pipelines, expected) in [
        (
            format!(r#"{p}, {{"name": "a", "stages": [{{"difference": {{"name": "d", "of": "p.mxa", "minus": "p.min"}}}}]}}"#),
            "pipelines[1].stages[0].difference.of: found the unknown name `p.mxa`, expected a monitor; did you mean `p.max`?",
        ),
        (
            format!(r#"{p}, {more}, {{"name": "a", "stages": [{{"spectrum": {{"name": "d", "monitor": "p.max"}}}}]}}"#),
            "spectrum.monitor: found `p.max`, which several pipelines have, expected `p/p.max` or `q/p.max`",
        ),
        (
            r#"{"name": "a", "stages": [{"difference": {"name": "d", "of": "s.min", "minus": "s.max"}},
                {"statistics": {"field": "s"}}]}"#.into(),
            "difference.of: found `s.min`, which no stage before has measured",
        ),
        (
            format!(r#"{p}, {{"name": "a", "stages": [], "when": "1 < 2 && p.mxa > 3", "then": [{{"stop": {{}}}}]}}"#),
            "pipelines[1].when: column 10 of the formula: found the unknown name `p.mxa`, expected a monitor",
        ),
        (
            r#"{"name": "a", "stages": [{"spectrum": {"name": "d", "monitor": "time", "samples": 100}}]}"#.into(),
            "spectrum.samples: found 100, expected a power of two of at least 8, as 128",
        ),
        (
            r#"{"name": "a", "stages": [{"csv": {"file": "a.csv"}}]}, {"name": "b", "stages": [{"csv": {"file": "a.csv"}}]}"#.into(),
            "another pipeline writes the file `a.csv`",
        ),
        (
            r#"{"name": "a", "stages": [{"render": {"file": "a.cdb"}}, {"render": {"file": "a.cdb", "field": "p"}}]}"#.into(),
            "pipelines[0]: two `render` write the database `a.cdb`",
        ),
        (
            r#"{"name": "a", "stages": [{"render": {"file": "a.cdb"}}]},
                {"name": "b", "stages": [{"render": {"file": "b.cdb"}}], "when": "cycle > 1", "then": [{"render": {"file": "a.cdb"}}]}"#.into(),
            "pipelines[1]: two `render` write the database `a.cdb`",
        ),
        (
            r#"{"name": "a", "stages": [{"render": {"file": "a-{cycle}.cdb"}}]}"#.into(),
            "render.file: found `a-{cycle}.cdb`, expected a name without `{`",
        ),
        (
            r#"{"name": "a", "stages": [{"csv": {"file": "a.txt"}}]}"#.into(),
            "csv.file: found the file `a.txt`, expected one that ends in `.csv`",
        ),
        (
            r#"{"name": "a", "stages": [{"log": {"message": "{time"}}]}"#.into(),
            "log.message: found '{' without its '}'",
        ),
        (r#"{"name": "a", "for": {"steps": 2}, "stages": []}"#.into(), "found `for` without `when`"),
        (
            r#"{"name": "a", "budget": {"percent": 0}, "stages": []}"#.into(),
            "budget.percent: found 0, expected a number above 0 and at most 100",
        ),
        (
            r#"{"name": "a", "on": "end", "stages": [{"quality": {}}]}"#.into(),
            "there is no mesh any more",
        ),
        (
            r#"{"name": "a", "on": "end", "stages": [], "when": "time > 1", "then": [{"pause": {}}]}"#.into(),
            "pipelines[0].then[0].pause: when the run ends there is no mesh any more, and nobody to obey",
        ),
        (
            r#"{"name": "a", "on": "viewer", "budget": {"percent": 1}, "stages": []}"#.into(),
            "pipelines[0].budget: a budget thins how often a pipeline runs, expected `every` beside it",
        ),
        (
            r#"{"name": "a", "stages": [{"write": {"file": "a.pvtp"}}]}"#.into(),
            "write.file: a `.pvtp` file holds surfaces, expected a source stage such as `surface` first, or a `.pvtu` file",
        ),
        (
            r#"{"name": "a", "stages": [{"write": {"file": "a-{cycle}.vtu"}}]},
                {"name": "b", "stages": [], "when": "cycle > 1", "then": [{"write": {"file": "a-{cycle}.vtu", "keep": 2}}]}"#.into(),
            "pipelines[1]: another pipeline writes the file `a-{cycle}.vtu`",
        ),
        (
            r#"{"name": "a", "stages": [{"force": {"name": "f", "pressure": "p"}}]}"#.into(),
            "expected a `surface` stage before it",
        ),
        (
            r#"{"name": "a", "stages": [{"surface": {}}, {"force": {"name": "f", "velocity": "u"}}]}"#.into(),
            "found `velocity` without `viscosity`",
        ),
        (
            r#"{"name": "a", "stages": [{"surface": {}}, {"force": {"name": "f", "velocity": "u", "viscosity": []}}]}"#.into(),
            "expected a number or the name of a field",
        ),
        (
            r#"{"name": "a", "stages": [{"integrate": {"name": "f", "units": {"flowrate": "m3/s"}}}]}"#.into(),
            "integrate.units: found `flowrate`, expected one of `size`, `integral`, `mean`, `flow_rate`; did you mean `flow_rate`?",
        ),
        (
            r#"{"name": "a", "stages": [{"time_statistics": {"name": "t"}}]}"#.into(),
            "expected exactly one of `monitor` and `field`",
        ),
        (
            r#"{"name": "a", "stages": [{"surface": {}}, {"time_statistics": {"name": "t", "field": "p"}}]}"#.into(),
            "must come before all stages but those that derive fields",
        ),
        (
            r#"{"name": "a", "stages": [{"histogram": {"name": "h", "field": "p", "range": [2, 2]}}]}"#.into(),
            "histogram.range[0]: found 2, expected less than `range[1]`: 2",
        ),
        (
            r#"{"name": "a", "stages": [{"histogram": {"name": "h", "field": "p", "bins": 5000}}]}"#.into(),
            "histogram.bins: found 5000 bins, expected at most 1024",
        ),
    ] {
        let text = format!(r#"{{"version": 1, "pipelines": [{pipelines}]}}"#);
        let message = parse(&text, "test.json").unwrap_err().to_string();
        assert!(message.contains(expected), "{expected}\n{message}");
    }
    let config = config(
        r#"{"name": "a", "stages": [], "when": "parameter.valvo > 1", "then": [{"set": {"name": "valve", "value": 2}}]}"#,
    );
    let message = check_parameters(&config, &["valve"]).unwrap_err().to_string();
    assert!(
        message.contains("pipelines[0].when: the solver has no parameter `valvo`"),
        "{message}"
    );
    assert!(check_parameters(&config, &["valve", "valvo"]).is_ok());
    assert!(check_parameters(&config, &["valvo"]).is_err());
}

/// A formula has the value that a parameter has at its step, on all ranks.
#[test]
fn a_formula_follows_a_parameter() {
    let pipelines = r#"
        {"name": "f", "stages": [
           {"expression": {"name": "force", "components": ["p * parameter.inflow^2", "{parameter.two words} + 0 * p"]}},
           {"expression": {"name": "constant", "formula": "parameter.inflow"}},
           {"statistics": {"field": "force"}}, {"statistics": {"field": "constant"}}]}"#;
    for ranks in 1..=4 {
        let made = threads::run(ranks, |ranks| {
            let ranks: Arc<dyn Communicator> = Arc::new(ranks);
            let rank = ranks.rank();
            let mut runner = Runner::with_communicator(&config(pipelines), ranks).unwrap();
            let mut found = Vec::new();
            for (cycle, inflow) in [(0, 2.0), (1, 3.0), (2, -1.0)] {
                runner.set_parameters([("inflow", inflow), ("two words", 0.0)]);
                for output in step_of(rank, &mut runner, cycle, 5.0) {
                    match output {
                        Output::Monitor(values) => {
                            let of = |wanted: &str| {
                                values.values.iter().find(|(name, _)| name == wanted).unwrap().1
                            };
                            found.push([of("force.max"), of("constant.min"), of("constant.max")]);
                        }
                        other => panic!("{other:?}"),
                    }
                }
            }
            found
        });
        for found in made {
            assert_eq!(found, [[20.0, 2.0, 2.0], [45.0, 3.0, 3.0], [5.0, -1.0, -1.0]]);
        }
    }
}

#[test]
fn a_parameter_is_neither_unknown_nor_a_field() {
    let told = |formula: &str, parameters: &[(&'static str, f64)], field: &str| {
        let stage = format!(r#"{{"expression": {{"name": "e", "formula": "{formula}"}}}}"#);
        let mut runner = runner(&format!(r#"{{"name": "a", "stages": [{stage}]}}"#));
        runner.set_parameters(parameters.iter().copied());
        let mesh = box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]);
        let values = vec![[1.0, 2.0, 3.0]; mesh.points().len()];
        let fields = [FieldView::vertex(field, &values)];
        let channel = Channel::new("fluid", MeshView::from(&mesh), &fields);
        words(&runner.run(&Snapshot { cycle: 0, time: 0.0, channels: &[channel] })).join("\n")
    };
    let inflow = [("inflow", 1.0), ("valve", 2.0)];
    assert_eq!(told("parameter.inflow + u.x", &inflow, "u"), "");
    assert_eq!(
        told("parameter.inflw", &inflow, "u"),
        "expression: the solver has no parameter `inflw`; it has inflow, valve; did you mean \
         `parameter.inflow`?"
    );
    assert_eq!(
        told("parameter.x", &[], "parameter"),
        "expression: the solver has no parameter `x`; it has none"
    );
    assert_eq!(
        told("inflow", &inflow, "u"),
        "expression: the channel has no field `inflow`; the parameter of that name is \
         `parameter.inflow`; did you mean `parameter.inflow`?"
    );
    for field in ["parameter", "parameter.x"] {
        assert_eq!(
            told("parameter.x", &[("x", 1.0)], field),
            format!(
                "expression: `parameter.x` is a parameter of the solver, and of the field \
                 `{field}` too; expected a field of another name"
            )
        );
    }
    // At the start the adaptor knows what there is.
    let config = config(
        r#"{"name": "a", "stages": [
            {"expression": {"name": "e", "components": ["x", "parameter.inflw"]}},
            {"log": {"message": "{parameter.valv}"}}], "when": "parameter.inlfow > 0", "then": [{"stop": {}}]}"#,
    );
    let problems = check_parameters(&config, &["inflow", "valve"]).unwrap_err();
    let problems: Vec<String> = problems.iter().map(ToString::to_string).collect();
    assert_eq!(
        problems,
        [
            "pipelines[0].when: the solver has no parameter `inlfow`; it has inflow, valve; did you mean `inflow`?",
            "pipelines[0].stages[0].expression.components[1]: the solver has no parameter `inflw`; it has inflow, valve; did you mean `inflow`?",
            "pipelines[0].stages[1].log.message: the solver has no parameter `valv`; it has inflow, valve; did you mean `valve`?",
        ]
    );
    let text = r#"{"version": 1, "pipelines": [{"name": "a", "stages": [{"magnitude": {"field": "u", "name": "parameter.u"}}]}]}"#;
    let error = parse(text, "test.json").unwrap_err().to_string();
    assert!(error.contains("found `parameter.u`, which has a meaning of its own"), "{error}");
}
