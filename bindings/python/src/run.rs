//! A run of a solver in Python, on which the class `tombolo.Adaptor` rests.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use tombolo::foreign::{self, RunError, Shown, ranks};
use tombolo::pipelines::language;
use tombolo::{Condition, ExecuteError, Parameter, Settings, Stopper};

use crate::error::{CallError, FailedError, Mistake, guarded, of_run, raised};
use crate::given::found;
use crate::lender::{Channels, Lender};
use crate::motion::Motion;

/// The motion that is asked for, whether to stop, and the parameters where they have changed.
type Asked<'py> = (Option<Motion>, bool, Option<Bound<'py, PyDict>>);

/// How far a run has come.
enum Stage {
    UnderWay(Box<foreign::Run>),
    /// With its report, one JSON object.
    Ended(String),
}

struct State {
    stage: Stage,
    /// The parameters as Python was told of them.
    told: BTreeMap<String, f64>,
    /// How many coordinates a vertex of each channel has.
    dimensions: HashMap<String, usize>,
}

/// A run under way.
#[pyclass(frozen, module = "tombolo._native")]
pub(crate) struct Run {
    state: Mutex<State>,
    /// Whose threads serve the run: a fork has none of them.
    process: u32,
    links: [Option<String>; 2],
    stopper: Stopper,
    /// Whether the run is at its end, which is known while another thread is in a call too.
    has_ended: AtomicBool,
    /// What a handler of a signal has raised while the solver waited.
    raised: Raised,
}

type Raised = Arc<Mutex<Option<PyErr>>>;

/// Has the handlers of signals run while the solver waits: Python runs them between its own calls
/// alone. What one raises stops the run, and is raised behind the call.
fn heed_signals(run: &mut foreign::Run) -> Raised {
    let (raised, stopper) = (Raised::default(), run.stopper());
    let told = Arc::clone(&raised);
    run.while_waiting(move || {
        if let Err(error) = Python::attach(|py| py.check_signals()) {
            *told.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            stopper.stop();
        }
    });
    raised
}

/// Moves what only this call uses to where other threads of Python may run meanwhile.
struct Call<'a, 'call> {
    run: &'a mut foreign::Run,
    given: Result<Shown<'call>, RunError>,
}

// SAFETY: the channels are `Channels`, which may be sent, taken apart; the rest is `Send` by itself.
unsafe impl Send for Call<'_, '_> {}

impl Call<'_, '_> {
    fn execute(self) -> Result<bool, RunError> {
        let _alarm = self.run.alarm();
        self.run.execute(self.given)
    }
}

impl Run {
    /// The state, where no other thread is in a call.
    fn free(&self) -> Option<MutexGuard<'_, State>> {
        match self.state.try_lock() {
            Ok(held) => Some(held),
            Err(TryLockError::Poisoned(held)) => Some(held.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        }
    }

    /// Refuses calls in a fork.
    fn require_own_process(&self) -> PyResult<()> {
        if std::process::id() == self.process {
            return Ok(());
        }
        Err(CallError::new_err(
            "the adaptor was made before this process was forked, and belongs to the other one; make one here",
        ))
    }

    fn hold(&self) -> PyResult<MutexGuard<'_, State>> {
        self.require_own_process()?;
        self.free().ok_or_else(|| {
            CallError::new_err("the adaptor is in another call; one thread at a time can use it")
        })
    }
}

impl Stage {
    fn run(&mut self) -> PyResult<&mut foreign::Run> {
        match self {
            Stage::UnderWay(run) => Ok(run),
            Stage::Ended(_) => Err(after_the_end()),
        }
    }
}

fn after_the_end() -> PyErr {
    CallError::new_err(
        "called after finalize, or after the end of the `with` block; the run has ended",
    )
}

/// The step of a call.
fn step(
    cycle: &Bound<'_, PyAny>,
    time: &Bound<'_, PyAny>,
    time_step: &Bound<'_, PyAny>,
) -> Result<tombolo::Step, Mistake> {
    let wrong = |what, given: &Bound<'_, PyAny>, expected, error: PyErr| {
        raised(error, |_| RunError::Step { what, found: found(given), expected })
    };
    let number = |what, given: &Bound<'_, PyAny>| {
        given.extract().map_err(|error| wrong(what, given, "a number", error))
    };
    let whole = |error| wrong("cycle", cycle, "a whole number from 0 on", error);
    Ok(tombolo::Step {
        cycle: cycle.extract().map_err(whole)?,
        time: number("time", time)?,
        time_step: number("time_step", time_step)?,
    })
}

/// A configuration or orders as they were given: a text with its name, or the path of a file.
#[derive(FromPyObject)]
enum Source {
    Text(String, String),
    File(PathBuf),
}

fn settings(
    configuration: Option<Source>,
    orders: Option<Source>,
    replay: Option<PathBuf>,
) -> Result<Settings, RunError> {
    let mut settings = match configuration {
        Some(Source::File(file)) => Settings::from_file(file)?,
        Some(Source::Text(text, name)) => {
            Settings { config: language::check(&text, &name)?, ..Settings::default() }
        }
        None => Settings::default(),
    };
    settings = match orders {
        Some(Source::File(file)) => settings.orders_from_file(file)?,
        Some(Source::Text(text, name)) => {
            Settings { orders: language::check_orders(&text, &name)?, ..settings }
        }
        None => settings,
    };
    match replay {
        Some(journal) => Ok(settings.replay_from_file(journal)?),
        None => Ok(settings),
    }
}

/// What features are to the flow, as Python names it.
fn conditions(given: Vec<(String, String)>) -> Result<BTreeMap<String, Condition>, RunError> {
    let condition = |(feature, word): (String, String)| match word.as_str() {
        "inflow" => Ok((feature, Condition::Inflow)),
        "outflow" => Ok((feature, Condition::Outflow)),
        "wall" => Ok((feature, Condition::Wall)),
        other => Err(RunError::Configuration(format!(
            "condition of '{feature}': found '{other}', expected 'inflow', 'outflow' or 'wall'"
        ))),
    };
    given.into_iter().map(condition).collect()
}

#[pymethods]
impl Run {
    #[new]
    #[pyo3(signature = (
        configuration, orders, replay, parameters, conditions, output, communicator, mistake
    ))]
    #[allow(clippy::too_many_arguments, reason = "Python names each")]
    fn new(
        py: Python<'_>,
        configuration: Option<Source>,
        orders: Option<Source>,
        replay: Option<PathBuf>,
        parameters: Vec<(String, f64, f64, f64)>,
        conditions: Vec<(String, String)>,
        output: Option<PathBuf>,
        communicator: Option<i32>,
        mistake: Option<String>,
    ) -> PyResult<Self> {
        let begin = || -> Result<foreign::Run, RunError> {
            // SAFETY: of a communicator of mpi4py, which is alive during the call.
            let communicator = unsafe { ranks::communicator(communicator) }?;
            // Refused on all ranks, what is wrong on one: the others would wait for it.
            let given = mistake.map_or(Ok(()), |mistake| Err(RunError::Configuration(mistake)));
            let given = given.and_then(|()| {
                Ok((settings(configuration, orders, replay)?, self::conditions(conditions)?))
            });
            let (settings, conditions) = ranks::agree(&*communicator, given)?;
            let parameters = parameters
                .into_iter()
                .map(|(name, value, minimum, maximum)| Parameter { name, value, minimum, maximum });
            foreign::Run::new(Settings {
                parameters: parameters.collect(),
                conditions,
                output: output.unwrap_or(settings.output),
                communicator: Arc::clone(&communicator),
                ..settings
            })
        };
        let mut run = guarded(|| py.detach(begin).map_err(of_run))?;
        let raised = heed_signals(&mut run);
        Ok(Self {
            links: [run.link(), run.watching_link()],
            stopper: run.stopper(),
            raised,
            has_ended: AtomicBool::new(false),
            process: std::process::id(),
            state: Mutex::new(State {
                told: run.asked().parameters.clone(),
                dimensions: HashMap::new(),
                stage: Stage::UnderWay(Box::new(run)),
            }),
        })
    }

    /// Shows a step; gives back `(motion, stop, parameters)`, or `None` where nothing is asked and
    /// nothing has changed.
    fn execute<'py>(
        &self,
        py: Python<'py>,
        cycle: &Bound<'py, PyAny>,
        time: &Bound<'py, PyAny>,
        time_step: &Bound<'py, PyAny>,
        channels: &Bound<'py, PyAny>,
    ) -> PyResult<Option<Asked<'py>>> {
        let mut state = self.hold()?;
        let State { stage, told, dimensions } = &mut *state;
        let run = stage.run()?;
        // Refused with what else is wrong on one rank: the others would wait for it.
        let step = step(cycle, time, time_step);
        let cycle = step.as_ref().map_or(0, |step| step.cycle);
        let looked_at = step.as_ref().is_ok_and(|step| run.looks_at(step));
        // A call with nothing due costs the same, however many fields and features there are.
        let mut lender = Lender::default();
        let given = lender.channels(channels, &|channel| looked_at || run.needs_whole(channel));
        for (channel, dimension) in given.iter().flat_map(Channels::dimensions) {
            if dimensions.get(channel) != Some(&dimension) {
                dimensions.insert(channel.to_owned(), dimension);
            }
        }
        let given = step
            .and_then(|step| given.map(|channels| Shown { step, looked_at, channels: channels.0 }));
        let (given, interrupted) = match given {
            Ok(shown) => (Ok(shown), None),
            Err(Mistake::Given(error)) => (Err(error), None),
            Err(Mistake::Raised(error)) => (Err(RunError::Left(error.to_string())), Some(error)),
        };
        let call = Call { run, given };
        let shown = guarded(|| py.detach(|| call.execute()).map_err(of_run));
        drop(lender);
        if let Some(error) = interrupted {
            return Err(error);
        }
        // Before the step's own error, lest it be raised by a later call.
        if let Some(error) = self.raised.lock().unwrap_or_else(PoisonError::into_inner).take() {
            if let Err(refused) = shown {
                error.set_cause(py, Some(refused));
            }
            return Err(error);
        }
        if !shown? {
            return Err(of_run(ExecuteError::NoChannel { cycle }.into()));
        }
        let asked = run.asked();
        let (motion, stop) = (asked.motion.clone(), asked.stop);
        let changed = (asked.parameters != *told).then(|| asked.parameters.clone());
        if motion.is_none() && !stop && changed.is_none() {
            return Ok(None);
        }
        let parameters = match changed {
            Some(changed) => {
                let dict = PyDict::new(py);
                changed.iter().try_for_each(|(name, value)| dict.set_item(name, value))?;
                *told = changed;
                Some(dict)
            }
            None => None,
        };
        let steered = run.steered().0;
        let dimension = dimensions.get(steered).copied().unwrap_or(3);
        Ok(Some((motion.map(|motion| Motion::new(motion, dimension)), stop, parameters)))
    }

    /// Whether anything is due at a step that looks at the mesh and its fields.
    fn looks_at(
        &self,
        cycle: &Bound<'_, PyAny>,
        time: &Bound<'_, PyAny>,
        time_step: &Bound<'_, PyAny>,
    ) -> PyResult<bool> {
        let step = step(cycle, time, time_step)?;
        let mut state = self.hold()?;
        Ok(state.stage.run()?.looks_at(&step))
    }

    #[getter]
    fn link(&self) -> Option<&str> {
        self.links[0].as_deref()
    }

    #[getter]
    fn watching_link(&self) -> Option<&str> {
        self.links[1].as_deref()
    }

    /// What a program prints for a person to open the run.
    fn invitation(&self, terminal: bool) -> PyResult<Option<String>> {
        let mut state = self.hold()?;
        Ok(state.stage.run()?.invitation(terminal)?)
    }

    /// The parameters and their values now.
    #[getter]
    fn parameters(&self) -> PyResult<BTreeMap<String, f64>> {
        Ok(self.hold()?.told.clone())
    }

    /// The orders so far, a JSON list.
    #[getter]
    fn orders(&self) -> PyResult<String> {
        let state = self.hold()?;
        let orders = match &state.stage {
            Stage::UnderWay(run) => run.orders(),
            Stage::Ended(_) => return Err(CallError::new_err("the run has ended")),
        };
        serde_json::to_string(&orders).map_err(|error| FailedError::new_err(error.to_string()))
    }

    /// Asks the solver to end, from any thread, also while another is in a call.
    fn stop(&self) -> PyResult<()> {
        self.require_own_process()?;
        if self.has_ended.load(Ordering::Relaxed) {
            return Err(after_the_end());
        }
        self.stopper.stop();
        Ok(())
    }

    #[getter]
    fn ended(&self) -> bool {
        // A run that is in a call has not.
        self.free().is_some_and(|state| matches!(state.stage, Stage::Ended(_)))
    }

    /// Tells the other ranks that the solver has failed on this one, which shows no step any more.
    fn leave(&self, py: Python<'_>, reason: &str) -> PyResult<()> {
        let mut state = self.hold()?;
        let run = state.stage.run()?;
        guarded(|| {
            py.detach(|| run.leave(reason));
            Ok(())
        })
    }

    /// Ends the run; gives back its report, one JSON object.
    fn finalize(&self, py: Python<'_>) -> PyResult<String> {
        let mut state = self.hold()?;
        state.stage.run()?;
        self.has_ended.store(true, Ordering::Relaxed);
        let stage = std::mem::replace(&mut state.stage, Stage::Ended("{}".to_owned()));
        let Stage::UnderWay(run) = stage else { return Ok("{}".to_owned()) };
        let (report, ended) = guarded(|| Ok(py.detach(|| run.finalize())))?;
        let report = serde_json::to_string(&report).unwrap_or_else(|_| "{}".to_owned());
        state.stage = Stage::Ended(report.clone());
        ended.map_err(of_run).map(|()| report)
    }

    /// The report of a run that has ended.
    #[getter]
    fn report(&self) -> Option<String> {
        match &self.free()?.stage {
            Stage::Ended(report) => Some(report.clone()),
            Stage::UnderWay(_) => None,
        }
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let state = self.state.get_mut().unwrap_or_else(PoisonError::into_inner);
        let stage = std::mem::replace(&mut state.stage, Stage::Ended(String::new()));
        if let Stage::UnderWay(run) = stage {
            if std::process::id() == self.process {
                // The run's threads may have something to say to Python's logging.
                Python::attach(|py| py.detach(|| drop(run)));
            } else {
                // A fork has not the threads that it would wait for.
                std::mem::forget(run);
            }
        }
    }
}
