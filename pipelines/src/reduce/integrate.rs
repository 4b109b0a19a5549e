//! Integrals of fields over an extract or the whole mesh.

use tombolo_deform::communicator::Reduction;
use tombolo_deform::mesh::{CellType, Cells, Vector};
use tombolo_deform::vector::{dot, scale};

use super::region::{Chosen, Region, Wanted};
use super::weights::{Weights, volume};
use crate::extract::{Association, CHUNK, FieldView, is_absent};
use crate::language::{Integrate, Stage};

/// The values of the monitors of a stage: its own, then those of its field and of its vector. They
/// are NaN where any rank has failed. Collective.
///
/// # Errors
/// In the second part: what is missing on this rank, or does not fit.
pub(crate) fn integrate(stage: &Integrate, region: &Region) -> (Vec<f64>, Option<String>) {
    let has_faces = region.stage.is_some_and(Stage::takes_faces);
    let wanted: Vec<Wanted> = [(&stage.field, &[1][..]), (&stage.vector, &[2, 3])]
        .into_iter()
        .filter_map(|(name, components)| Some(Wanted { name: name.as_deref()?, components }))
        .collect();
    let surface = region.surface(&wanted);
    let part = region.part(&surface, &wanted, &stage.features);
    let Chosen { dimension, is_known } = region.agreed(&part);
    let across = region.across().filter(|_| dimension == 1);
    let mut error = part.as_ref().err().cloned();
    let mut sums = Sums::default();
    if let Ok(part) = &part {
        let mut fields = part.fields.iter().copied();
        let mut next = |name: &Option<String>| name.as_ref().and_then(|_| fields.next()).flatten();
        let mut taken = |name: &Option<String>| next(name).map(|view| Taken::new(&view));
        let (field, vector) = (taken(&stage.field), taken(&stage.vector));
        let terms = Terms { cells: part.cells, points: part.points, field, vector };
        sums = terms.sums(&|cell| region.counts(part, cell, dimension), across);
        if has_faces && stage.vector.is_some() && dimension == 1 && across.is_none() {
            error = Some("lines have no normal, expected faces or a slice by one plane".into());
            sums.0[FLOW] = f64::NAN;
        }
    }
    region.communicator.reduce(Reduction::Sum, &mut sums.0);
    if !is_known {
        sums.0 = [f64::NAN; COUNT];
    }
    (sums.values(stage, has_faces), error.filter(|message| !message.is_empty()))
}

/// The sums: the size of all cells, the size and the integral of the scalar where it is there, and
/// of the vector, and its flux.
struct Sums([f64; COUNT]);

const COUNT: usize = 8;
const SIZE: usize = 0;
const FIELD: usize = 1;
const VECTOR: usize = 3;
const FLOW: usize = 7;

impl Default for Sums {
    fn default() -> Self {
        Self([0.0; COUNT])
    }
}

impl Sums {
    fn values(&self, stage: &Integrate, has_faces: bool) -> Vec<f64> {
        let sums = &self.0;
        let mut values = vec![sums[SIZE]];
        if stage.field.is_some() {
            values.extend([sums[FIELD + 1], sums[FIELD + 1] / sums[FIELD]]);
        }
        if stage.vector.is_some() {
            let integral = &sums[VECTOR + 1..FLOW];
            values.extend(integral);
            values.extend(integral.iter().map(|component| component / sums[VECTOR]));
            values.extend(has_faces.then_some(sums[FLOW]));
        }
        values
    }
}

/// A rank's contribution to the integral.
struct Terms<'a> {
    cells: &'a Cells,
    points: &'a [Vector],
    field: Option<Taken>,
    vector: Option<Taken>,
}

/// The values of a field as vectors. What a scalar or a plane vector lacks is 0.
struct Taken {
    is_of_cells: bool,
    values: Vec<Vector>,
}

impl Taken {
    fn new(view: &FieldView) -> Self {
        let values = &view.values;
        let component = |entity: usize, axis: usize| match axis < values.components() {
            true => values.get(entity, axis),
            false => 0.0,
        };
        let value = |entity: usize| std::array::from_fn(|axis| component(entity, axis));
        Self {
            is_of_cells: view.association == Association::Element,
            values: (0..values.len()).map(value).collect(),
        }
    }

    fn is_absent(&self, entity: usize) -> bool {
        is_absent(self.values[entity][0])
    }
}

impl Terms<'_> {
    fn sums(&self, counts: &dyn Fn(usize) -> bool, across: Option<Vector>) -> Sums {
        let mut sums = Sums::default();
        let mut weights = Weights::default();
        for start in (0..self.cells.len()).step_by(CHUNK) {
            let mut part = Sums::default();
            let chunk = start..self.cells.len().min(start + CHUNK);
            for cell in chunk.filter(|&cell| counts(cell)) {
                let vertices = self.cells.vertices(cell);
                if let (CellType::Tetra, &[a, b, c, d]) = (self.cells.cell_type(cell), vertices) {
                    self.add_tetrahedron(cell, [a, b, c, d], &mut part.0);
                    continue;
                }
                weights.find(self.cells, cell, self.points);
                self.add(cell, &weights, across, &mut part.0);
            }
            sums.0.iter_mut().zip(part.0).for_each(|(sum, part)| *sum += part);
        }
        sums
    }

    /// Adds what a tetrahedron has, as [`add`](Self::add) does, without a list of its parts.
    fn add_tetrahedron(&self, cell: usize, vertices: [u32; 4], sums: &mut [f64; COUNT]) {
        let size = volume(vertices.map(|vertex| self.points[vertex as usize]));
        sums[SIZE] += size;
        let entities = vertices.map(|vertex| vertex as usize);
        for (first, taken) in [(FIELD, &self.field), (VECTOR, &self.vector)] {
            let Some(taken) = taken else { continue };
            let whole = [cell];
            let entities = if taken.is_of_cells { &whole[..] } else { &entities };
            if entities.iter().any(|&entity| taken.is_absent(entity)) {
                continue;
            }
            sums[first] += size;
            let part = if taken.is_of_cells { size } else { size / 4.0 };
            for &entity in entities {
                let value = taken.values[entity];
                let axes = if first == FIELD { 1 } else { 3 };
                for axis in 0..axes {
                    sums[first + 1 + axis] += part * value[axis];
                }
            }
        }
    }

    /// Adds what one cell has.
    fn add(&self, cell: usize, weights: &Weights, across: Option<Vector>, sums: &mut [f64; COUNT]) {
        sums[SIZE] += weights.size;
        // The entities whose values count, with their parts of the size and of the vector area.
        #[expect(clippy::cast_possible_truncation, reason = "cells are numbered with 32 bits")]
        let whole = [(cell as u32, weights.size, weights.area)];
        for (first, taken) in [(FIELD, &self.field), (VECTOR, &self.vector)] {
            let Some(taken) = taken else { continue };
            let parts = if taken.is_of_cells { &whole[..] } else { &weights.parts };
            if parts.iter().any(|part| taken.is_absent(part.0 as usize)) {
                continue;
            }
            sums[first] += weights.size;
            for &(entity, size, area) in parts {
                let value = taken.values[entity as usize];
                if first == FIELD {
                    sums[FIELD + 1] += size * value[0];
                    continue;
                }
                for axis in 0..3 {
                    sums[VECTOR + 1 + axis] += size * value[axis];
                }
                sums[FLOW] += dot(value, across.map_or(area, |normal| scale(normal, size)));
            }
        }
    }
}
