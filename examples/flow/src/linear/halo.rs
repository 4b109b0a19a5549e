//! What one rank's rows need of the other ranks.

use std::fmt;
use std::sync::Arc;

use tombolo_pipelines::communicator::{Communicator, RankError, Reduction, Solo, agree};
use tombolo_pipelines::distributed::SharedVertices;

/// A value that stands at a vertex, as numbers.
pub trait Values: Copy {
    /// How many bytes it takes.
    const BYTES: usize;
    /// Appends it to a message.
    fn write(&self, message: &mut Vec<u8>);
    /// Reads it back from as many bytes.
    fn read(bytes: &[u8]) -> Self;
}

impl Values for f64 {
    const BYTES: usize = 8;
    fn write(&self, message: &mut Vec<u8>) {
        message.extend(self.to_le_bytes());
    }
    fn read(bytes: &[u8]) -> Self {
        bytes.first_chunk().map_or(f64::NAN, |eight| f64::from_le_bytes(*eight))
    }
}

impl Values for [f64; 3] {
    const BYTES: usize = 24;
    fn write(&self, message: &mut Vec<u8>) {
        self.iter().for_each(|value| value.write(message));
    }
    fn read(bytes: &[u8]) -> Self {
        std::array::from_fn(|component| bytes.get(8 * component..).map_or(f64::NAN, f64::read))
    }
}

/// The rows that this rank computes, the vertices beyond them whose values it gets from the ranks that do, and sums over all ranks.
///
/// A rank's vertices are numbered so that those it owns come first; they are its rows. On one process every vertex is owned, and
/// nothing here does anything.
pub struct Halo {
    communicator: Arc<dyn Communicator>,
    /// The rank that owns each vertex.
    owners: Vec<u32>,
    rows: usize,
    swaps: Vec<Swap>,
}

/// What goes to and comes from another rank: vertices in the same order on both.
struct Swap {
    rank: usize,
    send: Vec<u32>,
    receive: Vec<u32>,
}

impl Halo {
    /// One process that owns `vertices` vertices.
    #[must_use]
    pub fn alone(vertices: usize) -> Self {
        Self {
            communicator: Arc::new(Solo),
            owners: vec![0; vertices],
            rows: vertices,
            swaps: Vec::new(),
        }
    }

    /// A rank whose vertices are `order` in the numbers of its part, those that it owns first.
    #[must_use]
    pub fn new(
        communicator: Arc<dyn Communicator>,
        shared: &SharedVertices,
        order: &[u32],
    ) -> Self {
        let own = communicator.rank();
        let mut numbers = vec![0_u32; order.len()];
        (0..).zip(order).for_each(|(number, &vertex)| numbers[vertex as usize] = number);
        let owner = |vertex: u32| shared.owners()[vertex as usize] as usize;
        let owned_by = |rank: usize, vertices: &[u32]| -> Vec<u32> {
            vertices
                .iter()
                .filter(|&&vertex| owner(vertex) == rank)
                .map(|&vertex| numbers[vertex as usize])
                .collect()
        };
        let swaps = shared.neighbours().iter().map(|neighbour| Swap {
            rank: neighbour.rank,
            send: owned_by(own, &neighbour.vertices),
            receive: owned_by(neighbour.rank, &neighbour.vertices),
        });
        Self {
            swaps: swaps
                .filter(|swap| !(swap.send.is_empty() && swap.receive.is_empty()))
                .collect(),
            owners: order.iter().map(|&vertex| shared.owners()[vertex as usize]).collect(),
            rows: shared.owned(),
            communicator,
        }
    }

    /// How many vertices this rank owns: they are the first.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// How many vertices this rank has.
    #[must_use]
    pub fn vertices(&self) -> usize {
        self.owners.len()
    }

    /// How many ranks there are.
    #[must_use]
    pub fn ranks(&self) -> usize {
        self.communicator.size()
    }

    /// This rank's number.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.communicator.rank()
    }

    /// Whether a triangle that other ranks may have too is counted here: by the lowest of the ranks that own its corners, which
    /// has all cells around that corner, and so the triangle.
    #[must_use]
    pub fn counts(&self, triangle: &[u32; 3]) -> bool {
        let owner = triangle.iter().filter_map(|&vertex| self.owners.get(vertex as usize)).min();
        owner.is_some_and(|&owner| owner as usize == self.communicator.rank())
    }

    /// Gives the vertices of other ranks the values that their owners have. Collective.
    pub fn update<T: Values>(&self, values: &mut [T]) {
        if self.communicator.size() == 1 {
            return;
        }
        let messages = self.swaps.iter().filter(|swap| !swap.send.is_empty()).map(|swap| {
            let mut message = Vec::with_capacity(T::BYTES * swap.send.len());
            swap.send.iter().for_each(|&vertex| values[vertex as usize].write(&mut message));
            (swap.rank, message)
        });
        for (from, message) in self.communicator.exchange(messages.collect()) {
            let Some(swap) = self.swaps.iter().find(|swap| swap.rank == from) else { continue };
            for (&vertex, bytes) in swap.receive.iter().zip(message.chunks_exact(T::BYTES)) {
                values[vertex as usize] = T::read(bytes);
            }
        }
    }

    /// The sums over all ranks, added in a fixed order. Collective.
    #[must_use]
    pub fn sum<const N: usize>(&self, mut values: [f64; N]) -> [f64; N] {
        self.add(&mut values);
        values
    }

    /// Adds up each value over all ranks, in a fixed order. Collective.
    pub fn add(&self, values: &mut [f64]) {
        if self.communicator.size() > 1 {
            self.communicator.reduce(Reduction::Sum, values);
        }
    }

    /// The largest over all ranks. Collective.
    #[must_use]
    pub fn maximum(&self, value: f64) -> f64 {
        let mut values = [value];
        if self.communicator.size() > 1 {
            self.communicator.reduce(Reduction::Maximum, &mut values);
        }
        values[0]
    }

    /// Goes on where all ranks can; elsewhere all have the error of the lowest that cannot. Collective.
    ///
    /// # Errors
    /// On one process its own error; on several a [`RankError`], the same on all.
    pub fn agree<T, E: ToString + From<RankError>>(&self, mine: Result<T, E>) -> Result<T, E> {
        if self.communicator.size() == 1 { mine } else { Ok(agree(&*self.communicator, mine)?) }
    }
}

impl fmt::Debug for Halo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Halo")
            .field("rank", &self.communicator.rank())
            .field("rows", &self.rows)
            .field("vertices", &self.owners.len())
            .field("neighbours", &self.swaps.iter().map(|swap| swap.rank).collect::<Vec<_>>())
            .finish_non_exhaustive()
    }
}
