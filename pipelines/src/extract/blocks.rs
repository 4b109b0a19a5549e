//! Runs of cells with the vertices that they have, and the sides of a surface on which these lie, so
//! that most cells need not be looked at.

use std::ops::Range;

use tombolo_deform::lanes::with_wide_registers;
use tombolo_deform::mesh::{CellType, Cells};

/// Cells of a block: few enough that a block that is crossed has few cells that are not.
const CELLS: usize = 16;

/// Blocks of cells that follow one another, each with its vertices as bits. It depends on the cells
/// alone, and takes three bytes a tetrahedron where neighbours have neighbouring numbers, and fifteen
/// where the numbers are of no order.
#[derive(Debug)]
pub(super) struct Blocks {
    cells: usize,
    /// Where the words of each block end.
    ends: Vec<usize>,
    /// The numbers of the words in which a block has vertices, and its vertices in each.
    words: Vec<(u32, u32)>,
    are_tetrahedra: bool,
}

impl Blocks {
    pub(super) fn new(cells: &Cells, points: usize) -> Self {
        let (mut ends, mut words): (_, Vec<(u32, u32)>) = (Vec::new(), Vec::new());
        // Where the block that last had vertices of a word keeps them.
        let mut last = vec![usize::MAX; points.div_ceil(32)];
        for block in 0..cells.len().div_ceil(CELLS) {
            let start = words.len();
            for cell in range(block, cells.len()) {
                for &vertex in cells.vertices(cell) {
                    let (word, bit) = bit(vertex);
                    let known = &mut last[word];
                    if *known == usize::MAX || *known < start {
                        *known = words.len();
                        words.push((vertex / 32, 0));
                    }
                    words[*known].1 |= bit;
                }
            }
            ends.push(words.len());
        }
        words.shrink_to_fit();
        let are_tetrahedra = cells.uniform_type() == Some(CellType::Tetra);
        Self { cells: cells.len(), ends, words, are_tetrahedra }
    }

    /// The cells of each block, and the words that have its vertices.
    fn iter(&self) -> impl Iterator<Item = (Range<usize>, &[(u32, u32)])> {
        let mut start = 0;
        self.ends.iter().enumerate().map(move |(block, &end)| {
            let words = &self.words[std::mem::replace(&mut start, end)..end];
            (range(block, self.cells), words)
        })
    }

    /// Whether all cells are tetrahedra.
    pub(super) fn are_tetrahedra(&self) -> bool {
        self.are_tetrahedra
    }

    /// The cells of each block with vertices on both sides.
    pub(super) fn crossed(&self, sides: &Sides) -> impl Iterator<Item = Range<usize>> {
        let is_crossed = |words: &[(u32, u32)]| {
            let [behind, ahead, _] = sides.of_block(words);
            behind && ahead
        };
        self.iter().filter(move |(_, words)| is_crossed(words)).map(|(cells, _)| cells)
    }

    /// Each block, and what is known of its cells where all functions are to be 0 or above.
    pub(super) fn within(
        &self,
        functions: &[Sides],
    ) -> impl Iterator<Item = (Range<usize>, Within)> {
        let within = move |words: &[(u32, u32)]| {
            let mut within = Within::All;
            for sides in functions {
                match sides.of_block(words) {
                    [true, false, false] => return Within::None,
                    [false, true, false] => {}
                    _ => within = Within::Unknown,
                }
            }
            within
        };
        self.iter().map(move |(cells, words)| (cells, within(words)))
    }
}

/// Which cells of a block lie where all of some functions are 0 or above.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Within {
    All,
    None,
    /// Each cell is to be looked at.
    Unknown,
}

fn range(block: usize, cells: usize) -> Range<usize> {
    block * CELLS..cells.min((block + 1) * CELLS)
}

/// The word that has a vertex, and its bit there.
#[inline]
fn bit(vertex: u32) -> (usize, u32) {
    ((vertex / 32) as usize, 1 << (vertex % 32))
}

/// Vertices of a word.
const VERTICES: usize = 32;

/// The sides of a function at the vertices, as bits: behind where it is below 0, ahead where it is
/// 0 or above, neither where it is NaN.
pub(super) struct Sides {
    /// Those behind and those ahead, side by side: who asks for one asks for the other.
    words: Vec<[u32; 2]>,
}

impl Sides {
    pub(super) fn new(vertices: usize, value: impl Fn(usize) -> f64) -> Self {
        let mut words = Vec::with_capacity(vertices.div_ceil(VERTICES));
        with_wide_registers(
            #[inline(always)]
            || {
                for word in 0..vertices / VERTICES {
                    words.push(sides(std::array::from_fn(|bit| value(VERTICES * word + bit))));
                }
            },
        );
        let rest = vertices / VERTICES * VERTICES;
        if rest < vertices {
            // What is no vertex lies on neither side.
            let of = |bit: usize| if rest + bit < vertices { value(rest + bit) } else { f64::NAN };
            words.push(sides(std::array::from_fn(of)));
        }
        Self { words }
    }

    #[inline]
    pub(super) fn is_ahead(&self, vertex: u32) -> bool {
        let (word, bit) = bit(vertex);
        self.words[word][1] & bit != 0
    }

    #[inline]
    pub(super) fn is_behind(&self, vertex: u32) -> bool {
        let (word, bit) = bit(vertex);
        self.words[word][0] & bit != 0
    }

    /// Which corners of a tetrahedron lie ahead, by bits; `None` where the surface does not cut it:
    /// all lie on one side, or one on neither. Without a branch for each corner, which would be
    /// mispredicted as often as not.
    #[inline]
    pub(super) fn of_tetrahedron(&self, corners: [u32; 4]) -> Option<usize> {
        let mask = |side: usize| {
            (0..4).fold(0, |mask, corner| {
                let (word, _) = bit(corners[corner]);
                mask | ((self.words[word][side] >> (corners[corner] % 32) & 1) as usize) << corner
            })
        };
        let ahead = mask(1);
        // Few cells are cut, and of these the rest must lie behind.
        (ahead != 0 && ahead != 15 && mask(0) | ahead == 15).then_some(ahead)
    }

    /// Whether these vertices lie on both sides, and none of them on neither.
    #[inline]
    pub(super) fn are_crossed(&self, vertices: &[u32]) -> bool {
        let ahead = vertices.iter().filter(|&&vertex| self.is_ahead(vertex)).count();
        // Those that are not ahead are looked at where there are some of both: few cells are
        // crossed.
        let is_known = |&vertex: &u32| self.is_ahead(vertex) || self.is_behind(vertex);
        ahead > 0 && ahead < vertices.len() && vertices.iter().all(is_known)
    }

    /// Whether a block has vertices behind, ahead, and on neither side.
    fn of_block(&self, words: &[(u32, u32)]) -> [bool; 3] {
        let (mut behind, mut ahead, mut neither) = (0, 0, 0);
        for &(word, vertices) in words {
            let [below, above] = self.words[word as usize];
            behind |= below & vertices;
            ahead |= above & vertices;
            neither |= vertices & !(below | above);
        }
        [behind != 0, ahead != 0, neither != 0]
    }
}

/// The sides of the vertices of a word: those behind, and those ahead.
#[inline(always)]
fn sides(values: [f64; VERTICES]) -> [u32; 2] {
    [bits(&values, |value| value < 0.0), bits(&values, |value| value >= 0.0)]
}

#[inline(always)]
fn bits(values: &[f64; VERTICES], is: impl Fn(f64) -> bool) -> u32 {
    let bits = values.iter().enumerate();
    bits.fold(0, |bits, (bit, &value)| bits | u32::from(is(value)) << bit)
}

#[cfg(test)]
mod tests {
    use tombolo_deform::shapes::box_of_mixed_cells;

    use super::*;

    #[test]
    fn every_cell_is_in_one_block_that_has_its_vertices() {
        let mesh = box_of_mixed_cells([7, 5, 4], [0.0; 3], [1.0; 3]);
        let (cells, mut next) = (mesh.cells(), 0);
        for (block, words) in Blocks::new(cells, mesh.points().len()).iter() {
            assert_eq!(std::mem::replace(&mut next, block.end), block.start);
            let mut of_cells: Vec<u32> =
                block.flat_map(|cell| cells.vertices(cell)).copied().collect();
            of_cells.sort_unstable();
            of_cells.dedup();
            let mut vertices: Vec<u32> = words
                .iter()
                .flat_map(|&(word, bits)| {
                    (0..32).filter(move |bit| bits >> bit & 1 == 1).map(move |bit| 32 * word + bit)
                })
                .collect();
            vertices.sort_unstable();
            assert_eq!(vertices, of_cells);
        }
        assert_eq!(next, cells.len());
    }

    #[test]
    fn a_vertex_at_0_lies_ahead_and_one_without_a_value_on_neither_side() {
        let values = [-1.0, 0.0, f64::NAN, 2.0, -0.5];
        let sides = Sides::new(values.len(), |vertex| values[vertex]);
        let sides_of = |vertex| [sides.is_behind(vertex), sides.is_ahead(vertex)];
        let expected = [[true, false], [false, true], [false; 2], [false, true], [true, false]];
        assert_eq!([0, 1, 2, 3, 4].map(sides_of), expected);
        assert!(sides.are_crossed(&[0, 1, 3]));
        assert!(!sides.are_crossed(&[0, 1, 2]), "one has no value");
        assert!(!sides.are_crossed(&[0, 4]) && !sides.are_crossed(&[1, 3]));
    }

    #[test]
    fn tetrahedra_are_cut_where_their_corners_lie_on_both_sides() {
        let value = |vertex: usize| [-1.0, 0.0, 2.0, f64::NAN, -0.5][vertex % 7 % 5];
        let sides = Sides::new(100, value);
        for corners in (0..97).map(|first| [first, (first * 13 + 5) % 100, first + 2, first + 1]) {
            let ahead = (0..4).filter(|&corner| sides.is_ahead(corners[corner]));
            let ahead = ahead.fold(0, |mask, corner| mask | 1 << corner);
            let expected = sides.are_crossed(&corners).then_some(ahead);
            assert_eq!(sides.of_tetrahedron(corners), expected, "{corners:?}");
        }
        for vertex in 0..100 {
            let expected = [value(vertex as usize) < 0.0, value(vertex as usize) >= 0.0];
            assert_eq!([sides.is_behind(vertex), sides.is_ahead(vertex)], expected);
        }
    }
}
