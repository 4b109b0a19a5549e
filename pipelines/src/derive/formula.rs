//! Fields that formulas give.

use tombolo_deform::mesh::Vector;
use tombolo_deform::vector::mean;

use super::{Basis, Operand};
use crate::expression::Expression;
use crate::extract::{ABSENT, Association, FieldView, unknown_field};
use crate::language::{Formula, GIVEN, PARAMETER, nearest};

/// Where the value of a name comes from.
enum Name<'a> {
    /// A coordinate.
    Coordinate(usize),
    Time,
    Cycle,
    /// A parameter of the solver, by its value now.
    Parameter(f64),
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
                    Name::Parameter(value) => *value,
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
    let known = || basis.channel.fields.iter().map(|field| field.name);
    if let Some(parameter) = name.strip_prefix(PARAMETER) {
        let found = basis.parameters.iter().find(|(known, _)| known == parameter);
        let whole = PARAMETER.trim_end_matches('.');
        let field = known().find(|known| *known == name || *known == whole);
        match (found, field) {
            (Some(_), Some(field)) => {
                return Err(format!(
                    "`{name}` is a parameter of the solver, and of the field `{field}` too; \
                     expected a field of another name"
                ));
            }
            (Some((_, value)), None) => return Ok(Name::Parameter(*value)),
            (None, _) => return Err(unknown_parameter(parameter, basis.parameters)),
        }
    }
    if basis.is_bare() {
        return Ok(Name::Field(None, 0));
    }
    let (field, component) = match name.rsplit_once('.') {
        _ if known().any(|known| known == name) => (name, None),
        Some((field, component)) if known().any(|known| known == field) => (field, Some(component)),
        // A parameter without what stands before its name.
        _ if basis.parameters.iter().any(|(known, _)| known == name) => {
            return Err(format!(
                "the channel has no field `{name}`; the parameter of that name is \
                 `{PARAMETER}{name}`; did you mean `{PARAMETER}{name}`?"
            ));
        }
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

/// A text that says that the solver has no such parameter, which it has, and the nearest.
fn unknown_parameter(name: &str, known: &[(String, f64)]) -> String {
    let known = || known.iter().map(|(known, _)| known.as_str());
    let hint = nearest(name, known())
        .map_or(String::new(), |near| format!("; did you mean `{PARAMETER}{near}`?"));
    let all =
        if known().count() == 0 { "none".into() } else { known().collect::<Vec<_>>().join(", ") };
    format!("the solver has no parameter `{name}`; it has {all}{hint}")
}
