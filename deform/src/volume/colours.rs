//! Colours of vertices, of which no two that share a cell have the same.

use crate::communicator::{Communicator, Halo};
use crate::mesh::{Ordered, Vector};
use crate::topology::{marked, marks};

/// The vertices of this rank's cells, by the numbers of the ordered mesh, and which of them other
/// ranks have in theirs.
#[derive(Debug)]
pub(super) struct Held {
    vertices: Vec<u32>,
    halo: Halo,
    /// The index of each vertex of the part in `vertices`, where it is shared.
    indices: Vec<Option<u32>>,
}

impl Held {
    /// Collective.
    pub(super) fn new(ordered: &Ordered, of_mesh: &Halo) -> Self {
        let mesh = ordered.mesh();
        let vertices = marked(&marks(mesh.points().len(), mesh.cells().connectivity()));
        let numbers: Vec<u32> =
            vertices.iter().map(|&vertex| ordered.numbering().vertex(vertex)).collect();
        let halo = of_mesh.of(&numbers);
        let mut indices = vec![None; mesh.points().len()];
        halo.shared()
            .iter()
            .for_each(|&index| indices[vertices[index as usize] as usize] = Some(index));
        Self { vertices, halo, indices }
    }

    pub(super) fn len(&self) -> usize {
        self.vertices.len()
    }

    pub(super) fn vertex(&self, index: u32) -> u32 {
        self.vertices[index as usize]
    }

    pub(super) fn is_shared(&self, vertex: u32) -> bool {
        self.indices[vertex as usize].is_some()
    }

    pub(super) fn halo(&self) -> &Halo {
        &self.halo
    }

    /// Leaves a mark at a shared vertex only where all that have it do. Collective.
    pub(super) fn all(&self, marks: &mut [bool]) {
        let mut missing: Vec<bool> =
            self.vertices.iter().map(|&vertex| !marks[vertex as usize]).collect();
        self.halo.any(&mut missing);
        for &index in self.halo.shared() {
            marks[self.vertex(index) as usize] &= !missing[index as usize];
        }
    }
}

/// Where a vertex stands in the order in which colours are given: by numbers that look random, so
/// that few wait for each other, and that depend on its place alone, so that the colours do not
/// depend on numbering or parts.
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

/// A colour for each of the vertices `free`, rising: the first that no neighbour before it in the
/// order of the keys has. `around` visits the vertices of a vertex's cells. Collective with `held`;
/// shared vertices have the same colour on all ranks.
pub(super) fn colours(
    points: &[Vector],
    free: &[u32],
    around: impl Fn(u32, &mut dyn FnMut(u32)),
    held: Option<&Held>,
) -> Vec<Option<u16>> {
    let mut keys: Vec<Option<Key>> = vec![None; points.len()];
    free.iter().for_each(|&vertex| keys[vertex as usize] = Some(key(points[vertex as usize])));
    if let Some(held) = held {
        // Coordinates of one vertex may differ by rounding: those of one rank count.
        let mut positions: Vec<Vector> =
            held.vertices.iter().map(|&vertex| points[vertex as usize]).collect();
        held.halo.update(3, positions.as_flattened_mut());
        for &index in held.halo.shared() {
            if let Some(known) = &mut keys[held.vertex(index) as usize] {
                *known = key(positions[index as usize]);
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
            if held.is_some_and(|held| held.is_shared(vertex)) {
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
        let Some(held) = held else { return colour_of };
        // What the ranks know of the shared vertices: whether one must wait, and which colours its
        // neighbours have.
        let width = held.halo.communicator().most(used.len()) + 1;
        used.resize(width - 1, u32::MAX);
        let mut known = vec![0.0; width * held.len()];
        let is_shared = |entry: &&(Key, u32)| held.is_shared(entry.1);
        for &(key, vertex) in waiting.iter().filter(is_shared) {
            let Some(index) = held.indices[vertex as usize] else { continue };
            let known = &mut known[index as usize * width..][..width];
            around(vertex, &mut |other| match (keys[other as usize], colour_of[other as usize]) {
                (Some(before), None) if (before, other) < (key, vertex) && other != vertex => {
                    known[0] = 1.0
                }
                (_, Some(colour)) => known[usize::from(colour) + 1] = 1.0,
                _ => {}
            });
        }
        held.halo.sum(width, &mut known);
        waiting.retain(|&(_, vertex)| {
            let Some(index) = held.indices[vertex as usize] else { return true };
            let known = &known[index as usize * width..][..width];
            if known[0] == 0.0 {
                let first = known[1..].iter().position(|&count| count == 0.0).unwrap_or(width - 1);
                used.resize(used.len().max(first + 1), u32::MAX);
                colour_of[vertex as usize] = u16::try_from(first).ok();
                return false;
            }
            true
        });
        if !held.halo.communicator().any(!waiting.is_empty()) {
            return colour_of;
        }
    }
}
