//! The headers of frames, as encoder and decoder share them.

use serde::{Deserialize, Serialize};

use crate::extract::Association;

/// The first bytes of every frame.
pub(super) const MAGIC: [u8; 4] = *b"TMBL";
/// The version of the protocol.
pub(super) const VERSION: u8 = 1;
/// A frame that holds a topology.
pub(super) const TOPOLOGY: u8 = 1;
/// A frame that holds positions and fields.
pub(super) const DATA: u8 = 2;
/// A frame that holds a reference surface.
pub(super) const SURFACE: u8 = 3;
/// The bytes before the JSON header.
pub(super) const PREAMBLE: usize = 12;

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct TopologyHeader {
    pub(super) view: String,
    pub(super) topology: String,
    pub(super) points: usize,
    pub(super) arrays: Vec<Array>,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct DataHeader {
    pub(super) view: String,
    pub(super) topology: String,
    pub(super) cycle: u64,
    pub(super) time: f64,
    pub(super) arrays: Vec<Array>,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct SurfaceHeader {
    pub(super) features: Vec<String>,
    pub(super) arrays: Vec<Array>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Array {
    pub(super) name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) association: Option<Association>,
    pub(super) components: usize,
    pub(super) count: usize,
    #[serde(rename = "type")]
    pub(super) kind: Kind,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) quantum: Option<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) offset: Option<Vec<f64>>,
    pub(super) filter: Filter,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) range: Option<[f64; 2]>,
    pub(super) bytes: usize,
}

/// The type of an array's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Kind {
    U8,
    U16,
    U32,
    F32,
    F64,
}

impl Kind {
    pub(super) fn size(self) -> usize {
        match self {
            Kind::U8 => 1,
            Kind::U16 => 2,
            Kind::U32 | Kind::F32 => 4,
            Kind::F64 => 8,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Filter {
    Delta,
    None,
}

/// Integers as the little-endian zigzag of each one's difference to the one before, in 1, 2 or 4
/// bytes.
pub(super) fn delta(integers: impl ExactSizeIterator<Item = u32>, kind: Kind) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(integers.len() * kind.size());
    let mut previous = 0u32;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        reason = "wrap-around in the array's type"
    )]
    for integer in integers {
        let difference = integer.wrapping_sub(previous);
        match kind {
            Kind::U8 => {
                let difference = difference as i8;
                bytes.push(((difference << 1) ^ (difference >> 7)) as u8);
            }
            Kind::U16 => {
                let difference = difference as i16;
                bytes.extend((((difference << 1) ^ (difference >> 15)) as u16).to_le_bytes());
            }
            _ => {
                let difference = difference as i32;
                bytes.extend((((difference << 1) ^ (difference >> 31)) as u32).to_le_bytes());
            }
        }
        previous = integer;
    }
    bytes
}

/// The integers behind little-endian bytes; `None` for a type that holds no integers.
pub(super) fn integers(bytes: &[u8], kind: Kind, filter: Filter) -> Option<Vec<u32>> {
    let mut values: Vec<u32> = match kind {
        Kind::U8 => bytes.iter().map(|&byte| u32::from(byte)).collect(),
        Kind::U16 => {
            bytes.as_chunks().0.iter().map(|&chunk| u32::from(u16::from_le_bytes(chunk))).collect()
        }
        Kind::U32 => bytes.as_chunks().0.iter().map(|&chunk| u32::from_le_bytes(chunk)).collect(),
        Kind::F32 | Kind::F64 => return None,
    };
    if filter == Filter::Delta {
        let mask = u32::MAX >> (32 - 8 * kind.size());
        let mut previous = 0u32;
        for value in &mut values {
            let difference = (*value >> 1) ^ (*value & 1).wrapping_neg();
            previous = previous.wrapping_add(difference) & mask;
            *value = previous;
        }
    }
    Some(values)
}
