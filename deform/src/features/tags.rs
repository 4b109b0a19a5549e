//! The features that a mesh names, face by face.

use std::collections::HashMap;

use crate::mesh::{Cells, FaceBuffer, FeatureSource, lowest_four, sorted};

/// The tags that a mesh gives to faces, and the names of features.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FaceTags {
    /// The number of each face's feature; `None` where nothing is said.
    pub tags: Vec<Option<i64>>,
    /// The names of features, by their number.
    pub names: Vec<(i64, String)>,
}

/// The tags of faces, given by the vertex numbers of the mesh; `None` where features are to be
/// found at sharp edges.
#[must_use]
pub fn face_tags(source: &FeatureSource, faces: &Cells) -> Option<FaceTags> {
    match source {
        FeatureSource::SharpEdges => None,
        FeatureSource::Faces(tagged) => {
            let lookup = TagLookup::new(&tagged.faces, &tagged.tags);
            let tags = faces.iter().map(|(_, vertices)| lookup.get(vertices)).collect();
            Some(FaceTags { tags, names: tagged.names.clone() })
        }
        FeatureSource::Vertices(tagged) => {
            let numbers = &tagged.tags;
            let tags = faces.iter().map(|(_, vertices)| majority(numbers, vertices)).collect();
            Some(FaceTags { tags, names: tagged.names.clone() })
        }
    }
}

/// The number that most of the vertices carry, the lowest on a tie.
fn majority(tags: &[i64], vertices: &[u32]) -> Option<i64> {
    most_frequent(
        vertices.iter().filter_map(|&vertex| tags.get(vertex as usize).copied()).collect(),
    )
}

/// The number that comes most often, the lowest on a tie.
fn most_frequent(mut numbers: Vec<i64>) -> Option<i64> {
    numbers.sort_unstable();
    let mut best: Option<(usize, i64)> = None;
    for same in numbers.chunk_by(|a, b| a == b) {
        if best.is_none_or(|(count, _)| same.len() > count) {
            best = Some((same.len(), same[0]));
        }
    }
    best.map(|(_, number)| number)
}

/// Tags of faces, looked up by their vertices in any order.
struct TagLookup {
    small: HashMap<[u32; 4], i64>,
    large: HashMap<Vec<u32>, i64>,
}

impl TagLookup {
    /// Where a face is tagged more than once, the first tag holds.
    fn new(faces: &Cells, tags: &[i64]) -> Self {
        let mut lookup = Self { small: HashMap::with_capacity(faces.len()), large: HashMap::new() };
        let mut buffer = FaceBuffer::default();
        for (cell, &tag) in tags.iter().enumerate().take(faces.len()) {
            buffer.for_each(faces, cell, 2, |_, vertices| {
                if vertices.len() <= 4 {
                    lookup.small.entry(lowest_four(vertices)).or_insert(tag);
                } else {
                    lookup.large.entry(sorted(vertices)).or_insert(tag);
                }
            });
        }
        lookup
    }

    /// The tag of the face with these vertices; of a face whose tags stand on triangles that make
    /// it up, the one that most of them carry, the lowest on a tie.
    fn get(&self, vertices: &[u32]) -> Option<i64> {
        self.get_whole(vertices).or_else(|| self.get_by_triangles(vertices))
    }

    fn get_by_triangles(&self, vertices: &[u32]) -> Option<i64> {
        let count = vertices.len();
        // Larger faces have too many triangles to try.
        if !(4..=12).contains(&count) {
            return None;
        }
        let mut tags = Vec::new();
        for first in 0..count {
            for second in first + 1..count {
                let corners = |third: usize| [vertices[first], vertices[second], vertices[third]];
                tags.extend(
                    (second + 1..count).filter_map(|third| self.get_whole(&corners(third))),
                );
            }
        }
        if tags.len() < count - 2 { None } else { most_frequent(tags) }
    }

    fn get_whole(&self, vertices: &[u32]) -> Option<i64> {
        if vertices.len() <= 4 {
            self.small.get(&lowest_four(vertices)).copied()
        } else {
            self.large.get(&sorted(vertices)).copied()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{CellType, TaggedVertices};

    #[test]
    fn features_of_vertices_have_their_names() {
        let names = vec![(7, "inlet".to_owned())];
        let tagged = TaggedVertices { tags: vec![7, 7, 2, 2], names: names.clone() };
        let faces = Cells::uniform(CellType::Triangle, vec![0, 1, 2, 1, 2, 3]).expect("two faces");
        let tags = face_tags(&FeatureSource::Vertices(tagged), &faces).expect("tags");
        assert_eq!((tags.tags, tags.names), (vec![Some(7), Some(2)], names));
    }
}
