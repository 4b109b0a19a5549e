//! Triangles, one after the other, each across an edge of one that is known.
//!
//! The known triangles have an outline, a ring of directed gates or several of them. The first gate
//! in line is taken: either nothing is behind it, or one triangle, whose third point is new, or the
//! one before or after the gate on the outline, or any other that is known. Decoder and encoder walk
//! together, see `walk`.

use std::collections::VecDeque;

use super::CodecError;
use super::bits::{Bits, Model, Number};

/// Nothing, where a number of a gate or a point is expected.
const NONE: u32 = u32::MAX;
/// How many triangles at a point are told apart.
const DEGREES: usize = 10;

/// The third point behind a gate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Third {
    /// There is no triangle.
    Nothing,
    /// A point that no triangle had before.
    New,
    /// A point that is known.
    Known(u32),
}

/// The place where a new point is expected: opposite `opposite` across the edge of the other two.
#[derive(Debug, Clone, Copy)]
pub(super) struct Across {
    pub(super) ends: [u32; 2],
    pub(super) opposite: u32,
}

/// Who knows what lies behind a gate; the decoder learns it from what is coded.
pub(super) trait Guide<B: Bits> {
    /// The triangle to begin the next part with, with its points as they are numbered so far; a new
    /// one is `fresh`, then `fresh + 1` and so on. `None` where all triangles are coded.
    fn seed(&mut self, fresh: u32) -> Option<[u32; 3]>;

    /// The third point of the triangle behind a gate.
    fn behind(&mut self, gate: [u32; 2]) -> Third;

    /// A new point of the walk: codes what goes with it.
    fn point(&mut self, bits: &mut B, point: u32, across: Option<Across>)
    -> Result<(), CodecError>;

    /// A new triangle of the walk, across an edge of the triangle `beside`.
    fn triangle(
        &mut self,
        bits: &mut B,
        triangle: [u32; 3],
        beside: Option<u32>,
    ) -> Result<(), CodecError>;
}

/// A directed edge of the outline, seen from the side where nothing is known yet.
#[derive(Debug, Clone, Copy)]
struct Gate {
    from: u32,
    to: u32,
    before: u32,
    after: u32,
    /// The third point of the triangle on the known side, and the triangle's number.
    opposite: u32,
    triangle: u32,
    is_open: bool,
}

struct Models {
    more: Model,
    seed_new: [Model; 3],
    seed_point: Number,
    is_new: Vec<Model>,
    is_before: Vec<Model>,
    is_after: Vec<Model>,
    is_nothing: Model,
    known: Number,
}

impl Models {
    fn new() -> Self {
        let contexts = vec![Model::NEW; 4 * DEGREES * DEGREES];
        Self {
            more: Model::NEW,
            seed_new: [Model::NEW; 3],
            seed_point: Number::NEW,
            is_new: contexts.clone(),
            is_before: contexts.clone(),
            is_after: contexts,
            is_nothing: Model::NEW,
            known: Number::NEW,
        }
    }
}

/// The outline of what is known so far.
struct Outline {
    gates: Vec<Gate>,
    line: VecDeque<u32>,
    /// The last gate that was made at each point, and how many triangles the point has.
    last_from: Vec<u32>,
    degree: Vec<u8>,
}

impl Outline {
    fn push(&mut self, gate: Gate) -> u32 {
        #[expect(clippy::cast_possible_truncation, reason = "three for each triangle at most")]
        let index = self.gates.len() as u32;
        self.last_from[gate.from as usize] = index;
        self.gates.push(gate);
        self.line.push_back(index);
        index
    }

    fn join(&mut self, before: u32, after: u32) {
        self.gates[before as usize].after = after;
        self.gates[after as usize].before = before;
    }

    fn close(&mut self, gate: u32) {
        self.gates[gate as usize].is_open = false;
    }

    fn fresh(&mut self) {
        self.last_from.push(NONE);
        self.degree.push(0);
    }

    fn count(&mut self, triangle: [u32; 3]) {
        for point in triangle {
            let degree = &mut self.degree[point as usize];
            *degree = degree.saturating_add(1);
        }
    }
}

/// Walks over all triangles and codes what is met. Returns the number of points that were met.
#[expect(clippy::cast_possible_truncation, reason = "points and triangles have 32 bits")]
pub(super) fn walk<B: Bits, G: Guide<B>>(
    bits: &mut B,
    guide: &mut G,
    most_points: usize,
) -> Result<u32, CodecError> {
    let mut models = Models::new();
    let mut outline = Outline {
        gates: Vec::new(),
        line: VecDeque::new(),
        last_from: Vec::new(),
        degree: Vec::new(),
    };
    let (mut fresh, mut triangles) = (0u32, 0u32);
    let mut last_was_new = 0;
    let too_many = CodecError::Damaged("more points than the message states");
    loop {
        let seed = guide.seed(fresh);
        if !bits.bit(&mut models.more, seed.is_some())? {
            return Ok(fresh);
        }
        let wanted = seed.unwrap_or([NONE; 3]);
        let mut triangle = [0; 3];
        for corner in 0..3 {
            let is_new = bits.bit(&mut models.seed_new[corner], wanted[corner] == fresh)?;
            triangle[corner] = if is_new {
                if fresh as usize >= most_points {
                    return Err(too_many);
                }
                fresh += 1;
                outline.fresh();
                let across =
                    (fresh > 1).then(|| Across { ends: [fresh - 2; 2], opposite: fresh - 2 });
                guide.point(bits, fresh - 1, across)?;
                fresh - 1
            } else {
                let back = fresh.wrapping_sub(1).wrapping_sub(wanted[corner]);
                known(bits.number(&mut models.seed_point, u64::from(back))?, fresh)?
            };
        }
        guide.triangle(bits, triangle, None)?;
        outline.count(triangle);
        let [a, b, c] = triangle;
        let base = outline.gates.len() as u32;
        for (index, (from, to, opposite)) in
            [(b, a, c), (a, c, b), (c, b, a)].into_iter().enumerate()
        {
            let index = index as u32;
            let (before, after) = (base + (index + 2) % 3, base + (index + 1) % 3);
            let gate =
                Gate { from, to, before, after, opposite, triangle: triangles, is_open: true };
            outline.push(gate);
        }
        triangles += 1;

        while let Some(index) = outline.line.pop_front() {
            let gate = outline.gates[index as usize];
            if !gate.is_open {
                continue;
            }
            let Gate { from: x, to: y, before, after, .. } = gate;
            let [at_before, at_after] = [before, after].map(|gate| outline.gates[gate as usize]);
            let has_before = before != index && at_before.is_open && at_before.to == x;
            let has_after = after != index && at_after.is_open && at_after.from == y;
            let [point_before, point_after] = [
                if has_before { at_before.from } else { NONE },
                if has_after { at_after.to } else { NONE },
            ];
            let degree = |point: u32| usize::from(outline.degree[point as usize]).min(DEGREES - 1);
            let context = (degree(x) * DEGREES + degree(y)) * 4
                + 2 * last_was_new
                + usize::from(point_before == point_after);

            let third = guide.behind([x, y]);
            let is_new = bits.bit(&mut models.is_new[context], third == Third::New)?;
            last_was_new = usize::from(is_new);
            let mut is_before = false;
            let mut is_after = false;
            if !is_new && has_before {
                let wanted = third == Third::Known(point_before);
                is_before = bits.bit(&mut models.is_before[context], wanted)?;
            }
            if !is_new && has_after && !(is_before && point_before != point_after) {
                // Where both are the same point, it closes both gates or neither.
                is_after = if is_before {
                    true
                } else {
                    bits.bit(&mut models.is_after[context], third == Third::Known(point_after))?
                };
            }
            let k = if is_new {
                if fresh as usize >= most_points {
                    return Err(too_many);
                }
                fresh += 1;
                outline.fresh();
                let across = Across { ends: [x, y], opposite: gate.opposite };
                guide.point(bits, fresh - 1, Some(across))?;
                fresh - 1
            } else if is_before {
                point_before
            } else if is_after {
                point_after
            } else if bits.bit(&mut models.is_nothing, third == Third::Nothing)? {
                outline.close(index);
                continue;
            } else {
                let point = if let Third::Known(point) = third { point } else { NONE };
                let back = fresh.wrapping_sub(1).wrapping_sub(point);
                known(bits.number(&mut models.known, u64::from(back))?, fresh)?
            };
            let triangle = [x, y, k];
            guide.triangle(bits, triangle, Some(gate.triangle))?;
            outline.count(triangle);
            outline.close(index);

            // What of the ring lies on both sides of what is new.
            let split = if is_new || is_before || is_after {
                NONE
            } else {
                let last = outline.last_from[k as usize];
                let is_there = last != NONE && outline.gates[last as usize].is_open;
                if is_there { last } else { NONE }
            };
            let first = (!is_before).then(|| {
                let gate = Gate { to: k, opposite: y, triangle: triangles, ..gate };
                outline.push(gate)
            });
            let second = (!is_after).then(|| {
                let gate = Gate { from: k, opposite: x, triangle: triangles, ..gate };
                outline.push(gate)
            });
            triangles += 1;
            if is_before {
                outline.close(before);
            }
            if is_after {
                outline.close(after);
            }
            match (first, second) {
                (Some(first), Some(second)) if split == NONE => {
                    outline.join(before_of(before, index, second), first);
                    outline.join(first, second);
                    outline.join(second, before_of(after, index, first));
                }
                (Some(first), Some(second)) => {
                    // From x to k and on with the ring there; from the ring before k to y.
                    let into = outline.gates[split as usize].before;
                    let (before, after) =
                        (before_of(before, index, second), before_of(after, index, first));
                    if split == after {
                        outline.join(before, first);
                        outline.join(first, after);
                        outline.join(second, second);
                    } else {
                        outline.join(before, first);
                        outline.join(first, split);
                        outline.join(into, second);
                        outline.join(second, after);
                    }
                }
                (Some(first), None) => {
                    // k is behind the gate after this one.
                    let beyond = outline.gates[after as usize].after;
                    outline.join(before_of(before, after, first), first);
                    outline.join(first, before_of(beyond, index, first));
                }
                (None, Some(second)) => {
                    let beyond = outline.gates[before as usize].before;
                    outline.join(before_of(beyond, index, second), second);
                    outline.join(second, before_of(after, before, second));
                }
                (None, None) => {
                    // A ring closes, or two ends of one that goes on.
                    let into = outline.gates[before as usize].before;
                    let out = outline.gates[after as usize].after;
                    outline.join(into, out);
                }
            }
        }
    }
}

/// `gate`, or `instead` where it is `gone`.
fn before_of(gate: u32, gone: u32, instead: u32) -> u32 {
    if gate == gone { instead } else { gate }
}

/// A point that is known, from how many are newer.
#[expect(clippy::cast_possible_truncation, reason = "below `fresh`")]
fn known(back: u64, fresh: u32) -> Result<u32, CodecError> {
    if back < u64::from(fresh) {
        Ok(fresh - 1 - back as u32)
    } else {
        Err(CodecError::Damaged("a triangle names a point that is not known yet"))
    }
}
