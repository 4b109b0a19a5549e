//! How a person is told how to open a run: by a link that works once on a terminal, by a file that
//! only its owner can read anywhere else.

use std::{
    fs::OpenOptions,
    io::{self, Write},
    path::{Path, PathBuf},
};

use super::Server;

/// A file with the links of a run, which goes with it.
pub(super) struct LinkFile(PathBuf);

impl LinkFile {
    fn write(path: PathBuf, text: &str) -> io::Result<Self> {
        // A new file, so that neither a link that lies there nor another's permissions count.
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        let mut options = OpenOptions::new();
        options.write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let mut file = options.open(&path)?;
        let links = Self(path);
        file.write_all(text.as_bytes())?;
        Ok(links)
    }
}

impl Drop for LinkFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

impl Server {
    /// Writes the links of the run into a directory, and says how to open it. Only to a terminal is
    /// a link itself told: what is printed elsewhere others may read.
    pub(crate) fn invitation(&mut self, directory: &Path, terminal: bool) -> io::Result<String> {
        std::fs::create_dir_all(directory)?;
        let path = directory.join(format!("tombolo-{}.link", self.called()));
        let text = format!("drive: {}\nwatch: {}\n", self.link(), self.watching_link());
        // First the old one goes, which may be the same file.
        self.links = None;
        self.links = Some(LinkFile::write(path.clone(), &text)?);
        // Whoever reads it may stand elsewhere.
        let path = std::path::absolute(&path).unwrap_or(path);
        let path = path.display();
        let certificate = self.fingerprint().map_or_else(String::new, |fingerprint| {
            let pairs: Vec<&str> = (0..fingerprint.len() / 2)
                .filter_map(|at| fingerprint.get(2 * at..2 * at + 2))
                .collect();
            format!("\nits certificate has the SHA-256 fingerprint {}", pairs.join(":"))
        });
        let invitation = match self.browser_link().filter(|_| terminal) {
            Some(link) => format!(
                "open {link}\nIt opens one browser, once; links for others, and to watch only, are in {path}"
            ),
            None => format!("the links to this run are in {path}"),
        };
        Ok(invitation + &certificate)
    }
}
