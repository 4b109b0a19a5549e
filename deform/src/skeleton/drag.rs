//! Dragging the nodes of a skeleton.

use super::Skeleton;
use super::curve_deformation::{CurveDeformation, CurveError};
use crate::mesh::Vector;
use crate::vector::{Position, dot, subtract};

/// A skeleton made ready for dragging some of its nodes: only the curves that they lie on move.
///
/// Ends and branch nodes are pinned, whatever is dragged, so that each curve bends by itself
/// ([`CurveDeformation`]).
///
/// ```
/// use tombolo_deform::skeleton::{Skeleton, SkeletonDrag};
///
/// // A branch node 4 where three legs meet.
/// let mut nodes: Vec<_> = (0..=8).map(|i| [f64::from(i), 0.0, 0.0]).collect();
/// nodes.extend([[4.0, 1.0, 0.0], [4.0, 2.0, 0.0]]);
/// let skeleton = Skeleton::new(nodes, vec![vec![0, 1, 2, 3, 4], vec![4, 5, 6, 7, 8], vec![4, 9, 10]], vec![])?;
/// let drag = SkeletonDrag::new(&skeleton, &[6])?;
/// let moved = drag.displacement(&[[0.0, 0.0, 1.0]]);
/// assert_eq!(moved[6], [0.0, 0.0, 1.0]);
/// assert!((0..=4).chain(8..=10).all(|node| moved[node] == [0.0; 3]));
///
/// assert!(SkeletonDrag::new(&skeleton, &[4]).unwrap_err().to_string().contains("three curves or more meet"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SkeletonDrag {
    nodes: usize,
    curves: Vec<DraggedCurve>,
}

#[derive(Debug, Clone, PartialEq)]
struct DraggedCurve {
    curve: usize,
    nodes: Vec<u32>,
    /// Which of the drags are on this curve.
    drags: Vec<usize>,
    deformation: CurveDeformation,
}

impl SkeletonDrag {
    /// Makes a skeleton ready for dragging these nodes, each by its own way.
    ///
    /// # Errors
    /// [`DragError`].
    pub fn new(skeleton: &Skeleton, dragged: &[usize]) -> Result<Self, DragError> {
        let owners = curve_of_inner_node(skeleton);
        let mut by_curve: Vec<(usize, Vec<usize>)> = Vec::new();
        for (index, &node) in dragged.iter().enumerate() {
            if dragged[..index].contains(&node) {
                return Err(DragError::Twice { node });
            }
            let Some(curve) = owners.get(node).copied().flatten() else {
                return Err(DragError::pinned(skeleton, &owners, node));
            };
            match by_curve.iter_mut().find(|(known, _)| *known == curve) {
                Some((_, drags)) => drags.push(index),
                None => by_curve.push((curve, vec![index])),
            }
        }
        by_curve.sort_unstable();
        let curves = by_curve
            .into_iter()
            .map(|(curve, drags)| {
                let closed = is_free_loop(skeleton, curve);
                let mut nodes = skeleton.curves()[curve].nodes().to_vec();
                if closed {
                    nodes.pop();
                }
                let points: Vec<Vector> =
                    nodes.iter().map(|&node| skeleton.nodes()[node as usize]).collect();
                let inner =
                    |&index: &usize| nodes.iter().position(|&node| node as usize == dragged[index]);
                let wanted: Vec<usize> = drags.iter().filter_map(inner).collect();
                let deformation = CurveDeformation::new(&points, closed, &wanted)
                    .map_err(|source| DragError::Curve { curve, source })?;
                Ok(DraggedCurve { curve, nodes, drags, deformation })
            })
            .collect::<Result<_, DragError>>()?;
        Ok(Self { nodes: skeleton.nodes().len(), curves })
    }

    /// The numbers of the curves that move, rising.
    pub fn curves(&self) -> impl Iterator<Item = usize> {
        self.curves.iter().map(|dragged| dragged.curve)
    }

    /// The displacement of each node of the skeleton where the dragged ones move by `by`, in the
    /// order in which they were named.
    #[must_use]
    pub fn displacement(&self, by: &[Vector]) -> Vec<Vector> {
        let mut displacement = vec![[0.0; 3]; self.nodes];
        for dragged in &self.curves {
            let own: Vec<Vector> = dragged
                .drags
                .iter()
                .map(|&index| by.get(index).copied().unwrap_or_default())
                .collect();
            // A node where a curve comes back to its own branch node is met twice, both times
            // unmoved.
            for (&node, moved) in dragged.nodes.iter().zip(dragged.deformation.displacement(&own)) {
                displacement[node as usize] = moved;
            }
        }
        displacement
    }
}

/// Whether a curve is a loop without a branch node, of which no node is pinned.
pub(super) fn is_free_loop(skeleton: &Skeleton, curve: usize) -> bool {
    let curve = &skeleton.curves()[curve];
    curve.is_closed() && skeleton.degree(curve.ends()[0] as usize) == 2
}

/// For each node that can be dragged the curve it lies on.
pub(super) fn curve_of_inner_node(skeleton: &Skeleton) -> Vec<Option<usize>> {
    let mut owners = vec![None; skeleton.nodes().len()];
    for (number, curve) in skeleton.curves().iter().enumerate() {
        let nodes = if is_free_loop(skeleton, number) { curve.nodes() } else { curve.inner() };
        for &node in nodes {
            owners[node as usize] = Some(number);
        }
    }
    owners
}

/// Why nodes of a skeleton cannot be dragged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DragError {
    /// An end or a branch node, or a number that is no node's.
    #[error(
        "node {node} of the skeleton {} and is pinned; {}",
        match degree { 0 => "is on no curve", 1 | 2 => "is the end of a curve", _ => "is where three curves or more meet" },
        match nearest {
            Some((node, at)) => format!("the nearest node that can be dragged is node {node} at {}", Position(*at)),
            None => "this skeleton has no node that can be dragged".to_string(),
        }
    )]
    Pinned {
        /// The node.
        node: usize,
        /// How many segments meet in it.
        degree: usize,
        /// The nearest node that can be dragged, and where it lies.
        nearest: Option<(usize, Vector)>,
    },
    /// Two drags of one node.
    #[error("node {node} of the skeleton is dragged twice")]
    Twice {
        /// The node.
        node: usize,
    },
    /// The curve cannot be bent.
    #[error("curve {curve} of the skeleton: {source}")]
    Curve {
        /// The curve.
        curve: usize,
        /// The error.
        source: CurveError,
    },
}

impl DragError {
    fn pinned(skeleton: &Skeleton, owners: &[Option<usize>], node: usize) -> Self {
        let distance = |other: usize| {
            let from = skeleton.nodes().get(node).copied().unwrap_or_default();
            let away = subtract(skeleton.nodes()[other], from);
            dot(away, away)
        };
        let nearest = (0..owners.len())
            .filter(|&other| owners[other].is_some())
            .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
            .map(|other| (other, skeleton.nodes()[other]));
        Self::Pinned { node, degree: skeleton.degree(node), nearest }
    }
}

#[cfg(test)]
#[path = "drag_tests.rs"]
mod tests;
