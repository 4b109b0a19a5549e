//! Where a mesh's features come from.

use super::{Cells, MeshError};

/// Where the features (named parts of the boundary) of a mesh come from.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum FeatureSource {
    /// Nothing is known: features are found at sharp edges.
    #[default]
    SharpEdges,
    /// Faces that carry a feature, as physical surfaces in Gmsh do.
    Faces(TaggedFaces),
    /// One feature number for each vertex, as a VTK point array named `features` gives them. A
    /// boundary face belongs to the feature that most of its vertices carry, the lowest number on a
    /// tie.
    Vertices(TaggedVertices),
}

/// Vertices that carry a feature each.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TaggedVertices {
    /// The number of each vertex's feature.
    pub tags: Vec<i64>,
    /// The names of features, by their number, as those of [`TaggedFaces`].
    pub names: Vec<(i64, String)>,
}

impl From<Vec<i64>> for TaggedVertices {
    /// Numbers of features without names.
    fn from(tags: Vec<i64>) -> Self {
        Self { tags, names: Vec::new() }
    }
}

/// Faces that carry a feature each. They need not be all of the boundary, and need not lie on it;
/// boundary faces that are not among them make a feature of their own, named `untagged`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TaggedFaces {
    /// The faces: cells of dimension 2 by the vertex numbers of the mesh. A boundary face of four
    /// vertices or more may also be tagged by the triangles that make it up.
    pub faces: Cells,
    /// The number of each face's feature, one for each of `faces`.
    pub tags: Vec<i64>,
    /// The names of features, by their number. A feature without a name is called
    /// `feature-<number>`.
    pub names: Vec<(i64, String)>,
}

impl FeatureSource {
    pub(super) fn validate(&self, vertex_count: usize) -> Result<(), MeshError> {
        match self {
            FeatureSource::SharpEdges => Ok(()),
            FeatureSource::Faces(tagged) => {
                if tagged.tags.len() != tagged.faces.len() {
                    return Err(MeshError::FeatureCount {
                        found: tagged.tags.len(),
                        expected: tagged.faces.len(),
                        what: "faces",
                    });
                }
                for (cell, &cell_type) in tagged.faces.types().iter().enumerate() {
                    if cell_type.dimension() != 2 {
                        return Err(MeshError::CellType {
                            cell,
                            found: cell_type,
                            expected: "a face",
                        });
                    }
                }
                tagged.faces.validate(vertex_count)
            }
            FeatureSource::Vertices(tagged) if tagged.tags.len() != vertex_count => {
                Err(MeshError::FeatureCount {
                    found: tagged.tags.len(),
                    expected: vertex_count,
                    what: "vertices",
                })
            }
            FeatureSource::Vertices(_) => Ok(()),
        }
    }
}
