//! What is kept of a channel from step to step: whatever cannot be lent as it lies in the solver's memory.

use tombolo::deform::mesh::{
    ArrayView, Cells, CellsView, FeatureSource, Indices, MeshView, TaggedFaces, Values, Vector,
};
use tombolo::pipelines::extract::{ABSENT, Association, FieldView};

use super::channel::Channel;
use super::domain::Domain;
use super::field;
use crate::array::{Array, Fingerprint};
use crate::error::CatalystError;

/// The bit of a ghost array that says that a cell is a copy of another rank's.
const DUPLICATE: i64 = 1;

/// A field that had to be copied.
#[derive(Debug, Default)]
struct Copied {
    name: String,
    association: Option<Association>,
    components: usize,
    values: Vec<f64>,
}

/// The numbers and marks that a mesh brings, copied.
#[derive(Debug, Default)]
struct Marks {
    features: FeatureSource,
    ghosts: Option<Vec<bool>>,
    global_vertices: Option<Vec<u64>>,
    global_cells: Option<Vec<u64>>,
}

/// What is kept of one channel.
#[derive(Debug, Default)]
pub(crate) struct Kept {
    fingerprint: Option<Fingerprint>,
    counts: (usize, usize),
    address: usize,
    generation: u64,
    cells: Option<Cells>,
    points: Vec<Vector>,
    marks: Marks,
    fields: Vec<Copied>,
}

impl Kept {
    /// Brings what is kept up to date with what the solver shows. Where nobody will look at the values of this step
    /// (`looked_at`), nothing is copied or compared unless the mesh has another size. Says whether the cells are others than before.
    pub(crate) fn update(&mut self, channel: &Channel<'_>, looked_at: bool) -> Result<bool, CatalystError> {
        let counts = (channel.vertex_count(), channel.blocks.iter().map(|block| block.domain.topology.len()).sum());
        if !looked_at && self.fingerprint.is_some() && counts == self.counts {
            return Ok(false);
        }
        channel.check_memory()?;
        let single = channel.single();
        let lent_cells = single.and_then(|domain| domain.topology.lent().map(|_| address(domain)));
        let fingerprint = channel.fingerprint();
        let is_same = self.fingerprint == Some(fingerprint);
        let is_other = self.fingerprint.is_some() && !is_same;
        self.counts = counts;
        let lent_points = single.is_some_and(|domain| domain.coordset.lent().is_some());
        if !lent_points || (!is_same && lent_cells.is_none()) {
            self.points.clear();
            if self.points.try_reserve(counts.0).is_err() {
                return Err(CatalystError::Wrong {
                    path: format!("catalyst/channels/{}/data", channel.name),
                    found: format!("{} vertices", counts.0),
                    expected: "as many as there is memory for".into(),
                });
            }
            for block in &channel.blocks {
                block.domain.coordset.append(&mut self.points);
            }
        }
        if !is_same {
            self.fingerprint = None;
            self.generation += 1;
            self.cells = None;
            self.address = lent_cells.unwrap_or(0);
            match (single, lent_cells) {
                (Some(domain), Some(_)) => domain.topology.check(domain.coordset.len())?,
                _ => self.cells = Some(cells(channel, &self.points)?),
            }
            self.marks = marks(channel)?;
            self.fingerprint = Some(fingerprint);
        } else if let Some(address) = lent_cells
            && self.cells.is_none()
            && address != self.address
        {
            // A solver that copies its cells anew for each step: one copy here, by which they are known from now on.
            self.cells = Some(cells(channel, &self.points_of(channel))?);
        }
        if lent_points {
            self.points = Vec::new();
        }
        self.copy_fields(channel);
        Ok(is_other)
    }

    fn points_of(&self, channel: &Channel<'_>) -> Vec<Vector> {
        let mut points = Vec::new();
        channel.blocks.iter().for_each(|block| block.domain.coordset.append(&mut points));
        points
    }

    /// Copies the fields that cannot be lent.
    fn copy_fields(&mut self, channel: &Channel<'_>) {
        let mut names: Vec<(&str, Association, usize)> = Vec::new();
        if let Some(domain) = channel.single() {
            let unlent = domain.fields.iter().filter(|field| field::lent(&field.components).is_none());
            names.extend(unlent.map(|field| (field.name.as_str(), field.association, field.components.len())));
        } else {
            for field in channel.blocks.iter().flat_map(|block| &block.domain.fields) {
                if !names.iter().any(|(name, ..)| *name == field.name) {
                    names.push((&field.name, field.association, field.components.len()));
                }
            }
        }
        self.fields.resize_with(names.len(), Copied::default);
        for (copied, (name, association, components)) in self.fields.iter_mut().zip(names) {
            copied.name = name.to_owned();
            copied.association = Some(association);
            copied.components = components;
            copied.values.clear();
            for block in &channel.blocks {
                let entities = match association {
                    Association::Vertex => block.domain.coordset.len(),
                    Association::Element => block.domain.topology.len(),
                };
                let of_block = block.domain.fields.iter().find(|field| {
                    field.name == name && field.association == association && field.components.len() == components
                });
                for entity in 0..entities {
                    if association == Association::Element && !block.mask.keeps(entity) {
                        continue;
                    }
                    match of_block {
                        Some(field) => copied.values.extend(field.components.iter().map(|array| array.get(entity))),
                        // A block that lacks the field has no values to show.
                        None => copied.values.extend(std::iter::repeat_n(ABSENT, components)),
                    }
                }
            }
        }
    }

    /// What the adaptor is lent: the mesh and its fields.
    pub(crate) fn views<'a>(&'a self, channel: &'a Channel<'a>, fields: &mut Vec<FieldView<'a>>) -> MeshView<'a> {
        let single = channel.single();
        let points = single.and_then(|domain| domain.coordset.lent());
        let points = points.unwrap_or_else(|| ArrayView::vectors(&self.points));
        let cells = match (&self.cells, single.and_then(|domain| domain.topology.lent())) {
            (None, Some(lent)) => lent,
            (Some(kept), _) => CellsView::Owned(kept),
            (None, None) => CellsView::Uniform {
                cell_type: tombolo::deform::mesh::CellType::Tetra,
                connectivity: Indices::U32(&[]),
            },
        };
        if let Some(domain) = single {
            for field in &domain.fields {
                if let Some(values) = field::lent(&field.components) {
                    fields.push(FieldView { name: &field.name, association: field.association, values });
                }
            }
        }
        for copied in &self.fields {
            let values = ArrayView::interleaved(Values::F64(&copied.values), copied.components.max(1));
            if let (Ok(values), Some(association)) = (values, copied.association) {
                fields.push(FieldView { name: &copied.name, association, values });
            }
        }
        let Marks { features, ghosts, global_vertices, global_cells } = &self.marks;
        MeshView {
            points,
            cells,
            features,
            generation: self.generation,
            global_vertices: global_vertices.as_deref().map(Indices::U64),
            global_cells: global_cells.as_deref().map(Indices::U64),
            ghost_cells: ghosts.as_deref(),
        }
    }
}

fn address(domain: &Domain<'_>) -> usize {
    domain.topology.arrays().first().map_or(0, |array| array.address())
}

/// The cells of all blocks, one block after the other.
fn cells(channel: &Channel<'_>, points: &[Vector]) -> Result<Cells, CatalystError> {
    let mut cells = Cells::new();
    let mut base = 0;
    for block in &channel.blocks {
        let end = base + block.vertex_count();
        let so_far = points.get(..end).unwrap_or(points);
        block.domain.topology.append(&mut cells, base, so_far, &|cell| block.mask.keeps(cell))?;
        base = end;
    }
    Ok(cells)
}

fn marks(channel: &Channel<'_>) -> Result<Marks, CatalystError> {
    let mut marks = Marks { features: features(channel)?, ..Marks::default() };
    let Some(domain) = channel.single() else { return Ok(marks) };
    let roles = &domain.roles;
    marks.ghosts = roles.ghosts.as_ref().map(|array| {
        (0..array.len()).map(|index| array.integer(index).is_some_and(|bits| bits & DUPLICATE != 0)).collect()
    });
    let numbers = |array: &Array<'_>| -> Result<Vec<u64>, CatalystError> {
        (0..array.len())
            .map(|index| {
                array.whole(index).ok_or_else(|| CatalystError::Wrong {
                    path: format!("catalyst/channels/{}/data/fields", channel.name),
                    found: format!("the global number {}", array.get(index)),
                    expected: "whole numbers from 0 on".into(),
                })
            })
            .collect()
    };
    marks.global_vertices = roles.global_vertices.as_ref().map(numbers).transpose()?;
    marks.global_cells = roles.global_cells.as_ref().map(numbers).transpose()?;
    Ok(marks)
}

/// Where the features come from: tagged faces, numbers at vertices, else sharp edges.
fn features(channel: &Channel<'_>) -> Result<FeatureSource, CatalystError> {
    if let Some(domain) = channel.single()
        && let Some(numbers) = &domain.roles.vertex_features
        && channel.blocks.iter().all(|block| block.domain.faces.is_empty())
    {
        return Ok(FeatureSource::Vertices((0..numbers.len()).map(|at| numbers.integer(at).unwrap_or(0)).collect()));
    }
    let mut tagged = TaggedFaces { names: channel.feature_names.clone(), ..TaggedFaces::default() };
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
    Ok(if tagged.tags.is_empty() { FeatureSource::SharpEdges } else { FeatureSource::Faces(tagged) })
}
