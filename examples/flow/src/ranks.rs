//! What all ranks find out together.

use tombolo_deform::communicator::{Communicator, RankError, Reduction, agree};

/// The sums over all ranks, added in a fixed order. Collective.
#[must_use]
pub fn total<const N: usize>(communicator: &dyn Communicator, mut values: [f64; N]) -> [f64; N] {
    communicator.reduce(Reduction::Sum, &mut values);
    values
}

/// The largest over all ranks. Collective.
#[must_use]
pub fn largest(communicator: &dyn Communicator, value: f64) -> f64 {
    let mut values = [value];
    communicator.reduce(Reduction::Maximum, &mut values);
    values[0]
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
