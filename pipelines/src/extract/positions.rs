//! Where the vertices were last, by which it is told whether the mesh has moved.

use std::sync::atomic::{AtomicU64, Ordering};

use tombolo_deform::mesh::{ArrayView, Vector};

use super::ExtractError;
use super::gather::{are_finite, lent, point};

/// The coordinates of a mesh, and a number that is another one whenever they or the cells have
/// changed.
#[derive(Debug)]
pub(super) struct Positions {
    pub(super) points: Vec<Vector>,
    pub(super) version: u64,
}

impl Default for Positions {
    fn default() -> Self {
        Self { points: Vec::new(), version: next_version() }
    }
}

/// A number that no mesh of this process has had.
fn next_version() -> u64 {
    static LAST: AtomicU64 = AtomicU64::new(0);
    LAST.fetch_add(1, Ordering::Relaxed) + 1
}

impl Positions {
    /// Takes the coordinates over where they have changed. Where they have not, this is one pass
    /// that compares.
    ///
    /// # Errors
    /// [`ExtractError::PointNotFinite`]; there are no points then.
    pub(super) fn update(&mut self, view: &ArrayView, cycle: u64) -> Result<(), ExtractError> {
        if view.is_same_as(&self.points) {
            return Ok(());
        }
        self.version = next_version();
        self.points.clear();
        self.points.reserve_exact(view.len());
        if let Some(all) = lent(view).filter(|all| are_finite(all)) {
            self.points.extend_from_slice(all);
            return Ok(());
        }
        for vertex in 0..view.len() {
            match point(view, vertex, cycle) {
                Ok(point) => self.points.push(point),
                Err(error) => {
                    self.points = Vec::new();
                    return Err(error);
                }
            }
        }
        Ok(())
    }
}
