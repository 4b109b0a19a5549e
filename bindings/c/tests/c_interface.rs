//! `tombolo.h` and the Fortran module `tombolo`, as a stranger's compiler and a clumsy caller meet
//! them.

use std::path::{Path, PathBuf};
use std::process::Command;

use tombolo::pipelines::files::{MeshFile, read_mesh};
use tombolo_tests::{library, output, project, succeed};

/// A directory with the library under its installed name.
fn installed() -> tempfile::TempDir {
    let directory = tempfile::tempdir().expect("a temporary directory");
    for name in ["libtombolo.so.0", "libtombolo.so"] {
        std::os::unix::fs::symlink(library("libtombolo_c.so"), directory.path().join(name))
            .expect("a link");
    }
    directory
}

/// A C program, compiled by one line as the page says.
fn compile(directory: &Path, standard: &str, source: &Path) -> PathBuf {
    let program = directory.join("program");
    let mut compiler = Command::new(if standard.starts_with("c++") { "g++" } else { "cc" });
    compiler
        .args([&format!("-std={standard}"), "-Wall", "-Wextra", "-pedantic", "-Werror", "-g"])
        .arg(source);
    compiler.arg("-o").arg(&program).arg("-I").arg(project().join("bindings/c/include"));
    compiler
        .arg("-L")
        .arg(directory)
        .arg(format!("-Wl,-rpath,{}", directory.display()))
        .args(["-ltombolo", "-lm"]);
    succeed(&mut compiler);
    program
}

fn under_valgrind(program: &Path) -> Command {
    let mut command = Command::new("valgrind");
    command
        .args(["-q", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=definite"])
        .arg(program);
    command
}

#[test]
fn the_header_is_c_and_cpp_and_of_this_version() {
    let directory = installed();
    let source = |ending: &str| directory.path().join(format!("program.{ending}"));
    let text = "#include <tombolo.h>\n#include <string.h>\nint main(void) { return strcmp(tombolo_version(), TOMBOLO_VERSION); }\n";
    for ending in ["c", "cpp"] {
        std::fs::write(source(ending), text).expect("a file");
    }
    for (standard, ending) in [("c99", "c"), ("c11", "c"), ("c++11", "cpp"), ("c++17", "cpp")] {
        succeed(&mut Command::new(compile(directory.path(), standard, &source(ending))));
    }
    let header = std::fs::read_to_string(project().join("bindings/c/include/tombolo.h"))
        .expect("the header");
    let version = env!("CARGO_PKG_VERSION");
    assert!(header.contains(&format!("#define TOMBOLO_VERSION \"{version}\"")), "{version}");
    let parts = ["MAJOR", "MINOR", "PATCH"].into_iter().zip(version.split(['.', '-']));
    for (part, number) in parts {
        assert!(
            header.contains(&format!("#define TOMBOLO_VERSION_{part} {number}\n")),
            "{part} of {version}"
        );
    }
}

#[test]
fn every_function_of_the_header_is_exported_and_the_other_way_round() {
    let header = std::fs::read_to_string(project().join("bindings/c/include/tombolo.h"))
        .expect("the header");
    let directory = installed();
    let symbols = succeed(
        Command::new("nm")
            .args(["-D", "--defined-only"])
            .arg(directory.path().join("libtombolo.so")),
    );
    let exported: Vec<&str> = symbols
        .lines()
        .filter_map(|line| line.split(' ').nth(2))
        .filter(|name| name.starts_with("tombolo_"))
        .collect();
    assert!(
        !header.contains("atalyst") && !symbols.contains("catalyst"),
        "Catalyst is another library's"
    );
    for name in &exported {
        // Of the Fortran module alone.
        let is_own = matches!(
            *name,
            "tombolo_refuse" | "tombolo_vertices_of_cell" | "tombolo_order_by_number"
        );
        assert_eq!(
            header.contains(&format!(" {name}(")) || header.contains(&format!("* {name}(")),
            !is_own,
            "{name}"
        );
    }
    for name in declared(&header) {
        assert!(exported.contains(&name), "{name}");
    }
}

#[test]
fn the_smallest_program_runs_to_its_end() {
    let directory = installed();
    let program = compile(directory.path(), "c99", &project().join("examples/heat/c/first.c"));
    let pipelines = directory.path().join("pipelines.json");
    let watch = r#"{"version": 1, "pipelines": [{"name": "surface", "stages": [{"surface": {}}, {"write": {"file": "box-{cycle:1}.vtp"}}]}]}"#;
    std::fs::write(&pipelines, watch).expect("a file");
    succeed(Command::new(&program).current_dir(directory.path()).arg("pipelines.json").arg("2"));
    let written = read_mesh(directory.path().join("box-1.vtp")).expect("was written");
    assert_eq!(written.mesh.cells().len(), 6 * 64);
    let told = output(Command::new(&program).arg("no-such-file.json"));
    assert!(!told.status.success());
    let told = String::from_utf8_lossy(&told.stderr);
    assert!(told.starts_with("no-such-file.json: No such file"), "{told}");
    let source =
        std::fs::read_to_string(project().join("examples/heat/c/first.c")).expect("the example");
    assert!(source.lines().count() <= 40);
}

#[test]
fn every_mistake_is_an_error_with_its_reason() {
    let directory = installed();
    let program = compile(directory.path(), "c99", &project().join("bindings/c/tests/clumsy.c"));
    let told = succeed(&mut Command::new(&program));
    let count: u32 = told.split(' ').next().and_then(|count| count.parse().ok()).expect("a count");
    assert!(count > 300 && !told.contains("defect"), "{told}");
    succeed(&mut under_valgrind(&program));
}

#[test]
fn a_solver_can_take_the_motion_of_the_boundary_alone() {
    let directory = installed();
    let program = compile(directory.path(), "c99", &project().join("bindings/c/tests/surface.c"));
    assert_eq!(succeed(&mut Command::new(&program)), "");
    succeed(&mut under_valgrind(&program));
}

#[test]
fn what_is_forgotten_is_not_read_any_more() {
    let directory = installed();
    let program = compile(directory.path(), "c99", &project().join("bindings/c/tests/forget.c"));
    succeed(under_valgrind(&program).current_dir(directory.path()));
    let has_estimate = |cycle: u32| {
        let file = directory.path().join(format!("forget-{cycle}.vtu"));
        let written = read_mesh(file).expect("was written");
        written.fields.iter().any(|field| field.name == "error_estimate")
    };
    assert!(has_estimate(0) && !has_estimate(1) && !has_estimate(4));
}

#[test]
fn a_mesh_of_two_coordinates_stays_in_its_plane() {
    let directory = installed();
    let program = compile(directory.path(), "c99", &project().join("bindings/c/tests/plate.c"));
    succeed(Command::new(&program).current_dir(directory.path()));
}

#[test]
fn a_refused_step_leaves_nothing_behind() {
    let directory = installed();
    let program = compile(directory.path(), "c99", &project().join("bindings/c/tests/recovers.c"));
    succeed(Command::new(&program).current_dir(directory.path()));
}

#[test]
fn a_run_goes_on_from_its_checkpoint_as_if_it_had_not_ended() {
    let directory = installed();
    let program = compile(directory.path(), "c99", &project().join("bindings/c/tests/restart.c"));
    assert_eq!(succeed(Command::new(&program).current_dir(directory.path())), "");
    succeed(under_valgrind(&program).current_dir(directory.path()));
    let program = fortran(directory.path(), &project().join("bindings/c/tests/restart.f90"))
        .unwrap_or_else(|told| panic!("{told}"));
    // It lets go of the shape at its end.
    let told = "tombolo: the solver refines its mesh\n";
    assert_eq!(succeed(Command::new(&program).current_dir(directory.path())), told);
}

/// The functions that the header declares.
fn declared(header: &str) -> Vec<&str> {
    let lines = header
        .lines()
        .filter(|line| ["int ", "const ", "size_t "].iter().any(|it| line.starts_with(it)));
    lines
        .filter_map(|line| line.split('(').next().and_then(|before| before.rsplit(' ').next()))
        .collect()
}

#[test]
fn the_fortran_module_has_what_the_header_has_in_lines_that_every_compiler_takes() {
    let read = |file: &str| {
        std::fs::read_to_string(project().join("bindings/c").join(file)).expect("a file")
    };
    let (header, module) = (read("include/tombolo.h"), read("fortran/tombolo.f90"));
    let public: Vec<&str> = module
        .lines()
        .filter_map(|line| line.trim_start().strip_prefix("public :: "))
        .flat_map(|names| names.split(", "))
        .collect();
    // How many vertices there are is the size of an array.
    let sizes = ["tombolo_motion_count", "tombolo_surface_count"];
    for name in declared(&header).into_iter().filter(|name| !sizes.contains(name)) {
        let kinds = ["_f32", "_f64", "_i32", "_i64", "_u8", "_strided"];
        let generic = kinds.iter().find_map(|kind| name.strip_suffix(kind)).unwrap_or(name);
        assert!(public.contains(&generic), "{name}");
    }
    // The types of numbers are those of the arrays.
    let types = ["INT", "UINT", "FLOAT"].map(|kind| format!("  TOMBOLO_{kind}"));
    for line in header.lines().filter(|line| line.starts_with("  TOMBOLO_")) {
        let value = line.trim_start().split([',', '/']).next().unwrap_or_default().trim_end();
        let is_type = types.iter().any(|kind| line.starts_with(kind));
        let is_there = is_type
            || module.lines().any(|line| {
                let mut words = line.split([',', '&']).flat_map(|part| part.rsplit("::").next());
                words.any(|word| word.trim() == value)
            });
        assert!(is_there, "{value}");
    }
    for line in module.lines() {
        assert!(line.len() <= 132, "{line}");
    }
}

/// A Fortran program; `Err` with what the compiler says.
fn fortran(directory: &Path, source: &Path) -> Result<PathBuf, String> {
    let program = directory.join("program");
    let mut compiler = Command::new("gfortran");
    compiler
        .args(["-std=f2018", "-Wall", "-Wno-uninitialized", "-ffree-line-length-none", "-g", "-J"])
        .arg(directory);
    compiler
        .arg(project().join("bindings/c/fortran/tombolo.f90"))
        .arg(source)
        .arg("-o")
        .arg(&program);
    compiler
        .arg("-L")
        .arg(directory)
        .arg(format!("-Wl,-rpath,{}", directory.display()))
        .arg("-ltombolo");
    let output = output(&mut compiler);
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    if output.status.success() { Ok(program) } else { Err(told) }
}

fn field<'a>(file: &'a MeshFile, name: &str) -> &'a [f64] {
    let found = file.fields.iter().find(|field| field.name == name);
    &found.unwrap_or_else(|| panic!("no field {name}")).values
}

#[test]
fn fortran_sections_are_lent_as_they_are() {
    let directory = installed();
    let program = fortran(directory.path(), &project().join("bindings/c/tests/sections.f90"))
        .expect("compiles");
    succeed(under_valgrind(&program).current_dir(directory.path()));
    for cycle in 0..2 {
        let file =
            read_mesh(directory.path().join(format!("all-{cycle}.vtu"))).expect("was written");
        let base = 1000.0 * f64::from(cycle);
        assert_eq!(file.mesh.points()[4], [1.0, 1.0, 1.0]);
        // A value of the array `store`, at a row and a column.
        let store = |row: u32, column: u32| base + f64::from(100 * row + column);
        let expected =
            |values: &dyn Fn(u32) -> Vec<f64>| (1..=5).flat_map(values).collect::<Vec<f64>>();
        let every = |column: u32| 2 * column - 1;
        assert_eq!(field(&file, "row"), expected(&|i| vec![store(1, i)]));
        assert_eq!(field(&file, "every"), expected(&|i| vec![store(1, 2 * i)]));
        assert_eq!(field(&file, "rows"), expected(&|i| (1..=3).map(|row| store(row, i)).collect()));
        assert_eq!(
            field(&file, "apart"),
            expected(&|i| [2, 4, 6].map(|row| store(row, every(i))).to_vec())
        );
        assert_eq!(
            field(&file, "assumed"),
            expected(&|i| (1..=3).map(|row| store(row, every(i))).collect())
        );
        assert_eq!(field(&file, "of cells"), [store(7, 1), store(7, 2)]);
        let count = |i: u32| base + f64::from(i);
        assert_eq!(field(&file, "columns"), expected(&|i| [i, i + 5, i + 10].map(count).to_vec()));
        assert_eq!(field(&file, "bounds"), (1..=15).map(count).collect::<Vec<_>>());
        assert_eq!(field(&file, "large"), (1..=15).map(count).collect::<Vec<_>>());
        assert_eq!(field(&file, "small"), expected(&|i| vec![count(2 * i)]));
        let half = |i: u32| 1000.5 * f64::from(cycle) + f64::from(i);
        assert_eq!(field(&file, "single"), expected(&|i| vec![half(every(i))]));
        assert_eq!(field(&file, "pairs"), (1..=10).map(half).collect::<Vec<_>>());
    }
}

#[test]
fn fortran_lends_nothing_that_ends_with_the_call() {
    let directory = installed();
    let source = directory.path().join("program.f90");
    let attempt = |declaration: &str, actual: &str| {
        let text = format!(
            "program attempt\n use tombolo\n implicit none\n type(tombolo_run) :: run\n integer :: status\n {declaration} :: x(5)\n \
             x = 0\n status = tombolo_field(run, 'solid', 'x', TOMBOLO_VERTEX, {actual})\n if (status == 0) stop 1\n\
             end program\n"
        );
        std::fs::write(&source, text).expect("a file");
        fortran(directory.path(), &source)
    };
    assert!(attempt("real, target", "x").is_ok());
    assert!(attempt("double precision, target", "x(1:5:2)").is_ok());
    for (declaration, actual) in [("real", "x"), ("real, target", "2 * x"), ("real, target", "(x)")]
    {
        let told = attempt(declaration, actual).expect_err(actual);
        assert!(told.contains("Error"), "{actual}: {told}");
    }
}
