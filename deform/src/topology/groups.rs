//! Items in groups.

/// Items in groups, one group after the other, each in the order in which its items came.
#[derive(Debug, Clone, PartialEq)]
pub struct Groups<T> {
    /// Where each group begins among the items, and where the last one ends.
    pub offsets: Vec<usize>,
    /// The items of all groups.
    pub items: Vec<T>,
}

impl<T: Copy + Default> Groups<T> {
    /// Deals out items to `count` groups, each by the number of its group: a counting sort, linear
    /// in time and memory.
    ///
    /// # Panics
    /// Where a group is not below `count`.
    pub fn new(count: usize, items: impl Iterator<Item = (u32, T)> + Clone) -> Self {
        let mut offsets = vec![0; count + 1];
        // Nested iterators are quicker where they run their own loops.
        items.clone().for_each(|(group, _)| offsets[group as usize + 1] += 1);
        for group in 0..count {
            offsets[group + 1] += offsets[group];
        }
        let mut next = offsets.clone();
        let mut dealt = vec![T::default(); offsets[count]];
        items.for_each(|(group, item)| {
            let index = &mut next[group as usize];
            dealt[*index] = item;
            *index += 1;
        });
        Self { offsets, items: dealt }
    }
}

impl<T> Groups<T> {
    /// The items of a group.
    ///
    /// # Panics
    /// Where there is no such group.
    #[inline]
    #[must_use]
    pub fn of(&self, group: u32) -> &[T] {
        &self.items[self.offsets[group as usize]..self.offsets[group as usize + 1]]
    }

    /// The groups in order.
    pub fn iter(&self) -> impl Iterator<Item = &[T]> {
        self.offsets.windows(2).map(|range| &self.items[range[0]..range[1]])
    }

    /// Calls `visit` with each group in order, to be changed.
    pub fn for_each_mut(&mut self, visit: impl FnMut(&mut [T])) {
        let mut rest = &mut self.items[..];
        let groups = self.offsets.windows(2).map(|range| {
            let (group, after) = std::mem::take(&mut rest).split_at_mut(range[1] - range[0]);
            rest = after;
            group
        });
        groups.for_each(visit);
    }
}

/// The triangles at each vertex, rising.
pub(crate) fn triangles_at(triangles: &[[u32; 3]], vertices: usize) -> Groups<u32> {
    let corners = triangles
        .iter()
        .zip(0..)
        .flat_map(|(triangle, number)| triangle.map(|vertex| (vertex, number)));
    Groups::new(vertices, corners)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn items_keep_their_order_within_a_group_and_groups_may_be_empty() {
        let mut groups = Groups::new(4, [(2, 'a'), (0, 'b'), (2, 'c'), (3, 'd')].into_iter());
        assert_eq!(groups.iter().collect::<Vec<_>>(), [&['b'][..], &[], &['a', 'c'], &['d']]);
        groups.for_each_mut(<[char]>::reverse);
        assert_eq!((groups.of(1), groups.of(2)), (&[][..], &['c', 'a'][..]));
        assert!(Groups::<u8>::new(0, std::iter::empty()).iter().next().is_none());
    }

    #[test]
    fn every_triangle_stands_at_its_three_vertices() {
        let at = triangles_at(&[[0, 1, 2], [2, 1, 3]], 5);
        assert_eq!(at.iter().collect::<Vec<_>>(), [&[0][..], &[0, 1], &[0, 1], &[1], &[]]);
    }
}
