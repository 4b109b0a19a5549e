//! Which way round the vertices of volume cells run.

use super::{CellType, Cells, Vector};
use crate::parallel;
use crate::quality::{corner_tets, tet_determinant};

/// How many cells are looked at at a time.
const CHUNK: usize = 4096;

/// Some of the types of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Types(u64);

impl Types {
    pub(super) fn is_empty(self) -> bool {
        self.0 == 0
    }

    pub(super) fn contains(self, cell_type: CellType) -> bool {
        self.0 & 1 << cell_type.vtk() != 0
    }

    fn insert(&mut self, cell_type: CellType) {
        self.0 |= 1 << cell_type.vtk();
    }
}

/// Which way round a cell runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Hand {
    /// Every corner is right-handed, as it should be.
    Right,
    /// Every corner is left-handed.
    Left,
    /// Some corners are and others are not, or are flat.
    Neither,
}

/// Which way round a volume cell runs whose vertices lie `at`.
pub(super) fn hand(
    cells: &Cells,
    cell: usize,
    points: &[Vector],
    tets: &mut Vec<[Vector; 4]>,
) -> Hand {
    corner_tets(cells, cell, |vertex| points[vertex as usize], tets);
    let all = |sign: f64| tets.iter().all(|&tet| sign * tet_determinant(tet) > 0.0);
    match (all(1.0), all(-1.0)) {
        (true, false) => Hand::Right,
        (false, true) => Hand::Left,
        _ => Hand::Neither,
    }
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

/// The types of volume cells of which more are left-handed than right-handed, and those most of which are neither.
pub(super) fn hands(cells: &Cells, points: &[Vector]) -> (Types, Types) {
    if cells.dimension() < 3 {
        return Default::default();
    }
    let number = |cell_type: CellType| usize::from(cell_type.vtk());
    let size = number(CellType::Polyhedron) + 1;
    let parts = parallel::map_chunks(cells.len(), CHUNK, |range| {
        let (mut counts, mut tets) = (vec![Count::default(); size], Vec::new());
        for cell in range.filter(|&cell| cells.cell_type(cell).dimension() == 3) {
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

/// The order of vertices that makes a left-handed cell of this type a right-handed one with the same edges and faces, and the
/// other way round. Polyhedra have none: their faces are turned.
pub(super) const fn mirror(cell_type: CellType) -> &'static [usize] {
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
