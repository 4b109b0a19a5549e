//! A small case in a directory of its own.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tempfile::TempDir;
use tombolo_deform::mesh::Mesh;
use tombolo_pipelines::files::read_mesh;

use crate::write_nozzle;

/// A nozzle of about 2 000 tetrahedra with its case, ready to run in milliseconds a step.
pub struct Small {
    directory: TempDir,
}

impl Default for Small {
    fn default() -> Self {
        Self::new()
    }
}

impl Small {
    /// Writes the mesh and the case.
    ///
    /// # Panics
    /// Where there is no room for temporary files.
    #[must_use]
    pub fn new() -> Self {
        let small = Self { directory: TempDir::new().expect("a temporary directory") };
        write_nozzle(&small.path("nozzle.msh"));
        small.write(
            "case.json",
            &json!({
                "mesh": "nozzle.msh",
                "density": 1.0,
                "viscosity": 0.01,
                "boundary": {
                    "inlet": {"velocity": [0.0, 1.0, 0.0]},
                    "outlet": {"pressure": 0.0},
                    "upstream": {"wall": "no_slip"},
                    "throat": {"wall": "no_slip"},
                    "downstream": {"wall": "no_slip"}
                },
                "time_step": 0.002,
                "steps": 20
            }),
        );
        small
    }

    /// A file in the directory.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    /// Writes JSON to a file in the directory, and says where.
    ///
    /// # Panics
    /// Where it cannot be written.
    pub fn write(&self, name: &str, content: &Value) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, content.to_string()).expect("a temporary file can be written");
        path
    }

    /// Reads JSON from a file in the directory.
    ///
    /// # Panics
    /// Where there is none.
    #[must_use]
    pub fn read(&self, name: &str) -> Value {
        let path = self.path(name);
        let text = std::fs::read_to_string(&path)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    /// The bytes of a file in the directory.
    ///
    /// # Panics
    /// Where there is none.
    #[must_use]
    pub fn bytes(&self, name: &str) -> Vec<u8> {
        let path = self.path(name);
        std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    }

    /// The mesh in a file of the directory.
    ///
    /// # Panics
    /// Where it cannot be read.
    #[must_use]
    pub fn mesh(&self, name: &str) -> Mesh {
        read_mesh(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}")).mesh
    }

    /// The arguments of `flow` for this case, its output in `out/`.
    ///
    /// # Panics
    /// Never, in a directory whose name is UTF-8.
    #[must_use]
    pub fn arguments(&self, more: &[&str]) -> Vec<String> {
        let text =
            |path: &Path| path.to_str().expect("a temporary directory has a plain name").to_owned();
        let mut arguments = vec![
            "--case".to_owned(),
            text(&self.path("case.json")),
            "--out".to_owned(),
            text(&self.path("out")),
            "--report".to_owned(),
            text(&self.path("report.json")),
        ];
        for argument in more {
            // Names of files of this directory are written as `@name`.
            arguments.push(
                argument
                    .strip_prefix('@')
                    .map_or_else(|| (*argument).to_owned(), |name| text(&self.path(name))),
            );
        }
        arguments
    }
}
