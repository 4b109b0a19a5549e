//! The memory of the process.

/// Gives memory that was freed back to the system. The GNU allocator keeps tens of megabytes of it
/// where large arrays come and go, as they do where a mesh is taken over and made ready: memory that
/// a run which then waits for orders would take from its solver.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(crate) fn give_back_freed() {
    // SAFETY: it may be called at any time on any thread, and touches no memory that is in use.
    unsafe { libc::malloc_trim(0) };
}

/// Other allocators are left to themselves.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) fn give_back_freed() {}
