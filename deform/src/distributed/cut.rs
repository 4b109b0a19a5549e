//! Cutting a whole mesh into parts.

use crate::mesh::{
    Cells, FeatureSource, Mesh, MeshError, TaggedFaces, TaggedVertices, ghosts as bits,
};

use super::Part;
use crate::topology::{indices, marked, marks};

/// The piece of each cell where cells are dealt out in the order of their numbers, to `pieces`
/// pieces of nearly the same size.
///
/// ```
/// use tombolo_deform::distributed::in_order;
///
/// assert_eq!(in_order(5, 2), [0, 0, 0, 1, 1]);
/// ```
#[must_use]
pub fn in_order(cells: usize, pieces: usize) -> Vec<usize> {
    (0..cells).map(|cell| cell * pieces / cells).collect()
}

impl Part {
    /// The whole mesh as the part of one rank, with the numbers of its vertices and cells.
    ///
    /// # Errors
    /// Those of [`Self::cut`].
    pub fn whole(mesh: &Mesh) -> Result<Self, MeshError> {
        Self::cut(mesh, &vec![0; mesh.cells().len()], 0, false)
    }

    /// The part that `rank` has of a mesh whose cells are dealt out to the ranks `of_cells`, with
    /// the global numbers of its vertices and cells. With `ghosts` come copies of the other ranks'
    /// cells that touch its own by a vertex.
    ///
    /// ```
    /// use tombolo_deform::shapes::box_of_tets;
    /// use tombolo_deform::distributed::{Part, in_order};
    ///
    /// let mesh = box_of_tets([2, 1, 1], [0.0; 3], [2.0, 1.0, 1.0]);
    /// let of_cells = in_order(mesh.cells().len(), 2);
    /// let part = Part::cut(&mesh, &of_cells, 1, false)?;
    /// assert_eq!((part.cells.len(), part.global_cells.as_deref().map(|cells| cells[0])), (mesh.cells().len() / 2, Some(6)));
    /// # Ok::<(), tombolo_deform::mesh::MeshError>(())
    /// ```
    ///
    /// # Errors
    /// [`MeshError::ArrayLength`] where there is not one rank for each cell.
    pub fn cut(
        mesh: &Mesh,
        of_cells: &[usize],
        rank: usize,
        ghosts: bool,
    ) -> Result<Self, MeshError> {
        let (cells, points) = (mesh.cells(), mesh.points());
        if of_cells.len() != cells.len() {
            let (found, expected) = (of_cells.len(), cells.len());
            return Err(MeshError::ArrayLength { name: "ranks of cells".into(), found, expected });
        }
        let own = of_cells.iter().enumerate().filter(|(_, of)| **of == rank);
        let touched = marks(points.len(), own.flat_map(|(cell, _)| cells.vertices(cell)));
        let touches =
            |cell: usize| cells.vertices(cell).iter().any(|&vertex| touched[vertex as usize]);
        let taken: Vec<usize> = (0..cells.len())
            .filter(|&cell| of_cells[cell] == rank || ghosts && touches(cell))
            .collect();
        let used = marks(points.len(), taken.iter().flat_map(|&cell| cells.vertices(cell)));
        let vertices = marked(&used);
        let numbers = indices(points.len(), &vertices);
        let renumbered =
            |of: &[u32]| of.iter().map(|&vertex| numbers[vertex as usize]).collect::<Vec<u32>>();
        let own = cells.subset(taken.iter().copied()).with_vertices(&numbers);
        let features = match mesh.features() {
            FeatureSource::SharpEdges => FeatureSource::SharpEdges,
            FeatureSource::Vertices(tagged) => FeatureSource::Vertices(TaggedVertices {
                tags: vertices.iter().map(|&vertex| tagged.tags[vertex as usize]).collect(),
                names: tagged.names.clone(),
            }),
            FeatureSource::Faces(tagged) => {
                let mut mine = TaggedFaces {
                    faces: Cells::new(),
                    tags: Vec::new(),
                    names: tagged.names.clone(),
                };
                for ((cell_type, vertices), &tag) in tagged.faces.iter().zip(&tagged.tags) {
                    if vertices.iter().all(|&vertex| used[vertex as usize]) {
                        mine.faces.push(cell_type, &renumbered(vertices))?;
                        mine.tags.push(tag);
                    }
                }
                FeatureSource::Faces(mine)
            }
        };
        Ok(Self {
            points: vertices.iter().map(|&vertex| points[vertex as usize]).collect(),
            cells: own,
            features,
            global_vertices: Some(vertices.iter().map(|&vertex| u64::from(vertex)).collect()),
            global_cells: Some(taken.iter().map(|&cell| cell as u64).collect()),
            grid_boxes: Vec::new(),
            ghosts: ghosts.then(|| {
                taken
                    .iter()
                    .map(|&cell| if of_cells[cell] == rank { 0 } else { bits::DUPLICATE })
                    .collect()
            }),
        })
    }

    /// As the solver's arrays that it is a copy of.
    #[must_use]
    pub fn view(&self) -> crate::mesh::MeshView<'_> {
        use crate::mesh::{ArrayView, CellsView, Indices, MeshView};
        MeshView {
            global_vertices: self.global_vertices.as_deref().map(Indices::from),
            global_cells: self.global_cells.as_deref().map(Indices::from),
            ghost_cells: self.ghosts.as_deref(),
            grid_boxes: &self.grid_boxes,
            ..MeshView::new(ArrayView::vectors(&self.points), CellsView::Owned(&self.cells))
                .with_features(&self.features)
        }
    }

    /// The part with its vertices and cells in another order: of each the old indices.
    ///
    /// # Panics
    /// Where these are not those of the part.
    #[must_use]
    pub fn reordered(&self, vertices: &[usize], cells: &[usize]) -> Self {
        let mut new = vec![0; vertices.len()];
        (0..).zip(vertices).for_each(|(number, &vertex)| new[vertex] = number);
        let features = match &self.features {
            FeatureSource::Faces(tagged) => {
                let faces = tagged.faces.with_vertices(&new);
                FeatureSource::Faces(TaggedFaces { faces, ..tagged.clone() })
            }
            FeatureSource::Vertices(tagged) => {
                let tags = vertices.iter().map(|&old| tagged.tags[old]).collect();
                FeatureSource::Vertices(TaggedVertices { tags, ..tagged.clone() })
            }
            FeatureSource::SharpEdges => FeatureSource::SharpEdges,
        };
        let pick = |numbers: &Option<Vec<u64>>, order: &[usize]| {
            numbers.as_ref().map(|numbers| order.iter().map(|&old| numbers[old]).collect())
        };
        Self {
            points: vertices.iter().map(|&vertex| self.points[vertex]).collect(),
            cells: self.cells.subset(cells.iter().copied()).with_vertices(&new),
            features,
            global_vertices: pick(&self.global_vertices, vertices),
            global_cells: pick(&self.global_cells, cells),
            grid_boxes: self.grid_boxes.clone(),
            ghosts: self
                .ghosts
                .as_ref()
                .map(|ghosts| cells.iter().map(|&cell| ghosts[cell]).collect()),
        }
    }
    /// The part with its vertices and cells in an order that looks random and is the same for the
    /// same seed.
    #[must_use]
    pub fn shuffled(&self, seed: u64) -> Self {
        let vertices = random_order(self.points.len(), seed);
        let cells = random_order(self.cells.len(), seed ^ 0x5DEE_CE66);
        self.reordered(&vertices, &cells)
    }
}

/// A random order (Fisher and Yates) from a seed (splitmix64).
pub(crate) fn random_order(length: usize, mut seed: u64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..length).collect();
    for last in (1..length).rev() {
        seed = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = seed;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^= mixed >> 31;
        order.swap(last, usize::try_from(mixed % (last as u64 + 1)).unwrap_or(last));
    }
    order
}
