//! Meshes and extracts in the model of the crate vtkio, and back.

use tombolo_deform::mesh::Mesh;
use vtkio::Vtk;

use super::{FileError, MeshFile, Problem, vtk};
use crate::extract::{Extract, Field};

/// An extract in vtkio's model: an unstructured grid in one piece, coordinates in double precision,
/// each field an array of its number type, the features of cells the array `features`.
///
/// Fields of the mesh as a whole and the names of features have no place in that model.
///
/// # Errors
/// [`Problem`] for fields whose length is not that of the extract, for two of one name, and for
/// cells that vtkio has no type for. Polyhedra are there as in a legacy file: vtkio writes them to
/// `.vtk`, not to `.vtu`.
pub fn extract_to_vtkio(extract: &Extract) -> Result<Vtk, Problem> {
    vtk::extract_to_vtkio(extract)
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
pub fn mesh_to_vtkio(mesh: &Mesh, fields: &[Field]) -> Result<Vtk, Problem> {
    vtk::mesh_to_vtkio(mesh, fields)
}

/// The mesh in an unstructured grid or polygonal data of vtkio's, all pieces as one: what
/// [`read_mesh`] makes of a file with the same contents.
///
/// # Errors
/// [`FileError`] for another kind of dataset, for a piece that is a file not loaded yet, and for a
/// mesh that is none. It names the file by its path, or by the title where it has none.
///
/// [`read_mesh`]: super::read_mesh
pub fn mesh_from_vtkio(file: &Vtk) -> Result<MeshFile, FileError> {
    vtk::mesh_of(file)
}

/// An unstructured grid or polygonal data of vtkio's as an extract: every point, every cell of any
/// dimension, and every array of numbers as a field.
///
/// # Errors
/// As [`mesh_from_vtkio`].
pub fn extract_from_vtkio(file: &Vtk) -> Result<Extract, FileError> {
    vtk::extract_of(file)
}
