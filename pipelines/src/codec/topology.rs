//! The cells and reference positions of a mesh, in one message.

use std::sync::OnceLock;

use super::CodecError;
use super::bits::{Reader, Writer};
use super::bytes::{Input, put_count};
use super::cells::{MOST_STEPS, Unknown, Walked, code};
use super::hierarchy::Hierarchy;
use super::known::Known;

/// The most points, triangles and lines together that a byte of a message stands for.
const PER_BYTE: usize = 1024;
/// The most points, triangles and lines together.
const MOST: usize = 1 << 27;

/// The cells and the reference positions of a mesh of triangles and lines, as they are decoded.
/// Points have the numbers that are their indices in the hierarchy.
#[derive(Debug, Clone)]
pub struct Topology {
    points: Hierarchy,
    positions: Vec<[i32; 3]>,
    step: f64,
    offset: [f64; 3],
    triangles: Vec<[u32; 3]>,
    features: Option<Vec<u32>>,
    lines: Vec<[u32; 2]>,
    elements: OnceLock<Hierarchy>,
}

/// A topology, its message, and where everything came from.
#[derive(Debug, Clone)]
pub struct Coded {
    /// The topology as a decoder will return it.
    pub topology: Topology,
    /// The bytes.
    pub message: Vec<u8>,
    /// For each point as it will be decoded, the point that it was.
    pub points: Vec<u32>,
    /// For each triangle as it will be decoded, the triangle that it was.
    pub triangles: Vec<u32>,
}

impl Topology {
    /// Codes the triangles, the feature of each, and the lines between these points, and their
    /// positions within `bound`. Triangles and points change their order, and a triangle may begin
    /// with another of its corners; lines stay as they are.
    ///
    /// # Errors
    /// [`CodecError::Point`] where a cell names a point that there is none of,
    /// [`CodecError::Length`] where there is not one feature for each triangle,
    /// [`CodecError::Positions`] where the positions are not finite or the bound is less than about
    /// 2⁻²⁹ of their extent.
    pub fn encode(
        points: &[[f64; 3]],
        triangles: &[[u32; 3]],
        features: Option<&[u32]>,
        lines: &[[u32; 2]],
        bound: f64,
    ) -> Result<Coded, CodecError> {
        let count = points.len();
        let named = triangles.as_flattened().iter().chain(lines.as_flattened());
        if let Some(&point) = named.clone().find(|&&point| point as usize >= count) {
            return Err(CodecError::Point { point, points: count });
        }
        let (found, expected) = (features.map_or(triangles.len(), <[u32]>::len), triangles.len());
        if found != expected {
            return Err(CodecError::Length { found, expected });
        }
        let total = count + triangles.len() + lines.len();
        check_total(total as u64, MOST)?;
        let (positions, step, offset) = grid(points, bound).ok_or(CodecError::Positions)?;

        let mut message = Vec::new();
        put_count(&mut message, count);
        put_count(&mut message, triangles.len());
        put_count(&mut message, lines.len());
        message.push(u8::from(features.is_some()));
        message.extend(step.to_le_bytes());
        message.extend(offset.iter().flat_map(|offset| offset.to_le_bytes()));
        let mut bits = Writer::new();
        let mut source = Known::new(&positions, triangles, features, lines);
        let coded = code(&mut bits, &mut source, count, triangles.len(), lines.len())?;
        message.extend(bits.finish());
        message.resize(message.len().max(total.div_ceil(PER_BYTE)), 0);

        let Known { old_points, old_triangles, .. } = source;
        let topology = Self::new(coded, step, offset, features.is_some());
        let order = topology.points.order();
        let points = order.iter().map(|&point| old_points[point as usize]).collect();
        Ok(Coded { topology, message, points, triangles: old_triangles })
    }

    /// Reads a message.
    ///
    /// # Errors
    /// [`CodecError`]. Takes no more memory than some hundred bytes for each point, triangle and
    /// line, of which there are at most 1024 for each byte of the message.
    pub fn decode(message: &[u8]) -> Result<Self, CodecError> {
        let mut input = Input(message);
        let [points, triangles, lines] = [input.count()?, input.count()?, input.count()?];
        let total = points as u64 + triangles as u64 + lines as u64;
        check_total(total, MOST.min(message.len().saturating_mul(PER_BYTE)))?;
        let has_features = input.byte()? & 1 == 1;
        let step = input.double()?;
        let offset = [input.double()?, input.double()?, input.double()?];
        if !step.is_finite() || offset.iter().any(|offset| !offset.is_finite()) {
            return Err(CodecError::Positions);
        }
        let mut source = Unknown { has_features };
        let coded = code(&mut Reader::new(input.0), &mut source, points, triangles, lines)?;
        Ok(Self::new(coded, step, offset, has_features))
    }

    fn new(coded: Walked, step: f64, offset: [f64; 3], has_features: bool) -> Self {
        let Walked { positions, mut triangles, features, mut lines, .. } = coded;
        let sides = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
        let edges = triangles.iter().flat_map(sides).chain(lines.iter().copied());
        let points = Hierarchy::new(&positions, edges);
        let mut index_of = vec![0u32; positions.len()];
        for (index, &point) in (0u32..).zip(points.order()) {
            index_of[point as usize] = index;
        }
        let cells = triangles.as_flattened_mut().iter_mut().chain(lines.as_flattened_mut());
        cells.for_each(|point| *point = index_of[*point as usize]);
        let positions = points.order().iter().map(|&point| positions[point as usize]).collect();
        let features = has_features.then_some(features);
        let elements = OnceLock::new();
        Self { points, positions, step, offset, triangles, features, lines, elements }
    }

    /// The hierarchy of the points.
    #[must_use]
    pub fn points(&self) -> &Hierarchy {
        &self.points
    }

    /// The hierarchy of the elements: triangles, and after them lines. Worked out when it is first
    /// asked for.
    #[must_use]
    pub fn elements(&self) -> &Hierarchy {
        self.elements.get_or_init(|| {
            let position = |point: u32| self.positions[point as usize];
            let centres: Vec<[i32; 3]> = (self.triangles.iter())
                .map(|&corners| {
                    let [a, b, c] = corners.map(position);
                    std::array::from_fn(|axis| a[axis] + b[axis] + c[axis])
                })
                .chain(self.lines.iter().map(|&ends| {
                    let [a, b] = ends.map(position);
                    std::array::from_fn(|axis| a[axis] + b[axis] + (a[axis] + b[axis]) / 2)
                }))
                .collect();
            let edges = shared(&self.triangles, &self.lines);
            Hierarchy::new(&centres, edges.iter().copied())
        })
    }

    /// The triangles, by the indices of their points.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The feature of each triangle.
    #[must_use]
    pub fn features(&self) -> Option<&[u32]> {
        self.features.as_deref()
    }

    /// The lines, by the indices of their points.
    #[must_use]
    pub fn lines(&self) -> &[[u32; 2]] {
        &self.lines
    }

    /// The reference positions.
    #[must_use]
    pub fn positions(&self) -> Vec<[f64; 3]> {
        let at = |position: &[i32; 3]| {
            std::array::from_fn(|axis| self.offset[axis] + self.step * f64::from(position[axis]))
        };
        self.positions.iter().map(at).collect()
    }
}

fn check_total(found: u64, most: usize) -> Result<(), CodecError> {
    if found > most as u64 {
        let what = "points, triangles and lines";
        return Err(CodecError::TooLarge { what, found, most: most as u64 });
    }
    Ok(())
}

/// Positions as whole steps from an offset.
type Grid = (Vec<[i32; 3]>, f64, [f64; 3]);

fn grid(points: &[[f64; 3]], bound: f64) -> Option<Grid> {
    let mut offset = points.first().copied().unwrap_or_default();
    let mut largest = offset;
    for point in points {
        for axis in 0..3 {
            offset[axis] = offset[axis].min(point[axis]);
            largest[axis] = largest[axis].max(point[axis]);
        }
    }
    // A little less than twice the bound, for the rounding of the numbers themselves.
    let step = 2.0 * bound * (1.0 - 1e-9);
    let extent = (0..3).map(|axis| largest[axis] - offset[axis]).fold(0.0, f64::max);
    let step = if extent == 0.0 { 1.0 } else { step };
    if !bound.is_finite() || !step.is_normal() || extent.is_nan() || extent / step >= MOST_STEPS {
        return None;
    }
    let mut positions = Vec::with_capacity(points.len());
    for point in points {
        let mut position = [0; 3];
        for axis in 0..3 {
            let steps = ((point[axis] - offset[axis]) / step).round_ties_even();
            let off = (offset[axis] + step * steps - point[axis]).abs();
            if off.is_nan() || off > bound {
                return None;
            }
            #[expect(clippy::cast_possible_truncation, reason = "checked above")]
            {
                position[axis] = steps as i32;
            }
        }
        positions.push(position);
    }
    Some((positions, step, offset))
}

/// Pairs of elements that share an edge, or a point where they are lines.
#[expect(clippy::cast_possible_truncation, reason = "elements are numbered with 32 bits")]
fn shared(triangles: &[[u32; 3]], lines: &[[u32; 2]]) -> Vec<[u32; 2]> {
    let mut sides: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * triangles.len() + 2 * lines.len());
    for (&[a, b, c], element) in triangles.iter().zip(0u32..) {
        let sorted = [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)]);
        sides.extend(sorted.map(|side| (side, element)));
    }
    for (ends, element) in lines.iter().zip(triangles.len() as u32..) {
        // No side of a triangle ends beyond the last point.
        sides.extend(ends.map(|point| ([point, u32::MAX], element)));
    }
    sides.sort_unstable();
    let next_to = sides.windows(2).filter(|pair| pair[0].0 == pair[1].0);
    next_to.map(|pair| [pair[0].1, pair[1].1]).collect()
}
