//! The mesh that an encoder walks over.

use super::cells::Source;
use super::connectivity::Third;

/// The encoder's source.
pub(super) struct Known<'a> {
    positions: &'a [[i32; 3]],
    triangles: &'a [[u32; 3]],
    features: Option<&'a [u32]>,
    lines: &'a [[u32; 2]],
    /// The directed sides of the triangles: where the list of each point begins, and in it where a
    /// side leads and the number of its triangle, rising.
    starts: Vec<u32>,
    sides: Vec<(u32, u32)>,
    is_done: Vec<bool>,
    next_seed: usize,
    asked: u32,
    new_points: Vec<u32>,
    pub(super) old_points: Vec<u32>,
    pub(super) old_triangles: Vec<u32>,
}

const UNMET: u32 = u32::MAX;

impl<'a> Known<'a> {
    pub(super) fn new(
        positions: &'a [[i32; 3]],
        triangles: &'a [[u32; 3]],
        features: Option<&'a [u32]>,
        lines: &'a [[u32; 2]],
    ) -> Self {
        let mut starts = vec![0u32; positions.len() + 1];
        for &point in triangles.as_flattened() {
            starts[point as usize + 1] += 1;
        }
        for point in 0..positions.len() {
            starts[point + 1] += starts[point];
        }
        let mut next = starts.clone();
        let mut sides = vec![(0, 0); 3 * triangles.len()];
        for (&[a, b, c], triangle) in triangles.iter().zip(0u32..) {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                sides[next[from as usize] as usize] = (to, triangle);
                next[from as usize] += 1;
            }
        }
        for point in 0..positions.len() {
            sides[starts[point] as usize..starts[point + 1] as usize].sort_unstable();
        }
        Self {
            positions,
            triangles,
            features,
            lines,
            starts,
            sides,
            is_done: vec![false; triangles.len()],
            next_seed: 0,
            asked: 0,
            new_points: vec![UNMET; positions.len()],
            old_points: Vec::with_capacity(positions.len()),
            old_triangles: Vec::with_capacity(triangles.len()),
        }
    }

    /// The number of a point, a new one if it has none.
    #[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
    fn number(&mut self, point: u32) -> u32 {
        let number = &mut self.new_points[point as usize];
        if *number == UNMET {
            *number = self.old_points.len() as u32;
            self.old_points.push(point);
        }
        *number
    }
}

impl Source for Known<'_> {
    fn seed(&mut self, _: u32) -> Option<[u32; 3]> {
        while *self.is_done.get(self.next_seed)? {
            self.next_seed += 1;
        }
        #[expect(clippy::cast_possible_truncation, reason = "triangles have 32 bits")]
        {
            self.asked = self.next_seed as u32;
        }
        Some(self.triangles[self.next_seed].map(|point| self.number(point)))
    }

    fn behind(&mut self, [from, to]: [u32; 2]) -> Third {
        let [from, to] = [from, to].map(|point| self.old_points[point as usize]);
        let list = self.starts[from as usize] as usize..self.starts[from as usize + 1] as usize;
        let list = &self.sides[list];
        let first = list.partition_point(|side| side.0 < to);
        let mut along = list[first..].iter().take_while(|side| side.0 == to);
        let Some(&(_, triangle)) = along.find(|side| !self.is_done[side.1 as usize]) else {
            return Third::Nothing;
        };
        self.asked = triangle;
        let [a, b, c] = self.triangles[triangle as usize];
        let third = if (a, b) == (from, to) {
            c
        } else if (b, c) == (from, to) {
            a
        } else {
            b
        };
        match self.new_points[third as usize] {
            UNMET => {
                self.number(third);
                Third::New
            }
            known => Third::Known(known),
        }
    }

    fn position(&mut self, point: u32) -> [i32; 3] {
        self.positions[self.old_points[point as usize] as usize]
    }

    fn feature(&mut self) -> Option<u32> {
        self.is_done[self.asked as usize] = true;
        self.old_triangles.push(self.asked);
        self.features.map(|features| features[self.asked as usize])
    }

    fn line(&mut self, line: usize, _: u32) -> [u32; 2] {
        self.lines[line].map(|point| self.number(point))
    }

    fn rest(&mut self, _: u32) {
        for point in (0u32..).take(self.positions.len()) {
            self.number(point);
        }
    }
}
