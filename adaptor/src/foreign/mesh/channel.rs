//! A channel: one mesh, several blocks, or overlapping grids.

use tombolo_deform::bounds::Bounds;

use super::domain::Domain;
use super::field::Field;
use super::levels::{Grid, Mask};
use crate::foreign::array::Fingerprint;
use crate::foreign::error::RunError;
use crate::foreign::label::Label;
use crate::foreign::memory;

/// One mesh of a channel.
#[derive(Debug)]
pub struct Block<'call> {
    /// Its name; empty where the channel is one mesh.
    pub name: String,
    /// The mesh.
    pub domain: Domain<'call>,
    /// Which of its cells finer grids cover.
    pub mask: Mask,
}

impl Block<'_> {
    /// How many vertices it has.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.domain.coordset.vertex_count()
    }
}

/// A channel as the solver shows it in one call.
#[derive(Debug, Default)]
pub struct Channel<'call> {
    /// Its name.
    pub name: String,
    /// The channel's label in errors.
    pub label: Label,
    /// Its meshes; none on a rank without data.
    pub blocks: Vec<Block<'call>>,
    /// Names of features by their numbers.
    pub feature_names: Vec<(i64, String)>,
    /// Fields of the mesh as a whole.
    pub of_mesh: Vec<Field<'call>>,
    /// The grids of levels that the blocks are; none of a channel without levels.
    pub grids: Vec<Option<Grid>>,
    /// The boxes that the grids of all ranks fill, as far as they are known here.
    pub boxes: Vec<Bounds>,
    /// Parts that are passed over, for the log.
    pub notes: Vec<String>,
}

impl<'call> Channel<'call> {
    /// The grids of levels here.
    pub fn grids(&self) -> impl Iterator<Item = Grid> {
        self.grids.iter().flatten().copied()
    }

    /// Takes in the grids that there are, and leaves out the cells that finer ones cover.
    pub fn cover(&mut self, grids: &[Grid]) {
        // One grid has no neighbour.
        if grids.len() > 1 {
            self.boxes = grids.iter().map(Grid::bounds).collect();
        }
        for (block, own) in self.blocks.iter_mut().zip(&self.grids) {
            if let Some(own) = own {
                block.mask.settle(own, grids);
            }
        }
    }

    /// Whether its blocks are grids of levels, whose vertices at one point are one.
    pub(super) fn has_levels(&self) -> bool {
        self.grids.iter().any(Option::is_some)
    }

    /// How many vertices it has.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.blocks.iter().map(Block::vertex_count).sum()
    }

    /// How many coordinates a vertex has for the solver; 0 where there is no vertex.
    pub(in crate::foreign) fn dimension(&self) -> usize {
        let with_vertices = self.blocks.iter().filter(|block| block.vertex_count() > 0);
        with_vertices.map(|block| block.domain.coordset.dimension()).max().unwrap_or(0)
    }

    /// The one mesh that is lent as it is.
    pub(super) fn single(&self) -> Option<&Domain<'call>> {
        match self.blocks.as_slice() {
            [Block { domain, mask, .. }] if *mask == Mask::default() => Some(domain),
            _ => None,
        }
    }

    /// Whether the numbers at its vertices say which feature they belong to: where all blocks have
    /// them, and none has faces with features.
    pub(super) fn has_vertex_features(&self) -> bool {
        !self.blocks.is_empty()
            && self.blocks.iter().all(|Block { domain, .. }| {
                domain.faces.is_empty() && domain.roles.vertex_features.is_some()
            })
    }

    /// Notes for the log on parts of the mesh that are passed over.
    pub(in crate::foreign) fn passed_over(&self) -> Vec<String> {
        let any =
            |is_so: fn(&Domain<'_>) -> bool| self.blocks.iter().any(|block| is_so(&block.domain));
        let mut notes = Vec::new();
        if any(|domain| domain.roles.vertex_features.is_some())
            && !any(|domain| !domain.faces.is_empty())
            && !self.has_vertex_features()
        {
            notes.push(format!(
                "{}: the features of vertices are passed over, as not every block has them",
                self.label
            ));
        }
        let has_numbers = |domain: &Domain<'_>| {
            domain.roles.global_vertices.is_some() || domain.roles.global_cells.is_some()
        };
        if self.single().is_none() && any(has_numbers) {
            // Where two blocks touch, one number stands for two vertices.
            notes.push(format!(
                "{}: the global numbers of several blocks are passed over: the vertices that ranks share are found by their places",
                self.label
            ));
        }
        notes
    }

    /// A fingerprint by which these cells are told from others.
    pub(super) fn fingerprint(&self) -> Fingerprint {
        let mut fingerprint = Fingerprint::default();
        for block in &self.blocks {
            block.domain.fingerprint(&mut fingerprint);
            block.mask.words().for_each(|word| fingerprint.add(word));
        }
        let corners = self.boxes.iter().flat_map(Bounds::corners).flatten();
        corners.for_each(|coordinate| fingerprint.add(coordinate.to_bits()));
        fingerprint
    }

    /// Refuses arrays whose memory cannot be read.
    pub(super) fn check_memory(&self) -> Result<(), RunError> {
        self.blocks.iter().try_for_each(|block| block.domain.check_memory())?;
        for field in &self.of_mesh {
            for array in &field.components {
                let below = || format!("state/fields/{}", field.name);
                memory::check(array, || self.label.field(&below(), &field.name))?;
            }
        }
        Ok(())
    }
}
