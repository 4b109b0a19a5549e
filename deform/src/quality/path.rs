//! The straight path of a cell from one shape to another.

use super::Measure;
use super::cell::{Scratch, corner_tets, vector_area};
use super::inside::least_inside;
use crate::mesh::{CellType, Vector};
use crate::vector::{cross, determinant, dot, subtract};

/// The least value of a polynomial in the path parameter over `0..=1`, and where it is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Least {
    pub value: f64,
    pub at: f64,
    /// Whether the value is above zero by more than rounding could make of it.
    pub positive: bool,
}

impl Least {
    pub(super) const NONE: Self = Self { value: f64::INFINITY, at: 0.0, positive: true };

    pub(super) fn worse(self, other: Self) -> Self {
        let first =
            if other.positive == self.positive { other.value < self.value } else { self.positive };
        if first { other } else { self }
    }
}

/// The determinant of a tetrahedron whose corners go straight from `start` to `end`: a cubic `c0 + c1 t + c2 t² + c3 t³`.
fn tet_cubic(start: [Vector; 4], end: [Vector; 4]) -> Cubic {
    let edges = |tet: [Vector; 4]| {
        [subtract(tet[1], tet[0]), subtract(tet[2], tet[0]), subtract(tet[3], tet[0])]
    };
    triple(edges(start), edges(end))
}

/// A cubic by its coefficients, the constant first.
pub(super) type Cubic = [f64; 4];

/// The determinant of three vectors that go straight from the first three to the others.
pub(super) fn triple([a1, a2, a3]: [Vector; 3], [b1, b2, b3]: [Vector; 3]) -> Cubic {
    let (d1, d2, d3) = (subtract(b1, a1), subtract(b2, a2), subtract(b3, a3));
    [
        determinant(a1, a2, a3),
        determinant(d1, a2, a3) + determinant(a1, d2, a3) + determinant(a1, a2, d3),
        determinant(d1, d2, a3) + determinant(d1, a2, d3) + determinant(a1, d2, d3),
        determinant(d1, d2, d3),
    ]
}

/// Minimises a cubic over `0..=until`.
///
/// The cubic's Bernstein coefficients bound it from below; where they are all positive nothing else is computed. Else the ends
/// and the roots of the derivative are compared.
pub(super) fn least_of_cubic(c: Cubic, until: f64) -> Least {
    let evaluate = |t: f64| c[0] + t * (c[1] + t * (c[2] + t * c[3]));
    let magnitude = c.iter().map(|value| value.abs()).sum::<f64>();
    if !magnitude.is_finite() {
        return Least { value: f64::NAN, at: until, positive: false };
    }
    let rounding = 16.0 * f64::EPSILON * magnitude;
    let mut least = Least { value: c[0], at: 0.0, positive: true };
    let consider = |t: f64, least: &mut Least| {
        let value = evaluate(t);
        if value < least.value {
            (least.value, least.at) = (value, t);
        }
    };
    consider(until, &mut least);
    let (u1, u2) = (until * c[1], until * until * c[2]);
    let inner = (c[0] + u1 / 3.0).min(c[0] + (2.0 * u1 + u2) / 3.0);
    if inner <= least.value {
        for t in quadratic_roots(3.0 * c[3], 2.0 * c[2], c[1]) {
            if t > 0.0 && t < until {
                consider(t, &mut least);
            }
        }
    }
    least.positive = least.value > rounding || (least.at == 0.0 && least.value > 0.0);
    least
}

/// The real roots of `a t² + b t + c`, computed without cancellation; NaN where there is none.
fn quadratic_roots(a: f64, b: f64, c: f64) -> [f64; 2] {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return [f64::NAN; 2];
    }
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    [q / a, c / q]
}

/// The least determinant of a cell on its way from `start` to `start + until (end - start)`, at its corners and, where that is not
/// positive, inside; for polygons, the least of each corner's area against the cell's normal at the start.
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
        gather(start, &mut first.points);
        gather(end, &mut last.points);
        return least_of_polygon(&first.points, &last.points, until);
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
