//! The files of extracts: which of them stay, and the series that name them.

use std::{
    collections::{HashMap, VecDeque},
    num::NonZeroU32,
    path::{Component, Path, PathBuf},
    sync::Arc,
};

use tombolo_pipelines::files::{self, FileError, Series};

/// The series that a file belongs to.
pub(crate) struct Membership {
    pub(crate) series: PathBuf,
    /// How many files of the series stay, where not all do.
    pub(crate) keep: Option<NonZeroU32>,
}

/// The series of a run.
pub(super) struct AllSeries {
    /// By the pipeline that writes the files, and the series that it asked for.
    known: HashMap<(Arc<str>, PathBuf), Known>,
    /// The simulated time of the checkpoint that the run went on from: a series that is there from
    /// before goes on.
    since: Option<f64>,
}

struct Known {
    path: PathBuf,
    files: Files,
}

/// The files of a series.
enum Files {
    All(Series),
    Newest(Newest),
}

/// The newest files of a series, of which the others are deleted.
#[derive(Default)]
struct Newest {
    /// The files that the series names, the oldest first.
    named: VecDeque<(PathBuf, f64)>,
    /// The files of the run before that came after the checkpoint. They are not named, and are the
    /// first to go.
    undone: VecDeque<PathBuf>,
}

impl AllSeries {
    pub(super) fn new(since: Option<f64>) -> Self {
        Self { known: HashMap::new(), since }
    }

    /// Adds a file that has been written, and deletes those that no longer stay.
    pub(super) fn add(
        &mut self,
        pipeline: &Arc<str>,
        membership: &Membership,
        file: &Path,
        time: f64,
    ) -> Result<(), FileError> {
        let Membership { series, keep } = membership;
        let key = (Arc::clone(pipeline), series.clone());
        if !self.known.contains_key(&key) {
            let path = self.free(series);
            let files = Files::begin(&path, *keep, self.since)?;
            self.known.insert(key.clone(), Known { path, files });
        }
        let Some(Known { path, files }) = self.known.get_mut(&key) else { return Ok(()) };
        let gone = files.add(path, *keep, file, time)?;
        let directory = path.parent().unwrap_or(Path::new("")).to_path_buf();
        let is_named = |file: &Path| self.known.values().any(|known| known.files.names(file));
        let gone = gone.into_iter().filter(|file| !is_named(file));
        // One that cannot be deleted does not keep the others.
        gone.map(|file| remove(&file, &directory)).fold(Ok(()), Result::and)
    }

    /// The path of a series, or another where a pipeline of a similar name has that.
    fn free(&self, series: &Path) -> PathBuf {
        let mut path = series.to_path_buf();
        while self.known.values().any(|known| known.path == path) {
            let mut name = path.file_stem().unwrap_or_default().to_owned();
            name.push("_.pvd");
            path.set_file_name(name);
        }
        path
    }
}

/// Whether a file lies in a directory or in one below it.
fn is_below(directory: &Path, file: &Path) -> bool {
    let mut below = file.strip_prefix(directory).into_iter().flat_map(Path::components).peekable();
    below.peek().is_some() && below.all(|component| matches!(component, Component::Normal(_)))
}

impl Files {
    fn begin(path: &Path, keep: Option<NonZeroU32>, since: Option<f64>) -> Result<Self, FileError> {
        match (keep, since) {
            (None, None) => Series::create(path).map(Self::All),
            (None, Some(since)) => {
                let before = Series::entries(path)?.filter(|(time, _)| *time <= since);
                Series::of(path, before).map(Self::All)
            }
            (Some(_), None) => Ok(Self::Newest(Newest::default())),
            (Some(keep), Some(since)) => {
                let most = keep.get() as usize;
                let directory = path.parent().unwrap_or(Path::new(""));
                // Whoever wrote it, nothing elsewhere is deleted.
                let found = Series::entries(path)?.filter(|(_, file)| is_below(directory, file));
                let found: Vec<_> = found.take(most.saturating_add(1)).collect();
                // More than are kept: they were written when all were to stay, and do.
                if found.len() > most {
                    return Ok(Self::Newest(Newest::default()));
                }
                let (before, after): (Vec<_>, Vec<_>) =
                    found.into_iter().partition(|(time, _)| *time <= since);
                Ok(Self::Newest(Newest {
                    named: before.into_iter().map(|(time, file)| (file, time)).collect(),
                    undone: after.into_iter().map(|(_, file)| file).collect(),
                }))
            }
        }
    }

    /// Adds a file; the files that do not stay.
    fn add(
        &mut self,
        path: &Path,
        keep: Option<NonZeroU32>,
        file: &Path,
        time: f64,
    ) -> Result<Vec<PathBuf>, FileError> {
        match keep {
            None => {
                if let Self::Newest(newest) = self {
                    // The pipeline was replaced: from now on all stay.
                    *self = Self::All(Series::of(path, newest.named())?);
                }
                if let Self::All(series) = self {
                    series.push(time, file)?;
                }
                Ok(Vec::new())
            }
            Some(keep) => {
                if matches!(self, Self::All(_)) {
                    // The pipeline was replaced: what it wrote before all stays.
                    *self = Self::Newest(Newest::default());
                }
                match self {
                    Self::Newest(newest) => newest.add(path, keep.get() as usize, file, time),
                    Self::All(_) => Ok(Vec::new()),
                }
            }
        }
    }

    /// Whether a file is among those that stay for now.
    fn names(&self, file: &Path) -> bool {
        match self {
            Self::All(_) => false,
            Self::Newest(newest) => newest.named.iter().any(|(named, _)| named == file),
        }
    }
}

impl Newest {
    fn named(&self) -> impl Iterator<Item = (f64, &PathBuf)> {
        self.named.iter().map(|(file, time)| (*time, file))
    }

    fn add(
        &mut self,
        path: &Path,
        keep: usize,
        file: &Path,
        time: f64,
    ) -> Result<Vec<PathBuf>, FileError> {
        self.undone.retain(|other| other != file);
        self.named.retain(|(other, _)| other != file);
        self.named.push_back((file.to_path_buf(), time));
        let surplus = (self.named.len() + self.undone.len()).saturating_sub(keep);
        let undone = surplus.min(self.undone.len());
        let named = surplus - undone;
        // First the series, which never names a file that is not there. Where it cannot be written
        // nothing is deleted, and the next file makes up for it.
        Series::of(path, self.named().skip(named))?;
        let gone = self.named.drain(..named).map(|(file, _)| file);
        Ok(self.undone.drain(..undone).chain(gone).collect())
    }
}

/// Deletes a file, and the folders below the directory that it leaves empty.
fn remove(file: &Path, directory: &Path) -> Result<(), FileError> {
    files::remove(file)?;
    let folders = file.ancestors().skip(1);
    let below = folders.take_while(|it| *it != directory && it.starts_with(directory));
    // What somebody else has put there stays.
    below.map(std::fs::remove_dir).take_while(Result::is_ok).for_each(drop);
    Ok(())
}
