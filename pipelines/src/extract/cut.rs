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
use super::gather::Crossing;

/// The cut of a mesh.
#[derive(Debug, Default)]
pub(super) struct Cut {
    pub(super) points: Vec<Vector>,
    pub(super) crossings: Vec<Crossing>,
    /// The number of the function that each point lies on.
    pub(super) layers: Vec<u32>,
    pub(super) cells: Cells,
    /// The cell that each polygon or line lies in.
    pub(super) owners: Vec<u32>,
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
    let mut cut = Cut::default();
    for (layer, index) in (0..).zip(0..layers) {
        let value = |vertex: usize| value(index, vertex);
        let sides = Sides::new(points.len(), value);
        let mut cutter = Cutter {
            layer,
            value,
            sides: &sides,
            coordinates: points,
            known: KnownEdges::new(points.len(), cut.points.len()),
            segments: Vec::new(),
            polygon: Vec::new(),
            directions: Vec::new(),
            cut,
        };
        for cell in blocks.crossed(&sides) {
            if sides.are_crossed(cells.vertices(cell)) && counts(cell) {
                cutter.cell(cells, cell)?;
            }
        }
        cut = cutter.cut;
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

/// The points of a layer by the edges that they lie on: for each vertex a chain of the points on
/// edges that begin there.
struct KnownEdges {
    /// The number of the layer's first point.
    first: u32,
    /// The newest point of each chain.
    heads: Vec<u32>,
    /// For each point the end of its edge, and the point before it in the chain.
    links: Vec<(u32, u32)>,
}

/// There is no further point in a chain.
const NONE: u32 = u32::MAX;

impl KnownEdges {
    fn new(vertices: usize, first: usize) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a point for each edge of a mesh numbered with 32 bits"
        )]
        let first = first as u32;
        Self { first, heads: vec![NONE; vertices], links: Vec::new() }
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
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a point for each edge of a mesh numbered with 32 bits"
    )]
    fn add(&mut self, [start, end]: [u32; 2]) -> u32 {
        let point = self.first + self.links.len() as u32;
        let before = std::mem::replace(&mut self.heads[start as usize], point);
        self.links.push((end, before));
        point
    }
}

struct Cutter<'a, V> {
    layer: u32,
    /// The function's value at a vertex.
    value: V,
    sides: &'a Sides,
    coordinates: &'a [Vector],
    known: KnownEdges,
    /// The cell's segments: from the edge where the face's boundary leaves the side ahead to that
    /// where it enters it.
    segments: Vec<(u32, u32)>,
    polygon: Vec<u32>,
    /// The cell's points, with the direction from behind to ahead along their edges.
    directions: Vec<(u32, Vector)>,
    cut: Cut,
}

impl<V: Fn(usize) -> f64> Cutter<'_, V> {
    fn cell(&mut self, cells: &Cells, cell: usize) -> Result<(), MeshError> {
        let cell_type = cells.cell_type(cell);
        let vertices = cells.vertices(cell);
        self.segments.clear();
        self.directions.clear();
        if let (CellType::Tetra, &[a, b, c, d]) = (cell_type, vertices) {
            return self.tetrahedron([a, b, c, d], cell);
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

    /// The polygon of a tetrahedron: around the corner that lies alone on its side, or between the
    /// edges that two and two make.
    fn tetrahedron(&mut self, vertices: [u32; 4], cell: usize) -> Result<(), MeshError> {
        let (mut ahead, mut behind) = ([0; 4], [0; 4]);
        let (mut ahead_count, mut behind_count) = (0, 0);
        for vertex in vertices {
            if self.sides.is_ahead(vertex) {
                ahead[ahead_count] = vertex;
                ahead_count += 1;
            } else {
                behind[behind_count] = vertex;
                behind_count += 1;
            }
        }
        let [a, b, c, _] = ahead;
        let [d, e, f, _] = behind;
        let (ring, count) = match ahead_count {
            1 => ([[d, a], [e, a], [f, a], [f, a]], 3),
            2 => ([[d, a], [d, b], [e, b], [e, a]], 4),
            _ => ([[d, a], [d, b], [d, c], [d, c]], 3),
        };
        let mut polygon = std::mem::take(&mut self.polygon);
        polygon.clear();
        let mut direction = [0.0; 3];
        for edge in &ring[..count] {
            polygon.push(self.crossing(*edge));
            let behind = self.coordinates[edge[0] as usize];
            let ahead = self.coordinates[edge[1] as usize];
            direction = add(direction, subtract(ahead, behind));
        }
        let done = self.push_polygon(&mut polygon, direction, cell);
        self.polygon = polygon;
        done
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
    fn crossing(&mut self, edge: [u32; 2]) -> u32 {
        let [a, b] = if edge[0] <= edge[1] { edge } else { [edge[1], edge[0]] };
        // Most edges have their point already, and none of their ends is at 0.
        if let Some(point) = self.known.find([a, b]) {
            return point;
        }
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
        self.cut.layers.push(self.layer);
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
        polygon: &mut Vec<u32>,
        direction: Vector,
        cell: usize,
    ) -> Result<(), MeshError> {
        polygon.dedup();
        if polygon.len() > 1 && polygon.first() == polygon.last() {
            polygon.pop();
        }
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
