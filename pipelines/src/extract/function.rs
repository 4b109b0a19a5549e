//! The functions that are 0 where a mesh is cut.

use tombolo_deform::communicator::{Communicator, Reduction};
use tombolo_deform::edit::{BoxRegion, SphereRegion};
use tombolo_deform::mesh::Vector;
use tombolo_deform::vector::{dot, subtract};

use crate::language::{Cylinder, Plane, Slice};

/// A function of space.
#[derive(Debug, Clone, Copy)]
pub(super) enum Function {
    /// The distance from a plane, above 0 where the normal, of length 1, points.
    Plane { origin: Vector, normal: Vector },
    /// The square of the distance from an axis, of direction of length 1, less the radius's.
    Cylinder { origin: Vector, axis: Vector, radius: f64 },
    /// The square of the distance from a point, less the radius's.
    Sphere { center: Vector, radius: f64 },
}

impl Function {
    pub(super) fn value(&self, point: Vector) -> f64 {
        match *self {
            Function::Plane { origin, normal } => dot(subtract(point, origin), normal),
            Function::Cylinder { origin, axis, radius } => {
                let from = subtract(point, origin);
                dot(from, from) - dot(from, axis).powi(2) - radius * radius
            }
            Function::Sphere { center, radius } => {
                let from = subtract(point, center);
                dot(from, from) - radius * radius
            }
        }
    }

    /// The functions of a slice, one for each surface.
    pub(super) fn of_slice(slice: &Slice) -> Vec<Self> {
        match slice {
            Slice::Plane(plane) => vec![plane.into()],
            Slice::Planes(planes) => planes.iter().map(Self::from).collect(),
            Slice::Cylinder(Cylinder { origin, axis, radius }) => {
                vec![Function::Cylinder { origin: *origin, axis: unit(*axis), radius: *radius }]
            }
            Slice::Sphere(sphere) => vec![sphere.into()],
        }
    }

    /// The functions of a box, each at least 0 inside.
    pub(super) fn of_box(region: &BoxRegion) -> Vec<Self> {
        let side = |axis: usize, origin: Vector, sign: f64| {
            let mut normal = [0.0; 3];
            normal[axis] = sign;
            Function::Plane { origin, normal }
        };
        let sides =
            (0..3).flat_map(|axis| [side(axis, region.lower, 1.0), side(axis, region.upper, -1.0)]);
        sides.collect()
    }
}

impl From<&Plane> for Function {
    fn from(plane: &Plane) -> Self {
        Function::Plane { origin: plane.origin, normal: unit(plane.normal) }
    }
}

impl From<&SphereRegion> for Function {
    fn from(sphere: &SphereRegion) -> Self {
        Function::Sphere { center: sphere.center, radius: sphere.radius }
    }
}

/// The vector of length 1 along a direction that has a length, however small or large.
pub(crate) fn unit(direction: Vector) -> Vector {
    let length = direction.iter().fold(0.0_f64, |sum, x| sum.hypot(*x));
    direction.map(|x| x / length)
}

/// How far from 0 a value may be that is 0 but for rounding, for each of `count` functions: slivers
/// beside a vertex would mean nothing. `value` is that of a function at a vertex. Collective.
pub(super) fn slacks(
    count: usize,
    vertices: usize,
    value: impl Fn(usize, usize) -> f64,
    communicator: &dyn Communicator,
) -> Vec<f64> {
    // NaN is above nothing, and is passed over. Several at a time, as no step waits for the one
    // before: the largest is the same in any order.
    let larger = |most: f64, value: f64| if value > most { value } else { most };
    let furthest = |index: usize| {
        let mut most = [0.0_f64; 8];
        let whole = vertices - vertices % most.len();
        for start in (0..whole).step_by(most.len()) {
            for (lane, most) in most.iter_mut().enumerate() {
                *most = larger(*most, value(index, start + lane).abs());
            }
        }
        let rest = (whole..vertices).map(|vertex| value(index, vertex).abs());
        most.into_iter().chain(rest).fold(0.0, larger)
    };
    let mut furthest: Vec<f64> = (0..count).map(furthest).collect();
    communicator.reduce(Reduction::Maximum, &mut furthest);
    furthest.iter().map(|furthest| 1e-12 * furthest).collect()
}

/// The value, or 0 where it is that but for rounding.
#[inline]
pub(super) fn settled(value: f64, slack: f64) -> f64 {
    if value.abs() <= slack { 0.0 } else { value }
}
