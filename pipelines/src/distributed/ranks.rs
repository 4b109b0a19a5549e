//! The parts of a mesh as the geometry kernel knows them.

use std::{fmt, sync::Arc};

use tombolo_deform::{
    mesh::Cells,
    partition::{Neighbour, Partition, Reduction},
};

use super::{PartBoundary, SharedVertices};
use crate::communicator::Communicator;

/// The [`Partition`] of a mesh of which each rank of a communicator has a part. What the kernel does with it is collective: all ranks
/// do it, on the thread from which the communicator may be used.
#[derive(Clone)]
pub struct Ranks {
    communicator: Arc<dyn Communicator>,
    shared: Arc<SharedVertices>,
    boundary_faces: Cells,
    cell_numbers: Vec<u64>,
}

impl Ranks {
    /// `cell_numbers` are those in the whole mesh of the cells that the kernel is given.
    #[must_use]
    pub fn new(
        communicator: Arc<dyn Communicator>,
        shared: Arc<SharedVertices>,
        boundary: &PartBoundary,
        cell_numbers: Vec<u64>,
    ) -> Self {
        Self { communicator, shared, boundary_faces: boundary.faces().faces.clone(), cell_numbers }
    }

    /// The vertices that ranks share.
    #[must_use]
    pub fn shared(&self) -> &SharedVertices {
        &self.shared
    }
}

impl fmt::Debug for Ranks {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (rank, ranks) = (self.communicator.rank(), self.communicator.size());
        formatter
            .debug_struct("Ranks")
            .field("rank", &rank)
            .field("ranks", &ranks)
            .finish_non_exhaustive()
    }
}

fn to_bytes(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn from_bytes(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|value| f64::from_le_bytes(*value)).collect()
}

impl Partition for Ranks {
    fn rank(&self) -> usize {
        self.communicator.rank()
    }

    fn ranks(&self) -> usize {
        self.communicator.size()
    }

    fn reduce(&self, reduction: Reduction, values: &mut [f64]) {
        self.communicator.reduce(reduction, values);
    }

    fn gather(&self, values: &[f64]) -> Vec<f64> {
        let mut all = self.communicator.gather(0, &to_bytes(values)).unwrap_or_default().concat();
        self.communicator.broadcast(0, &mut all);
        from_bytes(&all)
    }

    fn exchange(&self, messages: Vec<(usize, Vec<f64>)>) -> Vec<(usize, Vec<f64>)> {
        let messages = messages.into_iter().map(|(to, values)| (to, to_bytes(&values))).collect();
        let heard = self.communicator.exchange(messages);
        heard.into_iter().map(|(from, bytes)| (from, from_bytes(&bytes))).collect()
    }

    fn exchange_with(
        &self,
        messages: Vec<(usize, Vec<f64>)>,
        from: &[usize],
    ) -> Vec<(usize, Vec<f64>)> {
        let messages = messages.into_iter().map(|(to, values)| (to, to_bytes(&values))).collect();
        let heard = self.communicator.exchange_with(messages, from);
        heard.into_iter().map(|(from, bytes)| (from, from_bytes(&bytes))).collect()
    }

    fn owns(&self, vertex: u32) -> bool {
        self.shared.owns(vertex)
    }

    fn neighbours(&self) -> &[Neighbour] {
        self.shared.neighbours()
    }

    fn cell_number(&self, cell: usize) -> usize {
        self.cell_numbers.get(cell).and_then(|&number| usize::try_from(number).ok()).unwrap_or(cell)
    }

    fn boundary_faces(&self) -> Option<&Cells> {
        Some(&self.boundary_faces)
    }
}
