//! The file of a journal: locked, continued, and never with a torn line in its midst.

use std::{
    fs::{File, OpenOptions, TryLockError},
    io::{self, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use tombolo_pipelines::language::is_journal;

use super::JournalError;

/// Bytes that are read of a file to find out what it is.
const BEGINNING: u64 = 64 << 10;
/// Bytes that are read at once in the search for the last whole line.
const BLOCK: u64 = 64 << 10;

/// Somewhere to write lines to.
pub(super) trait Append: Send + 'static {
    /// Writes whole lines and returns once they are on disk. Where that fails none of them is known
    /// to be there, and the next call cuts off what may be.
    fn append(&mut self, lines: &[u8]) -> io::Result<()>;

    /// The name of the file.
    fn path(&self) -> &Path;
}

/// The file. It is locked as long as this lives.
#[derive(Debug)]
pub(super) struct Store {
    path: PathBuf,
    file: File,
    /// Where the last line ends that is known to be on disk.
    end: u64,
    /// Whether bytes behind that may have been written.
    is_torn: bool,
}

impl Store {
    /// Opens a file to go on at its end, or makes one, and the directory for it where there is none.
    /// A line that a killed run left half-written is cut off.
    pub(super) fn open(path: &Path) -> Result<Self, JournalError> {
        let error = |source| JournalError::Write { path: path.into(), source };
        let directory = path.parent().filter(|directory| !directory.as_os_str().is_empty());
        if let Some(directory) = directory {
            std::fs::create_dir_all(directory).map_err(error)?;
        }
        let mut options = OpenOptions::new();
        let mut file = options
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(error)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(JournalError::InUse { path: path.into() }),
            // Some file systems have no locks; a journal there is still better than none.
            Err(TryLockError::Error(reason)) => {
                let path = path.display();
                tracing::warn!(%path, "the journal {path} cannot be locked: {reason}");
            }
        }
        let mut length = file.metadata().map_err(error)?.len();
        if length > 0 && is_blank(&mut file).map_err(error)? {
            let path = path.display();
            tracing::warn!(%path, "the journal {path} held nothing but zeros, as after a loss of power, and begins anew");
            file.set_len(0).map_err(error)?;
            length = 0;
        }
        // A device such as /dev/full has no length and cannot be cut.
        if length > 0 {
            if !is_journal(&beginning(&mut file, length).map_err(error)?) {
                return Err(JournalError::OtherFile { path: path.into() });
            }
            let end = end_of_lines(&mut file, length).map_err(error)?;
            if end < length {
                let path = path.display();
                tracing::warn!(
                    %path,
                    "the last line of the journal {path} was half-written and is cut off"
                );
                file.set_len(end).map_err(error)?;
            }
            return Ok(Self { path: path.into(), file, end, is_torn: false });
        }
        if let Some(directory) = directory {
            // So that the new file is still there after a power failure, where that can be had.
            let _ = File::open(directory).and_then(|directory| directory.sync_all());
        }
        Ok(Self { path: path.into(), file, end: 0, is_torn: false })
    }
}

impl Append for Store {
    fn append(&mut self, lines: &[u8]) -> io::Result<()> {
        if std::mem::replace(&mut self.is_torn, true) {
            self.file.set_len(self.end)?;
        }
        self.file.seek(SeekFrom::Start(self.end))?;
        self.file.write_all(lines)?;
        self.file.sync_data()?;
        self.end += lines.len() as u64;
        self.is_torn = false;
        Ok(())
    }

    fn path(&self) -> &Path {
        &self.path
    }
}

/// Whether a file holds nothing but zeros: some file systems keep the length of what they have lost.
fn is_blank(file: &mut File) -> io::Result<bool> {
    let mut block = vec![0; BLOCK as usize];
    file.seek(SeekFrom::Start(0))?;
    loop {
        match file.read(&mut block)? {
            0 => return Ok(true),
            count if block.iter().take(count).any(|&byte| byte != 0) => return Ok(false),
            _ => {}
        }
    }
}

/// The first lines of a file as text.
fn beginning(file: &mut File, length: u64) -> io::Result<String> {
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(0))?;
    Read::by_ref(file).take(length.min(BEGINNING)).read_to_end(&mut bytes)?;
    if let Some(end) = bytes.iter().position(|&byte| byte == b'\n') {
        bytes.truncate(end + 1);
    } else if length > BEGINNING {
        // The first line is longer: an order of another version, or no journal. Its start tells.
        let start = String::from_utf8_lossy(&bytes);
        return Ok(start.chars().take(16).collect());
    }
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Where the last whole line ends.
fn end_of_lines(file: &mut File, length: u64) -> io::Result<u64> {
    let mut to = length;
    let mut block = Vec::new();
    while to > 0 {
        let from = to.saturating_sub(BLOCK);
        block.clear();
        file.seek(SeekFrom::Start(from))?;
        Read::by_ref(file).take(to - from).read_to_end(&mut block)?;
        if let Some(last) = block.iter().rposition(|&byte| byte == b'\n') {
            return Ok(from + last as u64 + 1);
        }
        to = from;
    }
    Ok(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_torn_tail_is_cut_off_and_the_file_goes_on() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("deeper/journal.jsonl");
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let whole = "{\"end\":{\"cycle\":1,\"time\":0.1}}\n";
        for torn in ["", "{\"id\":\"o1\",\"sta", &"x".repeat(200_000)] {
            std::fs::write(&path, format!("{whole}{torn}")).unwrap();
            let mut store = Store::open(&path).unwrap();
            store.append(whole.as_bytes()).unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), whole.repeat(2));
        }
        std::fs::write(&path, "{\"id\":\"o1\",\"sta").unwrap();
        let store = Store::open(&path).unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().len(), 0);
        assert!(matches!(Store::open(&path), Err(JournalError::InUse { .. })));
        drop(store);
        Store::open(&path).unwrap();
    }

    /// A loss of power leaves zeros where a file was made longer and its data had not come to the disk.
    #[test]
    fn zeros_are_what_a_loss_of_power_left() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("journal.jsonl");
        let whole = "{\"end\":{\"cycle\":1,\"time\":0.1}}\n";
        for (before, kept) in [("", 0), (whole, 1)] {
            for zeros in [1, 4096, 200_000] {
                std::fs::write(&path, format!("{before}{}", "\0".repeat(zeros))).unwrap();
                let mut store = Store::open(&path).unwrap();
                store.append(whole.as_bytes()).unwrap();
                assert_eq!(std::fs::read_to_string(&path).unwrap(), whole.repeat(kept + 1));
            }
        }
    }

    #[test]
    fn a_file_of_something_else_is_left_alone() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("results.csv");
        for text in
            ["cycle,time\n1,0.1\n", "{\"version\": 1}", "half a line", "{\"run\": 3", "\0\0other"]
        {
            std::fs::write(&path, text).unwrap();
            assert!(matches!(Store::open(&path), Err(JournalError::OtherFile { .. })), "{text}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
    }
}
