//! How functions of `tombolo.h` are exported, and the arguments that C passes them.

use std::ffi::{CStr, c_char};

use crate::Fault;

/// Exports functions of `tombolo.h`.
///
/// A body runs so that neither an error nor a panic crosses the border: they become a status and a
/// message, or the value that stands behind the type of an answer.
macro_rules! export {
    ($(fn $name:ident($($argument:ident: $type:ty),* $(,)?) $(-> ($answer:ty = $otherwise:expr))? $body:block)*) => { $(
        export! { @one fn $name($($argument: $type),*) $(-> ($answer = $otherwise))? $body }
    )* };
    (@one fn $name:ident($($argument:ident: $type:ty),*) $body:block) => {
        /// See `tombolo.h`.
        ///
        /// # Safety
        /// As the crate's page says.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($($argument: $type),*) -> std::ffi::c_int {
            $crate::answer(|| $body)
        }
    };
    (@one fn $name:ident($($argument:ident: $type:ty),*) -> ($answer:ty = $otherwise:expr) $body:block) => {
        /// See `tombolo.h`.
        ///
        /// # Safety
        /// As the crate's page says.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name($($argument: $type),*) -> $answer {
            $crate::value($otherwise, || $body)
        }
    };
}

pub(crate) use export;

/// A `const char*`: null, or the address of a text that ends in a nul and lives, unchanged, during
/// the call.
///
/// Only C makes one.
#[repr(transparent)]
#[derive(Clone, Copy)]
pub struct Text(*const c_char);

impl Text {
    pub(crate) fn is_null(self) -> bool {
        self.0.is_null()
    }

    /// The text, which errors call `what`.
    pub(crate) fn get(self, what: &str) -> Result<String, Fault> {
        if self.is_null() {
            return Err(Fault::null(what));
        }
        // SAFETY: the text of a caller, as the header says.
        let text = unsafe { CStr::from_ptr(self.0) };
        text.to_str()
            .map(str::to_owned)
            .map_err(|_| Fault::invalid(what, "bytes that are not UTF-8", "a text in UTF-8"))
    }

    /// The text as that of something that has a name.
    pub(crate) fn name(self, what: &str) -> Result<String, Fault> {
        let name = self.get(what)?;
        if name.is_empty() || name.chars().any(char::is_control) {
            return Err(Fault::invalid(
                what,
                format!("{name:?}"),
                "a name of one letter or more, on one line",
            ));
        }
        Ok(name)
    }
}

/// The address that an answer is written to: null, or that of a value which nobody else uses during
/// the call.
///
/// Only C makes one.
#[repr(transparent)]
pub struct Out<T>(*mut T);

impl<T> Out<T> {
    /// Where the answer goes, which errors call `what`.
    pub(crate) fn get<'call>(self, what: &str) -> Result<&'call mut T, Fault> {
        // SAFETY: an address of the caller's, as the header says; this takes it away, so that
        // nobody else uses the value.
        unsafe { self.0.as_mut() }.ok_or_else(|| Fault::null(what))
    }
}
