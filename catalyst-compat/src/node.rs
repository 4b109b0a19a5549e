//! Safe access to the host's nodes: every read asks first whether the path is there and what it holds, because Conduit answers a
//! wrong guess with a C++ exception, which must not run through Rust frames.

use std::ffi::CStr;
use std::marker::PhantomData;

use crate::CatalystError;
use crate::host::{Host, RawNode};

/// A node that can be read for the length of one call.
pub(crate) struct Node<'call> {
    host: &'static Host,
    pointer: *const RawNode,
    call: PhantomData<&'call RawNode>,
}

/// A node that can be filled for the length of one call.
pub(crate) struct NodeMut<'call> {
    host: &'static Host,
    pointer: *mut RawNode,
    call: PhantomData<&'call mut RawNode>,
}

/// One number, as the host stored it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Number {
    Integer(i128),
    Real(f64),
}

impl Node<'_> {
    /// # Safety
    /// `pointer` is null or a node of the host's Conduit that lives, unchanged by others, until the call returns.
    pub(crate) unsafe fn new(host: &'static Host, pointer: *const RawNode) -> Result<Self, CatalystError> {
        if pointer.is_null() { Err(CatalystError::NullNode) } else { Ok(Self { host, pointer, call: PhantomData }) }
    }

    pub(crate) fn has(&self, path: &CStr) -> bool {
        // SAFETY: the node is live and not null (`Node::new`), the path is a C string; `has_path` reads only and does not throw.
        unsafe { (self.host.has_path)(self.pointer, path.as_ptr()) != 0 }
    }

    /// The number at `path`; `None` where the path is not there.
    pub(crate) fn number(&self, path: &CStr) -> Result<Option<Number>, CatalystError> {
        if !self.has(path) {
            return Ok(None);
        }
        // SAFETY: the path exists, so `fetch_existing` returns a live child and does not throw. It takes a mutable pointer by
        // its C signature but writes nothing.
        let child: *const RawNode = unsafe { (self.host.fetch_existing)(self.pointer.cast_mut(), path.as_ptr()) };
        if child.is_null() {
            return Ok(None);
        }
        // SAFETY: `child` is a live node; its data type lives as long as it does and is only read.
        let (kind, count) = unsafe {
            let datatype = (self.host.dtype)(child);
            ((self.host.datatype_id)(datatype), (self.host.number_of_elements)(datatype))
        };
        let wrong = || CatalystError::NotANumber {
            path: path.to_string_lossy().into_owned(),
            expected: "32- or 64-bit number",
            found: kind,
        };
        if count < 1 {
            return Err(wrong());
        }
        // SAFETY: each function reads the first element of a node that holds at least one value of exactly its type, which is
        // the case Conduit defines without an error.
        let number = unsafe {
            match kind {
                5 => Number::Integer((self.host.as_int32)(child).into()),
                6 => Number::Integer((self.host.as_int64)(child).into()),
                9 => Number::Integer((self.host.as_uint32)(child).into()),
                10 => Number::Integer((self.host.as_uint64)(child).into()),
                11 => Number::Real((self.host.as_float32)(child).into()),
                12 => Number::Real((self.host.as_float64)(child)),
                _ => return Err(wrong()),
            }
        };
        Ok(Some(number))
    }
}

impl NodeMut<'_> {
    /// # Safety
    /// `pointer` is null or a node of the host's Conduit that lives, touched by nobody else, until the call returns.
    pub(crate) unsafe fn new(host: &'static Host, pointer: *mut RawNode) -> Result<Self, CatalystError> {
        if pointer.is_null() { Err(CatalystError::NullNode) } else { Ok(Self { host, pointer, call: PhantomData }) }
    }

    pub(crate) fn set_text(&mut self, path: &CStr, value: &CStr) {
        // SAFETY: the node is live and ours for the call (`NodeMut::new`); both arguments are C strings, which Conduit copies.
        unsafe { (self.host.set_path_text)(self.pointer, path.as_ptr(), value.as_ptr()) }
    }

    pub(crate) fn set_integer(&mut self, path: &CStr, value: i32) {
        // SAFETY: as in `set_text`.
        unsafe { (self.host.set_path_int32)(self.pointer, path.as_ptr(), value) }
    }
}
