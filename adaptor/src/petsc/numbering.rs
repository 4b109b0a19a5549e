//! Which equation of PETSc's is whose.

use std::sync::Arc;

use tombolo_deform::{
    communicator::{Communicator, Halo, Reader},
    linear::LinearError,
};

use super::{
    sys::{self, PetscInt},
    vector::{read, write},
};

/// The unknowns of this rank among those of all.
#[derive(Debug, Clone)]
pub(super) struct Numbering {
    pub(super) halo: Halo,
    /// The number of each unknown of this rank among those of all.
    pub(super) numbers: Arc<[PetscInt]>,
    /// The unknowns that this rank owns, in the order of their numbers.
    pub(super) owned: Arc<[u32]>,
    /// How many there are in all.
    pub(super) total: usize,
}

impl Numbering {
    /// Collective.
    pub(super) fn new(halo: &Halo, unknowns: usize) -> Result<Self, LinearError> {
        let communicator = halo.communicator();
        let owned: Vec<u32> =
            (0..).take(unknowns).filter(|&entry: &u32| halo.owns(entry as usize)).collect();
        let counts = communicator.gather_all(&(owned.len() as u64).to_le_bytes());
        let counts = counts
            .iter()
            .enumerate()
            .map(|(rank, count)| Reader::new(rank, count).u64().unwrap_or(0));
        let counts: Vec<u64> = counts.collect();
        let first: u64 = counts.iter().take(communicator.rank()).sum();
        let total: u64 = counts.iter().sum();
        // Each unknown has three equations at most.
        let (Ok(total), Ok(_)) = (usize::try_from(total), PetscInt::try_from(3 * total)) else {
            return Err(LinearError::Library { name: "PETSc", code: 56 });
        };
        let mut numbers = vec![0; unknowns];
        for (&entry, number) in owned.iter().zip(first..) {
            numbers[entry as usize] = number;
        }
        halo.update(1, &mut numbers);
        let numbers = numbers
            .into_iter()
            .map(|number| PetscInt::try_from(number).unwrap_or(PetscInt::MAX))
            .collect();
        Ok(Self { halo: halo.clone(), numbers, owned: owned.into(), total })
    }

    pub(super) fn communicator(&self) -> &Arc<dyn Communicator> {
        self.halo.communicator()
    }

    /// Adds up what the ranks have of each unknown. Collective.
    pub(super) fn sum<const B: usize>(&self, values: &mut [[f64; B]]) {
        self.halo.sum(B, values.as_flattened_mut());
    }

    /// Values of this rank's unknowns from those that it owns in a vector of PETSc's. Collective.
    pub(super) fn update<const B: usize>(
        &self,
        vector: sys::Vec,
        values: &mut [[f64; B]],
    ) -> Result<(), LinearError> {
        read(vector, |own| {
            for (&unknown, own) in self.owned.iter().zip(own.as_chunks().0) {
                values[unknown as usize] = *own;
            }
        })?;
        self.halo.update(B, values.as_flattened_mut());
        Ok(())
    }

    /// The values that this rank owns, to a vector of PETSc's.
    pub(super) fn put<const B: usize>(
        &self,
        values: &[[f64; B]],
        vector: sys::Vec,
    ) -> Result<(), LinearError> {
        let own: Vec<f64> =
            self.owned.iter().flat_map(|&unknown| values[unknown as usize]).collect();
        write(vector, &own)
    }
}
