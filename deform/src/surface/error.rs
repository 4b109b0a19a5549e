//! Why a mesh has no usable surface.

use crate::features::InvalidSharpAngle;
use crate::mesh::MeshError;

/// Why a mesh has no usable surface.
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
    /// The sharp angle is not an angle between faces.
    #[error(transparent)]
    SharpAngle(#[from] InvalidSharpAngle),
}
