//! From frames back to numbers.

use std::collections::BTreeMap;

use tombolo_deform::mesh::{NumberType, Vector};

use super::encoder::{BOUNDED, ELEMENT, EXACT, VERTEX};
use super::error::{DecodeError, error};
use super::layout::{Kind, check_values, name, open};
use crate::codec::bytes::Input;
use crate::codec::{self, Hierarchy, Motion, Topology};
use crate::extract::{Association, Field};

/// The most views that a decoder keeps.
const MOST_VIEWS: usize = 1024;
/// The most fields of a view.
const MOST_FIELDS: usize = 1024;
/// The most components of a field.
const MOST_COMPONENTS: usize = 9;

/// A view at one step.
#[derive(Debug, Clone, PartialEq)]
pub struct DecodedFrame {
    /// The view.
    pub view: String,
    /// The name of its topology.
    pub topology: u64,
    /// The topology, where it came with this frame.
    pub cells: Option<DecodedCells>,
    /// The step.
    pub cycle: u64,
    /// The simulated time.
    pub time: f64,
    /// The coordinates of each point.
    pub points: Vec<Vector>,
    /// The fields; element fields have a value for each triangle, then for each line.
    pub fields: Vec<Field>,
}

/// The cells of a view.
#[derive(Debug, Clone, PartialEq)]
pub struct DecodedCells {
    /// Triangles by the numbers of their points, all of which exist.
    pub triangles: Vec<[u32; 3]>,
    /// The feature of each triangle.
    pub triangle_features: Option<Vec<u32>>,
    /// Lines by the numbers of their points, all of which exist.
    pub lines: Vec<[u32; 2]>,
}

/// Decodes the frames of views, in the order in which they were sent.
#[derive(Debug, Default)]
pub struct Decoder {
    views: BTreeMap<String, View>,
}

/// A view's topology, and what is known of its last frame.
#[derive(Debug)]
struct View {
    id: u64,
    topology: Topology,
    chain: Option<Chain>,
}

/// The frames since the last key frame.
#[derive(Debug)]
struct Chain {
    /// The number of the frame that goes on.
    next: usize,
    motion: Motion,
    exact: codec::Field,
    fields: Vec<KnownField>,
}

#[derive(Debug)]
struct KnownField {
    name: String,
    association: Association,
    field: codec::Field,
}

impl Decoder {
    /// A decoder that knows no view yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { views: BTreeMap::new() }
    }

    /// Decodes one message. Any bytes are answered with a frame or an error.
    ///
    /// A topology takes some hundred bytes for each point, triangle and line, of which there are at
    /// most 1024 for each byte of its message; a frame some 64 bytes for each of its values, of which
    /// there are at most 2²⁷, coordinates among them.
    ///
    /// # Errors
    /// [`DecodeError`]. A frame that goes on from one that was not read, or whose topology was not
    /// read, is an error; so is each one after a frame with an error, until a key frame comes.
    pub fn decode(&mut self, message: &[u8]) -> Result<DecodedFrame, DecodeError> {
        let (kind, mut input) = open(message)?;
        let topology = match kind {
            Kind::Frame => None,
            Kind::FrameWithTopology => {
                let block =
                    input.block().map_err(|failure| error("topology", failure.to_string()))?;
                Some(
                    Topology::decode(block)
                        .map_err(|failure| error("topology", failure.to_string()))?,
                )
            }
            Kind::Surface => {
                return Err(error("preamble", "the message holds a surface, expected a frame"));
            }
        };
        let header = Header::read(&mut input)?;
        let cells = topology.as_ref().map(|topology| DecodedCells {
            triangles: topology.triangles().to_vec(),
            triangle_features: topology.features().map(<[u32]>::to_vec),
            lines: topology.lines().to_vec(),
        });
        if let Some(topology) = topology {
            if self.views.len() >= MOST_VIEWS && !self.views.contains_key(&header.view) {
                return Err(error("header", format!("more than {MOST_VIEWS} views")));
            }
            let view = View { id: header.topology, topology, chain: None };
            self.views.insert(header.view.clone(), view);
        }
        let known = self.views.get_mut(&header.view).filter(|view| view.id == header.topology);
        let view = known.ok_or_else(|| {
            let id = header.topology;
            error("header", format!("the topology {id:016x} of this view was not read"))
        })?;
        let (points, fields) = view.read(header.number, &mut input)?;
        let Header { view, topology, cycle, time, .. } = header;
        Ok(DecodedFrame { view, topology, cells, cycle, time, points, fields })
    }
}

/// The view that a frame is of, without reading the frame.
///
/// # Errors
/// [`DecodeError`] where the message is no frame.
pub fn view_of(message: &[u8]) -> Result<String, DecodeError> {
    let (kind, mut input) = open(message)?;
    match kind {
        Kind::Frame => {}
        Kind::FrameWithTopology => {
            input.block().map_err(|failure| error("topology", failure.to_string()))?;
        }
        Kind::Surface => {
            return Err(error("preamble", "the message holds a surface, expected a frame"));
        }
    }
    name(&mut input, "header")
}

struct Header {
    view: String,
    topology: u64,
    number: usize,
    cycle: u64,
    time: f64,
}

impl Header {
    fn read(input: &mut Input<'_>) -> Result<Self, DecodeError> {
        let view = name(input, "header")?;
        let mut rest = || -> Result<_, codec::CodecError> {
            let topology = u64::from_le_bytes(input.array()?);
            Ok((topology, input.count()?, u64::from_le_bytes(input.array()?), input.double()?))
        };
        let read = rest().map_err(|failure| error("header", failure.to_string()))?;
        let (topology, number, cycle, time) = read;
        if !time.is_finite() {
            return Err(error("header", format!("the time is {time}")));
        }
        Ok(Self { view, topology, number, cycle, time })
    }
}

impl View {
    fn read(
        &mut self,
        number: usize,
        input: &mut Input<'_>,
    ) -> Result<(Vec<Vector>, Vec<Field>), DecodeError> {
        let Self { topology, chain, .. } = self;
        let is_key = number == 0;
        let mut going = match chain.take() {
            _ if is_key => Chain {
                next: 0,
                motion: Motion::new(topology),
                exact: codec::Field::new(3),
                fields: Vec::new(),
            },
            Some(chain) if chain.next == number => chain,
            _ => {
                let before = number - 1;
                return Err(error(
                    "header",
                    format!("frame {number} goes on from frame {before}, which was not read"),
                ));
            }
        };
        let wrong = |failure: codec::CodecError| error("points", failure.to_string());
        let points = match input.byte().map_err(wrong)? {
            BOUNDED => going.motion.decode(topology, &mut input.0).map_err(wrong)?.to_vec(),
            EXACT => {
                let values = going.exact.decode(topology.points(), &mut input.0).map_err(wrong)?;
                values.as_chunks().0.to_vec()
            }
            other => return Err(error("points", format!("found kind {other}, expected 0 or 1"))),
        };
        let wrong = |failure: codec::CodecError| error("header", failure.to_string());
        let count = input.count().map_err(wrong)?;
        let most = if is_key { MOST_FIELDS } else { going.fields.len() };
        if count > most || (!is_key && count < most) {
            return Err(error("header", format!("{count} fields, expected {most}")));
        }
        let mut fields = Vec::new();
        let mut values = points.as_flattened().len();
        for index in 0..count {
            if is_key {
                going.fields.push(KnownField::read(input)?);
            }
            values = values.saturating_add(going.fields[index].values(topology));
            check_values(values).map_err(|failure| error("fields", failure.to_string()))?;
            fields.push(going.fields[index].decode(topology, input)?);
        }
        if !input.0.is_empty() {
            return Err(error("fields", format!("{} bytes after the last one", input.0.len())));
        }
        going.next = number + 1;
        *chain = Some(going);
        Ok((points, fields))
    }
}

impl KnownField {
    fn read(input: &mut Input<'_>) -> Result<Self, DecodeError> {
        let name = name(input, "field")?;
        let part = || format!("field `{name:.60}`");
        let wrong = |failure: codec::CodecError| error(part(), failure.to_string());
        let association = match input.byte().map_err(wrong)? {
            VERTEX => Association::Vertex,
            ELEMENT => Association::Element,
            other => return Err(error(part(), format!("association {other}, expected 0 or 1"))),
        };
        let components = input.count().map_err(wrong)?;
        if components == 0 || components > MOST_COMPONENTS {
            let message = format!("{components} components, expected 1 to {MOST_COMPONENTS}");
            return Err(error(part(), message));
        }
        Ok(Self { name, association, field: codec::Field::new(components) })
    }

    /// How many values it has.
    fn values(&self, topology: &Topology) -> usize {
        let entities = match self.association {
            Association::Element => topology.triangles().len() + topology.lines().len(),
            _ => topology.points().len(),
        };
        entities * self.field.components()
    }

    fn decode(&mut self, topology: &Topology, input: &mut Input<'_>) -> Result<Field, DecodeError> {
        let is_of_elements = self.association == Association::Element;
        let hierarchy = if is_of_elements { topology.elements() } else { topology.points() };
        let values = self.field.decode(hierarchy, &mut input.0);
        let values = values
            .map_err(|failure| error(format!("field `{:.60}`", self.name), failure.to_string()))?;
        let components = self.field.components();
        Ok(Field {
            name: self.name.clone(),
            association: self.association,
            components,
            number: NumberType::F64,
            values: if is_of_elements { in_order(hierarchy, &values, components) } else { values },
        })
    }
}

/// Values by the numbers of their elements, from those by their places in the hierarchy.
fn in_order(hierarchy: &Hierarchy, values: &[f64], components: usize) -> Vec<f64> {
    let mut ordered = vec![0.0; values.len()];
    for (&element, tuple) in hierarchy.order().iter().zip(values.chunks_exact(components)) {
        ordered[element as usize * components..][..components].copy_from_slice(tuple);
    }
    ordered
}
