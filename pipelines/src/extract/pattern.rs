//! Extracts but for their fields, which can be kept as long as the mesh does not move.

use std::sync::Arc;

use tombolo_deform::mesh::{Cells, Vector};

use super::Extract;
use super::cut::Cut;
use super::gather::{self, Crossing, Owners, Points, Rows};
use super::input::Input;
use super::layout::Layout;
use super::source::{Extracted, Origin};
use super::supports::Supports;

/// The part of one stage's extract that depends on the mesh alone, kept until the mesh moves.
#[derive(Debug, Default)]
pub struct Kept {
    version: u64,
    pattern: Option<Arc<Pattern>>,
}

impl Kept {
    /// The pattern of this version of the mesh; `None` where it is of another version.
    pub(super) fn of(&self, version: u64) -> Option<Arc<Pattern>> {
        self.pattern.clone().filter(|_| self.version == version)
    }

    /// Bytes of memory.
    pub(crate) fn bytes(&self) -> usize {
        self.pattern.as_ref().map_or(0, |pattern| pattern.bytes())
    }

    pub(super) fn keep(&mut self, version: u64, pattern: &Arc<Pattern>) {
        *self = Self { version, pattern: Some(Arc::clone(pattern)) };
    }
}

/// Where the points of an extract lie.
#[derive(Debug)]
pub(super) enum Base {
    /// At these vertices.
    Vertices(Arc<[u32]>),
    /// On edges.
    Crossings(Arc<Vec<Crossing>>),
    /// Among several vertices.
    Rows(Rows),
    /// In these cells, among or at vertices: the points of a probe.
    Probe(Layout, Rows),
}

/// An extract but for its fields.
#[derive(Debug)]
pub(super) struct Pattern {
    pub(super) points: Vec<Vector>,
    pub(super) base: Base,
    pub(super) cells: Arc<Cells>,
    /// The solver's cell for each cell, or of a probe for each point.
    pub(super) owners: Arc<[u32]>,
    pub(super) origin: Origin,
}

impl Pattern {
    /// Bytes of its points, cells and weights.
    fn bytes(&self) -> usize {
        let base = match &self.base {
            Base::Vertices(vertices) => 4 * vertices.len(),
            Base::Crossings(crossings) => size_of::<Crossing>() * crossings.len(),
            Base::Rows(rows) | Base::Probe(_, rows) => rows.bytes(),
        };
        let origin = match &self.origin {
            Origin::Between(supports) => supports.bytes(),
            _ => 0,
        };
        let cells = self.cells.bytes();
        size_of::<Vector>() * self.points.len() + 4 * self.owners.len() + base + cells + origin
    }

    /// The extract with the fields of this step; the pattern may be needed again.
    pub(super) fn fill(&self, input: &Input) -> Extracted {
        self.filled(input, self.points.clone())
    }

    /// The extract with the fields of this step, where the pattern is of use for no other.
    pub(super) fn fill_once(mut self, input: &Input) -> Extracted {
        let points = std::mem::take(&mut self.points);
        self.filled(input, points)
    }

    fn filled(&self, input: &Input, coordinates: Vec<Vector>) -> Extracted {
        let points = match &self.base {
            Base::Vertices(vertices) => Points::Vertices(vertices),
            Base::Crossings(crossings) => Points::Crossings(crossings),
            Base::Rows(rows) | Base::Probe(_, rows) => Points::Rows(rows),
        };
        let owners = match &self.base {
            Base::Probe(..) => Owners::OfPoints(&self.owners),
            _ => Owners::Cells(&self.owners),
        };
        let Input { channel, cycle, wanted, .. } = *input;
        let (fields, mut errors) = gather::fields(channel, cycle, wanted, &points, &owners);
        if let Base::Probe(layout, _) = &self.base {
            errors.extend(layout.error());
        }
        let vertices = match &self.base {
            Base::Vertices(vertices) => Some(Arc::clone(vertices)),
            _ => None,
        };
        let extract = Extract {
            points: coordinates,
            vertices,
            cells: Arc::clone(&self.cells),
            features: None,
            fields,
        };
        Extracted {
            extract: Arc::new(extract),
            owners: Arc::clone(&self.owners),
            errors,
            origin: self.origin.clone(),
        }
    }
}

impl From<Cut> for Pattern {
    fn from(cut: Cut) -> Self {
        let Cut { points, crossings, ends, cells, owners, .. } = cut;
        let crossings = Arc::new(crossings);
        Self {
            origin: Origin::Between(Supports::OnEdges(Arc::clone(&crossings), ends.into())),
            points,
            base: Base::Crossings(crossings),
            cells: Arc::new(cells),
            owners: owners.into(),
        }
    }
}
