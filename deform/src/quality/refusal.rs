//! Why the guard does not let a path through.

use schemars::JsonSchema;
use serde::Serialize;

use crate::mesh::Vector;
use crate::number::Number;
use crate::vector::Position;

/// A cell that a path would break.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct FailingCell {
    /// The cell's number in the mesh.
    pub cell: usize,
    /// Its type, by VTK's number.
    pub cell_type: u8,
    /// The mean of its vertices at the start of the path.
    pub centroid: Vector,
    /// The least scaled Jacobian found on the path, -1 where it is no number.
    pub scaled_jacobian: f64,
    /// How far along the path that is.
    pub fraction: f64,
    /// Whether the cell is turned inside out somewhere on the path, in one of the shapes or between
    /// them.
    pub inverts: bool,
}

/// The flaws of a path.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BrokenPath {
    /// The floor that does not hold.
    pub floor: f64,
    /// The least scaled Jacobian found on the path.
    pub min_scaled_jacobian: f64,
    /// How many cells are turned inside out somewhere on the path.
    pub inverted: usize,
    /// How many cells fail, those turned inside out among them.
    pub failing: usize,
    /// The worst of the failing cells, at most 10, the worst first.
    pub worst: Vec<FailingCell>,
    /// How far along the path a mesh can go, in one straight step, with every cell valid all the
    /// way and above the floor at its end. 0 where not at all; below what is possible by at most
    /// one part in a million. Of a request that is [refused](crate::shape::Refused): the fraction of
    /// its edits' amounts that passes.
    pub feasible_fraction: f64,
    /// How many boundary faces have at the end of the path a normal that points against the one
    /// they started with. Where this is not 0, the prescribed surface folds over itself or turns by
    /// more than a right angle: no motion of the inside along this path can mend that.
    pub folded_faces: usize,
    /// Where the first of these faces started.
    pub folded_at: Option<Vector>,
}

/// Why a path was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// A mesh on the path would be broken.
    #[error("{}", describe(.0))]
    Quality(Box<BrokenPath>),
    /// A shape with another number of points than the mesh.
    #[error("the {which} shape has {found} points; the mesh has {expected}")]
    PointCount {
        /// `start` or `end`.
        which: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// A coordinate that is NaN or infinite.
    #[error(
        "vertex {vertex} of the {which} shape lies at {point:?}; every coordinate must be finite"
    )]
    NotFinite {
        /// `start` or `end`.
        which: &'static str,
        /// The vertex.
        vertex: usize,
        /// Its coordinates.
        point: Vector,
    },
    /// A fraction that is not on the path.
    #[error("fraction {index} of the path is {}; fractions are above 0, rise, and are at most 1", Number(*value))]
    Fraction {
        /// Which of the fractions.
        index: usize,
        /// The value.
        value: f64,
    },
    /// The judgement was given up: see [`judge_unless`](super::judge_unless).
    #[error("it was given up")]
    Cancelled,
    /// The arguments of another rank make no sense.
    #[error("the shapes given on another rank make no sense")]
    OtherRank,
    /// A floor out of range.
    #[error("guard.min_scaled_jacobian is {}; it must be from 0 to 1", Number(*value))]
    Floor {
        /// The value.
        value: f64,
    },
}

impl BrokenPath {
    /// The flaws in words, without the fractions of the path: for those who follow a longer way, of
    /// which it is a piece.
    #[must_use]
    pub fn flaw(&self) -> String {
        self.described(|_| String::new())
    }

    fn described(&self, way_of: impl Fn(&FailingCell) -> String) -> String {
        let mut text = match self.inverted {
            0 => {
                format!(
                    "{} cell(s) would fall under the scaled Jacobian of {:.4}",
                    self.failing,
                    Number(self.floor)
                )
            }
            inverted => format!("{inverted} cell(s) would be turned inside out"),
        };
        if let Some(worst) = self.worst.first() {
            let (position, value) = (Position(worst.centroid), Number(worst.scaled_jacobian));
            text += &format!(
                "; the worst is cell {} at {position} with {value:.4}{}",
                worst.cell,
                way_of(worst)
            );
        }
        if self.folded_faces > 0 {
            text += &format!(
                "; the prescribed surface itself turns over at {} face(s)",
                self.folded_faces
            );
            if let Some(position) = self.folded_at {
                text += &format!(", the first at {}", Position(position));
            }
        }
        text
    }
}

impl Refusal {
    /// The flaws in words, without the fractions of the path that was judged: see
    /// [`BrokenPath::flaw`].
    #[must_use]
    pub fn flaw(&self) -> String {
        match self {
            Refusal::Quality(path) => path.flaw(),
            other => other.to_string(),
        }
    }
}

fn describe(path: &BrokenPath) -> String {
    let text = path.described(|worst| format!(" at {:.1} % of the way", 100.0 * worst.fraction));
    // Rounded down, so that what is shown is feasible.
    text + &format!(
        "; the largest feasible fraction is {:.4}",
        (path.feasible_fraction * 1e4).floor() / 1e4
    )
}
