//! Cells: of grids, of one shape, mixed, polygonal, polyhedral, points.

use tombolo::deform::mesh::CellType;
use tombolo::foreign::mesh::{Coordset, Label, Rows, Topology};
use tombolo::foreign::{Array, NumberType, RunError};

use super::coordset::counts;
use super::rows;
use crate::node::Node;

const SHAPES: [(&str, CellType); 11] = [
    ("point", CellType::Vertex),
    ("line", CellType::Line),
    ("tri", CellType::Triangle),
    ("quad", CellType::Quad),
    ("tet", CellType::Tetra),
    ("hex", CellType::Hexahedron),
    ("wedge", CellType::Wedge),
    ("pyramid", CellType::Pyramid),
    ("polygonal", CellType::Polygon),
    ("polyhedral", CellType::Polyhedron),
    ("vertex", CellType::Vertex),
];

fn shape(name: &str) -> Option<CellType> {
    SHAPES.into_iter().find(|(shape, _)| *shape == name).map(|(_, cell_type)| cell_type)
}

const KNOWN_SHAPES: &str = "'point', 'line', 'tri', 'quad', 'tet', 'hex', 'wedge', 'pyramid', 'polygonal', 'polyhedral' or 'mixed'";
const KNOWN_TYPES: &str = "'points', 'uniform', 'rectilinear', 'structured' or 'unstructured'";

/// Reads the cells of a topology over this coordset.
pub(super) fn read<'call>(
    node: &Node<'_, 'call>,
    coordset: &Coordset<'call>,
) -> Result<Topology<'call>, RunError> {
    let kind = node.need(c"type", KNOWN_TYPES)?;
    match &*kind.text()? {
        "points" => Ok(Topology::Points(coordset.vertex_count())),
        "uniform" | "rectilinear" => {
            let points = coordset.grid().ok_or_else(|| {
                kind.wrong_found(
                    "a grid over explicit coordinates",
                    "'structured' or 'unstructured'",
                )
            })?;
            if points.contains(&0) {
                return Ok(empty_grid(node, coordset.dimension()));
            }
            let cells = points.map(|count| count.saturating_sub(1));
            Ok(Topology::Grid { cells })
        }
        "structured" => {
            let elements = node.need(c"elements", "an object with 'dims'")?;
            let dims = elements.need(c"dims", "the number of cells along i, j, k")?;
            let (cells, dimension) = counts(&dims)?;
            if coordset.vertex_count() == 0 && cells[..dimension].contains(&0) {
                return Ok(empty_grid(node, dimension));
            }
            let points = cells
                .iter()
                .try_fold(1_usize, |product, count| product.checked_mul(count.checked_add(1)?));
            if points != Some(coordset.vertex_count()) {
                return Err(dims.wrong_found(
                    format!("{:?} cells", &cells[..dimension]),
                    format!(
                        "cell counts whose grid has the {} points of the coordset",
                        coordset.vertex_count()
                    ),
                ));
            }
            Ok(Topology::Grid { cells })
        }
        "unstructured" => unstructured(node),
        other => Err(kind.wrong_found(format!("'{other}'"), KNOWN_TYPES)),
    }
}

/// No cells, of this dimension: the grid of a rank without points. The counts along its axes say
/// nothing, as axes without cells do not count in a grid.
fn empty_grid<'call>(node: &Node<'_, 'call>, dimension: usize) -> Topology<'call> {
    let cell_type = match dimension {
        0 => CellType::Vertex,
        1 => CellType::Line,
        2 => CellType::Quad,
        _ => CellType::Hexahedron,
    };
    let connectivity = Array::none(NumberType::I32);
    Topology::Uniform { cell_type, connectivity, label: Label::Path(node.path()) }
}

fn unstructured<'call>(node: &Node<'_, 'call>) -> Result<Topology<'call>, RunError> {
    let elements = node.need(c"elements", "an object with 'shape' and 'connectivity'")?;
    let shape_node = elements.need(c"shape", KNOWN_SHAPES)?;
    let name = shape_node.text()?;
    if name == "mixed" {
        return mixed(node, &elements);
    }
    match shape(&name) {
        Some(CellType::Polygon) => Ok(Topology::Polygonal(rows::read(&elements)?)),
        Some(CellType::Polyhedron) => {
            let faces = faces(node)?;
            Ok(Topology::Polyhedral { cells: rows::read(&elements)?, faces })
        }
        Some(cell_type) => {
            let connectivity_node =
                elements.need(c"connectivity", "vertex numbers, cell after cell")?;
            let connectivity = connectivity_node.array()?;
            if !connectivity.is_integer() {
                return Err(connectivity_node.wrong("integers"));
            }
            let size = cell_type.vertex_count().unwrap_or(1);
            if !connectivity.len().is_multiple_of(size) {
                return Err(connectivity_node
                    .wrong(format!("a multiple of {size} values, for cells of shape '{name}'")));
            }
            let label = Label::Path(connectivity_node.path());
            Ok(Topology::Uniform { cell_type, connectivity, label })
        }
        None => Err(shape_node.wrong_found(format!("'{name}'"), KNOWN_SHAPES)),
    }
}

fn faces<'call>(node: &Node<'_, 'call>) -> Result<Rows<'call>, RunError> {
    let below = node.need(c"subelements", "the faces of the polyhedra")?;
    rows::read(&below)
}

fn mixed<'call>(
    node: &Node<'_, 'call>,
    elements: &Node<'_, 'call>,
) -> Result<Topology<'call>, RunError> {
    let map_node = elements.need(c"shape_map", "an object with a number for each shape")?;
    let mut map = Vec::new();
    map_node.each(|child| {
        let (number, name) = (child.integer("one whole number")?, child.name());
        let unknown = || child.wrong_found(format!("the shape '{name}'"), KNOWN_SHAPES);
        map.push((number, shape(&name).ok_or_else(unknown)?));
        Ok(())
    })?;
    let cells = rows::read(elements)?;
    let shapes_node = elements.need(c"shapes", "the number of each cell's shape")?;
    let shapes = shapes_node.array()?;
    if shapes.len() != cells.count() {
        return Err(shapes_node.wrong(format!("{} values, as many as in 'sizes'", cells.count())));
    }
    // The map may name polyhedra of which there are none, and whose faces are not there then.
    let has_polyhedra = map.iter().any(|(_, cell_type)| *cell_type == CellType::Polyhedron)
        && node.child(c"subelements").is_some();
    let faces = has_polyhedra.then(|| faces(node)).transpose()?;
    let label = Label::Path(shapes_node.path());
    let expected = "one of the numbers in 'shape_map'";
    Ok(Topology::Mixed { cells, shapes, map, faces, label, expected })
}
