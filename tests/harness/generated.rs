//! The meshes that `scripts/meshes` makes, and their surfaces.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use crate::{project, target};

/// The files of `scripts/meshes --surface` of these names: made once, kept in the target directory,
/// and made again after the script has changed.
///
/// # Panics
/// Where the script fails: it needs what `scripts/setup` installs.
#[must_use]
pub fn generated_surfaces(names: &[&str]) -> Vec<PathBuf> {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _guard = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let directory = target().join("surfaces");
    let script = project().join("scripts/meshes");
    let changed = |path: &Path| std::fs::metadata(path).and_then(|data| data.modified()).ok();
    let path = |name: &str| directory.join(format!("{name}.msh"));
    let stale: Vec<&str> =
        names.iter().copied().filter(|name| changed(&path(name)) < changed(&script)).collect();
    if !stale.is_empty() {
        let output = Command::new(project().join(".venv/bin/python"))
            .arg(&script)
            .args(&stale)
            .args(["--surface", "--out"])
            .arg(&directory)
            .output()
            .unwrap_or_else(|error| panic!("Python does not start ({error}): run scripts/setup"));
        assert!(
            output.status.success(),
            "run scripts/setup\n{}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    names.iter().map(|name| path(name)).collect()
}

/// A mesh of `scripts/meshes`, in `meshes/`, where the cases of the examples look for it; made
/// where it is not there yet.
///
/// # Panics
/// Where the script fails: it needs what `scripts/setup` installs.
#[must_use]
pub fn generated_mesh(name: &str) -> PathBuf {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _guard = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let path = project().join(format!("meshes/{name}.msh"));
    if !path.exists() {
        let made = Command::new(project().join(".venv/bin/python"))
            .current_dir(project())
            .args(["scripts/meshes", name])
            .status()
            .unwrap_or_else(|error| panic!("Python does not start ({error}): run scripts/setup"));
        assert!(made.success(), "scripts/meshes made no mesh: run scripts/setup");
    }
    path
}
