//! The steering that the adaptor asks of the solver, kept until the solver has read it.

use std::collections::BTreeMap;

use crate::{MeshMotion, Parameter, Steering};

/// The steering of the step that follows.
#[derive(Debug, Clone, Default)]
pub struct Asked {
    /// Where the mesh goes, if it moves.
    pub motion: Option<MeshMotion>,
    /// The parameters and their values now.
    pub parameters: BTreeMap<String, f64>,
    /// Whether the run is to end.
    pub stop: bool,
}

impl Asked {
    /// Nothing but what the parameters are.
    #[must_use]
    pub fn of(parameters: &[Parameter]) -> Self {
        let parameters =
            parameters.iter().map(|parameter| (parameter.name.clone(), parameter.value)).collect();
        Self { parameters, ..Self::default() }
    }

    /// The mesh stays where it is.
    pub(super) fn rest(&mut self) {
        self.motion = None;
    }

    /// Takes over what the last call gave back.
    pub(super) fn take(&mut self, steering: &Steering) {
        self.stop = steering.stop;
        self.parameters.extend(steering.parameters.iter().cloned());
        self.motion.clone_from(&steering.motion);
    }
}
