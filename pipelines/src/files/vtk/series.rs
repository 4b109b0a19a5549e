//! Collections of files over time (.pvd), as ParaView opens them.

use std::fs::File;
use std::io::{BufRead as _, BufReader, BufWriter, Read as _, Write as _};
use std::path::{Component, Path, PathBuf, absolute};

use super::super::error::{FileError, Flaw};
use super::super::whole::{write_longer, write_whole};

const HEAD: &str = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n<Collection>\n";
const TAIL: &str = "</Collection>\n</VTKFile>\n";
/// Bytes of a series that are read back.
const MOST: u64 = 1 << 30;

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
    /// The file of the last entry, and the bytes before that entry.
    last: Option<(PathBuf, u64)>,
}

impl Series {
    /// An empty series in place of what was there.
    ///
    /// # Errors
    /// [`FileError`] where the file cannot be written.
    pub fn create(path: &Path) -> Result<Self, FileError> {
        Self::of(path, std::iter::empty::<(f64, &Path)>())
    }

    /// A series of these files, with their times, in place of what was there.
    ///
    /// # Errors
    /// As [`create`](Self::create).
    pub fn of<Name: AsRef<Path>>(
        path: &Path,
        files: impl Iterator<Item = (f64, Name)>,
    ) -> Result<Self, FileError> {
        let directory = path.parent().unwrap_or(Path::new(""));
        let mut series = Self { path: path.to_path_buf(), length: HEAD.len() as u64, last: None };
        write_whole(path, |new| {
            let mut out = BufWriter::new(new);
            out.write_all(HEAD.as_bytes())?;
            for (time, file) in files {
                let entry = entry(directory, time, file.as_ref());
                out.write_all(entry.as_bytes())?;
                series.last = Some((file.as_ref().to_path_buf(), series.length));
                series.length += entry.len() as u64;
            }
            out.write_all(TAIL.as_bytes())?;
            out.flush()
        })?;
        Ok(series)
    }

    /// The files that a series on disk names, with their times, in its order; none where it is not
    /// there. Lines are passed over that are not as they are written here.
    ///
    /// # Errors
    /// [`FileError`] where a file is there and cannot be opened.
    pub fn entries(path: &Path) -> Result<impl Iterator<Item = (f64, PathBuf)> + use<>, FileError> {
        let file = match File::open(path) {
            Ok(file) => Some(file),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => None,
            Err(error) => return Err(Flaw::from(error).in_file(path)),
        };
        let directory = path.parent().unwrap_or(Path::new("")).to_path_buf();
        let lines = file.into_iter().flat_map(|file| BufReader::new(file.take(MOST)).lines());
        Ok(lines.map_while(Result::ok).filter_map(move |line| parse(&directory, &line)))
    }

    /// The path of the series.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Adds a file that shows the state at this time, in place of the last entry where that names
    /// the same file. The entry is relative to the series, so that they can be moved together.
    ///
    /// # Errors
    /// [`FileError`] where the series cannot be read back or written.
    pub fn push(&mut self, time: f64, file: &Path) -> Result<(), FileError> {
        let directory = self.path.parent().unwrap_or(Path::new(""));
        let entry = entry(directory, time, file);
        let before = match &self.last {
            Some((last, before)) if last == file => *before,
            _ => self.length,
        };
        write_longer(&self.path, before, &entry, TAIL)?;
        self.last = Some((file.to_path_buf(), before));
        self.length = before + entry.len() as u64;
        Ok(())
    }
}

/// The line of a file.
fn entry(directory: &Path, time: f64, file: &Path) -> String {
    let shown = relative(directory, file);
    let shown = shown.to_string_lossy();
    let shown = quick_xml::escape::escape(shown.as_ref());
    format!("<DataSet timestep=\"{time}\" part=\"0\" file=\"{shown}\"/>\n")
}

/// The time and the file of a line.
fn parse(directory: &Path, line: &str) -> Option<(f64, PathBuf)> {
    let rest = line.strip_prefix("<DataSet timestep=\"")?;
    let (time, rest) = rest.split_once('"')?;
    let (_, rest) = rest.split_once("file=\"")?;
    let (file, _) = rest.split_once('"')?;
    let file = quick_xml::escape::unescape(file).ok()?;
    Some((time.parse().ok()?, directory.join(&*file)))
}

/// A file as it is found from a directory: with `..` where it does not lie below that, and whole
/// where its place could not be told from there.
fn relative(directory: &Path, file: &Path) -> PathBuf {
    if let Ok(below) = file.strip_prefix(directory) {
        return below.to_path_buf();
    }
    let here = Path::new(".");
    let directory = if directory.as_os_str().is_empty() { here } else { directory };
    let (Ok(from), Ok(to)) = (absolute(directory), absolute(file)) else { return file.into() };
    let mut both = from.components().chain(to.components());
    let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    // What a link leads to may lie above or below what `..` says.
    if common == 0 || both.any(|component| component == Component::ParentDir) {
        return to;
    }
    let up = from.components().skip(common).map(|_| Component::ParentDir);
    up.chain(to.components().skip(common)).collect()
}
