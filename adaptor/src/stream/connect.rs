//! A run's connection to a relay, which it keeps as long as it goes on, and the connections that it makes
//! there for viewers.

use std::{
    collections::BTreeSet,
    sync::{Arc, Condvar, Mutex, PoisonError},
    time::Duration,
};

use axum::http::{HeaderValue, header};
use futures_util::StreamExt;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    task::JoinSet,
    time::{sleep, timeout},
};
use tokio_tungstenite::{
    WebSocketStream, client_async_with_config,
    tungstenite::{
        Error, Message,
        client::IntoClientRequest,
        protocol::{CloseFrame, WebSocketConfig},
    },
};
use tombolo_pipelines::language::{RelayAddress, RunName, StreamServer, is_fingerprint};
use tracing::debug;

use super::{
    StreamError,
    connection::Way,
    credentials::relay_secret,
    listener::Entrance,
    relay_messages::{ATTACH, Attach, Attached, CARRY, MESSAGE, Open, PROTOCOL, VERSION},
    secret::Secret,
    socket::{Accepted, hold_little},
    tls::machine,
};
use crate::{
    dial::{Stream, connect, dial, encrypt},
    link::Link,
    lock::lock,
};

/// The pauses between attempts to reach a relay: each twice as long as the one before.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
const LONGEST_PAUSE: Duration = Duration::from_secs(15);
/// How long a relay may take to take a run in, or a connection for a viewer.
const ANSWER: Duration = Duration::from_secs(15);
/// How long it may be silent, which pings every ten seconds.
const SILENT: Duration = Duration::from_secs(35);
/// How long whoever asks for a link waits for the relay, once.
const PATIENCE: Duration = Duration::from_secs(3);
/// Connections for viewers that are being made at once.
const DIALS: usize = 64;
/// Reasons for which a relay is not reached that are told, each once, until it is.
const REASONS: usize = 16;
/// Bytes of the head of an answer.
const HEAD: usize = 4096;
/// Bytes of the address of a run.
const ADDRESS: usize = 1024;

/// A run's place at a relay.
pub(super) struct Connect {
    /// The number of the run.
    run: Option<Arc<str>>,
    relay: Arc<RelayAddress>,
    /// The relay's secret for runs.
    secret: Secret,
    instance: Secret,
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    /// The name and address by the relay's last answer; before the first, those that are expected.
    attached: Attached,
    is_connected: bool,
    /// Somebody has waited for it, in vain.
    is_given_up: bool,
}

/// The end of a connection to a relay.
struct Lost {
    reason: String,
    /// The relay had taken the run in.
    was_connected: bool,
}

impl Connect {
    /// The place that the settings ask for, if they do.
    pub(super) fn of(
        settings: &StreamServer,
        run: Option<&str>,
    ) -> Result<Option<Arc<Self>>, StreamError> {
        let Some(relay) = &settings.connect else { return Ok(None) };
        let secret = relay_secret(settings)?;
        let name = match &settings.name {
            Some(name) => name.clone(),
            None => own_name(),
        };
        let scheme = if relay.is_encrypted() { "https" } else { "http" };
        let address = format!("{scheme}://{}/{name}/", relay.authority());
        let attached = Attached { name, address, sha256: relay.sha256().map(str::to_owned) };
        let instance = Secret::random().map_err(StreamError::Token)?;
        let state = State { attached, is_connected: false, is_given_up: false };
        let (state, changed) = (Mutex::new(state), Condvar::new());
        let (run, relay) = (run.map(Into::into), Arc::new(relay.clone()));
        Ok(Some(Arc::new(Self { run, relay, secret, instance, state, changed })))
    }

    /// The address of the relay.
    pub(super) fn address(&self) -> &RelayAddress {
        &self.relay
    }

    pub(super) fn is_connected(&self) -> bool {
        lock(&self.state).is_connected
    }

    /// The name and address that the relay has given the run. The first time it is waited for a few
    /// seconds; where it does not answer, they are those that were asked for.
    pub(super) fn attached(&self) -> Attached {
        let waits = |state: &mut State| !state.is_connected && !state.is_given_up;
        let waited = self.changed.wait_timeout_while(lock(&self.state), PATIENCE, waits);
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        state.is_given_up = !state.is_connected;
        state.attached.clone()
    }

    /// Keeps the connection for ever, with growing pauses where it cannot be made; calls `renamed` where
    /// the relay gives the run another name or address.
    pub(super) async fn keep(&self, entrance: &Entrance, renamed: impl Fn()) {
        let mut pause = FIRST_PAUSE;
        let mut reported = BTreeSet::new();
        loop {
            let Lost { reason, was_connected } = match self.join().await {
                Ok((socket, attached)) => {
                    let (run, name) = (self.run.as_deref(), &attached.name);
                    let address = &self.relay;
                    if reported.is_empty() {
                        tracing::info!(run, %name, %address, "this run is {name} at the relay {address}");
                    } else {
                        // Whoever was told of the trouble is told of its end.
                        tracing::warn!(
                            run,
                            %name,
                            %address,
                            "the relay {address} is reached now, and this run is {name} there"
                        );
                        reported.clear();
                    }
                    let is_new = self.connected(&attached);
                    if is_new {
                        renamed();
                    }
                    let reason = self.serve(socket, &attached, entrance).await;
                    Lost { reason, was_connected: true }
                }
                Err(reason) => Lost { reason, was_connected: false },
            };
            lock(&self.state).is_connected = false;
            if was_connected {
                pause = FIRST_PAUSE;
            }
            if is_new(&mut reported, &reason) {
                let (run, address) = (self.run.as_deref(), &self.relay);
                tracing::warn!(
                    run,
                    %address,
                    reason,
                    "the relay {address} is not reached, and it is tried again and again: {reason}"
                );
            }
            sleep(varied(pause)).await;
            pause = pause.saturating_mul(2).min(LONGEST_PAUSE);
        }
    }

    /// Takes note of what the relay has said; whether it is something else than before.
    fn connected(&self, attached: &Attached) -> bool {
        let mut state = lock(&self.state);
        let is_new = state.attached != *attached;
        state.attached.clone_from(attached);
        state.is_connected = true;
        drop(state);
        self.changed.notify_all();
        is_new
    }

    /// Connects, and says who this run is; the error says why the relay does not take it.
    async fn join(&self) -> Result<(WebSocketStream<Box<dyn Stream>>, Attached), String> {
        let joining = async {
            let (host, port) = self.relay.host();
            let dialled = dial(host, port, certificate(&self.relay)).await;
            let stream = dialled.map_err(|error| error.to_string())?;
            let address = format!("ws://{}{ATTACH}", self.relay.authority());
            let mut request = address.into_client_request().map_err(|error| error.to_string())?;
            let bearer = HeaderValue::from_str(&format!("Bearer {}", self.secret.as_str()));
            let bearer = bearer.map_err(|error| error.to_string())?;
            request.headers_mut().insert(header::AUTHORIZATION, bearer);
            let limits = WebSocketConfig::default()
                .max_message_size(Some(MESSAGE))
                .max_frame_size(Some(MESSAGE));
            let (mut socket, _) =
                client_async_with_config(request, stream, Some(limits)).await.map_err(refused)?;
            let wish = lock(&self.state).attached.name.clone();
            let attach =
                Attach { version: VERSION, name: wish, instance: self.instance.as_str().into() };
            let attach = serde_json::to_string(&attach).map_err(|error| error.to_string())?;
            futures_util::SinkExt::send(&mut socket, Message::text(attach))
                .await
                .map_err(|error| error.to_string())?;
            let text = loop {
                match socket.next().await {
                    Some(Ok(Message::Text(text))) => break text,
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                    Some(Ok(Message::Close(Some(close)))) => return Err(closed(&close)),
                    _ => return Err("it ended the connection at once".into()),
                }
            };
            let attached: Attached =
                serde_json::from_str(&text).map_err(|_| "it is no relay".to_owned())?;
            // They stand in links, which people and programs are given.
            if !is_address(&attached.address) {
                return Err("it gives this run an address that none can have".into());
            }
            if !attached.sha256.as_deref().is_none_or(is_fingerprint) {
                return Err("it gives this run a certificate's fingerprint that is none".into());
            }
            Ok((socket, attached))
        };
        timeout(ANSWER, joining).await.unwrap_or_else(|_| Err("it does not answer".into()))
    }

    /// Makes the connections that the relay asks for, until this one ends; says why it did.
    async fn serve(
        &self,
        mut socket: WebSocketStream<Box<dyn Stream>>,
        attached: &Attached,
        entrance: &Entrance,
    ) -> String {
        let way = Way::Relayed { is_encrypted: attached.address.starts_with("https://") };
        let mut dials = JoinSet::new();
        loop {
            while dials.try_join_next().is_some() {}
            let text = match timeout(SILENT, socket.next()).await {
                Err(_) => return format!("silence of {} seconds", SILENT.as_secs()),
                Ok(Some(Ok(Message::Text(text)))) => text,
                Ok(Some(Ok(Message::Close(Some(close))))) => return closed(&close),
                Ok(Some(Ok(Message::Close(None)))) | Ok(None) => {
                    return "it has ended the connection".into();
                }
                Ok(Some(Ok(_))) => continue,
                Ok(Some(Err(error))) => return error.to_string(),
            };
            let Ok(open) = serde_json::from_str::<Open>(&text) else {
                return "it says something that no relay says".into();
            };
            // One that asks for more than it lets in is not obeyed.
            if dials.len() < DIALS {
                let (relay, secret) = (Arc::clone(&self.relay), self.secret.clone());
                let entrance = entrance.clone();
                dials.spawn(async move {
                    match timeout(ANSWER, carry(&relay, &secret, &open)).await {
                        Ok(Ok(accepted)) => entrance.take(accepted, way).await,
                        Ok(Err(reason)) => debug!("no connection for a viewer: {reason}"),
                        Err(_) => debug!("no connection for a viewer: the relay is silent"),
                    }
                });
            }
        }
    }
}

/// Whether a reason is none of those that were told since the run was connected last, of which it is
/// from now on.
fn is_new(reported: &mut BTreeSet<String>, reason: &str) -> bool {
    reported.len() < REASONS && reported.insert(reason.to_owned())
}

/// Makes a connection for a viewer.
async fn carry(relay: &RelayAddress, secret: &Secret, open: &Open) -> Result<Accepted, String> {
    let failed = |error: std::io::Error| error.to_string();
    let (host, port) = relay.host();
    let stream = connect(host, port).await.map_err(|error| error.to_string())?;
    hold_little(&stream);
    #[cfg(unix)]
    let descriptor = std::os::fd::AsRawFd::as_raw_fd(&stream);
    let encrypted = encrypt(stream, host, certificate(relay)).await;
    let mut stream = encrypted.map_err(|error| error.to_string())?;
    let ticket = Secret::given(&open.ticket).ok_or("its ticket is none")?;
    let request = format!(
        "GET {CARRY}{} HTTP/1.1\r\nHost: {}\r\nAuthorization: Bearer {}\r\nConnection: Upgrade\r\nUpgrade: {PROTOCOL}\r\n\r\n",
        ticket.as_str(),
        relay.authority(),
        secret.as_str()
    );
    stream.write_all(request.as_bytes()).await.map_err(failed)?;
    stream.flush().await.map_err(failed)?;
    // Byte by byte: what comes behind the head is for the server.
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        if head.len() >= HEAD {
            return Err("its answer is too long".into());
        }
        head.push(stream.read_u8().await.map_err(failed)?);
    }
    if !head.starts_with(b"HTTP/1.1 101 ") {
        return Err("nobody waits for it any more".into());
    }
    Ok(Accepted {
        stream,
        #[cfg(unix)]
        descriptor,
        address: open.viewer,
    })
}

/// The certificate by which a relay is known, where connections to it are encrypted.
fn certificate(relay: &RelayAddress) -> Option<Option<&str>> {
    relay.is_encrypted().then(|| relay.sha256())
}

/// Whether a text can be the address of a run, with a slash at its end.
pub(super) fn is_address(text: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_graphic() && !"?#\"<>\\".contains(c);
    let rest = text.strip_prefix("https://").or_else(|| text.strip_prefix("http://"));
    text.len() <= ADDRESS
        && text.chars().all(is_plain)
        && text.ends_with('/')
        && rest.is_some_and(|rest| !rest.starts_with('/'))
        && format!("{text}?token=x").parse::<Link>().is_ok()
}

/// Why a relay does not let a run in.
fn refused(error: Error) -> String {
    match error {
        Error::Http(answer) if answer.status().as_u16() == 401 => {
            "it does not know the secret for runs that this run shows".into()
        }
        Error::Http(answer) => format!("it answers with {}", answer.status()),
        error => error.to_string(),
    }
}

fn closed(close: &CloseFrame) -> String {
    let reason: String = close.reason.chars().filter(|c| !c.is_control()).take(200).collect();
    format!("it has ended the connection with {}: {reason}", u16::from(close.code))
}

/// The name of a run that has none: that of its machine.
fn own_name() -> RunName {
    let machine = machine().unwrap_or_default();
    let short = machine.split('.').next().unwrap_or_default();
    let short: String = short.chars().take(RunName::LENGTH).collect();
    short.parse().unwrap_or_else(|_| RunName::default())
}

/// Three quarters to five quarters of a pause, so that many runs do not come at the same moment.
fn varied(pause: Duration) -> Duration {
    let mut byte = [128];
    let _ = getrandom::fill(&mut byte);
    pause.mul_f64(0.75 + f64::from(byte[0]) / 510.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_vary_around_what_they_are() {
        for _ in 0..100 {
            let pause = varied(Duration::from_secs(4));
            assert!((3.0..=5.0).contains(&pause.as_secs_f64()), "{pause:?}");
        }
    }

    #[test]
    fn each_reason_is_told_once_until_the_relay_is_reached() {
        let mut reported = BTreeSet::new();
        assert!(is_new(&mut reported, "nobody listens there"));
        assert!(!is_new(&mut reported, "nobody listens there"));
        assert!(is_new(&mut reported, "it does not know the secret"));
        assert!(!is_new(&mut reported, "nobody listens there"));
        // A relay that says something else each time fills no log.
        let told = (0..1000).filter(|it| is_new(&mut reported, &it.to_string())).count();
        assert_eq!(told, REASONS - 2);
        reported.clear();
        assert!(is_new(&mut reported, "nobody listens there"));
    }

    #[test]
    fn only_an_address_stands_in_links() {
        for address in ["https://relay.host:7400/nozzle/", "http://[::1]:7400/nozzle-2/"] {
            assert!(is_address(address), "{address}");
        }
        for text in [
            "",
            "https:///",
            "https://relay/run",
            "ftp://relay/",
            "https://relay/?token=x/",
            "https://relay:0/",
            "https://name@relay/",
            "https://[relay]/",
        ] {
            assert!(!is_address(text), "{text}");
        }
        assert!(is_fingerprint(&"0a".repeat(32)));
        for text in ["", "0a", &"0g".repeat(32), "\ndrive: https://elsewhere/?token=x"] {
            assert!(!is_fingerprint(text), "{text}");
        }
    }

    #[test]
    fn a_run_without_a_name_is_called_by_its_machine() {
        assert!(own_name().as_str().parse::<RunName>().is_ok());
    }
}
