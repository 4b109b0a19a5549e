//! One linear system of the ranks, as PETSc solves it.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "that there are no more equations than 32 bits count is seen to where they are numbered"
)]

use std::{
    any::Any,
    ffi::CStr,
    fmt,
    os::raw::c_void,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    ptr::null_mut,
    sync::{Arc, Mutex, PoisonError},
};

use tombolo_deform::{
    linear::{Convergence, DistributedMultigrid, LinearError, LinearSolver, SparseMatrix, Tolerance},
    mesh::Vector,
    partition::{Partition, Reduction, Shares},
};

use super::{
    Preconditioning,
    library::Library,
    sys::{self, PetscInt},
};

const ITERATIONS: PetscInt = 5000;

/// How much larger than the tolerance the last correction may be, as in the kernel's own solvers, and how often a solve goes on
/// because it is.
const CORRECTION: f64 = 10.0;
const ROUNDS: usize = 6;

/// What a call of PETSc comes to.
fn done(code: sys::ErrorCode) -> Result<(), LinearError> {
    if code == 0 { Ok(()) } else { Err(LinearError::Library { name: "PETSc", code }) }
}

/// Which equation of PETSc's is whose.
#[derive(Debug, Clone)]
struct Numbering {
    shares: Shares,
    /// The number of each unknown of this rank among those of all.
    numbers: Arc<[PetscInt]>,
    /// The unknowns that this rank speaks for, in the order of their numbers.
    owned: Arc<[u32]>,
    /// How many there are in all.
    total: usize,
}

impl Numbering {
    /// Collective.
    fn new(partition: &dyn Partition, vertices: &[u32]) -> Result<Self, LinearError> {
        let shares = Shares::new(partition, vertices);
        let owned: Vec<u32> =
            (0..).zip(vertices).map(|(place, _)| place).filter(|&place| shares.owns(place as usize)).collect();
        #[expect(clippy::cast_precision_loss, reason = "counts below 2^53")]
        let counts = partition.gather(&[owned.len() as f64]);
        let first: f64 = counts.iter().take(partition.rank()).sum();
        let total: f64 = counts.iter().sum();
        if 3.0 * total >= f64::from(PetscInt::MAX) {
            return Err(LinearError::Library { name: "PETSc", code: 56 });
        }
        let mut numbers = vec![0.0; vertices.len()];
        for (&place, index) in owned.iter().zip(0_u32..) {
            numbers[place as usize] = first + f64::from(index);
        }
        shares.sum(partition, 1, &mut numbers);
        #[expect(clippy::cast_possible_truncation, reason = "checked above")]
        let numbers = numbers.into_iter().map(|number| number as PetscInt).collect();
        Ok(Self { shares, numbers, owned: owned.into(), total: total as usize })
    }
}

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

// SAFETY: PETSc's objects are bound to no thread; the mutex around them keeps calls apart, and the library's promise is that calls
// come from one thread.
unsafe impl Send for Handles {}

impl Drop for Handles {
    fn drop(&mut self) {
        if !Library::is_alive() {
            return;
        }
        // SAFETY: each is null, which is allowed, or an object made here that nobody else has; PETSc and MPI are there.
        unsafe {
            sys::KSPDestroy(&raw mut self.solver);
            sys::MatDestroy(&raw mut self.matrix);
            for vector in [&mut self.right_side, &mut self.solution, &mut self.rest, &mut self.correction] {
                sys::VecDestroy(vector);
            }
        }
    }
}

/// A symmetric positive definite system whose matrix is the sum of the ranks'.
pub(super) struct System<const B: usize> {
    // Dropped before the library.
    handles: Mutex<Handles>,
    partition: Arc<dyn Partition>,
    numbering: Numbering,
    places: Arc<[Vector]>,
    preconditioning: Preconditioning,
    multigrid: Option<DistributedMultigrid<B>>,
    rows: usize,
    library: Arc<Library>,
}

impl<const B: usize> fmt::Debug for System<B> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("System").field("preconditioning", &self.preconditioning).finish_non_exhaustive()
    }
}

impl<const B: usize> System<B> {
    /// Collective.
    pub(super) fn new(
        library: Arc<Library>,
        partition: Arc<dyn Partition>,
        matrix: Arc<SparseMatrix<B>>,
        vertices: &[u32],
        places: Vec<Vector>,
        preconditioning: Option<Preconditioning>,
    ) -> Result<Self, LinearError> {
        let numbering = Numbering::new(&*partition, vertices)?;
        let quickest = || Preconditioning::quickest(numbering.total, partition.ranks());
        let preconditioning = preconditioning.unwrap_or_else(quickest);
        let multigrid = (preconditioning == Preconditioning::Multigrid)
            .then(|| DistributedMultigrid::new(Arc::clone(&partition), Arc::clone(&matrix), vertices))
            .transpose()?;
        Self::assembled(library, partition, numbering, places.into(), preconditioning, multigrid, &matrix)
    }

    fn assembled(
        library: Arc<Library>,
        partition: Arc<dyn Partition>,
        numbering: Numbering,
        places: Arc<[Vector]>,
        preconditioning: Preconditioning,
        multigrid: Option<DistributedMultigrid<B>>,
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
        let rows = matrix.rows();
        let handles = Mutex::new(handles);
        let system = Self { handles, partition, numbering, places, preconditioning, multigrid, rows, library };
        system.set_up(matrix)?;
        Ok(system)
    }

    fn set_up(&self, matrix: &SparseMatrix<B>) -> Result<(), LinearError> {
        let Numbering { shares, numbers, owned, .. } = &self.numbering;
        let block = B as PetscInt;
        let size = block * owned.len() as PetscInt;
        // At most as many blocks in the rows of this rank as the ranks have between them, inside its own columns and beyond.
        let mut counts = vec![[0.0; 2]; matrix.rows()];
        let owner_is_that_of = |row: usize, column: u32| shares.owns(row) == shares.owns(column as usize);
        for (row, count) in counts.iter_mut().enumerate() {
            for &column in matrix.row(row).0 {
                // Two vertices of other ranks may belong to two of them: room is made for both cases.
                let same = owner_is_that_of(row, column);
                count[0] += f64::from(u8::from(same || !shares.owns(row)));
                count[1] += f64::from(u8::from(!same || !shares.owns(row)));
            }
        }
        shares.sum(&*self.partition, 2, counts.as_flattened_mut());
        let room = |of: usize| -> Vec<PetscInt> {
            let most = |count: f64| count.min(f64::from(PetscInt::MAX)) as PetscInt;
            let limit = owned.len() as PetscInt;
            let room = owned.iter().map(|&place| most(counts[place as usize][of]));
            room.map(|count| if of == 0 { count.min(limit) } else { count }).collect()
        };
        let (diagonal, off) = (room(0), room(1));
        let kind = match self.preconditioning {
            Preconditioning::Gamg => c"aij",
            _ if B == 1 => c"aij",
            _ => c"baij",
        };
        let handles = &mut *self.handles.lock().unwrap_or_else(PoisonError::into_inner);
        let comm = self.library.communicator();
        // SAFETY: PETSc is initialized for as long as the library is held. Each object is made before it is used, with sizes that
        // are those of the arrays given; PETSc copies what it is given, and writes handles where it is told to.
        unsafe {
            done(sys::MatCreate(comm, &raw mut handles.matrix))?;
            done(sys::MatSetSizes(handles.matrix, size, size, -1, -1))?;
            done(sys::MatSetType(handles.matrix, kind.as_ptr()))?;
            done(sys::MatXAIJSetPreallocation(
                handles.matrix,
                block,
                diagonal.as_ptr(),
                off.as_ptr(),
                std::ptr::null(),
                std::ptr::null(),
            ))?;
            done(sys::VecCreateMPI(comm, size, -1, &raw mut handles.right_side))?;
            done(sys::VecSetBlockSize(handles.right_side, block))?;
            for vector in [&raw mut handles.solution, &raw mut handles.rest, &raw mut handles.correction] {
                done(sys::VecDuplicate(handles.right_side, vector))?;
            }
        }
        let (mut columns, mut values) = (Vec::new(), Vec::new());
        for row in 0..matrix.rows() {
            let (of_row, blocks) = matrix.row(row);
            columns.clear();
            columns.extend(of_row.iter().map(|&column| numbers[column as usize]));
            values.clear();
            (0..B).for_each(|axis| values.extend(blocks.iter().flat_map(|block| block[axis])));
            // SAFETY: one row of blocks, as many columns as there are, and a value for each of their entries, row after row.
            done(unsafe {
                sys::MatSetValuesBlocked(
                    handles.matrix,
                    1,
                    &raw const numbers[row],
                    columns.len() as PetscInt,
                    columns.as_ptr(),
                    values.as_ptr(),
                    sys::ADD_VALUES,
                )
            })?;
        }
        // SAFETY: as above.
        unsafe {
            done(sys::MatAssemblyBegin(handles.matrix, sys::MAT_FINAL_ASSEMBLY))?;
            done(sys::MatAssemblyEnd(handles.matrix, sys::MAT_FINAL_ASSEMBLY))?;
        }
        if B == 3 && self.preconditioning == Preconditioning::Gamg {
            self.turn_as_bodies(handles)?;
        }
        self.precondition(handles, comm)
    }

    /// Tells the matrix which displacements strain nothing.
    fn turn_as_bodies(&self, handles: &Handles) -> Result<(), LinearError> {
        let owned = self.numbering.owned.iter();
        let places: Vec<f64> = owned.flat_map(|&place| self.places[place as usize]).collect();
        write(handles.rest, &places)?;
        let mut space = null_mut();
        // SAFETY: the vector has three coordinates for each block of this rank; the matrix keeps the space by itself.
        unsafe {
            done(sys::MatNullSpaceCreateRigidBody(handles.rest, &raw mut space))?;
            done(sys::MatSetNearNullSpace(handles.matrix, space))?;
            done(sys::MatNullSpaceDestroy(&raw mut space))
        }
    }

    fn precondition(&self, handles: &mut Handles, comm: mpi::ffi::MPI_Comm) -> Result<(), LinearError> {
        let name: &CStr = match self.preconditioning {
            Preconditioning::Multigrid => c"shell",
            Preconditioning::IncompleteCholesky => c"bjacobi",
            Preconditioning::Gamg => c"gamg",
            Preconditioning::Jacobi => c"pbjacobi",
        };
        // SAFETY: the matrix is assembled; handles are written before they are used; the sub-solvers are those of a block Jacobi
        // preconditioner that is set up, and belong to it.
        unsafe {
            done(sys::KSPCreate(comm, &raw mut handles.solver))?;
            done(sys::KSPSetType(handles.solver, c"cg".as_ptr()))?;
            done(sys::KSPSetOperators(handles.solver, handles.matrix, handles.matrix))?;
            done(sys::KSPSetNormType(handles.solver, sys::KSP_NORM_UNPRECONDITIONED))?;
            done(sys::KSPGetPC(handles.solver, &raw mut handles.preconditioner))?;
            done(sys::PCSetType(handles.preconditioner, name.as_ptr()))?;
            if self.preconditioning == Preconditioning::Multigrid {
                done(sys::PCShellSetApply(handles.preconditioner, apply::<B>))?;
            }
            done(sys::KSPSetUp(handles.solver))?;
            if self.preconditioning == Preconditioning::IncompleteCholesky {
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

    /// Values of this rank's unknowns from those that it speaks for in a vector of PETSc's.
    fn spread(&self, vector: sys::Vec, values: &mut [[f64; B]]) -> Result<(), LinearError> {
        values.iter_mut().for_each(|value| *value = [0.0; B]);
        read(vector, |own| {
            for (&place, own) in self.numbering.owned.iter().zip(own.as_chunks().0) {
                values[place as usize] = *own;
            }
        })?;
        self.numbering.shares.sum(&*self.partition, B, values.as_flattened_mut());
        Ok(())
    }

    /// The values that this rank speaks for, to a vector of PETSc's.
    fn put(&self, values: &[[f64; B]], vector: sys::Vec) -> Result<(), LinearError> {
        let own: Vec<f64> = self.numbering.owned.iter().flat_map(|&place| values[place as usize]).collect();
        write(vector, &own)
    }

    /// Solves, and goes on until the last correction is small too.
    fn iterate(&self, handles: &Handles, tolerance: Tolerance, whole: f64) -> Result<Convergence, LinearError> {
        let Handles { matrix, solver, preconditioner, right_side, solution, rest, correction } = *handles;
        let mut convergence = Convergence::default();
        let mut target = (tolerance.relative * whole).max(tolerance.absolute);
        for _ in 0..ROUNDS {
            let (mut count, mut reason, mut norm) = (0, 0, 0.0);
            // SAFETY: all objects are set up, of the same sizes.
            unsafe {
                done(sys::KSPSetTolerances(solver, 1e-300, target, sys::PETSC_DEFAULT, ITERATIONS))?;
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
            self.partition.reduce(Reduction::Maximum, &mut sizes);
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
        assert!(right_side.len() == self.rows && solution.len() == self.rows, "one value for each unknown");
        let handles = &*self.handles.lock().unwrap_or_else(PoisonError::into_inner);
        let mut summed = right_side.to_vec();
        self.numbering.shares.sum(&*self.partition, B, summed.as_flattened_mut());
        let own = self.numbering.owned.iter().flat_map(|&place| summed[place as usize]);
        let mut square = [own.map(|value| value * value).sum::<f64>()];
        self.partition.reduce(Reduction::Sum, &mut square);
        let whole = square[0].sqrt();
        if !whole.is_finite() {
            return Err(LinearError::NotFinite { iteration: 0 });
        }
        if whole <= tolerance.absolute || whole == 0.0 {
            solution.fill([0.0; B]);
            return Ok(Convergence::default());
        }
        self.put(&summed, handles.right_side)?;
        self.put(solution, handles.solution)?;
        let convergence = match &self.multigrid {
            None => self.iterate(handles, tolerance, whole)?,
            Some(multigrid) => multigrid.with_cycle(1.0 / whole, |cycle| {
                let values = (vec![[0.0; B]; self.rows], vec![[0.0; B]; self.rows]);
                let mut context = Context::<B> { system: self, cycle, values, panic: None };
                // SAFETY: the context lives until the solve has ended, and is taken away then.
                done(unsafe { sys::PCShellSetContext(handles.preconditioner, (&raw mut context).cast()) })?;
                let convergence = self.iterate(handles, tolerance, whole);
                // SAFETY: as above.
                done(unsafe { sys::PCShellSetContext(handles.preconditioner, null_mut()) })?;
                // Not through PETSc, but on: the other ranks wait for this one.
                if let Some(panic) = context.panic {
                    resume_unwind(panic);
                }
                convergence
            })?,
        };
        self.spread(handles.solution, solution)?;
        Ok(convergence)
    }

    fn renewed(&self, matrix: Arc<SparseMatrix<B>>) -> Result<Box<dyn LinearSolver<B>>, LinearError> {
        let multigrid =
            self.multigrid.as_ref().map(|multigrid| multigrid.of_like_matrix(Arc::clone(&matrix))).transpose()?;
        let (library, partition) = (Arc::clone(&self.library), Arc::clone(&self.partition));
        let (numbering, places) = (self.numbering.clone(), Arc::clone(&self.places));
        let renewed = Self::assembled(library, partition, numbering, places, self.preconditioning, multigrid, &matrix)?;
        Ok(Box::new(renewed))
    }
}

/// From a residual to a correction.
type Cycle<'a, const B: usize> = &'a mut dyn FnMut(&[[f64; B]], &mut [[f64; B]]);

/// What the preconditioner of a solve under way needs.
struct Context<'a, const B: usize> {
    system: &'a System<B>,
    cycle: Cycle<'a, B>,
    values: (Vec<[f64; B]>, Vec<[f64; B]>),
    /// What a cycle panicked with.
    panic: Option<Box<dyn Any + Send>>,
}

/// Applies the cycle.
///
/// # Safety
/// PETSc calls it within `KSPSolve` or `PCApply`, with the context set, on the thread that called these.
unsafe extern "C" fn apply<const B: usize>(pc: sys::PC, vector: sys::Vec, result: sys::Vec) -> sys::ErrorCode {
    /// PETSc's code for an error of the caller's.
    const USER: sys::ErrorCode = 83;
    let mut context: *mut Context<'_, B> = null_mut();
    // SAFETY: the context was set for this solve; PETSc writes the pointer where it is told to.
    let code = unsafe { sys::PCShellGetContext(pc, (&raw mut context).cast::<c_void>()) };
    // SAFETY: it lives until the solve ends, and nobody else has it meanwhile: the solve holds the handles' lock.
    let Some(context) = (unsafe { context.as_mut() }).filter(|_| code == 0) else { return USER };
    let Context { system, cycle, values: (before, after), panic } = context;
    let applied = catch_unwind(AssertUnwindSafe(|| {
        system.spread(vector, before)?;
        cycle(before, after);
        system.put(after, result)
    }));
    match applied {
        Ok(Ok(())) => 0,
        Ok(Err(_)) => USER,
        Err(reason) => {
            *panic = Some(reason);
            USER
        }
    }
}

/// Calls `work` with this rank's values of a vector.
fn read(vector: sys::Vec, work: impl FnOnce(&[f64])) -> Result<(), LinearError> {
    with_values(vector, |values| work(values))
}

fn write(vector: sys::Vec, own: &[f64]) -> Result<(), LinearError> {
    with_values(vector, |values| values.copy_from_slice(own))
}

/// The largest of this rank's values.
fn largest(vector: sys::Vec) -> Result<f64, LinearError> {
    let mut most = 0.0_f64;
    read(vector, |values| most = values.iter().fold(0.0, |most, value| most.max(value.abs())))?;
    Ok(most)
}

fn with_values(vector: sys::Vec, work: impl FnOnce(&mut [f64])) -> Result<(), LinearError> {
    let (mut values, mut size) = (null_mut(), 0);
    // SAFETY: the vector is alive; its array, of its local size, is lent until it is given back, and nobody else has it meanwhile.
    unsafe {
        done(sys::VecGetLocalSize(vector, &raw mut size))?;
        done(sys::VecGetArray(vector, &raw mut values))?;
        if !values.is_null() {
            work(std::slice::from_raw_parts_mut(values, usize::try_from(size).unwrap_or_default()));
        }
        done(sys::VecRestoreArray(vector, &raw mut values))
    }
}
