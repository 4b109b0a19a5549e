//! Fields that formulas give.

use tombolo_deform::mesh::Vector;
use tombolo_deform::vector::mean;

use super::{Basis, Operand};
use crate::expression::Expression;
use crate::extract::{ABSENT, Association, FieldView, unknown_field};
use crate::language::{Formula, GIVEN};

/// Where the value of a name comes from.
enum Name<'a> {
    /// A coordinate.
    Coordinate(usize),
    Time,
    Cycle,
    /// A component of a field; `None` on a rank that has nothing of the mesh.
    Field(Option<Operand<'a>>, usize),
}

/// Formulas whose names have been found.
pub(super) struct Program<'a> {
    formulas: Vec<(Expression, Vec<Name<'a>>)>,
}

impl<'a> Program<'a> {
    pub(super) fn new(formula: &Formula, basis: &Basis<'a>) -> Result<Self, String> {
        let mut formulas = Vec::with_capacity(formula.components.len());
        for text in &formula.components {
            let (expression, names) =
                Expression::parse_open(text).map_err(|error| error.to_string())?;
            let names = names.iter().map(|name| find(name, basis));
            formulas.push((expression, names.collect::<Result<Vec<_>, _>>()?));
        }
        let program = Self { formulas };
        let views: Vec<_> = program.operands().map(|operand| operand.view).collect();
        let differs = |pair: &&[&FieldView]| pair[0].association != pair[1].association;
        if let Some(&[first, other]) = views.windows(2).find(differs) {
            return Err(format!(
                "`{}` is a field of association {}, `{}` of association {}; expected fields of one",
                first.name, first.association, other.name, other.association
            ));
        }
        Ok(program)
    }

    fn operands(&self) -> impl Iterator<Item = &Operand<'a>> {
        self.formulas.iter().flat_map(|(_, names)| names).filter_map(|name| match name {
            Name::Field(operand, _) => operand.as_ref(),
            _ => None,
        })
    }

    pub(super) fn components(&self) -> usize {
        self.formulas.len()
    }

    /// The association of the field; without any field in the formulas it is one of vertices.
    /// `None` where this rank does not know.
    pub(super) fn kind(&self) -> Option<(Association, usize)> {
        let mut names = self.formulas.iter().flat_map(|(_, names)| names);
        let knows_not = names.any(|name| matches!(name, Name::Field(None, _)));
        let first = self.operands().next().map(|operand| operand.view.association);
        (!knows_not).then_some((first.unwrap_or(Association::Vertex), self.components()))
    }

    pub(super) fn values(&self, basis: &Basis, association: Association) -> Vec<f64> {
        let (points, cells) = (basis.source.points(), basis.source.cells());
        let at = |entity: usize| -> Vector {
            match association {
                Association::Element => {
                    let vertices = cells.vertices(entity);
                    mean(vertices.iter().map(|&vertex| points[vertex as usize]))
                }
                _ => points[entity],
            }
        };
        let count = if association == Association::Element { cells.len() } else { points.len() };
        let mut all = Vec::with_capacity(count * self.components());
        let mut values = Vec::new();
        #[expect(clippy::cast_precision_loss, reason = "cycles below 2^53")]
        let cycle = basis.cycle as f64;
        for entity in 0..count {
            let lacks = self.operands().any(|operand| operand.is_absent(entity));
            if lacks || !basis.source.shows(association, entity) {
                all.extend(std::iter::repeat_n(ABSENT, self.components()));
                continue;
            }
            let at = at(entity);
            for (expression, names) in &self.formulas {
                values.clear();
                values.extend(names.iter().map(|name| match name {
                    Name::Coordinate(axis) => at[*axis],
                    Name::Time => basis.time,
                    Name::Cycle => cycle,
                    Name::Field(operand, component) => {
                        operand.as_ref().map_or(ABSENT, |operand| operand.value(entity, *component))
                    }
                }));
                all.push(expression.evaluate(&values));
            }
        }
        all
    }
}

fn find<'a>(name: &str, basis: &Basis<'a>) -> Result<Name<'a>, String> {
    match GIVEN.iter().position(|given| *given == name) {
        Some(3) => return Ok(Name::Time),
        Some(4) => return Ok(Name::Cycle),
        Some(axis) => return Ok(Name::Coordinate(axis)),
        None => {}
    }
    if basis.is_bare() {
        return Ok(Name::Field(None, 0));
    }
    let known = || basis.channel.fields.iter().map(|field| field.name);
    let (field, component) = match name.rsplit_once('.') {
        _ if known().any(|known| known == name) => (name, None),
        Some((field, component)) if known().any(|known| known == field) => (field, Some(component)),
        _ => return Err(unknown_field(name, known())),
    };
    let Some(operand) = basis.operand(field)? else { return Ok(Name::Field(None, 0)) };
    let components = operand.view.values.components();
    let index = match component {
        None if components == 1 => Some(0),
        None => {
            return Err(format!(
                "field `{field}` has {components} components, expected one of them, such as `{field}.{}`",
                if components <= 3 { "x" } else { "0" }
            ));
        }
        Some(part) => match (part, components) {
            ("x", ..=3) => Some(0),
            ("y", ..=3) => Some(1),
            ("z", ..=3) => Some(2),
            _ => part.parse().ok(),
        },
    };
    match index.filter(|&index| index < components) {
        Some(index) => Ok(Name::Field(Some(operand), index)),
        None => {
            Err(format!("field `{field}` has {components} components, none of which is `{name}`"))
        }
    }
}
