//! The kinds of cells that polygonal data keep apart.

use tombolo_deform::mesh::CellType;

/// A kind of cells of polygonal data. The cells are numbered kind by kind, in this order.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    Vertices,
    Lines,
    Polygons,
    Strips,
}

impl Kind {
    pub const ALL: [Kind; 4] = [Kind::Vertices, Kind::Lines, Kind::Polygons, Kind::Strips];

    /// The kind that cells of a type are of.
    pub fn of(cell_type: CellType) -> Self {
        match cell_type {
            CellType::Vertex | CellType::PolyVertex => Kind::Vertices,
            CellType::Line | CellType::PolyLine => Kind::Lines,
            CellType::TriangleStrip => Kind::Strips,
            _ => Kind::Polygons,
        }
    }

    /// The element of an XML file that holds the cells of this kind.
    pub fn element(self) -> &'static str {
        match self {
            Kind::Vertices => "Verts",
            Kind::Lines => "Lines",
            Kind::Polygons => "Polys",
            Kind::Strips => "Strips",
        }
    }

    /// VTK's type number of a cell of this kind with so many vertices.
    pub fn cell_type(self, vertices: usize) -> i64 {
        match (self, vertices) {
            (Kind::Vertices, 1) => 1,
            (Kind::Vertices, _) => 2,
            (Kind::Lines, 2) => 3,
            (Kind::Lines, _) => 4,
            (Kind::Polygons, 3) => 5,
            (Kind::Polygons, 4) => 9,
            (Kind::Polygons, _) => 7,
            (Kind::Strips, _) => 6,
        }
    }
}
