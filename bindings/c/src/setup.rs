//! From `tombolo_open` to `tombolo_start`, and from `tombolo_finalize` to `tombolo_close`.

use std::ffi::{c_char, c_int};
use std::path::PathBuf;
use std::ptr;
use std::sync::Arc;

use tombolo::foreign::{Run, RunError, declare, ranks};
use tombolo::pipelines::language;
use tombolo::{Condition, Parameter, Restart, Settings};

use crate::ending::Ending;
use crate::export::{Out, Text, export};
use crate::{Fault, Handle, Opened, Stage, c_string, find, hold, register, runs, with};

/// Conditions as the header numbers them.
const INFLOW: c_int = 1;
const OUTFLOW: c_int = 2;
const WALL: c_int = 3;

fn read_settings(file: Text) -> Result<Settings, Fault> {
    Ok(Settings::from_file(file.get("file")?)?)
}

/// Changes what a run is opened with, before it begins.
fn set(
    run: *mut Handle,
    change: impl FnOnce(&mut Settings) -> Result<(), Fault>,
) -> Result<(), Fault> {
    with(run, |run| change(run.settings()?))
}

export! {
    fn tombolo_open(file: Text, communicator: c_int, run: Out<*mut Handle>) {
        let run = run.get("the address of the run")?;
        *run = ptr::null_mut();
        // SAFETY: the header says that it is the handle of a live communicator.
        let communicator = unsafe { ranks::communicator(Some(communicator)) }?;
        // A rank whose file cannot be read must not leave the others waiting.
        let read = if file.is_null() { Ok(Settings::default()) } else { read_settings(file) };
        let read = read.map_err(|fault| match fault {
            Fault::Error(error) => error,
            Fault::Call(message) => RunError::Configuration(message),
        });
        let settings = Settings { communicator: Arc::clone(&communicator), ..ranks::agree(&*communicator, read)? };
        *run = register(Opened::new(Stage::Opened(Box::new(settings))));
        Ok(())
    }

    fn tombolo_configure(run: *mut Handle, json: Text) {
        let json = json.get("json")?;
        set(run, |settings| {
            settings.config = language::check(&json, "configuration")?;
            settings.file = None;
            Ok(())
        })
    }

    fn tombolo_orders(run: *mut Handle, json: Text) {
        let json = json.get("json")?;
        set(run, |settings| {
            settings.orders.extend(language::check_orders(&json, "orders")?);
            Ok(())
        })
    }

    fn tombolo_orders_file(run: *mut Handle, file: Text) {
        let file = file.get("file")?;
        set(run, |settings| {
            settings.orders.extend(Settings::default().orders_from_file(&file)?.orders);
            Ok(())
        })
    }

    fn tombolo_replay_file(run: *mut Handle, file: Text) {
        let file = file.get("file")?;
        set(run, |settings| {
            settings.replay = Settings::default().replay_from_file(&file)?.replay;
            Ok(())
        })
    }

    fn tombolo_output(run: *mut Handle, directory: Text) {
        let directory = directory.get("directory")?;
        set(run, |settings| {
            settings.output = PathBuf::from(directory);
            Ok(())
        })
    }

    fn tombolo_parameter(run: *mut Handle, parameter: Text, value: f64, minimum: f64, maximum: f64) {
        let name = parameter.name("the parameter's name")?;
        set(run, |settings| {
            Ok(declare(&mut settings.parameters, Parameter { name, value, minimum, maximum })?)
        })
    }

    fn tombolo_condition(run: *mut Handle, feature: Text, condition: c_int) {
        let feature = feature.name("the feature's name")?;
        let condition = match condition {
            INFLOW => Condition::Inflow,
            OUTFLOW => Condition::Outflow,
            WALL => Condition::Wall,
            other => {
                let expected = "TOMBOLO_INFLOW, TOMBOLO_OUTFLOW or TOMBOLO_WALL";
                return Err(Fault::invalid("condition", other, expected));
            }
        };
        set(run, |settings| {
            settings.conditions.insert(feature, condition);
            Ok(())
        })
    }

    fn tombolo_restart(run: *mut Handle, file: Text) {
        let file = file.get("file")?;
        set(run, |settings| {
            settings.restart = Some(Restart::File(PathBuf::from(file)));
            Ok(())
        })
    }

    fn tombolo_start(run: *mut Handle) {
        with(run, |run| match &run.stage {
            Stage::UnderWay(_) => Err(Fault::Call("called twice, or after tombolo_execute; the run has begun".into())),
            _ => run.begin().map(|_| ()),
        })
    }

    fn tombolo_link(run: *mut Handle) -> (*const c_char = ptr::null()) {
        with(run, |run| {
            run.under_way()?;
            Ok(run.link.as_ref().map_or(ptr::null(), |link| link.as_ptr()))
        })
    }

    fn tombolo_watching_link(run: *mut Handle) -> (*const c_char = ptr::null()) {
        with(run, |run| {
            run.under_way()?;
            Ok(run.watching_link.as_ref().map_or(ptr::null(), |link| link.as_ptr()))
        })
    }

    fn tombolo_finalize(run: *mut Handle) {
        with(run, Opened::end)
    }

    fn tombolo_report(run: *mut Handle) -> (*const c_char = ptr::null()) {
        with(run, |run| match &run.stage {
            Stage::Ended => Ok(run.report.as_ref().map_or(ptr::null(), |(_, text)| text.as_ptr())),
            _ => Err(Fault::Call("called before tombolo_finalize; the report is made at the end".into())),
        })
    }

    fn tombolo_close(run: Out<*mut Handle>) {
        let run = run.get("the address of the run")?;
        if run.is_null() {
            return Ok(());
        }
        let opened = find(*run)?;
        let mut held = hold(&opened.run)?;
        runs().open.remove(&run.addr());
        *run = ptr::null_mut();
        if matches!(held.stage, Stage::Ended) { Ok(()) } else { held.end() }
    }
}

impl Opened {
    /// Begins, where that has not been done. Collective.
    pub(super) fn begin(&mut self) -> Result<&mut Run, Fault> {
        if let Stage::Opened(settings) = &self.stage {
            let run = Run::new((**settings).clone())?;
            self.link = run.link().map(|link| c_string(&link));
            self.watching_link = run.watching_link().map(|link| c_string(&link));
            Ending::of(&self.ending).begin(run.stopper());
            self.stage = Stage::UnderWay(Box::new(run));
        }
        match &mut self.stage {
            Stage::UnderWay(run) => Ok(run),
            _ => Err(Self::after_the_end()),
        }
    }

    /// Ends. Collective.
    pub(super) fn end(&mut self) -> Result<(), Fault> {
        *Ending::of(&self.ending) = Ending::Ended;
        match std::mem::replace(&mut self.stage, Stage::Ended) {
            Stage::UnderWay(run) => {
                let (report, ended) = run.finalize();
                self.orders.clear();
                let text = c_string(&serde_json::to_string(&report).unwrap_or_default());
                self.report = Some((report, text));
                Ok(ended?)
            }
            Stage::Opened(_) => Ok(()),
            Stage::Ended => Err(Self::after_the_end()),
        }
    }
}
