//! A mesh, or a part of one.

use std::sync::Arc;

use super::{Cells, Mesh, SharedVertices};
use crate::communicator::{Communicator, Halo, Solo};

/// A mesh, or one rank's part of a mesh: with the communicator of the ranks, and the vertices that
/// they share.
///
/// Each cell belongs to one rank, which alone has it; a vertex on the border between parts is held
/// by several. All that is done with a domain of several ranks is collective: all ranks call it, in
/// the same order, with their own parts, and all get the same outcome. A mesh by itself is a domain
/// of one process. To clone a domain copies no arrays.
///
/// ```
/// use tombolo_deform::{mesh::Domain, quality::quality, shapes::box_of_tets};
///
/// let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
/// let domain = Domain::from(&mesh);
/// assert!(domain.owns(0) && domain.communicator().size() == 1);
/// assert_eq!(quality(mesh.cells(), mesh.points()), quality(mesh.cells(), mesh.points()).gathered(&domain));
/// ```
#[derive(Debug, Clone)]
pub struct Domain {
    mesh: Mesh,
    halo: Halo,
    part: Option<Arc<PartOf>>,
}

/// The place of a part in the whole mesh.
#[derive(Debug)]
struct PartOf {
    /// The numbers of its cells in the whole mesh.
    cell_numbers: Vec<u64>,
    /// Its faces on the boundary of the whole mesh.
    boundary_faces: Cells,
}

impl Domain {
    /// The part that `mesh` is of a whole one. `cell_numbers` are those of its cells in the whole
    /// mesh, `boundary_faces` its faces on the boundary of that.
    #[must_use]
    pub fn of_rank(
        mesh: Mesh,
        shared: &SharedVertices,
        cell_numbers: Vec<u64>,
        boundary_faces: Cells,
    ) -> Self {
        Self {
            mesh,
            halo: shared.halo().clone(),
            part: Some(Arc::new(PartOf { cell_numbers, boundary_faces })),
        }
    }

    /// The part, or the mesh itself.
    #[must_use]
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The part with its vertices elsewhere; `mesh` has the same cells.
    #[must_use]
    pub fn with_mesh(&self, mesh: Mesh) -> Self {
        Self { mesh, halo: self.halo.clone(), part: self.part.clone() }
    }

    /// The part with another way to speak to the same ranks.
    pub(crate) fn among(&self, communicator: Arc<dyn Communicator>) -> Self {
        Self { halo: self.halo.among(communicator), ..self.clone() }
    }

    /// The ranks.
    #[must_use]
    pub fn communicator(&self) -> &Arc<dyn Communicator> {
        self.halo.communicator()
    }

    /// The vertices that other ranks have too.
    #[must_use]
    pub fn halo(&self) -> &Halo {
        &self.halo
    }

    /// Whether this rank owns a vertex: exactly one of those that have it does.
    #[must_use]
    pub fn owns(&self, vertex: u32) -> bool {
        self.halo.owns(vertex as usize)
    }

    /// The number of a cell in the whole mesh.
    #[must_use]
    pub fn cell_number(&self, cell: usize) -> usize {
        let number = self.part.as_ref().and_then(|part| part.cell_numbers.get(cell));
        number.and_then(|&number| usize::try_from(number).ok()).unwrap_or(cell)
    }

    /// The faces of the part on the boundary of the whole mesh; `None` where all are that belong to
    /// one cell.
    #[must_use]
    pub fn boundary_faces(&self) -> Option<&Cells> {
        self.part.as_ref().map(|part| &part.boundary_faces)
    }
}

impl From<Mesh> for Domain {
    fn from(mesh: Mesh) -> Self {
        Self { mesh, halo: Halo::alone(Arc::new(Solo)), part: None }
    }
}

impl From<&Mesh> for Domain {
    fn from(mesh: &Mesh) -> Self {
        mesh.clone().into()
    }
}

impl From<Arc<Mesh>> for Domain {
    fn from(mesh: Arc<Mesh>) -> Self {
        (*mesh).clone().into()
    }
}

impl From<&Arc<Mesh>> for Domain {
    fn from(mesh: &Arc<Mesh>) -> Self {
        (**mesh).clone().into()
    }
}

impl From<&Domain> for Domain {
    fn from(domain: &Domain) -> Self {
        domain.clone()
    }
}
