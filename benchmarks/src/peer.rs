//! Programs that others wrote, or that are compiled for a benchmark, run beside it.

use std::error::Error;
use std::path::PathBuf;
use std::process::Command;

use tombolo_tests::project;

/// Runs a program to its end, and gives what it printed.
///
/// # Errors
/// Where it cannot be started, with how to install it, or fails, with what it said.
pub fn run(command: &mut Command) -> Result<String, Box<dyn Error>> {
    let output = command.output().map_err(|error| {
        format!("{command:?}: {error}; `scripts/setup --benchmarks` installs the peers")
    })?;
    let said = String::from_utf8(output.stdout)?;
    if output.status.success() {
        return Ok(said);
    }
    let complained = String::from_utf8_lossy(&output.stderr);
    Err(format!(
        "{command:?} failed; `scripts/setup --benchmarks` installs the peers: {said}{complained}"
    )
    .into())
}

/// The Python that `scripts/setup` installs what it needs for.
pub fn python() -> Command {
    Command::new(project().join(".venv/bin/python"))
}

/// A program on ranks of MPI.
pub fn on_ranks(ranks: usize) -> Command {
    let mut command = Command::new("mpirun");
    command.args(["--allow-run-as-root", "--oversubscribe", "-n", &ranks.to_string()]);
    command
}

/// The line that a program on ranks prints for us.
///
/// # Errors
/// Where it printed none.
pub fn answer(printed: &str) -> Result<&str, Box<dyn Error>> {
    let line = printed.lines().find_map(|line| line.strip_prefix("tombolo "));
    line.ok_or_else(|| format!("the ranks gave no answer: {printed}").into())
}

/// The file of a mesh of `scripts/meshes`, which may have been made.
pub fn known_mesh(name: &str) -> PathBuf {
    let directory =
        std::env::var_os("TOMBOLO_MESHES").map_or_else(|| project().join("meshes"), PathBuf::from);
    directory.join(format!("{name}.msh"))
}

/// The file of a mesh of `scripts/meshes`, made where it is not there yet.
///
/// # Errors
/// Where it cannot be made.
pub fn mesh_file(name: &str) -> Result<PathBuf, Box<dyn Error>> {
    let file = known_mesh(name);
    if !file.exists() {
        let script = project().join("scripts/meshes");
        run(python().arg(script).args([name, "--out"]).args(file.parent()))?;
    }
    Ok(file)
}

/// Numbers from the bytes of a little-endian file.
pub fn numbers(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|&number| f64::from_le_bytes(number)).collect()
}

/// The largest difference between numbers, in parts of the largest of `theirs`; infinite where
/// there are not as many.
pub fn apart(ours: &[f64], theirs: &[f64]) -> f64 {
    if ours.len() != theirs.len() {
        return f64::INFINITY;
    }
    let largest = theirs.iter().fold(f64::MIN_POSITIVE, |largest, value| largest.max(value.abs()));
    ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest
}
