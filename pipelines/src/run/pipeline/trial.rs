//! The trial of a pipeline on the mesh at hand before it takes over.

use tombolo_deform::communicator::Communicator;

use super::{Keyed, Prepared, errors_of_all};
use crate::extract::{Channel, Snapshot, Source};
use crate::language::{Action, Stage};
use crate::run::history::Board;
use crate::run::output::{Frame, Output};

/// Whether a trial runs a stage: one that makes something of the mesh or shows it, not one that
/// writes or steers.
pub(super) fn is_tried(stage: &Stage) -> bool {
    let is_sink = matches!(
        stage,
        Stage::Write(_)
            | Stage::Csv(_)
            | Stage::Log(_)
            | Stage::Set(_)
            | Stage::Order(_)
            | Stage::Pause {}
            | Stage::Stop {}
    );
    !is_sink
}

/// Whether an error says that the pipeline asks for what is not there, and not only what the
/// solver's numbers are at this step.
fn is_of_pipeline((key, _): &Keyed) -> bool {
    !["not finite ", "uneven ", "part of ", "absent "]
        .iter()
        .any(|of_numbers| key.starts_with(of_numbers))
}

impl Prepared {
    /// Runs the stages on a mesh and writes nothing; what they stream. What the pipeline keeps from
    /// run to run is of no use afterwards. Collective.
    ///
    /// # Errors
    /// The first thing that is wrong, the same on all ranks.
    pub(crate) fn try_out(
        mut self,
        snapshot: &Snapshot,
        channel: &Channel,
        source: &mut Source,
        communicator: &dyn Communicator,
        parameters: &[(String, f64)],
    ) -> Result<Vec<Frame>, String> {
        let board = Board { parameters: parameters.to_vec(), ..Board::default() };
        let mut outputs = Vec::new();
        let mut progress =
            self.begin(snapshot, channel, source, communicator, &board, &mut outputs);
        progress.is_trial = true;
        self.run_stages(&mut progress);
        for action in &self.pipeline.then {
            if let Action::Render(render) = action {
                self.render(render, &mut progress);
            }
        }
        let errors = std::mem::take(&mut progress.errors);
        let errors = errors_of_all(communicator, errors);
        let first = errors.into_iter().find(is_of_pipeline).map(|(_, message)| message);
        told_by_first(communicator, first)?;
        let frame = |output| match output {
            Output::Frame(frame) => Some(frame),
            _ => None,
        };
        Ok(outputs.into_iter().filter_map(frame).collect())
    }
}

/// Broadcasts rank 0's error, if any. Collective.
fn told_by_first(communicator: &dyn Communicator, said: Option<String>) -> Result<(), String> {
    let mut bytes = said.unwrap_or_default().into_bytes();
    communicator.broadcast(0, &mut bytes);
    if bytes.is_empty() { Ok(()) } else { Err(String::from_utf8_lossy(&bytes).into_owned()) }
}
