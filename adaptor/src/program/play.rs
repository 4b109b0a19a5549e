//! `tombolo play`.

use std::{io::IsTerminal, path::PathBuf};

use crate::{
    pipelines::language::{Listen, StreamServer},
    play::{PlayError, Playback},
    stream::StreamError,
};
use clap::Args;
use signal_hook::{
    consts::{SIGHUP, SIGINT, SIGTERM},
    iterator::Signals,
};

use super::{Failure, say};

#[derive(Debug, Args)]
pub(crate) struct Options {
    /// The recording that a run has written
    file: PathBuf,
    /// Where viewers connect to; port 0 takes any free one
    #[arg(long, value_name = "ADDRESS:PORT|unix:/PATH")]
    listen: Option<Listen>,
}

/// Serves a recording until it is interrupted.
pub(crate) fn play(options: &Options) -> Result<(), Failure> {
    let mut settings = StreamServer::default();
    settings.listen.clone_from(&options.listen);
    crate::logging::start();
    let mut signals = Signals::new([SIGHUP, SIGINT, SIGTERM])?;
    let playback = Playback::start(&options.file, &settings).map_err(|error| match error {
        PlayError::Stream(StreamError::InUse { address }) => Failure::Wrong(format!(
            "--listen: {address} is in use by another program, which may be a run; choose another port or path, or \
             port 0 for any that is free"
        )),
        error => error.into(),
    })?;
    // Its own where the system gives each user one: others' files are in the way in the common one.
    let own =
        std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|folder| folder.is_dir());
    let directory = own.unwrap_or_else(std::env::temp_dir);
    let invitation = playback.invitation(&directory, std::io::stdout().is_terminal())?;
    say(&invitation)?;
    signals.forever().next();
    Ok(())
}
