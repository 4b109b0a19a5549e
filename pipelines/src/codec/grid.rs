//! A field in whole steps of a grid: what both sides know of it.

use super::plane::Plane;

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

/// The points that have one and the same tuple.
#[derive(Debug, Clone)]
pub(super) struct Mask {
    pub(super) points: Vec<bool>,
    pub(super) tuple: Vec<f64>,
}

impl Grid {
    pub(super) fn new(exponent: i16, steps: u8, offsets: Vec<f64>, points: usize) -> Self {
        let planes = offsets.iter().map(|_| Plane::new(points)).collect();
        Self { exponent, steps, offsets, planes, mask: None, frames: 0 }
    }

    /// Makes the last frame the one before. `false` where the grids are too different.
    pub(super) fn follow(&mut self, exponent: i16) -> bool {
        let by = i32::from(self.exponent) - i32::from(exponent);
        if by.abs() > 100 {
            return false;
        }
        #[expect(clippy::cast_possible_truncation, reason = "a power of two that it has")]
        let scale = two_to(by) as f32;
        let is_second = self.frames == 1;
        self.planes.iter_mut().for_each(|plane| plane.shift(scale, is_second));
        self.exponent = exponent;
        true
    }

    /// A step of the grid.
    pub(super) fn unit(&self) -> f64 {
        two_to(i32::from(self.exponent))
    }

    /// Gives points with a mask the value that is next to theirs in the grid.
    pub(super) fn set_masked(&mut self) {
        let per_unit = two_to(-i32::from(self.exponent));
        let Some(mask) = &self.mask else { return };
        for (component, plane) in self.planes.iter_mut().enumerate() {
            let value = (mask.tuple[component] - self.offsets[component]) * per_unit;
            let value = if value.abs() <= 2.0 * MOST_STEPS { value.round_ties_even() } else { 0.0 };
            for (node, _) in plane.nodes.iter_mut().zip(&mask.points).filter(|(_, set)| **set) {
                node[0] = value as f32;
                node[3] = 0.0;
            }
        }
    }

    pub(super) fn values(&self) -> Vec<f64> {
        let unit = self.unit();
        let (points, components) = (self.planes.first(), self.planes.len());
        let mut values = vec![0.0; points.map_or(0, |plane| plane.nodes.len()) * components];
        for (component, plane) in self.planes.iter().enumerate() {
            let offset = self.offsets[component];
            let places = values.iter_mut().skip(component).step_by(components);
            for (value, node) in places.zip(&plane.nodes) {
                *value = offset + f64::from(node[0]) * unit;
            }
        }
        if let Some(mask) = &self.mask {
            let tuples = values.chunks_exact_mut(components);
            for (tuple, _) in tuples.zip(&mask.points).filter(|(_, is_set)| **is_set) {
                tuple.copy_from_slice(&mask.tuple);
            }
        }
        values
    }
}

/// Two to the power of a number between -1000 and 1000.
#[expect(clippy::cast_sign_loss, reason = "the exponent of a double, from 23 on")]
pub(super) fn two_to(exponent: i32) -> f64 {
    f64::from_bits(((exponent + 1023) as u64) << 52)
}
