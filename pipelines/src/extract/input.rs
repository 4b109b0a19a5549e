//! What a source stage takes its extract from.

use tombolo_deform::communicator::Communicator;

use super::Channel;

/// The input of a source stage.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// The channel at this step.
    pub channel: &'a Channel<'a>,
    /// The step.
    pub cycle: u64,
    /// Whether a field of this name is wanted.
    pub wanted: &'a dyn Fn(&str) -> bool,
    /// The ranks that have parts of the mesh.
    pub communicator: &'a dyn Communicator,
}
