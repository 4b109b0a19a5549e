//! Fields that are derived from others on the solver's mesh, before anything is taken out of it.

mod formula;
mod gradient;
mod running;
mod wall;

use tombolo_deform::communicator::{Communicator, Reduction, agree};
use tombolo_deform::mesh::{ArrayView, NumberType, Values};

use crate::extract::{
    ABSENT, Association, Channel, Field, FieldView, Source, check_length, is_absent, unknown_field,
};
use crate::language::{Derived, Stage};

pub(crate) use running::{Running, follow};
pub(crate) use wall::wall_shear_stress;

/// The input of a derived field.
#[derive(Clone, Copy)]
pub(crate) struct Basis<'a> {
    /// The channel, with the fields that were derived before.
    pub(crate) channel: &'a Channel<'a>,
    pub(crate) source: &'a Source,
    pub(crate) cycle: u64,
    pub(crate) time: f64,
    /// The solver's parameters as they are now.
    pub(crate) parameters: &'a [(String, f64)],
    pub(crate) communicator: &'a dyn Communicator,
}

/// The fields of a channel, those that were derived among them.
pub(crate) fn with_derived<'a>(channel: &Channel<'a>, derived: &'a [Field]) -> Vec<FieldView<'a>> {
    let view = |field: &'a Field| {
        let values = ArrayView::interleaved(Values::F64(&field.values), field.components).ok()?;
        Some(FieldView { name: &field.name, association: field.association, values })
    };
    channel.fields.iter().copied().chain(derived.iter().filter_map(view)).collect()
}

/// The field that a stage derives; `None` where another rank says why there is none. Collective.
///
/// # Errors
/// A text that says what is missing or does not fit.
pub(crate) fn derive(stage: &Stage, basis: &Basis) -> Result<Option<Field>, String> {
    let Some(name) = stage.derived_name() else { return Ok(None) };
    let of = |derived: &Derived| basis.operand(&derived.field);
    let vector = |derived: &Derived| basis.operand(&derived.field).and_then(is_vector);
    let found = if basis.channel.fields.iter().any(|field| field.name == name) {
        Err(format!("the channel has a field `{name}` already"))
    } else {
        match stage {
            Stage::Gradient(derived) | Stage::Magnitude(derived) => of(derived).map(Some),
            Stage::Vorticity(derived) | Stage::Divergence(derived) | Stage::QCriterion(derived) => {
                vector(derived).map(Some)
            }
            _ => Ok(None),
        }
    };
    let formula = match (stage, &found) {
        (Stage::Expression(formula), Ok(_)) => formula::Program::new(formula, basis).map(Some),
        _ => Ok(None),
    };
    let kind = match (&found, &formula) {
        (Err(message), _) | (_, Err(message)) => Err(message.clone()),
        (Ok(Some(operand)), _) => Ok(operand.as_ref().map(Operand::kind)),
        (_, Ok(program)) => Ok(program.as_ref().and_then(formula::Program::kind)),
    };
    let kind = basis.agreed(kind)?;
    let Some((association, components)) = kind else { return Ok(None) };
    let field = |components: usize, values: Vec<f64>| Field {
        name: name.to_owned(),
        association,
        components,
        number: NumberType::F64,
        values,
    };
    if let Ok(Some(program)) = &formula {
        return Ok(Some(field(program.components(), program.values(basis, association))));
    }
    let operand = found.ok().flatten().flatten();
    if let Stage::Magnitude(_) = stage {
        return Ok(Some(field(1, operand.map_or_else(Vec::new, |of| of.magnitudes(basis)))));
    }
    // A vector in a plane has no third component.
    let components = if matches!(stage, Stage::Gradient(_)) { components } else { 3 };
    let gradients = gradient::gradients(basis, operand.as_ref(), association, components);
    let each = |of: &dyn Fn(&[f64]) -> Vec<f64>| -> Vec<f64> {
        let tuples = gradients.chunks(9);
        tuples
            .flat_map(|g| if is_absent(g[0]) { vec![ABSENT; of(g).len()] } else { of(g) })
            .collect()
    };
    Ok(Some(match stage {
        Stage::Vorticity(_) => field(3, each(&|g| vec![g[7] - g[5], g[2] - g[6], g[3] - g[1]])),
        Stage::Divergence(_) => field(1, each(&|g| vec![g[0] + g[4] + g[8]])),
        Stage::QCriterion(_) => field(
            1,
            each(&|g| {
                let squares = g[0] * g[0] + g[4] * g[4] + g[8] * g[8];
                vec![-0.5 * squares - g[1] * g[3] - g[2] * g[6] - g[5] * g[7]]
            }),
        ),
        _ => field(3 * components, gradients),
    }))
}

/// A field that another is derived from.
#[derive(Clone, Copy)]
struct Operand<'a> {
    view: &'a FieldView<'a>,
}

impl Operand<'_> {
    fn kind(&self) -> (Association, usize) {
        (self.view.association, self.view.values.components())
    }

    /// A component; 0 for one that the field lacks.
    fn value(&self, entity: usize, component: usize) -> f64 {
        let values = &self.view.values;
        if component < values.components() { values.get(entity, component) } else { 0.0 }
    }

    fn is_absent(&self, entity: usize) -> bool {
        is_absent(self.view.values.get(entity, 0))
    }

    fn magnitudes(&self, basis: &Basis) -> Vec<f64> {
        let values = &self.view.values;
        let of = |entity: usize| {
            if self.is_absent(entity) || !basis.source.shows(self.view.association, entity) {
                return ABSENT;
            }
            values.magnitude(entity).abs()
        };
        (0..values.len()).map(of).collect()
    }
}

fn is_vector(operand: Option<Operand<'_>>) -> Result<Option<Operand<'_>>, String> {
    match operand {
        Some(Operand { view }) if !matches!(view.values.components(), 2 | 3) => Err(format!(
            "field `{}` has {} components, expected a vector of 2 or 3",
            view.name,
            view.values.components()
        )),
        _ => Ok(operand),
    }
}

impl<'a> Basis<'a> {
    /// The field of this name; `None` on a rank that has nothing of the mesh.
    fn operand(&self, name: &str) -> Result<Option<Operand<'a>>, String> {
        let view = self.channel.fields.iter().find(|view| view.name == name);
        match view {
            None if self.is_bare() => Ok(None),
            None => Err(unknown_field(name, self.channel.fields.iter().map(|field| field.name))),
            Some(view) if view.association == Association::Mesh => Err(format!(
                "field `{name}` is one of the mesh, expected one of vertices or elements"
            )),
            Some(view) => check_length(self.channel, view)
                .map(|()| Some(Operand { view }))
                .map_err(|error| error.to_string()),
        }
    }

    /// Whether this rank has nothing of a mesh of which others have parts.
    fn is_bare(&self) -> bool {
        self.communicator.size() > 1 && self.channel.mesh.points.is_empty()
    }

    /// The association and components on which all ranks agree that have some; `None` where
    /// another rank has failed, or no rank has any.
    fn agreed(
        &self,
        mine: Result<Option<(Association, usize)>, String>,
    ) -> Result<Option<(Association, usize)>, String> {
        let may = agree(self.communicator, mine.as_ref().map(|_| ()));
        let mine = mine?;
        if may.is_err() {
            return Ok(None);
        }
        let code = |(association, components): (Association, usize)| {
            2 * components as u64 + u64::from(association == Association::Element)
        };
        let own = mine.map(code);
        let (mut least, mut largest) = ([own.unwrap_or(u64::MAX)], [own.unwrap_or(0)]);
        self.communicator.reduce_integers(Reduction::Minimum, &mut least);
        self.communicator.reduce_integers(Reduction::Maximum, &mut largest);
        if least[0] < largest[0] {
            return Err("the ranks have fields of this name of different kinds".into());
        }
        let components = (largest[0] / 2) as usize;
        let association =
            if largest[0] % 2 == 1 { Association::Element } else { Association::Vertex };
        Ok((largest[0] > 0).then_some((association, components)))
    }
}
