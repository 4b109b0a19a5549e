//! From extracts to frames.

use std::sync::Arc;

use tombolo_deform::mesh::{CellType, Cells};

use super::blob::compress;
use super::quantize::{pack, range};
use super::wire::{
    Array, DATA, DataHeader, Filter, Kind, MAGIC, TOPOLOGY, TopologyHeader, VERSION, delta,
};
use crate::extract::{Association, Extract, ExtractFeatures};
use crate::language::ErrorBound;
use crate::run::Frame;

/// zstd's level for data, which is new with every frame.
const DATA_LEVEL: i32 = 1;
/// zstd's level for topologies, which are sent once.
pub(super) const TOPOLOGY_LEVEL: i32 = 3;

/// An encoded frame: complete binary messages.
#[derive(Debug, Clone)]
pub struct Encoded {
    /// Which topology the data belongs to; the same number for the same cells.
    pub topology_id: u64,
    /// The topology's message, to be sent to whoever does not have it yet.
    pub topology: Arc<[u8]>,
    /// The data's message.
    pub data: Vec<u8>,
    /// How many bytes the points and fields are in the solver, in double precision.
    pub raw_bytes: usize,
}

/// Why an extract was not encoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// A number is NaN or infinite.
    #[error("`{array}` is {value} at entity {entity}; only finite numbers are sent")]
    NotFinite {
        /// The field, or `points`.
        array: String,
        /// The point or cell of the extract.
        entity: usize,
        /// The value found.
        value: f64,
    },
    /// A field does not fit the points or cells.
    #[error("`{array}` has {found} values, expected {expected}")]
    Length {
        /// The field.
        array: String,
        /// How many values it has.
        found: usize,
        /// How many it needs.
        expected: usize,
    },
    /// Volume cells, which a viewer cannot show.
    #[error("cell {cell} is a {cell_type}; only surfaces and lines are sent")]
    VolumeCell {
        /// The cell.
        cell: usize,
        /// Its type.
        cell_type: CellType,
    },
    /// The compressor failed.
    #[error("compression: {0}")]
    Compression(#[from] std::io::Error),
    /// The header could not be written.
    #[error("header: {0}")]
    Header(#[from] serde_json::Error),
}

/// Encodes the frames of views, one encoder for each view. What depends on the cells alone is kept
/// as long as they stay the same.
#[derive(Debug, Default)]
pub struct Encoder {
    topology: Option<Topology>,
}

/// Encodes one frame by itself.
///
/// # Errors
/// [`EncodeError`].
pub fn encode(frame: &Frame) -> Result<Encoded, EncodeError> {
    Encoder::new().encode(frame)
}

impl Encoder {
    /// An encoder that knows no topology yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Encodes the next frame.
    ///
    /// # Errors
    /// [`EncodeError`]: for numbers that are not finite, fields that do not fit, volume cells.
    pub fn encode(&mut self, frame: &Frame) -> Result<Encoded, EncodeError> {
        let Frame { pipeline, cycle, time, extract, encoding } = frame;
        if !time.is_finite() {
            return Err(EncodeError::NotFinite { array: "time".into(), entity: 0, value: *time });
        }
        let topology = match self.topology.take() {
            Some(topology) if topology.is_of(extract) => topology,
            _ => Topology::new(pipeline, extract)?,
        };
        let topology = self.topology.insert(topology);

        let positions = extract.points.as_flattened();
        let mut message = Message::new(DATA_LEVEL);
        let extent = (0..3).fold(0.0_f64, |sum, axis| {
            let [least, largest] = range(positions, 3, axis);
            sum.hypot(largest - least)
        });
        message.values("points", Association::Vertex, positions, 3, encoding.positions, extent)?;
        for field in extract.fields.iter().filter(|field| field.association != Association::Mesh) {
            let components = field.components;
            let of_triangles;
            let (count, values) = match field.association {
                Association::Vertex | Association::Mesh => {
                    (extract.points.len(), field.values.as_slice())
                }
                Association::Element => {
                    check_length(
                        &field.name,
                        field.values.len(),
                        extract.cells.len() * components,
                    )?;
                    let cells = topology.cells.iter().map(|&cell| cell as usize * components);
                    of_triangles = cells
                        .flat_map(|start| &field.values[start..start + components])
                        .copied()
                        .collect::<Vec<_>>();
                    (topology.cells.len(), of_triangles.as_slice())
                }
            };
            check_length(&field.name, values.len(), count * components)?;
            let extent = (0..components)
                .map(|component| range(values, components, component))
                .fold(0.0_f64, |widest, [least, largest]| widest.max(largest - least));
            // The name of the positions is taken.
            let name = if field.name == "points" { "points (field)" } else { &field.name };
            message.values(name, field.association, values, components, encoding.fields, extent)?;
        }
        let raw_bytes = message.raw_bytes;
        let data = message.finish(DATA, |arrays| {
            let topology = format!("{:016x}", topology.id);
            serde_json::to_vec(&DataHeader {
                view: pipeline.to_string(),
                topology,
                cycle: *cycle,
                time: *time,
                arrays,
            })
        })?;
        Ok(Encoded {
            topology_id: topology.id,
            topology: Arc::clone(&topology.message),
            data,
            raw_bytes,
        })
    }
}

fn check_length(array: &str, found: usize, expected: usize) -> Result<(), EncodeError> {
    if found == expected {
        Ok(())
    } else {
        Err(EncodeError::Length { array: array.into(), found, expected })
    }
}

/// A topology that was encoded.
#[derive(Debug)]
struct Topology {
    of_cells: Arc<Cells>,
    of_features: Option<Arc<ExtractFeatures>>,
    points: usize,
    id: u64,
    /// The cell that each triangle, and then each line, is part of.
    cells: Vec<u32>,
    message: Arc<[u8]>,
}

impl Topology {
    fn is_of(&self, extract: &Extract) -> bool {
        let same_features = match (&self.of_features, &extract.features) {
            (None, None) => true,
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            _ => false,
        };
        Arc::ptr_eq(&self.of_cells, &extract.cells)
            && same_features
            && self.points == extract.points.len()
    }

    fn new(view: &str, extract: &Extract) -> Result<Self, EncodeError> {
        let (mut triangles, mut lines) = (Vec::<[u32; 3]>::new(), Vec::<[u32; 2]>::new());
        let (mut triangle_cells, mut line_cells) = (Vec::new(), Vec::new());
        for (cell, (cell_type, points)) in extract.cells.iter().enumerate() {
            let (before, lines_before) = (triangles.len(), lines.len());
            match (cell_type, points) {
                (CellType::Vertex | CellType::PolyVertex, _) => {}
                (CellType::Line | CellType::PolyLine, _) => {
                    lines.extend(points.windows(2).map(|line| [line[0], line[1]]))
                }
                (CellType::Pixel, &[a, b, c, d]) => triangles.extend([[a, b, d], [a, d, c]]),
                (CellType::TriangleStrip, _) => {
                    for (index, strip) in points.windows(3).enumerate() {
                        let odd = index % 2 == 1;
                        triangles.push(if odd {
                            [strip[1], strip[0], strip[2]]
                        } else {
                            [strip[0], strip[1], strip[2]]
                        });
                    }
                }
                (
                    CellType::Triangle | CellType::Quad | CellType::Polygon,
                    &[first, ref rest @ ..],
                ) => {
                    triangles.extend(rest.windows(2).map(|edge| [first, edge[0], edge[1]]));
                }
                _ => return Err(EncodeError::VolumeCell { cell, cell_type }),
            }
            #[expect(clippy::cast_possible_truncation, reason = "cells are numbered with 32 bits")]
            let cell = cell as u32;
            triangle_cells.extend(std::iter::repeat_n(cell, triangles.len() - before));
            line_cells.extend(std::iter::repeat_n(cell, lines.len() - lines_before));
        }
        let features: Option<Vec<u32>> = extract.features.as_ref().map(|features| {
            let feature = |&cell: &u32| features.of_cells.get(cell as usize).copied().unwrap_or(0);
            triangle_cells.iter().map(feature).collect()
        });

        let mut hash = Hash(extract.points.len() as u64);
        for part in [
            triangles.as_flattened(),
            features.as_deref().unwrap_or_default(),
            lines.as_flattened(),
        ] {
            hash.add(part);
        }
        let id = hash.finish();
        let mut message = Message::new(TOPOLOGY_LEVEL);
        message.integers("triangles", triangles.as_flattened(), 3)?;
        if let Some(features) = &features {
            message.integers("triangle_features", features, 1)?;
        }
        if !lines.is_empty() {
            message.integers("lines", lines.as_flattened(), 2)?;
        }
        let points = extract.points.len();
        let message = message.finish(TOPOLOGY, |arrays| {
            let topology = format!("{id:016x}");
            serde_json::to_vec(&TopologyHeader { view: view.to_owned(), topology, points, arrays })
        })?;
        let mut cells = triangle_cells;
        cells.extend(line_cells);
        Ok(Self {
            of_cells: Arc::clone(&extract.cells),
            of_features: extract.features.clone(),
            points,
            id,
            cells,
            message: message.into(),
        })
    }
}

/// A hash of numbers that is the same on every machine.
struct Hash(u64);

impl Hash {
    fn add(&mut self, numbers: &[u32]) {
        let mut word =
            |word: u64| self.0 = (self.0.rotate_left(5) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        word(numbers.len() as u64);
        numbers.iter().for_each(|&number| word(u64::from(number)));
    }

    fn finish(self) -> u64 {
        let mut hash = self.0;
        hash = (hash ^ hash >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93);
        hash ^ hash >> 32
    }
}

/// A message under construction.
pub(super) struct Message {
    level: i32,
    arrays: Vec<Array>,
    blobs: Vec<u8>,
    raw_bytes: usize,
}

impl Message {
    pub(super) fn new(level: i32) -> Self {
        Self { level, arrays: Vec::new(), blobs: Vec::new(), raw_bytes: 0 }
    }

    fn push(&mut self, array: Array, bytes: &[u8]) -> Result<(), EncodeError> {
        let blob = compress(bytes, self.level)?;
        self.arrays.push(Array { bytes: blob.len(), ..array });
        self.blobs.extend(blob);
        Ok(())
    }

    pub(super) fn integers(
        &mut self,
        name: &str,
        values: &[u32],
        components: usize,
    ) -> Result<(), EncodeError> {
        let count = values.len() / components;
        let planar =
            (0..values.len()).map(|index| values[index % count * components + index / count]);
        let bytes = delta(planar, Kind::U32);
        let array = Array {
            name: name.to_owned(),
            association: None,
            components,
            count,
            kind: Kind::U32,
            quantum: None,
            offset: None,
            filter: Filter::Delta,
            range: None,
            bytes: 0,
        };
        self.push(array, &bytes)
    }

    pub(super) fn values(
        &mut self,
        name: &str,
        association: Association,
        values: &[f64],
        components: usize,
        bound: ErrorBound,
        extent: f64,
    ) -> Result<(), EncodeError> {
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            let entity = index / components.max(1);
            return Err(EncodeError::NotFinite {
                array: name.into(),
                entity,
                value: values[index],
            });
        }
        let packed = pack(values, components, bound, extent);
        self.raw_bytes += size_of_val(values);
        let array = Array {
            name: name.to_owned(),
            association: Some(association),
            components,
            count: values.len() / components.max(1),
            kind: packed.kind,
            quantum: packed.quantum,
            offset: packed.offset,
            filter: packed.filter,
            range: Some(magnitudes(values, components)),
            bytes: 0,
        };
        self.push(array, &packed.bytes)
    }

    pub(super) fn finish(
        self,
        kind: u8,
        header: impl FnOnce(Vec<Array>) -> Result<Vec<u8>, serde_json::Error>,
    ) -> Result<Vec<u8>, EncodeError> {
        let header = header(self.arrays)?;
        let mut message = Vec::with_capacity(16 + header.len() + self.blobs.len());
        message.extend(MAGIC);
        message.extend([VERSION, kind, 0, 0]);
        let length = u32::try_from(header.len()).map_err(std::io::Error::other)?;
        message.extend(length.to_le_bytes());
        message.extend(header);
        message.extend(self.blobs);
        Ok(message)
    }
}

/// The range of the values of a scalar, of the magnitudes of anything else.
fn magnitudes(values: &[f64], components: usize) -> [f64; 2] {
    if components == 1 {
        return range(values, 1, 0);
    }
    let magnitudes = values.chunks_exact(components.max(1)).map(|tuple| {
        let squares: f64 = tuple.iter().map(|value| value * value).sum();
        // Where the squares over- or underflow, the slower way around them.
        if squares.is_normal() {
            squares.sqrt()
        } else {
            tuple.iter().fold(0.0_f64, |sum, x| sum.hypot(*x))
        }
    });
    let [least, largest] = magnitudes.fold([f64::INFINITY, 0.0], |[least, largest], value| {
        [value.min(least), value.max(largest)]
    });
    if least > largest { [0.0, 0.0] } else { [least.min(f64::MAX), largest.min(f64::MAX)] }
}
