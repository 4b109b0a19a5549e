//! Carrying a small motion of a handle to the surface as it lies, not as it lay in the reference.

use std::sync::Arc;

use super::error::EditError;
use super::handle::{Handle, Role};
use super::kinds::Edit;
use crate::harmonic::{HarmonicOrder, Laplacian, Polyharmonic};
use crate::mesh::Vector;
use crate::surface::Surface;
use crate::surface::adjacency::Adjacency;
use crate::vector::subtract;

/// How much slack triangles must have in the Laplacian, tried one after the other.
const SLACKS: [f64; 3] = [1e-9, 1e-3, 1e-1];

/// Carries the motion of an edit's handle to the free surface of any shape of one surface, sub-step
/// by sub-step.
///
/// An [`Editor`](super::Editor) measures from the reference: what it makes of the free surface is
/// linear in the motion of the handle, so that a large motion can fold it, or shrink it to nothing.
/// Here each sub-step solves the polyharmonic equation on the shape that was reached, which folds
/// nothing as long as the sub-step is small.
#[derive(Debug)]
pub struct Advance {
    surface: Arc<Surface>,
    prescribed: Vec<bool>,
    order: HarmonicOrder,
    parts: Vec<u32>,
    edit: usize,
    name: &'static str,
}

impl Advance {
    /// Carries the motion of an edit on a reference surface; `index` is that of the edit in its
    /// stack. `None` for edits that give every vertex its own motion.
    ///
    /// # Errors
    /// [`EditError`], as [`Editor::displacement`](super::Editor::displacement).
    pub fn new(
        surface: &Arc<Surface>,
        edit: &Edit,
        index: usize,
    ) -> Result<Option<Self>, EditError> {
        let Some(order) = edit.harmonic_order() else { return Ok(None) };
        let handle = Handle::find(surface, edit, index)?;
        Ok(Some(Self {
            surface: Arc::clone(surface),
            prescribed: handle.roles.iter().map(|role| *role != Role::Free).collect(),
            order,
            parts: surface.components(),
            edit: index,
            name: edit.name(),
        }))
    }

    /// Moves the free vertices of `target` to where they follow, from the surface at `shape`, a
    /// handle and fixed vertices that go to their points in `target`.
    ///
    /// # Errors
    /// [`EditError::NotSolvable`].
    pub fn carry(&self, shape: &[Vector], target: &mut [Vector]) -> Result<(), EditError> {
        let surface = self.surface.with_points(shape.to_vec());
        let mut fields = [0, 1, 2].map(|_| vec![0.0; shape.len()]);
        for vertex in (0..shape.len()).filter(|&vertex| self.prescribed[vertex]) {
            let by = subtract(target[vertex], shape[vertex]);
            for (field, value) in fields.iter_mut().zip(by) {
                field[vertex] = value;
            }
        }
        self.solve(&surface, &mut fields).map_err(|reason| EditError::NotSolvable {
            edit: self.edit,
            name: self.name,
            order: self.order,
            reason,
        })?;
        for vertex in (0..shape.len()).filter(|&vertex| !self.prescribed[vertex]) {
            target[vertex] = std::array::from_fn(|axis| shape[vertex][axis] + fields[axis][vertex]);
        }
        Ok(())
    }

    fn solve(&self, surface: &Surface, fields: &mut [Vec<f64>; 3]) -> Result<(), String> {
        let mut reason = String::new();
        let adjacency = Adjacency::new(surface).map_err(|error| error.to_string())?;
        for (level, slack) in SLACKS.into_iter().enumerate() {
            let laplacian = Laplacian::new(surface, &adjacency, slack);
            let prescribed = self.prescribed.clone();
            match Polyharmonic::new(
                surface.points(),
                &laplacian,
                level,
                self.order,
                prescribed,
                &self.parts,
            ) {
                Ok(operator) => {
                    operator.solve(&laplacian, &self.parts, fields);
                    return Ok(());
                }
                Err(error) => reason = error.to_string(),
            }
        }
        Err(reason)
    }
}
