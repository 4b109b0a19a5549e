//! Whether a cell with curved faces is valid at every place inside it, and not at its corners
//! alone.
//!
//! The determinant of the map of a hexahedron, wedge or pyramid is a polynomial of degree 2 along
//! each of its axes. Its Bernstein coefficients bound it from below (A. Johnen, J.-C. Weill, J.-F.
//! Remacle, *Robust and efficient validation of the linear hexahedral element*, 2017); where they
//! are not all positive the cell is cut in halves, whose coefficients lie closer. Along a straight
//! path each coefficient is a cubic in the path parameter.

use super::cubic::{Cubic, Least, least_of_cubic, triple};
use crate::mesh::cell_geometry::VOXEL_AS_HEXAHEDRON;
use crate::mesh::{CellType, Vector};
use crate::vector::subtract;

/// How often a cell is cut in halves along each axis before it is taken to be broken.
const CUTS: usize = 3;

/// The ends of an edge of the map, at the start and at the end of the path.
type Edge = [Vector; 2];

/// The least Bernstein coefficient that is not positive on the way of a cell from `start` to `start
/// + until (end - start)`, after the cuts; [`Least::NONE`] where there is none.
pub(super) fn least_inside(
    cell_type: CellType,
    start: &[Vector],
    end: &[Vector],
    until: f64,
) -> Least {
    let edge = |from: usize, to: usize| -> Edge {
        [subtract(start[to], start[from]), subtract(end[to], end[from])]
    };
    match cell_type {
        CellType::Hexahedron => hexahedron(edge, |local| local, until),
        CellType::Voxel => hexahedron(edge, |local| VOXEL_AS_HEXAHEDRON[local], until),
        CellType::Wedge => (0..3)
            .map(|corner| {
                let (first, second) = ([edge(0, 1), edge(3, 4)], [edge(0, 2), edge(3, 5)]);
                let height = edge(corner, corner + 3);
                let mut coefficients = [[0.0; 4]; 3];
                for (k, u) in first.into_iter().enumerate() {
                    for (l, v) in second.into_iter().enumerate() {
                        accumulate(&mut coefficients[k + l], u, v, height, 1.0 / weight(k + l));
                    }
                }
                least(&coefficients, 1, until, CUTS)
            })
            .fold(Least::NONE, Least::worse),
        CellType::Pyramid => {
            let base = |r: usize, s: usize| if s == 0 { r } else { 3 - r };
            let mut coefficients = [[0.0; 4]; 9];
            for r in 0..2 {
                for s in 0..2 {
                    let (u, v) = (edge(base(0, s), base(1, s)), edge(base(r, 0), base(r, 1)));
                    for p in 0..2 {
                        for q in 0..2 {
                            let (i, j) = (r + p, s + q);
                            let factor = 1.0 / (weight(i) * weight(j));
                            accumulate(
                                &mut coefficients[i + 3 * j],
                                u,
                                v,
                                edge(base(p, q), 4),
                                factor,
                            );
                        }
                    }
                }
            }
            least(&coefficients, 2, until, CUTS)
        }
        _ => Least::NONE,
    }
}

fn hexahedron(
    edge: impl Fn(usize, usize) -> Edge,
    at: impl Fn(usize) -> usize,
    until: f64,
) -> Least {
    let corner = |a: usize, b: usize, c: usize| at(4 * c + if b == 0 { a } else { 3 - a });
    let mut coefficients = [[0.0; 4]; 27];
    for pair in 0..4 {
        let (b1, c1) = (pair % 2, pair / 2);
        let u = edge(corner(0, b1, c1), corner(1, b1, c1));
        for pair in 0..4 {
            let (a1, c2) = (pair % 2, pair / 2);
            let v = edge(corner(a1, 0, c2), corner(a1, 1, c2));
            for pair in 0..4 {
                let (a2, b2) = (pair % 2, pair / 2);
                let w = edge(corner(a2, b2, 0), corner(a2, b2, 1));
                let (i, j, k) = (a1 + a2, b1 + b2, c1 + c2);
                let factor = 1.0 / (weight(i) * weight(j) * weight(k));
                accumulate(&mut coefficients[i + 3 * j + 9 * k], u, v, w, factor);
            }
        }
    }
    least(&coefficients, 3, until, CUTS)
}

/// The binomial coefficient of 2 over `index`.
fn weight(index: usize) -> f64 {
    if index == 1 { 2.0 } else { 1.0 }
}

fn accumulate(sum: &mut Cubic, [u0, u1]: Edge, [v0, v1]: Edge, [w0, w1]: Edge, factor: f64) {
    for (sum, value) in sum.iter_mut().zip(triple([u0, v0, w0], [u1, v1, w1])) {
        *sum += factor * value;
    }
}

/// Looks at `3^axes` coefficients, the first axis running fastest.
fn least(coefficients: &[Cubic], axes: usize, until: f64, cuts: usize) -> Least {
    let worst = coefficients
        .iter()
        .map(|&cubic| least_of_cubic(cubic, until))
        .fold(Least::NONE, Least::worse);
    if worst.positive {
        return Least::NONE;
    }
    // At the corners the coefficients are the determinant itself.
    let at_corner = |mut index: usize| {
        (0..axes).all(|_| {
            let digit = index % 3;
            index /= 3;
            digit != 1
        })
    };
    let broken = (0..coefficients.len())
        .filter(|&index| at_corner(index))
        .map(|index| least_of_cubic(coefficients[index], until));
    let broken = broken.fold(Least::NONE, Least::worse);
    if !broken.positive {
        return broken;
    }
    if cuts == 0 {
        return worst;
    }
    let mut parts = vec![coefficients.to_vec()];
    for axis in 0..axes {
        let stride = 3usize.pow(u32::try_from(axis).unwrap_or(0));
        parts = parts.iter().flat_map(|part| halves(part, stride)).collect();
    }
    parts
        .iter()
        .map(|part| least(part, axes, until, cuts - 1))
        .find(|least| !least.positive)
        .unwrap_or(Least::NONE)
}

/// The coefficients on both halves along the axis of this stride (P. de Casteljau).
fn halves(coefficients: &[Cubic], stride: usize) -> [Vec<Cubic>; 2] {
    let mut result = [coefficients.to_vec(), coefficients.to_vec()];
    let middle =
        |a: Cubic, b: Cubic| -> Cubic { std::array::from_fn(|power| 0.5 * (a[power] + b[power])) };
    for first in (0..coefficients.len()).filter(|index| (index / stride).is_multiple_of(3)) {
        let [a, b, c] = [0, 1, 2].map(|step| coefficients[first + step * stride]);
        let (ab, bc) = (middle(a, b), middle(b, c));
        let centre = middle(ab, bc);
        (result[0][first + stride], result[0][first + 2 * stride]) = (ab, centre);
        (result[1][first], result[1][first + stride]) = (centre, bc);
    }
    result
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mesh::Cells;
    use crate::mesh::cell_geometry::{corner_tets, tet_determinant};
    use crate::quality::quality;
    use crate::vector::{add, determinant, scale};

    const CUBE: [Vector; 8] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 1.0],
        [1.0, 1.0, 1.0],
        [0.0, 1.0, 1.0],
    ];

    /// The determinant of the map of a hexahedron at one place, by its shape functions.
    fn at(points: &[Vector], place: Vector) -> f64 {
        let mut columns = [[0.0; 3]; 3];
        for (corner, &point) in CUBE.iter().zip(points) {
            let value: Vector =
                std::array::from_fn(|k| if corner[k] > 0.5 { place[k] } else { 1.0 - place[k] });
            let slope: Vector = std::array::from_fn(|k| if corner[k] > 0.5 { 1.0 } else { -1.0 });
            for (axis, column) in columns.iter_mut().enumerate() {
                let factor: f64 =
                    (0..3).map(|k| if k == axis { slope[k] } else { value[k] }).product();
                *column = add(*column, scale(point, factor));
            }
        }
        determinant(columns[0], columns[1], columns[2])
    }

    fn grid() -> impl Iterator<Item = Vector> {
        (0..1000).map(|n| [n % 10, n / 10 % 10, n / 100].map(|k| f64::from(k) / 9.0))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        /// A cell that is called valid is valid at every sampled point, and a cell far from broken is not
        /// refused.
        #[test]
        fn hexahedra_are_judged_inside(moves in prop::collection::vec(prop::array::uniform3(-0.45..0.45f64), 8)) {
            let points: Vec<Vector> = CUBE.iter().zip(&moves).map(|(&a, &b)| add(a, b)).collect();
            let least = grid().map(|place| at(&points, place)).fold(f64::INFINITY, f64::min);
            let found = least_inside(CellType::Hexahedron, &points, &points, 1.0);
            prop_assert!(!found.positive || least > 0.0, "{least}");
            prop_assert!(found.positive || least < 0.05, "{least} {found:?}");
        }

        /// On the way from the cube too, for the cube split in wedges and drawn together to a
        /// pyramid as well.
        #[test]
        fn ways_are_judged_inside(moves in prop::collection::vec(prop::array::uniform3(-0.9..0.9f64), 8)) {
            let points: Vec<Vector> = CUBE.iter().zip(&moves).map(|(&a, &b)| add(a, b)).collect();
            let found = least_inside(CellType::Hexahedron, &CUBE, &points, 1.0);
            if found.positive {
                for step in 0..=10 {
                    let t = f64::from(step) / 10.0;
                    let between: Vec<Vector> =
                        CUBE.iter().zip(&moves).map(|(&a, &b)| add(a, scale(b, t))).collect();
                    prop_assert!(grid().all(|place| at(&between, place) > 0.0));
                }
            }
            // A wedge and a pyramid are hexahedra with corners in one place.
            for (cell_type, merged) in [(CellType::Wedge, [0, 1, 2, 2, 3, 4, 5, 5]), (CellType::Pyramid, [0, 1, 2, 3, 4, 4, 4, 4])] {
                let start = if cell_type == CellType::Wedge {
                    vec![CUBE[0], CUBE[1], CUBE[2], CUBE[4], CUBE[5], CUBE[6]]
                } else {
                    CUBE[..5].to_vec()
                };
                let end: Vec<Vector> = start.iter().zip(&moves).map(|(&a, &b)| add(a, b)).collect();
                if least_inside(cell_type, &start, &end, 1.0).positive {
                    let as_hexahedron: Vec<Vector> = merged.iter().map(|&local| end[local]).collect();
                    let inner = grid().filter(|p| p.iter().all(|&x| x < 0.95));
                    prop_assert!(inner.into_iter().all(|place| at(&as_hexahedron, place) > 0.0), "{cell_type}");
                }
            }
        }
    }

    /// The top of a box turned by 150 degrees in its plane and stretched: every corner is valid,
    /// the middle is turned over.
    #[test]
    fn a_cell_broken_between_its_corners_is_found() {
        let (sine, cosine) = 150f64.to_radians().sin_cos();
        let lift = |[x, y, z]: Vector| {
            if z > 0.5 {
                [3.0 * cosine * x - sine / 3.0 * y, 3.0 * sine * x + cosine / 3.0 * y, z]
            } else {
                [x, y, z]
            }
        };
        let wedge = [CUBE[0], CUBE[1], CUBE[3], CUBE[4], CUBE[5], CUBE[7]].map(lift);
        for (cell_type, points) in
            [(CellType::Hexahedron, CUBE.map(lift).to_vec()), (CellType::Wedge, wedge.to_vec())]
        {
            let numbers = (0..).take(points.len()).collect();
            let cells = Cells::uniform(cell_type, numbers).unwrap();
            let mut tets = Vec::new();
            corner_tets(&cells, 0, |vertex| points[vertex as usize], &mut tets);
            assert!(tets.iter().all(|&tet| tet_determinant(tet) > 0.5));
            assert!(!least_inside(cell_type, &points, &points, 1.0).positive);
            assert_eq!(quality(&cells, &points).inverted, 1);
        }
    }
}
