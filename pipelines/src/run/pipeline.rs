//! One pipeline and its stages.

use std::collections::HashSet;
use std::sync::Arc;

use tombolo_deform::{mesh::ArrayView, surface::Edit};

use super::due::Clock;
use super::output::{Frame, MonitorValues, Output};
use crate::communicator::{Communicator, Reduction, agree};
use crate::expression::Expression;
use crate::extract::{
    Association, Channel, Extract, Extracted, Field, FieldView, Snapshot, Source, check_length,
    is_absent, merged, statistics_of,
};
use crate::language::{
    Action, Change, Order, OrderStage, Pipeline, Problem, Slice, Stage, StreamStage, Write,
    file_pattern, monitor_names, nearest,
};

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
    condition: Option<Expression>,
    monitors: Vec<String>,
    /// What went wrong in the last run, so that it is told once and not at every step.
    reported: HashSet<String>,
}

/// An error and what it is known by from run to run.
type Keyed = (String, String);

/// What one run has made so far.
struct Progress<'a> {
    snapshot: &'a Snapshot<'a>,
    channel: &'a Channel<'a>,
    source: &'a mut Source,
    communicator: &'a dyn Communicator,
    extracted: Option<Extracted>,
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
        Ok(Self {
            due: Clock::new(pipeline.due),
            is_chosen: true,
            name: pipeline.name.as_str().into(),
            selected,
            condition,
            monitors,
            reported: HashSet::new(),
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
            extracted: None,
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
                    Action::Pause {} => self.pause(&mut progress),
                    Action::Stop {} => self.stop(&mut progress),
                    Action::Stream(stream) => self.stream(stream, &mut progress),
                    Action::Write(write) => self.write(write, &mut progress),
                    Action::Order(order) => self.order(order, &mut progress),
                }
            }
        }
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
        let known = || progress.channel.fields.iter().map(|field| field.name);
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
            Stage::Surface {} => self.source(None, progress),
            Stage::Slice(slice) => self.source(Some(slice), progress),
            Stage::Quality {} => self.quality(progress),
            Stage::Statistics(stage) => Self::statistics(&stage.field, progress),
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
            Stage::Pause {} => self.pause(progress),
            Stage::Stop {} => self.stop(progress),
            // `select` has been heeded in the source; the others are settings of orders.
            Stage::Select(_) | Stage::Deform(_) | Stage::Guard(_) | Stage::Schedule(_) => {}
        }
    }

    fn source(&self, slice: Option<&Slice>, progress: &mut Progress) {
        let (channel, cycle) = (progress.channel, progress.snapshot.cycle);
        let wanted = |field: &str| self.wants(field);
        let taken = match slice {
            Some(plane) => {
                let communicator = progress.communicator;
                let furthest_of_all = |furthest: f64| {
                    let mut furthest = [furthest];
                    communicator.reduce(Reduction::Maximum, &mut furthest);
                    furthest[0]
                };
                progress.source.slice(channel, plane, cycle, &wanted, &furthest_of_all)
            }
            None => progress.source.surface(channel, cycle, &wanted),
        };
        self.keep(taken, progress);
    }

    fn keep(
        &self,
        taken: Result<Extracted, crate::extract::ExtractError>,
        progress: &mut Progress,
    ) {
        match taken {
            Ok(mut extracted) => {
                for error in std::mem::take(&mut extracted.errors) {
                    let key = format!("field {}", error.field().unwrap_or_default());
                    progress.errors.push((key, error.to_string()));
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
                progress.extracted = Some(extracted);
            }
            Err(error) => progress.errors.push(("extract".into(), error.to_string())),
        }
    }

    fn quality(&self, progress: &mut Progress) {
        let quality = progress.source.quality(progress.channel);
        #[expect(clippy::cast_precision_loss, reason = "counts below 2^53")]
        let [mut cells, mut inverted] = [quality.cells as f64, quality.inverted as f64];
        let (mut min, mut max, mut mean) = (quality.min, quality.max, quality.mean);
        if progress.communicator.size() > 1 {
            let none = quality.cells == 0;
            let mut extremes = if none { [f64::NEG_INFINITY; 2] } else { [-min, max] };
            progress.communicator.reduce(Reduction::Maximum, &mut extremes);
            let mut sums = [cells, inverted, mean * cells];
            progress.communicator.reduce(Reduction::Sum, &mut sums);
            [cells, inverted] = [sums[0], sums[1]];
            (min, max) = if cells > 0.0 { (-extremes[0], extremes[1]) } else { (1.0, 1.0) };
            mean = if cells > 0.0 { sums[2] / cells } else { 1.0 };
        }
        progress.values.extend([min, mean, max, inverted]);
        let wanted = self.wants(QUALITY_FIELD);
        if let Some(extracted) = progress.extracted.as_mut().filter(|_| wanted) {
            extracted.add_element_field(
                QUALITY_FIELD,
                &progress.source.scaled_jacobians(progress.channel),
            );
        }
    }

    fn statistics(field: &str, progress: &mut Progress) {
        let cycle = progress.snapshot.cycle;
        let known = || progress.channel.fields.iter().map(|field| field.name);
        let found = progress.channel.fields.iter().find(|view| view.name == field);
        // A rank with nothing of the mesh need not have its fields.
        let none = FieldView {
            name: field,
            association: Association::Vertex,
            values: ArrayView::scalars(&[]),
        };
        let view = match found {
            None if progress.is_bare() => Ok(&none),
            None => Err(format!("statistics: {}", unknown_field(field, known()))),
            Some(view) => check_length(progress.channel, view)
                .map(|()| view)
                .map_err(|error| format!("statistics: {error}")),
        };
        // Where one rank has nothing to measure, none measures.
        let may_measure = agree(progress.communicator, view.as_ref().map(|_| ()));
        match view {
            Err(message) => {
                progress.errors.push((format!("statistics {field}"), message));
                progress.values.extend([f64::NAN; 5]);
            }
            Ok(_) if may_measure.is_err() => progress.values.extend([f64::NAN; 5]),
            Ok(view) => {
                let source = &*progress.source;
                let counts = |entity: usize| source.counts(view.association, entity);
                let measured = statistics_of(view, progress.communicator, &counts);
                if let Some((entity, value)) = measured.first_non_finite {
                    let message = format!(
                        "cycle {cycle}: field `{field}` is not finite in {} places, first {value} at {} {entity}",
                        measured.non_finite, view.association
                    );
                    progress.errors.push((format!("not finite {field}"), message));
                }
                #[expect(clippy::cast_precision_loss, reason = "a count below 2^53")]
                let non_finite = measured.non_finite as f64;
                progress.values.extend([
                    measured.min,
                    measured.max,
                    measured.mean,
                    measured.l2,
                    non_finite,
                ]);
            }
        }
    }

    /// The extract to hand out; the whole mesh where no stage has taken one. Of several ranks rank 0 alone has one.
    fn finished(&self, progress: &mut Progress) -> Option<Arc<Extract>> {
        let has_source =
            matches!(self.pipeline.stages.first(), Some(Stage::Surface {} | Stage::Slice(_)));
        if progress.extracted.is_none() && !has_source {
            let taken =
                progress.source.whole(progress.channel, progress.snapshot.cycle, &|field: &str| {
                    self.wants(field)
                });
            self.keep(taken, progress);
        }
        let Some(whole) = progress.source.whole_mesh() else {
            return progress.extracted.as_ref().map(|extracted| Arc::clone(&extracted.extract));
        };
        // What is wrong where it could not be taken has been said there.
        merged(progress.communicator, whole, progress.extracted.as_ref()).ok().flatten()
    }

    fn stream(&self, stage: &StreamStage, progress: &mut Progress) {
        let Some(mut extract) = self.finished(progress) else { return };
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
        progress.outputs.push(Output::Order { pipeline: Arc::clone(&self.name), order });
    }

    fn reason(&self) -> String {
        match &self.pipeline.when {
            Some(when) => format!("pipeline `{}`: {when}", self.name),
            None => format!("pipeline `{}`", self.name),
        }
    }

    fn pause(&self, progress: &mut Progress) {
        progress
            .outputs
            .push(Output::Pause { pipeline: Arc::clone(&self.name), reason: self.reason() });
    }

    fn stop(&self, progress: &mut Progress) {
        progress
            .outputs
            .push(Output::Stop { pipeline: Arc::clone(&self.name), reason: self.reason() });
    }
}

/// The errors of all ranks, on rank 0; the others have none. Collective.
fn errors_of_all(communicator: &dyn Communicator, mut errors: Vec<Keyed>) -> Vec<Keyed> {
    if communicator.size() == 1 {
        return errors;
    }
    let mut any = [f64::from(u8::from(!errors.is_empty()))];
    communicator.reduce(Reduction::Maximum, &mut any);
    if any[0] == 0.0 {
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

fn unknown_field<'a>(name: &str, known: impl Iterator<Item = &'a str> + Clone) -> String {
    let hint = nearest(name, known.clone())
        .map_or(String::new(), |near| format!("; did you mean `{near}`?"));
    let known: Vec<&str> = known.collect();
    if known.is_empty() {
        return format!("the channel has no field `{name}`, nor any other");
    }
    format!("the channel has no field `{name}`; its fields are {}{hint}", known.join(", "))
}
