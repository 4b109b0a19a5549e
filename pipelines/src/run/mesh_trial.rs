//! Pipelines and orders tried on a mesh before a run.

use std::sync::Arc;

use tombolo_deform::communicator::Solo;
use tombolo_deform::edit::{Edit, EditError, Editor};
use tombolo_deform::features::UnknownFeature;
use tombolo_deform::shape::Deformation;
use tombolo_deform::surface::Surface;

use super::history::{Board, History};
use super::pipeline::Prepared;
use crate::extract::{Channel, Snapshot, Source};
use crate::files::read_displacement;
use crate::language::{Action, Config, Due, Formula, Monitored, Problem, Stage, Trial, monitors};

/// A mesh on which pipelines and orders are tried, as a run would show it at its first step.
///
/// A pipeline is run as in a run, once, whatever its condition and whenever it is due; what it would
/// stream, write and order goes nowhere. So what is wrong is what a run would say: fields and
/// features that are not there, fields of another association or of other components than a stage
/// takes, points in no cell. The solver's parameters are not known: they count as 1.
///
/// # Example
/// ```
/// use std::sync::Arc;
/// use tombolo_deform::{features::FeatureSettings, mesh::MeshView, shapes, surface::Surface};
/// use tombolo_pipelines::extract::{Channel, FieldView};
/// use tombolo_pipelines::language::check_content;
/// use tombolo_pipelines::run::MeshTrial;
///
/// let mesh = shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
/// let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?);
/// let pressure = vec![0.0; mesh.points().len()];
/// let fields = [FieldView::vertex("pressure", &pressure)];
/// let mut trial =
///     MeshTrial::new(Channel::new("mesh", MeshView::from(&mesh), &fields), surface);
/// let errors = check_content(
///     r#"{"version": 1, "pipelines": [{"name": "p", "stages": [{"statistics": {"field": "presure"}}]}]}"#,
///     "views.json",
///     Some(&mut trial),
/// )
/// .unwrap_err();
/// assert_eq!(
///     errors.to_string(),
///     "views.json:1:80: pipelines[0].stages[0].statistics.field: the channel has no field \
///      `presure`; its fields are pressure; did you mean `pressure`?"
/// );
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct MeshTrial<'a> {
    channel: Channel<'a>,
    /// The name of the one channel that the mesh is.
    only: Option<String>,
    surface: Arc<Surface>,
    editor: Option<Editor>,
}

impl<'a> MeshTrial<'a> {
    /// A trial on the mesh of a channel, with its surface. The mesh stands for every channel.
    #[must_use]
    pub fn new(channel: Channel<'a>, surface: Arc<Surface>) -> Self {
        Self { channel, only: None, surface, editor: None }
    }

    /// Tries only the pipelines that read the channel of this name.
    #[must_use]
    pub fn of_channel(self, name: impl Into<String>) -> Self {
        Self { only: Some(name.into()), ..self }
    }

    fn reads(&self, channel: Option<&str>) -> bool {
        self.only.as_deref().is_none_or(|only| channel == Some(only))
    }

    fn run(&self, config: &Config, monitored: &Monitored<'_>, index: usize) -> Vec<Problem> {
        // A pipeline that cannot be prepared was told already.
        let Ok(mut prepared) = Prepared::new(monitored, index) else { return Vec::new() };
        let histories = config.pipelines.iter().map(|pipeline| {
            let monitors = monitors(pipeline).split_off(2);
            History::new(monitors)
        });
        let formulas = config.pipelines[index].stages.iter().filter_map(|stage| match stage {
            Stage::Expression(formula) => Some(formula),
            _ => None,
        });
        let parameters = formulas.flat_map(Formula::parameters).map(|(_, name)| (name, 1.0));
        let board = Board { histories: histories.collect(), parameters: parameters.collect() };
        let communicator: Arc<dyn tombolo_deform::communicator::Communicator> = Arc::new(Solo);
        let channels = [self.channel];
        let snapshot = Snapshot { cycle: 0, time: 0.0, channels: &channels };
        match Source::distributed(&self.channel, &communicator) {
            Ok(mut source) => {
                source.set_surface(&self.surface);
                prepared.check_all(&snapshot, &mut source, &*communicator, &board)
            }
            Err(error) => vec![Problem::new(error.to_string())],
        }
    }
}

impl Trial for MeshTrial<'_> {
    fn configuration(&mut self, config: &Config, is_sound: &dyn Fn(usize) -> bool) -> Vec<Problem> {
        let mut problems = Vec::new();
        let unconditional = unconditional(config);
        let monitored = Monitored::of(&unconditional.pipelines);
        for (index, pipeline) in config.pipelines.iter().enumerate() {
            if !self.reads(pipeline.channel.as_deref()) || !is_sound(index) {
                continue;
            }
            let mut of_pipeline = match pipeline.due {
                Due::OnOrder | Due::OnEnd => Vec::new(),
                _ => self.run(&unconditional, &monitored, index),
            };
            for (index, stage) in pipeline.stages.iter().enumerate() {
                let found = match (stage, stage.edit()) {
                    (_, Some(edit)) => self.edit(edit),
                    (Stage::Deform(deform), _) => self.deformation(deform),
                    (Stage::Order(order), _) => self.deformation_of(order.deform.as_ref()),
                    _ => Vec::new(),
                };
                let located = |it: Problem| it.within(stage.name()).at(index).within("stages");
                of_pipeline.extend(found.into_iter().map(located));
            }
            for (index, action) in pipeline.then.iter().enumerate() {
                let Action::Order(order) = action else { continue };
                let found = self.deformation_of(order.deform.as_ref());
                let located = |it: Problem| it.within(action.name()).at(index).within("then");
                of_pipeline.extend(found.into_iter().map(located));
            }
            problems.extend(of_pipeline.into_iter().map(|it| it.at(index).within("pipelines")));
        }
        problems
    }

    fn edits(&mut self, edits: &[Edit]) -> Vec<Problem> {
        let mut problems = Vec::new();
        for (index, edit) in edits.iter().enumerate() {
            let located = |it: Problem| it.within(edit.name()).at(index);
            problems.extend(self.edit(edit.clone()).into_iter().map(located));
        }
        problems
    }

    fn deformation(&mut self, deformation: &Deformation) -> Vec<Problem> {
        let features = self.surface.features();
        let mut problems = Vec::new();
        for (key, names) in [("sliding", &deformation.sliding), ("free", &deformation.free)] {
            for (index, name) in names.iter().enumerate() {
                let found = features.index(name).err();
                let problem = found.map(|unknown| unknown_feature(&unknown).at(index).within(key));
                problems.extend(problem);
            }
        }
        problems
    }
}

impl MeshTrial<'_> {
    fn deformation_of(&mut self, deformation: Option<&Deformation>) -> Vec<Problem> {
        let problems = deformation.map(|deformation| self.deformation(deformation));
        problems.into_iter().flatten().map(|problem| problem.within("deform")).collect()
    }

    /// The problems of an edit, located within it.
    fn edit(&mut self, mut edit: Edit) -> Vec<Problem> {
        if let Edit::Displacement(import) = &mut edit
            && let Some(file) = import.file.take()
        {
            match read_displacement(&file, &self.surface) {
                Ok(found) => {
                    (import.vertices, import.values) = (found.vertices.into(), found.values.into());
                }
                Err(error) => return vec![Problem::new(error.to_string()).within("file")],
            }
        }
        if self.editor.is_none() {
            match Editor::new(Arc::clone(&self.surface)) {
                Ok(editor) => self.editor = Some(editor),
                Err(error) => return vec![Problem::new(error.to_string())],
            }
        }
        let errors = self.editor.as_mut().map(|editor| editor.check(std::slice::from_ref(&edit)));
        errors.unwrap_or_default().iter().map(|error| of_edit(&edit, error)).collect()
    }
}

/// A configuration whose pipelines act whatever their conditions say.
fn unconditional(config: &Config) -> Config {
    let mut config = config.clone();
    for pipeline in &mut config.pipelines {
        (pipeline.when, pipeline.lasting, pipeline.again_after) = (None, None, None);
    }
    config
}

fn of_edit(edit: &Edit, error: &EditError) -> Problem {
    if let EditError::UnknownFeature { field, source, .. } = error {
        let names = if *field == "fixed" { edit.fixed() } else { edit.features() };
        let index = names.iter().position(|name| *name == source.name).unwrap_or_default();
        return unknown_feature(source).at(index).within(field);
    }
    let text = error.to_string();
    let prefix = format!("edit 0 ({}): ", edit.name());
    let text = text.strip_prefix(&prefix).unwrap_or(&text);
    // Most begin with the way to what is wrong: `region.box`, `vertices[3]`.
    let is_way = |way: &str| {
        way.starts_with(|c: char| c.is_ascii_lowercase())
            && way.chars().all(|c| c.is_ascii_alphanumeric() || "_.[]".contains(c))
    };
    match text.split_once(": ").filter(|(way, _)| is_way(way)) {
        Some((way, message)) => Problem::new(message).within_path(way),
        None => Problem::new(text),
    }
}

fn unknown_feature(unknown: &UnknownFeature) -> Problem {
    let UnknownFeature { name, near, features } = unknown;
    let message = format!("there is no feature `{name}`; the features are {}", features.join(", "));
    Problem::new(message).suggest(near.first().map(String::as_str))
}
