//! Tombolo for C and Fortran: the functions of `include/tombolo.h`, which says what each does.
//!
//! The library is installed as `libtombolo.so`. The Fortran module `tombolo`
//! (`fortran/tombolo.f90`) calls the same functions.
//!
//! A handle is a number that is never given twice, so that a run that was closed is told from one
//! that is open. Functions are exported by one macro, which sees to it that no panic crosses the
//! border.
//!
//! # Safety
//! Of every function: pointers are null or point to what the header says, and arrays that were
//! named live, unchanged by others, while `tombolo_execute` runs.

mod ending;
mod export;
mod lent;
mod logging;
mod mesh;
mod named;
mod setup;
mod steps;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ffi::{CStr, CString, c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use tombolo::foreign::{Run, RunError};
use tombolo::{Report, Settings};

use ending::Ending;
use export::Text;
use named::Named;

/// A call at the wrong time, as the header numbers it.
const WRONG_CALL: c_int = 1;
/// An argument, an array or a file that makes no sense.
const INVALID: c_int = 100;
/// The run could not begin, or a file not be written; or a defect.
const FAILED: c_int = 102;
const DEFECT: &str = "a defect of tombolo stopped this call; the solver may go on";

/// The opaque type behind a `tombolo*`: nothing that is ever looked at.
#[repr(C)]
pub struct Handle {
    _private: [u8; 0],
}

/// How far a run has come.
enum Stage {
    Opened(Box<Settings>),
    UnderWay(Box<Run>),
    Ended,
}

/// A run that was opened and not closed.
struct Opened {
    stage: Stage,
    channels: Vec<Named>,
    /// How it is asked to end.
    ending: Arc<Mutex<Ending>>,
    /// Texts that the caller has the addresses of.
    link: Option<CString>,
    watching_link: Option<CString>,
    orders: BTreeMap<usize, CString>,
    motion_order: CString,
    report: Option<(Report, CString)>,
}

/// The reason why a call is refused.
enum Fault {
    Call(String),
    Error(RunError),
}

impl<E: Into<RunError>> From<E> for Fault {
    fn from(error: E) -> Self {
        Fault::Error(error.into())
    }
}

impl Fault {
    fn invalid(what: impl ToString, found: impl ToString, expected: impl ToString) -> Self {
        Fault::Error(RunError::Argument {
            what: what.to_string(),
            found: found.to_string(),
            expected: expected.to_string(),
        })
    }

    fn null(what: &str) -> Self {
        Fault::Call(format!("{what} is a null pointer"))
    }
}

thread_local! {
    static MESSAGE: RefCell<CString> = RefCell::default();
}

fn keep_message(text: &str) {
    let text = c_string(text);
    // A thread that is ending keeps none.
    let _ = MESSAGE.try_with(|message| message.replace(text));
}

fn c_string(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}

/// Runs a call so that neither an error nor a panic crosses the border.
fn answer(call: impl FnOnce() -> Result<(), Fault>) -> c_int {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(())) => 0,
        Ok(Err(Fault::Call(message))) => {
            keep_message(&message);
            WRONG_CALL
        }
        Ok(Err(Fault::Error(error))) => {
            keep_message(&error.to_string());
            if error.is_failure() { FAILED } else { INVALID }
        }
        Err(_) => {
            keep_message(DEFECT);
            FAILED
        }
    }
}

/// Runs a call that answers with a value, or `otherwise` where something is wrong.
fn value<T>(otherwise: T, call: impl FnOnce() -> Result<T, Fault>) -> T {
    let mut found = otherwise;
    answer(|| {
        found = call()?;
        Ok(())
    });
    found
}

/// A run, and what can be asked of it while it is in a call.
#[derive(Clone)]
struct Entry {
    run: Arc<Mutex<Opened>>,
    ending: Arc<Mutex<Ending>>,
}

/// The runs that are open, by the numbers that stand for them.
#[derive(Default)]
struct Runs {
    last: usize,
    open: BTreeMap<usize, Entry>,
}

static RUNS: Mutex<Runs> = Mutex::new(Runs { last: 0, open: BTreeMap::new() });

fn runs() -> MutexGuard<'static, Runs> {
    RUNS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Gives a run its handle.
fn register(run: Opened) -> *mut Handle {
    let mut runs = runs();
    // Distances as between addresses, for whoever looks at the lowest bits of one.
    runs.last += 16;
    let number = runs.last;
    let ending = Arc::clone(&run.ending);
    runs.open.insert(number, Entry { run: Arc::new(Mutex::new(run)), ending });
    ptr::without_provenance_mut(number)
}

fn find(run: *mut Handle) -> Result<Entry, Fault> {
    if run.is_null() {
        return Err(Fault::null("the run"));
    }
    let known = runs().open.get(&run.addr()).cloned();
    known.ok_or_else(|| {
        Fault::Call("the run is not open: it was closed, or never opened by tombolo_open".into())
    })
}

/// Holds a run for the length of a call; `None` while it is in another.
fn try_hold(run: &Mutex<Opened>) -> Option<MutexGuard<'_, Opened>> {
    match run.try_lock() {
        Ok(held) => Some(held),
        Err(TryLockError::Poisoned(held)) => Some(held.into_inner()),
        Err(TryLockError::WouldBlock) => None,
    }
}

/// Holds a run for the length of a call.
fn hold(run: &Mutex<Opened>) -> Result<MutexGuard<'_, Opened>, Fault> {
    try_hold(run).ok_or_else(|| {
        Fault::Call("the run is in another call; one thread at a time can use it".into())
    })
}

/// Does something with an open run.
fn with<T>(
    run: *mut Handle,
    call: impl FnOnce(&mut Opened) -> Result<T, Fault>,
) -> Result<T, Fault> {
    let entry = find(run)?;
    call(&mut *hold(&entry.run)?)
}

impl Opened {
    fn new(stage: Stage) -> Self {
        Self {
            stage,
            channels: Vec::new(),
            ending: Arc::default(),
            link: None,
            watching_link: None,
            orders: BTreeMap::new(),
            motion_order: CString::default(),
            report: None,
        }
    }

    fn settings(&mut self) -> Result<&mut Settings, Fault> {
        match &mut self.stage {
            Stage::Opened(settings) => Ok(settings),
            _ => Err(Fault::Call(
                "called after the run began; expected before tombolo_start and the first tombolo_execute".into(),
            )),
        }
    }

    /// The run, which has begun and not ended.
    fn under_way(&self) -> Result<&Run, Fault> {
        match &self.stage {
            Stage::UnderWay(run) => Ok(run),
            Stage::Opened(_) => Err(Fault::Call(
                "called before the run began, by tombolo_start or the first tombolo_execute".into(),
            )),
            Stage::Ended => Err(Self::after_the_end()),
        }
    }

    fn not_ended(&self) -> Result<(), Fault> {
        if matches!(self.stage, Stage::Ended) { Err(Self::after_the_end()) } else { Ok(()) }
    }

    fn after_the_end() -> Fault {
        Fault::Call("called after tombolo_finalize; the run has ended".into())
    }
}

/// See `tombolo.h`.
#[unsafe(no_mangle)]
pub extern "C" fn tombolo_message() -> *const c_char {
    // A borrowed message cannot be met: it is replaced whole, and nobody else is called meanwhile.
    let kept = MESSAGE
        .try_with(|message| message.try_borrow().map_or(c"".as_ptr(), |message| message.as_ptr()));
    kept.unwrap_or(c"".as_ptr())
}

/// See `tombolo.h`.
#[unsafe(no_mangle)]
pub extern "C" fn tombolo_version() -> *const c_char {
    const VERSION: &CStr =
        match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
            Ok(version) => version,
            Err(_) => c"",
        };
    VERSION.as_ptr()
}

/// Lets the Fortran module refuse an array in the words of every other error: text, found,
/// expected.
#[unsafe(no_mangle)]
pub extern "C" fn tombolo_refuse(what: Text, found: Text, expected: Text) -> c_int {
    answer(|| {
        Err(Fault::invalid(what.get("what")?, found.get("found")?, expected.get("expected")?))
    })
}

#[cfg(test)]
mod tests {
    use tombolo::communicator::{Communicator, threads};

    use super::*;

    #[test]
    fn a_panic_is_a_status_and_a_message() {
        // SAFETY: the message is this thread's, and a C string.
        let told = || unsafe { CStr::from_ptr(tombolo_message()) }.to_string_lossy().into_owned();
        assert_eq!(answer(|| panic!("deliberate")), 102);
        assert_eq!(told(), DEFECT);
        assert_eq!(value(7, || Err(Fault::Call("other".into()))), 7);
        assert_eq!(told(), "other");
        assert_eq!(value(7, || panic!("deliberate")), 7);
        assert_eq!(told(), DEFECT);
    }

    #[test]
    fn a_run_whose_call_panicked_can_be_used() {
        let run = register(Opened::new(Stage::Ended));
        assert_eq!(answer(|| with(run, |_| panic!("deliberate"))), 102);
        assert_eq!(answer(|| with(run, |_| with(run, |_| Ok(())))), WRONG_CALL);
        assert_eq!(answer(|| with(run, |_| Ok(()))), 0);
        runs().open.remove(&run.addr());
        assert_eq!(answer(|| with(run, |_| Ok(()))), WRONG_CALL);
    }

    #[test]
    fn a_run_in_a_call_can_be_asked_to_end_and_goes_on() {
        let run = register(Opened::new(Stage::Opened(Box::default())));
        // SAFETY: the handle is that of an open run.
        let (stop, stopped) =
            unsafe { (|| steps::tombolo_stop(run), || steps::tombolo_stopped(run)) };
        assert_eq!(stopped(), 0);
        let in_a_call = |_: &mut Opened| {
            assert_eq!((stopped(), stop()), (0, 0));
            Ok(())
        };
        assert_eq!(answer(|| with(run, in_a_call)), 0);
        assert_eq!(stopped(), 0, "the first step tells it, on all ranks");
        assert_eq!(answer(|| with(run, Opened::end)), 0);
        assert_eq!((stopped(), stop()), (1, WRONG_CALL));
        runs().open.remove(&run.addr());
        assert_eq!((stopped(), stop()), (1, WRONG_CALL));
    }

    #[test]
    fn a_negative_cycle_of_one_rank_is_refused_on_all() {
        let output = tempfile::tempdir().expect("a temporary directory");
        let told = threads::run(2, |ranks| {
            let cycle = if ranks.rank() == 1 { u64::MAX } else { 0 };
            let settings = Settings {
                communicator: Arc::new(ranks),
                output: output.path().into(),
                ..Settings::default()
            };
            let run = register(Opened::new(Stage::Opened(Box::new(settings))));
            // SAFETY: the handle is that of an open run without arrays.
            let status = unsafe { steps::tombolo_execute(run, cycle, 0.0, 0.1) };
            // SAFETY: the message is this thread's, and a C string.
            let told = unsafe { CStr::from_ptr(tombolo_message()) }.to_string_lossy().into_owned();
            assert_eq!(answer(|| with(run, Opened::end)), 0);
            runs().open.remove(&run.addr());
            (status, told)
        });
        let refused = "cycle: found -1; expected a whole number from 0 on";
        let of_rank_0 = format!("rank 1: {refused}");
        assert_eq!(told, [(INVALID, of_rank_0), (INVALID, refused.into())]);
    }

    #[test]
    fn every_exported_function_stops_panics() {
        let sources = [
            include_str!("export.rs"),
            include_str!("lib.rs"),
            include_str!("logging.rs"),
            include_str!("mesh.rs"),
            include_str!("setup.rs"),
            include_str!("steps.rs"),
        ];
        for source in sources {
            let source = source.split("#[cfg(test)]").next().unwrap_or_default();
            for function in source.split("extern \"C\" fn ").skip(1) {
                let body = function.split("\n}\n").next().unwrap_or_default();
                let body: String = body.split_whitespace().collect();
                let guarded = ["answer(", "value(", "MESSAGE.try_with(", "constVERSION"];
                assert!(guarded.iter().any(|guard| body.contains(guard)), "{body}");
            }
        }
    }
}
