//! The mesh as the solver lends it, against the shape that it was asked to have.
//!
//! A shape is handed out as coordinates; whether the solver went there is seen at the next call
//! alone. What it lends is the shape, a motion of its own added to it, or the shape before, where
//! it did not follow.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use tombolo_deform::{
    communicator::{Communicator, Reduction},
    mesh::{ArrayView, Domain, Vector},
    vector::{dot, subtract},
};

/// Rounding in single precision, as a fraction of the largest coordinate.
const SINGLE: f64 = 1.0 / (1 << 22) as f64;
/// The rounding of coordinates kept in double precision, as a fraction of their size.
const DOUBLE: f64 = 1.0 / (1_u64 << 48) as f64;

/// A shape that the solver did not follow.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NotFollowed {
    /// The cycle of the call that handed the shape out.
    pub cycle: u64,
    /// The shape of the schedule, counted from 1.
    pub shape: u32,
    /// The largest distance between a vertex as it was lent at the next call and where it was asked
    /// to be, in units of the mesh.
    pub distance: f64,
}

/// A shape that was handed out, and of which it is not known yet whether the solver went there.
pub(super) struct HandedOut {
    /// Where the mesh was lent.
    pub(super) from: Arc<[Vector]>,
    /// Where it was asked to go.
    pub(super) to: Arc<[Vector]>,
}

/// How the mesh as lent now lies to a shape.
#[derive(Default)]
pub(super) struct Own {
    /// The mesh as lent; `None` where it is the shape, bit for bit.
    pub(super) lent: Option<Arc<[Vector]>>,
    /// The motion that the solver itself has added to the shape; `None` where that is rounding on
    /// all ranks.
    pub(super) offsets: Option<Arc<[Vector]>>,
}

/// Whether a shape that was handed out was followed.
pub(super) struct Outcome {
    pub(super) is_followed: bool,
    /// The largest distance from where it was asked to be; 0 where that is rounding.
    pub(super) distance: f64,
}

/// How coordinates compare.
#[derive(Clone, Copy)]
pub(super) struct Rounding {
    /// The largest absolute coordinate of the reference, on all ranks.
    extent: f64,
}

impl Rounding {
    /// The rounding of a mesh's coordinates. Collective.
    pub(super) fn of(reference: &[Vector], communicator: &dyn Communicator) -> Self {
        let mut extent =
            [reference.as_flattened().iter().fold(0.0_f64, |largest, x| largest.max(x.abs()))];
        communicator.reduce(Reduction::Maximum, &mut extent);
        Self { extent: extent[0] }
    }

    /// Whether a coordinate is the one that was asked for, as far as the precision goes in which
    /// the solver seems to keep it: single where the value fits into that.
    #[inline]
    fn holds(self, lent: f64, asked: f64) -> bool {
        if lent == asked {
            return true;
        }
        #[expect(clippy::cast_possible_truncation, reason = "that is what is asked")]
        let is_single = f64::from(lent as f32) == lent;
        let precision = if is_single { SINGLE } else { DOUBLE };
        (lent - asked).abs() <= precision * self.extent.max(lent.abs())
    }

    fn holds_at(self, lent: Vector, asked: Vector) -> bool {
        (0..3).all(|axis| self.holds(lent[axis], asked[axis]))
    }

    /// Where a vertex lent at `lent` comes to when the shape goes from `now` to `next`: there, if
    /// it is in the shape now; else as far on.
    #[inline]
    pub(super) fn carried(self, lent: Vector, now: Vector, next: Vector) -> Vector {
        std::array::from_fn(|axis| {
            if self.holds(lent[axis], now[axis]) {
                next[axis]
            } else {
                lent[axis] + (next[axis] - now[axis])
            }
        })
    }

    /// Whether the mesh as it is lent is where it was asked to be.
    ///
    /// A vertex has stayed where it went less than half as far along as it was asked to; a shape
    /// was not followed where those that stayed make up more than half of the motion, as its sum of
    /// squares. A vertex that the solver moves by itself does not stay. Collective.
    pub(super) fn compare(
        self,
        handed: &HandedOut,
        lent: &ArrayView<'_>,
        domain: &Domain,
    ) -> Outcome {
        let (mut all, mut stayed, mut distance) = (0.0, 0.0, 0.0_f64);
        for (vertex, (&from, &to)) in handed.from.iter().zip(&*handed.to).enumerate() {
            let now = lent.vector(vertex);
            let is_there = now == to || self.holds_at(now, to);
            if !is_there {
                distance = distance.max(norm(subtract(now, to)));
            }
            if u32::try_from(vertex).is_ok_and(|vertex| domain.owns(vertex)) {
                let (asked, went) = (subtract(to, from), subtract(now, from));
                let square = dot(asked, asked);
                all += square;
                if !is_there && dot(went, went) < 0.25 * square {
                    stayed += square;
                }
            }
        }
        let (mut sums, mut largest) = ([all, stayed], [distance]);
        domain.communicator().reduce(Reduction::Sum, &mut sums);
        domain.communicator().reduce(Reduction::Maximum, &mut largest);
        Outcome { is_followed: sums[1] <= 0.5 * sums[0], distance: largest[0] }
    }

    /// The motion that the solver itself has added to `shape`. Collective.
    pub(super) fn own(self, shape: &[Vector], lent: &ArrayView<'_>, domain: &Domain) -> Own {
        let (mut is_same, mut is_rounding) = (true, true);
        for (vertex, &asked) in shape.iter().enumerate() {
            let now = lent.vector(vertex);
            // Without a difference in the bits nothing is computed anew.
            if now.map(f64::to_bits) != asked.map(f64::to_bits) {
                is_same = false;
                is_rounding = is_rounding && self.holds_at(now, asked);
            }
        }
        let differs = domain.communicator().any(!is_rounding);
        let offset = |(vertex, &asked): (usize, &Vector)| -> Vector {
            let now = lent.vector(vertex);
            std::array::from_fn(|axis| {
                if self.holds(now[axis], asked[axis]) { 0.0 } else { now[axis] - asked[axis] }
            })
        };
        Own {
            lent: (!is_same).then(|| lent.to_vectors().into()),
            offsets: differs.then(|| shape.iter().enumerate().map(offset).collect()),
        }
    }
}

fn norm(a: Vector) -> f64 {
    a[0].hypot(a[1]).hypot(a[2])
}
