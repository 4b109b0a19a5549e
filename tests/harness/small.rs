//! A small case in a directory of its own.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tempfile::TempDir;
use tombolo_deform::mesh::Mesh;
use tombolo_pipelines::files::read_mesh;

use crate::{PATIENCE, Run, write_nozzle};

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

    /// The arguments of `flow` for this case, its output in `out/`. An entry that begins with an
    /// option may hold several arguments with blanks between them. Names of files of this directory
    /// are written as `@name`.
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
        for entry in more {
            let several = entry.starts_with("--").then(|| entry.split_whitespace());
            let one = several.is_none().then_some(*entry);
            arguments.extend(several.into_iter().flatten().chain(one).map(|argument| {
                argument
                    .strip_prefix('@')
                    .map_or_else(|| argument.to_owned(), |name| text(&self.path(name)))
            }));
        }
        arguments
    }

    /// Runs `flow` to its end; its report, and what it printed.
    ///
    /// # Panics
    /// Where it fails or writes no report.
    pub fn run(&self, more: &[&str]) -> (Value, String) {
        self.ended(Run::flow(&self.arguments(more)), &format!("{more:?}"))
    }

    /// Runs `flow` on several ranks of MPI to its end; its report, and what it printed.
    ///
    /// # Panics
    /// Where it fails or writes no report.
    pub fn run_on(&self, ranks: usize, more: &[&str]) -> (Value, String) {
        let run = Run::flow_on(ranks, &self.arguments(more));
        self.ended(run, &format!("{ranks} ranks, {more:?}"))
    }

    fn ended(&self, run: Run, what: &str) -> (Value, String) {
        let (status, text) = run.finish(PATIENCE);
        assert!(status.success(), "{what}:\n{text}");
        (self.read("report.json"), text)
    }
}

/// An order that pinches the throat of the nozzle to a part of its height.
#[must_use]
pub fn pinch(factor: f64, steps: u32, every: u32) -> Value {
    json!({"edits": [{"scale_direction": {
                "features": ["throat"], "fixed": ["inlet", "outlet"], "factors": [1, 1, factor], "harmonic_order": 2}}],
           "schedule": {"steps": steps, "every": {"steps": every}}})
}
