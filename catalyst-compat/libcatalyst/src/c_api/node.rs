//! Whole trees: set, borrow, update, compact, compare; what they take of memory.

use std::ffi::{c_char, c_int, c_void};
use std::ptr;

use super::{apart, node, node_mut, run, string};
use crate::compare::Comparison;
use crate::error::{Error, Handler, Result, Severity, set_handler};
use crate::node::Node;

/// # Safety
/// As the functions of [`super`].
unsafe fn set(target: *mut Node, path: Option<*const c_char>, source: *const Node) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules; the copy is made before the target is borrowed.
        unsafe {
            let copy = node(source)?.copy()?;
            node_mut(place(target, path)?)?.take(copy)
        }
    });
}

/// # Safety
/// As the functions of [`super`].
unsafe fn borrow(target: *mut Node, path: Option<*const c_char>, source: *const Node) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules; the mirror is made before the target is borrowed.
        unsafe {
            let mirror = node(source)?.mirror()?;
            let target = place(target, path)?;
            if ptr::eq(target, source) {
                return Ok(());
            }
            let (here, there) = (node(target)?, node(source)?);
            if here.holds(there) || there.holds(here) {
                let message = format!(
                    "{} cannot borrow from {}, which it holds or lies in",
                    here.place(),
                    there.place()
                );
                return Err(Error::new(message));
            }
            node_mut(target)?.take(mirror)
        }
    });
}

/// # Safety
/// As the functions of [`super`].
unsafe fn place(target: *mut Node, path: Option<*const c_char>) -> Result<*mut Node> {
    match path {
        None => Ok(target),
        // SAFETY: the caller keeps to `c_api`'s rules.
        Some(path) => unsafe { node_mut(target)?.fetch(&string(path, "the path")?) },
    }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_set_node(target: *mut Node, source: *mut Node) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { set(target, None, source) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_set_path_node(
    target: *mut Node,
    path: *const c_char,
    source: *mut Node,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { set(target, Some(path), source) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_set_external_node(
    target: *mut Node,
    source: *mut Node,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { borrow(target, None, source) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_set_path_external_node(
    target: *mut Node,
    path: *const c_char,
    source: *mut Node,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { borrow(target, Some(path), source) }
}

/// # Safety
/// As the functions of [`super`].
unsafe fn change(
    target: *mut Node,
    source: *const Node,
    how: impl FnOnce(&mut Node, &Node) -> Result<()>,
) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules; nodes that overlap are told apart by a copy.
        unsafe {
            match apart(target, source)? {
                Some(copy) => how(node_mut(target)?, &copy),
                None => how(node_mut(target)?, node(source)?),
            }
        }
    });
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_update(target: *mut Node, source: *const Node) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { change(target, source, Node::update) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_update_compatible(
    target: *mut Node,
    source: *const Node,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { change(target, source, Node::update_compatible) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_update_external(
    target: *mut Node,
    source: *mut Node,
) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules; nodes that overlap are refused.
        unsafe {
            let (here, there) = (node(target)?, node(source)?);
            if here.holds(there) || there.holds(here) {
                return Err(Error::new(format!("{} and {} overlap", here.place(), there.place())));
            }
            node_mut(target)?.update_external(node(source)?)
        }
    });
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_compact_to(
    source: *const Node,
    target: *mut Node,
) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules; the copy is made before the target is borrowed.
        unsafe {
            let compacted = node(source)?.compacted()?;
            node_mut(target)?.take(compacted)
        }
    });
}

/// # Safety
/// As the functions of [`super`].
unsafe fn exchange(target: *mut Node, source: *mut Node, keep: bool) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules; nodes that overlap are refused.
        unsafe {
            let (here, there) = (node(target)?, node(source)?);
            if ptr::eq(here, there) {
                return Ok(());
            }
            if here.holds(there) || there.holds(here) {
                return Err(Error::new(format!("{} and {} overlap", here.place(), there.place())));
            }
            let (here, there) = (node_mut(target)?, node_mut(source)?);
            if !keep {
                here.reset();
            }
            here.swap(there);
            Ok(())
        }
    });
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_swap(target: *mut Node, source: *mut Node) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { exchange(target, source, true) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_move(target: *mut Node, source: *mut Node) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { exchange(target, source, false) }
}

/// # Safety
/// As the functions of [`super`].
unsafe fn difference(
    a: *const Node,
    b: *const Node,
    info: *mut Node,
    epsilon: f64,
    how: Comparison,
) -> c_int {
    run(0, || {
        // SAFETY: the caller keeps to `c_api`'s rules; the report is built apart.
        unsafe {
            let mut report = Node::new();
            let differs = node(a)?.difference(node(b)?, &mut report, epsilon, how)?;
            node_mut(info)?.take(report)?;
            Ok(differs.into())
        }
    })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_diff(
    a: *const Node,
    b: *const Node,
    info: *mut Node,
    epsilon: f64,
) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { difference(a, b, info, epsilon, Comparison::Same) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_diff_compatible(
    a: *const Node,
    b: *const Node,
    info: *mut Node,
    epsilon: f64,
) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { difference(a, b, info, epsilon, Comparison::Within) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_compatible(
    a: *const Node,
    b: *const Node,
) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(0, || Ok(unsafe { node(a)?.compatible(node(b)?) }.into()))
}

macro_rules! answers {
    ($($name:literal: $type:ty = $answer:expr;)*) => { $(
        const _: () = {
            #[unsafe(export_name = concat!("catalyst_conduit_node_", $name))]
            unsafe extern "C-unwind" fn answer(source: *const Node) -> $type {
                // SAFETY: the caller keeps to `c_api`'s rules.
                run(<$type>::default(), || Ok($answer(unsafe { node(source)? }).into()))
            }
        };
    )* };
}
answers! {
    "total_strided_bytes": i64 = Node::strided_bytes;
    "total_bytes_compact": i64 = Node::compact_bytes;
    "total_bytes_allocated": i64 = Node::allocated_bytes;
    "is_compact": c_int = Node::is_compact;
    "is_contiguous": c_int = |source: &Node| source.contiguous_from(ptr::null()).is_some();
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_contiguous_with_node(
    a: *const Node,
    b: *const Node,
) -> c_int {
    run(0, || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        let (here, before) = unsafe { (node(a)?, node(b)?) };
        let end = before.contiguous_from(ptr::null()).filter(|end| !end.is_null());
        Ok(end.is_some_and(|end| here.contiguous_from(end).is_some()).into())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_contiguous_with_address(
    a: *const Node,
    end: *mut c_void,
) -> c_int {
    run(0, || {
        // SAFETY: the caller keeps to `c_api`'s rules; the address is only compared.
        Ok((!end.is_null() && unsafe { node(a)? }.contiguous_from(end.cast()).is_some()).into())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_info(source: *const Node, target: *mut Node) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules; the report is built before the target is borrowed.
        unsafe {
            let report = node(source)?.information()?;
            node_mut(target)?.take(report)
        }
    });
}

macro_rules! handlers {
    ($($name:literal: $severity:ident;)*) => { $(
        const _: () = {
            #[unsafe(export_name = concat!("catalyst_conduit_utils_set_", $name, "_handler"))]
            extern "C-unwind" fn set(handler: Option<Handler>) {
                set_handler(Severity::$severity, handler);
            }
        };
    )* };
}
handlers! { "info": Information; "warning": Warning; "error": Error; }
