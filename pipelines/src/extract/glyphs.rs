//! Arrows and spheres that show a field.

use std::collections::HashMap;
use std::sync::Arc;

use tombolo_deform::bounds::Bounds;
use tombolo_deform::communicator::{Communicator, Reader, Reduction, Writer};
use tombolo_deform::distributed::DistributedError;
use tombolo_deform::mesh::{CellType, Cells, Vector};
use tombolo_deform::number::real;
use tombolo_deform::vector::{cross, dot, length, scale, subtract, unit};

use super::gather::{Rows, weighted};
use super::input::Input;
use super::pattern::{Base, Pattern};
use super::probe::{Finder, Found, keys};
use super::source::{Origin, Source};
use super::{Association, ExtractError};
use crate::language::{GlyphShape, Glyphs, GlyphsAt};
use crate::limits::GLYPHS;

/// The sides of an arrow.
const SIDES: usize = 10;
/// Points around an arrow, as in VTK's: along it and away from its axis.
const ARROW: [[f64; 2]; 4] = [[0.0, 0.03], [0.65, 0.03], [0.65, 0.1], [1.0, 0.0]];
/// The rings of a sphere between its poles.
const RINGS: usize = 7;

/// The glyphs of this rank but for their fields. Collective.
///
/// # Errors
/// [`ExtractError::Seeds`] where there would be more than the limit; the same on all ranks.
pub(super) fn pattern(
    source: &Source,
    input: &Input,
    vectors: Option<&[Vector]>,
    seeds: &[Vector],
    stage: &Glyphs,
) -> Result<Pattern, ExtractError> {
    let communicator = input.communicator;
    let bounds = bounds(source, communicator);
    let places = match &stage.at {
        GlyphsAt::Spread(count) => spread(source, input, &bounds, *count),
        GlyphsAt::Every(nth) => every(source, input, *nth)?,
        GlyphsAt::Points(_) => at_points(source, input, seeds),
    };
    check_count(communicator, places.len())?;
    let vector = |found: &Found| match vectors {
        Some(vectors) => weighted(&found.row, vectors),
        None => [1.0, 0.0, 0.0],
    };
    let along: Vec<Vector> = places.iter().map(|(_, found)| vector(found)).collect();
    let own = along.iter().map(|vector| length(*vector)).filter(|size| size.is_finite());
    let largest = communicator.reduced(Reduction::Maximum, own.fold(0.0, f64::max));
    let size = stage.size.unwrap_or(0.05 * bounds.diagonal());
    let body = match stage.shape {
        GlyphShape::Arrow => arrow(),
        GlyphShape::Sphere => sphere(),
    };
    let mut rows = Rows::default();
    let (mut points, mut owners) = (Vec::new(), Vec::new());
    let mut cells = Cells::new();
    for ((place, found), along) in places.into_iter().zip(along) {
        let magnitude = length(along);
        // What has no direction has no arrow.
        if magnitude.is_nan() || magnitude == 0.0 && stage.shape == GlyphShape::Arrow {
            continue;
        }
        let is_scaled = stage.scaled && vectors.is_some() && largest > 0.0;
        let size = if is_scaled { size * magnitude / largest } else { size };
        let frame = frame(along);
        #[expect(clippy::cast_possible_truncation, reason = "a limited number of glyphs")]
        let first = points.len() as u32;
        for point in &body.points {
            points.push([0, 1, 2].map(|axis| {
                let offset: f64 = (0..3).map(|part| frame[part][axis] * point[part]).sum();
                place[axis] + size * offset
            }));
            rows.push(found.row.iter().copied());
        }
        for triangle in &body.triangles {
            cells.push(CellType::Triangle, &triangle.map(|corner| first + corner))?;
            owners.push(found.cell);
        }
    }
    Ok(Pattern {
        points,
        base: Base::Rows(rows),
        cells: Arc::new(cells),
        owners: owners.into(),
        origin: Origin::Loose,
    })
}

fn bounds(source: &Source, communicator: &dyn Communicator) -> Bounds {
    Bounds::around(source.positions.points.iter().copied()).of_ranks(communicator)
}

/// A point and the vertices that its values come from.
type Sampled = (Vector, Found);

/// A vertex of own cells that may have a glyph.
struct Candidate {
    /// Its number in the whole mesh.
    number: u32,
    /// Its number on this rank.
    vertex: u32,
    /// Of the own cells around it, that of the lowest key.
    cell: u32,
    key: u64,
}

impl Candidate {
    fn sampled(&self, source: &Source) -> Sampled {
        let found = Found { cell: self.cell, row: vec![(self.vertex, 1.0)] };
        (source.positions.points[self.vertex as usize], found)
    }
}

/// The vertices of own cells whose numbers in the whole mesh are wanted, by these numbers. Those
/// that several ranks have, each of them brings. Collective.
fn at_vertices(source: &Source, input: &Input, is_wanted: impl Fn(u32) -> bool) -> Vec<Candidate> {
    let key = keys(source, input);
    let numbers = source.whole_mesh().map(|whole| whole.shared.numbers());
    let mut lowest = vec![(u64::MAX, u32::MAX); source.positions.points.len()];
    #[expect(clippy::cast_possible_truncation, reason = "cells are numbered with 32 bits")]
    for cell in (0..source.cells().len()).filter(|&cell| source.counts(Association::Element, cell))
    {
        let of_cell = (key(cell as u32), cell as u32);
        for &vertex in source.cells().vertices(cell) {
            let known = &mut lowest[vertex as usize];
            *known = of_cell.min(*known);
        }
    }
    let place = |(vertex, (key, cell)): (u32, (u64, u32))| {
        let number = numbers.map_or(vertex, |numbers| numbers[vertex as usize]);
        (cell < u32::MAX && is_wanted(number)).then_some(Candidate { number, vertex, cell, key })
    };
    let mut places: Vec<Candidate> = (0..).zip(lowest).filter_map(place).collect();
    places.sort_by_key(|place| place.number);
    places
}

/// Every nth vertex of all ranks, each on the rank that has the cell of the lowest key around it.
/// Collective.
fn every(source: &Source, input: &Input, every: usize) -> Result<Vec<Sampled>, ExtractError> {
    let communicator = input.communicator;
    let mut places = at_vertices(source, input, |number| (number as usize).is_multiple_of(every));
    let is_owned = |place: &&Candidate| source.counts(Association::Vertex, place.vertex as usize);
    check_count(communicator, places.iter().filter(is_owned).count())?;
    if let Some(whole) = source.whole_mesh().filter(|_| communicator.size() > 1) {
        let mut message = Writer::default();
        for place in places.iter().filter(|place| whole.is_shared[place.vertex as usize]) {
            message.u32(place.number);
            message.u64(place.key);
        }
        let mut lowest: HashMap<u32, (u64, usize)> = HashMap::new();
        for (rank, bytes) in communicator.gather_all(&message.into_bytes()).iter().enumerate() {
            let mut reader = Reader::new(rank, bytes);
            while !reader.is_empty() {
                let number = reader.u32().map_err(DistributedError::from)?;
                let own = (reader.u64().map_err(DistributedError::from)?, rank);
                let known = lowest.entry(number).or_insert(own);
                *known = own.min(*known);
            }
        }
        let rank = communicator.rank();
        let is_lowest = |place: &Candidate| {
            lowest.get(&place.number).is_none_or(|lowest| *lowest == (place.key, rank))
        };
        places.retain(is_lowest);
    }
    Ok(places.iter().map(|place| place.sampled(source)).collect())
}

/// Refuses more glyphs on all ranks than the limit; the same on all ranks. Collective.
fn check_count(communicator: &dyn Communicator, own: usize) -> Result<(), ExtractError> {
    let checked = GLYPHS.check(communicator.total(own));
    checked.map_err(|exceeded| ExtractError::Seeds(exceeded.to_string()))
}

/// Of all ranks' vertices the nearest to the middle of each of about `count` boxes, and that of the
/// lowest number where several are; each on the rank that has the cell of the lowest key around it.
/// Collective.
fn spread(source: &Source, input: &Input, bounds: &Bounds, count: usize) -> Vec<Sampled> {
    let communicator = input.communicator;
    let points = &source.positions.points;
    let extent = bounds.extent();
    // Cubes as large as leave about so many boxes; along a side without length there is one.
    let boxes = |side: f64| extent.map(|length| ((length / side).ceil() as usize).max(1));
    let all = |side: f64| boxes(side).iter().fold(1_usize, |all, &some| all.saturating_mul(some));
    let (mut least, mut most) = (0.0, bounds.diagonal().max(f64::MIN_POSITIVE));
    for _ in 0..60 {
        let middle = 0.5 * (least + most);
        if middle > 0.0 && all(middle) <= count { most = middle } else { least = middle }
    }
    let counts = boxes(most);
    // In the order of preference: the square of the distance, the number, the key.
    let mut own: Vec<Option<([u64; 3], Candidate)>> = Vec::new();
    own.resize_with(counts.iter().product(), || None);
    for place in at_vertices(source, input, |_| true) {
        let mut index = 0;
        let mut square = 0.0;
        for axis in (0..3).rev() {
            let side = extent[axis] / real(counts[axis]);
            let from = points[place.vertex as usize][axis] - bounds.lower[axis];
            let at = if side > 0.0 { (from / side).floor() as usize } else { 0 };
            let at = at.min(counts[axis] - 1);
            index = index * counts[axis] + at;
            let aside = from - (real(at) + 0.5) * side;
            square += aside * aside;
        }
        // Numbers above 0 are in the order of their bits.
        let order = [square.to_bits(), place.number.into(), place.key];
        if own[index].as_ref().is_none_or(|(least, _)| order < *least) {
            own[index] = Some((order, place));
        }
    }
    for part in 0..3 {
        let of =
            |own: &Option<([u64; 3], Candidate)>| own.as_ref().map_or(u64::MAX, |it| it.0[part]);
        let mut least: Vec<u64> = own.iter().map(of).collect();
        communicator.reduce_integers(Reduction::Minimum, &mut least);
        for (own, least) in own.iter_mut().zip(least) {
            own.take_if(|(order, _)| order[part] > least);
        }
    }
    own.iter().flatten().map(|(_, place)| place.sampled(source)).collect()
}

/// Of these points those that lie in a cell of this rank, and in none of a lower key. Collective.
fn at_points(source: &Source, input: &Input, seeds: &[Vector]) -> Vec<Sampled> {
    let finder = Finder::kept(source);
    let key = keys(source, input);
    let found: Vec<Option<Found>> = seeds.iter().map(|&seed| finder.find(seed, &key)).collect();
    let of = |found: &Option<Found>| found.as_ref().map_or(u64::MAX, |found| key(found.cell));
    let own: Vec<u64> = found.iter().map(of).collect();
    let mut least = own.clone();
    input.communicator.reduce_integers(Reduction::Minimum, &mut least);
    let is_least = own.iter().zip(&least).map(|(own, least)| own == least);
    let own = seeds.iter().zip(found).zip(is_least).filter(|(_, is_least)| *is_least);
    own.filter_map(|((&seed, found), _)| Some((seed, found?))).collect()
}

/// Directions along a vector and two across it, of length 1.
fn frame(along: Vector) -> [Vector; 3] {
    let size = length(along);
    let first = if size > 0.0 { scale(along, 1.0 / size) } else { [1.0, 0.0, 0.0] };
    let sizes = first.map(f64::abs);
    let shortest =
        (0..3).fold(0, |least, axis| if sizes[axis] < sizes[least] { axis } else { least });
    let mut aside = [0.0; 3];
    aside[shortest] = 1.0;
    let aside = subtract(aside, scale(first, dot(aside, first)));
    let second = unit(aside);
    [first, second, cross(first, second)]
}

/// A body along the first axis, of length 1.
struct Body {
    points: Vec<Vector>,
    triangles: Vec<[u32; 3]>,
}

impl Body {
    /// The surface that a profile makes as it turns about the axis; its first and last points lie
    /// on the axis. Seen from outside triangles turn counter-clockwise.
    fn turned(profile: &[[f64; 2]], sides: usize) -> Self {
        let mut body = Self { points: Vec::new(), triangles: Vec::new() };
        let mut rings: Vec<Vec<u32>> = Vec::new();
        for &[along, away] in profile {
            #[expect(clippy::cast_possible_truncation, reason = "a small body")]
            let first = body.points.len() as u32;
            let count = if away == 0.0 { 1 } else { sides };
            for side in 0..count {
                let angle = std::f64::consts::TAU * real(side) / real(sides);
                body.points.push([along, away * angle.cos(), away * angle.sin()]);
            }
            #[expect(clippy::cast_possible_truncation, reason = "a small body")]
            rings.push(
                (0..sides as u32).map(|side| first + if count > 1 { side } else { 0 }).collect(),
            );
        }
        for pair in rings.windows(2) {
            for side in 0..sides {
                let next = (side + 1) % sides;
                let [a, b, c, d] = [pair[0][side], pair[0][next], pair[1][next], pair[1][side]];
                if a != b {
                    body.triangles.push([a, b, c]);
                }
                if c != d {
                    body.triangles.push([a, c, d]);
                }
            }
        }
        body
    }
}

fn arrow() -> Body {
    let mut profile = vec![[0.0, 0.0]];
    profile.extend(ARROW);
    Body::turned(&profile, SIDES)
}

/// A sphere of diameter 1.
fn sphere() -> Body {
    let mut profile = vec![[-0.5, 0.0]];
    for ring in 1..=RINGS {
        let angle = std::f64::consts::PI * real(ring) / real(RINGS + 1);
        profile.push([-0.5 * angle.cos(), 0.5 * angle.sin()]);
    }
    profile.push([0.5, 0.0]);
    Body::turned(&profile, 2 * RINGS)
}

#[cfg(test)]
mod tests {
    use tombolo_deform::vector::determinant;

    use super::*;

    #[test]
    fn bodies_are_closed_and_turned_outwards() {
        for (body, volume) in [(arrow(), 0.0052), (sphere(), 0.478)] {
            let at = |corner: u32| body.points[corner as usize];
            let sum: f64 = body
                .triangles
                .iter()
                .map(|&[a, b, c]| determinant(at(a), at(b), at(c)) / 6.0)
                .sum();
            assert!((sum - volume).abs() < 0.1 * volume, "{sum}");
            let mut edges: Vec<(u32, u32)> = Vec::new();
            for &[a, b, c] in &body.triangles {
                edges.extend([(a, b), (b, c), (c, a)]);
            }
            assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))));
        }
    }
}
