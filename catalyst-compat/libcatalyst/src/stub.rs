//! The implementation that answers where none is named: it does nothing, and where `CATALYST_DATA_DUMP_DIRECTORY` is set it writes
//! the nodes that it gets, for `catalyst_replay`.

use std::ffi::c_int;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::{env, fs};

use crate::dump::{self, Stage};
use crate::error::{Error, Result};
use crate::implementation::{Implementation, Status};
use crate::node::Node;
use crate::{files, ranks};

/// The version of Catalyst that is spoken.
pub const VERSION: &str = "2.0.0";
/// The version of its binary interface, which is that of the library's name.
pub const INTERFACE_VERSION: &str = "3";
/// The version of Conduit whose interface is spoken.
pub const CONDUIT_VERSION: &str = "0.9.2";

/// The stub as a table of functions.
pub const IMPLEMENTATION: Implementation =
    Implementation { initialize, execute, finalize, about, results };

static EXECUTED: AtomicU64 = AtomicU64::new(0);

fn dump(stage: Stage, node: *const Node) -> c_int {
    let Some(directory) =
        env::var_os("CATALYST_DATA_DUMP_DIRECTORY").filter(|path| !path.is_empty())
    else {
        return Status::Ok as c_int;
    };
    let written = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| -> Result<()> {
        let directory = PathBuf::from(directory);
        fs::create_dir_all(&directory).map_err(|error| {
            Error::new(format!("'{}' cannot be made: {error}", directory.display()))
        })?;
        let path = dump::path(&directory, stage, ranks::rank_and_size());
        let empty = Node::new();
        // SAFETY: the caller of a Catalyst function hands over null or a live node.
        let node = unsafe { node.as_ref() }.unwrap_or(&empty);
        files::save(node, &path.to_string_lossy(), "conduit_bin")
    }));
    match written {
        Ok(Ok(())) => {}
        Ok(Err(error)) => eprintln!("catalyst: the node of {stage:?} is not written: {error}"),
        Err(_) => {
            eprintln!("catalyst: the node of {stage:?} is not written: a defect of this library")
        }
    }
    Status::Ok as c_int
}

/// `catalyst_stub_initialize`.
///
/// # Safety
/// The node is null or live.
pub unsafe extern "C-unwind" fn initialize(parameters: *const Node) -> c_int {
    dump(Stage::Initialize, parameters)
}

/// `catalyst_stub_execute`.
///
/// # Safety
/// The node is null or live.
pub unsafe extern "C-unwind" fn execute(parameters: *const Node) -> c_int {
    dump(Stage::Execute(EXECUTED.fetch_add(1, Ordering::Relaxed)), parameters)
}

/// `catalyst_stub_finalize`.
///
/// # Safety
/// The node is null or live.
pub unsafe extern "C-unwind" fn finalize(parameters: *const Node) -> c_int {
    dump(Stage::Finalize, parameters)
}

/// `catalyst_stub_about`.
///
/// # Safety
/// The node is null or live, and nobody else uses it.
pub unsafe extern "C-unwind" fn about(parameters: *mut Node) -> c_int {
    // SAFETY: as the caller promises.
    if let Some(Err(error)) = unsafe { parameters.as_mut() }.map(describe) {
        eprintln!("catalyst: {error}");
    }
    Status::Ok as c_int
}

/// `catalyst_stub_results`.
///
/// # Safety
/// The node is null or live, and nobody else uses it.
pub unsafe extern "C-unwind" fn results(_parameters: *mut Node) -> c_int {
    Status::Ok as c_int
}

fn describe(node: &mut Node) -> Result<()> {
    node.at("catalyst/version")?.set_text(VERSION)?;
    node.at("catalyst/abi_version")?.set_text(INTERFACE_VERSION)?;
    node.at("catalyst/implementation")?.set_text("stub")?;
    node.at("catalyst/use_mpi")?.set_number(i32::from(ranks::has_mpi()))?;
    about_conduit(node.at("catalyst/tpl/conduit")?)
}

/// The description of the Conduit whose interface this is.
///
/// # Errors
/// There is no memory.
pub fn about_conduit(node: &mut Node) -> Result<()> {
    node.at("version")?.set_text(CONDUIT_VERSION)?;
    node.at("implementation")?
        .set_text(concat!("tombolo-libcatalyst ", env!("CARGO_PKG_VERSION")))?;
    node.at("index_t")?.set_text("int64")?;
    for (name, width) in [
        ("char", "int8"),
        ("short", "int16"),
        ("int", "int32"),
        ("long", "int64"),
        ("unsigned_char", "uint8"),
        ("unsigned_short", "uint16"),
        ("unsigned_int", "uint32"),
        ("unsigned_long", "uint64"),
        ("float", "float32"),
        ("double", "float64"),
    ] {
        node.at("native_typemap")?.child_named(name)?.set_text(width)?;
    }
    Ok(())
}
