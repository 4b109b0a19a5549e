//! Surfaces: extraction from a mesh, features, and the edits that reshape them.

mod edit;

pub use edit::{Edit, HarmonicOrder, InvalidEdit, ScaleDirection, ScaleNormals, Translate};
