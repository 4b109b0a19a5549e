//! Errors of edits.

use super::region::RegionError;
use super::skeleton::SkeletonEditError;
use crate::bounds::Bounds;
use crate::features::UnknownFeature;
use crate::harmonic::HarmonicOrder;
use crate::mesh::Vector;
use crate::number::Number;
use crate::skeleton::SkeletonError;
use crate::vector::Position;

/// An error of an edit, whatever the surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InvalidEdit {
    /// Neither features nor a region are given.
    #[error("features: there is no handle; expected features, a region, or both")]
    NoHandle,
    /// A number is NaN or infinite.
    #[error("{field}: {value} is not a finite number")]
    NotFinite {
        /// The field, and the index in it.
        field: String,
        /// The number.
        value: f64,
    },
    /// A list that must hold something is empty.
    #[error("{field}: the list is empty; expected {expected}")]
    EmptyList {
        /// The field.
        field: String,
        /// The things that it should hold.
        expected: &'static str,
    },
    /// A direction has the length 0.
    #[error("{field}: expected a direction, whose length is not 0")]
    NoDirection {
        /// The field.
        field: String,
    },
    /// A box whose lower corner is above its upper one.
    #[error("{field}: {} is above the upper corner's {}", Number(*lower), Number(*upper))]
    TurnedBox {
        /// The field, and the axis.
        field: String,
        /// The lower corner's coordinate.
        lower: f64,
        /// The upper corner's.
        upper: f64,
    },
    /// A radius below 0.
    #[error("{field}: {} is below 0", Number(*radius))]
    NegativeRadius {
        /// The field.
        field: String,
        /// The radius.
        radius: f64,
    },
    /// Two fields that exclude each other, or two of which one is needed.
    #[error("{field}: expected either {first} or {second}")]
    EitherOr {
        /// The field at fault.
        field: String,
        /// One way to give it.
        first: &'static str,
        /// The other way.
        second: &'static str,
    },
    /// Two lists that go together differ in length.
    #[error("values: found {values} values for {vertices} vertices, expected one for each")]
    Lengths {
        /// How many vertices there are.
        vertices: usize,
        /// How many values.
        values: usize,
    },
    /// A vertex is named twice.
    #[error(
        "vertices[{second}]: vertex {vertex} is also vertices[{first}]; expected each vertex once"
    )]
    VertexTwice {
        /// The vertex, by mesh vertex number.
        vertex: u32,
        /// Where it stands first.
        first: usize,
        /// Where it stands again.
        second: usize,
    },
    /// The name of a layer cannot be shown.
    #[error("name: expected 1 to {} visible characters", crate::limits::NAME.most)]
    Name,
}

impl InvalidEdit {
    /// The way to the fault from the edit's body, as in `region.box.lower[0]`.
    #[must_use]
    pub fn field(&self) -> String {
        match self {
            InvalidEdit::NoHandle => "features".into(),
            InvalidEdit::NotFinite { field, .. }
            | InvalidEdit::EmptyList { field, .. }
            | InvalidEdit::NoDirection { field }
            | InvalidEdit::TurnedBox { field, .. }
            | InvalidEdit::NegativeRadius { field, .. }
            | InvalidEdit::EitherOr { field, .. } => field.clone(),
            InvalidEdit::Lengths { .. } => "values".into(),
            InvalidEdit::VertexTwice { second, .. } => format!("vertices[{second}]"),
            InvalidEdit::Name => "name".into(),
        }
    }
}

/// Refuses numbers that are not finite, naming the index in a field of several.
pub(super) fn finite(field: &str, values: &[f64]) -> Result<(), InvalidEdit> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) if values.len() > 1 => {
            Err(InvalidEdit::NotFinite { field: format!("{field}[{index}]"), value: values[index] })
        }
        Some(index) => {
            Err(InvalidEdit::NotFinite { field: field.to_string(), value: values[index] })
        }
        None => Ok(()),
    }
}

/// Why a stack of edits has no displacement. `edit` is the index of the edit in the stack, from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EditError {
    /// An edit that is wrong whatever the surface.
    #[error("edit {edit} ({name}): {source}")]
    Invalid {
        /// The index of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The error.
        source: InvalidEdit,
    },
    /// A feature that the surface does not have.
    #[error("edit {edit} ({name}): {field}: {source}")]
    UnknownFeature {
        /// The index of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The field that names the feature: features or fixed.
        field: &'static str,
        /// The name, those like it, and the features there are.
        source: UnknownFeature,
    },
    /// A region that does not fit the surface.
    #[error("edit {edit} ({name}): {field}.{source}")]
    Region {
        /// The index of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The field that holds the region: region or fixed_region.
        field: &'static str,
        /// The error.
        source: RegionError,
    },
    /// A region without a vertex of the surface.
    #[error("edit {edit} ({name}): {field}: no vertex of the surface lies in it{surroundings}")]
    EmptyRegion {
        /// The index of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The field that holds the region: region or fixed_region.
        field: &'static str,
        /// Where the surface is.
        surroundings: Box<Surroundings>,
    },
    /// No vertex of the features lies in the region.
    #[error(
        "edit {edit} ({name}): region: no vertex of {features:?} lies in it, though {vertices} other vertices do"
    )]
    NothingInCommon {
        /// The index of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The features.
        features: Vec<String>,
        /// How many vertices the region has.
        vertices: usize,
    },
    /// Fixed parts hold the whole handle.
    #[error(
        "edit {edit} ({name}): every vertex of {handle} is also fixed, so that nothing can move"
    )]
    HandleFixed {
        /// The index of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The handle, in words.
        handle: String,
    },
    /// A vertex of the handle has no normal to move along.
    #[error(
        "edit {edit} (scale_normals): the faces of the handle around mesh vertex {vertex} have no area or cancel out, so that it has no normal"
    )]
    NoNormal {
        /// The index of the edit.
        edit: usize,
        /// The vertex, by mesh vertex number.
        vertex: u32,
    },
    /// The faces of a handle that is to be offset do not run the same way round, and cannot be made
    /// to.
    #[error(
        "edit {edit} (scale_normals): the handle has one side only, as a Moebius strip: face {face} meets a neighbour that faces the other way, so that no side is the outer one"
    )]
    OneSided {
        /// The index of the edit.
        edit: usize,
        /// The face, as in [`Surface::faces`](crate::surface::Surface::faces).
        face: u32,
    },
    /// A displacement names a vertex that is not on the surface.
    #[error(
        "edit {edit} (displacement): vertices[{index}]: mesh vertex {vertex} is not on the surface"
    )]
    NotOnSurface {
        /// The index of the edit.
        edit: usize,
        /// The index in its list.
        index: usize,
        /// The vertex, by mesh vertex number.
        vertex: u32,
    },
    /// A displacement moves none of the vertices that it names.
    #[error(
        "edit {edit} (displacement): vertices: each of the {vertices} vertices is fixed, or outside of the features and the region, so that \
         nothing can move"
    )]
    NothingMoves {
        /// The index of the edit.
        edit: usize,
        /// How many vertices it names.
        vertices: usize,
    },
    /// A displacement is still in a file.
    #[error(
        "edit {edit} (displacement): file: {file:?} has not been read; only an edit in a file can name a file, expected vertices and values"
    )]
    Unread {
        /// The index of the edit.
        edit: usize,
        /// The file.
        file: String,
    },
    /// A surface that has no skeleton, or a drag that it does not allow.
    #[error("edit {edit} (skeleton): {source}")]
    Skeleton {
        /// The index of the edit.
        edit: usize,
        /// The error.
        source: Box<SkeletonEditError>,
    },
    /// Two vertices with the same coordinates, on open rims that are not joined, would part.
    #[error(
        "edit {edit} ({name}): mesh vertices {} and {} are at the same place but not joined, and the edit would part them; merge them, or move both sides of the seam together",
        vertices[0], vertices[1]
    )]
    OpensSeam {
        /// The index of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The vertices, by mesh vertex numbers.
        vertices: [u32; 2],
    },
    /// A coordinate would overflow.
    #[error(
        "edit {edit} ({name}): mesh vertex {vertex} would leave the range of floating-point numbers"
    )]
    OutOfRange {
        /// The index of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The vertex, by mesh vertex number.
        vertex: u32,
    },
    /// The polyharmonic equation could not be solved.
    #[error(
        "edit {edit} ({name}): the operator of harmonic order {order} could not be factored: {reason}"
    )]
    NotSolvable {
        /// The index of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The harmonic order.
        order: HarmonicOrder,
        /// Why.
        reason: String,
    },
    /// It was given up: see [`Editor::with_cancellation`](super::Editor::with_cancellation).
    #[error("it was given up before its displacement was known")]
    Cancelled,
}

/// Where a surface is that has nothing in a region.
#[derive(Debug, Clone, PartialEq)]
pub struct Surroundings {
    /// The nearest mesh vertex, where it lies, and its distance from the region.
    pub nearest: Option<(u32, Vector, f64)>,
    /// The bounding box of the reference surface.
    pub bounds: Bounds,
}

impl std::fmt::Display for Surroundings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some((vertex, point, distance)) = self.nearest {
            let distance = Number(distance);
            write!(
                f,
                "; the nearest, mesh vertex {vertex} at {}, is {distance:.7} away",
                Position(point)
            )?;
        }
        let Bounds { lower, upper } = self.bounds;
        write!(f, "; the surface reaches from {} to {}", Position(lower), Position(upper))
    }
}

impl EditError {
    pub(super) fn skeleton(edit: usize, source: SkeletonEditError) -> Self {
        match source {
            SkeletonEditError::Extraction(SkeletonError::Cancelled) => Self::Cancelled,
            source => Self::Skeleton { edit, source: Box::new(source) },
        }
    }
}
