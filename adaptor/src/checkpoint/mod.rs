//! Checkpoints: the state of a run, saved beside the solver's own, so that another run goes on from
//! there as if nothing had come between.

mod file;
mod saved;

use std::path::{Path, PathBuf};

use tombolo_deform::{
    communicator::{Garbled, RankError, Reader, Writer},
    shape::SavedPoints,
};
use tombolo_pipelines::files::write_durably;

pub(crate) use file::{read_of_ranks, write_of_ranks};
pub(crate) use saved::{SavedCommand, SavedMesh, SavedRun};

/// The first bytes of a checkpoint.
const MAGIC: &[u8; 8] = b"TMBLCKPT";
/// The version of the format.
const VERSION: u32 = 1;
/// Bytes in front of what a checkpoint holds: the magic, the version and the length.
const HEAD: usize = 20;

/// The state of a run at the end of a step: what the solver saves beside its own state.
///
/// It holds the reference mesh's coordinates, the stack of edits, the schedule under way and how far
/// it has come, the orders that wait, the parameters, the commands of files that are still to come,
/// what the pipelines have measured, and where in the journal it was made. What belongs to the solver
/// is not in it: its fields, its time, and the mesh as it lies now.
///
/// It belongs to the step that the last call of [`execute`](crate::Adaptor::execute) has begun, with
/// the motion that was asked for made: the solver saves its own state at the end of that step, goes on
/// from there, and the first call of the new run is the one that would have come next.
///
/// ```
/// use tombolo::{Adaptor, Channel, Checkpoint, MeshView, Settings, Step};
/// # use tombolo::{deform::shapes::box_of_tets, pipelines::language::parse_orders};
/// # let mesh = box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
/// # let tets = mesh.cells().connectivity().to_vec();
/// # let orders = parse_orders(r#"[{"at": {"cycle": 2}, "order": {"edits": [
/// #     {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -0.2]}}],
/// #     "schedule": {"steps": 4, "every": {"steps": 2}}}}]"#, "orders.json")?;
/// # let settings = Settings { orders, ..Settings::default() };
/// // A solver whose only state is its mesh, for so many cycles.
/// let run = |mut adaptor: Adaptor, points: &mut Vec<[f64; 3]>, cycles: std::ops::Range<u64>| {
///     for cycle in cycles {
///         let step = Step { cycle, time: 0.1 * cycle as f64, time_step: 0.1 };
///         let channel = Channel::new("fluid", MeshView::tets(&*points, &tets), &[]);
///         let steering = adaptor.execute(&step, &[channel]).unwrap();
///         if let Some(motion) = steering.motion {
///             points.copy_from_slice(&motion.coordinates);
///         }
///     }
///     adaptor
/// };
/// let mut whole = mesh.points().to_vec();
/// run(settings.clone().start()?, &mut whole, 0..20);
///
/// let mut points = mesh.points().to_vec();
/// let mut adaptor = run(settings.clone().start()?, &mut points, 0..5);
/// let saved = (adaptor.checkpoint().to_bytes(), points.clone());
/// drop(adaptor);
///
/// // In another process, with the mesh as the solver has saved it:
/// let (bytes, mut points) = saved;
/// let again = settings.restart(Checkpoint::from_bytes(&bytes)?).start()?;
/// run(again, &mut points, 5..20);
/// assert_eq!(points, whole);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// Of several ranks each has a checkpoint of its own.
#[derive(Debug, Clone)]
pub struct Checkpoint {
    pub(crate) run: SavedRun,
    /// What the pipelines have come to.
    pub(crate) pipelines: Vec<u8>,
    /// The coordinates of the shapes, where there is a mesh that orders change.
    pub(crate) points: Option<SavedPoints>,
}

/// Why a checkpoint cannot be made, written, read, or gone on from.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The file cannot be read or written.
    #[error("the checkpoint {}: {source}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// It is something else.
    #[error("found something else than a checkpoint; expected one that tombolo wrote")]
    Other,
    /// It is of another version of the format.
    #[error("found a checkpoint of version {found}, expected {VERSION}")]
    Version {
        /// Its version.
        found: u32,
    },
    /// Bytes are missing.
    #[error(
        "the checkpoint ends after {found} bytes, expected {expected}: it was not written whole"
    )]
    Torn {
        /// How many there are.
        found: u64,
        /// How many there should be.
        expected: u64,
    },
    /// Its bytes are not those that were written.
    #[error("the checkpoint is damaged: {0}")]
    Damaged(String),
    /// It was made on another number of ranks.
    #[error("the checkpoint was made on {found} ranks, the run has {expected}; expected as many")]
    Ranks {
        /// The ranks of the run that made it.
        found: usize,
        /// Those of this one.
        expected: usize,
    },
    /// It is that of another rank, or the ranks have checkpoints of different moments.
    #[error(
        "rank {rank} was given the checkpoint of rank {of} after cycle {cycle}, rank 0 one after cycle {first_cycle}; \
         expected those of one moment, each of its own rank"
    )]
    OtherMoment {
        /// The rank.
        rank: usize,
        /// The rank that it was made on.
        of: usize,
        /// The cycle that it was made after.
        cycle: u64,
        /// That of rank 0's.
        first_cycle: u64,
    },
    /// The journal, which holds what was acknowledged after the checkpoint, cannot be read.
    #[error("the journal {}, which holds what was accepted after the checkpoint: {reason}", file.display())]
    Journal {
        /// The file.
        file: PathBuf,
        /// Why not.
        reason: String,
    },
    /// Something is wrong on one rank. All ranks have this error.
    #[error(transparent)]
    Rank(#[from] RankError),
}

impl From<Garbled> for CheckpointError {
    fn from(_: Garbled) -> Self {
        CheckpointError::Damaged("its parts do not go together".into())
    }
}

impl Checkpoint {
    /// The cycle of the call that began the step after which the run goes on; `None` where there was
    /// no call yet.
    #[must_use]
    pub fn cycle(&self) -> Option<u64> {
        self.run.has_begun.then_some(self.run.cycle)
    }

    /// As bytes: a version, a length and a checksum are among them. It takes as long as it takes to
    /// copy the coordinates, and may be done on another thread.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let points = self.points.as_ref();
        let mut held = Writer::default();
        held.bytes(&serde_json::to_vec(&self.run).unwrap_or_default());
        held.bytes(&self.pipelines);
        held.u8(points.is_some().into());
        points.into_iter().for_each(|points| points.write(&mut held));
        let held = held.into_bytes();
        let mut bytes = Vec::with_capacity(HEAD + held.len() + 4);
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((held.len() as u64).to_le_bytes());
        bytes.extend(&held);
        bytes.extend(crc32fast::hash(&held).to_le_bytes());
        bytes
    }

    /// Reads what [`Checkpoint::to_bytes`] made. It takes no more memory than a small multiple of the
    /// bytes.
    ///
    /// # Errors
    /// [`CheckpointError`] for anything else.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, CheckpointError> {
        let (head, rest) = bytes.split_at_checked(HEAD).ok_or(CheckpointError::Other)?;
        let length = length_of(head)?;
        let expected = length.saturating_add(4);
        let torn = || CheckpointError::Torn {
            found: bytes.len() as u64,
            expected: expected.saturating_add(HEAD as u64),
        };
        let first = usize::try_from(expected).ok().and_then(|length| rest.get(..length));
        let (held, checksum) = first.and_then(<[u8]>::split_last_chunk).ok_or_else(torn)?;
        if crc32fast::hash(held) != u32::from_le_bytes(*checksum) {
            return Err(CheckpointError::Damaged("its checksum is another".into()));
        }
        let mut reader = Reader::new(0, held);
        let run: SavedRun = serde_json::from_slice(reader.bytes()?)
            .map_err(|error| CheckpointError::Damaged(error.to_string()))?;
        if rest.len() as u64 != expected {
            // The checkpoints of other ranks follow in the same file.
            return Err(match run.ranks {
                found @ 2.. => CheckpointError::Ranks { found, expected: 1 },
                _ => torn(),
            });
        }
        let pipelines = reader.bytes()?.to_vec();
        let has_points = reader.u8()? != 0;
        let points = has_points.then(|| SavedPoints::read(&mut reader)).transpose()?;
        if !reader.is_empty() {
            return Err(Garbled { rank: 0 }.into());
        }
        Ok(Self { run, pipelines, points })
    }

    /// Writes it to a file of its own, which holds the whole of it or is not there: under another
    /// name first, and under its own once it is on disk. On several ranks there is
    /// [`Adaptor::write_checkpoint`](crate::Adaptor::write_checkpoint).
    ///
    /// # Errors
    /// [`CheckpointError::File`].
    pub fn write(&self, file: impl AsRef<Path>) -> Result<(), CheckpointError> {
        let file = file.as_ref();
        let written = write_durably(file, |out| std::io::Write::write_all(out, &self.to_bytes()));
        written.map_err(|source| CheckpointError::File { file: file.into(), source })
    }

    /// Reads the file that [`Checkpoint::write`] has written.
    ///
    /// # Errors
    /// [`CheckpointError`].
    pub fn read(file: impl AsRef<Path>) -> Result<Self, CheckpointError> {
        let file = file.as_ref();
        let bytes = std::fs::read(file)
            .map_err(|source| CheckpointError::File { file: file.into(), source })?;
        Self::from_bytes(&bytes)
    }
}

/// The length of what a checkpoint with these first bytes holds.
fn length_of(head: &[u8]) -> Result<u64, CheckpointError> {
    let rest = head.strip_prefix(MAGIC).ok_or(CheckpointError::Other)?;
    let (version, length) = rest.split_first_chunk().ok_or(CheckpointError::Other)?;
    let length: [u8; 8] = length.try_into().map_err(|_| CheckpointError::Other)?;
    match u32::from_le_bytes(*version) {
        VERSION => Ok(u64::from_le_bytes(length)),
        found => Err(CheckpointError::Version { found }),
    }
}

/// Where a run goes on from.
#[derive(Debug, Clone)]
pub enum Restart {
    /// From a checkpoint, on several ranks each rank's own.
    Checkpoint(Box<Checkpoint>),
    /// From a file that [`Adaptor::write_checkpoint`](crate::Adaptor::write_checkpoint) has written.
    File(PathBuf),
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    fn checkpoint() -> Checkpoint {
        let reference: Arc<[_]> = vec![[0.0, -0.0, 1.5]; 3].into();
        let run = SavedRun { cycle: 7, ..SavedRun::default() };
        Checkpoint { run, pipelines: vec![1, 2, 3], points: Some(SavedPoints::new(&reference)) }
    }

    #[test]
    fn whatever_is_not_a_whole_checkpoint_is_refused() {
        let bytes = checkpoint().to_bytes();
        assert_eq!(Checkpoint::from_bytes(&bytes).unwrap().to_bytes(), bytes);
        for end in 0..bytes.len() {
            assert!(Checkpoint::from_bytes(&bytes[..end]).is_err(), "cut at {end}");
        }
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut flipped = bytes.clone();
                flipped[at] ^= 1 << bit;
                assert!(Checkpoint::from_bytes(&flipped).is_err(), "bit {bit} of byte {at}");
            }
        }
        // Lengths that lie, with a checksum that is right.
        let held = bytes.len() - 4;
        for at in (HEAD..held).step_by(4) {
            let mut lying = bytes.clone();
            lying[at..(at + 8).min(held)].fill(0xff);
            let checksum = crc32fast::hash(&lying[HEAD..held]);
            lying[held..].copy_from_slice(&checksum.to_le_bytes());
            let _ = Checkpoint::from_bytes(&lying);
        }
    }

    #[test]
    fn a_file_is_replaced_whole() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("run.checkpoint");
        std::fs::write(&file, "something else").unwrap();
        assert!(matches!(Checkpoint::read(&file), Err(CheckpointError::Other)));
        checkpoint().write(&file).unwrap();
        assert_eq!(Checkpoint::read(&file).unwrap().run.cycle, 7);
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
        let nowhere = directory.path().join("none/run.checkpoint");
        assert!(checkpoint().write(&nowhere).unwrap_err().to_string().contains("none"));
    }
}
