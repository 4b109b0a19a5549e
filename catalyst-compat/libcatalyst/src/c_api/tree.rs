//! Making, finding, removing and naming nodes, and the addresses of their data.

use std::ffi::{c_char, c_int, c_void};
use std::ptr;

use super::{hand_out, node, node_mut, run, string};
use crate::datatype::{Datatype, Kind};
use crate::error::{Error, Result};
use crate::memory::Memory;
use crate::node::Node;

#[unsafe(no_mangle)]
extern "C-unwind" fn catalyst_conduit_node_create() -> *mut Node {
    Box::into_raw(Box::default())
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_destroy(target: *mut Node) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules; a root came from `catalyst_conduit_node_create`.
        unsafe {
            if target.as_ref().is_some_and(Node::is_root) {
                drop(Box::from_raw(target));
            }
        }
        Ok(())
    });
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_reset(target: *mut Node) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        unsafe { node_mut(target)? }.reset();
        Ok(())
    });
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_fetch(
    target: *mut Node,
    path: *const c_char,
) -> *mut Node {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(ptr::null_mut(), || unsafe { node_mut(target)?.fetch(&string(path, "the path")?) })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_fetch_existing(
    source: *mut Node,
    path: *const c_char,
) -> *mut Node {
    run(ptr::null_mut(), || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        let found = unsafe { node(source)?.existing(&string(path, "the path")?)? };
        Ok(ptr::from_ref(found).cast_mut())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_append(target: *mut Node) -> *mut Node {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(ptr::null_mut(), || unsafe { node_mut(target)?.append().map(ptr::from_mut) })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_add_child(
    target: *mut Node,
    name: *const c_char,
) -> *mut Node {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(ptr::null_mut(), || unsafe {
        node_mut(target)?.child_named(&string(name, "the name")?).map(ptr::from_mut)
    })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_child(
    source: *mut Node,
    index: i64,
) -> *mut Node {
    run(ptr::null_mut(), || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        let source = unsafe { node_mut(source)? };
        let found = usize::try_from(index).ok().filter(|index| *index < source.count());
        match found.and_then(|index| source.child_mut(index)) {
            Some(child) => Ok(ptr::from_mut(child)),
            None => Err(no_child(source, index)),
        }
    })
}

#[track_caller]
fn no_child(source: &Node, index: i64) -> Error {
    Error::new(format!(
        "{} has {} children, none of number {index}",
        source.place(),
        source.count()
    ))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_child_by_name(
    source: *mut Node,
    name: *const c_char,
) -> *mut Node {
    run(ptr::null_mut(), || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        let (source, name) = unsafe { (node(source)?, string(name, "the name")?) };
        match source.get(&name) {
            Some(child) => Ok(ptr::from_ref(child).cast_mut()),
            None => Err(Error::new(format!("{} has no child '{name}'", source.place()))),
        }
    })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_number_of_children(source: *mut Node) -> i64 {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(0, || Ok(i64::try_from(unsafe { node(source)? }.count()).unwrap_or(i64::MAX)))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_number_of_elements(source: *mut Node) -> i64 {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(0, || Ok(unsafe { node(source)? }.datatype().elements))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_remove_path(
    target: *mut Node,
    path: *const c_char,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run((), || unsafe { node_mut(target)?.remove_path(&string(path, "the path")?) });
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_remove_child(target: *mut Node, index: i64) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        let target = unsafe { node_mut(target)? };
        target.remove(usize::try_from(index).map_err(|_| no_child(target, index))?)
    });
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_remove_child_by_name(
    target: *mut Node,
    name: *const c_char,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run((), || unsafe { node_mut(target)?.remove_named(&string(name, "the name")?) });
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_rename_child(
    target: *mut Node,
    old: *const c_char,
    new: *const c_char,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run((), || unsafe {
        node_mut(target)?.rename(&string(old, "the name")?, &string(new, "the new name")?)
    });
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_name(source: *const Node) -> *mut c_char {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(ptr::null_mut(), || Ok(hand_out(&unsafe { node(source)? }.name())))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_path(source: *const Node) -> *mut c_char {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(ptr::null_mut(), || Ok(hand_out(&unsafe { node(source)? }.path())))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_has_child(
    source: *const Node,
    name: *const c_char,
) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(0, || Ok(unsafe { node(source)?.get(&string(name, "the name")?) }.is_some().into()))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_has_path(
    source: *const Node,
    path: *const c_char,
) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(0, || Ok(unsafe { node(source)?.find(&string(path, "the path")?) }.is_some().into()))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_is_root(source: *mut Node) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(0, || Ok(unsafe { node(source)? }.is_root().into()))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_parent(source: *mut Node) -> *mut Node {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(ptr::null_mut(), || Ok(unsafe { node(source)? }.parent().cast_mut()))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_is_data_external(source: *const Node) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(0, || Ok(matches!(unsafe { node(source)? }.memory, Memory::Borrowed(_)).into()))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_data_ptr(source: *mut Node) -> *mut c_void {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(ptr::null_mut(), || Ok(unsafe { node(source)? }.data().cast()))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_element_ptr(
    source: *mut Node,
    index: i64,
) -> *mut c_void {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(ptr::null_mut(), || Ok(unsafe { node(source)? }.element(index).cast()))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_fetch_path_data_ptr(
    source: *mut Node,
    path: *const c_char,
) -> *mut c_void {
    run(ptr::null_mut(), || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        Ok(unsafe { node(source)?.existing(&string(path, "the path")?)? }.data().cast())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_fetch_node_data_ptr(
    source: *mut Node,
    path: *const c_char,
) -> *mut c_void {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { catalyst_conduit_node_fetch_path_data_ptr(source, path) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_fetch_path_element_ptr(
    source: *mut Node,
    path: *const c_char,
    index: i64,
) -> *mut c_void {
    run(ptr::null_mut(), || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        Ok(unsafe { node(source)?.existing(&string(path, "the path")?)? }.element(index).cast())
    })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_dtype(source: *const Node) -> *const Datatype {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(ptr::null(), || Ok(ptr::from_ref(unsafe { node(source)? }.datatype())))
}

/// # Safety
/// As the functions of [`super`].
unsafe fn set_text(target: *mut Node, path: Option<*const c_char>, value: *const c_char) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        unsafe {
            // Read before the tree changes: it may be the text of a node of this tree.
            if value.is_null() {
                return Err(Error::new("the text is null"));
            }
            let bytes = std::ffi::CStr::from_ptr(value).to_bytes().to_vec();
            node_mut(at(target, path)?)?.set_text(bytes)
        }
    });
}

/// # Safety
/// As the functions of [`super`].
unsafe fn borrow_text(target: *mut Node, path: Option<*const c_char>, value: *mut c_char) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        unsafe {
            if value.is_null() {
                return Err(Error::new("the text is null"));
            }
            let length = i64::try_from(libc::strlen(value) + 1)
                .map_err(|_| Error::new("too long a text"))?;
            let layout = Datatype::compact(Kind::Text, length);
            node_mut(at(target, path)?)?.borrow_elements(Kind::Text, value.cast(), layout)
        }
    });
}

/// # Safety
/// As the functions of [`super`].
unsafe fn at(target: *mut Node, path: Option<*const c_char>) -> Result<*mut Node> {
    match path {
        None => Ok(target),
        // SAFETY: the caller keeps to `c_api`'s rules.
        Some(path) => unsafe { node_mut(target)?.fetch(&string(path, "the path")?) },
    }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_set_char8_str(
    target: *mut Node,
    value: *const c_char,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { set_text(target, None, value) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_set_path_char8_str(
    target: *mut Node,
    path: *const c_char,
    value: *const c_char,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { set_text(target, Some(path), value) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_set_external_char8_str(
    target: *mut Node,
    value: *mut c_char,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { borrow_text(target, None, value) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_set_path_external_char8_str(
    target: *mut Node,
    path: *const c_char,
    value: *mut c_char,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { borrow_text(target, Some(path), value) }
}

fn text_address(source: &Node) -> Result<*mut c_char> {
    source.expect(Kind::Text)?;
    Ok(source.element(0).cast())
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_as_char8_str(source: *mut Node) -> *mut c_char {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(ptr::null_mut(), || text_address(unsafe { node(source)? }))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_node_fetch_path_as_char8_str(
    source: *mut Node,
    path: *const c_char,
) -> *mut c_char {
    run(ptr::null_mut(), || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        text_address(unsafe { node(source)?.existing(&string(path, "the path")?)? })
    })
}
