//! Finding an implementation of Catalyst and loading it.
//!
//! The name is `catalyst_load/implementation` in the node that initializes, else the variable `CATALYST_IMPLEMENTATION_NAME`; with
//! `CATALYST_IMPLEMENTATION_PREFER_ENV` set the variable comes first. Without a name, or with the name `stub`, the stub answers.
//! Directories are those of
//! `catalyst_load/search_paths`, then of `CATALYST_IMPLEMENTATION_PATHS` (first, where the environment is preferred), then
//! `catalyst` beside this library. The file is `libcatalyst-NAME.so`. `CATALYST_DEBUG` tells each step on standard error.

use std::env;
use std::ffi::{CStr, CString, OsString, c_void};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use crate::implementation::{Implementation, Status, Table};
use crate::node::Node;
use crate::stub;

static LOADED: Mutex<Option<Implementation>> = Mutex::new(None);

/// The implementation that is loaded.
#[must_use]
pub fn loaded() -> Option<Implementation> {
    *LOADED.lock().unwrap_or_else(PoisonError::into_inner)
}

fn debug(message: impl FnOnce() -> String) {
    if env::var_os("CATALYST_DEBUG").is_some() {
        eprintln!("catalyst: {}", message());
    }
}

/// The variable, unless it is empty.
fn variable(name: &str) -> Option<OsString> {
    env::var_os(name).filter(|value| !value.is_empty())
}

/// The implementation that a node and the environment ask for; the one that is loaded, if there is one.
///
/// # Errors
/// A status that says what is wrong; where a file was looked for and not found, standard error says where.
pub fn load(parameters: Option<&Node>) -> Result<Implementation, Status> {
    let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(implementation) = *loaded {
        debug(|| "an implementation is loaded already; it is used again".to_owned());
        return Ok(implementation);
    }
    let prefer_environment = variable("CATALYST_IMPLEMENTATION_PREFER_ENV").is_some();
    debug(|| {
        format!("the environment comes {}", if prefer_environment { "first" } else { "second" })
    });
    let from_node = parameters
        .and_then(|node| node.find("catalyst_load/implementation"))
        .and_then(Node::text_bytes)
        .filter(|name| !name.is_empty())
        .map(OsString::from_vec);
    let from_environment = variable("CATALYST_IMPLEMENTATION_NAME");
    debug(|| {
        format!(
            "'catalyst_load/implementation' is {from_node:?}, CATALYST_IMPLEMENTATION_NAME is {from_environment:?}"
        )
    });
    let name = if prefer_environment {
        from_environment.or(from_node)
    } else {
        from_node.or(from_environment)
    };
    let implementation = match name {
        None => {
            debug(|| "no implementation is named; the stub answers".to_owned());
            stub::IMPLEMENTATION
        }
        Some(name) if name == "stub" => {
            debug(|| "the stub is asked for".to_owned());
            stub::IMPLEMENTATION
        }
        Some(name) => {
            let table = open(&name, &directories(parameters, prefer_environment))?;
            complete(&table)?
        }
    };
    *loaded = Some(implementation);
    Ok(implementation)
}

fn complete(table: &Table) -> Result<Implementation, Status> {
    if table.version != 1 {
        debug(|| format!("the implementation's table is of version {}, not 1", table.version));
        return Err(Status::UnsupportedVersion);
    }
    match *table {
        Table {
            initialize: Some(initialize),
            execute: Some(execute),
            finalize: Some(finalize),
            about: Some(about),
            results: Some(results),
            ..
        } => Ok(Implementation { initialize, execute, finalize, about, results }),
        _ => {
            debug(|| "the implementation lacks a function".to_owned());
            Err(Status::Incomplete)
        }
    }
}

fn directories(parameters: Option<&Node>, prefer_environment: bool) -> Vec<PathBuf> {
    let from_node = parameters
        .and_then(|node| node.find("catalyst_load/search_paths"))
        .into_iter()
        .flat_map(|paths| {
            if paths.count() == 0 {
                vec![paths]
            } else {
                paths.children().map(|(_, path)| path).collect()
            }
        })
        .filter_map(Node::text_bytes)
        .map(|path| PathBuf::from(OsString::from_vec(path)));
    let listed = variable("CATALYST_IMPLEMENTATION_PATHS").unwrap_or_default();
    let from_environment = env::split_paths(&listed).filter(|path| !path.as_os_str().is_empty());
    let beside = own_directory().map(|directory| directory.join("catalyst"));
    if prefer_environment {
        from_environment.chain(from_node).chain(beside).collect()
    } else {
        from_node.chain(from_environment).chain(beside).collect()
    }
}

/// The directory of this library.
fn own_directory() -> Option<PathBuf> {
    let address = load as *const c_void;
    let mut found = std::mem::MaybeUninit::<libc::Dl_info>::zeroed();
    // SAFETY: `dladdr` writes to the structure; the address is one of this library's functions.
    let path = unsafe {
        if libc::dladdr(address, found.as_mut_ptr()) == 0 {
            return None;
        }
        let name = found.assume_init().dli_fname;
        if name.is_null() {
            return None;
        }
        CStr::from_ptr(name).to_bytes().to_vec()
    };
    let path = PathBuf::from(OsString::from_vec(path));
    // Libraries are found through links; what lies beside the link counts, as it does for the linker.
    let path = if path.is_absolute() { path } else { env::current_dir().ok()?.join(path) };
    path.parent().map(Path::to_path_buf)
}

fn open(name: &OsString, directories: &[PathBuf]) -> Result<Table, Status> {
    let mut file = OsString::from("libcatalyst-");
    file.push(name);
    file.push(".so");
    let mut failures = Vec::new();
    for directory in directories {
        let path = directory.join(&file);
        debug(|| format!("looking for '{}'", path.display()));
        let Ok(text) = CString::new(path.as_os_str().as_bytes()) else {
            continue;
        };
        // SAFETY: the path is a C string. Loading a library runs its initializers: that is what naming it asks for.
        let handle = unsafe { libc::dlopen(text.as_ptr(), libc::RTLD_LAZY | libc::RTLD_GLOBAL) };
        if handle.is_null() {
            failures.push(format!("  {}", reason()));
            continue;
        }
        // SAFETY: the handle is open, and stays so; the name is a C string.
        let table = unsafe { libc::dlsym(handle, c"catalyst_api_impl".as_ptr()) };
        if table.is_null() {
            eprintln!("catalyst: '{}' has no 'catalyst_api_impl'", path.display());
            // SAFETY: the handle was opened above and is not used any more.
            unsafe { libc::dlclose(handle) };
            return Err(Status::NotCatalyst);
        }
        debug(|| format!("loaded '{}'", path.display()));
        // SAFETY: the symbol is Catalyst's own for this table; the version is the first field of all versions and is read
        // before the rest is used.
        return Ok(unsafe { table.cast::<Table>().read() });
    }
    eprintln!("catalyst: no '{}' could be loaded from {directories:?}", file.to_string_lossy());
    if !failures.is_empty() {
        eprintln!("{}", failures.join("\n"));
    }
    Err(Status::NotFound)
}

/// Why the last `dlopen` failed.
fn reason() -> String {
    // SAFETY: `dlerror` gives null or a C string that lives until the next call on this thread.
    unsafe {
        let message = libc::dlerror();
        if message.is_null() {
            String::new()
        } else {
            CStr::from_ptr(message).to_string_lossy().into_owned()
        }
    }
}
