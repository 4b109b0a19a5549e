//! The arrays of a frame, from their blobs back to numbers.

use super::blob::{MOST_BYTES, decompress};
use super::wire::{Array, Kind, integers};

/// Why bytes could not be decoded as a frame.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{part}: {message}")]
pub struct DecodeError {
    /// The part of the frame: the preamble, the header, or an array.
    pub part: String,
    /// The thing found, and the thing expected.
    pub message: String,
}

pub(super) fn error(part: impl Into<String>, message: impl Into<String>) -> DecodeError {
    DecodeError { part: part.into(), message: message.into() }
}

/// Each array with its bytes, decompressed.
pub(super) fn unpacked(
    headers: Vec<Array>,
    mut blobs: &[u8],
) -> Result<Vec<(Array, Vec<u8>)>, DecodeError> {
    let mut total = 0usize;
    let mut arrays = Vec::new();
    for array in headers {
        let part = |message: String| error(format!("array `{:.60}`", array.name), message);
        if array.components == 0 || array.components > 9 {
            return Err(part(format!("{} components, expected 1 to 9", array.components)));
        }
        let size = array.count.checked_mul(array.components * array.kind.size());
        let size = size.filter(|&size| size <= MOST_BYTES);
        total = total.saturating_add(size.unwrap_or(usize::MAX));
        let Some(size) = size.filter(|_| total <= MOST_BYTES) else {
            return Err(part(format!("more than {MOST_BYTES} bytes in one frame")));
        };
        let (blob, rest) = blobs
            .split_at_checked(array.bytes)
            .ok_or_else(|| part("the frame is truncated".into()))?;
        blobs = rest;
        let bytes = decompress(blob, size).map_err(part)?;
        arrays.push((array, bytes));
    }
    if !blobs.is_empty() {
        return Err(error("arrays", format!("{} bytes after the last one", blobs.len())));
    }
    Ok(arrays)
}

/// The values of an array, tuple after tuple.
pub(super) fn values(array: &Array, bytes: &[u8]) -> Result<Vec<f64>, DecodeError> {
    let planar: Vec<f64> = match array.kind {
        Kind::F32 => {
            bytes.as_chunks().0.iter().map(|&chunk| f64::from(f32::from_le_bytes(chunk))).collect()
        }
        Kind::F64 => bytes.as_chunks().0.iter().map(|&chunk| f64::from_le_bytes(chunk)).collect(),
        kind => {
            let part = || format!("array `{:.60}`", array.name);
            let per_component = |numbers: &Option<Vec<f64>>, name: &str| {
                let numbers = numbers.clone().filter(|numbers| numbers.len() == array.components);
                numbers.ok_or_else(|| {
                    error(part(), format!("expected {} values of `{name}`", array.components))
                })
            };
            let quantum = per_component(&array.quantum, "quantum")?;
            let offset = per_component(&array.offset, "offset")?;
            let integers = integers(bytes, kind, array.filter).unwrap_or_default();
            let value = |(index, integer): (usize, u32)| {
                let component = index / array.count;
                offset[component] + quantum[component] * f64::from(integer)
            };
            integers.into_iter().enumerate().map(value).collect()
        }
    };
    let (count, components) = (array.count, array.components);
    Ok((0..planar.len())
        .map(|index| planar[index % components * count + index / components])
        .collect())
}
