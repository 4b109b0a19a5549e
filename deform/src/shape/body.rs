//! The body that is shaped.

use std::sync::Arc;

use super::Refused;
use super::refused::Elsewhere;
use crate::cancellation::Cancellation;
use crate::communicator::{Communicator, Reduction, first_failure};
use crate::distributed::PartBoundary;
use crate::linear::Solvers;
use crate::mesh::{Domain, Vector};
use crate::quality::{Guard, PathQuality, Refusal, SurfaceRule, judge_unless, keeps_unless};
use crate::surface::{Surface, require_sound};

/// A body: its domain, its boundary, and the choice of solvers for its volume. All that spans ranks
/// is collective, and its outcome the same on all of them.
#[derive(Debug)]
pub(super) struct Body {
    pub(super) domain: Domain,
    pub(super) boundary: PartBoundary,
    pub(super) solvers: Arc<dyn Solvers>,
    pub(super) cancellation: Cancellation,
}

impl Body {
    /// The surface of the whole mesh, where this process is the one that has it.
    pub(super) fn surface(&self) -> Option<&Arc<Surface>> {
        self.boundary.surface()
    }

    /// The vertices of the mesh on this process that lie on its boundary.
    pub(super) fn vertices(&self) -> &[u32] {
        self.boundary.vertices()
    }

    pub(super) fn communicator(&self) -> &Arc<dyn Communicator> {
        self.domain.communicator()
    }

    pub(super) fn judge(
        &self,
        start: &[Vector],
        end: &[Vector],
        fractions: &[f64],
        guard: &Guard,
    ) -> Result<PathQuality, Refusal> {
        judge_unless(&self.domain, start, end, fractions, guard, &self.cancellation)
    }

    /// Refuses to go on with what was given up: all ranks come here, and all or none are refused.
    pub(super) fn require_wanted(&self) -> Result<(), Refused> {
        if self.cancellation.is_cancelled() { Err(Refused::Cancelled) } else { Ok(()) }
    }

    /// The outcome, unless it was given up meanwhile: what was found then may be less than there is.
    pub(super) fn unless_given_up<T>(&self, found: Result<T, Refused>) -> Result<T, Refused> {
        self.require_wanted()?;
        found
    }

    /// Whether the guard lets a straight step through; not where it was given up.
    pub(super) fn keeps(&self, start: &[Vector], end: &[Vector], guard: &Guard) -> bool {
        keeps_unless(&self.domain, start, end, guard, &self.cancellation)
    }

    /// The coordinates of the boundary's vertices where those of the mesh lie at `points`.
    pub(super) fn positions(&self, points: &[Vector]) -> Vec<Vector> {
        self.vertices().iter().map(|&vertex| points[vertex as usize]).collect()
    }

    /// Goes on where all ranks can; where one cannot, all are refused for the same reason: that of
    /// the lowest rank with one of its own.
    pub(super) fn agree<T>(&self, mine: Result<T, Refused>) -> Result<T, Refused> {
        let rank = self.communicator().rank();
        if self.communicator().size() == 1 {
            return mine;
        }
        // A rank that failed because another did has no reason of its own.
        let weight =
            usize::from(matches!(&mine, Err(Refused::Volume(error)) if error.is_of_other_rank()));
        let told = mine.as_ref().err().map(|refused| Elsewhere::of(refused, rank).into_bytes());
        match (first_failure(self.communicator(), weight, told), mine) {
            (None, mine) => mine,
            (Some((0, _)), Err(refused)) if rank == 0 => Err(refused),
            (Some((_, bytes)), _) => Err(Refused::Elsewhere(Elsewhere::read(&bytes))),
        }
    }

    /// The values that rank 0 has for the vertices of the surface, for the boundary's vertices on
    /// this process.
    pub(super) fn scatter(
        &self,
        of_surface: Result<Vec<Vector>, Refused>,
    ) -> Result<Vec<Vector>, Refused> {
        let of_surface = self.agree(of_surface)?;
        if self.communicator().size() == 1 {
            return Ok(of_surface);
        }
        let values = self.surface().is_some().then_some(&of_surface[..]);
        self.agree(self.boundary.scatter(self.communicator(), values).map_err(Refused::from))
    }

    /// Refuses a surface, with its vertices at `shape`, that is broken where the reference's is
    /// not. Collective.
    pub(super) fn require_sound(&self, shape: &[Vector], rule: SurfaceRule) -> Result<(), Refused> {
        let sound = match (rule, self.surface()) {
            (SurfaceRule::Allow, _) | (_, None) => Ok(()),
            (_, Some(surface)) => {
                require_sound(surface, surface.points(), shape).map_err(Refused::from)
            }
        };
        self.agree(sound)
    }

    /// The values at the vertices of the surface of those of the mesh, where this process has the
    /// surface; else none.
    pub(super) fn gather(&self, of_mesh: &[Vector]) -> Result<Vec<Vector>, Refused> {
        if self.communicator().size() == 1 {
            return Ok(self.positions(of_mesh));
        }
        let gathered = self.boundary.gather(self.communicator(), of_mesh).map_err(Refused::from);
        Ok(self.agree(gathered)?.unwrap_or_default())
    }

    /// Puts the vertices that other ranks own where these have them.
    pub(super) fn update(&self, points: &mut [Vector]) {
        self.domain.halo().update(3, points.as_flattened_mut());
    }

    /// A count that rank 0 has.
    pub(super) fn of_root(&self, count: usize) -> usize {
        self.communicator().most(if self.surface().is_some() { count } else { 0 })
    }

    /// The values of all ranks, combined.
    pub(super) fn reduced(&self, reduction: Reduction, mine: f64) -> f64 {
        let mut values = [mine];
        self.communicator().reduce(reduction, &mut values);
        values[0]
    }
}
