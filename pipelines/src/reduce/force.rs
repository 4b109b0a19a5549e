//! The force of a fluid on a surface, by pressure and friction.

use tombolo_deform::communicator::Reduction;
use tombolo_deform::mesh::Vector;
use tombolo_deform::vector::{add, cross, mean, scale, subtract};

use super::region::{Chosen, Part, Region, Wanted};
use super::weights::Weights;
use crate::extract::{Association, CHUNK, FieldView, is_absent};
use crate::language::{Force, Viscosity};

/// The force of friction of the fluid on an area, without the density: `-viscosity (G + G^T) a` for
/// the outward vector area `a`. `gradient` has the derivatives of the first component of the
/// velocity along x, y and z first.
pub(crate) fn traction_of(gradient: &[f64], viscosity: f64, area: Vector) -> Vector {
    let part = |row: usize| -> f64 {
        let entry = |column: usize| gradient[3 * row + column] + gradient[3 * column + row];
        (0..3).map(|column| entry(column) * area[column]).sum()
    };
    [0, 1, 2].map(|row| -viscosity * part(row))
}

/// The values of the monitors of a stage; NaN where any rank has failed. `gradient` is the name of
/// the field of the velocity's gradient. Collective.
///
/// # Errors
/// In the second part: what is missing on this rank, or does not fit.
pub(crate) fn force(stage: &Force, gradient: &str, region: &Region) -> (Vec<f64>, Option<String>) {
    let viscosity = stage.viscosity.as_ref().and_then(Viscosity::field);
    let tensor = stage.velocity.as_ref().map(|_| gradient);
    let wanted: Vec<Wanted> =
        [(stage.pressure.as_deref(), &[1][..]), (tensor, &[9]), (viscosity, &[1])]
            .into_iter()
            .filter_map(|(name, components)| Some(Wanted { name: name?, components }))
            .collect();
    let surface = region.surface(&wanted);
    let part = region.part(&surface, &wanted, &stage.features);
    let Chosen { dimension, is_known } = region.agreed(&part);
    let mut error = part.as_ref().err().cloned();
    let mut sums = [0.0; COUNT];
    if dimension == 1 {
        error = error.or(Some("lines have no normal, expected the faces of a volume".into()));
        sums = [f64::NAN; COUNT];
    } else if let Ok(part) = &part {
        sums = Terms::new(stage, part).sums(|cell| region.counts(part, cell, dimension));
    }
    region.communicator.reduce(Reduction::Sum, &mut sums);
    if !is_known {
        sums = [f64::NAN; COUNT];
    }
    (values(stage, &sums), error.filter(|message| !message.is_empty()))
}

/// The sums: the force of pressure and of friction, the moment of both, the area, and the integral
/// of the pressure.
const COUNT: usize = 11;
const PRESSURE: usize = 0;
const VISCOUS: usize = 3;
const MOMENT: usize = 6;
const SIZE: usize = 9;
const INTEGRAL: usize = 10;

fn values(stage: &Force, sums: &[f64; COUNT]) -> Vec<f64> {
    let of = |first: usize| [0, 1, 2].map(|axis| stage.density * sums[first + axis]);
    let (pressure, viscous) = (of(PRESSURE), of(VISCOUS));
    let mut values = Vec::new();
    values.extend(add(pressure, viscous));
    values.extend(of(MOMENT));
    values.push(sums[SIZE]);
    if stage.pressure.is_some() {
        values.extend(pressure);
        values.push(sums[INTEGRAL] / sums[SIZE]);
    }
    if stage.velocity.is_some() {
        values.extend(viscous);
    }
    values
}

/// A rank's contribution to the force.
struct Terms<'a> {
    stage: &'a Force,
    part: &'a Part<'a>,
    pressure: Option<FieldView<'a>>,
    gradient: Option<FieldView<'a>>,
    viscosity: Option<FieldView<'a>>,
}

impl<'a> Terms<'a> {
    fn new(stage: &'a Force, part: &'a Part<'a>) -> Self {
        let mut fields = part.fields.iter().copied();
        let mut next = |is_there: bool| if is_there { fields.next().flatten() } else { None };
        let pressure = next(stage.pressure.is_some());
        let gradient = next(stage.velocity.is_some());
        let viscosity = next(matches!(stage.viscosity, Some(Viscosity::Field(_))));
        Self { stage, part, pressure, gradient, viscosity }
    }

    fn sums(&self, counts: impl Fn(usize) -> bool) -> [f64; COUNT] {
        let mut sums = [0.0; COUNT];
        let mut weights = Weights::default();
        let cells = self.part.cells;
        for start in (0..cells.len()).step_by(CHUNK) {
            let mut chunk = [0.0; COUNT];
            for cell in (start..cells.len().min(start + CHUNK)).filter(|&cell| counts(cell)) {
                weights.find(cells, cell, self.part.points);
                self.add(cell, &weights, &mut chunk);
            }
            sums.iter_mut().zip(chunk).for_each(|(sum, part)| *sum += part);
        }
        sums
    }

    /// Adds what one face has: at each of its vertices, with its part of the area.
    fn add(&self, face: usize, weights: &Weights, sums: &mut [f64; COUNT]) {
        sums[SIZE] += weights.size;
        let (mut moment, mut force_of_face) = ([0.0; 3], [0.0; 3]);
        for &(vertex, size, area) in &weights.parts {
            let at = |field: &FieldView, component: usize| {
                let entity = match field.association {
                    Association::Element => face,
                    _ => vertex as usize,
                };
                let value = field.values.get(entity, component);
                if is_absent(value) { f64::NAN } else { value }
            };
            let mut whole = [0.0; 3];
            if let Some(field) = &self.pressure {
                let pressure = at(field, 0);
                sums[INTEGRAL] += size * pressure;
                let force = scale(area, pressure - self.stage.reference_pressure);
                (0..3).for_each(|axis| sums[PRESSURE + axis] += force[axis]);
                whole = add(whole, force);
            }
            if let Some(field) = &self.gradient {
                let gradient: [f64; 9] = std::array::from_fn(|component| at(field, component));
                let viscosity = match (&self.viscosity, &self.stage.viscosity) {
                    (Some(field), _) => at(field, 0),
                    (None, Some(Viscosity::Number(viscosity))) => *viscosity,
                    _ => f64::NAN,
                };
                let force = traction_of(&gradient, viscosity, area);
                (0..3).for_each(|axis| sums[VISCOUS + axis] += force[axis]);
                whole = add(whole, force);
            }
            let arm = subtract(self.part.points[vertex as usize], self.stage.about);
            moment = add(moment, cross(arm, whole));
            force_of_face = add(force_of_face, whole);
        }
        let vertices = self.part.cells.vertices(face);
        if vertices.len() == 3 {
            // The integral of the product of two linear functions over a triangle: a quarter of the
            // rule of the vertices and three quarters of that of the middle.
            let middle = mean(vertices.iter().map(|&vertex| self.part.points[vertex as usize]));
            let of_middle = cross(subtract(middle, self.stage.about), force_of_face);
            moment = add(scale(moment, 0.25), scale(of_middle, 0.75));
        }
        (0..3).for_each(|axis| sums[MOMENT + axis] += moment[axis]);
    }
}
