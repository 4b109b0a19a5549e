//! Integrals of fields over an extract or the whole mesh.

use std::sync::Arc;

use tombolo_deform::communicator::{Communicator, Reduction, agree};
use tombolo_deform::mesh::{ArrayView, Cells, Values, Vector};
use tombolo_deform::names::nearest;
use tombolo_deform::vector::{dot, length, scale};

use super::weights::Weights;
use crate::extract::{
    Association, Channel, Extract, ExtractFeatures, Extracted, Field, FieldView, Source,
    check_length, is_absent, merged, unknown_field,
};
use crate::language::{Integrate, Slice, Stage};

/// What is integrated over.
#[derive(Clone, Copy)]
pub(crate) struct Region<'a> {
    /// The channel, with the fields that were derived; its points are known to the source where
    /// there is no source stage.
    pub(crate) channel: &'a Channel<'a>,
    pub(crate) source: &'a Source,
    /// The source stage; without one the region is the whole mesh.
    pub(crate) stage: Option<&'a Stage>,
    /// What the stage has taken; `None` where it has failed, which has been told.
    pub(crate) extracted: Option<&'a Extracted>,
    /// Fields of the extract that no later stage is to see.
    pub(crate) unselected: &'a [Field],
    pub(crate) communicator: &'a dyn Communicator,
}

/// How many cells are added up before their sum is: the sums lose less to rounding.
const CHUNK: usize = 4096;

/// The values of the monitors of a stage: its own, then those of its field and of its vector. They
/// are NaN where any rank has failed. Collective.
///
/// # Errors
/// In the second part: what is missing on this rank, or does not fit.
pub(crate) fn integrate(stage: &Integrate, region: &Region) -> (Vec<f64>, Option<String>) {
    let has_faces = region.stage.is_some_and(Stage::takes_faces);
    let surface = region.surface(stage);
    let terms = match &surface {
        Ok(surface) => region.terms(stage, surface.as_deref()),
        Err(message) => Err(message.clone()),
    };
    let communicator = region.communicator;
    let is_known = agree(communicator, terms.as_ref().map(|_| ())).is_ok();
    let dimension = communicator.most(terms.as_ref().map_or(0, |terms| terms.cells.dimension()));
    let across = region.across().filter(|_| dimension == 1);
    let mut error = terms.as_ref().err().cloned();
    let mut sums = Sums::default();
    if let Ok(terms) = &terms {
        let counts = |cell: usize| {
            let is_own = |cell| region.source.counts(Association::Element, cell);
            terms.cells.cell_type(cell).dimension() == dimension
                && (region.stage.is_some() || is_own(cell))
                && terms.features.is_none_or(|known| known.contains(&stage.features, cell))
        };
        sums = terms.sums(&counts, across);
        if has_faces && stage.vector.is_some() && dimension == 1 && across.is_none() {
            error = Some("lines have no normal, expected faces or a slice by one plane".into());
            sums.0[FLOW] = f64::NAN;
        }
    }
    communicator.reduce(Reduction::Sum, &mut sums.0);
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

/// The surface features that cells belong to.
#[derive(Clone, Copy)]
struct Chosen<'a>(&'a ExtractFeatures);

impl Chosen<'_> {
    fn contains(&self, names: &[String], cell: usize) -> bool {
        let feature = self.0.of_cells[cell] as usize;
        self.0.names.get(feature).is_some_and(|name| names.contains(name))
    }
}

/// What a rank integrates.
struct Terms<'a> {
    cells: &'a Cells,
    points: &'a [Vector],
    field: Option<FieldView<'a>>,
    vector: Option<FieldView<'a>>,
    features: Option<Chosen<'a>>,
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

impl<'a> Region<'a> {
    /// The surface of the whole mesh, with the fields that are integrated, where it lies in parts
    /// on several ranks: on rank 0, where its features and its outside are known. Collective.
    fn surface(&self, stage: &Integrate) -> Result<Option<Arc<Extract>>, String> {
        let Some(whole) = self.source.whole_mesh().filter(|_| self.is_surface()) else {
            return Ok(None);
        };
        let lean = self.extracted.map(|extracted| {
            let all = extracted.extract.fields.iter().chain(self.unselected);
            let names = [&stage.field, &stage.vector];
            let is_needed = |field: &&Field| names.contains(&&Some(field.name.clone()));
            let fields = all.filter(is_needed).cloned().collect();
            let extract = Extract { fields, ..Extract::clone(&extracted.extract) };
            Extracted { extract: Arc::new(extract), ..extracted.clone() }
        });
        // Where a rank has no surface, it has said why.
        merged(self.communicator, whole, lean.as_ref()).map_err(|_| String::new())
    }

    fn is_surface(&self) -> bool {
        matches!(self.stage, Some(Stage::Surface {}))
    }

    /// The direction across a slice by one plane.
    fn across(&self) -> Option<Vector> {
        match self.stage {
            Some(Stage::Slice(Slice::Plane(plane))) => {
                Some(scale(plane.normal, 1.0 / length(plane.normal)))
            }
            _ => None,
        }
    }

    /// What this rank integrates; an error without a text has been told already.
    fn terms<'b>(
        &'b self,
        stage: &Integrate,
        surface: Option<&'b Extract>,
    ) -> Result<Terms<'b>, String> {
        let is_merged = self.is_surface() && self.source.whole_mesh().is_some();
        let extract = match (self.stage, surface, self.extracted) {
            (None, ..) => None,
            (_, Some(surface), _) => Some(surface),
            (_, _, Some(extracted)) => Some(&*extracted.extract),
            (_, _, None) => return Err(String::new()),
        };
        // Rank 0 looks at all of the surface.
        let is_elsewhere = is_merged && surface.is_none();
        let is_bare = self.communicator.size() > 1 && self.channel.mesh.points.is_empty();
        let has_fields = surface.is_some() || !(is_elsewhere || is_bare);
        let find = |name: &Option<String>, components: &[usize]| match name {
            Some(name) if has_fields => self.field(name, components, extract).map(Some),
            _ => Ok(None),
        };
        let (field, vector) = (find(&stage.field, &[1])?, find(&stage.vector, &[2, 3])?);
        let mut features = None;
        if let Some(known) = extract.filter(|_| !stage.features.is_empty() && !is_elsewhere) {
            let known = known.features.as_deref().ok_or("the surface has no features")?;
            if let Some(name) = stage.features.iter().find(|&name| !known.names.contains(name)) {
                return Err(unknown_feature(name, &known.names));
            }
            features = Some(Chosen(known));
        }
        let (cells, points) = match extract {
            Some(extract) => (&*extract.cells, &extract.points[..]),
            None => (&**self.source.cells(), self.source.points()),
        };
        Ok(Terms { cells, points, field, vector, features })
    }

    /// A field of the extract, or of the mesh where there is none.
    fn field<'b>(
        &'b self,
        name: &str,
        components: &[usize],
        extract: Option<&'b Extract>,
    ) -> Result<FieldView<'b>, String> {
        let known = self.channel.fields.iter().map(|field| field.name);
        let of_mesh = self.channel.fields.iter().find(|view| view.name == name).copied();
        let view = match extract {
            None => of_mesh.ok_or_else(|| unknown_field(name, known))?,
            Some(extract) => {
                let mut all = extract.fields.iter().chain(self.unselected);
                let Some(field) = all.find(|field| field.name == name) else {
                    return Err(match of_mesh {
                        Some(_) => format!("field `{name}` could not be taken from all of it"),
                        None => unknown_field(name, known),
                    });
                };
                view_of(field)?
            }
        };
        let found = view.values.components();
        if view.association == Association::Mesh || !components.contains(&found) {
            let expected = if components == [1] { "a scalar" } else { "a vector of 2 or 3" };
            let association = view.association;
            return Err(format!(
                "field `{name}` is one of {association} values of {found} components, expected \
                 {expected} of vertices or elements"
            ));
        }
        if extract.is_none() {
            check_length(self.channel, &view).map_err(|error| error.to_string())?;
            let is_wrong = |&entity: &usize| {
                let mut values = (0..found).map(|component| view.values.get(entity, component));
                self.source.shows(view.association, entity)
                    && values.any(|value| !value.is_finite() && !is_absent(value))
            };
            if let Some(entity) = (0..view.values.len()).find(is_wrong) {
                return Err(format!(
                    "field `{name}` is not finite at {} {entity}",
                    view.association
                ));
            }
        }
        Ok(view)
    }
}

fn view_of(field: &Field) -> Result<FieldView<'_>, String> {
    let values = ArrayView::interleaved(Values::F64(&field.values), field.components);
    let values = values.map_err(|error| error.to_string())?;
    Ok(FieldView { name: &field.name, association: field.association, values })
}

fn unknown_feature(name: &str, known: &[String]) -> String {
    let hint = nearest(name, known.iter().map(String::as_str))
        .map_or(String::new(), |near| format!("; did you mean `{near}`?"));
    format!("the surface has no feature `{name}`; its features are {}{hint}", known.join(", "))
}
