//! Numbering unknowns so that neighbours lie close together in memory.

use crate::number::index;

/// The reverse Cuthill–McKee order of a symmetric graph (E. Cuthill, J. McKee 1969; A. George
/// 1971): `result[new] = old`.
///
/// `neighbours(i)` are the vertices that share an edge with vertex `i` of `0..count`. Each
/// component starts from a vertex far from its others. The order depends on the graph and its
/// numbering alone. Cost: two visits of each edge.
pub fn reverse_cuthill_mckee<'a>(count: usize, neighbours: impl Fn(u32) -> &'a [u32]) -> Vec<u32> {
    let mut order: Vec<u32> = Vec::with_capacity(count);
    // The number of the walk that saw a vertex last.
    let mut seen = vec![0u32; count];
    let mut walk = 0;
    for first in 0..index(count) {
        if seen[first as usize] != 0 {
            continue;
        }
        // The last vertex that a breadth-first walk meets lies far from where it started.
        let begin = order.len();
        walk += 1;
        breadth_first(first, walk, &neighbours, &mut seen, &mut order, begin, false);
        let start = order[order.len() - 1];
        order.truncate(begin);
        walk += 1;
        breadth_first(start, walk, &neighbours, &mut seen, &mut order, begin, true);
    }
    order.reverse();
    order
}

fn breadth_first<'a>(
    start: u32,
    walk: u32,
    neighbours: &impl Fn(u32) -> &'a [u32],
    seen: &mut [u32],
    order: &mut Vec<u32>,
    begin: usize,
    by_degree: bool,
) {
    seen[start as usize] = walk;
    order.push(start);
    let mut next = begin;
    while let Some(&vertex) = order.get(next) {
        next += 1;
        let from = order.len();
        for &other in neighbours(vertex) {
            if seen[other as usize] != walk {
                seen[other as usize] = walk;
                order.push(other);
            }
        }
        if by_degree {
            order[from..].sort_by_key(|&other| (neighbours(other).len(), other));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain whose numbers are scrambled has bandwidth 1 again; a second component comes along.
    #[test]
    fn a_chain_is_put_in_order() {
        let chain = [3u32, 0, 5, 1, 4, 2];
        let mut lists = vec![Vec::new(); 8];
        for pair in chain.windows(2) {
            lists[pair[0] as usize].push(pair[1]);
            lists[pair[1] as usize].push(pair[0]);
        }
        lists[6].push(7);
        lists[7].push(6);
        let order = reverse_cuthill_mckee(8, |vertex| &lists[vertex as usize]);
        let mut index = [0i64; 8];
        for (new, &old) in order.iter().enumerate() {
            index[old as usize] = new as i64;
        }
        for (vertex, list) in lists.iter().enumerate() {
            assert!(list.iter().all(|&other| (index[vertex] - index[other as usize]).abs() == 1));
        }
    }
}
