//! From frames back to numbers.

use tombolo_deform::mesh::{NumberType, Vector};
use tombolo_deform::surface::Surface;

use super::blob::{MOST_BYTES, decompress};
use super::surface;
use super::wire::{
    Array, DATA, DataHeader, Kind, MAGIC, PREAMBLE, SURFACE, TOPOLOGY, TopologyHeader, VERSION,
    integers,
};
use crate::extract::{Association, Field};

/// A decoded frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Decoded {
    /// A topology.
    Topology(TopologyFrame),
    /// Positions and fields.
    Data(DataFrame),
    /// A reference surface, bit for bit.
    Surface(Box<Surface>),
}

/// The cells of a view.
#[derive(Debug, Clone, PartialEq)]
pub struct TopologyFrame {
    /// The view.
    pub view: String,
    /// The topology's name.
    pub topology: String,
    /// How many points the data of this topology has.
    pub points: usize,
    /// Triangles by the numbers of their points, all of which exist.
    pub triangles: Vec<[u32; 3]>,
    /// The feature of each triangle.
    pub triangle_features: Option<Vec<u32>>,
    /// Lines by the numbers of their points, all of which exist.
    pub lines: Vec<[u32; 2]>,
}

/// The positions and fields of a view at one step.
#[derive(Debug, Clone, PartialEq)]
pub struct DataFrame {
    /// The view.
    pub view: String,
    /// The topology it belongs to.
    pub topology: String,
    /// The step.
    pub cycle: u64,
    /// The simulated time.
    pub time: f64,
    /// The coordinates of each point.
    pub points: Vec<Vector>,
    /// The fields; element fields have a value for each triangle, then for each line.
    pub fields: Vec<Field>,
}

/// Why bytes are no frame.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {message}")]
pub struct DecodeError {
    /// Where: the preamble, the header, or an array.
    pub place: String,
    /// What was found, and what was expected.
    pub message: String,
}

pub(super) fn error(place: impl Into<String>, message: impl Into<String>) -> DecodeError {
    DecodeError { place: place.into(), message: message.into() }
}

/// Decodes one binary message. Any bytes are answered with a frame or an error, and no more memory is taken than the frame needs.
///
/// # Errors
/// [`DecodeError`].
pub fn decode(bytes: &[u8]) -> Result<Decoded, DecodeError> {
    let (preamble, rest) = bytes
        .split_first_chunk::<PREAMBLE>()
        .ok_or_else(|| error("preamble", "the frame is truncated"))?;
    let [m0, m1, m2, m3, version, kind, zero, another_zero, l0, l1, l2, l3] = *preamble;
    if [m0, m1, m2, m3] != MAGIC {
        return Err(error("preamble", "the frame does not begin with TMBL"));
    }
    if version != VERSION || [zero, another_zero] != [0, 0] {
        return Err(error("preamble", format!("found version {version}, expected {VERSION}")));
    }
    let length = u32::from_le_bytes([l0, l1, l2, l3]) as usize;
    let (header, blobs) =
        rest.split_at_checked(length).ok_or_else(|| error("header", "the frame is truncated"))?;
    let bad_header = |failure: serde_json::Error| error("header", failure.to_string());
    match kind {
        TOPOLOGY => topology(serde_json::from_slice(header).map_err(bad_header)?, blobs)
            .map(Decoded::Topology),
        DATA => data(serde_json::from_slice(header).map_err(bad_header)?, blobs).map(Decoded::Data),
        SURFACE => {
            let header = serde_json::from_slice(header).map_err(bad_header)?;
            Ok(Decoded::Surface(Box::new(surface::decode(header, blobs)?)))
        }
        other => Err(error("preamble", format!("found kind {other}, expected 1, 2 or 3"))),
    }
}

/// Each array with its bytes, decompressed.
pub(super) fn arrays(
    headers: Vec<Array>,
    mut blobs: &[u8],
) -> Result<Vec<(Array, Vec<u8>)>, DecodeError> {
    let mut total = 0usize;
    let mut arrays = Vec::new();
    for array in headers {
        let place = |message: String| error(format!("array `{:.60}`", array.name), message);
        if array.components == 0 || array.components > 9 {
            return Err(place(format!("{} components, expected 1 to 9", array.components)));
        }
        let size = array.count.checked_mul(array.components * array.kind.size());
        let size = size.filter(|&size| size <= MOST_BYTES);
        total = total.saturating_add(size.unwrap_or(usize::MAX));
        let Some(size) = size.filter(|_| total <= MOST_BYTES) else {
            return Err(place(format!("more than {MOST_BYTES} bytes in one frame")));
        };
        let (blob, rest) = blobs
            .split_at_checked(array.bytes)
            .ok_or_else(|| place("the frame is truncated".into()))?;
        blobs = rest;
        let bytes = decompress(blob, size).map_err(place)?;
        arrays.push((array, bytes));
    }
    if !blobs.is_empty() {
        return Err(error("arrays", format!("{} bytes after the last one", blobs.len())));
    }
    Ok(arrays)
}

fn topology(header: TopologyHeader, blobs: &[u8]) -> Result<TopologyFrame, DecodeError> {
    let (mut triangles, mut lines, mut triangle_features) = (Vec::new(), Vec::new(), None);
    for (array, bytes) in arrays(header.arrays, blobs)? {
        let place = format!("array `{:.60}`", array.name);
        let values = integers(&bytes, array.kind, array.filter)
            .ok_or_else(|| error(&place, "expected integers"))?;
        let expected = match array.name.as_str() {
            "triangles" => 3,
            "lines" => 2,
            "triangle_features" => 1,
            _ => continue,
        };
        if array.components != expected {
            return Err(error(
                place,
                format!("{} components, expected {expected}", array.components),
            ));
        }
        let outside = values.iter().find(|&&point| point as usize >= header.points);
        if let (2.., Some(point)) = (expected, outside) {
            return Err(error(place, format!("point {point} of {}", header.points)));
        }
        let at = |index: usize, component: usize| values[component * array.count + index];
        match expected {
            3 => triangles = (0..array.count).map(|i| std::array::from_fn(|c| at(i, c))).collect(),
            2 => lines = (0..array.count).map(|i| std::array::from_fn(|c| at(i, c))).collect(),
            _ => triangle_features = Some(values),
        }
    }
    if let Some(features) = &triangle_features
        && features.len() != triangles.len()
    {
        let message = format!("{} values for {} triangles", features.len(), triangles.len());
        return Err(error("array `triangle_features`", message));
    }
    let TopologyHeader { view, topology, points, .. } = header;
    Ok(TopologyFrame { view, topology, points, triangles, triangle_features, lines })
}

fn data(header: DataHeader, blobs: &[u8]) -> Result<DataFrame, DecodeError> {
    let (mut points, mut fields) = (Vec::new(), Vec::new());
    for (array, bytes) in arrays(header.arrays, blobs)? {
        let values = values(&array, &bytes)?;
        if array.name == "points" {
            if array.components != 3 {
                return Err(error(
                    "array `points`",
                    format!("{} components, expected 3", array.components),
                ));
            }
            points = values.as_chunks().0.to_vec();
        } else {
            let association = array.association.unwrap_or(Association::Vertex);
            fields.push(Field {
                name: array.name,
                association,
                components: array.components,
                number: NumberType::F64,
                values,
            });
        }
    }
    let DataHeader { view, topology, cycle, time, .. } = header;
    Ok(DataFrame { view, topology, cycle, time, points, fields })
}

/// The values of an array, tuple after tuple.
pub(super) fn values(array: &Array, bytes: &[u8]) -> Result<Vec<f64>, DecodeError> {
    let planar: Vec<f64> = match array.kind {
        Kind::F32 => {
            bytes.as_chunks().0.iter().map(|&chunk| f64::from(f32::from_le_bytes(chunk))).collect()
        }
        Kind::F64 => bytes.as_chunks().0.iter().map(|&chunk| f64::from_le_bytes(chunk)).collect(),
        kind => {
            let place = || format!("array `{:.60}`", array.name);
            let per_component = |numbers: &Option<Vec<f64>>, name: &str| {
                let numbers = numbers.clone().filter(|numbers| numbers.len() == array.components);
                numbers.ok_or_else(|| {
                    error(place(), format!("expected {} values of `{name}`", array.components))
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
