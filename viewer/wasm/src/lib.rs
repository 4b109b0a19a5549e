//! What the viewer has of the code that the solver runs, as WebAssembly: the geometry kernel, by which
//! it previews, and the language, by which it checks what is typed.
//!
//! These are two modules, as a page needs the first at once and the second seldom. Each is built with
//! the feature of its name, `kernel` or `language`.
//!
//! The border is plain C and takes numbers only. A call's arguments beyond numbers are written into
//! the room that [`input`] makes; what it answers stands in arrays of the module's memory until the
//! next call. Every call that can fail returns 0 when it did, and its first array is then a text:
//! one line with the kind of the [`Failure`], and the message behind it.
//!
//! | export | input | returns | arrays |
//! |---|---|---|---|
//! | [`open_surface`] | a surface's message | a surface, from 1 | |
//! | [`create_surface`] | see there | a surface, from 1 | |
//! | [`close_surface`] | | | |
//! | [`describe_surface`] | | 1 | points `f64`, triangles `u32`, the feature of each triangle `u32`, mesh vertices `u32`, names of features (JSON) |
//! | [`displacement`] | a stack of edits (JSON) | 1 | the displacement of each vertex `f64` |
//! | [`check`] | | 1 | what is wrong with the shape of the last displacement (a line, empty where it is sound), the first triangles at fault `u32` |
//! | [`skeleton`] | | 1 | nodes `f64`, the number of nodes of each curve `u32`, their nodes `u32`, the node of each vertex `u32` |
//! | [`decode_frame`] | the next frame of a view | 1 | its header (JSON), points `f32`, each field `f64`; where it brought cells: triangles `u32`, lines `u32`, the feature of each triangle `u32` |
//! | [`rehearse`] | | | |
//! | [`check_pipeline`] | a pipeline and the run it is for (JSON) | 1 | its errors (JSON) |
//!
//! Nothing here panics on any input. Should the kernel do so all the same, the module traps: its
//! memory can no longer be relied on, [`panic_text`] says what happened, and the caller makes a new
//! instance.
//!
//! There is no `unsafe` block: the module reads only memory that it owns, through the vectors that
//! own it. A pointer leaves it as a number; what the caller writes through it, it writes into its
//! own sandbox.

mod answer;
mod checker;
#[cfg(feature = "kernel")]
mod geometry;
mod kernel;
#[cfg(feature = "language")]
mod language;
#[cfg(feature = "kernel")]
mod rehearsal;

use std::sync::{Mutex, MutexGuard, Once, PoisonError};

pub use answer::Array;
#[cfg(feature = "kernel")]
pub use geometry::{
    check, close_surface, create_surface, decode_frame, describe_surface, displacement,
    open_surface, rehearse, skeleton,
};
pub use kernel::{Failure, Kernel};
#[cfg(feature = "language")]
pub use language::check_pipeline;

static KERNEL: Mutex<Kernel> = Mutex::new(Kernel::new());
static PANIC: Mutex<String> = Mutex::new(String::new());

/// There is one thread, and a panic ends the instance: nobody ever sees a lock that is held or
/// poisoned.
fn lock<T>(mutex: &'static Mutex<T>) -> MutexGuard<'static, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Room for the input of the next call, `bytes` long and zero; null where there is not so much
/// memory. Valid until the next call of any kind.
#[unsafe(no_mangle)]
pub extern "C" fn input(bytes: usize) -> *mut u8 {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| std::panic::set_hook(Box::new(|panic| *lock(&PANIC) = panic.to_string())));
    lock(&KERNEL).input(bytes).map_or(std::ptr::null_mut(), <[u8]>::as_mut_ptr)
}

/// The number of arrays in the last answer.
#[unsafe(no_mangle)]
pub extern "C" fn arrays() -> usize {
    lock(&KERNEL).arrays().len()
}

/// A pointer to an array of the last answer; null for one that is not there.
#[unsafe(no_mangle)]
pub extern "C" fn array(index: usize) -> *const u8 {
    lock(&KERNEL).arrays().get(index).map_or(std::ptr::null(), Array::as_ptr)
}

/// The length of an array of the last answer, in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn array_bytes(index: usize) -> usize {
    lock(&KERNEL).arrays().get(index).map_or(0, Array::bytes)
}

/// The message of the panic, after a trap; a text of [`panic_text_bytes`] bytes.
#[unsafe(no_mangle)]
pub extern "C" fn panic_text() -> *const u8 {
    lock(&PANIC).as_ptr()
}

/// The length of [`panic_text`].
#[unsafe(no_mangle)]
pub extern "C" fn panic_text_bytes() -> usize {
    lock(&PANIC).len()
}
