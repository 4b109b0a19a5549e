//! The mechanical families: for each type, setting (by value, by pointer, by pointer with a layout; here, at a path; copied,
//! borrowed) and getting (the first element, the address; here, at a path).

use std::ffi::{c_char, c_double, c_float, c_int, c_long, c_schar, c_short, c_uchar, c_uint, c_ulong, c_ushort};
use std::ptr;

use super::{node, node_mut, run, string};
use crate::datatype::Datatype;
use crate::error::Result;
use crate::leaf::Element;
use crate::node::Node;

/// `char` counts as signed, as in Conduit.
type Char = c_schar;

/// A layout as the C functions take it.
fn layout<T: Element>(elements: i64, offset: i64, stride: i64, element_bytes: i64, endianness: i64) -> Datatype {
    Datatype { kind: T::KIND, elements, offset, stride, element_bytes, endianness }
}

/// # Safety
/// As the functions of [`super`]; `data` is as long as `layout` says.
unsafe fn set<T: Element>(target: *mut Node, path: Option<*const c_char>, data: *const T, layout: Datatype) {
    run((), || {
        // SAFETY: as the caller promises.
        unsafe {
            // An array may be one of a node that `fetch` is about to reshape, so its elements are read first.
            let mut copy = Node::new();
            match path {
                None => node_mut(target)?.set_elements(T::KIND, data.cast(), layout),
                Some(path) => {
                    let path = string(path, "the path")?;
                    if node(target)?.find(&path).is_some() {
                        let found = node_mut(target)?.fetch(&path)?;
                        return node_mut(found)?.set_elements(T::KIND, data.cast(), layout);
                    }
                    copy.set_elements(T::KIND, data.cast(), layout)?;
                    let found = node_mut(target)?.fetch(&path)?;
                    node_mut(found)?.take(copy)
                }
            }
        }
    });
}

/// # Safety
/// As the functions of [`super`]; `data` stays as long as `layout` says for as long as the node refers to it.
unsafe fn borrow<T: Element>(target: *mut Node, path: Option<*const c_char>, data: *mut T, layout: Datatype) {
    run((), || {
        // SAFETY: as the caller promises.
        unsafe {
            let target = match path {
                None => target,
                Some(path) => node_mut(target)?.fetch(&string(path, "the path")?)?,
            };
            node_mut(target)?.borrow_elements(T::KIND, data.cast(), layout)
        }
    });
}

/// # Safety
/// As the functions of [`super`].
unsafe fn get<T: Element + Default>(source: *const Node, path: Option<*const c_char>) -> T {
    // SAFETY: as the caller promises.
    run(T::default(), || unsafe { find(source, path)?.value() })
}

/// # Safety
/// As the functions of [`super`].
unsafe fn address<T: Element>(source: *const Node, path: Option<*const c_char>) -> *mut T {
    run(ptr::null_mut(), || {
        // SAFETY: as the caller promises.
        let found = unsafe { find(source, path) }?;
        found.expect(T::KIND)?;
        Ok(found.element(0).cast())
    })
}

/// # Safety
/// As the functions of [`super`].
unsafe fn find<'a>(source: *const Node, path: Option<*const c_char>) -> Result<&'a Node> {
    // SAFETY: as the caller promises.
    unsafe {
        match path {
            None => node(source),
            Some(path) => node(source)?.existing(&string(path, "the path")?),
        }
    }
}

macro_rules! family {
    ($module:ident, $stem:literal, $type:ty) => {
        mod $module {
            use super::*;

            #[unsafe(export_name = concat!("catalyst_conduit_node_set_", $stem))]
            unsafe extern "C-unwind" fn set_value(target: *mut Node, value: $type) {
                // SAFETY: the caller keeps to `c_api`'s rules; the value is one element.
                unsafe { set(target, None, &value, Datatype::compact(<$type>::KIND, 1)) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_set_path_", $stem))]
            unsafe extern "C-unwind" fn set_path_value(target: *mut Node, path: *const c_char, value: $type) {
                // SAFETY: as `set_value`.
                unsafe { set(target, Some(path), &value, Datatype::compact(<$type>::KIND, 1)) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_set_", $stem, "_ptr"))]
            unsafe extern "C-unwind" fn set_array(target: *mut Node, data: *mut $type, elements: i64) {
                // SAFETY: the caller keeps to `c_api`'s rules.
                unsafe { set(target, None, data, Datatype::compact(<$type>::KIND, elements)) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_set_path_", $stem, "_ptr"))]
            unsafe extern "C-unwind" fn set_path_array(
                target: *mut Node,
                path: *const c_char,
                data: *mut $type,
                elements: i64,
            ) {
                // SAFETY: the caller keeps to `c_api`'s rules.
                unsafe { set(target, Some(path), data, Datatype::compact(<$type>::KIND, elements)) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_set_", $stem, "_ptr_detailed"))]
            unsafe extern "C-unwind" fn set_strided(
                target: *mut Node,
                data: *mut $type,
                elements: i64,
                offset: i64,
                stride: i64,
                element_bytes: i64,
                endianness: i64,
            ) {
                // SAFETY: the caller keeps to `c_api`'s rules.
                unsafe { set(target, None, data, layout::<$type>(elements, offset, stride, element_bytes, endianness)) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_set_path_", $stem, "_ptr_detailed"))]
            unsafe extern "C-unwind" fn set_path_strided(
                target: *mut Node,
                path: *const c_char,
                data: *mut $type,
                elements: i64,
                offset: i64,
                stride: i64,
                element_bytes: i64,
                endianness: i64,
            ) {
                let layout = layout::<$type>(elements, offset, stride, element_bytes, endianness);
                // SAFETY: the caller keeps to `c_api`'s rules.
                unsafe { set(target, Some(path), data, layout) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_set_external_", $stem, "_ptr"))]
            unsafe extern "C-unwind" fn borrow_array(target: *mut Node, data: *mut $type, elements: i64) {
                // SAFETY: the caller keeps to `c_api`'s rules.
                unsafe { borrow(target, None, data, Datatype::compact(<$type>::KIND, elements)) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_set_path_external_", $stem, "_ptr"))]
            unsafe extern "C-unwind" fn borrow_path_array(
                target: *mut Node,
                path: *const c_char,
                data: *mut $type,
                elements: i64,
            ) {
                // SAFETY: the caller keeps to `c_api`'s rules.
                unsafe { borrow(target, Some(path), data, Datatype::compact(<$type>::KIND, elements)) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_set_external_", $stem, "_ptr_detailed"))]
            unsafe extern "C-unwind" fn borrow_strided(
                target: *mut Node,
                data: *mut $type,
                elements: i64,
                offset: i64,
                stride: i64,
                element_bytes: i64,
                endianness: i64,
            ) {
                let layout = layout::<$type>(elements, offset, stride, element_bytes, endianness);
                // SAFETY: the caller keeps to `c_api`'s rules.
                unsafe { borrow(target, None, data, layout) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_set_path_external_", $stem, "_ptr_detailed"))]
            unsafe extern "C-unwind" fn borrow_path_strided(
                target: *mut Node,
                path: *const c_char,
                data: *mut $type,
                elements: i64,
                offset: i64,
                stride: i64,
                element_bytes: i64,
                endianness: i64,
            ) {
                let layout = layout::<$type>(elements, offset, stride, element_bytes, endianness);
                // SAFETY: the caller keeps to `c_api`'s rules.
                unsafe { borrow(target, Some(path), data, layout) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_as_", $stem))]
            unsafe extern "C-unwind" fn get_value(source: *mut Node) -> $type {
                // SAFETY: the caller keeps to `c_api`'s rules.
                unsafe { get(source, None) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_fetch_path_as_", $stem))]
            unsafe extern "C-unwind" fn get_path_value(source: *mut Node, path: *const c_char) -> $type {
                // SAFETY: the caller keeps to `c_api`'s rules.
                unsafe { get(source, Some(path)) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_as_", $stem, "_ptr"))]
            unsafe extern "C-unwind" fn get_address(source: *mut Node) -> *mut $type {
                // SAFETY: the caller keeps to `c_api`'s rules.
                unsafe { address(source, None) }
            }

            #[unsafe(export_name = concat!("catalyst_conduit_node_fetch_path_as_", $stem, "_ptr"))]
            unsafe extern "C-unwind" fn get_path_address(source: *mut Node, path: *const c_char) -> *mut $type {
                // SAFETY: the caller keeps to `c_api`'s rules.
                unsafe { address(source, Some(path)) }
            }
        }
    };
}

family!(int8, "int8", i8);
family!(int16, "int16", i16);
family!(int32, "int32", i32);
family!(int64, "int64", i64);
family!(uint8, "uint8", u8);
family!(uint16, "uint16", u16);
family!(uint32, "uint32", u32);
family!(uint64, "uint64", u64);
family!(float32, "float32", f32);
family!(float64, "float64", f64);
family!(char, "char", Char);
family!(short, "short", c_short);
family!(int, "int", c_int);
family!(long, "long", c_long);
family!(signed_char, "signed_char", c_schar);
family!(signed_short, "signed_short", c_short);
family!(signed_int, "signed_int", c_int);
family!(signed_long, "signed_long", c_long);
family!(unsigned_char, "unsigned_char", c_uchar);
family!(unsigned_short, "unsigned_short", c_ushort);
family!(unsigned_int, "unsigned_int", c_uint);
family!(unsigned_long, "unsigned_long", c_ulong);
family!(float, "float", c_float);
family!(double, "double", c_double);
