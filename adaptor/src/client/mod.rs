//! A client of a run: it watches and steers from another program what a browser watches and steers.
//!
//! A [`Link`] is what a run prints. [`Client::connect`] connects to it, and keeps the connection on a
//! thread of its own until the run ends or the [`Client`] is closed or dropped. Every call here
//! blocks, for as long as it is told at most.
//!
//! ```
//! use std::time::Duration;
//! use tombolo::client::{Client, Event, Link, Options};
//! # use tombolo::{Adaptor, Channel, MeshView, Step, deform::shapes::box_of_tets, pipelines::language};
//! # let config = language::parse(r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"}}"#, "run.json")?;
//! # let mut adaptor = Adaptor::initialize(tombolo::Settings { config, ..Default::default() })?;
//! # let printed = adaptor.link().ok_or("no server")?;
//! # let solver = std::thread::spawn(move || {
//! #     let mut mesh = box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
//! #     for cycle in 0.. {
//! #         let step = Step { cycle, time: 0.01 * cycle as f64, time_step: 0.01 };
//! #         let channel = Channel { name: "solid", mesh: MeshView::from(&mesh), fields: &[] };
//! #         let steering = adaptor.execute(&step, &[channel]).expect("a step");
//! #         let moved = steering.motion.map(|motion| motion.coordinates.to_vec());
//! #         if steering.stop { break }
//! #         if let Some(points) = moved { mesh = mesh.with_points(points).expect("finite") }
//! #         std::thread::sleep(Duration::from_millis(1));
//! #     }
//! #     adaptor.finalize().expect("the end");
//! # });
//! // `printed` is the link of a run that goes on elsewhere.
//! let link: Link = printed.parse()?;
//! let client = Client::connect(&link, &Options::default())?;
//! client.drive(Duration::from_secs(10))?;
//!
//! // Squeezes the box from above, and waits until the solver has the new shape.
//! let order = language::parse_valid(r#"{"edits": [
//!     {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0, 0, -0.2]}}]}"#, "order")?;
//! # client.wait_for_status(Duration::from_secs(60), |status| status.cycle > 2)?;
//! let id = client.order(&order)?;
//! while let Some(told) = client.next(Duration::from_secs(60))? {
//!     match told.event {
//!         Event::Order(order) if order.id == id => {
//!             println!("{:?}: shape {} of {}", order.status, order.shape, order.shapes);
//!             if order.status == tombolo::OrderStatus::Applied { break }
//! #           assert_ne!(order.status, tombolo::OrderStatus::Rejected, "{:?}", order.reason);
//!         }
//!         Event::Error(error) => println!("{}", error.message),
//!         _ => {}
//!     }
//! }
//! client.stop()?;
//! # drop(client);
//! # solver.join().expect("the solver");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What it guarantees
//!
//! - A connection that is lost is made again with growing pauses ([`Options::attempts`] of them), under
//!   the client's old name, so that it has the wheel again. A command that was not answered is sent again
//!   by its id, which is taken once: an order that the run knows is not given twice.
//! - What waits to be read is bounded, by number and by bytes. Beyond it the oldest monitors make way,
//!   then the oldest of all; of `hello` and `status` only the newest waits. [`Client::missed`] counts.
//! - What comes from the network is no more than it may be, and never a panic: what is not understood is
//!   passed on as [`Event::Unknown`], and what is no message at all ends the connection.
//! - One that asks for no [views](Options::views) is sent no frame by a run, whose views rest
//!   while nobody looks at them; a recording sends frames all the same.
//!
//! # What it does not
//!
//! What goes over a link with `http://` is not encrypted: see [`stream`](crate::stream). A client that connects to a run that nobody
//! drives is the one that drives, as any viewer is, unless its [options](Options::drives) say otherwise.

mod connection;
mod error;
mod event;
mod get;
mod state;
mod wheel;

use std::{
    collections::BTreeSet,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread::JoinHandle,
    time::Duration,
};

use serde::Deserialize;
use serde_json::{Value, json};
use tombolo_deform::{edit::Edit, surface::Surface};
use tombolo_pipelines::{
    encode::decode_surface,
    language::{Change, Command, LinkFor, Order, Parameter, Question},
    limits::{DOCUMENT, EDITS, ORDERS_BYTES},
};

pub use crate::link::{Link, LinkError};
use crate::stream::UNDRIVEN;
pub use error::ClientError;
pub use event::{
    Complaint, Done, End, Event, Foretold, Hello, LinkTold, MonitorName, ParameterInformation,
    People, Person, PipelinesChanged, Precision, Received, Role, StackChange, Status,
    StatusQuality, Values, View,
};
use state::{Pending, Shared};

/// Bytes of a reference surface.
const SURFACE: usize = 1 << 30;
/// How long closing may take: a server takes the message that is on its way, or is given up.
const CLOSING: Duration = Duration::from_secs(12);

/// When a client whose link is for driving is the one that drives. One that drove and lost its connection
/// drives again when it is back in time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Drives {
    /// From the start where nobody else does, and else once it [asks](Client::drive).
    #[default]
    IfFree,
    /// Once it [asks](Client::drive).
    OnRequest,
    /// Never: it only watches.
    Never,
}

impl Drives {
    /// The word for it in the address of the WebSocket, if it has one.
    pub(crate) fn role(self) -> Option<&'static str> {
        match self {
            Self::IfFree => None,
            Self::OnRequest => Some("idle"),
            Self::Never => Some("watch"),
        }
    }
}

/// How a client behaves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// Whether the frames of the live views are decoded and handed out; `false` if left out.
    pub views: bool,
    /// When the client is the one that drives; [`Drives::IfFree`] if left out.
    pub drives: Drives,
    /// How long the run may take to answer a question; the first surface is encoded meanwhile. Where
    /// it is less than 20 seconds, connecting takes no longer either.
    pub answer: Duration,
    /// How often a lost connection is tried to be made again, one after the other; 0 for never.
    pub attempts: u32,
    /// The pause before the first attempt; each next one is twice as long.
    pub first_pause: Duration,
    /// The longest pause.
    pub longest_pause: Duration,
}

impl Default for Options {
    /// No views, answers within two minutes, and ten attempts within about one.
    fn default() -> Self {
        Self {
            views: false,
            drives: Drives::IfFree,
            answer: Duration::from_secs(120),
            attempts: 10,
            first_pause: Duration::from_millis(250),
            longest_pause: Duration::from_secs(10),
        }
    }
}

/// A client that is connected to a run. [Closing](Self::close) or dropping it ends the connection.
///
/// See the [module](self) for an example.
pub struct Client {
    link: Link,
    /// How long an answer may take.
    answer: Duration,
    /// Whether frames are handed out.
    has_views: bool,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    /// The prefix of this client's ids, which no other client uses.
    mark: u32,
    count: AtomicU64,
}

impl Client {
    /// Connects to a run; returns once it has said hello.
    ///
    /// # Errors
    /// [`ClientError`] says why there is no connection. The first one is tried once.
    pub fn connect(link: &Link, options: &Options) -> Result<Self, ClientError> {
        let system = |reason: String| ClientError::System { reason };
        let mut mark = [0; 4];
        getrandom::fill(&mut mark).map_err(|error| system(error.to_string()))?;
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(|error| system(error.to_string()))?;
        let shared = Arc::new(Shared::default());
        if !options.views {
            shared.with(|state| state.chosen = Some(BTreeSet::new()));
        }
        let (answer, has_views) = (options.answer, options.views);
        let (on_thread, of, options) = (Arc::clone(&shared), link.clone(), options.clone());
        let serve = move || {
            let failure = runtime.block_on(connection::run(&of, &options, &on_thread));
            // A name that is still being looked up is not waited for.
            runtime.shutdown_background();
            on_thread.with(|state| state.failure = Some(failure));
        };
        let thread = std::thread::Builder::new().name("tombolo-client".into()).spawn(serve);
        let thread = Some(thread.map_err(|error| system(error.to_string()))?);
        let mark = u32::from_le_bytes(mark);
        let (link, count) = (link.clone(), AtomicU64::new(0));
        let client = Self { link, answer, has_views, shared, thread, mark, count };
        let joined = client.shared.wait(Duration::MAX, |state| match &state.hello {
            Some(_) => Some(Ok(())),
            None => state.failure.clone().map(Err),
        });
        joined.unwrap_or(Err(ClientError::Closed)).map(|()| client)
    }

    /// The link it was connected by.
    #[must_use]
    pub fn link(&self) -> &Link {
        &self.link
    }

    /// The facts of the run as last received; never `None` once connected.
    #[must_use]
    pub fn hello(&self) -> Option<Arc<Hello>> {
        self.shared.with(|state| state.hello.clone())
    }

    /// How far the solver is, as it was last told.
    #[must_use]
    pub fn status(&self) -> Option<Arc<Status>> {
        self.shared.with(|state| state.status.clone())
    }

    /// How the run has ended, where it has.
    #[must_use]
    pub fn end(&self) -> Option<End> {
        self.shared.with(|state| state.end.clone())
    }

    /// Whether this client steers.
    #[must_use]
    pub fn drives(&self) -> bool {
        self.hello().is_some_and(|hello| hello.role == Role::Driver)
    }

    /// How many events made way for newer ones before anybody had read them.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.shared.with(|state| state.missed)
    }

    /// The next event, in the order in which they came, texts before frames; `None` where nothing
    /// came within `patience`.
    ///
    /// # Errors
    /// [`ClientError::Closed`] behind the last event of a run that has ended, and
    /// [`ClientError::Lost`] where the connection could not be made again.
    pub fn next(&self, patience: Duration) -> Result<Option<Received>, ClientError> {
        self.shared.next(patience)
    }

    /// Waits until the status says something, also if it is that of before.
    ///
    /// # Errors
    /// [`ClientError::NoAnswer`] after `patience`, or why nothing comes any more.
    pub fn wait_for_status(
        &self,
        patience: Duration,
        mut fits: impl FnMut(&Status) -> bool,
    ) -> Result<Arc<Status>, ClientError> {
        let found = self.shared.wait(patience, |state| {
            let status = state.status.as_ref().filter(|status| fits(status));
            match (status, &state.failure) {
                (Some(status), _) => Some(Ok(Arc::clone(status))),
                (None, failure) => failure.clone().map(Err),
            }
        });
        found.unwrap_or_else(|| Err(no_answer("the question how far it is", patience)))
    }

    /// Sends a command; returns its id, which comes back in the answers to it: of an order in
    /// [`Event::Order`], of a change of the pipelines in [`Event::Pipelines`], and of all others in
    /// [`Event::Done`] once the solver has come to it. [`Event::Error`] answers one that is refused.
    ///
    /// # Errors
    /// Where too much waits for an answer, or nothing is sent any more.
    pub fn send(&self, command: &Command) -> Result<String, ClientError> {
        self.say(&json!(command))
    }

    /// Gives an order of a new shape; returns its id.
    ///
    /// # Errors
    /// As of [`Client::send`].
    pub fn order(&self, order: &Order) -> Result<String, ClientError> {
        self.send(&Command::Order(order.clone()))
    }

    /// Takes the last orders back; returns the id of the order that does so.
    ///
    /// # Errors
    /// As of [`Client::send`].
    pub fn undo(&self, count: std::num::NonZeroU32) -> Result<String, ClientError> {
        self.order(&Change::Undo(count).into())
    }

    /// Asks what an order would come to; the answer is an [`Event::Forecast`] of this id.
    ///
    /// # Errors
    /// As of [`Client::send`].
    pub fn forecast(&self, order: &Order) -> Result<String, ClientError> {
        self.say(&json!(Question::Forecast(order.clone())))
    }

    /// Takes back the forecasts that it asked for: the run gives them up, and answers each with an error,
    /// unless its answer is on its way. The answer to this is an [`Event::Done`] of the id.
    ///
    /// # Errors
    /// As of [`Client::send`].
    pub fn withdraw_forecast(&self) -> Result<String, ClientError> {
        self.say(&json!(Question::WithdrawForecast {}))
    }

    /// Holds the solver at its next safe point.
    ///
    /// # Errors
    /// As of [`Client::send`].
    pub fn pause(&self) -> Result<String, ClientError> {
        self.send(&Command::Pause {})
    }

    /// Lets the solver go on.
    ///
    /// # Errors
    /// As of [`Client::send`].
    pub fn resume(&self) -> Result<String, ClientError> {
        self.send(&Command::Resume {})
    }

    /// Asks the solver to end.
    ///
    /// # Errors
    /// As of [`Client::send`].
    pub fn stop(&self) -> Result<String, ClientError> {
        self.send(&Command::Stop {})
    }

    /// Gives a parameter of the solver a new value.
    ///
    /// # Errors
    /// As of [`Client::send`].
    pub fn set(&self, name: &str, value: f64) -> Result<String, ClientError> {
        self.send(&Command::Parameter(Parameter { name: name.into(), value }))
    }

    /// Chooses the views whose frames are sent, by name; all of them where that is `None`, as they are at
    /// first. A name that no view has yet counts once one has it. Views at which nobody looks rest. A
    /// client that asked for no [views](Options::views) is sent none whatever it chooses.
    ///
    /// # Errors
    /// [`ClientError::TooMuch`] where the names are more than a run reads: 16 KiB of JSON.
    pub fn choose_views(&self, names: Option<BTreeSet<String>>) -> Result<(), ClientError> {
        let found = connection::choice(names.as_ref()).len();
        if found > UNDRIVEN {
            let what = "bytes of a choice of views";
            return Err(ClientError::TooMuch { what, found, most: UNDRIVEN });
        }
        if self.has_views {
            self.shared.with(|state| state.choose(names));
            self.shared.wake.notify_one();
        }
        Ok(())
    }

    /// A link that opens one browser, once, to watch or to drive: the address of this client's own
    /// [`Link`] with a key in place of its token. A run that is reached through a socket at a path has
    /// none that a browser could open: there it is a path with the key.
    ///
    /// # Errors
    /// [`ClientError::Rejected`] where this client may not give such a link, and
    /// [`ClientError::NoAnswer`] after `patience`.
    pub fn link_for(&self, rights: LinkFor, patience: Duration) -> Result<String, ClientError> {
        let id = self.id();
        self.shared.with(|state| state.asked.insert(id.clone(), None));
        let message = json!({"id": id, "link": {"for": rights}});
        let answered = self.transmit(id.clone(), &message).map(|()| {
            self.shared.wait(patience, |state| match state.asked.get_mut(&id)?.take() {
                Some(answer) => Some(Ok(answer)),
                None => state.failure.clone().map(Err),
            })
        });
        self.shared.with(|state| state.asked.remove(&id));
        match answered? {
            Some(Ok(Event::Link(link))) => Ok(self.link.opened_by(&link.path)),
            Some(Ok(Event::Error(error))) => Err(ClientError::Rejected { reason: error.message }),
            Some(Err(failure)) => Err(failure),
            _ => Err(no_answer("the question for a link", patience)),
        }
    }

    /// The pipelines as they are now, a JSON list.
    ///
    /// # Errors
    /// [`ClientError`] where the answer is none, or comes later than [`Options::answer`].
    pub fn pipelines(&self) -> Result<Value, ClientError> {
        let body = self.get("pipelines", &[], DOCUMENT.most)?;
        serde_json::from_slice(&body).map_err(|error| self.wrong(&error))
    }

    /// The edits that make the shape now, the oldest first. Long ones come in several answers; where
    /// the stack changes meanwhile it is asked for anew.
    ///
    /// # Errors
    /// [`ClientError`] where the answer is none, or comes later than [`Options::answer`].
    pub fn stack(&self) -> Result<Vec<Edit>, ClientError> {
        #[derive(Deserialize)]
        struct Answer {
            revision: u64,
            count: usize,
            edits: Vec<Edit>,
        }
        let (mut revision, mut stack, mut bytes) = (None, Vec::new(), 0_usize);
        for _ in 0..EDITS.most {
            let from = stack.len().to_string();
            let body = self.get("stack", &[("from", &from)], 2 * DOCUMENT.most)?;
            let answer: Answer =
                serde_json::from_slice(&body).map_err(|error| self.wrong(&error))?;
            if revision.is_some_and(|revision| revision != answer.revision) {
                (revision, stack, bytes) = (None, Vec::new(), 0);
                continue;
            }
            revision = Some(answer.revision);
            let is_more = !answer.edits.is_empty();
            bytes += answer.edits.iter().map(Edit::bytes).sum::<usize>();
            ORDERS_BYTES.check(bytes).map_err(|exceeded| self.wrong(&exceeded))?;
            stack.extend(answer.edits);
            EDITS.check(stack.len()).map_err(|exceeded| self.wrong(&exceeded))?;
            if stack.len() >= answer.count {
                return Ok(stack);
            }
            if !is_more {
                break;
            }
        }
        let found = "a stack of edits that has no end".into();
        Err(get::not_tombolo(&self.link, found))
    }

    /// The reference surface, every bit of it: what edits are measured from.
    ///
    /// # Errors
    /// [`ClientError::Answer`] with the status 404 as long as there is no mesh whose shape could be
    /// changed; [`ClientError::NoAnswer`] after [`Options::answer`].
    pub fn surface(&self) -> Result<Surface, ClientError> {
        let body = self.get("surface", &[], SURFACE)?;
        decode_surface(&body).map_err(|error| self.wrong(&error))
    }

    /// The error of an answer that cannot be read; the reason may hold words of the server.
    fn wrong(&self, reason: &dyn std::fmt::Display) -> ClientError {
        get::not_tombolo(&self.link, get::shown(reason.to_string().as_bytes()))
    }

    /// Asks for a path.
    fn get(
        &self,
        path: &'static str,
        query: &[(&str, &str)],
        most: usize,
    ) -> Result<Vec<u8>, ClientError> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|error| ClientError::System { reason: error.to_string() })?;
        let asked = get::get(&self.link, path, query, most);
        let answered = runtime.block_on(async { tokio::time::timeout(self.answer, asked).await });
        runtime.shutdown_background();
        let late = |_| no_answer(&format!("the question for its {path}"), self.answer);
        let answer = answered.map_err(late)??;
        match answer.status {
            200 => Ok(answer.body),
            status => Err(get::refused(&self.link, path, status, &answer.body)),
        }
    }

    /// Ends the connection as dropping the client does, for those who cannot drop it; the run goes on.
    /// Commands, and [`next`](Self::next) behind the last event, answer [`ClientError::Closed`] then.
    pub fn close(&self) {
        self.let_go();
        self.shared.wait(CLOSING, |state| state.failure.is_some().then_some(()));
    }

    fn let_go(&self) {
        self.shared.with(|state| state.closing = true);
        self.shared.wake.notify_one();
    }

    fn id(&self) -> String {
        let count = self.count.fetch_add(1, Ordering::Relaxed) + 1;
        format!("k{:08x}-{count}", self.mark)
    }

    fn say(&self, message: &Value) -> Result<String, ClientError> {
        let (id, mut message) = (self.id(), message.clone());
        message["id"] = json!(id);
        self.transmit(id.clone(), &message)?;
        Ok(id)
    }

    fn transmit(&self, id: String, message: &Value) -> Result<(), ClientError> {
        let text = message.to_string();
        DOCUMENT.check(text.len()).map_err(|exceeded| ClientError::TooMuch {
            what: "bytes of a command",
            found: exceeded.found,
            most: exceeded.limit.most,
        })?;
        self.shared.send(Pending { id, text, is_sent: false })
    }
}

fn no_answer(what: &str, patience: Duration) -> ClientError {
    ClientError::NoAnswer { what: what.into(), seconds: patience.as_secs_f64() }
}

impl Drop for Client {
    fn drop(&mut self) {
        self.let_go();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
