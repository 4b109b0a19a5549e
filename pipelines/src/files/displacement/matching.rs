//! Finding the surface vertices that a file names.

use std::collections::HashMap;

use tombolo_deform::bounds::Bounds;
use tombolo_deform::mesh::Vector;
use tombolo_deform::surface::Surface;

use super::SurfaceDisplacement;
use crate::files::Problem;
use crate::files::error::Flaw;

/// How far a point of a file may lie from its vertex, in diagonals of the surface's bounding box or
/// in the largest coordinate, whichever is more. The nearest vertex is taken.
pub const TOLERANCE: f64 = 1e-6;

/// Finds the surface vertices that the lines or points of a file name.
pub(super) struct Matcher<'a> {
    surface: &'a Surface,
    tolerance: f64,
    /// The surface vertices in each cube of twice the tolerance; made when it is first needed.
    cubes: Option<HashMap<[i64; 3], Vec<u32>>>,
    taken: Vec<bool>,
    found: SurfaceDisplacement,
}

impl<'a> Matcher<'a> {
    /// A matcher that has taken nothing yet.
    pub fn new(surface: &'a Surface) -> Self {
        let bounds = Bounds::around(surface.points().iter().copied());
        let largest = bounds
            .corners()
            .as_flattened()
            .iter()
            .fold(0.0f64, |largest, value| largest.max(value.abs()));
        let tolerance =
            (TOLERANCE * bounds.diagonal().max(largest)).clamp(f64::MIN_POSITIVE, f64::MAX / 4.0);
        let taken = vec![false; surface.points().len()];
        Self { surface, tolerance, cubes: None, taken, found: SurfaceDisplacement::default() }
    }

    fn cube(&self, point: Vector) -> [i64; 3] {
        point.map(|value| (value / (2.0 * self.tolerance)).floor() as i64)
    }

    /// The surface vertices within the tolerance of a point, with their distances.
    pub fn near(&mut self, point: Vector) -> Vec<(f64, u32)> {
        if self.cubes.is_none() {
            let mut cubes: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
            for (vertex, &at) in self.surface.points().iter().enumerate() {
                cubes.entry(self.cube(at)).or_default().push(vertex as u32);
            }
            self.cubes = Some(cubes);
        }
        let center = self.cube(point);
        let mut near = Vec::new();
        for offset in 0..27 {
            let steps = [offset % 3 - 1, offset / 3 % 3 - 1, offset / 9 - 1];
            let cube = [0, 1, 2].map(|axis| center[axis].saturating_add(steps[axis]));
            for &vertex in
                self.cubes.as_ref().and_then(|cubes| cubes.get(&cube)).into_iter().flatten()
            {
                let distance = apart(self.surface.points()[vertex as usize], point);
                if distance <= self.tolerance && !near.contains(&(distance, vertex)) {
                    near.push((distance, vertex));
                }
            }
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near
    }

    /// Takes the displacement of a vertex, named by its number, by its point, or by both.
    pub fn take(
        &mut self,
        vertex: Option<u32>,
        point: Option<Vector>,
        value: Vector,
    ) -> Result<(), Problem> {
        let local = match (vertex, point) {
            (Some(vertex), point) => {
                let Ok(local) = self.surface.vertices().binary_search(&vertex) else {
                    return Err(Problem::wrong(
                        format!("vertex {vertex}"),
                        "a mesh vertex on the surface",
                    ));
                };
                let there = self.surface.points()[local];
                if let Some(point) = point.filter(|point| apart(*point, there) > self.tolerance) {
                    let found = format!("vertex {vertex} at {point:?}");
                    return Err(Problem::wrong(
                        found,
                        format!("its reference coordinates {there:?}"),
                    ));
                }
                local
            }
            (None, Some(point)) => match self.near(point).first() {
                Some(&(_, local)) => local as usize,
                None => {
                    let points = self.surface.points().iter();
                    let nearest = points.map(|at| apart(*at, point)).fold(f64::INFINITY, f64::min);
                    return Err(Problem::wrong(
                        format!(
                            "the point {point:?}, which is {nearest:e} from the nearest vertex"
                        ),
                        format!("a vertex of the reference surface, within {:e}", self.tolerance),
                    ));
                }
            },
            // A line without vertex and point is refused with its header.
            (None, None) => return Ok(()),
        };
        let vertex = self.surface.vertices()[local];
        if std::mem::replace(&mut self.taken[local], true) {
            return Err(Problem::wrong(format!("vertex {vertex} again"), "each vertex once"));
        }
        self.found.vertices.push(vertex);
        self.found.values.push(value);
        Ok(())
    }

    /// The displacement of all vertices taken.
    pub fn finish(self) -> Result<SurfaceDisplacement, Flaw> {
        if self.found.vertices.is_empty() {
            return Err(
                Problem::wrong("no vertices", "the displacement of at least one vertex").into()
            );
        }
        Ok(self.found)
    }
}

/// The distance between two points, without overflow on the way to it.
fn apart(a: Vector, b: Vector) -> f64 {
    (0..3).fold(0.0f64, |length, axis| length.hypot(a[axis] - b[axis]))
}
