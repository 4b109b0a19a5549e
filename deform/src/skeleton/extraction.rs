//! The extraction of a skeleton from a surface.

use super::closing::closed_pieces;
use super::medial::NearestPoints;
use super::pruning::Curves;
use super::{Skeleton, SkeletonError, SkeletonSettings, flow, resolution, thinning};
use crate::cancellation::Cancellation;
use crate::surface::Surface;

impl Skeleton {
    /// The curve skeleton of a surface, by mean curvature flow (Tagliasacchi, Alhashim, Olson and
    /// Zhang 2012).
    ///
    /// Each connected piece gets a skeleton of its own, inside out or not. Holes are closed for the
    /// time being, so that an open tube has its axis; open edges that lie on each other to the last
    /// bit are joined. A piece as long as wide, as a ball, has one node: the centroid of its
    /// surface.
    ///
    /// # Errors
    /// [`SkeletonError`], which names the vertices at fault: edges of more than two faces, surfaces
    /// of one side, flat pieces.
    ///
    /// ```
    /// use tombolo_deform::{shapes, skeleton::{Skeleton, SkeletonSettings}, features::FeatureSettings, surface::Surface};
    ///
    /// let torus = shapes::torus(1.0, 0.3, [60, 24]);
    /// let surface = Surface::extract(&torus, &FeatureSettings::default())?;
    /// let skeleton = Skeleton::extract(&surface, &SkeletonSettings::default())?;
    /// assert_eq!((skeleton.loop_count(), skeleton.branch_count(), skeleton.end_count()), (1, 0, 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn extract(surface: &Surface, settings: &SkeletonSettings) -> Result<Self, SkeletonError> {
        Self::extract_unless(surface, settings, &Cancellation::default())
    }

    /// The curve skeleton of a surface, unless it is given up meanwhile: that is looked at before
    /// each step of the flow.
    ///
    /// # Errors
    /// As [`Skeleton::extract`], and [`SkeletonError::Cancelled`].
    pub fn extract_unless(
        surface: &Surface,
        settings: &SkeletonSettings,
        cancellation: &Cancellation,
    ) -> Result<Self, SkeletonError> {
        settings.validate()?;
        let go_on = || {
            if cancellation.is_cancelled() { Err(SkeletonError::Cancelled) } else { Ok(()) }
        };
        let mut nodes = Vec::new();
        let mut curves = Vec::new();
        let mut node_of_vertex = vec![0u32; surface.points().len()];
        for mut piece in closed_pieces(surface)? {
            go_on()?;
            resolution::resample(&mut piece.mesh, settings.least_vertices, settings.most_vertices);
            let (mut mesh, into) = piece.mesh.scattered();
            piece.vertices.iter_mut().for_each(|(_, vertex)| *vertex = into[*vertex as usize]);
            let centroid = mesh.centroid();
            let tree = NearestPoints::of(&mesh);
            flow::contract(&mut mesh, &tree, settings, go_on)?;
            let mut found = Curves::new(thinning::thin(&mesh), &piece.vertices, &tree, settings);
            // A piece without a middle line is drawn together to a point that hangs on the last
            // bit.
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
