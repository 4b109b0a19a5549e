//! `tombolo doctor`.

use crate::client::{Client, ClientError, Link, Options};
use serde_json::json;

use super::{Target, read_link};
use crate::program::{Failure, say};

/// The steps, in their order.
const STEPS: [&str; 5] = ["link", "name", "connection", "server", "token"];

pub(crate) fn doctor(target: &Target) -> Result<(), Failure> {
    let tell = |step: &str, is_well: bool, found: &str, advice: Option<&str>| {
        if target.json {
            return say(json!({"step": step, "ok": is_well, "found": found, "advice": advice}));
        }
        let how = if is_well { "ok" } else { "wrong" };
        say(format_args!("{step}: {how}: {found}"))?;
        advice.map_or(Ok(()), |advice| say(format_args!("  {advice}")))
    };
    let link = read_link(&target.link);
    let options = Options { attempts: 0, ..Options::default() };
    let connected = link.clone().and_then(|link| Client::connect(&link, &options));
    let wrong = connected.as_ref().err().map(|error| (step(error), error));
    for (number, name) in STEPS.iter().enumerate() {
        match wrong {
            Some((at, error)) if at == number => {
                tell(name, false, &error.to_string(), Some(&advice(error, link.as_ref().ok())))?;
                return Err(Failure::Unreached);
            }
            _ => {
                let link = link.as_ref().ok();
                let found = link.map_or_else(String::new, |link| well(number, link));
                tell(name, true, &found, None)?;
            }
        }
    }
    let Ok(client) = connected else { return Err(Failure::Unreached) };
    let name = client.hello().map_or_else(String::new, |hello| hello.client.clone());
    let role =
        if client.drives() { "it may steer" } else { "it watches, because another one drives" };
    tell("viewer", true, &format!("the run takes this client as {name}; {role}"), None)
}

/// The step at which a connection has failed.
fn step(error: &ClientError) -> usize {
    match error {
        ClientError::Link { .. } => 0,
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

/// The advice for an error.
fn advice(error: &ClientError, link: Option<&Link>) -> String {
    let port = link.map_or(7070, Link::port);
    match error {
        ClientError::Link { .. } => {
            "Copy the whole link that the run has printed, with its token, and put it in quotes.".into()
        }
        ClientError::Unknown { .. } => {
            "Look at the spelling of the host. A node of a cluster is often known inside it alone: go through an SSH tunnel then.".into()
        }
        ClientError::Refused { .. } => format!(
            "The run has ended, or it listens on another port, or the SSH tunnel is not open. A run on another machine that listens \
             on its loopback address is reached by: ssh -L {port}:127.0.0.1:{port} HOST"
        ),
        ClientError::Unreachable { .. } if link.is_some_and(|link| link.socket_path().is_some()) => {
            "The run has ended, or it is on another machine, or the socket belongs to another user: only its owner can connect.".into()
        }
        ClientError::Unreachable { .. } => format!(
            "The machine is off, or a firewall is between: try an SSH tunnel (ssh -L {port}:127.0.0.1:{port} HOST) and the host 127.0.0.1."
        ),
        ClientError::Certificate { .. } => {
            "Another program may answer there, or the link is of an earlier run: take the link that this run has printed, with what \
             stands behind the #. Behind a proxy leave that away, and have the proxy's certificate trusted by this machine.".into()
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
             version of Tombolo. Look at what the run has printed."
        ),
        _ => "Try again; if it stays so, look at what the run has printed.".into(),
    }
}
