//! Surfaces: extraction from a mesh, features, and the edits that reshape them.

mod edit;
mod editor;
mod extraction;
mod faces;
mod features;
mod laplacian;
mod polyharmonic;

pub use edit::{Edit, HarmonicOrder, InvalidEdit, ScaleDirection, ScaleNormals, Translate};
pub use editor::{EditError, Editor};
pub use extraction::{Surface, SurfaceError};
pub use features::{FeatureSettings, Features, UnknownFeature};
