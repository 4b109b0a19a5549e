//! Catalyst 2 compatibility: the C interface of Tombolo.
//!
//! The library exports the data symbol `catalyst_api_impl`, through which `libcatalyst` calls a Catalyst implementation. Copy or
//! link the built `libtombolo_catalyst.so` as `libcatalyst-tombolo.so` and point a solver at it:
//!
//! ```sh
//! CATALYST_IMPLEMENTATION_NAME=tombolo CATALYST_IMPLEMENTATION_PATHS=/where/it/lies ./solver
//! ```
//!
//! # What works
//! - `about` fills `catalyst/version`, `catalyst/abi_version`, `catalyst/implementation`, `catalyst/use_mpi` and
//!   `tombolo/version`.
//! - `initialize`, `execute` and `finalize` keep the order of calls that Catalyst asks for, and `execute` reads
//!   `catalyst/state/timestep` (or `cycle`) and `catalyst/state/time`.
//!
//! # What does not
//! Meshes are not read yet: an `execute` that hands over `catalyst/channels` returns [`Status::ChannelsNotRead`] (103) and says
//! so once on standard error. There is nothing to steer, so `results` writes nothing.
//!
//! # Guarantees
//! No call panics across the border, no null pointer is followed, and a node that lacks what is needed is answered with a
//! status and a line on standard error that names the path. The host's Conduit is reached only through its own C functions
//! ([`host`]), looked up at run time, so that the library needs no Catalyst to be built.

pub mod host;
mod node;
mod session;

use std::ffi::c_int;
use std::sync::{Mutex, MutexGuard, PoisonError};

use host::{Host, RawNode};
use node::{Node, NodeMut};
use session::Session;

/// What a call answers: Catalyst's own statuses, and above 99 those of this implementation (100 to 102 as ParaView uses them).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
#[non_exhaustive]
pub enum Status {
    /// Done.
    Ok = 0,
    /// The call came before `initialize` or after `finalize`.
    NoImplementation = 1,
    /// The process exports no `catalyst_conduit_*` functions that could read or fill its nodes.
    ConduitMismatch = 7,
    /// The node is null, or lacks something that is needed.
    InvalidNode = 100,
    /// The call met a defect of this library; the solver may go on.
    Failed = 102,
    /// The state was read, but the mesh channels that came with it were not: reading them is not implemented.
    ChannelsNotRead = 103,
}

/// Why a call did not answer [`Status::Ok`].
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CatalystError {
    /// The node pointer is null.
    #[error("the conduit node is null")]
    NullNode,
    /// The call came before `initialize` or after `finalize`.
    #[error("called outside of catalyst_initialize ... catalyst_finalize")]
    NotInitialized,
    /// The host exports no usable Conduit.
    #[error("this process does not export '{symbol}'; the solver must be linked with libcatalyst (2.0 or newer)")]
    MissingSymbol {
        /// The first function that was not found.
        symbol: &'static str,
    },
    /// A path that is needed is not there.
    #[error("'{path}' is missing")]
    Missing {
        /// The path, or the paths of which one is needed.
        path: &'static str,
    },
    /// A path holds something else than one number.
    #[error("'{path}' must hold one {expected}, but holds a value of conduit type {found}")]
    NotANumber {
        /// The path.
        path: String,
        /// What is needed.
        expected: &'static str,
        /// Conduit's type number.
        found: i64,
    },
    /// The time is NaN or infinite.
    #[error("'{path}' is {value}; it must be finite")]
    NotFinite {
        /// The path.
        path: &'static str,
        /// The value.
        value: f64,
    },
    /// The channels were not read.
    #[error("mesh channels are not read yet: 'catalyst/channels' is ignored")]
    ChannelsNotRead,
}

impl CatalystError {
    /// The status that says this to the host.
    #[must_use]
    pub fn status(&self) -> Status {
        match self {
            CatalystError::NotInitialized => Status::NoImplementation,
            CatalystError::MissingSymbol { .. } => Status::ConduitMismatch,
            CatalystError::ChannelsNotRead => Status::ChannelsNotRead,
            _ => Status::InvalidNode,
        }
    }
}

/// One function of the table.
type Call = unsafe extern "C" fn(*const RawNode) -> c_int;
/// One function of the table that fills the node it is given.
type CallMut = unsafe extern "C" fn(*mut RawNode) -> c_int;

/// The table that `libcatalyst` looks up by name: a version and five functions, in Catalyst's order.
#[repr(C)]
pub struct Implementation {
    /// The version of this layout: 1.
    pub version: c_int,
    /// `catalyst_initialize`.
    pub initialize: Call,
    /// `catalyst_execute`.
    pub execute: Call,
    /// `catalyst_finalize`.
    pub finalize: Call,
    /// `catalyst_about`.
    pub about: CallMut,
    /// `catalyst_results`.
    pub results: CallMut,
}

/// The data symbol through which Catalyst 2 finds an implementation.
// SAFETY: the name is Catalyst's own for exactly this layout; no other item of this library bears it, and the loader reads it
// from this library's handle alone.
#[unsafe(no_mangle)]
pub static catalyst_api_impl: Implementation =
    Implementation { version: 1, initialize, execute, finalize, about, results };

static SESSION: Mutex<Option<Session>> = Mutex::new(None);

fn session() -> MutexGuard<'static, Option<Session>> {
    // A session is replaced whole, never half written, so one that a panic left behind is still sound.
    SESSION.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts a session, or starts it anew: Catalyst allows a second `initialize`.
unsafe extern "C" fn initialize(params: *const RawNode) -> c_int {
    answer("catalyst_initialize", || {
        let host = Host::get()?;
        // SAFETY: the caller of a Catalyst function hands over null or a live node of the host's Conduit.
        unsafe { Node::new(host, params) }?;
        *session() = Some(Session::default());
        Ok(())
    })
}

/// One step of the solver.
unsafe extern "C" fn execute(params: *const RawNode) -> c_int {
    answer("catalyst_execute", || {
        let host = Host::get()?;
        // SAFETY: as in `initialize`.
        let node = unsafe { Node::new(host, params) }?;
        session().as_mut().ok_or(CatalystError::NotInitialized)?.execute(&node)
    })
}

/// Ends the session.
unsafe extern "C" fn finalize(params: *const RawNode) -> c_int {
    answer("catalyst_finalize", || {
        let host = Host::get()?;
        // SAFETY: as in `initialize`.
        unsafe { Node::new(host, params) }?;
        session().take().map(drop).ok_or(CatalystError::NotInitialized)
    })
}

/// Says who answers; allowed at any time.
unsafe extern "C" fn about(params: *mut RawNode) -> c_int {
    answer("catalyst_about", || {
        let host = Host::get()?;
        // SAFETY: as in `initialize`; `about` hands over a node to be filled, so the caller holds it for us alone.
        let mut node = unsafe { NodeMut::new(host, params) }?;
        node.set_text(c"catalyst/version", c"2.0.0");
        node.set_text(c"catalyst/abi_version", c"3");
        node.set_text(c"catalyst/implementation", c"tombolo");
        node.set_integer(c"catalyst/use_mpi", 0);
        node.set_text(c"tombolo/version", VERSION);
        Ok(())
    })
}

/// Hands nothing back: there is nothing to steer yet.
unsafe extern "C" fn results(params: *mut RawNode) -> c_int {
    answer("catalyst_results", || {
        let host = Host::get()?;
        // SAFETY: as in `about`.
        unsafe { NodeMut::new(host, params) }?;
        session().as_ref().map(|_| ()).ok_or(CatalystError::NotInitialized)
    })
}

const VERSION: &std::ffi::CStr =
    match std::ffi::CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
        Ok(text) => text,
        Err(_) => c"",
    };

/// Runs a call so that neither an error nor a panic crosses the border, and says on standard error what went wrong.
fn answer(call: &str, run: impl FnOnce() -> Result<(), CatalystError>) -> c_int {
    let status = match std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(error)) => {
            if session::is_news(&error) {
                eprintln!("tombolo: {call}: {error}");
            }
            error.status()
        }
        Err(_) => {
            eprintln!("tombolo: {call}: a defect of tombolo stopped this call; the solver may go on");
            Status::Failed
        }
    };
    status as c_int
}
