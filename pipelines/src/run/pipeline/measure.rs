//! The stages that measure: their numbers are monitors.

use tombolo_deform::{
    communicator::{Reduction, agree},
    mesh::ArrayView,
};

use super::prepare::{Names, State, gradient_of};
use super::{Prepared, Progress, QUALITY_FIELD};
use crate::derive::with_derived;
use crate::extract::{Channel, FieldView, Input, check_length, statistics, unknown_field};
use crate::language::{Stage, monitors_of};
use crate::reduce::{Region, force, histogram, integrate};

impl Prepared {
    /// Measures the cells.
    pub(super) fn quality(&self, progress: &mut Progress) {
        let quality = progress.source.quality(progress.channel);
        #[expect(clippy::cast_precision_loss, reason = "counts below 2^53")]
        let [mut cells, mut inverted] = [quality.cells as f64, quality.inverted as f64];
        let (mut min, mut max, mut mean) = (quality.min, quality.max, quality.mean);
        if progress.communicator.size() > 1 {
            let none = [f64::INFINITY, f64::NEG_INFINITY];
            let mut range = [if quality.cells == 0 { none } else { [min, max] }];
            progress.communicator.join_ranges(&mut range);
            let mut sums = [cells, inverted, mean * cells];
            progress.communicator.reduce(Reduction::Sum, &mut sums);
            [cells, inverted] = [sums[0], sums[1]];
            [min, max] = if cells > 0.0 { range[0] } else { [1.0; 2] };
            mean = if cells > 0.0 { sums[2] / cells } else { 1.0 };
        }
        progress.values.extend([min, mean, max, inverted]);
        // A field of the solver of that name stays.
        let is_added = self.wants(QUALITY_FIELD) && !progress.offers(QUALITY_FIELD);
        if let Some(extracted) = progress.extracted.as_mut().filter(|_| is_added) {
            extracted.add_element_field(
                QUALITY_FIELD,
                &progress.source.scaled_jacobians(progress.channel),
            );
        }
    }

    /// Measures a field.
    pub(super) fn statistics(field: &str, progress: &mut Progress) {
        let cycle = progress.snapshot.cycle;
        let fields = with_derived(progress.channel, &progress.derived);
        let channel = Channel { fields: &fields, ..*progress.channel };
        let known = || fields.iter().map(|field| field.name);
        let found = fields.iter().find(|view| view.name == field);
        // A rank with nothing of the mesh need not have its fields.
        let none = FieldView::vertex(field, ArrayView::scalars(&[]));
        let view = match found {
            None if progress.is_bare() => Ok(&none),
            None => Err(format!("statistics: {}", unknown_field(field, known()))),
            Some(view) => check_length(&channel, view)
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
                let measured = statistics(view, progress.communicator, &counts);
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

    /// Reduces fields over what the source stage has taken, or over the whole mesh.
    pub(super) fn reduce(&self, stage: &Stage, progress: &mut Progress) {
        let fields = with_derived(progress.channel, &progress.derived);
        let channel = Channel { fields: &fields, ..*progress.channel };
        let (cycle, communicator) = (progress.snapshot.cycle, progress.communicator);
        let input = Input { channel: &channel, cycle, wanted: &|_: &str| true, communicator };
        let source_stage = self.pipeline.stages.iter().find(|stage| stage.is_source());
        let is_known = source_stage.is_some() || {
            let found = progress.source.update(&input);
            let is_known = !communicator.any(found.is_err());
            if let Err(error) = found {
                progress.errors.push(("extract".into(), error.to_string()));
            }
            is_known
        };
        let has_faces = source_stage.is_some_and(Stage::takes_faces);
        if !is_known {
            let monitors = monitors_of(stage, has_faces).len();
            return progress.values.extend(vec![f64::NAN; monitors]);
        }
        let region = Region {
            channel: &channel,
            source: &*progress.source,
            stage: source_stage,
            extracted: progress.extracted.as_ref(),
            unselected: &progress.unselected,
            communicator,
        };
        let (name, (values, error)) = match stage {
            Stage::Integrate(stage) => (&stage.name, integrate(stage, &region)),
            Stage::Histogram(stage) => (&stage.name, histogram(stage, &region)),
            Stage::Force(stage) => {
                let gradient = gradient_of(stage.velocity.as_deref().unwrap_or_default());
                (&stage.name, force(stage, &gradient, &region))
            }
            _ => return,
        };
        progress.values.extend(values);
        if let Some(message) = error {
            let stage = stage.name();
            let key = format!("{stage} {name}");
            progress.errors.push((key, format!("{stage} `{name}`: {message}")));
        }
    }

    /// Measures what comes of other monitors.
    pub(super) fn of_monitors(
        stage: &Stage,
        names: &Names,
        state: &mut State,
        progress: &mut Progress,
    ) {
        let time = progress.snapshot.time;
        match (stage, names, state) {
            (Stage::Difference(_), Names::Difference(of, minus), _) => {
                let difference = progress.value(of) - progress.value(minus);
                progress.values.push(difference);
            }
            (Stage::TimeStatistics(stage), Names::One(slot), State::OverTime(over_time)) => {
                over_time.add(time, progress.value(slot));
                progress.values.extend(over_time.values(&stage.measures));
            }
            (Stage::Spectrum(stage), Names::One(slot), State::Samples(samples)) => {
                samples.add(time, progress.value(slot));
                let (values, is_uneven) = samples.values();
                progress.values.extend(values);
                if is_uneven && progress.communicator.rank() == 0 {
                    let message = format!(
                        "spectrum `{}`: the time steps vary; the values are interpolated at even \
                         times",
                        stage.name
                    );
                    progress.errors.push((format!("uneven {}", stage.name), message));
                }
            }
            _ => {}
        }
    }
}
