//! Programs over CGAL, for cross-checks: the C++ files of `tests/cgal`, compiled once and kept in
//! the target directory.

use std::fmt::Write as _;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};

use tombolo_deform::mesh::Vector;

use crate::{project, target};

const FLAGS: [&str; 5] = ["-std=c++17", "-O2", "-w", "-DNDEBUG", "-I/usr/include/eigen3"];
const LIBRARIES: [&str; 2] = ["-lgmp", "-lmpfr"];

/// The program made from `tests/cgal/<name>.cpp`. It is compiled with g++ where the target
/// directory has no program yet for this text and these flags; CGAL and Eigen (Debian's libcgal-dev
/// and libeigen3-dev) must be there, as `scripts/setup` has them.
///
/// # Panics
/// Where there is no such file, or it does not compile.
#[must_use]
pub fn cgal_program(name: &str) -> PathBuf {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _guard = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let source = project().join("tests/cgal").join(format!("{name}.cpp"));
    let text =
        std::fs::read(&source).unwrap_or_else(|error| panic!("{}: {error}", source.display()));
    let mut hasher = DefaultHasher::new();
    (&text, FLAGS, LIBRARIES).hash(&mut hasher);

    let directory = target().join("cgal");
    std::fs::create_dir_all(&directory).expect("the target directory can be written to");
    let program = directory.join(format!("{name}-{:016x}", hasher.finish()));
    if !program.exists() {
        // Another test may compile it at the same time: each writes a file of its own, and the last
        // one stays.
        let own = program.with_extension(std::process::id().to_string());
        let output = Command::new("g++")
            .args(FLAGS)
            .arg(&source)
            .arg("-o")
            .arg(&own)
            .args(LIBRARIES)
            .output()
            .unwrap_or_else(|error| panic!("g++ does not start ({error}): run scripts/setup"));
        let messages = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.success(),
            "{} does not compile; run scripts/setup\n{messages}",
            source.display()
        );
        std::fs::rename(&own, &program).expect("a file can be renamed");
    }
    program
}

/// Runs [`cgal_program`] with these arguments and this input to its end; what it printed.
///
/// # Panics
/// Where it does not end well.
#[must_use]
pub fn cgal(name: &str, arguments: &[&str], input: &str) -> String {
    let mut child = Command::new(cgal_program(name))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("a program that compiled starts");
    let mut pipe = child.stdin.take().expect("the input is a pipe");
    let output = std::thread::scope(|scope| {
        // A program that ends before it has read everything breaks the pipe; its status says why.
        scope.spawn(move || drop(pipe.write_all(input.as_bytes())));
        child.wait_with_output().expect("a program ends")
    });
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "{name} {arguments:?} ended with {}\n{messages}",
        output.status
    );
    String::from_utf8(output.stdout).expect("a cross-check prints text")
}

/// Triangles as an OFF file, with every digit of the coordinates.
#[must_use]
pub fn off(points: &[Vector], triangles: &[[u32; 3]]) -> String {
    let mut text = format!("OFF\n{} {} 0\n", points.len(), triangles.len());
    for [x, y, z] in points {
        let _ = writeln!(text, "{x:?} {y:?} {z:?}");
    }
    for [a, b, c] in triangles {
        let _ = writeln!(text, "3 {a} {b} {c}");
    }
    text
}
