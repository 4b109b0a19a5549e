//! The editor: from a stack of edits to the displacement of a surface.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::error::EditError;
use super::handle::{Handle, Role};
use super::kept_layers::{Followed, KeptLayer, KeptLayers, without_amount};
use super::kinds::Edit;
use super::motion::{self, Motion};
use super::skeleton::SkeletonEditor;
use crate::cancellation::Cancellation;
use crate::harmonic::{HarmonicOrder, Laplacian, NotFactored, Polyharmonic};
use crate::mesh::Vector;
use crate::skeleton::{Skeleton, SkeletonError, SkinError};
use crate::surface::adjacency::Adjacency;
use crate::surface::{Surface, SurfaceError};
use crate::vector::add;

/// How many factored operators are kept, and how many numbers they may hold together (8 bytes
/// each); the newest is always kept.
const OPERATORS_KEPT: usize = 8;
const NUMBERS_KEPT: usize = 1 << 26;

/// How much the two sides of a seam may part, in units of the largest motion.
const SEAM: f64 = 1e-6;

/// How much slack the triangles of the Laplacian must have (see [`Laplacian`]). The first is for
/// rounding alone; the others are tried one after the other on surfaces whose triangles are so thin
/// that the operator cannot be factored accurately.
const SLACKS: [f64; 4] = [1e-9, 1e-5, 1e-3, 1e-1];

/// Evaluates stacks of edits on one surface.
///
/// # What it guarantees
/// - The displacement depends on the surface and the stack alone, not on what was evaluated before:
///   same stack, same bits.
/// - An empty stack gives exact zeros. Vertices of fixed features move by exactly zero; vertices of
///   the handle make exactly the motion the edit states; a vertex in both stays fixed. Where all of
///   them in a connected component make the same translation, so does the whole component, exactly.
///   Axes along which nothing is prescribed to move do not move.
/// - The free vertices solve the polyharmonic equation on the reference surface with the handle's
///   motion and the fixed vertices prescribed. Components on which nothing is prescribed stay where
///   they are.
/// - Without a fixed feature nothing holds the surface back: a component then moves as a whole with
///   a handle that is translated, and takes the smoothest shape that fits its motion otherwise.
/// - Every edit acts on the shape that the edits before it have reached.
/// - No seam opens: where two open rims have the same coordinates without being joined, an edit
///   that would part them is refused ([`EditError::OpensSeam`]).
///
/// # What it does not
/// On surfaces with triangles so thin that the operator cannot be factored to six digits, it is
/// that of a slightly inflated surface.
///
/// It does not look at what the surface runs into: folds, flat parts and self-intersections are the
/// guard's business. Slopes and curvatures are continuous as far as the prescribed features carry
/// them: a part one ring of faces wide fixes a slope, one two rings wide a curvature. At an open
/// rim that nothing is prescribed on, the displacement has no slope across it.
///
/// # Performance
/// [`Editor::new`] sets up the Laplacian, in linear time. Each new choice of handle, fixed features
/// and order factors one sparse matrix, by nested dissection: `O(n^1.5)` operations and
/// `O(n log n)` numbers for `n` vertices. What follows is linear in the handle's motion, so that it
/// is solved once for each scalar field that the motion is made of (one for a translation, up to
/// four for an affine map) on the shape below; another amount of the same edit costs one
/// multiplication and addition for each vertex and field. A few operators and layers are kept, so
/// that editing the last layer does not evaluate those below it again.
///
/// ```
/// use std::sync::Arc;
/// use tombolo_deform::shapes;
/// use tombolo_deform::edit::{Edit, Editor, HarmonicOrder, Translate};
/// use tombolo_deform::features::FeatureSettings;
/// use tombolo_deform::surface::Surface;
///
/// let mesh = shapes::box_of_tets([8, 2, 2], [0.0; 3], [4.0, 1.0, 1.0]);
/// let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?);
/// let mut editor = Editor::new(Arc::clone(&surface))?;
/// let edit = Edit::Translate(Translate {
///     features: vec!["x-max".into()],
///     fixed: vec!["x-min".into()],
///     by: [0.0, 0.0, 0.5],
///     harmonic_order: HarmonicOrder::Biharmonic,
///     ..Translate::default()
/// });
/// let displacement = editor.displacement(&[edit])?;
/// for (point, moved) in surface.points().iter().zip(&displacement) {
///     assert_eq!(moved[0], 0.0);
///     if point[0] == 4.0 {
///         assert_eq!(moved[2], 0.5);
///     }
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Editor {
    surface: Arc<Surface>,
    /// The largest coordinate.
    farthest: f64,
    /// One for each of the first [`SLACKS`] so far needed.
    laplacians: Vec<Laplacian>,
    parts: Vec<u32>,
    operators: Vec<Polyharmonic>,
    skeletons: SkeletonEditor,
    /// Rim vertices with the same coordinates.
    seams: Vec<[u32; 2]>,
    layers: KeptLayers,
    cancellation: Cancellation,
}

impl Editor {
    /// An editor of a surface.
    ///
    /// # Errors
    /// [`SurfaceError::NonManifoldEdge`], [`SurfaceError::NonManifoldVertex`].
    pub fn new(surface: Arc<Surface>) -> Result<Self, SurfaceError> {
        let adjacency = Adjacency::new(&surface)?;
        adjacency.check_vertices(&surface)?;
        let laplacians = vec![Laplacian::new(&surface, &adjacency, SLACKS[0])];
        let parts = surface.components();
        let seams = adjacency.seams(&surface);
        let skeletons = SkeletonEditor::new(Arc::clone(&surface));
        let farthest = surface.points().as_flattened().iter().fold(0.0, |farthest, value| {
            if value.abs() > farthest { value.abs() } else { farthest }
        });
        Ok(Self {
            surface,
            farthest,
            laplacians,
            parts,
            operators: Vec::new(),
            skeletons,
            seams,
            layers: KeptLayers::default(),
            cancellation: Cancellation::default(),
        })
    }

    /// The editor with what has its work given up: that is looked at before each edit, each factor
    /// and each step of the extraction of a skeleton. A factor that was begun is finished.
    #[must_use]
    pub fn with_cancellation(self, cancellation: Cancellation) -> Self {
        let skeletons = self.skeletons.with_cancellation(cancellation.clone());
        Self { skeletons, cancellation, ..self }
    }

    fn require_wanted(&self) -> Result<(), EditError> {
        if self.cancellation.is_cancelled() { Err(EditError::Cancelled) } else { Ok(()) }
    }

    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &Arc<Surface> {
        &self.surface
    }

    /// Makes skeleton edits drag this skeleton, in place of the one that the first of them would
    /// extract.
    ///
    /// # Errors
    /// [`SkinError::OtherSurface`], where it does not carry as many vertices as the surface has.
    pub fn with_skeleton(mut self, skeleton: Arc<Skeleton>) -> Result<Self, SkinError> {
        self.skeletons.set(skeleton)?;
        self.layers.clear();
        Ok(self)
    }

    /// The skeleton of the reference surface, that skeleton edits drag. The first call extracts it,
    /// unless it was given.
    ///
    /// # Errors
    /// [`SkeletonError`], where the surface has none.
    pub fn skeleton(&mut self) -> Result<Arc<Skeleton>, SkeletonError> {
        self.skeletons.skeleton()
    }

    /// Extracts the skeleton when it is called, on whatever thread that is: the first skeleton edit
    /// then finds it there, or waits for it. Nothing is extracted where a skeleton was given.
    pub fn skeleton_in_advance(&self) -> impl FnOnce() + Send + 'static + use<> {
        self.skeletons.in_advance()
    }

    /// The displacement of each surface vertex from [`Surface::points`] that a stack of edits asks
    /// for.
    ///
    /// # Errors
    /// [`EditError`], naming the edit by its index in the stack, from 0. Nothing is evaluated
    /// unless every edit of the stack is valid on this surface.
    pub fn displacement(&mut self, stack: &[Edit]) -> Result<Vec<Vector>, EditError> {
        let mut displacement = Vec::new();
        self.displacement_into(stack, &mut displacement)?;
        Ok(displacement)
    }

    /// The first problem of each edit on this surface; nothing is evaluated. Edits that drag the
    /// skeleton have it extracted.
    pub fn check(&mut self, edits: &[Edit]) -> Vec<EditError> {
        let mut errors = Vec::new();
        for (index, edit) in edits.iter().enumerate() {
            let mut found = Handle::find(&self.surface, edit, index).map(drop);
            if let (Ok(()), Edit::Skeleton(drag)) = (&found, edit)
                && !drag.muted
            {
                let nodes = self.skeletons.nodes(drag).map(drop);
                found = nodes.map_err(|source| EditError::skeleton(index, source));
            }
            errors.extend(found.err());
        }
        errors
    }

    /// [`Editor::displacement`] into memory that is there already. After an error it holds nothing
    /// of meaning.
    ///
    /// # Errors
    /// [`EditError`], as [`Editor::displacement`].
    pub fn displacement_into(
        &mut self,
        stack: &[Edit],
        displacement: &mut Vec<Vector>,
    ) -> Result<(), EditError> {
        let kept = self.layers.best_for(stack);
        let known = kept.map_or(0, |kept| self.layers.get(kept).index);
        // Handles are as large as the surface: of several edits none is kept for the time when it
        // is needed.
        let mut handle = None;
        for (index, edit) in stack.iter().enumerate().skip(known) {
            let followed = kept.and_then(|kept| self.layers.get(kept).followed.as_ref());
            handle = if index == known && followed.is_some_and(|followed| followed.is_for(edit)) {
                edit.validate().map_err(|source| EditError::Invalid {
                    edit: index,
                    name: edit.name(),
                    source,
                })?;
                None
            } else {
                Some(Handle::find(&self.surface, edit, index)?)
            };
        }
        for (index, edit) in stack.iter().enumerate().skip(known) {
            if let Edit::Skeleton(drag) = edit
                && !drag.muted
            {
                self.skeletons.nodes(drag).map_err(|source| EditError::skeleton(index, source))?;
            }
        }
        displacement.resize(self.surface.points().len(), [0.0; 3]);
        if kept.is_none() {
            displacement.fill([0.0; 3]);
        }
        let layers = kept
            .and_then(|kept| self.layers.take(kept))
            .map(|layer| (known, layer))
            .into_iter()
            .collect();
        self.evaluate(stack, known, layers, handle, displacement, |_, _, _| Ok(()))
    }

    /// Evaluates the edits from `from` on, on the `displacement` that those below lead to. `layers`
    /// are those of its edits that were evaluated before, by their indices; `handle` is that of the
    /// last edit, where it is at hand. `visit` is told of each edit by its index, and the
    /// displacements below it and with it.
    pub(super) fn evaluate(
        &mut self,
        stack: &[Edit],
        from: usize,
        mut layers: BTreeMap<usize, KeptLayer>,
        mut handle: Option<Handle>,
        displacement: &mut [Vector],
        mut visit: impl FnMut(usize, &[Vector], &[Vector]) -> Result<(), EditError>,
    ) -> Result<(), EditError> {
        let mut shared: Option<Arc<[Edit]>> = None;
        for (index, edit) in stack.iter().enumerate().skip(from) {
            self.require_wanted()?;
            let mut layer = layers.remove(&index).unwrap_or_else(|| {
                let stack = Arc::clone(shared.get_or_insert_with(|| stack.into()));
                KeptLayer { stack, index, below: displacement.to_vec(), followed: None }
            });
            let handle = handle.take_if(|_| index + 1 == stack.len());
            let result = self.apply(index, edit, handle, &mut layer, displacement);
            let result = result.and_then(|()| visit(index, &layer.below, displacement));
            self.layers.keep(layer, self.surface.points().len());
            result?;
        }
        Ok(())
    }

    /// How far [`Editor::displacement`] of a stack is from the exact solution of its equations, at
    /// the vertex where it is farthest and in units of the largest motion that the last edit
    /// prescribes: the error that rounding has left. What the edits below the last one add to it is
    /// not counted; where the last edit solves no equation it is 0.
    ///
    /// The exact solution is found by refinement with residuals in twice the digits, which takes
    /// some ten times as long as the displacement itself.
    ///
    /// # Errors
    /// [`EditError`], as [`Editor::displacement`].
    ///
    /// ```
    /// use std::sync::Arc;
    /// use tombolo_deform::{shapes, edit::{Edit, Editor}, features::FeatureSettings, surface::Surface};
    ///
    /// let mesh = shapes::box_of_tets([8, 2, 2], [0.0; 3], [4.0, 1.0, 1.0]);
    /// let mut editor = Editor::new(Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?))?;
    /// let edit: Edit = serde_json::from_str(
    ///     r#"{ "translate": { "features": ["x-max"], "fixed": ["x-min"], "by": [0, 0, 1], "harmonic_order": 3 } }"#,
    /// )?;
    /// assert!(editor.forward_error(&[edit])? < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn forward_error(&mut self, stack: &[Edit]) -> Result<f64, EditError> {
        self.displacement(stack)?;
        let Some((index, edit, order)) = stack
            .last()
            .filter(|edit| !edit.muted())
            .and_then(|edit| Some((stack.len() - 1, edit, edit.harmonic_order()?)))
        else {
            return Ok(0.0);
        };
        let handle = Handle::find(&self.surface, edit, index)?;
        let prescribed: Vec<bool> = handle.roles.iter().map(|role| *role != Role::Free).collect();
        self.choose_operator(order, prescribed.clone()).map_err(|reason| {
            EditError::NotSolvable { edit: index, name: edit.name(), order, reason }
        })?;
        let operator = self.operators.last();
        let followed = self.layers.last().and_then(|layer| layer.followed.as_ref());
        let (Some(operator), Some(followed)) = (operator, followed) else { return Ok(0.0) };
        let laplacian = &self.laplacians[operator.level()];
        let errors = followed
            .bases
            .iter()
            .map(|base| base.as_ref().map(|base| operator.error(laplacian, base)))
            .collect();
        let errors =
            Followed { setting: followed.setting.clone(), unit: followed.unit, bases: errors };
        let size =
            |moved: &Vector| moved.iter().fold(0.0f64, |largest, part| largest.max(part.abs()));
        let below = vec![[0.0; 3]; self.surface.points().len()];
        let [mut moved, mut wrong] = [below.clone(), below.clone()];
        followed.add(edit, &below, f64::MAX, &mut moved);
        errors.add(edit, &below, f64::MAX, &mut wrong);
        let motion = moved
            .iter()
            .zip(&prescribed)
            .filter(|(_, prescribed)| **prescribed)
            .map(|(moved, _)| size(moved));
        let motion = motion.fold(0.0, f64::max);
        Ok(if motion > 0.0 { wrong.iter().map(size).fold(0.0, f64::max) / motion } else { 0.0 })
    }

    /// Takes out the layers of a stack's edits that were evaluated before, by their indices.
    pub(super) fn take_layers(&mut self, stack: &[Edit]) -> BTreeMap<usize, KeptLayer> {
        self.layers.take_all(stack)
    }

    #[cfg(test)]
    pub(super) fn kept_layers(&self) -> &KeptLayers {
        &self.layers
    }

    /// `displacement` becomes what the edits below and this one lead to. `handle` may be missing
    /// where the layer has been followed before.
    fn apply(
        &mut self,
        index: usize,
        edit: &Edit,
        handle: Option<Handle>,
        layer: &mut KeptLayer,
        displacement: &mut [Vector],
    ) -> Result<(), EditError> {
        if edit.muted() {
            displacement.copy_from_slice(&layer.below);
            return Ok(());
        }
        let finite = match edit {
            Edit::Displacement(import) => {
                displacement.copy_from_slice(&layer.below);
                let handle = handle.map_or_else(|| Handle::find(&self.surface, edit, index), Ok)?;
                self.add(&motion::displacement(&self.surface, import, &handle), displacement)
            }
            Edit::Skeleton(drag) => {
                displacement.copy_from_slice(&layer.below);
                let handle = handle.map_or_else(|| Handle::find(&self.surface, edit, index), Ok)?;
                let held = handle.roles.iter().map(|role| *role != Role::Handle).collect();
                let moved = self.skeletons.displacement(drag, held, displacement);
                self.add(&moved.map_err(|source| EditError::skeleton(index, source))?, displacement)
            }
            _ => {
                self.follow(index, edit, handle, layer)?;
                match &layer.followed {
                    Some(followed) => {
                        // Places are read only where a sum might not be finite.
                        followed.add(edit, &layer.below, f64::MAX - self.farthest, displacement)
                            || self.all_finite(displacement)
                    }
                    None => {
                        displacement.copy_from_slice(&layer.below);
                        true
                    }
                }
            }
        };
        if !finite {
            let reached =
                self.surface.points().iter().zip(displacement.iter()).map(|(a, b)| add(*a, *b));
            let vertex = reached
                .into_iter()
                .position(|point| !point.iter().all(|value| value.is_finite()))
                .unwrap_or(0);
            let vertex = self.surface.vertices()[vertex];
            return Err(EditError::OutOfRange { edit: index, name: edit.name(), vertex });
        }
        self.check_seams(index, edit, displacement)
    }

    /// Adds a displacement; whether all points reached are finite.
    fn add(&self, moved: &[Vector], displacement: &mut [Vector]) -> bool {
        displacement.iter_mut().zip(moved).for_each(|(sum, moved)| *sum = add(*sum, *moved));
        self.all_finite(displacement)
    }

    fn all_finite(&self, displacement: &[Vector]) -> bool {
        let mut reached = self
            .surface
            .points()
            .iter()
            .zip(displacement)
            .map(|(point, moved)| add(*point, *moved));
        reached.all(|point| point.iter().all(|value| value.is_finite()))
    }

    /// Solves for what the free surface makes of each base of the handle's motion that this edit
    /// has a part of.
    fn follow(
        &mut self,
        index: usize,
        edit: &Edit,
        handle: Option<Handle>,
        layer: &mut KeptLayer,
    ) -> Result<(), EditError> {
        let Some(order) = edit.harmonic_order() else { return Ok(()) };
        if layer
            .followed
            .as_ref()
            .is_some_and(|followed| followed.is_for(edit) && followed.has_bases_of(edit))
        {
            return Ok(());
        }
        let handle = handle.map_or_else(|| Handle::find(&self.surface, edit, index), Ok)?;
        let points = self.surface.points().iter();
        let shape: Vec<Vector> =
            points.zip(&layer.below).map(|(point, moved)| add(*point, *moved)).collect();
        let Some(motion) = Motion::new(&self.surface, edit, index, &handle, &shape)? else {
            return Ok(());
        };

        let old = layer.followed.take().filter(|followed| followed.is_for(edit));
        let mut followed = old.unwrap_or_else(|| Followed {
            setting: without_amount(edit),
            unit: motion.unit,
            bases: vec![None; motion.bases.len()],
        });
        let wanted: Vec<usize> = followed.missing(edit).collect();
        let mut fields = vec![vec![0.0; shape.len()]; wanted.len()];
        for (field, &base) in fields.iter_mut().zip(&wanted) {
            for (&vertex, &value) in handle.vertices.iter().zip(&motion.bases[base]) {
                if handle.roles[vertex as usize] == Role::Handle {
                    field[vertex as usize] = value;
                }
            }
        }
        let prescribed: Vec<bool> = handle.roles.iter().map(|role| *role != Role::Free).collect();
        self.require_wanted()?;
        self.choose_operator(order, prescribed).map_err(|reason| EditError::NotSolvable {
            edit: index,
            name: edit.name(),
            order,
            reason,
        })?;
        self.require_wanted()?;
        if let Some(operator) = self.operators.last() {
            operator.solve(&self.laplacians[operator.level()], &self.parts, &mut fields);
        }
        for (field, base) in fields.into_iter().zip(wanted) {
            followed.bases[base] = Some(field);
        }
        layer.followed = Some(followed);
        Ok(())
    }

    /// Refuses what would open a seam.
    fn check_seams(
        &self,
        index: usize,
        edit: &Edit,
        displacement: &[Vector],
    ) -> Result<(), EditError> {
        if self.seams.is_empty() {
            return Ok(());
        }
        let largest =
            displacement.iter().flatten().fold(0.0f64, |largest, value| largest.max(value.abs()));
        for &seam in &self.seams {
            let [a, b] = seam.map(|vertex| displacement[vertex as usize]);
            if (0..3).any(|axis| (a[axis] - b[axis]).abs() > SEAM * largest) {
                let vertices = seam.map(|vertex| self.surface.vertices()[vertex as usize]);
                return Err(EditError::OpensSeam { edit: index, name: edit.name(), vertices });
            }
        }
        Ok(())
    }

    /// Brings the operator for an order and a set of prescribed vertices to the end of the kept
    /// ones: kept from before, or factored now.
    fn choose_operator(
        &mut self,
        order: HarmonicOrder,
        prescribed: Vec<bool>,
    ) -> Result<(), String> {
        let operator =
            match self.operators.iter().position(|operator| operator.is_for(order, &prescribed)) {
                Some(found) => self.operators.remove(found),
                None => self.factor(order, prescribed)?,
            };
        let mut room = NUMBERS_KEPT.saturating_sub(operator.size());
        // The most recently used are at the end.
        let kept = self.operators.iter().rev().take(OPERATORS_KEPT - 1).take_while(|operator| {
            let fits = operator.size() <= room;
            room = room.saturating_sub(operator.size());
            fits
        });
        let dropped = self.operators.len() - kept.count();
        self.operators.drain(..dropped);
        self.operators.push(operator);
        Ok(())
    }

    fn factor(
        &mut self,
        order: HarmonicOrder,
        prescribed: Vec<bool>,
    ) -> Result<Polyharmonic, String> {
        let mut reason = String::new();
        for (level, slack) in SLACKS.into_iter().enumerate() {
            if self.laplacians.len() == level {
                let adjacency = Adjacency::new(&self.surface).map_err(|error| error.to_string())?;
                self.laplacians.push(Laplacian::new(&self.surface, &adjacency, slack));
            }
            let laplacian = &self.laplacians[level];
            let points = self.surface.points();
            match Polyharmonic::new(
                points,
                laplacian,
                level,
                order,
                prescribed.clone(),
                &self.parts,
            ) {
                Ok(operator) => return Ok(operator),
                Err(NotFactored::NotPositive) => reason = NotFactored::NotPositive.to_string(),
                Err(other) => return Err(other.to_string()),
            }
        }
        Err(reason)
    }
}

impl std::fmt::Debug for Editor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Editor")
            .field("vertices", &self.surface.points().len())
            .field("operators", &self.operators.len())
            .finish_non_exhaustive()
    }
}
