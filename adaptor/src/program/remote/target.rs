//! The run that a task is to reach: a link, or a file that leads to one.

use std::{
    fs::File,
    io::{BufRead, BufReader, ErrorKind, Read},
    path::{Path, PathBuf},
};

use clap::Args;

use crate::{
    client::{Link, LinkError},
    link::BEGINNINGS,
    stream::told_in,
};

/// Bytes that are read of a file.
const FILE: u64 = 1 << 28;

#[derive(Debug, Args)]
pub(crate) struct Target {
    /// A link to the run, or a file that leads to it: the run's file of links, or its output, which
    /// tells where that is
    link: String,
    /// Print one JSON object in each line: the messages of the protocol
    #[arg(long)]
    pub(crate) json: bool,
}

/// Why nothing leads to a run.
#[derive(Debug, PartialEq, thiserror::Error)]
pub(crate) enum TargetError {
    #[error(transparent)]
    Link(#[from] LinkError),
    #[error(
        "there is no file {}, and it is no link; expected http://HOST:PORT/?token=TOKEN or a run's file of links, which goes when the run ends", path.display()
    )]
    Gone { path: PathBuf },
    #[error(
        "{} says that the links are in {}, which is not there; a run takes its file of links away when it ends",
        log.display(),
        path.display()
    )]
    Ended { log: PathBuf, path: PathBuf },
    #[error("the file {} cannot be read: {reason}", path.display())]
    Unreadable { path: PathBuf, reason: String },
    #[error("{} is a folder, expected a link or a run's file of links", path.display())]
    Folder { path: PathBuf },
    #[error("the file {} holds no link, and does not tell where the links are", path.display())]
    NoLink { path: PathBuf },
    #[error(
        "{} says that the links are in {}, which others can use too: found the permissions {mode:o}, expected 600",
        log.display(),
        path.display()
    )]
    Open { log: PathBuf, path: PathBuf, mode: u32 },
}

/// The outcome of reading a file for links.
enum Found {
    Link(Link),
    /// The file of links of the last run that has told one.
    File(PathBuf),
}

impl Target {
    /// The link to the run.
    pub(super) fn link(&self) -> Result<Link, TargetError> {
        read_link(&self.link)
    }
}

fn read_link(text: &str) -> Result<Link, TargetError> {
    if text.contains("://") || text.starts_with("unix:") {
        return Ok(text.parse()?);
    }
    let log = Path::new(text);
    if is_missing(log)? {
        return Err(match text.parse::<Link>() {
            Err(error) if is_address(text) => error.into(),
            _ => TargetError::Gone { path: log.into() },
        });
    }
    if log.is_dir() {
        return Err(TargetError::Folder { path: log.into() });
    }
    let path = match find(log, open(log)?)? {
        Found::Link(link) => return Ok(link),
        // As the run has told it, from where its output lies.
        Found::File(path) => log.parent().unwrap_or(Path::new("")).join(path),
    };
    if is_missing(&path)? {
        return Err(TargetError::Ended { log: log.into(), path });
    }
    let file = open(&path)?;
    if let Some(mode) = mode(&file).filter(|mode| mode & 0o077 != 0) {
        return Err(TargetError::Open { log: log.into(), path, mode });
    }
    match find(&path, file)? {
        Found::Link(link) => Ok(link),
        Found::File(_) => Err(TargetError::NoLink { path }),
    }
}

/// Whether there is no such file. One in a folder that may not be entered is there for all that is
/// known.
fn is_missing(path: &Path) -> Result<bool, TargetError> {
    let unreadable = |error: std::io::Error| TargetError::Unreadable {
        path: path.into(),
        reason: error.to_string(),
    };
    match std::fs::metadata(path) {
        Ok(_) => Ok(false),
        Err(error) if error.kind() == ErrorKind::PermissionDenied => Err(unreadable(error)),
        Err(_) => Ok(true),
    }
}

/// Whether a text is meant as a host and port.
fn is_address(text: &str) -> bool {
    let place = text.split(['/', '?']).next().unwrap_or_default();
    place.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok())
}

fn unreadable(path: &Path, error: &std::io::Error) -> TargetError {
    TargetError::Unreadable { path: path.into(), reason: error.to_string() }
}

fn open(path: &Path) -> Result<File, TargetError> {
    File::open(path).map_err(|error| unreadable(path, &error))
}

/// Who may do what with a file.
#[cfg(unix)]
fn mode(file: &File) -> Option<u32> {
    use std::os::unix::fs::PermissionsExt;
    file.metadata().ok().map(|metadata| metadata.permissions().mode() & 0o777)
}

#[cfg(not(unix))]
fn mode(_: &File) -> Option<u32> {
    None
}

/// Looks through a file for its first link; without one, for the file that the last run names whose
/// output it is.
fn find(path: &Path, file: File) -> Result<Found, TargetError> {
    let mut lines = BufReader::new(file.take(FILE));
    let (mut told, mut wrong, mut line) = (None, None, Vec::new());
    loop {
        line.clear();
        let count = lines.read_until(b'\n', &mut line).map_err(|error| unreadable(path, &error))?;
        if count == 0 {
            break;
        }
        let line = String::from_utf8_lossy(&line);
        if let Some(path) = told_in(&line) {
            told = Some(path.into());
        }
        // Without a secret it is the address of something that is written of.
        let is_link = |word: &&str| {
            word.contains('?') && BEGINNINGS.iter().any(|begin| word.starts_with(begin))
        };
        for word in line.split_whitespace().filter(is_link) {
            match word.parse() {
                Ok(link) => return Ok(Found::Link(link)),
                Err(error) => _ = wrong.get_or_insert(error),
            }
        }
    }
    match (told, wrong) {
        (Some(path), _) => Ok(Found::File(path)),
        (None, Some(error)) => Err(error.into()),
        (None, None) => Err(TargetError::NoLink { path: path.into() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    fn give(path: &Path, text: &str, mode: u32) {
        use std::os::unix::fs::PermissionsExt;
        std::fs::write(path, text).expect("written");
        let permissions = std::fs::Permissions::from_mode(mode);
        std::fs::set_permissions(path, permissions).expect("given");
    }

    #[test]
    #[cfg(unix)]
    fn the_output_of_a_run_leads_to_its_file_of_links_alone() {
        let directory = tempfile::tempdir().expect("a folder");
        let at = |name: &str| directory.path().join(name);
        let read = |name: &str| read_link(at(name).to_str().expect("a path"));
        let links =
            "drive: http://127.0.0.1:7070/?token=d\nwatch: http://127.0.0.1:7070/?token=w\n";
        give(&at("tombolo 7070.link"), links, 0o600);
        let whole = format!(
            "see https://example.org/\nthe links to this run are in /gone.link\nstep 1\n[0] the links to this run are in {}\r\nstep 2",
            at("tombolo 7070.link").display()
        );
        give(&at("run.log"), &whole, 0o644);
        assert_eq!(read("run.log").map(|link| link.token().to_owned()), Ok("d".into()));
        let near = "open http://127.0.0.1:7070/?key=k\nIt opens one browser, once; links for others, and to watch only, are in tombolo 7070.link\n";
        give(&at("near.log"), near, 0o644);
        assert_eq!(read("near.log").map(|link| link.token().to_owned()), Ok("d".into()));
        // A second file is not followed, and none that others could have written or can read.
        give(&at("far.log"), "the links to this run are in near.log", 0o644);
        assert!(matches!(read("far.log"), Err(TargetError::Open { mode: 0o644, .. })));
        give(&at("near.log"), near, 0o600);
        assert_eq!(read("far.log"), Err(TargetError::NoLink { path: at("near.log") }));
        std::fs::remove_file(at("tombolo 7070.link")).expect("removed");
        let (log, path) = (at("near.log"), at("tombolo 7070.link"));
        assert_eq!(read("near.log"), Err(TargetError::Ended { log, path: path.clone() }));
        assert_eq!(read("tombolo 7070.link"), Err(TargetError::Gone { path }));
        let other = "the relay at https://127.0.0.1:1 is not reached, in /tmp/x.link neither";
        give(&at("other.txt"), other, 0o644);
        assert_eq!(read("other.txt"), Err(TargetError::NoLink { path: at("other.txt") }));
        for (text, reason) in [
            ("127.0.0.1:7070", "it does not begin with http://"),
            ("http://127.0.0.1:7070/?key=k", "it opens one browser, once"),
        ] {
            let error = read_link(text).expect_err("no link").to_string();
            assert!(error.contains(reason), "{error}");
        }
    }
}
