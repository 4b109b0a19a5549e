//! Vertices that slide along a surface.

use super::VolumeError;
use crate::linear::{Block, SparseMatrix};
use crate::mesh::Vector;
use crate::vector::{dot, length, scale, subtract};

/// A direction that is new is at least this far out of the plane of those known, as a sine.
const NEW_DIRECTION: f64 = 0.1;

/// A vertex that may move along a surface but not across it: the displacement along `normal` is
/// prescribed (none, unless told otherwise), the others are solved for without force.
///
/// A vertex where two such surfaces meet is listed once for each, and slides along their edge; with
/// three normals that span space all of its displacement is prescribed. Normals within about six
/// degrees of the plane of those before them say nothing new.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sliding {
    /// The vertex of the mesh.
    pub vertex: u32,
    /// Across the surface, of any length.
    pub normal: Vector,
}

/// A sliding vertex that is solved for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Constraint {
    /// Its unknown.
    pub(super) row: usize,
    /// Its first index in what the user listed.
    pub(super) first: usize,
    /// The projection on the directions that are prescribed.
    pub(super) across: Block<3>,
}

impl Constraint {
    /// The part of a displacement that is prescribed.
    pub(super) fn across(&self, value: Vector) -> Vector {
        self.across.map(|row| dot(row, value))
    }

    /// The part that is free.
    pub(super) fn along(&self, value: Vector) -> Vector {
        subtract(value, self.across(value))
    }
}

/// One constraint for each vertex that `sliding` lists and that has an unknown, in the order of the
/// unknowns.
///
/// # Errors
/// [`VolumeError::SlidingNormal`].
pub(super) fn constraints(
    sliding: &[Sliding],
    row_of: impl Fn(u32) -> Option<usize>,
) -> Result<Vec<Constraint>, VolumeError> {
    let mut order: Vec<usize> = (0..sliding.len()).collect();
    order.sort_by_key(|&index| sliding[index].vertex);
    let mut constraints = Vec::new();
    for group in order.chunk_by(|&a, &b| sliding[a].vertex == sliding[b].vertex) {
        let mut across = [[0.0; 3]; 3];
        for &index in group {
            let Sliding { vertex, normal } = sliding[index];
            let size = length(normal);
            if !(size.is_normal() && normal.iter().all(|value| value.is_finite())) {
                return Err(VolumeError::SlidingNormal { vertex, normal });
            }
            let unit = scale(normal, 1.0 / size);
            let rest = subtract(unit, across.map(|row| dot(row, unit)));
            let size = length(rest);
            if size > NEW_DIRECTION {
                let direction = scale(rest, 1.0 / size);
                for (row, a) in across.iter_mut().zip(direction) {
                    for (entry, b) in row.iter_mut().zip(direction) {
                        *entry += a * b;
                    }
                }
            }
        }
        let Some(&first) = group.first() else { continue };
        if let Some(row) = row_of(sliding[first].vertex) {
            constraints.push(Constraint { row, first, across });
        }
    }
    constraints.sort_by_key(|constraint| constraint.row);
    Ok(constraints)
}

/// Takes the directions across out of the equations: `P A P + α (1 - P)`, which is positive
/// definite where `A` is. What is returned couples the unknowns to the prescribed displacements,
/// one column for each constraint.
pub(super) fn constrain(
    matrix: &mut SparseMatrix<3>,
    constraints: &[Constraint],
) -> SparseMatrix<3> {
    let mut of_row = vec![None; matrix.rows()];
    for (index, constraint) in (0u32..).zip(constraints) {
        of_row[constraint.row] = Some((index, constraint));
    }
    let (offsets, columns, values) = matrix.offsets_and_values_mut();
    let (mut found_offsets, mut found_columns, mut found_values) =
        (vec![0], Vec::new(), Vec::new());
    for row in 0..of_row.len() {
        for entry in offsets[row]..offsets[row + 1] {
            let column = columns[entry] as usize;
            let block = &mut values[entry];
            let whole = *block;
            if let Some((index, constraint)) = of_row[column] {
                found_columns.push(index);
                found_values.push(whole);
                // The rows of a block times a symmetric projection.
                *block = block.map(|entries| constraint.along(entries));
            }
            if let Some((_, constraint)) = of_row[row] {
                let transposed: Block<3> =
                    std::array::from_fn(|i| std::array::from_fn(|j| block[j][i]));
                let along = transposed.map(|entries| constraint.along(entries));
                *block = std::array::from_fn(|i| std::array::from_fn(|j| along[j][i]));
                if column == row {
                    let size = (whole[0][0] + whole[1][1] + whole[2][2]) / 3.0;
                    for (entries, across) in block.iter_mut().zip(constraint.across) {
                        for (entry, across) in entries.iter_mut().zip(across) {
                            *entry += size * across;
                        }
                    }
                }
            }
        }
        found_offsets.push(found_columns.len());
    }
    SparseMatrix::from_parts(found_offsets, found_columns, found_values)
}
