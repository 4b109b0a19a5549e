//! VTK's files: XML (.vtu, .vtp, and .vtpd, .pvtu, .pvtp that name them), legacy (.vtk) and
//! collections (.pvd).

mod array;
mod dataset;
mod encoding;
mod index;
mod kind;
mod legacy;
#[cfg(feature = "vtkio")]
mod model;
mod names;
mod series;
mod write;
mod xml;
mod xml_file;

pub(super) use index::Index;
pub(super) use legacy::parse as parse_legacy;
#[cfg(feature = "vtkio")]
pub use model::{extract_from_vtkio, mesh_from_vtkio};
pub use series::Series;
pub(super) use write::{Format, check_polygonal, from_extract, from_mesh};
#[cfg(feature = "vtkio")]
pub use write::{extract_to_vtkio, mesh_to_vtkio};
pub(super) use xml::parse as parse_xml;
pub use xml_file::Compression;

/// The array that says which feature a cell or point belongs to.
const FEATURES: &str = "features";
/// The number behind a feature's number in the field-data array of its name.
const FACE_DIMENSION: i64 = 2;
/// A field-data array of text with the features' names, as other programs may write it.
const FEATURE_NAMES: &str = "feature_names";
/// The field-data array with the number that each of the names in that text belongs to; without it
/// they count from 0.
const FEATURE_NUMBERS: &str = "feature_numbers";
