//! Which way round the vertices of cells run.

use std::borrow::Cow;

use super::cell_type::Types;
use super::{CellType, Cells, Vector};
use crate::mesh::cell_geometry::{corner_tets, tet_determinant};
use crate::number::real;
use crate::parallel;
use crate::vector::{add, cross, determinant, dot, scale, subtract};

/// How many cells are looked at at a time.
const CHUNK: usize = 4096;

/// Which way round a cell runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Hand {
    /// Every corner is right-handed, as it should be.
    Right,
    /// Every corner is left-handed.
    Left,
    /// Some corners are and others are not, or are flat, or the cell is flat in the middle.
    Neither,
}

/// The corners of a quadrilateral, each between the ones before and after it.
const QUAD_CORNERS: [[usize; 3]; 4] = [[3, 0, 1], [0, 1, 2], [1, 2, 3], [2, 3, 0]];
const PIXEL_AS_QUAD: [usize; 4] = [0, 1, 3, 2];

/// The least Jacobian in the middle of a hexahedron, in parts of the mean of those at its corners:
/// one whose top is turned by 180 degrees against its bottom has sound corners and no middle.
const FLAT: f64 = 0.05;

/// Whether the order of vertices of such cells can be told: of volumes and of quadrilaterals.
pub(super) fn can_be_told(cell_type: CellType) -> bool {
    cell_type.dimension() == 3 || matches!(cell_type, CellType::Quad | CellType::Pixel)
}

/// Quadrilaterals have no hand of their own: [`Hand::Right`] where all corners turn the same way,
/// as no crossed one does.
fn hand_of_quad(quad: [Vector; 4]) -> Hand {
    let normals = QUAD_CORNERS.map(|[before, at, after]| {
        cross(subtract(quad[after], quad[at]), subtract(quad[before], quad[at]))
    });
    let is_convex = normals.iter().all(|&a| normals.iter().all(|&b| dot(a, b) > 0.0));
    if is_convex { Hand::Right } else { Hand::Neither }
}

/// Which way round a cell runs whose vertices lie `at`.
pub(super) fn hand(
    cells: &Cells,
    cell: usize,
    points: &[Vector],
    tets: &mut Vec<[Vector; 4]>,
) -> Hand {
    let at = |local: usize| points[cells.vertices(cell)[local] as usize];
    match cells.cell_type(cell) {
        CellType::Quad => return hand_of_quad([0, 1, 2, 3].map(at)),
        CellType::Pixel => return hand_of_quad(PIXEL_AS_QUAD.map(at)),
        _ => {}
    }
    corner_tets(cells, cell, |vertex| points[vertex as usize], tets);
    let all = |sign: f64| tets.iter().all(|&tet| sign * tet_determinant(tet) > 0.0);
    let middle = match cells.cell_type(cell) {
        CellType::Hexahedron => middle_jacobian([0, 1, 3, 2, 4, 5, 7, 6].map(at)),
        CellType::Voxel => middle_jacobian([0, 1, 2, 3, 4, 5, 6, 7].map(at)),
        _ => f64::NAN,
    };
    let sum: f64 = tets.iter().map(|&tet| tet_determinant(tet)).sum();
    if middle * real(tets.len()) / sum < FLAT {
        return Hand::Neither;
    }
    match (all(1.0), all(-1.0)) {
        (true, false) => Hand::Right,
        (false, true) => Hand::Left,
        _ => Hand::Neither,
    }
}

/// The Jacobian in the middle of a hexahedron whose vertices come x fastest, then y, then z.
fn middle_jacobian(points: [Vector; 8]) -> f64 {
    // An edge in the middle is the mean of the four edges along its axis.
    let [x, y, z] = [1, 2, 4].map(|axis| {
        let ends = (0..8).filter(|index| index & axis == 0);
        ends.fold([0.0; 3], |sum, index| {
            add(sum, scale(subtract(points[index | axis], points[index]), 0.25))
        })
    });
    determinant(x, y, z)
}

/// Whether every corner of a volume cell is left-handed.
pub(crate) fn is_left_handed(cells: &Cells, cell: usize, points: &[Vector]) -> bool {
    hand(cells, cell, points, &mut Vec::new()) == Hand::Left
}

/// The cells of one type by the way they run.
#[derive(Debug, Clone, Copy, Default)]
struct Count {
    right: usize,
    left: usize,
    neither: usize,
}

/// The types of cells of which more are left-handed than right-handed, and those most of which are
/// neither.
pub(super) fn hands(cells: &Cells, points: &[Vector]) -> (Types, Types) {
    if !cells.types().iter().any(|&cell_type| can_be_told(cell_type)) {
        return Default::default();
    }
    let number = |cell_type: CellType| usize::from(cell_type.vtk());
    let size = number(CellType::Polyhedron) + 1;
    let parts = parallel::map_chunks(cells.len(), CHUNK, |range| {
        let (mut counts, mut tets) = (vec![Count::default(); size], Vec::new());
        for cell in range.filter(|&cell| can_be_told(cells.cell_type(cell))) {
            let count = &mut counts[number(cells.cell_type(cell))];
            *match hand(cells, cell, points, &mut tets) {
                Hand::Right => &mut count.right,
                Hand::Left => &mut count.left,
                Hand::Neither => &mut count.neither,
            } += 1;
        }
        counts
    });
    let (mut left, mut neither) = (Types::default(), Types::default());
    for cell_type in CellType::ALL {
        let all = |of: fn(&Count) -> usize| {
            parts.iter().map(|counts| of(&counts[number(cell_type)])).sum::<usize>()
        };
        let count = Count {
            right: all(|it| it.right),
            left: all(|it| it.left),
            neither: all(|it| it.neither),
        };
        if count.left > count.right {
            left.insert(cell_type);
        }
        if count.neither > count.left + count.right {
            neither.insert(cell_type);
        }
    }
    (left, neither)
}

impl Cells {
    /// The cells right-handed, as a mesh with these points has them: each type most of whose cells
    /// are left-handed is turned. Cells that are a mesh's, or were taken from one, stay as they are
    /// whatever the points.
    ///
    /// # Panics
    /// Where a cell names a vertex beyond `points`.
    #[must_use]
    pub fn right_handed(&self, points: &[Vector]) -> Cow<'_, Self> {
        if self.turned_types().is_some() {
            return Cow::Borrowed(self);
        }
        let (turned, _) = hands(self, points);
        if turned.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut cells = self.clone();
        cells.turn(turned);
        Cow::Owned(cells.with_turned_types(Some(turned)))
    }

    /// The cells with their vertices in the order in which they were given, before a mesh turned
    /// those that were left-handed.
    #[must_use]
    pub fn as_given(&self) -> Cow<'_, Self> {
        match self.turned_types() {
            Some(turned) if !turned.is_empty() => {
                let mut cells = self.clone();
                cells.turn(turned);
                Cow::Owned(cells.with_turned_types(None))
            }
            _ => Cow::Borrowed(self),
        }
    }

    /// A note on the order in which the vertices were given: which types of cells were left-handed.
    /// Wedges are not told of, which have no agreed order.
    #[must_use]
    pub fn handedness_note(&self) -> Option<String> {
        let turned = self.turned_types().unwrap_or_default();
        let types: Vec<&str> = CellType::ALL
            .into_iter()
            .filter(|&cell_type| cell_type != CellType::Wedge && turned.contains(cell_type))
            .map(CellType::name)
            .collect();
        let types = match &types[..] {
            [] => return None,
            [one] => (*one).to_owned(),
            [first @ .., last] => format!("{} and {last}", first.join(", ")),
        };
        Some(format!(
            "left-handed cells: those of type {types} run the other way round than VTK's; they are read as mirrored, and keep \
             their own order of vertices wherever they are written"
        ))
    }

    /// The types of volume cells that were given left-handed, most of them, and those of the others
    /// that have a right-handed cell.
    ///
    /// # Panics
    /// Where a cell names a vertex beyond `points`.
    #[must_use]
    pub fn given_hands(&self, points: &[Vector]) -> [Vec<CellType>; 2] {
        let (mut left, mut right) = (Types::default(), Types::default());
        let turned = self.turned_types().unwrap_or_else(|| hands(self, points).0);
        let mut tets = Vec::new();
        for cell in (0..self.len()).filter(|&cell| self.cell_type(cell).dimension() == 3) {
            let cell_type = self.cell_type(cell);
            if turned.contains(cell_type) {
                left.insert(cell_type);
            } else if !right.contains(cell_type)
                && hand(self, cell, points, &mut tets) == Hand::Right
            {
                right.insert(cell_type);
            }
        }
        [left, right].map(|types| {
            CellType::ALL.into_iter().filter(|&cell_type| types.contains(cell_type)).collect()
        })
    }

    /// Mirrors the order of vertices of the cells of some types; twice is not at all.
    pub(super) fn turn(&mut self, types: Types) {
        if types.is_empty() {
            return;
        }
        let mut row = Vec::new();
        for cell in 0..self.len() {
            let cell_type = self.cell_type(cell);
            if types.contains(cell_type) && cell_type != CellType::Polyhedron {
                let vertices = self.vertices_mut(cell);
                row.clear();
                row.extend_from_slice(vertices);
                for (vertex, &from) in vertices.iter_mut().zip(mirror(cell_type)) {
                    *vertex = row[from];
                }
            }
        }
        if types.contains(CellType::Polyhedron) {
            self.polyhedron_faces_mut().for_each(|face| face[1..].reverse());
        }
    }
}

/// The order of vertices that makes a left-handed cell of this type a right-handed one with the
/// same edges and faces, and the other way round. Polyhedra have none: their faces are turned.
const fn mirror(cell_type: CellType) -> &'static [usize] {
    match cell_type {
        CellType::Tetra => &[0, 2, 1, 3],
        CellType::Voxel => &[0, 2, 1, 3, 4, 6, 5, 7],
        CellType::Hexahedron => &[0, 3, 2, 1, 4, 7, 6, 5],
        CellType::Wedge => &[0, 2, 1, 3, 5, 4],
        CellType::Pyramid => &[0, 3, 2, 1, 4],
        CellType::PentagonalPrism => &[0, 4, 3, 2, 1, 5, 9, 8, 7, 6],
        CellType::HexagonalPrism => &[0, 5, 4, 3, 2, 1, 6, 11, 10, 9, 8, 7],
        _ => &[],
    }
}
