//! Cells: of grids, of one shape, mixed, polygonal, polyhedral, points.

use tombolo_deform::mesh::{CellType, Cells, CellsView, Indices, Vector};

use super::polyhedron::turn_outward;
use super::rows::{Rows, vertex};
use crate::foreign::array::{Array, Fingerprint};
use crate::foreign::error::RunError;
use crate::foreign::label::Label;
use crate::foreign::memory;

/// Which cells a mesh has.
#[derive(Debug, Clone)]
pub enum Topology<'call> {
    /// One vertex cell for each point.
    Points(usize),
    /// A grid of these many cells along i, j, k.
    Grid {
        /// How many along each axis; 0 along one that the grid does not have.
        cells: [usize; 3],
    },
    /// All of one type.
    Uniform {
        /// The type.
        cell_type: CellType,
        /// The vertices, cell after cell.
        connectivity: Array<'call>,
        /// The connectivity's label in errors.
        label: Label,
    },
    /// Cells of several types, type after type.
    Types(Types<'call>),
    /// Polygons.
    Polygonal(Rows<'call>),
    /// Polyhedra by their faces.
    Polyhedral {
        /// The faces of each cell.
        cells: Rows<'call>,
        /// The vertices of each face.
        faces: Rows<'call>,
    },
    /// Each of its own type.
    Mixed {
        /// The vertices of each cell; of a polyhedron its faces.
        cells: Rows<'call>,
        /// Of each cell: the number of its type.
        shapes: Array<'call>,
        /// The types by their numbers.
        map: Vec<(i64, CellType)>,
        /// The vertices of each face of polyhedra.
        faces: Option<Rows<'call>>,
        /// The label in errors of the numbers of the types.
        label: Label,
        /// The numbers that are expected, in the solver's terms.
        expected: &'static str,
    },
}

/// Cells of several types, type after type: a topology of uniform cells for each.
#[derive(Debug, Clone)]
pub struct Types<'call> {
    topologies: Vec<Topology<'call>>,
    /// The cells of each as they lie in the solver's memory, where all can be lent.
    lent: Option<Vec<(CellType, Indices<'call>)>>,
}

impl<'call> Types<'call> {
    /// Cells of several types; those that are not uniform are copied.
    #[must_use]
    pub fn new(topologies: Vec<Topology<'call>>) -> Self {
        let lent = topologies.iter().map(|topology| match topology {
            Topology::Uniform { cell_type, connectivity, .. } => {
                Some((*cell_type, connectivity.indices()?))
            }
            _ => None,
        });
        Self { lent: lent.collect(), topologies }
    }
}

impl<'call> Topology<'call> {
    /// How many cells there are.
    #[must_use]
    pub fn cell_count(&self) -> usize {
        match self {
            Topology::Points(count) => *count,
            Topology::Grid { cells } => cells.iter().map(|count| (*count).max(1)).product(),
            Topology::Uniform { cell_type, connectivity, .. } => {
                connectivity.len() / cell_type.vertex_count().unwrap_or(1)
            }
            Topology::Types(types) => types.topologies.iter().map(Topology::cell_count).sum(),
            Topology::Polygonal(rows)
            | Topology::Polyhedral { cells: rows, .. }
            | Topology::Mixed { cells: rows, .. } => rows.count(),
        }
    }

    /// The highest dimension of its cells; of mixed ones the types that occur are looked at.
    ///
    /// # Errors
    /// [`RunError`] where the memory that holds the types cannot be read.
    pub fn dimension(&self) -> Result<usize, RunError> {
        Ok(match self {
            Topology::Points(_) => 0,
            Topology::Grid { cells } => cells.iter().filter(|count| **count > 0).count(),
            Topology::Uniform { cell_type, .. } => cell_type.dimension(),
            Topology::Types(types) => {
                let dimensions = types.topologies.iter().map(Topology::dimension);
                dimensions.collect::<Result<Vec<_>, _>>()?.into_iter().max().unwrap_or(0)
            }
            Topology::Polygonal(_) => 2,
            Topology::Polyhedral { .. } => 3,
            Topology::Mixed { shapes, map, label, .. } => {
                memory::check(shapes, || label.clone())?;
                let mut highest = 0;
                // The types that would still raise it: each is met once.
                let mut higher: Vec<(i64, usize)> = Vec::new();
                for (number, of) in map {
                    if !higher.iter().any(|(known, _)| known == number) {
                        higher.push((*number, of.dimension()));
                    }
                }
                higher.retain(|(_, dimension)| *dimension > highest);
                for cell in 0..shapes.len() {
                    if higher.is_empty() {
                        break;
                    }
                    let number = shapes.integer(cell);
                    let met = higher.iter().find(|(known, _)| Some(*known) == number);
                    if let Some(&(_, dimension)) = met {
                        highest = dimension;
                        higher.retain(|(_, dimension)| *dimension > highest);
                    }
                }
                highest
            }
        })
    }

    /// The cells as they lie in the solver's memory, where they can be lent.
    pub(super) fn lent(&self) -> Option<CellsView<'_>> {
        match self {
            Topology::Uniform { cell_type, connectivity, .. } => Some(CellsView::Uniform {
                cell_type: *cell_type,
                connectivity: connectivity.indices()?,
            }),
            Topology::Types(types) => types.lent.as_deref().map(CellsView::Types),
            Topology::Mixed { cells, shapes, map, faces: None, .. } if is_of_vtk(cells, map) => {
                let (offsets, connectivity) = cells.lent()?;
                Some(CellsView::Mixed { types: shapes.bytes()?, offsets, connectivity })
            }
            _ => None,
        }
    }

    /// Adds the cells that `keep` keeps to a copy, their vertices counted from `base` on.
    pub(super) fn append(
        &self,
        cells: &mut Cells,
        base: usize,
        points: &[Vector],
        keep: &dyn Fn(usize) -> bool,
    ) -> Result<(), RunError> {
        let vertices = points.len().saturating_sub(base);
        let shift = number(base);
        let shifted =
            |row: &[u32]| -> Vec<u32> { row.iter().map(|vertex| vertex + shift).collect() };
        let mut push = |label: &Label, cell: usize, cell_type: CellType, row: &[u32]| {
            cells.push(cell_type, row).map_err(|error| {
                let found = format_args!("cell {cell}: {error}");
                label.wrong(found, "as many vertices as the shape has")
            })
        };
        match self {
            Topology::Points(count) => {
                let unnamed = Label::Words("points".into());
                for cell in (0..*count).filter(|cell| keep(*cell)) {
                    push(&unnamed, cell, CellType::Vertex, &[shift + number(cell)])?;
                }
            }
            Topology::Grid { cells: counts } => {
                let unnamed = Label::Words("grid".into());
                for cell in (0..self.cell_count()).filter(|cell| keep(*cell)) {
                    let (cell_type, row) = grid_cell(*counts, cell);
                    push(&unnamed, cell, cell_type, &shifted(&row))?;
                }
            }
            Topology::Uniform { cell_type, connectivity, label } => {
                let size = cell_type.vertex_count().unwrap_or(1);
                let mut row = Vec::with_capacity(size);
                for cell in (0..self.cell_count()).filter(|cell| keep(*cell)) {
                    row.clear();
                    for index in cell * size..(cell + 1) * size {
                        let label = || label.clone();
                        row.push(shift + vertex(connectivity, &label, index, cell, vertices)?);
                    }
                    push(label, cell, *cell_type, &row)?;
                }
            }
            Topology::Types(types) => {
                let mut first = 0;
                for of_type in &types.topologies {
                    of_type.append(cells, base, points, &|cell| keep(first + cell))?;
                    first += of_type.cell_count();
                }
            }
            Topology::Polygonal(rows) => rows.for_each_of_vertices(vertices, |cell, row| {
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
            Topology::Mixed { cells: rows, shapes, map, faces, label, expected } => {
                let faces =
                    faces.as_ref().map_or(Ok(Vec::new()), |faces| all_faces(faces, vertices))?;
                let keeps_polygons = is_of_vtk(rows, map);
                rows.for_each(u32::MAX as usize, |cell, row| {
                    if !keep(cell) {
                        return Ok(());
                    }
                    let number = shapes.integer(cell);
                    let found = map.iter().find(|(known, _)| Some(*known) == number);
                    let Some((_, cell_type)) = found else {
                        let found = format!("{} at entry {cell}", shapes.get(cell));
                        return Err(label.wrong(found, expected));
                    };
                    let beyond = row.iter().find(|vertex| **vertex as usize >= vertices);
                    if let Some(&vertex) = beyond.filter(|_| *cell_type != CellType::Polyhedron) {
                        return Err(rows.no_such_vertex(cell, vertex, vertices));
                    }
                    let pushed = match cell_type {
                        CellType::Polyhedron => push_polyhedron(cells, &faces, row, shift, points),
                        CellType::Polygon if !keeps_polygons => push_polygon(cells, &shifted(row)),
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
        into.add(self.cell_count() as u64);
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
            Topology::Types(types) => {
                types.topologies.iter().for_each(|of_type| of_type.fingerprint(into));
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
            Topology::Types(types) => types.topologies.iter().flat_map(Topology::arrays).collect(),
            Topology::Polygonal(rows) => rows.arrays().collect(),
            Topology::Polyhedral { cells, faces } => cells.arrays().chain(faces.arrays()).collect(),
            Topology::Mixed { cells, shapes, faces, .. } => {
                cells.arrays().chain([shapes]).chain(faces.iter().flat_map(Rows::arrays)).collect()
            }
        }
    }
}

/// Whether cells are described as VTK does it, and the kernel: those that can be lent are then the
/// cells that they are when they are copied.
fn is_of_vtk(cells: &Rows<'_>, map: &[(i64, CellType)]) -> bool {
    let is_of_vtk = |(number, cell_type): &(i64, CellType)| {
        *number == i64::from(cell_type.vtk()) && *cell_type != CellType::Polyhedron
    };
    cells.has_offsets() && map.iter().all(is_of_vtk)
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

fn all_faces(rows: &Rows, vertices: usize) -> Result<Vec<Vec<u32>>, RunError> {
    let mut faces = Vec::with_capacity(rows.count());
    rows.for_each_of_vertices(vertices, |_, row| {
        faces.push(row.to_vec());
        Ok(())
    })?;
    Ok(faces)
}

/// The type and the vertices of a grid's cell, i fastest. Axes along which there is no cell do not
/// count.
fn grid_cell(counts: [usize; 3], cell: usize) -> (CellType, Vec<u32>) {
    let at = index_in_grid(counts, cell);
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
    (cell_type, corners.into_iter().map(|corner| number(first + corner)).collect())
}

/// Where a cell of a grid lies along each axis, i fastest.
pub(super) fn index_in_grid(counts: [usize; 3], cell: usize) -> [usize; 3] {
    let [i, j, _] = counts.map(|count| count.max(1));
    [cell % i, cell / i % j, cell / (i * j)]
}

/// The number of a vertex.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the number of points was held against u32::MAX"
)]
fn number(vertex: usize) -> u32 {
    vertex as u32
}
