//! Questions about a type and its layout.

use std::ffi::{c_char, c_int, c_void};
use std::ptr;

use super::{hand_out, run};
use crate::datatype::{
    BIG_ENDIAN, DEFAULT_ENDIANNESS, Datatype, Kind, LITTLE_ENDIAN, MACHINE_ENDIANNESS,
};
use crate::error::{Error, Result};

/// # Safety
/// The pointer is null or the type of a live node.
unsafe fn datatype<'a>(pointer: *const Datatype) -> Result<&'a Datatype> {
    // SAFETY: as the caller promises.
    unsafe { pointer.as_ref() }.ok_or_else(|| Error::new("the conduit datatype is null"))
}

macro_rules! answers {
    ($($name:literal: $type:ty = $answer:expr;)*) => { $(
        const _: () = {
            #[unsafe(export_name = concat!("catalyst_conduit_datatype_", $name))]
            unsafe extern "C-unwind" fn answer(pointer: *const Datatype) -> $type {
                // SAFETY: the caller keeps to `c_api`'s rules.
                run(<$type>::default(), || Ok($answer(unsafe { datatype(pointer)? }).into()))
            }
        };
    )* };
}

fn is(kind: Kind) -> impl Fn(&Datatype) -> bool {
    move |datatype| datatype.kind == kind
}

fn order(datatype: &Datatype) -> i64 {
    if datatype.endianness == DEFAULT_ENDIANNESS { MACHINE_ENDIANNESS } else { datatype.endianness }
}

answers! {
    "id": i64 = |datatype: &Datatype| datatype.kind as i64;
    "number_of_elements": i64 = |datatype: &Datatype| datatype.elements;
    "offset": i64 = |datatype: &Datatype| datatype.offset;
    "stride": i64 = |datatype: &Datatype| datatype.stride;
    "element_bytes": i64 = |datatype: &Datatype| datatype.element_bytes;
    "endianness": i64 = |datatype: &Datatype| datatype.endianness;
    "is_empty": c_int = is(Kind::Empty);
    "is_object": c_int = is(Kind::Object);
    "is_list": c_int = is(Kind::List);
    "is_number": c_int = |datatype: &Datatype| datatype.kind.is_number();
    "is_floating_point": c_int = |datatype: &Datatype| datatype.kind.is_floating();
    "is_integer": c_int = |datatype: &Datatype| datatype.kind.is_integer();
    "is_signed_integer": c_int = |datatype: &Datatype| datatype.kind.is_signed();
    "is_unsigned_integer": c_int = |datatype: &Datatype| datatype.kind.is_unsigned();
    "is_int8": c_int = is(Kind::Int8);
    "is_int16": c_int = is(Kind::Int16);
    "is_int32": c_int = is(Kind::Int32);
    "is_int64": c_int = is(Kind::Int64);
    "is_uint8": c_int = is(Kind::Uint8);
    "is_uint16": c_int = is(Kind::Uint16);
    "is_uint32": c_int = is(Kind::Uint32);
    "is_uint64": c_int = is(Kind::Uint64);
    "is_float32": c_int = is(Kind::Float32);
    "is_float64": c_int = is(Kind::Float64);
    "is_char": c_int = is(Kind::Int8);
    "is_short": c_int = is(Kind::Int16);
    "is_int": c_int = is(Kind::Int32);
    "is_long": c_int = is(Kind::Int64);
    "is_unsigned_char": c_int = is(Kind::Uint8);
    "is_unsigned_short": c_int = is(Kind::Uint16);
    "is_unsigned_int": c_int = is(Kind::Uint32);
    "is_unsigned_long": c_int = is(Kind::Uint64);
    "is_float": c_int = is(Kind::Float32);
    "is_double": c_int = is(Kind::Float64);
    "is_string": c_int = is(Kind::Text);
    "is_char8_str": c_int = is(Kind::Text);
    "is_little_endian": c_int = |datatype: &Datatype| order(datatype) == LITTLE_ENDIAN;
    "is_big_endian": c_int = |datatype: &Datatype| order(datatype) == BIG_ENDIAN;
    "endianness_matches_machine": c_int = |datatype: &Datatype| datatype.matches_machine();
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_datatype_element_index(
    pointer: *const Datatype,
    index: i64,
) -> i64 {
    run(0, || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        let found = unsafe { datatype(pointer)? }.element_index(index);
        found.ok_or_else(|| {
            Error::new(format!("the offset of element {index} does not fit into 64 bits"))
        })
    })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_datatype_name(
    pointer: *const Datatype,
) -> *mut c_char {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(ptr::null_mut(), || Ok(hand_out(unsafe { datatype(pointer)? }.kind.name())))
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_datatype_name_destroy(name: *mut c_char) {
    // SAFETY: the name came from `catalyst_conduit_datatype_name`, which used `malloc`, or is null.
    unsafe { libc::free(name.cast::<c_void>()) }
}

#[unsafe(no_mangle)]
extern "C-unwind" fn catalyst_conduit_datatype_sizeof_index_t() -> c_int {
    8
}
