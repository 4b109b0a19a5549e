//! Puts the built viewer, where there is one, into the library.

use std::{env, fmt::Write, fs, io, path::Path};

/// Leaves the viewer out, though it is there.
const WITHOUT_VIEWER: &str = "TOMBOLO_WITHOUT_VIEWER";

fn main() -> io::Result<()> {
    #[cfg(feature = "distributed")]
    petsc()?;
    let manifest = env::var("CARGO_MANIFEST_DIR").map_err(io::Error::other)?;
    let viewer = Path::new(&manifest).join("../viewer/dist");
    let mut files = Vec::new();
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed={WITHOUT_VIEWER}");
    // A path that does not exist would make every build start from here, so the viewer is built
    // first or this file touched.
    if env::var_os(WITHOUT_VIEWER).is_none()
        && let Ok(viewer) = viewer.canonicalize()
    {
        println!("cargo::rerun-if-changed={}", viewer.display());
        collect(&viewer, "", &mut files)?;
    }
    files.sort();
    let mut table = String::from("&[\n");
    for (name, path) in files {
        writeln!(table, "    ({name:?}, include_bytes!({path:?})),").map_err(io::Error::other)?;
    }
    table.push(']');
    let out = env::var("OUT_DIR").map_err(io::Error::other)?;
    fs::write(Path::new(&out).join("viewer_files.rs"), table)
}

/// Links PETSc, where its numbers are those that its binding declares.
#[cfg(feature = "distributed")]
fn petsc() -> io::Result<()> {
    let library = pkg_config::Config::new()
        .atleast_version("3.18")
        .probe("PETSc")
        .map_err(io::Error::other)?;
    for folder in &library.include_paths {
        let Ok(settings) = fs::read_to_string(folder.join("petscconf.h")) else { continue };
        let has =
            |name: &str| settings.lines().any(|line| line.starts_with(&format!("#define {name} ")));
        if has("PETSC_USE_64BIT_INDICES")
            || has("PETSC_USE_COMPLEX")
            || !has("PETSC_USE_REAL_DOUBLE")
        {
            let folder = folder.display();
            return Err(io::Error::other(format!(
                "PETSc in {folder}: expected real numbers of double precision and indices of 32 bits; `PKG_CONFIG_PATH` chooses another"
            )));
        }
    }
    Ok(())
}

fn collect(directory: &Path, prefix: &str, files: &mut Vec<(String, String)>) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let entry = entry?;
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if entry.file_type()?.is_dir() {
            collect(&entry.path(), &format!("{name}/"), files)?;
        } else {
            files.push((name, entry.path().to_string_lossy().into_owned()));
        }
    }
    Ok(())
}
