//! From `tombolo_create` to `tombolo_initialize`, and the end.

use std::ffi::{CString, c_char, c_int};
use std::path::PathBuf;

use tombolo::pipelines::{
    language,
    limits::{DOCUMENT, Limit, WAITING_BYTES},
};
use tombolo::{Parameter, Settings};

use super::{Fault, Handle, Stage, answer, c_string, give, handle, keep_message, shared, text};
use crate::error::CatalystError;
use crate::ranks;
use crate::run::Run;

fn unreadable(error: impl ToString) -> Fault {
    Fault::Error(CatalystError::Configuration(error.to_string()))
}

fn file_text(file: &str, limit: Limit) -> Result<String, Fault> {
    language::read_text(file.as_ref(), limit).map_err(unreadable)
}

/// See `tombolo.h`.
#[unsafe(no_mangle)]
pub extern "C" fn tombolo_create() -> *mut Handle {
    let stage = Stage::SettingUp { settings: Box::default(), communicator: None };
    let handle = Handle { stage, channels: Vec::new(), report: CString::default(), ended: None };
    Box::into_raw(Box::new(handle))
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says; the handle is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_destroy(run: *mut Handle) {
    if !run.is_null() {
        let dropped = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            // SAFETY: `tombolo_create` made it of a box, and it is destroyed once.
            drop(unsafe { Box::from_raw(run) });
        }));
        if dropped.is_err() {
            keep_message("a defect of tombolo stopped this call; the solver may go on");
        }
    }
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_configure(run: *mut Handle, json: *const c_char) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let (run, json) = unsafe { (handle(run)?, text(json, "json")?) };
        run.setting_up()?.0.config = language::parse(&json, "configuration").map_err(unreadable)?;
        Ok(())
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_configure_file(run: *mut Handle, file: *const c_char) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let (run, file) = unsafe { (handle(run)?, text(file, "file")?) };
        run.setting_up()?.0.config = language::parse(&file_text(&file, DOCUMENT)?, &file).map_err(unreadable)?;
        Ok(())
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_orders_file(run: *mut Handle, file: *const c_char) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let (run, file) = unsafe { (handle(run)?, text(file, "file")?) };
        run.setting_up()?.0.orders =
            language::parse_orders(&file_text(&file, WAITING_BYTES)?, &file).map_err(unreadable)?;
        Ok(())
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_output(run: *mut Handle, directory: *const c_char) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let (run, directory) = unsafe { (handle(run)?, text(directory, "directory")?) };
        run.setting_up()?.0.output = PathBuf::from(directory);
        Ok(())
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_communicator(run: *mut Handle, fortran_handle: c_int) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        *unsafe { handle(run) }?.setting_up()?.1 = Some(fortran_handle);
        Ok(())
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_parameter(
    run: *mut Handle,
    name: *const c_char,
    value: f64,
    minimum: f64,
    maximum: f64,
) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let (run, name) = unsafe { (handle(run)?, text(name, "name")?) };
        run.setting_up()?.0.parameters.push(Parameter { name, value, minimum, maximum });
        Ok(())
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_initialize(run: *mut Handle) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let run = unsafe { handle(run) }?;
        let (settings, communicator) = run.setting_up()?;
        let ranks = ranks::communicator(*communicator)?;
        let settings = Settings { communicator: ranks, ..settings.clone() };
        run.stage = Stage::UnderWay(Box::new(Run::new(settings)?));
        Ok(())
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_link(run: *const Handle, into: *mut c_char, bytes: usize) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let run = unsafe { shared(run) }.ok_or_else(|| Fault::Call("the run is a null pointer".into()))?;
        let link = run.under_way().and_then(Run::link).unwrap_or_default();
        // SAFETY: as the module says.
        unsafe { give(&link, into, bytes) };
        Ok(())
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_finalize(run: *mut Handle) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let run = unsafe { handle(run) }?;
        match std::mem::replace(&mut run.stage, Stage::Ended) {
            Stage::UnderWay(under_way) => {
                let (report, ended) = under_way.finalize();
                if let Some(report) = &report {
                    run.report = c_string(&serde_json::to_string(report).unwrap_or_default());
                }
                run.ended = report;
                Ok(ended?)
            }
            before => {
                run.stage = before;
                Err(Fault::Call("called outside of tombolo_initialize ... tombolo_finalize".into()))
            }
        }
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_report(run: *const Handle) -> *const c_char {
    // SAFETY: as the module says.
    unsafe { shared(run) }.map_or(c"".as_ptr(), |run| run.report.as_ptr())
}
