//! The viewer in a headless browser: the demo, the demonstrations of the paper, what can be seen and how,
//! before and after compared, shaping by hand, a first day, pipelines changed, a shape changed by two people
//! over an encrypted line, several people together, runs behind a relay and a proxy, the viewer in a page of
//! others, the end of a run, and a recording.

use std::path::Path;
use std::process::Command;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tombolo_tests::{
    PATIENCE, Proxy, Run, Small, driving, free_ports, gallery, generated_mesh, program, project,
};

/// The least seconds of a step of a small mesh, which would take its steps faster than a browser draws.
const PACE: &str = "0.02";

/// A browser that draws without a GPU, and a run, are as much as two cores can do: one at a time.
fn alone() -> MutexGuard<'static, ()> {
    static BROWSER: Mutex<()> = Mutex::new(());
    BROWSER.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs a script of `tests/browser` on a run, and panics with what both said where it fails.
fn drive(script: &str, run: &mut Run) {
    let url = run.link().url();
    drive_at(script, &url, run, &[]);
}

/// Runs a script of `tests/browser` on the run at an address, with these variables besides.
fn drive_at(script: &str, url: &str, run: &Run, variables: &[(&str, String)]) {
    let output = Command::new("node")
        .current_dir(project())
        .env("TOMBOLO_URL", url)
        .env("TOMBOLO_PID", run.process().to_string())
        .env("TOMBOLO_GALLERY", gallery(""))
        .envs(variables.iter().map(|(name, value)| (name, value)))
        .arg(Path::new("tests/browser").join(script))
        .output()
        .expect("node is installed (scripts/setup)");
    assert!(
        output.status.success(),
        "{}\n{}\nflow said:\n{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
        run.text()
    );
}

/// A case of the demos, running, its mesh made where it is not there.
fn running(case: &str, mesh: &str) -> Run {
    let _ = generated_mesh(mesh);
    let case = format!("examples/flow/cases/{case}.json");
    Run::flow(&["--case", &case, "--listen", "127.0.0.1:0", "--pace", "0.1"])
}

/// Runs a script on a case of the demos, which goes on behind it.
fn watch(script: &str, case: &str, mesh: &str) {
    let _alone = alone();
    let mut run = running(case, mesh);
    drive(script, &mut run);
    assert!(run.is_running(), "the run ended:\n{}", run.text());
}

#[test]
fn the_demo_in_a_browser() {
    watch("demo.mjs", "nozzle", "channel-60k");
}

#[test]
fn seeing_in_a_browser() {
    watch("seeing.mjs", "nozzle", "channel-60k");
}

#[test]
fn pipelines_changed_in_a_browser() {
    watch("pipelines.mjs", "nozzle", "channel-60k");
}

#[test]
fn several_people_in_a_browser() {
    watch("together.mjs", "nozzle", "channel-60k");
}

#[test]
fn before_and_after_in_a_browser() {
    watch("comparing.mjs", "nozzle", "channel-60k");
}

#[test]
fn shaping_by_hand_in_a_browser() {
    watch("handles.mjs", "nozzle", "channel-60k");
}

#[test]
fn a_first_day_in_a_browser() {
    watch("tasks.mjs", "bypass", "bypass-0");
}

/// The whole of a demonstration of the paper in a browser, on a mesh that such a browser draws with
/// ease. What the page shows in the end is what the report of the run says.
fn demonstrate(name: &str, mesh: &str) {
    let directory = tempfile::TempDir::new().expect("a temporary directory");
    let path = |file: &str| {
        directory
            .path()
            .join(file)
            .to_str()
            .expect("a temporary directory has a plain name")
            .to_owned()
    };
    let read = |path: &Path| -> Value {
        let text = std::fs::read_to_string(path).expect("a file");
        serde_json::from_str(&text).expect("JSON")
    };
    let example = |kind: &str| read(&project().join(format!("examples/flow/{kind}/{name}.json")));
    let mut case = example("cases");
    case["mesh"] = generated_mesh(mesh).to_str().expect("text").into();
    let pipelines = example("pipelines");
    for (file, content) in [("case.json", case), ("pipelines.json", pipelines)] {
        std::fs::write(path(file), content.to_string()).expect("written");
    }
    let files = [
        ("--case", "case.json"),
        ("--pipelines", "pipelines.json"),
        ("--report", "report.json"),
        ("--out", "out"),
    ];
    let mut arguments: Vec<String> =
        files.into_iter().flat_map(|(option, file)| [option.to_owned(), path(file)]).collect();
    // A core is left to the browser.
    arguments
        .extend(["--listen", "127.0.0.1:0", "--threads", "1", "--pace", PACE].map(str::to_owned));
    let mut run = Run::flow(&arguments);
    let url = run.link().url();
    let variables =
        [("TOMBOLO_DEMONSTRATION", name.to_owned()), ("TOMBOLO_SHOWN", path("shown.json"))];
    drive_at("paper.mjs", &url, &run, &variables);
    let (status, text) = run.finish(PATIENCE);
    assert!(status.success(), "{text}");
    let [shown, report] = ["shown.json", "report.json"].map(|file| read(Path::new(&path(file))));
    assert_page_agrees(&shown, &report);
}

/// The letters of the number at the beginning of a text of the page; what stands behind is passed over.
fn digits_of(text: &str) -> String {
    let is_of_number = |letter: &char| letter.is_ascii_digit() || "-.e".contains(*letter);
    text.replace('−', "-").chars().take_while(is_of_number).collect()
}

/// The number at the beginning of a text of the page.
fn number(text: &str) -> f64 {
    digits_of(text).parse().unwrap_or(f64::NAN)
}

/// Whether a page shows a number, rounded to so many digits, or one less beside a power of ten.
fn shows(text: &str, value: f64, digits: i32) -> bool {
    let unit = if value == 0.0 { 0.0 } else { 10f64.powf(value.abs().log10().floor() + 1.0) };
    let half = 0.5 * unit * 10f64.powi(i32::from(digits_of(text).contains('e')) - digits);
    (number(text) - value).abs() <= half * (1.0 + 1e-9)
}

/// Compares the numbers that a page shows of a run that has ended with those of its report.
fn assert_page_agrees(shown: &Value, report: &Value) {
    let assert_shown = |what: &str, text: &Value, value: &Value, digits: i32| {
        let agrees =
            shows(text.as_str().unwrap_or_default(), value.as_f64().unwrap_or(f64::NAN), digits);
        assert!(agrees, "{what}: the page shows {text}, the report says {value}");
    };
    let cycles = &report["cycles"];
    assert_eq!(shown["cycle"], cycles.to_string());
    let banner = shown["banner"].as_str().expect("text");
    assert!(
        banner.starts_with(&format!("The run ended at cycle {cycles}: stopped.")),
        "the page says \"{banner}\", the report {cycles} cycles"
    );
    assert_shown("the time", &shown["time"], &report["time"], 5);

    let last = |name: &str| -> Value {
        let pipelines = report["pipelines"].as_array().expect("pipelines");
        let monitors = pipelines.iter().flat_map(|pipeline| pipeline["monitors"].as_array());
        let monitor = monitors.flatten().find(|monitor| monitor["name"] == name);
        monitor.unwrap_or_else(|| panic!("the report has no {name}"))["last"].clone()
    };
    assert_shown("the least quality", &shown["quality"], &last("quality.min"), 3);
    for (place, label, name) in [
        ("monitors", "Quality, minimum", "quality.min"),
        ("monitors", "Quality, mean", "quality.mean"),
        ("monitors", "Velocity, maximum", "velocity.max"),
        ("monitors", "Inlet, mean", "inlet.mean"),
        ("monitors", "Outlet, flow rate", "outlet.flow_rate"),
        ("monitors", "Pressure drop", "pressure drop"),
        ("dock", "Quality, minimum", "quality.min"),
        ("dock", "Pressure drop [Pa]", "pressure drop"),
    ] {
        assert_shown(label, &shown[place][label], &last(name), 4);
    }
    // The mass balance is rounding alone: another number at each cycle, of which the plots show an earlier one.
    let balance = shown["dock"]["Mass balance, flow rate [m3/s]"].as_str().unwrap_or_default();
    let is_measured = last("mass balance.flow_rate").is_f64();
    assert!(is_measured && number(balance).is_finite(), "the page shows the balance \"{balance}\"");

    let [rows, orders] = [shown, report].map(|both| both["orders"].as_array().expect("orders"));
    assert!(rows.len() == orders.len() && orders.len() >= 2, "{shown}\n{report}");
    for (row, order) in rows.iter().zip(orders) {
        assert_eq!((&row["id"], &order["status"]), (&order["id"], &"applied".into()));
        let detail = row["detail"].as_str().expect("text");
        let part = |start: &str| -> Value {
            detail.split(" · ").find_map(|part| part.strip_prefix(start)).into()
        };
        assert_eq!(part("at cycle "), order["cycle_applied"].to_string(), "{detail}");
        let quality = &order["min_scaled_jacobian"];
        assert_shown("the quality of an order", &part("quality "), quality, 3);
        // The page had no forecast of an order that takes another one back.
        if let Some(forecast) = row["forecast"].as_str() {
            let foretold = forecast.strip_prefix("Forecast: least quality ").expect("a quality");
            let (end, now) = foretold.split_once(" (now ").expect("the quality of now");
            // The forecast tells the end of the way and the report the least on it, which are one
            // where the quality falls.
            if number(end) <= number(now) {
                assert_shown("the forecast", &end.into(), quality, 3);
            } else {
                let least = quality.as_f64().expect("a number");
                let (low, high) = (number(now) - 0.001, number(end) + 0.001);
                assert!((low..=high).contains(&least), "{foretold}: the report says {least}");
            }
        }
    }
    assert!(rows.iter().any(|row| row["forecast"].is_string()), "{shown}");
}

/// Each by another means: the nozzle by the keyboard, the bypass by the mouse, the pipe by touch.
#[test]
fn the_demonstrations_of_the_paper_in_a_browser() {
    let _alone = alone();
    for (name, mesh) in [("nozzle", "channel-5k"), ("bypass", "bypass-8k"), ("pipe", "pipe-4k")] {
        demonstrate(name, mesh);
    }
}

/// A small nozzle that is streamed by these settings, with these options besides.
fn small(stream: &Value, options: &[&str]) -> (Small, Run) {
    let small = Small::new();
    small.write(
        "pipelines.json",
        &json!({"version": 1, "stream": stream, "steering": {"wait_for_viewer": true}, "pipelines": [
            {"name": "surface", "every": {"steps": 10}, "stages": [{"surface": {}}, {"stream": {}}]},
            {"name": "shape", "on": "order", "stages": [{"deform": {}}, {"schedule": {"steps": 2}}]}
        ]}),
    );
    let mut arguments = vec!["--pipelines", "@pipelines.json", "--listen", "127.0.0.1:0"];
    // A core is left to the browser.
    arguments.extend(["--threads", "1", "--pace", PACE]);
    arguments.extend(options);
    let run = Run::flow(&small.arguments(&arguments));
    (small, run)
}

#[test]
fn two_people_change_a_shape_in_a_browser() {
    let _alone = alone();
    // Encrypted by the run, with a certificate that it makes.
    let (_small, mut run) = small(&json!({"tls": {}}), &[]);
    let url = run.line("its link", driving);
    drive_at("shape.mjs", &url, &run, &[]);
}

#[test]
fn the_end_of_a_run_in_a_browser() {
    let _alone = alone();
    let (_small, mut run) = small(&json!({}), &["--steps", "1500"]);
    drive("ended.mjs", &mut run);
}

#[test]
fn a_recording_in_a_browser() {
    let _alone = alone();
    let small = Small::new();
    small.write(
        "pipelines.json",
        &json!({"version": 1, "record": "run.tombolo", "pipelines": [
            {"name": "surface", "every": {"steps": 60}, "stages": [{"surface": {}}, {"stream": {}}]}
        ]}),
    );
    let pinch = json!({"edits": [{"scale_direction": {
        "features": ["throat"], "fixed": ["inlet", "outlet"], "factors": [1, 1, 0.8]}}]});
    small.write("orders.json", &json!([{"at": {"cycle": 3000}, "order": pinch}]));
    let options = ["--pipelines", "@pipelines.json", "--orders", "@orders.json", "--headless"];
    let run = Run::flow(&small.arguments(&[&options[..], &["--steps", "6000"]].concat()));
    let (status, text) = run.finish(PATIENCE);
    assert!(status.success(), "{text}");
    let mut played = Run::start(
        program("tombolo")
            .arg("play")
            .arg(small.path("out/run.tombolo"))
            .args(["--listen", "127.0.0.1:0"])
            // Where it writes its links.
            .env("TMPDIR", small.path("out")),
    );
    let url = played.line("its link", |line| {
        let (_, path) = line.split_once("the links to this recording are in ")?;
        let text = std::fs::read_to_string(path).ok()?;
        text.lines().find_map(|line| line.strip_prefix("watch: ")).map(str::to_owned)
    });
    drive_at("recording.mjs", &url, &played, &[]);
    played.signal("TERM");
    let (status, text) = played.finish(PATIENCE);
    assert!(status.success(), "{text}");
}

#[test]
fn the_viewer_in_a_page_of_others_in_a_browser() {
    let _alone = alone();
    let [named, other] = free_ports();
    let page = format!("http://localhost:{named}");
    let (_small, mut run) = small(&json!({"embed": [page]}), &[]);
    let url = run.link().url();
    drive_at("framing.mjs", &url, &run, &[("TOMBOLO_PAGES", format!("{named} {other}"))]);
}

/// The way of a site: the browser, a network that is cut for half a minute, a proxy with a certificate
/// before a path, a relay, and three runs, of which nobody reaches any by itself.
#[test]
fn runs_behind_a_relay_and_a_proxy_in_a_browser() {
    let _alone = alone();
    let [relay_port, proxy_port, public_port] = free_ports();
    let _proxy = Proxy::start(proxy_port, "/tombolo/", relay_port);
    let directory = tempfile::TempDir::new().expect("a temporary directory");
    let mut relay = Run::start(
        program("tombolo")
            .args(["relay", "--listen", &format!("127.0.0.1:{relay_port}"), "--directory"])
            .arg(directory.path())
            .args(["--public", &format!("https://localhost:{public_port}/tombolo")]),
    );
    let stream = relay.line("how runs connect", |line| {
        let (_, stream) = line.split_once("runs connect with \"stream\": ")?;
        serde_json::from_str::<Value>(stream).ok()
    });
    let mut runs = ["nozzle", "pump", "wing"].map(|name| {
        let small = Small::new();
        let mut stream = stream.clone();
        stream["name"] = name.into();
        small.write(
            "pipelines.json",
            &json!({"version": 1, "stream": stream, "steering": {"wait_for_viewer": true},
                    "pipelines": [
                {"name": "surface", "every": {"steps": 2}, "stages": [{"surface": {}}, {"stream": {}}]},
                {"name": "shape", "on": "order", "stages": [{"deform": {}}, {"schedule": {"steps": 2}}]}
            ]}),
        );
        let arguments =
            ["--pipelines", "@pipelines.json", "--steps", "1000000", "--pace", PACE];
        let run = Run::flow(&small.arguments(&arguments));
        (small, run)
    });
    // Once the relay is reached, the file says how the run is reached through the proxy.
    let public = format!("https://localhost:{public_port}/");
    let links = runs.each_mut().map(|(_, run)| {
        let line = run.line("its link", |line| driving(line).map(|_| line.to_owned()));
        let until = Instant::now() + PATIENCE;
        loop {
            if let Some(link) = driving(&line).filter(|link| link.starts_with(&public)) {
                break link;
            }
            assert!(Instant::now() < until, "the relay is not reached:\n{}", run.text());
            std::thread::sleep(Duration::from_millis(50));
        }
    });
    let page = std::fs::read_to_string(directory.path().join("relay.link")).expect("its link");
    let page = page.trim().strip_prefix("page: ").expect("a link").to_owned();
    let variables = [
        ("TOMBOLO_PAGE", page),
        ("TOMBOLO_OTHER", links[1].clone()),
        ("TOMBOLO_NETWORK", format!("{public_port} {proxy_port}")),
    ];
    drive_at("relay.mjs", &links[0], &runs[0].1, &variables);
    for (_, run) in &mut runs[1..] {
        assert!(run.is_running(), "the run ended:\n{}", run.text());
    }
}
