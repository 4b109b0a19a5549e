//! The mesh that orders change: how it is taken over at the first call, and let go.

use std::{sync::Arc, time::Duration};

use serde_json::json;
use tombolo_deform::{
    communicator::{Communicator, RankError, agree},
    distributed::{DistributedError, Part, domain},
    features::FeatureSettings,
    mesh::{ArrayView, Cells, MeshError, MeshView, Vector},
    shape::Shaper,
    surface::Surface,
};
use tombolo_pipelines::extract::{Channel, ChannelError};

use super::{
    Adaptor, Described,
    description::{features, unknown_conditions},
};
use crate::{
    allocator::give_back_freed,
    error::ExecuteError,
    steering::{Steerer, Steering, clock},
    step::Step,
    stream::ReferenceSurface,
};

/// The mesh that orders change: that of the channel which the pipeline that runs on orders names,
/// or of the first.
pub(super) enum SteeredMesh {
    /// The first call will take it over.
    Unknown,
    /// Nobody can give an order, so that no copy is made.
    Unsteered,
    /// Orders cannot be carried out, for this reason.
    Refused(String),
    /// With its surface, which on several ranks rank 0 has.
    Steered(Box<Steerer>, Option<Arc<Surface>>),
}

impl Adaptor {
    /// Ends the steering of the shape, for a solver that has replaced its mesh. Views go on; orders
    /// are rejected with this reason from now on. To be called on all ranks.
    pub fn release_shape(&mut self, reason: &str) {
        if matches!(self.mesh, SteeredMesh::Steered(..)) {
            self.refuse(reason);
        }
    }

    /// As [`execute`](Adaptor::execute), for a mesh whose cells are others than before: with them the
    /// shape is released for this reason, but only where they pass. To be called on all ranks alike.
    pub(crate) fn execute_replaced(
        &mut self,
        step: &Step,
        channels: &[Channel<'_>],
        reason: &'static str,
    ) -> Result<Steering, ExecuteError> {
        self.replaced = Some(reason);
        let steering = self.execute(step, channels);
        self.replaced = None;
        steering
    }

    /// Says that the vertices of a channel have two coordinates for the solver, so that orders which
    /// move any along z are rejected. Before its first step; what rank 0 says counts.
    pub fn keep_in_plane(&mut self, channel: &str) {
        if !self.in_plane.contains(channel) {
            self.in_plane.insert(channel.to_owned());
        }
    }

    fn refuse(&mut self, reason: &str) {
        if self.communicator.rank() == 0 {
            self.complain(reason);
        }
        if let SteeredMesh::Steered(steerer, _) = &mut self.mesh {
            steerer.release(self.moment, reason);
        }
        self.mesh = SteeredMesh::Refused(reason.to_owned());
        self.tell_stack();
        self.tell_conditions();
    }

    /// Copies the mesh as it is now as the reference of all shapes, if anybody could ask for one.
    pub(super) fn take_reference(
        &mut self,
        step: &Step,
        channels: &[Channel<'_>],
    ) -> Result<(), ExecuteError> {
        let cycle = step.cycle;
        let channel =
            match agree(&*self.communicator, Channel::find(channels, self.steered_channel())) {
                Ok(channel) => channel,
                // The configuration's mistake, not the solver's.
                Err(RankError { message, .. }) => {
                    self.refuse(&format!("no shape can be changed: {message}"));
                    return Ok(());
                }
            };
        let checked =
            self.check_features(channel).map_err(|error| of_channel(cycle, channel, error));
        if self.communicator.size() == 1 {
            checked?;
        } else {
            agree(&*self.communicator, checked).map_err(ExecuteError::Lent)?;
        }
        self.mesh = if self.config.stream.is_none()
            && self.timed.is_empty()
            && !self.pipelines.can_order()
            && !self.resumed.has_mesh()
        {
            SteeredMesh::Unsteered
        } else {
            match self.take_over(cycle, channel)? {
                Ok(steerer) => {
                    give_back_freed();
                    self.lent.take_reference(channel);
                    let surface = steerer.surface();
                    if let Some(surface) =
                        surface.as_ref().filter(|_| self.communicator.size() == 1)
                    {
                        self.pipelines.share_mesh(channel, &steerer.mesh(), surface);
                    }
                    SteeredMesh::Steered(Box::new(steerer), surface)
                }
                Err(reason) => {
                    let reason = format!("the shape of this mesh cannot be changed: {reason}");
                    self.complain(&reason);
                    SteeredMesh::Refused(reason)
                }
            }
        };
        let fields = channel.fields.iter().map(
            |field| json!({"name": field.name, "association": field.association, "components": field.values.components(),
                           "unit": self.config.units.get(field.name)}),
        );
        let mut described = Described {
            channel: channel.name.to_owned(),
            fields: fields.collect(),
            ..Described::default()
        };
        if let SteeredMesh::Steered(steerer, Some(surface)) = &self.mesh {
            described.features = features(surface, &self.conditions);
            if let Some(unknown) = unknown_conditions(surface, &self.conditions) {
                self.complain(&unknown);
            }
            // A stop needs it too, whether anybody watches or not.
            if let Some(forecaster) = steerer.forecaster() {
                let _ = self.forecaster.set(forecaster);
            }
            if let Some(hub) = &self.hub {
                let surface = ReferenceSurface::new(Arc::clone(surface));
                described.surface = surface.described();
                hub.offer_surface(Arc::new(surface));
            }
        }
        self.described = Arc::new(described);
        self.describe();
        // A run that goes on from a checkpoint has one.
        self.tell_stack();
        self.tell_conditions();
        Ok(())
    }

    /// Says in the log which types of cells any rank has left-handed. Collective.
    fn tell_handedness(&self, cells: &Cells) {
        let note = cells.handedness_note().unwrap_or_default();
        let notes = self.communicator.gather(0, note.as_bytes()).unwrap_or_default();
        if let Some(note) = notes.iter().find(|note| !note.is_empty()) {
            tracing::warn!(run = self.run_id(), "{}", String::from_utf8_lossy(note));
        }
    }

    /// The coordinates of the reference, where the run goes on from a checkpoint.
    fn saved_points(
        &self,
        cycle: u64,
        channel: &Channel<'_>,
    ) -> Result<Option<Arc<[Vector]>>, ExecuteError> {
        let Some((saved, points)) = self.resumed.mesh() else { return Ok(None) };
        let (cells, vertices) = (&channel.mesh.cells, channel.mesh.points.len());
        let (found, expected) = ((cells.fingerprint(), cells.len()), saved.cells);
        let reason = if found.1 != expected.1 {
            format!("found {} cells, expected {}", found.1, expected.1)
        } else if vertices != points.reference().len() {
            format!("found {vertices} vertices, expected {}", points.reference().len())
        } else if found != expected {
            "its cells have other vertices, or stand in another order".into()
        } else {
            return Ok(Some(Arc::clone(points.reference())));
        };
        Err(ExecuteError::Restart { cycle, channel: channel.name.into(), reason })
    }

    /// Takes over a mesh, or this rank's part of one; the inner error says why its shape cannot be
    /// changed. Collective.
    fn take_over(
        &mut self,
        cycle: u64,
        channel: &Channel<'_>,
    ) -> Result<Result<Steerer, String>, ExecuteError> {
        let refused = |error| of_channel(cycle, channel, error);
        let settings = FeatureSettings::default();
        let saved = self.saved_points(cycle, channel);
        let saved =
            if self.communicator.size() == 1 { saved? } else { agree(&*self.communicator, saved)? };
        // All shapes are measured from the reference, wherever the solver's mesh has come to.
        let mesh = match &saved {
            Some(points) => MeshView { points: ArrayView::vectors(points), ..channel.mesh },
            None => channel.mesh,
        };
        let shaper = if self.communicator.size() > 1 || !mesh.is_plain() {
            let part = agree(&*self.communicator, Part::of(&mesh).map_err(refused))?;
            self.tell_handedness(&part.cells);
            domain(&self.communicator, &part, &settings)
                .and_then(|(domain, boundary)| Shaper::new(domain, boundary))
                .map(|shaper| shaper.with_solvers(Arc::clone(&self.solvers)))
                .map_err(|error| error.to_string())
        } else {
            let mesh = mesh.to_mesh().map_err(refused)?;
            self.tell_handedness(mesh.cells());
            let surface = Surface::extract(&mesh, &settings).map_err(DistributedError::from);
            surface
                .and_then(|surface| Shaper::new(mesh, Arc::new(surface)))
                .map_err(|error| error.to_string())
        };
        // Whoever drives can drag the skeleton at any time.
        let skeleton = self.config.stream.is_some()
            || self.timed.drags_skeleton()
            || self.pipelines.drags_skeleton();
        let (log, queue) = (Arc::clone(&self.log), Arc::clone(&self.queue));
        let in_plane = self.in_plane.contains(channel.name);
        let resumed = &mut self.resumed;
        Ok(shaper.and_then(|shaper| {
            let shaper = shaper.with_clock(clock).in_plane(in_plane);
            let mut steerer = Steerer::new(shaper, self.defaults.clone(), log, queue, skeleton)
                .map_err(|error| format!("a thread could not be started: {error}"))?;
            resumed.hand_over(&mut steerer)?;
            steerer.set_deadline(Duration::from_secs(self.config.steering.deadline.get().into()));
            if let Some(shapes) = self.recorded.take() {
                steerer.repeat(shapes);
            }
            // Nobody may ever come to a run that is only watched over.
            if !self.timed.is_empty() || self.pipelines.can_order() {
                steerer.make_ready();
            }
            Ok(steerer)
        }))
    }
}

fn of_channel(cycle: u64, channel: &Channel<'_>, source: MeshError) -> ExecuteError {
    ExecuteError::Channel {
        cycle,
        source: ChannelError::Mesh { channel: channel.name.into(), source },
    }
}
