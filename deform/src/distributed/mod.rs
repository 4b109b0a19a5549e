//! Meshes of which each rank has a part.
//!
//! Each rank describes its own [`Part`]: points, cells, where features come from, and what it knows
//! of the whole, which may be nothing: vertices then belong together that lie at the same point.
//! Out of that the ranks find together
//!
//! - [`SharedVertices`](crate::mesh::SharedVertices): which vertices other ranks have too, who owns
//!   each, and a number for each in the whole mesh;
//! - [`PartBoundary`]: the boundary of the whole mesh, gathered on rank 0, and the way there and
//!   back for what lives on it.
//!
//! Ranks speak to those that they share vertices with, and once, to find these out, to those that
//! the vertices' names are dealt out to. No rank but 0 holds more than its part, and rank 0 the
//! surface besides.
//!
//! Every error is the same on all ranks: before anything is done that would make one wait for
//! another, they agree that all have come so far ([`agree`](crate::communicator::agree)).

mod assembly;
mod boundary;
mod cut;
mod domain;
mod find;
mod grids;
mod handedness;
mod positions;
// Ranks are threads, which WebAssembly does not have.
#[cfg(all(test, not(target_family = "wasm")))]
pub(crate) mod tests;

use crate::{
    bounds::Bounds,
    mesh::{CellType, Cells, FeatureSource, MeshError, MeshView, Vector, ghosts},
    number::Number,
    surface::SurfaceError,
    vector::Position,
};

pub use assembly::Root;
pub use boundary::PartBoundary;
pub use cut::in_order;
pub use domain::domain;

use crate::communicator::{Garbled, RankError};

/// By how much coordinates of one vertex may differ from rank to rank, as a fraction of the
/// diagonal of the whole mesh's bounding box, where vertices are matched by their positions.
pub const TOLERANCE: f64 = 1e-9;

/// The part that a rank has of a mesh.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Part {
    /// The coordinates of each vertex.
    pub points: Vec<Vector>,
    /// The cells.
    pub cells: Cells,
    /// Where the features come from; said by the rank that has the cell of a face.
    pub features: FeatureSource,
    /// The vertices' numbers in the whole mesh, if the solver knows them: then on all ranks that
    /// have vertices.
    pub global_vertices: Option<Vec<u64>>,
    /// The cells' numbers in the whole mesh, if the solver knows them: then on all ranks that have
    /// cells.
    pub global_cells: Option<Vec<u64>>,
    /// The bits of each cell's `vtkGhostType` ([`ghosts`]); `None`: all cells are this rank's own.
    pub ghosts: Option<Vec<u8>>,
    /// The boxes that the grids of the whole mesh fill, where it is of several levels
    /// ([`MeshView::grid_boxes`]).
    pub grid_boxes: Vec<Bounds>,
}

impl Part {
    /// A copy of what a solver shows, checked.
    ///
    /// # Errors
    /// As [`MeshView::to_mesh`], and [`MeshError::ArrayLength`] for as many numbers or ghost marks
    /// as there are not vertices or cells.
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
        let numbers = |name: &str, indices: &crate::mesh::Indices, expected: usize| {
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
            ghosts: view.ghost_cells.map(<[u8]>::to_vec),
            grid_boxes: view.grid_boxes.to_vec(),
        })
    }

    /// The bits of a cell's `vtkGhostType`.
    #[must_use]
    pub fn ghost_bits(&self, cell: usize) -> u8 {
        self.ghosts.as_ref().and_then(|bits| bits.get(cell)).copied().unwrap_or(0)
    }

    /// Whether a cell is this rank's own: no copy of another rank's, and not hidden.
    #[must_use]
    pub fn is_own(&self, cell: usize) -> bool {
        ghosts::is_own(self.ghost_bits(cell))
    }

    /// The cells whose bits do not fulfil a condition; `None` where all do.
    fn left_out(&self, is_in: impl Fn(u8) -> bool) -> Option<Vec<bool>> {
        let left_out =
            |bits: &Vec<u8>| bits.iter().map(|&bits| !is_in(bits)).collect::<Vec<bool>>();
        self.ghosts.as_ref().map(left_out).filter(|left_out| left_out.contains(&true))
    }

    /// The cells that are this rank's own, with the vertices of the part.
    #[must_use]
    pub fn own_cells(&self) -> Cells {
        self.cells.subset((0..self.cells.len()).filter(|&cell| self.is_own(cell)))
    }
}

/// Why the parts do not make a mesh. The same on all ranks.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DistributedError {
    /// A rank cannot go on; the others have no fault.
    #[error(transparent)]
    Rank(#[from] RankError),
    /// A message of another rank cannot be read.
    #[error(transparent)]
    Garbled(#[from] Garbled),
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
        "vertices {vertices:?} both lie at {}, where another rank has a vertex too; positions do not tell which is meant: \
         give global vertex numbers",
        Position(*position)
    )]
    Ambiguous {
        /// Where.
        position: Vector,
        /// The vertices.
        vertices: [u32; 2],
    },
    /// Cells run one way round on one rank and the other way on another.
    #[error(
        "cells of type {cell_type} are left-handed on rank {left} and right-handed on rank {right}; expected their vertices in one \
         order on all ranks"
    )]
    Hands {
        /// Their type.
        cell_type: CellType,
        /// The lowest rank most of whose cells of that type are left-handed.
        left: usize,
        /// The lowest rank where they are not.
        right: usize,
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
