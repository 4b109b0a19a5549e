//! The sum of the ranks' matrices as one of PETSc's.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "that there are no more equations than 32 bits count is seen to where they are numbered"
)]

use std::{ffi::CStr, ptr::null_mut};

use mpi::ffi::MPI_Comm;
use tombolo_deform::{
    linear::{LinearError, SparseMatrix},
    mesh::Vector,
};

use super::{
    numbering::Numbering,
    sys::{self, PetscInt},
    vector::{done, write},
};

/// Makes a matrix of one of PETSc's kinds, at `into`. Collective.
pub(super) fn assemble<const B: usize>(
    numbering: &Numbering,
    matrix: &SparseMatrix<B>,
    kind: &CStr,
    comm: MPI_Comm,
    into: &mut sys::Mat,
) -> Result<(), LinearError> {
    let Numbering { halo, numbers, owned, .. } = numbering;
    let block = B as PetscInt;
    let size = block * owned.len() as PetscInt;
    // At most as many blocks in the rows of this rank as the ranks have between them, inside its
    // own columns and beyond.
    let mut counts = vec![[0.0; 2]; matrix.rows()];
    let owner_is_that_of = |row: usize, column: u32| halo.owns(row) == halo.owns(column as usize);
    for (row, count) in counts.iter_mut().enumerate() {
        for &column in matrix.row(row).0 {
            // Two vertices of other ranks may belong to two of them: room is made for both cases.
            let same = owner_is_that_of(row, column);
            count[0] += f64::from(u8::from(same || !halo.owns(row)));
            count[1] += f64::from(u8::from(!same || !halo.owns(row)));
        }
    }
    numbering.sum(&mut counts);
    let room = |of: usize| -> Vec<PetscInt> {
        let most = |count: f64| count.min(f64::from(PetscInt::MAX)) as PetscInt;
        let limit = owned.len() as PetscInt;
        let room = owned.iter().map(|&unknown| most(counts[unknown as usize][of]));
        room.map(|count| if of == 0 { count.min(limit) } else { count }).collect()
    };
    let (diagonal, off) = (room(0), room(1));
    // SAFETY: PETSc is initialized for as long as the caller holds its library. The matrix is made
    // before it is used, with sizes that are those of the arrays given; PETSc copies what it is
    // given, and writes the handle where it is told to.
    unsafe {
        done(sys::MatCreate(comm, into))?;
        done(sys::MatSetSizes(*into, size, size, -1, -1))?;
        done(sys::MatSetType(*into, kind.as_ptr()))?;
        done(sys::MatXAIJSetPreallocation(
            *into,
            block,
            diagonal.as_ptr(),
            off.as_ptr(),
            std::ptr::null(),
            std::ptr::null(),
        ))?;
    }
    let (mut columns, mut values) = (Vec::new(), Vec::new());
    for row in 0..matrix.rows() {
        let (of_row, blocks) = matrix.row(row);
        columns.clear();
        columns.extend(of_row.iter().map(|&column| numbers[column as usize]));
        values.clear();
        (0..B).for_each(|axis| values.extend(blocks.iter().flat_map(|block| block[axis])));
        // SAFETY: one row of blocks, as many columns as there are, and a value for each of their
        // entries, row after row.
        done(unsafe {
            sys::MatSetValuesBlocked(
                *into,
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
        done(sys::MatAssemblyBegin(*into, sys::MAT_FINAL_ASSEMBLY))?;
        done(sys::MatAssemblyEnd(*into, sys::MAT_FINAL_ASSEMBLY))
    }
}

/// Tells a matrix which displacements strain nothing; `positions` are those of this rank's
/// unknowns, and `vector` is overwritten.
pub(super) fn turn_as_bodies(
    numbering: &Numbering,
    positions: &[Vector],
    matrix: sys::Mat,
    vector: sys::Vec,
) -> Result<(), LinearError> {
    let own: Vec<f64> =
        numbering.owned.iter().flat_map(|&unknown| positions[unknown as usize]).collect();
    write(vector, &own)?;
    let mut space = null_mut();
    // SAFETY: the vector has three coordinates for each block of this rank; the matrix keeps the
    // space by itself.
    unsafe {
        done(sys::MatNullSpaceCreateRigidBody(vector, &raw mut space))?;
        done(sys::MatSetNearNullSpace(matrix, space))?;
        done(sys::MatNullSpaceDestroy(&raw mut space))
    }
}
