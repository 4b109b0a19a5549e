//! Catalyst 2 compatibility: Tombolo as an implementation that Catalyst loads.
//!
//! The library exports the data symbol `catalyst_api_impl`, through which `libcatalyst` calls a
//! Catalyst implementation. Copy or link the built `libtombolo_catalyst.so` as
//! `libcatalyst-tombolo.so` and point a solver at it:
//!
//! ```sh
//! CATALYST_IMPLEMENTATION_NAME=tombolo CATALYST_IMPLEMENTATION_PATHS=/where/it/lies ./solver
//! ```
//!
//! # What is read
//! - `catalyst_initialize`: `catalyst/scripts` and `catalyst/pipelines` (files of pipelines that
//!   end in `.json`; the type `io` writes files), `catalyst/parameters/<name>/{value, minimum,
//!   maximum}`, `catalyst/mpi_comm`. Where the node names no file the variable `TOMBOLO_PIPELINES`
//!   may; else the surface of every channel is streamed besides. `TOMBOLO_ORDERS` names a file of
//!   orders, `catalyst/restart` or `TOMBOLO_RESTART` a checkpoint to go on from, `TOMBOLO_OUTPUT` the directory of what is written, `TOMBOLO_REPORT` the file of the
//!   report at the end.
//! - `catalyst_execute`: `catalyst/state/{timestep | cycle, time, time_step}`,
//!   `catalyst/state/checkpoint` (a file: the state of the run at the end of the coming step is saved
//!   in it, to be gone on from with the state that the solver saves then), and each of
//!   `catalyst/channels`: `mesh`, `multimesh`, `amrmesh`, all topologies and shapes of the
//!   Blueprint. Arrays are lent to the adaptor as they lie in memory wherever it reads their type.
//!   The first channel's mesh is the one that orders change, or that of the `channel` of the
//!   pipeline with `"on": "order"`. The cells are those of the topology of the highest dimension;
//!   an integer element field `features`, `boundary_attribute` or `<topology>_attribute` on a
//!   topology of its faces says which feature each belongs to, and `state/features/<name>` of the
//!   channel names them; the faces may be in several topologies, with a field on each. An integer
//!   vertex field `features` does so for vertices. Other topologies of the main dimension, and
//!   fields of any other, are passed over; each is told once. Orders stay in the plane of a mesh
//!   whose coordsets have x and y alone.
//!
//! # What is handed back
//! By `catalyst_results` after each `catalyst_execute`: `catalyst/<channel>` where the mesh is to
//! move over the coming step (its new coordinates, with the fields `displacement` and `velocity`),
//! and `catalyst/steering` with the parameters; both with `coordsets`, `topologies`, `fields` side
//! by side, and below `data` once more.
//!
//! # Guarantees
//! No call panics across the border, no null pointer is followed, and a node that lacks what is
//! needed is answered with a status and a line on standard error that names the path, what was
//! found and what was expected. Before values are read it is asked whether their memory can be. On
//! several ranks an error of one is that of all, so that none waits for another. The host's Conduit
//! is reached only through its own C functions ([`host`]), looked up at run time, so that the
//! library needs no Catalyst to be built.
//!
//! A length that a solver states wrongly, within memory that it has, cannot be known.

mod configuration;
mod error;
pub mod host;
mod mesh;
mod node;
mod results;
mod session;

use std::ffi::c_int;
use std::sync::{Mutex, MutexGuard, PoisonError};

pub use error::{CatalystError, Status};
use host::{Host, RawNode};
use node::{Node, NodeMut};
use session::{Session, SetUp};

/// One function of the table.
type Call = unsafe extern "C" fn(*const RawNode) -> c_int;
/// One function of the table that fills the node it is given.
type CallMut = unsafe extern "C" fn(*mut RawNode) -> c_int;

/// The table that `libcatalyst` looks up by name: a version and five functions, in Catalyst's
/// order.
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
// SAFETY: the name is Catalyst's own for exactly this layout; no other item of this library bears
// it, and the loader reads it from this library's handle alone.
#[unsafe(no_mangle)]
pub static catalyst_api_impl: Implementation =
    Implementation { version: 1, initialize, execute, finalize, about, results };

static SESSION: Mutex<Option<Session>> = Mutex::new(None);

fn session() -> MutexGuard<'static, Option<Session>> {
    // A session is replaced whole, and its calls bring it from one sound state to another or leave
    // it.
    SESSION.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts a session, or starts it anew: Catalyst allows a second `initialize`.
unsafe extern "C" fn initialize(params: *const RawNode) -> c_int {
    answer("catalyst_initialize", || {
        let host = Host::get()?;
        // SAFETY: the caller of a Catalyst function hands over null or a live node of the host's
        // Conduit.
        let node = unsafe { Node::root(host, params) }?;
        // A configuration that cannot be read must not end the run before.
        let set_up = SetUp::read(&node)?;
        // The one before ends first, with its server. What was not written then is told, but is no
        // reason to have no run.
        let before = session().take();
        let ended = before.map_or(Ok(()), Session::finalize);
        match Session::new(set_up) {
            Ok(new) => {
                *session() = Some(new);
                Ok(ended?)
            }
            Err(error) => {
                if let Err(of_before) = ended {
                    eprintln!("tombolo: catalyst_initialize: {of_before}");
                }
                Err(error.into())
            }
        }
    })
}

/// One step of the solver.
unsafe extern "C" fn execute(params: *const RawNode) -> c_int {
    answer("catalyst_execute", || {
        let host = Host::get()?;
        // SAFETY: as in `initialize`.
        let node = unsafe { Node::root(host, params) }?;
        Ok(session().as_mut().ok_or(CatalystError::NotInitialized)?.execute(&node)?)
    })
}

/// Ends the session.
unsafe extern "C" fn finalize(params: *const RawNode) -> c_int {
    answer("catalyst_finalize", || {
        let host = Host::get()?;
        // SAFETY: as in `initialize`.
        unsafe { Node::root(host, params) }?;
        let ended = session().take().ok_or(CatalystError::NotInitialized)?;
        Ok(ended.finalize()?)
    })
}

/// Says who answers; allowed at any time.
unsafe extern "C" fn about(params: *mut RawNode) -> c_int {
    answer("catalyst_about", || {
        let host = Host::get()?;
        // SAFETY: as in `initialize`; `about` hands over a node to be filled, so the caller holds
        // it for us alone.
        let mut node = unsafe { NodeMut::new(host, params) }?;
        node.set_text("catalyst/version", "2.0.0");
        node.set_text("catalyst/abi_version", "3");
        node.set_text("catalyst/implementation", "tombolo");
        node.set_integer("catalyst/use_mpi", i32::from(cfg!(feature = "distributed")));
        node.set_text("tombolo/version", env!("CARGO_PKG_VERSION"));
        Ok(())
    })
}

/// Hands back what is to be done in the step that follows.
unsafe extern "C" fn results(params: *mut RawNode) -> c_int {
    answer("catalyst_results", || {
        let host = Host::get()?;
        // SAFETY: as in `about`.
        let mut node = unsafe { NodeMut::new(host, params) }?;
        session().as_ref().ok_or(CatalystError::NotInitialized)?.results(&mut node);
        Ok(())
    })
}

/// Runs a call so that neither an error nor a panic crosses the border, and says on standard error
/// what went wrong.
fn answer(call: &str, run: impl FnOnce() -> Result<(), CatalystError>) -> c_int {
    let status = match std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)) {
        Ok(Ok(())) => Status::Ok,
        Ok(Err(error)) => {
            eprintln!("tombolo: {call}: {error}");
            error.status()
        }
        Err(_) => {
            eprintln!(
                "tombolo: {call}: a defect of tombolo stopped this call; the solver may go on"
            );
            Status::Failed
        }
    };
    status as c_int
}
