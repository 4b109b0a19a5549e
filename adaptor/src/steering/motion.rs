//! What a solver is asked to do in a step: how to move its mesh, which parameters to change,
//! whether to end.

use std::sync::Arc;

use tombolo_deform::mesh::Vector;

/// The steering of the step that follows: what the solver is asked to do.
#[derive(Debug, Clone, Default)]
pub struct Steering {
    /// Where to move the mesh over the step; `None`: it stays where it is.
    pub motion: Option<MeshMotion>,
    /// Parameters that changed since the last call, by name, each with its new value.
    pub parameters: Vec<(String, f64)>,
    /// Whether the solver should end. Once true it stays true.
    pub stop: bool,
}

/// A motion of the mesh over one step.
///
/// It is asked for, not assumed to be made: the coordinates lent at the next call say whether it
/// was. It may be kept, and cloned without a copy of the arrays.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MeshMotion {
    /// The coordinates of each vertex at the end of the step: the reference's plus the displacement
    /// that the stack of edits makes (or a shape on the way there), plus what the solver has moved
    /// the mesh by itself. With every order taken back, and no motion of the solver's own, they are
    /// the reference's, bit for bit.
    pub coordinates: Arc<[Vector]>,
    /// From the coordinates as they were lent to these.
    pub displacement: Arc<[Vector]>,
    /// `displacement / time_step`, for an arbitrary Lagrangian-Eulerian (ALE) solver; 0 in a steady
    /// one.
    pub velocity: Arc<[Vector]>,
    /// The motion of the boundary's vertices alone, for a solver that moves its volume by itself.
    pub surface: SurfaceMotion,
    /// The shape of the order's schedule that the mesh is on its way to, or reaches, counted from 1,
    /// and how many there are.
    pub shape: (u32, u32),
    /// Where on the way of the order the mesh is at the end of the step, counted in shapes: 2.5 is
    /// half way from the second to the third.
    pub position: f64,
    /// The order's name.
    pub order: String,
}

/// A motion of the boundary over one step: one entry for each of its vertices on this rank.
///
/// It holds what [`MeshMotion`] holds of these vertices. With `"deform": {"method": "surface"}`
/// there is no other motion: no volume is solved for, the vertices inside are handed back as they
/// were lent, and the solver moves them by itself.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SurfaceMotion {
    /// The vertices: numbers into the coordinates that the solver lends. The same, in the same
    /// order, in the whole run.
    pub vertices: Arc<[u32]>,
    /// Where each is at the end of the step.
    pub coordinates: Arc<[Vector]>,
    /// From where it was lent to there.
    pub displacement: Arc<[Vector]>,
    /// `displacement / time_step`; 0 in a steady solver.
    pub velocity: Arc<[Vector]>,
}
