//! Leaves: reading and writing elements, in whatever layout they lie.

use std::ptr;

use crate::datatype::{Datatype, KINDS, Kind, MACHINE_ENDIANNESS};
use crate::error::{Error, Result};
use crate::memory::{Block, Memory};
use crate::node::Node;

/// One number, as it is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// A signed integer.
    Signed(i64),
    /// An unsigned integer.
    Unsigned(u64),
    /// A floating point number of 32 bits.
    Single(f32),
    /// A floating point number of 64 bits.
    Double(f64),
}

impl Number {
    /// The nearest `f64`.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "the nearest is what is asked for")]
    pub fn as_f64(self) -> f64 {
        match self {
            Number::Signed(value) => value as f64,
            Number::Unsigned(value) => value as f64,
            Number::Single(value) => value.into(),
            Number::Double(value) => value,
        }
    }

    /// The integer, if it is one that fits.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "only whole numbers well inside the range are converted"
    )]
    pub fn as_i64(self) -> Option<i64> {
        match self {
            Number::Signed(value) => Some(value),
            Number::Unsigned(value) => i64::try_from(value).ok(),
            Number::Single(_) | Number::Double(_) => {
                let value = self.as_f64();
                (value.fract() == 0.0 && value.abs() < 9e15).then_some(value as i64)
            }
        }
    }
}

/// A type of element that C code reads and writes.
pub trait Element: Copy {
    /// Its number in Conduit.
    const KIND: Kind;
}

macro_rules! elements {
    ($($type:ty => $kind:ident,)*) => { $(impl Element for $type { const KIND: Kind = Kind::$kind; })* };
}
elements! {
    i8 => Int8, i16 => Int16, i32 => Int32, i64 => Int64, u8 => Uint8, u16 => Uint16, u32 => Uint32, u64 => Uint64,
    f32 => Float32, f64 => Float64,
}

/// Checks a layout that a caller gives, and the address that goes with it.
///
/// # Errors
/// A negative length, elements of another size than the type's, an unknown order of bytes, or no address for some elements.
pub fn described(kind: Kind, data: *const u8, mut layout: Datatype) -> Result<Datatype> {
    layout.kind = kind;
    let refuse = |what: String| Err(Error::new(format!("an array of {}: {what}", kind.name())));
    if layout.elements < 0 {
        return refuse(format!("{} elements", layout.elements));
    }
    if layout.element_bytes != kind.bytes() {
        return refuse(format!(
            "elements of {} bytes, where the type has {}",
            layout.element_bytes,
            kind.bytes()
        ));
    }
    if !(0..=2).contains(&layout.endianness) {
        return refuse(format!("no order of bytes has the number {}", layout.endianness));
    }
    let last =
        layout.stride.checked_mul(layout.elements).and_then(|span| span.checked_add(layout.offset));
    if last.is_none() {
        return refuse(format!(
            "{} elements at a stride of {} bytes",
            layout.elements, layout.stride
        ));
    }
    if data.is_null() && layout.elements > 1 {
        return refuse(format!("{} elements at a null address", layout.elements));
    }
    Ok(layout)
}

impl Node {
    /// The address of the data; null where there is none.
    #[must_use]
    pub fn data(&self) -> *mut u8 {
        self.memory.start()
    }

    /// The address of an element; null where there is no data. Numbers outside of the array are allowed, as one past its end is.
    #[must_use]
    pub fn element(&self, index: i64) -> *mut u8 {
        let start = self.memory.start();
        match self.datatype.element_index(index).and_then(|offset| isize::try_from(offset).ok()) {
            Some(offset) if !start.is_null() => start.wrapping_offset(offset),
            _ => ptr::null_mut(),
        }
    }

    fn readable(&self, index: i64) -> Option<*const u8> {
        let address = self.element(index);
        let inside = (0..self.datatype.elements).contains(&index) && !address.is_null();
        let fits = match (self.memory.known_length(), self.datatype.element_index(index)) {
            (Some(length), Some(offset)) => {
                offset >= 0
                    && usize::try_from(offset + self.datatype.element_bytes)
                        .is_ok_and(|end| end <= length)
            }
            (None, Some(_)) => true,
            _ => false,
        };
        (inside && fits).then_some(address.cast_const())
    }

    /// The bytes of an element in this machine's order; unused ones are 0.
    fn bytes(&self, index: i64) -> Option<[u8; 8]> {
        let address = self.readable(index)?;
        let size = usize::try_from(self.datatype.element_bytes)
            .ok()
            .filter(|size| (1..=8).contains(size))?;
        let mut bytes = [0; 8];
        // SAFETY: `readable` saw that the element lies inside the block; borrowed memory has the layout that its owner stated.
        unsafe { ptr::copy_nonoverlapping(address, bytes.as_mut_ptr(), size) };
        if !self.datatype.matches_machine() {
            bytes[..size].reverse();
        }
        Some(bytes)
    }

    /// An element as a number; `None` where the node holds no numbers or not so many.
    #[must_use]
    pub fn number(&self, index: i64) -> Option<Number> {
        let bytes = self.bytes(index)?;
        let [a, b, c, d, ..] = bytes;
        Some(match self.kind() {
            Kind::Int8 => Number::Signed(i8::from_ne_bytes([a]).into()),
            Kind::Int16 => Number::Signed(i16::from_ne_bytes([a, b]).into()),
            Kind::Int32 => Number::Signed(i32::from_ne_bytes([a, b, c, d]).into()),
            Kind::Int64 => Number::Signed(i64::from_ne_bytes(bytes)),
            Kind::Uint8 => Number::Unsigned(a.into()),
            Kind::Uint16 => Number::Unsigned(u16::from_ne_bytes([a, b]).into()),
            Kind::Uint32 => Number::Unsigned(u32::from_ne_bytes([a, b, c, d]).into()),
            Kind::Uint64 => Number::Unsigned(u64::from_ne_bytes(bytes)),
            Kind::Float32 => Number::Single(f32::from_ne_bytes([a, b, c, d])),
            Kind::Float64 => Number::Double(f64::from_ne_bytes(bytes)),
            Kind::Empty | Kind::Object | Kind::List | Kind::Text => return None,
        })
    }

    /// All numbers, as `f64`.
    pub fn numbers(&self) -> impl Iterator<Item = Number> {
        let count = if self.kind().is_number() { self.datatype.elements } else { 0 };
        (0..count).filter_map(|index| self.number(index))
    }

    /// The first element as an integer.
    #[must_use]
    pub fn integer(&self) -> Option<i64> {
        self.number(0)?.as_i64()
    }

    /// The bytes of a text up to its nul; `None` where the node holds no text.
    #[must_use]
    pub fn text_bytes(&self) -> Option<Vec<u8>> {
        if self.kind() != Kind::Text {
            return None;
        }
        let bytes =
            (0..self.datatype.elements).map_while(|index| self.bytes(index).map(|bytes| bytes[0]));
        Some(bytes.take_while(|byte| *byte != 0).collect())
    }

    /// The text; what is not UTF-8 in it is replaced.
    #[must_use]
    pub fn text(&self) -> Option<String> {
        self.text_bytes().map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
    }

    /// Makes room for what `wanted` describes: the memory stays where the node already holds as many elements of that type.
    ///
    /// # Errors
    /// There is not so much memory.
    pub fn make_room(&mut self, wanted: Datatype) -> Result<()> {
        let room =
            self.datatype.compatible(&wanted) && (!self.data().is_null() || wanted.elements == 0);
        if room && self.datatype.matches_machine() {
            return Ok(());
        }
        let block = Block::new(wanted.compact_bytes())?;
        self.reset();
        self.memory = Memory::Owned(block);
        self.datatype = Datatype::compact(wanted.kind, wanted.elements);
        Ok(())
    }

    /// Copies elements in. The layout of the source is given; the node keeps its own where it has room, else it becomes compact.
    ///
    /// # Safety
    /// `data` is null or points to what `layout` describes.
    ///
    /// # Errors
    /// As [`described`], or there is not so much memory.
    pub unsafe fn set_elements(
        &mut self,
        kind: Kind,
        data: *const u8,
        layout: Datatype,
    ) -> Result<()> {
        let layout = described(kind, data, layout)?;
        if data.is_null() && layout.elements > 0 {
            return Err(Error::new(format!(
                "an array of {}: {} elements at a null address",
                kind.name(),
                layout.elements
            )));
        }
        // The source may lie in the memory that this node is about to free.
        let kept = self.memory.clone();
        self.make_room(Datatype::compact(kind, layout.elements))?;
        let source = Node::over(data.cast_mut(), layout);
        let copied = self.write_from(&source);
        drop(kept);
        copied
    }

    /// A leaf that borrows.
    pub(crate) fn over(data: *mut u8, datatype: Datatype) -> Node {
        let mut node = Node::new();
        node.memory = Memory::Borrowed(data);
        node.datatype = datatype;
        node
    }

    /// Writes the elements of a leaf over the first ones of this leaf, which holds at least as many of the same type.
    ///
    /// # Errors
    /// It does not, or one of them has no data.
    pub fn write_from(&mut self, source: &Node) -> Result<()> {
        let (from, to) = (source.datatype, self.datatype);
        if from.elements == 0 {
            return Ok(());
        }
        if !to.compatible(&from) {
            return Err(Error::new(format!(
                "{} elements of {} do not fit",
                from.elements,
                from.kind.name()
            )));
        }
        let missing = || {
            Error::new(format!("an array of {} {} has no data", from.elements, from.kind.name()))
        };
        let size = usize::try_from(from.element_bytes).map_err(|_| missing())?;
        let ends = [0, from.elements - 1];
        if ends
            .iter()
            .any(|index| source.readable(*index).is_none() || self.readable(*index).is_none())
        {
            return Err(missing());
        }
        let packed = from.stride == from.element_bytes && to.stride == to.element_bytes;
        if packed && from.matches_machine() == to.matches_machine() {
            let length = size * usize::try_from(from.elements).map_err(|_| missing())?;
            // SAFETY: first and last element of both are readable, there are no gaps, and `copy` allows overlap.
            unsafe { ptr::copy(source.element(0).cast_const(), self.element(0), length) };
            return Ok(());
        }
        for index in 0..from.elements {
            let (Some(mut bytes), Some(_)) = (source.bytes(index), self.readable(index)) else {
                return Err(missing());
            };
            if !to.matches_machine() {
                bytes[..size].reverse();
            }
            // SAFETY: the element lies inside of the block, or in memory that its owner described and lent for writing.
            unsafe { ptr::copy_nonoverlapping(bytes.as_ptr(), self.element(index), size) };
        }
        Ok(())
    }

    /// Writes one element of a leaf of the same type over one of this leaf.
    ///
    /// # Errors
    /// The types differ, or one of the elements is not there.
    pub fn write_one(&mut self, to: i64, source: &Node, from: i64) -> Result<()> {
        source.expect(self.kind())?;
        let (Some(mut bytes), Some(_)) = (source.bytes(from), self.readable(to)) else {
            return Err(Error::new(format!("{} has no element {from}", source.place())));
        };
        let size = usize::try_from(self.datatype.element_bytes).unwrap_or(0).min(8);
        if !self.datatype.matches_machine() {
            bytes[..size].reverse();
        }
        // SAFETY: the element lies inside of the block, or in memory that its owner described and lent for writing.
        unsafe { ptr::copy_nonoverlapping(bytes.as_ptr(), self.element(to), size) };
        Ok(())
    }

    /// Borrows elements: the caller keeps them alive for as long as the node refers to them.
    ///
    /// # Errors
    /// As [`described`].
    pub fn borrow_elements(&mut self, kind: Kind, data: *mut u8, layout: Datatype) -> Result<()> {
        let layout = described(kind, data, layout)?;
        self.reset();
        self.memory = Memory::Borrowed(data);
        self.datatype = layout;
        Ok(())
    }

    /// Sets one number.
    ///
    /// # Errors
    /// There is no memory.
    pub fn set_number<T: Element>(&mut self, value: T) -> Result<()> {
        // SAFETY: `value` is one element of its own type.
        unsafe {
            self.set_elements(T::KIND, ptr::from_ref(&value).cast(), Datatype::compact(T::KIND, 1))
        }
    }

    /// Sets an array of numbers.
    ///
    /// # Errors
    /// There is no memory.
    pub fn set_numbers<T: Element>(&mut self, values: &[T]) -> Result<()> {
        let count = i64::try_from(values.len()).map_err(|_| Error::new("too many elements"))?;
        // SAFETY: a slice is that many elements of its type.
        unsafe {
            self.set_elements(T::KIND, values.as_ptr().cast(), Datatype::compact(T::KIND, count))
        }
    }

    /// Sets a text; a nul is added.
    ///
    /// # Errors
    /// There is no memory.
    pub fn set_text(&mut self, text: impl AsRef<[u8]>) -> Result<()> {
        let mut bytes: Vec<u8> =
            text.as_ref().iter().copied().take_while(|byte| *byte != 0).collect();
        bytes.push(0);
        let count = i64::try_from(bytes.len()).map_err(|_| Error::new("too long a text"))?;
        if self.datatype.elements != count && !matches!(self.memory, Memory::Borrowed(_)) {
            self.reset();
        }
        // SAFETY: the vector is that many bytes.
        unsafe {
            self.set_elements(Kind::Text, bytes.as_ptr(), Datatype::compact(Kind::Text, count))
        }
    }

    /// Checks that this leaf holds elements of a type.
    ///
    /// # Errors
    /// It does not.
    #[track_caller]
    pub fn expect(&self, kind: Kind) -> Result<()> {
        if self.kind() == kind {
            return Ok(());
        }
        Err(Error::warning(format!(
            "{} holds {}, not {}",
            self.place(),
            self.kind().name(),
            kind.name()
        )))
    }

    /// The first element, as what it is.
    ///
    /// # Errors
    /// The node holds another type, or nothing.
    #[track_caller]
    pub fn value<T: Element>(&self) -> Result<T> {
        self.expect(T::KIND)?;
        match self.readable(0) {
            // SAFETY: the first element is readable and holds a value of this type, all of whose bit patterns are valid.
            Some(address) => Ok(unsafe { address.cast::<T>().read_unaligned() }),
            None => Err(Error::new(format!("{} holds no elements", self.place()))),
        }
    }
}

/// The type of a number.
#[must_use]
pub fn kind_of(number: i64) -> Option<Kind> {
    KINDS.into_iter().find(|kind| *kind as i64 == number)
}

/// The order of bytes as schemas write it.
#[must_use]
pub fn endianness_name(endianness: i64) -> &'static str {
    match if endianness == 0 { MACHINE_ENDIANNESS } else { endianness } {
        1 => "big",
        _ => "little",
    }
}
