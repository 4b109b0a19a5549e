//! The surface of a mesh.

use super::bounds::Bounds;
use super::features::{FeatureSettings, FeatureSize, Features};
use super::orientation::faces_to_turn;
use super::part::{BoundaryFaces, FaceTags, face_tags};
use crate::mesh::{CellType, Cells, Mesh, MeshError, Vector, check_finite};
use crate::number::Number;
use crate::vector::{cross, dot, subtract};

/// The surface of a mesh: its boundary faces, their vertices and their features.
///
/// Surface vertices are the mesh vertices on the boundary in rising order; faces are in the order of their cells. So the
/// surface depends on the mesh alone, and two meshes with the same cells have the same surface topology.
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
    /// The boundary of a mesh of volume cells of any linear types; a mesh whose highest dimension is 2 is its own surface.
    ///
    /// Only cells of the highest dimension count. A face belongs to the boundary when it belongs to one cell. Cells collapsed
    /// by naming a vertex twice are taken with what is left of their faces. Time and memory are linear in the mesh.
    ///
    /// Edges with more than two faces, as where two blocks touch, are no error here: such a surface can be looked at. It
    /// cannot be edited; see [`Editor::new`](super::Editor::new).
    ///
    /// # Errors
    /// [`SurfaceError::NoFaces`] for a mesh without volume or surface cells, [`SurfaceError::SharedFace`] for a face of more than
    /// two cells, [`SurfaceError::DuplicateCells`], [`SurfaceError::NoBoundary`], [`SurfaceError::SharpAngle`].
    ///
    /// ```
    /// use tombolo_deform::{shapes, surface::{FeatureSettings, Surface}};
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
        let mut used = vec![false; mesh.points().len()];
        for &vertex in mesh_faces.connectivity() {
            used[vertex as usize] = true;
        }
        let vertices: Vec<u32> =
            (0..used.len()).filter(|&vertex| used[vertex]).map(|vertex| vertex as u32).collect();
        let mut local = vec![0u32; used.len()];
        for (number, &vertex) in vertices.iter().enumerate() {
            local[vertex as usize] = number as u32;
        }
        let points: Vec<Vector> =
            vertices.iter().map(|&vertex| mesh.points()[vertex as usize]).collect();
        let mut faces = renumbered(&mesh_faces, &local, |_| false);
        if may_run_either_way(dimension, cells) {
            turn_alike(&points, &mut faces);
        }
        let tags = face_tags(mesh.features(), &mesh_faces);
        Ok(Self::put_together(points, vertices, faces, owner_cells, tags.as_ref(), settings))
    }

    pub(super) fn put_together(
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

    /// A surface from its parts, as those of another surface were sent from elsewhere: edits of it give what edits of that one
    /// give. `vertices` are the mesh vertices of the `points`, rising; `faces` are by surface vertex numbers; `face_features` are
    /// indices into `names`. The mesh is not there, so that each face counts as its own cell.
    ///
    /// # Errors
    /// [`SurfaceError::Parts`] for numbers that are not finite or do not fit together, for cells that are no faces;
    /// [`SurfaceError::NoBoundary`] without any.
    ///
    /// ```
    /// use tombolo_deform::{shapes, surface::{FeatureSettings, Surface}};
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

    /// The same surface, with the same features and triangles, at other places.
    pub(super) fn with_points(&self, points: Vec<Vector>) -> Self {
        Self { points, ..self.clone() }
    }

    /// The same surface with the features that its sharp edges make, whatever the mesh says.
    ///
    /// # Errors
    /// [`SurfaceError::SharpAngle`].
    ///
    /// ```
    /// use tombolo_deform::{shapes, surface::{FeatureSettings, Surface}};
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
    /// use tombolo_deform::{shapes, surface::{FeatureSettings, Surface}};
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
                0.5 * dot(normal, normal).sqrt();
        }
        sizes
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

    /// The faces (triangles, quadrilaterals and polygons) by surface vertex numbers, counter-clockwise seen from outside the
    /// volume. Those of a mesh of dimension 2 run the same way round in each piece of the surface, as most of it was given, and
    /// closed pieces so that they enclose a positive volume; only a piece with one side, as a Moebius strip, is left as it was
    /// given.
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
        // What was a face before is one again.
        let _ = renumbered.push(cell_type, &corners);
    }
    renumbered
}

/// Whether the faces of these cells may run one way or the other round: those of volume cells other than polyhedra are known to
/// run the same way round.
pub(super) fn may_run_either_way(dimension: usize, cells: &Cells) -> bool {
    dimension == 2 || cells.types().contains(&CellType::Polyhedron)
}

/// Turns the faces that run the other way round than those around them.
pub(super) fn turn_alike(points: &[Vector], faces: &mut Cells) {
    let turned = faces_to_turn(points, faces);
    if turned.contains(&true) {
        let same: Vec<u32> = (0..points.len() as u32).collect();
        *faces = renumbered(faces, &same, |face| turned[face]);
    }
}

/// Refuses what makes no surface: `vertices` are the mesh vertices of the `points`, `faces` are by surface vertex numbers.
pub(super) fn check_parts(
    points: &[Vector],
    vertices: &[u32],
    faces: &Cells,
) -> Result<(), SurfaceError> {
    check_finite(points)?;
    if faces.is_empty() {
        return Err(SurfaceError::NoBoundary);
    }
    if vertices.len() != points.len() {
        return Err(MeshError::PointCount { found: points.len(), expected: vertices.len() }.into());
    }
    if let Some(place) = vertices.windows(2).position(|pair| pair[0] >= pair[1]) {
        return Err(SurfaceError::VertexOrder { vertex: place + 1 });
    }
    faces.validate(points.len())?;
    let mut referenced = vec![false; points.len()];
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
        corners.iter().for_each(|&vertex| referenced[vertex as usize] = true);
    }
    match referenced.iter().position(|referenced| !referenced) {
        Some(vertex) => Err(SurfaceError::Unreferenced { vertex }),
        None => Ok(()),
    }
}

fn split_into_triangles(points: &[Vector], faces: &Cells) -> (Vec<[u32; 3]>, Vec<u32>) {
    let mut triangles = Vec::with_capacity(faces.len());
    let mut triangle_faces = Vec::with_capacity(faces.len());
    for (face, (_, vertices)) in faces.iter().enumerate() {
        let count = vertices.len();
        let start = if count == 3 { 0 } else { best_fan(points, vertices) };
        for step in 1..count - 1 {
            triangles.push([
                vertices[start],
                vertices[(start + step) % count],
                vertices[(start + step + 1) % count],
            ]);
            triangle_faces.push(face as u32);
        }
    }
    (triangles, triangle_faces)
}

/// Where a fan of triangles over a polygon should start: where its smallest triangle is largest, so that a polygon that is
/// not convex is still covered rightly wherever a fan can; the lowest vertex number where it makes no difference.
fn best_fan(points: &[Vector], vertices: &[u32]) -> usize {
    let count = vertices.len();
    let point = |place: usize| points[vertices[place % count] as usize];
    let normal = polygon_normal(points, vertices);
    let length = dot(normal, normal);
    let mut best: Option<(f64, u32, usize)> = None;
    for (start, &vertex) in vertices.iter().enumerate() {
        let smallest = (1..count - 1)
            .map(|step| {
                let apex = point(start);
                let area = cross(
                    subtract(point(start + step), apex),
                    subtract(point(start + step + 1), apex),
                );
                dot(area, normal) / length
            })
            .fold(f64::INFINITY, f64::min);
        let better = best.is_none_or(|(value, number, _)| {
            smallest > value + 1e-9 || (smallest > value - 1e-9 && vertex < number)
        });
        if better {
            best = Some((smallest, vertex, start));
        }
    }
    best.map_or(0, |(_, _, start)| start)
}

/// Twice the area of a polygon along its normal (Newell's method).
pub(super) fn polygon_normal(points: &[Vector], vertices: &[u32]) -> Vector {
    let origin = points[vertices[0] as usize];
    let mut normal = [0.0; 3];
    for pair in vertices[1..].windows(2) {
        let [a, b] = [0, 1].map(|end| subtract(points[pair[end] as usize], origin));
        let part = cross(a, b);
        for axis in 0..3 {
            normal[axis] += part[axis];
        }
    }
    normal
}

/// Why a mesh has no surface that can be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// No cell has faces.
    #[error(
        "the mesh has no surface: none of its {cells} cells has dimension 2 or 3, the highest is {dimension}"
    )]
    NoFaces {
        /// How many cells there are.
        cells: usize,
        /// Their highest dimension.
        dimension: usize,
    },
    /// Every face is shared by two cells.
    #[error(
        "the mesh has no boundary: every face with three distinct vertices belongs to two cells"
    )]
    NoBoundary,
    /// More than two cells share a face.
    #[error(
        "cells {cells:?} share the face with vertices {vertices:?}; a face belongs to at most two cells"
    )]
    SharedFace {
        /// The vertices of the face, by mesh vertex numbers.
        vertices: Vec<u32>,
        /// Its cells.
        cells: Vec<u32>,
    },
    /// Two cells have the same vertices.
    #[error("cells {first} and {second} have the same vertices; remove one of them")]
    DuplicateCells {
        /// The first of them.
        first: u32,
        /// The other.
        second: u32,
    },
    /// An edge with more than two triangles.
    #[error(
        "the surface is not a manifold: the edge between the mesh vertices {} and {} belongs to {faces} faces; an edited surface has at most two at an edge",
        edge[0], edge[1]
    )]
    NonManifoldEdge {
        /// Its ends, by mesh vertex numbers.
        edge: [u32; 2],
        /// How many faces meet there.
        faces: usize,
    },
    /// Parts of a surface that do not make one.
    #[error("the parts do not make a surface: {0}")]
    Parts(#[from] MeshError),
    /// Parts of a surface whose vertices do not rise.
    #[error("surface vertex {vertex}: its mesh vertex is not above that of the one before it")]
    VertexOrder {
        /// The surface vertex.
        vertex: usize,
    },
    /// A surface vertex of no face.
    #[error("surface vertex {vertex} belongs to no face")]
    Unreferenced {
        /// The surface vertex.
        vertex: usize,
    },
    /// A vertex whose triangles hang together by nothing but the vertex.
    #[error(
        "the surface is not a manifold: the faces around mesh vertex {vertex} do not hang together by their edges; split the vertex in two, or join the faces"
    )]
    NonManifoldVertex {
        /// The vertex, by mesh vertex number.
        vertex: u32,
    },
    /// A sharp angle that is no angle between faces.
    #[error("sharp_angle_degrees is {}; expected an angle from 0 to 180 degrees", Number(*.0))]
    SharpAngle(f64),
}
