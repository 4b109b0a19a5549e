//! What is kept of a channel from step to step: whatever cannot be lent as it lies in the solver's
//! memory.

use std::collections::HashMap;

use tombolo_deform::bounds::Bounds;
use tombolo_deform::mesh::{
    ArrayView, Cells, CellsView, FeatureSource, Indices, Mesh, MeshView, TaggedFaces,
    TaggedVertices, Values, Vector, ghosts,
};
use tombolo_pipelines::extract::{ABSENT, Association, FieldView, GHOST_FIELD};

use super::channel::Channel;
use super::field::{self, Field};
use crate::foreign::array::{Array, Fingerprint, NumberType};
use crate::foreign::error::RunError;

/// A field that had to be copied.
#[derive(Debug, Default)]
struct Copied {
    name: String,
    association: Option<Association>,
    components: usize,
    number: NumberType,
    values: Vec<f64>,
}

impl Copied {
    /// Begins anew with a field of this kind.
    fn begin(&mut self, field: &Field<'_>) {
        field.name.clone_into(&mut self.name);
        self.association = Some(field.association);
        self.components = field.components.len();
        self.number = field.number;
        self.values.clear();
    }

    fn is_of(&self, field: &Field<'_>) -> bool {
        field.name == self.name
            && Some(field.association) == self.association
            && field.components.len() == self.components
    }

    fn append(&mut self, field: &Field<'_>, entity: usize) {
        self.values.extend(field.components.iter().map(|array| array.get(entity)));
    }
}

/// The numbers and marks that a mesh brings, copied.
#[derive(Debug, Default)]
struct Marks {
    features: FeatureSource,
    ghosts: Option<Vec<u8>>,
    global_vertices: Option<Vec<u64>>,
    global_cells: Option<Vec<u64>>,
}

/// The copies and marks that are kept of one channel.
#[derive(Debug, Default)]
pub(crate) struct Kept {
    /// That of the cells that are kept; `None` where they could not be read to their end.
    fingerprint: Option<Fingerprint>,
    /// That of the cells which passed last, and their generation: others are told from these.
    passed: Option<(Fingerprint, u64)>,
    counts: (usize, usize),
    /// Of the cells that are lent ([`CellsView::identity`]).
    identity: u64,
    generation: u64,
    newest_generation: u64,
    cells: Option<Cells>,
    points: Vec<Vector>,
    marks: Marks,
    boxes: Vec<Bounds>,
    fields: Vec<Copied>,
}

impl Kept {
    /// Brings what is kept up to date with what the solver shows. Where nobody will look at the
    /// values of this step (`looked_at`), nothing is copied or compared unless the mesh has another
    /// size. Says whether the cells are others than those that passed last.
    pub(crate) fn update(
        &mut self,
        channel: &Channel<'_>,
        looked_at: bool,
    ) -> Result<bool, RunError> {
        if !looked_at && self.suffices(channel) {
            return Ok(false);
        }
        let counts = counts(channel);
        let single = channel.single();
        let lent_cells =
            single.and_then(|domain| domain.topology.lent().map(|cells| cells.identity()));
        let lent_points = single.is_some_and(|domain| domain.coordset.lent().is_some());
        channel.check_memory()?;
        let fingerprint = channel.fingerprint();
        let is_same = self.fingerprint == Some(fingerprint);
        let is_other = self.passed.is_some_and(|(passed, _)| passed != fingerprint);
        self.counts = counts;
        if !lent_points || (!is_same && lent_cells.is_none()) {
            self.points.clear();
            if self.points.try_reserve(counts.0).is_err() {
                let found = format!("{} vertices", counts.0);
                let points = channel.label.part("data", "points");
                return Err(points.wrong(found, "as many as there is memory for"));
            }
            for block in &channel.blocks {
                block.domain.coordset.append(&mut self.points);
            }
        }
        if !is_same {
            self.fingerprint = None;
            // The cells that are back after others were refused are those that they were.
            self.generation = match self.passed {
                Some((passed, generation)) if passed == fingerprint => generation,
                _ => {
                    self.newest_generation += 1;
                    self.newest_generation
                }
            };
            self.cells = None;
            self.identity = lent_cells.unwrap_or(0);
            // Those that are lent are checked by the adaptor.
            if lent_cells.is_none() {
                self.cells = Some(cells(channel, &self.points)?);
            }
            self.marks = marks(channel)?;
            self.boxes.clone_from(&channel.boxes);
            self.fingerprint = Some(fingerprint);
        } else if self.cells.is_none() && lent_cells.is_none_or(|lent| lent != self.identity) {
            // A solver that copies its cells anew for each step, or has them in another form now:
            // one copy here, by which they are known from now on.
            self.cells = Some(cells(channel, &self.points_of(channel))?);
        }
        if lent_points {
            self.points = Vec::new();
        }
        self.copy_fields(channel);
        Ok(is_other)
    }

    /// Whether what is kept and what can be lent are the whole mesh, where nobody looks at values.
    pub(crate) fn suffices(&self, channel: &Channel<'_>) -> bool {
        let counts = counts(channel);
        let single = channel.single();
        let has_cells =
            self.cells.is_some() || single.is_some_and(|domain| domain.topology.lent().is_some());
        let has_points = self.points.len() == counts.0
            || single.is_some_and(|domain| domain.coordset.lent().is_some());
        self.fingerprint.is_some() && has_cells && has_points && counts == self.counts
    }

    /// Takes what is kept for what passed: the adaptor has refused none of it.
    pub(crate) fn pass(&mut self) {
        self.passed = self.fingerprint.map(|fingerprint| (fingerprint, self.generation));
    }

    fn points_of(&self, channel: &Channel<'_>) -> Vec<Vector> {
        let mut points = Vec::new();
        channel.blocks.iter().for_each(|block| block.domain.coordset.append(&mut points));
        points
    }

    /// Copies the fields that cannot be lent.
    fn copy_fields(&mut self, channel: &Channel<'_>) {
        let mut of_blocks: Vec<&Field<'_>> = Vec::new();
        if let Some(domain) = channel.single() {
            of_blocks.extend(
                domain.fields.iter().filter(|field| field::lent(&field.components).is_none()),
            );
        } else {
            for field in channel.blocks.iter().flat_map(|block| &block.domain.fields) {
                if !of_blocks.iter().any(|known| known.name == field.name) {
                    of_blocks.push(field);
                }
            }
        }
        let of_mesh =
            channel.of_mesh.iter().filter(|field| field::lent(&field.components).is_none());
        let of_mesh: Vec<&Field<'_>> = of_mesh.collect();
        self.fields.resize_with(of_blocks.len() + of_mesh.len(), Copied::default);
        let mut copies = self.fields.iter_mut();
        for (first, copied) in of_blocks.into_iter().zip(copies.by_ref()) {
            copied.begin(first);
            for block in &channel.blocks {
                let entities = match first.association {
                    Association::Vertex => block.domain.coordset.vertex_count(),
                    Association::Element => block.domain.topology.cell_count(),
                    Association::Mesh => 0,
                };
                let of_block = block.domain.fields.iter().find(|field| copied.is_of(field));
                if of_block.is_some_and(|field| field.number != copied.number) {
                    copied.number = NumberType::F64;
                }
                for entity in 0..entities {
                    if first.association == Association::Element && !block.mask.keeps(entity) {
                        continue;
                    }
                    match of_block {
                        Some(field) => copied.append(field, entity),
                        // Where a block says nothing of ghosts there are none.
                        None if copied.name == GHOST_FIELD => copied.values.push(0.0),
                        // A block that lacks the field has no values to show.
                        None => {
                            copied.values.extend(std::iter::repeat_n(ABSENT, copied.components))
                        }
                    }
                }
            }
        }
        for (field, copied) in of_mesh.into_iter().zip(copies) {
            copied.begin(field);
            (0..field.components.first().map_or(0, Array::len))
                .for_each(|tuple| copied.append(field, tuple));
        }
    }

    /// The mesh and its fields, as the adaptor is lent them.
    pub(crate) fn views<'a>(
        &'a self,
        channel: &'a Channel<'a>,
        fields: &mut Vec<FieldView<'a>>,
    ) -> MeshView<'a> {
        let single = channel.single();
        let points = single.and_then(|domain| domain.coordset.lent());
        let points = points.unwrap_or_else(|| ArrayView::vectors(&self.points));
        let cells = match (&self.cells, single.and_then(|domain| domain.topology.lent())) {
            (None, Some(lent)) => lent,
            (Some(kept), _) => CellsView::Owned(kept),
            (None, None) => CellsView::Uniform {
                cell_type: tombolo_deform::mesh::CellType::Tetra,
                connectivity: Indices::EMPTY,
            },
        };
        for field in single.iter().flat_map(|domain| &domain.fields).chain(&channel.of_mesh) {
            if let Some(values) = field::lent(&field.components) {
                let values = values.copied_from(field.number);
                fields.push(FieldView {
                    name: &field.name,
                    association: field.association,
                    values,
                });
            }
        }
        for copied in &self.fields {
            let values =
                ArrayView::interleaved(Values::F64(&copied.values), copied.components.max(1));
            if let (Ok(values), Some(association)) = (values, copied.association) {
                let values = values.copied_from(copied.number);
                fields.push(FieldView { name: &copied.name, association, values });
            }
        }
        let Marks { features, ghosts, global_vertices, global_cells } = &self.marks;
        MeshView {
            points,
            cells,
            features,
            generation: self.generation,
            global_vertices: global_vertices.as_deref().map(Indices::from),
            global_cells: global_cells.as_deref().map(Indices::from),
            ghost_cells: ghosts.as_deref(),
            grid_boxes: &self.boxes,
        }
    }
}

impl Channel<'_> {
    /// Its mesh, copied.
    ///
    /// # Errors
    /// [`RunError`] for arrays that make no mesh.
    pub fn to_mesh(&self) -> Result<Mesh, RunError> {
        let mut kept = Kept::default();
        kept.update(self, true)?;
        let mesh = kept.views(self, &mut Vec::new()).to_mesh();
        mesh.map_err(|source| RunError::Cells { place: self.label.place(), source })
    }
}

/// How many vertices and cells it has.
fn counts(channel: &Channel<'_>) -> (usize, usize) {
    let cells = channel.blocks.iter().map(|block| block.domain.topology.cell_count()).sum();
    (channel.vertex_count(), cells)
}

/// The cells of all blocks, one block after the other.
fn cells(channel: &Channel<'_>, points: &[Vector]) -> Result<Cells, RunError> {
    let mut cells = Cells::new();
    let mut base = 0;
    for block in &channel.blocks {
        let end = base + block.vertex_count();
        let so_far = points.get(..end).unwrap_or(points);
        block.domain.topology.append(&mut cells, base, so_far, &|cell| block.mask.keeps(cell))?;
        base = end;
    }
    if channel.has_levels() { joined(&cells, points, channel) } else { Ok(cells) }
}

/// The cells of grids of levels by the first of the vertices at each place, so that what lies
/// between two grids is no surface.
fn joined(cells: &Cells, points: &[Vector], channel: &Channel<'_>) -> Result<Cells, RunError> {
    let finest = channel.grids().map(|grid| grid.least_spacing()).fold(f64::INFINITY, f64::min);
    // Grids of one mesh have their points on one lattice, but for rounding.
    let unit = if finest.is_finite() && finest > 0.0 { finest / 8.0 } else { 1.0 };
    let lowest = Bounds::around(points.iter().copied()).lower;
    let mut first: HashMap<[i64; 3], u32> = HashMap::new();
    let numbers: Vec<u32> = (0..)
        .zip(points)
        .map(|(number, point)| {
            #[expect(
                clippy::cast_possible_truncation,
                reason = "eighths of the finest cell that fit into the mesh"
            )]
            let place =
                std::array::from_fn(|axis| ((point[axis] - lowest[axis]) / unit).round() as i64);
            *first.entry(place).or_insert(number)
        })
        .collect();
    let mut joined = Cells::new();
    for (cell_type, vertices) in cells.iter() {
        let vertices: Vec<u32> =
            vertices.iter().filter_map(|&vertex| numbers.get(vertex as usize).copied()).collect();
        joined.push(cell_type, &vertices).map_err(|error| {
            channel.label.part("data", "cells").wrong(error, "grids whose points lie apart")
        })?;
    }
    Ok(joined)
}

fn marks(channel: &Channel<'_>) -> Result<Marks, RunError> {
    let mut marks =
        Marks { features: features(channel)?, ghosts: ghost_bits(channel), ..Marks::default() };
    let Some(domain) = channel.single() else { return Ok(marks) };
    let roles = &domain.roles;
    let numbers = |array: &Array<'_>, name: &str| -> Result<Vec<u64>, RunError> {
        let number = |index: usize| {
            array.whole(index).ok_or_else(|| {
                let found = format!("the number {} at entry {index}", array.get(index));
                domain.label.part("fields", name).wrong(found, "whole numbers from 0 on")
            })
        };
        (0..array.len()).map(number).collect()
    };
    let of = |array: &Option<Array<'_>>, name: &str| {
        array.as_ref().map(|array| numbers(array, name)).transpose()
    };
    marks.global_vertices = of(&roles.global_vertices, "global vertices")?;
    marks.global_cells = of(&roles.global_cells, "global cells")?;
    Ok(marks)
}

/// The bits of the `vtkGhostType` of the cells that are kept.
fn ghost_bits(channel: &Channel<'_>) -> Option<Vec<u8>> {
    channel.blocks.iter().find(|block| block.domain.roles.ghosts.is_some())?;
    let bits = |array: &Array<'_>, cell: usize| {
        if cell < array.len() { array.integer(cell).map_or(0, ghosts::of_integer) } else { 0 }
    };
    if let Some(domain) = channel.single() {
        // As many as there are: the adaptor refuses too few and too many.
        let ghosts = domain.roles.ghosts.as_ref()?;
        return Some((0..ghosts.len()).map(|cell| bits(ghosts, cell)).collect());
    }
    let of_blocks = channel.blocks.iter().flat_map(|block| {
        let (ghosts, cells) =
            (block.domain.roles.ghosts.as_ref(), block.domain.topology.cell_count());
        let kept = (0..cells).filter(|&cell| block.mask.keeps(cell));
        kept.map(move |cell| ghosts.map_or(0, |array| bits(array, cell)))
    });
    Some(of_blocks.collect())
}

/// Where the features come from: tagged faces, numbers at vertices, else sharp edges.
fn features(channel: &Channel<'_>) -> Result<FeatureSource, RunError> {
    let names = channel.feature_names.clone();
    if channel.has_vertex_features() {
        let mut tags = Vec::new();
        for domain in channel.blocks.iter().map(|block| &block.domain) {
            let Some(array) = domain.roles.vertex_features else { continue };
            for index in 0..array.len() {
                tags.push(array.integer(index).ok_or_else(|| {
                    let label = domain.label.part("vertex_features", "vertex_features");
                    let found = format!("{} at entry {index}", array.get(index));
                    label.wrong(found, "a whole number for each vertex")
                })?);
            }
        }
        return Ok(FeatureSource::Vertices(TaggedVertices { tags, names }));
    }
    let mut tagged = TaggedFaces { names, ..TaggedFaces::default() };
    let mut base = 0;
    let mut points = Vec::new();
    for block in &channel.blocks {
        for faces in &block.domain.faces {
            points.resize(base + block.vertex_count(), Vector::default());
            faces.topology.append(&mut tagged.faces, base, &points, &|_| true)?;
            tagged.tags.extend((0..faces.tags.len()).map(|at| faces.tags.integer(at).unwrap_or(0)));
        }
        base += block.vertex_count();
    }
    Ok(if tagged.tags.is_empty() {
        FeatureSource::SharpEdges
    } else {
        FeatureSource::Faces(tagged)
    })
}
