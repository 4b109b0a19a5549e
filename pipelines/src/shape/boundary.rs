//! The boundary of the mesh that is shaped: its vertices on this process, and the surface that all of them make.

use std::{fmt, sync::Arc};

use tombolo_deform::{
    mesh::Vector,
    partition::{Partition, Reduction, whole},
    surface::Surface,
};

use super::Refused;
use crate::communicator::Communicator;
use crate::distributed::{PartBoundary, SharedVertices};

/// The boundary of a mesh, and the way between its vertices on this process and the surface, which one process alone has and
/// edits. All that speaks with other ranks is collective, and its outcome the same on all of them.
pub(super) struct Boundary {
    surface: Option<Arc<Surface>>,
    vertices: Vec<u32>,
    partition: Arc<dyn Partition>,
    ranks: Option<Parts>,
}

/// The ways of a mesh in parts.
pub(super) struct Parts {
    pub(super) communicator: Arc<dyn Communicator>,
    pub(super) shared: Arc<SharedVertices>,
    pub(super) boundary: PartBoundary,
}

impl fmt::Debug for Boundary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Boundary")
            .field("partition", &self.partition)
            .finish_non_exhaustive()
    }
}

/// What another rank cannot do, as far as it matters to the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Elsewhere {
    pub(super) message: String,
    pub(super) is_surface: bool,
    pub(super) is_quality: bool,
    pub(super) feasible_fraction: Option<f64>,
    pub(super) min_scaled_jacobian: Option<f64>,
}

impl fmt::Display for Elsewhere {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.message)
    }
}

impl Elsewhere {
    fn of(refused: &Refused, rank: usize) -> Self {
        let message =
            if rank == 0 { refused.to_string() } else { format!("rank {rank}: {refused}") };
        Self {
            message,
            is_surface: refused.is_surface(),
            is_quality: refused.is_quality(),
            feasible_fraction: refused.feasible_fraction(),
            min_scaled_jacobian: refused.min_scaled_jacobian(),
        }
    }

    fn into_bytes(self) -> Vec<u8> {
        let flags = u8::from(self.is_surface) + 2 * u8::from(self.is_quality);
        let number = |value: Option<f64>| value.unwrap_or(f64::NAN).to_le_bytes();
        let mut bytes = vec![flags];
        bytes.extend(number(self.feasible_fraction));
        bytes.extend(number(self.min_scaled_jacobian));
        bytes.extend(self.message.into_bytes());
        bytes
    }

    fn read(bytes: &[u8]) -> Self {
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
            message: String::from_utf8_lossy(rest.get(16..).unwrap_or_default()).into_owned(),
            is_surface: flags & 1 != 0,
            is_quality: flags & 2 != 0,
            feasible_fraction: number(0),
            min_scaled_jacobian: number(1),
        }
    }
}

impl Boundary {
    /// The boundary of a mesh that this process has as a whole.
    pub(super) fn of_surface(surface: Arc<Surface>) -> Self {
        let vertices = surface.vertices().to_vec();
        Self { surface: Some(surface), vertices, partition: whole(), ranks: None }
    }

    /// The boundary of a mesh in parts.
    pub(super) fn of_parts(parts: Parts, partition: Arc<dyn Partition>) -> Self {
        let vertices = parts.boundary.vertices().to_vec();
        Self { surface: parts.boundary.surface().cloned(), vertices, partition, ranks: Some(parts) }
    }

    /// The surface of the whole mesh, where this process is the one that has it.
    pub(super) fn surface(&self) -> Option<&Arc<Surface>> {
        self.surface.as_ref()
    }

    /// The vertices of the mesh on this process that lie on it: on one process in the order of the surface.
    pub(super) fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    pub(super) fn partition(&self) -> &Arc<dyn Partition> {
        &self.partition
    }

    /// The coordinates of its vertices where those of the mesh lie at `points`.
    pub(super) fn places(&self, points: &[Vector]) -> Vec<Vector> {
        self.vertices.iter().map(|&vertex| points[vertex as usize]).collect()
    }

    /// Whether something holds on all ranks.
    pub(super) fn all(&self, mine: bool) -> bool {
        let mut holds = [f64::from(u8::from(mine))];
        self.partition.reduce(Reduction::Minimum, &mut holds);
        holds[0] > 0.0
    }

    /// Goes on where all ranks can; where one cannot, all are refused for the same reason: that of the lowest rank with one of its
    /// own.
    pub(super) fn agree<T>(&self, mine: Result<T, Refused>) -> Result<T, Refused> {
        let Some(Parts { communicator, .. }) = &self.ranks else { return mine };
        let (rank, size) = (communicator.rank(), communicator.size());
        let own = match &mine {
            Ok(_) => 2 * size,
            // Another rank has the reason.
            Err(Refused::Volume(error)) if error.is_of_other_rank() => size + rank,
            Err(_) => rank,
        };
        #[expect(clippy::cast_precision_loss, reason = "ranks below 2^53")]
        let mut lowest = [own as f64];
        communicator.reduce(Reduction::Minimum, &mut lowest);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a rank")]
        let lowest = lowest[0] as usize;
        if lowest >= 2 * size {
            return mine;
        }
        let failing = lowest % size;
        let told = mine
            .as_ref()
            .err()
            .filter(|_| rank == failing)
            .map(|refused| Elsewhere::of(refused, rank));
        let mut bytes = told.map_or_else(Vec::new, Elsewhere::into_bytes);
        communicator.broadcast(failing, &mut bytes);
        match mine {
            Err(refused) if rank == 0 && failing == 0 => Err(refused),
            _ => Err(Refused::Elsewhere(Elsewhere::read(&bytes))),
        }
    }

    /// What rank 0 says of the vertices of the surface, for the boundary's vertices on this process.
    pub(super) fn scatter(
        &self,
        of_surface: Result<Vec<Vector>, Refused>,
    ) -> Result<Vec<Vector>, Refused> {
        let of_surface = self.agree(of_surface)?;
        let Some(parts) = &self.ranks else { return Ok(of_surface) };
        let values = self.surface.is_some().then_some(&of_surface[..]);
        self.agree(parts.boundary.scatter(&*parts.communicator, values).map_err(Refused::from))
    }

    /// Values of the vertices of the mesh, for those of the surface, where this process has it; else none.
    pub(super) fn gather(&self, of_mesh: &[Vector]) -> Result<Vec<Vector>, Refused> {
        let Some(parts) = &self.ranks else { return Ok(self.places(of_mesh)) };
        let gathered = parts.boundary.gather(&*parts.communicator, of_mesh).map_err(Refused::from);
        Ok(self.agree(gathered)?.unwrap_or_default())
    }

    /// Puts the vertices that other ranks speak for where these have them.
    pub(super) fn take_from_owners(&self, points: &mut [Vector]) -> Result<(), Refused> {
        let Some(Parts { communicator, shared, .. }) = &self.ranks else { return Ok(()) };
        self.agree(shared.take_from_owners(&**communicator, points).map_err(Refused::from))
    }

    /// A number that rank 0 has.
    pub(super) fn of_root(&self, number: f64) -> f64 {
        let mut most = [if self.surface.is_some() { number } else { f64::NEG_INFINITY }];
        self.partition.reduce(Reduction::Maximum, &mut most);
        most[0]
    }

    /// What the values of all ranks come to.
    pub(super) fn reduced(&self, reduction: Reduction, mine: f64) -> f64 {
        let mut values = [mine];
        self.partition.reduce(reduction, &mut values);
        values[0]
    }
}
