//! Nested dissection: an order of elimination that keeps the factor of an operator on a surface
//! sparse.

use crate::bounds::Bounds;
use crate::parallel;
use crate::vector::Vector;

/// Up to this many vertices are eliminated together, without cutting them up further.
const LEAF: usize = 40;

/// Pieces of fewer vertices are not worth a thread.
const PIECE: usize = 1 << 12;

/// A set of vertices that is eliminated after its parts, which do not couple with each other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Branch {
    /// The positions of its own vertices in the order of elimination; those of the parts come right
    /// before them.
    pub own: std::ops::Range<usize>,
    /// None or some; with one part only nothing was left of the other.
    pub parts: Vec<Branch>,
}

/// Puts vertices in the order of elimination.
///
/// They are cut in two at the middle of their longest extent, and what lies within `rings` edges of
/// the first half is taken out of the second one, so that an operator that reaches as far does not
/// couple what is left (George 1973, with cuts by coordinates). On a surface the factor of `n`
/// vertices then has `O(n log n)` entries. Where coordinates say nothing about who is whose
/// neighbour, the order is still a valid one, though its factor may be large.
pub(crate) fn dissect<N: Iterator<Item = usize>>(
    points: &[Vector],
    neighbours: &(impl Fn(usize) -> N + Sync),
    rings: usize,
    vertices: &mut [u32],
) -> Branch {
    Search::new(points, neighbours, rings).cut(vertices, 0)
}

struct Search<'a, F> {
    points: &'a [Vector],
    neighbours: &'a F,
    rings: usize,
    /// The last search that came to each vertex.
    reached: Vec<u32>,
    searches: u32,
}

impl<'a, N: Iterator<Item = usize>, F: Fn(usize) -> N + Sync> Search<'a, F> {
    fn new(points: &'a [Vector], neighbours: &'a F, rings: usize) -> Self {
        Self { points, neighbours, rings, reached: vec![0; points.len()], searches: 0 }
    }

    fn cut(&mut self, vertices: &mut [u32], first: usize) -> Branch {
        let last = first + vertices.len();
        if vertices.len() <= LEAF {
            vertices.sort_unstable();
            return Branch { own: first..last, parts: Vec::new() };
        }
        let axis = Bounds::around(vertices.iter().map(|&vertex| self.points[vertex as usize]))
            .longest_axis();
        let half = vertices.len() / 2;
        vertices.select_nth_unstable_by(half, |&a, &b| {
            let [x, y] = [a, b].map(|vertex| self.points[vertex as usize][axis]);
            x.total_cmp(&y).then(a.cmp(&b))
        });
        let (lower, upper) = vertices.split_at_mut(half);
        self.reach(lower);
        let mut kept = 0;
        for index in 0..upper.len() {
            if self.reached[upper[index] as usize] != self.searches {
                upper.swap(kept, index);
                kept += 1;
            }
        }
        let (upper, separator) = upper.split_at_mut(kept);
        separator.sort_unstable();
        let middle = first + half;
        let parts = if upper.is_empty() {
            vec![self.cut(lower, first)]
        } else if half < PIECE {
            vec![self.cut(lower, first), self.cut(upper, middle)]
        } else {
            let mut other = Search::new(self.points, self.neighbours, self.rings);
            let (lower, upper) =
                parallel::join(|| self.cut(lower, first), || other.cut(upper, middle));
            vec![lower, upper]
        };
        Branch { own: middle + kept..last, parts }
    }

    /// Marks everything within `rings` edges of some vertices.
    fn reach(&mut self, from: &[u32]) {
        self.searches += 1;
        for &vertex in from {
            self.reached[vertex as usize] = self.searches;
        }
        let mut ring = Vec::new();
        self.reach_from(from, &mut ring);
        for _ in 1..self.rings {
            let mut next = Vec::new();
            self.reach_from(&ring, &mut next);
            ring = next;
        }
    }

    fn reach_from(&mut self, from: &[u32], found: &mut Vec<u32>) {
        for &vertex in from {
            for neighbour in (self.neighbours)(vertex as usize) {
                if self.reached[neighbour] != self.searches {
                    self.reached[neighbour] = self.searches;
                    found.push(neighbour as u32);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The neighbours of a vertex of a grid of `n` by `n` squares, each cut in two.
    fn grid(n: usize) -> (Vec<Vector>, impl Fn(usize) -> std::vec::IntoIter<usize> + Sync) {
        let points =
            (0..n * n).map(|vertex| [(vertex % n) as f64, (vertex / n) as f64, 0.0]).collect();
        let neighbours = move |vertex: usize| {
            let (x, y) = ((vertex % n) as i64, (vertex / n) as i64);
            [(1, 0), (1, 1), (0, 1), (-1, 0), (-1, -1), (0, -1)]
                .map(|(i, j)| (x + i, y + j))
                .into_iter()
                .filter(|&(x, y)| (0..n as i64).contains(&x) && (0..n as i64).contains(&y))
                .map(|(x, y)| x as usize + n * y as usize)
                .collect::<Vec<_>>()
                .into_iter()
        };
        (points, neighbours)
    }

    /// The branch each position belongs to, and the branch above each.
    fn walk(branch: &Branch, branches: &mut Vec<Vec<usize>>, of_position: &mut [usize]) -> usize {
        let parts: Vec<usize> =
            branch.parts.iter().map(|part| walk(part, branches, of_position)).collect();
        let number = branches.len();
        for position in branch.own.clone() {
            of_position[position] = number;
        }
        let mut below: Vec<usize> = parts.iter().flat_map(|&part| branches[part].clone()).collect();
        below.push(number);
        branches.push(below);
        number
    }

    #[test]
    fn parts_do_not_couple_and_every_vertex_has_one_place() {
        let n = 40;
        let (points, neighbours) = grid(n);
        for rings in 1..4 {
            // Some vertices take no part; couplings run through them all the same.
            let mut vertices: Vec<u32> =
                (0..(n * n) as u32).filter(|vertex| vertex % 7 != 3).collect();
            let count = vertices.len();
            let branch = dissect(&points, &neighbours, rings, &mut vertices);
            let mut sorted = vertices.clone();
            sorted.sort_unstable();
            assert!(
                sorted.iter().copied().eq((0..(n * n) as u32).filter(|vertex| vertex % 7 != 3))
            );
            assert_eq!(branch.own.end, count);

            let (mut branches, mut of_position) = (Vec::new(), vec![usize::MAX; count]);
            walk(&branch, &mut branches, &mut of_position);
            let mut positions = vec![usize::MAX; n * n];
            for (position, &vertex) in vertices.iter().enumerate() {
                positions[vertex as usize] = position;
            }
            for (position, &vertex) in vertices.iter().enumerate() {
                let mut near = vec![vertex as usize];
                for _ in 0..rings {
                    near = near
                        .iter()
                        .flat_map(|&vertex| neighbours(vertex))
                        .chain(near.iter().copied())
                        .collect();
                    near.sort_unstable();
                    near.dedup();
                }
                for other in near
                    .into_iter()
                    .map(|vertex| positions[vertex])
                    .filter(|&position| position != usize::MAX)
                {
                    let [a, b] = [of_position[position], of_position[other]];
                    assert!(
                        branches[a].contains(&b) || branches[b].contains(&a),
                        "{position} and {other} couple"
                    );
                }
            }
        }
    }
}
