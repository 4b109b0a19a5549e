//! Surfaces: extraction from a mesh, features, and the edits that reshape them.
//!
//! # From a mesh to its surface
//! [`Surface::extract`] finds the faces that belong to one cell only, for any mix of linear cells. Surface vertices keep the
//! number of the mesh vertex they are; faces keep the cell they belong to.
//!
//! ```
//! use tombolo_deform::{shapes, surface::{FeatureSettings, Surface}};
//!
//! let mesh = shapes::box_of_tets([6, 2, 2], [0.0; 3], [3.0, 1.0, 1.0]);
//! let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
//! let first = surface.vertices()[0] as usize;
//! assert_eq!(surface.points()[0], mesh.points()[first]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Features
//! Every face belongs to one of the [`Features`], the parts that edits name. They come from the mesh
//! ([`FeatureSource`](crate::mesh::FeatureSource)): from tagged faces, from a number at each vertex, or, where it knows
//! nothing, from sharp edges, at the angle of [`FeatureSettings`].
//!
//! ```
//! # use tombolo_deform::{shapes, surface::{FeatureSettings, Surface}};
//! # let mesh = shapes::box_of_tets([6, 2, 2], [0.0; 3], [3.0, 1.0, 1.0]);
//! # let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
//! let inlet = surface.features().index("x-min")?;
//! assert_eq!(surface.features().vertices(inlet).len(), 9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Edits
//! An [`Edit`] moves a handle (some features) by an affine motion, holds other features fixed, and lets the rest of the surface
//! follow. An [`Editor`] turns a stack of edits into one displacement for each surface vertex, from the reference.
//!
//! ```
//! # use std::sync::Arc;
//! # use tombolo_deform::{shapes, surface::{FeatureSettings, Surface}};
//! use tombolo_deform::surface::{Edit, Editor};
//! # let mesh = shapes::box_of_tets([6, 2, 2], [0.0; 3], [3.0, 1.0, 1.0]);
//! # let surface = Surface::extract(&mesh, &FeatureSettings::default())?;
//!
//! let stack: Vec<Edit> = serde_json::from_str(r#"[
//!     { "scale_direction": { "features": ["x-max"], "fixed": ["x-min"], "factors": [1, 2, 2] } },
//!     { "translate": { "features": ["x-max"], "fixed": ["x-min"], "by": [0, 0, 0.5], "harmonic_order": 3 } }
//! ]"#)?;
//! let mut editor = Editor::new(Arc::new(surface))?;
//! let displacement = editor.displacement(&stack)?;
//! let corner = editor.surface().points().iter().position(|point| *point == [3.0, 1.0, 1.0]).unwrap();
//! assert_eq!(displacement[corner], [0.0, 0.5, 0.5 + 0.5]);
//!
//! assert!(editor.displacement(&[])?.iter().all(|moved| *moved == [0.0; 3]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # How the free surface follows
//! The displacement `d` of the free vertices solves the polyharmonic equation `Δ^k d = 0` on the reference surface (Botsch and
//! Kobbelt 2004; Jacobson, Tosun, Sorkine and Zorin 2010) for the [`HarmonicOrder`] `k`: `(L M^-1)^(k-1) L d = 0` with the
//! cotangent Laplacian `L` on the intrinsic Delaunay triangulation and the lumped Voronoi mass `M`. It is linear in the motion
//! of the handle, and does not look at the axes: what moves along z only, moves everything along z only.
//!
//! How smoothly it meets a handle or a fixed feature:
//!
//! | order | meets them with | carried by |
//! |---|---|---|
//! | 1 | the same place, and a kink | the outermost ring of prescribed vertices |
//! | 2 | the same slope | the two outermost rings: a feature one face wide has them |
//! | 3 | the same curvature | the three outermost rings |
//!
//! The conditions hold half a face (order 2) or one face (order 3) inside the prescribed part, so that the shape converges at
//! first order as the mesh is refined. A part with fewer rings leaves the derivatives that it cannot prescribe free. An open rim
//! is a mirror: where nothing is prescribed no slope runs across it, and a part that ends at a rim counts its rings twice but
//! for the rim itself, so that one ring clamps the slope for order 2 and two rings the curvature for order 3.
//!
//! # What is guaranteed
//! - The same mesh, settings and stack give the same bits, whatever was evaluated before. Renumbering the vertices changes
//!   results by rounding alone.
//! - Prescribed vertices move exactly as stated, fixed ones by exact zeros, and an empty stack is exact zeros everywhere.
//! - No input makes it panic: what cannot be answered is a [`SurfaceError`] or an [`EditError`] that names the cell, the vertex,
//!   the feature or the number at fault.
//!
//! # What is not
//! A displacement says nothing about whether the shape it leads to can be meshed: [`check`](fn@check) finds folds and
//! self-intersections of the surface, [`crate::quality`] inversions of the volume. Surfaces that are no manifold can be extracted and
//! looked at, but not edited.

mod adjacency;
mod advance;
mod amount;
mod bounds;
mod check;
mod dissection;
mod double_double;
mod edit;
mod edit_error;
mod edit_validate;
mod editor;
mod extraction;
mod faces;
mod factor;
mod features;
mod front;
mod handle;
mod inside_out;
mod kept_layers;
mod laplacian;
mod layers;
mod motion;
mod orientation;
mod part;
mod polyharmonic;
mod region;
mod sharp_edges;
mod tagged;
mod tetra_faces;
mod triangle_pair;

pub use advance::Advance;
pub use check::{
    BrokenSurface, FlawedFace, FlawedFaces, Intersection, Intersections, SurfaceReport, check,
    require_sound, sound_fraction,
};
pub use edit::{
    Affine, Displacement, Edit, HarmonicOrder, Rotate, ScaleDirection, ScaleNormals, Skeleton,
    SkeletonMove, Skinning, Translate,
};
pub use edit_error::{EditError, InvalidEdit, Surroundings};
pub use editor::Editor;
pub use extraction::{Surface, SurfaceError};
pub use features::{FeatureSettings, FeatureSize, Features, UnknownFeature};
pub use layers::Layer;
pub use part::{BoundaryFaces, FaceTags, face_tags};
pub use region::{BoxRegion, HalfSpaceRegion, Region, RegionError, SphereRegion};
pub use tagged::{MisplacedFaces, check_feature_names, misplaced_faces};
