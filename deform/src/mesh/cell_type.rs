//! The linear cell types of VTK, with their faces and edges.

use serde::{Deserialize, Serialize};

/// A linear VTK cell type. The discriminant is VTK's own number, and vertices are numbered as VTK
/// numbers them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum CellType {
    /// One vertex.
    Vertex = 1,
    /// Any number of separate vertices.
    PolyVertex = 2,
    /// Two vertices.
    Line = 3,
    /// A chain of two or more vertices.
    PolyLine = 4,
    /// Three vertices.
    Triangle = 5,
    /// Three or more vertices; each further one makes a triangle with the two before it.
    TriangleStrip = 6,
    /// Three or more vertices in order around a planar face.
    Polygon = 7,
    /// An axis-aligned quadrilateral, its last two vertices swapped against [`CellType::Quad`].
    Pixel = 8,
    /// Four vertices in order around.
    Quad = 9,
    /// Four vertices; the fourth lies on the side the first three's right-hand normal points to.
    Tetra = 10,
    /// An axis-aligned hexahedron in pixel order.
    Voxel = 11,
    /// Eight vertices: the bottom quadrilateral, then the top.
    Hexahedron = 12,
    /// Six vertices: one triangle, then the other, at which the normal of the first points.
    Wedge = 13,
    /// Five vertices: the quadrilateral base, then the apex.
    Pyramid = 14,
    /// Ten vertices: one pentagon, then the other.
    PentagonalPrism = 15,
    /// Twelve vertices: one hexagon, then the other.
    HexagonalPrism = 16,
    /// Any closed polyhedron, described by its faces.
    Polyhedron = 42,
}

impl CellType {
    /// Every type, in the order of VTK's numbers.
    pub const ALL: [CellType; 17] = [
        CellType::Vertex,
        CellType::PolyVertex,
        CellType::Line,
        CellType::PolyLine,
        CellType::Triangle,
        CellType::TriangleStrip,
        CellType::Polygon,
        CellType::Pixel,
        CellType::Quad,
        CellType::Tetra,
        CellType::Voxel,
        CellType::Hexahedron,
        CellType::Wedge,
        CellType::Pyramid,
        CellType::PentagonalPrism,
        CellType::HexagonalPrism,
        CellType::Polyhedron,
    ];

    /// The type with this VTK number, if it is a linear one.
    #[must_use]
    pub fn from_vtk(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|cell| cell.vtk() == number)
    }

    /// VTK's number of this type.
    #[must_use]
    pub const fn vtk(self) -> u8 {
        self as u8
    }

    /// The type of a polygon with so many corners: triangles and quadrilaterals have their own.
    #[must_use]
    pub const fn of_polygon(corners: usize) -> Self {
        match corners {
            3 => CellType::Triangle,
            4 => CellType::Quad,
            _ => CellType::Polygon,
        }
    }

    /// The dimension of the cell itself: 0 to 3.
    #[must_use]
    pub const fn dimension(self) -> usize {
        match self {
            CellType::Vertex | CellType::PolyVertex => 0,
            CellType::Line | CellType::PolyLine => 1,
            CellType::Triangle
            | CellType::TriangleStrip
            | CellType::Polygon
            | CellType::Pixel
            | CellType::Quad => 2,
            _ => 3,
        }
    }

    /// How many vertices a cell of this type has; `None` where it varies from cell to cell.
    #[must_use]
    pub const fn vertex_count(self) -> Option<usize> {
        match self {
            CellType::Vertex => Some(1),
            CellType::Line => Some(2),
            CellType::Triangle => Some(3),
            CellType::Pixel | CellType::Quad | CellType::Tetra => Some(4),
            CellType::Voxel | CellType::Hexahedron => Some(8),
            CellType::Wedge => Some(6),
            CellType::Pyramid => Some(5),
            CellType::PentagonalPrism => Some(10),
            CellType::HexagonalPrism => Some(12),
            CellType::PolyVertex
            | CellType::PolyLine
            | CellType::TriangleStrip
            | CellType::Polygon
            | CellType::Polyhedron => None,
        }
    }

    /// The faces of a volume cell as local vertex numbers, counter-clockwise seen from outside.
    ///
    /// Empty for cells of lower dimension and for [`CellType::Polyhedron`], whose faces are stored
    /// with the cell.
    #[must_use]
    pub const fn faces(self) -> &'static [&'static [usize]] {
        match self {
            CellType::Tetra => &[&[0, 1, 3], &[1, 2, 3], &[2, 0, 3], &[0, 2, 1]],
            CellType::Voxel => &[
                &[0, 4, 6, 2],
                &[1, 3, 7, 5],
                &[0, 1, 5, 4],
                &[2, 6, 7, 3],
                &[0, 2, 3, 1],
                &[4, 5, 7, 6],
            ],
            CellType::Hexahedron => &[
                &[0, 4, 7, 3],
                &[1, 2, 6, 5],
                &[0, 1, 5, 4],
                &[3, 7, 6, 2],
                &[0, 3, 2, 1],
                &[4, 5, 6, 7],
            ],
            // VTK's manual has wedges whose first triangle's normal points out of the cell, its
            // measures and most mesh generators those whose first triangle's normal points in: a
            // mesh turns the ones to be the others.
            CellType::Wedge => {
                &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]]
            }
            CellType::Pyramid => &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
            CellType::PentagonalPrism => &[
                &[0, 4, 3, 2, 1],
                &[5, 6, 7, 8, 9],
                &[0, 1, 6, 5],
                &[1, 2, 7, 6],
                &[2, 3, 8, 7],
                &[3, 4, 9, 8],
                &[4, 0, 5, 9],
            ],
            CellType::HexagonalPrism => &[
                &[0, 5, 4, 3, 2, 1],
                &[6, 7, 8, 9, 10, 11],
                &[0, 1, 7, 6],
                &[1, 2, 8, 7],
                &[2, 3, 9, 8],
                &[3, 4, 10, 9],
                &[4, 5, 11, 10],
                &[5, 0, 6, 11],
            ],
            _ => &[],
        }
    }

    /// The field's word for the type, in the plural-free form VTK and Blueprint users know.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            CellType::Vertex => "vertex",
            CellType::PolyVertex => "poly vertex",
            CellType::Line => "line",
            CellType::PolyLine => "poly line",
            CellType::Triangle => "triangle",
            CellType::TriangleStrip => "triangle strip",
            CellType::Polygon => "polygon",
            CellType::Pixel => "pixel",
            CellType::Quad => "quad",
            CellType::Tetra => "tetra",
            CellType::Voxel => "voxel",
            CellType::Hexahedron => "hexahedron",
            CellType::Wedge => "wedge",
            CellType::Pyramid => "pyramid",
            CellType::PentagonalPrism => "pentagonal prism",
            CellType::HexagonalPrism => "hexagonal prism",
            CellType::Polyhedron => "polyhedron",
        }
    }
}

impl std::fmt::Display for CellType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

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

    pub(super) fn insert(&mut self, cell_type: CellType) {
        self.0 |= 1 << cell_type.vtk();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every edge of a closed, consistently oriented boundary is walked once in each direction.
    #[test]
    fn faces_close_every_volume_cell() {
        for cell in CellType::ALL {
            let mut edges = std::collections::HashSet::new();
            for face in cell.faces() {
                for (i, &a) in face.iter().enumerate() {
                    assert!(edges.insert((a, face[(i + 1) % face.len()])), "{cell}: edge twice");
                }
            }
            for &(a, b) in &edges {
                assert!(edges.contains(&(b, a)), "{cell}: edge {a}-{b} open");
            }
        }
    }

    #[test]
    fn numbers_are_those_of_vtk() {
        for cell in CellType::ALL {
            assert_eq!(CellType::from_vtk(cell.vtk()), Some(cell));
        }
        assert_eq!(CellType::from_vtk(0), None);
        assert_eq!(CellType::from_vtk(24), None, "quadratic cells are refused, not misread");
    }
}
