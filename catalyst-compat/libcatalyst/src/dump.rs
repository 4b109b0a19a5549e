//! The files in which the stub keeps the nodes that it gets: what they are called, and whether a directory holds all of a run.
//!
//! `initialize_params.conduit_bin.SIZE.RANK`, `execute_invcN_params.conduit_bin.SIZE.RANK` with N from 0, and
//! `finalize_params.conduit_bin.SIZE.RANK`; beside each its schema, whose name ends in `_json`.

use std::fs;
use std::path::{Path, PathBuf};

/// A call whose node is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// `catalyst_initialize`.
    Initialize,
    /// `catalyst_execute`, with its number from 0.
    Execute(u64),
    /// `catalyst_finalize`.
    Finalize,
}

/// The file of a call on one rank.
#[must_use]
pub fn path(directory: &Path, stage: Stage, (rank, size): (i32, i32)) -> PathBuf {
    let call = match stage {
        Stage::Initialize => "initialize".to_owned(),
        Stage::Execute(number) => format!("execute_invc{number}"),
        Stage::Finalize => "finalize".to_owned(),
    };
    directory.join(format!("{call}_params.conduit_bin.{size}.{rank}"))
}

/// The call and the number of ranks in a file's name; `None` for files of another kind.
fn parse(name: &str) -> Option<(Stage, i32)> {
    let (call, ranks) = name.split_once("_params.conduit_bin.")?;
    let (size, rank) = ranks.split_once('.')?;
    let _: i32 = rank.parse().ok()?;
    let stage = match call {
        "initialize" => Stage::Initialize,
        "finalize" => Stage::Finalize,
        _ => Stage::Execute(call.strip_prefix("execute_invc")?.parse().ok()?),
    };
    Some((stage, size.parse().ok()?))
}

/// Sees that a directory holds a whole run on `size` ranks; gives how many times it executed.
///
/// # Errors
/// The directory cannot be read, holds a run on another number of ranks, or lacks a call of a rank.
pub fn check(directory: &Path, size: i32) -> Result<u64, String> {
    let unreadable = |error| format!("'{}' cannot be read: {error}", directory.display());
    let (mut initialized, mut executed, mut finalized, mut executions) = (0_u64, 0_u64, 0_u64, 0_u64);
    for entry in fs::read_dir(directory).map_err(unreadable)? {
        let name = entry.map_err(unreadable)?.file_name();
        let Some((stage, ranks)) = name.to_str().and_then(parse) else {
            continue;
        };
        if ranks != size {
            return Err(format!("'{}' holds a run on {ranks} ranks; this one has {size}", directory.display()));
        }
        match stage {
            Stage::Initialize => initialized += 1,
            Stage::Finalize => finalized += 1,
            Stage::Execute(number) => {
                executed += 1;
                executions = executions.max(number.saturating_add(1));
            }
        }
    }
    let ranks = u64::from(size.unsigned_abs());
    for (call, found, wanted) in [
        ("initialize", initialized, ranks),
        ("execute", executed, ranks.saturating_mul(executions).max(ranks)),
        ("finalize", finalized, ranks),
    ] {
        if found != wanted {
            return Err(format!(
                "'{}' holds {found} nodes of {call} where a run on {size} ranks leaves {wanted}",
                directory.display()
            ));
        }
    }
    Ok(executions)
}
