//! The tree by which what the ranks have comes together.

/// How many ranks hand what they have to one of them.
const FAN: usize = 32;

/// The ranks that a rank hears in the tree by which values come together on rank 0, in order, and
/// the one that it tells (`None` on rank 0).
///
/// At each level every 32nd rank of those that are left hears the ones up to the next. So rank 0
/// hears `31 * log(size) / log(32)` ranks at most, and a rank hears of consecutive ranks that begin
/// with itself.
#[must_use]
pub fn tree(rank: usize, size: usize) -> (Vec<usize>, Option<usize>) {
    let mut children = Vec::new();
    let mut step = 1;
    while step < size {
        let group = step * FAN;
        if !rank.is_multiple_of(group) {
            return (children, Some(rank - rank % group));
        }
        children
            .extend((1..FAN).map(|child| rank + child * step).take_while(|&child| child < size));
        step = group;
    }
    (children, None)
}

/// Combines the bytes of the ranks in the order in which the [`tree`] does: that of the ranks, for
/// up to 32 of them.
#[must_use]
pub fn combine(mut parts: Vec<Vec<u8>>, take_in: &dyn Fn(&mut [u8], &[u8])) -> Vec<u8> {
    for rank in (0..parts.len()).rev() {
        for child in tree(rank, parts.len()).0 {
            let more = std::mem::take(&mut parts[child]);
            take_in(&mut parts[rank], &more);
        }
    }
    parts.into_iter().next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rank_is_heard_once_and_in_order() {
        for size in [1, 2, 3, 31, 32, 33, 64, 1000, 1025, 40_000] {
            let mut heard: Vec<Vec<usize>> = (0..size).map(|rank| vec![rank]).collect();
            for rank in (0..size).rev() {
                let (children, parent) = tree(rank, size);
                assert_eq!(parent.is_none(), rank == 0);
                for child in children {
                    assert_eq!(tree(child, size).1, Some(rank));
                    let more = std::mem::take(&mut heard[child]);
                    heard[rank].extend(more);
                }
            }
            assert!(heard[0].iter().copied().eq(0..size), "{size}");
            assert!(tree(0, size).0.len() <= 31 * 4);
        }
    }

    #[test]
    fn what_the_ranks_bring_is_taken_in_by_rising_ranks() {
        for size in [1, 5, 32, 33, 1030] {
            // The order of sums is the order in which ranks are appended to each other.
            let order = std::cell::RefCell::new(Vec::new());
            let take_in = |_: &mut [u8], more: &[u8]| order.borrow_mut().extend_from_slice(more);
            let _ =
                combine((0..size).map(|rank: u32| rank.to_le_bytes().to_vec()).collect(), &take_in);
            let mut heard: Vec<u32> =
                order.borrow().as_chunks().0.iter().map(|rank| u32::from_le_bytes(*rank)).collect();
            if size <= 32 {
                assert!(heard.iter().copied().eq(1..size), "{size}: {heard:?}");
            }
            heard.sort_unstable();
            assert!(heard.iter().copied().eq(1..size), "{size}");
        }
    }
}
