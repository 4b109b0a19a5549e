//! The reasons for which a request is refused.

use std::fmt;

use crate::{
    distributed::DistributedError,
    edit::EditError,
    features::UnknownFeature,
    limits::Exceeded,
    mesh::Vector,
    quality::Refusal,
    surface::BrokenSurface,
    volume::{Impossible, VolumeError},
};

/// Why a stack of edits makes no shape that could be handed to a solver. Nothing was changed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Refused {
    /// An edit asks for what the surface cannot do.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// The surface folds over or intersects itself.
    #[error(transparent)]
    Surface(#[from] Box<BrokenSurface>),
    /// A feature that should slide or be free is none of the surface.
    #[error("deform.{field}: {source}")]
    Feature {
        /// `sliding` or `free`.
        field: &'static str,
        /// The name, and those that there are.
        source: UnknownFeature,
    },
    /// Features that slide or are free leave nothing that holds a part of the mesh.
    #[error(
        "deform.{}: nothing holds the part of the mesh that {} {}, so that it could go anywhere; keep a feature of it off the list",
        match (sliding.is_empty(), free.is_empty()) {
            (false, true) => "sliding",
            (true, _) => "free",
            _ => "sliding and deform.free",
        },
        sliding.iter().chain(free).map(|name| format!("'{name}'")).collect::<Vec<_>>().join(", "),
        if sliding.len() + free.len() == 1 { "bounds" } else { "bound" }
    )]
    LetGo {
        /// The features of that part that slide.
        sliding: Vec<String>,
        /// The features of that part that are free.
        free: Vec<String>,
    },
    /// The volume cannot follow.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// A mesh on the way would be broken.
    #[error(transparent)]
    Guard(#[from] Refusal),
    /// An edit cannot be followed to its end, not in sub-steps and not by untangling.
    #[error(
        "edit {edit} ({name}) can be done to {:.2} % of its amount; beyond that{} {}{}",
        (1e4 * fraction).floor() / 1e2,
        if *folds { " the surface itself folds:" } else { "" },
        refusal.flaw(),
        at_its_end(impossible.as_deref(), *end_is_valid)
    )]
    Stalled {
        /// The index of the edit in the stack, counted from 0.
        edit: usize,
        /// Its kind.
        name: &'static str,
        /// The fraction of its amount that was reached.
        fraction: f64,
        /// Whether it is the prescribed surface that folds there.
        folds: bool,
        /// The reason for which it cannot go further.
        refusal: Refusal,
        /// Why there is no valid mesh at the edit's whole amount, where that is proved.
        impossible: Option<Box<Impossible>>,
        /// Whether a valid mesh was found at the edit's whole amount, to which there was no way.
        end_is_valid: bool,
    },
    /// The parts of the ranks make no mesh.
    #[error(transparent)]
    Distributed(#[from] DistributedError),
    /// The edits move a vertex out of the plane of a mesh of two coordinates:
    /// [`Shaper::in_plane`](super::Shaper::in_plane).
    #[error(
        "the edits move the vertex at ({}, {}) by {by} along z, expected 0: the vertices of this mesh have two coordinates",
        at[0], at[1]
    )]
    LeavesPlane {
        /// The vertex.
        at: Vector,
        /// How far, in units of the mesh.
        by: f64,
    },
    /// There are more edits or shapes than are allowed.
    #[error(transparent)]
    Limit(#[from] Exceeded),
    /// It was given up: see [`Shaper::cancellation`](super::Shaper::cancellation).
    #[error("it was given up before its shapes were known")]
    Cancelled,
    /// Another rank has the reason, in its own words.
    #[error("{0}")]
    Elsewhere(Elsewhere),
}

/// The end of an edit that cannot be followed to it, in words.
fn at_its_end(impossible: Option<&Impossible>, end_is_valid: bool) -> String {
    match impossible {
        Some(proof) => {
            format!("; no motion of the inside gives a valid mesh at its whole amount: {proof}")
        }
        None if end_is_valid => String::from(
            "; there is a valid mesh at its whole amount, but no way to it was found: make the edit in parts",
        ),
        None => String::new(),
    }
}

impl Refused {
    /// Whether it was given up, of which nothing follows for the next such request.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        match self {
            Refused::Cancelled
            | Refused::Guard(Refusal::Cancelled)
            | Refused::Edit(EditError::Cancelled) => true,
            Refused::Volume(error) => error.is_cancelled(),
            Refused::Elsewhere(elsewhere) => elsewhere.is_cancelled,
            _ => false,
        }
    }

    /// Whether it is the surface that is broken.
    pub(super) fn is_surface(&self) -> bool {
        matches!(self, Refused::Surface(_) | Refused::Elsewhere(Elsewhere { is_surface: true, .. }))
    }

    /// Whether a mesh on a straight way would be broken.
    pub(super) fn is_quality(&self) -> bool {
        matches!(
            self,
            Refused::Guard(Refusal::Quality(_))
                | Refused::Elsewhere(Elsewhere { is_quality: true, .. })
        )
    }

    /// Whether a linear system could not be solved: the same on all ranks.
    pub(super) fn breaks_down(&self) -> bool {
        !self.is_cancelled()
            && matches!(
                self,
                Refused::Volume(VolumeError::Linear(_))
                    | Refused::Elsewhere(Elsewhere { breaks_down: true, .. })
            )
    }

    /// The least scaled Jacobian on the way, where that is what was wrong.
    #[must_use]
    pub fn min_scaled_jacobian(&self) -> Option<f64> {
        match self {
            Refused::Guard(Refusal::Quality(path))
            | Refused::Stalled { refusal: Refusal::Quality(path), .. } => {
                Some(path.min_scaled_jacobian)
            }
            Refused::Elsewhere(elsewhere) => elsewhere.min_scaled_jacobian,
            _ => None,
        }
    }

    /// The fraction that would pass: of the amounts of the edits that are not kept, as it was tried; of
    /// the way, where there are none; or of the amount of the edit that cannot be followed. 0 where
    /// none is known.
    #[must_use]
    pub fn feasible_fraction(&self) -> Option<f64> {
        match self {
            Refused::Guard(Refusal::Quality(path)) => Some(path.feasible_fraction),
            Refused::Stalled { fraction, .. } => Some(*fraction),
            Refused::Surface(broken) => Some(broken.sound_fraction),
            Refused::Elsewhere(elsewhere) => elsewhere.feasible_fraction,
            _ => None,
        }
    }

    /// The refusal of a broken way, of which this fraction passes.
    pub(super) fn with_feasible_fraction(mut self, fraction: f64) -> Self {
        if let Refused::Guard(Refusal::Quality(path)) = &mut self {
            path.feasible_fraction = fraction;
        }
        self
    }

    /// The place of the worst cell before the change, or of the first face of the surface that is
    /// broken, where one is the reason.
    #[must_use]
    pub fn place(&self) -> Option<Vector> {
        match self {
            Refused::Guard(Refusal::Quality(path))
            | Refused::Stalled { refusal: Refusal::Quality(path), .. } => {
                path.worst.first().map(|worst| worst.centroid).or(path.folded_at)
            }
            Refused::Surface(broken) => broken.report.place(),
            Refused::LeavesPlane { at, .. } => Some(*at),
            Refused::Elsewhere(elsewhere) => elsewhere.place,
            _ => None,
        }
    }
}

/// The refusal of another rank, as far as it matters to the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Elsewhere {
    pub(super) message: String,
    pub(super) is_surface: bool,
    pub(super) is_quality: bool,
    pub(super) breaks_down: bool,
    pub(super) is_cancelled: bool,
    pub(super) feasible_fraction: Option<f64>,
    pub(super) min_scaled_jacobian: Option<f64>,
    pub(super) place: Option<Vector>,
}

impl fmt::Display for Elsewhere {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.message)
    }
}

impl Elsewhere {
    pub(super) fn of(refused: &Refused, rank: usize) -> Self {
        let message =
            if rank == 0 { refused.to_string() } else { format!("rank {rank}: {refused}") };
        Self {
            message,
            is_surface: refused.is_surface(),
            is_quality: refused.is_quality(),
            breaks_down: refused.breaks_down(),
            is_cancelled: refused.is_cancelled(),
            feasible_fraction: refused.feasible_fraction(),
            min_scaled_jacobian: refused.min_scaled_jacobian(),
            place: refused.place(),
        }
    }

    pub(super) fn into_bytes(self) -> Vec<u8> {
        let flags = u8::from(self.is_surface)
            + 2 * u8::from(self.is_quality)
            + 4 * u8::from(self.breaks_down)
            + 8 * u8::from(self.is_cancelled);
        let number = |value: Option<f64>| value.unwrap_or(f64::NAN).to_le_bytes();
        let mut bytes = vec![flags];
        bytes.extend(number(self.feasible_fraction));
        bytes.extend(number(self.min_scaled_jacobian));
        for axis in 0..3 {
            bytes.extend(number(self.place.map(|place| place[axis])));
        }
        bytes.extend(self.message.into_bytes());
        bytes
    }

    pub(super) fn read(bytes: &[u8]) -> Self {
        let (flags, rest) =
            bytes.split_first().map_or((0, &[][..]), |(flags, rest)| (*flags, rest));
        let number = |at: usize| {
            let value = rest
                .get(8 * at..)
                .and_then(|rest| rest.first_chunk())
                .map(|bytes| f64::from_le_bytes(*bytes));
            value.filter(|value| !value.is_nan())
        };
        Self {
            message: String::from_utf8_lossy(rest.get(40..).unwrap_or_default()).into_owned(),
            is_surface: flags & 1 != 0,
            is_quality: flags & 2 != 0,
            breaks_down: flags & 4 != 0,
            is_cancelled: flags & 8 != 0,
            feasible_fraction: number(0),
            min_scaled_jacobian: number(1),
            place: number(2).zip(number(3)).zip(number(4)).map(|((x, y), z)| [x, y, z]),
        }
    }
}
