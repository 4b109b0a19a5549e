//! Interpolation within one cell, as VTK has it: the weights of the vertices at parametric
//! coordinates, and their derivatives.

use tombolo_deform::mesh::{CellType, Vector};
use tombolo_deform::vector::{add, cross, dot, length, scale, subtract, unit};

/// The weights of a cell's vertices at a point, and how they grow along the parametric coordinates.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Shape {
    weights: [f64; 8],
    slopes: [Vector; 8],
    count: usize,
}

impl Shape {
    fn of<const N: usize>(parts: [(f64, Vector); N]) -> Self {
        let (mut weights, mut slopes) = ([0.0; 8], [[0.0; 3]; 8]);
        for (vertex, (weight, slope)) in parts.into_iter().enumerate() {
            (weights[vertex], slopes[vertex]) = (weight, slope);
        }
        Self { weights, slopes, count: N }
    }

    /// The weight of each vertex; their sum is 1.
    pub(crate) fn weights(&self) -> &[f64] {
        &self.weights[..self.count]
    }

    /// The derivatives of the position along the parametric coordinates. Of a cell of dimension 2
    /// the third is its normal, of length 1.
    pub(crate) fn tangents(&self, points: &[Vector], dimension: usize) -> [Vector; 3] {
        let mut tangents = [[0.0; 3]; 3];
        for (point, slope) in points.iter().zip(&self.slopes) {
            for (tangent, slope) in tangents.iter_mut().zip(slope) {
                *tangent = add(*tangent, scale(*point, *slope));
            }
        }
        if dimension == 2 {
            let normal = cross(tangents[0], tangents[1]);
            tangents[2] = unit(normal);
        }
        tangents
    }

    /// The derivatives of a value along the parametric coordinates.
    pub(crate) fn slope(&self, value: impl Fn(usize) -> f64) -> Vector {
        let parts = self.slopes[..self.count].iter().enumerate();
        parts.fold([0.0; 3], |sum, (vertex, slope)| add(sum, scale(*slope, value(vertex))))
    }
}

/// The shape of a cell at parametric coordinates; `None` for types that have no such coordinates.
pub(crate) fn shape(cell_type: CellType, at: Vector) -> Option<Shape> {
    let [r, s, t] = at;
    let [x, y, z] = [1.0 - r, 1.0 - s, 1.0 - t];
    let corner = |at: [bool; 3]| {
        let pick = |axis: usize, low: f64, high: f64| if at[axis] { high } else { low };
        let [a, b, c] = [pick(0, x, r), pick(1, y, s), pick(2, z, t)];
        let [da, db, dc] = [0, 1, 2].map(|axis| if at[axis] { 1.0 } else { -1.0 });
        (a * b * c, [da * b * c, a * db * c, a * b * dc])
    };
    let flat = |at: [bool; 2]| {
        let (a, da) = if at[0] { (r, 1.0) } else { (x, -1.0) };
        let (b, db) = if at[1] { (s, 1.0) } else { (y, -1.0) };
        (a * b, [da * b, a * db, 0.0])
    };
    const L: bool = false;
    const H: bool = true;
    Some(match cell_type {
        CellType::Triangle => Shape::of([
            (1.0 - r - s, [-1.0, -1.0, 0.0]),
            (r, [1.0, 0.0, 0.0]),
            (s, [0.0, 1.0, 0.0]),
        ]),
        CellType::Quad => Shape::of([[L, L], [H, L], [H, H], [L, H]].map(flat)),
        CellType::Pixel => Shape::of([[L, L], [H, L], [L, H], [H, H]].map(flat)),
        CellType::Tetra => Shape::of([
            (1.0 - r - s - t, [-1.0, -1.0, -1.0]),
            (r, [1.0, 0.0, 0.0]),
            (s, [0.0, 1.0, 0.0]),
            (t, [0.0, 0.0, 1.0]),
        ]),
        CellType::Hexahedron => Shape::of(
            [
                [L, L, L],
                [H, L, L],
                [H, H, L],
                [L, H, L],
                [L, L, H],
                [H, L, H],
                [H, H, H],
                [L, H, H],
            ]
            .map(corner),
        ),
        CellType::Voxel => Shape::of(
            [
                [L, L, L],
                [H, L, L],
                [L, H, L],
                [H, H, L],
                [L, L, H],
                [H, L, H],
                [L, H, H],
                [H, H, H],
            ]
            .map(corner),
        ),
        CellType::Wedge => {
            let u = 1.0 - r - s;
            Shape::of([
                (u * z, [-z, -z, -u]),
                (r * z, [z, 0.0, -r]),
                (s * z, [0.0, z, -s]),
                (u * t, [-t, -t, u]),
                (r * t, [t, 0.0, r]),
                (s * t, [0.0, t, s]),
            ])
        }
        CellType::Pyramid => Shape::of([
            (x * y * z, [-y * z, -x * z, -x * y]),
            (r * y * z, [y * z, -r * z, -r * y]),
            (r * s * z, [s * z, r * z, -r * s]),
            (x * s * z, [-s * z, x * z, -x * s]),
            (t, [0.0, 0.0, 1.0]),
        ]),
        _ => return None,
    })
}

/// The parametric coordinates of each vertex.
pub(crate) fn corners(cell_type: CellType) -> &'static [Vector] {
    const O: Vector = [0.0, 0.0, 0.0];
    const X: Vector = [1.0, 0.0, 0.0];
    const Y: Vector = [0.0, 1.0, 0.0];
    const Z: Vector = [0.0, 0.0, 1.0];
    const XY: Vector = [1.0, 1.0, 0.0];
    const XZ: Vector = [1.0, 0.0, 1.0];
    const YZ: Vector = [0.0, 1.0, 1.0];
    const XYZ: Vector = [1.0, 1.0, 1.0];
    match cell_type {
        CellType::Triangle => &[O, X, Y],
        CellType::Quad => &[O, X, XY, Y],
        CellType::Pixel => &[O, X, Y, XY],
        CellType::Tetra => &[O, X, Y, Z],
        CellType::Hexahedron => &[O, X, XY, Y, Z, XZ, XYZ, YZ],
        CellType::Voxel => &[O, X, Y, XY, Z, XZ, YZ, XYZ],
        CellType::Wedge => &[O, X, Y, Z, XZ, YZ],
        CellType::Pyramid => &[O, X, XY, Y, Z],
        _ => &[],
    }
}

/// The parametric coordinates of the centre: the mean of the vertices'.
pub(crate) fn center(cell_type: CellType) -> Vector {
    match cell_type {
        CellType::Triangle => [1.0 / 3.0, 1.0 / 3.0, 0.0],
        CellType::Quad | CellType::Pixel => [0.5, 0.5, 0.0],
        CellType::Tetra => [0.25; 3],
        CellType::Wedge => [1.0 / 3.0, 1.0 / 3.0, 0.5],
        CellType::Pyramid => [0.4, 0.4, 0.2],
        _ => [0.5; 3],
    }
}

/// Whether parametric coordinates lie in the cell, or no further than `slack` beside it. Of a cell
/// of dimension 2 the third, the distance from it, does not count.
pub(crate) fn is_inside(cell_type: CellType, at: Vector, slack: f64) -> bool {
    let [r, s, t] = at;
    let within = |x: f64| x >= -slack && x <= 1.0 + slack;
    match cell_type {
        CellType::Triangle => r >= -slack && s >= -slack && r + s <= 1.0 + slack,
        CellType::Quad | CellType::Pixel => within(r) && within(s),
        CellType::Tetra => at.iter().all(|&x| x >= -slack) && r + s + t <= 1.0 + slack,
        CellType::Wedge => r >= -slack && s >= -slack && r + s <= 1.0 + slack && within(t),
        _ => at.iter().all(|&x| within(x)),
    }
}

/// The vector whose scalar products with these three are given; `None` where they lie in a plane.
pub(crate) fn solve([a, b, c]: [Vector; 3], products: Vector) -> Option<Vector> {
    let normals = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = dot(a, normals[0]);
    let sum = normals.iter().zip(products).fold([0.0; 3], |sum, (n, p)| add(sum, scale(*n, p)));
    let solution = scale(sum, 1.0 / determinant);
    solution.iter().all(|x| x.is_finite()).then_some(solution)
}

/// How near its apex a point is taken for that of a pyramid, by its distance from the base.
const APEX: f64 = 1e-12;

/// The parametric coordinates of a point, by Newton's method; `None` where it does not converge.
/// Of a cell of dimension 2 the third is the distance from it. A cell has at most 8 points.
pub(crate) fn locate(cell_type: CellType, points: &[Vector], point: Vector) -> Option<Vector> {
    let dimension = cell_type.dimension();
    // Measured from the point, what is rounded is as small as the cell, however far away it lies.
    let mut from = [[0.0; 3]; 8];
    let from = from.get_mut(..points.len())?;
    for (from, vertex) in from.iter_mut().zip(points) {
        *from = subtract(*vertex, point);
    }
    // At the apex of a pyramid two tangents vanish.
    if let (CellType::Pyramid, [base @ .., apex]) = (cell_type, &*from) {
        let longest = base.iter().map(|from| length(*from)).fold(0.0, f64::max);
        if length(*apex) < APEX * longest {
            return Some([0.5, 0.5, 1.0]);
        }
    }
    let mut at = center(cell_type);
    for _ in 0..50 {
        let shape = shape(cell_type, at)?;
        let parts = from.iter().zip(shape.weights());
        let beside = parts.fold([0.0; 3], |sum, (from, weight)| add(sum, scale(*from, *weight)));
        let [a, b, c] = shape.tangents(from, dimension);
        // The rows of the matrix whose columns are the tangents.
        let rows = [0, 1, 2].map(|axis| [a[axis], b[axis], c[axis]]);
        let step = scale(solve(rows, beside)?, -1.0);
        (0..dimension).for_each(|axis| at[axis] += step[axis]);
        if dimension == 2 {
            // Each step tells the whole distance, in units of the mesh: nothing that converges.
            at[2] = step[2];
        }
        if at[..dimension].iter().any(|x| x.abs() > 1e3) {
            return None;
        }
        if step[..dimension].iter().all(|x| x.abs() < 1e-10) {
            return Some(at);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use tombolo_deform::shapes::single_cell;
    use tombolo_deform::vector::distance;

    use super::*;

    const TYPES: [CellType; 8] = [
        CellType::Triangle,
        CellType::Quad,
        CellType::Pixel,
        CellType::Tetra,
        CellType::Hexahedron,
        CellType::Voxel,
        CellType::Wedge,
        CellType::Pyramid,
    ];

    #[test]
    fn weights_are_one_at_their_own_vertex_and_slopes_are_their_differences() {
        for cell_type in TYPES {
            for (vertex, &corner) in corners(cell_type).iter().enumerate() {
                let weights = shape(cell_type, corner).unwrap();
                for (other, &weight) in weights.weights().iter().enumerate() {
                    assert_eq!(weight, f64::from(u8::from(vertex == other)), "{cell_type}");
                }
            }
            let at = [0.3, 0.2, if cell_type.dimension() == 2 { 0.0 } else { 0.25 }];
            let here = shape(cell_type, at).unwrap();
            assert!((here.weights().iter().sum::<f64>() - 1.0).abs() < 1e-15);
            for axis in 0..cell_type.dimension() {
                let mut beside = [at; 2];
                beside[0][axis] -= 1e-6;
                beside[1][axis] += 1e-6;
                let [low, high] = beside.map(|at| shape(cell_type, at).unwrap());
                for vertex in 0..here.count {
                    let slope = (high.weights[vertex] - low.weights[vertex]) / 2e-6;
                    assert!((slope - here.slopes[vertex][axis]).abs() < 1e-9, "{cell_type}");
                }
            }
        }
    }

    #[test]
    fn points_are_found_where_they_were_put() {
        for cell_type in TYPES {
            let mut points = single_cell(cell_type).points().to_vec();
            // Bent, so that Newton's method has something to do.
            for (vertex, point) in
                points.iter_mut().enumerate().filter(|_| cell_type.dimension() == 3)
            {
                point[vertex % 3] += 0.1 * (vertex as f64).sin();
            }
            let at = [0.2, 0.3, if cell_type.dimension() == 2 { 0.0 } else { 0.4 }];
            let weights = shape(cell_type, at).unwrap();
            let parts = points.iter().zip(weights.weights());
            let point =
                parts.fold([0.0; 3], |sum, (point, weight)| add(sum, scale(*point, *weight)));
            let found = locate(cell_type, &points, point).unwrap();
            assert!(
                (0..3).all(|axis| (found[axis] - at[axis]).abs() < 1e-12),
                "{cell_type}: {found:?}"
            );
            assert!(is_inside(cell_type, found, 0.0));
        }
    }

    /// A cell, turned out of the planes of the axes.
    fn aslant(cell_type: CellType) -> Vec<Vector> {
        let turn = |[x, y, z]: &Vector| [*x, *y, z + x / 2.0 - y / 4.0];
        single_cell(cell_type).points().iter().map(turn).collect()
    }

    #[test]
    fn corners_are_found() {
        for cell_type in TYPES {
            for points in [single_cell(cell_type).points().to_vec(), aslant(cell_type)] {
                for (vertex, &point) in points.iter().enumerate() {
                    let found = locate(cell_type, &points, point)
                        .unwrap_or_else(|| panic!("{cell_type}: {vertex}"));
                    assert!(is_inside(cell_type, found, 1e-12), "{cell_type}: {found:?}");
                    let weights = shape(cell_type, found).unwrap();
                    assert!((weights.weights()[vertex] - 1.0).abs() < 1e-12, "{cell_type}");
                }
            }
        }
    }

    #[test]
    fn the_distance_from_a_face_is_told() {
        for cell_type in [CellType::Triangle, CellType::Quad, CellType::Pixel] {
            for (size, beside) in [(1.0, 5e-10), (1.0, 0.3), (100.0, -1e-8)] {
                let points: Vec<Vector> =
                    aslant(cell_type).iter().map(|&it| scale(it, size)).collect();
                let shape = shape(cell_type, [0.3, 0.4, 0.0]).unwrap();
                let [.., normal] = shape.tangents(&points, 2);
                let parts = points.iter().zip(shape.weights());
                let point = parts
                    .fold(scale(normal, beside), |sum, (it, part)| add(sum, scale(*it, *part)));
                let [r, s, distance] = locate(cell_type, &points, point).unwrap();
                assert!((r - 0.3).abs() < 1e-12 && (s - 0.4).abs() < 1e-12, "{cell_type}");
                assert!((distance - beside).abs() < 1e-14 * size, "{cell_type}: {distance}");
            }
        }
    }

    /// Geographic coordinates are in metres, millions of them from their origin.
    #[test]
    fn points_are_found_far_from_the_origin() {
        for cell_type in TYPES {
            let flat = if cell_type.dimension() == 2 { 0.0 } else { 1.0 };
            for far in [1e4, 5e5, 5e6] {
                let offset = [far, -0.7 * far, 0.3 * far];
                let points: Vec<Vector> =
                    aslant(cell_type).iter().map(|&it| add(it, offset)).collect();
                for step in 1..100 {
                    let part = f64::from(step) / 300.0;
                    let inside = [part, 0.3 - part / 2.0, flat * (0.1 + part / 2.0)];
                    let shape = shape(cell_type, inside).unwrap();
                    let parts = points.iter().zip(shape.weights());
                    let point = parts.fold([0.0; 3], |sum, (it, part)| add(sum, scale(*it, *part)));
                    let found = locate(cell_type, &points, point)
                        .unwrap_or_else(|| panic!("{cell_type} at {far}: {inside:?}"));
                    // What is left is the rounding of the point itself.
                    let allowed = 1e-15 * far + 1e-9;
                    assert!(distance(found, inside) < 4.0 * allowed, "{cell_type}: {found:?}");
                }
            }
        }
    }
}
