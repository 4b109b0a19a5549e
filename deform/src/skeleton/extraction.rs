//! The extraction of a skeleton from a surface.

use super::closing::closed_pieces;
use super::curves::Curves;
use super::medial::NearestPoints;
use super::{InvalidSkeleton, Skeleton, flow, resolution, thinning};
use crate::number::Number;
use crate::surface::Surface;

/// How a skeleton is extracted. Lengths are parts of the diagonal of the bounding box of each connected piece.
///
/// The defaults are those of CGAL 5.5.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkeletonSettings {
    /// How strongly a vertex keeps its place in one step of the flow: the lower, the larger the step.
    pub keep: f64,
    /// How strongly a vertex is drawn to the middle of the surface: to its pole, while that lies inside.
    pub centre: f64,
    /// Edges shorter than this are collapsed on the way.
    pub shortest_edge: f64,
    /// The flow ends when one step changes the area by less than this part of the first.
    pub area_change: f64,
    /// The flow ends after this many steps.
    pub iterations: usize,
    /// Pieces of fewer vertices are refined to about so many.
    pub least_vertices: usize,
    /// Pieces of more vertices are coarsened to about so many.
    pub most_vertices: usize,
    /// Branches shorter than this many times the largest radius along them are taken for noise and cut off.
    pub shortest_branch: f64,
}

impl Default for SkeletonSettings {
    fn default() -> Self {
        Self {
            keep: 0.1,
            centre: 0.2,
            shortest_edge: 0.002,
            area_change: 1e-4,
            iterations: 500,
            least_vertices: 3500,
            most_vertices: 8000,
            shortest_branch: 1.75,
        }
    }
}

impl SkeletonSettings {
    fn validate(&self) -> Result<(), SkeletonError> {
        for (name, value) in [
            ("keep", self.keep),
            ("centre", self.centre),
            ("shortest_edge", self.shortest_edge),
            ("area_change", self.area_change),
            ("shortest_branch", self.shortest_branch),
        ] {
            if !(value.is_finite() && value >= 0.0) || (name == "keep" && value == 0.0) {
                return Err(SkeletonError::Setting { name, value });
            }
        }
        Ok(())
    }
}

/// Why a surface has no skeleton.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SkeletonError {
    /// The surface has no triangle with three different vertices.
    #[error("the surface has no triangles")]
    NoTriangles,
    /// More than two faces meet in an edge, so that inside and outside cannot be told apart.
    #[error(
        "{faces} faces meet in the edge between vertices {} and {}: expected 1 or 2; a skeleton needs a surface with an inside",
        edge[0], edge[1]
    )]
    NonManifoldEdge {
        /// The mesh vertices at its ends.
        edge: [u32; 2],
        /// How many faces meet there.
        faces: usize,
    },
    /// The surface has one side only, as a Möbius strip.
    #[error("the surface has one side only: it comes back turned over at the edge between vertices {} and {}", edge[0], edge[1])]
    OneSided {
        /// The mesh vertices at the ends of the edge where it shows.
        edge: [u32; 2],
    },
    /// A connected piece of the surface encloses no volume, even with its holes closed.
    #[error(
        "the piece of the surface at vertex {vertex} ({triangles} triangles) is flat: it encloses no volume, so that it has no \
         middle line"
    )]
    Flat {
        /// A mesh vertex of the piece.
        vertex: u32,
        /// How many triangles the piece has.
        triangles: usize,
    },
    /// A setting is out of range.
    #[error(
        "the skeleton's setting {name} is {}: expected a finite number that is not negative, and `keep` above 0",
        Number(*value)
    )]
    Setting {
        /// Its name.
        name: &'static str,
        /// What was given.
        value: f64,
    },
    /// What came out is no skeleton: a defect of this library.
    #[error("the extraction ended in what is no skeleton: {0}")]
    Invalid(#[from] InvalidSkeleton),
}

impl Skeleton {
    /// The curve skeleton of a surface, by mean curvature flow (Tagliasacchi, Alhashim, Olson and Zhang 2012).
    ///
    /// Each connected piece gets a skeleton of its own, inside out or not. Holes are closed for the time being, so that an open
    /// tube has its axis; open edges that lie on each other to the last bit are joined. A piece as long as wide, as a ball, has one
    /// node: the centroid of its surface.
    ///
    /// # Errors
    /// [`SkeletonError`], which names the place: edges of more than two faces, surfaces of one side, flat pieces.
    ///
    /// ```
    /// use tombolo_deform::{shapes, skeleton::{Skeleton, SkeletonSettings}, surface::{FeatureSettings, Surface}};
    ///
    /// let torus = shapes::torus(1.0, 0.3, [60, 24]);
    /// let surface = Surface::extract(&torus, &FeatureSettings::default())?;
    /// let skeleton = Skeleton::extract(&surface, &SkeletonSettings::default())?;
    /// assert_eq!((skeleton.loop_count(), skeleton.branch_count(), skeleton.end_count()), (1, 0, 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn extract(surface: &Surface, settings: &SkeletonSettings) -> Result<Self, SkeletonError> {
        settings.validate()?;
        let mut nodes = Vec::new();
        let mut curves = Vec::new();
        let mut node_of_vertex = vec![0u32; surface.points().len()];
        for mut piece in closed_pieces(surface)? {
            resolution::resample(&mut piece.mesh, settings.least_vertices, settings.most_vertices);
            let (mut mesh, into) = piece.mesh.scattered();
            piece.vertices.iter_mut().for_each(|(_, vertex)| *vertex = into[*vertex as usize]);
            let centroid = mesh.centroid();
            let tree = NearestPoints::of(&mesh);
            flow::contract(&mut mesh, &tree, settings);
            let mut found = Curves::new(thinning::thin(&mesh), &piece.vertices, &tree, settings);
            // What has no middle line is drawn together to a place that hangs on the last bit.
            if let [only] = &mut found.nodes[..] {
                *only = centroid;
            }
            let offset = nodes.len() as u32;
            for (&(vertex, _), node) in piece.vertices.iter().zip(&found.node_of_original) {
                node_of_vertex[vertex as usize] = node + offset;
            }
            nodes.extend(found.nodes.iter().map(|&node| piece.frame.leave(node)));
            curves.extend(
                found
                    .polylines
                    .into_iter()
                    .map(|polyline| polyline.iter().map(|node| node + offset).collect()),
            );
        }
        Ok(Self::new(nodes, curves, node_of_vertex)?)
    }
}
