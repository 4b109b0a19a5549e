//! PETSc's solvers for the volume motion of meshes in parts.
//!
//! [`Petsc`] is a partition of a mesh whose linear systems PETSc solves: conjugate gradients on the solver's own parts, with one of
//! several [`Preconditioning`]s.
//!
//! ```no_run
//! use std::sync::Arc;
//! use tombolo::{Settings, comm::mpi::{Mpi, rsmpi}, distributed::Petsc};
//!
//! let universe = rsmpi::initialize().ok_or("MPI was initialized before")?;
//! let settings = Settings {
//!     solvers: Some(Petsc::solvers(&universe.world(), None)?),
//!     communicator: Arc::new(Mpi::new(&universe.world())?),
//!     ..Settings::default()
//! };
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod assembled;
mod library;
mod numbering;
mod shell;
mod sys;
mod system;
mod vector;

use std::{fmt, sync::Arc};

use mpi::{ffi::MPI_Comm, traits::AsRaw};
use tombolo_deform::{
    linear::SparseMatrix,
    mesh::{Cells, Vector},
    partition::{Neighbour, Partition, Reduction, Solver},
};
use tombolo_pipelines::distributed::Ranks;

use crate::settings::Solvers;
use library::Library;
pub use library::PetscError;
use system::System;

/// What conjugate gradients are preconditioned by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Preconditioning {
    /// A V-cycle of the kernel's own multigrid over all ranks: see
    /// [`DistributedMultigrid`](tombolo_deform::linear::DistributedMultigrid).
    Multigrid,
    /// Incomplete Cholesky without fill on each rank.
    IncompleteCholesky,
    /// PETSc's algebraic multigrid over all ranks; with rigid bodies as its near null space where three components are solved for
    /// together.
    Gamg,
    /// The diagonal.
    Jacobi,
}

/// From how many unknown vertices on V-cycles are quicker than incomplete Cholesky, on one rank and on several: the benchmark `volume`
/// measures it.
const FROM_VERTICES: [usize; 2] = [12_000, 20_000];

impl Preconditioning {
    /// The one that takes least from the first set-up to the first displacement of so many unknown vertices of all ranks together, by
    /// what was measured: [`Multigrid`](Self::Multigrid) for many, [`IncompleteCholesky`](Self::IncompleteCholesky) for few.
    #[must_use]
    pub fn quickest(vertices: usize, ranks: usize) -> Self {
        if vertices >= FROM_VERTICES[usize::from(ranks > 1)] {
            Self::Multigrid
        } else {
            Self::IncompleteCholesky
        }
    }
}

/// The [`Partition`] of a mesh whose linear systems PETSc solves. PETSc is initialized by the first one on the ranks of its
/// communicator, unless the solver has initialized it, and finalized with the last one, if it was initialized here.
#[derive(Clone)]
pub struct Petsc {
    ranks: Ranks,
    library: Arc<Library>,
    preconditioning: Option<Preconditioning>,
    /// Where the vertices of the part lie, for rigid bodies.
    points: Arc<[Vector]>,
}

impl fmt::Debug for Petsc {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Petsc")
            .field("preconditioning", &self.preconditioning)
            .finish_non_exhaustive()
    }
}

impl Petsc {
    /// What [`Settings::solvers`](crate::Settings::solvers) takes: PETSc on the ranks of `communicator`, which must be those of the
    /// adaptor's; without a preconditioning each system gets the [`quickest`](Preconditioning::quickest). Collective over them; the
    /// communicator stays the caller's.
    ///
    /// # Errors
    /// [`PetscError`].
    pub fn solvers(
        communicator: &impl AsRaw<Raw = MPI_Comm>,
        preconditioning: Option<Preconditioning>,
    ) -> Result<Solvers, PetscError> {
        // SAFETY: a communicator of rsmpi is alive for as long as it is borrowed.
        unsafe { Self::solvers_from_raw(communicator.as_raw(), preconditioning) }
    }

    /// The same by the handle of the communicator in C.
    ///
    /// # Errors
    /// [`PetscError`].
    ///
    /// # Safety
    /// `communicator` must be a handle that MPI gave out and that has not been freed.
    pub unsafe fn solvers_from_raw(
        communicator: MPI_Comm,
        preconditioning: Option<Preconditioning>,
    ) -> Result<Solvers, PetscError> {
        // SAFETY: as the caller vouches for.
        let library = Arc::new(unsafe { Library::open(communicator) }?);
        Ok(Arc::new(move |ranks, points| {
            let (library, points) = (Arc::clone(&library), points.into());
            Arc::new(Self { ranks, library, preconditioning, points })
        }))
    }

    fn system<const B: usize>(&self, matrix: &Arc<SparseMatrix<B>>, vertices: &[u32]) -> Solver<B> {
        let places: Vec<Vector> =
            vertices.iter().map(|&vertex| self.points[vertex as usize]).collect();
        let partition: Arc<dyn Partition> = Arc::new(self.ranks.clone());
        Ok(Box::new(System::new(
            Arc::clone(&self.library),
            partition,
            Arc::clone(matrix),
            vertices,
            places,
            self.preconditioning,
        )?))
    }
}

impl Partition for Petsc {
    fn rank(&self) -> usize {
        self.ranks.rank()
    }

    fn ranks(&self) -> usize {
        self.ranks.ranks()
    }

    fn reduce(&self, reduction: Reduction, values: &mut [f64]) {
        self.ranks.reduce(reduction, values);
    }

    fn gather(&self, values: &[f64]) -> Vec<f64> {
        self.ranks.gather(values)
    }

    fn exchange(&self, messages: Vec<(usize, Vec<f64>)>) -> Vec<(usize, Vec<f64>)> {
        self.ranks.exchange(messages)
    }

    fn exchange_with(
        &self,
        messages: Vec<(usize, Vec<f64>)>,
        from: &[usize],
    ) -> Vec<(usize, Vec<f64>)> {
        self.ranks.exchange_with(messages, from)
    }

    fn owns(&self, vertex: u32) -> bool {
        self.ranks.owns(vertex)
    }

    fn neighbours(&self) -> &[Neighbour] {
        self.ranks.neighbours()
    }

    fn cell_number(&self, cell: usize) -> usize {
        self.ranks.cell_number(cell)
    }

    fn boundary_faces(&self) -> Option<&Cells> {
        self.ranks.boundary_faces()
    }

    fn scalar_solver(&self, matrix: &Arc<SparseMatrix<1>>, vertices: &[u32]) -> Option<Solver<1>> {
        Some(self.system(matrix, vertices))
    }

    fn vector_solver(&self, matrix: &Arc<SparseMatrix<3>>, vertices: &[u32]) -> Option<Solver<3>> {
        Some(self.system(matrix, vertices))
    }
}

#[cfg(test)]
mod tests {
    use super::Preconditioning::{self, IncompleteCholesky, Multigrid};

    #[test]
    fn many_unknowns_are_preconditioned_by_cycles_and_few_by_a_factor() {
        for (vertices, ranks, expected) in [
            (9_000, 1, IncompleteCholesky),
            (36_000, 1, Multigrid),
            (18_000, 2, IncompleteCholesky),
            (36_000, 2, Multigrid),
        ] {
            assert_eq!(
                Preconditioning::quickest(vertices, ranks),
                expected,
                "{vertices} on {ranks}"
            );
        }
    }
}
