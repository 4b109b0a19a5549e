//! What viewers are told of a run besides its frames.

use std::{collections::BTreeMap, sync::Arc};

use serde_json::{Map, Value, json};
use tombolo_deform::{features::FeatureSize, names::nearest, surface::Surface};

use super::{Adaptor, SteeredMesh};
use crate::{
    condition::Condition,
    steering::{Defaults, EditStack, Parameter},
};

impl Adaptor {
    /// Brings what `hello` tells up to date. Whoever reads it writes it out, and not the solver.
    pub(super) fn describe(&self) {
        if let Some(hub) = &self.hub {
            hub.describe(self.description());
        }
    }

    /// Does so where nothing but the values of parameters has changed.
    pub(super) fn describe_values(&self) {
        if let Some(hub) = &self.hub {
            let values = self.parameters.all().iter().map(|it| (it.name.clone(), it.value));
            hub.describe_values(self.description(), values.collect());
        }
    }

    fn description(&self) -> impl Fn() -> Map<String, Value> + Send + Sync + 'static {
        let (views, monitors) = (self.pipelines.views(), self.pipelines.monitors());
        let (views, monitors) = (Arc::clone(views), Arc::clone(monitors));
        let (changed, described) = (self.changed, Arc::clone(&self.described));
        let stream = self.config.stream.as_ref();
        let embed = stream.map(|stream| stream.embed.clone()).unwrap_or_default();
        let declared = |Parameter { name, value, minimum, maximum }: &Parameter| {
            json!({"name": name, "value": value, "minimum": minimum, "maximum": maximum,
                   "unit": self.config.units.get(name)})
        };
        let parameters: Vec<_> = self.parameters.all().iter().map(declared).collect();
        let defaults = self.defaults.clone();
        move || {
            let list = |value: &Value| if value.is_null() { json!([]) } else { value.clone() };
            let Defaults { deform, guard, schedule } = &defaults;
            let description = json!({
                "protocol": 2,
                "views": *views,
                "monitors": *monitors,
                "pipelines": {"changes": changed},
                "channel": described.channel,
                "features": list(&described.features),
                "surface": described.surface,
                "fields": list(&described.fields),
                "parameters": parameters,
                "embed": embed,
                "defaults": {"deform": deform, "guard": guard, "schedule": schedule},
            });
            if let Value::Object(description) = description { description } else { Map::new() }
        }
    }

    /// Tells how the stack of edits has changed, where it has.
    pub(super) fn tell_stack(&mut self) {
        let Some(hub) = &self.hub else { return };
        let none = EditStack::default();
        let now = match &self.mesh {
            SteeredMesh::Steered(steerer, _) => steerer.stack(),
            _ => &none,
        };
        let (before, edits) = (self.reported_stack.count(), now.count());
        let kept = self.reported_stack.shared(now);
        let is_same =
            (before, edits) == (kept, kept) && self.reported_stack.orders() == now.orders();
        if is_same {
            return;
        }
        self.reported_stack = now.clone();
        let stack = now.clone();
        hub.stack([edits, kept, stack.orders()], move |from, next| {
            let _all = stack.present().skip(from).all(next);
        });
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

/// The features of a surface: names, sizes, bounds, and the conditions that the solver imposes.
pub(super) fn features(surface: &Surface, conditions: &BTreeMap<String, Condition>) -> Value {
    let described = |FeatureSize { name, faces, vertices, bounds, .. }: FeatureSize| {
        let condition = conditions.get(&name);
        json!({"name": name, "faces": faces, "vertices": vertices, "bounds": bounds, "condition": condition})
    };
    surface.feature_sizes().into_iter().map(described).collect()
}

/// The warning about conditions on features that a surface does not have; `None` without any.
pub(super) fn unknown_conditions(
    surface: &Surface,
    conditions: &BTreeMap<String, Condition>,
) -> Option<String> {
    let known = surface.features().names();
    let unknown: Vec<String> = conditions
        .keys()
        .filter(|name| !known.contains(name))
        .map(|name| match nearest(name, known.iter().map(String::as_str)) {
            Some(near) => format!("'{name}' (did you mean '{near}'?)"),
            None => format!("'{name}'"),
        })
        .collect();
    (!unknown.is_empty()).then(|| {
        format!(
            "conditions: the mesh has no feature {}; its features are {}",
            unknown.join(", "),
            known.join(", ")
        )
    })
}
