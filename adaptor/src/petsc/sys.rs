//! The part of PETSc's C interface (3.18 and later) used here, as its headers declare it. The build
//! script has seen to it that its numbers are those declared here.

#![allow(
    non_snake_case,
    non_upper_case_globals,
    clippy::upper_case_acronyms,
    reason = "PETSc's own names"
)]

use std::os::raw::{c_char, c_int, c_void};

use mpi::ffi::MPI_Comm;

/// A count or number.
pub(super) type PetscInt = i32;
/// 0 where all went well.
pub(super) type ErrorCode = c_int;
/// 0 or 1.
pub(super) type PetscBool = c_int;

macro_rules! opaque {
    ($($name:ident),*) => {$(
        #[repr(C)]
        pub(super) struct $name {
            _opaque: [u8; 0],
        }
    )*};
}

opaque!(Matrix, Vector, Krylov, Preconditioner, NullSpace);

pub(super) type Mat = *mut Matrix;
pub(super) type Vec = *mut Vector;
pub(super) type KSP = *mut Krylov;
pub(super) type PC = *mut Preconditioner;
pub(super) type MatNullSpace = *mut NullSpace;

/// Add to what is there.
pub(super) const ADD_VALUES: c_int = 2;
pub(super) const MAT_FINAL_ASSEMBLY: c_int = 0;
/// The product with a vector.
pub(super) const MATOP_MULT: c_int = 3;
/// The 2-norm of the residual itself.
pub(super) const KSP_NORM_UNPRECONDITIONED: c_int = 2;
/// The default of a number.
pub(super) const PETSC_DEFAULT: f64 = -2.0;

unsafe extern "C" {
    pub(super) static mut PETSC_COMM_WORLD: MPI_Comm;
    pub(super) fn PetscInitialized(is: *mut PetscBool) -> ErrorCode;
    pub(super) fn PetscFinalized(is: *mut PetscBool) -> ErrorCode;
    pub(super) fn PetscInitializeNoArguments() -> ErrorCode;
    pub(super) fn PetscPopSignalHandler() -> ErrorCode;
    pub(super) fn PetscFinalize() -> ErrorCode;

    pub(super) fn MatCreate(comm: MPI_Comm, matrix: *mut Mat) -> ErrorCode;
    pub(super) fn MatSetSizes(
        m: Mat,
        rows: PetscInt,
        cols: PetscInt,
        all_rows: PetscInt,
        all_cols: PetscInt,
    ) -> ErrorCode;
    pub(super) fn MatSetType(matrix: Mat, name: *const c_char) -> ErrorCode;
    pub(super) fn MatXAIJSetPreallocation(
        matrix: Mat,
        block: PetscInt,
        diagonal: *const PetscInt,
        off: *const PetscInt,
        upper_diagonal: *const PetscInt,
        upper_off: *const PetscInt,
    ) -> ErrorCode;
    pub(super) fn MatSetValuesBlocked(
        matrix: Mat,
        rows: PetscInt,
        row: *const PetscInt,
        columns: PetscInt,
        column: *const PetscInt,
        values: *const f64,
        mode: c_int,
    ) -> ErrorCode;
    pub(super) fn MatAssemblyBegin(matrix: Mat, kind: c_int) -> ErrorCode;
    pub(super) fn MatAssemblyEnd(matrix: Mat, kind: c_int) -> ErrorCode;
    pub(super) fn MatCreateShell(
        comm: MPI_Comm,
        rows: PetscInt,
        cols: PetscInt,
        all_rows: PetscInt,
        all_cols: PetscInt,
        context: *mut c_void,
        matrix: *mut Mat,
    ) -> ErrorCode;
    /// The function is of the type of the operation.
    pub(super) fn MatShellSetOperation(
        matrix: Mat,
        operation: c_int,
        function: unsafe extern "C" fn(Mat, Vec, Vec) -> ErrorCode,
    ) -> ErrorCode;
    pub(super) fn MatShellSetContext(matrix: Mat, context: *mut c_void) -> ErrorCode;
    /// `context` is where the pointer is written to.
    pub(super) fn MatShellGetContext(matrix: Mat, context: *mut c_void) -> ErrorCode;
    pub(super) fn MatMult(matrix: Mat, vector: Vec, result: Vec) -> ErrorCode;
    pub(super) fn MatDestroy(matrix: *mut Mat) -> ErrorCode;
    pub(super) fn MatSetNearNullSpace(matrix: Mat, space: MatNullSpace) -> ErrorCode;
    pub(super) fn MatNullSpaceCreateRigidBody(
        coordinates: Vec,
        space: *mut MatNullSpace,
    ) -> ErrorCode;
    pub(super) fn MatNullSpaceDestroy(space: *mut MatNullSpace) -> ErrorCode;

    pub(super) fn VecCreateMPI(
        comm: MPI_Comm,
        own: PetscInt,
        all: PetscInt,
        vector: *mut Vec,
    ) -> ErrorCode;
    pub(super) fn VecSetBlockSize(vector: Vec, block: PetscInt) -> ErrorCode;
    pub(super) fn VecDuplicate(vector: Vec, copy: *mut Vec) -> ErrorCode;
    pub(super) fn VecGetArray(vector: Vec, values: *mut *mut f64) -> ErrorCode;
    pub(super) fn VecRestoreArray(vector: Vec, values: *mut *mut f64) -> ErrorCode;
    pub(super) fn VecGetLocalSize(vector: Vec, size: *mut PetscInt) -> ErrorCode;
    pub(super) fn VecAYPX(y: Vec, factor: f64, x: Vec) -> ErrorCode;
    pub(super) fn VecDestroy(vector: *mut Vec) -> ErrorCode;

    pub(super) fn KSPCreate(comm: MPI_Comm, solver: *mut KSP) -> ErrorCode;
    pub(super) fn KSPSetType(solver: KSP, name: *const c_char) -> ErrorCode;
    pub(super) fn KSPSetOperators(solver: KSP, matrix: Mat, preconditioner: Mat) -> ErrorCode;
    pub(super) fn KSPSetNormType(solver: KSP, norm: c_int) -> ErrorCode;
    pub(super) fn KSPSetTolerances(
        solver: KSP,
        relative: f64,
        absolute: f64,
        growth: f64,
        most: PetscInt,
    ) -> ErrorCode;
    pub(super) fn KSPSetInitialGuessNonzero(solver: KSP, is: PetscBool) -> ErrorCode;
    pub(super) fn KSPGetPC(solver: KSP, preconditioner: *mut PC) -> ErrorCode;
    pub(super) fn KSPSetUp(solver: KSP) -> ErrorCode;
    pub(super) fn KSPSetUpOnBlocks(solver: KSP) -> ErrorCode;
    pub(super) fn KSPSolve(solver: KSP, right_side: Vec, solution: Vec) -> ErrorCode;
    pub(super) fn KSPGetIterationNumber(solver: KSP, count: *mut PetscInt) -> ErrorCode;
    pub(super) fn KSPGetConvergedReason(solver: KSP, reason: *mut c_int) -> ErrorCode;
    pub(super) fn KSPGetResidualNorm(solver: KSP, norm: *mut f64) -> ErrorCode;
    pub(super) fn KSPDestroy(solver: *mut KSP) -> ErrorCode;

    pub(super) fn PCSetType(preconditioner: PC, name: *const c_char) -> ErrorCode;
    pub(super) fn PCBJacobiGetSubKSP(
        pc: PC,
        count: *mut PetscInt,
        first: *mut PetscInt,
        of: *mut *mut KSP,
    ) -> ErrorCode;
    pub(super) fn PCApply(preconditioner: PC, vector: Vec, result: Vec) -> ErrorCode;
    pub(super) fn PCShellSetApply(
        pc: PC,
        apply: unsafe extern "C" fn(PC, Vec, Vec) -> ErrorCode,
    ) -> ErrorCode;
    pub(super) fn PCShellSetContext(preconditioner: PC, context: *mut c_void) -> ErrorCode;
    /// `context` is where the pointer is written to.
    pub(super) fn PCShellGetContext(preconditioner: PC, context: *mut c_void) -> ErrorCode;
}
