//! `tombolo play`.

use std::{io::IsTerminal, path::PathBuf};

use crate::{
    pipelines::language::{Listen, StreamServer},
    play::Playback,
};
use clap::Args;
use signal_hook::{
    consts::{SIGINT, SIGTERM},
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
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    let playback = Playback::start(&options.file, &settings)?;
    let directory = std::env::temp_dir();
    let invitation = playback.invitation(&directory, std::io::stdout().is_terminal())?;
    say(&invitation)?;
    signals.forever().next();
    Ok(())
}
