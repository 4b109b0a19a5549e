//! Proof that a boundary has no valid mesh, wherever the inside lies.

use std::fmt;

use super::corners::{Corner, for_each_corner_of};
use super::foldover::determinant_of;
use crate::communicator::{Communicator, Garbled, Reader, Writer};
use crate::mesh::cell_geometry::{Scratch, centroid};
use crate::mesh::{CellType, Domain, Vector};
use crate::quality::Measure;
use crate::topology::marks;
use crate::vector::{add, cross, dot, length, scale, triangle_normal};

/// Half-spaces about one vertex that are looked at: more than any mesh has but about a vertex where
/// thousands of cells meet.
const HALF_SPACES: usize = 32;

/// Half-spaces that miss each other by less than this part of the size of the cells may do so by
/// rounding.
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
        /// The scaled Jacobian that it would have.
        scaled_jacobian: f64,
    },
    /// A corner of a cell and its three neighbours are on the boundary, so that nothing can mend
    /// it.
    Corner {
        /// The cell's number in the mesh.
        cell: usize,
        /// Its type.
        cell_type: CellType,
        /// The mean of its vertices in the reference.
        centroid: Vector,
    },
    /// A vertex inside belongs to cells whose other vertices are on the boundary, and there is no
    /// place where all of these cells are valid.
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
            Self::Corner { cell, cell_type, centroid: [x, y, z] } => write!(
                formatter,
                "cell {cell} ({cell_type}) at ({x:.6}, {y:.6}, {z:.6}) has a corner and its three neighbours on the prescribed \
                 boundary, which turns it inside out there"
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

/// The cells and corners of a mesh that its boundary decides about: set up once, and looked at for
/// any number of boundaries.
#[derive(Debug)]
pub(super) struct Prescribed<'a> {
    domain: &'a Domain,
    /// The cells all of whose vertices are on the boundary.
    cells: Vec<usize>,
    /// The corners of other cells that have all their four.
    corners: Vec<Corner>,
    /// The corners with one vertex inside, and which of the four that is; those of one vertex come
    /// one after the other.
    free: Vec<(Corner, usize)>,
}

impl<'a> Prescribed<'a> {
    /// The cells that `boundary` decides about; `domain` is that of the reference mesh.
    pub(super) fn new(domain: &'a Domain, boundary: &[u32]) -> Self {
        let mesh = domain.mesh();
        let prescribed = marks(mesh.points().len(), boundary);
        let held = |cell: usize| {
            mesh.cells().vertices(cell).iter().all(|&vertex| prescribed[vertex as usize])
        };
        let cells: Vec<usize> = (0..mesh.cells().len()).filter(|&cell| held(cell)).collect();
        let (mut corners, mut free) = (Vec::new(), Vec::new());
        for_each_corner_of(mesh, |corner| {
            let mut inside = (0..4).filter(|&local| !prescribed[corner.vertices[local] as usize]);
            match (inside.next(), inside.next()) {
                (None, _) if !held(corner.cell as usize) => corners.push(corner),
                (Some(local), None) => free.push((corner, local)),
                _ => {}
            }
        });
        free.sort_by_key(|&(corner, local)| corner.vertices[local]);
        Self { domain, cells, corners, free }
    }

    /// A proof that no place of the vertices inside gives every cell a scaled Jacobian of at least
    /// `floor`, with the boundary as it lies in `points`; the proof of the first rank that has one.
    /// Collective.
    pub(super) fn proof(&self, points: &[Vector], floor: f64) -> Option<Impossible> {
        let mine = self.broken_cell(points, floor).or_else(|| self.broken_corner(points));
        let mine =
            mine.or_else(|| self.torn_vertex(points)).map(|proof| proof.numbered(self.domain));
        let communicator = self.domain.communicator();
        if communicator.all(mine.is_none()) {
            return None;
        }
        let mut message = Writer::default();
        mine.iter().for_each(|proof| proof.write(&mut message));
        let all = communicator.gather_all(&message.into_bytes());
        all.iter()
            .enumerate()
            .find_map(|(rank, bytes)| Impossible::read(Reader::new(rank, bytes)).ok())
    }

    /// The worst of the cells whose vertices are all prescribed, where it is inverted or below
    /// `floor`.
    fn broken_cell(&self, points: &[Vector], floor: f64) -> Option<Impossible> {
        let cells = self.domain.mesh().cells();
        let measure = Measure::new(cells);
        let mut scratch = Scratch::default();
        let measured = self.cells.iter().filter_map(|&cell| {
            let (value, inverted) =
                measure.cell(cell, |vertex| points[vertex as usize], &mut scratch)?;
            (inverted || value < floor).then_some((cell, value))
        });
        let (cell, scaled_jacobian) = measured.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let (cell_type, centroid) =
            (cells.cell_type(cell), centroid(cells, cell, self.domain.mesh().points()));
        Some(Impossible::Cell { cell, cell_type, centroid, scaled_jacobian })
    }

    /// The corner of another cell that is inverted by most.
    fn broken_corner(&self, points: &[Vector]) -> Option<Impossible> {
        let cells = self.domain.mesh().cells();
        let determinants =
            self.corners.iter().map(|corner| (corner, determinant_of(&corner.jacobian(points))));
        let (corner, _) =
            determinants.filter(|(_, value)| *value <= 0.0).min_by(|a, b| a.1.total_cmp(&b.1))?;
        let cell = corner.cell as usize;
        let (cell_type, centroid) =
            (cells.cell_type(cell), centroid(cells, cell, self.domain.mesh().points()));
        Some(Impossible::Corner { cell, cell_type, centroid })
    }

    /// A free vertex and four half-spaces that it must be in, which have no point in common.
    ///
    /// Four of the half-spaces prove that they share no point (E. Helly 1923): normals that add up to
    /// zero with factors that are not negative, while the offsets with these factors do not come
    /// below zero (J. Farkas 1902).
    fn torn_vertex(&self, points: &[Vector]) -> Option<Impossible> {
        let vertex = |&(corner, local): &(Corner, usize)| corner.vertices[local] as usize;
        self.free.chunk_by(|a, b| vertex(a) == vertex(b)).find_map(|about| {
            let halves =
                about.iter().filter_map(|(corner, local)| half_space(corner, *local, points));
            let halves: Vec<HalfSpace> = halves.take(HALF_SPACES).collect();
            let vertex = vertex(about.first()?);
            if halves.iter().all(|half| dot(half.normal, points[vertex]) > half.offset) {
                return None;
            }
            disjoint(&halves).map(|cells| Impossible::Vertex {
                point: self.domain.mesh().points()[vertex],
                cells,
            })
        })
    }
}

impl Impossible {
    /// A proof that no place of the free vertices gives every cell a scaled Jacobian of at least
    /// `floor`, with `boundary` as it lies in `points`; `None` where none is found, which does not
    /// mean that there is a valid mesh. `domain` is that of the reference mesh. Collective; the
    /// proof of the first rank that has one.
    #[must_use]
    pub fn find(
        domain: impl Into<Domain>,
        boundary: &[u32],
        points: &[Vector],
        floor: f64,
    ) -> Option<Self> {
        Prescribed::new(&domain.into(), boundary).proof(points, floor)
    }

    /// The proof with the cells' numbers in the whole mesh.
    fn numbered(self, domain: &Domain) -> Self {
        let number = |cell| domain.cell_number(cell);
        match self {
            Self::Cell { cell, cell_type, centroid, scaled_jacobian } => {
                Self::Cell { cell: number(cell), cell_type, centroid, scaled_jacobian }
            }
            Self::Corner { cell, cell_type, centroid } => {
                Self::Corner { cell: number(cell), cell_type, centroid }
            }
            Self::Vertex { point, cells } => Self::Vertex { point, cells: cells.map(number) },
        }
    }

    fn write(&self, message: &mut Writer) {
        match self {
            Self::Cell { cell, cell_type, centroid, scaled_jacobian } => {
                message.u8(cell_type.vtk());
                message.u64(*cell as u64);
                message.f64s(centroid);
                message.f64s(&[*scaled_jacobian]);
            }
            Self::Corner { cell, cell_type, centroid } => {
                message.u8(cell_type.vtk());
                message.u64(*cell as u64);
                message.f64s(centroid);
            }
            Self::Vertex { point, cells } => {
                message.u8(0);
                cells.iter().for_each(|&cell| message.u64(cell as u64));
                message.f64s(point);
            }
        }
    }

    fn read(mut reader: Reader<'_>) -> Result<Self, Garbled> {
        let number =
            |reader: &mut Reader<'_>| Ok(usize::try_from(reader.u64()?).unwrap_or(usize::MAX));
        let cell_type = reader.u8()?;
        if cell_type == 0 {
            let mut cells = [0; 4];
            for cell in &mut cells {
                *cell = number(&mut reader)?;
            }
            return Ok(Self::Vertex { cells, point: reader.vector()? });
        }
        let cell_type = CellType::from_vtk(cell_type).ok_or(reader.garbled())?;
        let (cell, centroid) = (number(&mut reader)?, reader.vector()?);
        if reader.is_empty() {
            return Ok(Self::Corner { cell, cell_type, centroid });
        }
        Ok(Self::Cell { cell, cell_type, centroid, scaled_jacobian: reader.f64s(1)?[0] })
    }
}

/// Where a point must lie for a cell to be valid: `normal · x > offset`, the normal of length 1.
struct HalfSpace {
    normal: Vector,
    offset: f64,
    cell: usize,
}

/// Where the free vertex `local` must lie for the corner's determinant to be positive.
fn half_space(corner: &Corner, local: usize, points: &[Vector]) -> Option<HalfSpace> {
    const OTHERS: [[usize; 3]; 4] = [[1, 3, 2], [0, 2, 3], [0, 3, 1], [0, 1, 2]];
    let face = OTHERS[local].map(|other| points[corner.vertices[other] as usize]);
    let normal = triangle_normal(face);
    let length = length(normal);
    let normal = (length > 0.0 && length.is_finite()).then(|| scale(normal, 1.0 / length))?;
    Some(HalfSpace { normal, offset: dot(normal, face[0]), cell: corner.cell as usize })
}

/// The cells of four half-spaces without a point in common.
fn disjoint(halves: &[HalfSpace]) -> Option<[usize; 4]> {
    let count = halves.len();
    let size = halves.iter().fold(0.0_f64, |most, half| most.max(half.offset.abs()));
    for d in 3..count {
        for c in 2..d {
            for b in 1..c {
                for a in 0..b {
                    let four = [a, b, c, d].map(|index| &halves[index]);
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
                    // What rounding leaves of the sum of the normals moves the sum of the offsets
                    // by as much.
                    let rest = (0..4)
                        .fold([0.0; 3], |rest, k| add(rest, scale(four[k].normal, factors[k])));
                    let slack = ROUNDING * size * sum + size * length(rest);
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
    use crate::mesh::Mesh;
    use crate::shapes;
    use crate::vector::subtract;
    use crate::volume::tests::cube_boundary;

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
            let boundary = cube_boundary(&mesh);
            let mut points = mesh.points().to_vec();
            assert_eq!(Impossible::find(&mesh, &boundary, &points, 0.0), None);
            // Wherever the inside lies.
            for (vertex, point) in (0u32..).zip(&mut points) {
                if !boundary.contains(&vertex) {
                    *point = [0.01, 0.99, 0.02];
                }
            }
            assert_eq!(Impossible::find(&mesh, &boundary, &points, 0.0), None);
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
            assert_eq!(Impossible::find(&mesh, &boundary, mesh.points(), 0.0), None);
            let mut pushed = mesh.points().to_vec();
            let [away, from] = [pushed[0], pushed[pushed.len() - 1]];
            pushed[0] = add(from, scale(subtract(from, away), 2.0));
            let proof = Impossible::find(&mesh, &boundary, &pushed, 0.0);
            assert!(
                matches!(proof, Some(Impossible::Cell { cell: 0, .. })),
                "{cell_type}: {proof:?}"
            );
            assert!(proof.unwrap().to_string().contains(&cell_type.to_string()));
        }
    }

    /// The corner of the box is pushed through the hexahedron there, which has a free vertex.
    #[test]
    fn a_corner_without_a_free_vertex_is_named() {
        let mesh = shapes::box_of_hexahedra([2, 2, 2], [0.0; 3], [1.0; 3]);
        let boundary = cube_boundary(&mesh);
        let mut points = mesh.points().to_vec();
        let corner = points.iter().position(|point| *point == [0.0; 3]).unwrap();
        points[corner] = [0.3, 0.3, 0.3];
        let proof = Impossible::find(&mesh, &boundary, &points, 0.0);
        assert!(matches!(proof, Some(Impossible::Corner { cell: 0, .. })), "{proof:?}");
        assert!(proof.unwrap().to_string().contains("cell 0 (hexahedron) at (0.25"));
        points[corner] = [0.1, 0.1, 0.1];
        assert_eq!(Impossible::find(&mesh, &boundary, &points, 0.0), None);
    }

    /// Four cells about one free vertex, in a tetrahedron that is turned inside out.
    #[test]
    fn a_vertex_without_a_place_is_named() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let points: Vec<Vector> = corners.into_iter().chain([[0.2, 0.2, 0.2]]).collect();
        let cells = vec![0, 1, 2, 4, 0, 3, 1, 4, 0, 2, 3, 4, 1, 3, 2, 4];
        let cells = crate::mesh::Cells::uniform(CellType::Tetra, cells).unwrap();
        let mesh = Mesh::new(points, cells, crate::mesh::FeatureSource::SharpEdges).unwrap();
        let find = |points: &[Vector]| Impossible::find(&mesh, &[0, 1, 2, 3], points, 0.0);
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
