//! `tombolo doctor`.

use std::time::Duration;

use crate::client::{Client, ClientError, Drives, Link, Options};
use serde_json::json;

use super::{Target, target::TargetError};
use crate::program::{Failure, say};

/// The steps, in their order.
const STEPS: [&str; 5] = ["link", "name", "connection", "server", "token"];
/// How long the first status is waited for, which comes right behind the greeting.
const STATUS: Duration = Duration::from_secs(5);

pub(crate) fn doctor(target: &Target) -> Result<(), Failure> {
    let tell = |step: &str, is_well: bool, found: &str, advice: Option<&str>| {
        if target.json {
            return say(json!({"step": step, "ok": is_well, "found": found, "advice": advice}));
        }
        let how = if is_well { "ok" } else { "wrong" };
        say(format_args!("{step}: {how}: {found}"))?;
        advice.map_or(Ok(()), |advice| say(format_args!("  {advice}")))
    };
    let link = match target.link() {
        Ok(link) => link,
        Err(error) => {
            tell(STEPS[0], false, &error.to_string(), Some(advice_on_target(&error)))?;
            return Err(Failure::Unreached);
        }
    };
    let options = Options { attempts: 0, drives: Drives::OnRequest, ..Options::default() };
    let connected = Client::connect(&link, &options);
    let wrong = connected.as_ref().err().map(|error| (step(error), error));
    for (number, name) in STEPS.iter().enumerate() {
        match wrong {
            Some((at, error)) if at == number => {
                tell(name, false, &error.to_string(), Some(&advice(error, &link)))?;
                return Err(Failure::Unreached);
            }
            _ => tell(name, true, &well(number, &link), None)?,
        }
    }
    let Ok(client) = connected else { return Err(Failure::Unreached) };
    tell("viewer", true, &viewer(&client), None)
}

/// The line that says whether the connected client steers, may steer or only watches.
fn viewer(client: &Client) -> String {
    let hello = client.hello();
    if hello.as_ref().is_some_and(|hello| hello.recording.is_some()) {
        return "this is a recording, of which nothing can be ordered".into();
    }
    let role = if hello.as_ref().is_some_and(|hello| hello.may_drive == Some(false)) {
        "it watches, because the link is for watching".into()
    } else {
        let status = client.wait_for_status(STATUS, |_| true).ok();
        match status.as_ref().and_then(|status| status.driver.as_ref()) {
            Some(driver) => format!("it watches, because {driver} drives"),
            None => "it may steer".into(),
        }
    };
    let name = hello.map_or_else(String::new, |hello| hello.client.clone());
    format!("the run takes this client as {name}; {role}")
}

/// The step at which a connection has failed.
fn step(error: &ClientError) -> usize {
    match error {
        ClientError::Unknown { .. } => 1,
        ClientError::Refused { .. }
        | ClientError::Unreachable { .. }
        | ClientError::System { .. } => 2,
        ClientError::WrongToken { .. } => 4,
        _ => 3,
    }
}

fn well(step: usize, link: &Link) -> String {
    match step {
        0 => format!("it names {}", link.address()),
        1 => match link.socket_path() {
            Some(path) => format!("{} is a path of this machine", path.display()),
            None => format!("{} has an address", link.host()),
        },
        2 => format!("something listens on {}", link.address()),
        3 => "a run of Tombolo answers".into(),
        _ => "it is that of the run".into(),
    }
}

/// The advice where nothing leads to a run.
fn advice_on_target(error: &TargetError) -> &'static str {
    match error {
        TargetError::Link(_) | TargetError::NoLink { .. } | TargetError::Folder { .. } => {
            "Give the file of links that the run's output names (tombolo-PORT.link), or a whole link from it, in quotes."
        }
        TargetError::Gone { .. } | TargetError::Ended { .. } => {
            "The run has ended, or the file is on another machine or in another folder. Look at the end of the run's output."
        }
        TargetError::Unreadable { .. } => {
            "A file of links is its owner's alone: somebody else asks them for a link (`tombolo link`)."
        }
        TargetError::Open { .. } => {
            "Where that file is right, give it itself; its owner can set it right by: chmod 600 FILE"
        }
    }
}

/// The advice for an error.
fn advice(error: &ClientError, link: &Link) -> String {
    let port = link.port();
    match error {
        ClientError::Unknown { .. } => {
            "Look at the spelling of the host. A node of a cluster is often known inside it alone: go through an SSH tunnel then.".into()
        }
        ClientError::Refused { .. } if link.socket_path().is_some() => {
            "The run has ended, and has left its socket behind.".into()
        }
        ClientError::Refused { .. } => format!(
            "The run has ended, or it listens on another port, or the SSH tunnel is not open. A run on another machine that listens \
             on its loopback address is reached by: ssh -L {port}:127.0.0.1:{port} HOST"
        ),
        ClientError::Unreachable { .. } if link.socket_path().is_some() => {
            "The run has ended, or it is on another machine, or the socket belongs to another user: only its owner can connect.".into()
        }
        ClientError::Unreachable { .. } => format!(
            "The machine is off, or a firewall is between: try an SSH tunnel (ssh -L {port}:127.0.0.1:{port} HOST) and the host 127.0.0.1."
        ),
        ClientError::Certificate { .. } => {
            "Another program may answer there, or the link is of an earlier run: take the link that this run has printed, with what \
             stands behind the #. Behind a proxy leave that away, and have the proxy's certificate trusted by this machine.".into()
        }
        ClientError::Encrypted { .. } => {
            "Begin the link with https://. Better, take the run's own link: it names the run's certificate behind the #.".into()
        }
        ClientError::NotEncrypted { .. } => {
            "Begin the link with http://, where this is a run on the loopback address or at the near end of a tunnel. Otherwise \
             another program has the port: a token that is sent there can be read on the way.".into()
        }
        ClientError::HungUp { .. } => format!(
            "The run has ended, and the tunnel to it is still open; or the tunnel ends at another port than that of the run, or at \
             another machine. A tunnel is opened by: ssh -L {port}:127.0.0.1:{port} HOST"
        ),
        ClientError::NotAtRelay { .. } if link.is_bare() => {
            "This link is that of the relay's page: open it in a browser, which lists the runs. A program takes the links in \
             the run's own file.".into()
        }
        ClientError::NotAtRelay { .. } => {
            "The run has ended, or has not come to the relay yet, or is connected to it under another name: the relay's page lists \
             those that are. The run's output says why it does not reach the relay.".into()
        }
        ClientError::HostRefused { .. } => format!(
            "The run listens on its loopback address and answers to 127.0.0.1, localhost and [::1] only: open the link as \
             http://127.0.0.1:{port}/?token=..., at the near end of a tunnel too."
        ),
        ClientError::WrongToken { .. } => {
            "This link is of another run; each has a token of its own. Take the link that this run has printed.".into()
        }
        ClientError::TooManyViewers { .. } => {
            "Close a viewer or a watching program that is not needed, and try again.".into()
        }
        ClientError::NotTombolo { .. } => format!(
            "Another program has the port {port}, or the tunnel ends at another port than that of the run, or the run is of another \
             version of Tombolo, or it has been suspended. Look at what the run has printed, and whether its job runs."
        ),
        _ => "Try again; if it stays so, look at what the run has printed.".into(),
    }
}
