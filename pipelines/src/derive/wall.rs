//! The shear of a flow on the walls.

use tombolo_deform::communicator::agree;
use tombolo_deform::mesh::{NumberType, Vector};
use tombolo_deform::vector::{dot, length, mean, polygon_normal, scale, subtract};

use super::{Basis, Operand};
use crate::extract::{ABSENT, Association, Field, Walls};
use crate::language::{Viscosity, WallShearStress};
use crate::reduce::traction_of;

/// The stress that the flow exerts along each face of the surface that this rank has; `None` where
/// another rank says why there is none. `gradient` is the name of the field of the velocity's
/// gradient. Collective.
///
/// # Errors
/// A text that says what is missing or does not fit.
pub(crate) fn wall_shear_stress(
    stage: &WallShearStress,
    gradient: &str,
    basis: &Basis,
    walls: &Walls,
) -> Result<Option<Field>, String> {
    let found = operands(stage, gradient, basis, walls);
    let is_found = agree(basis.communicator, found.as_ref().map(|_| ())).is_ok();
    let operands = found?;
    if !is_found {
        return Ok(None);
    }
    let mut values = Vec::with_capacity(3 * walls.faces.len());
    let mut ring = Vec::new();
    let points = basis.source.points();
    for (face, &owner) in walls.owners.iter().enumerate() {
        ring.clear();
        ring.extend(walls.face(face));
        let stress = operands.as_ref().and_then(|operands| operands.at(&ring, owner as usize));
        let behind = basis.source.cells().vertices(owner as usize);
        let at = |vertices: &[u32]| mean(vertices.iter().map(|&vertex| points[vertex as usize]));
        let across = polygon_normal(points, &ring);
        // Away from the cell behind, whichever way the face turns.
        let turn = 1.0_f64.copysign(dot(across, subtract(at(&ring), at(behind))));
        let normal = scale(across, turn / length(across));
        let along = stress.map(|(gradient, viscosity)| {
            let force = traction_of(&gradient, viscosity * stage.density, normal);
            subtract(force, scale(normal, dot(force, normal)))
        });
        let finite = |vector: &Vector| vector.iter().all(|part| part.is_finite());
        values.extend(along.filter(finite).unwrap_or([ABSENT; 3]));
    }
    Ok(Some(Field {
        name: stage.name().to_owned(),
        association: Association::Element,
        components: 3,
        number: NumberType::F64,
        values,
    }))
}

/// The fields that the stress comes from.
struct Operands<'a> {
    gradient: Operand<'a>,
    viscosity: Result<f64, Operand<'a>>,
}

/// `None` on a rank that has nothing of the mesh.
fn operands<'a>(
    stage: &WallShearStress,
    gradient: &str,
    basis: &Basis<'a>,
    walls: &Walls,
) -> Result<Option<Operands<'a>>, String> {
    let is_solid = |&cell: &u32| basis.source.cells().cell_type(cell as usize).dimension() == 3;
    if !walls.owners.iter().all(is_solid) {
        return Err("the mesh has no volume cells behind its surface".into());
    }
    let Some(gradient) = basis.operand(gradient)? else { return Ok(None) };
    let viscosity = match &stage.viscosity {
        Viscosity::Number(viscosity) => Ok(*viscosity),
        Viscosity::Field(name) => match basis.operand(name)? {
            Some(operand) if operand.view.values.components() != 1 => {
                return Err(format!("field `{name}` is no scalar, which a viscosity is"));
            }
            Some(operand) => Err(operand),
            None => return Ok(None),
        },
    };
    Ok(Some(Operands { gradient, viscosity }))
}

impl Operands<'_> {
    /// The gradient and the viscosity in the middle of a face; `None` where one is absent.
    fn at(&self, face: &[u32], owner: usize) -> Option<([f64; 9], f64)> {
        let mut gradient = [0.0; 9];
        for (component, value) in gradient.iter_mut().enumerate() {
            *value = middle(&self.gradient, component, face, owner)?;
        }
        let viscosity = match &self.viscosity {
            Ok(viscosity) => *viscosity,
            Err(operand) => middle(operand, 0, face, owner)?,
        };
        Some((gradient, viscosity))
    }
}

/// The mean over the vertices of a face, or the value in the cell behind.
fn middle(operand: &Operand, component: usize, face: &[u32], owner: usize) -> Option<f64> {
    if operand.view.association == Association::Element {
        return (!operand.is_absent(owner)).then(|| operand.value(owner, component));
    }
    if face.iter().any(|&vertex| operand.is_absent(vertex as usize)) {
        return None;
    }
    let sum: f64 = face.iter().map(|&vertex| operand.value(vertex as usize, component)).sum();
    #[expect(clippy::cast_precision_loss, reason = "faces have few vertices")]
    Some(sum / face.len() as f64)
}
