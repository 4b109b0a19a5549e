//! Monitors outside: tables, files that stay, costs in the report and the status, parameters that
//! pipelines set, and what the clock and viewers make due.

mod common;

use std::fs::read_to_string;
use std::sync::Arc;
use std::time::{Duration, Instant};

use common::{Solver, Viewer, config};
use tombolo::{
    Adaptor, Parameter, Settings, Step,
    deform::{
        communicator::{Communicator, threads},
        distributed::{Part, in_order},
        shapes::box_of_tets,
    },
    pipelines::extract::Channel,
};

fn valve() -> Vec<Parameter> {
    vec![Parameter { name: "valve".into(), value: 1.0, minimum: 0.0, maximum: 2.0 }]
}

#[test]
fn tables_and_files_are_written_and_told_in_the_report() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"{"version": 1, "pipelines": [
        {"name": "speed", "every": {"steps": 2}, "stages": [{"statistics": {"field": "speed", "unit": "m/s"}},
            {"csv": {"file": "tables/speed.csv", "monitors": ["speed.max", "parameter.valve"]}}]},
        {"name": "close", "stages": [], "when": "speed.max > 2.025", "again_after": {"condition": "speed.max < 1"},
            "then": [{"set": {"name": "valve", "value": 0.5}}]},
        {"name": "states", "stages": [{"surface": {}}, {"write": {"file": "state-{cycle}.pvtu", "keep": 2}}]},
        {"name": "end", "on": "end", "stages": [{"csv": {"file": "end.csv", "monitors": ["speed.max"]}}]}]}"#;
    let mut solver = Solver::new(Settings {
        config: config(text),
        parameters: valve(),
        output: folder.path().into(),
        ..Settings::default()
    });
    solver.steps(7);
    assert_eq!(solver.parameters, [("valve".to_owned(), 0.5)]);
    assert_eq!(solver.adaptor.history("speed").unwrap().measured().len(), 4);
    assert!(solver.adaptor.history("sped").is_none());
    let report = solver.finish();
    // The greatest speed is 2 and a hundredth for each step; what is over 2.025 was seen at cycle 4.
    assert_eq!(
        read_to_string(folder.path().join("tables/speed.csv")).unwrap(),
        "cycle,time,speed.max [m/s],parameter.valve\n0,0,2,1\n2,0.02,2.02,1\n4,0.04,2.04,1\n6,0.06,2.06,0.5\n"
    );
    let end = read_to_string(folder.path().join("end.csv")).unwrap();
    assert_eq!(end, "cycle,time,speed.max [m/s]\n6,0.06,2.06\n");
    let mut there: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .filter(|name| name.starts_with("state"))
        .collect();
    there.sort();
    let kept =
        ["state-000005", "state-000005.pvtu", "state-000006", "state-000006.pvtu", "states.pvd"];
    assert_eq!(there, kept);
    let series = read_to_string(folder.path().join("states.pvd")).unwrap();
    assert_eq!(series.matches("<DataSet ").count(), 2, "{series}");

    let [speed, close, states, end] = &report.pipelines[..] else { panic!("{report:?}") };
    assert_eq!([speed.runs, close.runs, states.runs, end.runs], [4, 7, 7, 1]);
    assert!(states.bytes > 7 * 1000 && states.seconds > 0.0 && speed.bytes == 0);
    let max = speed.monitors.iter().find(|monitor| monitor.name == "speed.max").unwrap();
    assert_eq!((max.unit.as_deref(), max.last), (Some("m/s"), Some(2.06)));
    assert_eq!((max.min, max.max), (Some(2.0), Some(2.06)));
}

#[test]
fn a_parameter_that_the_solver_lacks_is_a_mistake_of_the_configuration() {
    for stages in [
        r#"[{"set": {"name": "valbe", "value": 1}}]"#,
        r#"[{"csv": {"file": "a.csv", "monitors": ["parameter.valbe"]}}]"#,
    ] {
        let text =
            format!(r#"{{"version": 1, "pipelines": [{{"name": "a", "stages": {stages}}}]}}"#);
        let settings =
            Settings { config: config(&text), parameters: valve(), ..Settings::default() };
        let Err(error) = Adaptor::initialize(settings) else { panic!("{text}") };
        let said = error.to_string();
        assert!(said.contains("no parameter `valbe`") && said.contains("`valve`?"), "{said}");
    }
}

#[test]
fn viewers_make_pipelines_due_and_are_told_what_they_cost() {
    let mut solver = Solver::with_config(
        r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [
        {"name": "always", "stages": [{"quality": {}}]},
        {"name": "hello", "on": "viewer", "stages": [{"statistics": {"field": "speed", "unit": "m/s"}}]}]}"#,
    );
    solver.steps(3);
    assert_eq!(solver.adaptor.history("hello").unwrap().count(), 0);
    let mut viewer = Viewer::connect(&solver.adaptor);
    let monitors = viewer.hello()["monitors"].clone();
    assert_eq!(monitors[4]["name"], "speed.min");
    assert_eq!((&monitors[4]["pipeline"], &monitors[4]["unit"]), (&"hello".into(), &"m/s".into()));
    let told = solver.step_until_told(&mut viewer, "monitor", |told| told["pipeline"] == "hello");
    assert!(told["values"]["speed.max"].as_f64().is_some() && told["time"].as_f64().is_some());
    let status = solver.step_until_told(&mut viewer, "status", |status| {
        status["pipelines"].as_array().is_some_and(|all| all.len() == 2 && all[1]["runs"] == 1)
    });
    let [always, hello] = [0, 1].map(|index| status["pipelines"][index].clone());
    assert_eq!((&always["name"], &hello["name"]), (&"always".into(), &"hello".into()));
    assert!(always["runs"].as_u64().unwrap() > 3 && hello["runs"] == 1, "{status}");
    assert!(always["memory"].as_u64().unwrap() > 0 && always["every"] == 1);
    solver.steps(3);
    assert_eq!(solver.adaptor.history("hello").unwrap().count(), 1, "once for each viewer");
    drop(viewer);
}

#[test]
fn the_clock_of_rank_0_counts_for_all_ranks() {
    let text = r#"{"version": 1, "pipelines": [
        {"name": "slow", "every": {"seconds": 0.05}, "stages": [{"quality": {}}]}]}"#;
    let mesh = box_of_tets([3, 2, 2], [0.0; 3], [1.0; 3]);
    let count = mesh.cells().len();
    let of_cells = in_order(count, 3);
    let cycles = threads::run(3, |ranks| {
        let part = Part::cut(&mesh, &of_cells, ranks.rank(), false).unwrap();
        let rank = ranks.rank();
        let ranks: Arc<dyn Communicator> = Arc::new(ranks);
        let settings = Settings { config: config(text), ..Settings::default() }.on(ranks);
        let mut adaptor = settings.start().unwrap();
        let begun = Instant::now();
        for cycle in 0..60 {
            // The ranks are not equally fast.
            std::thread::sleep(Duration::from_millis(2 + 3 * rank as u64));
            let step = Step { cycle, time: 0.1 * cycle as f64, time_step: 0.1 };
            let looks = adaptor.looks_at(&step);
            let before = adaptor.history("slow").unwrap().count();
            adaptor.execute(&step, &[Channel::new("fluid", part.view(), &[])]).unwrap();
            let ran = adaptor.history("slow").unwrap().count() > before;
            assert_eq!(looks, ran || cycle == 0, "it is known before the step");
        }
        let history = adaptor.history("slow").unwrap();
        let cycles: Vec<u64> = history.measured().map(|measured| measured.cycle).collect();
        let seconds = begun.elapsed().as_secs_f64();
        assert!(cycles.len() >= 3 && cycles.len() as f64 <= 2.0 + seconds / 0.05, "{cycles:?}");
        adaptor.finalize().unwrap();
        cycles
    });
    assert!(cycles[1] == cycles[0] && cycles[2] == cycles[0], "{cycles:?}");
}

#[test]
fn pictures_are_written_beside_the_solver() {
    let folder = tempfile::tempdir().unwrap();
    let text = r#"{"version": 1, "pipelines": [
        {"name": "front", "every": {"steps": 2}, "stages": [{"surface": {}},
            {"render": {"file": "pictures/front-{cycle}.png", "field": "speed", "width": 60, "height": 40}}]},
        {"name": "around", "every": {"steps": 3}, "stages": [{"slice": {"origin": [0, 0, 0.3], "normal": [0, 0, 1]}},
            {"render": {"file": "around.cdb", "width": 30, "height": 20, "orbit": {"azimuths": 3, "elevations": [20]}}}]}]}"#;
    let mut solver = Solver::new(Settings {
        config: config(text),
        output: folder.path().into(),
        ..Settings::default()
    });
    solver.steps(5);
    solver.finish();
    let size = |path: &str| {
        let bytes = std::fs::read(folder.path().join(path)).unwrap_or_else(|_| panic!("{path}"));
        assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n", "{path}");
        [16, 20].map(|at| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()))
    };
    for cycle in [0, 2, 4] {
        assert_eq!(size(&format!("pictures/front-{cycle:06}.png")), [60, 40]);
    }
    let table = read_to_string(folder.path().join("around.cdb/data.csv")).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0].last(), Some(&"FILE"));
    assert_eq!(
        rows.iter().map(|row| row[1]).collect::<Vec<_>>(),
        ["cycle", "0", "0", "0", "3", "3", "3"]
    );
    assert!(rows[1..].iter().all(|row| size(&format!("around.cdb/{}", row[5])) == [30, 20]));
}
