//! Cutting a whole mesh into parts.

use tombolo_deform::mesh::{Cells, FeatureSource, Mesh, MeshError, TaggedFaces};

use super::Part;

impl Part {
    /// What `rank` has of a mesh whose cells are dealt out to the ranks `of_cells`, with the global numbers of its vertices and
    /// cells. With `ghosts` come copies of the other ranks' cells that touch its own by a vertex.
    ///
    /// ```
    /// use tombolo_deform::shapes::box_of_tets;
    /// use tombolo_pipelines::distributed::Part;
    ///
    /// let mesh = box_of_tets([2, 1, 1], [0.0; 3], [2.0, 1.0, 1.0]);
    /// let of_cells: Vec<usize> = (0..mesh.cells().len()).map(|cell| cell * 2 / mesh.cells().len()).collect();
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
        let mut touched = vec![false; points.len()];
        for (cell, _) in of_cells.iter().enumerate().filter(|(_, of)| **of == rank) {
            cells.vertices(cell).iter().for_each(|&vertex| touched[vertex as usize] = true);
        }
        let touches =
            |cell: usize| cells.vertices(cell).iter().any(|&vertex| touched[vertex as usize]);
        let taken: Vec<usize> = (0..cells.len())
            .filter(|&cell| of_cells[cell] == rank || ghosts && touches(cell))
            .collect();
        let mut used = vec![false; points.len()];
        taken
            .iter()
            .flat_map(|&cell| cells.vertices(cell))
            .for_each(|&vertex| used[vertex as usize] = true);
        let vertices: Vec<usize> = (0..points.len()).filter(|&vertex| used[vertex]).collect();
        let mut numbers = vec![u32::MAX; points.len()];
        (0..).zip(&vertices).for_each(|(number, &vertex)| numbers[vertex] = number);
        let renumbered =
            |of: &[u32]| of.iter().map(|&vertex| numbers[vertex as usize]).collect::<Vec<u32>>();
        let own = cells.subset(taken.iter().copied()).with_vertices(&numbers);
        let features = match mesh.features() {
            FeatureSource::SharpEdges => FeatureSource::SharpEdges,
            FeatureSource::Vertices(tags) => {
                FeatureSource::Vertices(vertices.iter().map(|&vertex| tags[vertex]).collect())
            }
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
            points: vertices.iter().map(|&vertex| points[vertex]).collect(),
            cells: own,
            features,
            global_vertices: Some(vertices.iter().map(|&vertex| vertex as u64).collect()),
            global_cells: Some(taken.iter().map(|&cell| cell as u64).collect()),
            ghosts: ghosts.then(|| taken.iter().map(|&cell| of_cells[cell] != rank).collect()),
        })
    }

    /// As the solver's arrays that it is a copy of.
    #[must_use]
    pub fn view(&self) -> tombolo_deform::mesh::MeshView<'_> {
        use tombolo_deform::mesh::{ArrayView, CellsView, Indices, MeshView};
        MeshView {
            global_vertices: self.global_vertices.as_deref().map(Indices::U64),
            global_cells: self.global_cells.as_deref().map(Indices::U64),
            ghost_cells: self.ghosts.as_deref(),
            ..MeshView::new(ArrayView::vectors(&self.points), CellsView::Owned(&self.cells))
                .with_features(&self.features)
        }
    }
}
