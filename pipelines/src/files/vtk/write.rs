//! Writes .vtu and .vtp (appended raw data, little endian, 64-bit headers) and .vtk, every number
//! as it is.

use std::borrow::Cow;
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};

use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh, NumberType, TaggedFaces, Vector};

use super::super::assemble::{owners_of_faces, sorted};
use super::super::error::Problem;
use super::kind::Kind;
use super::names::encoded;
use super::xml_file::{Array, Compression, Values, XmlFile};
use super::{FACE_DIMENSION, FEATURES};
use crate::extract::{Association, Extract, Field};

/// The kind of a VTK file and its encoding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) enum Format {
    /// A .vtu file.
    Unstructured,
    /// A .vtp file.
    Polygonal,
    /// A .vtk file.
    Legacy,
}

/// An extract as the bytes of a file.
pub(in super::super) fn from_extract(
    extract: &Extract,
    format: Format,
    compression: Compression,
) -> Result<Vec<u8>, Problem> {
    grid_of_extract(extract)?.write(format, compression)
}

/// A mesh with its fields as the bytes of a file.
pub(in super::super) fn from_mesh(
    mesh: &Mesh,
    fields: &[Field],
    format: Format,
    compression: Compression,
) -> Result<Vec<u8>, Problem> {
    let (mut grid, owners) = grid_of_mesh(mesh, fields)?;
    let fields = with_faces(fields, mesh.cells().len(), &owners)?;
    grid.add_fields(&fields)?;
    grid.write(format, compression)
}

/// An extract in vtkio's model: an unstructured grid in one piece, coordinates in double precision,
/// each field an array of its number type, the features of cells the array `features`.
///
/// Fields of the mesh as a whole and the names of features have no place in that model.
///
/// # Errors
/// [`Problem`] for fields whose length is not that of the extract, for two of one name, and for
/// cells that vtkio has no type for. Polyhedra are there as in a legacy file: vtkio writes them to
/// `.vtk`, not to `.vtu`.
#[cfg(feature = "vtkio")]
pub fn extract_to_vtkio(extract: &Extract) -> Result<vtkio::Vtk, Problem> {
    grid_of_extract(extract)?.to_vtkio()
}

/// A mesh with its fields in vtkio's model. Tagged faces stand as cells behind the mesh's own, which
/// the array `features` tells apart: -1 for a cell, or the number of a face's feature.
///
/// # Errors
/// As [`extract_to_vtkio`].
///
/// ```
/// use tombolo_deform::shapes::box_of_tets;
/// use tombolo_pipelines::files::{mesh_from_vtkio, mesh_to_vtkio};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
/// let file = mesh_to_vtkio(&mesh, &[])?;
/// assert_eq!(mesh_from_vtkio(&file)?.mesh.cells(), mesh.cells());
/// # Ok(())
/// # }
/// ```
#[cfg(feature = "vtkio")]
pub fn mesh_to_vtkio(mesh: &Mesh, fields: &[Field]) -> Result<vtkio::Vtk, Problem> {
    let (mut grid, owners) = grid_of_mesh(mesh, fields)?;
    let fields = with_faces(fields, mesh.cells().len(), &owners)?;
    grid.add_fields(&fields)?;
    grid.to_vtkio()
}

fn grid_of_extract(extract: &Extract) -> Result<Grid<'_>, Problem> {
    let mut grid = Grid::new(&extract.points, Cow::Borrowed(&extract.cells));
    if let Some(features) = &extract.features {
        check_length(FEATURES, features.of_cells.len(), grid.cells.len())?;
        let numbers = features.of_cells.iter().map(|&feature| i64::from(feature)).collect();
        grid.cell_arrays.push(Array {
            name: FEATURES,
            components: 1,
            values: Values::Integers(numbers),
        });
        grid.names = (0..).zip(features.names.iter().cloned()).collect();
    }
    grid.add_fields(&extract.fields)?;
    Ok(grid)
}

/// A mesh, its tagged faces as cells behind the mesh's own, and the cell that each of those belongs
/// to where a field asks for it. The fields are not added.
fn grid_of_mesh<'a>(
    mesh: &'a Mesh,
    fields: &[Field],
) -> Result<(Grid<'a>, Vec<Option<usize>>), Problem> {
    let mut grid = Grid::new(mesh.points(), mesh.cells().as_given());
    let mut owners = Vec::new();
    match mesh.features() {
        FeatureSource::SharpEdges => {}
        FeatureSource::Vertices(tagged) => {
            grid.names.clone_from(&tagged.names);
            grid.point_arrays.push(Array {
                name: FEATURES,
                components: 1,
                values: Values::Integers(tagged.tags.clone()),
            });
        }
        FeatureSource::Faces(tagged) => {
            let (tags, names) = with_natural_numbers(tagged);
            grid.names = names;
            let mut numbers = vec![-1; mesh.cells().len()];
            if mesh.cells().dimension() == 3 {
                let cells = grid.cells.to_mut();
                for (cell_type, vertices) in tagged.faces.iter() {
                    cells.push(cell_type, vertices)?;
                }
                numbers.extend(tags);
                // Only element fields ask whose a face is.
                if fields.iter().any(|field| field.association == Association::Element) {
                    let by_face = owners_of_faces(mesh.cells());
                    owners.extend(
                        tagged.faces.iter().map(|(_, face)| by_face.get(&sorted(face)).copied()),
                    );
                }
            } else {
                // The faces are the cells themselves; any other face has no place in such a mesh.
                let by_face: HashMap<Vec<u32>, i64> =
                    tagged.faces.iter().map(|(_, face)| sorted(face)).zip(tags).collect();
                for (number, (_, vertices)) in numbers.iter_mut().zip(mesh.cells().iter()) {
                    *number = by_face.get(&sorted(vertices)).copied().unwrap_or(-1);
                }
            }
            grid.cell_arrays.push(Array {
                name: FEATURES,
                components: 1,
                values: Values::Integers(numbers),
            });
        }
    }
    Ok((grid, owners))
}

/// The fields with values for the faces behind the cells.
fn with_faces(
    fields: &[Field],
    cell_count: usize,
    owners: &[Option<usize>],
) -> Result<Vec<Field>, Problem> {
    fields.iter().map(|field| field_with_faces(field, cell_count, owners)).collect()
}

/// The field with values for the faces behind the cells: those of the cell that a face belongs to,
/// NaN where there is none.
fn field_with_faces(
    field: &Field,
    cell_count: usize,
    owners: &[Option<usize>],
) -> Result<Field, Problem> {
    let mut field = field.clone();
    if field.association == Association::Element && !owners.is_empty() {
        let components = field.components;
        check_length(&field.name, field.values.len(), components * cell_count)?;
        for owner in owners {
            for component in 0..components {
                let index = owner.map(|owner| owner * components + component);
                let value =
                    index.and_then(|index| field.values.get(index).copied()).unwrap_or(f64::NAN);
                field.values.push(value);
            }
        }
        // Whole numbers have none that says that there is nothing.
        if !field.number.is_real() && owners.contains(&None) {
            field.number = NumberType::F64;
        }
    }
    Ok(field)
}

/// Tags and names, negative numbers put behind the others: in a file they say that a cell has no
/// feature.
fn with_natural_numbers(tagged: &TaggedFaces) -> (Vec<i64>, Vec<(i64, String)>) {
    let highest = tagged
        .tags
        .iter()
        .chain(tagged.names.iter().map(|(number, _)| number))
        .max()
        .copied()
        .unwrap_or(0);
    let mut natural: HashMap<i64, i64> = HashMap::new();
    let mut names = tagged.names.clone();
    for &tag in tagged.tags.iter().filter(|&&tag| tag < 0) {
        let next = highest.max(-1) + 1 + natural.len() as i64;
        if let Entry::Vacant(entry) = natural.entry(tag) {
            entry.insert(next);
            if tagged.names.iter().all(|(number, _)| *number != tag) {
                names.push((tag, format!("feature-{tag}")));
            }
        }
    }
    let renumber = |tag: i64| natural.get(&tag).copied().unwrap_or(tag);
    let tags = tagged.tags.iter().map(|&tag| renumber(tag)).collect();
    (tags, names.into_iter().map(|(number, name)| (renumber(number), name)).collect())
}

fn check_length(name: &str, found: usize, expected: usize) -> Result<(), Problem> {
    Problem::check_count(format!("values of array '{name}'"), found, expected)
}

/// Refuses cells that polygonal data cannot hold.
pub(in super::super) fn check_polygonal(cells: &Cells) -> Result<(), Problem> {
    if cells.dimension() <= 2 {
        return Ok(());
    }
    Err(Problem::Unsupported {
        what: "a volume cell in polygonal data (.vtp)".into(),
        instead: "write it as .vtu, or take its surface",
    })
}

/// Points and cells with their arrays, as VTK's files hold them.
pub(super) struct Grid<'a> {
    pub points: &'a [Vector],
    pub cells: Cow<'a, Cells>,
    pub point_arrays: Vec<Array<'a>>,
    pub cell_arrays: Vec<Array<'a>>,
    pub field_arrays: Vec<Array<'a>>,
    names: Vec<(i64, String)>,
}

impl<'a> Grid<'a> {
    fn new(points: &'a [Vector], cells: Cow<'a, Cells>) -> Self {
        Self {
            points,
            cells,
            point_arrays: Vec::new(),
            cell_arrays: Vec::new(),
            field_arrays: Vec::new(),
            names: Vec::new(),
        }
    }

    fn add_fields(&mut self, fields: &'a [Field]) -> Result<(), Problem> {
        for field in fields {
            let tuples = field.values.len() / field.components.max(1);
            let (arrays, count) = match field.association {
                Association::Vertex => (&mut self.point_arrays, self.points.len()),
                Association::Element => (&mut self.cell_arrays, self.cells.len()),
                Association::Mesh => (&mut self.field_arrays, tuples),
            };
            check_length(&field.name, field.values.len(), field.components.saturating_mul(count))?;
            if arrays.iter().any(|array| array.name == field.name) {
                return Err(Problem::Unsupported {
                    what: format!("a second {} array named '{}'", field.association, field.name),
                    instead: "give each array a name of its own; 'features' holds the mesh's features",
                });
            }
            let values = Values::Numbers(Cow::Borrowed(&field.values), field.number);
            arrays.push(Array { name: &field.name, components: field.components, values });
        }
        Ok(())
    }

    fn write(self, format: Format, compression: Compression) -> Result<Vec<u8>, Problem> {
        match format {
            Format::Unstructured => self.write_xml(false, compression),
            Format::Polygonal => {
                check_polygonal(&self.cells)?;
                self.write_xml(true, compression)
            }
            Format::Legacy => self.write_legacy(),
        }
    }

    #[cfg(feature = "vtkio")]
    fn write_legacy(&self) -> Result<Vec<u8>, Problem> {
        self.to_legacy()
    }

    #[cfg(not(feature = "vtkio"))]
    fn write_legacy(&self) -> Result<Vec<u8>, Problem> {
        Err(Problem::Unsupported {
            what: "a legacy file (.vtk)".into(),
            instead: "build with the feature `vtkio`, or write a .vtu file",
        })
    }

    fn write_xml(mut self, polygonal: bool, compression: Compression) -> Result<Vec<u8>, Problem> {
        let mut file = XmlFile::new(compression);
        let kind = if polygonal { "PolyData" } else { "UnstructuredGrid" };
        let compressor = match compression {
            Compression::None => "",
            Compression::Zlib => " compressor=\"vtkZLibDataCompressor\"",
        };
        file.line(format_args!("<?xml version=\"1.0\"?>"));
        file.line(format_args!(
            "<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\"{compressor}>"
        ));
        file.line(format_args!("<{kind}>"));
        self.write_field_data(&mut file)?;
        let sections = if polygonal { sections(&self.cells) } else { Vec::new() };
        let count =
            |(name, cells): &(&str, Vec<usize>)| format!(" NumberOf{name}=\"{}\"", cells.len());
        let counts = match polygonal {
            true => sections.iter().map(count).collect(),
            false => format!(" NumberOfCells=\"{}\"", self.cells.len()),
        };
        file.line(format_args!("<Piece NumberOfPoints=\"{}\"{counts}>", self.points.len()));
        file.section("PointData", &self.point_arrays)?;
        if polygonal {
            let order: Vec<usize> = sections.iter().flat_map(|(_, cells)| cells).copied().collect();
            self.cell_arrays.iter_mut().for_each(|array| array.permute(&order));
        }
        file.section("CellData", &self.cell_arrays)?;
        let points = Values::Numbers(Cow::Borrowed(self.points.as_flattened()), NumberType::F64);
        file.section("Points", &[Array { name: "Points", components: 3, values: points }])?;
        if polygonal {
            for (name, cells) in &sections {
                file.section(name, &polygonal_rows(&self.cells, cells))?;
            }
        } else {
            file.section("Cells", &unstructured_rows(&self.cells))?;
        }
        file.line(format_args!("</Piece>"));
        file.line(format_args!("</{kind}>"));
        Ok(file.finish())
    }

    fn write_field_data(&self, file: &mut XmlFile) -> Result<(), Problem> {
        let names = self.names_by_text();
        if names.is_empty() && self.field_arrays.is_empty() {
            return Ok(());
        }
        file.line(format_args!("<FieldData>"));
        for array in &self.field_arrays {
            file.array(array, Some(array.tuples()))?;
        }
        for (name, numbers) in names {
            let count = numbers.len();
            file.array(
                &Array { name: &name, components: 1, values: Values::Integers(numbers) },
                Some(count),
            )?;
        }
        file.line(format_args!("</FieldData>"));
        Ok(())
    }

    /// For each name an array that is called so, of the feature's number and the dimension of its
    /// faces: what meshio takes for the name of a physical group. An array of text would be refused
    /// there.
    pub fn names_by_text(&self) -> BTreeMap<String, Vec<i64>> {
        let mut numbers: BTreeMap<String, Vec<i64>> = BTreeMap::new();
        for (number, name) in self.names.iter().filter(|(_, name)| !name.is_empty()) {
            numbers.entry(encoded(name)).or_default().extend([*number, FACE_DIMENSION]);
        }
        numbers
    }
}

/// The cells of polygonal data, by the element of the file that holds them.
fn sections(cells: &Cells) -> Vec<(&'static str, Vec<usize>)> {
    let of_kind =
        |kind| (0..cells.len()).filter(|&cell| Kind::of(cells.cell_type(cell)) == kind).collect();
    Kind::ALL.into_iter().map(|kind| (kind.element(), of_kind(kind))).collect()
}

fn polygonal_rows(cells: &Cells, section: &[usize]) -> Vec<Array<'static>> {
    let mut connectivity: Vec<i64> = Vec::new();
    let mut offsets = Vec::with_capacity(section.len());
    for &cell in section {
        match (cells.cell_type(cell), cells.vertices(cell)) {
            (CellType::Pixel, &[a, b, c, d]) => connectivity.extend([a, b, d, c].map(i64::from)),
            (_, vertices) => connectivity.extend(vertices.iter().map(|&vertex| i64::from(vertex))),
        }
        offsets.push(connectivity.len() as i64);
    }
    vec![integers("connectivity", connectivity), integers("offsets", offsets)]
}

fn unstructured_rows(cells: &Cells) -> Vec<Array<'static>> {
    let connectivity = cells.connectivity().iter().map(|&vertex| i64::from(vertex)).collect();
    let offsets = cells.offsets().skip(1).map(|offset| offset as i64).collect();
    let types = cells.types().iter().map(|cell| cell.vtk()).collect();
    let mut arrays = vec![
        integers("connectivity", connectivity),
        integers("offsets", offsets),
        Array { name: "types", components: 1, values: Values::Bytes(types) },
    ];
    if cells.types().contains(&CellType::Polyhedron) {
        let mut faces: Vec<i64> = Vec::new();
        let mut ends = Vec::with_capacity(cells.len());
        for cell in 0..cells.len() {
            let of_cell = cells.polyhedron_faces(cell);
            if of_cell.is_empty() {
                ends.push(-1);
                continue;
            }
            faces.push(of_cell.len() as i64);
            for face in of_cell {
                faces.push(face.len() as i64);
                faces.extend(face.iter().map(|&vertex| i64::from(vertex)));
            }
            ends.push(faces.len() as i64);
        }
        arrays.extend([integers("faces", faces), integers("faceoffsets", ends)]);
    }
    arrays
}

fn integers(name: &'static str, values: Vec<i64>) -> Array<'static> {
    Array { name, components: 1, values: Values::Integers(values) }
}
