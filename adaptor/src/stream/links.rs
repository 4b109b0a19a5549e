//! How a person gets into a run: by a link that works once on a terminal, by a file that only its owner
//! can read anywhere else.

use std::{
    ffi::OsString,
    fs::File,
    io::{self, Read, Write},
    net::SocketAddr,
    path::{Path, PathBuf},
    sync::{Arc, Mutex},
};

use super::{
    connect::Connect,
    credentials::{Access, Credentials, private},
    relay_messages::Attached,
    socket::Place,
    tls::machine,
};
use crate::lock::lock;

/// What stands before the path of the file of links where a run, or a recording, tells it.
const ARE_IN: [&str; 4] = [
    "the links to this run are in ",
    "the links to this recording are in ",
    "links for others, and to watch only, are in ",
    "links for others are in ",
];

/// The path of the file of links that a line of a program's output tells.
pub(crate) fn told_in(line: &str) -> Option<&str> {
    let told = ARE_IN.iter().find_map(|words| Some(line.split_once(words)?.1.trim_end()));
    told.filter(|path| !path.is_empty())
}

/// Bytes that are read of a file of links.
const FILE: u64 = 1 << 16;
/// What stands before the name of the machine in a file of links.
const HOST: &str = "host: ";

/// A file with links, which goes with the server that they lead to. It is locked until then, so that
/// what a run that was killed has left can be told from it.
pub(super) struct LinkFile {
    path: PathBuf,
    /// Holds the lock.
    held: File,
}

impl LinkFile {
    pub(super) fn write(path: PathBuf, text: &str) -> io::Result<Self> {
        let named =
            |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", path.display()));
        let held = write_whole(&path, text).map_err(named)?;
        Ok(Self { path, held })
    }

    /// Writes the file again; whoever reads it meanwhile finds the old text or the new one.
    fn rewrite(&mut self, text: &str) -> io::Result<()> {
        self.held = write_whole(&self.path, text)?;
        Ok(())
    }
}

/// A file that is gone with this, unless it has got another name.
struct Beside(PathBuf);

impl Drop for Beside {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

/// Writes a new file beside it, locks it and renames it, so that neither a link that lies there nor
/// another's permissions count, and nobody finds half a file, none, or one that seems to be nobody's.
fn write_whole(path: &Path, text: &str) -> io::Result<File> {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(".part");
    let beside = Beside(path.with_file_name(name));
    // What a run that was killed has left.
    match std::fs::remove_file(&beside.0) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let mut file = private().create_new(true).open(&beside.0)?;
    // Where a file system has no locks, nobody takes the file for one that was left.
    let _ = file.try_lock();
    file.write_all(text.as_bytes())?;
    std::fs::rename(&beside.0, path)?;
    Ok(file)
}

/// Removes what runs of this machine that were killed have left in a folder.
fn remove_left(directory: &Path) {
    let Ok(files) = std::fs::read_dir(directory) else { return };
    for file in files.flatten() {
        let name = file.file_name();
        let is_one =
            name.to_str().is_some_and(|it| it.starts_with("tombolo-") && it.ends_with(".link"));
        let path = file.path();
        if is_one && file.file_type().is_ok_and(|it| it.is_file()) && is_left(&path) {
            let _ = std::fs::remove_file(&path);
            let path = path.display();
            tracing::info!(%path, "{path}, the links of a run that was killed, is removed");
        }
    }
}

/// Whether a file of links is one that a killed run has left: it is of this machine, and nobody holds
/// it. Another machine's lock is not known everywhere.
fn is_left(path: &Path) -> bool {
    let Ok(file) = File::options().read(true).write(true).open(path) else { return false };
    if file.try_lock().is_err() {
        return false;
    }
    let mut text = String::new();
    let is_read = Read::take(&file, FILE).read_to_string(&mut text).is_ok();
    let host = text.lines().find_map(|line| line.strip_prefix(HOST));
    // Another run may have put its own file there meanwhile.
    is_read && host.is_some() && host == machine().as_deref() && is_at(&file, path)
}

/// Whether this file is the one at a path.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let number = |it: std::fs::Metadata| (it.dev(), it.ino());
    let (here, there) = (file.metadata().map(number), std::fs::symlink_metadata(path).map(number));
    matches!((here, there), (Ok(here), Ok(there)) if here == there)
}

#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

impl Drop for LinkFile {
    fn drop(&mut self) {
        // Another run may have put its own file there: of another node, or with a port that was free.
        if is_at(&self.held, &self.path) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// The links of a run.
pub(super) struct Links {
    /// Where its server listens, if it does.
    pub(super) place: Option<Place>,
    /// SHA-256 of its certificate, where connections to it are encrypted.
    pub(super) fingerprint: Option<String>,
    pub(super) credentials: Arc<Credentials>,
    /// The relay that it connects to, which its links lead through.
    pub(super) relay: Option<Arc<Connect>>,
    pub(super) file: Mutex<Option<LinkFile>>,
    /// Whether they lead to a recording, which nobody drives.
    pub(super) is_of_recording: bool,
}

/// Where a link leads, but for its secret.
enum Way {
    Socket(PathBuf),
    /// An address with a slash at its end, and what is known of the certificate there.
    Address {
        address: String,
        sha256: Option<String>,
    },
}

impl Links {
    /// The link for some rights, with their secret.
    pub(super) fn link(&self, access: Access) -> String {
        self.way().link("token", self.credentials.secret(access).as_str())
    }

    /// A link that opens one browser, once, for driving what can be driven; `None` where the system has
    /// no random numbers.
    pub(super) fn browser_link(&self) -> Option<String> {
        let access = if self.is_of_recording { Access::Watch } else { Access::Drive };
        let key = self.credentials.sessions.key(access, None).ok()?;
        Some(self.way().link("key", key.as_str()))
    }

    fn way(&self) -> Way {
        match (&self.relay, &self.place) {
            (Some(relay), _) => {
                let Attached { address, sha256, .. } = relay.attached();
                Way::Address { address, sha256 }
            }
            (None, Some(place)) => self.local(place),
            // A server listens or connects.
            (None, None) => Way::Address { address: String::new(), sha256: None },
        }
    }

    /// The way past a relay.
    fn local(&self, place: &Place) -> Way {
        match place {
            Place::Socket(path) => Way::Socket(path.clone()),
            Place::Address(address) => {
                let sha256 = self.fingerprint.clone();
                let scheme = if sha256.is_some() { "https" } else { "http" };
                Way::Address { address: format!("{scheme}://{}/", authority(*address)), sha256 }
            }
        }
    }

    /// The lines of the file: the links through a relay first, then those past it, then the machine.
    fn lines(&self) -> String {
        let local = match (&self.relay, &self.place) {
            (Some(_), Some(place)) => Some(self.local(place)),
            _ => None,
        };
        let mut lines = String::new();
        for way in std::iter::once(self.way()).chain(local) {
            let driven = (!self.is_of_recording).then_some(("drive", Access::Drive));
            for (name, access) in driven.into_iter().chain([("watch", Access::Watch)]) {
                let secret = self.credentials.secret(access);
                lines += &format!("{name}: {}\n", way.link("token", secret.as_str()));
            }
        }
        lines.extend(machine().map(|host| format!("{HOST}{host}\n")));
        lines
    }

    /// The name of the file: the port, that of the socket, or that at the relay.
    fn called(&self) -> String {
        match (&self.place, &self.relay) {
            (Some(Place::Address(address)), _) => address.port().to_string(),
            (Some(Place::Socket(path)), _) => {
                path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
            }
            (None, Some(relay)) => relay.attached().name.to_string(),
            (None, None) => "run".into(),
        }
    }

    /// Writes the links of the run into a directory, from which it removes those of killed ones, and says
    /// how to open it. Only to a terminal is
    /// a link itself told: what is printed elsewhere others may read.
    pub(super) fn invitation(&self, directory: &Path, terminal: bool) -> io::Result<String> {
        std::fs::create_dir_all(directory)?;
        remove_left(directory);
        let path = directory.join(format!("tombolo-{}.link", self.called()));
        self.write(path.clone())?;
        // Whoever reads it may stand elsewhere.
        let path = std::path::absolute(&path).unwrap_or(path);
        let path = path.display();
        let certificate = self.fingerprint.as_ref().map_or_else(String::new, |fingerprint| {
            format!("\nits certificate has the SHA-256 fingerprint {}", with_colons(fingerprint))
        });
        let [to_run, to_recording, of_run, of_recording] = ARE_IN;
        let (opens, leads) =
            if self.is_of_recording { (of_recording, to_recording) } else { (of_run, to_run) };
        let invitation = match self.browser_link().filter(|_| terminal) {
            Some(link) => format!("open {link}\nIt opens one browser, once; {opens}{path}"),
            None => format!("{leads}{path}"),
        };
        let waits = match &self.relay {
            Some(relay) if !relay.is_connected() => {
                format!("\nthey work once the relay {} is reached", relay.address())
            }
            _ => String::new(),
        };
        Ok(invitation + &waits + &certificate)
    }

    fn write(&self, path: PathBuf) -> io::Result<()> {
        let mut file = lock(&self.file);
        // Under the lock: a name that the relay gives meanwhile is written behind these.
        let lines = self.lines();
        match &mut *file {
            Some(there) if there.path == path => there.rewrite(&lines)?,
            _ => {
                // First the old one goes, which may be the same file by another name.
                *file = None;
                *file = Some(LinkFile::write(path, &lines)?);
            }
        }
        Ok(())
    }

    /// Writes the file again, after the run has got another name at its relay.
    pub(super) fn renew(&self) {
        if let Some(file) = &mut *lock(&self.file)
            && let Err(error) = file.rewrite(&self.lines())
        {
            let path = file.path.display();
            tracing::warn!(%path, "the links were not written to {path}: {error}");
        }
    }
}

impl Way {
    fn link(&self, name: &str, secret: &str) -> String {
        match self {
            Self::Socket(path) => format!("unix:{}?{name}={secret}", path.display()),
            Self::Address { address, sha256 } => {
                format!("{address}?{name}={secret}{}", fragment(sha256.as_deref()))
            }
        }
    }
}

/// The end of a link by which programs know a certificate. What stands behind the `#` no browser sends.
pub(super) fn fragment(sha256: Option<&str>) -> String {
    sha256.map_or_else(String::new, |digits| format!("#sha256={digits}"))
}

/// Warns of a server that listens on every address of the machine: what is reachable then, and what its
/// links name.
pub(super) fn warn_of_open(run: Option<&str>, address: SocketAddr, setting: &str) {
    if !address.ip().is_unspecified() {
        return;
    }
    let named = authority(address);
    tracing::warn!(
        run,
        %address,
        "viewers are listened to on every address of this machine, from every network that it is in: whoever reaches {address} \
         can connect, and needs a secret to see anything. The links lead to {named}, which may be known by that name to \
         this machine alone; {setting} takes one address"
    );
}

/// The host and port at which a server is reached that listens on an address: the machine's name where
/// it listens on all.
pub(super) fn authority(address: SocketAddr) -> String {
    let host = machine().filter(|_| address.ip().is_unspecified());
    host.map_or(address.to_string(), |name| format!("{name}:{}", address.port()))
}

/// A fingerprint as browsers show it.
pub(super) fn with_colons(fingerprint: &str) -> String {
    let pairs = (0..fingerprint.len() / 2).filter_map(|at| fingerprint.get(2 * at..2 * at + 2));
    pairs.collect::<Vec<_>>().join(":")
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;

    #[test]
    fn only_the_links_of_a_killed_run_of_this_machine_are_removed() {
        let directory = tempfile::tempdir().expect("a folder");
        let at = |name: &str| directory.path().join(name);
        let Some(host) = machine() else { return };
        let text = format!("drive: http://127.0.0.1:1/?token=d\n{HOST}{host}\n");
        let mut living = LinkFile::write(at("tombolo-1.link"), &text).expect("written");
        living.rewrite(&text).expect("written");
        for name in ["tombolo-2.link", "notes-2.link", "tombolo-3.txt"] {
            std::fs::write(at(name), &text).expect("written");
        }
        let of_other = text.replace(&host, "another-machine");
        std::fs::write(at("tombolo-4.link"), of_other).expect("written");
        std::fs::write(at("tombolo-5.link"), "drive: http://a/?token=d\n").expect("written");
        std::fs::create_dir(at("tombolo-6.link")).expect("made");
        remove_left(directory.path());
        let files = std::fs::read_dir(directory.path()).expect("the folder").flatten();
        let mut names: Vec<_> = files.map(|file| file.file_name()).collect();
        names.sort();
        let expected = ["notes-2.link", "tombolo-1.link", "tombolo-3.txt", "tombolo-4.link"];
        assert_eq!(names[..4], expected);
        assert_eq!(names[4..], ["tombolo-5.link", "tombolo-6.link"]);
    }

    /// Two runs of different nodes may write at the same path of one file system.
    #[test]
    fn the_end_of_a_run_leaves_the_links_of_another() {
        let directory = tempfile::tempdir().expect("a folder");
        let path = directory.path().join("tombolo-7070.link");
        let first = LinkFile::write(path.clone(), "first").expect("written");
        let second = LinkFile::write(path.clone(), "second").expect("written");
        drop(first);
        assert_eq!(std::fs::read_to_string(&path).expect("it is there"), "second");
        drop(second);
        assert!(!path.exists());
        let nowhere = directory.path().join("none/tombolo-7070.link");
        let error = LinkFile::write(nowhere, "").err().expect("refused").to_string();
        assert!(error.contains("none/tombolo-7070.link"), "{error}");
    }

    #[test]
    fn a_file_of_links_is_whole_whenever_it_is_read() {
        let directory = tempfile::tempdir().expect("a folder");
        let path = directory.path().join("tombolo-run.link");
        let text = |address: &str| format!("drive: {address}\nwatch: {address}\n");
        let mut file = LinkFile::write(path.clone(), &text("http://before/")).expect("written");
        let ended = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let reader = scope.spawn(|| {
                while !ended.load(Ordering::Relaxed) {
                    let read = std::fs::read_to_string(&path).expect("it is there");
                    assert!(
                        [text("http://before/"), text("http://behind/")].contains(&read),
                        "{read}"
                    );
                }
            });
            for _ in 0..500 {
                file.rewrite(&text("http://behind/")).expect("written");
                file.rewrite(&text("http://before/")).expect("written");
            }
            ended.store(true, Ordering::Relaxed);
            reader.join().expect("every reading was whole");
        });
        drop(file);
        let left = std::fs::read_dir(directory.path()).expect("the folder").count();
        assert_eq!(left, 0);
    }
}
