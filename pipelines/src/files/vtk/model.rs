//! Grids in vtkio's model and back, and legacy files, which vtkio writes.

use std::path::Path;

use tombolo_deform::mesh::{CellType, Cells, NumberType};
use vtkio::model as vtk;

use super::super::MeshFile;
use super::super::error::{FileError, Flaw, Problem};
use super::array::{Array, Numbers};
use super::dataset::{Dataset, points, push_cell, push_polyhedron, row};
use super::kind::Kind;
use super::names::encoded_for_legacy;
use super::write::Grid;
use super::xml_file::{self, Values};
use crate::extract::Extract;

impl Grid<'_> {
    /// The grid as an unstructured grid of vtkio's. What belongs to the mesh as a whole, the names
    /// of features among it, has no place there.
    pub(super) fn to_vtkio(&self) -> Result<vtk::Vtk, Problem> {
        let piece = vtk::UnstructuredGridPiece {
            points: self.points.as_flattened().to_vec().into(),
            cells: cells_of(&self.cells)?,
            data: vtk::Attributes {
                point: self.point_arrays.iter().map(attribute).collect::<Result<_, _>>()?,
                cell: self.cell_arrays.iter().map(attribute).collect::<Result<_, _>>()?,
            },
        };
        Ok(vtk::Vtk {
            version: vtk::Version::new_legacy(4, 2),
            title: "tombolo".into(),
            byte_order: vtk::ByteOrder::BigEndian,
            file_path: None,
            data: vtk::DataSet::inline(piece),
        })
    }

    /// The bytes of a binary legacy file.
    pub(super) fn to_legacy(&self) -> Result<Vec<u8>, Problem> {
        let mut file = self.to_vtkio()?;
        if let vtk::DataSet::UnstructuredGrid { pieces, .. } = &mut file.data {
            for piece in pieces {
                if let vtk::Piece::Inline(piece) = piece {
                    // VTK reads the first of several SCALARS alone, but every array of a FIELD.
                    piece.data.point = as_one_field(std::mem::take(&mut piece.data.point));
                    piece.data.cell = as_one_field(std::mem::take(&mut piece.data.cell));
                }
            }
        }
        let of_mesh = self.field_data()?;
        let bytes = legacy_bytes(file.clone())?;
        if of_mesh.is_empty() {
            return Ok(bytes);
        }
        // vtkio's grids have no field data; the format has them behind the line of the grid's kind.
        file.data = vtk::DataSet::Field { name: "FieldData".into(), data_array: of_mesh };
        let fields = legacy_bytes(file)?;
        let (head, grid) = bytes.split_at(end_of_line(&bytes, b"DATASET"));
        Ok([head, &fields[start_of(&fields, b"FIELD")..], b"\n", grid].concat())
    }

    fn field_data(&self) -> Result<Vec<vtk::FieldArray>, Problem> {
        let mut arrays: Vec<vtk::FieldArray> = Vec::new();
        for array in &self.field_arrays {
            arrays.push(field_array(&encoded_for_legacy(array.name), array)?);
        }
        for (name, numbers) in self.names_by_text() {
            let array =
                xml_file::Array { name: &name, components: 1, values: Values::Integers(numbers) };
            arrays.push(field_array(&encoded_for_legacy(&name), &array)?);
        }
        Ok(arrays)
    }
}

fn legacy_bytes(file: vtk::Vtk) -> Result<Vec<u8>, Problem> {
    let mut bytes = Vec::new();
    file.write_legacy(&mut bytes).map_err(|error| std::io::Error::other(error.to_string()))?;
    Ok(bytes)
}

/// Where a word of the file's head first stands; its end where there is none.
fn start_of(bytes: &[u8], word: &[u8]) -> usize {
    bytes.windows(word.len()).position(|window| window == word).unwrap_or(bytes.len())
}

/// Where the line behind that with the word begins.
fn end_of_line(bytes: &[u8], word: &[u8]) -> usize {
    let start = start_of(bytes, word);
    let rest = bytes[start..].iter().position(|&byte| byte == b'\n');
    rest.map_or(bytes.len(), |end| start + end + 1)
}

fn as_one_field(attributes: Vec<vtk::Attribute>) -> Vec<vtk::Attribute> {
    let arrays: Vec<vtk::FieldArray> = attributes
        .into_iter()
        .filter_map(|attribute| match attribute {
            vtk::Attribute::DataArray(array) => Some(vtk::FieldArray {
                name: encoded_for_legacy(&array.name),
                elem: array.elem.num_comp(),
                data: array.data,
            }),
            vtk::Attribute::Field { .. } => None,
        })
        .collect();
    match arrays.is_empty() {
        true => Vec::new(),
        false => vec![vtk::Attribute::Field { name: "FieldData".into(), data_array: arrays }],
    }
}

fn attribute(array: &xml_file::Array) -> Result<vtk::Attribute, Problem> {
    let field = field_array(array.name, array)?;
    let elem = vtk::ElementType::Generic(field.elem);
    Ok(vtk::Attribute::DataArray(vtk::DataArray { name: field.name, elem, data: field.data }))
}

fn field_array(name: &str, array: &xml_file::Array) -> Result<vtk::FieldArray, Problem> {
    let elem = u32::try_from(array.components).map_err(|_| too_many("components of an array"))?;
    let data = match &array.values {
        Values::Numbers(values, number) => buffer(values, *number),
        Values::Integers(values) => values.clone().into(),
        Values::Bytes(values) => values.clone().into(),
    };
    Ok(vtk::FieldArray { name: name.to_owned(), elem, data })
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the values are of the type that they are cast to"
)]
fn buffer(values: &[f64], number: NumberType) -> vtk::IOBuffer {
    fn all<T>(values: &[f64], number: impl Fn(f64) -> T) -> Vec<T> {
        values.iter().map(|&value| number(value)).collect()
    }
    match number {
        NumberType::I8 => all(values, |value| value as i8).into(),
        NumberType::I16 => all(values, |value| value as i16).into(),
        NumberType::I32 => all(values, |value| value as i32).into(),
        NumberType::I64 => all(values, |value| value as i64).into(),
        NumberType::U8 => all(values, |value| value as u8).into(),
        NumberType::U16 => all(values, |value| value as u16).into(),
        NumberType::U32 => all(values, |value| value as u32).into(),
        NumberType::U64 => all(values, |value| value as u64).into(),
        NumberType::F32 => all(values, |value| value as f32).into(),
        NumberType::F64 => values.to_vec().into(),
    }
}

/// The cells; where there are polyhedra as legacy files have them, because the other form has no
/// faces.
fn cells_of(cells: &Cells) -> Result<vtk::Cells, Problem> {
    let types: Result<Vec<vtk::CellType>, Problem> =
        cells.types().iter().map(|&cell_type| vtkio_type(cell_type)).collect();
    let cell_verts = if cells.types().contains(&CellType::Polyhedron) {
        let mut vertices = Vec::new();
        for (cell, (_, row)) in cells.iter().enumerate() {
            match cells.polyhedron_faces(cell) {
                [] => push_row(&mut vertices, row)?,
                faces => {
                    let mut stream = vec![count(faces.len())?];
                    for face in faces {
                        push_row(&mut stream, face)?;
                    }
                    push_row(&mut vertices, &stream)?;
                }
            }
        }
        vtk::VertexNumbers::Legacy { num_cells: count(cells.len())?, vertices }
    } else {
        vtk::VertexNumbers::XML {
            connectivity: cells.connectivity().iter().map(|&vertex| u64::from(vertex)).collect(),
            offsets: cells.offsets().skip(1).map(|offset| offset as u64).collect(),
        }
    };
    Ok(vtk::Cells { cell_verts, types: types? })
}

fn push_row(numbers: &mut Vec<u32>, row: &[u32]) -> Result<(), Problem> {
    numbers.push(count(row.len())?);
    numbers.extend(row);
    Ok(())
}

fn count(number: usize) -> Result<u32, Problem> {
    u32::try_from(number).map_err(|_| too_many("cells of a legacy file"))
}

fn too_many(what: &str) -> Problem {
    Problem::Unsupported {
        what: format!("more than {} {what}", u32::MAX),
        instead: "write a .vtu file",
    }
}

fn vtkio_type(cell_type: CellType) -> Result<vtk::CellType, Problem> {
    use vtk::CellType as Type;
    let number = cell_type.vtk();
    [
        Type::Vertex,
        Type::PolyVertex,
        Type::Line,
        Type::PolyLine,
        Type::Triangle,
        Type::TriangleStrip,
        Type::Polygon,
        Type::Pixel,
        Type::Quad,
        Type::Tetra,
        Type::Voxel,
        Type::Hexahedron,
        Type::Wedge,
        Type::Pyramid,
        Type::Polyhedron,
    ]
    .into_iter()
    .find(|&known| known as u8 == number)
    .ok_or_else(|| Problem::Unsupported {
        what: format!("a cell of VTK type {number}, which vtkio does not know,"),
        instead: "write a .vtu file",
    })
}

/// The mesh in an unstructured grid or polygonal data of vtkio's, all pieces as one: what
/// [`read_mesh`] makes of a file with the same contents.
///
/// # Errors
/// [`FileError`] for another kind of dataset, for a piece that is a file not loaded yet, and for a
/// mesh that is none. It names the file by its path, or by the title where it has none.
///
/// [`read_mesh`]: super::super::read_mesh
pub fn mesh_from_vtkio(file: &vtk::Vtk) -> Result<MeshFile, FileError> {
    dataset_of(&file.data)
        .map_err(Flaw::from)
        .and_then(Dataset::into_mesh_file)
        .map_err(|flaw| flaw.in_file(name_of(file)))
}

/// An unstructured grid or polygonal data of vtkio's as an extract: every point, every cell of any
/// dimension, and every array of numbers as a field.
///
/// # Errors
/// As [`mesh_from_vtkio`].
pub fn extract_from_vtkio(file: &vtk::Vtk) -> Result<Extract, FileError> {
    dataset_of(&file.data)
        .map_err(Flaw::from)
        .and_then(Dataset::into_extract)
        .map_err(|flaw| flaw.in_file(name_of(file)))
}

fn name_of(file: &vtk::Vtk) -> &Path {
    file.file_path.as_deref().unwrap_or(Path::new(&file.title))
}

fn dataset_of(data: &vtk::DataSet) -> Result<Dataset, Problem> {
    let mut all: Option<Dataset> = None;
    let mut append = |piece: Dataset| match &mut all {
        Some(all) => all.append(piece),
        None => {
            all = Some(piece);
            Ok(())
        }
    };
    match data {
        vtk::DataSet::UnstructuredGrid { pieces, .. } => {
            for piece in pieces {
                match piece {
                    vtk::Piece::Inline(piece) => append(unstructured(piece)?)?,
                    vtk::Piece::Loaded(data) => append(dataset_of(data)?)?,
                    vtk::Piece::Source(name, _) => return Err(not_loaded(name)),
                }
            }
        }
        vtk::DataSet::PolyData { pieces, .. } => {
            for piece in pieces {
                match piece {
                    vtk::Piece::Inline(piece) => append(polygonal(piece)?)?,
                    vtk::Piece::Loaded(data) => append(dataset_of(data)?)?,
                    vtk::Piece::Source(name, _) => return Err(not_loaded(name)),
                }
            }
        }
        _ => {
            return Err(Problem::wrong(
                "another kind of dataset",
                "an unstructured grid or polygonal data",
            ));
        }
    }
    Ok(all.unwrap_or_default())
}

fn not_loaded(name: &str) -> Problem {
    Problem::Unsupported {
        what: format!("the piece '{name}', which is not loaded,"),
        instead: "call Vtk::load_all_pieces first",
    }
}

fn unstructured(piece: &vtk::UnstructuredGridPiece) -> Result<Dataset, Problem> {
    let mut cells = Cells::new();
    let rows = rows(&piece.cells.cell_verts)?;
    Problem::check_count("cells with vertices", rows.len(), piece.cells.types.len())?;
    for (row, cell_type) in rows.iter().zip(&piece.cells.types) {
        match cell_type {
            vtk::CellType::Polyhedron => push_polyhedron(&mut cells, row)?,
            _ => push_cell(&mut cells, i64::from(*cell_type as u8), row)?,
        }
    }
    with_arrays(&piece.points, cells, &piece.data)
}

fn polygonal(piece: &vtk::PolyDataPiece) -> Result<Dataset, Problem> {
    let mut cells = Cells::new();
    let sections = [
        (Kind::Vertices, &piece.verts),
        (Kind::Lines, &piece.lines),
        (Kind::Polygons, &piece.polys),
        (Kind::Strips, &piece.strips),
    ];
    for (kind, section) in sections {
        for row in section.as_ref().map(rows).transpose()?.unwrap_or_default() {
            push_cell(&mut cells, kind.cell_type(row.len()), &row)?;
        }
    }
    with_arrays(&piece.points, cells, &piece.data)
}

fn with_arrays(
    coordinates: &vtk::IOBuffer,
    cells: Cells,
    data: &vtk::Attributes,
) -> Result<Dataset, Problem> {
    let points = points(array("points", 3, coordinates)?)?;
    cells.validate(points.len())?;
    Ok(Dataset {
        points,
        cells,
        point_arrays: arrays(&data.point)?,
        cell_arrays: arrays(&data.cell)?,
        ..Dataset::default()
    })
}

/// The vertices of each cell, or the numbers of each polyhedron's faces.
fn rows(numbers: &vtk::VertexNumbers) -> Result<Vec<Vec<i64>>, Problem> {
    let mut rows = Vec::new();
    match numbers {
        vtk::VertexNumbers::Legacy { num_cells, vertices } => {
            let mut rest = vertices.as_slice();
            while let Some((&count, tail)) = rest.split_first() {
                let (vertices, behind) = tail
                    .split_at_checked(count as usize)
                    .ok_or_else(|| short(rows.len(), count as usize, tail.len()))?;
                rows.push(vertices.iter().map(|&vertex| i64::from(vertex)).collect());
                rest = behind;
            }
            Problem::check_count("cells with vertices", rows.len(), *num_cells as usize)?;
        }
        vtk::VertexNumbers::XML { connectivity, offsets } => {
            let connectivity: Vec<i64> =
                connectivity.iter().map(|&number| signed(number)).collect();
            let mut start = 0;
            for (cell, &end) in offsets.iter().enumerate() {
                let end = signed(end);
                rows.push(row(&connectivity, cell, start, end)?.to_vec());
                start = end;
            }
        }
    }
    Ok(rows)
}

fn short(cell: usize, expected: usize, found: usize) -> Problem {
    Problem::Count {
        what: format!("vertices of cell {cell}"),
        found: found as u64,
        expected: expected as u64,
    }
}

/// The number, or one that no vertex and no row has.
fn signed(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}

fn arrays(attributes: &[vtk::Attribute]) -> Result<Vec<Array>, Problem> {
    let mut arrays = Vec::new();
    for attribute in attributes {
        match attribute {
            // Colours for the values of another array belong to no point or cell.
            vtk::Attribute::DataArray(vtk::DataArray {
                elem: vtk::ElementType::LookupTable,
                ..
            }) => {}
            vtk::Attribute::DataArray(data) => {
                arrays.push(array(&data.name, data.elem.num_comp(), &data.data)?);
            }
            vtk::Attribute::Field { data_array, .. } => {
                for data in data_array {
                    arrays.push(array(&data.name, data.elem, &data.data)?);
                }
            }
        }
    }
    Ok(arrays)
}

fn array(name: &str, components: u32, data: &vtk::IOBuffer) -> Result<Array, Problem> {
    fn all<T: Copy, N: From<T>>(values: &[T]) -> Vec<N> {
        values.iter().map(|&value| N::from(value)).collect()
    }
    use vtk::IOBuffer;
    let (number, numbers) = match data {
        IOBuffer::Bit(values) | IOBuffer::U8(values) => {
            (NumberType::U8, Numbers::Integer(all(values)))
        }
        IOBuffer::I8(values) => (NumberType::I8, Numbers::Integer(all(values))),
        IOBuffer::U16(values) => (NumberType::U16, Numbers::Integer(all(values))),
        IOBuffer::I16(values) => (NumberType::I16, Numbers::Integer(all(values))),
        IOBuffer::U32(values) => (NumberType::U32, Numbers::Integer(all(values))),
        IOBuffer::I32(values) => (NumberType::I32, Numbers::Integer(all(values))),
        IOBuffer::I64(values) => (NumberType::I64, Numbers::Integer(values.clone())),
        IOBuffer::U64(values) => {
            let whole = |&value: &u64| {
                i64::try_from(value).map_err(|_| {
                    let expected = format!("a number up to {} in array '{name}'", i64::MAX);
                    Problem::unexpected(value.to_string().as_bytes(), expected)
                })
            };
            let values: Result<_, _> = values.iter().map(whole).collect();
            (NumberType::U64, Numbers::Integer(values?))
        }
        IOBuffer::F32(values) => (NumberType::F32, Numbers::Float(all(values))),
        IOBuffer::F64(values) => (NumberType::F64, Numbers::Float(values.clone())),
    };
    Ok(Array { name: name.to_owned(), components: components as usize, number, numbers })
}
