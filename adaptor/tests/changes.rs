//! Pipelines that are added, replaced and removed while a run goes on: by viewers, by files, by the
//! program itself.

mod common;

use std::{
    fs::{read_to_string, write},
    io::{Read as _, Write as _},
    net::TcpStream,
    sync::Arc,
    time::Duration,
};

use common::{PATIENCE, Solver, Viewer, config, socket_url, squeeze, statuses};
use serde_json::{Value, json};
use tombolo::{
    Adaptor, Channel, FieldView, Settings, Step,
    deform::{
        communicator::{Communicator, threads},
        distributed::{Part, in_order},
        shapes::box_of_tets,
    },
    pipelines::{
        encode::DecodedFrame,
        language::{parse_json, parse_orders},
    },
};

const WATCHED_OVER: &str = r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [
    {"name": "boundary", "stages": [{"surface": {}}, {"stream": {}}]},
    {"name": "health", "stages": [{"quality": {}}]}]}"#;

fn slice(x: f64) -> Value {
    json!({"name": "cut", "stages": [
        {"slice": {"origin": [x, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}}, {"stream": {}}]})
}

fn names(list: &Value) -> Vec<&str> {
    let list = list.as_array().expect("a list");
    list.iter().map(|named| named["name"].as_str().expect("a name")).collect()
}

/// Steps until a change has been made.
fn applied(solver: &mut Solver, viewer: &mut Viewer, id: &str) -> Value {
    solver.step_until_told(viewer, "pipelines", |told| {
        told["id"] == id && told["status"] == "applied"
    })
}

/// Steps until a message is answered with an error, which is told.
fn refused(solver: &mut Solver, viewer: &mut Viewer, id: &str) -> String {
    let error = solver.step_until_told(viewer, "error", |error| error["id"] == id);
    error["message"].as_str().expect("a message").to_owned()
}

/// Where the points of the newest frame of a view lie along x; steps until there is one that fits.
fn step_until_seen(
    solver: &mut Solver,
    viewer: &mut Viewer,
    view: &str,
    fits: impl Fn(f64) -> bool,
) {
    let begun = std::time::Instant::now();
    loop {
        let seen = viewer
            .decoded()
            .iter()
            .any(|frame| frame.view == view && frame.points.iter().all(|point| fits(point[0])));
        if seen {
            return;
        }
        assert!(begun.elapsed() < PATIENCE, "no such frame of {view}");
        solver.step();
        let _ = viewer.look_for("nothing", Duration::from_millis(2), |_| false);
    }
}

#[test]
fn a_viewer_adds_replaces_and_removes_a_view() {
    let mut solver = Solver::with_config(WATCHED_OVER);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    let hello = viewer.hello();
    assert_eq!(
        (names(&hello["views"]), &hello["pipelines"]),
        (vec!["boundary"], &json!({"changes": 0}))
    );

    viewer.send(&json!({"id": "add", "pipelines": {"set": [slice(0.3)]}}));
    let accepted = viewer.wait_for("pipelines", |told| told["id"] == "add");
    assert_eq!(accepted["status"], "accepted");
    let told = applied(&mut solver, &mut viewer, "add");
    assert_eq!(
        (&told["added"], &told["replaced"], &told["removed"]),
        (&json!(["cut"]), &json!([]), &json!([]))
    );
    assert!(told["cycle"].as_u64() < Some(solver.cycle));
    let hello = viewer.wait_for("hello", |hello| hello["pipelines"]["changes"] == 1);
    assert_eq!(names(&hello["views"]), ["boundary", "cut"]);
    step_until_seen(&mut solver, &mut viewer, "cut", |x| (x - 0.3).abs() < 1e-3);

    viewer.send(&json!({"id": "move", "pipelines": {"set": [slice(0.6)]}}));
    let told = applied(&mut solver, &mut viewer, "move");
    assert_eq!((&told["added"], &told["replaced"]), (&json!([]), &json!(["cut"])));
    step_until_seen(&mut solver, &mut viewer, "cut", |x| (x - 0.6).abs() < 1e-3);

    let before = solver.adaptor.history("health").expect("measured").count();
    viewer.send(&json!({"id": "other", "pipelines": {"set": [
        {"name": "speed", "stages": [{"statistics": {"field": "speed", "unit": "m/s"}}]}]}}));
    applied(&mut solver, &mut viewer, "other");
    let hello = viewer.wait_for("hello", |hello| hello["pipelines"]["changes"] == 3);
    assert_eq!(
        hello["monitors"][4],
        json!({"pipeline": "speed", "name": "speed.min", "unit": "m/s"})
    );
    let told = solver.step_until_told(&mut viewer, "monitor", |told| told["pipeline"] == "speed");
    assert!(told["values"]["speed.max"].as_f64() > Some(1.9));
    let health = solver.adaptor.history("health").expect("measured");
    assert!(health.count() > before && health.count() == solver.cycle, "it went on");

    viewer.send(&json!({"id": "less", "pipelines": {"remove": ["cut", "health"]}}));
    let told = applied(&mut solver, &mut viewer, "less");
    assert_eq!(told["removed"], json!(["health", "cut"]));
    let hello = viewer.wait_for("hello", |hello| hello["pipelines"]["changes"] == 4);
    assert_eq!(names(&hello["views"]), ["boundary"]);
    assert_eq!(hello["monitors"].as_array().map(Vec::len), Some(5));
    assert!(solver.adaptor.history("health").is_none());
    // Who comes now sees nothing of what is gone, and the boundary as ever.
    let mut late = Viewer::connect(&solver.adaptor);
    late.hello();
    step_until_seen(&mut solver, &mut late, "boundary", |_| true);
    solver.steps(20);
    let _ = late.look_for("nothing", Duration::from_millis(50), |_| false);
    assert!(!late.decoded().iter().any(|frame| frame.view == "cut"));
    let status = solver.step_until_told(&mut late, "status", |status| {
        status["pipelines"].as_array().is_some_and(|all| all.len() == 2)
    });
    assert_eq!(names(&status["pipelines"]), ["boundary", "speed"]);
    assert_eq!(solver.finish().pipelines.len(), 2);
}

#[test]
fn the_pipelines_and_their_schema_can_be_asked_for() {
    let mut solver = Solver::with_config(WATCHED_OVER);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.send(&json!({"id": "add", "pipelines": {"set": [slice(0.3)]}}));
    applied(&mut solver, &mut viewer, "add");
    let token = socket_url(&solver.adaptor).split_once("token=").expect("a token").1.to_owned();
    let address = solver.adaptor.address().expect("a server");
    let get = |path: &str| {
        let mut stream = TcpStream::connect(address).expect("connected");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a timeout");
        let asked = format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
        stream.write_all(asked.as_bytes()).expect("sent");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("an answer");
        let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
        (head[9..12].to_owned(), serde_json::from_str::<Value>(body).unwrap_or_default())
    };
    for path in ["/pipelines", "/schema"] {
        assert_eq!(get(path).0, "401");
        assert_eq!(get(&format!("{path}?token=wrong")).0, "401");
    }
    let (status, pipelines) = get(&format!("/pipelines?token={token}"));
    assert_eq!((&*status, names(&pipelines)), ("200", vec!["boundary", "health", "cut"]));
    // What is asked for can be sent back.
    viewer.send(&json!({"id": "same", "pipelines": {"all": pipelines}}));
    let told = applied(&mut solver, &mut viewer, "same");
    assert_eq!(
        (&told["added"], &told["replaced"], &told["removed"]),
        (&json!([]), &json!([]), &json!([]))
    );
    let (status, schema) = get(&format!("/schema?token={token}"));
    assert!(status == "200" && schema["properties"]["stages"].is_object(), "{schema}");
    assert!(schema["$defs"]["Stage"].is_object());
}

#[test]
fn what_cannot_take_over_is_refused_and_those_before_go_on() {
    let text = WATCHED_OVER.replace(
        r#"{"name": "health""#,
        r#"{"name": "watch", "stages": [], "when": "quality.min < 0", "then": [{"stop": {}}]}, {"name": "health""#,
    );
    let mut solver = Solver::with_config(&text);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let stages = |stages: Value| json!({"set": [{"name": "new", "stages": stages}]});
    let at_once = [
        // At the token: the line and column of the message itself.
        (json!({"set": [{"name": "new", "stages": [{"slcie": {}}]}]}), "did you mean `slice`?"),
        (
            json!({"remove": ["health"]}),
            "pipelines.remove: pipeline `watch` could not go on: when: column 1",
        ),
        (
            json!({"remove": ["helth"]}),
            "pipelines.remove[0]: found `helth`, which no pipeline is named; did you mean `health`?",
        ),
        (
            stages(json!([{"set": {"name": "inflow", "value": 1.0}}])),
            "pipelines.set[0].stages[0].set.name: the solver has no parameter `inflow`",
        ),
        (stages(json!([{"write": {"file": "/tmp/a.vtu"}}])), "below the run's output directory"),
        (
            stages(json!([{"csv": {"file": "../a.csv", "monitors": ["quality.min"]}}])),
            "below the run's output directory",
        ),
        (
            stages(json!([{"displacement": {"file": "a.vtp"}}, {"order": {}}])),
            "names no files of this machine",
        ),
        (json!({"remove": []}), "expected at least one pipeline"),
        (
            json!({"set": [{"name": "shape", "on": "order", "channel": "fluid", "stages": []}]}),
            "the channel whose mesh orders change",
        ),
    ];
    for (index, (change, expected)) in at_once.into_iter().enumerate() {
        let id = format!("a{index}");
        viewer.send(&json!({"id": id, "pipelines": change}));
        // The solver takes no step meanwhile.
        let error = viewer.wait_for("error", |error| error["id"] == *id);
        let said = error["message"].as_str().expect("a message");
        assert!(said.starts_with("message:1:") && said.contains(expected), "{said}");
    }
    let on_the_mesh = [
        (
            json!([{"statistics": {"field": "sped"}}]),
            "pipeline `new` cannot run on this mesh: statistics: ",
        ),
        (
            json!([{"surface": {}}, {"select": {"fields": ["pressure"]}}, {"stream": {}}]),
            "select: ",
        ),
        (json!([{"contour": {"field": "sped", "values": [1.0]}}, {"stream": {}}]), "contour: "),
        (json!([{"surface": {}}, {"integrate": {"name": "lid", "features": ["top"]}}]), "`top`"),
        (
            json!([{"gradient": {"field": "speed"}}, {"surface": {}}, {"render": {"file": "a.png", "field": "sped"}}]),
            "render: ",
        ),
    ];
    for (index, (stages, expected)) in on_the_mesh.into_iter().enumerate() {
        let id = format!("m{index}");
        viewer.send(&json!({"id": id, "pipelines": {"set": [
            {"name": "good", "stages": [{"statistics": {"field": "speed"}}]}, {"name": "new", "stages": stages}]}}));
        let said = refused(&mut solver, &mut viewer, &id);
        assert!(said.contains(expected), "{said}");
    }
    viewer.send(&json!({"id": "elsewhere", "pipelines": {"set": [{"name": "new", "channel": "solid", "stages": [{"statistics": {"field": "speed"}}]}]}}));
    let said = refused(&mut solver, &mut viewer, "elsewhere");
    assert!(said.contains("`new` cannot run") && said.contains("solid"), "{said}");

    let mut watcher = Viewer::connect(&solver.adaptor);
    let hello = watcher.hello();
    assert_eq!((&hello["role"], &hello["pipelines"]["changes"]), (&json!("watcher"), &json!(0)));
    assert_eq!(names(&hello["views"]), ["boundary"]);
    watcher.send(&json!({"id": "w", "pipelines": {"remove": ["boundary"]}}));
    let said = refused(&mut solver, &mut watcher, "w");
    assert!(said.contains("this viewer watches"), "{said}");
    let history = solver.adaptor.history("health").expect("it goes on").count();
    assert_eq!(history, solver.cycle);
    assert!(solver.adaptor.history("good").is_none(), "all of a change or none of it");
    assert!(solver.finish().pipelines.iter().all(|pipeline| pipeline.name != "new"));
}

#[test]
fn a_slice_can_be_moved_while_the_solver_waits() {
    let mut solver = Solver::with_config(WATCHED_OVER);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    viewer.send(&json!({"pause": {}}));
    let sender = std::thread::spawn(move || {
        viewer.wait_for("status", |status| status["paused"] == true);
        viewer.send(&json!({"id": "cut", "pipelines": {"set": [slice(0.3)]}}));
        let told = viewer.wait_for("pipelines", |told| told["status"] == "applied");
        let begun = std::time::Instant::now();
        let is_shown = |frame: &DecodedFrame| frame.view == "cut" && frame.cycle == told["cycle"];
        while !viewer.decoded().iter().any(is_shown) {
            assert!(begun.elapsed() < PATIENCE, "the slice was not shown");
            let _ = viewer.look_for("nothing", Duration::from_millis(5), |_| false);
        }
        viewer.send(&json!({"resume": {}}));
        viewer.send(&json!({"stop": {}}));
        viewer
    });
    solver.step_until("the end", |solver| solver.stopped);
    drop(sender.join().expect("it saw the slice"));
}

#[test]
fn the_settings_of_orders_can_be_replaced() {
    let shape = |steps: u32| json!({"name": "shape", "on": "order", "stages": [{"schedule": {"steps": steps}}]});
    let text = json!({"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [shape(2)]});
    let mut solver = Solver::with_config(&text.to_string());
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    viewer.send(&json!({"id": "longer", "pipelines": {"set": [shape(5)]}}));
    applied(&mut solver, &mut viewer, "longer");
    let hello = viewer.wait_for("hello", |hello| hello["pipelines"]["changes"] == 1);
    assert_eq!(hello["defaults"]["schedule"]["steps"], 5);
    viewer.send(&json!({"id": "f", "forecast": squeeze(0.2)}));
    let told = viewer.wait_for("forecast", |forecast| forecast["id"] == "f");
    assert_eq!(told["order"]["shapes"], 5);
    viewer.send(&json!({"id": "press", "order": squeeze(0.2)}));
    let done = solver.step_until_told(&mut viewer, "order", |order| order["status"] == "applied");
    assert_eq!(done["shapes"], 5);
    let lift = |feature: &str| {
        json!({"set": [{"name": "lift", "at": {"cycle": 0}, "stages": [
            {"translate": {"features": [feature], "fixed": ["z-min"], "by": [0.0, 0.0, 0.1]}}, {"order": {}}]}]})
    };
    viewer.send(&json!({"id": "wrong", "pipelines": lift("z_max")}));
    let said = refused(&mut solver, &mut viewer, "wrong");
    assert!(
        said.starts_with("pipeline `lift`: there is no feature 'z_max'; did you mean 'z-max'"),
        "{said}"
    );
    // One that gives an order at its time, brought while the run goes on.
    viewer.send(&json!({"id": "later", "pipelines": lift("z-max")}));
    applied(&mut solver, &mut viewer, "later");
    solver.step_until("a second order", |solver| {
        let orders = solver.adaptor.orders();
        orders.len() == 2 && orders[1].status == tombolo::OrderStatus::Applied
    });
}

fn journalled(config: &str, orders: &str, folder: &std::path::Path) -> Settings {
    let mut config: Value = serde_json::from_str(config).expect("JSON");
    config["journal"] = json!(folder.join("journal.jsonl"));
    Settings {
        config: common::config(&config.to_string()),
        orders: parse_orders(orders, "orders.json").expect("orders"),
        output: folder.into(),
        ..Settings::default()
    }
}

/// The cycles at which a pipeline has measured.
fn measured(solver: &Solver, pipeline: &str) -> Vec<u64> {
    let history = solver.adaptor.history(pipeline).expect("a pipeline");
    history.measured().map(|measured| measured.cycle).collect()
}

#[test]
fn a_journal_makes_the_same_changes_at_the_same_cycles() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut solver = Solver::new(journalled(WATCHED_OVER, "[]", folder.path()));
    solver.steps(3);
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let speed = json!({"name": "speed", "every": {"steps": 2}, "stages": [{"statistics": {"field": "speed"}},
        {"csv": {"file": "speed.csv"}}]});
    viewer.send(&json!({"id": "add", "pipelines": {"set": [speed]}}));
    applied(&mut solver, &mut viewer, "add");
    viewer.send(&json!({"id": "wrong", "pipelines": {"set": [{"name": "b", "stages": [{"statistics": {"field": "b"}}]}]}}));
    refused(&mut solver, &mut viewer, "wrong");
    solver.steps(5);
    viewer.send(&json!({"id": "less", "pipelines": {"remove": ["health"]}}));
    applied(&mut solver, &mut viewer, "less");
    solver.steps(4);
    let cycles = measured(&solver, "speed");
    assert!(cycles.len() >= 4, "{cycles:?}");
    let steps = solver.cycle;
    solver.finish();
    let table = read_to_string(folder.path().join("speed.csv")).expect("a table");
    let journal = read_to_string(folder.path().join("journal.jsonl")).expect("a journal");
    let lines = statuses(&journal);
    let told: Vec<[&str; 2]> = lines
        .iter()
        .map(|line| ["id", "status"].map(|key| line[key].as_str().unwrap_or("")))
        .collect();
    assert_eq!(
        told,
        [
            ["add", "accepted"],
            ["add", "applied"],
            ["wrong", "accepted"],
            ["wrong", "rejected"],
            ["less", "accepted"],
            ["less", "applied"]
        ]
    );
    assert_eq!(lines[0]["pipelines"]["set"][0]["name"], "speed");

    let again = tempfile::tempdir().expect("a folder");
    let mut replay = Solver::new(journalled(WATCHED_OVER, &journal, again.path()));
    replay.steps(steps);
    assert_eq!(measured(&replay, "speed"), cycles);
    assert!(replay.adaptor.history("health").is_none());
    replay.finish();
    assert_eq!(read_to_string(again.path().join("speed.csv")).expect("a table"), table);
    let second = read_to_string(again.path().join("journal.jsonl")).expect("a journal");
    let of = |journal: &str| -> Vec<Value> {
        statuses(journal).into_iter().filter(|line| line["status"] == "applied").collect()
    };
    assert_eq!(of(&second), of(&journal));
}

#[test]
fn a_file_of_orders_changes_pipelines_and_a_table_keeps_its_columns() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = |field: &str, file: &str| {
        json!({"name": "table", "stages": [{"statistics": {"field": field, "name": field}},
            {"csv": {"file": file, "monitors": [format!("{field}.max")]}}]})
    };
    let orders = json!([
        {"at": {"cycle": 2}, "id": "a", "pipelines": {"set": [table("speed", "a.csv")]}},
        {"at": {"cycle": 4}, "id": "b", "pipelines": {"remove": ["table"]}},
        // The rows that this run has written stay.
        {"at": {"cycle": 6}, "id": "c", "pipelines": {"set": [table("speed", "a.csv")]}},
        {"at": {"cycle": 7}, "id": "d", "pipelines": {"set": [
            {"name": "table", "stages": [{"quality": {}}, {"csv": {"file": "a.csv"}}]}]}}]);
    let text = r#"{"version": 1}"#;
    let mut solver = Solver::new(journalled(text, &orders.to_string(), folder.path()));
    solver.steps(9);
    solver.finish();
    let rows = read_to_string(folder.path().join("a.csv")).expect("a table");
    let cycles: Vec<&str> =
        rows.lines().skip(1).map(|row| row.split_once(',').expect("columns").0).collect();
    assert_eq!(cycles, ["3", "4", "7", "8"]);
    let journal = read_to_string(folder.path().join("journal.jsonl")).expect("a journal");
    let last = statuses(&journal).pop().expect("lines");
    assert_eq!((&last["id"], &last["status"]), (&json!("d"), &json!("rejected")));
    let reason = last["reason"].as_str().expect("a reason");
    assert!(reason.starts_with("the table `a.csv` of this run has other columns"), "{reason}");
}

#[test]
fn files_of_a_replaced_pipeline_are_kept_as_it_says() {
    let folder = tempfile::tempdir().expect("a folder");
    let states =
        |write: Value| json!({"name": "states", "stages": [{"surface": {}}, {"write": write}]});
    let set = |cycle: u64, write: Value| json!({"at": {"cycle": cycle}, "pipelines": {"set": [states(write)]}});
    let orders = json!([
        set(2, json!({"file": "kept-{cycle}.vtp", "keep": 2})),
        set(6, json!({"file": "later-{cycle}.vtp"}))
    ]);
    let text = json!({"version": 1, "pipelines": [states(json!({"file": "early-{cycle}.vtp"}))]});
    let mut solver = Solver::new(journalled(&text.to_string(), &orders.to_string(), folder.path()));
    solver.steps(9);
    solver.finish();
    let mut there: Vec<String> = std::fs::read_dir(folder.path())
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .filter(|name| name.ends_with(".vtp"))
        .collect();
    there.sort();
    // Those before and after stay, whatever is kept in between.
    let of = |name: &str, cycles: &[u32]| -> Vec<String> {
        cycles.iter().map(|cycle| format!("{name}-{cycle:06}.vtp")).collect()
    };
    let expected = [of("early", &[0, 1, 2]), of("kept", &[5, 6]), of("later", &[7, 8])].concat();
    assert_eq!(there, expected);
    let series = read_to_string(folder.path().join("states.pvd")).expect("a series");
    let shown: Vec<&String> = there.iter().filter(|name| series.contains(*name)).collect();
    assert_eq!(shown, expected[3..].iter().collect::<Vec<_>>());
}

#[test]
fn the_program_changes_pipelines_itself() {
    let mut solver = Solver::with_config(r#"{"version": 1}"#);
    let change = |text: &str| parse_json(text, "change").expect("a change");
    let set =
        r#"{"set": [{"name": "health", "every": {"steps": 2}, "stages": [{"quality": {}}]}]}"#;
    solver.steps(3);
    solver.adaptor.change_pipelines(change(set)).expect("taken");
    solver.steps(4);
    assert_eq!(measured(&solver, "health"), [4, 6]);
    let error = solver.adaptor.change_pipelines(change(r#"{"remove": ["helth"]}"#)).unwrap_err();
    assert!(error.to_string().contains("did you mean `health`?"), "{error}");
    // Nobody could give an order when the run began, so that there is nothing to measure shapes from.
    let order = r#"{"set": [{"name": "lift", "stages": [{"translate": {"features": ["z-max"],
        "fixed": ["z-min"], "by": [0, 0, 1]}}, {"order": {}}]}]}"#;
    solver.adaptor.change_pipelines(change(order)).expect("taken");
    solver.steps(1);
    assert_eq!(solver.finish().pipelines.len(), 1);
}

/// A solver that copies its fields only where they are looked at.
#[test]
fn a_change_waits_for_a_solver_that_was_spared_its_fields() {
    let mut adaptor = Settings::default().start().expect("a run");
    let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let speed = vec![1.0; mesh.points().len()];
    let change = r#"{"set": [{"name": "speed", "stages": [{"statistics": {"field": "speed"}}]}]}"#;
    for cycle in 0..4 {
        let step = Step { cycle, time: 0.0, time_step: 0.0 };
        let looks = adaptor.looks_at(&step);
        assert_eq!(looks, [true, false, true, true][cycle as usize], "cycle {cycle}");
        if cycle == 1 {
            // Behind its back.
            adaptor
                .change_pipelines(parse_json(change, "change").expect("a change"))
                .expect("taken");
        }
        let fields = [FieldView::vertex("speed", &speed)];
        let lent = if looks { &fields[..] } else { &[] };
        adaptor.execute(&step, &[Channel::new("fluid", (&mesh).into(), lent)]).expect("execute");
    }
    let history = adaptor.history("speed").expect("added");
    assert_eq!(history.measured().map(|it| it.cycle).collect::<Vec<_>>(), [3]);
}

#[test]
fn the_file_of_the_configuration_is_looked_at_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("pipelines.json");
    let text = |pipelines: &Value, journal: &str| {
        json!({"version": 1, "watch": true, "stream": {"listen": "127.0.0.1:0"}, "journal": journal,
               "pipelines": pipelines})
        .to_string()
    };
    let health = json!({"name": "health", "stages": [{"quality": {}}]});
    write(&file, text(&json!([health]), "a.jsonl")).expect("written");
    let mut settings = Adaptor::from_file(&file).expect("a configuration");
    settings.output = folder.path().into();
    // Changed while the solver still reads its mesh.
    let early = json!({"name": "early", "stages": [{"quality": {}}]});
    write(&file, text(&json!([health, early]), "a.jsonl")).expect("written");
    let mut solver = Solver::new(settings);
    solver.step();
    let mut viewer = Viewer::connect(&solver.adaptor);
    viewer.hello();
    let told = solver.step_until_told(&mut viewer, "pipelines", |told| {
        told["status"] == "applied" && told["added"] == json!(["early"])
    });
    assert_eq!(told["removed"], json!([]));
    write(&file, text(&json!([health]), "a.jsonl")).expect("written");
    solver.step_until_told(&mut viewer, "pipelines", |told| {
        told["status"] == "applied" && told["removed"] == json!(["early"])
    });
    viewer.send(&json!({"id": "own", "pipelines": {"set": [slice(0.5)]}}));
    applied(&mut solver, &mut viewer, "own");

    // Half written; a person sees it once, whatever time goes by.
    let whole = text(
        &json!([health, {"name": "speed", "stages": [{"statistics": {"field": "speed"}}]}]),
        "a.jsonl",
    );
    write(&file, &whole[..whole.len() - 40]).expect("written");
    let told = solver.step_until_told(&mut viewer, "error", |_| true);
    let said = told["message"].as_str().expect("a message");
    assert!(said.contains("pipelines.json:1:") && said.contains("go on as they were"), "{said}");

    write(&file, &whole).expect("written");
    let told = solver.step_until_told(&mut viewer, "pipelines", |told| {
        told["status"] == "applied" && told["added"] == json!(["speed"])
    });
    assert_eq!((&told["replaced"], &told["removed"]), (&json!([]), &json!([])), "the slice stays");
    assert_eq!(solver.adaptor.history("health").map(|history| history.count()), Some(solver.cycle));
    assert!(viewer.look_for("error", Duration::from_millis(10), |_| true).is_none(), "told once");

    // What the mesh does not have is refused, and comes with the next change once it is mended.
    let wrong = json!([{"name": "speed", "stages": [{"statistics": {"field": "sped"}}]}]);
    write(&file, text(&wrong, "b.jsonl")).expect("written");
    let told = solver.step_until_told(&mut viewer, "error", |told| {
        told["message"].as_str().is_some_and(|said| said.contains("needs a restart"))
    });
    assert!(
        told["message"].as_str().is_some_and(|said| said.contains("`journal` needs")),
        "{told}"
    );
    let told = solver.step_until_told(&mut viewer, "error", |_| true);
    assert!(told["message"].as_str().is_some_and(|said| said.contains("`sped`")), "{told}");
    assert!(solver.adaptor.history("health").is_some());
    let right =
        json!([{"name": "speed", "stages": [{"statistics": {"field": "speed", "unit": "m/s"}}]}]);
    write(&file, text(&right, "b.jsonl")).expect("written");
    let told = solver.step_until_told(&mut viewer, "pipelines", |told| {
        told["status"] == "applied" && told["replaced"] == json!(["speed"])
    });
    assert_eq!(told["removed"], json!(["health"]));
    viewer.wait_for("hello", |hello| hello["monitors"][0]["unit"] == "m/s");
    let begun = std::time::Instant::now();
    solver.finish();
    assert!(begun.elapsed() < Duration::from_secs(20), "the thread ends");
    let journal = read_to_string(folder.path().join("a.jsonl")).expect("a journal");
    let lines = statuses(&journal);
    let from_file = lines.iter().filter(|line| line["by"] == "configuration");
    assert_eq!(from_file.count(), 5, "{journal}");
}

#[test]
fn a_configuration_without_a_file_cannot_be_watched() {
    let settings =
        Settings { config: config(r#"{"version": 1, "watch": true}"#), ..Settings::default() };
    let error = settings.start().err().expect("refused").to_string();
    assert_eq!(
        error,
        "the configuration: watch: the configuration did not come from a file that could be watched"
    );
}

#[test]
fn ranks_change_their_pipelines_at_the_same_cycle() {
    let mesh = box_of_tets([4, 3, 3], [0.0; 3], [1.0; 3]);
    let (mut last, set) = (
        None,
        |field: &str| json!({"set": [{"name": "speed", "stages": [{"statistics": {"field": field}}]}, slice(0.4)]}),
    );
    for size in [1, 2, 3] {
        let outcomes = threads::run(size, |ranks| {
            let rank = ranks.rank();
            let of_cells = in_order(mesh.cells().len(), size);
            let part = Part::cut(&mesh, &of_cells, rank, true).expect("a part");
            let ranks: Arc<dyn Communicator> = Arc::new(ranks);
            let mut adaptor = Settings { config: config(WATCHED_OVER), ..Settings::default() }
                .on(ranks)
                .start()
                .expect("a run");
            let speed: Vec<f64> = part.points.iter().map(|[x, y, z]| x + y * z).collect();
            let fields = [FieldView::vertex("speed", &speed)];
            let mut viewer = (rank == 0).then(|| Viewer::connect(&adaptor));
            let (mut stopped, mut wrong, mut less) = (None, false, false);
            for cycle in 0..100_000 {
                if let Some(viewer) = &mut viewer {
                    match cycle {
                        5 => viewer.send(&json!({"id": "add", "pipelines": set("speed")})),
                        10 => viewer.send(&json!({"id": "wrong", "pipelines": set("sped")})),
                        15 => {
                            viewer.send(&json!({"id": "less", "pipelines": {"remove": ["health"]}}))
                        }
                        _ => {}
                    }
                    // Only steps bring the answers.
                    if cycle > 15 && !(wrong && less) {
                        let short = Duration::from_millis(5);
                        let mut told = |key, id| {
                            viewer.look_for(key, short, |told| told["id"] == id).is_some()
                        };
                        wrong = wrong || told("error", "wrong");
                        less = less || told("pipelines", "less");
                        if wrong && less {
                            viewer.send(&json!({"id": "end", "stop": {}}));
                        }
                    }
                    std::thread::sleep(Duration::from_millis(5));
                }
                let step = Step { cycle, time: 0.01 * cycle as f64, time_step: 0.01 };
                let channels = [Channel::new("fluid", part.view(), &fields)];
                if adaptor.execute(&step, &channels).expect("execute").stop {
                    stopped = Some(cycle);
                    break;
                }
            }
            let speed = adaptor.history("speed").expect("added");
            let cycles: Vec<u64> = speed.measured().map(|measured| measured.cycle).collect();
            let values = speed.last().expect("measured").values.clone();
            let is_gone = adaptor.history("health").is_none();
            drop(viewer);
            adaptor.finalize().expect("finalize");
            (stopped, is_gone, cycles, values)
        });
        assert!(outcomes.iter().all(|outcome| *outcome == outcomes[0]), "{outcomes:?}");
        let (stopped, is_gone, cycles, values) = outcomes[0].clone();
        assert!(is_gone, "{size}: {cycles:?}");
        // Once added it is measured at each step, to the one that ended the run.
        let last_cycle = stopped.expect("stopped");
        assert!(cycles[0] > 5, "{size}: {cycles:?}");
        assert_eq!(cycles, (cycles[0]..=last_cycle).collect::<Vec<_>>(), "{size}");
        let close =
            |before: &Vec<f64>| before.iter().zip(&values).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(last.replace(values.clone()).is_none_or(|before| close(&before)));
    }
}
