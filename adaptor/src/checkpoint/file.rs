//! Files of checkpoints: those of all ranks one after the other, written whole or not at all.

use std::{
    fs::File,
    io::{self, Read},
    path::Path,
};

use tombolo_deform::communicator::{Communicator, agree};
use tombolo_pipelines::files::write_durably;

use super::{Checkpoint, CheckpointError, HEAD, length_of};

/// Writes the checkpoints of all ranks to one file, rank 0 one after the other as they come.
/// Collective.
///
/// # Errors
/// [`CheckpointError`], the same on all ranks.
pub(crate) fn write_of_ranks(
    communicator: &dyn Communicator,
    file: &Path,
    mine: &Checkpoint,
) -> Result<(), CheckpointError> {
    let (rank, size) = (communicator.rank(), communicator.size());
    if size == 1 {
        return mine.write(file);
    }
    let mut written = Ok(());
    if rank > 0 {
        (1..size).for_each(|of| {
            let message = if of == rank { vec![(0, mine.to_bytes())] } else { Vec::new() };
            communicator.exchange_with(message, &[]);
        });
    } else {
        let mut turn = 0;
        let mut next = || {
            turn += 1;
            communicator.exchange_with(Vec::new(), &[turn]).pop().map(|(_, bytes)| bytes)
        };
        written = write_durably(file, |out| {
            out.write_all(&mine.to_bytes())?;
            (1..size).try_for_each(|_| out.write_all(&next().unwrap_or_default()))
        });
        // The others send what they have also where the disk is full.
        while turn + 1 < size {
            turn += 1;
            communicator.exchange_with(Vec::new(), &[turn]);
        }
    }
    let written = written.map_err(|source| CheckpointError::File { file: file.into(), source });
    Ok(agree(communicator, written)?)
}

/// Reads the file that [`write_of_ranks`] wrote: rank 0 does, and hands each rank its own.
/// Collective.
///
/// # Errors
/// [`CheckpointError`], the same on all ranks.
pub(crate) fn read_of_ranks(
    communicator: &dyn Communicator,
    file: &Path,
) -> Result<Checkpoint, CheckpointError> {
    let (rank, size) = (communicator.rank(), communicator.size());
    if size == 1 {
        return Checkpoint::read(file);
    }
    if rank > 0 {
        let mut mine = Vec::new();
        for of in 1..size {
            let from: &[usize] = if of == rank { &[0] } else { &[] };
            mine.extend(communicator.exchange_with(Vec::new(), from).pop());
        }
        let bytes = mine.pop().map(|(_, bytes)| bytes).unwrap_or_default();
        // What rank 0 could not read it says itself.
        agree(communicator, Ok::<(), CheckpointError>(()))?;
        return Ok(agree(communicator, Checkpoint::from_bytes(&bytes))?);
    }
    let error = |source| CheckpointError::File { file: file.into(), source };
    let mut parts =
        File::open(file).map_err(error).map(|file| Parts { file, read: 0, ranks: size });
    let mut fault = None;
    let mut next = || {
        let part = match &mut parts {
            Ok(parts) => parts.next(),
            Err(_) => return Vec::new(),
        };
        match part {
            Ok(bytes) => bytes,
            Err(PartError::Read(source)) => {
                fault.get_or_insert(error(source));
                Vec::new()
            }
            Err(PartError::Head(other)) => {
                fault.get_or_insert(other);
                Vec::new()
            }
        }
    };
    let mine = next();
    for of in 1..size {
        communicator.exchange_with(vec![(of, next())], &[]);
    }
    let read = parts.map(drop).and(fault.map_or(Ok(()), Err));
    agree(communicator, read)?;
    Ok(agree(communicator, Checkpoint::from_bytes(&mine))?)
}

/// The checkpoints in a file.
struct Parts {
    file: File,
    /// How many have been read.
    read: usize,
    /// How many there should be.
    ranks: usize,
}

enum PartError {
    Read(io::Error),
    Head(CheckpointError),
}

impl From<io::Error> for PartError {
    fn from(error: io::Error) -> Self {
        PartError::Read(error)
    }
}

impl Parts {
    /// The bytes of the next; no more than the file has.
    fn next(&mut self) -> Result<Vec<u8>, PartError> {
        let mut bytes = Vec::new();
        Read::by_ref(&mut self.file).take(HEAD as u64).read_to_end(&mut bytes)?;
        if bytes.is_empty() && self.read > 0 {
            let (found, expected) = (self.read, self.ranks);
            return Err(PartError::Head(CheckpointError::Ranks { found, expected }));
        }
        if bytes.len() < HEAD {
            return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
        }
        self.read += 1;
        let length = length_of(&bytes).map_err(PartError::Head)?;
        Read::by_ref(&mut self.file).take(length.saturating_add(4)).read_to_end(&mut bytes)?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use tombolo_deform::communicator::threads;

    use super::super::SavedRun;
    use super::*;

    fn of(rank: usize, ranks: usize) -> Checkpoint {
        let run = SavedRun { cycle: 3, rank, ranks, ..SavedRun::default() };
        Checkpoint { run, pipelines: vec![0; 1000 * rank], points: None }
    }

    #[test]
    fn each_rank_reads_what_it_wrote() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("of-three");
        let ranks = threads::run(3, |ranks| {
            write_of_ranks(&ranks, &file, &of(ranks.rank(), 3)).unwrap();
            read_of_ranks(&ranks, &file).unwrap().run.rank
        });
        assert_eq!(ranks, [0, 1, 2]);
        let whole = std::fs::read(&file).unwrap();
        for end in [0, 10, 50, whole.len() - 1] {
            let torn = directory.path().join("torn");
            std::fs::write(&torn, &whole[..end]).unwrap();
            let errors =
                threads::run(3, |ranks| read_of_ranks(&ranks, &torn).unwrap_err().to_string());
            assert!(errors.iter().all(|error| *error == errors[0]), "{errors:?}");
        }
        let wrong_ranks = |ranks: usize| {
            let told =
                threads::run(ranks, |ranks| read_of_ranks(&ranks, &file).unwrap_err().to_string());
            assert!(told.iter().all(|error| error.contains("made on 3 ranks")), "{told:?}");
        };
        wrong_ranks(1);
        wrong_ranks(4);
        let nowhere = directory.path().join("none/of-three");
        let errors = threads::run(3, |ranks| {
            write_of_ranks(&ranks, &nowhere, &of(ranks.rank(), 3)).unwrap_err().to_string()
        });
        assert!(errors.iter().all(|error| error.contains("none")), "{errors:?}");
    }
}
