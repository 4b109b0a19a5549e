//! The edges of faces, each with the faces that meet there.

use super::Groups;

/// One face's side at an edge; `ends` rise, `forward` where the face walks from the lower to the
/// higher.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct EdgeSide {
    pub ends: [u32; 2],
    pub face: u32,
    pub forward: bool,
}

/// The sides of all edges, those of one edge together, in rising order.
pub(crate) fn edges<'a>(faces: impl Iterator<Item = &'a [u32]> + Clone) -> Vec<EdgeSide> {
    let sides_of = |(vertices, face): (&'a [u32], u32)| {
        let next = vertices.iter().cycle().skip(1);
        vertices.iter().zip(next).map(move |(&a, &b)| {
            let ends = [a.min(b), a.max(b)];
            (ends[0], EdgeSide { ends, face, forward: a < b })
        })
    };
    let vertex_count = faces.clone().flatten().max().map_or(0, |&highest| highest as usize + 1);
    let mut by_lower_end = Groups::new(vertex_count, faces.zip(0..).flat_map(sides_of));
    by_lower_end.for_each_mut(<[EdgeSide]>::sort_unstable);
    by_lower_end.items
}
