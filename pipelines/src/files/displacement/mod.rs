//! Displacement files: the motion of the vertices of a surface, as plain text or VTK.
//!
//! # Plain text
//! One line for each vertex that moves, its numbers parted by commas or blanks. A `#` begins a
//! comment; empty lines are passed over. Either of
//!
//! | columns | the vertex is found |
//! |---|---|
//! | `x y z dx dy dz` | by its reference coordinates, within [`TOLERANCE`] |
//! | `vertex dx dy dz` | by its mesh vertex number, counted from 0 |
//!
//! A first line of words names the columns, in any order; columns with other names are then passed
//! over. Beside the names above it may have those of ParaView's tables (`Points:0`,
//! `displacement:0` and so on). A header may name both the vertex and its coordinates, which are
//! then checked.
//!
//! # VTK
//! A `.vtp`, `.vtu` or `.vtk` file whose points have an array `displacement` of three components.
//! Points are found by their coordinates, or by the point array `vertex` where the file has it.
//! Points inside a volume are passed over.
//!
//! # Both
//! Vertices that the file does not name do not move. A point that is no vertex of the surface is an
//! error, and so is a vertex that stands twice.

use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;

use tombolo_deform::edit::Edit;
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{NumberType, Vector};
use tombolo_deform::surface::Surface;

use super::error::Flaw;
use super::{FileError, Problem, extension, parse_mesh, unknown_extension, write, write_whole};
use crate::extract::{Association, Extract, ExtractFeatures, Field};

mod matching;
mod text;

use matching::Matcher;
pub use matching::TOLERANCE;
use text::{parse_text, to_text};

const KNOWN: &str = ".txt, .csv, .vtp, .vtu and .vtk";
/// The point array with the displacement.
const DISPLACEMENT: &str = "displacement";
/// The point array with the mesh vertex numbers.
const VERTEX: &str = "vertex";

/// The displacement of some vertices of a surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SurfaceDisplacement {
    /// The vertices, by mesh vertex numbers; each once.
    pub vertices: Vec<u32>,
    /// How far each of them moves along x, y and z.
    pub values: Vec<Vector>,
}

/// Reads the displacement of the vertices of `surface` from a `.txt`, `.csv`, `.vtp`, `.vtu` or
/// `.vtk` file.
///
/// # Errors
/// [`FileError`] with the line and column, or the point, that is wrong.
///
/// ```
/// use tombolo_deform::{shapes::box_of_tets, features::FeatureSettings, surface::Surface};
/// use tombolo_pipelines::files::{read_displacement, write_displacement};
///
/// let surface = Surface::extract(&box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]), &FeatureSettings::default())?;
/// let folder = tempfile::tempdir()?;
/// let file = folder.path().join("lift.txt");
/// std::fs::write(&file, "# the two lower corners in front\nx, y, z, dx, dy, dz\n0, 0, 0, 0, 0, 0.1\n1, 0, 0, 0, 0, 0.2\n")?;
/// assert_eq!(read_displacement(&file, &surface)?.values, [[0.0, 0.0, 0.1], [0.0, 0.0, 0.2]]);
///
/// let all = vec![[0.5, 0.25, 1.0 / 3.0]; surface.points().len()];
/// write_displacement(&file, &surface, &all)?;
/// assert_eq!(read_displacement(&file, &surface)?.values, all);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_displacement(
    path: impl AsRef<Path>,
    surface: &Surface,
) -> Result<SurfaceDisplacement, FileError> {
    let path = path.as_ref();
    is_text(path)?;
    let bytes = std::fs::read(path).map_err(|error| Flaw::from(error).in_file(path))?;
    parse_displacement(path, &bytes, surface)
}

/// Reads a displacement from the bytes of a file; its name tells the format.
///
/// # Errors
/// As [`read_displacement`].
pub fn parse_displacement(
    name: &Path,
    bytes: &[u8],
    surface: &Surface,
) -> Result<SurfaceDisplacement, FileError> {
    let found = if is_text(name)? {
        parse_text(bytes, surface)
    } else {
        let file = parse_mesh(name, bytes)?;
        from_mesh(&file.mesh, &file.fields, surface)
    };
    found.map_err(|flaw| flaw.in_file(name))
}

/// Writes the displacement of each vertex of a surface, so that [`read_displacement`] gives the
/// same bits again: as `.txt` or `.csv`, or as `.vtp` with the reference surface, its features, and
/// the point arrays `displacement` and `vertex`.
///
/// # Errors
/// [`FileError`] for another extension, where `displacement` has not one value for each surface
/// vertex, and where the file cannot be written.
pub fn write_displacement(
    path: impl AsRef<Path>,
    surface: &Surface,
    displacement: &[Vector],
) -> Result<(), FileError> {
    let path = path.as_ref();
    Problem::check_count(
        "the values of the displacement",
        displacement.len(),
        surface.points().len(),
    )
    .map_err(|problem| Flaw::from(problem).in_file(path))?;
    check_displacement_name(path)?;
    if extension(path) == "vtp" {
        return write(path, &to_extract(surface, displacement));
    }
    let text = to_text(surface, displacement, if extension(path) == "csv" { "," } else { " " });
    write_whole(path, |file| file.write_all(text.as_bytes()))
}

/// Checks, before long work, whether [`write_displacement`] takes a file of this name.
///
/// # Errors
/// [`FileError`] for another extension.
pub fn check_displacement_name(path: impl AsRef<Path>) -> Result<(), FileError> {
    let path = path.as_ref();
    match extension(path).as_str() {
        "txt" | "csv" | "vtp" => Ok(()),
        found => Err(unknown_extension(found, ".txt, .csv and .vtp").in_file(path)),
    }
}

/// Reads the files that edits name, and replaces each by its vertices and values.
///
/// # Errors
/// [`UnreadFile`] with the edit; the edits before it have been read.
pub fn read_displacements(edits: &mut [Edit], surface: &Surface) -> Result<(), UnreadFile> {
    for (index, edit) in edits.iter_mut().enumerate() {
        if let Edit::Displacement(import) = edit
            && let Some(file) = &import.file
        {
            let found = read_displacement(file, surface)
                .map_err(|source| UnreadFile { edit: index, source })?;
            (import.file, import.vertices, import.values) =
                (None, found.vertices.into(), found.values.into());
        }
    }
    Ok(())
}

/// A displacement file that an edit names and that could not be read.
#[derive(Debug, thiserror::Error)]
#[error("edit {edit} (displacement): file: {source}")]
pub struct UnreadFile {
    /// The index of the edit in its list, from 0.
    pub edit: usize,
    /// The error of the file.
    pub source: FileError,
}

fn is_text(path: &Path) -> Result<bool, FileError> {
    match extension(path).as_str() {
        "txt" | "csv" => Ok(true),
        "vtp" | "vtu" | "vtk" => Ok(false),
        found => Err(unknown_extension(found, KNOWN).in_file(path)),
    }
}

fn from_mesh(
    mesh: &tombolo_deform::mesh::Mesh,
    fields: &[Field],
    surface: &Surface,
) -> Result<SurfaceDisplacement, Flaw> {
    let find = |name: &str, components: usize| {
        let fits = |field: &&Field| {
            field.name == name
                && field.association == Association::Vertex
                && field.components == components
        };
        fields.iter().find(fits)
    };
    let Some(values) = find(DISPLACEMENT, 3) else {
        let listed = fields
            .iter()
            .map(|field| {
                format!("{} ({} of {} components)", field.name, field.association, field.components)
            })
            .collect::<Vec<_>>()
            .join(", ");
        let found =
            if listed.is_empty() { "no arrays".into() } else { format!("the arrays {listed}") };
        return Err(Problem::wrong(found, "a point array `displacement` of 3 components").into());
    };
    let numbers = find(VERTEX, 1);
    // Points inside a volume are no vertices of a surface.
    let outside = if mesh.cells().dimension() == 3 {
        let outer = Surface::extract(mesh, &FeatureSettings::default())
            .map_err(|error| Problem::wrong(error.to_string(), "a mesh with a surface"))?;
        let mut outside = vec![false; mesh.points().len()];
        outer.vertices().iter().for_each(|&vertex| outside[vertex as usize] = true);
        outside
    } else {
        vec![true; mesh.points().len()]
    };
    let mut matcher = Matcher::new(surface);
    for (index, ((point, value), outside)) in
        mesh.points().iter().zip(values.values.chunks_exact(3)).zip(outside).enumerate()
    {
        if !outside {
            continue;
        }
        let in_point = |problem: Problem| match problem {
            Problem::Unexpected { found, expected } => {
                Problem::wrong(format!("at point {index}: {found}"), expected)
            }
            other => other,
        };
        let value = [value[0], value[1], value[2]];
        if value.iter().any(|part| !part.is_finite()) {
            return Err(in_point(Problem::wrong(
                format!("the displacement {value:?}"),
                "finite numbers",
            ))
            .into());
        }
        let vertex = match numbers.and_then(|numbers| numbers.values.get(index)) {
            None => None,
            Some(&number)
                if number >= 0.0 && number <= f64::from(u32::MAX) && number.fract() == 0.0 =>
            {
                Some(number as u32)
            }
            Some(number) => {
                return Err(in_point(Problem::wrong(
                    format!("the vertex {number}"),
                    "a mesh vertex number",
                ))
                .into());
            }
        };
        matcher.take(vertex, Some(*point), value).map_err(in_point)?;
    }
    matcher.finish()
}

fn to_extract(surface: &Surface, displacement: &[Vector]) -> Extract {
    let features = surface.features();
    Extract {
        points: surface.points().to_vec(),
        vertices: Some(surface.vertices().into()),
        cells: Arc::new(surface.faces().clone()),
        features: Some(Arc::new(ExtractFeatures {
            names: features.names().to_vec(),
            of_cells: features.face_features().to_vec(),
        })),
        fields: vec![
            Field {
                name: DISPLACEMENT.into(),
                association: Association::Vertex,
                components: 3,
                number: NumberType::F64,
                values: displacement.as_flattened().to_vec(),
            },
            Field {
                name: VERTEX.into(),
                association: Association::Vertex,
                components: 1,
                number: NumberType::F64,
                values: surface.vertices().iter().map(|&vertex| f64::from(vertex)).collect(),
            },
        ],
    }
}
