//! Disjoint sets of numbers.

/// Disjoint sets of the numbers from 0 on; the root of a set is its lowest member.
///
/// ```
/// use tombolo_deform::topology::DisjointSets;
///
/// let mut sets = DisjointSets::new(4);
/// sets.join(3, 1);
/// assert_eq!([0, 1, 2, 3].map(|member| sets.root(member)), [0, 1, 2, 1]);
/// ```
#[derive(Debug, Clone)]
pub struct DisjointSets {
    parents: Vec<u32>,
}

impl DisjointSets {
    /// Sets of one number each, from 0 to below `count`.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self { parents: (0..count as u32).collect() }
    }

    /// The connected component of each of `count` vertices that cells or faces join, by its lowest
    /// vertex.
    pub fn components<'a>(count: usize, cells: impl IntoIterator<Item = &'a [u32]>) -> Vec<u32> {
        let mut sets = Self::new(count);
        for pair in cells.into_iter().flat_map(|vertices| vertices.windows(2)) {
            sets.join(pair[0], pair[1]);
        }
        (0..count as u32).map(|vertex| sets.root(vertex)).collect()
    }

    /// The lowest member of the set that `member` belongs to.
    pub fn root(&mut self, mut member: u32) -> u32 {
        while self.parents[member as usize] != member {
            let grandparent = self.parents[self.parents[member as usize] as usize];
            self.parents[member as usize] = grandparent;
            member = grandparent;
        }
        member
    }

    /// Unites the sets of `a` and `b`.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }
}

/// Leads each member of a forest to the root of its tree; `parents` holds the parent of each, a
/// root its own number.
pub(crate) fn lead_to_roots(parents: &mut [u32]) {
    for member in 0..parents.len() {
        let mut root = member as u32;
        while parents[root as usize] != root {
            root = parents[root as usize];
        }
        let mut walk = member as u32;
        while parents[walk as usize] != root {
            walk = std::mem::replace(&mut parents[walk as usize], root);
        }
    }
}
