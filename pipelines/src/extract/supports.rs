//! What all ranks can call the points of an extract that lie between vertices.

use std::sync::Arc;

use super::gather::Crossing;

/// A point that was cut out, known by the vertices between which it lies and by what cut it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Support {
    /// Up to four vertices, rising; `u32::MAX` where there is none.
    pub(crate) vertices: [u32; 4],
    /// Distinguishes it from other points between these vertices.
    pub(crate) layer: u64,
}

impl Support {
    /// The point between these vertices, at most four.
    pub(crate) fn new(vertices: &[u32], layer: u64) -> Self {
        let mut all = [u32::MAX; 4];
        all.iter_mut().zip(vertices).for_each(|(slot, vertex)| *slot = *vertex);
        all.sort_unstable();
        Self { vertices: all, layer }
    }

    /// The point between its vertices and those of another, together at most four.
    pub(crate) fn with(&self, other: &Self, layer: u64) -> Self {
        let mut all = [u32::MAX; 8];
        let mut count = 0;
        for vertex in self.vertices().chain(other.vertices()) {
            if !all[..count].contains(&vertex) {
                all[count] = vertex;
                count += 1;
            }
        }
        Self::new(&all[..count], layer)
    }

    /// Its vertices.
    pub(crate) fn vertices(&self) -> impl Iterator<Item = u32> + '_ {
        self.vertices.iter().copied().filter(|&vertex| vertex != u32::MAX)
    }
}

/// The supports of points.
#[derive(Debug, Clone)]
pub(crate) enum Supports {
    /// Of each point its own.
    Each(Arc<[Support]>),
    /// Of points on edges, and how many there are up to the last of each layer. They are made when
    /// they are asked for, which one process never does.
    OnEdges(Arc<Vec<Crossing>>, Arc<[u32]>),
}

impl Supports {
    /// That of a point.
    pub(crate) fn of(&self, point: usize) -> Support {
        match self {
            Supports::Each(supports) => supports[point],
            Supports::OnEdges(crossings, ends) => {
                let edge = crossings[point].edge;
                let layer = ends.partition_point(|&end| end as usize <= point);
                // A vertex stands twice.
                Support::new(&edge[usize::from(edge[0] == edge[1])..], layer as u64)
            }
        }
    }

    /// Bytes of memory, but for those of the edges, which the extract has as well.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Supports::Each(supports) => size_of_val(&**supports),
            Supports::OnEdges(_, ends) => size_of_val(&**ends),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_edges_have_their_ends_and_the_layer_that_they_lie_on() {
        let edges = [[3, 7], [5, 5], [3, 7], [2, 9], [5, 5]];
        let crossings = edges.map(|edge| Crossing { edge, fraction: 0.5 }).to_vec();
        // The third of four layers has no point.
        let supports = Supports::OnEdges(crossings.into(), [2, 3, 3, 5].into());
        let expected: [(&[u32], u64); 5] =
            [(&[3, 7], 0), (&[5], 0), (&[3, 7], 1), (&[2, 9], 3), (&[5], 3)];
        for (point, (vertices, layer)) in expected.into_iter().enumerate() {
            assert_eq!(supports.of(point), Support::new(vertices, layer));
        }
        assert_eq!(supports.bytes(), 16);
    }
}
