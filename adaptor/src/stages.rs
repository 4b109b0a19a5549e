//! Runs the pipelines that are due and hands on what they make.

use std::{path::Path, sync::Arc};

use serde_json::{Value, json};
use tombolo_pipelines::{
    extract::Channel,
    language::{Action, Command, Config, Stage},
};

use crate::{settings::InitializeError, steering::Moment, stream::Hub};

/// The pipelines of a run.
pub(crate) struct Pipelines {
    views: Vec<(String, &'static str)>,
    can_order: bool,
}

impl Pipelines {
    pub(crate) fn new(config: &Config, _output: &Path) -> Result<Self, InitializeError> {
        let mut views = Vec::new();
        let mut can_order = false;
        for pipeline in &config.pipelines {
            let streams = pipeline.stages.iter().any(|stage| matches!(stage, Stage::Stream(_)))
                || pipeline.then.iter().any(|action| matches!(action, Action::Stream(_)));
            if streams {
                views.push((pipeline.name.clone(), pipeline.stages.first().map_or("mesh", Stage::name)));
            }
            can_order |= pipeline.stages.iter().any(|stage| matches!(stage, Stage::Order(_)))
                || pipeline.then.iter().any(|action| matches!(action, Action::Order(_)));
        }
        Ok(Self { views, can_order })
    }

    /// What `hello` tells of the views.
    pub(crate) fn views(&self) -> Value {
        self.views.iter().map(|(name, kind)| json!({"name": name, "kind": kind})).collect()
    }

    /// Whether a pipeline can give an order of a new shape.
    pub(crate) fn can_order(&self) -> bool {
        self.can_order
    }

    #[inline]
    pub(crate) fn is_due(&self, _moment: Moment) -> bool {
        false
    }

    /// Runs what is due. Back come the commands that pipelines give, with the pipeline's name.
    pub(crate) fn run(
        &mut self,
        _moment: Moment,
        _channels: &[Channel<'_>],
        _hub: Option<&Arc<Hub>>,
    ) -> Vec<(String, Command)> {
        Vec::new()
    }

    /// Waits for files that are still being written; what was wrong with any.
    pub(crate) fn finish(&mut self) -> Vec<String> {
        Vec::new()
    }
}
