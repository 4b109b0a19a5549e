//! Integrals of fields over an extract or the whole mesh.

use tombolo_deform::communicator::Reduction;
use tombolo_deform::mesh::{Cells, Vector};
use tombolo_deform::vector::{dot, scale};

use super::region::{CHUNK, Chosen, Region, Wanted};
use super::weights::Weights;
use crate::extract::{Association, FieldView, is_absent};
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
        let (field, vector) = (next(&stage.field), next(&stage.vector));
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

/// What a rank integrates.
struct Terms<'a> {
    cells: &'a Cells,
    points: &'a [Vector],
    field: Option<FieldView<'a>>,
    vector: Option<FieldView<'a>>,
}

impl Terms<'_> {
    fn sums(&self, counts: &dyn Fn(usize) -> bool, across: Option<Vector>) -> Sums {
        let mut sums = Sums::default();
        let mut weights = Weights::default();
        for start in (0..self.cells.len()).step_by(CHUNK) {
            let mut part = Sums::default();
            let chunk = start..self.cells.len().min(start + CHUNK);
            for cell in chunk.filter(|&cell| counts(cell)) {
                weights.find(self.cells, cell, self.points);
                self.add(cell, &weights, across, &mut part.0);
            }
            sums.0.iter_mut().zip(part.0).for_each(|(sum, part)| *sum += part);
        }
        sums
    }

    /// Adds what one cell has.
    fn add(&self, cell: usize, weights: &Weights, across: Option<Vector>, sums: &mut [f64; COUNT]) {
        sums[SIZE] += weights.size;
        // The entities whose values count, with their parts of the size and of the vector area.
        let whole = [(0, weights.size, weights.area)];
        for (first, view) in [(FIELD, &self.field), (VECTOR, &self.vector)] {
            let Some(FieldView { association, values, .. }) = view else { continue };
            let parts = match association {
                Association::Element => &whole[..],
                _ => &weights.parts,
            };
            let entity = |part: u32| match association {
                Association::Element => cell,
                _ => part as usize,
            };
            if parts.iter().any(|part| is_absent(values.get(entity(part.0), 0))) {
                continue;
            }
            sums[first] += weights.size;
            for &(part, size, area) in parts {
                if first == FIELD {
                    sums[FIELD + 1] += size * values.get(entity(part), 0);
                    continue;
                }
                let component = |axis: usize| match axis < values.components() {
                    true => values.get(entity(part), axis),
                    false => 0.0,
                };
                let value = [0, 1, 2].map(component);
                for axis in 0..3 {
                    sums[VECTOR + 1 + axis] += size * value[axis];
                }
                sums[FLOW] += dot(value, across.map_or(area, |normal| scale(normal, size)));
            }
        }
    }
}
