//! The Catalyst API: each call goes on to the implementation that is loaded, whose exceptions pass through.

use std::ffi::c_int;
use std::panic::{AssertUnwindSafe, catch_unwind};

use super::{node_mut, run};
use crate::implementation::{Implementation, Status};
use crate::loader;
use crate::node::Node;
use crate::stub;

/// The implementation, or the status that says why there is none.
fn implementation(
    find: impl FnOnce() -> Result<Implementation, Status>,
) -> Result<Implementation, c_int> {
    catch_unwind(AssertUnwindSafe(find))
        .unwrap_or(Err(Status::NoImplementation))
        .map_err(|status| status as c_int)
}

fn present() -> Result<Implementation, Status> {
    loader::loaded().ok_or(Status::NoImplementation)
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_initialize(parameters: *const Node) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    match implementation(|| loader::load(unsafe { parameters.as_ref() })) {
        // SAFETY: a function of an implementation's table takes what the caller of Catalyst hands over.
        Ok(found) => unsafe { (found.initialize)(parameters) },
        Err(status) => status,
    }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_execute(parameters: *const Node) -> c_int {
    match implementation(present) {
        // SAFETY: as in `catalyst_initialize`.
        Ok(found) => unsafe { (found.execute)(parameters) },
        Err(status) => status,
    }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_finalize(parameters: *const Node) -> c_int {
    match implementation(present) {
        // SAFETY: as in `catalyst_initialize`.
        Ok(found) => unsafe { (found.finalize)(parameters) },
        Err(status) => status,
    }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_about(parameters: *mut Node) -> c_int {
    match implementation(present) {
        // SAFETY: as in `catalyst_initialize`.
        Ok(found) => unsafe { (found.about)(parameters) },
        Err(status) => status,
    }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_results(parameters: *mut Node) -> c_int {
    match implementation(present) {
        // SAFETY: as in `catalyst_initialize`.
        Ok(found) => unsafe { (found.results)(parameters) },
        Err(status) => status,
    }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_stub_initialize(parameters: *const Node) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { stub::initialize(parameters) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_stub_execute(parameters: *const Node) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { stub::execute(parameters) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_stub_finalize(parameters: *const Node) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { stub::finalize(parameters) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_stub_about(parameters: *mut Node) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { stub::about(parameters) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_stub_results(parameters: *mut Node) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { stub::results(parameters) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_about(target: *mut Node) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run((), || stub::about_conduit(unsafe { node_mut(target)? }));
}
