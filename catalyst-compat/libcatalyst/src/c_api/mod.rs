//! The C interface, under the names that solvers link to.
//!
//! Every function takes pointers that its caller vouches for, so each is `unsafe`: a node is null or one that this library made
//! and has not destroyed, a text is null or ends in a nul, an array is as long as stated, and no other thread uses the same tree.
//! A null node or text is an error, not undefined. Errors go to the handler; where that returns, so does the function, with 0 or
//! null. No panic leaves a function.

mod blueprint;
mod catalyst;
mod datatype;
mod node;
mod text;
mod tree;
mod values;

use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

use crate::error::{Error, Result, raise};
use crate::node::Node;

/// Functions of the C interface: the name that is linked to, the function, and its body.
macro_rules! exported {
    ($($name:expr => $function:ident($($argument:ident: $type:ty),* $(,)?) $(-> $answer:ty)? { $($body:tt)* })*) => { $(
        #[unsafe(export_name = $name)]
        unsafe extern "C-unwind" fn $function($($argument: $type),*) $(-> $answer)? {
            // SAFETY: the caller keeps to the rules of this module.
            unsafe { $($body)* }
        }
    )* };
}
pub(crate) use exported;

/// Runs the body of a function; an error is raised after everything in it has been dropped.
pub(crate) fn run<T>(otherwise: T, body: impl FnOnce() -> Result<T>) -> T {
    let failure = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(value)) => return value,
        Ok(Err(error)) => error,
        Err(payload) => {
            drop(payload);
            Error::new("a defect of this library stopped the call")
        }
    };
    raise(failure);
    otherwise
}

/// The node behind a pointer.
///
/// # Safety
/// The pointer is null or a live node that nobody changes while the reference is used.
#[track_caller]
pub(crate) unsafe fn node<'a>(pointer: *const Node) -> Result<&'a Node> {
    // SAFETY: as the caller promises.
    unsafe { pointer.as_ref() }.ok_or_else(|| Error::new("the conduit node is null"))
}

/// The node behind a pointer, to change it.
///
/// # Safety
/// The pointer is null or a live node that nobody else uses while the reference is used.
#[track_caller]
pub(crate) unsafe fn node_mut<'a>(pointer: *mut Node) -> Result<&'a mut Node> {
    // SAFETY: as the caller promises.
    unsafe { pointer.as_mut() }.ok_or_else(|| Error::new("the conduit node is null"))
}

/// The text behind a pointer, as UTF-8; other bytes are replaced.
///
/// # Safety
/// The pointer is null or a text that ends in a nul.
#[track_caller]
pub(crate) unsafe fn string(pointer: *const c_char, what: &str) -> Result<String> {
    if pointer.is_null() {
        return Err(Error::new(format!("{what} is null")));
    }
    // SAFETY: as the caller promises.
    Ok(unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned())
}

/// A copy of a text that the caller frees with `free`.
pub(crate) fn hand_out(text: &str) -> *mut c_char {
    // SAFETY: `malloc` gives null or as many bytes as are written, the last of which is a nul.
    unsafe {
        let copy = libc::malloc(text.len() + 1).cast::<u8>();
        if copy.is_null() {
            return ptr::null_mut();
        }
        ptr::copy_nonoverlapping(text.as_ptr(), copy, text.len());
        copy.add(text.len()).write(0);
        copy.cast()
    }
}

/// Leaves out of a copy what overlaps: a copy of `source` if the two nodes share anything, so that both can be used at once.
///
/// # Safety
/// Both are null or live nodes.
pub(crate) unsafe fn apart(target: *mut Node, source: *const Node) -> Result<Option<Node>> {
    // SAFETY: as the caller promises; both are only read here.
    let (target, source) = unsafe { (node(target)?, node(source)?) };
    if target.holds(source) || source.holds(target) { source.copy().map(Some) } else { Ok(None) }
}
