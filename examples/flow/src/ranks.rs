//! What all ranks find out together.

use tombolo_deform::communicator::{Communicator, RankError, Reduction, agree};

/// The sums over all ranks, added in a fixed order. Collective.
#[must_use]
pub fn total<const N: usize>(communicator: &dyn Communicator, mut values: [f64; N]) -> [f64; N] {
    communicator.reduce(Reduction::Sum, &mut values);
    values
}

/// Goes on where all ranks can; elsewhere all have the error of the lowest that cannot. Collective.
///
/// # Errors
/// On one process its own error; on several a [`RankError`], the same on all.
pub fn agreed<T, E: ToString + From<RankError>>(
    communicator: &dyn Communicator,
    mine: Result<T, E>,
) -> Result<T, E> {
    if communicator.size() == 1 { mine } else { Ok(agree(communicator, mine)?) }
}

/// How many threads this rank uses that is not told otherwise: the cores that it may run on, shared
/// out evenly among the ranks that may run on the same. Collective.
#[must_use]
pub fn threads(communicator: &dyn Communicator) -> usize {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let own = affinity();
    share_of(cores, &own, &communicator.gather_all(&own))
}

/// The share of one rank of the cores that it may run on, by its affinity and that of all ranks.
///
/// ```
/// use tombolo_flow::ranks::share_of;
///
/// // Two that are bound to cores of their own, and two that are not, on another machine.
/// let affinities = ["one 0-7", "one 8-15", "two 0-15", "two 0-15"];
/// assert_eq!(share_of(8, &affinities[0], &affinities), 8);
/// assert_eq!(share_of(16, &affinities[2], &affinities), 8);
/// assert_eq!(share_of(1, &affinities[3], &affinities), 1);
/// ```
#[must_use]
pub fn share_of<A: PartialEq>(cores: usize, affinity: &A, affinities: &[A]) -> usize {
    let sharers = affinities.iter().filter(|other| *other == affinity).count();
    (cores / sharers.max(1)).max(1)
}

/// The machine and those of its cores that this process may run on; nothing where that is not known.
fn affinity() -> Vec<u8> {
    let read = |file: &str| std::fs::read_to_string(file).unwrap_or_default();
    let status = read("/proc/self/status");
    let cores = status.lines().find(|line| line.starts_with("Cpus_allowed_list"));
    (read("/proc/sys/kernel/hostname") + cores.unwrap_or_default()).into_bytes()
}
