//! The library as it is installed: its symbols, and programs in C, C++ and Fortran that are built against a prefix by CMake and by
//! pkg-config.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The directory of this package.
fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The shared library that cargo built beside this test.
fn library() -> PathBuf {
    let mut path = std::env::current_exe().expect("a running test has a path");
    path.set_file_name("libcatalyst.so");
    path
}

fn output(command: &mut Command) -> Output {
    command.output().unwrap_or_else(|error| {
        panic!("{command:?} does not run ({error}); scripts/setup installs it")
    })
}

#[track_caller]
fn succeed(command: &mut Command) -> String {
    let output = output(command);
    let (told, errors) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{command:?}: {}\n{told}\n{errors}", output.status);
    format!("{told}{errors}")
}

/// A prefix with everything in it, and the programs built by CMake against it.
struct Built {
    prefix: PathBuf,
    build: PathBuf,
}

impl Built {
    fn get() -> &'static Self {
        static BUILT: OnceLock<Built> = OnceLock::new();
        BUILT.get_or_init(|| {
            let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("libcatalyst");
            let (prefix, build) = (directory.join("prefix"), directory.join("build"));
            succeed(
                Command::new(package().join("../../scripts/install-catalyst"))
                    .arg(&prefix)
                    .args(["--library".as_ref(), library().as_os_str()])
                    .args(["--replay", env!("CARGO_BIN_EXE_catalyst_replay")]),
            );
            // CMake refuses what another clone left.
            drop(std::fs::remove_dir_all(&build));
            let mut configure = Command::new("cmake");
            configure.arg("-S").arg(package().join("tests/programs")).arg("-B").arg(&build);
            succeed(configure.arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display())));
            succeed(Command::new("cmake").arg("--build").arg(&build));
            Built { prefix, build }
        })
    }

    /// A program, with nothing of the caller's environment that Catalyst reads.
    fn program(&self, name: &str) -> Command {
        let mut command = Command::new(self.build.join(name));
        for variable in ["NAME", "PATHS", "PREFER_ENV"] {
            command.env_remove(format!("CATALYST_IMPLEMENTATION_{variable}"));
        }
        command.env_remove("CATALYST_DATA_DUMP_DIRECTORY");
        command
    }

    fn implementations(&self) -> PathBuf {
        self.build.join("lib/catalyst")
    }
}

#[test]
fn exactly_the_listed_symbols_are_exported() {
    let listed = include_str!("../symbols.txt");
    let told = succeed(Command::new("nm").args(["-D", "--defined-only"]).arg(library()));
    let mut exported: Vec<&str> =
        told.lines().filter_map(|line| line.split_whitespace().nth(2)).collect();
    let mut wanted: Vec<&str> = listed.split_whitespace().collect();
    exported.sort_unstable();
    wanted.sort_unstable();
    assert_eq!(wanted.len(), 477);
    assert_eq!(exported, wanted);
    let dynamic = succeed(Command::new("readelf").arg("-d").arg(library()));
    assert!(dynamic.contains("Library soname: [libcatalyst.so.3]"), "{dynamic}");
}

#[test]
fn nodes_work_from_c_cpp_and_fortran() {
    let built = Built::get();
    let directory = tempfile::tempdir().expect("a temporary directory");
    let told = succeed(built.program("node_c").arg(directory.path()));
    assert!(
        told.contains("node.c: ok") && told.contains("conduit: the conduit node is null"),
        "{told}"
    );
    assert!(succeed(&mut built.program("blueprint")).contains("blueprint.c: ok"));
    let implementations = built.implementations();
    let told =
        succeed(built.program("node_cpp").env("CATALYST_IMPLEMENTATION_PATHS", &implementations));
    assert!(told.contains("node.cpp: ok"), "{told}");
    assert!(succeed(&mut built.program("node_f90")).contains("ok with stub"));
    let mut echoed = built.program("node_f90");
    echoed
        .env("CATALYST_IMPLEMENTATION_PATHS", implementations)
        .env("CATALYST_IMPLEMENTATION_NAME", "echo");
    assert!(succeed(&mut echoed).contains("ok with echo"));
}

#[test]
fn every_python_sees_the_same_node() {
    let built = Built::get();
    let packages =
        std::fs::read_dir(built.prefix.join("lib")).expect("the prefix can be read").flatten();
    let packages =
        packages.map(|entry| entry.path().join("site-packages")).find(|path| path.is_dir());
    let packages = packages.expect("the Python packages are installed");
    // The declarations as the compiler sees them: Python's idea of them must be the same.
    let mut preprocess = Command::new("gcc");
    preprocess.args([
        "-E",
        "-P",
        "-x",
        "c",
        "-include",
        "catalyst.h",
        "-include",
        "conduit_blueprint.h",
    ]);
    let preprocess =
        preprocess.arg("-I").arg(built.prefix.join("include/catalyst-2.0")).arg("/dev/null");
    let directory = tempfile::tempdir().expect("a temporary directory");
    let declared = directory.path().join("declared");
    std::fs::write(&declared, succeed(preprocess)).expect("can be written");
    let pythons = interpreters(directory.path());
    for (python, numpy) in &pythons {
        for (name, paths) in [("stub", PathBuf::new()), ("echo", built.implementations())] {
            let mut run = Command::new(python);
            run.arg(package().join("tests/programs/node.py"))
                .arg(name)
                .stdin(std::fs::File::open(&declared).expect("was written"))
                .env(
                    "PYTHONPATH",
                    std::env::join_paths([&packages, numpy]).expect("paths without a colon"),
                )
                .env("PYTHONDONTWRITEBYTECODE", "1");
            let told = succeed(
                run.env_remove("CATALYST_IMPLEMENTATION_NAME")
                    .env("CATALYST_IMPLEMENTATION_PATHS", paths),
            );
            assert!(told.contains(&format!("node.py: ok with {name}")), "{told}");
        }
    }
}

/// Every Python that can have NumPy, its own or that of the system's Python, which another of the same version can load; and where
/// it finds it. Those of a system lie below 4 GB, those that people build themselves do not: an address that is cut shows there.
fn interpreters(directory: &Path) -> Vec<(PathBuf, PathBuf)> {
    let home = std::env::var_os("PYENV_ROOT").map(PathBuf::from);
    let home =
        home.or_else(|| std::env::var_os("HOME").map(|home| Path::new(&home).join(".pyenv")));
    let versions = home.and_then(|home| std::fs::read_dir(home.join("versions")).ok());
    let built =
        versions.into_iter().flatten().flatten().map(|version| version.path().join("bin/python3"));
    let candidates =
        [PathBuf::from("python3"), PathBuf::from("/usr/bin/python3")].into_iter().chain(built);
    let lent = directory.join("numpy");
    std::fs::create_dir(&lent).expect("can be made");
    let system = "/usr/lib/python3/dist-packages/numpy";
    std::os::unix::fs::symlink(system, lent.join("numpy")).expect("can be made");
    let mut found: Vec<(PathBuf, PathBuf)> = Vec::new();
    for python in candidates {
        for numpy in [PathBuf::new(), lent.clone()] {
            let mut command = Command::new(&python);
            command
                .args(["-c", "import numpy"])
                .env("PYTHONPATH", &numpy)
                .env("PYTHONDONTWRITEBYTECODE", "1");
            if command.output().is_ok_and(|output| output.status.success()) {
                found.push((python, numpy));
                break;
            }
        }
    }
    assert!(!found.is_empty(), "no Python has NumPy; scripts/setup installs it");
    found
}

#[test]
fn valgrind_finds_nothing() {
    let built = Built::get();
    let directory = tempfile::tempdir().expect("a temporary directory");
    let options =
        ["-q", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=definite"];
    succeed(
        Command::new("valgrind")
            .args(options)
            .arg(built.build.join("node_c"))
            .arg(directory.path()),
    );
    for seed in ["1", "2"] {
        succeed(
            Command::new("valgrind")
                .args(options)
                .arg(built.build.join("rubbish"))
                .args([seed, "3000"]),
        );
        succeed(built.program("rubbish").args([seed, "50000"]));
    }
    let mut session = Command::new("valgrind");
    session
        .args(options)
        .arg(built.build.join("session"))
        .args(["0", "echo"])
        .arg(built.implementations());
    assert!(succeed(&mut session).contains("echo"));
}

#[test]
fn headers_define_what_programs_name() {
    let built = Built::get();
    let directory = tempfile::tempdir().expect("a temporary directory");
    let headers = built.prefix.join("include/catalyst-2.0");
    let compiled = |compiler: &str, standard: &str, source: &Path, program: &Path| {
        let mut compile = Command::new(compiler);
        compile
            .arg(format!("-std={standard}"))
            .args(["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-I"])
            .arg(&headers);
        compile
            .arg(source)
            .arg("-o")
            .arg(program)
            .arg("-L")
            .arg(built.prefix.join("lib"))
            .arg("-lcatalyst");
        succeed(&mut compile);
    };
    for (compiler, standard, source) in [
        ("gcc", "c99", "names.c"),
        ("gcc", "c11", "names.c"),
        ("g++", "c++11", "names.cpp"),
        ("g++", "c++17", "names.cpp"),
        ("g++", "c++20", "names.cpp"),
    ] {
        let program = directory.path().join(standard);
        compiled(compiler, standard, &package().join("tests/programs").join(source), &program);
        let told = succeed(Command::new(&program).env("LD_LIBRARY_PATH", built.prefix.join("lib")));
        assert!(told.contains(&format!("{source}: ok")), "{told}");
    }
    // Each header stands alone, and may come twice.
    let mut count = 0;
    for entry in std::fs::read_dir(&headers).expect("the headers are installed").flatten() {
        let name = entry.file_name().into_string().expect("headers have plain names");
        let languages: &[_] =
            match entry.path().extension().and_then(|extension| extension.to_str()) {
                Some("h") => &[("gcc", "c99", "c"), ("g++", "c++11", "cpp")],
                // Needs what includes it, and says so.
                Some("hpp") if name == "catalyst_conduit_families.hpp" => continue,
                Some("hpp") => &[("g++", "c++11", "cpp"), ("g++", "c++17", "cpp")],
                _ => continue,
            };
        for (compiler, standard, extension) in languages {
            let source = directory.path().join(format!("alone.{extension}"));
            let text =
                format!("#include <{name}>\n#include <{name}>\nint main(void) {{ return 0; }}\n");
            std::fs::write(&source, text).expect("can be written");
            compiled(compiler, standard, &source, &directory.path().join("alone"));
        }
        count += 1;
    }
    assert!(count > 25, "{count}");
}

#[test]
fn pkg_config_builds_the_same_programs() {
    let built = Built::get();
    let directory = tempfile::tempdir().expect("a temporary directory");
    for (compiler, source, name) in [
        ("gcc", "session.c", "catalyst"),
        ("g++", "node.cpp", "catalyst"),
        ("gfortran", "node.f90", "catalyst_fortran"),
    ] {
        let mut query = Command::new("pkg-config");
        query
            .env("PKG_CONFIG_PATH", built.prefix.join("lib/pkgconfig"))
            .args(["--cflags", "--libs", name]);
        let flags = succeed(&mut query);
        let program = directory.path().join(compiler);
        let mut compile = Command::new(compiler);
        compile.arg(package().join("tests/programs").join(source)).arg("-o").arg(&program);
        succeed(compile.args(flags.split_whitespace()));
        succeed(Command::new(&program).arg("0").env_remove("CATALYST_IMPLEMENTATION_NAME"));
    }
}

#[test]
fn the_loader_finds_what_is_asked_for() {
    let built = Built::get();
    let here = built.implementations();
    let with = |arguments: &[&str], environment: &[(&str, &str)]| {
        let mut command = built.program("session");
        command.args(arguments).envs(environment.iter().copied());
        succeed(&mut command)
    };
    let path = here.to_str().expect("the target directory's name is UTF-8");
    let paths = ("CATALYST_IMPLEMENTATION_PATHS", path);
    let name = |name| ("CATALYST_IMPLEMENTATION_NAME", name);
    let prefer = ("CATALYST_IMPLEMENTATION_PREFER_ENV", "1");
    assert_eq!(with(&["0"], &[]), "stub\n");
    assert_eq!(with(&["0"], &[name("stub")]), "stub\n");
    assert_eq!(with(&["0", "stub", path], &[name("nothing")]), "stub\n");
    assert_eq!(with(&["0", "echo", path], &[]), "echo\n");
    assert_eq!(with(&["0", "echo"], &[paths]), "echo\n");
    assert_eq!(with(&["0"], &[paths, name("echo")]), "echo\n");
    // The node comes before the environment, unless the environment is preferred.
    assert_eq!(with(&["0", "echo"], &[paths, name("nothing")]), "echo\n");
    assert_eq!(with(&["0", "nothing"], &[paths, name("echo"), prefer]), "echo\n");
    let told = with(&["3", "nothing", "/no/such/directory"], &[paths]);
    assert!(
        told.contains("no 'libcatalyst-nothing.so'")
            && told.contains("/no/such/directory")
            && told.contains(path),
        "{told}"
    );
    with(&["4", "NO_TABLE"], &[paths]);
    with(&["5", "WITHOUT_FUNCTION"], &[paths]);
    with(&["6", "OTHER_VERSION"], &[paths]);
    let told = with(&["0", "echo"], &[paths, ("CATALYST_DEBUG", "1")]);
    assert!(told.contains("catalyst: loaded '"), "{told}");
}

#[test]
fn what_is_dumped_is_played_back() {
    let built = Built::get();
    let directory = tempfile::tempdir().expect("a temporary directory");
    let dumped = directory.path().join("dump");
    let mut record = built.program("session");
    succeed(
        record
            .args(["0", "echo"])
            .arg(built.implementations())
            .env("CATALYST_DATA_DUMP_DIRECTORY", &dumped),
    );
    for stage in ["initialize", "execute_invc0", "finalize"] {
        assert!(dumped.join(format!("{stage}_params.conduit_bin.1.0")).exists(), "{stage}");
        assert!(dumped.join(format!("{stage}_params.conduit_bin.1.0_json")).exists(), "{stage}");
    }
    let again = directory.path().join("again");
    let replay = || {
        let mut command = Command::new(built.prefix.join("bin/catalyst_replay"));
        command
            .env("CATALYST_DATA_DUMP_DIRECTORY", &again)
            .env_remove("CATALYST_IMPLEMENTATION_NAME");
        command
    };
    succeed(replay().arg(&dumped));
    let read = |directory: &Path| {
        std::fs::read(directory.join("execute_invc0_params.conduit_bin.1.0")).expect("was dumped")
    };
    assert_eq!(read(&dumped), read(&again));
    let schema = std::fs::read_to_string(dumped.join("finalize_params.conduit_bin.1.0_json"))
        .expect("was dumped");
    let leaf = "{\"dtype\":\"char8_str\",\"number_of_elements\": 5,\"offset\": 0,\"stride\": 1,\"element_bytes\": 1,\
                \"endianness\": \"little\"}";
    assert!(
        schema.starts_with("\n{\n  \"catalyst_load\": \n  {\n    \"implementation\": ")
            && schema.contains(leaf),
        "{schema}"
    );

    // What is not the whole of a run on as many ranks is refused.
    let refused = |directory: &Path, why: &str| {
        let refused = output(replay().arg(directory));
        assert!(!refused.status.success());
        assert!(String::from_utf8_lossy(&refused.stderr).starts_with(why), "{refused:?}");
    };
    refused(&directory.path().join("nothing"), "ERROR: Error opening directory");
    refused(Path::new(""), "ERROR: Empty data_dump_directory path detected");
    refused(directory.path(), "ERROR: Missing node data for at least one stage");
    let without = |stage: &str, why: &str| {
        let file = dumped.join(format!("{stage}_params.conduit_bin.1.0"));
        let kept = std::fs::read(&file).expect("was dumped");
        std::fs::remove_file(&file).expect("is there");
        refused(&dumped, why);
        std::fs::write(&file, &kept).expect("can be written");
    };
    for stage in ["initialize", "execute_invc0", "finalize"] {
        without(stage, "ERROR: Missing node data for at least one stage");
    }
    let first = dumped.join("execute_invc0_params.conduit_bin.1.0");
    std::fs::copy(&first, dumped.join("execute_invc1_params.conduit_bin.1.0"))
        .expect("can be written");
    without("execute_invc0", "ERROR: Unexpected number of calls to execute");
    std::fs::remove_file(dumped.join("execute_invc1_params.conduit_bin.1.0")).expect("is there");
    let second = dumped.join("initialize_params.conduit_bin.1.1");
    std::fs::copy(&first, &second).expect("can be written");
    refused(&dumped, "ERROR: Mismatch in the number of calls to initialize or finalize");
    std::fs::remove_file(&second).expect("is there");
    for arguments in [&[][..], &["one", "two"]] {
        let told = output(replay().args(arguments));
        assert!(!told.status.success());
        let told = String::from_utf8_lossy(&told.stderr).into_owned();
        assert!(told.starts_with("ERROR: Expected 1 argument, the data dump directory."), "{told}");
    }
    std::fs::write(dumped.join("finalize_params.conduit_bin.2.1"), "").expect("can be written");
    refused(&dumped, "ERROR: Mismatch in the number of ranks");
}
