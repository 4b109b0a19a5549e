//! PETSc's solvers for the motion of a volume that several ranks have parts of.
//!
//! [`Petsc::solvers`] is a choice of solvers for [`Settings::solvers`](crate::Settings::solvers):
//! conjugate gradients of PETSc on the solver's own parts, with one of several
//! [`Preconditioning`]s.
//!
//! ```no_run
//! use std::sync::Arc;
//! use tombolo::{Settings, mpi::{Mpi, rsmpi}, petsc::Petsc};
//!
//! let universe = rsmpi::initialize().ok_or("MPI was initialized before")?;
//! let settings = Settings {
//!     solvers: Petsc::solvers(&universe.world(), None)?,
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

use std::sync::Arc;

use mpi::{ffi::MPI_Comm, traits::AsRaw};
use tombolo_deform::{
    communicator::Halo,
    linear::{Solver, Solvers, SparseMatrix},
    mesh::Vector,
};

use library::Library;
pub use library::PetscError;
use system::System;

/// The preconditioner of conjugate gradients.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Preconditioning {
    /// A V-cycle of the kernel's own multigrid over all ranks: see
    /// [`Multigrid`](tombolo_deform::linear::Multigrid).
    Multigrid,
    /// Incomplete Cholesky without fill on each rank.
    IncompleteCholesky,
    /// PETSc's algebraic multigrid over all ranks; with rigid bodies as its near null space where
    /// three components are solved for together.
    Gamg,
    /// The diagonal.
    Jacobi,
}

/// From how many unknown vertices on V-cycles are quicker than incomplete Cholesky, on one rank and
/// on several: the benchmark `volume` measures it.
const FROM_VERTICES: [usize; 2] = [12_000, 20_000];

impl Preconditioning {
    /// The preconditioner that takes least from the first set-up to the first displacement of so
    /// many unknown vertices of all ranks together, by what was measured:
    /// [`Multigrid`](Self::Multigrid) for many, [`IncompleteCholesky`](Self::IncompleteCholesky)
    /// for few.
    #[must_use]
    pub fn quickest(vertices: usize, ranks: usize) -> Self {
        if vertices >= FROM_VERTICES[usize::from(ranks > 1)] {
            Self::Multigrid
        } else {
            Self::IncompleteCholesky
        }
    }
}

/// PETSc as a choice of solvers. It is initialized by the first one on the ranks of its
/// communicator, unless the solver has initialized it, and finalized with the last one, if it was
/// initialized here.
#[derive(Debug, Clone)]
pub struct Petsc {
    library: Arc<Library>,
    preconditioning: Option<Preconditioning>,
}

impl Petsc {
    /// PETSc on the ranks of `communicator`, which must be those of the adaptor's; without a
    /// preconditioning each system gets the [`quickest`](Preconditioning::quickest). Collective
    /// over them; the communicator stays the caller's.
    ///
    /// # Errors
    /// [`PetscError`].
    pub fn solvers(
        communicator: &impl AsRaw<Raw = MPI_Comm>,
        preconditioning: Option<Preconditioning>,
    ) -> Result<Arc<dyn Solvers>, PetscError> {
        // SAFETY: a communicator of rsmpi is alive for as long as it is borrowed.
        unsafe { Self::solvers_from_raw(communicator.as_raw(), preconditioning) }
    }

    /// PETSc on the ranks of a communicator that is given by its handle in C.
    ///
    /// # Errors
    /// [`PetscError`].
    ///
    /// # Safety
    /// `communicator` must be a handle that MPI gave out and that has not been freed.
    pub unsafe fn solvers_from_raw(
        communicator: MPI_Comm,
        preconditioning: Option<Preconditioning>,
    ) -> Result<Arc<dyn Solvers>, PetscError> {
        // SAFETY: as the caller vouches for.
        let library = Arc::new(unsafe { Library::open(communicator) }?);
        Ok(Arc::new(Self { library, preconditioning }))
    }

    fn solver<const B: usize>(
        &self,
        matrix: Arc<SparseMatrix<B>>,
        halo: &Halo,
        positions: &[Vector],
    ) -> Solver<B> {
        Ok(Box::new(System::new(
            Arc::clone(&self.library),
            matrix,
            halo,
            positions,
            self.preconditioning,
        )?))
    }
}

impl Solvers for Petsc {
    fn scalar(&self, matrix: Arc<SparseMatrix<1>>, halo: &Halo, positions: &[Vector]) -> Solver<1> {
        self.solver(matrix, halo, positions)
    }

    fn vector(&self, matrix: Arc<SparseMatrix<3>>, halo: &Halo, positions: &[Vector]) -> Solver<3> {
        self.solver(matrix, halo, positions)
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
