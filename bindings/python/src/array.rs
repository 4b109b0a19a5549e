//! NumPy's arrays, as they lie in memory.

use numpy::npyffi::_PyArray_GET_ITEM_DATA;
use numpy::{PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use tombolo::foreign::{Array, NumberType, RunError};

use crate::error::{Mistake, argument, raised};

/// The most axes of an array that is lent.
const AXES: usize = 3;

/// An array as it lies in memory.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Layout {
    first: *const u8,
    pub(crate) axes: usize,
    /// 1 along the axes that there are not.
    pub(crate) shape: [usize; AXES],
    /// In bytes; 0 along the axes that there are not.
    strides: [isize; AXES],
    pub(crate) number: NumberType,
    /// Whether they are truth values, which NumPy keeps as numbers 0 and 1.
    pub(crate) is_truth: bool,
    big_endian: bool,
}

/// The type of number of an array, and whether its bytes are those of a big-endian machine.
fn number(array: &Bound<'_, PyUntypedArray>, what: &str) -> Result<(NumberType, bool), RunError> {
    use NumberType::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    let dtype = array.dtype();
    let number = match (dtype.kind(), dtype.itemsize()) {
        (b'b' | b'u', 1) => U8,
        (b'u', 2) => U16,
        (b'u', 4) => U32,
        (b'u', 8) => U64,
        (b'i', 1) => I8,
        (b'i', 2) => I16,
        (b'i', 4) => I32,
        (b'i', 8) => I64,
        (b'f', 4) => F32,
        (b'f', 8) => F64,
        (kind, _) => {
            let expected = match kind {
                b'c' => "real numbers, such as values.real and values.imag",
                _ => "float32, float64, int32, int64 or another type of whole numbers",
            };
            return Err(argument(what, format!("an array of {dtype}"), expected));
        }
    };
    Ok((number, dtype.is_native_byteorder() == Some(false) && cfg!(target_endian = "little")))
}

impl Layout {
    pub(crate) fn of(array: &Bound<'_, PyUntypedArray>, what: &str) -> Result<Self, RunError> {
        let (number, big_endian) = number(array, what)?;
        let (axes, given) = (array.ndim(), array.shape());
        if axes > AXES {
            return Err(argument(
                what,
                format!("an array of shape {}", shown(given)),
                "at most three axes",
            ));
        }
        // SAFETY: it is an array of NumPy's, which lives as long as `array` does.
        let first = unsafe { (*_PyArray_GET_ITEM_DATA(array.as_array_ptr())).data };
        let mut layout = Self {
            first: first.cast_const().cast(),
            axes,
            shape: [1; AXES],
            strides: [0; AXES],
            number,
            is_truth: array.dtype().kind() == b'b',
            big_endian,
        };
        for (own, length) in layout.shape.iter_mut().zip(given) {
            *own = *length;
        }
        for (own, stride) in layout.strides.iter_mut().zip(array.strides()) {
            *own = *stride;
        }
        Ok(layout)
    }

    /// The shape as Python writes it.
    pub(crate) fn shape_text(&self) -> String {
        shown(self.shape.get(..self.axes).unwrap_or_default())
    }

    /// All numbers along the first axis of one component: `row` along the second axis, `column`
    /// along the third.
    ///
    /// # Safety
    /// The array lives, unchanged by others, during `'call`; the component is there.
    pub(crate) unsafe fn component<'call>(&self, row: usize, column: usize) -> Array<'call> {
        let [_, of_row, of_column] = self.strides;
        let first = self
            .first
            .wrapping_offset(row.cast_signed() * of_row + column.cast_signed() * of_column);
        // SAFETY: the caller's promise, and NumPy's: so many numbers, so far apart.
        unsafe {
            Array::table(
                first,
                [self.shape[0], 1],
                [self.strides[0], 0],
                self.number,
                self.big_endian,
            )
        }
    }

    /// The numbers of the first two axes, row by row.
    ///
    /// # Safety
    /// The array lives, unchanged by others, during `'call`.
    pub(crate) unsafe fn table<'call>(&self) -> Array<'call> {
        let ([rows, columns, _], [of_row, of_column, _]) = (self.shape, self.strides);
        // SAFETY: the caller's promise, and NumPy's.
        unsafe {
            Array::table(
                self.first,
                [rows, columns],
                [of_row, of_column],
                self.number,
                self.big_endian,
            )
        }
    }
}

fn shown(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        several => {
            let lengths: Vec<String> = several.iter().map(usize::to_string).collect();
            format!("({})", lengths.join(", "))
        }
    }
}

/// Refuses an array that says of some of its numbers that they are none.
fn require_unmasked(array: &Bound<'_, PyUntypedArray>, what: &str) -> Result<(), Mistake> {
    // Only a class of its own has a mask.
    if array.is_exact_instance_of::<PyUntypedArray>() {
        return Ok(());
    }
    static IS_MASKED: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let is_masked = IS_MASKED
        .import(array.py(), "numpy.ma", "is_masked")
        .and_then(|is_masked| is_masked.call1((array,))?.is_truthy());
    match is_masked {
        Ok(false) => Ok(()),
        Ok(true) => {
            Err(argument(what, "an array of which values are masked", "a value for each").into())
        }
        Err(error) => Err(raised(error, |error| argument(what, error, "an array of numbers"))),
    }
}

/// What was given as an array: itself where it is one, else what `numpy.asarray` makes of it.
pub(crate) fn as_array<'py>(
    given: &Bound<'py, PyAny>,
    what: &str,
) -> Result<Bound<'py, PyUntypedArray>, Mistake> {
    if let Ok(array) = given.cast::<PyUntypedArray>() {
        require_unmasked(array, what)?;
        return Ok(array.clone());
    }
    static ASARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let asarray = ASARRAY.import(given.py(), "numpy", "asarray");
    let made = asarray
        .and_then(|asarray| asarray.call1((given,)))
        .and_then(|made| made.cast_into::<PyUntypedArray>().map_err(PyErr::from));
    made.map_err(|error| {
        raised(error, |error| {
            let found = format!("a {} that makes no array ({error})", given.get_type());
            argument(what, found, "an array of numbers")
        })
    })
}
