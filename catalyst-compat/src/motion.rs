//! What the adaptor asks of the solver, kept until the solver has read it.

use std::collections::BTreeMap;

use tombolo::deform::mesh::Vector;
use tombolo::{Parameter, Steering};

/// A motion of the mesh over one step.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Motion {
    pub(crate) coordinates: Vec<Vector>,
    pub(crate) displacement: Vec<Vector>,
    pub(crate) velocity: Vec<Vector>,
    pub(crate) surface: Box<Surface>,
    pub(crate) shape: (u32, u32),
    pub(crate) order: String,
}

/// The motion of the boundary's vertices alone.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Surface {
    pub(crate) vertices: Vec<u32>,
    pub(crate) coordinates: Vec<Vector>,
    pub(crate) displacement: Vec<Vector>,
    pub(crate) velocity: Vec<Vector>,
}

/// What the adaptor asks for the step that follows.
#[derive(Debug, Clone, Default)]
pub(crate) struct Asked {
    /// Where the mesh goes, if it moves.
    pub(crate) motion: Option<Motion>,
    /// The parameters and their values now.
    pub(crate) parameters: BTreeMap<String, f64>,
    /// Whether the run is to end.
    pub(crate) stop: bool,
}

impl Asked {
    /// Nothing but what the parameters are.
    pub(crate) fn of(parameters: &[Parameter]) -> Self {
        let parameters =
            parameters.iter().map(|parameter| (parameter.name.clone(), parameter.value)).collect();
        Self { parameters, ..Self::default() }
    }

    /// The mesh stays where it is.
    pub(crate) fn rest(&mut self) {
        self.motion = None;
    }

    /// Takes over what the last call gave back.
    pub(crate) fn take(&mut self, steering: &Steering<'_>) {
        self.stop = steering.stop;
        self.parameters.extend(steering.parameters.iter().cloned());
        let Some(motion) = &steering.motion else { return };
        let kept = self.motion.get_or_insert_default();
        kept.surface.vertices.clear();
        kept.surface.vertices.extend_from_slice(motion.surface.vertices);
        for (kept, given) in [
            (&mut kept.coordinates, motion.coordinates),
            (&mut kept.displacement, motion.displacement),
            (&mut kept.velocity, motion.velocity),
            (&mut kept.surface.coordinates, motion.surface.coordinates),
            (&mut kept.surface.displacement, motion.surface.displacement),
            (&mut kept.surface.velocity, motion.surface.velocity),
        ] {
            kept.clear();
            kept.extend_from_slice(given);
        }
        kept.shape = motion.shape;
        kept.order.clear();
        kept.order.push_str(motion.order);
    }
}
