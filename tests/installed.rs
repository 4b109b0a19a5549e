//! What scripts/install-catalyst puts into a prefix: programs build against it in one language at a
//! time, without MPI, by the lines of the book; it is listed, and goes again.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use tombolo_tests::{install, output, project, succeed};

fn script() -> Command {
    Command::new(project().join("scripts/install-catalyst"))
}

/// A prefix that all tests but one only read.
fn prefix() -> &'static Path {
    static PREFIX: OnceLock<PathBuf> = OnceLock::new();
    PREFIX.get_or_init(|| {
        let prefix = Path::new(env!("CARGO_TARGET_TMPDIR")).join("installed/prefix");
        succeed(&mut install(&prefix));
        prefix
    })
}

/// A program in an environment that says nothing but that Tombolo is meant, and that nothing is
/// watched.
fn run(program: &Path, folder: &Path, arguments: [&str; 2]) -> String {
    let pipelines = folder.join("pipelines.json");
    fs::write(&pipelines, "{\"version\": 1}").expect("a file");
    let mut command = Command::new(program);
    command.args(arguments).current_dir(folder);
    command.env("TOMBOLO_PIPELINES", pipelines).env("CATALYST_IMPLEMENTATION_NAME", "tombolo");
    for variable in
        ["TOMBOLO_ORDERS", "TOMBOLO_OUTPUT", "TOMBOLO_REPORT", "CATALYST_IMPLEMENTATION_PATHS"]
    {
        command.env_remove(variable);
    }
    succeed(&mut command)
}

/// Each line of the page on solvers that calls the C compiler, as it stands there but for the
/// prefix.
#[test]
fn the_lines_of_the_book_compile_a_solver() {
    let page = fs::read_to_string(project().join("docs/instrument-your-solver.md"))
        .expect("the page is there");
    let lines: Vec<&str> = page.lines().filter(|line| line.starts_with("cc ")).collect();
    assert!(lines.iter().any(|line| line.contains("pkg-config")), "{lines:?}");
    assert!(lines.iter().any(|line| line.contains("-Wl,-rpath")), "{lines:?}");
    for line in lines {
        let folder = tempfile::tempdir().expect("a folder");
        symlink(project().join("examples"), folder.path().join("examples")).expect("a link");
        let line = line.replace("PREFIX", &prefix().to_string_lossy());
        let mut compile = Command::new("sh");
        compile.args(["-e", "-c", &line]).current_dir(folder.path());
        succeed(compile.env("PKG_CONFIG_PATH", prefix().join("lib/pkgconfig")));
        let words: Vec<&str> = line.split_whitespace().collect();
        let program =
            words.iter().position(|word| *word == "-o").and_then(|option| words.get(option + 1));
        let program = folder.path().join(program.expect("-o names the program"));
        // The hottest corner has cooled from 308 towards 300 by a thousandth in each of 3 steps.
        let told = run(&program, folder.path(), ["pipelines.json", "3"]);
        assert!(told.contains("ended at 307.976024"), "{line}: {told}");
    }
}

/// Each folder of examples wants its own language only, and no MPI; what they compute is the same.
#[test]
fn each_language_builds_by_itself_without_mpi() {
    let mut told = BTreeSet::new();
    for (language, programs) in [
        ("c", &["heat_catalyst", "heat_tombolo"][..]),
        ("cxx", &["heat_catalyst_cxx"]),
        ("fortran", &["heat_catalyst_fortran", "heat_tombolo_fortran"]),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let mut configure = Command::new("cmake");
        configure
            .arg("-S")
            .arg(project().join("examples/heat").join(language))
            .arg("-B")
            .arg(folder.path());
        configure
            .arg("-DEXAMPLES_MPI=OFF")
            .arg(format!("-DCMAKE_PREFIX_PATH={}", prefix().display()));
        for (name, variable) in [("c", "CC"), ("cxx", "CXX"), ("fortran", "FC")] {
            if name != language {
                configure.env(variable, "/bin/false");
            }
        }
        succeed(&mut configure);
        succeed(Command::new("cmake").arg("--build").arg(folder.path()));
        for program in programs {
            let program = folder.path().join(program);
            let linked = succeed(Command::new("readelf").arg("-d").arg(&program));
            assert!(!linked.contains("libmpi"), "{linked}");
            let said = run(&program, folder.path(), ["5", "3"]);
            let line =
                said.lines().find(|line| line.starts_with("volume ")).expect("a line of numbers");
            let numbers = line.split_whitespace().filter_map(|word| word.parse::<f64>().ok());
            told.insert(numbers.map(|number| format!("{number:.9}")).collect::<Vec<_>>());
        }
    }
    assert_eq!(told.len(), 1, "{told:?}");
}

/// All of them at once, in the languages that there are.
#[test]
fn a_missing_compiler_leaves_the_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut configure = Command::new("cmake");
    configure
        .arg("-S")
        .arg(project().join("examples/heat"))
        .arg("-B")
        .arg(folder.path())
        .arg("-DEXAMPLES_MPI=OFF");
    configure
        .arg(format!("-DCMAKE_PREFIX_PATH={}", prefix().display()))
        .arg("-DCMAKE_Fortran_COMPILER=NOTFOUND");
    succeed(&mut configure);
    succeed(Command::new("cmake").arg("--build").arg(folder.path()));
    let built = |name| folder.path().join(name).is_file();
    assert!(built("heat_tombolo") && built("heat_catalyst_cxx") && !built("heat_tombolo_fortran"));
}

/// Every file of the prefix, relative to it.
fn files(folder: &Path) -> BTreeSet<String> {
    let told = succeed(
        Command::new("find")
            .args([".", "-not", "-type", "d", "-printf", "%P\\n"])
            .current_dir(folder),
    );
    told.lines().map(str::to_owned).collect()
}

#[test]
fn what_is_installed_is_listed_and_goes_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let prefix = folder.path().join("a prefix");
    fs::create_dir_all(prefix.join("lib")).expect("a folder");
    fs::write(prefix.join("lib/libother.so"), "not ours").expect("a file");
    let manifest = prefix.join("share/tombolo/installed");
    let listed = || -> BTreeSet<String> {
        fs::read_to_string(&manifest).expect("the list").lines().map(str::to_owned).collect()
    };
    let ours = || -> BTreeSet<String> {
        let kept = ["lib/libother.so", "share/tombolo/installed"];
        files(&prefix).into_iter().filter(|file| !kept.contains(&file.as_str())).collect()
    };

    succeed(install(&prefix).args(["--program", "/bin/true"]));
    let first = listed();
    assert_eq!(ours(), first);
    for file in [
        "bin/tombolo",
        "lib/libtombolo.so",
        "include/tombolo.h",
        "lib/catalyst/libcatalyst-tombolo.so",
    ] {
        assert!(first.contains(file), "{file}: {first:?}");
    }
    // Each library exports what is its own, under the name by which programs look for it.
    for (file, soname, own, others) in [
        ("lib/libtombolo.so", "libtombolo.so.0", " tombolo_execute\n", "catalyst_api_impl"),
        (
            "lib/catalyst/libcatalyst-tombolo.so",
            "libcatalyst-tombolo.so",
            " catalyst_api_impl\n",
            "tombolo_execute",
        ),
    ] {
        let symbols =
            succeed(Command::new("nm").args(["-D", "--defined-only"]).arg(prefix.join(file)));
        assert!(symbols.contains(own) && !symbols.contains(others), "{file}: {symbols}");
        let linked = succeed(Command::new("readelf").arg("-d").arg(prefix.join(file)));
        assert!(linked.contains(&format!("[{soname}]")), "{file}: {linked}");
    }
    let version = succeed(
        Command::new("pkg-config")
            .args(["--modversion", "tombolo"])
            .env("PKG_CONFIG_PATH", prefix.join("lib/pkgconfig")),
    );
    assert_eq!(version.trim(), env!("CARGO_PKG_VERSION"));

    succeed(install(&prefix).args(["--program", "/bin/true"]));
    assert_eq!(
        (listed(), ours()),
        (first.clone(), first.clone()),
        "the second time changes nothing"
    );

    // What this installation has not, of the one before, goes.
    succeed(install(&prefix).env("FC", "no-such-compiler"));
    assert_eq!(listed(), ours());
    assert!(!prefix.join("bin").exists() && !prefix.join("include/tombolo.mod").exists());

    succeed(script().arg(&prefix).arg("--uninstall"));
    assert_eq!(files(&prefix), BTreeSet::from(["lib/libother.so".to_owned()]));
    let again = output(script().arg(&prefix).arg("--uninstall"));
    assert!(!again.status.success());
    assert!(String::from_utf8_lossy(&again.stderr).contains("nothing is installed"), "{again:?}");
}

#[test]
fn what_is_wrong_or_missing_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let prefix = folder.path().join("prefix");
    let refused = |command: &mut Command, why: &str| {
        let output = output(command);
        assert!(!output.status.success(), "{command:?}");
        assert!(String::from_utf8_lossy(&output.stderr).contains(why), "{command:?}: {output:?}");
    };
    assert!(succeed(script().arg("--help")).contains("--without-viewer"));
    refused(&mut script(), "where to?");
    refused(script().arg(&prefix).arg("--verbose"), "there is no option '--verbose'");
    refused(script().arg(&prefix).arg("--library"), "--library needs a file");
    refused(
        script().arg(&prefix).args(["--library", "/no/such.so"]),
        "there is no file '/no/such.so'",
    );
    refused(script().arg("/proc/prefix"), "'/proc/prefix' cannot be written");

    // A machine with nothing but what every machine has.
    let tools = folder.path().join("tools");
    fs::create_dir(&tools).expect("a folder");
    for tool in ["bash", "dirname", "basename", "sed", "head", "mkdir", "sort", "cut"] {
        symlink(Path::new("/usr/bin").join(tool), tools.join(tool)).expect("a link");
    }
    let mut without_rust = script();
    refused(without_rust.arg(&prefix).env("PATH", &tools), "Rust is missing");
    for tool in ["cargo", "rustc"] {
        let stands_in = tools.join(tool);
        fs::write(&stands_in, "#!/usr/bin/bash\necho rustc 1.200.0\n").expect("a file");
        succeed(Command::new("chmod").arg("+x").arg(&stands_in));
    }
    refused(script().arg(&prefix).env("PATH", &tools), "a C compiler (cc) is missing");
    symlink("/bin/true", tools.join("cc")).expect("a link");
    refused(script().arg(&prefix).arg("--distributed").env("PATH", &tools), "mpicc is missing");
    assert!(!prefix.join("lib").exists(), "nothing is installed by halves");
}
