//! The flaws of a deformed surface, as they are reported.

use schemars::JsonSchema;
use serde::Serialize;

use crate::mesh::Vector;
use crate::vector::Position;

/// The flaws that a shape of a surface has and its reference has not.
#[derive(Debug, Clone, PartialEq, Default, Serialize, JsonSchema)]
pub struct SurfaceReport {
    /// Faces without area, or with a coordinate that is not finite.
    pub degenerate: FlawedFaces,
    /// Faces folded over: turned by more than 120° against most of what was smoothly connected to
    /// them around, or lying on a neighbour with less than 1° between.
    pub flipped: FlawedFaces,
    /// Faces of closed pieces that are turned inside out as a whole: what was inside them is
    /// outside.
    pub inside_out: FlawedFaces,
    /// Faces that pass through each other or touch, but for the vertices and edges they share.
    pub intersections: Intersections,
}

/// Faces with a flaw.
#[derive(Debug, Clone, PartialEq, Default, Serialize, JsonSchema)]
pub struct FlawedFaces {
    /// How many there are.
    pub count: usize,
    /// The faces with the lowest numbers, at most 16.
    pub first: Vec<FlawedFace>,
}

/// A face with a flaw.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct FlawedFace {
    /// The number of the face, as in [`Surface::faces`](super::Surface::faces).
    pub face: u32,
    /// The mean of its vertices in the shape.
    pub position: Vector,
}

/// Pairs of faces that intersect.
#[derive(Debug, Clone, PartialEq, Default, Serialize, JsonSchema)]
pub struct Intersections {
    /// How many pairs of triangles intersect (faces with more than three vertices are split into
    /// triangles).
    pub count: usize,
    /// Whether there are more: the count ends early where a small part of the surface has ten
    /// thousand.
    pub more: bool,
    /// The pairs with the lowest numbers among those counted, at most 16.
    pub first: Vec<Intersection>,
}

/// Two faces that intersect.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Intersection {
    /// The numbers of the faces, as in [`Surface::faces`](super::Surface::faces), the lower first;
    /// twice the same where the triangles of one face meet.
    pub faces: [u32; 2],
    /// A point of both; for faces in one plane, a point near both.
    pub position: Vector,
}

impl SurfaceReport {
    /// Whether nothing is wrong.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        [&self.degenerate, &self.flipped, &self.inside_out].iter().all(|flawed| flawed.count == 0)
            && self.intersections.count == 0
    }

    /// The place of the first flaw; `None` where nothing is wrong.
    #[must_use]
    pub fn place(&self) -> Option<Vector> {
        let flawed = [&self.degenerate, &self.flipped, &self.inside_out];
        let faces = flawed.into_iter().flat_map(|flawed| flawed.first.first());
        let first = faces.map(|face| face.position).next();
        first.or_else(|| self.intersections.first.first().map(|pair| pair.position))
    }
}

impl std::fmt::Display for SurfaceReport {
    /// One line for people: what is wrong, how often, and where first.
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let at = Position;
        let mut parts = Vec::new();
        for (flawed, what) in [
            (&self.degenerate, "lose their area"),
            (&self.flipped, "fold over"),
            (&self.inside_out, "of closed pieces are turned inside out"),
        ] {
            if let Some(first) = flawed.first.first() {
                parts.push(format!(
                    "{} face(s) {what}, the first is face {} at {}",
                    flawed.count,
                    first.face,
                    at(first.position)
                ));
            }
        }
        if let Some(first) = self.intersections.first.first() {
            let more = if self.intersections.more { "more than " } else { "" };
            let [a, b] = first.faces;
            parts.push(format!(
                "{more}{} pair(s) of faces intersect, the first are faces {a} and {b} at {}",
                self.intersections.count,
                at(first.position)
            ));
        }
        if parts.is_empty() {
            return formatter.write_str("the surface is sound");
        }
        formatter.write_str(&parts.join("; "))
    }
}

/// A surface that is broken before any volume comes into it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema, thiserror::Error)]
#[error(
    "the surface itself would be broken: {report}; the largest feasible fraction is at most {:.4}",
    // Rounded down, so that what is shown is feasible.
    (sound_fraction * 1e4).floor() / 1e4
)]
pub struct BrokenSurface {
    /// Its flaws.
    pub report: SurfaceReport,
    /// How far it can go and still be sound there: see [`sound_fraction`](super::sound_fraction).
    pub sound_fraction: f64,
}
