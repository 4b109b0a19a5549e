//! The straight path of a cell from one shape to another.

use super::Measure;
use super::cubic::{Cubic, Least, least_of_cubic, triple};
use super::inside::least_inside;
use crate::mesh::cell_geometry::{Scratch, corner_tets, vector_area};
use crate::mesh::{CellType, Vector};
use crate::vector::{cross, dot, subtract};

/// The determinant of a tetrahedron whose corners go straight from `start` to `end`: a cubic `c0 +
/// c1 t + c2 t² + c3 t³`.
fn tet_cubic(start: [Vector; 4], end: [Vector; 4]) -> Cubic {
    let edges = |tet: [Vector; 4]| {
        [subtract(tet[1], tet[0]), subtract(tet[2], tet[0]), subtract(tet[3], tet[0])]
    };
    triple(edges(start), edges(end))
}

/// The least determinant of a cell on its way from `start` to `start + until (end - start)`, at its
/// corners and, where that is not positive, inside; for polygons, the least of each corner's area
/// against the cell's normal at the start.
pub(super) fn least_on_path(
    measure: &Measure<'_>,
    cell: usize,
    start: &[Vector],
    end: &[Vector],
    until: f64,
    [first, last]: &mut [Scratch; 2],
) -> Least {
    let cells = measure.cells;
    let vertices = cells.vertices(cell);
    let gather = |points: &[Vector], into: &mut Vec<Vector>| {
        into.clear();
        into.extend(vertices.iter().map(|&vertex| points[vertex as usize]));
    };
    if cells.cell_type(cell).dimension() == 2 {
        let mut least = Least::NONE;
        cells.for_each_polygon(cell, |polygon| {
            for (points, into) in [(start, &mut first.points), (end, &mut last.points)] {
                into.clear();
                into.extend(polygon.iter().map(|&vertex| points[vertex as usize]));
            }
            least = least.worse(least_of_polygon(&first.points, &last.points, until));
        });
        return least;
    }
    corner_tets(cells, cell, |vertex| start[vertex as usize], &mut first.tets);
    corner_tets(cells, cell, |vertex| end[vertex as usize], &mut last.tets);
    let corners = first
        .tets
        .iter()
        .zip(&last.tets)
        .map(|(&start, &end)| least_of_cubic(tet_cubic(start, end), until))
        .fold(Least::NONE, Least::worse);
    if !corners.positive || !has_inside(cells.cell_type(cell)) {
        return corners;
    }
    gather(start, &mut first.points);
    gather(end, &mut last.points);
    corners.worse(least_inside(cells.cell_type(cell), &first.points, &last.points, until))
}

/// Whether the determinant of a cell can be least elsewhere than at the corners that are looked at.
pub(super) fn has_inside(cell_type: CellType) -> bool {
    matches!(
        cell_type,
        CellType::Hexahedron | CellType::Voxel | CellType::Wedge | CellType::Pyramid
    )
}

fn least_of_polygon(start: &[Vector], end: &[Vector], until: f64) -> Least {
    let normal = vector_area(start);
    let count = start.len();
    (0..count)
        .map(|index| {
            let sides = |points: &[Vector]| {
                let (before, at, after) = (
                    points[(index + count - 1) % count],
                    points[index],
                    points[(index + 1) % count],
                );
                (subtract(at, before), subtract(after, at))
            };
            let ((a, b), (a1, b1)) = (sides(start), sides(end));
            let (da, db) = (subtract(a1, a), subtract(b1, b));
            let along = |v: Vector| dot(v, normal);
            let quadratic = [
                along(cross(a, b)),
                along(cross(da, b)) + along(cross(a, db)),
                along(cross(da, db)),
                0.0,
            ];
            least_of_cubic(quadratic, until)
        })
        .fold(Least::NONE, Least::worse)
}
