//! Which equation of PETSc's is whose.

use std::sync::Arc;

use tombolo_deform::{
    linear::LinearError,
    partition::{Partition, Shares},
};

use super::{
    sys::{self, PetscInt},
    vector::{read, write},
};

/// The unknowns of this rank among those of all.
#[derive(Debug, Clone)]
pub(super) struct Numbering {
    partition: Arc<dyn Partition>,
    pub(super) shares: Shares,
    /// The number of each unknown of this rank among those of all.
    pub(super) numbers: Arc<[PetscInt]>,
    /// The unknowns that this rank speaks for, in the order of their numbers.
    pub(super) owned: Arc<[u32]>,
    /// How many there are in all.
    pub(super) total: usize,
}

impl Numbering {
    /// Collective.
    pub(super) fn new(
        partition: Arc<dyn Partition>,
        vertices: &[u32],
    ) -> Result<Self, LinearError> {
        let shares = Shares::new(&*partition, vertices);
        let owned: Vec<u32> = (0..)
            .zip(vertices)
            .map(|(place, _)| place)
            .filter(|&place| shares.owns(place as usize))
            .collect();
        #[expect(clippy::cast_precision_loss, reason = "counts below 2^53")]
        let counts = partition.gather(&[owned.len() as f64]);
        let first: f64 = counts.iter().take(partition.rank()).sum();
        let total: f64 = counts.iter().sum();
        if 3.0 * total >= f64::from(PetscInt::MAX) {
            return Err(LinearError::Library { name: "PETSc", code: 56 });
        }
        let mut numbers = vec![0.0; vertices.len()];
        for (&place, index) in owned.iter().zip(0_u32..) {
            numbers[place as usize] = first + f64::from(index);
        }
        shares.sum(&*partition, 1, &mut numbers);
        #[expect(clippy::cast_possible_truncation, reason = "checked above")]
        let numbers = numbers.into_iter().map(|number| number as PetscInt).collect();
        Ok(Self { partition, shares, numbers, owned: owned.into(), total: total as usize })
    }

    pub(super) fn partition(&self) -> &Arc<dyn Partition> {
        &self.partition
    }

    /// Adds up what the ranks have of each unknown. Collective.
    pub(super) fn sum<const B: usize>(&self, values: &mut [[f64; B]]) {
        self.shares.sum(&*self.partition, B, values.as_flattened_mut());
    }

    /// Values of this rank's unknowns from those that it speaks for in a vector of PETSc's. Collective.
    pub(super) fn spread<const B: usize>(
        &self,
        vector: sys::Vec,
        values: &mut [[f64; B]],
    ) -> Result<(), LinearError> {
        values.iter_mut().for_each(|value| *value = [0.0; B]);
        read(vector, |own| {
            for (&place, own) in self.owned.iter().zip(own.as_chunks().0) {
                values[place as usize] = *own;
            }
        })?;
        self.sum(values);
        Ok(())
    }

    /// The values that this rank speaks for, to a vector of PETSc's.
    pub(super) fn put<const B: usize>(
        &self,
        values: &[[f64; B]],
        vector: sys::Vec,
    ) -> Result<(), LinearError> {
        let own: Vec<f64> = self.owned.iter().flat_map(|&place| values[place as usize]).collect();
        write(vector, &own)
    }
}
