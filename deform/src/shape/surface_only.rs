//! Shapes of solvers that move their volume by themselves: only the boundary is told where to go.

use std::sync::Arc;

use crate::{
    mesh::Vector,
    quality::{Guard, SurfaceRule, shape_at},
    schedule::Schedule,
};

use super::plan::{CurrentShape, Plan};
use super::travel::of_surface;
use super::{Refused, ShapeSeconds, Shaper, Target, moved};

impl Shaper {
    /// The reference with its boundary displaced.
    pub(super) fn of_surface(
        &self,
        displacement: &[Vector],
        seconds: ShapeSeconds,
    ) -> Result<Target, Refused> {
        let mut points = self.reference.to_vec();
        for (&vertex, &by) in self.body.vertices().iter().zip(displacement) {
            points[vertex as usize] = moved(points[vertex as usize], by);
        }
        self.body.update(&mut points);
        Ok(Target { surface_only: true, ..Target::new(points.into(), &self.reference, seconds) })
    }

    /// The straight way of the boundary from `start` to a target, with the surface of each shape
    /// held to the guard. The vertices inside stay where they are, unless the target is one whose
    /// volume is known.
    pub(super) fn along_surface(
        &self,
        start: &CurrentShape,
        target: &Target,
        schedule: &Schedule,
        guard: &Guard,
    ) -> Result<Plan, Refused> {
        let mut end = Arc::clone(&target.points);
        if target.surface_only {
            let mut points = start.points.to_vec();
            for &vertex in self.body.vertices() {
                points[vertex as usize] = target.points[vertex as usize];
            }
            self.body.update(&mut points);
            if points[..] != *end {
                end = points.into();
            }
        }
        if guard.surface == SurfaceRule::Reject {
            // Where it ends was looked at when it was made; the reference needs no look.
            for fraction in schedule.fractions().into_iter().filter(|&fraction| fraction < 1.0) {
                self.body.require_wanted()?;
                let at = |(&from, &to): (&Vector, &Vector)| shape_at(from, to, fraction);
                let points: Vec<Vector> = start.points.iter().zip(&*end).map(at).collect();
                let shape = self.body.gather(&points)?;
                self.body.require_sound(&shape, guard.surface)?;
            }
        }
        Ok(of_surface(start, end, target, schedule))
    }
}
