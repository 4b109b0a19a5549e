//! The processes that run together, and how they agree about what each was given.

use std::sync::Arc;

use serde::Serialize;
use serde::de::DeserializeOwned;
use tombolo::comm::Communicator;
use tombolo::pipelines::communicator::Reduction;

use crate::error::{CatalystError, Status};

/// In place of a communicator's handle: all ranks there are, with MPI or without.
#[cfg(feature = "distributed")]
const WORLD: i32 = -1;

/// The communicator of this Fortran handle; without one or with -1, MPI's world where MPI runs, else this process by itself.
#[cfg(feature = "distributed")]
pub(crate) fn communicator(handle: Option<i32>) -> Result<Arc<dyn Communicator>, CatalystError> {
    use tombolo::comm::{Solo, mpi};
    let unusable =
        |error: mpi::MpiError| CatalystError::Configuration(format!("the communicator: {error}"));
    match handle.filter(|&handle| handle != WORLD) {
        // SAFETY: Catalyst's blueprint says that `catalyst/mpi_comm` is the handle of a live communicator; a null one is told.
        Some(handle) => Ok(Arc::new(unsafe { mpi::Mpi::from_fortran(handle) }.map_err(unusable)?)),
        None => {
            use mpi::rsmpi::environment::{is_finalized, is_initialized};
            if !is_initialized() || is_finalized() {
                return Ok(Arc::new(Solo));
            }
            // SAFETY: the world is alive between MPI's initialization and its end.
            let world = unsafe { mpi::Mpi::from_raw(mpi::rsmpi::ffi::RSMPI_COMM_WORLD) };
            Ok(Arc::new(world.map_err(unusable)?))
        }
    }
}

/// This process by itself: built without the feature `distributed`.
#[cfg(not(feature = "distributed"))]
pub(crate) fn communicator(_: Option<i32>) -> Result<Arc<dyn Communicator>, CatalystError> {
    let size = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MV2_COMM_WORLD_SIZE"]
        .into_iter()
        .find_map(|name| std::env::var(name).ok()?.parse::<usize>().ok());
    match size {
        Some(size) if size > 1 => Err(CatalystError::Configuration(format!(
            "{size} ranks run, but this library was built without MPI; expected a build with the feature 'distributed'"
        ))),
        _ => Ok(Arc::new(tombolo::comm::Solo)),
    }
}

/// Goes on where all ranks can; where one cannot, all get its error with its status. Collective.
pub(crate) fn agree<T>(
    ranks: &dyn Communicator,
    mine: Result<T, CatalystError>,
) -> Result<T, CatalystError> {
    agree_and_ask(ranks, mine, false, 0).map(|(mine, _)| mine)
}

/// The same; says too whether any rank says yes, and is an error where not all have the same `choice` of pipelines.
pub(crate) fn agree_and_ask<T>(
    ranks: &dyn Communicator,
    mine: Result<T, CatalystError>,
    yes: bool,
    choice: u32,
) -> Result<(T, bool), CatalystError> {
    if ranks.size() == 1 {
        return mine.map(|mine| (mine, yes));
    }
    #[expect(clippy::cast_precision_loss, reason = "ranks below 2^53")]
    let (own, none) = (ranks.rank() as f64, ranks.size() as f64);
    let choice = f64::from(choice);
    let mut first =
        [if mine.is_err() { own } else { none }, if yes { -1.0 } else { 0.0 }, choice, -choice];
    ranks.reduce(Reduction::Minimum, &mut first);
    if first[0] >= none {
        if first[2] != -first[3] {
            return Err(CatalystError::Choices);
        }
        return mine.map(|mine| (mine, first[1] < 0.0));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a rank")]
    let rank = first[0] as usize;
    let mut bytes = match &mine {
        Err(error) => format!("{} {error}", error.status() as i32).into_bytes(),
        Ok(_) => Vec::new(),
    };
    ranks.broadcast(rank, &mut bytes);
    // On the rank itself its own error says it all.
    match mine {
        Err(error) if rank == ranks.rank() => Err(error),
        _ => {
            let told = String::from_utf8_lossy(&bytes).into_owned();
            let (status, message) = told.split_once(' ').unwrap_or(("100", told.as_str()));
            let status = if status == "102" { Status::Failed } else { Status::InvalidNode };
            Err(CatalystError::Rank { rank, message: message.into(), status })
        }
    }
}

/// Whether any rank that has something says yes of it. Collective.
pub(crate) fn ask<T, E>(
    ranks: &dyn Communicator,
    mine: Result<T, E>,
    is_so: impl Fn(&T) -> bool,
) -> (Result<T, E>, bool) {
    let mut any = [f64::from(u8::from(mine.as_ref().is_ok_and(is_so)))];
    ranks.reduce(Reduction::Maximum, &mut any);
    (mine, any[0] > 0.0)
}

/// What all ranks have, in their order. Collective.
pub(crate) fn gathered<O: DeserializeOwned>(
    ranks: &dyn Communicator,
    own: &impl Serialize,
) -> Vec<O> {
    let mut bytes = Vec::new();
    if let Some(parts) = ranks.gather(0, &serde_json::to_vec(own).unwrap_or_default()) {
        let lists = parts.iter().map(|part| serde_json::from_slice(part).unwrap_or_default());
        let all: Vec<serde_json::Value> =
            lists.flat_map(|list: Vec<serde_json::Value>| list).collect();
        bytes = serde_json::to_vec(&all).unwrap_or_default();
    }
    ranks.broadcast(0, &mut bytes);
    serde_json::from_slice(&bytes).unwrap_or_default()
}

/// The names of all ranks' channels, in the order of their ranks and there in their own. Collective.
pub(crate) fn union(ranks: &dyn Communicator, own: &[&str]) -> Vec<String> {
    let mut bytes = own.join("\n").into_bytes();
    // Most often all have the same.
    let hash = bytes.iter().fold(bytes.len() as u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let mut spread = [f64::from((hash >> 32) as u32 ^ hash as u32), 0.0];
    spread[1] = -spread[0];
    ranks.reduce(Reduction::Minimum, &mut spread);
    if spread[0] == -spread[1] {
        return own.iter().map(|name| (*name).to_owned()).collect();
    }
    if let Some(all) = ranks.gather(0, &bytes) {
        let mut names: Vec<String> = Vec::new();
        for part in &all {
            for name in String::from_utf8_lossy(part).lines() {
                if !names.iter().any(|known| known == name) {
                    names.push(name.to_owned());
                }
            }
        }
        bytes = names.join("\n").into_bytes();
    }
    ranks.broadcast(0, &mut bytes);
    String::from_utf8_lossy(&bytes).lines().map(str::to_owned).collect()
}
