//! One pipeline and its stages.

mod measure;

use std::collections::HashSet;
use std::sync::Arc;

use tombolo_deform::edit::Edit;

use super::due::Clock;
use super::output::{Frame, MonitorValues, Output};
use crate::derive::{Basis, derive, with_derived};
use crate::expression::Expression;
use crate::extract::{
    Channel, Extract, ExtractError, Extracted, Field, Input, Kept, Snapshot, Source, is_absent,
    merged, skin, unknown_field,
};
use crate::language::{
    Action, Change, Command, Order, OrderStage, Pipeline, Problem, Stage, StreamStage, Write,
    file_pattern, monitor_names,
};
use tombolo_deform::communicator::Communicator;

/// The name of the element field that a `quality` stage adds.
const QUALITY_FIELD: &str = "scaled_jacobian";

/// A pipeline that is ready to run.
pub(super) struct Prepared {
    pub(super) pipeline: Pipeline,
    pub(super) due: Clock,
    /// Whether it runs when it is due.
    pub(super) is_chosen: bool,
    name: Arc<str>,
    /// The fields to keep, where a `select` stage says so.
    selected: Option<HashSet<String>>,
    /// The fields to integrate over the extract.
    integrated: HashSet<String>,
    condition: Option<Expression>,
    monitors: Vec<String>,
    /// The errors of the last run, so that it is told once and not at every step.
    reported: HashSet<String>,
    /// What the source stage keeps as long as the mesh does not move.
    kept: Kept,
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
    extracted: Option<Extracted>,
    /// Fields of the extract that are integrated, but not selected.
    unselected: Vec<Field>,
    values: Vec<f64>,
    edits: Vec<Edit>,
    errors: Vec<Keyed>,
    outputs: &'a mut Vec<Output>,
}

impl Progress<'_> {
    /// Whether this rank has nothing of a mesh of which others have parts.
    fn is_bare(&self) -> bool {
        self.communicator.size() > 1 && self.channel.mesh.points.is_empty()
    }
}

impl Prepared {
    pub(super) fn new(pipeline: &Pipeline) -> Result<Self, Problem> {
        let monitors = monitor_names(pipeline);
        let names: Vec<&str> = monitors.iter().map(String::as_str).collect();
        let condition = match &pipeline.when {
            Some(when) => Some(
                Expression::parse_condition(when, &names)
                    .map_err(|error| Problem::new(error.to_string()).within("when"))?,
            ),
            None => None,
        };
        let mut selected: Option<HashSet<String>> = None;
        for stage in &pipeline.stages {
            if let Stage::Select(select) = stage {
                let fields: HashSet<String> = select.fields.iter().cloned().collect();
                selected = Some(match selected {
                    Some(before) => before.intersection(&fields).cloned().collect(),
                    None => fields,
                });
            }
        }
        let integrated = pipeline.stages.iter().filter_map(|stage| match stage {
            Stage::Integrate(integrate) => Some([&integrate.field, &integrate.vector]),
            _ => None,
        });
        Ok(Self {
            integrated: integrated.flatten().flatten().cloned().collect(),
            due: Clock::new(pipeline.due),
            is_chosen: true,
            name: pipeline.name.as_str().into(),
            selected,
            condition,
            monitors,
            reported: HashSet::new(),
            kept: Kept::default(),
            pipeline: pipeline.clone(),
        })
    }

    pub(super) fn streams(&self) -> bool {
        self.pipeline.stages.iter().any(|stage| matches!(stage, Stage::Stream(_)))
            || self.pipeline.then.iter().any(|action| matches!(action, Action::Stream(_)))
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

    pub(super) fn run(
        &mut self,
        snapshot: &Snapshot,
        channel: &Channel,
        source: &mut Source,
        communicator: &dyn Communicator,
        outputs: &mut Vec<Output>,
    ) {
        #[expect(clippy::cast_precision_loss, reason = "cycles below 2^53")]
        let values = vec![snapshot.cycle as f64, snapshot.time];
        let mut progress = Progress {
            snapshot,
            channel,
            source,
            communicator,
            derived: Vec::new(),
            kept: std::mem::take(&mut self.kept),
            extracted: None,
            unselected: Vec::new(),
            values,
            edits: Vec::new(),
            errors: Vec::new(),
            outputs,
        };
        self.check_selection(&mut progress);
        for stage in &self.pipeline.stages {
            self.stage(stage, &mut progress);
        }
        if self.monitors.len() > 2 {
            let values = self
                .monitors
                .iter()
                .cloned()
                .zip(progress.values.iter().copied())
                .skip(2)
                .collect();
            progress.outputs.push(Output::Monitor(MonitorValues {
                pipeline: Arc::clone(&self.name),
                cycle: snapshot.cycle,
                time: snapshot.time,
                values,
            }));
        }
        if self.condition.as_ref().is_none_or(|condition| condition.holds(&progress.values)) {
            for action in &self.pipeline.then {
                match action {
                    Action::Pause {} => self.command(Command::Pause {}, &mut progress),
                    Action::Stop {} => self.command(Command::Stop {}, &mut progress),
                    Action::Stream(stream) => self.stream(stream, &mut progress),
                    Action::Write(write) => self.write(write, &mut progress),
                    Action::Order(order) => self.order(order, &mut progress),
                }
            }
        }
        self.kept = std::mem::take(&mut progress.kept);
        let errors = errors_of_all(communicator, std::mem::take(&mut progress.errors));
        self.report(snapshot.cycle, errors, outputs);
    }

    fn wants(&self, field: &str) -> bool {
        self.selected.as_ref().is_none_or(|selected| selected.contains(field))
    }

    /// Names selected fields that the channel does not have.
    fn check_selection(&self, progress: &mut Progress) {
        let Some(selected) = &self.selected else { return };
        if progress.is_bare() {
            return;
        }
        let derived = || self.pipeline.stages.iter().filter_map(Stage::derived_name);
        let known = || progress.channel.fields.iter().map(|field| field.name).chain(derived());
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

    fn stage(&self, stage: &Stage, progress: &mut Progress) {
        match stage {
            Stage::Surface {}
            | Stage::Slice(_)
            | Stage::Contour(_)
            | Stage::Threshold(_)
            | Stage::Clip(_)
            | Stage::Probe(_) => self.source(stage, progress),
            Stage::Gradient(_)
            | Stage::Vorticity(_)
            | Stage::Divergence(_)
            | Stage::QCriterion(_)
            | Stage::Magnitude(_)
            | Stage::Expression(_) => Self::derive(stage, progress),
            Stage::Quality {} => self.quality(progress),
            Stage::Statistics(stage) => Self::statistics(&stage.field, progress),
            Stage::Integrate(stage) => self.integrate(stage, progress),
            Stage::Stream(stream) => self.stream(stream, progress),
            Stage::Write(write) => self.write(write, progress),
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
        let fields = with_derived(progress.channel, &progress.derived);
        let channel = Channel { fields: &fields, ..*progress.channel };
        let input = Input {
            channel: &channel,
            cycle: progress.snapshot.cycle,
            wanted: &|field: &str| self.wants(field) || self.integrated.contains(field),
            communicator: progress.communicator,
        };
        let (source, kept) = (&mut *progress.source, &mut progress.kept);
        let taken = match stage {
            Stage::Slice(slice) => source.slice(&input, slice, kept),
            Stage::Contour(contour) => source.contour(&input, contour),
            Stage::Threshold(threshold) => source.threshold(&input, threshold),
            Stage::Clip(clip) => source.clip(&input, clip, kept),
            Stage::Probe(probe) => source.probe(&input, probe, kept),
            _ => source.surface(&channel, input.cycle, input.wanted),
        };
        self.keep(taken, stage.name(), progress);
    }

    /// Derives a field, which the stages after find among those of the channel.
    fn derive(stage: &Stage, progress: &mut Progress) {
        let fields = with_derived(progress.channel, &progress.derived);
        let channel = Channel { fields: &fields, ..*progress.channel };
        let Snapshot { cycle, time, .. } = *progress.snapshot;
        let communicator = progress.communicator;
        let input = Input { channel: &channel, cycle, wanted: &|_: &str| true, communicator };
        // What is wrong on one rank is wrong for all.
        let found = progress.source.update(&input).map_err(|error| error.to_string());
        let is_found = !communicator.any(found.is_err());
        let derived = found.and_then(|()| {
            let source = &*progress.source;
            let basis = Basis { channel: &channel, source, cycle, time, communicator };
            if is_found { derive(stage, &basis) } else { Ok(None) }
        });
        match derived {
            Ok(field) => progress.derived.extend(field),
            Err(message) => {
                let key = format!("derived {}", stage.derived_name().unwrap_or_default());
                progress.errors.push((key, format!("{}: {message}", stage.name())));
            }
        }
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
                let offered =
                    progress.channel.fields.iter().any(|field| field.name == QUALITY_FIELD);
                if named && !offered {
                    extracted.add_element_field(
                        QUALITY_FIELD,
                        &progress.source.scaled_jacobians(progress.channel),
                    );
                }
                let is_aside = |name: &str| self.integrated.contains(name) && !self.wants(name);
                if self.integrated.iter().any(|field| is_aside(field)) {
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

    /// The extract to hand out; the whole mesh where no stage has taken one. Of several ranks rank
    /// 0 alone has one.
    fn finished(&self, progress: &mut Progress) -> Option<Arc<Extract>> {
        let has_source = self.pipeline.stages.iter().any(Stage::is_source);
        if progress.extracted.is_none() && !has_source {
            let fields = with_derived(progress.channel, &progress.derived);
            let channel = Channel { fields: &fields, ..*progress.channel };
            let wanted = |field: &str| self.wants(field);
            let taken = progress.source.whole(&channel, progress.snapshot.cycle, &wanted);
            self.keep(taken, "mesh", progress);
        }
        let Some(whole) = progress.source.whole_mesh() else {
            return progress.extracted.as_ref().map(|extracted| Arc::clone(&extracted.extract));
        };
        // Where the extract could not be taken, its error has been reported already.
        merged(progress.communicator, whole, progress.extracted.as_ref()).ok().flatten()
    }

    fn stream(&self, stage: &StreamStage, progress: &mut Progress) {
        let Some(mut extract) = self.finished(progress) else { return };
        match skin(&extract) {
            Ok(Some(outside)) => extract = outside.into(),
            Ok(None) => {}
            Err(error) => progress.errors.push(("skin".into(), error.to_string())),
        }
        let lacks = |field: &Field| field.values.iter().any(|&value| is_absent(value));
        if extract.fields.iter().any(lacks) {
            for field in Arc::make_mut(&mut extract).fields.extract_if(.., |field| lacks(field)) {
                let message = format!(
                    "field `{}` is not on all of the mesh; it is not sent to viewers",
                    field.name
                );
                progress.errors.push((format!("absent {}", field.name), message));
            }
        }
        progress.outputs.push(Output::Frame(Frame {
            pipeline: Arc::clone(&self.name),
            cycle: progress.snapshot.cycle,
            time: progress.snapshot.time,
            extract,
            encoding: (*stage).into(),
        }));
    }

    fn write(&self, stage: &Write, progress: &mut Progress) {
        let Some(extract) = self.finished(progress) else { return };
        let Snapshot { cycle, time, .. } = *progress.snapshot;
        match file_pattern(&stage.file, cycle, time) {
            Ok(path) => {
                let pipeline = Arc::clone(&self.name);
                progress.outputs.push(Output::Write { pipeline, path, cycle, time, extract });
            }
            Err(problem) => progress.errors.push(("write".into(), problem.to_string())),
        }
    }

    fn order(&self, stage: &OrderStage, progress: &mut Progress) {
        let edits = std::mem::take(&mut progress.edits);
        let OrderStage { schedule, deform, guard } = stage.clone();
        let order = Order { change: Change::Edits(edits), schedule, deform, guard };
        self.command(Command::Order(order), progress);
    }

    fn command(&self, command: Command, progress: &mut Progress) {
        progress.outputs.push(Output::Command { pipeline: Arc::clone(&self.name), command });
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
