//! The C interface of `include/tombolo.h`. What each function does is told there.
//!
//! # Safety
//! Of every function: pointers are null or point to what the header says, handles come from `tombolo_create` and are used by one
//! thread at a time, and arrays that were named live, unchanged by others, while `tombolo_execute` runs.

mod arrays;
mod setup;
mod steps;

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int};

use tombolo::{Report, Settings};

use crate::error::CatalystError;
use crate::run::Run;
use arrays::Named;

/// Wrong call, as the header numbers it; the other statuses are those of Catalyst.
const WRONG_CALL: c_int = 1;

/// How far a run has come.
enum Stage {
    SettingUp { settings: Box<Settings>, communicator: Option<i32> },
    UnderWay(Box<Run>),
    Ended,
}

/// What the handle stands for.
pub struct Handle {
    stage: Stage,
    channels: Vec<Named>,
    report: CString,
    /// The report itself, for counts.
    ended: Option<Report>,
}

/// What can be wrong with a call.
enum Fault {
    Call(String),
    Error(CatalystError),
}

impl From<CatalystError> for Fault {
    fn from(error: CatalystError) -> Self {
        Fault::Error(error)
    }
}

impl Fault {
    fn invalid(what: &str, found: impl ToString, expected: impl ToString) -> Self {
        Fault::Error(CatalystError::Wrong {
            path: what.into(),
            found: found.to_string(),
            expected: expected.to_string(),
        })
    }
}

thread_local! {
    static MESSAGE: RefCell<CString> = RefCell::default();
}

fn keep_message(text: &str) {
    MESSAGE.with_borrow_mut(|message| *message = c_string(text));
}

fn c_string(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}

/// Runs a call so that neither an error nor a panic crosses the border.
fn answer(run: impl FnOnce() -> Result<(), Fault>) -> c_int {
    match std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)) {
        Ok(Ok(())) => 0,
        Ok(Err(Fault::Call(message))) => {
            keep_message(&message);
            WRONG_CALL
        }
        Ok(Err(Fault::Error(error))) => {
            keep_message(&error.to_string());
            error.status() as c_int
        }
        Err(_) => {
            keep_message("a defect of tombolo stopped this call; the solver may go on");
            102
        }
    }
}

/// # Safety
/// As the module says.
unsafe fn handle<'a>(run: *mut Handle) -> Result<&'a mut Handle, Fault> {
    // SAFETY: null, or what `tombolo_create` made and nobody else uses now.
    unsafe { run.as_mut() }.ok_or_else(|| Fault::Call("the run is a null pointer".into()))
}

/// # Safety
/// As the module says.
unsafe fn shared<'a>(run: *const Handle) -> Option<&'a Handle> {
    // SAFETY: as in `handle`.
    unsafe { run.as_ref() }
}

/// # Safety
/// `text` is null or a C string.
unsafe fn text(text: *const c_char, what: &str) -> Result<String, Fault> {
    if text.is_null() {
        return Err(Fault::Call(format!("{what} is a null pointer")));
    }
    // SAFETY: a C string, by the module's contract.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map(str::to_owned).map_err(|_| Fault::invalid(what, "bytes that are no UTF-8", "a text in UTF-8"))
}

/// Copies a text into the caller's memory, cut where it is too long, and ends it.
///
/// # Safety
/// `into` is null or can be written to for `bytes` bytes.
unsafe fn give(text: &str, into: *mut c_char, bytes: usize) {
    if into.is_null() || bytes == 0 {
        return;
    }
    let mut length = text.len().min(bytes - 1);
    while !text.is_char_boundary(length) {
        length -= 1;
    }
    // SAFETY: `length + 1` bytes can be written, and lie apart from the text.
    unsafe {
        std::ptr::copy_nonoverlapping(text.as_ptr().cast(), into, length);
        into.add(length).write(0);
    }
}

impl Handle {
    fn setting_up(&mut self) -> Result<(&mut Settings, &mut Option<i32>), Fault> {
        match &mut self.stage {
            Stage::SettingUp { settings, communicator } => Ok((settings, communicator)),
            _ => Err(Fault::Call("called after tombolo_initialize; it belongs before".into())),
        }
    }

    fn under_way(&self) -> Option<&Run> {
        match &self.stage {
            Stage::UnderWay(run) => Some(run),
            _ => None,
        }
    }
}

/// The last message of this thread.
#[unsafe(no_mangle)]
pub extern "C" fn tombolo_message() -> *const c_char {
    MESSAGE.with_borrow(|message| message.as_ptr())
}
