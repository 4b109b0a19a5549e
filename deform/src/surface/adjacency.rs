//! Which triangles of a surface meet.

use super::features::Parts;
use super::{Surface, SurfaceError};
use crate::parallel;

/// Vertices that one thread looks at in one go.
const CHUNK: usize = 1 << 14;

/// The sides of the triangles of a surface: side `3 t + s` runs from corner `s` of triangle `t` to the next one.
pub(super) struct Adjacency {
    /// The other side at the edge of each side, [`OPEN`] at a rim.
    across: Vec<u32>,
}

/// No triangle on the other side.
pub(super) const OPEN: u32 = u32::MAX;

impl Adjacency {
    /// Time and memory are linear in the surface.
    ///
    /// # Errors
    /// [`SurfaceError::NonManifoldEdge`].
    pub fn new(surface: &Surface) -> Result<Self, SurfaceError> {
        let triangles = surface.triangles();
        let ends = |side: usize| {
            let triangle = &triangles[side / 3];
            let [a, b] = [triangle[side % 3], triangle[(side + 1) % 3]];
            (a.min(b), a.max(b))
        };
        let sides = 3 * triangles.len();
        let mut starts = vec![0u32; surface.points().len() + 1];
        for side in 0..sides {
            starts[ends(side).0 as usize + 1] += 1;
        }
        for vertex in 1..starts.len() {
            starts[vertex] += starts[vertex - 1];
        }
        let mut by_lower = vec![(0u32, 0u32); sides];
        let mut next = starts.clone();
        for side in 0..sides {
            let (lower, upper) = ends(side);
            by_lower[next[lower as usize] as usize] = (upper, side as u32);
            next[lower as usize] += 1;
        }
        let mut across = vec![OPEN; sides];
        for (lower, range) in starts.windows(2).enumerate() {
            let around = &mut by_lower[range[0] as usize..range[1] as usize];
            around.sort_unstable();
            for same in around.chunk_by(|a, b| a.0 == b.0) {
                match *same {
                    [(_, first), (_, second)] => {
                        across[first as usize] = second;
                        across[second as usize] = first;
                    }
                    [_] | [] => {}
                    [(upper, _), ..] => {
                        return Err(SurfaceError::NonManifoldEdge {
                            edge: [lower as u32, upper]
                                .map(|vertex| surface.vertices()[vertex as usize]),
                            faces: same.len(),
                        });
                    }
                }
            }
        }
        Ok(Self { across })
    }

    /// The other side at the edge of each side, [`OPEN`] at a rim.
    pub fn across(&self) -> &[u32] {
        &self.across
    }

    /// Makes sure that the triangles around each vertex hang together by their edges.
    ///
    /// # Errors
    /// [`SurfaceError::NonManifoldVertex`].
    pub fn check_vertices(&self, surface: &Surface) -> Result<(), SurfaceError> {
        let corners = surface.triangles().as_flattened();
        let mut around_vertices = vec![(0u32, 0u32); surface.points().len()];
        for (corner, &vertex) in corners.iter().enumerate() {
            let (first, count) = &mut around_vertices[vertex as usize];
            *first = corner as u32;
            *count += 1;
        }
        let failures = parallel::map_chunks(around_vertices.len(), CHUNK, |vertices| {
            vertices.into_iter().find(|&vertex| {
                let (first, count) = around_vertices[vertex];
                count > 0 && self.fan(corners, vertex as u32, first as usize, count) != count
            })
        });
        match failures.into_iter().flatten().next() {
            Some(vertex) => {
                Err(SurfaceError::NonManifoldVertex { vertex: surface.vertices()[vertex] })
            }
            None => Ok(()),
        }
    }

    /// How many triangles hang together around a vertex, one of whose corners is `corner`; it has `count` of them.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    fn fan(&self, corners: &[u32], vertex: u32, corner: usize, count: u32) -> u32 {
        let triangle = corner / 3;
        // Along the side that leaves the vertex, and, where a rim ends that, along the one that comes to it.
        let mut found = 1;
        for start in [corner, around(corner)[2]] {
            let mut side = start;
            while self.across[side] != OPEN && found <= count {
                let other = self.across[side] as usize;
                if other / 3 == triangle {
                    break;
                }
                found += 1;
                let [own, next, last] = around(other);
                side = if corners[own] == vertex { last } else { next };
            }
            if self.across[side] != OPEN {
                break;
            }
        }
        found
    }
}

impl Adjacency {
    /// Pairs of rim vertices at the same place that no edges without length join, the lower one first.
    pub fn seams(&self, surface: &Surface) -> Vec<[u32; 2]> {
        let corners = surface.triangles().as_flattened();
        let ends = |side: usize| [corners[side], corners[around(side)[1]]];
        let mut rim: Vec<u32> = (0..self.across.len())
            .filter(|&side| self.across[side] == OPEN)
            .flat_map(ends)
            .collect();
        rim.sort_unstable();
        rim.dedup();
        // -0 and 0 are the same place.
        let key =
            |vertex: u32| surface.points()[vertex as usize].map(|value| (value + 0.0).to_bits());
        rim.sort_by_key(|&vertex| key(vertex));
        let mut seams: Vec<[u32; 2]> = rim
            .chunk_by(|&a, &b| key(a) == key(b))
            .flat_map(|same| same[1..].iter().map(|&other| [same[0], other]))
            .collect();
        if !seams.is_empty() {
            let mut joined = Parts::new(surface.points().len());
            for [a, b] in (0..corners.len()).map(ends).filter(|&[a, b]| key(a) == key(b)) {
                joined.join(a, b);
            }
            seams.retain(|&[a, b]| joined.root(a) != joined.root(b));
        }
        seams
    }
}

/// The three sides of a triangle, from one of them on.
pub(super) fn around(side: usize) -> [usize; 3] {
    let first = side - side % 3;
    [side, first + (side + 1) % 3, first + (side + 2) % 3]
}
