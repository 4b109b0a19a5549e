//! The weights of the vertices of one cell in integrals over it.

use tombolo_deform::mesh::{CellType, Cells, Vector};
use tombolo_deform::vector::{add, cross, distance, dot, length, mean, scale, subtract};

/// The parts that the vertices of one cell have in integrals over it.
///
/// Cells that are no simplices are taken as those that their edges make with the mean of each face
/// and of the cell, where a field has the mean value. That does not depend on the numbering, is
/// exact for linear fields, and neighbours agree on the face between them.
#[derive(Default)]
pub(super) struct Weights {
    /// The length, area or volume of the cell.
    pub(super) size: f64,
    /// The vector area of a face: its normal, as long as the area.
    pub(super) area: Vector,
    /// Vertices, each with its part of the size and of the vector area; one may stand here more
    /// than once.
    pub(super) parts: Vec<(u32, f64, Vector)>,
    ring: Vec<u32>,
}

/// The volume of a tetrahedron, whichever way its corners turn.
pub(super) fn volume([a, b, c, d]: [Vector; 4]) -> f64 {
    let [u, v, w] = [b, c, d].map(|corner| subtract(corner, a));
    dot(cross(u, v), w).abs() / 6.0
}

impl Weights {
    /// Finds the weights of a cell of dimension 1, 2 or 3; those of others are 0.
    pub(super) fn find(&mut self, cells: &Cells, cell: usize, points: &[Vector]) {
        self.parts.clear();
        let vertices = cells.vertices(cell);
        let at = |vertex: u32| points[vertex as usize];
        match (cells.cell_type(cell), vertices) {
            (CellType::Tetra, &[a, b, c, d]) => {
                let size = volume([a, b, c, d].map(at));
                self.parts.extend(vertices.iter().map(|&vertex| (vertex, size / 4.0, [0.0; 3])));
            }
            (cell_type, _) => match cell_type.dimension() {
                1 => {
                    for pair in vertices.windows(2) {
                        let half = distance(at(pair[0]), at(pair[1])) / 2.0;
                        self.parts.extend(pair.iter().map(|&vertex| (vertex, half, [0.0; 3])));
                    }
                }
                2 => cells.for_each_polygon(cell, |polygon| self.polygon(polygon, at)),
                3 => self.volume(cells, cell, at),
                _ => {}
            },
        }
        self.size = self.parts.iter().map(|(_, size, _)| size).sum();
        self.area = self.parts.iter().fold([0.0; 3], |sum, (_, _, area)| add(sum, *area));
    }

    /// Adds the triangles that the edges make with the mean; those that turn against the whole, as
    /// beside the inner corner of an L, count negative.
    fn polygon(&mut self, vertices: &[u32], at: impl Fn(u32) -> Vector) {
        if let &[a, b, c] = vertices {
            let area = scale(cross(subtract(at(b), at(a)), subtract(at(c), at(a))), 0.5);
            let part = (length(area) / 3.0, scale(area, 1.0 / 3.0));
            self.parts.extend(vertices.iter().map(|&vertex| (vertex, part.0, part.1)));
            return;
        }
        let middle = mean(vertices.iter().map(|&vertex| at(vertex)));
        let triangle = |index: usize| {
            let (a, b) = (vertices[index], vertices[(index + 1) % vertices.len()]);
            let area = scale(cross(subtract(at(a), middle), subtract(at(b), middle)), 0.5);
            (a, b, area)
        };
        let whole = (0..vertices.len()).fold([0.0; 3], |sum, index| add(sum, triangle(index).2));
        let (mut size_of_middle, mut area_of_middle) = (0.0, [0.0; 3]);
        for index in 0..vertices.len() {
            let (a, b, area) = triangle(index);
            let size = length(area).copysign(dot(area, whole)) / 3.0;
            let area = scale(area, 1.0 / 3.0);
            self.parts.extend([(a, size, area), (b, size, area)]);
            size_of_middle += size;
            area_of_middle = add(area_of_middle, area);
        }
        self.spread(vertices, size_of_middle, area_of_middle);
    }

    /// Adds the tetrahedra between the mean of the cell and the triangles of its faces. The faces
    /// of a polyhedron may turn either way: each has a volume of its own above 0.
    fn volume(&mut self, cells: &Cells, cell: usize, at: impl Fn(u32) -> Vector) {
        let vertices = cells.vertices(cell);
        let centre = mean(vertices.iter().map(|&vertex| at(vertex)));
        let mut size_of_centre = 0.0;
        let mut ring = std::mem::take(&mut self.ring);
        cells.for_each_face(cell, |face| {
            ring.clear();
            ring.extend(face);
            let middle = subtract(mean(ring.iter().map(|&vertex| at(vertex))), centre);
            let sixth = |index: usize| {
                let pair = [ring[index], ring[(index + 1) % ring.len()]];
                let [a, b] = pair.map(|vertex| subtract(at(vertex), centre));
                dot(middle, cross(a, b)) / 6.0
            };
            let turn = 1.0_f64.copysign((0..ring.len()).map(sixth).sum());
            let mut size_of_middle = 0.0;
            for index in 0..ring.len() {
                let size = turn * sixth(index) / 4.0;
                let next = ring[(index + 1) % ring.len()];
                self.parts.extend([(ring[index], size, [0.0; 3]), (next, size, [0.0; 3])]);
                size_of_middle += size;
            }
            self.spread(&ring, size_of_middle, [0.0; 3]);
            size_of_centre += size_of_middle;
        });
        self.ring = ring;
        self.spread(vertices, size_of_centre, [0.0; 3]);
    }

    /// Deals out the part of a mean to those that it is the mean of.
    fn spread(&mut self, vertices: &[u32], size: f64, area: Vector) {
        #[expect(clippy::cast_precision_loss, reason = "cells have few vertices")]
        let part = 1.0 / vertices.len() as f64;
        let area = scale(area, part);
        self.parts.extend(vertices.iter().map(|&vertex| (vertex, size * part, area)));
    }
}

#[cfg(test)]
mod tests {
    use tombolo_deform::quality::volumes;
    use tombolo_deform::shapes::{box_of_mixed_cells, single_cell};

    use super::*;

    #[test]
    fn sizes_are_those_of_the_kernel_and_linear_fields_are_exact() {
        let mut weights = Weights::default();
        for cell_type in [CellType::Tetra, CellType::Hexahedron, CellType::Wedge, CellType::Pyramid]
        {
            let mesh = single_cell(cell_type);
            let mut points = mesh.points().to_vec();
            for (index, point) in (0_u32..).zip(&mut points) {
                point[index as usize % 3] += 0.1 * f64::from(index).sin();
            }
            weights.find(mesh.cells(), 0, &points);
            let expected = volumes(mesh.cells(), &points)[0];
            assert!((weights.size - expected).abs() < 1e-14, "{cell_type}");
        }
        let mesh = box_of_mixed_cells([3, 2, 2], [0.0; 3], [2.0, 1.0, 1.0]);
        let mut integral = 0.0;
        for cell in 0..mesh.cells().len() {
            weights.find(mesh.cells(), cell, mesh.points());
            let value = |vertex: u32| {
                let [x, y, z] = mesh.points()[vertex as usize];
                1.0 + x - 3.0 * y + 2.0 * z
            };
            integral += weights.parts.iter().map(|part| part.1 * value(part.0)).sum::<f64>();
        }
        assert!((integral - 2.0 * (1.0 + 1.0 - 1.5 + 1.0)).abs() < 1e-13, "{integral}");
    }

    #[test]
    fn an_inner_corner_counts_once() {
        // An L of area 3, whose mean lies at its inner corner or beside it.
        let ring = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let points = ring.map(|[x, y]| [x, y, 0.5]);
        let mut cells = Cells::new();
        cells.push(CellType::Polygon, &[0, 1, 2, 3, 4, 5]).unwrap();
        let mut weights = Weights::default();
        weights.find(&cells, 0, &points);
        assert!((weights.size - 3.0).abs() < 1e-14);
        assert!(distance(weights.area, [0.0, 0.0, 3.0]) < 1e-14);
    }
}
