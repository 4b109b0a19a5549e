//! The processes that a mesh is distributed over, and how they agree.

pub use tombolo_pipelines::communicator::{Communicator, Reduction, Solo};

use tombolo_pipelines::language::{Command, parse_json};

/// Gives every rank the commands that rank 0 has taken in, so that they take effect at the same cycle on all. Collective; free
/// on one process.
pub(crate) fn agree(communicator: &dyn Communicator, commands: Vec<(String, Command)>) -> Vec<(String, Command)> {
    if communicator.size() == 1 {
        return commands;
    }
    let mut bytes =
        if communicator.rank() == 0 { serde_json::to_vec(&commands).unwrap_or_default() } else { Vec::new() };
    communicator.broadcast(0, &mut bytes);
    // Every rank reads the same bytes, rank 0 too: what one cannot read, none obeys.
    std::str::from_utf8(&bytes).ok().and_then(|text| parse_json(text, "broadcast").ok()).unwrap_or_default()
}
