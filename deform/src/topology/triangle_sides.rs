//! The sides of triangles: side `3 t + s` runs from corner `s` of triangle `t` to the next one.

use super::Groups;

/// The twin of a side at a rim: there is no triangle on the other side.
pub(crate) const OPEN: u32 = u32::MAX;

/// An edge at which more than two triangles meet.
#[derive(Debug)]
pub(crate) struct CrowdedEdge {
    /// Its ends, the lower one first.
    pub ends: [u32; 2],
    /// How many triangles meet there.
    pub triangles: usize,
}

/// The three sides of a triangle, from one of them on.
pub(crate) fn around(side: usize) -> [usize; 3] {
    let first = side - side % 3;
    [side, first + (side + 1) % 3, first + (side + 2) % 3]
}

/// The ends of the three sides of a triangle.
pub(crate) fn ends_of_sides(&[a, b, c]: &[u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// The sides of triangles by the edges that they run along.
pub(crate) struct SidesOfEdges {
    /// The sides whose lower end each vertex is: the higher end, and the number of the side.
    by_lower_end: Groups<(u32, u32)>,
}

impl SidesOfEdges {
    /// The sides of triangles whose vertices are below `vertices`. Time and memory are linear in
    /// the triangles.
    pub fn new(triangles: &[[u32; 3]], vertices: usize) -> Self {
        let sides = triangles.iter().flat_map(ends_of_sides).zip(0u32..);
        let sides = sides.map(|([a, b], side)| (a.min(b), (a.max(b), side)));
        let mut by_lower_end = Groups::new(vertices, sides);
        by_lower_end.for_each_mut(<[_]>::sort_unstable);
        Self { by_lower_end }
    }

    /// Each edge in rising order: its ends, the lower one first, and its sides with the higher end.
    pub fn edges(&self) -> impl Iterator<Item = ([u32; 2], &[(u32, u32)])> {
        self.by_lower_end.iter().zip(0u32..).flat_map(|(sides, lower)| {
            sides.chunk_by(|a, b| a.0 == b.0).map(move |same| ([lower, same[0].0], same))
        })
    }

    /// The twin of each side, which is the side of the other triangle at its edge; [`OPEN`] at a
    /// rim.
    ///
    /// # Errors
    /// The first edge at which more than two triangles meet.
    pub fn twins(&self) -> Result<Vec<u32>, CrowdedEdge> {
        let mut twins = vec![OPEN; self.by_lower_end.items.len()];
        for (ends, sides) in self.edges() {
            match *sides {
                [(_, first), (_, second)] => {
                    twins[first as usize] = second;
                    twins[second as usize] = first;
                }
                [_] | [] => {}
                _ => return Err(CrowdedEdge { ends, triangles: sides.len() }),
            }
        }
        Ok(twins)
    }
}
