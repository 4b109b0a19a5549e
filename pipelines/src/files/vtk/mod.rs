//! VTK's files: XML (.vtu, .vtp, and .vtpd, .pvtu, .pvtp that name them), legacy (.vtk) and collections (.pvd).

mod array;
mod dataset;
mod encoding;
mod index;
mod legacy;
mod series;
mod write;
mod xml;

pub(super) use index::Index;
pub(super) use legacy::parse as parse_legacy;
pub use series::Series;
pub use write::Compression;
pub(super) use write::{from_extract, from_mesh};
pub(super) use xml::parse as parse_xml;

/// The array that says which feature a cell or point belongs to.
const FEATURES: &str = "features";
/// The field-data array with the features' names.
const FEATURE_NAMES: &str = "feature_names";
/// The field-data array with the number that each of the names belongs to; without it they count from 0.
const FEATURE_NUMBERS: &str = "feature_numbers";
