//! `tombolo link`.

use crate::{client::Drives, pipelines::language::LinkFor};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::{ANSWER, Target, connect, failed};
use crate::program::{Failure, say};

#[derive(Debug, Args)]
pub(crate) struct Options {
    #[command(flatten)]
    pub(super) target: Target,
    /// The rights of the browser that it opens
    #[arg(long = "for", value_enum, default_value = "watch")]
    rights: Rights,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Rights {
    /// It sees everything and changes nothing
    Watch,
    /// It may be the one that drives
    Drive,
}

pub(crate) fn link(options: &Options) -> Result<(), Failure> {
    let (rights, drives) = match options.rights {
        Rights::Watch => (LinkFor::Watch, Drives::Never),
        Rights::Drive => (LinkFor::Drive, Drives::OnRequest),
    };
    let client = connect(&options.target, drives)?;
    let address = client.link_for(rights, ANSWER).map_err(failed)?;
    if options.target.json {
        return say(json!({"link": {"for": rights, "address": address}}));
    }
    say(&address)?;
    if let Some(rest) = address.strip_prefix("unix:") {
        let (socket, query) = rest.split_once('?').unwrap_or((rest, ""));
        eprintln!(
            "tombolo: no browser opens a socket; `ssh -N -L 7070:{socket} HOST` brings it to a port of another machine, where \
             http://127.0.0.1:7070/?{query} opens it"
        );
    }
    Ok(())
}
