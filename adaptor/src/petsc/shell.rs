//! The kernel's own multigrid as PETSc calls it: the product with the sum of the ranks' matrices,
//! and the preconditioner.

use std::{
    any::Any,
    os::raw::c_void,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    ptr::null_mut,
};

use mpi::ffi::MPI_Comm;
use tombolo_deform::linear::{LinearError, LinearSolver, Multigrid};

use super::{
    numbering::Numbering,
    sys::{self, PetscInt},
    vector::done,
};

/// From a residual to a correction.
type Cycle<'a, const B: usize> = &'a mut dyn FnMut(&[[f64; B]], &mut [[f64; B]]);

/// The data that PETSc's calls need while it solves.
struct Context<'a, const B: usize> {
    numbering: &'a Numbering,
    multigrid: &'a Multigrid<B>,
    cycle: Cycle<'a, B>,
    values: (Vec<[f64; B]>, Vec<[f64; B]>),
    /// The panic of a call.
    panic: Option<Box<dyn Any + Send>>,
}

/// Makes a matrix whose product is that of `B` by `B` blocks of the kernel's, at `into`.
/// Collective.
pub(super) fn create<const B: usize>(
    numbering: &Numbering,
    comm: MPI_Comm,
    into: &mut sys::Mat,
) -> Result<(), LinearError> {
    let size = PetscInt::try_from(B * numbering.owned.len()).unwrap_or(PetscInt::MAX);
    // SAFETY: PETSc is initialized for as long as the caller holds its library, and writes the
    // handle where it is told to. The function is of the type that this operation is called by.
    unsafe {
        done(sys::MatCreateShell(comm, size, size, -1, -1, null_mut(), into))?;
        done(sys::MatShellSetOperation(*into, sys::MATOP_MULT, multiply::<B>))
    }
}

/// Makes a preconditioner the kernel's.
///
/// # Safety
/// It must be one of PETSc's, alive, of the type `shell`.
pub(super) unsafe fn precondition<const B: usize>(
    preconditioner: sys::PC,
) -> Result<(), LinearError> {
    // SAFETY: as the caller vouches for; the function is of the type that is asked for.
    done(unsafe { sys::PCShellSetApply(preconditioner, apply::<B>) })
}

/// Calls `work`, during which a matrix and a preconditioner made here can be used. `scale` brings
/// residuals to the order of 1.
pub(super) fn with_context<const B: usize, R>(
    (matrix, preconditioner): (sys::Mat, sys::PC),
    numbering: &Numbering,
    multigrid: &Multigrid<B>,
    scale: f64,
    work: impl FnOnce() -> Result<R, LinearError>,
) -> Result<R, LinearError> {
    multigrid.with_cycle(scale, |cycle| {
        let zeros = || vec![[0.0; B]; multigrid.unknowns()];
        let mut context =
            Context::<B> { numbering, multigrid, cycle, values: (zeros(), zeros()), panic: None };
        let set = |context: *mut c_void| {
            // SAFETY: both are alive; what they are given lives until the solve has ended, and is
            // taken away then.
            unsafe {
                done(sys::MatShellSetContext(matrix, context))?;
                done(sys::PCShellSetContext(preconditioner, context))
            }
        };
        set((&raw mut context).cast())?;
        let result = work();
        set(null_mut())?;
        // Not through PETSc, but on: the other ranks wait for this one.
        if let Some(panic) = context.panic {
            resume_unwind(panic);
        }
        result
    })
}

/// PETSc's code for an error of the caller's.
const USER: sys::ErrorCode = 83;

impl<const B: usize> Context<'_, B> {
    /// Makes the values of `result` from those of `vector`.
    fn call(
        &mut self,
        vector: sys::Vec,
        result: sys::Vec,
        work: impl FnOnce(&Multigrid<B>, Cycle<'_, B>, &[[f64; B]], &mut [[f64; B]]),
    ) -> sys::ErrorCode {
        let Self { numbering, multigrid, cycle, values: (before, after), panic } = self;
        let called = catch_unwind(AssertUnwindSafe(|| {
            numbering.update(vector, before)?;
            work(multigrid, cycle, before, after);
            numbering.put(after, result)
        }));
        match called {
            Ok(Ok(())) => 0,
            Ok(Err(_)) => USER,
            Err(reason) => {
                *panic = Some(reason);
                USER
            }
        }
    }
}

/// # Safety
/// PETSc calls it within `KSPSolve` or `MatMult`, with the context set, on the thread that called
/// these.
unsafe extern "C" fn multiply<const B: usize>(
    matrix: sys::Mat,
    vector: sys::Vec,
    result: sys::Vec,
) -> sys::ErrorCode {
    let mut context: *mut Context<'_, B> = null_mut();
    // SAFETY: the context was set for this solve; PETSc writes the pointer where it is told to.
    let code = unsafe { sys::MatShellGetContext(matrix, (&raw mut context).cast::<c_void>()) };
    // SAFETY: it lives until the solve ends, and nobody else has it meanwhile: the solve holds the
    // handles' lock.
    let Some(context) = (unsafe { context.as_mut() }).filter(|_| code == 0) else { return USER };
    context.call(vector, result, |multigrid, _, before, after| multigrid.multiply(before, after))
}

/// # Safety
/// PETSc calls it within `KSPSolve` or `PCApply`, with the context set, on the thread that called
/// these.
unsafe extern "C" fn apply<const B: usize>(
    pc: sys::PC,
    vector: sys::Vec,
    result: sys::Vec,
) -> sys::ErrorCode {
    let mut context: *mut Context<'_, B> = null_mut();
    // SAFETY: as above.
    let code = unsafe { sys::PCShellGetContext(pc, (&raw mut context).cast::<c_void>()) };
    // SAFETY: as above.
    let Some(context) = (unsafe { context.as_mut() }).filter(|_| code == 0) else { return USER };
    context.call(vector, result, |_, cycle, before, after| cycle(before, after))
}
