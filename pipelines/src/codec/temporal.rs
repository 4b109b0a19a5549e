//! How earlier frames are used: which of four ways serves each block of points best.

use tombolo_deform::lanes::Lanes;

use super::CodecError;
use super::bytes::Input;
use super::hierarchy::{BLOCK, Stencil};
use super::node::Node;
use super::prediction::{Coefficients, sums_of_each};

/// The coefficients are fitted to about so many points: they say nearly as much as all.
const FITTED_TO: usize = 1024;
/// How often they are fitted.
const ROUNDS: usize = 3;
/// Neighbours alone.
pub(super) const SPACE: u8 = 0;
/// The ways that are fixed: neighbours alone; the last frame alone; the last frame and how the
/// neighbours differ from it. The fourth is fitted to the frame.
const FIXED: [Coefficients; 3] = [[0.0, 1.0, 0.0, 0.0], [0.0; 4], [1.0, 0.0, 0.0, 0.0]];
const FITTED: u8 = 3;
/// Fitted coefficients are whole multiples of the inverse of this.
const PARTS: f32 = 32.0;

/// The way of each block.
pub(super) struct Modes {
    /// One for all, or one for each block.
    modes: Vec<u8>,
    fitted: [i8; 4],
}

impl Modes {
    pub(super) fn uniform(mode: u8) -> Self {
        Self { modes: vec![mode], fitted: [0; 4] }
    }

    /// Adds the way of the next block.
    pub(super) fn push(&mut self, mode: u8) {
        self.modes.push(mode);
    }

    fn uses_fit(&self) -> bool {
        self.modes.contains(&FITTED)
    }

    /// The coefficients of a point.
    #[inline]
    pub(super) fn of(&self, point: usize) -> Coefficients {
        let block = if self.modes.len() == 1 { 0 } else { point / BLOCK };
        self.coefficients(self.modes.get(block).copied().unwrap_or(SPACE))
    }

    /// The coefficients of a way.
    #[inline]
    pub(super) fn coefficients(&self, mode: u8) -> Coefficients {
        match mode {
            FITTED => self.fitted.map(|part| f32::from(part) / PARTS),
            mode => FIXED[usize::from(mode)],
        }
    }

    /// Two bits of the way, where it is one for all; whether it is not; whether a fit is sent.
    pub(super) fn flags(&self) -> u8 {
        let several = self.modes.len() > 1;
        let mode = if several { 0 } else { self.modes.first().copied().unwrap_or(SPACE) };
        mode | u8::from(several) << 2 | u8::from(self.uses_fit()) << 3
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        if self.modes.len() > 1 {
            out.extend(
                self.modes
                    .chunks(4)
                    .map(|four| four.iter().rev().fold(0, |byte, mode| byte << 2 | mode)),
            );
        }
        if self.uses_fit() {
            #[expect(clippy::cast_sign_loss, reason = "the bits are meant")]
            out.extend(self.fitted.map(|part| part as u8));
        }
    }

    pub(super) fn read(
        flags: u8,
        points: usize,
        input: &mut Input<'_>,
    ) -> Result<Self, CodecError> {
        let modes = if flags >> 2 & 1 == 1 {
            let blocks = points.div_ceil(BLOCK);
            let bytes = input.take(blocks.div_ceil(4))?;
            (0..blocks).map(|block| bytes[block / 4] >> (2 * (block % 4)) & 3).collect()
        } else {
            vec![flags & 3]
        };
        let fitted = if flags >> 3 & 1 == 1 { input.array()? } else { [0; 4] };
        #[expect(clippy::cast_possible_wrap, reason = "the bits are meant")]
        Ok(Self { modes, fitted: fitted.map(|part| part as i8) })
    }

    /// One for all, where all are the same or there is none.
    pub(super) fn settle(&mut self) {
        let first = self.modes.first().copied().unwrap_or(SPACE);
        if self.modes.iter().all(|&mode| mode == first) {
            self.modes = vec![first];
        }
    }
}

/// The four ways side by side, to choose from.
pub(super) struct Ways {
    /// For each coefficient its value in each way.
    coefficients: [[f32; 4]; 4],
    fitted: [i8; 4],
    per_step: f32,
}

impl Ways {
    /// The ways for values that stand in the nodes.
    #[inline(always)]
    pub(super) fn new(
        nodes: &[Node],
        stencils: &[Stencil],
        mask: Option<&[bool]>,
        step: f32,
    ) -> Self {
        let fitted = fit(nodes, stencils, mask, step);
        let fit = fitted.map(|part| f32::from(part) / PARTS);
        let ways = [FIXED[0], FIXED[1], FIXED[2], fit];
        let coefficients = [0, 1, 2, 3].map(|index| ways.map(|way| way[index]));
        Self { coefficients, fitted, per_step: 2.0 / step }
    }

    /// No ways chosen yet.
    pub(super) fn modes(&self, points: usize) -> Modes {
        Modes { modes: Vec::with_capacity(points.div_ceil(BLOCK)), fitted: self.fitted }
    }

    /// Adds about the bits that a node's value costs in each way.
    #[inline(always)]
    pub(super) fn add_costs(&self, sums: Node, node: Node, costs: &mut [f32; 4]) {
        let [_, now, before, earlier] = sums.0;
        let [_, value, last, second] = node.0;
        let terms = [now - before, now - last, last - second, before - earlier];
        let mut off = [last - value; 4];
        for (term, coefficients) in terms.iter().zip(&self.coefficients) {
            for way in 0..4 {
                off[way] += term * coefficients[way];
            }
        }
        for way in 0..4 {
            costs[way] += logarithm(1.0 + self.per_step * off[way].abs());
        }
    }
}

/// The way that costs least.
pub(super) fn cheapest(costs: [f32; 4]) -> u8 {
    // The fit costs four bytes and other ways than one two bits a block: the last way first, so that
    // equals are all the same.
    let least = |&a: &u8, &b: &u8| costs[usize::from(a)].total_cmp(&costs[usize::from(b)]);
    (0u8..4).rev().min_by(least).unwrap_or(SPACE)
}

/// About the logarithm to base 2 of a number from 1 on: exact for powers of two, a line between them.
#[inline(always)]
#[expect(clippy::cast_possible_wrap, reason = "the sign's bit is not set")]
fn logarithm(number: f32) -> f32 {
    (number.to_bits() as i32 as f32) * (1.0 / 8_388_608.0) - 127.0
}

/// The coefficients with about the least sum of what is left, which is about what it costs. Squares
/// would be above all those of a few points: each point has the weight of the inverse of what the
/// last coefficients left of it, at first of what the fixed ways did.
#[inline(always)]
fn fit(nodes: &[Node], stencils: &[Stencil], mask: Option<&[bool]>, step: f32) -> [i8; 4] {
    let masked = mask.map_or(0, |mask| mask.iter().filter(|&&is_masked| is_masked).count());
    let stride = (nodes.len() - masked).div_ceil(FITTED_TO).max(1);
    let mut points =
        (0..nodes.len()).step_by(stride).filter(|&point| mask.is_none_or(|mask| !mask[point]));
    let mut samples = Vec::with_capacity(FITTED_TO);
    let mut several = [(0, Node::ZERO); BLOCK];
    loop {
        let several = sums_of_each(nodes, stencils, &mut points, &mut several);
        for &(point, sums) in several {
            let [_, now, before, earlier] = sums.0;
            let [_, value, last, second] = nodes[point].0;
            let terms = [now - before, now - last, last - second, before - earlier];
            let change = value - last;
            let off = change.abs().min((change - terms[0]).abs()).min((change - terms[1]).abs());
            samples.push((terms, change, off));
        }
        if several.len() < BLOCK {
            break;
        }
    }
    let mut fitted = [0.0; 4];
    for _ in 0..ROUNDS {
        let (mut matrix, mut right) = ([Lanes::ZERO; 4], Lanes::ZERO);
        for (terms, change, off) in &samples {
            let terms = Lanes(terms.map(f64::from));
            let weighted = Lanes::all(f64::from(1.0 / (step + off))) * terms;
            for (row, term) in matrix.iter_mut().zip(terms.0) {
                *row += Lanes::all(term) * weighted;
            }
            right += Lanes::all(f64::from(*change)) * weighted;
        }
        fitted = solve(matrix.map(|row| row.0), right.0);
        #[expect(clippy::cast_possible_truncation, reason = "to weigh points by")]
        let by = fitted.map(|part| part as f32);
        for (terms, change, off) in &mut samples {
            let [a, b, c, d] = *terms;
            *off = (a * by[0] + b * by[1] + (c * by[2] + d * by[3]) - *change).abs();
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "it saturates, and NaN becomes zero")]
    fitted.map(|part| (part * f64::from(PARTS)).round_ties_even() as i8)
}

/// Solves a system whose matrix is symmetric and as good as positive definite.
#[expect(clippy::needless_range_loop, reason = "the indices of a matrix")]
fn solve(mut matrix: [[f64; 4]; 4], mut right: [f64; 4]) -> [f64; 4] {
    let trace: f64 = (0..4).map(|index| matrix[index][index]).sum();
    for (index, row) in matrix.iter_mut().enumerate() {
        row[index] += 1e-9 * trace + 1e-300;
    }
    for pivot in 0..4 {
        for row in pivot + 1..4 {
            let factor = matrix[row][pivot] / matrix[pivot][pivot];
            for column in pivot..4 {
                matrix[row][column] -= factor * matrix[pivot][column];
            }
            right[row] -= factor * right[pivot];
        }
    }
    for row in (0..4).rev() {
        for column in row + 1..4 {
            right[row] -= matrix[row][column] * right[column];
        }
        right[row] /= matrix[row][row];
    }
    right
}
