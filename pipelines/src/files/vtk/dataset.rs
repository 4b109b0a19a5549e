//! From the arrays of a VTK file to a mesh.

use std::collections::{BTreeMap, HashMap};
#[cfg(feature = "vtkio")]
use std::sync::Arc;

use tombolo_deform::mesh::{CellType, Cells, MeshError, Vector, ghosts};

use super::super::MeshFile;
use super::super::assemble::FileContents;
use super::super::error::{Flaw, Problem};
use super::array::{Array, Numbers};
use super::names::decoded;
use super::{FACE_DIMENSION, FEATURE_NAMES, FEATURE_NUMBERS, FEATURES};
#[cfg(feature = "vtkio")]
use crate::extract::Extract;
use crate::extract::{Association, Field};

/// Components that a field may have.
const MOST_COMPONENTS: usize = 9;

/// An unstructured grid or polygonal data as a file has it.
#[derive(Default)]
pub(super) struct Dataset {
    pub points: Vec<Vector>,
    pub cells: Cells,
    pub point_arrays: Vec<Array>,
    pub cell_arrays: Vec<Array>,
    pub field_arrays: Vec<Array>,
    pub notes: Vec<String>,
}

impl Dataset {
    pub fn into_mesh_file(mut self) -> Result<MeshFile, Flaw> {
        self.check_lengths()?;
        let left_out = self.ghost_cells()?;
        let has_faces = self.cells.types().iter().any(|cell| cell.dimension() == 2);
        let mut cell_tags = None;
        if has_faces && let Some(array) = take(&mut self.cell_arrays, FEATURES) {
            let tags = array.integers()?.into_iter().map(|tag| (tag >= 0).then_some(tag)).collect();
            cell_tags = Some(tags);
        }
        let point_tags = match take(&mut self.point_arrays, FEATURES) {
            Some(array) => Some(array.integers()?),
            None => None,
        };
        let has_tags = cell_tags.is_some() || point_tags.is_some();
        let names = if has_tags { self.feature_names()? } else { BTreeMap::new() };
        let fields = self.take_fields();
        FileContents {
            points: self.points,
            cells: self.cells,
            cell_tags,
            point_tags,
            names,
            left_out,
            fields,
            notes: self.notes,
        }
        .assemble()
    }

    /// Every point and cell with its arrays. The features stay an array of that name.
    #[cfg(feature = "vtkio")]
    pub fn into_extract(mut self) -> Result<Extract, Flaw> {
        self.check_lengths()?;
        self.cells.validate(self.points.len()).map_err(Problem::from)?;
        let fields = self.take_fields();
        Ok(Extract {
            points: self.points,
            vertices: None,
            cells: Arc::new(self.cells),
            features: None,
            fields,
        })
    }

    fn check_lengths(&self) -> Result<(), Problem> {
        for (arrays, count, what) in [
            (&self.point_arrays, self.points.len(), "points"),
            (&self.cell_arrays, self.cells.len(), "cells"),
        ] {
            for array in arrays {
                let expected = array.components.saturating_mul(count);
                let what = format!("values of array '{}' on {count} {what}", array.name);
                Problem::check_count(what, array.numbers.len(), expected)?;
            }
        }
        Ok(())
    }

    /// Takes the arrays of numbers as fields; a note tells what is left out.
    fn take_fields(&mut self) -> Vec<Field> {
        let mut fields = Vec::new();
        for (arrays, association) in [
            (std::mem::take(&mut self.point_arrays), Association::Vertex),
            (std::mem::take(&mut self.cell_arrays), Association::Element),
            (std::mem::take(&mut self.field_arrays), Association::Mesh),
        ] {
            for array in arrays {
                let (name, components, number) =
                    (array.name.clone(), array.components, array.number);
                if components == 0 || components > MOST_COMPONENTS {
                    self.notes.push(format!("left out: array '{name}' of {components} components"));
                } else if let Some(values) = array.into_floats() {
                    fields.push(Field { name, association, components, number, values });
                } else {
                    self.notes.push(format!("left out: array '{name}' of text"));
                }
            }
        }
        fields
    }

    fn ghost_cells(&mut self) -> Result<Option<Vec<bool>>, Problem> {
        take(&mut self.point_arrays, "vtkGhostType");
        take(&mut self.point_arrays, "vtkGhostLevels");
        if let Some(array) = take(&mut self.cell_arrays, "vtkGhostType") {
            return Ok(Some(
                array
                    .integers()?
                    .into_iter()
                    .map(|bits| !ghosts::is_own(ghosts::of_integer(bits)))
                    .collect(),
            ));
        }
        match take(&mut self.cell_arrays, "vtkGhostLevels") {
            Some(array) => Ok(Some(array.integers()?.into_iter().map(|level| level > 0).collect())),
            None => Ok(None),
        }
    }

    fn feature_names(&mut self) -> Result<BTreeMap<i64, String>, Problem> {
        let Some(names) = take(&mut self.field_arrays, FEATURE_NAMES) else {
            let mut names = BTreeMap::new();
            self.field_arrays.retain(|array| {
                let found: Vec<_> = named_features(array).collect();
                let is_field = found.is_empty();
                names.extend(found);
                is_field
            });
            return Ok(names);
        };
        let Numbers::Text(names) = names.numbers else {
            return Err(Problem::unexpected(
                b"numbers",
                format!("text in array '{FEATURE_NAMES}'"),
            ));
        };
        let numbers: Vec<i64> = match take(&mut self.field_arrays, FEATURE_NUMBERS) {
            Some(numbers) => numbers.integers()?,
            None => (0..).take(names.len()).collect(),
        };
        Problem::check_count(
            format!("values of array '{FEATURE_NUMBERS}'"),
            numbers.len(),
            names.len(),
        )?;
        Ok(numbers.into_iter().zip(names).collect())
    }

    /// Puts another piece of the same file behind this one.
    pub fn append(&mut self, piece: Dataset) -> Result<(), Problem> {
        piece.cells.validate(piece.points.len())?;
        let end = u32::try_from(self.points.len() + piece.points.len()).map_err(|_| {
            Problem::Unsupported {
                what: format!("a mesh of more than {} points", u32::MAX),
                instead: "split it into parts, one for each rank",
            }
        })?;
        let numbers: Vec<u32> = (0..end).skip(self.points.len()).collect();
        let cells = piece.cells.with_vertices(&numbers);
        for (cell, (cell_type, vertices)) in cells.iter().enumerate() {
            match cells.polyhedron_faces(cell) {
                [] => self.cells.push(cell_type, vertices)?,
                faces => self.cells.push_polyhedron(faces)?,
            }
        }
        self.points.extend(piece.points);
        self.notes.extend(piece.notes);
        append_arrays(&mut self.point_arrays, piece.point_arrays, &mut self.notes);
        append_arrays(&mut self.cell_arrays, piece.cell_arrays, &mut self.notes);
        Ok(())
    }
}

fn append_arrays(first: &mut Vec<Array>, second: Vec<Array>, notes: &mut Vec<String>) {
    // Of several of one name the first, and so the last that is put in.
    let others = second.iter().rev().map(|other| ((&*other.name, other.components), other));
    let others: HashMap<(&str, usize), &Array> = others.collect();
    first.retain_mut(|array| {
        let other = others.get(&(&*array.name, array.components));
        match (&mut array.numbers, other.map(|other| &other.numbers)) {
            (Numbers::Float(values), Some(Numbers::Float(more))) => values.extend(more),
            (Numbers::Integer(values), Some(Numbers::Integer(more))) => values.extend(more),
            (Numbers::Text(values), Some(Numbers::Text(more))) => {
                values.extend(more.iter().cloned())
            }
            _ => {
                notes.push(format!(
                    "left out: array '{}', which not every piece has alike",
                    array.name
                ));
                return false;
            }
        }
        true
    });
}

/// The features that a field-data array names by its own name: pairs of a number and the dimension
/// of faces.
fn named_features(array: &Array) -> impl Iterator<Item = (i64, String)> {
    let (pairs, rest) = match &array.numbers {
        Numbers::Integer(numbers) => numbers.as_chunks::<2>(),
        Numbers::Float(_) | Numbers::Text(_) => (&[][..], &[][..]),
    };
    let all = rest.is_empty() && pairs.iter().all(|&[_, dimension]| dimension == FACE_DIMENSION);
    pairs.iter().filter(move |_| all).map(|&[number, _]| (number, decoded(&array.name)))
}

fn take(arrays: &mut Vec<Array>, name: &str) -> Option<Array> {
    let index = arrays.iter().position(|array| array.name == name)?;
    Some(arrays.remove(index))
}

/// Points from three coordinates each.
pub(super) fn points(array: Array) -> Result<Vec<Vector>, Problem> {
    let values = array
        .into_floats()
        .ok_or_else(|| Problem::unexpected(b"text", "the coordinates of points"))?;
    Problem::check_count(
        "numbers of point coordinates",
        values.len(),
        values.len().next_multiple_of(3),
    )?;
    Ok(values.as_chunks().0.to_vec())
}

/// Appends a cell of a VTK type number, its vertices as signed numbers.
pub(super) fn push_cell(cells: &mut Cells, number: i64, vertices: &[i64]) -> Result<(), Problem> {
    let cell = cells.len();
    let cell_type = u8::try_from(number).ok().and_then(CellType::from_vtk).ok_or_else(|| {
        let what = match higher_order_name(number) {
            Some(name) => format!("cell {cell} of VTK type {number}, a {name},"),
            None => format!("cell {cell} of VTK type {number}"),
        };
        Problem::Unsupported {
            what,
            instead: "write the mesh with linear cells, VTK types 1 to 16 and 42",
        }
    })?;
    let row: Result<Vec<u32>, Problem> =
        vertices.iter().map(|&vertex| vertex_number(cell, vertex)).collect();
    Ok(cells.push(cell_type, &row?)?)
}

/// Appends a polyhedron from a stream of numbers: how many faces, then for each how many vertices
/// and which.
pub(super) fn push_polyhedron(cells: &mut Cells, stream: &[i64]) -> Result<(), Problem> {
    let cell = cells.len();
    let mut rest = stream;
    let mut next = |what: &str| -> Result<i64, Problem> {
        let (&first, tail) = rest
            .split_first()
            .ok_or_else(|| Problem::unexpected(b"", format!("{what} of polyhedron {cell}")))?;
        rest = tail;
        Ok(first)
    };
    let mut faces = Vec::new();
    for _ in 0..next("the number of faces")? {
        let mut face = Vec::new();
        for _ in 0..next("the number of vertices of a face")? {
            face.push(vertex_number(cell, next("a vertex of a face")?)?);
        }
        faces.push(face);
    }
    let what = format!("numbers for the faces of polyhedron {cell}");
    Problem::check_count(what, stream.len(), stream.len() - rest.len())?;
    Ok(cells.push_polyhedron(&faces)?)
}

fn vertex_number(cell: usize, vertex: i64) -> Result<u32, Problem> {
    u32::try_from(vertex).map_err(|_| {
        let vertex = u64::try_from(vertex).unwrap_or(u64::MAX);
        MeshError::VertexNumber { cell, vertex, vertex_count: u32::MAX as usize }.into()
    })
}

/// A row of a connectivity, by where it starts and ends.
pub(super) fn row(
    connectivity: &[i64],
    cell: usize,
    start: i64,
    end: i64,
) -> Result<&[i64], Problem> {
    let range = usize::try_from(start).ok().zip(usize::try_from(end).ok());
    range.and_then(|(start, end)| connectivity.get(start..end)).ok_or_else(|| {
        let unsigned = |number: i64| u64::try_from(number).unwrap_or(u64::MAX);
        let length = connectivity.len();
        MeshError::Offsets { cell, start: unsigned(start), end: unsigned(end), length }.into()
    })
}

fn higher_order_name(number: i64) -> Option<&'static str> {
    Some(match number {
        21 => "quadratic edge",
        22 | 34 => "quadratic triangle",
        23 | 28 | 30 => "quadratic quad",
        24 => "quadratic tetra",
        25 | 29 | 33 => "quadratic hexahedron",
        26 | 31 | 32 => "quadratic wedge",
        27 | 37 => "quadratic pyramid",
        35 => "cubic line",
        36 => "quadratic polygon",
        41 => "convex point set",
        60..=67 => "higher-order cell",
        68..=74 => "Lagrange cell",
        75..=81 => "Bezier cell",
        _ => return None,
    })
}
