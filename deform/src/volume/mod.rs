//! Carrying the motion of the boundary into the volume.
//!
//! A [`VolumeOperator`] is set up once from the reference mesh and then answers any number of boundary motions.

mod settings;

pub use settings::{Deform, Method};

use crate::mesh::{CellType, Mesh, Vector};

/// The operator that carries boundary motion into the volume of one reference mesh. Set up once, immutable afterwards.
#[derive(Debug)]
pub struct VolumeOperator {
    vertex_count: usize,
    boundary: Vec<u32>,
}

/// The displacement of every vertex of a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeSolution {
    /// The displacement of each mesh vertex, from the reference.
    pub displacement: Vec<Vector>,
    /// How many iterations the solve took; with several solves (harmonic), the most of any.
    pub iterations: usize,
    /// The relative residual reached.
    pub residual: f64,
}

impl VolumeOperator {
    /// Sets up the operator of `mesh` as it lies, where the displacement of the vertices `boundary` will be prescribed.
    ///
    /// # Errors
    /// [`VolumeError`].
    pub fn new(mesh: &Mesh, boundary: &[u32], settings: &Deform) -> Result<Self, VolumeError> {
        settings.validate()?;
        Ok(Self { vertex_count: mesh.points().len(), boundary: boundary.to_vec() })
    }

    /// The displacement of every vertex for these displacements of the boundary vertices, one for each of `boundary`.
    ///
    /// # Errors
    /// [`VolumeError`].
    pub fn solve(&self, boundary_displacement: &[Vector]) -> Result<VolumeSolution, VolumeError> {
        if boundary_displacement.len() != self.boundary.len() {
            return Err(VolumeError::BoundaryCount {
                found: boundary_displacement.len(),
                expected: self.boundary.len(),
            });
        }
        let mut displacement = vec![[0.0; 3]; self.vertex_count];
        for (&vertex, &value) in self.boundary.iter().zip(boundary_displacement) {
            displacement[vertex as usize] = value;
        }
        Ok(VolumeSolution { displacement, iterations: 0, residual: 0.0 })
    }
}

/// Why a volume could not be deformed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeError {
    /// A setting is out of its range.
    #[error("deform.{name} is {value}; it must be {expected}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// What was found.
        value: f64,
        /// What is allowed.
        expected: &'static str,
    },
    /// A cell of the reference mesh is flat or turned inside out.
    #[error(
        "cell {cell} ({cell_type}) at ({:.6}, {:.6}, {:.6}) has no positive volume in the reference mesh; {count} such \
         cell(s) in all",
        centroid[0], centroid[1], centroid[2]
    )]
    InvertedCell {
        /// The first such cell.
        cell: usize,
        /// Its type.
        cell_type: CellType,
        /// The mean of its vertices.
        centroid: Vector,
        /// How many there are.
        count: usize,
    },
    /// A boundary vertex that the mesh does not have.
    #[error("boundary vertex {vertex} does not exist; the mesh has {vertex_count} vertices, numbered from 0")]
    BoundaryVertex {
        /// The vertex.
        vertex: u32,
        /// How many the mesh has.
        vertex_count: usize,
    },
    /// A boundary vertex that is listed more than once.
    #[error("boundary vertex {vertex} is listed more than once")]
    BoundaryTwice {
        /// The vertex.
        vertex: u32,
    },
    /// Cells that hang together with no boundary vertex, so that nothing says where they go.
    #[error("vertex {vertex} belongs to cells that no boundary vertex holds; {count} such vertices in all")]
    Unattached {
        /// The first such vertex.
        vertex: usize,
        /// How many there are.
        count: usize,
    },
    /// Another number of displacements than there are boundary vertices.
    #[error("{found} boundary displacements given for {expected} boundary vertices")]
    BoundaryCount {
        /// How many were given.
        found: usize,
        /// How many there are.
        expected: usize,
    },
    /// A displacement that is NaN or infinite, or too large to compute with.
    #[error("the displacement of boundary vertex {vertex} is {value:?}; it must be finite")]
    NotFinite {
        /// The vertex.
        vertex: u32,
        /// Its displacement.
        value: Vector,
    },
    /// The linear solve failed.
    #[error(transparent)]
    Linear(#[from] crate::linear::LinearError),
}
