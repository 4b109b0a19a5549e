//! The checks of the arrays that a solver lends, and when they are made.
//!
//! Lengths are compared in every call. What takes a pass over the mesh is looked at when a mesh is
//! lent first or replaced, and the coordinates once more whenever they are used.

use tombolo_deform::communicator::agree;
use tombolo_pipelines::extract::{Channel, MeshKey, check_names};

use super::{Adaptor, SteeredMesh};
use crate::{
    error::ExecuteError,
    step::{Moment, Step},
};

/// The arrays that were looked at already.
#[derive(Debug, Default)]
pub(super) struct Lent {
    /// By the channel's name, the mesh that passed.
    meshes: Vec<(String, MeshKey)>,
    /// The fingerprint of the cells of the reference mesh, and how many there are.
    reference: Option<(u64, usize)>,
}

impl Lent {
    fn is_known(&self, channel: &Channel<'_>) -> bool {
        let key = MeshKey::of(&channel.mesh);
        self.meshes.iter().any(|(name, known)| *known == key && name == channel.name)
    }

    fn keep(&mut self, channel: &Channel<'_>) {
        let key = MeshKey::of(&channel.mesh);
        match self.meshes.iter_mut().find(|(name, _)| name == channel.name) {
            Some((_, known)) => *known = key,
            None => self.meshes.push((channel.name.to_owned(), key)),
        }
    }

    /// The fingerprint of the cells that all shapes have, and how many there are.
    pub(super) fn reference(&self) -> Option<(u64, usize)> {
        self.reference
    }

    /// Notes the cells that all shapes have.
    pub(super) fn take_reference(&mut self, channel: &Channel<'_>) {
        self.reference = Some((channel.mesh.cells.fingerprint(), channel.mesh.cells.len()));
    }
}

impl Adaptor {
    /// Refuses what the solver got wrong, as far as this rank can tell before it has spoken with
    /// the others.
    pub(super) fn check(
        &mut self,
        step: &Step,
        moment: Moment,
        channels: &[Channel<'_>],
    ) -> Result<(), ExecuteError> {
        let cycle = step.cycle;
        if !step.time.is_finite() {
            return Err(ExecuteError::Time { cycle, what: "time", value: step.time });
        }
        if !(step.time_step >= 0.0 && step.time_step.is_finite()) {
            return Err(ExecuteError::Time { cycle, what: "time_step", value: step.time_step });
        }
        if channels.is_empty() {
            return Err(ExecuteError::NoChannel { cycle });
        }
        let of_channel = |source| ExecuteError::Channel { cycle, source };
        check_names(channels).map_err(of_channel)?;
        channels.iter().try_for_each(Channel::check_lengths).map_err(of_channel)?;
        let steered = self.steered_among(step, channels)?;
        // Between two meetings nothing is looked at.
        let meets = self.meets();
        for (index, channel) in channels.iter().enumerate() {
            let is_steered = steered == Some(channel.name);
            if self.lent.is_known(channel) {
                let is_used = is_steered && self.uses_steered(moment)
                    || self.pipelines.is_due(moment)
                        && self.pipelines.reads(moment, channel.name, index == 0);
                if meets && is_used {
                    channel.check_points().map_err(of_channel)?;
                }
                continue;
            }
            channel.check_mesh().map_err(of_channel)?;
            if let (Some((fingerprint, expected)), true) = (self.lent.reference, is_steered) {
                let found = channel.mesh.cells.len();
                if (channel.mesh.cells.fingerprint(), found) != (fingerprint, expected) {
                    return Err(ExecuteError::OtherCells {
                        cycle,
                        channel: channel.name.into(),
                        found,
                        expected,
                    });
                }
            }
            self.lent.keep(channel);
        }
        Ok(())
    }

    /// The name of the channel whose shape can be changed, where one was taken over: with as many
    /// vertices as it had. None where it is about to be released.
    fn steered_among<'c>(
        &self,
        step: &Step,
        channels: &[Channel<'c>],
    ) -> Result<Option<&'c str>, ExecuteError> {
        let (SteeredMesh::Steered(steerer, _), None) = (&self.mesh, self.replaced) else {
            return Ok(None);
        };
        let (cycle, expected) = (step.cycle, steerer.vertex_count());
        let channel = Channel::find(channels, self.steered_channel())
            .map_err(|reason| ExecuteError::SteeredChannel { cycle, reason })?;
        let found = channel.mesh.points.len();
        if found != expected {
            return Err(ExecuteError::VertexCount {
                cycle,
                channel: channel.name.into(),
                found,
                expected,
            });
        }
        Ok(Some(channel.name))
    }

    /// Whether orders will look at the coordinates in this call, as far as all ranks know it alike.
    fn uses_steered(&self, moment: Moment) -> bool {
        let is_busy =
            matches!(&self.mesh, SteeredMesh::Steered(steerer, _) if !steerer.is_at_rest());
        is_busy || self.timed.is_due(moment) || self.resumed.is_due(moment.cycle)
    }

    /// Refuses coordinates of the steered mesh that are not finite, where rank 0 was called to look
    /// at something: only it knew of that before. Collective.
    pub(super) fn check_called(
        &self,
        step: &Step,
        channels: &[Channel<'_>],
    ) -> Result<(), ExecuteError> {
        let SteeredMesh::Steered(..) = &self.mesh else { return Ok(()) };
        let checked = Channel::find(channels, self.steered_channel()).map(Channel::check_points);
        let mine = match checked {
            Ok(Err(source)) => Err(ExecuteError::Channel { cycle: step.cycle, source }),
            _ => Ok(()),
        };
        if self.communicator.size() == 1 { mine } else { Ok(agree(&*self.communicator, mine)?) }
    }
}
