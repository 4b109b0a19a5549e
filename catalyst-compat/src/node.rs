//! Safe access to the host's nodes: every read asks first what is there, because Conduit answers a
//! wrong guess with a C++ exception, which must not run through Rust frames.

use std::borrow::Cow;
use std::ffi::{CStr, CString, c_char};
use std::marker::PhantomData;
use std::ptr;

use tombolo::foreign::{Array, RunError, conduit_type};

use crate::error::CatalystError;
use crate::host::{Host, RawNode};

/// Conduit's numbers of types.
mod type_number {
    pub(super) const EMPTY: i64 = 0;
    pub(super) const OBJECT: i64 = 1;
    pub(super) const LIST: i64 = 2;
    pub(super) const TEXT: i64 = 13;
}

const BIG_ENDIAN: i64 = 1;

/// The kind of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Empty,
    Object,
    List,
    Text,
    Numbers,
    Unknown(i64),
}

/// A node that can be read for the length of one call (`'call`). It knows the way to itself, so
/// that an error can name it; the way is written out only then.
#[derive(Clone, Copy)]
pub(crate) struct Node<'up, 'call> {
    host: &'static Host,
    pointer: *mut RawNode,
    name: &'up CStr,
    parent: Option<&'up Node<'up, 'call>>,
    type_number: i64,
    call: PhantomData<&'call RawNode>,
}

impl<'call> Node<'_, 'call> {
    /// # Safety
    /// `pointer` is null or a node of the host's Conduit that lives, with all that it borrows,
    /// unchanged by others until the call returns.
    pub(crate) unsafe fn root(
        host: &'static Host,
        pointer: *const RawNode,
    ) -> Result<Self, CatalystError> {
        if pointer.is_null() {
            return Err(CatalystError::NullNode);
        }
        // SAFETY: the node is live, by the caller's promise.
        Ok(unsafe { Self::reached(host, pointer.cast_mut(), c"", None) })
    }

    /// # Safety
    /// `pointer` is a live node of the host's Conduit.
    unsafe fn reached<'next>(
        host: &'static Host,
        pointer: *mut RawNode,
        name: &'next CStr,
        parent: Option<&'next Node<'next, 'call>>,
    ) -> Node<'next, 'call> {
        // SAFETY: the node is live; its data type is part of it.
        let type_number = unsafe { (host.type_number)((host.dtype)(pointer)) };
        Node { host, pointer, name, parent, type_number, call: PhantomData }
    }

    /// The way from the root: names joined by `/`.
    pub(crate) fn path(&self) -> String {
        let mut path = String::with_capacity(96);
        self.write_path(&mut path);
        path
    }

    fn write_path(&self, path: &mut String) {
        let Some(parent) = self.parent else { return };
        parent.write_path(path);
        if !path.is_empty() {
            path.push('/');
        }
        path.push_str(&self.name());
    }

    /// The name under which it was reached, as Conduit has it.
    pub(crate) fn key(&self) -> &CStr {
        self.name
    }

    /// The name under which it was reached.
    pub(crate) fn name(&self) -> Cow<'_, str> {
        self.name.to_string_lossy()
    }

    pub(crate) fn kind(&self) -> Kind {
        match self.type_number {
            type_number::EMPTY => Kind::Empty,
            type_number::OBJECT => Kind::Object,
            type_number::LIST => Kind::List,
            type_number::TEXT => Kind::Text,
            other if conduit_type(other).is_some() => Kind::Numbers,
            other => Kind::Unknown(other),
        }
    }

    /// The child of this name; `None` where this is no object or has none.
    pub(crate) fn child<'next>(&'next self, name: &'next CStr) -> Option<Node<'next, 'call>> {
        if self.kind() != Kind::Object {
            return None;
        }
        // SAFETY: the node is a live object and the name a C string; the child is asked for only
        // where it is there.
        let pointer = unsafe {
            if (self.host.has_child)(self.pointer, name.as_ptr()) == 0 {
                return None;
            }
            (self.host.child_by_name)(self.pointer, name.as_ptr())
        };
        // SAFETY: what Conduit hands out as a child is a live node of the tree.
        (!pointer.is_null()).then(|| unsafe { Self::reached(self.host, pointer, name, Some(self)) })
    }

    /// The child of this name.
    pub(crate) fn need<'next>(
        &'next self,
        name: &'next CStr,
        expected: &'static str,
    ) -> Result<Node<'next, 'call>, RunError> {
        self.child(name).ok_or_else(|| match self.kind() {
            Kind::Object | Kind::Empty => RunError::Missing {
                path: Node { name, parent: Some(self), ..*self }.path(),
                expected,
            },
            _ => self.wrong(format!("an object with '{}'", name.to_string_lossy())),
        })
    }

    /// How many children an object or a list has.
    pub(crate) fn len(&self) -> usize {
        if !matches!(self.kind(), Kind::Object | Kind::List) {
            return 0;
        }
        // SAFETY: the node is live and has children.
        usize::try_from(unsafe { (self.host.number_of_children)(self.pointer) }).unwrap_or(0)
    }

    /// The names of the children, by which [`Node::at`] reaches them; in a list their numbers in
    /// brackets.
    pub(crate) fn names(&self) -> Vec<CString> {
        let is_list = self.kind() == Kind::List;
        (0..self.len())
            .map(|index| {
                if is_list {
                    return CString::new(format!("[{index}]")).unwrap_or_default();
                }
                // SAFETY: the index is below the number of children; Conduit hands out a copy of
                // the name, made by malloc, which is freed here once it has been copied.
                unsafe {
                    let child = (self.host.child)(self.pointer, index as i64);
                    let name: *mut c_char =
                        if child.is_null() { ptr::null_mut() } else { (self.host.name)(child) };
                    if name.is_null() {
                        return CString::default();
                    }
                    let copy = CStr::from_ptr(name).to_owned();
                    libc::free(name.cast());
                    bare(copy)
                }
            })
            .collect()
    }

    /// The child number `index`, which `name` names in errors.
    pub(crate) fn at<'next>(
        &'next self,
        index: usize,
        name: &'next CStr,
    ) -> Option<Node<'next, 'call>> {
        if index >= self.len() {
            return None;
        }
        // SAFETY: the index is below the number of children.
        let pointer = unsafe { (self.host.child)(self.pointer, i64::try_from(index).ok()?) };
        // SAFETY: what Conduit hands out as a child is a live node of the tree.
        (!pointer.is_null()).then(|| unsafe { Self::reached(self.host, pointer, name, Some(self)) })
    }

    /// Calls `visit` with each child of an object or a list.
    pub(crate) fn each(
        &self,
        mut visit: impl FnMut(&Node<'_, 'call>) -> Result<(), RunError>,
    ) -> Result<(), RunError> {
        let names = self.names();
        let mut children =
            names.iter().enumerate().filter_map(|(index, name)| self.at(index, name));
        children.try_for_each(|child| visit(&child))
    }

    /// The text that it holds, up to its first nul; borrowed for the length of the call wherever
    /// its letters lie side by side.
    pub(crate) fn text(&self) -> Result<Cow<'call, str>, RunError> {
        if self.kind() != Kind::Text {
            return Err(self.wrong("a text"));
        }
        let (first, count, stride) = self.layout()?;
        let no_text = || self.wrong_found("bytes that are none", "a text in UTF-8");
        if stride == 1 || count == 1 {
            // SAFETY: Conduit says that the node holds `count` bytes, which live until the call
            // returns (`root`).
            let bytes: &'call [u8] = unsafe { std::slice::from_raw_parts(first, count as usize) };
            let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
            return std::str::from_utf8(&bytes[..end]).map(Cow::Borrowed).map_err(|_| no_text());
        }
        // SAFETY: Conduit says that the node holds `count` bytes, `stride` apart.
        let bytes =
            (0..count).map(|index| unsafe { first.offset((index * stride) as isize).read() });
        String::from_utf8(bytes.take_while(|byte| *byte != 0).collect())
            .map(Cow::Owned)
            .map_err(|_| no_text())
    }

    /// Address of the first element, number of elements, and bytes from one to the next.
    fn layout(&self) -> Result<(*const u8, i64, i64), RunError> {
        // SAFETY: the node is live; its data type is part of it.
        let (count, stride) = unsafe {
            let dtype = (self.host.dtype)(self.pointer);
            ((self.host.count)(dtype), (self.host.stride)(dtype))
        };
        if count <= 0 {
            return Ok((ptr::NonNull::<u64>::dangling().as_ptr().cast(), 0, stride.max(1)));
        }
        // SAFETY: the node has a first element.
        let first: *const u8 = unsafe { (self.host.element)(self.pointer, 0) }.cast::<u8>();
        if first.is_null() {
            return Err(
                self.wrong_found("a null pointer", format!("the address of {count} values"))
            );
        }
        if stride < 0
            || count.checked_mul(stride.max(1)).is_none_or(|bytes| bytes > isize::MAX as i64)
        {
            return Err(self.wrong_found(
                format!("{count} values {stride} bytes apart"),
                "a length that memory can have",
            ));
        }
        Ok((first, count, stride))
    }

    /// The numbers that it holds, borrowed for the length of the call.
    pub(crate) fn array(&self) -> Result<Array<'call>, RunError> {
        let number =
            conduit_type(self.type_number).ok_or_else(|| self.wrong("an array of numbers"))?;
        let (first, count, stride) = self.layout()?;
        // SAFETY: the node is live; its data type is part of it.
        let endianness = unsafe { (self.host.endianness)((self.host.dtype)(self.pointer)) };
        // SAFETY: Conduit says that the node holds `count` numbers of this type, `stride` bytes
        // apart, and by the contract of `root` they live until the call returns.
        Ok(unsafe {
            Array::new(first, count as usize, stride as usize, number, endianness == BIG_ENDIAN)
        })
    }

    /// The one number that it holds.
    pub(crate) fn number(&self) -> Result<f64, RunError> {
        let array = self.array().map_err(|_| self.wrong("a number"))?;
        if array.len() == 1 { Ok(array.get(0)) } else { Err(self.wrong("one number")) }
    }

    /// The one whole number that it holds, which errors expect as `expected`.
    pub(crate) fn integer(&self, expected: &str) -> Result<i64, RunError> {
        let array = self.array().ok().filter(|array| array.len() == 1);
        array.and_then(|array| array.integer(0)).ok_or_else(|| self.wrong(expected))
    }

    /// The one whole number that it holds, from 0 on.
    pub(crate) fn count(&self) -> Result<u64, RunError> {
        let array = self.array().map_err(|_| self.wrong("a whole number from 0 on"))?;
        let value = (array.len() == 1).then(|| array.whole(0)).flatten();
        value.ok_or_else(|| {
            let found = if array.len() == 1 { format!("{}", array.get(0)) } else { self.found() };
            self.wrong_found(found, "a whole number from 0 on")
        })
    }

    /// The node's content, in words.
    pub(crate) fn found(&self) -> String {
        match self.kind() {
            Kind::Empty => "nothing".into(),
            Kind::Object => {
                let names: Vec<String> = self
                    .names()
                    .iter()
                    .take(8)
                    .map(|name| name.to_string_lossy().into_owned())
                    .collect();
                if names.is_empty() {
                    "an empty object".into()
                } else {
                    format!("an object of {}", names.join(", "))
                }
            }
            Kind::List => format!("a list of {}", self.len()),
            Kind::Text => match self.text() {
                Ok(text) => format!("the text '{text}'"),
                Err(_) => "a text".into(),
            },
            Kind::Numbers => match self.array() {
                Ok(array) => format!("{} value(s) of type {}", array.len(), array.number().name()),
                Err(_) => "numbers".into(),
            },
            Kind::Unknown(number) => format!("a value of unknown type {number}"),
        }
    }

    /// The error that this holds something else.
    pub(crate) fn wrong(&self, expected: impl Into<String>) -> RunError {
        self.wrong_found(self.found(), expected)
    }

    pub(crate) fn wrong_found(
        &self,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> RunError {
        RunError::Wrong { path: self.path(), found: found.into(), expected: expected.into() }
    }
}

/// A node that can be filled for the length of one call.
pub(crate) struct NodeMut<'call> {
    host: &'static Host,
    pointer: *mut RawNode,
    call: PhantomData<&'call mut RawNode>,
}

impl NodeMut<'_> {
    /// # Safety
    /// `pointer` is null or a node of the host's Conduit that lives, and is used by nobody else,
    /// until the call returns.
    pub(crate) unsafe fn new(
        host: &'static Host,
        pointer: *mut RawNode,
    ) -> Result<Self, CatalystError> {
        if pointer.is_null() {
            Err(CatalystError::NullNode)
        } else {
            Ok(Self { host, pointer, call: PhantomData })
        }
    }

    pub(crate) fn set_text(&mut self, path: &str, value: &str) {
        let (path, value) = (c_string(path), c_string(value));
        // SAFETY: the node is live and ours alone (`new`), path and value are C strings, which
        // Conduit copies.
        unsafe { (self.host.set_text)(self.pointer, path.as_ptr(), value.as_ptr()) }
    }

    pub(crate) fn set_integer(&mut self, path: &str, value: i32) {
        // SAFETY: as in `set_text`.
        unsafe { (self.host.set_int32)(self.pointer, c_string(path).as_ptr(), value) }
    }

    pub(crate) fn set_integers(&mut self, path: &str, values: &[i64]) {
        // SAFETY: as in `set_text`; the values are copied, not written to.
        unsafe {
            let data = values.as_ptr().cast_mut();
            (self.host.set_int64s)(
                self.pointer,
                c_string(path).as_ptr(),
                data,
                values.len() as i64,
            );
        }
    }

    pub(crate) fn set_number(&mut self, path: &str, value: f64) {
        // SAFETY: as in `set_text`.
        unsafe { (self.host.set_float64)(self.pointer, c_string(path).as_ptr(), value) }
    }

    /// Copies one axis of vectors.
    pub(crate) fn set_axis(&mut self, path: &str, vectors: &[[f64; 3]], axis: usize) {
        // SAFETY: as in `set_text`; of the values, from the `axis`-th on, every third is copied,
        // none is written to.
        unsafe {
            let data = vectors.as_ptr().cast::<f64>().cast_mut();
            let (count, offset) = (vectors.len() as i64, 8 * axis.min(2) as i64);
            (self.host.set_float64s)(
                self.pointer,
                c_string(path).as_ptr(),
                data,
                count,
                offset,
                24,
                8,
                0,
            );
        }
    }

    /// Shows at `path` what stands at `from`, without a copy.
    pub(crate) fn set_same(&mut self, path: &str, from: &str) {
        // SAFETY: as in `set_text`; both places are in one tree, so that what is borrowed lives as
        // long as what borrows it.
        unsafe {
            let shown = (self.host.fetch)(self.pointer, c_string(from).as_ptr());
            if !shown.is_null() {
                (self.host.set_external)(self.pointer, c_string(path).as_ptr(), shown);
            }
        }
    }

    /// Takes away what an earlier call left.
    pub(crate) fn remove(&mut self, path: &str) {
        let path = c_string(path);
        // SAFETY: as in `set_text`; only what is there is removed.
        unsafe {
            if (self.host.has_path)(self.pointer, path.as_ptr()) != 0 {
                (self.host.remove_path)(self.pointer, path.as_ptr());
            }
        }
    }
}

/// A C string; what follows a nul is left out.
fn c_string(text: &str) -> CString {
    CString::new(text.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

/// A name as it was given: Conduit tells one with a slash in it in braces, because it is no path.
fn bare(name: CString) -> CString {
    let bytes = name.as_bytes();
    match bytes.strip_prefix(b"{").and_then(|rest| rest.strip_suffix(b"}")) {
        Some(inner) if inner.contains(&b'/') => CString::new(inner).unwrap_or_default(),
        _ => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_that_were_given() {
        for (told, given) in
            [(c"{a/b}", c"a/b"), (c"a", c"a"), (c"{a}", c"{a}"), (c"{", c"{"), (c"", c"")]
        {
            assert_eq!(bare(told.to_owned()).as_c_str(), given);
        }
    }
}
