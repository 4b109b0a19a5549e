//! Lists of vertices and other numbered things: as marks, and the other way round.

/// Marks for `count` numbers: those that are listed.
pub(crate) fn marks<'a>(count: usize, listed: impl IntoIterator<Item = &'a u32>) -> Vec<bool> {
    let mut marks = vec![false; count];
    listed.into_iter().for_each(|&number| marks[number as usize] = true);
    marks
}

/// The numbers that are marked, rising.
pub(crate) fn marked(marks: &[bool]) -> Vec<u32> {
    marks.iter().zip(0..).filter(|(mark, _)| **mark).map(|(_, number)| number).collect()
}

/// The index in a list of each of `count` numbers; `u32::MAX` for those that are not listed.
pub(crate) fn indices(count: usize, list: &[u32]) -> Vec<u32> {
    let mut indices = vec![u32::MAX; count];
    list.iter().zip(0..).for_each(|(&number, index)| indices[number as usize] = index);
    indices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_comes_back_from_its_marks_and_its_indices() {
        let marks = marks(5, &[3, 0, 3]);
        assert_eq!((marked(&marks), marks), (vec![0, 3], vec![true, false, false, true, false]));
        assert_eq!(indices(4, &[2, 0]), [1, u32::MAX, 0, u32::MAX]);
    }
}
