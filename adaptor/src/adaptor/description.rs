//! What viewers are told of a run besides its frames.

use serde_json::{Value, json};
use tombolo_deform::{mesh::Vector, surface::Surface};

use super::{Adaptor, SteeredMesh};
use crate::steering::Defaults;

impl Adaptor {
    /// Brings what `hello` tells up to date.
    pub(super) fn describe(&self) {
        let Some(hub) = &self.hub else { return };
        let stack = match &self.mesh {
            SteeredMesh::Steered(steerer, _) => steerer.stack().edits(),
            _ => Vec::new(),
        };
        let list = |value: &Value| if value.is_null() { json!([]) } else { value.clone() };
        let Defaults { deform, guard, schedule } = &self.defaults;
        let description = json!({
            "protocol": 1,
            "views": self.pipelines.views(),
            "channel": self.told.channel,
            "features": list(&self.told.features),
            "surface": self.told.surface,
            "fields": list(&self.told.fields),
            "parameters": self.parameters.all(),
            "schemas": {"order": self.told.schema},
            "stack": stack,
            "defaults": {"deform": deform, "guard": guard, "schedule": schedule},
        });
        if let Value::Object(description) = description {
            hub.describe(description);
        }
    }

    /// Tells whether the run is paused or stopped, and how good the mesh is.
    pub(super) fn tell_conditions(&self) {
        let Some(hub) = &self.hub else { return };
        let quality = match &self.mesh {
            SteeredMesh::Steered(steerer, _) => steerer.quality(),
            _ => None,
        };
        let quality = quality
            .map(|(min, mean, inverted)| json!({"min": min, "mean": mean, "inverted": inverted}));
        let conditions =
            json!({"paused": self.paused, "stopped": self.stopped, "quality": quality});
        if let Value::Object(conditions) = conditions {
            hub.conditions(conditions);
        }
    }
}

/// The features of a surface: names, sizes and bounds.
pub(super) fn features(surface: &Surface) -> Value {
    let features = surface.features();
    let mut faces = vec![0_usize; features.names().len()];
    for &feature in features.face_features() {
        if let Some(count) = faces.get_mut(feature as usize) {
            *count += 1;
        }
    }
    let described = features.names().iter().zip(faces).zip(0..).map(|((name, faces), feature)| {
        let vertices = features.vertices(feature);
        let points = vertices.iter().map(|&vertex| surface.points()[vertex as usize]);
        let empty = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let bounds = points.fold(empty, |[lower, upper]: [Vector; 2], point| {
            [
                std::array::from_fn(|axis| lower[axis].min(point[axis])),
                std::array::from_fn(|axis| upper[axis].max(point[axis])),
            ]
        });
        json!({"name": name, "faces": faces, "vertices": vertices.len(), "bounds": bounds})
    });
    described.collect()
}
