//! Whether two triangles intersect: exactly, by the signs of determinants that are never wrong
//! (Shewchuk 1997, crate `robust`).
//!
//! Triangles are closed: to touch is to intersect. What two triangles share by the numbers of their
//! vertices does not count: a common vertex, a common edge. Most pairs are told apart before by a
//! separating plane found in floating point, with a margin far above its rounding.

use robust::{Coord, Coord3D, orient2d, orient3d};

use crate::mesh::Vector;
use crate::vector::{cross, dot, length, subtract};

type Triangle = [Vector; 3];

/// The most that rounding can add to a distance, as a part of the size of both triangles together;
/// well above what it does.
const ROUNDING: f64 = 1e-14;

/// The least distance of triangles that are clear of each other, as a part of their size.
const CLEARANCE: f64 = 1e-9;

/// Two triangles by what they share by number.
pub(super) enum Shared {
    Nothing([Triangle; 2]),
    /// The triangles turned so that both begin with the vertex.
    Vertex([Triangle; 2]),
    /// The ends of the edge, and the third vertex of each.
    Edge {
        ends: [Vector; 2],
        thirds: [Vector; 2],
    },
    /// All three.
    All,
}

impl Shared {
    #[inline]
    pub fn of(points: &[Vector], a: [u32; 3], b: [u32; 3]) -> Self {
        let in_b = a.map(|vertex| b.contains(&vertex));
        let point = |vertex: u32| points[vertex as usize];
        match in_b {
            [false, false, false] => Self::Nothing([a, b].map(|triangle| triangle.map(point))),
            [true, true, true] => Self::All,
            [true, false, false] | [false, true, false] | [false, false, true] => {
                let own = usize::from(in_b[1]) + 2 * usize::from(in_b[2]);
                let other = usize::from(b[1] == a[own]) + 2 * usize::from(b[2] == a[own]);
                let turned = |triangle: [u32; 3], first: usize| {
                    [triangle[first], triangle[(first + 1) % 3], triangle[(first + 2) % 3]]
                        .map(point)
                };
                Self::Vertex([turned(a, own), turned(b, other)])
            }
            _ => {
                let lone = usize::from(!in_b[1]) + 2 * usize::from(!in_b[2]);
                let ends = [a[(lone + 1) % 3], a[(lone + 2) % 3]];
                let third = b.into_iter().find(|vertex| !ends.contains(vertex)).unwrap_or(b[0]);
                Self::Edge { ends: ends.map(point), thirds: [a[lone], third].map(point) }
            }
        }
    }

    /// Whether the triangles meet anywhere but in what they share. For triangles without area the
    /// answer may be either.
    #[inline]
    pub fn intersect(&self) -> bool {
        match self {
            Self::All => true,
            Self::Edge { ends, thirds } => folded_flat(*ends, *thirds),
            Self::Vertex([a, b]) => {
                !cones_are_apart(a, b)
                    && (segment_meets(a, [b[1], b[2]]) || segment_meets(b, [a[1], a[2]]))
            }
            Self::Nothing([a, b]) => !are_apart(a, b, ROUNDING) && meet(a, b),
        }
    }

    /// Whether the triangles neither meet nor, where they share nothing, lie so close that rounding
    /// could make them.
    pub fn is_clear(&self) -> bool {
        match self {
            Self::Nothing([a, b]) => are_apart(a, b, CLEARANCE),
            _ => !self.intersect(),
        }
    }
}

/// A point of both of two triangles that intersect, where an edge of one passes through the other;
/// `None` for triangles in one plane.
pub(super) fn common_point(points: &[Vector], a: [u32; 3], b: [u32; 3]) -> Option<Vector> {
    let corners = [a, b].map(|triangle| triangle.map(|vertex| points[vertex as usize]));
    for (triangle, numbers, other) in [(&corners[0], a, 1), (&corners[1], b, 0)] {
        let other_numbers = if other == 0 { a } else { b };
        for side in 0..3 {
            let [from, to] = [side, (side + 1) % 3];
            if numbers.contains(&other_numbers[from]) || numbers.contains(&other_numbers[to]) {
                continue;
            }
            let segment = [corners[other][from], corners[other][to]];
            let heights = segment.map(|point| orientation(triangle, point));
            if heights[0] != heights[1] && segment_meets(triangle, segment) {
                let part = heights[0] / (heights[0] - heights[1]);
                return Some(std::array::from_fn(|axis| {
                    segment[0][axis] + part * (segment[1][axis] - segment[0][axis])
                }));
            }
        }
    }
    None
}

/// Whether the triangles on an edge lie in one plane and on one side of the edge.
fn folded_flat([start, end]: [Vector; 2], [a, b]: [Vector; 2]) -> bool {
    let along = subtract(end, start);
    let [normal_a, normal_b] = [a, b].map(|third| cross(along, subtract(third, start)));
    let product = dot(normal_a, normal_b);
    // Rounding does not turn a fold into this.
    if product < 0.0 && product * product > 1e-6 * dot(normal_a, normal_a) * dot(normal_b, normal_b)
    {
        return false;
    }
    let triangle = [start, end, a];
    orientation(&triangle, b) == 0.0
        && Plane::of(&triangle).is_some_and(|plane| {
            let [start, end, a, b] = [start, end, a, b].map(|point| plane.project(point));
            orient2d(start, end, a) * orient2d(start, end, b) > 0.0
        })
}

fn meet(a: &Triangle, b: &Triangle) -> bool {
    let sides =
        |triangle: &Triangle| [0, 1, 2].map(|side| [triangle[side], triangle[(side + 1) % 3]]);
    sides(b).into_iter().any(|side| segment_meets(a, side))
        || sides(a).into_iter().any(|side| segment_meets(b, side))
}

fn exact(point: Vector) -> Coord3D<f64> {
    Coord3D { x: point[0], y: point[1], z: point[2] }
}

/// On which side of the triangle's plane the point lies; its sign is exact.
fn orientation([a, b, c]: &Triangle, point: Vector) -> f64 {
    orient3d(exact(*a), exact(*b), exact(*c), exact(point))
}

/// Whether a segment and a triangle have a point in common.
fn segment_meets(triangle: &Triangle, [start, end]: [Vector; 2]) -> bool {
    let [from, to] = [start, end].map(|point| orientation(triangle, point));
    if (from > 0.0 && to > 0.0) || (from < 0.0 && to < 0.0) {
        return false;
    }
    if from == 0.0 && to == 0.0 {
        return Plane::of(triangle)
            .is_some_and(|plane| plane.segment_meets(triangle, [start, end]));
    }
    // The line through the segment passes all sides of the triangle the same way round, or touches
    // them.
    let turns =
        [0, 1, 2].map(|side| orientation(&[start, end, triangle[side]], triangle[(side + 1) % 3]));
    turns.iter().all(|&turn| turn >= 0.0) || turns.iter().all(|&turn| turn <= 0.0)
}

/// A plane of two coordinates on which a triangle keeps an area.
#[derive(Clone, Copy)]
struct Plane {
    axes: [usize; 2],
}

impl Plane {
    fn of(triangle: &Triangle) -> Option<Self> {
        [[0, 1], [1, 2], [2, 0]]
            .into_iter()
            .map(|axes| Self { axes })
            .find(|plane| plane.turn(triangle) != 0.0)
    }

    fn project(self, point: Vector) -> Coord<f64> {
        Coord { x: point[self.axes[0]], y: point[self.axes[1]] }
    }

    fn turn(self, [a, b, c]: &Triangle) -> f64 {
        orient2d(self.project(*a), self.project(*b), self.project(*c))
    }

    fn segment_meets(self, triangle: &Triangle, [start, end]: [Vector; 2]) -> bool {
        let way = self.turn(triangle);
        let side = |number: usize| [triangle[number], triangle[(number + 1) % 3]];
        let inside = |point: Vector| {
            (0..3).all(|number| {
                let [a, b] = side(number);
                self.turn(&[a, b, point]) * way.signum() >= 0.0
            })
        };
        inside(start)
            || inside(end)
            || (0..3).any(|number| self.segments_cross([start, end], side(number)))
    }

    /// Whether segments cross in a point inside at least one of them; of segments along one line
    /// the ends decide, elsewhere.
    fn segments_cross(self, [a, b]: [Vector; 2], [c, d]: [Vector; 2]) -> bool {
        let [first, second] = [self.turn(&[a, b, c]), self.turn(&[a, b, d])];
        let [third, fourth] = [self.turn(&[c, d, a]), self.turn(&[c, d, b])];
        let parted =
            |one: f64, other: f64| (one > 0.0 && other > 0.0) || (one < 0.0 && other < 0.0);
        let in_line = first == 0.0 && second == 0.0 && third == 0.0 && fourth == 0.0;
        !in_line && !parted(first, second) && !parted(third, fourth)
    }
}

/// Whether a plane is found that parts the triangles and leaves a gap of `margin` of their size; it
/// is wherever there is one.
fn are_apart(a: &Triangle, b: &Triangle, margin: f64) -> bool {
    let origin = a[0];
    let [a, b] = [a, b].map(|triangle| triangle.map(|point| subtract(point, origin)));
    let size = a.iter().chain(&b).flatten().fold(0.0f64, |size, value| size.max(value.abs()));
    let parts = |axis: Vector| {
        let margin = margin * size * (axis[0].abs() + axis[1].abs() + axis[2].abs());
        let range = |triangle: &Triangle| {
            let [x, y, z] = triangle.map(|point| dot(axis, point));
            [x.min(y).min(z), x.max(y).max(z)]
        };
        let [[low_a, high_a], [low_b, high_b]] = [range(&a), range(&b)];
        high_a + margin < low_b || high_b + margin < low_a
    };
    let middle = |triangle: &Triangle| -> Vector {
        std::array::from_fn(|axis| triangle[0][axis] + triangle[1][axis] + triangle[2][axis])
    };
    if parts(subtract(middle(&a), middle(&b))) {
        return true;
    }
    let sides = |[x, y, z]: &Triangle| [subtract(*y, *x), subtract(*z, *y), subtract(*x, *z)];
    let [sides_a, sides_b] = [sides(&a), sides(&b)];
    let [normal_a, normal_b] = [sides_a, sides_b].map(|sides| cross(sides[0], sides[1]));
    parts(normal_a)
        || parts(normal_b)
        || sides_a.into_iter().any(|side| parts(cross(normal_a, side)))
        || sides_b.into_iter().any(|side| parts(cross(normal_b, side)))
        || sides_a
            .into_iter()
            .any(|side| sides_b.into_iter().any(|other| parts(cross(side, other))))
}

/// Whether a plane through the first vertex, which is both triangles', is found that parts the
/// cones they span there.
fn cones_are_apart(a: &Triangle, b: &Triangle) -> bool {
    let apex = a[0];
    let unit = |vector: Vector| {
        let length = length(vector);
        vector.map(|value| value / length)
    };
    let [a, b] =
        [a, b].map(|triangle| [triangle[1], triangle[2]].map(|point| unit(subtract(point, apex))));
    let parts = |axis: Vector| {
        let length = length(axis);
        let range = |pair: [Vector; 2]| {
            let [x, y] = pair.map(|direction| dot(axis, direction));
            [x.min(y), x.max(y)]
        };
        let [[low_a, high_a], [low_b, high_b]] = [range(a), range(b)];
        // A cone may touch the plane; the other must clear it by far more than rounding.
        let [touch, clear] = [1e-12 * length, 1e-6 * length];
        let parted = (high_a <= touch && low_b >= clear)
            || (low_a >= -touch && high_b <= -clear)
            || (high_b <= touch && low_a >= clear)
            || (low_b >= -touch && high_a <= -clear);
        length > 0.0 && parted
    };
    let middle = |[x, y]: [Vector; 2]| unit(std::array::from_fn(|axis| x[axis] + y[axis]));
    if parts(subtract(middle(a), middle(b))) {
        return true;
    }
    let [normal_a, normal_b] = [a, b].map(|[x, y]| cross(x, y));
    parts(normal_a)
        || parts(normal_b)
        || a.into_iter().any(|direction| parts(cross(normal_a, direction)))
        || b.into_iter().any(|direction| parts(cross(normal_b, direction)))
}
