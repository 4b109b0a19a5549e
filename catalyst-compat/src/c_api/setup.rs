//! From `tombolo_open` to `tombolo_start`, and from `tombolo_finalize` to `tombolo_close`.

use std::collections::BTreeMap;
use std::ffi::{CString, c_char, c_int};
use std::path::PathBuf;
use std::ptr;
use std::sync::Arc;

use tombolo::pipelines::{
    language::{self, Config},
    limits::{DOCUMENT, Limit, WAITING_BYTES},
};
use tombolo::{Parameter, Settings};

use super::{
    Fault, Handle, Opened, Stage, answer, c_string, find, hold, name, register, runs, text, value,
    with,
};
use crate::error::CatalystError;
use crate::ranks;
use crate::run::Run;

fn unreadable(error: impl ToString) -> CatalystError {
    CatalystError::Configuration(error.to_string())
}

fn file_text(file: &str, limit: Limit) -> Result<String, CatalystError> {
    language::read_text(file.as_ref(), limit).map_err(unreadable)
}

fn read_configuration(file: &str) -> Result<Config, CatalystError> {
    language::parse(&file_text(file, DOCUMENT)?, file).map_err(unreadable)
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_open(
    file: *const c_char,
    communicator: c_int,
    run: *mut *mut Handle,
) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let run = unsafe { run.as_mut() }.ok_or_else(|| Fault::null("the address of the run"))?;
        *run = ptr::null_mut();
        let communicator = ranks::communicator(Some(communicator))?;
        let mut settings =
            Settings { communicator: Arc::clone(&communicator), ..Settings::default() };
        // SAFETY: as the module says.
        let file = if file.is_null() { Ok(None) } else { unsafe { text(file, "file") }.map(Some) };
        // A rank whose file cannot be read must not leave the others waiting.
        let config =
            file.and_then(|file| Ok(file.map(|file| read_configuration(&file)).transpose()?));
        let config = config.map_err(|fault| match fault {
            Fault::Error(error) => error,
            Fault::Call(message) => CatalystError::Configuration(message),
        });
        if let Some(config) = ranks::agree(&*communicator, config)? {
            settings.config = config;
        }
        *run = register(Opened {
            stage: Stage::Opened(Box::new(settings)),
            channels: Vec::new(),
            link: None,
            orders: BTreeMap::new(),
            motion_order: CString::default(),
            report: None,
        });
        Ok(())
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_configure(run: *mut Handle, json: *const c_char) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let json = unsafe { text(json, "json") }?;
        with(run, |run| {
            run.settings()?.config = language::parse(&json, "configuration").map_err(unreadable)?;
            Ok(())
        })
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_orders(run: *mut Handle, json: *const c_char) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let json = unsafe { text(json, "json") }?;
        with(run, |run| {
            run.settings()?.orders = language::parse_orders(&json, "orders").map_err(unreadable)?;
            Ok(())
        })
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
        let file = unsafe { text(file, "file") }?;
        with(run, |run| {
            run.settings()?.orders =
                language::parse_orders(&file_text(&file, WAITING_BYTES)?, &file)
                    .map_err(unreadable)?;
            Ok(())
        })
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
        let directory = unsafe { text(directory, "directory") }?;
        with(run, |run| {
            run.settings()?.output = PathBuf::from(directory);
            Ok(())
        })
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_parameter(
    run: *mut Handle,
    parameter: *const c_char,
    value: f64,
    minimum: f64,
    maximum: f64,
) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let name = unsafe { name(parameter, "the parameter's name") }?;
        with(run, |run| {
            run.settings()?.parameters.push(Parameter { name, value, minimum, maximum });
            Ok(())
        })
    })
}

impl Opened {
    /// Begins, where that has not been done. Collective.
    pub(super) fn begin(&mut self) -> Result<&mut Run, Fault> {
        if let Stage::Opened(settings) = &self.stage {
            let run = Run::new((**settings).clone())?;
            self.link = run.link().map(|link| c_string(&link));
            self.stage = Stage::UnderWay(Box::new(run));
        }
        match &mut self.stage {
            Stage::UnderWay(run) => Ok(run),
            _ => Err(Self::after_the_end()),
        }
    }

    /// Ends. Collective.
    fn end(&mut self) -> Result<(), Fault> {
        match std::mem::replace(&mut self.stage, Stage::Ended) {
            Stage::UnderWay(run) => {
                let (report, ended) = run.finalize();
                self.orders.clear();
                self.report = report.map(|report| {
                    let text = c_string(&serde_json::to_string(&report).unwrap_or_default());
                    (report, text)
                });
                Ok(ended?)
            }
            Stage::Opened(_) => Ok(()),
            Stage::Ended => Err(Self::after_the_end()),
        }
    }
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_start(run: *mut Handle) -> c_int {
    answer(|| {
        with(run, |run| match &run.stage {
            Stage::UnderWay(_) => {
                Err(Fault::Call("called twice, or after tombolo_execute; the run has begun".into()))
            }
            _ => run.begin().map(|_| ()),
        })
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_link(run: *mut Handle) -> *const c_char {
    value(ptr::null(), || {
        with(run, |run| {
            run.under_way()?;
            Ok(run.link.as_ref().map_or(ptr::null(), |link| link.as_ptr()))
        })
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_finalize(run: *mut Handle) -> c_int {
    answer(|| with(run, Opened::end))
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_report(run: *mut Handle) -> *const c_char {
    value(ptr::null(), || {
        with(run, |run| match &run.stage {
            Stage::Ended => Ok(run.report.as_ref().map_or(ptr::null(), |(_, text)| text.as_ptr())),
            _ => Err(Fault::Call(
                "called before tombolo_finalize; the report is made at the end".into(),
            )),
        })
    })
}

/// See `tombolo.h`.
///
/// # Safety
/// As the module says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tombolo_close(run: *mut *mut Handle) -> c_int {
    answer(|| {
        // SAFETY: as the module says.
        let run = unsafe { run.as_mut() }.ok_or_else(|| Fault::null("the address of the run"))?;
        if run.is_null() {
            return Ok(());
        }
        let opened = find(*run)?;
        let mut held = hold(&opened)?;
        runs().open.remove(&run.addr());
        *run = ptr::null_mut();
        if matches!(held.stage, Stage::Ended) { Ok(()) } else { held.end() }
    })
}
