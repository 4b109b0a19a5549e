//! Small meshes with known geometry, for tests, examples and benchmarks.
//!
//! Every mesh here is structured, so that its counts, volumes and normals have closed forms, and
//! its vertices are numbered in a stated order.
//!
//! ```
//! use tombolo_deform::shapes;
//!
//! let mesh = shapes::box_of_tets([2, 1, 1], [0.0; 3], [2.0, 1.0, 1.0]);
//! assert_eq!((mesh.points().len(), mesh.cells().len()), (12, 12));
//! ```
//!
//! # Panics
//! The functions of this module panic for coordinates that are not finite and for more than
//! `u32::MAX` vertices: their arguments are written by a programmer, never read from a user.

use crate::mesh::{CellType, Cells, FeatureSource, Mesh, MeshError, TaggedFaces, Vector};
use crate::vector::{add, cross, dot, scale, subtract, unit};

/// The features of a box, in the order of their tags 1 to 6.
pub const BOX_FEATURES: [&str; 6] = ["x-min", "x-max", "y-min", "y-max", "z-min", "z-max"];

/// A box of `counts` cubes in x, y and z, each split into six tetrahedra (Kuhn 1960) along its main
/// diagonal.
///
/// Vertex `i + (counts[0] + 1) * (j + (counts[1] + 1) * k)` lies at `lower + (upper - lower) * [i,
/// j, k] / counts`. The boundary triangles carry the features [`BOX_FEATURES`]. A count of 0 is
/// taken as 1.
#[must_use]
pub fn box_of_tets(counts: [usize; 3], lower: Vector, upper: Vector) -> Mesh {
    let grid = Grid::new(counts);
    let mut connectivity = Vec::with_capacity(24 * grid.cell_count());
    grid.for_each_cell(|_, corner| {
        for ([a, b, c], even) in [
            ([0, 1, 2], true),
            ([1, 2, 0], true),
            ([2, 0, 1], true),
            ([0, 2, 1], false),
            ([2, 1, 0], false),
            ([1, 0, 2], false),
        ] {
            // The path from the lowest to the highest corner along the axes a, b, c.
            let first = 1 << a;
            let second = first | 1 << b;
            let third = second | 1 << c;
            let (first, second) = if even { (first, second) } else { (second, first) };
            connectivity.extend([0, first, second, third].map(corner));
        }
    });
    let mut faces = Cells::new();
    let mut tags = Vec::new();
    grid.for_each_boundary_quad(|tag, [a, b, c, d]| {
        // Corner a is the lowest and c the highest of the square, so that a-c is the diagonal the
        // tetrahedra have.
        for triangle in [[a, b, c], [a, c, d]] {
            valid(faces.push(CellType::Triangle, &triangle));
            tags.push(tag);
        }
    });
    let cells = valid(Cells::uniform(CellType::Tetra, connectivity));
    valid(Mesh::new(grid.points(lower, upper), cells, box_features(faces, tags)))
}

/// A box of hexahedra, its vertices and features as those of [`box_of_tets`]; its boundary faces
/// are quadrilaterals.
#[must_use]
pub fn box_of_hexahedra(counts: [usize; 3], lower: Vector, upper: Vector) -> Mesh {
    let grid = Grid::new(counts);
    let mut connectivity = Vec::with_capacity(8 * grid.cell_count());
    grid.for_each_cell(|_, corner| connectivity.extend([0, 1, 3, 2, 4, 5, 7, 6].map(corner)));
    let mut faces = Cells::new();
    let mut tags = Vec::new();
    grid.for_each_boundary_quad(|tag, quad| {
        valid(faces.push(CellType::Quad, &quad));
        tags.push(tag);
    });
    let cells = valid(Cells::uniform(CellType::Hexahedron, connectivity));
    valid(Mesh::new(grid.points(lower, upper), cells, box_features(faces, tags)))
}

/// A box of hexahedra, wedges, pyramids and tetrahedra, its first vertices and its features as
/// those of [`box_of_tets`].
///
/// The kind of a column of cubes along z repeats every three steps, by `(i + 2 j) mod 3`:
/// hexahedra; six pyramids in each cube; two wedges in each cube of an even layer, four pyramids
/// and four tetrahedra in each of an odd one. The cubes cut to pyramids have a vertex of their own
/// in the middle; these are the last vertices. So there is every kind from 3 by 1 by 2 cubes on.
#[must_use]
pub fn box_of_mixed_cells(counts: [usize; 3], lower: Vector, upper: Vector) -> Mesh {
    // The squares of a cube, their normals inward: at z-min, z-max, and around.
    const SQUARES: [[usize; 4]; 6] =
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    // Those at z-min and z-max along the diagonal that the wedges have.
    const HALVES: [[usize; 3]; 4] = [[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7]];
    let grid = Grid::new(counts);
    let kind = |i: usize, j: usize| (i + 2 * j) % 3;
    let mut points = grid.points(lower, upper);
    let mut cells = Cells::new();
    let [columns, rows, _] = grid.counts;
    grid.for_each_cell(|[i, j, k], corner| {
        let mut push =
            |cell_type: CellType, vertices: &[u32]| valid(cells.push(cell_type, vertices));
        match (kind(i, j), k % 2) {
            (0, _) => push(CellType::Hexahedron, &[0, 1, 3, 2, 4, 5, 7, 6].map(corner)),
            (2, 0) => {
                push(CellType::Wedge, &[0, 3, 1, 4, 7, 5].map(corner));
                push(CellType::Wedge, &[0, 2, 3, 4, 6, 7].map(corner));
            }
            (kind, _) => {
                let middle = number(points.len());
                let [low, high] = [0, 7].map(|end| points[corner(end) as usize]);
                points.push(scale(add(low, high), 0.5));
                let squares = if kind == 1 { &SQUARES[..] } else { &SQUARES[2..] };
                for [a, b, c, d] in squares.iter().map(|square| square.map(corner)) {
                    push(CellType::Pyramid, &[a, b, c, d, middle]);
                }
                for [a, b, c] in HALVES.iter().filter(|_| kind == 2).map(|half| half.map(corner)) {
                    push(CellType::Tetra, &[a, b, c, middle]);
                }
            }
        }
    });
    let mut faces = Cells::new();
    let mut tags = Vec::new();
    grid.for_each_boundary_quad(|tag, [a, b, c, d]| {
        let lowest = a as usize;
        if tag >= 5 && kind(lowest % (columns + 1), lowest / (columns + 1) % (rows + 1)) == 2 {
            for triangle in [[a, b, c], [a, c, d]] {
                valid(faces.push(CellType::Triangle, &triangle));
                tags.push(tag);
            }
        } else {
            valid(faces.push(CellType::Quad, &[a, b, c, d]));
            tags.push(tag);
        }
    });
    valid(Mesh::new(points, cells, box_features(faces, tags)))
}

/// A closed torus of triangles about the z axis: a mesh of dimension 2, its triangles
/// counter-clockwise seen from outside.
///
/// `counts` vertices lie around the axis and around the tube (at least 3 of each). Vertex `j +
/// counts[1] * i` lies at the angle `u = 2 pi i / counts[0]` about the axis and `v = 2 pi j /
/// counts[1]` about the tube: `((major + minor cos v) cos u, (major + minor cos v) sin u, minor sin
/// v)`. Features are given by vertices, as in a VTK array: the torus is cut into four quarters
/// `feature-0` to `feature-3` by `u`.
#[must_use]
pub fn torus(major: f64, minor: f64, counts: [usize; 2]) -> Mesh {
    let [around, about] = counts.map(|count| count.max(3));
    let mut points = Vec::with_capacity(around * about);
    let mut tags = Vec::with_capacity(around * about);
    for i in 0..around {
        let u = std::f64::consts::TAU * i as f64 / around as f64;
        for j in 0..about {
            let v = std::f64::consts::TAU * j as f64 / about as f64;
            let radius = major + minor * v.cos();
            points.push([radius * u.cos(), radius * u.sin(), minor * v.sin()]);
            tags.push((4 * i / around) as i64);
        }
    }
    let vertex = |i: usize, j: usize| number((j % about) + about * (i % around));
    let cells = split_squares([around, about], |i, j| {
        [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]
    });
    valid(Mesh::new(points, cells, FeatureSource::Vertices(tags.into())))
}

/// An open tube of triangles around a polyline of at least 2 points: a mesh of dimension 2, its
/// triangles counter-clockwise seen from outside.
///
/// `around` vertices (at least 3) lie on a circle of the radius about each point, in the plane
/// normal to the polyline there; vertex `j + around * i` is the `j`-th about point `i`. The circles
/// are not turned against each other along the way. Its features are to be found at sharp edges.
#[must_use]
pub fn tube(axis: &[Vector], radius: f64, around: usize) -> Mesh {
    let around = around.max(3);
    let tangent = |i: usize| {
        let along = |i: usize| unit(subtract(axis[i + 1], axis[i]));
        let [before, after] = [i.max(1) - 1, i.min(axis.len() - 2)].map(along);
        unit(add(before, after))
    };
    let mut points = Vec::with_capacity(axis.len() * around);
    let mut across = if tangent(0)[0].abs() < 0.9 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    for (i, &center) in axis.iter().enumerate() {
        let along = tangent(i);
        across = unit(subtract(across, scale(along, dot(across, along))));
        let side = cross(along, across);
        for j in 0..around {
            let (sine, cosine) = (std::f64::consts::TAU * j as f64 / around as f64).sin_cos();
            points
                .push(add(center, add(scale(across, radius * cosine), scale(side, radius * sine))));
        }
    }
    let vertex = |i: usize, j: usize| number(j % around + around * i);
    let cells = split_squares([axis.len().saturating_sub(1), around], |i, j| {
        [vertex(i, j), vertex(i, j + 1), vertex(i + 1, j + 1), vertex(i + 1, j)]
    });
    valid(Mesh::new(points, cells, FeatureSource::SharpEdges))
}

/// A flat plate of triangles in the plane z = 0, normal along +z: an open mesh of dimension 2.
///
/// Vertex `i + (counts[0] + 1) * j` lies at `lower + (upper - lower) * [i, j] / counts`; every
/// square is split along its rising diagonal. A count of 0 is taken as 1. Its features are to be
/// found at sharp edges, of which it has none.
#[must_use]
pub fn plate(counts: [usize; 2], lower: [f64; 2], upper: [f64; 2]) -> Mesh {
    let [columns, rows] = counts.map(|count| count.max(1));
    let mut points = Vec::with_capacity((columns + 1) * (rows + 1));
    for j in 0..=rows {
        for i in 0..=columns {
            points.push([
                between(lower[0], upper[0], i, columns),
                between(lower[1], upper[1], j, rows),
                0.0,
            ]);
        }
    }
    let vertex = |i: usize, j: usize| number(i + (columns + 1) * j);
    let cells = split_squares([rows, columns], |j, i| {
        [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]
    });
    valid(Mesh::new(points, cells, FeatureSource::SharpEdges))
}

/// Two triangles for each square, which has its corners in turn: on the diagonal from the first to
/// the third.
fn split_squares([rows, columns]: [usize; 2], corners: impl Fn(usize, usize) -> [u32; 4]) -> Cells {
    let mut connectivity = Vec::with_capacity(6 * rows * columns);
    for row in 0..rows {
        for column in 0..columns {
            let [a, b, c, d] = corners(row, column);
            connectivity.extend([a, b, c, a, c, d]);
        }
    }
    valid(Cells::uniform(CellType::Triangle, connectivity))
}

/// One cell of a type, right-handed and of unit size: each kind of cell spans a unit square or cube
/// (prisms of more sides: a unit circle by a unit height), and a polyhedron is a cube given by its
/// faces.
#[must_use]
pub fn single_cell(cell_type: CellType) -> Mesh {
    let mut cells = Cells::new();
    let points = single_cell_points(cell_type);
    if cell_type == CellType::Polyhedron {
        let faces: Vec<Vec<u32>> = CellType::Hexahedron
            .faces()
            .iter()
            .map(|face| face.iter().map(|&v| number(v)).collect())
            .collect();
        valid(cells.push_polyhedron(&faces));
    } else {
        let vertices: Vec<u32> = (0..points.len()).map(number).collect();
        valid(cells.push(cell_type, &vertices));
    }
    valid(Mesh::new(points, cells, FeatureSource::SharpEdges))
}

fn single_cell_points(cell_type: CellType) -> Vec<Vector> {
    const O: Vector = [0.0, 0.0, 0.0];
    const X: Vector = [1.0, 0.0, 0.0];
    const Y: Vector = [0.0, 1.0, 0.0];
    const Z: Vector = [0.0, 0.0, 1.0];
    const XY: Vector = [1.0, 1.0, 0.0];
    const XZ: Vector = [1.0, 0.0, 1.0];
    const YZ: Vector = [0.0, 1.0, 1.0];
    const XYZ: Vector = [1.0, 1.0, 1.0];
    match cell_type {
        CellType::Vertex => vec![O],
        CellType::PolyVertex => vec![O, X, Y],
        CellType::Line => vec![O, X],
        CellType::PolyLine => vec![O, X, XY],
        CellType::Triangle => vec![O, X, Y],
        CellType::TriangleStrip | CellType::Pixel => vec![O, X, Y, XY],
        CellType::Polygon => ring(5, 0.0),
        CellType::Quad => vec![O, X, XY, Y],
        CellType::Tetra => vec![O, X, Y, Z],
        CellType::Voxel => vec![O, X, Y, XY, Z, XZ, YZ, XYZ],
        CellType::Hexahedron | CellType::Polyhedron => vec![O, X, XY, Y, Z, XZ, XYZ, YZ],
        CellType::Wedge => vec![O, Y, X, Z, YZ, XZ],
        CellType::Pyramid => vec![O, X, XY, Y, [0.5, 0.5, 1.0]],
        CellType::PentagonalPrism => [ring(5, 0.0), ring(5, 1.0)].concat(),
        CellType::HexagonalPrism => [ring(6, 0.0), ring(6, 1.0)].concat(),
    }
}

fn ring(sides: usize, height: f64) -> Vec<Vector> {
    (0..sides)
        .map(|side| std::f64::consts::TAU * side as f64 / sides as f64)
        .map(|angle| [angle.cos(), angle.sin(), height])
        .collect()
}

fn box_features(faces: Cells, tags: Vec<i64>) -> FeatureSource {
    let names =
        BOX_FEATURES.iter().zip(1..).map(|(name, tag)| (tag, (*name).to_string())).collect();
    FeatureSource::Faces(TaggedFaces { faces, tags, names })
}

/// The vertices of a structured box.
struct Grid {
    counts: [usize; 3],
}

impl Grid {
    fn new(counts: [usize; 3]) -> Self {
        Self { counts: counts.map(|count| count.max(1)) }
    }

    fn cell_count(&self) -> usize {
        self.counts.iter().product()
    }

    fn vertex(&self, [i, j, k]: [usize; 3]) -> u32 {
        number(i + (self.counts[0] + 1) * (j + (self.counts[1] + 1) * k))
    }

    fn points(&self, lower: Vector, upper: Vector) -> Vec<Vector> {
        let [columns, rows, layers] = self.counts;
        let mut points = Vec::with_capacity((columns + 1) * (rows + 1) * (layers + 1));
        for k in 0..=layers {
            for j in 0..=rows {
                for i in 0..=columns {
                    points.push([
                        between(lower[0], upper[0], i, columns),
                        between(lower[1], upper[1], j, rows),
                        between(lower[2], upper[2], k, layers),
                    ]);
                }
            }
        }
        points
    }

    /// Calls `visit` with each cell's place in the grid and its corners: bit 0 of a corner's number stands for x, bit 1 for
    /// y, bit 2 for z.
    fn for_each_cell(&self, mut visit: impl FnMut([usize; 3], &dyn Fn(usize) -> u32)) {
        for k in 0..self.counts[2] {
            for j in 0..self.counts[1] {
                for i in 0..self.counts[0] {
                    visit([i, j, k], &|corner| {
                        self.vertex([
                            i + (corner & 1),
                            j + (corner >> 1 & 1),
                            k + (corner >> 2 & 1),
                        ])
                    });
                }
            }
        }
    }

    /// Calls `visit` with the tag and the vertices of each boundary square, counter-clockwise seen
    /// from outside, from its lowest corner.
    fn for_each_boundary_quad(&self, mut visit: impl FnMut(i64, [u32; 4])) {
        for axis in 0..3 {
            let [first, second] = [(axis + 1) % 3, (axis + 2) % 3];
            for (side, tag) in [(0, 2 * axis + 1), (self.counts[axis], 2 * axis + 2)] {
                for q in 0..self.counts[second] {
                    for p in 0..self.counts[first] {
                        let at = |dp: usize, dq: usize| {
                            let mut corner = [0; 3];
                            corner[axis] = side;
                            corner[first] = p + dp;
                            corner[second] = q + dq;
                            self.vertex(corner)
                        };
                        let quad = if side == 0 {
                            [at(0, 0), at(0, 1), at(1, 1), at(1, 0)]
                        } else {
                            [at(0, 0), at(1, 0), at(1, 1), at(0, 1)]
                        };
                        visit(tag as i64, quad);
                    }
                }
            }
        }
    }
}

/// The `step`-th of `steps` even steps, exact at both ends.
fn between(lower: f64, upper: f64, step: usize, steps: usize) -> f64 {
    if step == steps { upper } else { lower + (upper - lower) * step as f64 / steps as f64 }
}

fn number(vertex: usize) -> u32 {
    u32::try_from(vertex).expect("a shape has at most u32::MAX vertices")
}

fn valid<T>(built: Result<T, MeshError>) -> T {
    built.unwrap_or_else(|error| panic!("a shape of finite coordinates is a valid mesh: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::FeatureSettings;
    use crate::surface::Surface;
    use crate::vector::determinant;

    /// Six times the volume enclosed by the faces of a cell, by the divergence theorem.
    fn six_volumes(mesh: &Mesh, cell: usize) -> f64 {
        let mut total = 0.0;
        mesh.cells().for_each_face(cell, |face| {
            for i in 1..face.len() - 1 {
                let [a, b, c] =
                    [face[0], face[i], face[i + 1]].map(|vertex| mesh.points()[vertex as usize]);
                total += determinant(a, b, c);
            }
        });
        total
    }

    #[test]
    fn a_box_of_tets_fills_the_box_with_right_handed_tets() {
        let mesh = box_of_tets([3, 2, 1], [-1.0, 0.0, 2.0], [2.0, 1.0, 4.0]);
        let volumes: Vec<f64> =
            (0..mesh.cells().len()).map(|cell| six_volumes(&mesh, cell) / 6.0).collect();
        assert!(volumes.iter().all(|&volume| volume > 0.0));
        assert!((volumes.iter().sum::<f64>() - 6.0).abs() < 1e-12);
        let FeatureSource::Faces(tagged) = mesh.features() else { panic!("tagged faces") };
        assert_eq!(tagged.faces.len(), 2 * 2 * (3 * 2 + 2 + 3));
    }

    #[test]
    fn a_box_of_mixed_cells_fills_the_box_with_right_handed_cells_that_fit() {
        let mesh = box_of_mixed_cells([4, 3, 3], [-1.0, 0.0, 2.0], [2.0, 1.0, 4.0]);
        let volumes: Vec<f64> =
            (0..mesh.cells().len()).map(|cell| six_volumes(&mesh, cell) / 6.0).collect();
        assert!(volumes.iter().all(|&volume| volume > 0.0));
        assert!((volumes.iter().sum::<f64>() - 6.0).abs() < 1e-12);
        for cell_type in [CellType::Tetra, CellType::Hexahedron, CellType::Wedge, CellType::Pyramid]
        {
            assert!(mesh.cells().iter().any(|(found, _)| found == cell_type), "{cell_type}");
        }
        // Faces that do not fit would be boundary faces without a tag.
        let surface = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
        let FeatureSource::Faces(tagged) = mesh.features() else { panic!("tagged faces") };
        assert_eq!(surface.faces().len(), tagged.faces.len());
        assert_eq!(surface.features().names(), BOX_FEATURES);
    }

    #[test]
    fn every_single_volume_cell_is_right_handed() {
        for cell_type in CellType::ALL {
            let mesh = single_cell(cell_type);
            assert_eq!(mesh.cells().cell_type(0), cell_type);
            if cell_type.dimension() == 3 {
                assert!(six_volumes(&mesh, 0) > 0.0, "{cell_type}");
            }
        }
    }

    #[test]
    fn the_torus_is_closed_and_outward() {
        let mesh = torus(2.0, 0.5, [64, 32]);
        let mut six = 0.0;
        for (_, triangle) in mesh.cells().iter() {
            let [a, b, c] = [0, 1, 2].map(|corner| mesh.points()[triangle[corner] as usize]);
            six += determinant(a, b, c);
        }
        let exact = 2.0 * std::f64::consts::PI.powi(2) * 2.0 * 0.25;
        assert!((six / 6.0 / exact - 1.0).abs() < 0.02, "{} against {exact}", six / 6.0);
    }
}
