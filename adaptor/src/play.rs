//! Shows a recording to viewers, as `tombolo play` does.

use std::{io, net::SocketAddr, path::Path};

use tombolo_pipelines::language::StreamServer;

use crate::{
    recording::{RecordError, Recording},
    stream::{Server, StreamError},
};

/// Why a recording cannot be shown.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlayError {
    /// The recording cannot be read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The server cannot be started.
    #[error(transparent)]
    Stream(#[from] StreamError),
}

/// A server that shows a recording, over the protocol of a run. Each viewer goes through it by itself:
/// forwards and back, faster and slower. Dropping it ends its threads.
///
/// ```no_run
/// use tombolo::{pipelines::language::StreamServer, play::Playback};
///
/// let playback = Playback::start("run.tombolo", &StreamServer::default())?;
/// println!("{}", playback.link());
/// # Ok::<(), tombolo::play::PlayError>(())
/// ```
pub struct Playback {
    server: Server,
}

impl Playback {
    /// Looks through a recording, and serves it.
    ///
    /// # Errors
    /// [`PlayError`].
    pub fn start(file: impl AsRef<Path>, settings: &StreamServer) -> Result<Self, PlayError> {
        let file = file.as_ref();
        let recording = Recording::open(file)?;
        if recording.lost_bytes() > 0 {
            let (path, lost) = (file.display(), recording.lost_bytes());
            tracing::warn!(
                %path,
                "{path}: {lost} bytes cannot be read; what else was recorded is shown"
            );
        }
        Ok(Self { server: Server::play(settings, file)? })
    }

    /// The link that a viewer opens.
    #[must_use]
    pub fn link(&self) -> String {
        self.server.watching_link()
    }

    /// The address that viewers connect to; `None` where it listens on a path.
    #[must_use]
    pub fn address(&self) -> Option<SocketAddr> {
        self.server.address()
    }

    /// What a program prints for a person to open the recording: see
    /// [`Adaptor::invitation`](crate::Adaptor::invitation).
    ///
    /// # Errors
    /// Where the file of the links cannot be written.
    pub fn invitation(&self, directory: &Path, terminal: bool) -> io::Result<String> {
        self.server.invitation(directory, terminal)
    }
}
