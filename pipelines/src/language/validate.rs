//! The rules that a well-formed configuration must keep to mean something.

use std::collections::HashSet;

use tombolo_deform::number::Number;

use super::configuration::{Config, Unwatched};
use super::derived::check_name;
use super::error::finite;
use super::file_pattern::check_file;
use super::parse::Validate;
use super::pipeline::{AgainAfter, At, Due, Pipeline};
use super::reductions::check_monitor;
use super::stage::{Action, ErrorBound, OrderStage, Stage, StreamStage, Write};
use super::unread::{Found, Unread};
use super::validate_orders::{
    check_deformation, check_edit, check_guard, check_schedule, check_settings,
};
use super::{Problem, TimeStatistics, monitors};
use crate::limits::{Exceeded, NAME, PIPELINES, VIEWS};

impl From<Exceeded> for Problem {
    fn from(exceeded: Exceeded) -> Self {
        Problem::new(exceeded.to_string())
    }
}

impl Validate for Config {
    fn validate(&self) -> Result<(), Problem> {
        self.problems_beside(&Unread::default()).first()
    }

    fn problems(&self) -> Vec<Problem> {
        self.problems_beside(&Unread::default()).into_problems()
    }
}

impl Config {
    /// The problems of meaning, given what could not be read.
    pub(super) fn problems_beside(&self, unread: &Unread) -> Found {
        let mut found = Found::default();
        self.check_settings(unread, &mut found);
        let views = self.pipelines.iter().filter(|pipeline| pipeline.streams()).count();
        for count in [PIPELINES.check(self.pipelines.len()), VIEWS.check(views)] {
            found.note(count.map_err(Problem::from), |problem| problem.within("pipelines"));
        }
        let mut names = HashSet::new();
        let mut on_order = None;
        for (index, pipeline) in self.pipelines.iter().enumerate() {
            let located = |problem: Problem| problem.at(index).within("pipelines");
            if !names.insert(&pipeline.name) {
                let message = format!("two pipelines are named `{}`", pipeline.name);
                found.push(located(Problem::new(message).within("name")));
            }
            if pipeline.due == Due::OnOrder && on_order.replace(index).is_some() {
                let message = "two pipelines run on orders, expected at most one";
                found.push(located(Problem::new(message).within("on")));
            }
            found.extend(pipeline.problems(unread.is_whole(index)), located);
        }
        monitors::check(self, &mut found);
        found
    }

    fn check_settings(&self, unread: &Unread, found: &mut Found) {
        if self.version != 1 {
            let message = format!("found version {}, expected 1", self.version);
            found.push(Problem::new(message).within("version"));
        }
        if let Some(stream) = &self.stream
            && let Some(token) = &stream.token
        {
            let known = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
            if !(16..=128).contains(&token.len()) || !token.chars().all(known) {
                let message = "expected a token of 16 to 128 letters, digits, '-' or '_'";
                found.push(Problem::new(message).within("token").within("stream"));
            }
        }
        let limits = self.stream.iter().flat_map(|stream| stream.limits.problems());
        limits.for_each(|problem| found.push(problem.within("limits").within("stream")));
        let no_stream = self.stream.is_none() && !unread.of_configuration;
        let needs_stream = [
            ("wait_for_viewer", self.steering.wait_for_viewer),
            ("unwatched", self.steering.unwatched.is_some()),
        ];
        for (key, _) in needs_stream.iter().filter(|(_, is_given)| *is_given && no_stream) {
            let message = "there is no `stream`, so that no viewer could connect";
            found.push(Problem::new(message).within(key).within("steering"));
        }
        if let (Some(Unwatched::PauseAfter(_)), Some(_)) =
            (self.steering.unwatched, self.steering.resume_after)
        {
            let message = "found `resume_after` too, by which a run that is paused because nobody \
                           watches goes on while nobody does; expected one of them";
            let problem = Problem::new(message).within("pause_after").within("unwatched");
            found.push(problem.within("steering"));
        }
        for (field, unit) in &self.units {
            if unit.trim().is_empty()
                || unit.chars().any(char::is_control)
                || NAME.check(unit.chars().count()).is_err()
            {
                let message = format!("expected a unit of 1 to {} visible characters", NAME.most);
                found.push(Problem::new(message).within(field).within("units"));
            }
        }
        if self.journal.as_deref() == Some("") {
            found.push(Problem::new("expected the name of a file").within("journal"));
        }
    }
}

impl Pipeline {
    /// The problems of meaning in a pipeline by itself; `is_whole` says whether all of it could be read.
    pub(super) fn problems(&self, is_whole: bool) -> Vec<Problem> {
        let mut found = Found::default();
        if self.name.trim().is_empty()
            || self.name.chars().any(char::is_control)
            || NAME.check(self.name.chars().count()).is_err()
        {
            let message = format!("expected a name of 1 to {} visible characters", NAME.most);
            found.push(Problem::new(message).within("name"));
        }
        if let Due::At(At::Time(time)) = self.due {
            found.note(finite(time), |problem| problem.within("time").within("at"));
        }
        let mut state = Made { is_whole, ..Made::default() };
        for (index, stage) in self.stages.iter().enumerate() {
            let located = |problem: Problem| problem.within(stage.name()).at(index);
            found.note(state.check(stage, self.due), |it| located(it).within("stages"));
        }
        if is_whole {
            self.check_condition(&mut found);
        }
        if self.budget.is_some() && !matches!(self.due, Due::Every(_)) {
            let message = "a budget thins how often a pipeline runs, expected `every` beside it";
            found.push(Problem::new(message).within("budget"));
        }
        if let Some(budget) = self.budget
            && !(budget.percent > 0.0 && budget.percent <= 100.0)
        {
            let message = format!(
                "found {}, expected a number above 0 and at most 100",
                Number(budget.percent)
            );
            found.push(Problem::new(message).within("percent").within("budget"));
        }
        for (index, action) in self.then.iter().enumerate() {
            let located = |problem: Problem| problem.within(action.name()).at(index);
            found.note(state.act(action, self.due), |it| located(it).within("then"));
        }
        if let Some((index, name)) = state.unordered.filter(|_| is_whole) {
            let message = "found an edit that nothing orders, expected an `order` stage after it";
            found.push(Problem::new(message).within(name).at(index).within("stages"));
        }
        found.into_problems()
    }

    /// Checks that a condition has what belongs to it.
    fn check_condition(&self, found: &mut Found) {
        if self.due == Due::OnOrder {
            if self.when.is_some() {
                let message = "a pipeline that runs on orders has no condition";
                found.push(Problem::new(message).within("when"));
            }
            if !self.then.is_empty() {
                let message = "a pipeline that runs on orders has no `then`";
                found.push(Problem::new(message).within("then"));
            }
        }
        match &self.when {
            Some(_) if self.then.is_empty() => {
                found.push(Problem::new("found a condition without `then`").within("when"));
            }
            None => {
                if self.lasting.is_some() {
                    found.push(Problem::new("found `for` without `when`").within("for"));
                }
                if matches!(self.again_after, Some(AgainAfter::Condition(_))) {
                    let message = "found a condition without `when`";
                    found.push(Problem::new(message).within("again_after"));
                }
            }
            _ => {}
        }
    }
}

/// The things that the stages of a pipeline have made so far.
#[derive(Default)]
struct Made {
    /// Whether all stages are there: what one lacks for want of another is told only then.
    is_whole: bool,
    stages: usize,
    extract: bool,
    /// The key of the source stage.
    source: Option<&'static str>,
    /// The names of the fields that were derived, and how many stages did.
    derived: HashSet<String>,
    deriving: usize,
    /// The names of fields that were added later.
    added: HashSet<String>,
    quality: bool,
    decimates: bool,
    measured: HashSet<String>,
    settings: HashSet<&'static str>,
    /// The last edit that no order has taken up yet.
    unordered: Option<(usize, &'static str)>,
}

impl Made {
    fn check(&mut self, stage: &Stage, due: Due) -> Result<(), Problem> {
        let index = self.stages;
        self.stages += 1;
        let is_setting = matches!(stage, Stage::Deform(_) | Stage::Guard(_) | Stage::Schedule(_));
        if is_setting != (due == Due::OnOrder) {
            self.of_whole(if is_setting {
                "this stage belongs to a pipeline with `\"on\": \"order\"`"
            } else {
                "a pipeline with `\"on\": \"order\"` has only the stages `deform`, `guard` and `schedule`"
            })?;
        }
        if !monitors::needs_no_mesh(stage, due) {
            self.of_whole(
                "a pipeline with `\"on\": \"end\"` has only the stages `difference`, `csv` and `log`: \
                 there is no mesh any more",
            )?;
        }
        if is_setting && !self.settings.insert(stage.name()) {
            return Err(Problem::new("found twice, expected at most once"));
        }
        if let Some(edit) = stage.edit() {
            self.unordered = Some((index, stage.name()));
            return check_edit(&edit);
        }
        if stage.is_source() {
            self.source.get_or_insert(stage.name());
        }
        match stage {
            Stage::Surface {} => self.source(),
            Stage::Slice(slice) => self.source().and_then(|()| slice.check()),
            Stage::Contour(contour) => self.source().and_then(|()| contour.check()),
            Stage::Threshold(threshold) => self.source().and_then(|()| threshold.check()),
            Stage::Clip(clip) => self.source().and_then(|()| clip.check()),
            Stage::Probe(probe) => self.source().and_then(|()| probe.check()),
            Stage::Streamlines(lines) => self.source().and_then(|()| lines.check()),
            Stage::Glyphs(glyphs) => self.source().and_then(|()| glyphs.check()),
            Stage::Gradient(_)
            | Stage::Vorticity(_)
            | Stage::Divergence(_)
            | Stage::QCriterion(_)
            | Stage::Magnitude(_) => self.derives(stage),
            Stage::Expression(formula) => self.derives(stage).and_then(|()| formula.check()),
            Stage::Select(select) => {
                let mut known = HashSet::new();
                match select.fields.iter().position(|field| !known.insert(field)) {
                    Some(index) => {
                        Err(Problem::new("found the same field twice").at(index).within("fields"))
                    }
                    None => Ok(()),
                }
            }
            Stage::Quality {} if std::mem::replace(&mut self.quality, true) => {
                Err(Problem::new("found twice, expected at most once"))
            }
            Stage::Statistics(stage) => {
                stage.check().and_then(|()| self.measures(stage.name(), stage.name.is_some()))
            }
            Stage::Integrate(stage) => {
                stage.check(self.may_be_on_surface()).and_then(|()| self.reduces(&stage.name))
            }
            Stage::Histogram(stage) => {
                stage.check(self.may_be_on_surface()).and_then(|()| self.reduces(&stage.name))
            }
            Stage::Force(stage) => {
                stage.check(self.may_be_on_surface()).and_then(|()| self.reduces(&stage.name))
            }
            Stage::WallShearStress(stage) => {
                stage.check(self.may_be_on_surface()).and_then(|()| self.adds(stage.name()))
            }
            Stage::Difference(stage) => check_monitor(&stage.name),
            Stage::TimeStatistics(stage) => {
                stage.check().and_then(|()| self.time_statistics(stage))
            }
            Stage::Spectrum(stage) => stage.check().and_then(|()| self.measures(&stage.name, true)),
            Stage::Csv(csv) => csv.check(),
            Stage::Set(parameter) => finite(parameter.value).map_err(|it| it.within("value")),
            Stage::Decimate(_) if std::mem::replace(&mut self.decimates, true) => {
                Err(Problem::new("found twice, expected at most once"))
            }
            Stage::Decimate(decimate) => decimate.check(),
            Stage::Stream(stream) => self.stream(stream),
            Stage::Write(write) => self.write(write),
            Stage::Render(render) => render.check(),
            Stage::Order(order) => self.order(order),
            Stage::Deform(deform) => check_deformation(deform),
            Stage::Guard(guard) => check_guard(guard),
            Stage::Schedule(schedule) => check_schedule(schedule),
            _ => Ok(()),
        }
    }

    /// Checks an action.
    fn act(&mut self, action: &Action, due: Due) -> Result<(), Problem> {
        match action {
            Action::Log(_) => Ok(()),
            _ if due == Due::OnEnd && !matches!(action, Action::Csv(_)) => {
                let message = "when the run ends there is no mesh any more, and nobody to obey; \
                               expected `csv` or `log`";
                self.of_whole(message)
            }
            Action::Pause {} | Action::Stop {} => Ok(()),
            Action::Stream(stream) => self.stream(stream),
            Action::Write(write) => self.write(write),
            Action::Csv(csv) => csv.check(),
            Action::Set(parameter) => finite(parameter.value).map_err(|it| it.within("value")),
            Action::Render(render) => render.check(),
            Action::Order(order) => self.order(order),
        }
    }

    /// A problem that is one only where all stages are there.
    fn of_whole(&self, message: &str) -> Result<(), Problem> {
        if self.is_whole { Err(Problem::new(message)) } else { Ok(()) }
    }

    fn source(&mut self) -> Result<(), Problem> {
        if std::mem::replace(&mut self.extract, true) {
            return Err(Problem::new("a pipeline has one source stage"));
        }
        if self.stages > self.deriving + 1 {
            let message = "a source stage must come first; only stages that derive fields may \
                           stand before it";
            return Err(Problem::new(message));
        }
        Ok(())
    }

    /// A stage that derives a field.
    fn derives(&mut self, stage: &Stage) -> Result<(), Problem> {
        if self.stages > self.deriving + 1 {
            let message = "a stage that derives a field must come before all others";
            return Err(Problem::new(message));
        }
        self.deriving += 1;
        let name = stage.derived_name().unwrap_or_default();
        check_name(name).map_err(|problem| problem.within("name"))?;
        if self.added.contains(name) || !self.derived.insert(name.to_owned()) {
            let message = format!("two stages derive a field `{name}`");
            return Err(Problem::new(message).within("name"));
        }
        Ok(())
    }

    fn may_be_on_surface(&self) -> bool {
        self.source == Some("surface") || (self.source.is_none() && !self.is_whole)
    }

    /// A stage whose monitors begin with this name.
    fn measures(&mut self, name: &str, is_given: bool) -> Result<(), Problem> {
        if self.measured.insert(name.to_owned()) {
            return Ok(());
        }
        let message = match is_given {
            true => format!("another stage has monitors named `{name}`"),
            false => "this field is measured twice, expected a `name` beside it".into(),
        };
        Err(Problem::new(message).within(if is_given { "name" } else { "field" }))
    }

    /// A stage that reduces the extract to monitors that begin with this name.
    fn reduces(&mut self, name: &str) -> Result<(), Problem> {
        if let Some(source @ ("probe" | "streamlines" | "glyphs")) = self.source {
            let message = format!("what `{source}` takes has no size to integrate over");
            return Err(Problem::new(message));
        }
        self.measures(name, true)
    }

    /// A stage that adds a field of this name.
    fn adds(&mut self, name: &str) -> Result<(), Problem> {
        if self.derived.contains(name) || !self.added.insert(name.to_owned()) {
            let message = format!("two stages derive a field `{name}`");
            return Err(Problem::new(message).within("name"));
        }
        Ok(())
    }

    fn time_statistics(&mut self, stage: &TimeStatistics) -> Result<(), Problem> {
        if stage.field.is_none() {
            return self.measures(&stage.name, true);
        }
        if self.stages > self.deriving + 1 {
            let message = "the statistics of a field must come before all stages but those that \
                           derive fields";
            return Err(Problem::new(message));
        }
        self.deriving += 1;
        stage.fields().try_for_each(|(name, _)| self.adds(&name))
    }

    fn stream(&self, stream: &StreamStage) -> Result<(), Problem> {
        if !self.extract {
            self.of_whole("nothing to stream, expected a source stage such as `surface` first")?;
        }
        check_bound(stream.error).map_err(|problem| problem.within("error"))?;
        match stream.positions {
            Some(bound) => check_bound(bound).map_err(|problem| problem.within("positions")),
            None => Ok(()),
        }
    }

    fn write(&self, write: &Write) -> Result<(), Problem> {
        let file = write.file.to_ascii_lowercase();
        let of_surfaces = [(".vtp", ".vtu"), (".pvtp", ".pvtu")];
        let found = of_surfaces.into_iter().find(|(ending, _)| file.ends_with(ending));
        if let Some((ending, other)) = found.filter(|_| !self.extract && self.is_whole) {
            let message = format!(
                "a `{ending}` file holds surfaces, expected a source stage such as `surface` first, or a `{other}` file"
            );
            return Err(Problem::new(message).within("file"));
        }
        check_file(&write.file).map_err(|problem| problem.within("file"))
    }

    fn order(&mut self, order: &OrderStage) -> Result<(), Problem> {
        if self.unordered.take().is_none() {
            self.of_whole("nothing to order, expected an edit stage before it")?;
        }
        check_settings(order.deform.as_ref(), order.guard.as_ref(), order.schedule.as_ref()).first()
    }
}

fn check_bound(bound: ErrorBound) -> Result<(), Problem> {
    let (key, value) = match bound {
        ErrorBound::Lossless => return Ok(()),
        ErrorBound::Relative(value) => ("relative", value),
        ErrorBound::Absolute(value) => ("absolute", value),
    };
    if value.is_finite() && value > 0.0 && (key == "absolute" || value <= 0.5) {
        return Ok(());
    }
    let most = if key == "relative" { " and at most 0.5" } else { "" };
    Err(Problem::new(format!("found {value}, expected a number above 0{most}")).within(key))
}
