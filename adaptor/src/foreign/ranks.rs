//! The processes that run together, and how they agree about what each was given.

use std::sync::Arc;

use serde::Serialize;
use serde::de::DeserializeOwned;
use tombolo_deform::communicator::{Communicator, Reduction, Solo, first_failure};

use crate::fingerprint::hash;
use crate::foreign::error::{Kind, RunError};

/// In place of a communicator's handle: all ranks there are, with MPI or without.
#[cfg(feature = "distributed")]
const WORLD: i32 = -1;

/// The communicator of this Fortran handle; without one or with -1, MPI's world where MPI runs,
/// else this process by itself.
///
/// # Errors
/// [`RunError::Configuration`] where the handle is that of no usable communicator.
///
/// # Safety
/// The handle is -1, or one that MPI gave out and that has not been freed, or that of
/// `MPI_COMM_NULL`.
#[cfg(feature = "distributed")]
pub unsafe fn communicator(handle: Option<i32>) -> Result<Arc<dyn Communicator>, RunError> {
    use crate::mpi;
    let unusable =
        |error: mpi::MpiError| RunError::Configuration(format!("the communicator: {error}"));
    match handle.filter(|&handle| handle != WORLD) {
        // SAFETY: the caller's promise; a null one is told.
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

/// This process by itself, as this is built without the feature `distributed`.
///
/// # Errors
/// [`RunError::Configuration`] where several ranks run.
///
/// # Safety
/// None is needed here; with the feature `distributed` the handle must be one that MPI gave out.
#[cfg(not(feature = "distributed"))]
pub unsafe fn communicator(_: Option<i32>) -> Result<Arc<dyn Communicator>, RunError> {
    let size = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MV2_COMM_WORLD_SIZE"]
        .into_iter()
        .find_map(|name| std::env::var(name).ok()?.parse::<usize>().ok());
    match size {
        Some(size) if size > 1 => Err(RunError::Configuration(format!(
            "{size} ranks run, but this library was built without MPI; expected a build with the feature 'distributed'"
        ))),
        _ => Ok(Arc::new(Solo)),
    }
}

/// Goes on where all ranks can; where one cannot, all get its error. Collective.
///
/// # Errors
/// The error of the lowest rank that has one, on all ranks.
pub fn agree<T>(ranks: &dyn Communicator, mine: Result<T, RunError>) -> Result<T, RunError> {
    agree_and_ask(ranks, mine, false, 0).map(|(mine, _)| mine)
}

/// Goes on where all ranks can and have the same text, or all have none. Collective.
///
/// # Errors
/// As [`agree`]; on all ranks [`RunError::Wrong`] of this path where they have others.
pub fn agree_on(
    ranks: &dyn Communicator,
    mine: Result<Option<String>, RunError>,
    path: &str,
) -> Result<Option<String>, RunError> {
    let choice = mine.as_ref().ok().and_then(Option::as_deref).map_or(0, choice_of);
    match agree_and_ask(ranks, mine, false, choice) {
        Err(RunError::Choices) => {
            Err(RunError::wrong(path, "another one on other ranks, or none", "the same on all"))
        }
        agreed => agreed.map(|(mine, _)| mine),
    }
}

/// In place of a choice: this rank is at the end of the run.
pub(super) const ENDING: u64 = u64::MAX;

/// A number by which ranks compare what they choose: never 0, which is no choice.
pub(super) fn choice_of(text: &str) -> u64 {
    hash(text.bytes()).max(1)
}

/// Goes on where all ranks can; says too whether any rank says yes, and is an error where not all
/// have the same `choice`: [`RunError::Choices`], or [`RunError::Ending`] where some are at the
/// end.
pub(super) fn agree_and_ask<T>(
    ranks: &dyn Communicator,
    mine: Result<T, RunError>,
    yes: bool,
    choice: u64,
) -> Result<(T, bool), RunError> {
    if ranks.size() == 1 {
        return mine.map(|mine| (mine, yes));
    }
    let mut said = [u64::from(mine.is_err()), u64::from(yes), choice, u64::MAX - choice];
    ranks.reduce_integers(Reduction::Maximum, &mut said);
    let [failing, any, highest, lowest] = said;
    let told = mine.as_ref().err().map(|error| {
        let mut told = vec![error.kind() as u8, u8::from(error.is_failure())];
        told.extend_from_slice(error.to_string().as_bytes());
        told
    });
    let failure = if failing > 0 { first_failure(ranks, 0, told) } else { None };
    let Some((rank, bytes)) = failure else {
        if highest != u64::MAX - lowest {
            return Err(if highest == ENDING { RunError::Ending } else { RunError::Choices });
        }
        return mine.map(|mine| (mine, any > 0));
    };
    // On the rank itself its own error says it all.
    match mine {
        Err(error) if rank == ranks.rank() => Err(error),
        _ => {
            let (told, message) = bytes.split_at_checked(2).unwrap_or_default();
            let kinds = [Kind::Configuration, Kind::Mesh, Kind::Step, Kind::Failure];
            let is_of = |kind: &Kind| told.first() == Some(&(*kind as u8));
            Err(RunError::Rank {
                rank,
                message: String::from_utf8_lossy(message).into_owned(),
                kind: kinds.into_iter().find(is_of).unwrap_or(Kind::Failure),
                is_failure: told.last() == Some(&1),
            })
        }
    }
}

/// Whether any rank that has something says yes of it. Collective.
pub(super) fn ask<T, E>(
    ranks: &dyn Communicator,
    mine: Result<T, E>,
    is_so: impl Fn(&T) -> bool,
) -> (Result<T, E>, bool) {
    let any = ranks.any(mine.as_ref().is_ok_and(is_so));
    (mine, any)
}

/// The values of all ranks, in their order. Collective.
pub(super) fn gathered<O: DeserializeOwned>(
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

/// The names of all ranks' channels, in the order of their ranks and there in their own.
/// Collective.
#[must_use]
pub fn union(ranks: &dyn Communicator, own: &[&str]) -> Vec<String> {
    let mut bytes = own.join("\n").into_bytes();
    // Most often all have the same.
    let hash = hash(bytes.iter().copied());
    let mut spread = [hash, u64::MAX - hash];
    ranks.reduce_integers(Reduction::Minimum, &mut spread);
    if spread[0] == u64::MAX - spread[1] {
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

#[cfg(test)]
mod tests {
    use tombolo_deform::communicator::threads;

    use super::*;

    #[test]
    fn what_one_rank_alone_is_given_is_an_error_on_all() {
        let agreed = |given: [Option<&str>; 2]| {
            threads::run(2, |ranks| {
                let mine = given[ranks.rank()].map(str::to_owned);
                agree_on(&ranks, Ok(mine), "a/path").map_err(|error| error.to_string())
            })
        };
        assert_eq!(agreed([None, None]), [Ok(None), Ok(None)]);
        let both = agreed([Some("file"), Some("file")]);
        assert!(
            both.iter().all(|mine| mine.as_ref().is_ok_and(|mine| mine.as_deref() == Some("file")))
        );
        for given in [[Some("file"), None], [None, Some("file")], [Some("file"), Some("other")]] {
            let said = agreed(given);
            let expected =
                "'a/path': found another one on other ranks, or none; expected the same on all";
            assert!(
                said.iter().all(|said| said.as_ref().is_err_and(|it| it == expected)),
                "{said:?}"
            );
        }
    }
}
