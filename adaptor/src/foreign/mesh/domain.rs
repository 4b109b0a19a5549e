//! One mesh: a topology with its coordinates, its fields and its features.

use super::coordset::Coordset;
use super::field::Field;
use super::topology::Topology;
use crate::foreign::array::{Array, Fingerprint};
use crate::foreign::error::RunError;
use crate::foreign::memory;

/// Fields that say something of the mesh itself.
#[derive(Debug, Clone, Default)]
pub struct Roles<'call> {
    /// Of each cell: the bits of its `vtkGhostType`.
    pub ghosts: Option<Array<'call>>,
    /// Of each vertex: its number among those of all ranks.
    pub global_vertices: Option<Array<'call>>,
    /// Of each cell: its number among those of all ranks.
    pub global_cells: Option<Array<'call>>,
    /// Of each vertex: the number of its feature.
    pub vertex_features: Option<Array<'call>>,
}

/// Faces with the number of their feature.
#[derive(Debug, Clone)]
pub struct Faces<'call> {
    /// The faces.
    pub topology: Topology<'call>,
    /// Of each face: the number of its feature.
    pub tags: Array<'call>,
}

/// One mesh on this rank.
#[derive(Debug, Clone)]
pub struct Domain<'call> {
    /// Where its vertices lie.
    pub coordset: Coordset<'call>,
    /// Its cells.
    pub topology: Topology<'call>,
    /// Values at its vertices and in its cells.
    pub fields: Vec<Field<'call>>,
    /// Faces of one type each.
    pub faces: Vec<Faces<'call>>,
    /// Fields that say something of the mesh itself.
    pub roles: Roles<'call>,
    /// Its name in errors.
    pub path: String,
}

impl<'call> Domain<'call> {
    /// Takes what makes these cells other cells into a fingerprint; values that change from step to
    /// step are not among it.
    pub(super) fn fingerprint(&self, into: &mut Fingerprint) {
        self.coordset.fingerprint(into);
        self.topology.fingerprint(into);
        for faces in &self.faces {
            faces.topology.fingerprint(into);
            faces.tags.fingerprint(into);
        }
        let Roles { ghosts, global_vertices, global_cells, vertex_features } = &self.roles;
        for array in [ghosts, global_vertices, global_cells, vertex_features].into_iter().flatten()
        {
            array.fingerprint(into);
        }
    }

    /// Refuses arrays whose memory cannot be read.
    pub(super) fn check_memory(&self) -> Result<(), RunError> {
        for array in self.coordset.arrays() {
            memory::check(array, format_args!("{}/coordsets", self.path))?;
        }
        let of_faces = self
            .faces
            .iter()
            .flat_map(|faces| faces.topology.arrays().into_iter().chain([&faces.tags]));
        for array in self.topology.arrays().into_iter().chain(of_faces) {
            memory::check(array, format_args!("{}/topologies", self.path))?;
        }
        for field in &self.fields {
            for array in &field.components {
                memory::check(array, format_args!("{}/fields/{}/values", self.path, field.name))?;
            }
        }
        Ok(())
    }
}
