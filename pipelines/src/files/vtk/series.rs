//! Collections of files over time (.pvd), as ParaView opens them.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::super::error::FileError;
use super::super::whole::{write_longer, write_whole};

const HEAD: &str = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n<Collection>\n";
const TAIL: &str = "</Collection>\n</VTKFile>\n";

/// A .pvd file that grows by one entry at a time.
///
/// Whenever a run is killed, the file on disk is whole: each change is written beside it and takes
/// its place in one step. The memory used does not grow with the number of entries.
///
/// ```no_run
/// # use std::path::Path;
/// # fn main() -> Result<(), tombolo_pipelines::files::FileError> {
/// let mut series = tombolo_pipelines::files::Series::create(Path::new("out/flow.pvd"))?;
/// series.push(0.001, Path::new("out/flow-1.vtu"))?;
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Series {
    path: PathBuf,
    /// Bytes of the file up to its closing tags.
    length: u64,
}

impl Series {
    /// An empty series in place of what was there.
    ///
    /// # Errors
    /// [`FileError`] where the file cannot be written.
    pub fn create(path: &Path) -> Result<Self, FileError> {
        write_whole(path, |file| {
            file.write_all(HEAD.as_bytes())?;
            file.write_all(TAIL.as_bytes())
        })?;
        Ok(Self { path: path.to_path_buf(), length: HEAD.len() as u64 })
    }

    /// A series of these files, with their times, in place of what was there.
    ///
    /// # Errors
    /// As [`create`](Self::create).
    pub fn of<'a>(
        path: &Path,
        files: impl Iterator<Item = (f64, &'a Path)>,
    ) -> Result<Self, FileError> {
        let directory = path.parent().unwrap_or(Path::new(""));
        let mut text = HEAD.to_owned();
        files.for_each(|(time, file)| text.push_str(&entry(directory, time, file)));
        write_whole(path, |new| {
            new.write_all(text.as_bytes())?;
            new.write_all(TAIL.as_bytes())
        })?;
        Ok(Self { path: path.to_path_buf(), length: text.len() as u64 })
    }

    /// The path of the series.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Adds a file that shows the state at this time. The entry is relative to the series where the
    /// file lies beside or below it.
    ///
    /// # Errors
    /// [`FileError`] where the series cannot be read back or written.
    pub fn push(&mut self, time: f64, file: &Path) -> Result<(), FileError> {
        let directory = self.path.parent().unwrap_or(Path::new(""));
        let entry = entry(directory, time, file);
        write_longer(&self.path, self.length, &entry, TAIL)?;
        self.length += entry.len() as u64;
        Ok(())
    }
}

/// The line of a file.
fn entry(directory: &Path, time: f64, file: &Path) -> String {
    let shown = file.strip_prefix(directory).unwrap_or(file).to_string_lossy();
    let shown = quick_xml::escape::escape(shown.as_ref());
    format!("<DataSet timestep=\"{time}\" part=\"0\" file=\"{shown}\"/>\n")
}
