//! The flaws of a deformed surface: faces without area, faces folded over, and self-intersections.

use super::Surface;
use super::inside_out::turned_inside_out;
use super::report::{
    BrokenSurface, FlawedFace, FlawedFaces, Intersection, Intersections, SurfaceReport,
};
use super::triangle_pair::{Shared, common_point};
use crate::bounds::{Bounds, BoxTree, Boxed};
use crate::mesh::Vector;
use crate::parallel;
use crate::topology::{Groups, triangles_at};
use crate::vector::{cross, dot, length, subtract, triangle_normal};

/// How many flaws of each kind are named.
const NAMED: usize = 16;

/// How many leaves of the tree are looked at together.
const CHUNK: usize = 256;

/// After how many intersections such a part is left.
const ENOUGH: usize = 10_000;

/// A triangle is degenerate where its height is this part of its longest side or less, or its
/// longest side this part of what it was: beyond that the direction of its normal is rounding.
const FLAT: f64 = 1e-8;

/// Two triangles that open less than this many degrees at their edge, and much less than they did,
/// may be folded.
const FOLDED: f64 = 60.0;

/// Below so many degrees they lie on each other.
const CLOSED: f64 = 1.0;

/// Finds the flaws that a surface has at `shape` and had not at `reference` (coordinates of each
/// surface vertex).
///
/// - **Degenerate**: a triangle whose height is under 10⁻⁸ of its longest side, or whose sides are
///   under 10⁻⁸ of what they were.
/// - **Flipped**: judged by the angles between normals only, before and after, so that a part that
///   is turned as a whole, by 180° too, is never flipped. Sharp edges that the reference has,
///   however sharp, do not count.
/// - **Inside out**: the volume that a closed piece encloses has another sign than before.
/// - **Intersections**: by exact predicates, so that no rounding hides or makes one; touching
///   counts. Triangles without area are left out, and so are pairs that met or touched in the
///   reference (to 10⁻⁹ of their size): parts in contact may move together.
///
/// Pairs of triangles none of which moves are not looked at. Cost: a sort of the triangles and, for
/// each, its neighbours in a tree of boxes; on all threads. The same input gives the same
/// report whatever their number.
///
/// It does not say whether the volume can follow, nor whether the surface passes through itself on
/// the way to the shape and out again.
///
/// ```
/// use tombolo_deform::{shapes, features::FeatureSettings, surface::{Surface, check}};
///
/// let mesh = shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
/// let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
/// // Pushes the middle of the floor through the ceiling.
/// let middle = surface.points().iter().position(|point| *point == [0.5, 0.5, 0.0]).unwrap();
/// let mut shape = surface.points().to_vec();
/// shape[middle][2] = 1.5;
/// let report = check(&surface, surface.points(), &shape);
/// assert!(report.intersections.count > 0);
/// assert_eq!(report.intersections.first[0].position[2], 1.0);
/// // Turning everything by half a turn breaks nothing.
/// let turned: Vec<_> = surface.points().iter().map(|[x, y, z]| [-x, -y, *z]).collect();
/// assert!(check(&surface, surface.points(), &turned).is_sound());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Panics
/// Where `reference` or `shape` has another length than [`Surface::points`].
#[must_use]
pub fn check(surface: &Surface, reference: &[Vector], shape: &[Vector]) -> SurfaceReport {
    check_triangles(surface, reference, shape).0
}

/// The report of [`check`], and every triangle of the surface with a flaw, rising, where the report
/// names the first faces alone.
///
/// The triangles are numbered as in [`Surface::triangles`]. Of triangles that intersect they are
/// those of the pairs that are counted: see [`Intersections::more`].
///
/// # Panics
/// As [`check`].
#[must_use]
pub fn check_triangles(
    surface: &Surface,
    reference: &[Vector],
    shape: &[Vector],
) -> (SurfaceReport, Vec<u32>) {
    for points in [reference, shape] {
        assert_eq!(
            points.len(),
            surface.points().len(),
            "one point for each vertex of the surface"
        );
    }
    let mut found = Shapes { triangles: surface.triangles(), reference, shape }.look();
    let inside_out = turned_inside_out(surface.triangles(), reference, shape);
    let mut flawed = std::mem::take(&mut found.crossing);
    for triangles in [&found.degenerate, &found.flipped, &inside_out] {
        flawed.extend(triangles);
    }
    flawed.sort_unstable();
    flawed.dedup();
    let face = |triangle: u32| surface.triangle_faces()[triangle as usize];
    let faces = |triangles: Vec<u32>| {
        let mut faces: Vec<u32> = triangles.into_iter().map(face).collect();
        faces.sort_unstable();
        faces.dedup();
        let named = faces.iter().take(NAMED).map(|&face| {
            let vertices = surface.faces().vertices(face as usize);
            let position =
                crate::vector::mean(vertices.iter().map(|&vertex| shape[vertex as usize]));
            FlawedFace { face, position }
        });
        FlawedFaces { count: faces.len(), first: named.collect() }
    };
    let first = found.intersecting.iter().map(|&[a, b]| {
        let corners = [a, b].map(|triangle| surface.triangles()[triangle as usize]);
        let position = common_point(shape, corners[0], corners[1]).unwrap_or_else(|| {
            let [a, b] =
                corners.map(|corners| Bounds::around(corners.map(|vertex| shape[vertex as usize])));
            a.center_with(&b)
        });
        let (a, b) = (face(a), face(b));
        Intersection { faces: [a.min(b), a.max(b)], position }
    });
    let report = SurfaceReport {
        degenerate: faces(found.degenerate),
        intersections: Intersections {
            count: found.count,
            more: found.more,
            first: first.collect(),
        },
        flipped: faces(found.flipped),
        inside_out: faces(inside_out),
    };
    (report, flawed)
}

/// [`check`], for those who take a sound surface or none.
///
/// # Errors
/// [`BrokenSurface`] with what is wrong and how far the surface could go.
///
/// # Panics
/// As [`check`].
pub fn require_sound(
    surface: &Surface,
    reference: &[Vector],
    shape: &[Vector],
) -> Result<(), Box<BrokenSurface>> {
    let report = check(surface, reference, shape);
    if report.is_sound() {
        return Ok(());
    }
    let sound_fraction = bisect(surface, reference, shape);
    Err(Box::new(BrokenSurface { report, sound_fraction }))
}

/// How far a surface can go from `reference` straight to `shape` and still be sound there, by
/// bisection of [`check`] to one part in 1024: 0 where not at all, 1 where all the way.
///
/// The surface is sound at that fraction; that it is sound at every smaller one is likely, and not
/// looked at.
///
/// # Panics
/// As [`check`].
#[must_use]
pub fn sound_fraction(surface: &Surface, reference: &[Vector], shape: &[Vector]) -> f64 {
    if check(surface, reference, shape).is_sound() {
        1.0
    } else {
        bisect(surface, reference, shape)
    }
}

/// The fraction of a shape that is not sound.
fn bisect(surface: &Surface, reference: &[Vector], shape: &[Vector]) -> f64 {
    let is_sound = |fraction: f64| {
        let between: Vec<Vector> = reference
            .iter()
            .zip(shape)
            .map(|(&from, &to)| {
                // What does not move must not seem to.
                std::array::from_fn(|axis| {
                    if from[axis] == to[axis] {
                        from[axis]
                    } else {
                        from[axis] + fraction * (to[axis] - from[axis])
                    }
                })
            })
            .collect();
        check(surface, reference, &between).is_sound()
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..10 {
        let middle = 0.5 * (low + high);
        if is_sound(middle) { low = middle } else { high = middle }
    }
    low
}

/// The box of some triangles, and whether any of them moves.
#[derive(Clone, Copy)]
struct MovingBox {
    bounds: Bounds,
    moves: bool,
}

impl MovingBox {
    #[inline]
    fn may_meet(&self, other: &Self) -> bool {
        (self.moves | other.moves) && self.bounds.meets(&other.bounds)
    }
}

impl Boxed for MovingBox {
    const NONE: Self = Self { bounds: Bounds::EMPTY, moves: false };

    #[inline]
    fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    #[inline]
    fn join(&self, other: &Self) -> Self {
        Self { bounds: self.bounds.join(&other.bounds), moves: self.moves | other.moves }
    }
}

/// The triangles of a surface in two shapes.
struct Shapes<'a> {
    triangles: &'a [[u32; 3]],
    reference: &'a [Vector],
    shape: &'a [Vector],
}

/// The flaws found, by numbers of triangles.
#[derive(Default)]
struct Found {
    degenerate: Vec<u32>,
    flipped: Vec<u32>,
    count: usize,
    more: bool,
    /// The first pairs, rising.
    intersecting: Vec<[u32; 2]>,
    /// The triangles of all pairs that are counted, in no order and some of them often.
    crossing: Vec<u32>,
}

/// An edge at which two triangles have newly come to lie on each other.
struct Fold {
    triangles: [u32; 2],
    /// Whether they nearly touch.
    closed: bool,
}

#[derive(Default)]
struct Part {
    count: usize,
    more: bool,
    intersecting: Vec<[u32; 2]>,
    crossing: Vec<u32>,
    folds: Vec<Fold>,
}

impl Part {
    fn intersect(&mut self, pair: [u32; 2]) {
        self.count += 1;
        self.crossing.extend(pair);
        self.intersecting.push(pair);
        if self.intersecting.len() >= 4 * NAMED {
            self.keep_first();
        }
    }

    fn keep_first(&mut self) {
        self.intersecting.sort_unstable();
        self.intersecting.truncate(NAMED);
    }
}

impl Shapes<'_> {
    fn look(&self) -> Found {
        let mut found = Found::default();
        let mut chosen = Vec::with_capacity(self.triangles.len());
        for (number, &triangle) in self.triangles.iter().enumerate() {
            let longest_was = longest_side(self.reference, triangle);
            if is_flat(self.shape, triangle, FLAT * longest_was) {
                if !is_flat(self.reference, triangle, 0.0) && self.moves(number as u32) {
                    found.degenerate.push(number as u32);
                }
            } else {
                chosen.push(number as u32);
            }
        }
        let boxes: Vec<MovingBox> = chosen.iter().map(|&number| self.moving_box(number)).collect();
        let tree = BoxTree::new(&boxes);
        let parts = parallel::map_chunks(tree.leaves(), CHUNK, |leaves| {
            let mut part = Part::default();
            for leaf in leaves {
                if part.count >= ENOUGH {
                    part.more = true;
                    break;
                }
                tree.for_each_pair(leaf, MovingBox::may_meet, |a, b| {
                    // Chosen in rising order.
                    let pair = [a.min(b), a.max(b)].map(|index| chosen[index as usize]);
                    self.look_at_pair(pair, &mut part);
                });
            }
            part
        });
        let mut folds = Vec::new();
        for part in parts {
            found.count += part.count;
            found.more |= part.more;
            found.intersecting.extend(part.intersecting);
            found.crossing.extend(part.crossing);
            folds.extend(part.folds);
        }
        found.intersecting.sort_unstable();
        found.intersecting.truncate(NAMED);
        if !folds.is_empty() {
            found.flipped = self.flipped(&folds);
        }
        found
    }

    fn moving_box(&self, triangle: u32) -> MovingBox {
        let corners = self.triangles[triangle as usize].map(|vertex| self.shape[vertex as usize]);
        MovingBox { bounds: Bounds::around(corners), moves: self.moves(triangle) }
    }

    fn moves(&self, triangle: u32) -> bool {
        self.triangles[triangle as usize]
            .iter()
            .any(|&vertex| self.reference[vertex as usize] != self.shape[vertex as usize])
    }

    fn look_at_pair(&self, pair: [u32; 2], part: &mut Part) {
        let [a, b] = pair.map(|triangle| self.triangles[triangle as usize]);
        let shared = Shared::of(self.shape, a, b);
        if let Shared::Edge { ends, thirds } = shared {
            if !opens_less_than_right(ends, thirds) {
                return;
            }
            let now = opening(ends, thirds);
            if let Shared::Edge { ends, thirds } = Shared::of(self.reference, a, b) {
                let before = opening(ends, thirds);
                if now < FOLDED && now < before - FOLDED.min(0.5 * before) {
                    part.folds.push(Fold { triangles: pair, closed: now < CLOSED });
                }
            }
        }
        if shared.intersect() && Shared::of(self.reference, a, b).is_clear() {
            part.intersect(pair);
        }
    }

    /// Of the triangles at folds, those that are turned against most of the area smoothly connected
    /// to them around; where a fold is closed and neither side is in the minority, both.
    fn flipped(&self, folds: &[Fold]) -> Vec<u32> {
        let around = triangles_at(self.triangles, self.shape.len());
        let mut flipped = Vec::new();
        for fold in folds {
            let turned = fold.triangles.map(|triangle| self.is_turned(triangle, &around));
            for (&triangle, turned_alone) in fold.triangles.iter().zip(turned) {
                if turned_alone || (fold.closed && turned == [false; 2]) {
                    flipped.push(triangle);
                }
            }
        }
        flipped
    }

    fn is_turned(&self, triangle: u32, around: &Groups<u32>) -> bool {
        let corners = self.triangles[triangle as usize];
        let [was, is] = [self.reference, self.shape].map(|points| normal(points, corners));
        let mut neighbours: Vec<u32> = corners
            .iter()
            .flat_map(|&vertex| around.of(vertex))
            .copied()
            .filter(|&other| other != triangle)
            .collect();
        neighbours.sort_unstable();
        neighbours.dedup();
        let [mut with, mut against] = [0.0, 0.0];
        for other in neighbours {
            let corners = self.triangles[other as usize];
            let [other_was, other_is] =
                [self.reference, self.shape].map(|points| normal(points, corners));
            let before = cosine(was, other_was);
            if before.abs() > 0.5 {
                let area = length(other_was);
                if cosine(is, other_is) * before.signum() < -0.5 {
                    against += area;
                } else {
                    with += area;
                }
            }
        }
        against > with
    }
}

fn normal(points: &[Vector], triangle: [u32; 3]) -> Vector {
    triangle_normal(triangle.map(|vertex| points[vertex as usize]))
}

/// The cosine of the angle between two vectors, NaN where one has no length.
fn cosine(a: Vector, b: Vector) -> f64 {
    dot(a, b) / (length(a) * length(b))
}

/// The angle in degrees between two triangles on an edge: 180 where they continue each other, 0
/// where one lies on the other.
fn opening([start, end]: [Vector; 2], [a, b]: [Vector; 2]) -> f64 {
    let along = subtract(end, start);
    let [a, b] = [a, b].map(|third| cross(along, subtract(third, start)));
    let turn = cross(a, b);
    length(turn).atan2(dot(a, b)).to_degrees()
}

/// Whether `opening(..) < 90.0`, in a few operations.
fn opens_less_than_right([start, end]: [Vector; 2], [a, b]: [Vector; 2]) -> bool {
    let along = subtract(end, start);
    let [a, b] = [a, b].map(|third| cross(along, subtract(third, start)));
    dot(a, b) > 0.0
}

fn longest_side(points: &[Vector], [a, b, c]: [u32; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(|vertex| points[vertex as usize]);
    let square = |from: Vector, to: Vector| {
        let side = subtract(to, from);
        dot(side, side)
    };
    square(a, b).max(square(b, c)).max(square(c, a)).sqrt()
}

/// Whether a triangle has no area to speak of, or no side longer than `least`, or a coordinate that
/// is not finite.
fn is_flat(points: &[Vector], triangle: [u32; 3], least: f64) -> bool {
    let longest = longest_side(points, triangle);
    let normal = normal(points, triangle);
    let has_area =
        longest > least && length(normal) > FLAT * longest * longest && longest.is_finite();
    !has_area
}
