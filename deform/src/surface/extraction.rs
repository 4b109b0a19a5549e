//! The surface of a mesh.

use super::SurfaceError;
use super::boundary::{BoundaryFaces, may_run_either_way};
use super::orientation::faces_to_turn;
use super::triangles::split_into_triangles;
use crate::bounds::Bounds;
use crate::features::{FaceTags, FeatureSettings, FeatureSize, Features, face_tags};
use crate::mesh::{CellType, Cells, Mesh, MeshError, Vector, check_finite};
use crate::topology::{DisjointSets, indices, marked, marks};
use crate::vector::{length, polygon_normal};

/// The surface of a mesh: its boundary faces, their vertices and their features.
///
/// Surface vertices are the mesh vertices on the boundary in rising order; faces are in the order
/// of their cells. So the surface depends on the mesh alone, and two meshes with the same cells
/// have the same surface topology.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    points: Vec<Vector>,
    vertices: Vec<u32>,
    faces: Cells,
    owner_cells: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    triangle_faces: Vec<u32>,
    features: Features,
}

impl Surface {
    /// The boundary of a mesh of volume cells of any linear types; a mesh whose highest dimension
    /// is 2 is its own surface.
    ///
    /// Only cells of the highest dimension count. A face belongs to the boundary when it belongs to
    /// one cell. Cells collapsed by naming a vertex twice are taken with what is left of their
    /// faces. Time and memory are linear in the mesh.
    ///
    /// Edges with more than two faces, as where two blocks touch, are no error here: such a surface
    /// can be looked at. It cannot be edited; see [`Editor::new`](crate::edit::Editor::new).
    ///
    /// # Errors
    /// [`SurfaceError::NoFaces`] for a mesh without volume or surface cells,
    /// [`SurfaceError::SharedFace`] for a face of more than two cells,
    /// [`SurfaceError::DuplicateCells`], [`SurfaceError::NoBoundary`],
    /// [`SurfaceError::SharpAngle`].
    ///
    /// ```
    /// use tombolo_deform::{shapes, features::FeatureSettings, surface::Surface};
    ///
    /// let mesh = shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    /// let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
    /// assert_eq!(surface.triangles().len(), 6 * 2 * 16);
    /// assert_eq!(surface.features().names(), ["x-min", "x-max", "y-min", "y-max", "z-min", "z-max"]);
    /// # Ok::<(), tombolo_deform::surface::SurfaceError>(())
    /// ```
    pub fn extract(mesh: &Mesh, settings: &FeatureSettings) -> Result<Self, SurfaceError> {
        settings.validate()?;
        let cells = mesh.cells();
        let dimension = cells.dimension();
        if dimension < 2 {
            return Err(SurfaceError::NoFaces { cells: cells.len(), dimension });
        }
        let boundary = BoundaryFaces::find(mesh.points(), cells, dimension, None)?;
        if boundary.faces.is_empty() {
            return Err(SurfaceError::NoBoundary);
        }
        let BoundaryFaces { faces: mesh_faces, cells: owner_cells, .. } = boundary;
        let vertices = marked(&marks(mesh.points().len(), mesh_faces.connectivity()));
        let local = indices(mesh.points().len(), &vertices);
        let points: Vec<Vector> =
            vertices.iter().map(|&vertex| mesh.points()[vertex as usize]).collect();
        let mut faces = renumbered(&mesh_faces, &local, |_| false);
        if may_run_either_way(dimension, cells) {
            turn_alike(&points, &mut faces);
        }
        let tags = face_tags(mesh.features(), &mesh_faces);
        Ok(Self::put_together(points, vertices, faces, owner_cells, tags.as_ref(), settings))
    }

    fn put_together(
        points: Vec<Vector>,
        vertices: Vec<u32>,
        faces: Cells,
        owner_cells: Vec<u32>,
        tags: Option<&FaceTags>,
        settings: &FeatureSettings,
    ) -> Self {
        let (triangles, triangle_faces) = split_into_triangles(&points, &faces);
        let features = Features::of_tags(tags, &points, &faces, settings);
        Self { points, vertices, faces, owner_cells, triangles, triangle_faces, features }
    }

    /// A surface from its parts, as those of another surface were sent from elsewhere: edits of it
    /// give what edits of that one give. `vertices` are the mesh vertices of the `points`, rising;
    /// `faces` are by surface vertex numbers; `face_features` are indices into `names`. The mesh is
    /// not there, so that each face counts as its own cell.
    ///
    /// # Errors
    /// [`SurfaceError::Parts`] for numbers that are not finite or do not fit together, for cells
    /// that are no faces; [`SurfaceError::NoBoundary`] without any.
    ///
    /// ```
    /// use tombolo_deform::{shapes, features::FeatureSettings, surface::Surface};
    ///
    /// let mesh = shapes::box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    /// let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
    /// let features = surface.features();
    /// let again = Surface::from_faces(
    ///     surface.points().to_vec(),
    ///     surface.vertices().to_vec(),
    ///     surface.faces().clone(),
    ///     features.names().to_vec(),
    ///     features.face_features().to_vec(),
    /// )?;
    /// assert_eq!((again.triangles(), again.features()), (surface.triangles(), features));
    /// # Ok::<(), tombolo_deform::surface::SurfaceError>(())
    /// ```
    pub fn from_faces(
        points: Vec<Vector>,
        vertices: Vec<u32>,
        faces: Cells,
        names: Vec<String>,
        face_features: Vec<u32>,
    ) -> Result<Self, SurfaceError> {
        check_parts(&points, &vertices, &faces)?;
        let features = Features::of_faces(names, face_features, &faces)?;
        let owner_cells = (0..faces.len() as u32).collect();
        let (triangles, triangle_faces) = split_into_triangles(&points, &faces);
        Ok(Self { points, vertices, faces, owner_cells, triangles, triangle_faces, features })
    }

    /// A surface from the boundary faces of the parts of a mesh. `vertices` are the numbers in the
    /// whole mesh of the `points`, rising; `faces` are by surface vertex numbers, `owner_cells` the
    /// numbers of their cells in the whole mesh; without `tags` features are found at sharp edges;
    /// `may_run_either_way` says that of the faces of any part. Faces in the order of their cells
    /// make the surface that [`Surface::extract`] makes of the whole mesh.
    ///
    /// # Errors
    /// [`SurfaceError::Parts`], [`SurfaceError::VertexOrder`], [`SurfaceError::Unreferenced`] for
    /// what does not fit together, [`SurfaceError::NoBoundary`] without faces;
    /// [`SurfaceError::SharpAngle`].
    pub fn assemble(
        points: Vec<Vector>,
        vertices: Vec<u32>,
        mut faces: Cells,
        owner_cells: Vec<u32>,
        may_run_either_way: bool,
        tags: Option<&FaceTags>,
        settings: &FeatureSettings,
    ) -> Result<Self, SurfaceError> {
        settings.validate()?;
        check_parts(&points, &vertices, &faces)?;
        for found in
            [Some(owner_cells.len()), tags.map(|tags| tags.tags.len())].into_iter().flatten()
        {
            if found != faces.len() {
                let what = "faces";
                return Err(MeshError::FeatureCount { found, expected: faces.len(), what }.into());
            }
        }
        if may_run_either_way {
            turn_alike(&points, &mut faces);
        }
        Ok(Self::put_together(points, vertices, faces, owner_cells, tags, settings))
    }

    /// The surface with its vertices at other points.
    pub(crate) fn with_points(&self, points: Vec<Vector>) -> Self {
        Self { points, ..self.clone() }
    }

    /// The surface with the features that its sharp edges make, whatever the mesh says.
    ///
    /// # Errors
    /// [`SurfaceError::SharpAngle`].
    ///
    /// ```
    /// use tombolo_deform::{shapes, features::FeatureSettings, surface::Surface};
    ///
    /// let mesh = shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    /// let tagged = Surface::extract(&mesh, &FeatureSettings::default())?;
    /// assert_eq!(tagged.features().names()[0], "x-min");
    /// let sharp = tagged.with_sharp_features(&FeatureSettings { sharp_angle_degrees: 45.0 })?;
    /// assert_eq!(sharp.features().names(), ["feature-1", "feature-2", "feature-3", "feature-4", "feature-5", "feature-6"]);
    /// # Ok::<(), tombolo_deform::surface::SurfaceError>(())
    /// ```
    pub fn with_sharp_features(mut self, settings: &FeatureSettings) -> Result<Self, SurfaceError> {
        settings.validate()?;
        self.features = Features::of_tags(None, &self.points, &self.faces, settings);
        Ok(self)
    }

    /// The size of each feature, in the order of [`Features::names`].
    ///
    /// ```
    /// use tombolo_deform::{shapes, features::FeatureSettings, surface::Surface};
    ///
    /// let mesh = shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0, 2.0, 3.0]);
    /// let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
    /// let top = &surface.feature_sizes()[5];
    /// assert_eq!((top.name.as_str(), top.faces, top.vertices), ("z-max", 32, 25));
    /// assert!((top.area - 2.0).abs() < 1e-12);
    /// assert_eq!(top.bounds, [[0.0, 0.0, 3.0], [1.0, 2.0, 3.0]]);
    /// # Ok::<(), tombolo_deform::surface::SurfaceError>(())
    /// ```
    #[must_use]
    pub fn feature_sizes(&self) -> Vec<FeatureSize> {
        let size = |(feature, name): (u32, &String)| {
            let vertices = self.features.vertices(feature);
            let bounds =
                Bounds::around(vertices.iter().map(|&vertex| self.points[vertex as usize]));
            let faces = self.features.faces(feature).count();
            let bounds = [bounds.lower, bounds.upper];
            FeatureSize { name: name.clone(), faces, vertices: vertices.len(), area: 0.0, bounds }
        };
        let mut sizes: Vec<FeatureSize> = (0..).zip(self.features.names()).map(size).collect();
        for (triangle, &face) in self.triangles.iter().zip(&self.triangle_faces) {
            let normal = polygon_normal(&self.points, triangle);
            sizes[self.features.face_features()[face as usize] as usize].area +=
                0.5 * length(normal);
        }
        sizes
    }

    /// The connected component of each surface vertex, by its lowest vertex.
    pub(crate) fn components(&self) -> Vec<u32> {
        DisjointSets::components(self.points.len(), self.triangles.iter().map(<[u32; 3]>::as_slice))
    }

    /// The coordinates of each surface vertex in the mesh the surface was taken from.
    #[must_use]
    pub fn points(&self) -> &[Vector] {
        &self.points
    }

    /// The mesh vertex of each surface vertex, rising.
    #[must_use]
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// The faces (triangles, quadrilaterals and polygons) by surface vertex numbers,
    /// counter-clockwise seen from outside the volume. Those of a mesh of dimension 2 run the same
    /// way round in each piece of the surface, as most of it was given, and closed pieces so that
    /// they enclose a positive volume; only a piece with one side, as a Moebius strip, is left as
    /// it was given.
    #[must_use]
    pub fn faces(&self) -> &Cells {
        &self.faces
    }

    /// The cell each face belongs to.
    #[must_use]
    pub fn owner_cells(&self) -> &[u32] {
        &self.owner_cells
    }

    /// The faces split into triangles, by surface vertex numbers.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The face each triangle is part of.
    #[must_use]
    pub fn triangle_faces(&self) -> &[u32] {
        &self.triangle_faces
    }

    /// The features.
    #[must_use]
    pub fn features(&self) -> &Features {
        &self.features
    }
}

/// Faces by other vertex numbers, some of them turned round.
fn renumbered(faces: &Cells, numbers: &[u32], is_turned: impl Fn(usize) -> bool) -> Cells {
    let mut renumbered = Cells::new();
    let mut corners: Vec<u32> = Vec::new();
    for (face, (cell_type, vertices)) in faces.iter().enumerate() {
        corners.clear();
        corners.extend(vertices.iter().map(|&vertex| numbers[vertex as usize]));
        if is_turned(face) {
            corners[1..].reverse();
        }
        // Each was a face of the earlier surface, so that none is refused.
        let _ = renumbered.push(cell_type, &corners);
    }
    renumbered
}

/// Turns the faces that run the other way round than those around them.
fn turn_alike(points: &[Vector], faces: &mut Cells) {
    let turned = faces_to_turn(points, faces);
    if turned.contains(&true) {
        let same: Vec<u32> = (0..points.len() as u32).collect();
        *faces = renumbered(faces, &same, |face| turned[face]);
    }
}

/// Refuses what makes no surface: `vertices` are the mesh vertices of the `points`, `faces` are by
/// surface vertex numbers.
fn check_parts(points: &[Vector], vertices: &[u32], faces: &Cells) -> Result<(), SurfaceError> {
    check_finite(points)?;
    if faces.is_empty() {
        return Err(SurfaceError::NoBoundary);
    }
    if vertices.len() != points.len() {
        return Err(MeshError::PointCount { found: points.len(), expected: vertices.len() }.into());
    }
    if let Some(before) = vertices.windows(2).position(|pair| pair[0] >= pair[1]) {
        return Err(SurfaceError::VertexOrder { vertex: before + 1 });
    }
    faces.validate(points.len())?;
    let referenced = marks(points.len(), faces.connectivity());
    let mut sorted = Vec::new();
    for (cell, (found, corners)) in faces.iter().enumerate() {
        if !matches!(found, CellType::Triangle | CellType::Quad | CellType::Polygon) {
            return Err(MeshError::CellType { cell, found, expected: "a face" }.into());
        }
        sorted.clear();
        sorted.extend_from_slice(corners);
        sorted.sort_unstable();
        sorted.dedup();
        if sorted.len() < corners.len() {
            return Err(
                MeshError::VertexCount { cell, cell_type: found, found: sorted.len() }.into()
            );
        }
    }
    match referenced.iter().position(|referenced| !referenced) {
        Some(vertex) => Err(SurfaceError::Unreferenced { vertex }),
        None => Ok(()),
    }
}
