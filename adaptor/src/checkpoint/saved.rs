//! What a checkpoint holds besides coordinates.

use serde::{Deserialize, Serialize};
use tombolo_pipelines::language::{Command, CommandAuthor, Pipeline, TimedCommand};

use crate::steering::{Defaults, KnownCommands, SavedSteering};

/// The state of a run on one rank.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SavedRun {
    /// The checkpoint; the same on all ranks.
    pub(crate) id: String,
    /// The run that made it.
    pub(crate) run: String,
    pub(crate) rank: usize,
    pub(crate) ranks: usize,
    /// The step of the last call, where there was one.
    pub(crate) has_begun: bool,
    pub(crate) cycle: u64,
    pub(crate) time: f64,
    /// The cycle at which the ranks last came together, where they do not at every call.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) met: Option<u64>,
    pub(crate) parameters: Vec<(String, f64)>,
    /// The pipelines that the run began with, and those that it has come to.
    pub(crate) pipelines: [Vec<Pipeline>; 2],
    /// What the commands of files were told apart by, and those that are still to come.
    pub(crate) timed: (u64, Vec<TimedCommand>),
    /// The hashes of the commands of files that were carried out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) carried_out: Vec<u64>,
    pub(crate) defaults: Defaults,
    /// The commands so far; on rank 0.
    pub(crate) known: KnownCommands,
    /// The commands that were accepted and not obeyed yet; on rank 0.
    pub(crate) waiting: Vec<SavedCommand>,
    pub(crate) mesh: Option<SavedMesh>,
}

/// A command that was accepted.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SavedCommand {
    pub(crate) id: String,
    pub(crate) by: CommandAuthor,
    pub(crate) command: Command,
}

/// The mesh that orders change, on one rank.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SavedMesh {
    /// The fingerprint of its cells, and how many there are.
    pub(crate) cells: (u64, usize),
    pub(crate) steering: SavedSteering,
}
