//! `tombolo relay`.

use std::{io::IsTerminal, net::SocketAddr, num::NonZeroU32, path::PathBuf};

use crate::{
    pipelines::language::Tls,
    stream::relay::{Relay, RelaySettings},
};
use clap::Args;
use signal_hook::{
    consts::{SIGHUP, SIGINT, SIGTERM},
    iterator::Signals,
};

use super::{Failure, say};

/// The directory below the home directory where a relay keeps its files.
const DIRECTORY: &str = ".tombolo-relay";

#[derive(Debug, Args)]
pub(crate) struct Options {
    /// Where runs and viewers connect to; port 0 takes any free one. Anything but a loopback address is
    /// open to the network, and encrypted
    #[arg(long, value_name = "ADDRESS:PORT")]
    listen: Option<SocketAddr>,
    /// Where its secrets and its certificate are kept; left out, ~/.tombolo-relay
    #[arg(long)]
    directory: Option<PathBuf>,
    /// A PEM file with the certificate; left out, one is made
    #[arg(long, requires = "key")]
    certificate: Option<String>,
    /// A PEM file with the certificate's key, that only its owner can read
    #[arg(long, requires = "certificate")]
    key: Option<String>,
    /// The address at which viewers reach it, where that is another than the one of runs
    #[arg(long, value_name = "https://HOST[/PATH]")]
    public: Option<String>,
    /// Connections of viewers at once, of which half may lead to one run
    #[arg(long)]
    connections: Option<NonZeroU32>,
}

/// Serves until it is interrupted.
pub(crate) fn relay(options: &Options) -> Result<(), Failure> {
    let home = || std::env::home_dir().map(|home| home.join(DIRECTORY));
    let directory = options.directory.clone().or_else(home);
    let directory =
        directory.ok_or_else(|| Failure::Wrong("no home directory: give --directory".into()))?;
    let mut settings = RelaySettings::new(directory);
    if let Some(listen) = options.listen {
        settings.listen = listen;
    }
    if options.certificate.is_some() {
        let (certificate, key) = (options.certificate.clone(), options.key.clone());
        settings.tls = Some(Tls { certificate, key });
    }
    settings.public.clone_from(&options.public);
    if let Some(connections) = options.connections {
        settings.connections = connections;
    }
    crate::logging::start();
    let mut signals = Signals::new([SIGHUP, SIGINT, SIGTERM])?;
    let mut relay = Relay::start(&settings)?;
    say(&relay.invitation(std::io::stdout().is_terminal())?)?;
    signals.forever().next();
    Ok(())
}
