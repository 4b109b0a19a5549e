//! The cut of a mesh with the surface on which a function is 0.
//!
//! The function is known at the vertices. Every cell is cut along its own edges: each face that has
//! corners on both sides gives segments between its crossed edges, and the segments of a cell close
//! to polygons. For tetrahedra these are the triangles and quadrilaterals of marching tetrahedra,
//! which are exact; for other cells no decomposition is needed, and two cells cut the face between
//! them alike, so that the cut has no gaps. A face whose corners change sides four times cuts off
//! its corners on the side where the function is above 0.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use tombolo_deform::mesh::{CellType, Cells, MeshError, Vector};
use tombolo_deform::vector::{add, cross, dot, subtract};

use super::blocks::{Blocks, Sides};
use super::gather::{Crossing, are_finite};

/// The cut of a mesh.
#[derive(Debug, Default)]
pub(super) struct Cut {
    pub(super) points: Vec<Vector>,
    pub(super) crossings: Vec<Crossing>,
    /// How many points there are up to each function's last.
    pub(super) ends: Vec<u32>,
    pub(super) cells: Cells,
    /// The cell that each polygon or line lies in.
    pub(super) owners: Vec<u32>,
    /// Whether an edge that is cut has an end whose coordinates are not finite.
    pub(super) is_broken: bool,
}

/// Cuts cells of dimension 3 to polygons and cells of dimension 2 to lines; others are passed over.
///
/// A vertex at which the function is 0 counts to the side above, so that a face on which it is 0 is
/// cut out once, by the cell behind it.
///
/// There are `layers` functions, one after the other; `value` is that of a function at a vertex.
/// Cells for which `counts` does not hold are passed over, and those with a vertex at which it is
/// NaN. `blocks` are those of the cells.
pub(super) fn cut(
    cells: &Cells,
    blocks: &Blocks,
    points: &[Vector],
    layers: usize,
    value: impl Fn(usize, usize) -> f64,
    counts: impl Fn(usize) -> bool,
) -> Result<Cut, MeshError> {
    let (mut cut, mut known) = (Cut::default(), KnownEdges::new(points.len()));
    let all = cells.connectivity().as_chunks::<4>().0;
    let tetrahedra = Some(all).filter(|_| blocks.are_tetrahedra());
    for layer in 0..layers {
        let value = |vertex: usize| value(layer, vertex);
        let sides = Sides::new(points.len(), value);
        known.begin(cut.points.len());
        let mut cutter = Cutter {
            value,
            sides: &sides,
            coordinates: points,
            known: &mut known,
            segments: Vec::new(),
            polygon: Vec::new(),
            directions: Vec::new(),
            cut: &mut cut,
        };
        for block in blocks.crossed(&sides) {
            let Some(tetrahedra) = tetrahedra else {
                for cell in block {
                    if sides.are_crossed(cells.vertices(cell)) && counts(cell) {
                        cutter.cell(cells, cell)?;
                    }
                }
                continue;
            };
            for (cell, corners) in block.clone().zip(&tetrahedra[block]) {
                if let Some(ahead) = sides.of_tetrahedron(*corners)
                    && counts(cell)
                {
                    cutter.tetrahedron(*corners, ahead, cell)?;
                }
            }
        }
        cut.ends.push(numbered(cut.points.len()));
    }
    Ok(cut)
}

/// Spreads the numbers of an edge's ends over 64 bits by the golden ratio (D. E. Knuth, *The Art of
/// Computer Programming* 3, 6.4): many times as fast as what keeps to numbers that an enemy chose.
#[derive(Default)]
pub(super) struct EdgeHasher(u64);

/// Two numbers made one.
pub(super) fn mixed(one: u64, other: u64) -> u64 {
    let product = (one.rotate_left(32) ^ other).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    product ^ (product >> 32)
}

impl Hasher for EdgeHasher {
    fn write(&mut self, bytes: &[u8]) {
        for part in bytes.chunks(8) {
            let word = part.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte));
            self.write_u64(word);
        }
    }

    fn write_u32(&mut self, number: u32) {
        self.write_u64(u64::from(number));
    }

    fn write_u64(&mut self, number: u64) {
        self.0 = mixed(self.0, number);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

/// A map with the global numbers of vertices as keys.
pub(super) type ByVertices<K> = HashMap<K, u32, BuildHasherDefault<EdgeHasher>>;

#[expect(
    clippy::cast_possible_truncation,
    reason = "a point for each edge of a mesh numbered with 32 bits"
)]
fn numbered(point: usize) -> u32 {
    point as u32
}

/// The points of a layer by the edges that they lie on: for each vertex a chain of the points on
/// edges that begin there.
struct KnownEdges {
    /// The number of the layer's first point.
    first: u32,
    /// The newest point of each chain.
    heads: Vec<u32>,
    /// For each point the end of its edge, and the point before it in the chain.
    links: Vec<(u32, u32)>,
    /// Edges that were asked for a short time ago, and their points: neighbours ask for the same,
    /// and this is small enough to stay near the processor. An edge has one place in it.
    recent: Vec<([u32; 2], u32)>,
}

/// There is no further point in a chain.
const NONE: u32 = u32::MAX;

/// By its bits, how many edges are kept that were asked for a short time ago.
const RECENT: u32 = 11;

impl KnownEdges {
    fn new(vertices: usize) -> Self {
        let recent = vec![([NONE; 2], NONE); 1 << RECENT];
        Self { first: 0, heads: vec![NONE; vertices], links: Vec::new(), recent }
    }

    /// Forgets all edges; the next point has this number.
    fn begin(&mut self, first: usize) {
        if !self.links.is_empty() {
            self.heads.fill(NONE);
            self.links.clear();
            self.recent.fill(([NONE; 2], NONE));
        }
        self.first = numbered(first);
    }

    /// The place of an edge among those that were asked for a short time ago.
    #[inline]
    fn place(&mut self, [start, end]: [u32; 2]) -> &mut ([u32; 2], u32) {
        let edge = u64::from(start) << 32 | u64::from(end);
        let place = edge.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (u64::BITS - RECENT);
        &mut self.recent[place as usize]
    }

    fn find(&self, [start, end]: [u32; 2]) -> Option<u32> {
        let mut point = self.heads[start as usize];
        while point != NONE {
            let (other, before) = self.links[(point - self.first) as usize];
            if other == end {
                return Some(point);
            }
            point = before;
        }
        None
    }

    /// Adds the next point; returns its number.
    fn add(&mut self, [start, end]: [u32; 2]) -> u32 {
        let point = self.first + numbered(self.links.len());
        let before = std::mem::replace(&mut self.heads[start as usize], point);
        self.links.push((end, before));
        point
    }
}

/// For each set of corners of a tetrahedron that lie ahead, by bits, the edges that are cut, in
/// order around, from behind to ahead, and how many: around the corner that lies alone on its side,
/// or between the edges that two and two make.
const RINGS: [([[usize; 2]; 4], usize); 16] = rings();

const fn rings() -> [([[usize; 2]; 4], usize); 16] {
    let mut rings = [([[0; 2]; 4], 0); 16];
    let mut mask = 1;
    while mask < 15 {
        let mut corners = [[0; 4]; 2];
        let mut counts = [0; 2];
        let mut corner = 0;
        while corner < 4 {
            let side = mask >> corner & 1;
            corners[side][counts[side]] = corner;
            counts[side] += 1;
            corner += 1;
        }
        let [[d, e, f, _], [a, b, c, _]] = corners;
        rings[mask] = match counts[1] {
            1 => ([[d, a], [e, a], [f, a], [f, a]], 3),
            2 => ([[d, a], [d, b], [e, b], [e, a]], 4),
            _ => ([[d, a], [d, b], [d, c], [d, c]], 3),
        };
        mask += 1;
    }
    rings
}

struct Cutter<'a, V> {
    /// The function's value at a vertex.
    value: V,
    sides: &'a Sides,
    coordinates: &'a [Vector],
    known: &'a mut KnownEdges,
    /// The cell's segments: from the edge where the face's boundary leaves the side ahead to that
    /// where it enters it.
    segments: Vec<(u32, u32)>,
    polygon: Vec<u32>,
    /// The cell's points, with the direction from behind to ahead along their edges.
    directions: Vec<(u32, Vector)>,
    cut: &'a mut Cut,
}

impl<V: Fn(usize) -> f64> Cutter<'_, V> {
    fn cell(&mut self, cells: &Cells, cell: usize) -> Result<(), MeshError> {
        let cell_type = cells.cell_type(cell);
        let vertices = cells.vertices(cell);
        self.segments.clear();
        self.directions.clear();
        if let (CellType::Tetra, &[a, b, c, d]) = (cell_type, vertices) {
            let corners = [a, b, c, d];
            let ahead = self.sides.of_tetrahedron(corners);
            return ahead.map_or(Ok(()), |ahead| self.tetrahedron(corners, ahead, cell));
        }
        match cell_type.dimension() {
            3 => {
                cells.for_each_face(cell, |face| self.face(face));
                self.close(cell)
            }
            2 => {
                cells.for_each_polygon(cell, |polygon| self.face(polygon));
                for (from, to) in std::mem::take(&mut self.segments) {
                    if from != to {
                        self.push(CellType::Line, &[from, to], cell)?;
                    }
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// The polygon of a tetrahedron, of which these corners lie ahead, by bits.
    fn tetrahedron(
        &mut self,
        corners: [u32; 4],
        ahead: usize,
        cell: usize,
    ) -> Result<(), MeshError> {
        let (ring, count) = &RINGS[ahead];
        let at = corners.map(|vertex| self.coordinates[vertex as usize]);
        let (mut polygon, mut direction) = ([0; 4], [0.0; 3]);
        for (point, &[behind, ahead]) in polygon.iter_mut().zip(&ring[..*count]) {
            *point = self.crossing([corners[behind], corners[ahead]]);
            direction = add(direction, subtract(at[ahead], at[behind]));
        }
        self.push_polygon(&mut polygon[..*count], direction, cell)
    }

    /// The segments of one face: one for each run of its corners ahead.
    fn face(&mut self, face: &[u32]) {
        let sides = self.sides;
        let ahead = |corner: usize| sides.is_ahead(face[corner % face.len()]);
        let Some(start) = (0..face.len()).find(|&corner| !ahead(corner) && ahead(corner + 1))
        else {
            return;
        };
        let mut enter = None;
        for corner in start..start + face.len() {
            let edge = [face[corner % face.len()], face[(corner + 1) % face.len()]];
            match (sides.is_ahead(edge[0]), sides.is_ahead(edge[1])) {
                (false, true) => {
                    let [behind, ahead] = edge.map(|vertex| self.coordinates[vertex as usize]);
                    let point = self.crossing(edge);
                    self.directions.push((point, subtract(ahead, behind)));
                    enter = Some(point);
                }
                (true, false) => {
                    let leave = self.crossing(edge);
                    self.segments.extend(enter.take().map(|enter| (leave, enter)));
                }
                _ => {}
            }
        }
    }

    /// The number of the point on an edge whose ends lie on two sides.
    #[inline]
    fn crossing(&mut self, edge: [u32; 2]) -> u32 {
        let edge = if edge[0] <= edge[1] { edge } else { [edge[1], edge[0]] };
        let (known, point) = *self.known.place(edge);
        if known == edge {
            return point;
        }
        let point = match self.known.find(edge) {
            Some(point) => point,
            None => self.new_crossing(edge),
        };
        *self.known.place(edge) = (edge, point);
        point
    }

    /// The number of the point on an edge that has none yet, or has an end at 0.
    fn new_crossing(&mut self, [a, b]: [u32; 2]) -> u32 {
        let ends = [a, b].map(|vertex| self.coordinates[vertex as usize]);
        self.cut.is_broken |= !are_finite(&ends);
        let (at_a, at_b) = ((self.value)(a as usize), (self.value)(b as usize));
        let edge = match (at_a == 0.0, at_b == 0.0) {
            (true, _) => [a, a],
            (_, true) => [b, b],
            _ => [a, b],
        };
        if edge[0] == edge[1]
            && let Some(point) = self.known.find(edge)
        {
            return point;
        }
        let crossing = Crossing {
            edge,
            fraction: if edge[0] == edge[1] { 0.0 } else { at_a / (at_a - at_b) },
        };
        let from = self.coordinates[edge[0] as usize];
        let to = self.coordinates[edge[1] as usize];
        let at = |axis: usize| crossing.between(from[axis], to[axis]);
        self.cut.points.push([at(0), at(1), at(2)]);
        self.cut.crossings.push(crossing);
        self.known.add(edge)
    }

    /// Chains the segments of a volume cell to polygons that turn counter-clockwise seen from
    /// ahead.
    fn close(&mut self, cell: usize) -> Result<(), MeshError> {
        let mut segments = std::mem::take(&mut self.segments);
        while let Some((start, mut end)) = segments.pop() {
            self.polygon.clear();
            self.polygon.push(start);
            while end != start {
                self.polygon.push(end);
                let Some(next) = segments.iter().position(|segment| segment.0 == end) else {
                    break;
                };
                end = segments.swap_remove(next).1;
            }
            let mut polygon = std::mem::take(&mut self.polygon);
            let own = self.directions.iter().filter(|(point, _)| polygon.contains(point));
            let direction = own.fold([0.0; 3], |sum, (_, direction)| add(sum, *direction));
            self.push_polygon(&mut polygon, direction, cell)?;
            self.polygon = polygon;
        }
        self.segments = segments;
        Ok(())
    }

    /// Adds a polygon, turned so that it is counter-clockwise seen from where the direction points.
    /// Points that follow on themselves are left out, and what is left without an area.
    fn push_polygon(
        &mut self,
        polygon: &mut [u32],
        direction: Vector,
        cell: usize,
    ) -> Result<(), MeshError> {
        let count = without_repeats(polygon);
        let polygon = &mut polygon[..count];
        if polygon.len() < 3 {
            return Ok(());
        }
        if self.turn(polygon, direction) < 0.0 {
            polygon.reverse();
        }
        let cell_type = match polygon.len() {
            3 => CellType::Triangle,
            4 => CellType::Quad,
            _ => CellType::Polygon,
        };
        self.push(cell_type, polygon, cell)
    }

    /// Twice the area of a polygon as it is seen from where the direction points, times its length.
    fn turn(&self, polygon: &[u32], direction: Vector) -> f64 {
        let at = |index: usize| self.cut.points[polygon[index] as usize];
        let origin = at(0);
        let triangle = |index: usize| {
            let [u, v] = [at(index), at(index + 1)].map(|corner| subtract(corner, origin));
            dot(cross(u, v), direction)
        };
        (1..polygon.len() - 1).map(triangle).sum()
    }

    fn push(&mut self, cell_type: CellType, points: &[u32], cell: usize) -> Result<(), MeshError> {
        self.cut.cells.push(cell_type, points)?;
        #[expect(clippy::cast_possible_truncation, reason = "cells are numbered with 32 bits")]
        self.cut.owners.push(cell as u32);
        Ok(())
    }
}

/// Moves the points of a ring that do not follow on themselves to the front; returns how many.
fn without_repeats(ring: &mut [u32]) -> usize {
    let mut count = 0;
    for index in 0..ring.len() {
        let point = ring[index];
        if count == 0 || ring[count - 1] != point {
            ring[count] = point;
            count += 1;
        }
    }
    // The last is followed by the first.
    if count > 1 && ring[0] == ring[count - 1] { count - 1 } else { count }
}

#[cfg(test)]
mod tests;
