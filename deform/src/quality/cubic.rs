//! Cubics in the path parameter: determinants of vectors that go straight.

use crate::mesh::Vector;
use crate::vector::{determinant, subtract};

/// A cubic by its coefficients, the constant first.
pub(super) type Cubic = [f64; 4];

/// The least value of a polynomial in the path parameter over `0..=1`, and where it is taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Least {
    pub value: f64,
    pub at: f64,
    /// Whether the value is above zero by more than rounding could make of it.
    pub positive: bool,
}

impl Least {
    pub(super) const NONE: Self = Self { value: f64::INFINITY, at: 0.0, positive: true };

    pub(super) fn worse(self, other: Self) -> Self {
        let first =
            if other.positive == self.positive { other.value < self.value } else { self.positive };
        if first { other } else { self }
    }
}

/// The determinant of three vectors that go straight from the first three to the others.
pub(super) fn triple([a1, a2, a3]: [Vector; 3], [b1, b2, b3]: [Vector; 3]) -> Cubic {
    let (d1, d2, d3) = (subtract(b1, a1), subtract(b2, a2), subtract(b3, a3));
    [
        determinant(a1, a2, a3),
        determinant(d1, a2, a3) + determinant(a1, d2, a3) + determinant(a1, a2, d3),
        determinant(d1, d2, a3) + determinant(d1, a2, d3) + determinant(a1, d2, d3),
        determinant(d1, d2, d3),
    ]
}

/// Minimises a cubic over `0..=until`.
///
/// The cubic's Bernstein coefficients bound it from below; where they are all positive nothing else
/// is computed. Else the ends and the roots of the derivative are compared.
pub(super) fn least_of_cubic(c: Cubic, until: f64) -> Least {
    let evaluate = |t: f64| c[0] + t * (c[1] + t * (c[2] + t * c[3]));
    let magnitude = c.iter().map(|value| value.abs()).sum::<f64>();
    if !magnitude.is_finite() {
        return Least { value: f64::NAN, at: until, positive: false };
    }
    let rounding = 16.0 * f64::EPSILON * magnitude;
    let mut least = Least { value: c[0], at: 0.0, positive: true };
    let consider = |t: f64, least: &mut Least| {
        let value = evaluate(t);
        if value < least.value {
            (least.value, least.at) = (value, t);
        }
    };
    consider(until, &mut least);
    let (u1, u2) = (until * c[1], until * until * c[2]);
    let inner = (c[0] + u1 / 3.0).min(c[0] + (2.0 * u1 + u2) / 3.0);
    if inner <= least.value {
        for t in quadratic_roots(3.0 * c[3], 2.0 * c[2], c[1]) {
            if t > 0.0 && t < until {
                consider(t, &mut least);
            }
        }
    }
    least.positive = least.value > rounding || (least.at == 0.0 && least.value > 0.0);
    least
}

/// The real roots of `a t² + b t + c`, computed without cancellation; NaN where there is none.
fn quadratic_roots(a: f64, b: f64, c: f64) -> [f64; 2] {
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return [f64::NAN; 2];
    }
    let q = -0.5 * (b + discriminant.sqrt().copysign(b));
    [q / a, c / q]
}
