//! One pipeline and its stages.

#[cfg(feature = "files")]
mod check;
mod decimate;
mod draw;
mod end;
mod measure;
mod prepare;
mod sinks;
mod trial;

use std::collections::HashSet;
use std::sync::Arc;

use tombolo_deform::communicator::Communicator;
use tombolo_deform::edit::Edit;
use tombolo_deform::mesh::ArrayView;

use super::cost::{Cost, Thinning};
use super::dormancy::Dormancy;
use super::due::{Clock, Now};
use super::history::Board;
use super::output::{MonitorValues, Output};
use super::trigger::Trigger;
use crate::derive::{Basis, derive, follow, wall_shear_stress, with_derived};
use crate::extract::{
    Channel, Decimation, Extract, ExtractError, Extracted, Field, FieldView, Input, Kept, Snapshot,
    Source, merged, unknown_field,
};
use crate::language::{Action, Command, Monitor, Pipeline, Slot, Stage, WallShearStress};
use prepare::{Names, State, gradient_of};

/// The name of the element field that a `quality` stage adds.
const QUALITY_FIELD: &str = "scaled_jacobian";

/// A pipeline that is ready to run.
pub(super) struct Prepared {
    pub(super) pipeline: Pipeline,
    /// Its index in the configuration.
    pub(super) index: usize,
    pub(super) due: Clock,
    pub(super) dormancy: Dormancy,
    pub(super) thinning: Thinning,
    pub(super) cost: Cost,
    /// Whether it runs when it is due.
    pub(super) is_chosen: bool,
    pub(super) name: Arc<str>,
    /// The stages, and those that derive what they need.
    stages: Vec<Stage>,
    /// The names that each stage uses, and its state.
    names: Vec<Names>,
    states: Vec<State>,
    names_of_actions: Vec<Names>,
    /// The fields to keep, where a `select` stage says so.
    selected: Option<HashSet<String>>,
    /// The fields that are reduced over the extract or colour it.
    used: HashSet<String>,
    /// The fields that nobody sees but the stages that need them.
    hidden: HashSet<String>,
    trigger: Trigger,
    monitors: Vec<Monitor>,
    /// The errors of the last run, so that it is told once and not at every step.
    reported: HashSet<String>,
    /// The source stage's pattern, kept as long as the mesh does not move.
    kept: Kept,
    /// The decimated surface, kept as long as the mesh does not move.
    decimation: Option<Arc<Decimation>>,
}

/// An error and what it is known by from run to run.
type Keyed = (String, String);

/// The things that one run has made so far.
struct Progress<'a> {
    snapshot: &'a Snapshot<'a>,
    channel: &'a Channel<'a>,
    source: &'a mut Source,
    communicator: &'a dyn Communicator,
    /// The fields that stages have derived.
    derived: Vec<Field>,
    kept: Kept,
    decimation: Option<Arc<Decimation>>,
    extracted: Option<Extracted>,
    /// The decimated extract that replaces the extract, on rank 0.
    decimated: Option<Arc<Extract>>,
    is_decimated: bool,
    /// Fields of the extract that are used, but not selected.
    unselected: Vec<Field>,
    /// The values of the monitors so far, the cycle and the time in front.
    values: Vec<f64>,
    board: &'a Board,
    edits: Vec<Edit>,
    errors: Vec<Keyed>,
    cost: Cost,
    /// Whether it is only tried whether the pipeline can run.
    is_trial: bool,
    outputs: &'a mut Vec<Output>,
}

/// The values of monitors and parameters at a step.
struct Seen<'a> {
    cycle: u64,
    time: f64,
    /// The values of the pipeline's own monitors, the cycle and the time in front.
    values: &'a [f64],
    board: &'a Board,
    /// Whether this is rank 0.
    is_first: bool,
}

impl Seen<'_> {
    fn value(&self, slot: &Slot) -> f64 {
        self.board.value(slot, self.values)
    }
}

impl Progress<'_> {
    /// The values of the monitors so far.
    fn seen(&self) -> Seen<'_> {
        Seen {
            cycle: self.snapshot.cycle,
            time: self.snapshot.time,
            values: &self.values,
            board: self.board,
            is_first: self.communicator.rank() == 0,
        }
    }

    /// The value of a name as it is now.
    fn value(&self, slot: &Slot) -> f64 {
        self.board.value(slot, &self.values)
    }

    /// Whether this rank has nothing of a mesh of which others have parts.
    fn is_bare(&self) -> bool {
        self.communicator.size() > 1 && self.channel.mesh.points.is_empty()
    }

    /// Whether the solver has a field of this name.
    fn offers(&self, field: &str) -> bool {
        self.channel.fields.iter().any(|known| known.name == field)
    }
}

impl Prepared {
    /// Whether it runs at this step.
    #[inline]
    pub(super) fn is_due(&self, now: &Now) -> bool {
        self.is_chosen
            && match self.dormancy.only_shows() {
                // What went by while it rested is made up for.
                true if self.dormancy.is_watched(now) => self.due.has_struck(now),
                true => self.due.is_due(now) && self.dormancy.is_over(now),
                false => self.due.is_due(now),
            }
    }

    /// Tells the errors that were not there in the last run.
    pub(super) fn report(&mut self, cycle: u64, errors: Vec<Keyed>, outputs: &mut Vec<Output>) {
        let mut keys = HashSet::new();
        for (key, message) in errors {
            if !self.reported.contains(&key) && !keys.contains(&key) {
                outputs.push(Output::Error { pipeline: Arc::clone(&self.name), cycle, message });
            }
            keys.insert(key);
        }
        self.reported = keys;
    }

    /// The state at the beginning of a run.
    fn begin<'a>(
        &mut self,
        snapshot: &'a Snapshot<'a>,
        channel: &'a Channel<'a>,
        source: &'a mut Source,
        communicator: &'a dyn Communicator,
        board: &'a Board,
        outputs: &'a mut Vec<Output>,
    ) -> Progress<'a> {
        #[expect(clippy::cast_precision_loss, reason = "cycles below 2^53")]
        let values = vec![snapshot.cycle as f64, snapshot.time];
        Progress {
            snapshot,
            channel,
            source,
            communicator,
            derived: Vec::new(),
            kept: std::mem::take(&mut self.kept),
            decimation: self.decimation.take(),
            extracted: None,
            decimated: None,
            is_decimated: false,
            unselected: Vec::new(),
            values,
            board,
            edits: Vec::new(),
            errors: Vec::new(),
            cost: self.cost,
            is_trial: false,
            outputs,
        }
    }

    /// Runs the stages, and the actions where the condition holds. Returns the values of the
    /// monitors. Collective.
    pub(super) fn run(
        &mut self,
        snapshot: &Snapshot,
        channel: &Channel,
        source: &mut Source,
        communicator: &dyn Communicator,
        board: &Board,
        outputs: &mut Vec<Output>,
    ) -> Vec<f64> {
        let mut progress = self.begin(snapshot, channel, source, communicator, board, outputs);
        self.run_stages(&mut progress);
        let measured = progress.values[2..].to_vec();
        progress.outputs.extend(self.told(snapshot.cycle, snapshot.time, &measured));
        let fires = {
            let value = |slot: &Slot| progress.value(slot);
            self.trigger.fires((snapshot.cycle, snapshot.time), value)
        };
        if fires {
            for (action, names) in self.pipeline.then.iter().zip(&self.names_of_actions) {
                self.act(action, names, &mut progress);
            }
        }
        self.kept = std::mem::take(&mut progress.kept);
        self.decimation = progress.decimation.take();
        self.cost = progress.cost;
        let states: usize = self.states.iter().map(State::bytes).sum();
        self.cost.memory = (self.kept.bytes() + states) as u64;
        let errors = errors_of_all(communicator, std::mem::take(&mut progress.errors));
        self.report(snapshot.cycle, errors, outputs);
        measured
    }

    /// Takes a step in which the channel is missing or cannot be used: every monitor is NaN, and the
    /// condition has to hold anew for as long as `for` says. Returns the values of the monitors.
    pub(super) fn without_channel(
        &mut self,
        snapshot: &Snapshot,
        message: String,
        outputs: &mut Vec<Output>,
    ) -> Vec<f64> {
        let unknown = vec![f64::NAN; self.monitors.len()];
        outputs.extend(self.told(snapshot.cycle, snapshot.time, &unknown));
        self.trigger.lapse();
        self.report(snapshot.cycle, vec![("channel".into(), message)], outputs);
        unknown
    }

    /// The message that tells the values of the monitors; `None` for a pipeline without monitors.
    fn told(&self, cycle: u64, time: f64, values: &[f64]) -> Option<Output> {
        let names = self.monitors.iter().map(|monitor| monitor.name.clone());
        (!values.is_empty()).then(|| {
            let values = names.zip(values.iter().copied()).collect();
            Output::Monitor(MonitorValues { pipeline: Arc::clone(&self.name), cycle, time, values })
        })
    }

    fn run_stages(&mut self, progress: &mut Progress) {
        self.check_selection(progress);
        let mut states = std::mem::take(&mut self.states);
        for (index, state) in states.iter_mut().enumerate() {
            self.stage(index, state, progress);
        }
        self.states = states;
    }

    fn act(&self, action: &Action, names: &Names, progress: &mut Progress) {
        match action {
            Action::Pause {} => self.command(Command::Pause {}, progress),
            Action::Stop {} => self.command(Command::Stop {}, progress),
            Action::Set(parameter) => self.command(Command::Parameter(parameter.clone()), progress),
            Action::Stream(stream) => self.stream(stream, progress),
            Action::Write(write) => self.write(write, progress),
            Action::Render(render) => self.render(render, progress),
            Action::Csv(_) => {
                let row = self.row(names, &progress.seen());
                progress.outputs.extend(row);
            }
            Action::Log(log) => {
                let line = self.log(log, names, &progress.seen());
                progress.outputs.extend(line);
            }
            Action::Order(order) => self.order(order, progress),
        }
    }

    fn wants(&self, field: &str) -> bool {
        !self.hidden.contains(field)
            && self.selected.as_ref().is_none_or(|selected| selected.contains(field))
    }

    /// Names selected fields that the channel does not have.
    fn check_selection(&self, progress: &mut Progress) {
        let Some(selected) = &self.selected else { return };
        if progress.is_bare() {
            return;
        }
        let added: Vec<String> =
            self.pipeline.stages.iter().flat_map(Stage::added_fields).collect();
        let of_channel = || progress.channel.fields.iter().map(|field| field.name);
        let known = || of_channel().chain(added.iter().map(String::as_str));
        let mut missing: Vec<&String> = selected
            .iter()
            .filter(|name| *name != QUALITY_FIELD && known().all(|known| known != *name))
            .collect();
        missing.sort();
        for name in missing {
            let message = unknown_field(name, known());
            progress.errors.push((format!("select {name}"), format!("select: {message}")));
        }
    }

    fn stage(&self, index: usize, state: &mut State, progress: &mut Progress) {
        let (stage, names) = (&self.stages[index], &self.names[index]);
        if progress.is_trial && !trial::is_tried(stage) {
            return;
        }
        match stage {
            Stage::Surface {}
            | Stage::Slice(_)
            | Stage::Contour(_)
            | Stage::Threshold(_)
            | Stage::Clip(_)
            | Stage::Probe(_)
            | Stage::Streamlines(_)
            | Stage::Glyphs(_) => self.source(stage, progress),
            Stage::Gradient(_)
            | Stage::Vorticity(_)
            | Stage::Divergence(_)
            | Stage::QCriterion(_)
            | Stage::Magnitude(_)
            | Stage::Expression(_) => Self::derive(stage, progress),
            Stage::Quality {} => self.quality(progress),
            Stage::Statistics(stage) => Self::statistics(&stage.field, progress),
            Stage::Integrate(_) | Stage::Histogram(_) | Stage::Force(_) => {
                self.reduce(stage, progress);
            }
            Stage::WallShearStress(stress) => self.wall_shear_stress(stress, progress),
            Stage::TimeStatistics(statistics) if statistics.field.is_some() => {
                Self::follow(stage, state, progress);
            }
            Stage::Difference(_) | Stage::TimeStatistics(_) | Stage::Spectrum(_) => {
                Self::of_monitors(stage, names, state, progress);
            }
            Stage::Decimate(stage) => self.decimate(stage, progress),
            Stage::Stream(stream) => self.stream(stream, progress),
            Stage::Write(write) => self.write(write, progress),
            Stage::Render(render) => self.render(render, progress),
            Stage::Csv(_) => {
                let row = self.row(names, &progress.seen());
                progress.outputs.extend(row);
            }
            Stage::Log(log) => {
                let line = self.log(log, names, &progress.seen());
                progress.outputs.extend(line);
            }
            Stage::Set(parameter) => self.command(Command::Parameter(parameter.clone()), progress),
            Stage::Translate(_)
            | Stage::Rotate(_)
            | Stage::ScaleDirection(_)
            | Stage::ScaleNormals(_)
            | Stage::Affine(_)
            | Stage::Displacement(_)
            | Stage::Skeleton(_) => {
                progress.edits.extend(stage.edit());
            }
            Stage::Order(order) => self.order(order, progress),
            Stage::Pause {} => self.command(Command::Pause {}, progress),
            Stage::Stop {} => self.command(Command::Stop {}, progress),
            // `select` has been heeded in the source; the others are settings of orders.
            Stage::Select(_) | Stage::Deform(_) | Stage::Guard(_) | Stage::Schedule(_) => {}
        }
    }

    fn source(&self, stage: &Stage, progress: &mut Progress) {
        let mut fields = with_derived(progress.channel, &progress.derived);
        let is_by_quality =
            matches!(stage, Stage::Threshold(threshold) if threshold.field == QUALITY_FIELD);
        // Measured where the solver has no field of that name.
        let measured = (is_by_quality && fields.iter().all(|field| field.name != QUALITY_FIELD))
            .then(|| progress.source.scaled_jacobians(progress.channel));
        if let Some(measured) = &measured {
            fields.push(FieldView::element(QUALITY_FIELD, ArrayView::scalars(measured)));
        }
        let channel = Channel { fields: &fields, ..*progress.channel };
        let input = Input {
            channel: &channel,
            cycle: progress.snapshot.cycle,
            wanted: &|field: &str| self.wants(field) || self.used.contains(field),
            communicator: progress.communicator,
        };
        let (source, kept) = (&mut *progress.source, &mut progress.kept);
        let taken = match stage {
            Stage::Slice(slice) => source.slice(&input, slice, kept),
            Stage::Contour(contour) => source.contour(&input, contour),
            Stage::Threshold(threshold) => source.threshold(&input, threshold),
            Stage::Clip(clip) => source.clip(&input, clip, kept),
            Stage::Probe(probe) => source.probe(&input, probe, kept),
            Stage::Streamlines(lines) => source.streamlines(&input, lines),
            Stage::Glyphs(glyphs) => source.glyphs(&input, glyphs),
            _ => source.surface(&channel, input.cycle, input.wanted),
        };
        self.keep(taken, stage.name(), progress);
    }

    /// Derives a field, which the stages after find among those of the channel.
    fn derive(stage: &Stage, progress: &mut Progress) {
        let derived = Self::on_basis(progress, |basis| derive(stage, basis));
        match derived {
            Ok(field) => progress.derived.extend(field.flatten()),
            Err(message) => {
                let key = format!("derived {}", stage.derived_name().unwrap_or_default());
                progress.errors.push((key, format!("{}: {message}", stage.name())));
            }
        }
    }

    /// Follows a field over time; its statistics are found among the fields of the channel.
    fn follow(stage: &Stage, state: &mut State, progress: &mut Progress) {
        let (Stage::TimeStatistics(statistics), State::Running(running)) = (stage, state) else {
            return;
        };
        match Self::on_basis(progress, |basis| follow(statistics, basis, running)) {
            Ok(fields) => progress.derived.extend(fields.into_iter().flatten()),
            Err(message) => {
                let key = format!("over time {}", statistics.name);
                progress.errors.push((key, format!("time_statistics: {message}")));
            }
        }
    }

    /// Derives the shear of the flow on the faces of the surface, as a field of the extract.
    fn wall_shear_stress(&self, stage: &WallShearStress, progress: &mut Progress) {
        let gradient = gradient_of(&stage.velocity);
        let derived = Self::on_basis(progress, |basis| match basis.source.walls() {
            Some(walls) => wall_shear_stress(stage, &gradient, basis, &walls),
            None => Ok(None),
        });
        match (derived, progress.extracted.as_mut()) {
            (Ok(Some(Some(field))), Some(extracted)) => match self.wants(stage.name()) {
                true => Arc::make_mut(&mut extracted.extract).fields.push(field),
                false => progress.unselected.push(field),
            },
            (Err(message), _) => {
                let message = format!("wall_shear_stress: {message}");
                progress.errors.push((format!("derived {}", stage.name()), message));
            }
            _ => {}
        }
    }

    /// Works something out from the fields of the mesh, where all ranks know where it lies; `None`
    /// where one does not. Collective.
    fn on_basis<T>(
        progress: &mut Progress,
        work: impl FnOnce(&Basis) -> Result<T, String>,
    ) -> Result<Option<T>, String> {
        let fields = with_derived(progress.channel, &progress.derived);
        let channel = Channel { fields: &fields, ..*progress.channel };
        let Snapshot { cycle, time, .. } = *progress.snapshot;
        let communicator = progress.communicator;
        let input = Input { channel: &channel, cycle, wanted: &|_: &str| true, communicator };
        // What is wrong on one rank is wrong for all.
        let found = progress.source.update(&input).map_err(|error| error.to_string());
        let is_found = !communicator.any(found.is_err());
        found?;
        let source = &*progress.source;
        let parameters = &progress.board.parameters[..];
        let basis = Basis { channel: &channel, source, cycle, time, parameters, communicator };
        if is_found { work(&basis).map(Some) } else { Ok(None) }
    }

    fn keep(&self, taken: Result<Extracted, ExtractError>, stage: &str, progress: &mut Progress) {
        match taken {
            Ok(mut extracted) => {
                for error in std::mem::take(&mut extracted.errors) {
                    let (key, message) = match error.field() {
                        Some(field) => (format!("field {field}"), error.to_string()),
                        None => (format!("part of {stage}"), format!("{stage}: {error}")),
                    };
                    progress.errors.push((key, message));
                }
                let named =
                    self.selected.as_ref().is_some_and(|selected| selected.contains(QUALITY_FIELD));
                if named && !progress.offers(QUALITY_FIELD) {
                    extracted.add_element_field(
                        QUALITY_FIELD,
                        &progress.source.scaled_jacobians(progress.channel),
                    );
                }
                let is_aside = |name: &str| self.used.contains(name) && !self.wants(name);
                if self.used.iter().any(|field| is_aside(field)) {
                    let fields = &mut Arc::make_mut(&mut extracted.extract).fields;
                    progress.unselected =
                        fields.extract_if(.., |field| is_aside(&field.name)).collect();
                }
                progress.extracted = Some(extracted);
            }
            Err(error) => {
                let message = match error {
                    // What is wrong with the mesh is wrong for every stage.
                    ExtractError::PointNotFinite { .. } | ExtractError::Surface(_) => {
                        error.to_string()
                    }
                    _ => format!("{stage}: {error}"),
                };
                progress.errors.push(("extract".into(), message));
            }
        }
    }

    /// Takes the whole mesh where no stage takes an extract.
    fn take_whole(&self, progress: &mut Progress) {
        let has_source = self.pipeline.stages.iter().any(Stage::is_source);
        if progress.extracted.is_none() && !has_source {
            let fields = with_derived(progress.channel, &progress.derived);
            let channel = Channel { fields: &fields, ..*progress.channel };
            let wanted = |field: &str| self.wants(field) || self.used.contains(field);
            let taken = progress.source.whole(&channel, progress.snapshot.cycle, &wanted);
            self.keep(taken, "mesh", progress);
        }
    }

    /// The extract to hand out; the whole mesh where no stage has taken one. Of several ranks rank
    /// 0 alone has one.
    fn finished(&self, progress: &mut Progress) -> Option<Arc<Extract>> {
        if progress.is_decimated {
            return progress.decimated.clone();
        }
        self.take_whole(progress);
        let Some(whole) = progress.source.whole_mesh() else {
            return progress.extracted.as_ref().map(|extracted| Arc::clone(&extracted.extract));
        };
        // Where the extract could not be taken, its error has been reported already.
        merged(progress.communicator, whole, progress.extracted.as_ref()).ok().flatten()
    }
}

/// The errors of all ranks, on rank 0; the others have none. Collective.
fn errors_of_all(communicator: &dyn Communicator, mut errors: Vec<Keyed>) -> Vec<Keyed> {
    if communicator.size() == 1 || !communicator.any(!errors.is_empty()) {
        return errors;
    }
    let own = if communicator.rank() == 0 { Vec::new() } else { std::mem::take(&mut errors) };
    let told = communicator.gather(0, &serde_json::to_vec(&own).unwrap_or_default());
    for (rank, bytes) in told.unwrap_or_default().into_iter().enumerate() {
        let theirs: Vec<Keyed> = serde_json::from_slice(&bytes).unwrap_or_default();
        errors.extend(
            theirs.into_iter().map(|(key, message)| (key, format!("rank {rank}: {message}"))),
        );
    }
    errors
}
