//! A channel as the solver has named it, part by part.

use tombolo::deform::mesh::CellType;
use tombolo::foreign::mesh::{
    Block, Channel, Coordset, Domain, Faces, Field, Label, Mask, Roles, Rows, Topology,
};
use tombolo::foreign::{Array, RunError};
use tombolo::pipelines::extract::{Association, check_field_length};
use tombolo::pipelines::language::nearest;

use crate::Fault;
use crate::lent::Address;

/// The arrays of the cells as they were named.
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

/// The arrays of a channel as they were named.
#[derive(Debug, Default)]
pub(super) struct Named {
    pub(super) name: String,
    points: Vec<Address>,
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
    /// Whether it was forgotten. Its name keeps its place among those of the others, and its features
    /// keep theirs, for when it is named again.
    pub(super) is_forgotten: bool,
}

/// Arrays of a channel other than its fields, as they are forgotten by name.
const GHOST_CELLS: &str = "ghost_cells";
const GLOBAL_VERTICES: &str = "global_vertices";
const GLOBAL_CELLS: &str = "global_cells";

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

    /// Names a feature, which has to be done before the channel is shown: its features are found
    /// then.
    pub(super) fn feature(&mut self, number: i64, name: String) -> Result<(), Fault> {
        match self.features.iter().find(|(known, _)| *known == number) {
            Some((_, known)) if *known != name => Err(Fault::invalid(
                format!("channel '{}', feature {number}", self.name),
                format!("the name '{name}'"),
                format!("'{known}', as it was named before"),
            )),
            Some(_) => Ok(()),
            None if self.is_shown => Err(Fault::invalid(
                format!("channel '{}', feature {number}", self.name),
                format!("the name '{name}' after tombolo_execute has shown the channel"),
                "all names before the first tombolo_execute",
            )),
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

    /// Names the points, by which a channel that was forgotten is there again.
    pub(super) fn points(&mut self, points: Vec<Address>) {
        self.points = points;
        self.is_forgotten = false;
    }

    /// Forgets all arrays: none is read any more.
    pub(super) fn forget_all(&mut self) {
        let Self { name, features, is_shown, .. } = std::mem::take(self);
        // The names of features that nobody has seen bind nobody.
        let features = if is_shown { features } else { Vec::new() };
        *self = Self { name, features, is_shown, is_forgotten: true, ..Self::default() };
    }

    /// Forgets a field, or the numbers of this name.
    pub(super) fn forget(&mut self, name: &str) -> Result<(), Fault> {
        if let Some(index) = self.fields.iter().position(|(known, ..)| known == name) {
            self.fields.remove(index);
            return Ok(());
        }
        let numbers = [
            (GHOST_CELLS, &mut self.ghosts),
            (GLOBAL_VERTICES, &mut self.global_vertices),
            (GLOBAL_CELLS, &mut self.global_cells),
        ];
        let mut known: Vec<&str> = self.fields.iter().map(|(field, ..)| field.as_str()).collect();
        for (of, array) in numbers {
            if array.is_some() {
                if of == name {
                    *array = None;
                    return Ok(());
                }
                known.push(of);
            }
        }
        let expected = match nearest(name, known.iter().copied()) {
            Some(near) => format!("one that was named; did you mean '{near}'?"),
            None if known.is_empty() => "one that was named; none was".into(),
            None => format!("one that was named: {}", known.join(", ")),
        };
        let what = format!("channel '{}', what to forget", self.name);
        Err(Fault::invalid(what, format!("'{name}'"), expected))
    }

    /// # Safety
    /// All arrays live, unchanged by others, during `'call`.
    pub(super) unsafe fn channel<'call>(&self) -> Result<Channel<'call>, RunError> {
        // SAFETY: the caller's promise.
        let array = |address: &Address| -> Array<'call> { unsafe { address.array() } };
        let missing = |what: String, found: &str, expected: &str| RunError::Argument {
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
        let label = Label::Words(format!("channel '{}'", self.name));
        let part = |name: &str| label.part(name, name);
        let coordset = Coordset::Explicit { axes: self.points.iter().map(array).collect() };
        let uniform = |what: &str, cell_type: CellType, connectivity: &Address| Topology::Uniform {
            cell_type,
            connectivity: array(connectivity),
            label: part(what),
        };
        let topology = match cells {
            Cells::Points => Topology::Points(coordset.vertex_count()),
            Cells::Uniform(cell_type, connectivity) => uniform("cells", *cell_type, connectivity),
            Cells::Mixed { types, sizes, connectivity } => {
                let map = CellType::ALL
                    .into_iter()
                    .filter(|cell_type| *cell_type != CellType::Polyhedron);
                Topology::Mixed {
                    cells: Rows::new(array(connectivity), array(sizes), None, part("cells")),
                    shapes: array(types),
                    map: map.map(|cell_type| (i64::from(cell_type.vtk()), cell_type)).collect(),
                    faces: None,
                    label: part("cell types"),
                    expected: "one of enum tombolo_cell_type",
                }
            }
        };
        let counts = (coordset.vertex_count(), topology.cell_count());
        let mut fields = Vec::with_capacity(self.fields.len());
        for (field, association, components) in &self.fields {
            // The adaptor compares lengths too, but only after arrays of other types were copied.
            let length = components.first().map_or(0, |component| component.count);
            check_field_length(&self.name, (field, *association), length, counts)?;
            fields.push(Field::new(
                field.clone(),
                *association,
                components.iter().map(array).collect(),
            ));
        }
        let faces = self.faces.iter().map(|(cell_type, connectivity, tags)| Faces {
            topology: uniform("faces", *cell_type, connectivity),
            tags: array(tags),
        });
        let domain = Domain {
            coordset,
            topology,
            fields,
            faces: faces.collect(),
            roles: Roles {
                ghosts: self.ghosts.as_ref().map(array),
                global_vertices: self.global_vertices.as_ref().map(array),
                global_cells: self.global_cells.as_ref().map(array),
                vertex_features: None,
            },
            label: label.clone(),
        };
        Ok(Channel {
            name: self.name.clone(),
            blocks: vec![Block { name: String::new(), domain, mask: Mask::default() }],
            feature_names: self.features.clone(),
            label,
            ..Channel::default()
        })
    }
}
