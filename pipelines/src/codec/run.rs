//! A run of points, of which none is predicted from another: what is known of them, number by number,
//! so that a processor works on several at once.
#![expect(clippy::needless_range_loop, reason = "loops over lists side by side, which vectorise")]

use std::ops::Range;

use super::hierarchy::{BLOCK, Hierarchy};
use super::node::Node;
use super::prediction::{Coefficients, predict};

/// The number of contexts.
pub(super) const CLASSES: usize = 17;
/// Where each context but the first begins.
const EDGES: [u16; CLASSES - 1] =
    [1, 3, 5, 8, 12, 17, 25, 35, 49, 70, 101, 145, 232, 377, 638, 1160];
/// No difference counts for more than this in a context.
const MOST: f32 = 64.0;
/// The weights of the last frame's difference and of the preceding component's.
const LAST: f32 = 20.0;
const BESIDE: f32 = 12.0;

/// Everything that goes with a plane.
#[derive(Clone, Copy)]
pub(super) struct Around<'a> {
    pub(super) hierarchy: &'a Hierarchy,
    /// The points whose values are known without.
    pub(super) mask: Option<&'a [bool]>,
    /// The component before this one.
    pub(super) beside: Option<&'a [Node]>,
    /// Grid steps in a step of the difference.
    pub(super) step: f32,
    /// Whether the frame goes on from earlier ones.
    pub(super) follows: bool,
}

/// The class of each sum of magnitudes, which is a whole number below 2¹³.
static CLASS: [u8; 1 << 13] = {
    let mut classes = [0; 1 << 13];
    let (mut value, mut class) = (0, 0);
    while value < classes.len() {
        if class < EDGES.len() && value >= EDGES[class] as usize {
            class += 1;
        } else {
            classes[value] = class as u8;
            value += 1;
        }
    }
    classes
};

/// The nearest whole number, the even one of two; by adding and subtracting a number that has no
/// digits behind the point. Beyond 2²² it is even, and below -2²²
/// halves stay: the same on both sides.
#[inline(always)]
fn nearest(value: f32) -> f32 {
    const WHOLE: f32 = 12_582_912.0;
    (value + WHOLE) - WHOLE
}

/// The points of a run, but for those with a mask: where they stand, the sums of their neighbours, and
/// their own values in the two frames before; then what is coded of them.
pub(super) struct Run {
    count: usize,
    start: usize,
    /// Where they stand behind the start, if that is not one after the other.
    places: Option<[u8; BLOCK]>,
    sums: [[f32; BLOCK]; 3],
    own: [[f32; BLOCK]; 2],
    contexts: [f32; BLOCK],
    classes: [u8; BLOCK],
    near: [f32; BLOCK],
    magnitudes: [f32; BLOCK],
    now: [f32; BLOCK],
}

impl Run {
    /// A run without points, of a frame with or without a mask.
    pub(super) fn new(has_mask: bool) -> Self {
        Self {
            count: 0,
            start: 0,
            places: has_mask.then_some([0; BLOCK]),
            sums: [[0.0; BLOCK]; 3],
            own: [[0.0; BLOCK]; 2],
            contexts: [0.0; BLOCK],
            classes: [0; BLOCK],
            near: [0.0; BLOCK],
            magnitudes: [0.0; BLOCK],
            now: [0.0; BLOCK],
        }
    }

    /// Takes up the points of a run with their sums.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "a block has 256 places")]
    pub(super) fn take(
        &mut self,
        nodes: &[Node],
        around: &Around<'_>,
        run: Range<usize>,
        sums: &[Node; BLOCK],
    ) {
        self.start = run.start;
        let nodes = &nodes[run.clone()];
        let sums = &sums[..nodes.len()];
        self.count = nodes.len();
        if let (Some(mask), Some(places)) = (around.mask, &mut self.places) {
            let mut count = 0;
            for (index, &is_masked) in mask[run.clone()].iter().enumerate() {
                if !is_masked {
                    places[count] = index as u8;
                    count += 1;
                }
            }
            self.count = count;
            for at in 0..count {
                let index = usize::from(places[at]);
                let [magnitude, now, before, earlier] = sums[index].0;
                let [last_magnitude, _, last, second] = nodes[index].0;
                self.contexts[at] = magnitude + LAST * last_magnitude;
                self.sums[0][at] = now;
                self.sums[1][at] = before;
                self.sums[2][at] = earlier;
                self.own[0][at] = last;
                self.own[1][at] = second;
            }
        } else if around.follows {
            for index in 0..nodes.len() {
                let [magnitude, now, before, earlier] = sums[index].0;
                let [last_magnitude, _, last, second] = nodes[index].0;
                self.contexts[index] = magnitude + LAST * last_magnitude;
                self.sums[0][index] = now;
                self.sums[1][index] = before;
                self.sums[2][index] = earlier;
                self.own[0][index] = last;
                self.own[1][index] = second;
            }
        } else {
            // Those before are zero.
            for index in 0..nodes.len() {
                self.contexts[index] = sums[index].magnitude();
                self.sums[0][index] = sums[index].now();
            }
        }
        if let Some(beside) = around.beside {
            let beside = &beside[run];
            match &self.places {
                Some(places) => {
                    for at in 0..self.count {
                        let beside = beside[usize::from(places[at])];
                        self.contexts[at] += BESIDE * beside.magnitude();
                    }
                }
                None => {
                    for (context, beside) in self.contexts.iter_mut().zip(beside) {
                        *context += BESIDE * beside.magnitude();
                    }
                }
            }
        }
    }

    /// Works out the predictions and the classes.
    #[inline(always)]
    pub(super) fn predict(&mut self, by: Coefficients) {
        let count = self.count;
        let [now, before, earlier] = self.sums.each_ref().map(|sums| &sums[..count]);
        let [last, second] = self.own.each_ref().map(|own| &own[..count]);
        let (near, contexts) = (&mut self.near[..count], &self.contexts[..count]);
        let classes = &mut self.classes[..count];
        for index in 0..count {
            let sums = Node([0.0, now[index], before[index], earlier[index]]);
            let node = Node([0.0, 0.0, last[index], second[index]]);
            near[index] = nearest(predict(sums, node, by));
        }
        for index in 0..count {
            // With 2²³ added, the number stands in the lowest bits.
            let context = (contexts[index] + 8_388_608.0).to_bits() as usize;
            classes[index] = CLASS[context % CLASS.len()];
        }
    }

    /// How many points there are.
    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Where a point stands.
    #[inline(always)]
    pub(super) fn place(&self, at: usize) -> usize {
        self.start + self.places.as_ref().map_or(at, |places| usize::from(places[at]))
    }

    /// Takes for each point what a list has at its place.
    #[inline(always)]
    pub(super) fn gather(&self, list: &[f64], to: &mut [f64]) {
        let list = &list[self.start..];
        match &self.places {
            None => to.copy_from_slice(&list[..to.len()]),
            Some(places) => {
                for (to, &index) in to.iter_mut().zip(places) {
                    *to = list[usize::from(index)];
                }
            }
        }
    }

    /// Their classes.
    #[inline(always)]
    pub(super) fn classes(&self) -> &[u8] {
        &self.classes[..self.count]
    }

    /// Their predictions.
    #[inline(always)]
    pub(super) fn near(&self) -> &[f32] {
        &self.near[..self.count]
    }

    /// Takes up so many steps of this size beside each prediction.
    #[inline(always)]
    pub(super) fn step(&mut self, size: f32, steps: &[f32]) {
        let (count, steps) = (self.count, &steps[..self.count]);
        let (near, now) = (&self.near[..count], &mut self.now[..count]);
        let magnitudes = &mut self.magnitudes[..count];
        for index in 0..count {
            now[index] = near[index] + size * steps[index];
            magnitudes[index] = steps[index].abs().min(MOST);
        }
    }

    /// The values now.
    #[inline(always)]
    pub(super) fn now(&self) -> &[f32] {
        &self.now[..self.count]
    }

    /// Puts the values and their magnitudes into the nodes.
    #[inline(always)]
    pub(super) fn put(&self, nodes: &mut [Node]) {
        let nodes = &mut nodes[self.start..];
        let (now, magnitudes) = (&self.now[..self.count], &self.magnitudes[..self.count]);
        match &self.places {
            None => {
                for ((node, &now), &magnitude) in nodes.iter_mut().zip(now).zip(magnitudes) {
                    node.set(magnitude, now);
                }
            }
            Some(places) => {
                for ((&index, &now), &magnitude) in places.iter().zip(now).zip(magnitudes) {
                    nodes[usize::from(index)].set(magnitude, now);
                }
            }
        }
    }
}
