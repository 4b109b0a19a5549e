//! Plays back to an implementation what the stub wrote to a directory: `catalyst_replay DIRECTORY`, on as many ranks. A directory
//! that does not hold all of a run is refused. A communicator among the parameters (`mpi_comm`, or `mpi_comm` below any of them) is
//! of the run that was written: it becomes the world of this one, or is left out where there is no MPI.
//!
//! The library is taken from `../lib` beside this program, else from where the linker looks. Under a launcher of MPI, MPI is
//! loaded and initialized first, as implementations that use it expect.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::ExitCode;
use std::{env, ptr};

#[path = "../dump.rs"]
mod dump;
#[path = "../ranks.rs"]
#[allow(dead_code, reason = "shared with the library")]
mod ranks;

use dump::Stage;

type Make = unsafe extern "C-unwind" fn() -> *mut c_void;
type Unmake = unsafe extern "C-unwind" fn(*mut c_void);
type Load = unsafe extern "C-unwind" fn(*mut c_void, *const c_char, *const c_char);
type Call = unsafe extern "C-unwind" fn(*const c_void) -> c_int;
type Count = unsafe extern "C-unwind" fn(*mut c_void) -> i64;
type Child = unsafe extern "C-unwind" fn(*mut c_void, i64) -> *mut c_void;
type Has = unsafe extern "C-unwind" fn(*const c_void, *const c_char) -> c_int;
type Remove = unsafe extern "C-unwind" fn(*mut c_void, *const c_char);
type Set = unsafe extern "C-unwind" fn(*mut c_void, *const c_char, u64);

/// The functions of the library that are used.
struct Catalyst {
    make: Make,
    unmake: Unmake,
    load: Load,
    count: Count,
    child: Child,
    has: Has,
    remove: Remove,
    set: Set,
    initialize: Call,
    execute: Call,
    finalize: Call,
}

fn open(path: &Path) -> Option<*mut c_void> {
    let path = CString::new(path.as_os_str().as_bytes()).ok()?;
    // SAFETY: the path is a C string.
    let handle = unsafe { libc::dlopen(path.as_ptr(), libc::RTLD_NOW | libc::RTLD_GLOBAL) };
    (!handle.is_null()).then_some(handle)
}

fn symbol(handle: *mut c_void, name: &CStr) -> Result<*mut c_void, String> {
    // SAFETY: the handle is open and the name a C string.
    let found = unsafe { libc::dlsym(handle, name.as_ptr()) };
    if found.is_null() { Err(format!("ERROR: the library has no {name:?}")) } else { Ok(found) }
}

impl Catalyst {
    fn find() -> Result<Self, String> {
        let beside = env::current_exe()
            .ok()
            .and_then(|path| Some(path.parent()?.join("../lib/libcatalyst.so.3")));
        let handle = beside
            .and_then(|path| open(&path))
            .or_else(|| open(Path::new("libcatalyst.so.3")))
            .ok_or(
                "ERROR: libcatalyst.so.3 is not found; put its directory into LD_LIBRARY_PATH",
            )?;
        // SAFETY: the library of this name exports these functions with these signatures.
        unsafe {
            Ok(Self {
                make: std::mem::transmute::<*mut c_void, Make>(symbol(
                    handle,
                    c"catalyst_conduit_node_create",
                )?),
                unmake: std::mem::transmute::<*mut c_void, Unmake>(symbol(
                    handle,
                    c"catalyst_conduit_node_destroy",
                )?),
                load: std::mem::transmute::<*mut c_void, Load>(symbol(
                    handle,
                    c"catalyst_conduit_node_load",
                )?),
                count: std::mem::transmute::<*mut c_void, Count>(symbol(
                    handle,
                    c"catalyst_conduit_node_number_of_children",
                )?),
                child: std::mem::transmute::<*mut c_void, Child>(symbol(
                    handle,
                    c"catalyst_conduit_node_child",
                )?),
                has: std::mem::transmute::<*mut c_void, Has>(symbol(
                    handle,
                    c"catalyst_conduit_node_has_path",
                )?),
                remove: std::mem::transmute::<*mut c_void, Remove>(symbol(
                    handle,
                    c"catalyst_conduit_node_remove_path",
                )?),
                set: std::mem::transmute::<*mut c_void, Set>(symbol(
                    handle,
                    c"catalyst_conduit_node_set_path_uint64",
                )?),
                initialize: std::mem::transmute::<*mut c_void, Call>(symbol(
                    handle,
                    c"catalyst_initialize",
                )?),
                execute: std::mem::transmute::<*mut c_void, Call>(symbol(
                    handle,
                    c"catalyst_execute",
                )?),
                finalize: std::mem::transmute::<*mut c_void, Call>(symbol(
                    handle,
                    c"catalyst_finalize",
                )?),
            })
        }
    }

    /// Puts this run's communicator in the place of the one that was written.
    ///
    /// # Safety
    /// The node is live.
    unsafe fn adopt(&self, node: *mut c_void, deepest: bool) {
        let name = c"mpi_comm";
        // SAFETY: the node and its children are live, the name is a C string.
        unsafe {
            if (self.has)(node, name.as_ptr()) != 0 {
                match ranks::world() {
                    Some(world) => (self.set)(node, name.as_ptr(), world),
                    None => (self.remove)(node, name.as_ptr()),
                }
            } else if !deepest {
                for index in 0..(self.count)(node) {
                    self.adopt((self.child)(node, index), true);
                }
            }
        }
    }

    fn play(&self, path: &Path, call: Call) -> Result<(), String> {
        let file = CString::new(path.as_os_str().as_bytes())
            .map_err(|_| "ERROR: a path with a nul in it".to_owned())?;
        // SAFETY: the node is made, filled, used and destroyed here; the path is a C string.
        let status = unsafe {
            let node = (self.make)();
            (self.load)(node, file.as_ptr(), c"conduit_bin".as_ptr());
            self.adopt(node, false);
            let status = call(node);
            (self.unmake)(node);
            status
        };
        if status == 0 {
            Ok(())
        } else {
            Err(format!("ERROR: '{}' was answered with status {status}", path.display()))
        }
    }
}

/// Initializes MPI where a launcher started this; gives what ends it.
fn start_mpi() -> Option<unsafe extern "C" fn() -> c_int> {
    ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"].iter().find_map(env::var_os)?;
    let handle = ["libmpi.so.40", "libmpi.so.12", "libmpich.so.12", "libmpi.so"]
        .iter()
        .find_map(|name| open(Path::new(name)))?;
    let (begin, end) = (symbol(handle, c"MPI_Init").ok()?, symbol(handle, c"MPI_Finalize").ok()?);
    // SAFETY: MPI's C interface gives these functions these signatures; null arguments are allowed since MPI 2.
    unsafe {
        let begin = std::mem::transmute::<
            *mut c_void,
            unsafe extern "C" fn(*mut c_int, *mut c_void) -> c_int,
        >(begin);
        if begin(ptr::null_mut(), ptr::null_mut()) != 0 {
            return None;
        }
        Some(std::mem::transmute::<*mut c_void, unsafe extern "C" fn() -> c_int>(end))
    }
}

fn replay(directory: &Path) -> Result<(), String> {
    let world = ranks::rank_and_size();
    // All ranks read the same directory: one tells for all what is wrong with it.
    let executions = dump::check(directory, world.1)
        .map_err(|message| if world.0 == 0 { message } else { String::new() })?;
    let catalyst = Catalyst::find()?;
    catalyst.play(&dump::path(directory, Stage::Initialize, world), catalyst.initialize)?;
    for number in 0..executions {
        catalyst.play(&dump::path(directory, Stage::Execute(number), world), catalyst.execute)?;
    }
    catalyst.play(&dump::path(directory, Stage::Finalize, world), catalyst.finalize)
}

/// Plays back what the arguments name, on as many ranks as there are.
fn run() -> Result<(), String> {
    let arguments: Vec<_> = env::args_os().skip(1).collect();
    let [directory] = arguments.as_slice() else {
        return Err("ERROR: Expected 1 argument, the data dump directory.\nusage: catalyst_replay DIRECTORY".to_owned());
    };
    let end_mpi = start_mpi();
    let outcome = replay(Path::new(directory));
    if let Some(end_mpi) = end_mpi {
        // SAFETY: MPI was initialized by `start_mpi` and is ended once.
        unsafe { end_mpi() };
    }
    outcome
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            if !message.is_empty() {
                eprintln!("{message}");
            }
            ExitCode::FAILURE
        }
    }
}
