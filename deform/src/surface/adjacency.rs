//! Which triangles of a surface meet.

use super::{Surface, SurfaceError};
use crate::parallel;
use crate::topology::{CrowdedEdge, DisjointSets, OPEN, SidesOfEdges, around};

/// Vertices that one thread looks at in one go.
const CHUNK: usize = 1 << 14;

/// Which sides of the triangles of a surface meet.
pub(crate) struct Adjacency {
    /// The twin of each side, which is the side of the other triangle at its edge; [`OPEN`] at a
    /// rim.
    twins: Vec<u32>,
}

impl Adjacency {
    /// Finds the twins of all sides. Time and memory are linear in the surface.
    ///
    /// # Errors
    /// [`SurfaceError::NonManifoldEdge`].
    pub fn new(surface: &Surface) -> Result<Self, SurfaceError> {
        let sides = SidesOfEdges::new(surface.triangles(), surface.points().len());
        let twins = sides.twins().map_err(|CrowdedEdge { ends, triangles }| {
            SurfaceError::NonManifoldEdge {
                edge: ends.map(|vertex| surface.vertices()[vertex as usize]),
                faces: triangles,
            }
        })?;
        Ok(Self { twins })
    }

    /// The twin of each side, which is the side of the other triangle at its edge; [`OPEN`] at a
    /// rim.
    pub fn twins(&self) -> &[u32] {
        &self.twins
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

    /// How many triangles hang together around a vertex, one of whose corners is `corner`; it has
    /// `count` of them.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    fn fan(&self, corners: &[u32], vertex: u32, corner: usize, count: u32) -> u32 {
        let triangle = corner / 3;
        // Along the side that leaves the vertex, and, where a rim ends that, along the one that
        // comes to it.
        let mut found = 1;
        for start in [corner, around(corner)[2]] {
            let mut side = start;
            while self.twins[side] != OPEN && found <= count {
                let other = self.twins[side] as usize;
                if other / 3 == triangle {
                    break;
                }
                found += 1;
                let [own, next, last] = around(other);
                side = if corners[own] == vertex { last } else { next };
            }
            if self.twins[side] != OPEN {
                break;
            }
        }
        found
    }

    /// Pairs of rim vertices with the same coordinates that no edges without length join, the lower
    /// one first.
    pub fn seams(&self, surface: &Surface) -> Vec<[u32; 2]> {
        let corners = surface.triangles().as_flattened();
        let ends = |side: usize| [corners[side], corners[around(side)[1]]];
        let mut rim: Vec<u32> =
            (0..self.twins.len()).filter(|&side| self.twins[side] == OPEN).flat_map(ends).collect();
        rim.sort_unstable();
        rim.dedup();
        // -0 and 0 are the same coordinate.
        let key =
            |vertex: u32| surface.points()[vertex as usize].map(|value| (value + 0.0).to_bits());
        rim.sort_by_key(|&vertex| key(vertex));
        let mut seams: Vec<[u32; 2]> = rim
            .chunk_by(|&a, &b| key(a) == key(b))
            .flat_map(|same| same[1..].iter().map(|&other| [same[0], other]))
            .collect();
        if !seams.is_empty() {
            let mut joined = DisjointSets::new(surface.points().len());
            for [a, b] in (0..corners.len()).map(ends).filter(|&[a, b]| key(a) == key(b)) {
                joined.join(a, b);
            }
            seams.retain(|&[a, b]| joined.root(a) != joined.root(b));
        }
        seams
    }
}
