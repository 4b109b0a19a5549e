//! The editor: from a stack of edits to the displacement of a surface.

use std::sync::Arc;

use super::features::Parts;
use super::handle::{Handle, Role};
use super::laplacian::Laplacian;
use super::motion::{self, Motion};
use super::polyharmonic::{NotFactored, Polyharmonic};
use super::{Edit, EditError, HarmonicOrder, Surface, SurfaceError};
use crate::mesh::Vector;
use crate::skeleton::{Skeleton, SkeletonEditor, SkeletonError, SkinError};
use crate::vector::add;

/// How many factored operators are kept, and how many numbers they may hold together (8 bytes each); the newest is always kept.
const OPERATORS_KEPT: usize = 8;
const NUMBERS_KEPT: usize = 1 << 26;

/// How much slack the triangles of the Laplacian must have (see [`Laplacian`]). The first is for rounding alone; the others are
/// tried one after the other on surfaces whose triangles are so thin that the operator cannot be factored accurately.
const SLACKS: [f64; 4] = [1e-9, 1e-5, 1e-3, 1e-1];

/// Evaluates stacks of edits on one surface.
///
/// # What it guarantees
/// - The displacement depends on the surface and the stack alone, not on what was evaluated before: same stack, same bits.
/// - An empty stack gives exact zeros. Vertices of fixed features move by exactly zero; vertices of the handle make exactly the
///   motion the edit states; a vertex in both stays fixed. Where all of them in a connected component make the same
///   translation, so does the whole component, exactly. Axes along which nothing is prescribed to move do not move.
/// - The free vertices solve the polyharmonic equation on the reference surface with the handle's motion and the fixed vertices
///   prescribed. Components on which nothing is prescribed stay where they are.
/// - Every edit acts on the shape that the edits before it have reached.
///
/// # What it does not
/// On surfaces with triangles so thin that the operator cannot be factored to six digits, it is that of a slightly inflated
/// surface.
///
/// It does not look at what the surface runs into: folds, flat parts and self-intersections are the guard's business.
/// Slopes and curvatures are continuous as far as the prescribed features carry them: a part one ring of faces wide fixes a
/// slope, one two rings wide a curvature. At an open rim that nothing is prescribed on, the displacement has no slope across it.
///
/// # Performance
/// [`Editor::new`] sets up the Laplacian. Each new choice of handle, fixed features and order factors one sparse matrix; a few
/// are kept, so that changing an amount costs one pair of triangular solves, and editing the last layer does not evaluate those
/// below it again.
///
/// ```
/// use std::sync::Arc;
/// use tombolo_deform::shapes;
/// use tombolo_deform::surface::{Edit, Editor, FeatureSettings, HarmonicOrder, Surface, Translate};
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
    /// One for each of the first [`SLACKS`] so far needed.
    laplacians: Vec<Laplacian>,
    parts: Vec<u32>,
    operators: Vec<Polyharmonic>,
    skeletons: SkeletonEditor,
    /// The stack without its last edit, as it was last evaluated.
    below: Option<(Vec<Edit>, Vec<Vector>)>,
}

impl Editor {
    /// An editor of a surface.
    ///
    /// # Errors
    /// [`SurfaceError::NonManifoldEdge`].
    pub fn new(surface: Arc<Surface>) -> Result<Self, SurfaceError> {
        let laplacians = vec![Laplacian::new(&surface, SLACKS[0])?];
        let mut parts = Parts::new(surface.points().len());
        for &[a, b, c] in surface.triangles() {
            parts.join(a, b);
            parts.join(b, c);
        }
        let parts = (0..surface.points().len() as u32).map(|vertex| parts.root(vertex)).collect();
        let skeletons = SkeletonEditor::new(Arc::clone(&surface));
        Ok(Self { surface, laplacians, parts, operators: Vec::new(), skeletons, below: None })
    }

    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &Arc<Surface> {
        &self.surface
    }

    /// The same with this skeleton, in place of the one that would be extracted when the first skeleton edit needs it.
    ///
    /// # Errors
    /// [`SkinError::OtherSurface`], where it does not carry as many vertices as the surface has.
    pub fn with_skeleton(mut self, skeleton: Arc<Skeleton>) -> Result<Self, SkinError> {
        self.skeletons.set(skeleton)?;
        self.below = None;
        Ok(self)
    }

    /// The skeleton of the reference surface, that skeleton edits drag. The first call extracts it, unless it was given.
    ///
    /// # Errors
    /// [`SkeletonError`], where the surface has none.
    pub fn skeleton(&mut self) -> Result<Arc<Skeleton>, SkeletonError> {
        self.skeletons.skeleton()
    }

    /// The displacement of each surface vertex from [`Surface::points`] that a stack of edits asks for.
    ///
    /// # Errors
    /// [`EditError`], naming the edit by its place in the stack, counted from 0. Nothing is evaluated unless every edit of the
    /// stack is valid on this surface.
    pub fn displacement(&mut self, stack: &[Edit]) -> Result<Vec<Vector>, EditError> {
        let handles = stack
            .iter()
            .enumerate()
            .map(|(edit, what)| Handle::find(&self.surface, what, edit))
            .collect::<Result<Vec<_>, _>>()?;
        for (edit, what) in stack.iter().enumerate() {
            if let Edit::Skeleton(drag) = what
                && !drag.muted
            {
                self.skeletons.nodes(drag).map_err(|source| EditError::skeleton(edit, source))?;
            }
        }
        let Some((_, lower)) = stack.split_last() else {
            return Ok(vec![[0.0; 3]; self.surface.points().len()]);
        };
        let (done, mut displacement) = match self.below.take() {
            Some((edits, displacement)) if edits == lower => (lower.len(), displacement),
            _ => (0, vec![[0.0; 3]; self.surface.points().len()]),
        };
        for (edit, handle) in handles.iter().enumerate().skip(done) {
            if edit + 1 == stack.len() {
                self.below = Some((lower.to_vec(), displacement.clone()));
            }
            self.apply(edit, &stack[edit], handle, &mut displacement)?;
        }
        Ok(displacement)
    }

    fn apply(
        &mut self,
        edit: usize,
        what: &Edit,
        handle: &Handle,
        displacement: &mut [Vector],
    ) -> Result<(), EditError> {
        if what.muted() {
            return Ok(());
        }
        let fields = match what {
            Edit::Displacement(import) => axes(&motion::displacement(&self.surface, import, handle)),
            Edit::Skeleton(drag) => {
                let held = handle.roles.iter().map(|role| *role != Role::Handle).collect();
                let moved = self.skeletons.displacement(drag, held, displacement);
                axes(&moved.map_err(|source| EditError::skeleton(edit, source))?)
            }
            _ => self.follow(edit, what, handle, displacement)?,
        };
        for (vertex, moved) in displacement.iter_mut().enumerate() {
            let reference = self.surface.points()[vertex];
            for axis in 0..3 {
                moved[axis] += fields[axis][vertex];
                if !(reference[axis] + moved[axis]).is_finite() {
                    return Err(EditError::OutOfRange {
                        edit,
                        name: what.name(),
                        vertex: self.surface.vertices()[vertex],
                    });
                }
            }
        }
        Ok(())
    }

    /// The displacement along each axis of an edit whose handle makes a [`Motion`] that the free surface follows.
    fn follow(
        &mut self,
        edit: usize,
        what: &Edit,
        handle: &Handle,
        displacement: &[Vector],
    ) -> Result<[Vec<f64>; 3], EditError> {
        let shape: Vec<Vector> =
            self.surface.points().iter().zip(displacement).map(|(point, moved)| add(*point, *moved)).collect();
        let mut fields = [0, 1, 2].map(|_| vec![0.0; shape.len()]);
        let motion = Motion::new(&self.surface, what, edit, handle, &shape)?;
        let (Some(motion), Some(order)) = (motion, what.harmonic_order()) else { return Ok(fields) };
        for (&vertex, motion) in handle.vertices.iter().zip(&motion.displacement()) {
            if handle.roles[vertex as usize] == Role::Handle {
                for axis in 0..3 {
                    fields[axis][vertex as usize] = motion[axis];
                }
            }
        }
        let prescribed: Vec<bool> = handle.roles.iter().map(|role| *role != Role::Free).collect();
        self.choose_operator(order, prescribed).map_err(|reason| EditError::NotSolvable {
            edit,
            name: what.name(),
            order,
            reason,
        })?;
        if let Some(operator) = self.operators.last() {
            operator.solve(&self.laplacians[operator.level()], &self.parts, &mut fields);
        }
        Ok(fields)
    }

    /// Brings the operator for an order and a set of prescribed vertices to the end of the kept ones: kept from before, or
    /// factored now.
    fn choose_operator(&mut self, order: HarmonicOrder, prescribed: Vec<bool>) -> Result<(), String> {
        let operator = match self.operators.iter().position(|operator| operator.is_for(order, &prescribed)) {
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

    fn factor(&mut self, order: HarmonicOrder, prescribed: Vec<bool>) -> Result<Polyharmonic, String> {
        let mut reason = String::new();
        for (level, slack) in SLACKS.into_iter().enumerate() {
            if self.laplacians.len() == level {
                self.laplacians.push(Laplacian::new(&self.surface, slack).map_err(|error| error.to_string())?);
            }
            match Polyharmonic::new(&self.laplacians[level], level, order, prescribed.clone(), &self.parts) {
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

fn axes(vectors: &[Vector]) -> [Vec<f64>; 3] {
    [0, 1, 2].map(|axis| vectors.iter().map(|vector| vector[axis]).collect())
}
