//! Polyharmonic equations on a surface.
//!
//! They say how the free surface follows a handle. The displacement `d` of the free vertices solves
//! `Δ^k d = 0` on the reference surface (Botsch and Kobbelt 2004; Jacobson, Tosun, Sorkine and
//! Zorin 2010) for the [`HarmonicOrder`] `k`: `(L M^-1)^(k-1) L d = 0` with the cotangent Laplacian
//! `L` on the intrinsic Delaunay triangulation and the lumped Voronoi mass `M`. It is linear in the
//! motion of the handle, and does not look at the axes: what moves along z only, moves everything
//! along z only.
//!
//! How smoothly it meets a handle or a fixed feature:
//!
//! | order | meets them with | carried by |
//! |---|---|---|
//! | 1 | the same position, and a kink | the outermost ring of prescribed vertices |
//! | 2 | the same slope | the two outermost rings: a feature one face wide has them |
//! | 3 | the same curvature | the three outermost rings |
//!
//! The conditions hold half a face (order 2) or one face (order 3) inside the prescribed part, so
//! that the shape converges at first order as the mesh is refined. A part with fewer rings leaves
//! the derivatives that it cannot prescribe free. An open rim is a mirror: where nothing is
//! prescribed no slope runs across it, and a part that ends at a rim counts its rings twice but for
//! the rim itself, so that one ring clamps the slope for order 2 and two rings the curvature for
//! order 3.

mod double_double;
mod intrinsic;
mod laplacian;
mod order;
mod polyharmonic;

pub(crate) use laplacian::Laplacian;
pub use order::HarmonicOrder;
pub(crate) use polyharmonic::{NotFactored, Polyharmonic};
