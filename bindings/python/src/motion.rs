//! Mesh motions as NumPy arrays, which are those of the adaptor and not copies.

use numpy::ndarray::{ArrayView1, ArrayView2, ShapeBuilder};
use numpy::{Element, PyArray};
use pyo3::prelude::*;
use tombolo::MeshMotion;
use tombolo::deform::mesh::Vector;

/// A motion of the mesh over one step: `tombolo.Motion` says what is in it.
#[pyclass(frozen, module = "tombolo._native")]
pub(crate) struct Motion {
    motion: MeshMotion,
    /// Coordinates of a vertex as the solver lends them: 2 or 3.
    dimension: usize,
}

/// An array that nobody writes to, and that keeps the motion it is of.
fn read_only<'py, T: Element, D: numpy::ndarray::Dimension>(
    array: Bound<'py, PyArray<T, D>>,
) -> PyResult<Bound<'py, PyAny>> {
    let array = array.into_any();
    array.call_method1("setflags", (false,))?;
    Ok(array)
}

impl Motion {
    pub(crate) fn new(motion: MeshMotion, dimension: usize) -> Self {
        Self { motion, dimension }
    }

    fn vectors<'py>(
        own: &Bound<'py, Self>,
        of: impl Fn(&MeshMotion) -> &[Vector],
    ) -> PyResult<Bound<'py, PyAny>> {
        let Self { motion, dimension } = own.get();
        let vectors = of(motion);
        let shape = (vectors.len(), *dimension).strides((3, 1));
        let view = ArrayView2::from_shape(shape, vectors.as_flattened());
        let view = view.map_err(|error| crate::error::FailedError::new_err(error.to_string()))?;
        // SAFETY: the numbers live, unchanged, as long as the motion, which the array keeps.
        read_only(unsafe { PyArray::borrow_from_array(&view, own.clone().into_any()) })
    }
}

#[pymethods]
impl Motion {
    #[getter]
    fn coordinates<'py>(own: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        Self::vectors(own, |motion| &motion.coordinates)
    }

    #[getter]
    fn displacement<'py>(own: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        Self::vectors(own, |motion| &motion.displacement)
    }

    #[getter]
    fn velocity<'py>(own: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        Self::vectors(own, |motion| &motion.velocity)
    }

    #[getter]
    fn surface_vertices<'py>(own: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let view = ArrayView1::from(&*own.get().motion.surface.vertices);
        // SAFETY: as in `vectors`.
        read_only(unsafe { PyArray::borrow_from_array(&view, own.clone().into_any()) })
    }

    #[getter]
    fn surface_coordinates<'py>(own: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        Self::vectors(own, |motion| &motion.surface.coordinates)
    }

    #[getter]
    fn surface_displacement<'py>(own: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        Self::vectors(own, |motion| &motion.surface.displacement)
    }

    #[getter]
    fn surface_velocity<'py>(own: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        Self::vectors(own, |motion| &motion.surface.velocity)
    }

    #[getter]
    fn order(&self) -> &str {
        &self.motion.order
    }

    #[getter]
    fn shape(&self) -> (u32, u32) {
        self.motion.shape
    }

    #[getter]
    fn position(&self) -> f64 {
        self.motion.position
    }
}
