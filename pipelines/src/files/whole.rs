//! Files that are there whole or not at all.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::Path;

use super::error::{FileError, Flaw};

/// Writes a file under another name beside it, then renames it. Folders that are missing are made.
/// Several programs may do so at the same time.
pub(super) fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> Result<(), FileError> {
    let made = match path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
        Some(directory) => std::fs::create_dir_all(directory),
        None => Ok(()),
    };
    let ending = format!(".{}.part", std::process::id());
    made.and_then(|()| write_beside(path, &ending, write))
        .map_err(|error| Flaw::from(error).in_file(path))
}

/// Writes a file under its own name with a dot before and an ending behind it, then renames it.
fn write_beside(
    path: &Path,
    ending: &str,
    write: impl FnOnce(&mut File) -> io::Result<()>,
) -> io::Result<()> {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(ending);
    let beside = path.with_file_name(name);
    let written = File::create(&beside)
        .and_then(|mut file| write(&mut file))
        .and_then(|()| std::fs::rename(&beside, path));
    if written.is_err() {
        // The error that matters is the first; this only tidies up.
        let _ = std::fs::remove_file(&beside);
    }
    written
}

/// Writes a file that is there whole or not at all, also after a power failure: under another name
/// beside it, which is renamed once the file is on disk. One program writes it at a time: what one
/// that was killed has left is overwritten by the next.
///
/// ```
/// # let directory = tempfile::tempdir()?;
/// # let path = directory.path().join("state");
/// tombolo_pipelines::files::write_durably(&path, |out| out.write_all(b"step 400"))?;
/// assert_eq!(std::fs::read(&path)?, b"step 400");
/// # Ok::<(), std::io::Error>(())
/// ```
///
/// # Errors
/// The first error of writing; whatever was under this name before is then still there.
pub fn write_durably(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    write_beside(path, ".part", |file| {
        let mut out = BufWriter::new(&*file);
        write(&mut out)?;
        out.flush()?;
        drop(out);
        file.sync_all()
    })?;
    let directory = path.parent().filter(|directory| !directory.as_os_str().is_empty());
    // Not every file system can have a folder brought to disk; the file itself is there.
    let _ = File::open(directory.unwrap_or(Path::new("."))).and_then(|it| it.sync_all());
    Ok(())
}

/// Writes a file anew with an entry behind its first `length` bytes and a tail behind that.
pub(super) fn write_longer(
    path: &Path,
    length: u64,
    entry: &str,
    tail: &str,
) -> Result<(), FileError> {
    let old = File::open(path).map_err(|error| Flaw::from(error).in_file(path))?;
    write_whole(path, |new| {
        let copied = io::copy(&mut old.take(length), new)?;
        if copied < length {
            return Err(io::Error::other("it was cut short by another program"));
        }
        new.write_all(entry.as_bytes())?;
        new.write_all(tail.as_bytes())
    })
}
