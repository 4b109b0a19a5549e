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
/// A text that begins with the words of Catalyst's own program, by which scripts know what is wrong: the directory cannot be read,
/// holds a run on another number of ranks, or lacks a call of a rank.
pub fn check(directory: &Path, size: i32) -> Result<u64, String> {
    let place = directory.display();
    if directory.as_os_str().is_empty() {
        return Err("ERROR: Empty data_dump_directory path detected.".to_owned());
    }
    let unreadable = |error| format!("ERROR: Error opening directory {place}: {error}");
    let (mut initialized, mut executed, mut finalized, mut executions) =
        (0_u64, 0_u64, 0_u64, 0_u64);
    for entry in fs::read_dir(directory).map_err(unreadable)? {
        let name = entry.map_err(unreadable)?.file_name();
        let Some((stage, ranks)) = name.to_str().and_then(parse) else {
            continue;
        };
        if ranks != size {
            return Err(format!(
                "ERROR: Mismatch in the number of ranks: '{place}' holds a run on {ranks}; catalyst_replay runs on {size}."
            ));
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
    let found = format!(
        "'{place}' holds {initialized} of initialize, {executed} of execute, {finalized} of finalize"
    );
    if initialized == 0 || executed == 0 || finalized == 0 {
        return Err(format!("ERROR: Missing node data for at least one stage: {found}."));
    }
    let ranks = u64::from(size.unsigned_abs());
    if initialized != ranks || finalized != ranks {
        return Err(format!(
            "ERROR: Mismatch in the number of calls to initialize or finalize: {found}; a run on {size} ranks leaves {ranks} \
             of each."
        ));
    }
    let expected = ranks.saturating_mul(executions);
    if executed != expected {
        return Err(format!(
            "ERROR: Unexpected number of calls to execute: {found}; {executions} steps on {size} ranks leave {expected}."
        ));
    }
    Ok(executions)
}
