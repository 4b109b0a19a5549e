//! The geometry of one cell: its scaled Jacobian, and the corners that tell whether it is turned
//! inside out.

use std::f64::consts::{SQRT_2, TAU};

use super::{CellType, Cells};
use crate::number::real;
use crate::vector::{Vector, add, cross, determinant, dot, length, mean, subtract};

/// The order in which a voxel's vertices make a hexahedron.
pub(crate) const VOXEL_AS_HEXAHEDRON: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];

/// Each corner of a hexahedron with its three neighbours, right-handed.
pub(crate) const HEXAHEDRON_CORNERS: [[usize; 4]; 8] = [
    [0, 1, 3, 4],
    [1, 2, 0, 5],
    [2, 3, 1, 6],
    [3, 0, 2, 7],
    [4, 7, 5, 0],
    [5, 4, 6, 1],
    [6, 5, 7, 2],
    [7, 6, 4, 3],
];

/// Each corner of a wedge with its three neighbours, right-handed where the first triangle's normal
/// points at the second.
pub(crate) const WEDGE_CORNERS: [[usize; 4]; 6] =
    [[0, 1, 2, 3], [1, 2, 0, 4], [2, 0, 1, 5], [3, 5, 4, 0], [4, 3, 5, 1], [5, 4, 3, 2]];

/// Each corner of a pyramid's base with its neighbours and the apex.
pub(crate) const PYRAMID_CORNERS: [[usize; 4]; 4] =
    [[0, 1, 3, 4], [1, 2, 0, 4], [2, 3, 1, 4], [3, 0, 2, 4]];

/// The scaled Jacobian of one cell: 1 for the ideal cell, 0 for a flat one, negative for one turned
/// inside out.
///
/// For tetrahedra, hexahedra, wedges, pyramids, triangles and quadrilaterals it is what VTK's
/// `vtkMeshQuality` computes (C. Stimpson et al., *The Verdict geometric quality library*,
/// SAND2007-1751), to rounding. Two things differ: a cell shrunk to a point or an edge gets 0 here,
/// not Verdict's largest number; and Verdict gives every pyramid turned inside out 0, which is
/// kept, so look at [`Quality::inverted`](crate::quality::Quality::inverted) for those. Verdict
/// takes a wedge to be positive where the normal of its first triangle points at the second; those
/// of a mesh are, whichever way they were given.
///
/// Types that VTK has no measure for:
/// - pixels and voxels: the quadrilateral and hexahedron of the same vertices;
/// - triangle strips: the least of their triangles;
/// - polygons: the least over the corners of the corner's area by its sides, against the regular
///   polygon's (as Verdict's quadrilateral);
/// - pentagonal and hexagonal prisms: the least over the tetrahedra that each edge of each face
///   makes with the mean of the face's vertices and the mean of the cell's. Polyhedra likewise, see
///   [`scaled_jacobians`](crate::quality::scaled_jacobians); their points alone do not tell their
///   faces.
///
/// `None` for vertices, lines and polyhedra, and where the number of points is not the type's. NaN
/// where a coordinate is.
///
/// # Example
/// ```
/// use tombolo_deform::{mesh::CellType, quality::scaled_jacobian};
///
/// let corner = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let value = scaled_jacobian(CellType::Tetra, &corner).unwrap();
/// assert!((value - 0.5f64.sqrt()).abs() < 1e-15);
/// ```
#[must_use]
pub fn scaled_jacobian(cell_type: CellType, points: &[Vector]) -> Option<f64> {
    if cell_type.vertex_count().is_some_and(|count| count != points.len()) {
        return None;
    }
    match cell_type {
        CellType::Tetra => fixed(points).map(tetra),
        CellType::Hexahedron => fixed(points).map(hexahedron),
        CellType::Voxel => {
            fixed::<8>(points).map(|p| hexahedron(VOXEL_AS_HEXAHEDRON.map(|local| p[local])))
        }
        CellType::Wedge => fixed(points).map(wedge),
        CellType::Pyramid => fixed(points).map(pyramid),
        CellType::Triangle => fixed(points).map(triangle),
        CellType::Quad => fixed(points).map(quad),
        CellType::Pixel => fixed::<4>(points).map(|[a, b, c, d]| quad([a, b, d, c])),
        CellType::TriangleStrip if points.len() >= 3 => {
            Some(least(points.windows(3).map(|p| triangle([p[0], p[1], p[2]]))))
        }
        CellType::Polygon if points.len() >= 3 => Some(match *points {
            [a, b, c] => triangle([a, b, c]),
            [a, b, c, d] => quad([a, b, c, d]),
            _ => polygon(points),
        }),
        CellType::PentagonalPrism | CellType::HexagonalPrism => {
            let mut tets = Vec::new();
            let centre = mean(points.iter().copied());
            for face in cell_type.faces() {
                split_face(face, |local| points[local], centre, &mut tets);
            }
            Some(least(tets.into_iter().map(tetra)))
        }
        _ => None,
    }
}

fn fixed<const N: usize>(points: &[Vector]) -> Option<[Vector; N]> {
    points.try_into().ok()
}

/// The least value; NaN if any is.
pub(crate) fn least(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(
        f64::INFINITY,
        |least, value| if value < least || value.is_nan() { value } else { least },
    )
}

/// `numerator / denominator`, with 0 for a cell shrunk to nothing.
#[inline]
fn ratio(numerator: f64, denominator: f64) -> f64 {
    if denominator < f64::MIN_POSITIVE { 0.0 } else { numerator / denominator }
}

#[inline]
pub(crate) fn tetra([p0, p1, p2, p3]: [Vector; 4]) -> f64 {
    let (e01, e02, e03) = (subtract(p1, p0), subtract(p2, p0), subtract(p3, p0));
    let (e12, e13, e23) = (subtract(p2, p1), subtract(p3, p1), subtract(p3, p2));
    let jacobian = determinant(e01, e02, e03);
    let (l01, l02, l03) = (dot(e01, e01), dot(e02, e02), dot(e03, e03));
    let (l12, l13, l23) = (dot(e12, e12), dot(e13, e13), dot(e23, e23));
    let squared = (l01 * l02 * l03).max(l01 * l12 * l13).max(l02 * l12 * l23).max(l03 * l13 * l23);
    // `max` forgets NaN, the Jacobian does not.
    SQRT_2 * ratio(jacobian, squared.sqrt().max(jacobian.abs()))
}

fn corner([p, a, b, c]: [Vector; 4]) -> f64 {
    let (a, b, c) = (subtract(a, p), subtract(b, p), subtract(c, p));
    ratio(determinant(a, b, c), (dot(a, a) * dot(b, b) * dot(c, c)).sqrt())
}

fn hexahedron(p: [Vector; 8]) -> f64 {
    let axis = |plus: [usize; 4], minus: [usize; 4]| {
        let sum =
            |local: [usize; 4]| local.into_iter().fold([0.0; 3], |sum, index| add(sum, p[index]));
        subtract(sum(plus), sum(minus))
    };
    let axes = [
        axis([1, 2, 5, 6], [0, 3, 4, 7]),
        axis([2, 3, 6, 7], [0, 1, 4, 5]),
        axis([4, 5, 6, 7], [0, 1, 2, 3]),
    ];
    let centre = corner([[0.0; 3], axes[0], axes[1], axes[2]]);
    least(
        std::iter::once(centre)
            .chain(HEXAHEDRON_CORNERS.into_iter().map(|local| corner(local.map(|index| p[index])))),
    )
}

fn wedge(p: [Vector; 6]) -> f64 {
    2.0 / 3.0f64.sqrt()
        * least(WEDGE_CORNERS.into_iter().map(|local| corner(local.map(|index| p[index]))))
}

fn pyramid(p: [Vector; 5]) -> f64 {
    let value =
        SQRT_2 * least(PYRAMID_CORNERS.into_iter().map(|local| tetra(local.map(|index| p[index]))));
    if value <= 0.0 {
        0.0
    } else if value < 1.0 || value.is_nan() {
        value
    } else {
        2.0 - value
    }
}

fn triangle([a, b, c]: [Vector; 3]) -> f64 {
    let (ab, ac, bc) = (subtract(b, a), subtract(c, a), subtract(c, b));
    let (lab, lac, lbc) = (dot(ab, ab), dot(ac, ac), dot(bc, bc));
    let normal = cross(ab, ac);
    2.0 / 3.0f64.sqrt() * ratio(length(normal), (lab * lac).max(lab * lbc).max(lac * lbc).sqrt())
}

fn quad(points: [Vector; 4]) -> f64 {
    polygon(&points)
}

/// The least over the corners of its area against the polygon's normal, by the two sides' lengths.
fn polygon(points: &[Vector]) -> f64 {
    let count = points.len();
    let normal = vector_area(points);
    let length = length(normal);
    let regular = if count == 4 { 1.0 } else { (TAU / real(count)).sin() };
    least((0..count).map(|index| {
        let (before, at, after) =
            (points[(index + count - 1) % count], points[index], points[(index + 1) % count]);
        let (from, to) = (subtract(at, before), subtract(after, at));
        let sides = (dot(from, from) * dot(to, to)).sqrt();
        ratio(dot(normal, cross(from, to)), length * sides) / regular
    }))
}

/// Twice the vector area of a closed polygon.
pub(crate) fn vector_area(points: &[Vector]) -> Vector {
    let Some(&origin) = points.first() else { return [0.0; 3] };
    points.windows(2).fold([0.0; 3], |sum, pair| {
        add(sum, cross(subtract(pair[0], origin), subtract(pair[1], origin)))
    })
}

/// Appends the tetrahedra that the edges of one face make with the mean of the face (itself, where
/// it is a triangle) and `centre`. They have positive volume where the face is counter-clockwise
/// seen from outside and the cell is star-shaped.
fn split_face<I: Copy>(
    face: &[I],
    point: impl Fn(I) -> Vector,
    centre: Vector,
    tets: &mut Vec<[Vector; 4]>,
) {
    if let &[a, b, c] = face {
        tets.push([point(b), point(a), point(c), centre]);
        return;
    }
    let middle = mean(face.iter().map(|&local| point(local)));
    for (index, &a) in face.iter().enumerate() {
        tets.push([point(face[(index + 1) % face.len()]), point(a), middle, centre]);
    }
}

/// Puts into `tets` the tetrahedra whose volumes must all be positive for a volume cell to be
/// valid: a tetrahedron itself; the corners of hexahedra, wedges and pyramids (base); of prisms and
/// polyhedra the tetrahedra of [`scaled_jacobian`].
///
/// Each is made of means of vertices, so that it moves linearly where the vertices do.
pub(crate) fn corner_tets(
    cells: &Cells,
    cell: usize,
    at: impl Fn(u32) -> Vector,
    tets: &mut Vec<[Vector; 4]>,
) {
    tets.clear();
    let vertices = cells.vertices(cell);
    let point = |local: usize| at(vertices[local]);
    match cells.cell_type(cell) {
        CellType::Tetra => tets.push([0, 1, 2, 3].map(point)),
        CellType::Hexahedron => tets.extend(HEXAHEDRON_CORNERS.map(|local| local.map(point))),
        CellType::Voxel => {
            tets.extend(
                HEXAHEDRON_CORNERS
                    .map(|local| local.map(|index| point(VOXEL_AS_HEXAHEDRON[index]))),
            );
        }
        CellType::Wedge => tets.extend(WEDGE_CORNERS.map(|local| local.map(point))),
        CellType::Pyramid => tets.extend(PYRAMID_CORNERS.map(|local| local.map(point))),
        cell_type if cell_type.dimension() == 3 => {
            let centre = mean(vertices.iter().map(|&vertex| at(vertex)));
            cells.for_each_face(cell, |face| split_face(face, &at, centre, tets));
        }
        _ => {}
    }
}

/// The scaled Jacobian of a cell of a mesh, polyhedra among them; `None` where its type has none.
pub(crate) fn scaled_jacobian_of(
    cells: &Cells,
    cell: usize,
    at: impl Fn(u32) -> Vector,
    scratch: &mut Scratch,
) -> Option<f64> {
    let vertices = cells.vertices(cell);
    if let (CellType::Tetra, &[a, b, c, d]) = (cells.cell_type(cell), vertices) {
        return Some(tetra([a, b, c, d].map(at)));
    }
    if cells.cell_type(cell) == CellType::Polyhedron {
        corner_tets(cells, cell, at, &mut scratch.tets);
        return Some(least(scratch.tets.iter().map(|&tet| tetra(tet))));
    }
    scratch.points.clear();
    scratch.points.extend(vertices.iter().map(|&vertex| at(vertex)));
    scaled_jacobian(cells.cell_type(cell), &scratch.points)
}

/// Memory that is used again from cell to cell.
#[derive(Default)]
pub(crate) struct Scratch {
    pub(crate) points: Vec<Vector>,
    pub(crate) tets: Vec<[Vector; 4]>,
}

#[inline]
pub(crate) fn tet_determinant([p, a, b, c]: [Vector; 4]) -> f64 {
    determinant(subtract(a, p), subtract(b, p), subtract(c, p))
}

/// The mean of a cell's vertices.
pub(crate) fn centroid(cells: &Cells, cell: usize, points: &[Vector]) -> Vector {
    mean(cells.vertices(cell).iter().map(|&vertex| points[vertex as usize]))
}
