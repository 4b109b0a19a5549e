//! Tetrahedra on their straight way from one shape to another, four at a time.

use std::f64::consts::SQRT_2;

use crate::lanes::{LANES, Lanes};
use crate::mesh::Vector;

/// A vector of each of four cells.
type Vectors = [Lanes; 3];

/// Four tetrahedra whose vertices go straight from one place to another.
///
/// All that is computed of them has the bits that the cells one by one have.
pub(super) struct FourTets {
    start: [Vectors; 4],
    end: [Vectors; 4],
    way: [Vectors; 4],
}

impl FourTets {
    /// The tetrahedra of these vertices.
    #[inline(always)]
    pub(super) fn new(cells: [&[u32]; LANES], start: &[Vector], end: &[Vector]) -> Self {
        let (start, end) = (corners(cells, start), corners(cells, end));
        let way = std::array::from_fn(|vertex| subtract(end[vertex], start[vertex]));
        Self { start, end, way }
    }

    /// Their scaled Jacobians a `fraction` of the way, -1 where one is no number.
    #[inline(always)]
    pub(super) fn scaled_jacobians(&self, fraction: f64) -> Lanes {
        if fraction == 1.0 {
            return scaled_jacobians(self.end);
        }
        let fraction = Lanes::all(fraction);
        let [mut a, mut b, mut c, mut d] = self.start;
        for (point, way) in [&mut a, &mut b, &mut c, &mut d].into_iter().zip(self.way) {
            for axis in 0..3 {
                point[axis] += way[axis] * fraction;
            }
        }
        scaled_jacobians([a, b, c, d])
    }

    /// Whether the determinants are surely positive on the way to `until`: by the least Bernstein
    /// coefficients of the cubics that they are, and twice the rounding of `least_of_cubic`.
    #[inline(always)]
    pub(super) fn stay_valid(&self, until: f64) -> bool {
        let edges = |[origin, a, b, c]: [Vectors; 4]| [a, b, c].map(|end| subtract(end, origin));
        let ([a1, a2, a3], [b1, b2, b3]) = (edges(self.start), edges(self.end));
        let (d1, d2, d3) = (subtract(b1, a1), subtract(b2, a2), subtract(b3, a3));
        let cubic = [
            determinant(a1, a2, a3),
            determinant(d1, a2, a3) + determinant(a1, d2, a3) + determinant(a1, a2, d3),
            determinant(d1, d2, a3) + determinant(d1, a2, d3) + determinant(a1, d2, d3),
            determinant(d1, d2, d3),
        ];
        let [c0, c1, c2, c3] = cubic;
        let (until, third) = (Lanes::all(until), Lanes::all(1.0 / 3.0));
        let (u1, u2) = (until * c1, until * until * c2);
        let end = c0 + until * (c1 + until * (c2 + until * c3));
        let least = c0.least(end).least(c0 + u1 * third).least(c0 + (u1 + u1 + u2) * third);
        let magnitude = cubic.map(Lanes::magnitude).into_iter().fold(Lanes::ZERO, |a, b| a + b);
        (least - Lanes::all(32.0 * f64::EPSILON) * magnitude).all_above(0.0)
    }
}

/// The least of the scaled Jacobians of four tetrahedra at `points`, -1 where one is no number.
#[inline(always)]
pub(super) fn scaled_jacobians_at(cells: [&[u32]; LANES], points: &[Vector]) -> Lanes {
    scaled_jacobians(corners(cells, points))
}

#[inline(always)]
fn corners(cells: [&[u32]; LANES], points: &[Vector]) -> [Vectors; 4] {
    let mut corners = [[Lanes::ZERO; 3]; 4];
    for (lane, vertices) in cells.into_iter().enumerate() {
        for (corner, &vertex) in corners.iter_mut().zip(vertices) {
            let point = points[vertex as usize];
            for axis in 0..3 {
                corner[axis].0[lane] = point[axis];
            }
        }
    }
    corners
}

/// As `tetra` of `cell_geometry` has it, operation by operation.
#[inline(always)]
fn scaled_jacobians([p0, p1, p2, p3]: [Vectors; 4]) -> Lanes {
    let (e01, e02, e03) = (subtract(p1, p0), subtract(p2, p0), subtract(p3, p0));
    let (e12, e13, e23) = (subtract(p2, p1), subtract(p3, p1), subtract(p3, p2));
    let jacobian = determinant(e01, e02, e03);
    let (l01, l02, l03) = (square(e01), square(e02), square(e03));
    let (l12, l13, l23) = (square(e12), square(e13), square(e23));
    let squared = (l01 * l02 * l03)
        .greatest(l01 * l12 * l13)
        .greatest(l02 * l12 * l23)
        .greatest(l03 * l13 * l23);
    let length = squared.sqrt().greatest(jacobian.magnitude());
    let ratio = (jacobian / length).unless_below(length, f64::MIN_POSITIVE);
    let scaled = Lanes::all(SQRT_2) * ratio;
    scaled.where_finite(scaled, Lanes::all(-1.0))
}

#[inline(always)]
fn subtract(a: Vectors, b: Vectors) -> Vectors {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn square(a: Vectors) -> Lanes {
    a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
}

#[inline(always)]
fn determinant(a: Vectors, b: Vectors, c: Vectors) -> Lanes {
    a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
}
