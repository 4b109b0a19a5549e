//! What a call answers with.

use tombolo_deform::mesh::Vector;

/// One array of an answer, in the layout in which the browser reads it.
#[derive(Debug, Clone, PartialEq)]
pub enum Array {
    /// UTF-8.
    Text(String),
    /// Coordinates, one vector after the other.
    Vectors(Vec<Vector>),
    /// 32-bit numbers.
    Numbers(Vec<u32>),
    /// Triangles, one after the other.
    Triangles(Vec<[u32; 3]>),
    /// Values in single precision.
    Singles(Vec<f32>),
    /// Values in double precision.
    Doubles(Vec<f64>),
}

impl Array {
    /// A pointer to the first byte of the array.
    #[must_use]
    pub fn as_ptr(&self) -> *const u8 {
        match self {
            Array::Text(text) => text.as_ptr(),
            Array::Vectors(values) => values.as_ptr().cast(),
            Array::Numbers(values) => values.as_ptr().cast(),
            Array::Triangles(values) => values.as_ptr().cast(),
            Array::Singles(values) => values.as_ptr().cast(),
            Array::Doubles(values) => values.as_ptr().cast(),
        }
    }

    /// The length of the array, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        match self {
            Array::Text(text) => text.len(),
            Array::Vectors(values) => size_of_val(&values[..]),
            Array::Numbers(values) => size_of_val(&values[..]),
            Array::Triangles(values) => size_of_val(&values[..]),
            Array::Singles(values) => size_of_val(&values[..]),
            Array::Doubles(values) => size_of_val(&values[..]),
        }
    }
}
