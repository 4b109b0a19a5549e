//! From extracts to frames.

use std::sync::Arc;

use tombolo_deform::bounds::Bounds;
use tombolo_deform::mesh::Cells;

use super::elements::Elements;
use super::error::EncodeError;
use super::layout::{Kind, PREAMBLE, check_values, preamble, put_name};
use crate::codec::bytes::{put_block, put_count};
use crate::codec::{self, Bound, CodecError, Coded, Field, Motion, Topology};
use crate::extract::{self, Association, Extract, ExtractFeatures};
use crate::language::ErrorBound;
use crate::run::Frame;

/// Positions of a topology are coded this much more precisely than those of its frames, so that
/// motion along straight lines is found.
const FINER: f64 = 2.0;
/// A topology's grid where positions are sent exactly, in parts of the diagonal: enough to predict
/// from.
const COARSE: f64 = 1e-6;
/// A chain ends after so many frames.
const LONGEST_CHAIN: usize = 1 << 30;
/// Positions are sent as a motion, within their bound.
pub(super) const BOUNDED: u8 = 0;
/// Positions are sent as a field, bit for bit.
pub(super) const EXACT: u8 = 1;
/// The field has a value for each point.
pub(super) const VERTEX: u8 = 0;
/// The field has a value for each triangle and line.
pub(super) const ELEMENT: u8 = 1;

/// An encoded frame: what a viewer is sent.
#[derive(Debug, Clone)]
pub struct Encoded {
    /// Which topology the frame belongs to; the same number for the same message of a topology.
    pub topology_id: u64,
    /// The frame's number in its chain. A key frame is 0, and can be read with the topology alone;
    /// any other goes on from the one before it.
    pub number: usize,
    /// The frame, for whoever has the topology.
    pub message: Vec<u8>,
    /// How many bytes the points and fields are in the solver, in double precision.
    pub raw_bytes: usize,
    topology: Arc<[u8]>,
}

impl Encoded {
    /// Whether the frame can be read without those before it.
    #[must_use]
    pub fn is_key(&self) -> bool {
        self.number == 0
    }

    /// The frame and the topology in one message, for whoever does not have the topology.
    #[must_use]
    pub fn with_topology(&self) -> Vec<u8> {
        let mut message = preamble(Kind::FrameWithTopology).to_vec();
        message.reserve(self.topology.len() + self.message.len());
        put_block(&mut message, &self.topology);
        message.extend(&self.message[PREAMBLE..]);
        message
    }
}

/// Encodes the frames of a view, one encoder for each view.
///
/// Whatever depends on the cells alone is kept as long as they stay the same, and the last frame
/// with it: some 16 bytes for each value of a field, and up to 56 for each coordinate.
#[derive(Debug, Default)]
pub struct Encoder {
    topology: Option<KnownTopology>,
    chain: Option<Chain>,
}

impl Encoder {
    /// An encoder that knows no topology yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Encodes the next frame: a key frame if `key` says so, if the topology or the list of fields
    /// has changed, and after an error.
    ///
    /// # Errors
    /// [`EncodeError`]: positions that are not finite, fields that do not fit, volume cells.
    pub fn encode(&mut self, frame: &Frame, key: bool) -> Result<Encoded, EncodeError> {
        let Frame { pipeline, cycle, time, extract, encoding } = frame;
        check_finite("time", &[*time], 1)?;
        let positions = extract.points.as_flattened();
        check_finite("points", positions, 3)?;
        check_values(
            positions.len() + sent(extract).map(|field| field.values.len()).sum::<usize>(),
        )?;
        let bound = bound(encoding.positions, diagonal(extract));
        let topology = match self.topology.take() {
            Some(topology) if topology.is_of(extract) => topology,
            _ => {
                self.chain = None;
                KnownTopology::new(extract, bound)?
            }
        };
        let topology = self.topology.insert(topology);
        let chain = self.chain.take().filter(|chain| !key && chain.goes_on(extract));
        let mut chain = chain.unwrap_or_else(|| Chain::new(topology, extract));

        let mut message = preamble(Kind::Frame).to_vec();
        put_name(&mut message, pipeline);
        message.extend(topology.id.to_le_bytes());
        put_count(&mut message, chain.number);
        message.extend(cycle.to_le_bytes());
        message.extend(time.to_le_bytes());
        let mut raw_bytes = size_of_val(positions);
        let Coded { topology: cells, points: order, .. } = &topology.coded;
        match &mut chain.positions {
            Positions::Bounded(motion) => {
                message.push(BOUNDED);
                let bound = if let Bound::Absolute(bound) = bound { bound } else { 0.0 };
                motion.encode(cells, order, &extract.points, bound, &mut message)?;
            }
            Positions::Exact(field) => {
                message.push(EXACT);
                field.encode(cells.points(), order, positions, Bound::Exact, &mut message)?;
            }
        }
        put_count(&mut message, chain.fields.len());
        for (field, known) in sent(extract).zip(&mut chain.fields) {
            raw_bytes += size_of_val(&field.values[..]);
            let (expected, found) = match field.association {
                Association::Element => (extract.cells.len(), field.values.len()),
                _ => (extract.points.len(), field.values.len()),
            };
            let expected = expected * field.components;
            if found != expected {
                return Err(EncodeError::Length { array: field.name.clone(), found, expected });
            }
            if chain.number == 0 {
                put_name(&mut message, &field.name);
                let is_of_elements = field.association == Association::Element;
                message.push(if is_of_elements { ELEMENT } else { VERTEX });
                put_count(&mut message, field.components);
            }
            let bound = self::bound(encoding.fields, extent(field));
            if field.association == Association::Element {
                let values = topology.of_elements(field);
                let hierarchy = cells.elements();
                known.encode(hierarchy, hierarchy.order(), &values, bound, &mut message)?;
            } else {
                known.encode(cells.points(), order, &field.values, bound, &mut message)?;
            }
        }
        let number = chain.number;
        chain.number += 1;
        self.chain = Some(chain).filter(|chain| chain.number < LONGEST_CHAIN);
        Ok(Encoded {
            topology_id: topology.id,
            number,
            message,
            raw_bytes,
            topology: Arc::clone(&topology.message),
        })
    }
}

/// The fields that viewers are sent: those with a value for each point or cell.
fn sent(extract: &Extract) -> impl Iterator<Item = &extract::Field> {
    extract.fields.iter().filter(|field| field.association != Association::Mesh)
}

fn check_finite(array: &str, values: &[f64], components: usize) -> Result<(), EncodeError> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => Err(EncodeError::NotFinite {
            array: array.into(),
            entity: index / components,
            value: values[index],
        }),
    }
}

fn diagonal(extract: &Extract) -> f64 {
    let bounds = Bounds::around(extract.points.iter().copied());
    if extract.points.is_empty() { 0.0 } else { bounds.diagonal() }
}

/// The bound that an error stands for, where values have this extent.
fn bound(error: ErrorBound, extent: f64) -> Bound {
    match error {
        ErrorBound::Absolute(bound) => Bound::Absolute(bound),
        ErrorBound::Relative(part) => Bound::Absolute(part * extent),
        ErrorBound::Lossless => Bound::Exact,
    }
}

/// The widest range of any component over the values that are finite.
fn extent(field: &extract::Field) -> f64 {
    let ranges = codec::ranges(&field.values, field.components);
    ranges.into_iter().fold(0.0_f64, |widest, [least, largest]| widest.max(largest - least))
}

/// A topology that was coded.
#[derive(Debug)]
struct KnownTopology {
    of_cells: Arc<Cells>,
    of_features: Option<Arc<ExtractFeatures>>,
    coded: Coded,
    id: u64,
    message: Arc<[u8]>,
    /// The cell that each triangle, and then each line, is part of, as they are decoded.
    cells: Vec<u32>,
    /// Whether positions are coded within the bound that was asked for.
    is_fine: bool,
}

impl KnownTopology {
    fn is_of(&self, extract: &Extract) -> bool {
        let same_features = match (&self.of_features, &extract.features) {
            (None, None) => true,
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            _ => false,
        };
        Arc::ptr_eq(&self.of_cells, &extract.cells)
            && same_features
            && self.coded.points.len() == extract.points.len()
    }

    fn new(extract: &Extract, bound: Bound) -> Result<Self, EncodeError> {
        let elements = Elements::of(extract)?;
        let features = elements.features(extract);
        let code = |bound: f64| {
            let (triangles, lines) = (&elements.triangles, &elements.lines);
            Topology::encode(&extract.points, triangles, features.as_deref(), lines, bound)
        };
        let fine = match bound {
            Bound::Absolute(bound) => code(bound / FINER),
            Bound::Exact => Err(CodecError::Positions),
        };
        let is_fine = fine.is_ok();
        let mut coded = match fine {
            Err(CodecError::Positions) => code(COARSE * diagonal(extract))?,
            fine => fine?,
        };
        let message: Arc<[u8]> = std::mem::take(&mut coded.message).into();
        let cell_of = |&triangle: &u32| elements.triangle_cells[triangle as usize];
        let mut cells: Vec<u32> = coded.triangles.iter().map(cell_of).collect();
        cells.extend(elements.line_cells);
        Ok(Self {
            of_cells: Arc::clone(&extract.cells),
            of_features: extract.features.clone(),
            coded,
            id: hash(&message),
            message,
            cells,
            is_fine,
        })
    }

    /// The values of the triangles and lines from those of their cells.
    fn of_elements(&self, field: &extract::Field) -> Vec<f64> {
        let components = field.components;
        let values = |&cell: &u32| &field.values[cell as usize * components..][..components];
        self.cells.iter().flat_map(values).copied().collect()
    }
}

/// The frames since the last key frame.
#[derive(Debug)]
struct Chain {
    number: usize,
    positions: Positions,
    names: Vec<(String, Association)>,
    fields: Vec<Field>,
}

impl Chain {
    fn new(topology: &KnownTopology, extract: &Extract) -> Self {
        let positions = if topology.is_fine {
            Positions::Bounded(Box::new(Motion::new(&topology.coded.topology)))
        } else {
            Positions::Exact(Field::new(3))
        };
        Self {
            number: 0,
            positions,
            names: sent(extract).map(|field| (field.name.clone(), field.association)).collect(),
            fields: sent(extract).map(|field| Field::new(field.components)).collect(),
        }
    }

    /// Whether the extract has the same fields.
    fn goes_on(&self, extract: &Extract) -> bool {
        let fields = || self.names.iter().zip(&self.fields);
        sent(extract).count() == self.fields.len()
            && sent(extract).zip(fields()).all(|(field, ((name, association), known))| {
                (&field.name, field.association, field.components)
                    == (name, *association, known.components())
            })
    }
}

/// The positions of the last frame.
#[derive(Debug)]
enum Positions {
    Bounded(Box<Motion>),
    Exact(Field),
}

/// A hash of bytes that is the same on every machine.
fn hash(bytes: &[u8]) -> u64 {
    let mut hash = bytes.len() as u64;
    for chunk in bytes.chunks(8) {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        hash = (hash.rotate_left(5) ^ u64::from_le_bytes(word)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
    hash = (hash ^ hash >> 32).wrapping_mul(0xd6e8_feb8_6659_fd93);
    hash ^ hash >> 32
}
