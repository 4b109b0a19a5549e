//! PETSc itself, from its initialization to its end.

use std::sync::Mutex;

use mpi::{
    environment,
    ffi::{self, MPI_Comm},
};

use super::sys;
use crate::lock::lock;

/// Why PETSc cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PetscError {
    /// MPI is not there.
    #[error("MPI is not initialized, or finalized already; PETSc needs it")]
    Mpi,
    /// Too late.
    #[error("PETSc has been finalized")]
    Finalized,
    /// PETSc says no.
    #[error("PETSc could not be initialized (its error {code})")]
    Failed {
        /// Its error code.
        code: i32,
    },
}

/// Whether PETSc was initialized here, and how often it is in use.
static OPEN: Mutex<Open> = Mutex::new(Open { count: 0, is_ours: false, was_ours: false });

struct Open {
    /// How many libraries there are.
    count: usize,
    /// Whether PETSc was initialized for them; whether it was, and has been finalized since.
    is_ours: bool,
    was_ours: bool,
}

/// PETSc on some ranks.
#[derive(Debug)]
pub(super) struct Library {
    communicator: MPI_Comm,
}

// SAFETY: the handle of a communicator may be used by any thread, as long as the calls of threads
// do not overlap: whoever uses it promises what the adaptor does, to call from the thread that
// called it.
unsafe impl Send for Library {}
// SAFETY: as above; nothing here changes.
unsafe impl Sync for Library {}

impl Library {
    /// PETSc on the ranks of a copy of `communicator`. Collective.
    ///
    /// # Safety
    /// `communicator` must be a handle that MPI gave out and that has not been freed.
    pub(super) unsafe fn open(communicator: MPI_Comm) -> Result<Self, PetscError> {
        if !environment::is_initialized() || environment::is_finalized() {
            return Err(PetscError::Mpi);
        }
        let mut open = lock(&OPEN);
        let (mut initialized, mut finalized) = (0, 0);
        // SAFETY: both may be asked at any time, and write where they are told to.
        unsafe {
            sys::PetscInitialized(&raw mut initialized);
            sys::PetscFinalized(&raw mut finalized);
        }
        if finalized != 0 && !open.was_ours {
            return Err(PetscError::Finalized);
        }
        let mut copy = communicator;
        // SAFETY: MPI is there, the caller vouches for the handle, and `copy` is written.
        unsafe { ffi::MPI_Comm_dup(communicator, &raw mut copy) };
        if initialized == 0 {
            // SAFETY: PETSc is not initialized: this is the time to tell it its world, which it
            // never takes other ranks into than these; nobody else reads it before. Its handler of
            // signals is the solver's business.
            let code = unsafe {
                sys::PETSC_COMM_WORLD = copy;
                match sys::PetscInitializeNoArguments() {
                    0 => sys::PetscPopSignalHandler(),
                    code => code,
                }
            };
            if code != 0 {
                return Err(PetscError::Failed { code });
            }
            (open.is_ours, open.was_ours) = (true, false);
        }
        open.count += 1;
        Ok(Self { communicator: copy })
    }

    pub(super) fn communicator(&self) -> MPI_Comm {
        self.communicator
    }

    /// Whether PETSc is still there.
    pub(super) fn is_alive() -> bool {
        let mut finalized = 0;
        // SAFETY: may be asked at any time.
        unsafe { sys::PetscFinalized(&raw mut finalized) };
        finalized == 0 && environment::is_initialized() && !environment::is_finalized()
    }
}

impl Drop for Library {
    fn drop(&mut self) {
        let mut open = lock(&OPEN);
        open.count -= 1;
        if !Self::is_alive() {
            return;
        }
        if open.count == 0 && open.is_ours {
            (open.is_ours, open.was_ours) = (false, true);
            // SAFETY: PETSc was initialized here, nobody has finalized it, and no system is left:
            // each holds its library. Whoever initializes it again finds the world as it is before
            // anybody does: none.
            unsafe {
                sys::PetscFinalize();
                sys::PETSC_COMM_WORLD = ffi::RSMPI_COMM_NULL;
            }
        }
        if !open.is_ours {
            // SAFETY: a copy made here, that nothing uses any more. While PETSc lives on, it may be
            // PETSc's world, and stays.
            unsafe { ffi::MPI_Comm_free(&raw mut self.communicator) };
        }
    }
}
