//! Proof that a boundary has no valid mesh, wherever the inside lies.

use std::fmt;

use super::untangle::{Corner, corners};
use crate::mesh::{CellType, Mesh, Vector};
use crate::partition::{Partition, all};
use crate::quality::{Measure, Scratch, centroid};
use crate::vector::{add, cross, dot, scale, subtract};

/// Half-spaces about one vertex that are looked at: more than any mesh has but about a vertex where thousands of cells meet.
const HALF_SPACES: usize = 32;

/// Half-spaces that miss each other by less than this part of the size of the cells may do so by rounding.
const ROUNDING: f64 = 1e-9;

/// Why the cells of a mesh cannot all be valid with their boundary where it is prescribed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Impossible {
    /// A cell has all its vertices on the boundary, so that nothing can mend it.
    Cell {
        /// The cell's number in the mesh.
        cell: usize,
        /// Its type.
        cell_type: CellType,
        /// The mean of its vertices in the reference.
        centroid: Vector,
        /// What its scaled Jacobian would be.
        scaled_jacobian: f64,
    },
    /// A vertex inside belongs to cells whose other vertices are on the boundary, and there is no place where all of these cells
    /// are valid.
    Vertex {
        /// Where the vertex lies in the reference.
        point: Vector,
        /// Four such cells; one may be listed several times.
        cells: [usize; 4],
    },
}

impl fmt::Display for Impossible {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cell { cell, cell_type, centroid: [x, y, z], scaled_jacobian } => write!(
                formatter,
                "cell {cell} ({cell_type}) at ({x:.6}, {y:.6}, {z:.6}) has all its vertices on the prescribed boundary, which gives \
                 it a scaled Jacobian of {scaled_jacobian:.4}"
            ),
            Self::Vertex { point: [x, y, z], cells } => {
                let mut cells = cells.to_vec();
                cells.sort_unstable();
                cells.dedup();
                let cells: Vec<String> = cells.iter().map(usize::to_string).collect();
                write!(
                    formatter,
                    "the prescribed boundary leaves the vertex at ({x:.6}, {y:.6}, {z:.6}) no place where cells {} are all valid",
                    cells.join(", ")
                )
            }
        }
    }
}

impl Impossible {
    /// A proof that no place of the free vertices gives every cell a scaled Jacobian of at least `floor`, with `boundary` as it
    /// lies in `points`; `None` where none is found, which does not mean that there is a valid mesh. `mesh` is the reference mesh, or
    /// this rank's part of it. Collective; the proof of the first rank that has one.
    #[must_use]
    pub fn find(
        mesh: &Mesh,
        boundary: &[u32],
        points: &[Vector],
        floor: f64,
        partition: &dyn Partition,
    ) -> Option<Self> {
        let mut prescribed = vec![false; mesh.points().len()];
        boundary.iter().for_each(|&vertex| prescribed[vertex as usize] = true);
        let numbered = |proof: Self| match proof {
            Self::Cell { cell, cell_type, centroid, scaled_jacobian } => Self::Cell {
                cell: partition.cell_number(cell),
                cell_type,
                centroid,
                scaled_jacobian,
            },
            Self::Vertex { point, cells } => {
                Self::Vertex { point, cells: cells.map(|cell| partition.cell_number(cell)) }
            }
        };
        let mine = broken_cell(mesh, &prescribed, points, floor);
        let mine = mine.or_else(|| torn_vertex(mesh, &prescribed, points)).map(numbered);
        if all(partition, mine.is_none()) {
            return None;
        }
        let mine = mine.map_or([f64::NAN; LENGTH], Self::packed);
        partition.gather(&mine).as_chunks::<LENGTH>().0.iter().find_map(Self::unpacked)
    }

    #[expect(clippy::cast_precision_loss, reason = "fewer cells than 2^53")]
    fn packed(self) -> [f64; LENGTH] {
        match self {
            Self::Cell { cell, cell_type, centroid: [x, y, z], scaled_jacobian } => {
                [0.0, x, y, z, cell as f64, f64::from(cell_type.vtk()), scaled_jacobian, 0.0]
            }
            Self::Vertex { point: [x, y, z], cells: [a, b, c, d] } => {
                [1.0, x, y, z, a as f64, b as f64, c as f64, d as f64]
            }
        }
    }

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "what was packed")]
    fn unpacked(&[kind, x, y, z, a, b, c, d]: &[f64; LENGTH]) -> Option<Self> {
        if kind == 0.0 {
            let cell_type = CellType::from_vtk(b as u8)?;
            Some(Self::Cell {
                cell: a as usize,
                cell_type,
                centroid: [x, y, z],
                scaled_jacobian: c,
            })
        } else if kind == 1.0 {
            Some(Self::Vertex { point: [x, y, z], cells: [a, b, c, d].map(|cell| cell as usize) })
        } else {
            None
        }
    }
}

/// How many numbers a proof is sent as.
const LENGTH: usize = 8;

/// The worst of the cells whose vertices are all prescribed, where it is inverted or below `floor`.
fn broken_cell(
    mesh: &Mesh,
    prescribed: &[bool],
    points: &[Vector],
    floor: f64,
) -> Option<Impossible> {
    let cells = mesh.cells();
    let measure = Measure::new(cells);
    let mut scratch = Scratch::default();
    let held =
        |cell: &usize| cells.vertices(*cell).iter().all(|&vertex| prescribed[vertex as usize]);
    let measured = (0..cells.len()).filter(held).filter_map(|cell| {
        let (value, inverted) =
            measure.cell(cell, |vertex| points[vertex as usize], &mut scratch)?;
        (inverted || value < floor).then_some((cell, value))
    });
    let (cell, scaled_jacobian) = measured.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let (cell_type, centroid) = (cells.cell_type(cell), centroid(cells, cell, mesh.points()));
    Some(Impossible::Cell { cell, cell_type, centroid, scaled_jacobian })
}

/// Where a point must lie for a cell to be valid: `normal · x > offset`, the normal of length 1.
struct HalfSpace {
    normal: Vector,
    offset: f64,
    cell: usize,
}

/// A free vertex and four half-spaces that it must be in, which have no point in common.
///
/// That half-spaces have none is shown by four of them (E. Helly 1923): normals that add up to zero with factors that are not
/// negative, while the offsets with these factors do not come below zero (J. Farkas 1902).
fn torn_vertex(mesh: &Mesh, prescribed: &[bool], points: &[Vector]) -> Option<Impossible> {
    let mut about: Vec<(u32, HalfSpace)> = Vec::new();
    for corner in corners(mesh) {
        let mut free = (0..4).filter(|&local| !prescribed[corner.vertices[local] as usize]);
        if let (Some(local), None) = (free.next(), free.next()) {
            about.extend(
                half_space(&corner, local, points).map(|half| (corner.vertices[local], half)),
            );
        }
    }
    about.sort_by_key(|(vertex, _)| *vertex);
    about.chunk_by(|a, b| a.0 == b.0).find_map(|same| {
        let point = mesh.points()[same[0].0 as usize];
        let halves: Vec<&HalfSpace> = same.iter().take(HALF_SPACES).map(|(_, half)| half).collect();
        let now = points[same[0].0 as usize];
        if halves.iter().all(|half| dot(half.normal, now) > half.offset) {
            return None;
        }
        disjoint(&halves).map(|cells| Impossible::Vertex { point, cells })
    })
}

/// Where the free vertex `local` must lie for the corner's determinant to be positive.
fn half_space(corner: &Corner, local: usize, points: &[Vector]) -> Option<HalfSpace> {
    const OTHERS: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];
    let [a, b, c] = OTHERS[local].map(|other| points[corner.vertices[other] as usize]);
    let normal = cross(subtract(b, a), subtract(c, a));
    let length = dot(normal, normal).sqrt();
    let normal = (length > 0.0 && length.is_finite()).then(|| scale(normal, 1.0 / length))?;
    Some(HalfSpace { normal, offset: dot(normal, a), cell: corner.cell as usize })
}

/// The cells of four half-spaces without a point in common.
fn disjoint(halves: &[&HalfSpace]) -> Option<[usize; 4]> {
    let count = halves.len();
    let size = halves.iter().fold(0.0_f64, |most, half| most.max(half.offset.abs()));
    for d in 3..count {
        for c in 2..d {
            for b in 1..c {
                for a in 0..b {
                    let four = [a, b, c, d].map(|index| halves[index]);
                    let [p, q, r, s] = four.map(|half| half.normal);
                    let triple = |u, v, w| dot(cross(u, v), w);
                    let mut factors =
                        [triple(q, r, s), -triple(p, r, s), triple(p, q, s), -triple(p, q, r)];
                    if factors.iter().all(|&factor| factor <= 0.0) {
                        factors = factors.map(|factor| -factor);
                    }
                    let sum: f64 = factors.iter().sum();
                    if factors.iter().any(|&factor| factor < 0.0) || sum < ROUNDING {
                        continue;
                    }
                    let apart: f64 =
                        factors.iter().zip(four).map(|(factor, half)| factor * half.offset).sum();
                    // What rounding leaves of the sum of the normals moves the sum of the offsets by as much.
                    let rest = (0..4)
                        .fold([0.0; 3], |rest, k| add(rest, scale(four[k].normal, factors[k])));
                    let slack = ROUNDING * size * sum + size * dot(rest, rest).sqrt();
                    if apart > slack {
                        return Some(four.map(|half| half.cell));
                    }
                }
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::partition::Whole;
    use crate::shapes;

    fn boundary(mesh: &Mesh) -> Vec<u32> {
        let on = |p: &Vector| p.iter().any(|&x| x == 0.0 || x == 1.0);
        (0..).zip(mesh.points()).filter(|(_, p)| on(p)).map(|(vertex, _)| vertex).collect()
    }

    fn meshes() -> [Mesh; 3] {
        let size = ([3, 3, 3], [0.0; 3], [1.0; 3]);
        [
            shapes::box_of_tets(size.0, size.1, size.2),
            shapes::box_of_hexahedra(size.0, size.1, size.2),
            shapes::box_of_mixed_cells(size.0, size.1, size.2),
        ]
    }

    #[test]
    fn what_is_possible_is_not_called_impossible() {
        for mesh in meshes() {
            let boundary = boundary(&mesh);
            let mut points = mesh.points().to_vec();
            assert_eq!(Impossible::find(&mesh, &boundary, &points, 0.0, &Whole), None);
            // Wherever the inside lies.
            for (vertex, point) in (0u32..).zip(&mut points) {
                if !boundary.contains(&vertex) {
                    *point = [0.01, 0.99, 0.02];
                }
            }
            assert_eq!(Impossible::find(&mesh, &boundary, &points, 0.0, &Whole), None);
        }
    }

    /// One cell of each type, all of whose vertices are on the boundary.
    #[test]
    fn a_cell_without_a_free_vertex_is_named() {
        for cell_type in [
            CellType::Tetra,
            CellType::Pyramid,
            CellType::Wedge,
            CellType::Hexahedron,
            CellType::Voxel,
        ] {
            let mesh = shapes::single_cell(cell_type);
            let boundary: Vec<u32> = (0..mesh.points().len() as u32).collect();
            assert_eq!(Impossible::find(&mesh, &boundary, mesh.points(), 0.0, &Whole), None);
            let mut pushed = mesh.points().to_vec();
            let [away, from] = [pushed[0], pushed[pushed.len() - 1]];
            pushed[0] = add(from, scale(subtract(from, away), 2.0));
            let proof = Impossible::find(&mesh, &boundary, &pushed, 0.0, &Whole);
            assert!(
                matches!(proof, Some(Impossible::Cell { cell: 0, .. })),
                "{cell_type}: {proof:?}"
            );
            assert!(proof.unwrap().to_string().contains(&cell_type.to_string()));
        }
    }

    /// Four cells about one free vertex, in a tetrahedron that is turned inside out.
    #[test]
    fn a_vertex_without_a_place_is_named() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let points: Vec<Vector> = corners.into_iter().chain([[0.2, 0.2, 0.2]]).collect();
        let cells = vec![0, 1, 2, 4, 0, 3, 1, 4, 0, 2, 3, 4, 1, 3, 2, 4];
        let cells = crate::mesh::Cells::uniform(CellType::Tetra, cells).unwrap();
        let mesh = Mesh::new(points, cells, crate::mesh::FeatureSource::SharpEdges).unwrap();
        let find = |points: &[Vector]| Impossible::find(&mesh, &[0, 1, 2, 3], points, 0.0, &Whole);
        let mut outside = mesh.points().to_vec();
        outside[4] = [3.0, -2.0, 1.0];
        assert_eq!(find(&outside), None);
        let mut mirrored = mesh.points().to_vec();
        mirrored[3] = [0.3, 0.2, -1.0];
        let Some(Impossible::Vertex { point, mut cells }) = find(&mirrored) else {
            panic!("no proof")
        };
        cells.sort_unstable();
        assert_eq!((point, cells), ([0.2, 0.2, 0.2], [0, 1, 2, 3]));
        assert!(find(&mirrored).unwrap().to_string().contains("cells 0, 1, 2, 3"));
    }
}
