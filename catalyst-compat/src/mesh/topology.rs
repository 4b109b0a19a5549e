//! Cells: of grids, of one shape, mixed, polygonal, polyhedral, points.

use tombolo::deform::mesh::{CellType, Cells, CellsView, Vector};

use super::coordset::{Coordset, counts};
use super::polyhedron::turn_outward;
use super::rows::{Rows, entry};
use crate::array::{Array, Fingerprint};
use crate::error::CatalystError;
use crate::node::Node;

/// What the cells are.
#[derive(Debug, Clone)]
pub(super) enum Topology<'call> {
    /// One vertex cell for each point.
    Points(usize),
    /// A grid of these many cells along i, j, k.
    Grid { cells: [usize; 3] },
    /// All of one type.
    Uniform { cell_type: CellType, connectivity: Array<'call>, path: String },
    /// Polygons.
    Polygonal(Rows<'call>),
    /// Polyhedra by their faces.
    Polyhedral { cells: Rows<'call>, faces: Rows<'call> },
    /// Each of its own type.
    Mixed {
        cells: Rows<'call>,
        shapes: Array<'call>,
        map: Vec<(i64, CellType)>,
        faces: Option<Rows<'call>>,
        path: String,
    },
}

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

impl<'call> Topology<'call> {
    pub(super) fn read(
        node: &Node<'_, 'call>,
        coordset: &Coordset<'call>,
    ) -> Result<Self, CatalystError> {
        let kind = node.need(c"type", KNOWN_TYPES)?;
        match &*kind.text()? {
            "points" => Ok(Topology::Points(coordset.len())),
            "uniform" | "rectilinear" => {
                let points = coordset.grid().ok_or_else(|| {
                    kind.wrong_found(
                        "a grid over explicit coordinates".into(),
                        "'structured' or 'unstructured'".into(),
                    )
                })?;
                let cells = points.map(|count| count.saturating_sub(1));
                Ok(Topology::Grid { cells })
            }
            "structured" => {
                let elements = node.need(c"elements", "an object with 'dims'")?;
                let dims = elements.need(c"dims", "the number of cells along i, j, k")?;
                let (cells, dimension) = counts(&dims)?;
                let points = cells
                    .iter()
                    .try_fold(1_usize, |product, count| product.checked_mul(count.checked_add(1)?));
                if points != Some(coordset.len()) {
                    return Err(dims.wrong_found(
                        format!("{:?} cells", &cells[..dimension]),
                        format!(
                            "cell counts whose grid has the {} points of the coordset",
                            coordset.len()
                        ),
                    ));
                }
                Ok(Topology::Grid { cells })
            }
            "unstructured" => Self::unstructured(node),
            other => Err(kind.wrong_found(format!("'{other}'"), KNOWN_TYPES.into())),
        }
    }

    fn unstructured(node: &Node<'_, 'call>) -> Result<Self, CatalystError> {
        let elements = node.need(c"elements", "an object with 'shape' and 'connectivity'")?;
        let shape_node = elements.need(c"shape", KNOWN_SHAPES)?;
        let name = shape_node.text()?;
        if name == "mixed" {
            return Self::mixed(node, &elements);
        }
        match shape(&name) {
            Some(CellType::Polygon) => Ok(Topology::Polygonal(Rows::read(&elements)?)),
            Some(CellType::Polyhedron) => {
                let faces = Self::faces(node)?;
                Ok(Topology::Polyhedral { cells: Rows::read(&elements)?, faces })
            }
            Some(cell_type) => {
                let connectivity_node =
                    elements.need(c"connectivity", "vertex numbers, cell after cell")?;
                let connectivity = connectivity_node.array()?;
                if !connectivity.is_integer() {
                    return Err(connectivity_node.wrong("integers".into()));
                }
                let size = cell_type.vertex_count().unwrap_or(1);
                if !connectivity.len().is_multiple_of(size) {
                    return Err(connectivity_node.wrong(format!(
                        "a multiple of {size} values, for cells of shape '{name}'"
                    )));
                }
                Ok(Topology::Uniform { cell_type, connectivity, path: connectivity_node.path() })
            }
            None => Err(shape_node.wrong_found(format!("'{name}'"), KNOWN_SHAPES.into())),
        }
    }

    fn faces(node: &Node<'_, 'call>) -> Result<Rows<'call>, CatalystError> {
        let below = node.need(c"subelements", "the faces of the polyhedra")?;
        Rows::read(&below)
    }

    fn mixed(node: &Node<'_, 'call>, elements: &Node<'_, 'call>) -> Result<Self, CatalystError> {
        let map_node = elements.need(c"shape_map", "an object with a number for each shape")?;
        let mut map = Vec::new();
        for (index, name) in map_node.names().iter().enumerate() {
            let Some(child) = map_node.at(index, name) else { continue };
            let number = child
                .array()
                .ok()
                .filter(|array| array.len() == 1)
                .and_then(|array| array.integer(0));
            let number = number.ok_or_else(|| child.wrong("one whole number".into()))?;
            let cell_type = shape(&name.to_string_lossy()).ok_or_else(|| {
                child.wrong_found(
                    format!("the shape '{}'", name.to_string_lossy()),
                    KNOWN_SHAPES.into(),
                )
            })?;
            map.push((number, cell_type));
        }
        let cells = Rows::read(elements)?;
        let shapes_node = elements.need(c"shapes", "the number of each cell's shape")?;
        let shapes = shapes_node.array()?;
        if shapes.len() != cells.len() {
            return Err(shapes_node.wrong(format!("{} values, as many as in 'sizes'", cells.len())));
        }
        let has_polyhedra = map.iter().any(|(_, cell_type)| *cell_type == CellType::Polyhedron);
        let faces = if has_polyhedra { Some(Self::faces(node)?) } else { None };
        Ok(Topology::Mixed { cells, shapes, map, faces, path: shapes_node.path() })
    }

    pub(super) fn len(&self) -> usize {
        match self {
            Topology::Points(count) => *count,
            Topology::Grid { cells } => cells.iter().map(|count| (*count).max(1)).product(),
            Topology::Uniform { cell_type, connectivity, .. } => {
                connectivity.len() / cell_type.vertex_count().unwrap_or(1)
            }
            Topology::Polygonal(rows)
            | Topology::Polyhedral { cells: rows, .. }
            | Topology::Mixed { cells: rows, .. } => rows.len(),
        }
    }

    /// The highest dimension that its cells can have.
    pub(super) fn dimension(&self) -> usize {
        match self {
            Topology::Points(_) => 0,
            Topology::Grid { cells } => cells.iter().filter(|count| **count > 0).count(),
            Topology::Uniform { cell_type, .. } => cell_type.dimension(),
            Topology::Polygonal(_) => 2,
            Topology::Polyhedral { .. } => 3,
            Topology::Mixed { map, .. } => {
                map.iter().map(|(_, cell_type)| cell_type.dimension()).max().unwrap_or(0)
            }
        }
    }

    /// The cells as they lie in the solver's memory, where they can be lent.
    pub(super) fn lent(&self) -> Option<CellsView<'call>> {
        let Topology::Uniform { cell_type, connectivity, .. } = self else { return None };
        Some(CellsView::Uniform { cell_type: *cell_type, connectivity: connectivity.indices()? })
    }

    /// Refuses vertex numbers that `lent` would hand on.
    pub(super) fn check(&self, vertices: usize) -> Result<(), CatalystError> {
        if let Topology::Uniform { connectivity, path, .. } = self {
            for index in 0..connectivity.len() {
                entry(connectivity, path, index, vertices as u64)?;
            }
        }
        Ok(())
    }

    /// Adds the cells that `keep` keeps to a copy, their vertices counted from `base` on.
    pub(super) fn append(
        &self,
        cells: &mut Cells,
        base: usize,
        points: &[Vector],
        keep: &dyn Fn(usize) -> bool,
    ) -> Result<(), CatalystError> {
        let vertices = points.len().saturating_sub(base);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the number of points was held against u32::MAX"
        )]
        let shift = base as u32;
        let shifted =
            |row: &[u32]| -> Vec<u32> { row.iter().map(|vertex| vertex + shift).collect() };
        let unfit = |path: &str, cell: usize, error: &dyn std::fmt::Display| CatalystError::Wrong {
            path: path.to_owned(),
            found: format!("cell {cell}: {error}"),
            expected: "as many vertices as the shape has".into(),
        };
        match self {
            Topology::Points(count) => {
                for cell in (0..*count).filter(|cell| keep(*cell)) {
                    #[expect(clippy::cast_possible_truncation, reason = "as above")]
                    cells
                        .push(CellType::Vertex, &[shift + cell as u32])
                        .map_err(|error| unfit("points", cell, &error))?;
                }
            }
            Topology::Grid { cells: counts } => {
                for cell in (0..self.len()).filter(|cell| keep(*cell)) {
                    let (cell_type, row) = grid_cell(*counts, cell);
                    cells
                        .push(cell_type, &shifted(&row))
                        .map_err(|error| unfit("grid", cell, &error))?;
                }
            }
            Topology::Uniform { cell_type, connectivity, path } => {
                let size = cell_type.vertex_count().unwrap_or(1);
                let mut row = Vec::with_capacity(size);
                for cell in (0..self.len()).filter(|cell| keep(*cell)) {
                    row.clear();
                    for index in cell * size..(cell + 1) * size {
                        #[expect(
                            clippy::cast_possible_truncation,
                            reason = "below the number of vertices"
                        )]
                        row.push(shift + entry(connectivity, path, index, vertices as u64)? as u32);
                    }
                    cells.push(*cell_type, &row).map_err(|error| unfit(path, cell, &error))?;
                }
            }
            Topology::Polygonal(rows) => rows.for_each(vertices, |cell, row| {
                let pushed = if keep(cell) { push_polygon(cells, &shifted(row)) } else { Ok(()) };
                pushed.map_err(|found| rows.error(cell, found, "three vertices or more"))
            })?,
            Topology::Polyhedral { cells: rows, faces } => {
                let faces = all_faces(faces, vertices)?;
                rows.for_each(faces.len(), |cell, row| {
                    let pushed = if keep(cell) {
                        push_polyhedron(cells, &faces, row, shift, points)
                    } else {
                        Ok(())
                    };
                    pushed.map_err(|found| rows.error(cell, found, "four faces or more"))
                })?;
            }
            Topology::Mixed { cells: rows, shapes, map, faces, path } => {
                let faces =
                    faces.as_ref().map_or(Ok(Vec::new()), |faces| all_faces(faces, vertices))?;
                rows.for_each(vertices.max(faces.len()), |cell, row| {
                    if !keep(cell) {
                        return Ok(());
                    }
                    let number = shapes.integer(cell);
                    let found = map.iter().find(|(known, _)| Some(*known) == number);
                    let Some((_, cell_type)) = found else {
                        return Err(CatalystError::Wrong {
                            path: path.clone(),
                            found: format!("{} at entry {cell}", shapes.get(cell)),
                            expected: "one of the numbers in 'shape_map'".into(),
                        });
                    };
                    let limit =
                        if *cell_type == CellType::Polyhedron { faces.len() } else { vertices };
                    if let Some(vertex) = row.iter().find(|vertex| **vertex as usize >= limit) {
                        return Err(rows.error(
                            cell,
                            format!("{vertex}"),
                            &format!("numbers below {limit}"),
                        ));
                    }
                    let pushed = match cell_type {
                        CellType::Polyhedron => push_polyhedron(cells, &faces, row, shift, points),
                        CellType::Polygon => push_polygon(cells, &shifted(row)),
                        fixed => {
                            cells.push(*fixed, &shifted(row)).map_err(|error| error.to_string())
                        }
                    };
                    pushed.map_err(|found| {
                        rows.error(cell, found, "as many vertices as the shape has")
                    })
                })?;
            }
        }
        Ok(())
    }

    pub(super) fn fingerprint(&self, into: &mut Fingerprint) {
        into.add(self.len() as u64);
        match self {
            Topology::Points(_) => into.add(1),
            Topology::Grid { cells } => {
                into.add(2);
                cells.iter().for_each(|count| into.add(*count as u64));
            }
            Topology::Uniform { cell_type, connectivity, .. } => {
                into.add(100 + u64::from(cell_type.vtk()));
                connectivity.fingerprint(into);
            }
            Topology::Polygonal(rows) => rows.fingerprint(into),
            Topology::Polyhedral { cells, faces } => {
                cells.fingerprint(into);
                faces.fingerprint(into);
            }
            Topology::Mixed { cells, shapes, map, faces, .. } => {
                cells.fingerprint(into);
                shapes.fingerprint(into);
                map.iter().for_each(|(number, shape)| {
                    into.add(number.cast_unsigned() ^ u64::from(shape.vtk()) << 48)
                });
                if let Some(faces) = faces {
                    faces.fingerprint(into);
                }
            }
        }
    }

    pub(super) fn arrays(&self) -> Vec<&Array<'call>> {
        match self {
            Topology::Points(_) | Topology::Grid { .. } => Vec::new(),
            Topology::Uniform { connectivity, .. } => vec![connectivity],
            Topology::Polygonal(rows) => rows.arrays().collect(),
            Topology::Polyhedral { cells, faces } => cells.arrays().chain(faces.arrays()).collect(),
            Topology::Mixed { cells, shapes, faces, .. } => {
                cells.arrays().chain([shapes]).chain(faces.iter().flat_map(Rows::arrays)).collect()
            }
        }
    }
}

/// A polygon as what it is: a triangle and a quadrilateral have types of their own.
fn push_polygon(cells: &mut Cells, row: &[u32]) -> Result<(), String> {
    let cell_type = match row.len() {
        3 => CellType::Triangle,
        4 => CellType::Quad,
        _ => CellType::Polygon,
    };
    cells.push(cell_type, row).map_err(|error| error.to_string())
}

fn push_polyhedron(
    cells: &mut Cells,
    faces: &[Vec<u32>],
    row: &[u32],
    shift: u32,
    points: &[Vector],
) -> Result<(), String> {
    let mut own: Vec<Vec<u32>> = Vec::with_capacity(row.len());
    for &face in row {
        let face = faces
            .get(face as usize)
            .ok_or_else(|| format!("the face {face}, which does not exist"))?;
        own.push(face.iter().map(|vertex| vertex + shift).collect());
    }
    turn_outward(&mut own, |vertex| points.get(vertex as usize).copied().unwrap_or_default());
    cells.push_polyhedron(&own).map_err(|error| error.to_string())
}

fn all_faces(rows: &Rows, vertices: usize) -> Result<Vec<Vec<u32>>, CatalystError> {
    let mut faces = Vec::with_capacity(rows.len());
    rows.for_each(vertices, |_, row| {
        faces.push(row.to_vec());
        Ok(())
    })?;
    Ok(faces)
}

/// The type and the vertices of a grid's cell, i fastest. Axes along which there is no cell do not count.
fn grid_cell(counts: [usize; 3], cell: usize) -> (CellType, Vec<u32>) {
    let along = |axis: usize| counts[axis].max(1);
    let at = [cell % along(0), cell / along(0) % along(1), cell / (along(0) * along(1))];
    let strides = [1, counts[0] + 1, (counts[0] + 1) * (counts[1] + 1)];
    let first: usize = at.iter().zip(strides).map(|(at, stride)| at * stride).sum();
    let steps: Vec<usize> = strides
        .into_iter()
        .zip(counts)
        .filter(|(_, count)| *count > 0)
        .map(|(step, _)| step)
        .collect();
    let (cell_type, corners) = match steps[..] {
        [] => (CellType::Vertex, vec![0]),
        [a] => (CellType::Line, vec![0, a]),
        [a, b] => (CellType::Quad, vec![0, a, a + b, b]),
        [a, b, c, ..] => (CellType::Hexahedron, vec![0, a, a + b, b, c, a + c, a + b + c, b + c]),
    };
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the number of points was held against u32::MAX"
    )]
    (cell_type, corners.into_iter().map(|corner| (first + corner) as u32).collect())
}
