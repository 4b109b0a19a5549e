//! How earlier frames are used: which of four ways serves each block of points best.

use super::CodecError;
use super::bytes::Input;
use super::hierarchy::Stencil;
use super::prediction::{Coefficients, Node, predict, sums};

/// The number of points that share a way of prediction.
pub(super) const BLOCK: usize = 256;
/// From so many points on, one of so many is asked which way is best: it takes a third less time,
/// and costs two bits in a hundred.
const SAMPLED: [usize; 2] = [1 << 16, 3];
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

    fn uses_fit(&self) -> bool {
        self.modes.contains(&FITTED)
    }

    /// The coefficients of a point.
    #[inline]
    pub(super) fn of(&self, point: usize) -> Coefficients {
        let block = if self.modes.len() == 1 { 0 } else { point / BLOCK };
        match self.modes.get(block).copied().unwrap_or(SPACE) {
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

    /// The best ways for values that stand in the nodes' first place. The neighbours are taken as
    /// they are, not as they will be coded.
    pub(super) fn best(
        nodes: &[Node],
        stencils: &[Stencil],
        mask: Option<&[bool]>,
        step: f32,
    ) -> Self {
        let is_masked = |point: usize| mask.is_some_and(|mask| mask[point]);
        let fitted = fit(nodes, stencils, is_masked);
        let fit = fitted.map(|part| f32::from(part) / PARTS);
        let ways = [FIXED[0], FIXED[1], FIXED[2], fit];
        let per_step = 2.0 / step;
        let stride = if nodes.len() < SAMPLED[0] { 1 } else { SAMPLED[1] };
        let mut modes = Vec::with_capacity(nodes.len() / BLOCK + 1);
        for block in 0..nodes.len().div_ceil(BLOCK) {
            let mut costs = [0.0f32; 4];
            let points = block * BLOCK..nodes.len().min((block + 1) * BLOCK);
            for point in points.step_by(stride) {
                if is_masked(point) {
                    continue;
                }
                let sums = sums(nodes, &stencils[point]);
                for (cost, by) in costs.iter_mut().zip(ways) {
                    let off = (predict(sums, nodes[point], by) - nodes[point][0]).abs();
                    *cost += logarithm(1.0 + per_step * off);
                }
            }
            // The fit costs four bytes and other ways than one two bits a block: the last way
            // first, so that equals are all the same.
            let best = (0u8..4)
                .rev()
                .min_by(|&a, &b| costs[usize::from(a)].total_cmp(&costs[usize::from(b)]));
            modes.push(best.unwrap_or(SPACE));
        }
        modes.dedup_if_uniform();
        Self { modes, fitted }
    }
}

trait Uniform {
    fn dedup_if_uniform(&mut self);
}

impl Uniform for Vec<u8> {
    /// One entry, where all are the same or there is none.
    fn dedup_if_uniform(&mut self) {
        let first = self.first().copied().unwrap_or(SPACE);
        if self.iter().all(|&mode| mode == first) {
            *self = vec![first];
        }
    }
}

/// About the logarithm to base 2 of a number from 1 on: exact for powers of two, a line between them.
fn logarithm(number: f32) -> f32 {
    (number.to_bits() as f32) * (1.0 / 8_388_608.0) - 127.0
}

/// The coefficients with the least squares of what is left.
#[expect(clippy::needless_range_loop, reason = "the indices of a matrix")]
fn fit(nodes: &[Node], stencils: &[Stencil], is_masked: impl Fn(usize) -> bool) -> [i8; 4] {
    let (mut matrix, mut right) = ([[0.0f64; 4]; 4], [0.0f64; 4]);
    // Some thousand points say as much as all.
    let stride = nodes.len().div_ceil(16384).max(1);
    for point in (0..nodes.len()).step_by(stride) {
        if is_masked(point) {
            continue;
        }
        let [now, before, earlier, _] = sums(nodes, &stencils[point]).map(f64::from);
        let [value, last, second, _] = nodes[point].map(f64::from);
        let terms = [now - before, now - last, last - second, before - earlier];
        for row in 0..4 {
            for column in 0..4 {
                matrix[row][column] += terms[row] * terms[column];
            }
            right[row] += terms[row] * (value - last);
        }
    }
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
    #[expect(clippy::cast_possible_truncation, reason = "it saturates, and NaN becomes zero")]
    right.map(|part| (part * f64::from(PARTS)).round_ties_even() as i8)
}
