//! The source stages: what is taken out of a channel's mesh.

use std::borrow::Cow;
use std::sync::Arc;

use tombolo_deform::mesh::{NumberType, Vector, ghosts};

use super::blocks::{Sides, Within};
use super::clip::Clipper;
use super::cut::{Cut, cut};
use super::function::{Function, settled, slacks};
use super::gather::{self, check_length};
use super::input::Input;
use super::pattern::{Base, Kept, Pattern};
use super::probe;
use super::source::{Extracted, Origin, Source};
use super::{
    Association, ExtractError, Field, FieldView, glyphs, is_absent, seeds, streamlines,
    unknown_field,
};
use crate::language::{
    Clip, ClipBy, Contour, Glyphs, GlyphsAt, Probe, Quantifier, Slice, Streamlines, Threshold,
};
use crate::limits::LINE_POINTS;

impl Source {
    /// The cut of the mesh with planes, a cylinder or a sphere: polygons that turn
    /// counter-clockwise about the normal, or seen from outside (lines where the mesh is a
    /// surface), vertex fields interpolated linearly along the cut edges, element fields carried
    /// over. Cells that share an edge share its point. As long as the mesh does not move, what is
    /// `kept` of the last slice is filled with the fields of this step. Collective.
    ///
    /// # Errors
    /// [`ExtractError::PointNotFinite`]; fields as in [`surface`](Self::surface).
    pub fn slice(
        &mut self,
        input: &Input,
        slice: &Slice,
        kept: &mut Kept,
    ) -> Result<Extracted, ExtractError> {
        self.kept(input, kept, |source, fault| {
            let functions = Function::of_slice(slice);
            let points = &source.positions.points;
            let value = |index: usize, vertex: usize| functions[index].value(points[vertex]);
            let slacks = slacks(functions.len(), points.len(), value, input.communicator);
            fault?;
            Ok(source.cut(points, &slacks, value)?.into())
        })
    }

    /// The surfaces on which a vertex field has given values, cut out as a slice is; they are
    /// counter-clockwise seen from where the field is larger. Coordinates are looked at where the
    /// surfaces are. Collective.
    ///
    /// # Errors
    /// [`ExtractError::UnknownField`], [`ExtractError::NotOfVertices`] or
    /// [`ExtractError::DecidingNotFinite`], and as [`slice`](Self::slice).
    pub fn contour(&mut self, input: &Input, contour: &Contour) -> Result<Extracted, ExtractError> {
        // Nothing is kept for another step, so that it need not be known whether the mesh has
        // moved.
        let points = match gather::lent(&input.channel.mesh.points) {
            Some(all) => Cow::Borrowed(all),
            None => Cow::Owned(input.channel.mesh.points.to_vectors()),
        };
        let values = self.vertex_values(input, &contour.field);
        let known = values.as_deref().unwrap_or_default();
        let levels = &contour.values;
        let value = |index: usize, vertex: usize| known[vertex] - levels[index];
        let slacks = slacks(levels.len(), known.len(), value, input.communicator);
        values.as_ref().map_err(Clone::clone)?;
        let cut = self.cut(&points, &slacks, value)?;
        if cut.is_broken {
            // This names the vertex.
            self.update(input)?;
        }
        Ok(Pattern::from(cut).fill_once(input))
    }

    /// The cells in which a field keeps to a range, whole, with their fields. Collective.
    ///
    /// # Errors
    /// As [`contour`](Self::contour); the field may be one of elements.
    pub fn threshold(
        &mut self,
        input: &Input,
        threshold: &Threshold,
    ) -> Result<Extracted, ExtractError> {
        let keeps = |value: f64| {
            threshold.min.is_none_or(|min| value >= min)
                && threshold.max.is_none_or(|max| value <= max)
        };
        let Some(view) = self.field(input, &threshold.field)? else {
            return Ok(self.whole_cells(input, Vec::new())?.fill_once(input));
        };
        if view.association == Association::Mesh {
            let (field, association) = (view.name.to_owned(), view.association);
            return Err(ExtractError::NotOfVertices { field, association });
        }
        let of_elements = view.association == Association::Element;
        let values = self.deciding(input, view)?;
        let is_in = |cell: &u32| {
            let cell = *cell as usize;
            let vertices = self.cells().vertices(cell);
            let mut of_vertices = vertices.iter().map(|&vertex| values[vertex as usize]);
            self.counts(Association::Element, cell)
                && match threshold.vertices {
                    _ if of_elements => keeps(values[cell]),
                    Quantifier::All => of_vertices.all(keeps),
                    Quantifier::Any => of_vertices.any(keeps),
                }
        };
        #[expect(clippy::cast_possible_truncation, reason = "cells are numbered with 32 bits")]
        let cells = (0..self.cells().len() as u32).filter(is_in).collect();
        Ok(self.whole_cells(input, cells)?.fill_once(input))
    }

    /// The part of the mesh on one side of a surface. Cells that are cut become tetrahedra,
    /// pyramids and wedges (triangles and quadrilaterals where the mesh is a surface), by a
    /// decomposition that two cells with a common face have in common; others stay as they are.
    /// Cells of lower dimension are passed over. As long as the mesh does not move, what is `kept`
    /// of the last clip by a plane, box or sphere is filled with the fields of this step.
    /// Collective.
    ///
    /// # Errors
    /// As [`contour`](Self::contour).
    pub fn clip(
        &mut self,
        input: &Input,
        clip: &Clip,
        kept: &mut Kept,
    ) -> Result<Extracted, ExtractError> {
        let functions = match &clip.by {
            ClipBy::Field(field) => {
                let values =
                    self.update(input).and_then(|()| self.vertex_values(input, &field.name));
                let known = values.as_deref().unwrap_or_default();
                let value = |_: usize, vertex: usize| known[vertex] - field.value;
                let slacks = slacks(1, known.len(), value, input.communicator);
                values.as_ref().map_err(Clone::clone)?;
                return Ok(self.clipped(&slacks, value, clip.invert)?.fill_once(input));
            }
            ClipBy::Plane(plane) => vec![Function::from(plane)],
            ClipBy::Sphere(sphere) => vec![Function::from(sphere)],
            ClipBy::Box(region) => Function::of_box(region),
        };
        // Inside a sphere its function is below 0.
        let sign = if matches!(clip.by, ClipBy::Sphere(_)) { -1.0 } else { 1.0 };
        self.kept(input, kept, |source, fault| {
            let points = &source.positions.points;
            let value = |index: usize, vertex: usize| sign * functions[index].value(points[vertex]);
            let slacks = slacks(functions.len(), points.len(), value, input.communicator);
            fault?;
            source.clipped(&slacks, value, clip.invert)
        })
    }

    /// The fields at points. Those that lie in no cell are left out, and named in
    /// [`Extracted::errors`]. As long as the mesh does not move, what is `kept` of the last probe
    /// is filled with the fields of this step. Collective.
    ///
    /// # Errors
    /// As [`slice`](Self::slice).
    pub fn probe(
        &mut self,
        input: &Input,
        stage: &Probe,
        kept: &mut Kept,
    ) -> Result<Extracted, ExtractError> {
        self.kept(input, kept, |source, fault| probe::pattern(source, input, stage, fault))
    }

    /// Lines along a vector field, as the field is now. Seeds that lie in no cell are left out, and
    /// named in [`Extracted::errors`]. The field `integration_time` is the time from the seed,
    /// below 0 against the flow. Collective.
    ///
    /// # Errors
    /// As [`contour`](Self::contour); [`ExtractError::NoVector`], [`ExtractError::Seeds`].
    pub fn streamlines(
        &mut self,
        input: &Input,
        stage: &Streamlines,
    ) -> Result<Extracted, ExtractError> {
        let vectors = self.agreed_vectors(input, Some(&stage.field))?.unwrap_or_default();
        let seeds = seeds::of(self, input, &stage.seeds)?;
        let (pattern, times) =
            streamlines::pattern(self, input, &vectors, &seeds, stage, LINE_POINTS)?;
        let mut extracted = pattern.fill_once(input);
        let extract = Arc::make_mut(&mut extracted.extract);
        extract.fields.retain(|field| field.name != streamlines::TIME);
        extract.fields.push(Field {
            name: streamlines::TIME.to_owned(),
            association: Association::Vertex,
            components: 1,
            number: NumberType::F64,
            values: times,
        });
        Ok(extracted)
    }

    /// Arrows or spheres that show a field, as triangles whose points have the values of the place
    /// that the glyph stands at. Places that lie in no cell are left out. Collective.
    ///
    /// # Errors
    /// As [`streamlines`](Self::streamlines).
    pub fn glyphs(&mut self, input: &Input, stage: &Glyphs) -> Result<Extracted, ExtractError> {
        let vectors = self.agreed_vectors(input, stage.field.as_deref())?;
        let seeds = match &stage.at {
            GlyphsAt::Points(seeds) => seeds::of(self, input, seeds)?,
            _ => Vec::new(),
        };
        let pattern = glyphs::pattern(self, input, vectors.as_deref(), &seeds, stage)?;
        Ok(pattern.fill_once(input))
    }

    /// The vectors of a field where all ranks have them, and know where the vertices are now.
    /// Collective.
    fn agreed_vectors(
        &mut self,
        input: &Input,
        field: Option<&str>,
    ) -> Result<Option<Vec<Vector>>, ExtractError> {
        let found = self.update(input);
        let found = found.and_then(|()| field.map(|name| self.vectors(input, name)).transpose());
        if input.communicator.any(found.is_err()) {
            return Err(found.err().unwrap_or(ExtractError::Elsewhere));
        }
        found
    }

    /// The vector that a vertex field has at each vertex.
    fn vectors(&self, input: &Input, name: &str) -> Result<Vec<Vector>, ExtractError> {
        let Some(view) = self.field(input, name)? else { return Ok(Vec::new()) };
        let (field, association) = (name.to_owned(), view.association);
        let components = view.values.components();
        if association != Association::Vertex {
            return Err(ExtractError::NotOfVertices { field, association });
        }
        if !matches!(components, 2 | 3) {
            return Err(ExtractError::NoVector { field, components });
        }
        self.deciding(input, view)?;
        let vector = |vertex: usize| {
            [0, 1, 2].map(
                |axis| {
                    if axis < components { view.values.get(vertex, axis) } else { 0.0 }
                },
            )
        };
        Ok((0..view.values.len()).map(vector).collect())
    }

    /// Where the vertices were when it was last taken note of.
    pub(crate) fn points(&self) -> &[Vector] {
        &self.positions.points
    }

    /// Adds up what the ranks have of the vertices that they share, `width` values for each vertex.
    /// Collective.
    pub(crate) fn sum_shared(&self, width: usize, values: &mut [f64]) {
        if let Some(whole) = self.whole_mesh() {
            whole.shared.halo().sum(width, values);
        }
    }

    /// The kept pattern of this mesh, made anew on all ranks where it is out of date, with the fields of
    /// this step.
    fn kept(
        &mut self,
        input: &Input,
        kept: &mut Kept,
        make: impl FnOnce(&Self, Result<(), ExtractError>) -> Result<Pattern, ExtractError>,
    ) -> Result<Extracted, ExtractError> {
        let fault = self.update(input);
        let version = self.positions.version;
        let known = kept.of(version).filter(|_| fault.is_ok());
        let is_known = !input.communicator.any(known.is_none());
        let pattern = match known.filter(|_| is_known) {
            Some(pattern) => pattern,
            None => {
                let pattern = Arc::new(make(self, fault)?);
                kept.keep(version, &pattern);
                pattern
            }
        };
        Ok(pattern.fill(input))
    }

    /// Cuts with functions, of which each has its slack; `value` is that of one at a vertex.
    fn cut(
        &self,
        points: &[Vector],
        slacks: &[f64],
        value: impl Fn(usize, usize) -> f64,
    ) -> Result<Cut, ExtractError> {
        let counts = |cell: usize| self.counts(Association::Element, cell);
        let value = |index: usize, vertex: usize| settled(value(index, vertex), slacks[index]);
        Ok(cut(self.cells(), self.blocks(), points, slacks.len(), value, counts)?)
    }

    /// Clips with functions, as [`cut`](Self::cut) cuts.
    fn clipped(
        &self,
        slacks: &[f64],
        value: impl Fn(usize, usize) -> f64,
        invert: bool,
    ) -> Result<Pattern, ExtractError> {
        let points = &self.positions.points;
        let values = |(index, slack): (usize, &f64)| {
            (0..points.len()).map(|vertex| settled(value(index, vertex), *slack)).collect()
        };
        let values: Vec<Vec<f64>> = slacks.iter().enumerate().map(values).collect();
        let numbers = self.whole_mesh().map(|whole| whole.shared.numbers());
        let mut clipper = Clipper::new(self.cells(), points, &values, numbers, invert);
        let sides = |values: &Vec<f64>| Sides::new(values.len(), |vertex| values[vertex]);
        let functions: Vec<Sides> = values.iter().map(sides).collect();
        for (block, within) in self.blocks().within(&functions) {
            if within == (if invert { Within::All } else { Within::None }) {
                continue;
            }
            for cell in block.filter(|&cell| self.counts(Association::Element, cell)) {
                match within {
                    Within::Unknown => clipper.cell(cell)?,
                    Within::All | Within::None => clipper.whole(cell)?,
                }
            }
        }
        Ok(clipper.finish())
    }

    /// These cells, with the vertices that they have.
    fn whole_cells(&self, input: &Input, owners: Vec<u32>) -> Result<Pattern, ExtractError> {
        let points = &input.channel.mesh.points;
        let cells = self.cells().subset(owners.iter().map(|&cell| cell as usize));
        let (cells, vertices) = cells.compact(points.len());
        Ok(Pattern {
            points: gather::points(points, &vertices, input.cycle)?,
            cells: Arc::new(cells),
            base: Base::Vertices(vertices.into()),
            owners: owners.into(),
            origin: Origin::Vertices,
        })
    }

    /// The field of this name; `None` on a rank that has nothing of the mesh.
    fn field<'a>(
        &self,
        input: &Input<'a>,
        name: &str,
    ) -> Result<Option<&'a FieldView<'a>>, ExtractError> {
        let channel = input.channel;
        match channel.fields.iter().find(|view| view.name == name) {
            Some(view) => check_length(channel, view).map(|()| Some(view)),
            None if input.communicator.size() > 1 && channel.mesh.points.is_empty() => Ok(None),
            None => {
                let known = channel.fields.iter().map(|field| field.name);
                Err(ExtractError::UnknownField(unknown_field(name, known)))
            }
        }
    }

    /// The value of a vertex field that decides, at each vertex.
    fn vertex_values<'a>(
        &self,
        input: &Input<'a>,
        name: &str,
    ) -> Result<Cow<'a, [f64]>, ExtractError> {
        match self.field(input, name)? {
            None => Ok(Cow::default()),
            Some(view) if view.association == Association::Vertex => self.deciding(input, view),
            Some(view) => {
                let association = view.association;
                Err(ExtractError::NotOfVertices { field: name.to_owned(), association })
            }
        }
    }

    /// The values of a scalar field, and the magnitudes of any other; NaN where it is absent.
    fn deciding<'a>(
        &self,
        input: &Input<'a>,
        view: &FieldView<'a>,
    ) -> Result<Cow<'a, [f64]>, ExtractError> {
        let components = view.values.components();
        let contiguous = view.values.contiguous().filter(|_| components == 1);
        let are_finite =
            |values: &&[f64]| values.iter().fold(true, |all, value| all & value.is_finite());
        if let Some(values) = contiguous.filter(are_finite) {
            return Ok(Cow::Borrowed(values));
        }
        let mut values = Vec::with_capacity(view.values.len());
        for entity in 0..view.values.len() {
            let value = view.values.magnitude(entity);
            let is_lacking = || is_absent(view.values.get(entity, 0));
            if !value.is_finite() && !is_lacking() && self.shows(view.association, entity) {
                return Err(ExtractError::DecidingNotFinite {
                    field: view.name.to_owned(),
                    association: view.association,
                    entity,
                    value,
                    cycle: input.cycle,
                });
            }
            values.push(if value.is_finite() { value } else { f64::NAN });
        }
        Ok(Cow::Owned(values))
    }

    /// Whether a cell is this rank's own, or a vertex one of such a cell.
    pub(crate) fn shows(&self, association: Association, entity: usize) -> bool {
        self.whole_mesh().is_none_or(|whole| match association {
            Association::Element => ghosts::is_own(whole.ghost_bits(entity)),
            Association::Vertex => !whole.is_ghostly[entity],
            Association::Mesh => false,
        })
    }
}

#[cfg(test)]
mod tests;
