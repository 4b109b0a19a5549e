//! A client of a run, on which the class `tombolo.Run` rests.

use std::collections::BTreeSet;
use std::mem::ManuallyDrop;
use std::num::NonZeroU32;
use std::time::Duration;

use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use tombolo::client::{self, Drives, Event, Link, LinkError, Options};
use tombolo::deform::surface::Surface;
use tombolo::pipelines::encode::DecodedFrame;
use tombolo::pipelines::extract::{Association, Field};
use tombolo::pipelines::files::read_displacements;
use tombolo::pipelines::language::{self, Cancel, Command, LinkFor, Order, PipelineChange};

use crate::error::{ConfigurationError, FailedError, guarded, of_client, of_language};
use crate::language::{names_file, order};

/// A connection to a run.
#[pyclass(frozen, module = "tombolo._native")]
pub(crate) struct Client {
    client: ManuallyDrop<client::Client>,
    /// Whose thread serves it: a fork has none of it.
    process: u32,
}

/// An order that was read, with the numbers of the displacements whose files it names: to be sent.
#[pyclass(frozen, module = "tombolo._native")]
pub(crate) struct Prepared(Order);

impl Drop for Client {
    fn drop(&mut self) {
        // A fork has not the thread that it would wait for.
        if std::process::id() == self.process {
            // SAFETY: nothing uses it any more.
            let client = unsafe { ManuallyDrop::take(&mut self.client) };
            Python::attach(|py| py.detach(|| drop(client)));
        }
    }
}

/// A row for each of so many values of `columns` numbers, or the numbers where that is one.
pub(crate) fn table<'py, T: numpy::Element>(
    py: Python<'py>,
    values: Vec<T>,
    columns: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let rows = values.len() / columns.max(1);
    let array = values.into_pyarray(py);
    if columns == 1 { Ok(array.into_any()) } else { Ok(array.reshape([rows, columns])?.into_any()) }
}

fn frame<'py>(py: Python<'py>, frame: DecodedFrame) -> PyResult<Bound<'py, PyDict>> {
    let DecodedFrame { view, topology, cells, cycle, time, points, fields } = frame;
    let dict = PyDict::new(py);
    dict.set_item("view", view)?;
    dict.set_item("topology", topology)?;
    dict.set_item("cycle", cycle)?;
    dict.set_item("time", time)?;
    dict.set_item("points", table(py, points.into_flattened(), 3)?)?;
    if let Some(cells) = cells {
        dict.set_item("triangles", table(py, cells.triangles.into_flattened(), 3)?)?;
        dict.set_item("lines", table(py, cells.lines.into_flattened(), 2)?)?;
        dict.set_item("features", cells.triangle_features.map(|of| of.into_pyarray(py)))?;
    }
    let list = PyList::empty(py);
    for Field { name, association, components, values, .. } in fields {
        let association = match association {
            Association::Vertex => "vertex",
            Association::Element => "element",
            Association::Mesh => "mesh",
        };
        list.append((name, association, table(py, values, components)?))?;
    }
    dict.set_item("fields", list)?;
    Ok(dict)
}

/// The reference surface as arrays.
pub(crate) fn surface<'py>(py: Python<'py>, surface: &Surface) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("points", table(py, surface.points().as_flattened().to_vec(), 3)?)?;
    dict.set_item("vertices", surface.vertices().to_vec().into_pyarray(py))?;
    let faces = surface.faces();
    let (mut offsets, mut connectivity) = (vec![0_i64], Vec::new());
    for (_, face) in faces.iter() {
        connectivity.extend_from_slice(face);
        offsets.push(i64::try_from(connectivity.len()).unwrap_or(i64::MAX));
    }
    dict.set_item("connectivity", connectivity.into_pyarray(py))?;
    dict.set_item("offsets", offsets.into_pyarray(py))?;
    dict.set_item("features", surface.features().face_features().to_vec().into_pyarray(py))?;
    dict.set_item("names", surface.features().names())?;
    Ok(dict)
}

/// So many seconds; none where that is no number of seconds.
pub(crate) fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or(if seconds > 0.0 {
        Duration::MAX
    } else {
        Duration::ZERO
    })
}

impl Client {
    /// An order, with the numbers of the displacements whose files it names: a run reads none.
    fn order_of(&self, text: &str, name: &str) -> PyResult<Order> {
        let mut order = order(text, name)?;
        if order.edits().iter().any(names_file) {
            let surface = self.client.surface().map_err(of_client)?;
            read_displacements(order.edits_mut(), &surface)
                .map_err(|error| ConfigurationError::new_err(format!("{name}: {error}")))?;
        }
        Ok(order)
    }

    fn give(&self, command: Command) -> PyResult<String> {
        self.client.send(&command).map_err(of_client)
    }
}

#[pymethods]
impl Client {
    #[new]
    #[pyo3(signature = (link, views, watches, attempts, answer))]
    fn new(
        py: Python<'_>,
        link: &str,
        views: bool,
        watches: bool,
        attempts: u32,
        answer: Option<f64>,
    ) -> PyResult<Self> {
        let link: Link = link.parse().map_err(|error: LinkError| of_client(error.into()))?;
        // A script that only reads must not keep others from driving: it has the wheel once it commands.
        let drives = if watches { Drives::Never } else { Drives::OnRequest };
        let mut options = Options { views, drives, attempts, ..Options::default() };
        options.answer = answer.map_or(options.answer, seconds);
        let connect = || client::Client::connect(&link, &options).map_err(of_client);
        let client = ManuallyDrop::new(guarded(|| py.detach(connect))?);
        Ok(Self { client, process: std::process::id() })
    }

    /// The next event within so many seconds: its name and its message, one JSON object, or for a
    /// frame its arrays.
    fn next<'py>(
        &self,
        py: Python<'py>,
        patience: f64,
    ) -> PyResult<Option<(&'static str, Bound<'py, PyAny>)>> {
        let next = || self.client.next(seconds(patience)).map_err(of_client);
        let Some(told) = guarded(|| py.detach(next))? else { return Ok(None) };
        let name = match told.event {
            Event::Frame(told) => return Ok(Some(("frame", frame(py, *told)?.into_any()))),
            Event::Lost { reason } => {
                return Ok(Some(("lost", reason.into_pyobject(py)?.into_any())));
            }
            Event::Hello(_) => "hello",
            Event::Status(_) => "status",
            Event::Order(_) => "order",
            Event::Parameters(_) => "parameters",
            Event::Stack(_) => "stack",
            Event::Precision(_) => "precision",
            Event::Monitor(_) => "monitor",
            Event::Forecast(_) => "forecast",
            Event::Pipelines(_) => "pipelines",
            Event::Done(_) => "done",
            Event::Link(_) => "link",
            Event::People(_) => "people",
            Event::Note(_) => "note",
            Event::NoteRemoved(_) => "note_removed",
            Event::Error(_) => "error",
            Event::End(_) => "end",
            _ => "unknown",
        };
        Ok(Some((name, told.text.into_pyobject(py)?.into_any())))
    }

    /// Ends the connection, whatever still holds this client.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        // A fork has not the thread that it would wait for.
        if std::process::id() != self.process {
            return Ok(());
        }
        guarded(|| {
            py.detach(|| self.client.close());
            Ok(())
        })
    }

    /// Whether this client steers.
    #[getter]
    fn drives(&self) -> bool {
        self.client.drives()
    }

    /// How many events made way for newer ones before anybody had read them.
    #[getter]
    fn missed(&self) -> u64 {
        self.client.missed()
    }

    /// Asks for the wheel for so many seconds.
    fn drive(&self, py: Python<'_>, patience: f64) -> PyResult<()> {
        guarded(|| py.detach(|| self.client.drive(seconds(patience)).map_err(of_client)))
    }

    /// An order or a list of edits, read.
    fn prepare(&self, py: Python<'_>, text: &str, name: &str) -> PyResult<Prepared> {
        guarded(|| py.detach(|| self.order_of(text, name).map(Prepared)))
    }

    /// Gives an order; returns its id.
    fn order(&self, py: Python<'_>, prepared: &Bound<'_, Prepared>) -> PyResult<String> {
        let Prepared(order) = prepared.get();
        guarded(|| py.detach(|| self.client.order(order).map_err(of_client)))
    }

    /// Asks for a forecast; returns the question's id.
    fn forecast(&self, py: Python<'_>, prepared: &Bound<'_, Prepared>) -> PyResult<String> {
        let Prepared(order) = prepared.get();
        guarded(|| py.detach(|| self.client.forecast(order).map_err(of_client)))
    }

    /// Takes back the forecasts that it asked for; returns the id of what is done then.
    fn withdraw_forecast(&self) -> PyResult<String> {
        self.client.withdraw_forecast().map_err(of_client)
    }

    /// Takes the last orders back; returns the id of the order that does so.
    fn undo(&self, count: u32) -> PyResult<String> {
        let count = NonZeroU32::new(count).ok_or_else(|| {
            ConfigurationError::new_err("undo: found 0, expected a whole number from 1 on")
        })?;
        self.client.undo(count).map_err(of_client)
    }

    fn pause(&self) -> PyResult<String> {
        self.give(Command::Pause {})
    }

    fn resume(&self) -> PyResult<String> {
        self.give(Command::Resume {})
    }

    fn stop(&self) -> PyResult<String> {
        self.give(Command::Stop {})
    }

    fn cancel(&self, order: String) -> PyResult<String> {
        self.give(Command::Cancel(Cancel { order }))
    }

    fn set(&self, name: String, value: f64) -> PyResult<String> {
        if !value.is_finite() {
            return Err(ConfigurationError::new_err(format!(
                "parameter '{name}': found {value}, expected a finite number"
            )));
        }
        self.give(Command::Parameter(language::Parameter { name, value }))
    }

    /// Chooses the views whose frames are sent; all of them for None.
    fn choose_views(&self, names: Option<BTreeSet<String>>) -> PyResult<()> {
        self.client.choose_views(names).map_err(of_client)
    }

    /// Changes the pipelines; returns the id of the change.
    fn change_pipelines(&self, py: Python<'_>, text: &str) -> PyResult<String> {
        let change = py.detach(|| language::parse_valid::<PipelineChange>(text, "pipelines"));
        self.give(Command::Pipelines(change.map_err(of_language)?))
    }

    /// Gives the wheel to another client by its name in the run.
    fn hand_over(&self, py: Python<'_>, to: &str, patience: f64) -> PyResult<()> {
        guarded(|| py.detach(|| self.client.hand_over(to, seconds(patience)).map_err(of_client)))
    }

    /// A link that opens one browser, once, to watch or to drive.
    fn link_for(&self, py: Python<'_>, rights: &str, patience: f64) -> PyResult<String> {
        let rights = match rights {
            "watch" => LinkFor::Watch,
            "drive" => LinkFor::Drive,
            _ => {
                return Err(ConfigurationError::new_err(format!(
                    "link: found '{rights}', expected 'watch' or 'drive'"
                )));
            }
        };
        guarded(|| py.detach(|| self.client.link_for(rights, seconds(patience)).map_err(of_client)))
    }

    /// The pipelines as they are now, a JSON list.
    fn pipelines(&self, py: Python<'_>) -> PyResult<String> {
        guarded(|| {
            py.detach(|| self.client.pipelines().map(|it| it.to_string()).map_err(of_client))
        })
    }

    /// The edits that make the shape now, a JSON list.
    fn stack(&self, py: Python<'_>) -> PyResult<String> {
        let stack = guarded(|| py.detach(|| self.client.stack().map_err(of_client)))?;
        serde_json::to_string(&stack).map_err(|error| FailedError::new_err(error.to_string()))
    }

    /// The reference surface.
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = guarded(|| py.detach(|| self.client.surface().map_err(of_client)))?;
        surface(py, &found)
    }
}
