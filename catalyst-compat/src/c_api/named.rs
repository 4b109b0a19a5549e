//! A channel as the solver has named it, part by part.

use tombolo::deform::mesh::CellType;
use tombolo::pipelines::extract::Association;

use super::Fault;
use super::lent::Address;
use crate::array::Array;
use crate::error::CatalystError;
use crate::mesh::{Channel, DescribedCells, Description};

/// Cells as they were named.
#[derive(Debug, Clone, Copy)]
pub(super) enum Cells {
    /// Each point is a cell.
    Points,
    Uniform(CellType, Address),
    Mixed {
        types: Address,
        sizes: Address,
        connectivity: Address,
    },
}

/// A channel as it was named.
#[derive(Debug, Default)]
pub(super) struct Named {
    pub(super) name: String,
    pub(super) points: Vec<Address>,
    cells: Option<Cells>,
    /// Of each type of face one array.
    faces: Vec<(CellType, Address, Address)>,
    features: Vec<(i64, String)>,
    fields: Vec<(String, Association, Vec<Address>)>,
    pub(super) ghosts: Option<Address>,
    pub(super) global_vertices: Option<Address>,
    pub(super) global_cells: Option<Address>,
    /// Whether `tombolo_execute` has shown it.
    pub(super) is_shown: bool,
}

impl Named {
    pub(super) fn new(name: String, points: Vec<Address>) -> Self {
        Self { name, points, ..Self::default() }
    }

    pub(super) fn cells(&mut self, cells: Cells) -> Result<(), Fault> {
        if let (Some(Cells::Uniform(known, _)), Cells::Uniform(other, _)) = (&self.cells, &cells)
            && known != other
            && !self.is_shown
        {
            return Err(Fault::invalid(
                format!("channel '{}', cells", self.name),
                format!("cells of type {other} beside those of type {known}"),
                "cells of one type, or of several by tombolo_mixed_cells",
            ));
        }
        self.cells = Some(cells);
        Ok(())
    }

    pub(super) fn faces(&mut self, cell_type: CellType, connectivity: Address, features: Address) {
        self.faces.retain(|(known, ..)| *known != cell_type);
        self.faces.push((cell_type, connectivity, features));
    }

    pub(super) fn feature(&mut self, number: i64, name: String) -> Result<(), Fault> {
        match self.features.iter().find(|(known, _)| *known == number) {
            Some((_, known)) if *known != name => Err(Fault::invalid(
                format!("channel '{}', feature {number}", self.name),
                format!("the name '{name}'"),
                format!("'{known}', as it was named before"),
            )),
            Some(_) => Ok(()),
            None => {
                self.features.push((number, name));
                Ok(())
            }
        }
    }

    pub(super) fn field(
        &mut self,
        name: String,
        association: Association,
        components: Vec<Address>,
    ) {
        self.fields.retain(|(known, ..)| *known != name);
        self.fields.push((name, association, components));
    }

    /// # Safety
    /// All arrays live, unchanged by others, during `'call`.
    pub(super) unsafe fn channel<'call>(&self) -> Result<Channel<'call>, CatalystError> {
        // SAFETY: the caller's promise.
        let array = |address: &Address| -> Array<'call> { unsafe { address.array() } };
        let missing = |what: String, found: &str, expected: &str| CatalystError::Argument {
            what,
            found: found.into(),
            expected: expected.into(),
        };
        let Some(cells) = &self.cells else {
            let what = format!("channel '{}'", self.name);
            let expected =
                "tombolo_cells, tombolo_mixed_cells, or tombolo_point_cells for points alone";
            return Err(missing(what, "points without cells", expected));
        };
        if let Some((number, name)) = self.features.first().filter(|_| self.faces.is_empty()) {
            let what = format!("channel '{}', feature '{name}' ({number})", self.name);
            return Err(missing(
                what,
                "no faces",
                "tombolo_faces, with 0 faces on a rank that has none",
            ));
        }
        let cells = match cells {
            Cells::Points => None,
            Cells::Uniform(cell_type, connectivity) => {
                Some(DescribedCells::Uniform(*cell_type, array(connectivity)))
            }
            Cells::Mixed { types, sizes, connectivity } => Some(DescribedCells::Mixed {
                types: array(types),
                sizes: array(sizes),
                connectivity: array(connectivity),
            }),
        };
        let description = Description {
            name: self.name.clone(),
            axes: self.points.iter().map(array).collect(),
            cells,
            faces: self
                .faces
                .iter()
                .map(|(cell_type, faces, tags)| (*cell_type, array(faces), array(tags)))
                .collect(),
            feature_names: self.features.clone(),
            fields: self
                .fields
                .iter()
                .map(|(name, association, components)| {
                    (name.clone(), *association, components.iter().map(array).collect())
                })
                .collect(),
            ghosts: self.ghosts.as_ref().map(array),
            global_vertices: self.global_vertices.as_ref().map(array),
            global_cells: self.global_cells.as_ref().map(array),
        };
        description.channel()
    }
}
