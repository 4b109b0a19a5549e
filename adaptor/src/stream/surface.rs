//! The reference surface, for viewers that preview edits: every bit of it, encoded when the first
//! of them asks.

use std::{
    collections::hash_map::DefaultHasher,
    hash::{Hash, Hasher},
    sync::{Arc, OnceLock},
};

use axum::body::Bytes;
use serde_json::{Value, json};
use tombolo_deform::surface::Surface;
use tombolo_pipelines::encode::encode_surface;

/// A surface that viewers may have.
pub(crate) struct ReferenceSurface {
    surface: Arc<Surface>,
    id: u64,
    frame: OnceLock<Result<Bytes, String>>,
}

impl ReferenceSurface {
    pub(crate) fn new(surface: Arc<Surface>) -> Self {
        let mut hasher = DefaultHasher::new();
        for coordinate in surface.points().as_flattened() {
            coordinate.to_bits().hash(&mut hasher);
        }
        surface.vertices().hash(&mut hasher);
        surface.faces().offsets().for_each(|start| start.hash(&mut hasher));
        surface.faces().connectivity().hash(&mut hasher);
        surface.features().names().hash(&mut hasher);
        surface.features().face_features().hash(&mut hasher);
        Self { id: hasher.finish(), surface, frame: OnceLock::new() }
    }

    /// The description of the surface in `hello`.
    pub(crate) fn described(&self) -> Value {
        let (vertices, faces) = (self.surface.points().len(), self.surface.faces().len());
        json!({"id": format!("{:016x}", self.id), "vertices": vertices, "faces": faces})
    }

    /// The frame that holds it. The first call takes a while.
    pub(super) fn frame(&self) -> Result<Bytes, String> {
        let encode =
            || encode_surface(&self.surface).map(Bytes::from).map_err(|error| error.to_string());
        self.frame.get_or_init(encode).clone()
    }
}
