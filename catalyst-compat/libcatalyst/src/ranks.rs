//! The rank of this process among those that run together, without MPI as something to link to: the MPI that the process has
//! loaded is asked if it runs, else the variables that launchers set.

use std::env;
use std::ffi::{CStr, c_int, c_void};

type Ask = unsafe extern "C" fn(*mut c_int) -> c_int;
type AskOfWorld = unsafe extern "C" fn(*mut c_void, *mut c_int) -> c_int;

fn symbol(name: &CStr) -> Option<*mut c_void> {
    // SAFETY: `name` is a C string, and `RTLD_DEFAULT` needs no open handle.
    let found = unsafe { libc::dlsym(libc::RTLD_DEFAULT, name.as_ptr()) };
    (!found.is_null()).then_some(found)
}

/// Whether the process has an MPI.
#[must_use]
pub fn has_mpi() -> bool {
    symbol(c"MPI_Comm_rank").is_some()
}

/// Rank and size of the world; 0 and 1 for a process by itself.
#[must_use]
pub fn rank_and_size() -> (i32, i32) {
    from_mpi()
        .or_else(from_environment)
        .filter(|(rank, size)| *rank >= 0 && rank < size)
        .unwrap_or((0, 1))
}

/// The world of MPICH and its kin, which is a constant; Open MPI's is an object with a name.
const WORLD: usize = 0x4400_0000;

/// The world as Fortran numbers it, where MPI runs.
#[must_use]
pub fn world() -> Option<u64> {
    from_mpi()?;
    match (symbol(c"ompi_mpi_comm_world"), symbol(c"MPI_Comm_c2f")) {
        (Some(world), Some(convert)) => {
            // SAFETY: a function of this name in a process with Open MPI takes a communicator and gives a number.
            let handle = unsafe {
                std::mem::transmute::<*mut c_void, unsafe extern "C" fn(*mut c_void) -> c_int>(
                    convert,
                )(world)
            };
            u64::try_from(handle).ok()
        }
        _ => u64::try_from(WORLD).ok(),
    }
}

fn from_mpi() -> Option<(i32, i32)> {
    let (initialized, finalized) = (symbol(c"MPI_Initialized")?, symbol(c"MPI_Finalized")?);
    let (rank_of, size_of) = (symbol(c"MPI_Comm_rank")?, symbol(c"MPI_Comm_size")?);
    let world = symbol(c"ompi_mpi_comm_world").unwrap_or(std::ptr::without_provenance_mut(WORLD));
    let (mut started, mut ended, mut rank, mut size) = (0, 0, 0, 0);
    // SAFETY: functions of these names in a process are MPI's, whose C interface gives them these signatures; a communicator is
    // passed in one register by all of them, whether it is an address or an integer.
    unsafe {
        let initialized = std::mem::transmute::<*mut c_void, Ask>(initialized);
        let finalized = std::mem::transmute::<*mut c_void, Ask>(finalized);
        if initialized(&raw mut started) != 0
            || finalized(&raw mut ended) != 0
            || started == 0
            || ended != 0
        {
            return None;
        }
        let rank_of = std::mem::transmute::<*mut c_void, AskOfWorld>(rank_of);
        let size_of = std::mem::transmute::<*mut c_void, AskOfWorld>(size_of);
        if rank_of(world, &raw mut rank) != 0 || size_of(world, &raw mut size) != 0 {
            return None;
        }
    }
    Some((rank, size))
}

fn from_environment() -> Option<(i32, i32)> {
    let read = |name: &str| env::var(name).ok()?.parse().ok();
    [("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"), ("PMI_RANK", "PMI_SIZE")]
        .into_iter()
        .find_map(|(rank, size)| Some((read(rank)?, read(size)?)))
}
