//! The host's Conduit: the C functions of the process that called, found at run time.
//!
//! A node's layout belongs to the Conduit that made it. `libcatalyst` exports that Conduit's C
//! functions under the prefix `catalyst_conduit_`; they are looked up in the process, first in the
//! global scope, then in a loaded `libcatalyst.so.3` (which a Python host loads without making its
//! symbols global).

use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::OnceLock;

use crate::error::CatalystError;

/// A node of the host's Conduit; only ever behind a pointer.
#[repr(C)]
pub struct RawNode {
    _private: [u8; 0],
}

/// A data type of the host's Conduit; only ever behind a pointer.
#[repr(C)]
pub struct RawDatatype {
    _private: [u8; 0],
}

macro_rules! host_functions {
    ($($field:ident: $symbol:literal => $signature:ty,)*) => {
        /// The functions of the host's Conduit that are called. Signatures are those of Conduit's C
        /// interface.
        pub(crate) struct Host {
            $(pub(crate) $field: $signature,)*
        }

        impl Host {
            fn look_up() -> Result<Host, &'static str> {
                Ok(Host {
                    $($field: {
                        let address = symbol(concat!("catalyst_conduit_", $symbol, "\0"))
                            .ok_or(concat!("catalyst_conduit_", $symbol))?;
                        // SAFETY: a function of this name in a process that speaks Catalyst 2 is
                        // Conduit's, whose C interface gives it this signature; the address is not
                        // null (`symbol`), and function and data pointers have one size on every
                        // platform that has `dlsym`.
                        unsafe { std::mem::transmute::<*mut c_void, $signature>(address) }
                    },)*
                })
            }
        }
    };
}

host_functions! {
    number_of_children: "node_number_of_children" => unsafe extern "C" fn(*mut RawNode) -> i64,
    child: "node_child" => unsafe extern "C" fn(*mut RawNode, i64) -> *mut RawNode,
    has_child: "node_has_child" => unsafe extern "C" fn(*const RawNode, *const c_char) -> c_int,
    child_by_name: "node_child_by_name" => unsafe extern "C" fn(*mut RawNode, *const c_char) -> *mut RawNode,
    name: "node_name" => unsafe extern "C" fn(*const RawNode) -> *mut c_char,
    dtype: "node_dtype" => unsafe extern "C" fn(*const RawNode) -> *const RawDatatype,
    element: "node_element_ptr" => unsafe extern "C" fn(*mut RawNode, i64) -> *mut c_void,
    type_number: "datatype_id" => unsafe extern "C" fn(*const RawDatatype) -> i64,
    count: "datatype_number_of_elements" => unsafe extern "C" fn(*const RawDatatype) -> i64,
    stride: "datatype_stride" => unsafe extern "C" fn(*const RawDatatype) -> i64,
    endianness: "datatype_endianness" => unsafe extern "C" fn(*const RawDatatype) -> i64,
    fetch: "node_fetch" => unsafe extern "C" fn(*mut RawNode, *const c_char) -> *mut RawNode,
    has_path: "node_has_path" => unsafe extern "C" fn(*const RawNode, *const c_char) -> c_int,
    remove_path: "node_remove_path" => unsafe extern "C" fn(*mut RawNode, *const c_char),
    set_text: "node_set_path_char8_str" => unsafe extern "C" fn(*mut RawNode, *const c_char, *const c_char),
    set_int32: "node_set_path_int32" => unsafe extern "C" fn(*mut RawNode, *const c_char, i32),
    set_int64s: "node_set_path_int64_ptr" => unsafe extern "C" fn(*mut RawNode, *const c_char, *mut i64, i64),
    set_float64: "node_set_path_float64" => unsafe extern "C" fn(*mut RawNode, *const c_char, f64),
    set_float64s: "node_set_path_float64_ptr_detailed" =>
        unsafe extern "C" fn(*mut RawNode, *const c_char, *mut f64, i64, i64, i64, i64, i64),
    set_external: "node_set_path_external_node" => unsafe extern "C" fn(*mut RawNode, *const c_char, *mut RawNode),
}

impl Host {
    /// The host's functions, looked up at the first call.
    ///
    /// # Errors
    /// [`CatalystError::MissingSymbol`] with the first function that the process does not export.
    pub(crate) fn get() -> Result<&'static Host, CatalystError> {
        static HOST: OnceLock<Result<Host, &'static str>> = OnceLock::new();
        HOST.get_or_init(Host::look_up)
            .as_ref()
            .map_err(|symbol| CatalystError::MissingSymbol { symbol })
    }
}

/// The address of a function that the process has loaded; `name` ends in a nul.
fn symbol(name: &'static str) -> Option<*mut c_void> {
    let name = CStr::from_bytes_with_nul(name.as_bytes()).ok()?;
    // SAFETY: `name` is a C string; `RTLD_DEFAULT` asks for the global scope and needs no handle to
    // be open.
    let found = unsafe { libc::dlsym(libc::RTLD_DEFAULT, name.as_ptr()) };
    if !found.is_null() {
        return Some(found);
    }
    // SAFETY: the file name is a C string; with `RTLD_NOLOAD` nothing is loaded and no foreign code
    // runs.
    let library =
        unsafe { libc::dlopen(c"libcatalyst.so.3".as_ptr(), libc::RTLD_LAZY | libc::RTLD_NOLOAD) };
    if library.is_null() {
        return None;
    }
    // SAFETY: `library` is an open handle (not null) and `name` a C string. The handle stays open,
    // so the address stays valid.
    let found = unsafe { libc::dlsym(library, name.as_ptr()) };
    (!found.is_null()).then_some(found)
}
