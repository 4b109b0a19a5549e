//! Coordinates of the vertices: uniform, rectilinear, explicit.

use tombolo_deform::mesh::{ArrayView, Vector};

use crate::foreign::array::{Array, Fingerprint};

/// Where the vertices lie.
#[derive(Debug, Clone)]
pub enum Coordset<'call> {
    /// A grid of equal steps.
    Uniform {
        /// How many points along each axis.
        points: [usize; 3],
        /// The first point.
        origin: Vector,
        /// From one point to the next along each axis.
        spacing: Vector,
        /// Along how many axes the solver has points.
        dimension: usize,
    },
    /// A grid of steps that differ.
    Rectilinear {
        /// The coordinates along each axis.
        axes: Vec<Array<'call>>,
    },
    /// Each vertex by itself.
    Explicit {
        /// The coordinates of all vertices along each axis, as many on each.
        axes: Vec<Array<'call>>,
    },
}

impl<'call> Coordset<'call> {
    /// Points along each axis of a grid; `None` for explicit coordinates.
    #[must_use]
    pub fn grid(&self) -> Option<[usize; 3]> {
        match self {
            Coordset::Uniform { points, .. } => Some(*points),
            Coordset::Rectilinear { axes } => {
                Some(std::array::from_fn(|axis| axes.get(axis).map_or(1, Array::len)))
            }
            Coordset::Explicit { .. } => None,
        }
    }

    /// How many coordinates a vertex has for the solver.
    #[must_use]
    pub fn dimension(&self) -> usize {
        match self {
            Coordset::Uniform { dimension, .. } => *dimension,
            Coordset::Rectilinear { axes } | Coordset::Explicit { axes } => axes.len(),
        }
    }

    /// How many vertices there are.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        match self {
            Coordset::Explicit { axes } => axes.first().map_or(0, Array::len),
            _ => self.grid().map_or(0, |points| points.iter().product()),
        }
    }

    /// The coordinates as they lie in the solver's memory, where they can be lent.
    pub(super) fn lent(&self) -> Option<ArrayView<'call>> {
        let Coordset::Explicit { axes } = self else { return None };
        super::field::lent(axes)
    }

    /// Adds the coordinates to a copy.
    pub(super) fn append(&self, points: &mut Vec<Vector>) {
        let position = |axes: &[Array], at: [usize; 3]| -> Vector {
            std::array::from_fn(|axis| axes.get(axis).map_or(0.0, |along| along.get(at[axis])))
        };
        match self {
            Coordset::Explicit { axes } => {
                points.extend((0..self.vertex_count()).map(|index| position(axes, [index; 3])));
            }
            Coordset::Uniform { points: counts, origin, spacing, .. } => {
                grid(*counts, |at| {
                    points.push(std::array::from_fn(|axis| {
                        let along =
                            if counts[axis] > 1 { at[axis] as f64 * spacing[axis] } else { 0.0 };
                        origin[axis] + along
                    }));
                });
            }
            Coordset::Rectilinear { axes } => {
                let Some(counts) = self.grid() else { return };
                grid(counts, |at| points.push(position(axes, at)));
            }
        }
    }

    pub(super) fn fingerprint(&self, into: &mut Fingerprint) {
        // Coordinates may move from step to step; only their number makes another mesh.
        into.add(self.vertex_count() as u64);
    }

    pub(super) fn arrays(&self) -> &[Array<'call>] {
        match self {
            Coordset::Explicit { axes } | Coordset::Rectilinear { axes } => axes,
            Coordset::Uniform { .. } => &[],
        }
    }
}

/// Calls `visit` with the position of each point of a grid, i fastest.
fn grid(counts: [usize; 3], mut visit: impl FnMut([usize; 3])) {
    for k in 0..counts[2] {
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                visit([i, j, k]);
            }
        }
    }
}
