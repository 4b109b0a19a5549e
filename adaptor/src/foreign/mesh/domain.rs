//! One mesh: a topology with its coordinates, its fields and its features.

use super::coordset::Coordset;
use super::field::{self, Field};
use super::topology::Topology;
use crate::foreign::array::{Array, Fingerprint};
use crate::foreign::error::RunError;
use crate::foreign::label::Label;
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

/// How an array of a mesh is lent to the adaptor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lending {
    /// Its name: `points`, `cells`, or that of a field; of points and fields one for each component.
    pub name: String,
    /// The address of its first number.
    pub address: usize,
    /// How many numbers it has.
    pub count: usize,
    /// Whether it is read where it lies, rather than copied.
    pub is_borrowed: bool,
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
    /// The domain's label in errors.
    pub label: Label,
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

    /// How the arrays of its points, cells and fields are lent.
    #[must_use]
    pub fn lending(&self) -> Vec<Lending> {
        let lending = |name: &str, array: &Array<'_>, is_borrowed: bool| Lending {
            name: name.to_owned(),
            address: array.address(),
            count: array.len(),
            is_borrowed,
        };
        let (points, cells) = (self.coordset.lent().is_some(), self.topology.lent().is_some());
        let points = self.coordset.arrays().iter().map(|axis| lending("points", axis, points));
        let cells = self.topology.arrays().into_iter().map(|array| lending("cells", array, cells));
        let fields = self.fields.iter().flat_map(|field| {
            let is_borrowed = field::lent(&field.components).is_some();
            field.components.iter().map(move |array| lending(&field.name, array, is_borrowed))
        });
        points.chain(cells).chain(fields).collect()
    }

    /// Refuses arrays whose memory cannot be read.
    pub(super) fn check_memory(&self) -> Result<(), RunError> {
        let label = &self.label;
        for array in self.coordset.arrays() {
            memory::check(array, || label.part("coordsets", "points"))?;
        }
        for array in self.topology.arrays() {
            memory::check(array, || label.part("topologies", "cells"))?;
        }
        for faces in &self.faces {
            for array in faces.topology.arrays() {
                memory::check(array, || label.part("topologies", "faces"))?;
            }
            memory::check(&faces.tags, || label.part("fields", "faces, features"))?;
        }
        for field in &self.fields {
            for array in &field.components {
                let below = || format!("fields/{}/values", field.name);
                memory::check(array, || label.field(&below(), &field.name))?;
            }
        }
        let Roles { ghosts, global_vertices, global_cells, vertex_features } = &self.roles;
        for (array, name) in [
            (ghosts, "ghost cells"),
            (global_vertices, "global vertices"),
            (global_cells, "global cells"),
            (vertex_features, "vertex features"),
        ] {
            array
                .iter()
                .try_for_each(|array| memory::check(array, || label.part("fields", name)))?;
        }
        Ok(())
    }
}
