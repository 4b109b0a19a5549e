//! The examples in C, C++ and Fortran, built by CMake and by pkg-config against an installed
//! prefix, on one rank of MPI and on three: they obey orders alike, stream to a viewer, and no rank
//! waits for one that goes wrong.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use serde_json::{Value, json};
use tombolo_tests::{PATIENCE, Run, Viewer, install, project, succeed};

const PROGRAMS: [&str; 5] = [
    "heat_catalyst",
    "heat_catalyst_cxx",
    "heat_catalyst_fortran",
    "heat_tombolo",
    "heat_tombolo_fortran",
];

/// A prefix with everything in it, and the examples built by CMake against it.
struct Built {
    prefix: PathBuf,
    build: PathBuf,
}

impl Built {
    fn get() -> &'static Self {
        static BUILT: OnceLock<Built> = OnceLock::new();
        BUILT.get_or_init(|| {
            let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("examples");
            let (prefix, build) = (directory.join("prefix"), directory.join("build"));
            succeed(&mut install(&prefix));
            // CMake refuses what another clone left.
            drop(std::fs::remove_dir_all(&build));
            let mut configure = Command::new("cmake");
            configure.arg("-S").arg(project().join("examples/heat")).arg("-B").arg(&build);
            succeed(configure.arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display())));
            succeed(Command::new("cmake").arg("--build").arg(&build));
            Built { prefix, build }
        })
    }

    /// A program on so many ranks, in an environment that says nothing but that Tombolo is meant.
    fn program(&self, name: &str, ranks: usize) -> Command {
        let program = self.build.join(name);
        let mut command =
            if ranks == 1 { Command::new(&program) } else { on_ranks(ranks, &program) };
        for variable in ["PIPELINES", "ORDERS", "OUTPUT", "REPORT"] {
            command.env_remove(format!("TOMBOLO_{variable}"));
        }
        command
            .env_remove("CATALYST_IMPLEMENTATION_PATHS")
            .env("CATALYST_IMPLEMENTATION_NAME", "tombolo");
        command
    }
}

fn on_ranks(ranks: usize, program: &Path) -> Command {
    let mut command = Command::new("mpirun");
    // More ranks than cores, and as whoever runs the tests.
    command.args(["--oversubscribe", "--allow-run-as-root", "-n", &ranks.to_string()]).arg(program);
    command
}

/// A directory with a configuration and orders.
fn inputs(config: &Value, orders: &Value) -> (tempfile::TempDir, PathBuf, PathBuf) {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let (pipelines, file) =
        (directory.path().join("pipelines.json"), directory.path().join("orders.json"));
    std::fs::write(&pipelines, config.to_string()).expect("a file");
    std::fs::write(&file, orders.to_string()).expect("a file");
    (directory, pipelines, file)
}

/// The numbers of the line that the examples print in the end: volume, mean temperature,
/// conductivity.
fn numbers(told: &str) -> [f64; 3] {
    let line = told
        .lines()
        .find(|line| line.starts_with("volume "))
        .unwrap_or_else(|| panic!("no volume in:\n{told}"));
    let numbers: Vec<f64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
    numbers.try_into().unwrap_or_else(|_| panic!("not three numbers: {line}"))
}

/// Presses the box flat to four fifths of its height.
fn press() -> Value {
    json!({"edits": [{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -0.2]}}],
        "schedule": {"steps": 4, "every": {"steps": 2}}})
}

#[test]
fn every_language_obeys_the_same_orders_alike() {
    let built = Built::get();
    let orders = json!([{"at": {"cycle": 5}, "order": press()}, {"at": {"cycle": 20}, "parameter": {"name": "conductivity", "value": 0.25}}]);
    let (_directory, pipelines, orders) = inputs(&json!({"version": 1}), &orders);
    let mut first: Option<[f64; 3]> = None;
    for name in PROGRAMS {
        let rest = numbers(&succeed(
            built.program(name, 1).args(["40", "4"]).env("TOMBOLO_PIPELINES", &pipelines),
        ));
        assert!((rest[0] - 1.0).abs() < 1e-12, "{name}: {rest:?}");
        let mut program = built.program(name, 1);
        program
            .args(["40", "4"])
            .env("TOMBOLO_PIPELINES", &pipelines)
            .env("TOMBOLO_ORDERS", &orders);
        let moved = numbers(&succeed(&mut program));
        assert!((moved[0] - 0.8).abs() < 1e-9 && moved[2] == 0.25, "{name}: {moved:?}");
        // The heat flows along x, and the box is pressed along z: the temperature is that of the
        // box at rest until the conductivity changes.
        assert!(
            moved[1] < rest[1] && moved[1] > 0.7 * rest[1],
            "{name}: {moved:?}, at rest {rest:?}"
        );
        let first = *first.get_or_insert(moved);
        assert!(
            first.iter().zip(moved).all(|(one, other)| (one - other).abs() < 1e-9),
            "{name}: {moved:?}, not {first:?}"
        );
    }
}

#[test]
fn three_ranks_and_ranks_without_cells_compute_what_one_does() {
    let built = Built::get();
    let change =
        json!([{"at": {"cycle": 3}, "parameter": {"name": "conductivity", "value": 0.125}}]);
    let watch = json!({"version": 1, "pipelines": [{"name": "surface", "every": {"steps": 10},
        "stages": [{"surface": {}}, {"write": {"file": "surface-{cycle}.vtp"}}]}]});
    let (directory, pipelines, change) = inputs(&watch, &change);
    for name in PROGRAMS {
        let run = |ranks: usize, cells: &str| {
            let mut program = built.program(name, ranks);
            program.current_dir(directory.path()).args(["20", cells]);
            numbers(&succeed(
                program.env("TOMBOLO_PIPELINES", &pipelines).env("TOMBOLO_ORDERS", &change),
            ))
        };
        let (one, three) = (run(1, "4"), run(3, "4"));
        assert!(
            one[2] == 0.125 && one.iter().zip(three).all(|(a, b)| (a - b).abs() < 1e-12),
            "{name}: {one:?}, {three:?}"
        );
        if name == PROGRAMS[0] {
            // Two slabs of cells on three ranks.
            assert!((run(3, "2")[0] - 1.0).abs() < 1e-12);
        }
    }
}

/// A finer mesh and a better conductor take shorter steps: no temperature leaves the range of those
/// that are held.
#[test]
fn fine_meshes_stay_finite() {
    let built = Built::get();
    let change = json!([{"at": {"cycle": 0}, "parameter": {"name": "conductivity", "value": 1}}]);
    let (_directory, pipelines, change) = inputs(&json!({"version": 1}), &change);
    for name in PROGRAMS {
        let mut program = built.program(name, 2);
        program.args(["150", "16"]).env("TOMBOLO_PIPELINES", &pipelines);
        let told = numbers(&succeed(program.env("TOMBOLO_ORDERS", &change)));
        // On its way to one half.
        assert!((told[1] - 0.408).abs() < 0.01, "{name}: {told:?}");
    }
}

#[test]
fn ranks_without_a_configuration_find_a_port() {
    let built = Built::get();
    // By this test or by anything else: the usual port is taken.
    let _taken = std::net::TcpListener::bind("127.0.0.1:7070");
    for ranks in [1, 3] {
        let told = succeed(built.program("heat_catalyst", ranks).args(["5", "4"]));
        assert!((numbers(&told)[0] - 1.0).abs() < 1e-12, "{told}");
        assert!(
            told.contains("tombolo: the links to this run are in ")
                && !told.contains("tombolo-7070.link"),
            "{told}"
        );
    }
}

/// Steers an example from a viewer until it ends.
fn steer(name: &str, ranks: usize) {
    let config = json!({"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [
        {"name": "surface", "stages": [{"surface": {}}, {"stream": {}}]}]});
    let (_directory, pipelines, _) = inputs(&config, &json!([]));
    let mut program = Built::get().program(name, ranks);
    program.args(["1000000", "4", "2"]).env("TOMBOLO_PIPELINES", &pipelines);
    let mut run = Run::start(&mut program);
    let link = run.link();
    let mut viewer = Viewer::connect(&link).expect("the run lets in");
    let hello = viewer.wait_for("hello", |hello| hello["channel"] == "solid");
    let features: Vec<&str> = hello["features"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|it| it["name"].as_str())
        .collect();
    assert!(viewer.frame().starts_with(b"TMBL"), "{name}");
    for side in ["x-min", "x-max", "y-min", "y-max", "z-min", "z-max"] {
        assert!(features.contains(&side), "{name}: {features:?}");
    }
    viewer.send(&json!({"id": "press", "order": press()}));
    let order = viewer.wait_for("order", |order| {
        order["id"] == "press" && (order["status"] == "applied" || order["status"] == "rejected")
    });
    assert_eq!(order["status"], "applied", "{name}: {order}");
    // The step that the last shape is for comes to its end.
    viewer.wait_for("status", |_| true);
    viewer.send(&json!({"parameter": {"name": "conductivity", "value": 0.75}}));
    viewer.send(&json!({"stop": {}}));
    let (status, text) = run.finish(PATIENCE);
    assert!(status.success(), "{name}: {text}");
    let [volume, _, conductivity] = numbers(&text);
    assert_eq!(conductivity, 0.75, "{name}: {text}");
    assert!((volume - 0.8).abs() < 1e-9, "{name}: {text}");
}

#[test]
fn every_language_streams_and_obeys_a_viewer() {
    PROGRAMS.into_iter().for_each(|name| steer(name, 1));
}

#[test]
fn three_ranks_stream_and_obey_a_viewer() {
    PROGRAMS.into_iter().for_each(|name| steer(name, 3));
}

#[test]
fn pkg_config_builds_the_same_programs() {
    let built = Built::get();
    let directory = tempfile::tempdir().expect("a temporary directory");
    let (pipelines, program) =
        (directory.path().join("nothing.json"), directory.path().join("program"));
    std::fs::write(&pipelines, json!({"version": 1}).to_string()).expect("a file");
    let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    for (compiler, sources, packages, mpi) in [
        ("gcc", "c/heat.c c/heat_catalyst.c", "catalyst", "mpicc"),
        ("gcc", "c/heat.c c/heat_tombolo.c", "tombolo", "mpicc"),
        ("g++", "cxx/heat_catalyst.cpp", "catalyst", "mpicxx"),
        (
            "gfortran",
            "fortran/heat.f90 fortran/pace.f90 fortran/heat_catalyst.f90",
            "catalyst_fortran",
            "mpifort",
        ),
        (
            "gfortran",
            "fortran/heat.f90 fortran/pace.f90 fortran/heat_tombolo.f90",
            "tombolo_fortran",
            "mpifort",
        ),
    ] {
        let mut query = Command::new("pkg-config");
        query
            .env("PKG_CONFIG_PATH", built.prefix.join("lib/pkgconfig"))
            .args(["--cflags", "--libs", packages]);
        let flags = succeed(&mut query);
        let compile = succeed(Command::new(mpi).arg("--showme:compile"));
        let link = succeed(Command::new(mpi).arg("--showme:link"));
        let mut command = Command::new(compiler);
        command.current_dir(directory.path()).args(words(&compile));
        command
            .args(words(sources).iter().map(|source| project().join("examples/heat").join(source)));
        succeed(command.arg("-o").arg(&program).args(words(&flags)).args(words(&link)));
        let mut run = Command::new(&program);
        run.args(["5", "3"])
            .env("CATALYST_IMPLEMENTATION_NAME", "tombolo")
            .env("TOMBOLO_PIPELINES", &pipelines);
        assert!((numbers(&succeed(&mut run))[0] - 1.0).abs() < 1e-12);
    }
}

#[test]
fn no_rank_waits_for_one_that_goes_wrong() {
    let built = Built::get();
    let directory = tempfile::tempdir().expect("a temporary directory");
    let (pipelines, program) =
        (directory.path().join("surface.json"), directory.path().join("ranks"));
    let watch = json!({"version": 1, "pipelines": [
        {"name": "surface", "stages": [{"surface": {}}, {"write": {"file": "surface-{cycle}.vtp"}}]},
        {"name": "touching", "channel": "touching", "stages": [{"write": {"file": "touching-{cycle}.vtu"}}]},
        {"name": "levels", "channel": "levels", "stages": [{"surface": {}}, {"write": {"file": "levels-{cycle}.vtp"}}]},
        {"name": "across", "channel": "across", "stages": [{"write": {"file": "across-{cycle}.vtu"}}]},
        {"name": "drops", "channel": "drops", "stages": [{"write": {"file": "drops-{cycle}.vtu"}}]},
        {"name": "skin", "channel": "drops", "stages": [{"surface": {}}, {"write": {"file": "skin-{cycle}.vtp"}}]},
        {"name": "last", "channel": "touching", "stages": [{"write": {"file": "last-{cycle}.vtu"}}]}]});
    std::fs::write(&pipelines, watch.to_string()).expect("a file");
    let half_space =
        |at: f64, up: i32| json!({"half_space": {"origin": [0, 0, at], "normal": [0, 0, up]}});
    let press = json!({"region": half_space(0.99, 1), "fixed_region": half_space(0.01, -1), "by": [0, 0, -0.1]});
    let orders = directory.path().join("orders.json");
    let order = json!([{"at": {"cycle": 2}, "order": {"edits": [{"translate": press}], "schedule": {"steps": 1}}}]);
    std::fs::write(&orders, order.to_string()).expect("a file");
    let mut query = Command::new("pkg-config");
    query
        .env("PKG_CONFIG_PATH", built.prefix.join("lib/pkgconfig"))
        .args(["--cflags", "--libs", "catalyst"]);
    let flags = succeed(&mut query);
    let mut compile = Command::new("mpicc");
    compile.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/languages/ranks.c")).arg("-o").arg(&program);
    succeed(compile.args(flags.split_whitespace()));
    let mut run = Command::new("timeout");
    run.args(["900", "mpirun", "--oversubscribe", "--allow-run-as-root", "-n", "3"]).arg(&program);
    run.current_dir(directory.path())
        .env("CATALYST_IMPLEMENTATION_NAME", "tombolo")
        .env("TOMBOLO_ORDERS", &orders)
        .env("TOMBOLO_PIPELINES", &pipelines);
    let told = succeed(&mut run);
    // The same order moves cubes that are blocks, without the files.
    let nothing = directory.path().join("nothing.json");
    std::fs::write(&nothing, json!({"version": 1}).to_string()).expect("a file");
    succeed(run.arg("blocks").env("TOMBOLO_PIPELINES", &nothing));
    assert!(
        told.contains(
            "rank 1: 'catalyst/channels/solid/data/topologies/mesh/elements/shape': found 'cube'"
        ),
        "{told}"
    );
    assert!(told.contains("rank 2: 'catalyst/state/time' is missing"), "{told}");
    let surface = tombolo::pipelines::files::read_mesh(directory.path().join("surface-000002.vtp"))
        .expect("was written");
    // Two cubes side by side, without the face between them.
    assert_eq!(surface.mesh.cells().len(), 10);
    // Two blocks on each of two ranks: only what is matched beyond doubt is one vertex.
    let written = |name: &str| {
        tombolo::pipelines::files::read_mesh(directory.path().join(name)).expect("was written")
    };
    let touching = written("touching-000002.vtu").mesh;
    assert_eq!((touching.cells().len(), touching.points().len()), (4, 28));
    // A coarse cell and eight fine ones on each rank: all faces but those against each other, and
    // against those of the other rank.
    assert_eq!(written("levels-000002.vtp").mesh.cells().len(), 2 * (6 + 24 - 2 * (1 + 4)));
    // Finer cells of another rank cover a coarse one; types and fields of the mesh come along.
    let across = written("across-000002.vtu");
    assert_eq!(across.mesh.cells().len(), 1 + 8);
    let field =
        |name: &str| across.fields.iter().find(|field| field.name == name).expect("was written");
    assert_eq!(
        (field("level").number.name(), field("level").values.iter().sum::<f64>()),
        ("uint8", 8.0)
    );
    assert_eq!(
        (field("held").number.name(), field("held").values.as_slice()),
        ("float32", &[0.5][..])
    );
    let drops = written("drops-000002.vtu").mesh;
    assert_eq!((drops.cells().len(), drops.points().len()), (4, 4), "points are never merged");
    let skin = "pipeline 'skin': the mesh has no surface: none of its 4 cells has dimension 2 or 3";
    assert_eq!(told.matches(skin).count(), 1, "{told}");
}

#[test]
fn no_rank_of_tombolo_h_waits_for_one_that_goes_wrong() {
    let built = Built::get();
    let directory = tempfile::tempdir().expect("a temporary directory");
    let program = directory.path().join("ranks");
    let mut query = Command::new("pkg-config");
    query
        .env("PKG_CONFIG_PATH", built.prefix.join("lib/pkgconfig"))
        .args(["--cflags", "--libs", "tombolo"]);
    let flags = succeed(&mut query);
    let mut compile = Command::new("mpicc");
    compile
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/languages/ranks_tombolo.c"))
        .arg("-o")
        .arg(&program);
    succeed(compile.args(["-Wall", "-Wextra", "-Werror"]).args(flags.split_whitespace()));
    let mut run = Command::new("timeout");
    succeed(
        run.args(["900", "mpirun", "--oversubscribe", "--allow-run-as-root", "-n", "3"])
            .arg(&program),
    );
}

#[test]
fn valgrind_finds_nothing_in_the_examples() {
    let built = Built::get();
    let orders = json!([{"at": {"cycle": 1}, "order": press()}]);
    let (_directory, pipelines, orders) = inputs(&json!({"version": 1}), &orders);
    for name in ["heat_catalyst", "heat_tombolo"] {
        let mut command = Command::new("valgrind");
        // What MPI leaks is its own; what it does to memory that it maps is listed in its
        // suppressions.
        command.args([
            "-q",
            "--error-exitcode=9",
            "--suppressions=/usr/share/openmpi/openmpi-valgrind.supp",
        ]);
        command
            .arg(built.build.join(name))
            .args(["4", "2"])
            .env("CATALYST_IMPLEMENTATION_NAME", "tombolo");
        let told =
            succeed(command.env("TOMBOLO_PIPELINES", &pipelines).env("TOMBOLO_ORDERS", &orders));
        assert!(numbers(&told)[0] < 1.0, "{told}");
    }
}
