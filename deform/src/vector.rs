//! Vectors: their arithmetic, and positions as messages show them.

use std::fmt;

use crate::number::{Number, real};

/// A point or vector in space.
pub type Vector = [f64; 3];

/// `a - b`.
#[inline]
#[must_use]
pub fn subtract(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `a + b`.
#[inline]
#[must_use]
pub fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `factor a`.
#[inline]
#[must_use]
pub fn scale(a: Vector, factor: f64) -> Vector {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

/// The scalar product `a · b`.
#[inline]
#[must_use]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector product `a × b`.
#[inline]
#[must_use]
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The Euclidean length.
#[inline]
#[must_use]
pub fn length(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// The vector of length 1 in the direction of `a`; not finite where `a` is 0.
#[inline]
#[must_use]
pub fn unit(a: Vector) -> Vector {
    scale(a, 1.0 / length(a))
}

/// The Euclidean distance between two points.
#[inline]
#[must_use]
pub fn distance(a: Vector, b: Vector) -> f64 {
    length(subtract(a, b))
}

/// The determinant of the matrix with these columns.
#[inline]
#[must_use]
pub fn determinant(a: Vector, b: Vector, c: Vector) -> f64 {
    dot(a, cross(b, c))
}

/// Twice the area of a triangle along its normal.
#[inline]
#[must_use]
pub fn triangle_normal([a, b, c]: [Vector; 3]) -> Vector {
    cross(subtract(b, a), subtract(c, a))
}

/// The mean of some points; 0 where there are none.
#[must_use]
pub fn mean(points: impl ExactSizeIterator<Item = Vector>) -> Vector {
    let count = real(points.len().max(1));
    scale(points.fold([0.0; 3], add), 1.0 / count)
}

/// Twice the area of a polygon along its normal (Newell's method).
#[must_use]
pub fn polygon_normal(points: &[Vector], vertices: &[u32]) -> Vector {
    let origin = points[vertices[0] as usize];
    let mut normal = [0.0; 3];
    for pair in vertices[1..].windows(2) {
        let [a, b] = [0, 1].map(|end| subtract(points[pair[end] as usize], origin));
        let part = cross(a, b);
        for axis in 0..3 {
            normal[axis] += part[axis];
        }
    }
    normal
}

/// A position as a message shows it, to seven digits.
///
/// ```
/// use tombolo_deform::vector::Position;
///
/// assert_eq!(Position([0.1, -1.0 / 3.0, 1e-9]).to_string(), "(0.1, -0.3333333, 1e-9)");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position(pub Vector);

impl fmt::Display for Position {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.0.map(Number);
        write!(formatter, "({x:.7}, {y:.7}, {z:.7})")
    }
}
