//! What sweeps have gained.

use super::{Improver, Interface};
use crate::communicator::{Communicator, Reduction};
use crate::mesh::Vector;
use crate::parallel;

/// How many corners are looked at at a time.
const CHUNK: usize = 4096;

/// From this least quality on, it is the mean that counts.
pub(super) const ENOUGH: f64 = 0.8;

/// The least mean gain in quality per worn cell that makes a sweep worthwhile.
const GAIN: f64 = 1e-3;

/// The least gain in the mean or the least quality while that is still too low; less is rounding.
const LEAST_GAIN: f64 = 1e-6;

/// The quality of what can be moved, on all ranks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Qualities {
    /// The least; NaN or negative infinity where one is NaN.
    pub(super) least: f64,
    sum: f64,
    /// How many are worn.
    worn: f64,
}

impl Qualities {
    const NONE: Self = Self { least: f64::INFINITY, sum: 0.0, worn: 0.0 };

    /// With those of `other`, whose NaN counts.
    fn with(self, other: Self) -> Self {
        let is_less = other.least < self.least || other.least.is_nan();
        Self {
            least: if is_less { other.least } else { self.least },
            sum: self.sum + other.sum,
            worn: self.worn + other.worn,
        }
    }

    /// Whether the least quality is high enough, or as high as that of the cells that cannot be moved,
    /// `fixed`: it is the mean that counts from there on.
    pub(super) fn are_enough(&self, fixed: f64) -> bool {
        self.least + LEAST_GAIN >= fixed.min(ENOUGH)
    }

    /// Whether these are so much better than those `before` a sweep, or a part of one, that the
    /// sweep was worth it.
    pub(super) fn are_worth_more(&self, before: &Self, fixed: f64, part: f64) -> bool {
        let gain = (self.sum - before.sum) / before.worn.max(1.0);
        gain >= part * GAIN
            || !before.are_enough(fixed) && gain.max(self.rise(before, fixed)) >= LEAST_GAIN
    }

    /// Whether the mesh is better by these than by those `before`.
    pub(super) fn are_better(&self, before: &Self, fixed: f64) -> bool {
        self.sum > before.sum || self.rise(before, fixed) >= LEAST_GAIN
    }

    /// By how much the least quality of the mesh has risen, whose cells that cannot be moved have
    /// `fixed`.
    fn rise(&self, before: &Self, fixed: f64) -> f64 {
        self.least.min(fixed) - before.least.min(fixed)
    }
}

impl Improver {
    /// The quality of what can be moved. Collective.
    pub(super) fn qualities(&self, points: &[Vector]) -> Qualities {
        let of_simplex = |&simplex: &u32| {
            let least = self.simplices[simplex as usize].least(points);
            Qualities { least, sum: least, worn: f64::from(u8::from(least < self.good)) }
        };
        let mut found = parallel::map_chunks(self.movable.len(), CHUNK, |range| {
            self.movable[range].iter().map(of_simplex).fold(Qualities::NONE, Qualities::with)
        })
        .into_iter()
        .fold(Qualities::NONE, Qualities::with);
        if let Some(Interface { held, .. }) = &self.interface {
            let ranks = held.halo().communicator();
            // The reduction passes over NaN.
            let least = if found.least.is_nan() { f64::NEG_INFINITY } else { found.least };
            let least = ranks.reduced(Reduction::Minimum, least);
            let mut sums = [found.sum, found.worn];
            ranks.reduce(Reduction::Sum, &mut sums);
            found = Qualities { least, sum: sums[0], worn: sums[1] };
        }
        found
    }

    /// The least quality of the cells that cannot be moved: the mesh keeps it, whatever the others
    /// gain. Collective.
    pub(super) fn least_fixed(&self, points: &[Vector]) -> f64 {
        let quality = |&simplex: &u32| self.simplices[simplex as usize].least(points);
        let least = self.fixed.iter().map(quality).fold(f64::INFINITY, f64::min);
        match &self.interface {
            Some(Interface { held, .. }) => {
                held.halo().communicator().reduced(Reduction::Minimum, least)
            }
            None => least,
        }
    }
}
