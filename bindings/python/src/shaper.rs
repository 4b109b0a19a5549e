//! Shapes of a mesh without a run, on which the class `tombolo.Shaper` rests.

use std::sync::{Arc, Mutex, MutexGuard, TryLockError};

use numpy::{IntoPyArray, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use serde_json::json;
use tombolo::deform::cancellation::Cancellation;
use tombolo::deform::edit::Edit;
use tombolo::deform::features::{FeatureSettings, check_feature_names, misplaced_faces};
use tombolo::deform::mesh::{self, FeatureSource, Mesh, Vector};
use tombolo::deform::number::Number;
use tombolo::deform::quality::{quality, scaled_jacobians};
use tombolo::deform::shape::{CurrentPhase, Phase, Refused, Request};
use tombolo::deform::skeleton::{Skeleton, SkeletonError, SkeletonSettings};
use tombolo::deform::surface::{Surface, SurfaceError};
use tombolo::pipelines::files::read_displacements;
use tombolo::pipelines::language::Change;

use crate::client::{surface, table};
use crate::error::{CallError, ConfigurationError, MeshError, RejectedError, guarded, of_run};
use crate::language::order;
use crate::lender::Lender;

/// What gives a mesh other shapes.
#[pyclass(frozen, module = "tombolo._native")]
pub(crate) struct Shaper {
    shaper: Mutex<tombolo::deform::shape::Shaper>,
    mesh: Arc<Mesh>,
    surface: Arc<Surface>,
    cancellation: Cancellation,
    phase: CurrentPhase,
    /// Coordinates of a vertex as they were given.
    dimension: usize,
}

fn mistake(error: impl ToString) -> PyErr {
    MeshError::new_err(error.to_string())
}

fn rejected(py: Python<'_>, refused: &Refused) -> PyErr {
    let report = PyDict::new(py);
    // A dict of numbers takes them, unless there is no memory.
    let _ = report.set_item("fraction", refused.feasible_fraction());
    let _ = report.set_item("min_scaled_jacobian", refused.min_scaled_jacobian());
    RejectedError::new_err((refused.to_string(), report.unbind()))
}

/// Refuses named parts that have no face of the mesh, as a run does.
fn check_features(mesh: &Mesh) -> Result<(), mesh::MeshError> {
    let FeatureSource::Faces(tagged) = mesh.features() else { return Ok(()) };
    misplaced_faces(tagged, mesh.cells()).check(tagged)?;
    let mut numbers = tagged.tags.clone();
    numbers.sort_unstable();
    check_feature_names(&tagged.names, &numbers)
}

/// Refuses volume cells where each vertex has two coordinates.
fn check_flat(mesh: &Mesh) -> PyResult<()> {
    match mesh.cells().iter().find(|(cell_type, _)| cell_type.dimension() == 3) {
        None => Ok(()),
        Some((cell_type, _)) => Err(mistake(format!(
            "points: found two coordinates, expected three: cells of type '{cell_type}' have a volume"
        ))),
    }
}

impl Shaper {
    fn hold(&self) -> PyResult<MutexGuard<'_, tombolo::deform::shape::Shaper>> {
        match self.shaper.try_lock() {
            Ok(held) => Ok(held),
            Err(TryLockError::Poisoned(held)) => Ok(held.into_inner()),
            Err(TryLockError::WouldBlock) => Err(CallError::new_err(
                "the shaper is in another call; one thread at a time can use it",
            )),
        }
    }

    /// What is asked for by the text of an order or a list of edits.
    fn asked(&self, text: &str, name: &str) -> PyResult<Request> {
        let order = order(text, name)?;
        let mut edits: Vec<Edit> = match order.change {
            Change::Edits(edits) | Change::Stack(edits) => edits,
            Change::Undo(_) => {
                return Err(ConfigurationError::new_err(format!(
                    "{name}: undo: a mesh by itself has no orders to take back"
                )));
            }
        };
        read_displacements(&mut edits, &self.surface)
            .map_err(|error| ConfigurationError::new_err(format!("{name}: {error}")))?;
        let reference: Arc<[Vector]> = self.mesh.points().into();
        Ok(Request {
            deformation: order.deform.unwrap_or_default(),
            guard: order.guard.unwrap_or_default(),
            schedule: order.schedule.unwrap_or_default(),
            ..Request::new(edits, reference)
        })
    }

    /// Points of the mesh with as many columns as they were given with.
    fn columns<'py>(&self, py: Python<'py>, points: &[Vector]) -> PyResult<Bound<'py, PyAny>> {
        let kept: Vec<f64> =
            points.iter().flat_map(|point| point.iter().take(self.dimension)).copied().collect();
        let rows = points.len();
        Ok(kept.into_pyarray(py).reshape([rows, self.dimension])?.into_any())
    }

    /// The coordinates that were given in place of the mesh's own.
    fn points(&self, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<Vector>> {
        let Some(given) = given else { return Ok(self.mesh.points().to_vec()) };
        let mut lender = Lender::default();
        let (points, columns) = lender.points(given, "points")?;
        if columns != self.dimension {
            return Err(MeshError::new_err(format!(
                "points: found {columns} columns, expected {}, as the mesh has",
                self.dimension
            )));
        }
        let is_finite = |point: &Vector| point.iter().all(|coordinate| coordinate.is_finite());
        if let Some(row) = points.iter().position(|point| !is_finite(point)) {
            let [x, y, z] = points.get(row).map_or([f64::NAN; 3], |point| *point).map(Number);
            return Err(MeshError::new_err(format!(
                "points: row {row}: found ({x}, {y}, {z}), expected finite coordinates"
            )));
        }
        if points.len() != self.mesh.points().len() {
            return Err(MeshError::new_err(format!(
                "points: found {} rows, expected {}, one for each vertex",
                points.len(),
                self.mesh.points().len()
            )));
        }
        Ok(points)
    }
}

#[pymethods]
impl Shaper {
    #[new]
    #[pyo3(signature = (mesh, angle))]
    fn new(py: Python<'_>, mesh: &Bound<'_, PyAny>, angle: Option<f64>) -> PyResult<Self> {
        let mut lender = Lender::default();
        let channels = lender.channels(mesh, &|_| true)?;
        let dimension = channels.dimensions().next().map_or(3, |(_, dimension)| dimension);
        guarded(|| {
            py.detach(move || {
                let channels = channels;
                let channel =
                    channels.0.first().ok_or_else(|| mistake("found no mesh, expected one"))?;
                let mesh = Arc::new(channel.to_mesh().map_err(of_run)?);
                check_features(&mesh).map_err(mistake)?;
                if dimension == 2 {
                    check_flat(&mesh)?;
                }
                let surface = Arc::new(of_mesh(&mesh, angle).map_err(mistake)?);
                let shaper = tombolo::deform::shape::Shaper::new(&mesh, Arc::clone(&surface))
                    .map_err(mistake)?;
                let shaper = shaper.with_clock(tombolo::steering::clock).in_plane(dimension == 2);
                let (cancellation, phase) = (shaper.cancellation().clone(), shaper.phase().clone());
                let shaper = Mutex::new(shaper);
                Ok(Self { shaper, mesh, surface, cancellation, phase, dimension })
            })
        })
    }

    /// The shape that edits make: its points, and what there is to know of it as JSON.
    fn shape<'py>(
        &self,
        py: Python<'py>,
        text: &str,
        name: &str,
    ) -> PyResult<(Bound<'py, PyAny>, String)> {
        let request = py.detach(|| self.asked(text, name))?;
        let mut shaper = self.hold()?;
        let shaper = &mut *shaper;
        let plan = guarded(|| Ok(py.detach(|| shaper.plan(&request))))?;
        let plan = plan.map_err(|refused| rejected(py, &refused))?;
        let target = plan.target();
        let facts = py.detach(|| {
            json!({
                "fraction": target.fraction,
                "iterations": target.iterations,
                "sub_steps": target.sub_steps,
                "min_scaled_jacobian": plan.min_scaled_jacobian(),
                "largest_displacement": plan.largest_displacement(),
                "quality": quality(self.mesh.cells(), plan.end()),
                "seconds": shaper.spent(),
            })
        });
        Ok((self.columns(py, plan.end())?, facts.to_string()))
    }

    /// What edits would come to, as JSON.
    fn forecast(&self, py: Python<'_>, text: &str, name: &str) -> PyResult<String> {
        let request = py.detach(|| self.asked(text, name))?;
        let mut shaper = self.hold()?;
        let shaper = &mut *shaper;
        let forecast = guarded(|| Ok(py.detach(|| shaper.forecast(&request))))?;
        serde_json::to_string(&forecast).map_err(mistake)
    }

    /// The displacement of each vertex of the surface, in three columns as edits have it.
    fn displacement<'py>(
        &self,
        py: Python<'py>,
        text: &str,
        name: &str,
    ) -> PyResult<Bound<'py, PyAny>> {
        let request = py.detach(|| self.asked(text, name))?;
        let mut shaper = self.hold()?;
        let shaper = &mut *shaper;
        let moved = guarded(|| {
            py.detach(|| match shaper.editor() {
                Some(editor) => editor
                    .displacement(&request.stack)
                    .map_err(|error| RejectedError::new_err(error.to_string())),
                None => Ok(Vec::new()),
            })
        })?;
        table(py, moved.into_flattened(), 3)
    }

    /// The quality of the mesh, or of one with other points, as JSON.
    fn quality(&self, py: Python<'_>, points: Option<&Bound<'_, PyAny>>) -> PyResult<String> {
        let points = self.points(points)?;
        let found = guarded(|| Ok(py.detach(|| quality(self.mesh.cells(), &points))))?;
        serde_json::to_string(&found).map_err(mistake)
    }

    /// The scaled Jacobian of each cell.
    fn scaled_jacobians<'py>(
        &self,
        py: Python<'py>,
        points: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let points = self.points(points)?;
        let found = guarded(|| Ok(py.detach(|| scaled_jacobians(self.mesh.cells(), &points))))?;
        Ok(found.into_pyarray(py).into_any())
    }

    /// The features, as JSON.
    fn features(&self) -> PyResult<String> {
        serde_json::to_string(&self.surface.feature_sizes()).map_err(mistake)
    }

    /// The surface.
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        surface(py, &self.surface)
    }

    /// The curve skeleton of the surface.
    fn skeleton<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = guarded(|| {
            py.detach(|| {
                let settings = SkeletonSettings::default();
                Skeleton::extract_unless(&self.surface, &settings, &self.cancellation).map_err(
                    |error| match error {
                        SkeletonError::Cancelled => RejectedError::new_err(error.to_string()),
                        error => mistake(error),
                    },
                )
            })
        })?;
        let dict = PyDict::new(py);
        dict.set_item("nodes", table(py, found.nodes().as_flattened().to_vec(), 3)?)?;
        dict.set_item("radii", found.radii(self.surface.points()).into_pyarray(py))?;
        let curves = PyList::empty(py);
        for curve in found.curves() {
            curves.append(curve.nodes().to_vec().into_pyarray(py))?;
        }
        dict.set_item("curves", curves)?;
        dict.set_item("node_of_vertex", found.node_of_vertex().to_vec().into_pyarray(py))?;
        Ok(dict)
    }

    /// The name of the phase that the work under way is at, from any thread.
    fn phase(&self) -> &'static str {
        self.phase.get().name()
    }

    /// Has the work under way given up, from any thread.
    fn cancel(&self) {
        self.cancellation.cancel();
    }

    /// Lets work go on that comes next; an error where there is some under way, which stays cancelled.
    fn renew(&self) -> PyResult<()> {
        let _held = self.hold()?;
        self.cancellation.renew();
        self.phase.enter(Phase::Surface);
        Ok(())
    }
}

/// The surface of a mesh; with an angle, its features are those between sharp edges.
fn of_mesh(mesh: &Mesh, angle: Option<f64>) -> Result<Surface, SurfaceError> {
    let surface = Surface::extract(mesh, &FeatureSettings::default())?;
    match angle {
        Some(sharp_angle_degrees) => {
            surface.with_sharp_features(&FeatureSettings { sharp_angle_degrees })
        }
        None => Ok(surface),
    }
}
