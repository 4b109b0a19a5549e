//! Extracts of a running solver: surfaces, cuts, parts and fields, from borrowed arrays to compact
//! copies.
//!
//! [`Source`] keeps what does not change while a channel's cells stay the same;
//! [`Source::surface`], [`Source::slice`], [`Source::contour`], [`Source::threshold`],
//! [`Source::clip`], [`Source::probe`], [`Source::streamlines`], [`Source::glyphs`] and [`Source::whole`] then make an [`Extract`] of the channel
//! as it is now. The parts of an extract that depend on the mesh alone stay in a [`Kept`].

mod bins;
mod blocks;
mod check;
mod clip;
mod cut;
mod decimate;
mod decompose;
mod error;
mod function;
mod gather;
mod glyphs;
mod input;
mod layout;
mod merge;
mod pattern;
mod positions;
mod probe;
mod search;
mod seeds;
mod shown;
mod skin;
mod source;
mod statistics;
mod streamlines;
mod supports;
mod take;
mod walls;

pub use check::{ChannelError, check_field_length, check_names};
pub(crate) use decimate::Decimation;
pub use error::ExtractError;
pub(crate) use error::{unknown_feature, unknown_field};
pub(crate) use function::unit;
pub(crate) use gather::check_length;
pub use input::Input;
pub(crate) use merge::merged;
pub use pattern::Kept;
pub(crate) use shown::{Shown, shown};
pub(crate) use skin::skin;
pub use source::{Extracted, MeshKey, Source};
pub(crate) use statistics::CHUNK;
pub use statistics::{FieldStatistics, statistics};
pub(crate) use supports::Support;
pub(crate) use walls::Walls;

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use tombolo_deform::mesh::{ArrayView, Cells, MeshView, NumberType, Vector};

use tombolo_deform::names::hint;

/// The entities that a field has one value for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Association {
    /// Each vertex.
    Vertex,
    /// Each cell.
    Element,
    /// The mesh as a whole: any number of values, whatever the number of vertices and cells.
    /// Viewers do not get them.
    Mesh,
}

impl std::fmt::Display for Association {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Association::Vertex => "vertex",
            Association::Element => "element",
            Association::Mesh => "mesh",
        })
    }
}

/// A field that owns its values.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// The entities that it has one value for.
    pub association: Association,
    /// Components of each value: 1 for a scalar, 3 for a vector, up to 9.
    pub components: usize,
    /// The type of number that files hold; the values are those of this type. Whole numbers beyond
    /// 2^53 are rounded.
    pub number: NumberType,
    /// The values, tuple after tuple: `components` times as many as there are vertices or cells.
    pub values: Vec<f64>,
}

impl Field {
    /// Keeps to a type of number that has what was put in: no whole numbers where a value is
    /// absent.
    pub(crate) fn settle(&mut self) {
        if !self.number.is_real() && self.values.iter().any(|&value| is_absent(value)) {
            self.number = NumberType::F64;
        }
    }
}

/// The name of the element or vertex field that marks ghosts in VTK's bits: copies of another
/// rank's (1), and what is not to be shown.
pub const GHOST_FIELD: &str = "vtkGhostType";

/// The mark of a missing value in a field, as on a block of the mesh that lacks the field: a NaN of
/// its own bits, so that one that the solver computed is still told. It is not measured, files have
/// NaN there, and viewers do not get the field.
pub const ABSENT: f64 = f64::from_bits(0x7ff8_6162_7365_6e74);

/// Whether a value is [`ABSENT`].
#[must_use]
pub fn is_absent(value: f64) -> bool {
    value.to_bits() == ABSENT.to_bits()
}

/// A field borrowed from the solver.
#[derive(Debug, Clone, Copy)]
pub struct FieldView<'a> {
    /// Its name.
    pub name: &'a str,
    /// The entities that it has one value for.
    pub association: Association,
    /// The values, one tuple for each vertex or cell of the channel's mesh.
    pub values: ArrayView<'a>,
}

impl<'a> FieldView<'a> {
    /// A field with a value for each vertex: a scalar, or a tuple of up to 9 components.
    ///
    /// ```
    /// use tombolo_pipelines::extract::FieldView;
    ///
    /// let (temperature, velocity) = (vec![293.15; 8], vec![[0.0_f32; 3]; 8]);
    /// assert_eq!(FieldView::vertex("temperature", &temperature).values.components(), 1);
    /// assert_eq!(FieldView::vertex("velocity", &velocity).values.components(), 3);
    /// ```
    #[must_use]
    pub fn vertex(name: &'a str, values: impl Into<ArrayView<'a>>) -> Self {
        Self { name, association: Association::Vertex, values: values.into() }
    }

    /// A field with a value for each cell: a scalar, or a tuple of up to 9 components.
    #[must_use]
    pub fn element(name: &'a str, values: impl Into<ArrayView<'a>>) -> Self {
        Self { name, association: Association::Element, values: values.into() }
    }
}

/// One mesh of the solver with its fields, borrowed for the length of one call.
#[derive(Debug, Clone, Copy)]
pub struct Channel<'a> {
    /// The channel's name, by which pipelines choose it.
    pub name: &'a str,
    /// The mesh as it is now.
    pub mesh: MeshView<'a>,
    /// The fields on it.
    pub fields: &'a [FieldView<'a>],
}

impl<'a> Channel<'a> {
    /// A mesh by the name of its channel, with its fields.
    #[must_use]
    pub fn new(name: &'a str, mesh: MeshView<'a>, fields: &'a [FieldView<'a>]) -> Self {
        Self { name, mesh, fields }
    }

    /// The channel of this name; without one the first.
    ///
    /// # Errors
    /// A text that names the channels that there are, and the nearest.
    pub fn find<'c>(channels: &'c [Channel<'a>], name: Option<&str>) -> Result<&'c Self, String> {
        let found = match name {
            None => channels.first(),
            Some(name) => channels.iter().find(|channel| channel.name == name),
        };
        found.ok_or_else(|| {
            let known: Vec<&str> = channels.iter().map(|channel| channel.name).collect();
            let Some(name) = name.filter(|_| !known.is_empty()) else {
                return "the solver has no channel".to_owned();
            };
            let hint = hint(name, known.iter().copied());
            format!(
                "the solver has no channel `{name}`; its channels are {}{hint}",
                known.join(", ")
            )
        })
    }
}

/// All that a solver shows of one step.
#[derive(Debug, Clone, Copy)]
pub struct Snapshot<'a> {
    /// The step's number.
    pub cycle: u64,
    /// The simulated time.
    pub time: f64,
    /// The meshes and their fields; the first is the one that a pipeline without a `channel` reads.
    pub channels: &'a [Channel<'a>],
}

/// The features that the cells of an extract belong to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExtractFeatures {
    /// The features' names.
    pub names: Vec<String>,
    /// For each cell, the index of its feature in `names`.
    pub of_cells: Vec<u32>,
}

/// An extract, taken out of a channel by a source stage: a copy of its own, small against the mesh
/// unless it is the whole mesh.
///
/// Invariants: cells name only points that exist, fields have one tuple for each point or cell,
/// every number is finite, or in a field [`ABSENT`]. What stays the same from step to step is
/// shared, not copied.
#[derive(Debug, Clone, PartialEq)]
pub struct Extract {
    /// The coordinates of each point.
    pub points: Vec<Vector>,
    /// The vertex of the solver's mesh that each point is; `None` where points lie between
    /// vertices, as in a slice.
    pub vertices: Option<Arc<[u32]>>,
    /// The cells by the numbers of the points.
    pub cells: Arc<Cells>,
    /// The features of the cells, where the source knows them.
    pub features: Option<Arc<ExtractFeatures>>,
    /// The fields.
    pub fields: Vec<Field>,
}

impl Extract {
    /// Bytes of its points, cells and fields.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let values: usize = self.fields.iter().map(|field| field.values.len()).sum();
        let cells = self.cells.bytes();
        size_of::<Vector>() * self.points.len() + cells + 8 * values
    }

    /// Some of its points, with other cells between them and the cell that each of these is a part
    /// of, whose values it has.
    pub(crate) fn part(&self, points: &[u32], cells: Arc<Cells>, owners: &[u32]) -> Self {
        let field = |field: &Field| {
            let of = |entities: &[u32]| {
                let tuple = |&entity: &u32| {
                    &field.values[entity as usize * field.components..][..field.components]
                };
                entities.iter().flat_map(tuple).copied().collect()
            };
            let values = match field.association {
                Association::Vertex => of(points),
                Association::Element => of(owners),
                Association::Mesh => field.values.clone(),
            };
            Field { values, ..field.clone() }
        };
        let of_points =
            |all: &Arc<[u32]>| points.iter().map(|&point| all[point as usize]).collect();
        let features = self.features.as_ref().map(|features| {
            let of_cells = owners.iter().map(|&cell| features.of_cells[cell as usize]).collect();
            ExtractFeatures { names: features.names.clone(), of_cells }.into()
        });
        Self {
            points: points.iter().map(|&point| self.points[point as usize]).collect(),
            vertices: self.vertices.as_ref().map(of_points),
            cells,
            features,
            fields: self.fields.iter().map(field).collect(),
        }
    }
}
