//! Meshes of which each rank has a part.
//!
//! Each rank describes its own [`Part`]: points, cells, where features come from, and what it knows of the whole, which may be
//! nothing: vertices then belong together that lie at the same place. Out of that the ranks find together
//!
//! - [`SharedVertices`]: which vertices other ranks have too, who owns each, and a number for each in the whole mesh;
//! - [`PartBoundary`]: the boundary of the whole mesh, gathered on rank 0, and the way there and back for what lives on it.
//!
//! Ranks speak to those that they share vertices with, and once, to find these out, to those that the vertices' names are dealt
//! out to. No rank but 0 holds more than its part, and rank 0 the surface besides.
//!
//! Every error is the same on all ranks: before anything is done that would make one wait for another, they agree that all have
//! come so far ([`agree`](crate::communicator::agree)).

mod boundary;
mod cut;
mod message;
mod places;
mod ranks;
mod shared;
#[cfg(test)]
pub(crate) mod tests;

use tombolo_deform::{
    mesh::{Cells, FeatureSource, MeshError, MeshView, Vector},
    number::{Number, Position},
    surface::SurfaceError,
};

pub use boundary::PartBoundary;
pub(crate) use message::{Reader, Writer};
pub use ranks::Ranks;
pub use shared::SharedVertices;
pub use tombolo_deform::partition::Neighbour;

use crate::communicator::RankError;

/// By how much coordinates of one vertex may differ from rank to rank, as a fraction of the diagonal of the whole mesh's bounding
/// box, where vertices are matched by their places.
pub const TOLERANCE: f64 = 1e-9;

/// What a rank has of a mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Part {
    /// The coordinates of each vertex.
    pub points: Vec<Vector>,
    /// The cells.
    pub cells: Cells,
    /// Where the features come from; said by the rank that has the cell of a face.
    pub features: FeatureSource,
    /// The vertices' numbers in the whole mesh, if the solver knows them: then on all ranks that have vertices.
    pub global_vertices: Option<Vec<u64>>,
    /// The same of the cells.
    pub global_cells: Option<Vec<u64>>,
    /// For each cell whether it is a copy of another rank's; `None`: none is.
    pub ghosts: Option<Vec<bool>>,
}

impl Part {
    /// A copy of what a solver shows, checked.
    ///
    /// # Errors
    /// As [`MeshView::to_mesh`], and [`MeshError::ArrayLength`] for as many numbers or ghost marks as there are not vertices or
    /// cells.
    pub fn of(view: &MeshView) -> Result<Self, MeshError> {
        let mesh = view.to_mesh()?;
        let (vertices, cells) = (mesh.points().len(), mesh.cells().len());
        let fits = |name: &str, found: usize, expected: usize| {
            if found == expected {
                Ok(())
            } else {
                Err(MeshError::ArrayLength { name: name.into(), found, expected })
            }
        };
        let numbers = |name: &str, indices: &tombolo_deform::mesh::Indices, expected: usize| {
            fits(name, indices.len(), expected)?;
            Ok((0..expected).map(|index| indices.get(index)).collect::<Vec<u64>>())
        };
        let global_vertices = view
            .global_vertices
            .as_ref()
            .map(|ids| numbers("global vertices", ids, vertices))
            .transpose()?;
        let global_cells = view
            .global_cells
            .as_ref()
            .map(|ids| numbers("global cells", ids, cells))
            .transpose()?;
        if let Some(ghosts) = view.ghost_cells {
            fits("ghost cells", ghosts.len(), cells)?;
        }
        Ok(Self {
            points: mesh.points().to_vec(),
            cells: mesh.cells().clone(),
            features: mesh.features().clone(),
            global_vertices,
            global_cells,
            ghosts: view.ghost_cells.map(<[bool]>::to_vec),
        })
    }

    /// Whether a cell is a copy of another rank's.
    #[must_use]
    pub fn is_ghost(&self, cell: usize) -> bool {
        self.ghosts.as_ref().is_some_and(|ghosts| ghosts.get(cell).is_some_and(|&ghost| ghost))
    }

    /// The cells that are this rank's own, with the vertices of the part.
    #[must_use]
    pub fn own_cells(&self) -> Cells {
        self.cells.subset((0..self.cells.len()).filter(|&cell| !self.is_ghost(cell)))
    }
}

/// Why the parts do not make a mesh. The same on all ranks.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DistributedError {
    /// A rank cannot go on; the others have no fault.
    #[error(transparent)]
    Rank(#[from] RankError),
    /// What a rank said cannot be understood.
    #[error("what rank {rank} said cannot be read; the ranks must all run the same program")]
    Garbled {
        /// The rank.
        rank: usize,
    },
    /// A cell, coordinate or face is wrong.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// A cell or coordinate is wrong.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Some ranks number their vertices, others do not.
    #[error(
        "there are vertices without global numbers here, but rank {other} gives global numbers; expected them on all ranks, or on none"
    )]
    Numbers {
        /// A rank that does.
        other: usize,
    },
    /// A rank has two vertices of one global number.
    #[error(
        "vertices {vertices:?} have the same global number {number}; expected each number once on a rank"
    )]
    NumberTwice {
        /// The number.
        number: u64,
        /// The vertices.
        vertices: [u32; 2],
    },
    /// A vertex of another rank could be one of two.
    #[error(
        "vertices {vertices:?} both lie at {}, where another rank has a vertex too; places do not tell which is meant: \
         give global vertex numbers",
        Position(*place)
    )]
    Ambiguous {
        /// Where.
        place: Vector,
        /// The vertices.
        vertices: [u32; 2],
    },
    /// A tolerance that is none.
    #[error("the tolerance is {}; expected a small fraction of the mesh's diagonal, from 0 to 0.01", Number(*.0))]
    Tolerance(f64),
    /// More than two cells have a face.
    #[error(
        "the face of the vertices {vertices:?} (by global numbers) belongs to {count} cells of the ranks {ranks:?}; a face belongs to at \
         most two: are ghost cells not marked?"
    )]
    SharedFace {
        /// Its vertices.
        vertices: Vec<u32>,
        /// The ranks that have them.
        ranks: Vec<usize>,
        /// How many cells.
        count: usize,
    },
    /// More vertices than can be numbered.
    #[error("{vertices} vertices in one mesh; at most {} can be numbered", u32::MAX)]
    TooLarge {
        /// How many there are.
        vertices: u64,
    },
}
