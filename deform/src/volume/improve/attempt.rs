//! The sweeps of one improvement, one after the other, and what they have come to.

use std::ops::Range;

use super::{
    Improver,
    sweep::Sweeps,
    worth::{ENOUGH, Qualities},
};
use crate::mesh::Vector;

/// How far beyond what the least quality is to rise to the cells count that hold it down.
const BEYOND: f64 = 0.02;

/// An improvement that is under way.
pub(super) struct Attempt<'a> {
    improver: &'a Improver,
    /// The points, in the improver's numbering.
    near: Vec<Vector>,
    /// The least quality of the cells that cannot be moved.
    fixed: f64,
    /// How many sweeps there may be.
    most: u32,
    /// The points after the last sweep that has gained something.
    pub(super) kept: Vec<Vector>,
    /// Their qualities.
    pub(super) last: Qualities,
    /// Whether any sweep has gained something; a rank may have no points to move.
    pub(super) has_gained: bool,
}

impl<'a> Attempt<'a> {
    /// Begins with points that have the qualities `last`. Collective, as all that follows.
    pub(super) fn new(
        improver: &'a Improver,
        near: Vec<Vector>,
        last: Qualities,
        sweeps: u32,
    ) -> Self {
        let (fixed, kept) = (improver.least_fixed(&near), near.clone());
        Self { improver, near, fixed, most: sweeps, kept, last, has_gained: false }
    }

    /// Sweeps through all vertices that have a cell which is not good, as often as is allowed.
    pub(super) fn sweep_on(&mut self) {
        let sweeps = Sweeps::about(self.improver, &self.near, self.improver.good);
        for _ in 0..self.most {
            let now = self.sweep(&sweeps, 0..self.improver.colours.len());
            self.keep(now);
        }
    }

    /// Lifts the least quality to where it is enough, by the vertices that hold it down.
    pub(super) fn lift_least(&mut self) {
        if self.last.are_enough(self.fixed) {
            return;
        }
        let bound = self.fixed.min(ENOUGH) + BEYOND;
        let sweeps = Sweeps::about(self.improver, &self.near, bound);
        for _ in 0..self.most {
            let now = self.sweep(&sweeps, 0..self.improver.colours.len());
            let lifts = now.lift(&self.last, self.fixed);
            if !now.rise(&self.last, self.fixed) {
                self.near.clone_from(&self.kept);
                return;
            }
            self.keep(now);
            if !lifts || now.are_enough(self.fixed) {
                return;
            }
        }
    }

    /// Raises the mean by the vertices of all worn cells, and the least quality where that is not
    /// enough, as long as sweeps are worth it.
    pub(super) fn raise_mean(&mut self) {
        let colours = self.improver.colours.len();
        let sweeps = Sweeps::about(self.improver, &self.near, self.improver.good);
        let mut tried = 0;
        if self.last.are_enough(self.fixed) {
            tried = colours.min(1);
            sweeps.through(&mut self.near, 0..tried, self.last.least);
            let part = 1.0 / colours.max(1) as f64;
            if !self.improver.qualities(&self.near).are_worth_more(&self.last, self.fixed, part) {
                return;
            }
        }
        for _ in 0..self.most {
            let now = self.sweep(&sweeps, tried..colours);
            tried = 0;
            let worth = now.are_worth_more(&self.last, self.fixed, 1.0);
            if worth || now.are_better(&self.last, self.fixed) {
                self.keep(now);
            }
            if !worth {
                return;
            }
        }
    }

    fn sweep(&mut self, sweeps: &Sweeps<'_>, colours: Range<usize>) -> Qualities {
        sweeps.through(&mut self.near, colours, self.last.least);
        self.improver.qualities(&self.near)
    }

    fn keep(&mut self, now: Qualities) {
        self.kept.clone_from(&self.near);
        (self.last, self.has_gained) = (now, true);
    }
}
