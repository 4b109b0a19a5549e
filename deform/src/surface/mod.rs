//! Surfaces: extraction from a mesh, features, and the edits that reshape them.

mod edit;
mod extraction;
mod faces;
mod features;

pub use edit::{Edit, HarmonicOrder, InvalidEdit, ScaleDirection, ScaleNormals, Translate};
pub use extraction::{Surface, SurfaceError};
pub use features::{FeatureSettings, Features, UnknownFeature};
