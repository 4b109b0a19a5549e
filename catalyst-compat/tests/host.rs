//! The built library, called by C programs as a `libcatalyst` that is not ours would call it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tombolo::deform::mesh::CellType;
use tombolo::pipelines::files::{MeshFile, read_mesh};
use tombolo_tests::{library, output, succeed};

const LIBRARY: &str = "libtombolo_catalyst.so";

/// Compiles a program of this directory; with `exporting`, its Conduit functions can be found by
/// the library.
fn compile(directory: &Path, name: &str, exporting: bool) -> PathBuf {
    let program = directory.join(name);
    let source = format!("{}/tests/{name}.c", env!("CARGO_MANIFEST_DIR"));
    let mut compiler = Command::new("cc");
    compiler
        .args(["-Wall", "-Wno-unused-function", "-Werror", "-O1", "-g", &source, "-o"])
        .arg(&program);
    if exporting {
        compiler.arg("-rdynamic");
    }
    succeed(compiler.args(["-ldl", "-lm"]));
    program
}

fn run(program: &Path, script: Option<&Path>, environment: &[(&str, &str)]) -> (Output, String) {
    let mut command = Command::new(program);
    for name in ["PIPELINES", "ORDERS", "OUTPUT", "REPORT", "RESTART"] {
        command.env_remove(format!("TOMBOLO_{name}"));
    }
    let output =
        output(command.arg(library(LIBRARY)).args(script).envs(environment.iter().copied()));
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    (output, errors)
}

/// A configuration that looks at everything, and is watched by nobody.
const QUALITY: &str =
    r#"{"version": 1, "pipelines": [{"name": "health", "stages": [{"quality": {}}]}]}"#;

/// A configuration with a server.
const STREAM: &str = r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [
    {"name": "surface", "stages": [{"surface": {}}, {"stream": {}}]}]}"#;

#[test]
fn whatever_is_wrong_is_told_with_its_path() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let pipelines = directory.path().join("pipelines.json");
    std::fs::write(&pipelines, QUALITY).expect("a file");
    let pipelines = pipelines.to_string_lossy();
    let host = compile(directory.path(), "host", true);
    let stream = directory.path().join("stream.json");
    std::fs::write(&stream, STREAM).expect("a file");
    let (output, errors) = run(&host, Some(&stream), &[("TOMBOLO_PIPELINES", &pipelines)]);
    assert!(output.status.success(), "{errors}");
    for told in [
        "catalyst_execute: 'catalyst' is missing; expected an object with 'state' and 'channels'",
        "'catalyst/state/time' is missing",
        "'catalyst/state/time': found NaN; expected a finite number",
        "'catalyst/state/timestep': found the text 'seven'; expected a whole number from 0 on",
        "'catalyst/state/timestep': found -1; expected a whole number from 0 on",
        "catalyst_initialize: the conduit node is null",
        "no-such-file.json",
        "'catalyst/pipelines/0/type': found 'oi'; expected 'io'",
        "'catalyst/mpi_comm': found the text 'world'; expected the Fortran handle of a communicator",
        "'catalyst/channels/grid/type': found 'msh'; expected 'mesh', 'multimesh' or 'amrmesh'",
        "'catalyst/channels/grid/memoryspace': found 'cuda'; expected 'host'",
        "'catalyst/channels/grid/data/coordsets/coords/type': found 'explicid'",
        "'catalyst/channels/grid/data/coordsets/coords/values/y': found 3 value(s) of type float64; expected 4 values",
        "'catalyst/channels/grid/data/topologies/mesh/coordset': found the text 'points'; expected one of the coordsets coords",
        "'catalyst/channels/grid/data/topologies/mesh/elements/shape': found 'tetrahedron'",
        "/elements/connectivity': found 3 value(s) of type int32; expected a multiple of 4 values",
        "channel 'grid': cell 0: vertex 4 does not exist; the mesh has 4 vertices, numbered from 0",
        "channel 'grid': cell 0: vertex -3 does not exist; the mesh has 4 vertices, numbered from 0",
        "/elements/connectivity': cell 0: vertex 4 does not exist; the mesh has 4 vertices, numbered from 0",
        "/elements/connectivity': cell 0: vertex -3 does not exist; the mesh has 4 vertices, numbered from 0",
        "'catalyst/channels/grid/data/fields/temperature/values': found 3 values; expected 4, one for each vertex",
        "'catalyst/channels/grid/data/fields/temperature/association': found 'point'; expected 'vertex' or 'element'",
        "'catalyst/channels/grid/data/fields/temperature/values' is missing",
        "'catalyst/channels/grid/data/fields/temperature/values': found the text 'warm'; expected an array of numbers",
        "'catalyst/channels/grid/data/coordsets/coords/values/x': found a null pointer",
        "expected a length that memory can have",
        "cannot be read; expected values in the main memory of this process",
        "tombolo: the links to this run are in ",
        "tombolo: the solver has made another mesh",
    ] {
        assert!(errors.contains(told), "'{told}' is not in:\n{errors}");
    }
    assert_eq!(errors.matches("'catalyst/mpi_comm': found").count(), 2, "{errors}");
    assert!(!errors.contains("defect"), "{errors}");
}

#[test]
fn a_host_without_conduit_is_told_so() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let (output, errors) = run(&compile(directory.path(), "host", false), None, &[]);
    assert!(!output.status.success());
    assert!(
        errors.contains("does not export 'catalyst_conduit_node_number_of_children'"),
        "{errors}"
    );
    assert!(errors.contains("about before initialize: 7 where 0 is expected"), "{errors}");
}

/// What a written file holds: how many cells of each type, and the sizes of the cells.
struct Written {
    file: MeshFile,
}

impl Written {
    fn read(directory: &Path, channel: &str, cycle: u64) -> Self {
        let path = directory.join(format!("{channel}-{cycle}.vtu"));
        Self { file: read_mesh(&path).unwrap_or_else(|error| panic!("{error}")) }
    }

    fn types(&self) -> Vec<CellType> {
        self.file.mesh.cells().types().to_vec()
    }

    fn field(&self, name: &str) -> &[f64] {
        let found = self.file.fields.iter().find(|field| field.name == name);
        &found.unwrap_or_else(|| panic!("no field {name}")).values
    }

    /// The volume within the faces of each cell, by the divergence theorem.
    fn volumes(&self) -> Vec<f64> {
        let (points, cells) = (self.file.mesh.points(), self.file.mesh.cells());
        (0..cells.len())
            .map(|cell| {
                let mut sum = 0.0;
                cells.for_each_face(cell, |face| {
                    let [a, rest @ ..] = face else { return };
                    for pair in rest.windows(2) {
                        let [a, b, c] =
                            [*a, pair[0], pair[1]].map(|vertex| points[vertex as usize]);
                        sum += a[0] * (b[1] * c[2] - b[2] * c[1])
                            + a[1] * (b[2] * c[0] - b[0] * c[2])
                            + a[2] * (b[0] * c[1] - b[1] * c[0]);
                    }
                });
                sum / 6.0
            })
            .collect()
    }
}

#[test]
fn every_mesh_of_the_blueprint_arrives() {
    use CellType::{
        Hexahedron, Line, Polygon, Polyhedron, Pyramid, Quad, Tetra, Triangle, Vertex, Wedge,
    };

    let directory = tempfile::tempdir().expect("a temporary directory");
    let pipelines = directory.path().join("pipelines.json");
    let watch = r#"{"version": 1, "pipelines": [{"name": "amounts", "channel": "hex", "stages": [
        {"statistics": {"field": "place"}}], "when": "cycle == 1", "then": [{"write": {"file": "when-{cycle}.vtu"}}]}]}"#;
    std::fs::write(&pipelines, watch).expect("a file");
    let program = compile(directory.path(), "meshes", true);
    let written = directory.path().join("out");
    let output = Command::new(&program)
        .arg(library(LIBRARY))
        .arg(&pipelines)
        .env("TOMBOLO_OUTPUT", &written)
        .env_remove("TOMBOLO_PIPELINES")
        .output()
        .expect("the program was just compiled");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert!(written.join("when-000001.vtu").exists() && !written.join("when-000000.vtu").exists());

    let third = 1.0 / 3.0;
    let expected: [(&str, &[CellType], &[f64]); 16] = [
        ("uniform", &[Hexahedron; 2], &[1.0, 1.0]),
        ("rectilinear", &[Quad; 6], &[0.0; 6]),
        ("structured", &[Hexahedron; 2], &[1.0, 1.0]),
        ("hex", &[Hexahedron; 2], &[1.0, 1.0]),
        ("tet", &[Tetra; 2], &[0.5 * third, 0.5 * third]),
        ("wedge", &[Wedge], &[0.5]),
        ("pyramid", &[Pyramid], &[third]),
        ("tri", &[Triangle; 2], &[0.0; 2]),
        ("quad", &[Quad; 2], &[0.0; 2]),
        ("line", &[Line; 2], &[0.0; 2]),
        ("point", &[Vertex; 3], &[0.0; 3]),
        ("points", &[Vertex; 12], &[0.0; 12]),
        ("mixed", &[Hexahedron, Wedge, Pyramid, Tetra], &[1.0, 0.5, third, 0.5 * third]),
        ("polygonal", &[Polygon, Triangle], &[0.0; 2]),
        ("polyhedral", &[Polyhedron; 2], &[1.0, 1.0]),
        ("blocks", &[Hexahedron; 2], &[1.0, 8.0]),
    ];
    for (channel, types, volumes) in expected {
        for cycle in 0..3 {
            let found = Written::read(&written, channel, cycle);
            assert_eq!(found.types(), types, "{channel}");
            let is_stretched = !matches!(channel, "uniform" | "blocks" | "hex");
            let stretch = if is_stretched { f64::from(1 << cycle) } else { 1.0 };
            for (found, expected) in found.volumes().iter().zip(volumes) {
                assert!(
                    (found - stretch * expected).abs() < 1e-12,
                    "{channel} at {cycle}: {found}, not {expected}"
                );
            }
        }
    }
    let amr = Written::read(&written, "amr", 0);
    assert_eq!(amr.types(), [Quad; 12 + 16]);
    assert_eq!(amr.field("level").iter().sum::<f64>(), 16.0);
    assert_eq!(Written::read(&written, "levels", 0).types(), [Quad; 12 + 14 + 8]);

    let uniform = Written::read(&written, "uniform", 2);
    assert_eq!(uniform.field("single"), [1.5, 2.5]);
    assert_eq!(uniform.field("small"), [-1.0, 7.0]);
    assert_eq!(
        uniform.field("along")[..3],
        [2.0, 12.0, 22.0],
        "what the solver changes in place is seen"
    );
    let hex = Written::read(&written, "hex", 0);
    assert_eq!(hex.field("place").len(), 36);
    assert_eq!(hex.field("place")[33..], [2.0, 1.0, 1.0]);
    assert_eq!(hex.field("big"), [258.0, 5.0]);
    assert_eq!(Written::read(&written, "mixed", 0).field("each"), [1.0, 2.0, 3.0, 4.0]);
    let blocks = Written::read(&written, "blocks", 0);
    assert_eq!(blocks.field("which"), [1.0, 2.0]);
    assert!(
        blocks.field("alone")[0] == 1.0 && blocks.field("alone")[1].is_nan(),
        "one block has no such field"
    );
}

/// What VTK finds in a file (`tests/vtk/arrays.py`).
fn vtk(file: &Path) -> serde_json::Value {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/vtk/arrays.py");
    let output = Command::new("/usr/bin/python3")
        .arg(script)
        .arg(file)
        .output()
        .expect("scripts/setup installs VTK");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

#[test]
fn vtk_reads_back_types_ghosts_and_fields_of_the_mesh() {
    use serde_json::json;

    let directory = tempfile::tempdir().expect("a temporary directory");
    let watch = directory.path().join("watch.json");
    let surfaces = r#"{"version": 1, "pipelines": [
        {"name": "skin", "channel": "types", "stages": [{"surface": {}}, {"write": {"file": "skin.vtp"}}]},
        {"name": "part", "channel": "types", "stages": [{"select": {"fields": ["int8"]}}, {"write": {"file": "part.vtu"}}]},
        {"name": "cut", "channel": "types", "stages": [{"slice": {"origin": [1.5, 0.5, 0.5], "normal": [0, 1, 0]}}, {"write": {"file": "cut.vtp"}}]},
        {"name": "amount", "channel": "types", "stages": [{"statistics": {"field": "uint8"}}],
            "when": "uint8.max < 4", "then": [{"write": {"file": "amount.vtu"}}]},
        {"name": "outside", "channel": "levels", "stages": [{"surface": {}}, {"write": {"file": "outside.vtp"}}]}]}"#;
    std::fs::write(&watch, surfaces).expect("a file");
    let program = compile(directory.path(), "arrays", true);
    let written = directory.path().join("out");
    let (output, errors) =
        run(&program, Some(&watch), &[("TOMBOLO_OUTPUT", &written.to_string_lossy())]);
    assert!(output.status.success(), "{errors}");
    let told = "tombolo: 'catalyst/channels/types/data/state/fields/title' is passed over: fields hold numbers, not texts\n";
    assert_eq!(errors, told, "what is passed over is told once");

    let types = vtk(&written.join("types.vtu"));
    assert_eq!(
        (&types["cells"], &types["own_cells"], &types["points"]),
        (&json!(3), &json!(2), &json!(16))
    );
    // Faces of ghosts, and those that lie against them, are inside the mesh.
    assert_eq!(types["faces"], 10);
    for (name, kind, values) in [
        ("int8", "signed char", [-128.0, 127.0]),
        ("int16", "short", [-32768.0, 32767.0]),
        ("int32", "int", [-2_147_483_648.0, 2_147_483_647.0]),
        ("int64", "long long", [-9_007_199_254_740_992.0, 9_007_199_254_740_992.0]),
        ("uint8", "unsigned char", [0.0, 255.0]),
        ("uint16", "unsigned short", [0.0, 65535.0]),
        ("uint32", "unsigned int", [0.0, 4_294_967_295.0]),
        ("uint64", "unsigned long long", [0.0, 9_007_199_254_740_992.0]),
        ("float32", "float", [f64::from(0.1_f32), f64::from(-1e30_f32)]),
        ("float64", "double", [0.1, -1e300]),
    ] {
        let found = &types["element"][name];
        let plain = found[0].as_str().map(|kind| kind.replace("vtktypeint64", "long long"));
        let plain = plain.as_deref().map(|found| if found == "long" { "long long" } else { found });
        let plain =
            plain.map(|found| if found == "unsigned long" { "unsigned long long" } else { found });
        assert_eq!((plain, &found[1]), (Some(kind), &json!(1)), "{name}");
        assert_eq!(found[2], json!([values[0], values[1], 3.0]), "{name}");
    }
    assert_eq!(types["element"]["vtkGhostType"], json!(["unsigned char", 1, [0.0, 1.0, 0.0]]));
    assert!(types["element"].get("halo").is_none());
    assert_eq!(types["mesh"]["times"], json!(["float", 1, [0.5, 0.25]]));
    assert_eq!(types["mesh"]["counts"], json!(["unsigned short", 1, [7.0]]));
    // Ghosts are told whatever fields are chosen.
    assert_eq!(vtk(&written.join("part.vtu"))["own_cells"], 2);
    assert!(written.join("amount.vtu").exists(), "the greatest value is the ghost's");

    let blocks = vtk(&written.join("blocks.vtu"));
    assert_eq!((&blocks["cells"], &blocks["own_cells"]), (&json!(5), &json!(4)));
    assert_eq!(
        blocks["element"]["vtkGhostType"],
        json!(["unsigned char", 1, [0.0, 0.0, 0.0, 1.0, 0.0]])
    );
    assert_eq!(blocks["element"]["small"][0], "short");

    let cells = |name: &str| {
        read_mesh(written.join(name)).unwrap_or_else(|error| panic!("{error}")).mesh.cells().len()
    };
    assert_eq!((cells("skin.vtp"), cells("cut.vtp")), (10, 2));
    assert_eq!(cells("outside.vtp"), 4 * 4 + 2, "nothing between the grids is drawn");
}

#[test]
fn pipelines_of_the_solver_and_of_the_user_run_together() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let program = compile(directory.path(), "arrays", true);
    let (user, solver) = (directory.path().join("user.json"), directory.path().join("solver.json"));
    let write = |name: &str| {
        format!(
            r#"{{"version": 1, "pipelines": [{{"name": "{name}", "channel": "types", "stages": [{{"write": {{"file": "{name}.vtu"}}}}]}}]}}"#
        )
    };
    std::fs::write(&user, write("user")).expect("a file");
    std::fs::write(&solver, write("solver")).expect("a file");
    let written = |name: &str| directory.path().join("out").join(name).exists();
    let output_of = |script: Option<&Path>, user: Option<&Path>| {
        let _ = std::fs::remove_dir_all(directory.path().join("out"));
        let (out, user) =
            (directory.path().join("out"), user.map(|user| user.to_string_lossy().into_owned()));
        let mut environment = vec![("TOMBOLO_OUTPUT", out.to_str().expect("a plain path"))];
        environment.extend(user.as_deref().map(|user| ("TOMBOLO_PIPELINES", user)));
        let (output, errors) = run(&program, script, &environment);
        assert!(output.status.success(), "{errors}");
        errors
    };
    // Files of the solver's, and the default view.
    let errors = output_of(None, None);
    assert!(
        errors.contains("tombolo: the links to this run are in ") && written("types.vtu"),
        "{errors}"
    );
    // Files of the solver's, and what the user asks for.
    let errors = output_of(None, Some(&user));
    assert!(
        !errors.contains("open http") && written("types.vtu") && written("user.vtu"),
        "{errors}"
    );
    // The solver names a configuration: the variable is passed over, and that is told.
    let errors = output_of(Some(&solver), Some(&user));
    assert!(written("types.vtu") && written("solver.vtu") && !written("user.vtu"), "{errors}");
    let told = format!(
        "tombolo: TOMBOLO_PIPELINES={} is passed over: the solver names a configuration itself\n",
        user.display()
    );
    assert_eq!(errors.matches(&told).count(), 1, "{errors}");
}

#[test]
fn a_step_says_which_pipelines_run() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let pipelines = directory.path().join("pipelines.json");
    let write = r#"{"version": 1, "pipelines": [
        {"name": "inner", "stages": [{"write": {"file": "inner-{cycle:1}.vtu"}}]},
        {"name": "outer", "stages": [{"surface": {}}, {"write": {"file": "outer-{cycle:1}.vtp"}}]}]}"#;
    std::fs::write(&pipelines, write).expect("a file");
    let written = directory.path().join("out");
    let program = compile(directory.path(), "choice", true);
    let (output, errors) =
        run(&program, Some(&pipelines), &[("TOMBOLO_OUTPUT", &written.to_string_lossy())]);
    assert!(output.status.success(), "{errors}");
    assert!(
        errors.contains("'catalyst/state/pipelines/[0]': found 'bothh'; expected one of"),
        "{errors}"
    );
    assert!(errors.contains("did you mean 'both'?"), "{errors}");
    let mut files: Vec<String> = std::fs::read_dir(&written)
        .expect("files were written")
        .map(|file| file.expect("a file").file_name().to_string_lossy().into_owned())
        .filter(|name| !name.ends_with(".pvd"))
        .collect();
    files.sort_unstable();
    let all = |cycle: u32| ["a", "b", "inner", "outer"].map(|name| format!("{name}-{cycle}"));
    let mut expected: Vec<String> = all(0).into_iter().chain(all(6)).collect();
    expected.extend(["a-1", "inner-3", "outer-3", "b-4", "inner-4"].map(str::to_owned));
    expected
        .iter_mut()
        .for_each(|name| name.push_str(if name.starts_with("outer") { ".vtp" } else { ".vtu" }));
    expected.sort_unstable();
    assert_eq!(files, expected);
}

#[test]
fn every_channel_is_watched_where_nobody_says_what_is() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let report = directory.path().join("report.json");
    let program = compile(directory.path(), "choice", true);
    let (output, errors) = run(&program, None, &[("TOMBOLO_REPORT", &report.to_string_lossy())]);
    assert!(output.status.success(), "{errors}");
    assert!(
        errors.starts_with("tombolo: the links to this run are in ") && errors.lines().count() == 1,
        "{errors}"
    );
    let report = std::fs::read_to_string(report).expect("a report");
    assert!(report.contains("\"cycles\": 3"), "{report}");
}

#[test]
fn rubbish_is_answered() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let stream = directory.path().join("stream.json");
    std::fs::write(&stream, STREAM).expect("a file");
    let (output, errors) = run(&compile(directory.path(), "rubbish", true), Some(&stream), &[]);
    assert!(output.status.success(), "{errors}");
    let told = String::from_utf8_lossy(&output.stdout);
    let refused: u32 =
        told.split(' ').next().and_then(|count| count.parse().ok()).expect("a count");
    assert!((1000..3000).contains(&refused), "{told}");
    assert!(!errors.contains("defect"), "{errors}");
}

#[test]
fn valgrind_finds_nothing() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let pipelines = directory.path().join("pipelines.json");
    std::fs::write(&pipelines, QUALITY).expect("a file");
    for name in ["host", "meshes"] {
        let program = compile(directory.path(), name, true);
        let mut command = Command::new("valgrind");
        command.args([
            "-q",
            "--error-exitcode=9",
            "--leak-check=full",
            "--errors-for-leak-kinds=definite",
        ]);
        command
            .arg(&program)
            .arg(library(LIBRARY))
            .arg(&pipelines)
            .env("TOMBOLO_PIPELINES", &pipelines);
        let output = command
            .env("TOMBOLO_OUTPUT", directory.path())
            .output()
            .expect("valgrind is installed (scripts/setup)");
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    }
}

/// Of what lies at z = 1, towards z = 0, in two shapes.
const ORDERS: &str = r#"[
    {"id": "press", "at": {"cycle": 2}, "order": {
        "edits": [{"translate": {"region": {"half_space": {"origin": [0, 0, 0.99], "normal": [0, 0, 1]}},
            "fixed_region": {"half_space": {"origin": [0, 0, 0.01], "normal": [0, 0, -1]}}, "by": [0, 0, -0.2]}}],
        "schedule": {"steps": 2, "every": {"steps": 2}, "motion": "at_once"}}},
    {"at": {"cycle": 3}, "parameter": {"name": "heating", "value": 2.5}},
    {"at": {"cycle": 6}, "stop": {}}]"#;

#[test]
fn results_hold_the_motion_while_there_is_one() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let (pipelines, orders) =
        (directory.path().join("pipelines.json"), directory.path().join("orders.json"));
    let config = r#"{"version": 1, "pipelines": [{"name": "shape", "on": "order", "channel": "box", "stages": []}]}"#;
    std::fs::write(&pipelines, config).expect("a file");
    std::fs::write(&orders, ORDERS).expect("a file");
    let program = compile(directory.path(), "motion", true);
    let (output, errors) =
        run(&program, Some(&pipelines), &[("TOMBOLO_ORDERS", &orders.to_string_lossy())]);
    assert!(output.status.success(), "{errors}");
    // Grids cannot move; it is said once for each run.
    let said = |line: &str| {
        line.contains("order 'press': applied, not followed: shape 1 of 2, handed out at cycle 2")
    };
    assert!(errors.lines().count() == 3 && errors.lines().all(said), "{errors}");
}

/// A directory with a configuration whose orders change the channel `box`, and with these orders.
fn steered(orders: &str) -> (tempfile::TempDir, PathBuf, String) {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let (pipelines, file) =
        (directory.path().join("pipelines.json"), directory.path().join("orders.json"));
    let config = r#"{"version": 1, "pipelines": [{"name": "shape", "on": "order", "channel": "box", "stages": []}]}"#;
    std::fs::write(&pipelines, config).expect("a file");
    std::fs::write(&file, orders).expect("a file");
    (directory, pipelines, file.to_string_lossy().into_owned())
}

#[test]
fn a_run_goes_on_from_its_checkpoint_as_if_it_had_not_ended() {
    let (directory, pipelines, orders) = steered(
        r#"[{"id": "press", "at": {"cycle": 2}, "order": {
            "edits": [{"translate": {"region": {"half_space": {"origin": [0, 0, 0.99], "normal": [0, 0, 1]}},
                "fixed_region": {"half_space": {"origin": [0, 0, 0.01], "normal": [0, 0, -1]}}, "by": [0.03, 0, -0.2]}}],
            "schedule": {"steps": 3, "every": {"steps": 2}}}},
        {"at": {"cycle": 10}, "order": {"undo": 1, "schedule": {"steps": 2, "every": {"steps": 1}}}}]"#,
    );
    let program = compile(directory.path(), "restart", true);
    let (output, errors) = run(&program, Some(&pipelines), &[("TOMBOLO_ORDERS", &orders)]);
    assert!(output.status.success(), "{errors}");
    assert!(directory.path().join("pipelines.json.state").exists());
}

#[test]
fn what_the_blueprint_allows_is_taken_for_what_it_is() {
    let (directory, pipelines, orders) = steered(
        r#"[{"id": "press", "at": {"cycle": 1}, "order": {
            "edits": [{"translate": {"features": ["lid"], "by": [0, 0, -0.25]}}], "schedule": {"steps": 1}}}]"#,
    );
    let program = compile(directory.path(), "blueprint", true);
    let (output, errors) = run(&program, Some(&pipelines), &[("TOMBOLO_ORDERS", &orders)]);
    assert!(output.status.success(), "{errors}");
    for told in [
        "'catalyst/channels/box/data/fields/fraction' is passed over: it has values of materials alone",
        "catalyst/channels/box: the global numbers of several blocks are passed over",
        "'catalyst/channels/box/data/topologies/solid' is passed over: the cells are those of topology 'volume'",
        "'catalyst/channels/box/data/fields/stress' is passed over: it is one of topology 'solid'",
        "'catalyst/channels/box/data/fields/wire_attribute' is passed over: it is one of topology 'wire'",
    ] {
        assert_eq!(errors.matches(told).count(), 1, "{errors}");
    }
}

#[test]
fn a_mesh_of_two_coordinates_stays_in_its_plane() {
    let translate = |cycle: u64, by: [f64; 3]| {
        let region = serde_json::json!({"box": {"lower": [-1, -1, -1], "upper": [0.5, 2, 1]}});
        serde_json::json!({"at": {"cycle": cycle}, "order": {
            "edits": [{"translate": {"region": region, "by": by}}], "schedule": {"steps": 1}}})
    };
    let orders = serde_json::json!([translate(1, [0.1, 0.0, 0.3]), translate(3, [0.1, 0.0, 0.0])]);
    let (directory, pipelines, orders) = steered(&orders.to_string());
    let program = compile(directory.path(), "plate", true);
    let (output, errors) = run(&program, Some(&pipelines), &[("TOMBOLO_ORDERS", &orders)]);
    assert!(output.status.success(), "{errors}");
}

#[test]
fn a_start_or_an_end_that_fails_leaves_what_it_should() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let pipelines = directory.path().join("pipelines.json");
    std::fs::write(&pipelines, QUALITY).expect("a file");
    let program = compile(directory.path(), "starts", true);
    let output_directory = directory.path().to_string_lossy().into_owned();
    let (output, errors) =
        run(&program, Some(&pipelines), &[("TOMBOLO_OUTPUT", &output_directory)]);
    assert!(output.status.success(), "{errors}");
    assert!(
        errors.contains("parameter 'inflow' cannot be 50; it must be a number from 0 to 40"),
        "{errors}"
    );
    let report = std::fs::read_to_string(directory.path().join("pipelines.json.report"));
    let report: serde_json::Value = serde_json::from_str(&report.expect("a report")).expect("JSON");
    let pipelines = report["pipelines"].as_array().expect("a list");
    let names: Vec<_> = pipelines.iter().map(|pipeline| &pipeline["name"]).collect();
    assert_eq!(names, ["surface"], "one default view, however many starts have failed");
}
