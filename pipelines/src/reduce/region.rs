//! What fields are reduced over: an extract, a surface or its features, or the whole mesh.

use std::sync::Arc;

use tombolo_deform::communicator::{Communicator, agree};
use tombolo_deform::mesh::{ArrayView, Cells, Values, Vector};

use crate::extract::{
    Association, Channel, Extract, ExtractFeatures, Extracted, Field, FieldView, Source,
    check_length, is_absent, merged, unit, unknown_feature, unknown_field,
};
use crate::language::{Slice, Stage};

/// The region of an integral.
#[derive(Clone, Copy)]
pub(crate) struct Region<'a> {
    /// The channel, with the fields that were derived; its points are known to the source where
    /// there is no source stage.
    pub(crate) channel: &'a Channel<'a>,
    pub(crate) source: &'a Source,
    /// The source stage; without one the region is the whole mesh.
    pub(crate) stage: Option<&'a Stage>,
    /// The stage's extract; `None` where it has failed, which has been reported.
    pub(crate) extracted: Option<&'a Extracted>,
    /// Fields of the extract that no later stage is to see.
    pub(crate) unselected: &'a [Field],
    pub(crate) communicator: &'a dyn Communicator,
}

/// A field that is reduced.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'a> {
    pub(super) name: &'a str,
    /// How many components it may have.
    pub(super) components: &'a [usize],
}

/// A rank's part of a region.
pub(super) struct Part<'a> {
    pub(super) cells: &'a Cells,
    pub(super) points: &'a [Vector],
    /// The fields that were wanted, in that order; `None` where another rank looks at them.
    pub(super) fields: Vec<Option<FieldView<'a>>>,
    /// The features of the cells, and the names of those that count.
    of_cells: Option<(&'a ExtractFeatures, &'a [String])>,
}

/// The extract of all ranks together.
pub(super) enum Gathered {
    /// It was not brought together: each rank has its own.
    No,
    /// This rank looks at all of it.
    Here(Arc<Extract>),
    /// Another rank does.
    Elsewhere,
}

/// The properties of a region that all ranks agree on.
pub(super) struct Chosen {
    /// The highest dimension of any cell.
    pub(super) dimension: usize,
    /// Whether no rank has failed.
    pub(super) is_known: bool,
}

impl<'a> Region<'a> {
    /// The surface of the whole mesh, with the fields that are integrated, where it lies in parts
    /// on several ranks: on rank 0, where its features and its outside are known. Collective.
    pub(super) fn surface(&self, wanted: &[Wanted]) -> Result<Gathered, String> {
        match self.is_surface() {
            true => self.gathered(wanted),
            false => Ok(Gathered::No),
        }
    }

    /// The extract of all ranks, with the fields that are wanted; on rank 0. Collective.
    pub(super) fn gathered(&self, wanted: &[Wanted]) -> Result<Gathered, String> {
        let Some(whole) = self.source.whole_mesh().filter(|_| self.stage.is_some()) else {
            return Ok(Gathered::No);
        };
        let lean = self.extracted.map(|extracted| {
            let all = extracted.extract.fields.iter().chain(self.unselected);
            let is_needed = |field: &&Field| wanted.iter().any(|it| it.name == field.name);
            let fields = all.filter(is_needed).cloned().collect();
            let extract = Extract { fields, ..Extract::clone(&extracted.extract) };
            Extracted { extract: Arc::new(extract), ..extracted.clone() }
        });
        // Where a rank has no extract, it has said why.
        let merged = merged(self.communicator, whole, lean.as_ref());
        Ok(match merged.map_err(|_| String::new())? {
            Some(extract) => Gathered::Here(extract),
            None => Gathered::Elsewhere,
        })
    }

    fn is_surface(&self) -> bool {
        matches!(self.stage, Some(Stage::Surface {}))
    }

    /// The direction across a slice by one plane.
    pub(super) fn across(&self) -> Option<Vector> {
        match self.stage {
            Some(Stage::Slice(Slice::Plane(plane))) => Some(unit(plane.normal)),
            _ => None,
        }
    }

    /// This rank's part of the region; an error without a text has been reported already.
    pub(super) fn part<'b>(
        &'b self,
        gathered: &'b Result<Gathered, String>,
        wanted: &[Wanted],
        features: &'b [String],
    ) -> Result<Part<'b>, String> {
        let gathered = gathered.as_ref().map_err(Clone::clone)?;
        let extract = match (self.stage, gathered, self.extracted) {
            (None, ..) => None,
            (_, Gathered::Here(extract), _) => Some(&**extract),
            (_, _, Some(extracted)) => Some(&*extracted.extract),
            (_, _, None) => return Err(String::new()),
        };
        let is_elsewhere = matches!(gathered, Gathered::Elsewhere);
        let is_bare = self.communicator.size() > 1 && self.channel.mesh.points.is_empty();
        let is_here = matches!(gathered, Gathered::Here(_));
        let has_fields = is_here || !(is_elsewhere || is_bare);
        let find = |wanted: &Wanted| match has_fields {
            true => self.field(wanted.name, wanted.components, extract).map(Some),
            false => Ok(None),
        };
        let fields: Result<Vec<_>, String> = wanted.iter().map(find).collect();
        let fields = fields?;
        let mut of_cells = None;
        if let Some(known) = extract.filter(|_| !features.is_empty() && !is_elsewhere) {
            let known = known.features.as_deref().ok_or("the surface has no features")?;
            if let Some(name) = features.iter().find(|&name| !known.names.contains(name)) {
                return Err(unknown_feature(name, &known.names));
            }
            of_cells = Some((known, features));
        }
        let (cells, points) = match extract {
            Some(extract) => (&*extract.cells, &extract.points[..]),
            None => (&**self.source.cells(), self.source.points()),
        };
        Ok(Part { cells, points, fields, of_cells })
    }

    /// The properties of the region that all ranks agree on. Collective.
    pub(super) fn agreed(&self, part: &Result<Part, String>) -> Chosen {
        let is_known = agree(self.communicator, part.as_ref().map(|_| ())).is_ok();
        let dimension = part.as_ref().map_or(0, |part| part.cells.dimension());
        Chosen { dimension: self.communicator.most(dimension), is_known }
    }

    /// Whether a cell of the region counts: it is of its highest dimension, this rank's own, and of
    /// one of the chosen features.
    pub(super) fn counts(&self, part: &Part, cell: usize, dimension: usize) -> bool {
        part.cells.cell_type(cell).dimension() == dimension
            && (self.stage.is_some() || self.source.counts(Association::Element, cell))
            && part.of_cells.is_none_or(|(known, names)| {
                let feature = known.of_cells[cell] as usize;
                known.names.get(feature).is_some_and(|name| names.contains(name))
            })
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
            let expected = match components {
                [1] => "a scalar",
                [2, 3] => "a vector of 2 or 3",
                _ => "a field",
            };
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
