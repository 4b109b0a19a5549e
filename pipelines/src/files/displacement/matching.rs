//! Finding the surface vertices that a file names.

use std::collections::HashMap;

use tombolo_deform::bounds::{Bounds, BoxTree};
use tombolo_deform::mesh::Vector;
use tombolo_deform::surface::Surface;

use super::SurfaceDisplacement;
use crate::files::Problem;
use crate::files::error::Flaw;

/// How far a point of a file may lie from its vertex, in diagonals of the surface's bounding box;
/// or as much as coordinates of single precision are rounded by, where that is more. The nearest
/// vertex is taken.
pub const TOLERANCE: f64 = 1e-6;

/// Finds the surface vertices that the lines or points of a file name.
pub(super) struct Matcher<'a> {
    surface: &'a Surface,
    tolerance: f64,
    /// Made when it is first needed.
    lookup: Option<Lookup>,
    taken: Vec<bool>,
    found: SurfaceDisplacement,
}

/// The surface vertices by their coordinates.
struct Lookup {
    /// The first vertex at each point, by the bits of its coordinates.
    exact: HashMap<[u64; 3], u32>,
    /// All vertices, at coordinates that are scaled so that no square is infinite.
    tree: BoxTree,
    scale: f64,
}

impl Lookup {
    fn new(surface: &Surface, largest: f64) -> Self {
        // A power of two, which rounds nothing.
        let scale = (-largest.log2().floor().clamp(-1000.0, 1000.0)).exp2();
        let mut exact = HashMap::with_capacity(surface.points().len());
        for (vertex, &point) in (0..).zip(surface.points()) {
            exact.entry(bits(point)).or_insert(vertex);
        }
        let scaled = |point: &Vector| Bounds::around([point.map(|part| scale * part)]);
        let boxes: Vec<Bounds> = surface.points().iter().map(scaled).collect();
        Self { exact, tree: BoxTree::new(&boxes), scale }
    }
}

impl<'a> Matcher<'a> {
    /// A matcher that has taken nothing yet.
    pub fn new(surface: &'a Surface) -> Self {
        let bounds = Bounds::around(surface.points().iter().copied());
        let rounded = f64::from(f32::EPSILON) * largest(&bounds);
        let tolerance =
            (TOLERANCE * bounds.diagonal()).max(rounded).clamp(f64::MIN_POSITIVE, f64::MAX / 4.0);
        let taken = vec![false; surface.points().len()];
        Self { surface, tolerance, lookup: None, taken, found: SurfaceDisplacement::default() }
    }

    fn lookup(&mut self) -> &Lookup {
        let surface = self.surface;
        self.lookup.get_or_insert_with(|| {
            let bounds = Bounds::around(surface.points().iter().copied());
            Lookup::new(surface, largest(&bounds))
        })
    }

    /// The surface vertex at a point, or nearest to it within the tolerance.
    fn nearest(&mut self, point: Vector) -> Option<u32> {
        let tolerance = self.tolerance;
        let Lookup { exact, tree, scale } = self.lookup();
        let nearest =
            || tree.nearest(point.map(|part| scale * part), scale * tolerance).map(|it| it.0);
        exact.get(&bits(point)).copied().or_else(nearest)
    }

    /// Whether another surface vertex lies within the tolerance of this one.
    pub fn has_neighbour(&mut self, point: Vector) -> bool {
        let tolerance = self.tolerance;
        let Lookup { tree, scale, .. } = self.lookup();
        let mut count = 0;
        tree.around(point.map(|part| scale * part), scale * tolerance, |_| count += 1);
        count > 1
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
            (None, Some(point)) => match self.nearest(point) {
                Some(local) => local as usize,
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

/// The largest coordinate of a box.
fn largest(bounds: &Bounds) -> f64 {
    bounds.corners().as_flattened().iter().fold(0.0, |largest, value| value.abs().max(largest))
}

/// The bits of a point's coordinates; 0 has no sign.
fn bits(point: Vector) -> [u64; 3] {
    point.map(|part| (part + 0.0).to_bits())
}

/// The distance between two points, without overflow on the way to it.
fn apart(a: Vector, b: Vector) -> f64 {
    (0..3).fold(0.0f64, |length, axis| length.hypot(a[axis] - b[axis]))
}
