//! The cut of a mesh with a plane.
//!
//! Every cell is cut along its own edges: each face that has corners on both sides gives segments between its crossed edges, and
//! the segments of a cell close to polygons. For tetrahedra these are the triangles and quadrilaterals of marching tetrahedra,
//! which are exact; for other cells no decomposition is needed, and two cells cut the face between them alike, so that the cut has
//! no gaps. A face whose corners change sides four times (only a warped one can) cuts off its corners on the normal's side.

use std::collections::HashMap;

use tombolo_deform::mesh::{ArrayView, CellType, Cells, MeshError, Vector};

use super::ExtractError;
use super::gather::point;
use crate::language::Slice;

/// A point of the cut: between the two ends of an edge, or a vertex where they are one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crossing {
    /// The ends, the lower number first.
    pub(super) edge: [u32; 2],
    /// How far from the first to the second, 0 to 1.
    pub(super) fraction: f64,
}

impl Crossing {
    /// Linear between the values at the ends, and never outside them.
    pub(super) fn between(&self, first: f64, second: f64) -> f64 {
        if self.edge[0] == self.edge[1] || first == second {
            return first;
        }
        first * (1.0 - self.fraction) + second * self.fraction
    }
}

/// The cut of a mesh.
pub(super) struct Cut {
    pub(super) points: Vec<Vector>,
    pub(super) crossings: Vec<Crossing>,
    pub(super) cells: Cells,
    /// The cell that each polygon or line lies in.
    pub(super) owners: Vec<u32>,
}

/// Cuts cells of dimension 3 to polygons and cells of dimension 2 to lines; others are passed over.
///
/// A vertex in the plane counts to the side of the normal, so that a face in the plane is cut out once, by the cell behind it.
///
/// Cells for which `counts` does not hold are passed over. `furthest_of_all` makes of the distance of the furthest vertex from
/// the plane that of all ranks, and is called whatever happens.
pub(super) fn cut(
    cells: &Cells,
    points: &ArrayView,
    plane: &Slice,
    cycle: u64,
    counts: &dyn Fn(usize) -> bool,
    furthest_of_all: &dyn Fn(f64) -> f64,
) -> Result<Cut, ExtractError> {
    let length = plane.normal.iter().fold(0.0_f64, |sum, x| sum.hypot(*x));
    let normal = plane.normal.map(|x| x / length);
    let mut distances = Vec::with_capacity(points.len());
    let mut furthest = 0.0_f64;
    let mut fault = None;
    for vertex in 0..points.len() {
        let at = match point(points, vertex, cycle) {
            Ok(at) => at,
            Err(error) => {
                fault = Some(error);
                break;
            }
        };
        let distance: f64 = (0..3).map(|axis| (at[axis] - plane.origin[axis]) * normal[axis]).sum();
        furthest = furthest.max(distance.abs());
        distances.push(distance);
    }
    // A vertex that is in the plane but for rounding is in the plane: slivers beside it would mean nothing.
    let slack = 1e-12 * furthest_of_all(furthest);
    if let Some(error) = fault {
        return Err(error);
    }
    for distance in &mut distances {
        if distance.abs() <= slack {
            *distance = 0.0;
        }
    }
    let mut cutter = Cutter {
        distances: &distances,
        coordinates: points,
        normal,
        numbers: HashMap::new(),
        segments: Vec::new(),
        polygon: Vec::new(),
        cut: Cut {
            points: Vec::new(),
            crossings: Vec::new(),
            cells: Cells::new(),
            owners: Vec::new(),
        },
    };
    for cell in (0..cells.len()).filter(|&cell| counts(cell)) {
        let vertices = cells.vertices(cell);
        let first = is_ahead(distances[vertices[0] as usize]);
        if vertices.iter().all(|&vertex| is_ahead(distances[vertex as usize]) == first) {
            continue;
        }
        cutter.cell(cells, cell)?;
    }
    Ok(cutter.cut)
}

fn is_ahead(distance: f64) -> bool {
    distance >= 0.0
}

struct Cutter<'a> {
    distances: &'a [f64],
    coordinates: &'a ArrayView<'a>,
    normal: Vector,
    numbers: HashMap<[u32; 2], u32>,
    /// The cell's segments: from the edge where the face's boundary leaves the normal's side to that where it enters it.
    segments: Vec<(u32, u32)>,
    polygon: Vec<u32>,
    cut: Cut,
}

impl Cutter<'_> {
    fn cell(&mut self, cells: &Cells, cell: usize) -> Result<(), MeshError> {
        let cell_type = cells.cell_type(cell);
        let vertices = cells.vertices(cell);
        self.segments.clear();
        match cell_type.dimension() {
            3 => {
                cells.for_each_face(cell, |face| self.face(face));
                self.close(cell)
            }
            2 => {
                match (cell_type, vertices) {
                    (CellType::Pixel, &[a, b, c, d]) => self.face(&[a, b, d, c]),
                    (CellType::TriangleStrip, _) => {
                        vertices.windows(3).for_each(|triangle| self.face(triangle))
                    }
                    _ => self.face(vertices),
                }
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

    /// The segments of one face: one for each run of its corners on the normal's side.
    fn face(&mut self, face: &[u32]) {
        let ahead = |corner: usize| is_ahead(self.distances[face[corner % face.len()] as usize]);
        let Some(start) = (0..face.len()).find(|&corner| !ahead(corner) && ahead(corner + 1))
        else {
            return;
        };
        let mut enter = None;
        for corner in start..start + face.len() {
            let edge = [face[corner % face.len()], face[(corner + 1) % face.len()]];
            let is_ahead_at = |vertex: u32| is_ahead(self.distances[vertex as usize]);
            match (is_ahead_at(edge[0]), is_ahead_at(edge[1])) {
                (false, true) => enter = Some(self.crossing(edge)),
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
        let (at_a, at_b) = (self.distances[a as usize], self.distances[b as usize]);
        let edge = match (at_a == 0.0, at_b == 0.0) {
            (true, _) => [a, a],
            (_, true) => [b, b],
            _ => [a, b],
        };
        let next = self.cut.points.len();
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a crossing for each edge of a mesh numbered with 32 bits"
        )]
        *self.numbers.entry(edge).or_insert_with(|| {
            let crossing = Crossing {
                edge,
                fraction: if edge[0] == edge[1] { 0.0 } else { at_a / (at_a - at_b) },
            };
            let [from, to] = edge.map(|vertex| self.coordinates.vector(vertex as usize));
            self.cut
                .points
                .push(std::array::from_fn(|axis| crossing.between(from[axis], to[axis])));
            self.cut.crossings.push(crossing);
            next as u32
        })
    }

    /// Chains the segments of a volume cell to polygons that turn counter-clockwise about the normal.
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
            self.polygon.dedup();
            if self.polygon.len() < 3 {
                continue;
            }
            let mut polygon = std::mem::take(&mut self.polygon);
            if self.turns_backwards(&polygon) {
                polygon.reverse();
            }
            let cell_type = match polygon.len() {
                3 => CellType::Triangle,
                4 => CellType::Quad,
                _ => CellType::Polygon,
            };
            self.push(cell_type, &polygon, cell)?;
            self.polygon = polygon;
        }
        self.segments = segments;
        Ok(())
    }

    fn turns_backwards(&self, polygon: &[u32]) -> bool {
        let at = |index: usize| self.cut.points[polygon[index] as usize];
        let origin = at(0);
        let mut turn = 0.0;
        for index in 1..polygon.len() - 1 {
            let [u, v] = [at(index), at(index + 1)]
                .map(|p| [p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]]);
            let cross =
                [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            turn +=
                cross[0] * self.normal[0] + cross[1] * self.normal[1] + cross[2] * self.normal[2];
        }
        turn < 0.0
    }

    fn push(&mut self, cell_type: CellType, points: &[u32], cell: usize) -> Result<(), MeshError> {
        self.cut.cells.push(cell_type, points)?;
        #[expect(clippy::cast_possible_truncation, reason = "cells are numbered with 32 bits")]
        self.cut.owners.push(cell as u32);
        Ok(())
    }
}
