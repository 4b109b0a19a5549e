//! This rank's values of PETSc's vectors.

use std::ptr::null_mut;

use tombolo_deform::linear::LinearError;

use super::sys;

/// The result of a call of PETSc.
pub(super) fn done(code: sys::ErrorCode) -> Result<(), LinearError> {
    if code == 0 { Ok(()) } else { Err(LinearError::Library { name: "PETSc", code }) }
}

/// Calls `work` with this rank's values of a vector.
pub(super) fn read(vector: sys::Vec, work: impl FnOnce(&[f64])) -> Result<(), LinearError> {
    with_values(vector, |values| work(values))
}

pub(super) fn write(vector: sys::Vec, own: &[f64]) -> Result<(), LinearError> {
    with_values(vector, |values| values.copy_from_slice(own))
}

/// The largest of this rank's values.
pub(super) fn largest(vector: sys::Vec) -> Result<f64, LinearError> {
    let mut most = 0.0_f64;
    read(vector, |values| most = values.iter().fold(0.0, |most, value| most.max(value.abs())))?;
    Ok(most)
}

fn with_values(vector: sys::Vec, work: impl FnOnce(&mut [f64])) -> Result<(), LinearError> {
    let (mut values, mut size) = (null_mut(), 0);
    // SAFETY: the vector is alive; its array, of its local size, is lent until it is given back,
    // and nobody else has it meanwhile.
    unsafe {
        done(sys::VecGetLocalSize(vector, &raw mut size))?;
        done(sys::VecGetArray(vector, &raw mut values))?;
        if !values.is_null() {
            work(std::slice::from_raw_parts_mut(values, usize::try_from(size).unwrap_or_default()));
        }
        done(sys::VecRestoreArray(vector, &raw mut values))
    }
}
