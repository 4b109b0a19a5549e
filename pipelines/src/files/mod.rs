//! Mesh files: Gmsh's .msh and VTK's .vtu, .vtp and .vtk are read, .vtu, .vtp, .vtk and .pvd
//! written.
//!
//! | format | read | written |
//! |---|---|---|
//! | Gmsh `.msh` | 2.2 and 4.1, text and binary of either byte order | |
//! | VTK `.vtu`, `.vtp` | text, base64, appended; plain, zlib, LZ4; either byte order | appended raw, plain or zlib |
//! | VTK `.vtk` (legacy) | text and binary, file versions 1 to 5 | binary, by vtkio (feature `vtkio`) |
//! | ParaView `.pvd` | | [`Series`] |
//!
//! Pictures are written as PNG: [`write_picture`], [`Database`].
//!
//! Displacements of a surface are read from and written to plain text and VTK:
//! [`read_displacement`], [`write_displacement`].
//!
//! # Features
//! Physical surfaces of Gmsh become [`FeatureSource::Faces`]. In a VTK file a cell array named
//! `features` says which feature each face belongs to (a negative number: none), on cells of
//! dimension 2 beside the volume cells or on the cells of a surface; a point array of that name
//! becomes [`FeatureSource::Vertices`]. A feature's name is the name of a field-data array of two
//! integers: its number, and 2, the dimension of its faces. That is how meshio keeps the names of
//! physical groups. In such a name `"`, `%`, `&`, `<` and `>` stand as `%` and two hexadecimal
//! digits. A field-data array of text, `feature_names`, is read as well: feature 0 first, or in the
//! order of the numbers in `feature_numbers` where that is there.
//!
//! # What is left out
//! The cells of the highest dimension make the mesh. Other cells but tagged faces, ghost cells, and
//! vertices that no cell uses are left out; [`MeshFile::notes`] says how many.
//!
//! # Trouble
//! Whatever the bytes, reading ends with a mesh or with a [`FileError`] that says which file, where
//! in it, what stands there and what is needed. It never panics, and sets no memory aside that the
//! size of the file does not warrant.
//!
//! [`FeatureSource::Faces`]: tombolo_deform::mesh::FeatureSource::Faces
//! [`FeatureSource::Vertices`]: tombolo_deform::mesh::FeatureSource::Vertices

mod assemble;
mod displacement;
mod error;
mod gmsh;
mod pictures;
mod scanner;
#[cfg(test)]
mod tests;
mod vtk;
mod whole;

use std::io::Write;
use std::path::Path;

use tombolo_deform::mesh::{Cells, Mesh};

pub use displacement::{
    SurfaceDisplacement, TOLERANCE, UnreadFile, check_displacement_name, parse_displacement,
    read_displacement, read_displacements, write_displacement,
};
pub use error::{FileError, Position, Problem};
pub use pictures::{Database, write_picture};
pub use vtk::{Compression, Series};
#[cfg(feature = "vtkio")]
pub use vtk::{extract_from_vtkio, extract_to_vtkio, mesh_from_vtkio, mesh_to_vtkio};
pub use whole::write_durably;
use whole::write_whole;

use crate::extract::{Extract, Field};
use error::Flaw;

/// A mesh with what its file says about it.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshFile {
    /// The mesh.
    pub mesh: Mesh,
    /// The arrays on its vertices and cells, as the file has them: they may hold NaN.
    pub fields: Vec<Field>,
    /// Notes for people: the things left out, and why.
    pub notes: Vec<String>,
}

/// Reads a mesh by its file's extension: `.msh`, `.vtu`, `.vtp` or `.vtk`.
///
/// # Errors
/// [`FileError`] where the file cannot be opened, is not of its format, uses something that is not
/// read here (elements of higher order, other kinds of dataset), or holds a mesh that is none.
///
/// ```no_run
/// # fn main() -> Result<(), tombolo_pipelines::files::FileError> {
/// let file = tombolo_pipelines::files::read_mesh(std::path::Path::new("meshes/channel.msh"))?;
/// println!("{} cells; {}", file.mesh.cells().len(), file.notes.join("; "));
/// # Ok(())
/// # }
/// ```
pub fn read_mesh(path: impl AsRef<Path>) -> Result<MeshFile, FileError> {
    let path = path.as_ref();
    let parse = parser(path)?;
    let bytes = std::fs::read(path).map_err(|error| Flaw::from(error).in_file(path))?;
    parse(&bytes).map_err(|flaw| flaw.in_file(path))
}

/// Reads a mesh from the bytes of a file; its name tells the format.
///
/// # Errors
/// As [`read_mesh`].
pub fn parse_mesh(name: &Path, bytes: &[u8]) -> Result<MeshFile, FileError> {
    parser(name)?(bytes).map_err(|flaw| flaw.in_file(name))
}

type Parser = fn(&[u8]) -> Result<MeshFile, Flaw>;

fn parser(path: &Path) -> Result<Parser, FileError> {
    match extension(path).as_str() {
        "msh" => Ok(gmsh::parse),
        "vtu" | "vtp" => Ok(vtk::parse_xml),
        "vtk" => Ok(vtk::parse_legacy),
        found => Err(unknown_extension(found, ".msh, .vtu, .vtp and .vtk").in_file(path)),
    }
}

fn extension(path: &Path) -> String {
    path.extension()
        .map(|extension| extension.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default()
}

fn unknown_extension(found: &str, expected: &'static str) -> Flaw {
    Problem::Extension { found: found.to_owned(), expected }.into()
}

/// Writes an extract: as `.vtp`, which holds cells up to dimension 2, or as `.vtu` or legacy `.vtk`,
/// which hold any.
/// Folders are made where they are missing, and the file takes its place in one step, so that no
/// reader ever sees half of it.
///
/// A file that ends in `.vtpd`, `.pvtu` or `.pvtp` names one that holds the data: of `out.vtpd`
/// that is `out/out_0.vtu`. It takes its place after the other, which it must be kept beside.
///
/// Fields are written as numbers of their type, coordinates in double precision. In a `.vtp` file
/// cells stand in VTK's order of kinds: vertices, lines, polygons, strips.
///
/// # Errors
/// [`FileError`] for another extension, for volume cells in a `.vtp`, for prisms of five or six
/// sides in a `.vtk`, for fields whose length is not that of the mesh, and where the file cannot be
/// written.
pub fn write(path: impl AsRef<Path>, extract: &Extract) -> Result<(), FileError> {
    write_compressed(path, extract, Compression::None)
}

/// Removes a file that [`write`](fn@write) has written, with the data that it names and their folder
/// where that is empty then.
///
/// # Errors
/// [`FileError`] where a file is there and cannot be removed.
pub fn remove(path: impl AsRef<Path>) -> Result<(), FileError> {
    let path = path.as_ref();
    let gone = |path: &Path| match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(Flaw::from(error).in_file(path))
        }
        _ => Ok(()),
    };
    gone(path)?;
    let Some(index) = vtk::Index::of(&extension(path)) else { return Ok(()) };
    let piece = path.with_file_name(index.piece(path));
    gone(&piece)?;
    if let Some(folder) = piece.parent() {
        // What somebody else has put there stays.
        let _ = std::fs::remove_dir(folder);
    }
    Ok(())
}

/// Writes an extract to a file with its arrays compressed.
///
/// # Errors
/// As [`write`](fn@write).
pub fn write_compressed(
    path: impl AsRef<Path>,
    extract: &Extract,
    compression: Compression,
) -> Result<(), FileError> {
    let path = path.as_ref();
    let index = vtk::Index::of(&extension(path));
    let piece = index.map(|index| index.piece(path));
    let data =
        piece.as_ref().map_or_else(|| path.to_path_buf(), |piece| path.with_file_name(piece));
    let format = format(&data)?;
    let bytes = vtk::from_extract(extract, format, compression)
        .map_err(|error| Flaw::from(error).in_file(path))?;
    write_whole(&data, |file| file.write_all(&bytes))?;
    match (index, piece) {
        (Some(index), Some(piece)) => {
            let text = index.text(&piece, extract);
            write_whole(path, |file| file.write_all(text.as_bytes()))
        }
        _ => Ok(()),
    }
}

/// Writes a whole mesh with its fields to a `.vtu` or `.vtk` (or, a surface mesh, `.vtp`) file, so that
/// [`read_mesh`] gives the same again, features included: tagged faces are written as cells behind
/// the mesh's own. Element fields take on such a face the value of the cell it belongs to.
///
/// # Errors
/// As [`write`](fn@write).
pub fn write_mesh(
    path: impl AsRef<Path>,
    mesh: &Mesh,
    fields: &[Field],
    compression: Compression,
) -> Result<(), FileError> {
    let path = path.as_ref();
    check_mesh_name(path, mesh.cells())?;
    let format = format(path)?;
    let bytes = vtk::from_mesh(mesh, fields, format, compression)
        .map_err(|error| Flaw::from(error).in_file(path))?;
    write_whole(path, |file| file.write_all(&bytes))
}

/// Whether [`write_mesh`] takes a mesh of these cells for a file of this name: for whoever wants to
/// know before long work.
///
/// # Errors
/// [`FileError`] for another extension, and for volume cells in a `.vtp`.
pub fn check_mesh_name(path: impl AsRef<Path>, cells: &Cells) -> Result<(), FileError> {
    let path = path.as_ref();
    match extension(path).as_str() {
        "vtp" => vtk::check_polygonal(cells).map_err(|problem| Flaw::from(problem).in_file(path)),
        "vtu" | "vtk" => Ok(()),
        found => Err(unknown_extension(found, ".vtu, .vtp and .vtk").in_file(path)),
    }
}

fn format(path: &Path) -> Result<vtk::Format, FileError> {
    match extension(path).as_str() {
        "vtp" => Ok(vtk::Format::Polygonal),
        "vtu" => Ok(vtk::Format::Unstructured),
        "vtk" => Ok(vtk::Format::Legacy),
        found => {
            Err(unknown_extension(found, ".vtu, .vtp, .vtk, .vtpd, .pvtu and .pvtp").in_file(path))
        }
    }
}
