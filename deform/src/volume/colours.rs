//! Colours of vertices, of which no two that share a cell have the same.

use crate::mesh::{Ordered, Vector};
use crate::partition::{Partition, Shares, any, most};

/// The vertices of this rank's cells, by the numbers of the ordered mesh, and which of them other ranks have in theirs.
#[derive(Debug)]
pub(super) struct Held {
    vertices: Vec<u32>,
    shares: Shares,
    /// The place of each vertex of the part in `vertices`, where it is shared.
    places: Vec<Option<u32>>,
}

impl Held {
    /// Collective.
    pub(super) fn new(ordered: &Ordered, partition: &dyn Partition) -> Self {
        let mesh = ordered.mesh();
        let mut used = vec![false; mesh.points().len()];
        mesh.cells().connectivity().iter().for_each(|&vertex| used[vertex as usize] = true);
        let vertices: Vec<u32> =
            (0..).zip(&used).filter(|(_, used)| **used).map(|(vertex, _)| vertex).collect();
        let numbers: Vec<u32> =
            vertices.iter().map(|&place| ordered.numbering().vertex(place)).collect();
        let shares = Shares::new(partition, &numbers);
        let mut places = vec![None; used.len()];
        shares
            .places()
            .iter()
            .for_each(|&place| places[vertices[place as usize] as usize] = Some(place));
        Self { vertices, shares, places }
    }

    pub(super) fn len(&self) -> usize {
        self.vertices.len()
    }

    pub(super) fn vertex(&self, place: u32) -> u32 {
        self.vertices[place as usize]
    }

    pub(super) fn is_shared(&self, vertex: u32) -> bool {
        self.places[vertex as usize].is_some()
    }

    pub(super) fn shares(&self) -> &Shares {
        &self.shares
    }

    /// Leaves a mark at a shared vertex only where all that have it do. Collective.
    pub(super) fn all(&self, partition: &dyn Partition, marks: &mut [bool]) {
        let mut missing: Vec<f64> = self
            .vertices
            .iter()
            .map(|&vertex| f64::from(u8::from(!marks[vertex as usize])))
            .collect();
        self.shares.sum(partition, 1, &mut missing);
        for &place in self.shares.places() {
            marks[self.vertex(place) as usize] &= missing[place as usize] == 0.0;
        }
    }
}

/// Where a vertex stands in the order in which colours are given: by numbers that look random, so that few wait for each other,
/// and that depend on its place alone, so that the colours do not depend on numbering or parts.
type Key = (u64, [u64; 3]);

fn key(point: Vector) -> Key {
    // Adding 0 makes one zero of two.
    let bits = point.map(|value| (value + 0.0).to_bits());
    let mix = |seed: u64, value: u64| {
        let mut mixed = (seed ^ value).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        mixed ^= mixed >> 32;
        mixed = mixed.wrapping_mul(0xd6e8_feb8_6659_fd93);
        mixed ^ (mixed >> 29)
    };
    (bits.into_iter().fold(0, mix), bits)
}

/// A colour for each of the vertices `free`, rising: the first that no neighbour before it in the order of the keys has. `around`
/// visits the vertices of a vertex's cells. Collective with `parts`; shared vertices have the same colour on all ranks.
pub(super) fn colours(
    points: &[Vector],
    free: &[u32],
    around: impl Fn(u32, &mut dyn FnMut(u32)),
    parts: Option<(&dyn Partition, &Held)>,
) -> Vec<Option<u16>> {
    let mut keys: Vec<Option<Key>> = vec![None; points.len()];
    free.iter().for_each(|&vertex| keys[vertex as usize] = Some(key(points[vertex as usize])));
    if let Some((partition, held)) = parts {
        // Coordinates of one vertex may differ by rounding: those of one rank count.
        let own = |(place, &vertex): (usize, &u32)| {
            if held.shares.owns(place) { points[vertex as usize] } else { [0.0; 3] }
        };
        let mut places: Vec<Vector> = held.vertices.iter().enumerate().map(own).collect();
        held.shares.sum(partition, 3, places.as_flattened_mut());
        for &place in held.shares.places() {
            if let Some(known) = &mut keys[held.vertex(place) as usize] {
                *known = key(places[place as usize]);
            }
        }
    }
    let mut order: Vec<(Key, u32)> =
        free.iter().filter_map(|&vertex| Some((keys[vertex as usize]?, vertex))).collect();
    order.sort_unstable();
    let mut colour_of: Vec<Option<u16>> = vec![None; points.len()];
    let mut used: Vec<u32> = Vec::new();
    let mut waiting = order;
    loop {
        // One pass goes as far as this rank can.
        waiting.retain(|&(key, vertex)| {
            if parts.is_some_and(|(_, held)| held.is_shared(vertex)) {
                return true;
            }
            let mut waits = false;
            around(vertex, &mut |other| match (keys[other as usize], colour_of[other as usize]) {
                (Some(before), None) => waits |= (before, other) < (key, vertex) && other != vertex,
                (_, Some(colour)) => {
                    used.resize(used.len().max(usize::from(colour) + 1), u32::MAX);
                    used[usize::from(colour)] = vertex;
                }
                (None, None) => {}
            });
            if !waits {
                let first = used.iter().position(|&by| by != vertex).unwrap_or(used.len());
                used.resize(used.len().max(first + 1), u32::MAX);
                colour_of[vertex as usize] = u16::try_from(first).ok();
            }
            waits
        });
        let Some((partition, held)) = parts else { return colour_of };
        // What the ranks know of the shared vertices: whether one must wait, and which colours its neighbours have.
        let width = most(partition, used.len()) + 1;
        used.resize(width - 1, u32::MAX);
        let mut known = vec![0.0; width * held.len()];
        let is_shared = |entry: &&(Key, u32)| held.is_shared(entry.1);
        for &(key, vertex) in waiting.iter().filter(is_shared) {
            let Some(place) = held.places[vertex as usize] else { continue };
            let known = &mut known[place as usize * width..][..width];
            around(vertex, &mut |other| match (keys[other as usize], colour_of[other as usize]) {
                (Some(before), None) if (before, other) < (key, vertex) && other != vertex => {
                    known[0] = 1.0
                }
                (_, Some(colour)) => known[usize::from(colour) + 1] = 1.0,
                _ => {}
            });
        }
        held.shares.sum(partition, width, &mut known);
        waiting.retain(|&(_, vertex)| {
            let Some(place) = held.places[vertex as usize] else { return true };
            let known = &known[place as usize * width..][..width];
            if known[0] == 0.0 {
                let first = known[1..].iter().position(|&count| count == 0.0).unwrap_or(width - 1);
                used.resize(used.len().max(first + 1), u32::MAX);
                colour_of[vertex as usize] = u16::try_from(first).ok();
                return false;
            }
            true
        });
        if !any(partition, !waiting.is_empty()) {
            return colour_of;
        }
    }
}
