//! Gmsh's element types.

use tombolo_deform::mesh::{CellType, Cells};

use super::super::error::{Flaw, Problem};
use super::Reader;

/// A first-order element type.
pub(super) struct Element {
    pub cell_type: CellType,
    pub nodes: usize,
}

/// The element type with Gmsh's number.
pub(super) fn element(number: i32, reader: &Reader) -> Result<Element, Flaw> {
    let (cell_type, nodes) = match number {
        1 => (CellType::Line, 2),
        2 => (CellType::Triangle, 3),
        3 => (CellType::Quad, 4),
        4 => (CellType::Tetra, 4),
        5 => (CellType::Hexahedron, 8),
        6 => (CellType::Wedge, 6),
        7 => (CellType::Pyramid, 5),
        15 => (CellType::Vertex, 1),
        other => {
            let what = match higher_order_name(other) {
                Some(name) => format!("element type {other}, a {name},"),
                None => format!("element type {other}"),
            };
            return Err(reader.scanner.flaw(Problem::Unsupported {
                what,
                instead: "export the mesh with first-order elements (Mesh.ElementOrder = 1, or gmsh -order 1)",
            }));
        }
    };
    Ok(Element { cell_type, nodes })
}

/// Appends a cell given by its nodes in Gmsh's order.
pub(super) fn push(
    cells: &mut Cells,
    cell_type: CellType,
    vertices: &mut [u32],
) -> Result<(), Flaw> {
    // Gmsh's first triangle of a prism looks inwards, VTK's outwards.
    if let (CellType::Wedge, [_, b, c, _, e, f]) = (cell_type, &mut *vertices) {
        std::mem::swap(b, c);
        std::mem::swap(e, f);
    }
    Ok(cells.push(cell_type, vertices)?)
}

fn higher_order_name(number: i32) -> Option<&'static str> {
    Some(match number {
        8 => "quadratic line of 3 nodes",
        9 => "quadratic triangle of 6 nodes",
        10 => "quadratic quadrangle of 9 nodes",
        11 => "quadratic tetrahedron of 10 nodes",
        12 => "quadratic hexahedron of 27 nodes",
        13 => "quadratic prism of 18 nodes",
        14 => "quadratic pyramid of 14 nodes",
        16 => "quadratic quadrangle of 8 nodes",
        17 => "quadratic hexahedron of 20 nodes",
        18 => "quadratic prism of 15 nodes",
        19 => "quadratic pyramid of 13 nodes",
        20 | 21 | 23 | 25 => "triangle of third or higher order",
        26..=28 => "line of third or higher order",
        29..=31 => "tetrahedron of third or higher order",
        36..=38 => "quadrangle of third or higher order",
        92 | 93 => "hexahedron of third or higher order",
        34 => "polygon",
        35 => "polyhedron",
        _ => return None,
    })
}
