//! Views are dormant while nobody looks.

use super::{audience::Audience, due::Now};
use crate::language::{Action, Due, Pipeline, Stage};

/// The most that a view takes of the time while nobody looks. It is taken now and then all the same, so
/// that whoever comes has something to see at once.
const SHARE: f64 = 1e-3;

/// Whether a pipeline is dormant: one that only shows something is while nobody looks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dormancy {
    only_shows: bool,
    /// The audience that looks at its view alone.
    view: Audience,
    /// The second on the clock of rank 0 until which it is dormant; none where it has not been since
    /// somebody looked.
    until: Option<f64>,
}

impl Dormancy {
    pub(super) fn of(pipeline: &Pipeline) -> Self {
        Self {
            only_shows: only_shows(pipeline),
            view: Audience::of([pipeline.name.as_str()]),
            until: None,
        }
    }

    /// Whether nothing comes of the pipeline but what viewers see.
    pub(super) fn only_shows(&self) -> bool {
        self.only_shows
    }

    /// Whether somebody looks at its view.
    #[inline]
    pub(super) fn is_watched(&self, now: &Now) -> bool {
        now.audience.includes(self.view)
    }

    /// Whether it has been dormant for long enough.
    #[inline]
    pub(super) fn is_over(&self, now: &Now) -> bool {
        self.until.is_none_or(|until| now.seconds >= until)
    }

    /// Is dormant for so long that a run of these seconds is no more than its share of the time.
    pub(super) fn begin(&mut self, now: &Now, seconds: f64) {
        self.until = Some(now.seconds + seconds / SHARE);
    }

    /// Whether this is the first run since somebody looks again.
    pub(super) fn wakes(&mut self, now: &Now) -> bool {
        self.is_watched(now) && self.until.take().is_some()
    }
}

/// Whether nothing comes of a pipeline but what viewers see, so that nobody misses a run that nobody
/// sees. One that runs once is not among these: its moment does not come again.
fn only_shows(pipeline: &Pipeline) -> bool {
    let is_shown = |stage: &Stage| {
        stage.is_source()
            || stage.derived_name().is_some()
            || matches!(stage, Stage::Select(_) | Stage::WallShearStress(_) | Stage::Stream(_))
    };
    matches!(pipeline.due, Due::Every(_))
        && pipeline.streams()
        && pipeline.when.is_none()
        && pipeline.stages.iter().all(is_shown)
        && pipeline.then.iter().all(|action| matches!(action, Action::Stream(_)))
}
