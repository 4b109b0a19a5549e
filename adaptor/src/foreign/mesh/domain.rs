//! One mesh: a topology with its coordinates, its fields and its features.

use super::coordset::Coordset;
use super::field::{self, Field};
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
