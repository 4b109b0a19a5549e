//! The editor: from a stack of edits to the displacement of a surface.

use std::sync::Arc;

use super::features::Parts;
use super::laplacian::Laplacian;
use super::polyharmonic::{NotFactored, Polyharmonic};
use super::{Edit, HarmonicOrder, InvalidEdit, Surface, SurfaceError, UnknownFeature};
use crate::mesh::Vector;
use crate::vector::{add, cross, dot, subtract};

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
        Ok(Self { surface, laplacians, parts, operators: Vec::new(), below: None })
    }

    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &Arc<Surface> {
        &self.surface
    }

    /// The displacement of each surface vertex from [`Surface::points`] that a stack of edits asks for.
    ///
    /// # Errors
    /// [`EditError`], naming the edit by its place in the stack, counted from 0. Nothing is evaluated unless every edit of the
    /// stack is valid on this surface.
    pub fn displacement(&mut self, stack: &[Edit]) -> Result<Vec<Vector>, EditError> {
        let roles =
            stack.iter().enumerate().map(|(edit, what)| self.roles(edit, what)).collect::<Result<Vec<_>, _>>()?;
        let Some((_, lower)) = stack.split_last() else {
            return Ok(vec![[0.0; 3]; self.surface.points().len()]);
        };
        let (done, mut displacement) = match self.below.take() {
            Some((edits, displacement)) if edits == lower => (lower.len(), displacement),
            _ => (0, vec![[0.0; 3]; self.surface.points().len()]),
        };
        for (edit, roles) in roles.into_iter().enumerate().skip(done) {
            if edit + 1 == stack.len() {
                self.below = Some((lower.to_vec(), displacement.clone()));
            }
            self.apply(edit, &stack[edit], roles, &mut displacement)?;
        }
        Ok(displacement)
    }

    /// Which vertices an edit moves and which it holds.
    fn roles(&self, edit: usize, what: &Edit) -> Result<Roles, EditError> {
        what.validate().map_err(|source| EditError::Invalid { edit, name: what.name(), source })?;
        let features = self.surface.features();
        let find = |field: &'static str, names: &[String]| {
            let found = names.iter().map(|name| features.index(name)).collect::<Result<Vec<u32>, _>>();
            found.map_err(|source| EditError::UnknownFeature { edit, name: what.name(), field, source })
        };
        let handle_features = find("features", what.features())?;
        let mut roles = vec![Role::Free; self.surface.points().len()];
        let mut handle = Vec::new();
        for &feature in &handle_features {
            for &vertex in features.vertices(feature) {
                if std::mem::replace(&mut roles[vertex as usize], Role::Handle) == Role::Free {
                    handle.push(vertex);
                }
            }
        }
        for feature in find("fixed", what.fixed())? {
            for &vertex in features.vertices(feature) {
                roles[vertex as usize] = Role::Fixed;
            }
        }
        if handle.iter().all(|&vertex| roles[vertex as usize] == Role::Fixed) {
            return Err(EditError::HandleFixed { edit, name: what.name(), features: what.features().to_vec() });
        }
        Ok(Roles { roles, handle, handle_features })
    }

    fn apply(&mut self, edit: usize, what: &Edit, roles: Roles, displacement: &mut [Vector]) -> Result<(), EditError> {
        let shape: Vec<Vector> =
            self.surface.points().iter().zip(displacement.iter()).map(|(point, moved)| add(*point, *moved)).collect();
        let motion = self.handle_motion(edit, what, &roles, &shape)?;

        let mut fields = [0, 1, 2].map(|_| vec![0.0; shape.len()]);
        for (&vertex, motion) in roles.handle.iter().zip(&motion) {
            if roles.roles[vertex as usize] == Role::Handle {
                for axis in 0..3 {
                    fields[axis][vertex as usize] = motion[axis];
                }
            }
        }
        let prescribed: Vec<bool> = roles.roles.iter().map(|role| *role != Role::Free).collect();
        let order = what.harmonic_order();
        self.choose_operator(order, prescribed).map_err(|reason| EditError::NotSolvable {
            edit,
            name: what.name(),
            order,
            reason,
        })?;
        if let Some(operator) = self.operators.last() {
            operator.solve(&self.laplacians[operator.level()], &self.parts, &mut fields);
        }

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

    /// How each vertex of the handle moves.
    fn handle_motion(
        &self,
        edit: usize,
        what: &Edit,
        roles: &Roles,
        shape: &[Vector],
    ) -> Result<Vec<Vector>, EditError> {
        let handle = roles.handle.iter().map(|&vertex| shape[vertex as usize]);
        match what {
            Edit::Translate(translate) => Ok(vec![translate.by; roles.handle.len()]),
            Edit::ScaleDirection(scale) => {
                let center = scale.center.unwrap_or_else(|| box_center(handle.clone()));
                Ok(handle
                    .map(|point| [0, 1, 2].map(|axis| (scale.factors[axis] - 1.0) * (point[axis] - center[axis])))
                    .collect())
            }
            Edit::ScaleNormals(scale) => {
                let normals = self.handle_normals(roles, shape);
                let moved = |&vertex: &u32| {
                    if roles.roles[vertex as usize] == Role::Fixed {
                        return Ok([0.0; 3]);
                    }
                    let normal = normals[vertex as usize];
                    let length = dot(normal, normal).sqrt();
                    if length > 0.0 && length.is_finite() {
                        Ok(normal.map(|part| scale.distance * (part / length)))
                    } else {
                        Err(EditError::NoNormal { edit, vertex: self.surface.vertices()[vertex as usize] })
                    }
                };
                roles.handle.iter().map(moved).collect()
            }
        }
    }

    /// The area-weighted sum of the normals of the handle's own triangles at each vertex, up to one common factor.
    fn handle_normals(&self, roles: &Roles, shape: &[Vector]) -> Vec<Vector> {
        let scale = shape.iter().flatten().fold(0.0f64, |largest, value| largest.max(value.abs()));
        let scale = if scale > 0.0 { scale } else { 1.0 };
        let face_features = self.surface.features().face_features();
        let mut normals = vec![[0.0; 3]; shape.len()];
        for (triangle, &face) in self.surface.triangles().iter().zip(self.surface.triangle_faces()) {
            if !roles.handle_features.contains(&face_features[face as usize]) {
                continue;
            }
            let [a, b, c] = triangle.map(|vertex| shape[vertex as usize].map(|value| value / scale));
            let normal = cross(subtract(b, a), subtract(c, a));
            for &vertex in triangle {
                for axis in 0..3 {
                    normals[vertex as usize][axis] += normal[axis];
                }
            }
        }
        normals
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

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    Free,
    Handle,
    Fixed,
}

struct Roles {
    roles: Vec<Role>,
    /// Every vertex of the handle's features, the fixed ones among them too.
    handle: Vec<u32>,
    handle_features: Vec<u32>,
}

fn box_center(points: impl Iterator<Item = Vector>) -> Vector {
    let mut lower = [f64::INFINITY; 3];
    let mut upper = [f64::NEG_INFINITY; 3];
    for point in points {
        for axis in 0..3 {
            lower[axis] = lower[axis].min(point[axis]);
            upper[axis] = upper[axis].max(point[axis]);
        }
    }
    [0, 1, 2].map(|axis| 0.5 * lower[axis] + 0.5 * upper[axis])
}

/// Why a stack of edits has no displacement. `edit` is the place of the edit in the stack, counted from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EditError {
    /// An edit that is wrong whatever the surface.
    #[error("edit {edit} ({name}): {source}")]
    Invalid {
        /// The place of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// What is wrong.
        source: InvalidEdit,
    },
    /// A feature that the surface does not have.
    #[error("edit {edit} ({name}): {field}: {source}")]
    UnknownFeature {
        /// The place of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The field that names the feature: features or fixed.
        field: &'static str,
        /// The name, those like it, and the features there are.
        source: UnknownFeature,
    },
    /// Fixed features hold the whole handle.
    #[error("edit {edit} ({name}): every vertex of {features:?} is also in a fixed feature, so that nothing can move")]
    HandleFixed {
        /// The place of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The features of the handle.
        features: Vec<String>,
    },
    /// A vertex of the handle has no normal to move along.
    #[error(
        "edit {edit} (scale_normals): the faces of the handle around mesh vertex {vertex} have no area or cancel out, so that it has no normal"
    )]
    NoNormal {
        /// The place of the edit.
        edit: usize,
        /// The vertex, by mesh vertex number.
        vertex: u32,
    },
    /// A coordinate would overflow.
    #[error("edit {edit} ({name}): mesh vertex {vertex} would leave the range of floating-point numbers")]
    OutOfRange {
        /// The place of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The vertex, by mesh vertex number.
        vertex: u32,
    },
    /// The polyharmonic equation could not be solved.
    #[error("edit {edit} ({name}): the operator of harmonic order {order} could not be factored: {reason}")]
    NotSolvable {
        /// The place of the edit.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The harmonic order.
        order: HarmonicOrder,
        /// Why.
        reason: String,
    },
}
