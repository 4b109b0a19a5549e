//! One linear system of the ranks, as PETSc solves it.

use std::{
    fmt,
    ptr::null_mut,
    sync::{Arc, Mutex},
};

use tombolo_deform::{
    communicator::{Communicator, Halo, Reduction},
    linear::{
        Convergence, LinearError, LinearSolver, Multigrid, MultigridSettings, SparseMatrix,
        Tolerance,
    },
    mesh::Vector,
};

use super::{
    Preconditioning, assembled,
    library::Library,
    numbering::Numbering,
    shell,
    sys::{self, PetscInt},
    vector::{done, largest},
};
use crate::lock::lock;

const ITERATIONS: PetscInt = 5000;

/// How much larger than the tolerance the last correction may be, as in the kernel's own solvers,
/// and how often a solve goes on because it is.
const CORRECTION: f64 = 10.0;
const ROUNDS: usize = 6;

/// PETSc's objects; null where they are not made yet.
struct Handles {
    matrix: sys::Mat,
    solver: sys::KSP,
    preconditioner: sys::PC,
    right_side: sys::Vec,
    solution: sys::Vec,
    /// Two more vectors to work with.
    rest: sys::Vec,
    correction: sys::Vec,
}

// SAFETY: PETSc's objects are bound to no thread; the mutex around them keeps calls apart, and the
// library's promise is that calls come from one thread.
unsafe impl Send for Handles {}

impl Drop for Handles {
    fn drop(&mut self) {
        if !Library::is_alive() {
            return;
        }
        // SAFETY: each is null, which is allowed, or an object made here that nobody else has;
        // PETSc and MPI are there.
        unsafe {
            sys::KSPDestroy(&raw mut self.solver);
            sys::MatDestroy(&raw mut self.matrix);
            for vector in
                [&mut self.right_side, &mut self.solution, &mut self.rest, &mut self.correction]
            {
                sys::VecDestroy(vector);
            }
        }
    }
}

/// A symmetric positive definite system whose matrix is the sum of the ranks'.
pub(super) struct System<const B: usize> {
    // Dropped before the library.
    handles: Mutex<Handles>,
    numbering: Numbering,
    method: Method<B>,
    rows: usize,
    library: Arc<Library>,
}

/// The matrix and the preconditioner of conjugate gradients.
#[derive(Debug)]
enum Method<const B: usize> {
    /// The kernel's matrix and cycle.
    Multigrid(Box<Multigrid<B>>),
    /// PETSc's, of an assembled matrix.
    IncompleteCholesky,
    /// The positions of the unknowns, for rigid bodies.
    Gamg(Arc<[Vector]>),
    Jacobi,
}

impl<const B: usize> fmt::Debug for System<B> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("System").field("rows", &self.rows).finish_non_exhaustive()
    }
}

impl<const B: usize> System<B> {
    /// Collective.
    pub(super) fn new(
        library: Arc<Library>,
        matrix: Arc<SparseMatrix<B>>,
        halo: &Halo,
        positions: &[Vector],
        preconditioning: Option<Preconditioning>,
    ) -> Result<Self, LinearError> {
        let numbering = Numbering::new(halo, matrix.rows())?;
        let quickest = || Preconditioning::quickest(numbering.total, halo.communicator().size());
        let method = match preconditioning.unwrap_or_else(quickest) {
            Preconditioning::Multigrid => {
                let settings =
                    MultigridSettings { max_iterations: 300, ..MultigridSettings::default() };
                let multigrid =
                    Multigrid::distributed(halo.clone(), Arc::clone(&matrix), settings)?;
                Method::Multigrid(Box::new(multigrid))
            }
            Preconditioning::IncompleteCholesky => Method::IncompleteCholesky,
            Preconditioning::Gamg => Method::Gamg(positions.into()),
            Preconditioning::Jacobi => Method::Jacobi,
        };
        Self::with_method(library, numbering, method, &matrix)
    }

    fn with_method(
        library: Arc<Library>,
        numbering: Numbering,
        method: Method<B>,
        matrix: &SparseMatrix<B>,
    ) -> Result<Self, LinearError> {
        let handles = Handles {
            matrix: null_mut(),
            solver: null_mut(),
            preconditioner: null_mut(),
            right_side: null_mut(),
            solution: null_mut(),
            rest: null_mut(),
            correction: null_mut(),
        };
        let system =
            Self { handles: Mutex::new(handles), numbering, method, rows: matrix.rows(), library };
        system.set_up(matrix)?;
        Ok(system)
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        reason = "that there are no more equations than 32 bits count is seen to where they are numbered"
    )]
    fn set_up(&self, matrix: &SparseMatrix<B>) -> Result<(), LinearError> {
        let numbering = &self.numbering;
        let block = B as PetscInt;
        let size = block * numbering.owned.len() as PetscInt;
        let handles = &mut *lock(&self.handles);
        let comm = self.library.communicator();
        // SAFETY: PETSc is initialized for as long as the library is held, and writes handles where
        // it is told to.
        unsafe {
            done(sys::VecCreateMPI(comm, size, -1, &raw mut handles.right_side))?;
            done(sys::VecSetBlockSize(handles.right_side, block))?;
            for vector in
                [&raw mut handles.solution, &raw mut handles.rest, &raw mut handles.correction]
            {
                done(sys::VecDuplicate(handles.right_side, vector))?;
            }
        }
        let blocked = if B == 1 { c"aij" } else { c"baij" };
        match &self.method {
            Method::Multigrid(_) => shell::create::<B>(numbering, comm, &mut handles.matrix)?,
            Method::Gamg(positions) => {
                assembled::assemble(numbering, matrix, c"aij", comm, &mut handles.matrix)?;
                if B == 3 {
                    assembled::turn_as_bodies(numbering, positions, handles.matrix, handles.rest)?;
                }
            }
            Method::IncompleteCholesky | Method::Jacobi => {
                assembled::assemble(numbering, matrix, blocked, comm, &mut handles.matrix)?;
            }
        }
        self.precondition(handles, comm)
    }

    fn precondition(
        &self,
        handles: &mut Handles,
        comm: mpi::ffi::MPI_Comm,
    ) -> Result<(), LinearError> {
        let name = match self.method {
            Method::Multigrid(_) => c"shell",
            Method::IncompleteCholesky => c"bjacobi",
            Method::Gamg(_) => c"gamg",
            Method::Jacobi => c"pbjacobi",
        };
        // SAFETY: the matrix is made; handles are written before they are used; the sub-solvers are
        // those of a block Jacobi preconditioner that is set up, and belong to it.
        unsafe {
            done(sys::KSPCreate(comm, &raw mut handles.solver))?;
            done(sys::KSPSetType(handles.solver, c"cg".as_ptr()))?;
            done(sys::KSPSetOperators(handles.solver, handles.matrix, handles.matrix))?;
            done(sys::KSPSetNormType(handles.solver, sys::KSP_NORM_UNPRECONDITIONED))?;
            done(sys::KSPGetPC(handles.solver, &raw mut handles.preconditioner))?;
            done(sys::PCSetType(handles.preconditioner, name.as_ptr()))?;
            if matches!(self.method, Method::Multigrid(_)) {
                shell::precondition::<B>(handles.preconditioner)?;
            }
            done(sys::KSPSetUp(handles.solver))?;
            if matches!(self.method, Method::IncompleteCholesky) {
                let (mut count, mut first, mut solvers) = (0, 0, null_mut());
                done(sys::PCBJacobiGetSubKSP(
                    handles.preconditioner,
                    &raw mut count,
                    &raw mut first,
                    &raw mut solvers,
                ))?;
                for index in 0..count as usize {
                    let mut own = null_mut();
                    let solver = *solvers.add(index);
                    done(sys::KSPSetType(solver, c"preonly".as_ptr()))?;
                    done(sys::KSPGetPC(solver, &raw mut own))?;
                    // A factor of nothing is more than PETSc can bear.
                    let factor = if self.numbering.owned.is_empty() { c"none" } else { c"icc" };
                    done(sys::PCSetType(own, factor.as_ptr()))?;
                }
                done(sys::KSPSetUpOnBlocks(handles.solver))?;
            }
        }
        Ok(())
    }

    /// Solves, and goes on until the last correction is small too.
    fn iterate(
        &self,
        handles: &Handles,
        tolerance: Tolerance,
        whole: f64,
    ) -> Result<Convergence, LinearError> {
        let Handles { matrix, solver, preconditioner, right_side, solution, rest, correction } =
            *handles;
        let mut convergence = Convergence::default();
        let mut target = (tolerance.relative * whole).max(tolerance.absolute);
        for _ in 0..ROUNDS {
            let (mut count, mut reason, mut norm) = (0, 0, 0.0);
            // SAFETY: all objects are set up, of the same sizes.
            unsafe {
                done(sys::KSPSetTolerances(
                    solver,
                    1e-300,
                    target,
                    sys::PETSC_DEFAULT,
                    ITERATIONS,
                ))?;
                done(sys::KSPSetInitialGuessNonzero(solver, 1))?;
                done(sys::KSPSolve(solver, right_side, solution))?;
                done(sys::KSPGetIterationNumber(solver, &raw mut count))?;
                done(sys::KSPGetConvergedReason(solver, &raw mut reason))?;
                done(sys::KSPGetResidualNorm(solver, &raw mut norm))?;
            }
            convergence.iterations += usize::try_from(count).unwrap_or_default();
            convergence.residual = norm / whole;
            if reason <= 0 {
                let Convergence { iterations, residual } = convergence;
                return Err(if norm.is_finite() {
                    LinearError::NotConverged { iterations, residual, tolerance: target / whole }
                } else {
                    LinearError::NotFinite { iteration: iterations }
                });
            }
            if norm <= tolerance.absolute || norm == 0.0 {
                break;
            }
            // SAFETY: as above.
            unsafe {
                done(sys::MatMult(matrix, solution, rest))?;
                done(sys::VecAYPX(rest, -1.0, right_side))?;
                done(sys::PCApply(preconditioner, rest, correction))?;
            }
            let mut sizes = [largest(solution)?, largest(correction)?];
            self.numbering.communicator().reduce(Reduction::Maximum, &mut sizes);
            let allowed = CORRECTION * tolerance.relative * sizes[0];
            if sizes[1] <= allowed {
                break;
            }
            target = norm * (0.5 * allowed / sizes[1]).clamp(0.01, 0.5);
            if target < tolerance.absolute {
                break;
            }
        }
        Ok(convergence)
    }
}

impl<const B: usize> LinearSolver<B> for System<B> {
    fn unknowns(&self) -> usize {
        self.rows
    }

    fn solve_from(
        &self,
        right_side: &[[f64; B]],
        solution: &mut [[f64; B]],
        tolerance: Tolerance,
    ) -> Result<Convergence, LinearError> {
        assert!(
            right_side.len() == self.rows && solution.len() == self.rows,
            "one value for each unknown"
        );
        let handles = &*lock(&self.handles);
        let numbering = &self.numbering;
        let mut summed = right_side.to_vec();
        numbering.sum(&mut summed);
        let own = numbering.owned.iter().flat_map(|&unknown| summed[unknown as usize]);
        let mut square = [own.map(|value| value * value).sum::<f64>()];
        numbering.communicator().reduce(Reduction::Sum, &mut square);
        let whole = square[0].sqrt();
        if !whole.is_finite() {
            return Err(LinearError::NotFinite { iteration: 0 });
        }
        if whole <= tolerance.absolute || whole == 0.0 {
            solution.fill([0.0; B]);
            return Ok(Convergence::default());
        }
        numbering.put(&summed, handles.right_side)?;
        numbering.put(solution, handles.solution)?;
        let work = || self.iterate(handles, tolerance, whole);
        let convergence = match &self.method {
            Method::Multigrid(multigrid) => {
                let objects = (handles.matrix, handles.preconditioner);
                match shell::with_context(objects, numbering, multigrid, 1.0 / whole, work) {
                    // It can do without the cycle.
                    Err(LinearError::NotConverged { .. }) => {
                        return multigrid.solve_from(right_side, solution, tolerance);
                    }
                    outcome => outcome?,
                }
            }
            Method::IncompleteCholesky | Method::Gamg(_) | Method::Jacobi => work()?,
        };
        numbering.update(handles.solution, solution)?;
        Ok(convergence)
    }

    fn renewed(
        &self,
        matrix: Arc<SparseMatrix<B>>,
    ) -> Result<Box<dyn LinearSolver<B>>, LinearError> {
        let method = match &self.method {
            Method::Multigrid(multigrid) => {
                Method::Multigrid(Box::new(multigrid.of_like_matrix(Arc::clone(&matrix))?))
            }
            Method::IncompleteCholesky => Method::IncompleteCholesky,
            Method::Gamg(positions) => Method::Gamg(Arc::clone(positions)),
            Method::Jacobi => Method::Jacobi,
        };
        Ok(Box::new(Self::with_method(
            Arc::clone(&self.library),
            self.numbering.clone(),
            method,
            &matrix,
        )?))
    }
}
