//! Where the points of a scene lie in a picture.

use tombolo_deform::bounds::Bounds;
use tombolo_deform::edit::BoxRegion;
use tombolo_deform::mesh::Vector;
use tombolo_deform::vector::{cross, dot, length, scale, subtract, unit};

use super::angle::sine_and_cosine;
use crate::language::{Camera, Viewpoint};

/// The part of a picture that a fitted scene fills, in pixels from the top left.
#[derive(Debug, Clone, Copy)]
pub(super) struct Viewport {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

/// A camera that stands.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    eye: Vector,
    /// The directions to the right, up and away in the picture, of length 1.
    pub(super) right: Vector,
    pub(super) up: Vector,
    pub(super) away: Vector,
    parallel: bool,
    /// Where the line of sight meets the picture, in pixels.
    center: [f64; 2],
    /// Pixels for each unit to the side; at distance 1 where rays are not parallel.
    scale: f64,
    /// The nearest and the farthest that is seen.
    near: f64,
    far: f64,
}

/// A point before it is divided by its distance: pixels to the right of and below the line of sight
/// times `weight`, and the distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seen {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) distance: f64,
}

impl View {
    /// The view of a camera upon a scene within `bounds`, in a picture of `size` pixels.
    pub(super) fn new(
        camera: &Camera,
        bounds: &Bounds,
        size: [f64; 2],
        viewport: Viewport,
    ) -> Self {
        let (sine, cosine) = sine_and_cosine(camera.angle / 2.0);
        let tangent = sine / cosine;
        let (away, up) = directions(camera);
        let right = normalized(cross(away, up));
        let up = cross(right, away);
        let mut view = Self {
            eye: [0.0; 3],
            right,
            up,
            away,
            parallel: camera.parallel,
            center: [size[0] / 2.0, size[1] / 2.0],
            scale: 0.0,
            near: 0.0,
            far: 1.0,
        };
        match camera.viewpoint {
            Viewpoint::At { position, focal_point } => {
                view.eye = position;
                let per_pixel = if camera.parallel {
                    length(subtract(focal_point, position)) * tangent
                } else {
                    tangent
                };
                view.scale = camera.zoom * size[1] / 2.0 / per_pixel;
            }
            Viewpoint::Around { bounds: fixed, .. } => {
                let of_box = |it: BoxRegion| Bounds { lower: it.lower, upper: it.upper };
                view.fit(&fixed.map_or(*bounds, of_box), viewport, tangent, size[1]);
                view.scale *= camera.zoom;
            }
        }
        view.limit(bounds);
        view
    }

    /// Steps back until a box fills the viewport.
    fn fit(&mut self, bounds: &Bounds, viewport: Viewport, tangent: f64, height: f64) {
        let middle = bounds.center();
        let corners = corners(bounds).map(|corner| {
            let from = subtract(corner, middle);
            [dot(from, self.right).abs(), dot(from, self.up).abs(), dot(from, self.away)]
        });
        let half = [viewport.width / 2.0, viewport.height / 2.0];
        self.center = [viewport.left + half[0], viewport.top + half[1]];
        let largest = |of: &dyn Fn(&Vector) -> f64| corners.iter().map(of).fold(0.0, f64::max);
        let radius = largest(&|corner| length(*corner));
        let radius = if radius > 0.0 { radius } else { 1.0 };
        let distance = if self.parallel {
            let across = largest(&|corner| (corner[0] / half[0]).max(corner[1] / half[1]));
            self.scale = 1.0 / if across > 0.0 { across } else { radius / half[1] };
            2.0 * radius
        } else {
            self.scale = height / 2.0 / tangent;
            let needed = |corner: &Vector| {
                self.scale * (corner[0] / half[0]).max(corner[1] / half[1]) - corner[2]
            };
            largest(&needed).max(1e-3 * radius)
        };
        self.eye = subtract(middle, scale(self.away, distance));
    }

    /// Finds the distances between which the scene lies.
    fn limit(&mut self, bounds: &Bounds) {
        let distances = corners(bounds).map(|corner| dot(subtract(corner, self.eye), self.away));
        let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
        let most = distances.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let slack = 0.01 * length(bounds.extent()) + f64::MIN_POSITIVE;
        let floor = if self.parallel { f64::NEG_INFINITY } else { slack };
        self.near = (least - slack).max(floor);
        self.far = (most + slack).max(self.near + slack);
    }

    /// Where a point is seen.
    pub(super) fn see(&self, point: Vector) -> Seen {
        let from = subtract(point, self.eye);
        Seen {
            x: self.scale * dot(from, self.right),
            y: -self.scale * dot(from, self.up),
            distance: dot(from, self.away),
        }
    }

    /// By how much a point counts between others, so that what is straight in space is so in the
    /// picture: the inverse of its distance, or 1 where rays are parallel.
    pub(super) fn weight(&self, seen: Seen) -> f64 {
        if self.parallel { 1.0 } else { 1.0 / seen.distance }
    }

    /// The pixels to the right of the left edge, and below the upper one.
    pub(super) fn pixel(&self, seen: Seen) -> [f64; 2] {
        let weight = self.weight(seen);
        [self.center[0] + seen.x * weight, self.center[1] + seen.y * weight]
    }

    /// The depth in the picture, from 0 for the nearest to 1. Linear between points of a picture.
    pub(super) fn depth(&self, seen: Seen) -> f64 {
        if self.parallel {
            (seen.distance - self.near) / (self.far - self.near)
        } else {
            let (near, far) = (1.0 / self.near, 1.0 / self.far);
            (near - 1.0 / seen.distance) / (near - far)
        }
    }

    /// How far a point lies within each of the planes that bound what is seen: the nearest, and
    /// those through the eye that lie two pictures to the side. Below 0 it is beyond.
    pub(super) fn margins(&self, seen: Seen, size: [f64; 2]) -> [f64; 5] {
        let depth = if self.parallel { 1.0 } else { seen.distance };
        let (x, y) = (seen.x, seen.y);
        [
            seen.distance - self.near,
            x + 3.0 * size[0] * depth,
            3.0 * size[0] * depth - x,
            y + 3.0 * size[1] * depth,
            3.0 * size[1] * depth - y,
        ]
    }
}

/// The direction in which a camera looks, and one that is up.
fn directions(camera: &Camera) -> (Vector, Vector) {
    let upwards = normalized(camera.up);
    let size = upwards.map(f64::abs);
    let longest = (0..3).fold(0, |most, axis| if size[axis] > size[most] { axis } else { most });
    let mut ahead = [0.0; 3];
    ahead[(longest + 1) % 3] = 1.0;
    let ahead = normalized(subtract(ahead, scale(upwards, dot(ahead, upwards))));
    let beside = cross(upwards, ahead);
    let sum = |parts: [(Vector, f64); 3]| -> Vector {
        std::array::from_fn(|axis| parts.iter().map(|(part, by)| part[axis] * by).sum())
    };
    match camera.viewpoint {
        Viewpoint::At { position, focal_point } => {
            let away = normalized(subtract(focal_point, position));
            // Along the direction up there is none in the picture: any will do.
            let is_lost = length(cross(away, upwards)) < 1e-9;
            (away, if is_lost { ahead } else { upwards })
        }
        Viewpoint::Around { azimuth, elevation, .. } => {
            let (sine, cosine) = sine_and_cosine(azimuth);
            let (height, horizontal) = sine_and_cosine(elevation);
            let away = sum([
                (ahead, -cosine * horizontal),
                (beside, -sine * horizontal),
                (upwards, -height),
            ]);
            let up =
                sum([(ahead, -cosine * height), (beside, -sine * height), (upwards, horizontal)]);
            (away, up)
        }
    }
}

fn normalized(vector: Vector) -> Vector {
    // First by the largest component, so that no square is too large or small for a number.
    let largest = vector.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let scaled = vector.map(|x| x / largest);
    unit(scaled)
}

fn corners(bounds: &Bounds) -> [Vector; 8] {
    std::array::from_fn(|corner| {
        let pick = |axis: usize| {
            if corner >> axis & 1 == 0 { bounds.lower[axis] } else { bounds.upper[axis] }
        };
        [pick(0), pick(1), pick(2)]
    })
}
