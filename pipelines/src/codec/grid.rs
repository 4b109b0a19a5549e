//! A field in whole steps of a grid: what both sides know of it.

use super::mask::Mask;
use super::plane::{Plane, Shift, two_to};

/// No value is further than this from its offset, in grid steps.
pub(super) const MOST_STEPS: f64 = 4_194_304.0;

/// A field in whole steps of a grid.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    /// A step of the grid is two to this; a step of a difference is so many of them.
    pub(super) exponent: i16,
    pub(super) steps: u8,
    pub(super) offsets: Vec<f64>,
    pub(super) planes: Vec<Plane>,
    pub(super) mask: Option<Mask>,
    pub(super) frames: u32,
}

impl Grid {
    pub(super) fn new(exponent: i16, steps: u8, offsets: Vec<f64>, points: usize) -> Self {
        let planes = offsets.iter().map(|_| Plane::new(points)).collect();
        Self { exponent, steps, offsets, planes, mask: None, frames: 0 }
    }

    /// Takes another exponent for the next frame. `None` where the grids are too different;
    /// otherwise what is to become of the planes.
    pub(super) fn follow(&mut self, exponent: i16) -> Option<Shift> {
        let by = i32::from(self.exponent) - i32::from(exponent);
        if by.abs() > 100 {
            return None;
        }
        self.exponent = exponent;
        #[expect(clippy::cast_possible_truncation, reason = "a power of two that it has")]
        Some(Shift { scale: two_to(by) as f32, is_second: self.frames == 1 })
    }

    /// A step of the grid.
    pub(super) fn unit(&self) -> f64 {
        two_to(i32::from(self.exponent))
    }

    /// Gives points with a mask the value that is next to theirs in the grid.
    pub(super) fn set_masked(&mut self) {
        let per_unit = two_to(-i32::from(self.exponent));
        for (index, tuple) in self.mask.iter().flat_map(Mask::tuples) {
            for (component, plane) in self.planes.iter_mut().enumerate() {
                let value = (tuple[component] - self.offsets[component]) * per_unit;
                let is_near = value.abs() <= 2.0 * MOST_STEPS;
                let now = if is_near { value.round_ties_even() as f32 } else { 0.0 };
                plane.nodes[index].set(0.0, now);
            }
        }
    }

    /// The values, but for those that no step reaches.
    pub(super) fn values(&self) -> Vec<f64> {
        let unit = self.unit();
        let (points, components) = (self.planes.first(), self.planes.len());
        let mut values = vec![0.0; points.map_or(0, |plane| plane.nodes.len()) * components];
        for (component, plane) in self.planes.iter().enumerate() {
            let offset = self.offsets[component];
            let of_points = values.iter_mut().skip(component).step_by(components);
            for (value, node) in of_points.zip(&plane.nodes) {
                *value = offset + f64::from(node.now()) * unit;
            }
        }
        self.put_masked(&mut values);
        values
    }

    /// Gives points with a mask their tuples.
    pub(super) fn put_masked(&self, values: &mut [f64]) {
        let components = self.planes.len();
        for (index, tuple) in self.mask.iter().flat_map(Mask::tuples) {
            values[index * components..][..components].copy_from_slice(tuple);
        }
    }
}
