//! Whether the faces that carry features are faces of the mesh.

use std::collections::HashMap;

use crate::mesh::{Cells, FaceBuffer, MeshError, TaggedFaces, lowest_four};

/// Tagged faces that make no feature of the surface of some cells.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MisplacedFaces {
    /// The indices of those that are no face of any cell, and no triangle of one; rising.
    pub loose: Vec<usize>,
    /// How many are faces of two cells, which lie inside the mesh.
    pub inside: usize,
}

impl MisplacedFaces {
    /// Refuses the loose faces.
    ///
    /// # Errors
    /// [`MeshError::LooseFace`] with the first.
    pub fn check(&self, tagged: &TaggedFaces) -> Result<(), MeshError> {
        let Some(&face) = self.loose.first() else { return Ok(()) };
        let tag = tagged.tags.get(face).copied().unwrap_or_default();
        let name =
            tagged.names.iter().find(|(number, _)| *number == tag).map(|(_, name)| name.clone());
        Err(MeshError::LooseFace {
            face,
            feature: name.unwrap_or_else(|| tag.to_string()),
            vertices: tagged.faces.vertices(face).to_vec(),
            loose: self.loose.len(),
            faces: tagged.faces.len(),
        })
    }
}

/// Finds the tagged faces that make no feature of the cells' surface. One pass over the cells.
///
/// ```
/// use tombolo_deform::{mesh::FeatureSource, shapes, features::{MisplacedFaces, misplaced_faces}};
///
/// let mesh = shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
/// let FeatureSource::Faces(tagged) = mesh.features() else { panic!("the box has its sides tagged") };
/// assert_eq!(misplaced_faces(tagged, mesh.cells()), MisplacedFaces::default());
/// ```
#[must_use]
pub fn misplaced_faces(tagged: &TaggedFaces, cells: &Cells) -> MisplacedFaces {
    let mut buffer = FaceBuffer::default();
    // The lowest four vertices stand for a face; of the faces of one mesh no two large ones have
    // the same.
    let mut uses: HashMap<[u32; 4], u32> = HashMap::with_capacity(tagged.faces.len());
    let mut is_touched = Vec::new();
    let mut has_triangles = false;
    for face in 0..tagged.faces.len() {
        buffer.for_each(&tagged.faces, face, 2, |_, vertices| {
            uses.insert(lowest_four(vertices), 0);
            has_triangles |= vertices.len() == 3;
            for &vertex in vertices {
                if is_touched.len() <= vertex as usize {
                    is_touched.resize(vertex as usize + 1, false);
                }
                is_touched[vertex as usize] = true;
            }
        });
    }
    if uses.is_empty() {
        return MisplacedFaces::default();
    }
    let dimension = cells.dimension().max(2);
    for cell in 0..cells.len() {
        buffer.for_each(cells, cell, dimension, |_, vertices| {
            if vertices
                .iter()
                .any(|&vertex| !is_touched.get(vertex as usize).copied().unwrap_or(false))
            {
                return;
            }
            if let Some(count) = uses.get_mut(&lowest_four(vertices)) {
                *count += 1;
            }
            let count = vertices.len();
            // Larger faces have too many triangles to try; none of theirs is looked up either.
            if has_triangles && (4..=12).contains(&count) {
                for first in 0..count {
                    for second in first + 1..count {
                        for third in second + 1..count {
                            let corners = [vertices[first], vertices[second], vertices[third]];
                            if let Some(count) = uses.get_mut(&lowest_four(&corners)) {
                                *count += 1;
                            }
                        }
                    }
                }
            }
        });
    }
    let mut found = MisplacedFaces::default();
    for face in 0..tagged.faces.len() {
        let mut least = u32::MAX;
        buffer.for_each(&tagged.faces, face, 2, |_, vertices| {
            least = least.min(uses.get(&lowest_four(vertices)).copied().unwrap_or(0));
        });
        match least {
            0 => found.loose.push(face),
            // On the boundary; or collapsed to a line, as the faces of a collapsed cell are.
            1 | u32::MAX => {}
            _ => found.inside += usize::from(dimension == 3),
        }
    }
    found
}

/// Refuses the name of a feature whose number no face has. `numbers` are those that the faces have,
/// rising.
///
/// # Errors
/// [`MeshError::EmptyFeature`] with the first.
pub fn check_feature_names(names: &[(i64, String)], numbers: &[i64]) -> Result<(), MeshError> {
    match names.iter().find(|(number, _)| numbers.binary_search(number).is_err()) {
        None => Ok(()),
        Some((number, name)) => Err(MeshError::EmptyFeature {
            number: *number,
            name: name.clone(),
            numbers: numbers.to_vec(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{CellType, FeatureSource};
    use crate::shapes::{box_of_hexahedra, box_of_tets};

    fn check_tagged_faces(tagged: &TaggedFaces, cells: &Cells) -> Result<usize, MeshError> {
        let found = misplaced_faces(tagged, cells);
        found.check(tagged).map(|()| found.inside)
    }

    fn tagged(cell_type: CellType, faces: Vec<u32>, tags: Vec<i64>) -> TaggedFaces {
        TaggedFaces {
            faces: Cells::uniform(cell_type, faces).expect("whole faces"),
            tags,
            names: vec![(7, "lid".into())],
        }
    }

    #[test]
    fn every_face_of_a_box_is_one_and_no_other_is() {
        for mesh in [
            box_of_tets([3, 2, 2], [0.0; 3], [1.0; 3]),
            box_of_hexahedra([3, 2, 2], [0.0; 3], [1.0; 3]),
        ] {
            let FeatureSource::Faces(mut tagged) = mesh.features().clone() else { panic!("sides") };
            assert_eq!(check_tagged_faces(&tagged, mesh.cells()), Ok(0));
            // From one corner of the box to the opposite one.
            let triangle = vec![0, 1, mesh.points().len() as u32 - 1];
            tagged.faces.push(CellType::Triangle, &triangle).expect("a triangle");
            tagged.tags.push(7);
            tagged.names.push((7, "lid".into()));
            let error = check_tagged_faces(&tagged, mesh.cells()).expect_err("no face");
            let faces = tagged.faces.len();
            let expected = MeshError::LooseFace {
                face: faces - 1,
                feature: "lid".into(),
                vertices: triangle,
                loose: 1,
                faces,
            };
            assert_eq!(error, expected);
        }
    }

    #[test]
    fn triangles_of_a_quad_and_faces_inside_are_none_of_it() {
        let mesh = box_of_hexahedra([2, 1, 1], [0.0; 3], [1.0; 3]);
        let quad = |cell: usize, local: [usize; 4]| {
            local.map(|corner| mesh.cells().vertices(cell)[corner])
        };
        let [a, b, c, d] = quad(0, [0, 1, 2, 3]);
        assert_eq!(
            check_tagged_faces(
                &tagged(CellType::Triangle, vec![a, b, c, c, d, a], vec![7, 7]),
                mesh.cells()
            ),
            Ok(0)
        );
        let shared: Vec<u32> = mesh
            .cells()
            .vertices(0)
            .iter()
            .copied()
            .filter(|vertex| mesh.cells().vertices(1).contains(vertex))
            .collect();
        assert_eq!(
            check_tagged_faces(&tagged(CellType::Quad, shared, vec![7]), mesh.cells()),
            Ok(1)
        );
    }

    #[test]
    fn a_name_without_faces_is_told_with_the_numbers_there_are() {
        let names = [(1, "low".to_owned()), (3, "high".to_owned())];
        assert_eq!(check_feature_names(&names, &[1, 2, 3]), Ok(()));
        let error = check_feature_names(&names, &[1, 2]).expect_err("3 is missing");
        assert_eq!(
            error.to_string(),
            "feature 'high' has the number 3, which no face has; the faces have 1, 2"
        );
    }
}
