//! Overlapping grids of several levels: which cells finer grids cover.

use tombolo_deform::bounds::Bounds;

use super::topology::index_in_grid;

/// A grid among those of its channel.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Grid {
    /// The number by which other grids name it.
    pub id: Option<i64>,
    /// How fine it is: 0 is the coarsest. Where it is not said, windows tell what finer grids
    /// cover.
    pub level: Option<i64>,
    /// Its first point.
    #[serde(with = "bits")]
    pub lower: [f64; 3],
    /// From one point to the next along each axis.
    #[serde(with = "bits")]
    pub spacing: [f64; 3],
    /// How many cells it has along each axis.
    pub cells: [usize; 3],
}

/// Numbers as they are, to the last bit.
mod bits {
    use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer};

    pub(super) fn serialize<S: Serializer>(
        numbers: &[f64; 3],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        numbers.map(f64::to_bits).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<[f64; 3], D::Error> {
        Ok(<[u64; 3]>::deserialize(deserializer)?.map(f64::from_bits))
    }
}

impl Grid {
    /// The box that it fills.
    pub(super) fn bounds(&self) -> Bounds {
        #[expect(clippy::cast_precision_loss, reason = "a number of cells below 2^32")]
        let upper = std::array::from_fn(|axis| {
            self.lower[axis] + self.cells[axis] as f64 * self.spacing[axis]
        });
        Bounds::around([self.lower, upper])
    }

    /// The least distance between two of its points along an axis.
    pub(super) fn least_spacing(&self) -> f64 {
        (0..3)
            .filter(|&axis| self.cells[axis] > 0)
            .map(|axis| self.spacing[axis].abs())
            .fold(f64::INFINITY, f64::min)
    }

    /// The cells of this grid whose middle lies in a finer one.
    fn covered_by(&self, finer: &Grid) -> Option<Covered> {
        let mut covered = Covered { child: None, origin: [0; 3], counts: [1; 3] };
        for axis in (0..3).filter(|&axis| self.cells[axis] > 0) {
            let [own, length] =
                [self.cells[axis] as f64, finer.cells[axis] as f64 * finer.spacing[axis]];
            let at = |position: f64| {
                ((position - self.lower[axis]) / self.spacing[axis] - 0.5).ceil().clamp(0.0, own)
            };
            let (from, to) = (at(finer.lower[axis]), at(finer.lower[axis] + length));
            // False for what is no number, too.
            let has_any = from < to;
            if !has_any {
                return None;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "from 0 to the number of cells"
            )]
            {
                covered.origin[axis] = from as i64;
                covered.counts[axis] = (to - from) as usize;
            }
        }
        Some(covered)
    }
}

/// A box of cells: the first along each axis, and how many; and the domain that was said to cover
/// them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Covered {
    child: Option<i64>,
    origin: [i64; 3],
    counts: [usize; 3],
}

/// The cells of a grid that finer grids cover.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Mask {
    cells: [usize; 3],
    covered: Vec<Covered>,
}

impl Mask {
    /// All of a grid of these many cells along each axis: nothing is covered.
    #[must_use]
    pub fn new(cells: [usize; 3]) -> Self {
        Self { cells, covered: Vec::new() }
    }

    /// Leaves out a box of cells: the first along each axis, and how many. `child` is the number of
    /// the grid that covers them.
    pub fn cover(&mut self, child: Option<i64>, origin: [i64; 3], counts: [usize; 3]) {
        self.covered.push(Covered { child, origin, counts });
    }

    /// Takes the word of the finer grids that are known for what they cover. Windows tell of those
    /// that are not; one that names its own grid tells nothing.
    pub(super) fn settle(&mut self, own: &Grid, others: &[Grid]) {
        let has_level = |grid: &&Grid| own.level.is_some() && grid.level.is_some();
        let known = |id: i64| {
            own.id == Some(id) || others.iter().filter(has_level).any(|grid| grid.id == Some(id))
        };
        self.covered.retain(|window| !window.child.is_some_and(known));
        let finer = others.iter().filter(has_level).filter(|grid| grid.level > own.level);
        self.covered.extend(finer.filter_map(|finer| own.covered_by(finer)));
    }

    /// Whether no finer grid covers the cell.
    pub(super) fn keeps(&self, cell: usize) -> bool {
        if self.covered.is_empty() {
            return true;
        }
        let at = index_in_grid(self.cells, cell);
        !self.covered.iter().any(|window| {
            (0..3).all(|axis| {
                let from = at[axis] as i64 - window.origin[axis];
                from >= 0 && from < window.counts[axis] as i64
            })
        })
    }

    /// Takes what is covered into a fingerprint.
    pub(super) fn words(&self) -> impl Iterator<Item = u64> {
        self.covered.iter().flat_map(|window| {
            let origin = window.origin.map(i64::cast_unsigned);
            origin.into_iter().chain(window.counts.map(|count| count as u64))
        })
    }
}
