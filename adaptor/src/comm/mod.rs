//! The processes that a mesh is distributed over, and how they agree.

mod meeting;
#[cfg(feature = "distributed")]
pub mod mpi;

pub use tombolo_pipelines::communicator::{
    Alarm, Communicator, Counted, RankError, Reduction, Solo, Threads, Traffic, agree as agree_on,
    threads,
};

pub(crate) use meeting::meet;
use tombolo_pipelines::language::{Command, parse_json};

/// Gives every rank the commands that rank 0 has taken in, so that they take effect at the same cycle on all. Collective; free
/// on one process.
///
/// # Errors
/// A text, on all ranks, where the commands cannot be read back.
pub(crate) fn share(
    communicator: &dyn Communicator,
    commands: Vec<(String, Command)>,
) -> Result<Vec<(String, Command)>, String> {
    if communicator.size() == 1 {
        return Ok(commands);
    }
    let mut bytes = if communicator.rank() == 0 {
        serde_json::to_vec(&commands).unwrap_or_default()
    } else {
        Vec::new()
    };
    communicator.broadcast(0, &mut bytes);
    // Every rank reads the same bytes, rank 0 too: what one cannot read, none obeys.
    let text = std::str::from_utf8(&bytes)
        .map_err(|error| format!("commands were lost between ranks: {error}"))?;
    parse_json(text, "broadcast")
        .map_err(|error| format!("commands were lost between ranks: {error}"))
}
