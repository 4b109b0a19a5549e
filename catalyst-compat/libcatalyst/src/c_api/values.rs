//! The mechanical families: for each type, setting (by value, by pointer, by pointer with a layout; here, at a path; copied,
//! borrowed) and getting (the first element, the address; here, at a path).

use std::ffi::{
    c_char, c_double, c_float, c_int, c_long, c_schar, c_short, c_uchar, c_uint, c_ulong, c_ushort,
};
use std::ptr;

use super::{exported, node, node_mut, run, string};
use crate::datatype::Datatype;
use crate::error::Result;
use crate::leaf::Element;
use crate::node::Node;

/// `char` counts as signed, as in Conduit.
type Char = c_schar;

/// # Safety
/// As the functions of [`super`]; `data` is as long as `layout` says.
unsafe fn set<T: Element>(
    target: *mut Node,
    path: Option<*const c_char>,
    data: *const T,
    layout: Datatype,
) {
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
unsafe fn borrow<T: Element>(
    target: *mut Node,
    path: Option<*const c_char>,
    data: *mut T,
    layout: Datatype,
) {
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

            type Nodes = *mut Node;
            type Path = *const c_char;
            type Values = *mut $type;

            fn compact(elements: i64) -> Datatype {
                Datatype::compact(<$type>::KIND, elements)
            }

            fn laid_out(elements: i64, offset: i64, stride: i64, element_bytes: i64, endianness: i64) -> Datatype {
                Datatype { kind: <$type>::KIND, elements, offset, stride, element_bytes, endianness }
            }

            exported! {
                concat!("catalyst_conduit_node_set_", $stem) =>
                    set_value(node: Nodes, value: $type) { set(node, None, &value, compact(1)) }
                concat!("catalyst_conduit_node_set_path_", $stem) =>
                    set_path_value(node: Nodes, path: Path, value: $type) { set(node, Some(path), &value, compact(1)) }
                concat!("catalyst_conduit_node_set_", $stem, "_ptr") =>
                    set_array(node: Nodes, data: Values, count: i64) { set(node, None, data, compact(count)) }
                concat!("catalyst_conduit_node_set_path_", $stem, "_ptr") =>
                    set_path_array(node: Nodes, path: Path, data: Values, count: i64) {
                        set(node, Some(path), data, compact(count))
                    }
                concat!("catalyst_conduit_node_set_external_", $stem, "_ptr") =>
                    borrow_array(node: Nodes, data: Values, count: i64) { borrow(node, None, data, compact(count)) }
                concat!("catalyst_conduit_node_set_path_external_", $stem, "_ptr") =>
                    borrow_path_array(node: Nodes, path: Path, data: Values, count: i64) {
                        borrow(node, Some(path), data, compact(count))
                    }
                concat!("catalyst_conduit_node_set_", $stem, "_ptr_detailed") =>
                    set_strided(node: Nodes, data: Values, count: i64, offset: i64, stride: i64, bytes: i64, order: i64) {
                        set(node, None, data, laid_out(count, offset, stride, bytes, order))
                    }
                concat!("catalyst_conduit_node_set_path_", $stem, "_ptr_detailed") =>
                    set_path_strided(
                        node: Nodes, path: Path, data: Values, count: i64, offset: i64, stride: i64, bytes: i64, order: i64
                    ) { set(node, Some(path), data, laid_out(count, offset, stride, bytes, order)) }
                concat!("catalyst_conduit_node_set_external_", $stem, "_ptr_detailed") =>
                    borrow_strided(node: Nodes, data: Values, count: i64, offset: i64, stride: i64, bytes: i64, order: i64) {
                        borrow(node, None, data, laid_out(count, offset, stride, bytes, order))
                    }
                concat!("catalyst_conduit_node_set_path_external_", $stem, "_ptr_detailed") =>
                    borrow_path_strided(
                        node: Nodes, path: Path, data: Values, count: i64, offset: i64, stride: i64, bytes: i64, order: i64
                    ) { borrow(node, Some(path), data, laid_out(count, offset, stride, bytes, order)) }
                concat!("catalyst_conduit_node_as_", $stem) => get_value(node: Nodes) -> $type { get(node, None) }
                concat!("catalyst_conduit_node_fetch_path_as_", $stem) =>
                    get_path_value(node: Nodes, path: Path) -> $type { get(node, Some(path)) }
                concat!("catalyst_conduit_node_as_", $stem, "_ptr") =>
                    get_address(node: Nodes) -> Values { address(node, None) }
                concat!("catalyst_conduit_node_fetch_path_as_", $stem, "_ptr") =>
                    get_path_address(node: Nodes, path: Path) -> Values { address(node, Some(path)) }
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
