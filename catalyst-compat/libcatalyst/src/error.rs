//! Errors, and how they reach the caller: through the handler that was set for their severity, else as a C++ exception where the
//! process has a C++ runtime, else as a line on standard error. As in Conduit, a value read as another type than it has is a
//! warning: with a handler of warnings that returns, the read answers 0 or null.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::fmt;
use std::panic::Location;
use std::sync::{Mutex, PoisonError};

/// What went wrong, and where in this library it was noticed.
#[derive(Debug, Clone)]
pub struct Error {
    message: String,
    place: &'static Location<'static>,
    severity: Severity,
}

/// The result of anything that may go wrong.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An error that says `message`, noticed where this is called.
    #[track_caller]
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), place: Location::caller(), severity: Severity::Error }
    }

    /// What is told to the handler of warnings, noticed where this is called.
    #[track_caller]
    pub fn warning(message: impl Into<String>) -> Self {
        Self { message: message.into(), place: Location::caller(), severity: Severity::Warning }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.message)
    }
}

impl std::error::Error for Error {}

/// A handler of messages: the text, the file and the line where it arose.
pub type Handler = unsafe extern "C-unwind" fn(*const c_char, *const c_char, c_int);

static INFORMATION: Mutex<Option<Handler>> = Mutex::new(None);
static WARNING: Mutex<Option<Handler>> = Mutex::new(None);
static ERROR: Mutex<Option<Handler>> = Mutex::new(None);

/// Which messages a handler is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Severity {
    /// Worth knowing.
    Information,
    /// Probably not what was meant.
    Warning,
    /// Not done.
    Error,
}

fn slot(severity: Severity) -> &'static Mutex<Option<Handler>> {
    match severity {
        Severity::Information => &INFORMATION,
        Severity::Warning => &WARNING,
        Severity::Error => &ERROR,
    }
}

/// Sets the handler of a severity; `None` brings the default back.
pub fn set_handler(severity: Severity, handler: Option<Handler>) {
    *slot(severity).lock().unwrap_or_else(PoisonError::into_inner) = handler;
}

/// Tells an error to the handler, or throws it, or prints it. Whoever calls this must be ready to be unwound.
pub fn raise(error: Error) {
    let handler = *slot(error.severity).lock().unwrap_or_else(PoisonError::into_inner);
    let message = text(&error.message);
    let file = text(error.place.file());
    let line = c_int::try_from(error.place.line()).unwrap_or(0);
    drop(error);
    match handler {
        // SAFETY: the caller of `set_handler` promised a function of this signature; both strings live until it returns or
        // unwinds, and it may unwind.
        Some(handler) => unsafe { handler(message.as_ptr(), file.as_ptr(), line) },
        None => {
            throw(&message);
            eprintln!("conduit: {}", message.to_string_lossy());
        }
    }
}

fn text(message: &str) -> CString {
    CString::new(message.replace('\0', "\u{fffd}")).unwrap_or_default()
}

type Allocate = unsafe extern "C" fn(usize) -> *mut c_void;
type Construct = unsafe extern "C-unwind" fn(*mut c_void, *const c_char);
type Destroy = unsafe extern "C" fn(*mut c_void);
type Throw = unsafe extern "C-unwind" fn(*mut c_void, *mut c_void, Option<Destroy>);

/// Throws `std::runtime_error` if the process has a C++ runtime; returns if it has none.
fn throw(message: &CStr) {
    let (Some(allocate), Some(construct), Some(information), Some(destroy), Some(throw)) = (
        symbol(c"__cxa_allocate_exception"),
        symbol(c"_ZNSt13runtime_errorC1EPKc"),
        symbol(c"_ZTISt13runtime_error"),
        symbol(c"_ZNSt13runtime_errorD1Ev"),
        symbol(c"__cxa_throw"),
    ) else {
        return;
    };
    // SAFETY: these are the names that the Itanium C++ ABI gives to these functions; the signatures are those of that ABI. An
    // exception object of 64 bytes is larger than any runtime's `std::runtime_error`. Every Rust frame between here and the C
    // caller is `extern "C-unwind"` or plain Rust, which foreign exceptions may unwind.
    unsafe {
        let allocate = std::mem::transmute::<*mut c_void, Allocate>(allocate);
        let construct = std::mem::transmute::<*mut c_void, Construct>(construct);
        let destroy = std::mem::transmute::<*mut c_void, Destroy>(destroy);
        let throw = std::mem::transmute::<*mut c_void, Throw>(throw);
        let exception = allocate(64);
        construct(exception, message.as_ptr());
        throw(exception, information, Some(destroy));
    }
}

fn symbol(name: &CStr) -> Option<*mut c_void> {
    // SAFETY: `name` is a C string, and `RTLD_DEFAULT` needs no open handle.
    let found = unsafe { libc::dlsym(libc::RTLD_DEFAULT, name.as_ptr()) };
    (!found.is_null()).then_some(found)
}
