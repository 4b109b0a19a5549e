//! Loops that use threads where the feature `parallel` is on, and give the same bits where it is
//! off.
//!
//! Work is cut into chunks whose size depends on the problem alone, and partial results are
//! combined in the order of the chunks. So no result depends on how many threads there are.

#[cfg(feature = "parallel")]
use rayon::prelude::*;

/// Calls `work` with the number of each chunk of `out` and the chunk.
pub(crate) fn for_each_chunk<T: Send>(
    out: &mut [T],
    chunk: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    #[cfg(feature = "parallel")]
    if out.len() > chunk {
        out.par_chunks_mut(chunk).enumerate().for_each(|(index, part)| work(index, part));
        return;
    }
    for (index, part) in out.chunks_mut(chunk).enumerate() {
        work(index, part);
    }
}

/// Calls `work` with each part.
pub(crate) fn for_each<P: Send>(parts: Vec<P>, work: impl Fn(P) + Sync) {
    #[cfg(feature = "parallel")]
    if parts.len() > 1 {
        parts.into_par_iter().for_each(&work);
        return;
    }
    for part in parts {
        work(part);
    }
}

/// The results of `work` for each chunk of `0..count`, in order.
pub(crate) fn map_chunks<R: Send>(
    count: usize,
    chunk: usize,
    work: impl Fn(std::ops::Range<usize>) -> R + Sync,
) -> Vec<R> {
    let range = |index: usize| index * chunk..((index + 1) * chunk).min(count);
    let chunks = count.div_ceil(chunk);
    #[cfg(feature = "parallel")]
    if chunks > 1 {
        return (0..chunks).into_par_iter().map(|index| work(range(index))).collect();
    }
    (0..chunks).map(|index| work(range(index))).collect()
}

/// Calls `work` with each chunk of rows and what two arrays in compressed rows hold for them.
pub(crate) fn for_each_rows<T: Send, U: Send>(
    chunk: usize,
    (offsets, values): (&[usize], &mut [T]),
    (other_offsets, other_values): (&[usize], &mut [U]),
    work: impl Fn(std::ops::Range<usize>, &mut [T], &mut [U]) + Sync,
) {
    let rows = offsets.len() - 1;
    let mut parts = Vec::with_capacity(rows.div_ceil(chunk));
    let (mut rest, mut other_rest) = (values, other_values);
    for start in (0..rows).step_by(chunk) {
        let end = (start + chunk).min(rows);
        let (part, after) = rest.split_at_mut(offsets[end] - offsets[start]);
        let (other_part, other_after) =
            other_rest.split_at_mut(other_offsets[end] - other_offsets[start]);
        parts.push((start..end, part, other_part));
        (rest, other_rest) = (after, other_after);
    }
    #[cfg(feature = "parallel")]
    if parts.len() > 1 {
        parts.into_par_iter().for_each(|(range, part, other)| work(range, part, other));
        return;
    }
    for (range, part, other) in parts {
        work(range, part, other);
    }
}

/// Sorts values that are all different.
pub(crate) fn sort<T: Ord + Send>(values: &mut [T]) {
    #[cfg(feature = "parallel")]
    values.par_sort_unstable();
    #[cfg(not(feature = "parallel"))]
    values.sort_unstable();
}

/// Does two things, at the same time where there are threads.
pub(crate) fn join<A: Send, B: Send>(
    first: impl FnOnce() -> A + Send,
    second: impl FnOnce() -> B + Send,
) -> (A, B) {
    #[cfg(feature = "parallel")]
    {
        rayon::join(first, second)
    }
    #[cfg(not(feature = "parallel"))]
    {
        (first(), second())
    }
}

/// Whether `test` holds for any chunk of `0..count`.
pub(crate) fn any_chunk(
    count: usize,
    chunk: usize,
    test: impl Fn(std::ops::Range<usize>) -> bool + Sync,
) -> bool {
    let range = |index: usize| index * chunk..((index + 1) * chunk).min(count);
    #[cfg(feature = "parallel")]
    {
        (0..count.div_ceil(chunk)).into_par_iter().any(|index| test(range(index)))
    }
    #[cfg(not(feature = "parallel"))]
    {
        (0..count.div_ceil(chunk)).any(|index| test(range(index)))
    }
}
