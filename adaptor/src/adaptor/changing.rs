//! Changes of the pipelines, made at a safe point.

use std::sync::Arc;

use serde_json::json;
use tombolo_deform::communicator::agree;
use tombolo_pipelines::{
    extract::Channel,
    language::{Action, Command, Config, Deformation, Pipeline, PipelineChange, Problem, Stage},
};

use super::{Adaptor, SteeredMesh};
use crate::{
    checkpoint::SavedCommand,
    stages::Changed,
    steering::{Defaults, Reservation, Source},
    step::Moment,
};

/// The [name](Command::name) of a change of the pipelines.
const PIPELINES: &str = "pipelines";

/// A change of the pipelines that all ranks know of.
pub(super) struct WaitingChange {
    id: String,
    source: Source,
    change: PipelineChange,
    /// The room that it takes until it is made.
    _reservation: Option<Reservation>,
}

impl WaitingChange {
    /// The command as it is saved.
    pub(super) fn saved(&self) -> SavedCommand {
        SavedCommand {
            id: self.id.clone(),
            by: (&self.source).into(),
            command: Command::Pipelines(self.change.clone()),
        }
    }
}

impl Adaptor {
    /// Adds, replaces or removes pipelines while the run goes on.
    ///
    /// The change is checked against all pipelines at once, and against the mesh and its fields in
    /// the next call of [`execute`](Adaptor::execute), which makes it, or tells the log and the
    /// viewers why it is not made; the journal has both. A pipeline that stays the same goes on,
    /// one that is replaced starts anew. It is called on all ranks alike; the change of rank 0 counts.
    ///
    /// ```
    /// use tombolo::{Adaptor, Channel, FieldView, MeshView, Step};
    /// use tombolo::pipelines::language::parse_json;
    /// # let mesh = tombolo::deform::shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    /// # let mesh = MeshView::from(&mesh);
    ///
    /// let mut adaptor = tombolo::Settings::default().start()?;
    /// adaptor.change_pipelines(parse_json(
    ///     r#"{"set": [{"name": "health", "stages": [{"quality": {}}]}]}"#,
    ///     "pipelines",
    /// )?)?;
    /// let step = Step { cycle: 0, time: 0.0, time_step: 0.1 };
    /// adaptor.execute(&step, &[Channel::new("fluid", mesh, &[])])?;
    /// assert!(adaptor.history("health").is_some());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// A [`Problem`] with the way to it from the change, where the pipelines would not go together;
    /// nothing has changed then.
    pub fn change_pipelines(&mut self, change: PipelineChange) -> Result<(), Problem> {
        if self.communicator.rank() > 0 {
            return self.changes.check(&change);
        }
        self.changes.take(None, Source::Program, change, 0).map(drop)
    }

    /// Keeps a change that all ranks were told of for the next safe point.
    pub(super) fn keep_change(
        &mut self,
        id: String,
        source: Source,
        change: PipelineChange,
        reservation: Option<Reservation>,
    ) {
        self.waiting_changes.push(WaitingChange { id, source, change, _reservation: reservation });
    }

    /// Tells that the run ends before the changes that all ranks were told of are made.
    pub(super) fn end_changes(&mut self) {
        for WaitingChange { id, source, .. } in std::mem::take(&mut self.waiting_changes) {
            self.end_command(PIPELINES, &id, &source, self.saved.is_some());
        }
    }

    /// Makes the changes that all ranks were told of. All have lent the whole mesh with its fields.
    /// Collective.
    pub(super) fn make_changes(&mut self, moment: Moment, channels: &[Channel<'_>]) {
        for WaitingChange { id, source, change, .. } in std::mem::take(&mut self.waiting_changes) {
            let made = self.make_change(&change, &source, moment, channels);
            self.changes.settle(&id, made.is_ok(), &self.config);
            self.settle(
                PIPELINES,
                &id,
                &source,
                moment,
                made.as_ref().map(|_| ()).map_err(Clone::clone),
            );
            self.describe();
            if let (Ok(changed), Some(hub)) = (made, &self.hub) {
                let Changed { added, replaced, removed, frames } = changed;
                // Behind the `hello` that lists their views.
                frames.into_iter().for_each(|frame| self.pipelines.send(frame, hub));
                hub.tell(move || {
                    json!({"pipelines": {
                        "id": id, "status": "applied", "cycle": moment.cycle,
                        "added": added, "replaced": replaced, "removed": removed,
                    }})
                });
            }
        }
    }

    fn make_change(
        &mut self,
        change: &PipelineChange,
        source: &Source,
        moment: Moment,
        channels: &[Channel<'_>],
    ) -> Result<Changed, String> {
        let changes_orders = change.changes_orders(&self.config);
        if changes_orders && self.is_replay && matches!(source, Source::Viewer(_)) {
            return Err(
                "this run replays a journal: how its orders are carried out is in the journal"
                    .into(),
            );
        }
        let config = self.changes.after(change, &self.config).map_err(|it| it.to_string())?;
        self.check_orders(&config)?;
        self.check_features_of(change.pipelines())?;
        let (parameters, hub) = (self.parameters.all(), self.hub.as_ref());
        let changed = self.pipelines.replace(&config, moment, channels, parameters, hub)?;
        self.config = Arc::new(config);
        // A replay has others than its configuration's, until its journal changes them.
        if changes_orders {
            self.defaults = Defaults::of(&self.config);
        }
        if let SteeredMesh::Steered(steerer, _) = &mut self.mesh {
            steerer.set_defaults(&self.defaults);
            if self.pipelines.can_order() {
                steerer.make_ready();
            }
        }
        self.changed += 1;
        if let Some(hub) = &self.hub {
            hub.offer_pipelines(&self.config.pipelines);
        }
        Ok(changed)
    }

    /// Refuses pipelines that order shapes in a run that has kept no reference mesh.
    fn check_orders(&self, config: &Config) -> Result<(), String> {
        let ordering = config.pipelines.iter().find(|pipeline| Pipeline::can_order(pipeline));
        match (ordering, &self.mesh) {
            (Some(pipeline), SteeredMesh::Unsteered) => Err(format!(
                "pipeline `{}` gives orders, but the run began with nobody who could, so that it \
                 has kept no reference mesh: this needs a restart",
                pipeline.name
            )),
            _ => Ok(()),
        }
    }

    /// Refuses pipelines whose edits or settings of orders name features that the mesh does not
    /// have. Collective.
    fn check_features_of(&self, pipelines: &[Pipeline]) -> Result<(), String> {
        let SteeredMesh::Steered(_, surface) = &self.mesh else { return Ok(()) };
        // Of several ranks rank 0 has the surface.
        let features = surface.as_ref().map(|surface| surface.features());
        let check = |pipeline: &Pipeline| {
            let known = |name: &String| {
                let found = features.map_or(Ok(0), |features| features.index(name));
                found.map_err(|error| format!("pipeline `{}`: {error}", pipeline.name))
            };
            let settings = |deform: &Deformation| {
                deform.sliding.iter().chain(&deform.free).try_for_each(|name| known(name).map(drop))
            };
            for stage in &pipeline.stages {
                if let Some(edit) = stage.edit() {
                    edit.features()
                        .iter()
                        .chain(edit.fixed())
                        .try_for_each(|name| known(name).map(drop))?;
                }
                match stage {
                    Stage::Deform(deform) => settings(deform)?,
                    Stage::Order(order) => order.deform.iter().try_for_each(settings)?,
                    _ => {}
                }
            }
            pipeline.then.iter().try_for_each(|action| match action {
                Action::Order(order) => order.deform.iter().try_for_each(settings),
                _ => Ok(()),
            })
        };
        let mine = pipelines.iter().try_for_each(check);
        agree(&*self.communicator, mine).map_err(|error| error.message)
    }
}
