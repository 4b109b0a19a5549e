//! Which vertices of the ranks are one and the same.
//!
//! Each vertex is told to a rank that follows from its name alone, where those of one name meet:
//! its global number, or the box of a grid that it lies in. Where a vertex lies so near to a side
//! of its box that its match may lie beyond, the box beyond is told too.

use std::collections::BTreeMap;

use crate::mesh::Vector;
use crate::number::index;

use super::{DistributedError, Part};
use crate::communicator::{Communicator, Message, Reader, Reduction, Writer};

/// A vertex of another rank that is the same as one of this rank's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Twin {
    pub(super) rank: u32,
    pub(super) vertex: u32,
    /// What that rank has around it.
    pub(super) held: Held,
}

/// The vertices of this rank that others have too, rising, each with what the others call it, by
/// rank.
pub(super) type Twins = Vec<(u32, Vec<Twin>)>;

/// A vertex on its way to where its name is dealt out to.
struct Told<K> {
    name: K,
    twin: Twin,
}

/// Spreads names evenly (the finalizer of SplitMix64).
fn scatter(name: u64) -> u64 {
    let mut bits = name.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

fn dealt_to(name: u64, size: usize) -> usize {
    (scatter(name) % size as u64) as usize
}

/// What of its own a rank has around a vertex. The owner is among those that have the most, which
/// comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Held {
    /// A cell of the mesh's dimension.
    Whole,
    /// Cells of a lower dimension alone: lines or faces in a mesh of volumes.
    Lower,
    /// No cell of its own.
    Nothing,
}

/// A vertex and what this rank has around it.
pub(super) type Candidate = (u32, Held);

fn write(message: &mut Writer, (vertex, held): Candidate) {
    message.u32(vertex);
    message.u8(held as u8);
}

/// Reads a vertex of a rank, as [`write`] has written it.
fn read(rank: u32, reader: &mut Reader) -> Result<Twin, DistributedError> {
    let vertex = reader.u32()?;
    let held = match reader.u8()? {
        0 => Held::Whole,
        1 => Held::Lower,
        2 => Held::Nothing,
        _ => return Err(reader.garbled().into()),
    };
    Ok(Twin { rank, vertex, held })
}

/// Vertices of one global number. Collective; what is wrong on this rank alone is not agreed upon
/// yet.
pub(super) fn by_number(
    communicator: &dyn Communicator,
    numbers: &[u64],
    candidates: &[Candidate],
) -> Result<Twins, DistributedError> {
    let size = communicator.size();
    let mut messages: Vec<Writer> = (0..size).map(|_| Writer::default()).collect();
    for &candidate in candidates {
        let number = numbers[candidate.0 as usize];
        let message = &mut messages[dealt_to(number, size)];
        message.u64(number);
        write(message, candidate);
    }
    let mut told = Vec::new();
    for (rank, bytes) in communicator.exchange(addressed(messages)) {
        let mut reader = Reader::new(rank, &bytes);
        while !reader.is_empty() {
            told.push(Told { name: reader.u64()?, twin: read(index(rank), &mut reader)? });
        }
    }
    told.sort_unstable_by_key(|told| (told.name, told.twin));
    let mut answers: Vec<Writer> = (0..size).map(|_| Writer::default()).collect();
    for same in told.chunk_by(|a, b| a.name == b.name).filter(|same| same.len() > 1) {
        let twins: Vec<Twin> = same.iter().map(|told| told.twin).collect();
        for twin in &twins {
            answer(
                &mut answers[twin.rank as usize],
                *twin,
                twins.iter().filter(|other| *other != twin),
            );
        }
    }
    let twins = heard(communicator.exchange(addressed(answers)))?;
    let rank = communicator.rank();
    for (vertex, twins) in &twins {
        if let Some(twice) = twins.iter().find(|twin| twin.rank as usize == rank) {
            let vertices = [*vertex.min(&twice.vertex), *vertex.max(&twice.vertex)];
            return Err(DistributedError::NumberTwice {
                number: numbers[*vertex as usize],
                vertices,
            });
        }
    }
    Ok(twins)
}

/// The answer to a vertex that could be one of two of another rank.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Doubt {
    /// It is an error.
    Refused,
    /// It is taken for none of them.
    Apart,
}

/// Vertices at one point: nearer to each other than `tolerance` times the diagonal of the bounding
/// box of all. Collective, as above.
pub(super) fn by_position(
    communicator: &dyn Communicator,
    part: &Part,
    candidates: &[Candidate],
    tolerance: f64,
    doubt: Doubt,
) -> Result<Twins, DistributedError> {
    let size = communicator.size();
    let mut bounds = [f64::INFINITY; 6];
    for point in &part.points {
        for axis in 0..3 {
            bounds[axis] = bounds[axis].min(point[axis]);
            bounds[axis + 3] = bounds[axis + 3].min(-point[axis]);
        }
    }
    communicator.reduce(Reduction::Minimum, &mut bounds);
    let lower: Vector = std::array::from_fn(|axis| bounds[axis]);
    let extent: Vector = std::array::from_fn(|axis| -bounds[axis + 3] - bounds[axis]);
    let diagonal = extent[0].hypot(extent[1]).hypot(extent[2]);
    let diagonal = if diagonal.is_finite() && diagonal > 0.0 { diagonal } else { 1.0 };
    let near = tolerance * diagonal;
    // Much wider than the tolerance, so that hardly a vertex is told twice, and narrow enough to
    // spread.
    let width = (diagonal / 1024.0).max(8.0 * near);
    let box_of = |point: Vector, shift: [f64; 3]| -> [u16; 3] {
        std::array::from_fn(|axis| {
            // From 0 to 1025.
            (((point[axis] + shift[axis] * near - lower[axis]) / width).floor() + 1.0)
                .clamp(0.0, 65535.0) as u16
        })
    };
    let name = |[x, y, z]: [u16; 3]| u64::from(x) | u64::from(y) << 16 | u64::from(z) << 32;
    let mut messages: Vec<Writer> = (0..size).map(|_| Writer::default()).collect();
    let mut boxes = Vec::new();
    for &(vertex, held) in candidates {
        let point = part.points[vertex as usize];
        let own = box_of(point, [0.0; 3]);
        let (low, high) = (box_of(point, [-1.0; 3]), box_of(point, [1.0; 3]));
        boxes.clear();
        boxes.push(own);
        if low != high {
            for corner in 0..8_usize {
                let position = std::array::from_fn(|axis| {
                    if corner >> axis & 1 == 0 { low[axis] } else { high[axis] }
                });
                if !boxes.contains(&position) {
                    boxes.push(position);
                }
            }
        }
        for (copy, &position) in boxes.iter().enumerate() {
            let message = &mut messages[dealt_to(name(position), size)];
            message.u64(name(position) << 1 | u64::from(copy > 0));
            write(message, (vertex, held));
            message.f64s(&point);
        }
    }
    struct Placed {
        of_box: u64,
        point: Vector,
        is_copy: bool,
        twin: Twin,
    }
    let mut told = Vec::new();
    for (rank, bytes) in communicator.exchange(addressed(messages)) {
        let mut reader = Reader::new(rank, &bytes);
        while !reader.is_empty() {
            let (tagged, twin) = (reader.u64()?, read(index(rank), &mut reader)?);
            let (of_box, is_copy, point) = (tagged >> 1, tagged & 1 == 1, reader.vector()?);
            told.push(Placed { of_box, point, is_copy, twin });
        }
    }
    told.sort_unstable_by(|a, b| {
        a.of_box.cmp(&b.of_box).then(a.point[0].total_cmp(&b.point[0])).then(a.twin.cmp(&b.twin))
    });
    let is_near = |a: &Vector, b: &Vector| (0..3).all(|axis| (a[axis] - b[axis]).abs() <= near);
    let mut answers: Vec<Writer> = (0..size).map(|_| Writer::default()).collect();
    for in_box in told.chunk_by(|a, b| a.of_box == b.of_box) {
        let mut pairs: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (first, a) in in_box.iter().enumerate() {
            for (second, b) in in_box.iter().enumerate().skip(first + 1) {
                if b.point[0] - a.point[0] > near {
                    break;
                }
                if a.twin != b.twin && is_near(&a.point, &b.point) {
                    pairs.entry(first).or_default().push(second);
                    pairs.entry(second).or_default().push(first);
                }
            }
        }
        // Of each vertex all matches are known where it lies itself.
        for (vertex, mut others) in pairs.into_iter().filter(|(vertex, _)| !in_box[*vertex].is_copy)
        {
            others.sort_unstable_by_key(|&other| in_box[other].twin);
            let own = in_box[vertex].twin;
            answer(
                &mut answers[own.rank as usize],
                own,
                others.iter().map(|&other| &in_box[other].twin),
            );
        }
    }
    let mut twins = heard(communicator.exchange(addressed(answers)))?;
    let rank = communicator.rank();
    if doubt == Doubt::Apart {
        return set_apart(communicator, twins);
    }
    for (vertex, others) in &mut twins {
        let same_rank = others.iter().find(|twin| twin.rank as usize == rank).copied();
        others.retain(|twin| twin.rank as usize != rank);
        let position = part.points[*vertex as usize];
        // Two vertices of one rank at one point are two, as long as nobody else has one there.
        if let (Some(twice), false) = (same_rank, others.is_empty()) {
            let vertices = [(*vertex).min(twice.vertex), (*vertex).max(twice.vertex)];
            return Err(DistributedError::Ambiguous { position, vertices });
        }
        if let Some(pair) = others.windows(2).find(|pair| pair[0].rank == pair[1].rank) {
            return Err(DistributedError::Ambiguous {
                position,
                vertices: [pair[0].vertex, pair[1].vertex],
            });
        }
    }
    twins.retain(|(_, others)| !others.is_empty());
    Ok(twins)
}

/// Lets go of the vertices that could be one of two, here and where others hold them to be theirs.
/// Collective.
fn set_apart(communicator: &dyn Communicator, mut twins: Twins) -> Result<Twins, DistributedError> {
    let (rank, size) = (communicator.rank(), communicator.size());
    let mut messages: Vec<Writer> = (0..size).map(|_| Writer::default()).collect();
    for (vertex, others) in &mut twins {
        let is_doubtful = others.iter().any(|twin| twin.rank as usize == rank)
            || others.windows(2).any(|pair| pair[0].rank == pair[1].rank);
        if !is_doubtful {
            continue;
        }
        for twin in others.drain(..).filter(|twin| twin.rank as usize != rank) {
            messages[twin.rank as usize].u32(twin.vertex);
            messages[twin.rank as usize].u32(*vertex);
        }
    }
    for (from, bytes) in communicator.exchange(addressed(messages)) {
        let mut reader = Reader::new(from, &bytes);
        while !reader.is_empty() {
            let (own, theirs) = (reader.u32()?, reader.u32()?);
            if let Ok(at) = twins.binary_search_by_key(&own, |(vertex, _)| *vertex) {
                twins[at].1.retain(|twin| (twin.rank as usize, twin.vertex) != (from, theirs));
            }
        }
    }
    twins.retain(|(_, others)| !others.is_empty());
    Ok(twins)
}

/// The messages that are not empty, with the ranks that they go to.
pub(super) fn addressed(messages: Vec<Writer>) -> Vec<Message> {
    let messages = messages.into_iter().enumerate().filter(|(_, message)| !message.is_empty());
    messages.map(|(rank, message)| (rank, message.into_bytes())).collect()
}

fn answer<'a>(message: &mut Writer, of: Twin, others: impl Iterator<Item = &'a Twin> + Clone) {
    message.u32(of.vertex);
    message.u32(index(others.clone().count()));
    for other in others {
        message.u32(other.rank);
        write(message, (other.vertex, other.held));
    }
}

fn heard(answers: Vec<Message>) -> Result<Twins, DistributedError> {
    let mut twins = Twins::new();
    for (from, bytes) in answers {
        let mut reader = Reader::new(from, &bytes);
        while !reader.is_empty() {
            let (vertex, count) = (reader.u32()?, reader.u32()?);
            let others: Result<Vec<Twin>, DistributedError> = (0..count)
                .map(|_| {
                    let rank = reader.u32()?;
                    read(rank, &mut reader)
                })
                .collect();
            twins.push((vertex, others?));
        }
    }
    twins.sort_unstable();
    Ok(twins)
}
