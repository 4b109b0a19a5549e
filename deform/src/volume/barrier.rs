//! The energy whose minimum has good cells around a vertex.
#![expect(
    clippy::needless_range_loop,
    reason = "loops over lanes and axes read like the formulas, and vectorise"
)]

use crate::lanes::{LANES, Lanes, with_wide_registers};
use crate::mesh::Vector;
use crate::vector::{add, cross, dot, scale, subtract};

/// The weight of the mean against the barrier.
const MEAN: f64 = 0.01;

/// Longest and shortest step tried along a direction, as powers of 2.
const LONGER: usize = 30;
const SHORTER: usize = 12;

/// Where a vertex comes first, the others of a tetrahedron follow so that its orientation stays.
const FIRST: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 0, 3, 2], [2, 0, 1, 3], [3, 0, 2, 1]];

/// A tetrahedron at a corner of a cell, or a cell that is one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Simplex {
    pub(super) vertices: [u32; 4],
    /// Makes a corner's determinant by the product of its edges the quality.
    pub(super) factor: f64,
    /// Whether all four corners count, or the first alone.
    pub(super) whole: bool,
}

impl Simplex {
    /// The least quality at its corners.
    pub(super) fn least(&self, points: &[Vector]) -> f64 {
        let [a, b, c, d] = self.vertices.map(|vertex| points[vertex as usize]);
        let [ab, ac, ad] = [b, c, d].map(|other| subtract(other, a));
        let determinant = self.factor * dot(cross(ab, ac), ad);
        let square = |edge: Vector| dot(edge, edge);
        let [ab, ac, ad] = [ab, ac, ad].map(square);
        let first = ab * ac * ad;
        if !self.whole {
            return determinant / first.sqrt();
        }
        let [bc, bd, cd] = [subtract(c, b), subtract(d, b), subtract(d, c)].map(square);
        // The largest product makes the smallest quality.
        let most = first.max(ab * bc * bd).max(ac * bc * cd).max(ad * bd * cd);
        determinant / most.sqrt()
    }
}

/// Four simplices as one of their vertices sees them.
#[derive(Debug, Clone, Copy)]
struct Four {
    /// The coordinates of each other vertex.
    others: [[Lanes; 3]; 3],
    /// The gradient of the determinant by the vertex.
    normal: [Lanes; 3],
    factor: Lanes,
    /// The part of each corner's product of edges that does not depend on the vertex, the vertex's
    /// own corner first; infinite for corners that do not count.
    roots: [Lanes; 4],
}

/// The simplices around a vertex, as it sees them.
#[derive(Debug, Default)]
pub(super) struct Star {
    fours: Vec<Four>,
}

/// Four simplices where the vertex is at a point.
struct Seen {
    /// The edges from the others to the vertex, and their squared lengths.
    edges: [[Lanes; 3]; 3],
    squares: [Lanes; 3],
    determinant: Lanes,
    /// The determinant by that of a corner at right angles: a corner's quality times the product of
    /// its edges.
    scaled: Lanes,
    /// The product of the edges at each corner; of no meaning at those that do not count.
    roots: [Lanes; 4],
}

impl Four {
    /// No simplex: a corner counts once it is given its part of the product.
    const NONE: Self = Self {
        others: [[Lanes::ZERO; 3]; 3],
        normal: [Lanes::ZERO; 3],
        factor: Lanes::ZERO,
        roots: [Lanes::all(f64::INFINITY); 4],
    };

    /// Finds what does not depend on the vertex, from the others' coordinates. Roots are 0 or
    /// infinite before.
    #[inline(always)]
    fn complete(&mut self) {
        let [a, b, c] = self.others;
        let edge = |p: [Lanes; 3], q: [Lanes; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let [x, y] = [edge(c, a), edge(b, a)];
        for axis in 0..3 {
            let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
            self.normal[axis] = x[next] * y[last] - x[last] * y[next];
        }
        let length = |[x, y, z]: [Lanes; 3]| (x * x + y * y + z * z).sqrt();
        let (ab, ac, bc) = (length(y), length(x), length(edge(c, b)));
        let products = [Lanes::all(1.0), ab * ac, ab * bc, ac * bc];
        for (root, product) in self.roots.iter_mut().zip(products) {
            *root += product;
        }
    }

    #[inline(always)]
    fn seen_from(&self, point: [Lanes; 3]) -> Seen {
        let mut edges = [[Lanes::ZERO; 3]; 3];
        let mut squares = [Lanes::ZERO; 3];
        for other in 0..3 {
            for axis in 0..3 {
                edges[other][axis] = point[axis] - self.others[other][axis];
            }
            let [x, y, z] = edges[other];
            squares[other] = x * x + y * y + z * z;
        }
        let [x, y, z] = edges[0];
        let determinant = self.normal[0] * x + self.normal[1] * y + self.normal[2] * z;
        let [a, b, c] = squares.map(Lanes::sqrt);
        let own = [a * b * c, a, b, c];
        let mut roots = self.roots;
        for corner in 0..4 {
            roots[corner] *= own[corner];
        }
        Seen { edges, squares, determinant, scaled: self.factor * determinant, roots }
    }

    /// Adds to the energy: the sum of the barriers, and the sum of `ln q`. Whether every corner is
    /// above the barrier.
    #[inline(always)]
    fn add_energy(
        &self,
        seen: &Seen,
        parts: [Lanes; 4],
        above: [Lanes; 4],
        sum: &mut Lanes,
        logarithms: &mut f64,
    ) -> bool {
        let one = Lanes::all(1.0);
        let (mut lowest, mut products) = (one, [[one; 2]; 2]);
        for corner in 0..4 {
            let counts = self.roots[corner];
            *sum += (parts[corner] * parts[corner]).where_finite(counts, Lanes::ZERO);
            lowest = lowest.least(above[corner].where_finite(counts, one));
            products[corner / 2][0] *= seen.scaled.where_finite(counts, one);
            products[corner / 2][1] *= seen.roots[corner].where_finite(counts, one);
        }
        let [first, second] = products.map(|[scaled, roots]| scaled / roots);
        *logarithms += (first * second).product().ln();
        lowest.all_above(0.0)
    }
}

impl Star {
    /// Makes it the star of a vertex: each simplex comes with the index of the vertex in it.
    pub(super) fn gather<'a>(
        &mut self,
        simplices: impl IntoIterator<Item = (&'a Simplex, usize)>,
        points: &[Vector],
    ) {
        self.fours.clear();
        for (count, (simplex, index)) in simplices.into_iter().enumerate() {
            let lane = count % LANES;
            if lane == 0 {
                self.fours.push(Four::NONE);
            }
            let Some(four) = self.fours.last_mut() else { return };
            let order = FIRST[index];
            for (lanes, local) in four.others.iter_mut().zip(&order[1..]) {
                let point = points[simplex.vertices[*local] as usize];
                for axis in 0..3 {
                    lanes[axis].0[lane] = point[axis];
                }
            }
            four.factor.0[lane] = simplex.factor;
            for (root, local) in four.roots.iter_mut().zip(order) {
                if simplex.whole || local == 0 {
                    root.0[lane] = 0.0;
                }
            }
        }
        with_wide_registers(
            #[inline(always)]
            || self.fours.iter_mut().for_each(Four::complete),
        );
    }

    /// Whether every quality is above `bound` where the vertex is at `point`.
    pub(super) fn is_above(&self, point: Vector, bound: f64) -> bool {
        with_wide_registers(
            #[inline(always)]
            || {
                let (point, bound) = (point.map(Lanes::all), Lanes::all(bound));
                self.fours.iter().all(|four| {
                    let seen = four.seen_from(point);
                    let mut least = Lanes::all(1.0);
                    for corner in 0..4 {
                        let above = seen.scaled - bound * seen.roots[corner];
                        least = least.least(above.where_finite(four.roots[corner], least));
                    }
                    least.all_above(0.0)
                })
            },
        )
    }
}

/// The energy that one sweep lowers: `Σ (δ / (q - τ))² - 0.01 ln q` over the corners `q` of a star.
#[derive(Debug, Clone, Copy)]
pub(super) struct Barrier {
    /// `τ`.
    pub(super) floor: f64,
    /// `δ`.
    pub(super) gap: f64,
}

/// The energy at a place, with its gradient and Hessian.
pub(super) struct Derivatives {
    pub(super) energy: f64,
    pub(super) gradient: Vector,
    pub(super) hessian: [Vector; 3],
}

impl Barrier {
    /// The energy; infinite where a corner is not above the barrier.
    ///
    /// With `s` the determinant of a corner and `r` the product of its edges, `q = s / r` and
    /// `δ / (q - τ) = δ r / (s - τ r)`, which takes one division.
    pub(super) fn energy(&self, point: Vector, star: &Star) -> f64 {
        with_wide_registers(
            #[inline(always)]
            || {
                let point = point.map(Lanes::all);
                let (floor, gap) = (Lanes::all(self.floor), Lanes::all(self.gap));
                let (mut sum, mut logarithms) = (Lanes::ZERO, 0.0);
                for four in &star.fours {
                    let seen = four.seen_from(point);
                    let above = seen.roots.map(|root| seen.scaled - floor * root);
                    let mut parts = [Lanes::ZERO; 4];
                    for corner in 0..4 {
                        parts[corner] = gap * seen.roots[corner] / above[corner];
                    }
                    if !four.add_energy(&seen, parts, above, &mut sum, &mut logarithms) {
                        return f64::INFINITY;
                    }
                }
                finite_or_infinite(sum.sum() - MEAN * logarithms)
            },
        )
    }

    /// A better place of a vertex, or its own where none is found.
    pub(super) fn improved(&self, point: Vector, star: &Star) -> Vector {
        let Derivatives { energy, gradient, hessian } = self.derivatives(point, star);
        let Some(direction) = newton(&gradient, &hessian) else { return point };
        let along = |length: f64| self.energy(add(point, scale(direction, length)), star);
        searched(point, direction, energy, dot(direction, gradient), along)
    }

    /// The energy, and its gradient and Hessian by the place of the vertex.
    pub(super) fn derivatives(&self, point: Vector, star: &Star) -> Derivatives {
        with_wide_registers(
            #[inline(always)]
            || {
                let point = point.map(Lanes::all);
                let (floor, gap, zero) =
                    (Lanes::all(self.floor), Lanes::all(self.gap), Lanes::ZERO);
                let (one, mean) = (Lanes::all(1.0), Lanes::all(MEAN));
                let (two, six) = (Lanes::all(2.0), Lanes::all(6.0));
                let (mut sum, mut logarithms, mut is_above) = (zero, 0.0, true);
                let mut gradient = [zero; 3];
                let mut hessian = [[zero; 3]; 3];
                for four in &star.fours {
                    let seen = four.seen_from(point);
                    let mut units = [[zero; 3]; 3];
                    let inverse = seen.squares.map(|square| one / square);
                    for other in 0..3 {
                        for axis in 0..3 {
                            units[other][axis] = seen.edges[other][axis] * inverse[other];
                        }
                    }
                    let by_determinant = one / seen.determinant;
                    let normal = four.normal.map(|part| part * by_determinant);
                    let above = seen.roots.map(|root| seen.scaled - floor * root);
                    let mut parts = [zero; 4];
                    for corner in 0..4 {
                        // The derivatives of -ln q.
                        let own = if corner == 0 { 0..3 } else { corner - 1..corner };
                        let mut slope = [zero; 3];
                        let mut bend = [[zero; 3]; 3];
                        for row in 0..3 {
                            slope[row] = zero - normal[row];
                            for column in 0..=row {
                                bend[row][column] = normal[row] * normal[column];
                            }
                        }
                        for other in own {
                            for row in 0..3 {
                                slope[row] += units[other][row];
                                bend[row][row] += inverse[other];
                                for column in 0..=row {
                                    bend[row][column] -=
                                        two * units[other][row] * units[other][column];
                                }
                            }
                        }
                        let by_above = one / above[corner];
                        parts[corner] = gap * seen.roots[corner] * by_above;
                        let barrier = parts[corner] * parts[corner];
                        // The first and second derivative by q, times q and its square.
                        let ratio = seen.scaled * by_above;
                        let first = zero - two * barrier * ratio - mean;
                        let second = six * barrier * ratio * ratio + mean;
                        let counts = four.roots[corner];
                        let outer = second + first;
                        for row in 0..3 {
                            gradient[row] -= (slope[row] * first).where_finite(counts, zero);
                            for column in 0..=row {
                                let value =
                                    slope[row] * slope[column] * outer - bend[row][column] * first;
                                hessian[row][column] += value.where_finite(counts, zero);
                            }
                        }
                    }
                    is_above &= four.add_energy(&seen, parts, above, &mut sum, &mut logarithms);
                }
                let h = |row: usize, column: usize| hessian[row.max(column)][row.min(column)].sum();
                let energy = sum.sum() - MEAN * logarithms;
                Derivatives {
                    energy: if is_above { finite_or_infinite(energy) } else { f64::INFINITY },
                    gradient: gradient.map(Lanes::sum),
                    hessian: std::array::from_fn(|row| {
                        std::array::from_fn(|column| h(row, column))
                    }),
                }
            },
        )
    }
}

fn finite_or_infinite(energy: f64) -> f64 {
    if energy.is_nan() { f64::INFINITY } else { energy }
}

/// All steps that [`searched`] may try, and none.
pub(super) const LENGTHS: usize = LONGER + SHORTER;

pub(super) fn length(index: usize) -> f64 {
    let power = |power: usize| f64::from(i32::try_from(power).unwrap_or(0));
    if index == 0 { 0.0 } else { (power(index) - power(SHORTER)).exp2() }
}

/// The place along a direction where the energy, a function of the length, has fallen enough: where
/// the direction itself is not too long but falls short, as it does near the barrier, it is doubled
/// while that helps. `before` and `slope` are the energy and its derivative at length 0.
pub(super) fn searched(
    point: Vector,
    direction: Vector,
    before: f64,
    slope: f64,
    mut energy: impl FnMut(f64) -> f64,
) -> Vector {
    if !before.is_finite() {
        return point;
    }
    let at = |length: f64| add(point, scale(direction, length));
    let mut length = 1.0;
    for _ in 0..SHORTER {
        let reached = energy(length);
        if reached <= before + 1e-4 * length * slope {
            if length < 1.0 {
                return at(length);
            }
            let mut least = reached;
            for _ in 0..LONGER {
                let longer = energy(2.0 * length);
                if longer.is_nan() || longer >= least {
                    break;
                }
                (least, length) = (longer, 2.0 * length);
            }
            return at(length);
        }
        length *= 0.5;
    }
    point
}

/// The direction of Newton's method, with as much of the identity added to the Hessian as makes it
/// positive definite.
pub(super) fn newton(gradient: &Vector, hessian: &[Vector; 3]) -> Option<Vector> {
    let size = (hessian[0][0] + hessian[1][1] + hessian[2][2]).abs();
    let least = 1e-9 * size;
    let mut shift = 0.0;
    for _ in 0..20 {
        let added = shift;
        let h = |row: usize, column: usize| {
            hessian[row][column] + if row == column { added } else { 0.0 }
        };
        shift = if shift == 0.0 { 1e-3 * size } else { 4.0 * shift };
        let first = h(0, 0);
        if first.is_nan() || first <= least {
            continue;
        }
        let (l10, l20) = (h(1, 0) / first, h(2, 0) / first);
        let second = h(1, 1) - l10 * h(1, 0);
        if second <= least {
            continue;
        }
        let l21 = (h(2, 1) - l20 * h(1, 0)) / second;
        let third = h(2, 2) - l20 * h(2, 0) - l21 * l21 * second;
        if third <= least {
            continue;
        }
        let y = [-gradient[0], -gradient[1] + l10 * gradient[0]];
        let y = [y[0], y[1], -gradient[2] - l20 * y[0] - l21 * y[1]];
        let z = y[2] / third;
        let middle = y[1] / second - l21 * z;
        let direction = [y[0] / first - l10 * middle - l20 * z, middle, z];
        return direction.iter().all(|value| value.is_finite()).then_some(direction);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(simplices: &[(Simplex, usize)], points: &[Vector]) -> Star {
        let mut star = Star::default();
        star.gather(simplices.iter().map(|(simplex, index)| (simplex, *index)), points);
        star
    }

    /// An octahedron's four tetrahedra and two of its corners, seen from a place near the middle.
    fn star() -> (Vector, Star) {
        let points = [
            [0.05, -0.03, 0.04],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.1],
            [-1.0, 0.2, 0.0],
            [0.0, -1.0, 0.0],
            [0.1, 0.0, 1.2],
            [0.0, 0.0, -1.0],
        ];
        let simplex = |vertices, whole| Simplex { vertices, factor: 1.2, whole };
        let simplices = [
            ([0, 1, 2, 5], 0, true),
            ([2, 3, 0, 5], 2, true),
            ([4, 3, 5, 0], 3, true),
            ([4, 0, 5, 1], 1, true),
            ([0, 2, 1, 6], 0, false),
            ([2, 3, 6, 0], 3, false),
        ]
        .map(|(vertices, index, whole)| (simplex(vertices, whole), index));
        (points[0], of(&simplices, &points))
    }

    #[test]
    fn derivatives_are_those_of_the_energy() {
        let (point, star) = star();
        let barrier = Barrier { floor: 0.2, gap: 0.1 };
        let Derivatives { energy, gradient, hessian } = barrier.derivatives(point, &star);
        assert!((energy - barrier.energy(point, &star)).abs() < 1e-13 * energy);
        for axis in 0..3 {
            let at = |step: f64| {
                let mut moved = point;
                moved[axis] += step;
                moved
            };
            let slope = (barrier.energy(at(1e-6), &star) - barrier.energy(at(-1e-6), &star)) / 2e-6;
            assert!(
                (slope - gradient[axis]).abs() < 1e-5 * (1.0 + slope.abs()),
                "{slope} {}",
                gradient[axis]
            );
            let [after, before] =
                [1e-6, -1e-6].map(|step| barrier.derivatives(at(step), &star).gradient);
            for row in 0..3 {
                let bend = (after[row] - before[row]) / 2e-6;
                assert!(
                    (bend - hessian[row][axis]).abs() < 1e-4 * (1.0 + bend.abs()),
                    "{bend} {}",
                    hessian[row][axis]
                );
            }
        }
    }

    /// Three edges of length 1 at right angles: the quality at their corner is the factor, at the
    /// others the factor by the root of 4.
    #[test]
    fn corners_count_as_their_simplex_says() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let barrier = Barrier { floor: 0.1, gap: 0.3 };
        for (whole, least, corners) in
            [(true, 0.4, vec![0.8, 0.4, 0.4, 0.4]), (false, 0.8, vec![0.8])]
        {
            let simplex = Simplex { vertices: [0, 1, 2, 3], factor: 0.8, whole };
            assert!((simplex.least(&points) - least).abs() < 1e-15);
            let expected: f64 =
                corners.iter().map(|q: &f64| (0.3 / (q - 0.1)).powi(2) - MEAN * q.ln()).sum();
            for index in 0..4 {
                let star = of(&[(simplex, index)], &points);
                assert!((barrier.energy(points[index], &star) - expected).abs() < 1e-13, "{index}");
                assert!(
                    star.is_above(points[index], 0.999 * least)
                        && !star.is_above(points[index], 1.001 * least)
                );
            }
            assert_eq!(
                Barrier { floor: least, ..barrier }
                    .energy(points[0], &of(&[(simplex, 0)], &points)),
                f64::INFINITY
            );
        }
    }
}
