//! From frames back to numbers.

use tombolo_deform::mesh::{NumberType, Vector};
use tombolo_deform::surface::Surface;

use super::arrays::{DecodeError, error, unpacked, values};
use super::surface;
use super::wire::{
    DATA, DataHeader, MAGIC, PREAMBLE, SURFACE, TOPOLOGY, TopologyHeader, VERSION, integers,
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

/// Decodes one binary message. Any bytes are answered with a frame or an error, and no more memory
/// is taken than the frame needs.
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

fn topology(header: TopologyHeader, blobs: &[u8]) -> Result<TopologyFrame, DecodeError> {
    let (mut triangles, mut lines, mut triangle_features) = (Vec::new(), Vec::new(), None);
    for (array, bytes) in unpacked(header.arrays, blobs)? {
        let part = format!("array `{:.60}`", array.name);
        let values = integers(&bytes, array.kind, array.filter)
            .ok_or_else(|| error(&part, "expected integers"))?;
        let expected = match array.name.as_str() {
            "triangles" => 3,
            "lines" => 2,
            "triangle_features" => 1,
            _ => continue,
        };
        if array.components != expected {
            return Err(error(
                part,
                format!("{} components, expected {expected}", array.components),
            ));
        }
        let outside = values.iter().find(|&&point| point as usize >= header.points);
        if let (2.., Some(point)) = (expected, outside) {
            return Err(error(part, format!("point {point} of {}", header.points)));
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
    for (array, bytes) in unpacked(header.arrays, blobs)? {
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
