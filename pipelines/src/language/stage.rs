//! The stages of a pipeline, and the actions of one whose condition holds.

use std::num::NonZeroU32;

use super::{
    Clip, Contour, Csv, Decimate, Deformation, Derived, Difference, Force, Formula, Glyphs,
    Histogram, Integrate, Log, Parameter, Probe, Render, Slice, Spectrum, Statistics, Streamlines,
    Threshold, TimeStatistics, WallShearStress,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tombolo_deform::edit::{
    Affine, Displacement, Edit, Rotate, ScaleDirection, ScaleNormals, SkeletonEdit, Translate,
};
use tombolo_deform::quality::Guard;
use tombolo_deform::schedule::Schedule;

/// One stage of a pipeline.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Stage {
    /// Takes the boundary of the mesh, with its features. A source stage: it comes before any other
    /// but those that derive fields.
    Surface {},
    /// Cuts the mesh with a plane, several planes, a cylinder or a sphere. A source stage.
    Slice(Slice),
    /// Takes the surfaces on which a vertex field has given values. A source stage.
    Contour(Contour),
    /// Takes the cells in which a field keeps to a range. A source stage.
    Threshold(Threshold),
    /// Takes the part of the volume on one side of a plane, in or around a box or a sphere, or by a
    /// field. A source stage.
    Clip(Clip),
    /// Takes the fields at points, on a line or on a grid. A source stage.
    Probe(Probe),
    /// Takes lines along a vector field. A source stage.
    Streamlines(Streamlines),
    /// Takes arrows or spheres that show a field, as triangles. A source stage.
    Glyphs(Glyphs),
    /// Derives the gradient of a field: of each component its derivatives along x, y and z. At a
    /// vertex it is the mean over the cells around; an element field is first brought to the
    /// vertices as the mean over the cells around each.
    Gradient(Derived),
    /// Derives the vorticity of a vector field, the curl; from derivatives as `gradient` has them.
    Vorticity(Derived),
    /// Derives the divergence of a vector field, from derivatives as `gradient` has them.
    Divergence(Derived),
    /// Derives the Q criterion of a velocity, `-(g_xx^2 + g_yy^2 + g_zz^2) / 2 - g_xy g_yx - g_xz
    /// g_zx - g_yz g_zy`, from derivatives `g` as `gradient` has them: above 0 a vortex turns
    /// faster than it is strained.
    QCriterion(Derived),
    /// Derives the magnitude of a field.
    Magnitude(Derived),
    /// Derives a field by formulas.
    Expression(Formula),
    /// Leaves only some fields.
    Select(Select),
    /// Measures the cells: monitors `quality.min`, `quality.mean`, `quality.max` and
    /// `quality.inverted`, and the element field `scaled_jacobian`, where the solver has none of that
    /// name.
    Quality {},
    /// Measures a field: monitors `<field>.min`, `.max`, `.mean`, `.l2` (of the magnitude, for a
    /// vector) and `.non_finite`.
    Statistics(Statistics),
    /// Integrates over the extract, or over the whole mesh where no stage has taken one: monitors
    /// `<name>.size` (length, area or volume), and those of a scalar and of a vector field.
    Integrate(Integrate),
    /// Counts how the values of a field are spread over the extract, or over the whole mesh where
    /// no stage has taken one.
    Histogram(Histogram),
    /// Adds up the force of the fluid on the surface, by pressure and friction, and its moment.
    Force(Force),
    /// Derives the shear of the flow on the faces of the surface.
    WallShearStress(WallShearStress),
    /// Takes one monitor from another.
    Difference(Difference),
    /// Follows a monitor or a field over time.
    TimeStatistics(TimeStatistics),
    /// Finds the frequencies in a monitor.
    Spectrum(Spectrum),
    /// Leaves fewer triangles for what is streamed and written after it: monitors
    /// `decimate.error`, the largest distance of a point from what is left, and
    /// `decimate.triangles`.
    Decimate(Decimate),
    /// Sends the extract to the viewers as the view of this pipeline; of volume cells their outside. While
    /// nobody watches and nothing records, a pipeline of which nothing else comes rests.
    Stream(StreamStage),
    /// Writes the extract, or the whole mesh where no stage has extracted anything, to a file.
    Write(Write),
    /// Writes monitors to a table, a row each time.
    Csv(Csv),
    /// Says monitors in the log, a line each time.
    Log(Log),
    /// Draws pictures of the extract, or of the outside of the whole mesh where no stage has taken
    /// one.
    Render(Box<Render>),
    /// An edit of the shape, for `order`.
    Translate(Translate),
    /// An edit of the shape, for `order`.
    Rotate(Rotate),
    /// An edit of the shape, for `order`.
    ScaleDirection(ScaleDirection),
    /// An edit of the shape, for `order`.
    ScaleNormals(ScaleNormals),
    /// An edit of the shape, for `order`.
    Affine(Affine),
    /// An edit of the shape, for `order`.
    Displacement(Displacement),
    /// An edit of the shape, for `order`.
    Skeleton(SkeletonEdit),
    /// Orders the edits of the stages before it.
    Order(OrderStage),
    /// How the motion of the surface is carried into the volume. Only with `"on": "order"`.
    Deform(Deformation),
    /// The guard that the mesh must keep to. Only with `"on": "order"`.
    Guard(Guard),
    /// In how many steps the shape is reached. Only with `"on": "order"`.
    Schedule(Schedule),
    /// Pauses the solver.
    Pause {},
    /// Asks the solver to stop.
    Stop {},
    /// Gives a parameter of the solver a new value.
    Set(Parameter),
}

impl Stage {
    /// The stage's key in JSON.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Stage::Surface {} => "surface",
            Stage::Slice(_) => "slice",
            Stage::Contour(_) => "contour",
            Stage::Threshold(_) => "threshold",
            Stage::Clip(_) => "clip",
            Stage::Probe(_) => "probe",
            Stage::Streamlines(_) => "streamlines",
            Stage::Glyphs(_) => "glyphs",
            Stage::Gradient(_) => "gradient",
            Stage::Vorticity(_) => "vorticity",
            Stage::Divergence(_) => "divergence",
            Stage::QCriterion(_) => "q_criterion",
            Stage::Magnitude(_) => "magnitude",
            Stage::Expression(_) => "expression",
            Stage::Select(_) => "select",
            Stage::Quality {} => "quality",
            Stage::Statistics(_) => "statistics",
            Stage::Integrate(_) => "integrate",
            Stage::Histogram(_) => "histogram",
            Stage::Force(_) => "force",
            Stage::WallShearStress(_) => "wall_shear_stress",
            Stage::Difference(_) => "difference",
            Stage::TimeStatistics(_) => "time_statistics",
            Stage::Spectrum(_) => "spectrum",
            Stage::Decimate(_) => "decimate",
            Stage::Stream(_) => "stream",
            Stage::Write(_) => "write",
            Stage::Csv(_) => "csv",
            Stage::Log(_) => "log",
            Stage::Render(_) => "render",
            Stage::Translate(_) => "translate",
            Stage::Rotate(_) => "rotate",
            Stage::ScaleDirection(_) => "scale_direction",
            Stage::ScaleNormals(_) => "scale_normals",
            Stage::Affine(_) => "affine",
            Stage::Displacement(_) => "displacement",
            Stage::Skeleton(_) => "skeleton",
            Stage::Order(_) => "order",
            Stage::Deform(_) => "deform",
            Stage::Guard(_) => "guard",
            Stage::Schedule(_) => "schedule",
            Stage::Pause {} => "pause",
            Stage::Stop {} => "stop",
            Stage::Set(_) => "set",
        }
    }

    /// Whether the stage takes an extract out of the mesh.
    #[must_use]
    pub fn is_source(&self) -> bool {
        matches!(
            self,
            Stage::Surface {}
                | Stage::Slice(_)
                | Stage::Contour(_)
                | Stage::Threshold(_)
                | Stage::Clip(_)
                | Stage::Probe(_)
                | Stage::Streamlines(_)
                | Stage::Glyphs(_)
        )
    }

    /// Whether the stage takes faces out of a mesh of volume cells: a boundary or a cut.
    #[must_use]
    pub fn takes_faces(&self) -> bool {
        matches!(self, Stage::Surface {} | Stage::Slice(_) | Stage::Contour(_))
    }

    /// The name of the field that the stage derives from those of the mesh, if it derives one.
    #[must_use]
    pub fn derived_name(&self) -> Option<&str> {
        match self {
            Stage::Gradient(derived)
            | Stage::Vorticity(derived)
            | Stage::Divergence(derived)
            | Stage::QCriterion(derived)
            | Stage::Magnitude(derived) => Some(derived.name.as_deref().unwrap_or(self.name())),
            Stage::Expression(formula) => Some(&formula.name),
            _ => None,
        }
    }

    /// The names of all fields that the stage adds to those of the solver.
    #[must_use]
    pub fn added_fields(&self) -> Vec<String> {
        match self {
            Stage::WallShearStress(stress) => vec![stress.name().to_owned()],
            Stage::TimeStatistics(statistics) => {
                statistics.fields().map(|(name, _)| name).collect()
            }
            _ => self.derived_name().map(str::to_owned).into_iter().collect(),
        }
    }

    /// The edit that the stage is, if it is one.
    #[must_use]
    pub fn edit(&self) -> Option<Edit> {
        match self {
            Stage::Translate(edit) => Some(Edit::Translate(edit.clone())),
            Stage::Rotate(edit) => Some(Edit::Rotate(edit.clone())),
            Stage::ScaleDirection(edit) => Some(Edit::ScaleDirection(edit.clone())),
            Stage::ScaleNormals(edit) => Some(Edit::ScaleNormals(edit.clone())),
            Stage::Affine(edit) => Some(Edit::Affine(edit.clone())),
            Stage::Displacement(edit) => Some(Edit::Displacement(edit.clone())),
            Stage::Skeleton(edit) => Some(Edit::Skeleton(edit.clone())),
            _ => None,
        }
    }
}

/// A stage or an action that writes files.
#[derive(Clone, Copy)]
pub(crate) enum FileSink<'a> {
    Write(&'a Write),
    Csv(&'a Csv),
    Render(&'a Render),
}

impl<'a> FileSink<'a> {
    /// The name of its files, as it is written in the configuration.
    pub(crate) fn file(self) -> &'a str {
        match self {
            FileSink::Write(write) => &write.file,
            FileSink::Csv(csv) => &csv.file,
            FileSink::Render(render) => &render.file,
        }
    }
}

impl Stage {
    /// The stage as one that writes files, if it is.
    pub(crate) fn file_sink(&self) -> Option<FileSink<'_>> {
        match self {
            Stage::Write(write) => Some(FileSink::Write(write)),
            Stage::Csv(csv) => Some(FileSink::Csv(csv)),
            Stage::Render(render) => Some(FileSink::Render(render)),
            _ => None,
        }
    }
}

/// An action of a pipeline whose condition holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Action {
    /// Pauses the solver.
    Pause {},
    /// Asks the solver to stop.
    Stop {},
    /// Sends the extract to the viewers.
    Stream(StreamStage),
    /// Writes the extract, or the whole mesh where no stage has extracted anything, to a file.
    Write(Write),
    /// Writes monitors to a table, a row each time.
    Csv(Csv),
    /// Says monitors in the log, a line each time.
    Log(Log),
    /// Gives a parameter of the solver a new value.
    Set(Parameter),
    /// Draws pictures of the extract, or of the outside of the whole mesh where no stage has taken
    /// one.
    Render(Box<Render>),
    /// Orders the edits of the stages.
    Order(OrderStage),
}

impl Action {
    /// The action as one that writes files, if it is.
    pub(crate) fn file_sink(&self) -> Option<FileSink<'_>> {
        match self {
            Action::Write(write) => Some(FileSink::Write(write)),
            Action::Csv(csv) => Some(FileSink::Csv(csv)),
            Action::Render(render) => Some(FileSink::Render(render)),
            _ => None,
        }
    }

    /// The action's key in JSON.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Action::Pause {} => "pause",
            Action::Stop {} => "stop",
            Action::Stream(_) => "stream",
            Action::Write(_) => "write",
            Action::Csv(_) => "csv",
            Action::Log(_) => "log",
            Action::Set(_) => "set",
            Action::Render(_) => "render",
            Action::Order(_) => "order",
        }
    }
}

/// Fields to keep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Select {
    /// The names of the fields to keep.
    pub fields: Vec<String>,
}

/// How an extract is sent to viewers.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StreamStage {
    /// By how much a field's value may differ in the viewer.
    pub error: ErrorBound,
    /// By how much a point's coordinates may differ in the viewer; `relative` is to the diagonal of
    /// the bounding box. Without it, 1e-5 of the diagonal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub positions: Option<ErrorBound>,
}

/// By how much a number may differ after it was sent. The bound holds for every value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ErrorBound {
    /// This part of the widest range of any component over the extract.
    Relative(f64),
    /// This much, in the field's unit.
    Absolute(f64),
    /// Not at all.
    Lossless,
}

impl Default for ErrorBound {
    fn default() -> Self {
        ErrorBound::Relative(1e-3)
    }
}

/// A file to write.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Write {
    /// The file, ending in `.vtu`, `.vtp` or `.vtk`, or in `.vtpd`, `.pvtu` or `.pvtp`, which name a
    /// file in a folder beside them that holds the data. `{cycle}` and `{time}` stand for those of the
    /// step; `{cycle:4}` has four digits or more instead of six, `{time:3}` three behind the point.
    /// A relative one lies in the run's output directory. A `.pvd` file, called as the pipeline, names
    /// the files with their times, in the folder that all of them lie in or below; that of a second
    /// `write` of a pipeline has `-2` behind its name.
    pub file: String,
    /// How many of these files stay: older ones are deleted, and leave their `.pvd`. Left out, all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub keep: Option<NonZeroU32>,
}

/// How the edits of a pipeline are ordered. What is left out is taken from the pipeline with
/// `"on": "order"`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OrderStage {
    /// In how many steps the shape is reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub schedule: Option<Schedule>,
    /// How the motion of the surface is carried into the volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deform: Option<Deformation>,
    /// The guard that the mesh must keep to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub guard: Option<Guard>,
}
