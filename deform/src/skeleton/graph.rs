//! The skeleton as a graph of polylines.

use crate::mesh::Vector;
use crate::topology::{DisjointSets, indices};
use crate::vector::{dot, length, subtract};

/// A curve skeleton: nodes joined into polylines, and the node that carries each vertex of a
/// surface.
///
/// Polylines ([`Curve`]) run between nodes that are no inner node of a curve: ends (degree 1) and
/// branch nodes (degree 3 and more). A loop without a branch node starts and ends in the same node.
/// A component that shrinks to a point is a node of degree 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Skeleton {
    nodes: Vec<Vector>,
    curves: Vec<Curve>,
    node_of_vertex: Vec<u32>,
    degrees: Vec<u32>,
    components: Vec<u32>,
    component_count: usize,
}

/// A polyline of a skeleton.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Curve {
    nodes: Vec<u32>,
}

impl Curve {
    /// The numbers of its nodes from one end to the other: at least 2, at least 4 where it is
    /// closed.
    #[must_use]
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// The numbers of its first and its last node; the same one where the curve is closed.
    #[must_use]
    pub fn ends(&self) -> [u32; 2] {
        [self.nodes[0], self.nodes[self.nodes.len() - 1]]
    }

    /// The nodes between its ends: those that move when it is bent.
    #[must_use]
    pub fn inner(&self) -> &[u32] {
        &self.nodes[1..self.nodes.len() - 1]
    }

    /// Whether it starts and ends in the same node.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.nodes[0] == self.nodes[self.nodes.len() - 1]
    }
}

impl Skeleton {
    /// A skeleton from its parts: `[n]` nodes, polylines of their numbers, and for each of `[v]`
    /// surface vertices the number of the node that carries it. Time and memory are linear in all
    /// three.
    ///
    /// # Errors
    /// [`InvalidSkeleton`], which names the first node, curve or vertex at fault.
    ///
    /// ```
    /// use tombolo_deform::skeleton::Skeleton;
    ///
    /// let nodes = vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    /// let skeleton = Skeleton::new(nodes, vec![vec![0, 1, 2]], vec![0, 0, 1, 2])?;
    /// assert_eq!((skeleton.degree(0), skeleton.degree(1)), (1, 2));
    /// assert_eq!((skeleton.branch_count(), skeleton.end_count(), skeleton.loop_count()), (0, 2, 0));
    /// # Ok::<(), tombolo_deform::skeleton::InvalidSkeleton>(())
    /// ```
    pub fn new(
        nodes: Vec<Vector>,
        curves: Vec<Vec<u32>>,
        node_of_vertex: Vec<u32>,
    ) -> Result<Self, InvalidSkeleton> {
        if nodes.is_empty() {
            return Err(InvalidSkeleton::NoNodes);
        }
        if let Some(node) =
            nodes.iter().position(|node| !node.iter().all(|value| value.is_finite()))
        {
            return Err(InvalidSkeleton::NotFinite { node });
        }
        if let Some(vertex) = node_of_vertex.iter().position(|&node| node as usize >= nodes.len()) {
            return Err(InvalidSkeleton::NoSuchCarrier {
                vertex,
                node: node_of_vertex[vertex],
                nodes: nodes.len(),
            });
        }
        let mut degrees = vec![0u32; nodes.len()];
        let mut inner = vec![false; nodes.len()];
        for (curve, polyline) in curves.iter().enumerate() {
            let (Some(&first), Some(&last)) = (polyline.first(), polyline.last()) else {
                return Err(InvalidSkeleton::ShortCurve { curve, nodes: 0 });
            };
            if polyline.len() < if first == last { 4 } else { 2 } {
                return Err(InvalidSkeleton::ShortCurve { curve, nodes: polyline.len() });
            }
            if let Some(&node) = polyline.iter().find(|&&node| node as usize >= nodes.len()) {
                return Err(InvalidSkeleton::NoSuchNode { curve, node, nodes: nodes.len() });
            }
            for pair in polyline.windows(2) {
                degrees[pair[0] as usize] += 1;
                degrees[pair[1] as usize] += 1;
            }
            for &node in &polyline[1..polyline.len() - 1] {
                if std::mem::replace(&mut inner[node as usize], true) {
                    return Err(InvalidSkeleton::Crossing { curve, node });
                }
            }
        }
        for (curve, polyline) in curves.iter().enumerate() {
            if let Some(&node) =
                polyline[1..polyline.len() - 1].iter().find(|&&node| degrees[node as usize] != 2)
            {
                return Err(InvalidSkeleton::Crossing { curve, node });
            }
            let ends = [polyline[0], polyline[polyline.len() - 1]];
            if ends[0] != ends[1]
                && let Some(&node) = ends.iter().find(|&&end| degrees[end as usize] == 2)
            {
                return Err(InvalidSkeleton::Unjoined { curve, node });
            }
        }
        let (components, component_count) = components(nodes.len(), &curves);
        let curves = curves.into_iter().map(|nodes| Curve { nodes }).collect();
        Ok(Self { nodes, curves, node_of_vertex, degrees, components, component_count })
    }

    /// Where the nodes lie.
    #[must_use]
    pub fn nodes(&self) -> &[Vector] {
        &self.nodes
    }

    /// The polylines that join the nodes.
    #[must_use]
    pub fn curves(&self) -> &[Curve] {
        &self.curves
    }

    /// For each surface vertex the number of the node that carries it.
    #[must_use]
    pub fn node_of_vertex(&self) -> &[u32] {
        &self.node_of_vertex
    }

    /// How many segments meet in a node: 1 at an end, 2 along a curve, more at a branch node; 0 for
    /// a number that is no node's.
    #[must_use]
    pub fn degree(&self, node: usize) -> usize {
        self.degrees.get(node).map_or(0, |&degree| degree as usize)
    }

    /// For each node the number of the connected piece it belongs to, counted from 0 in the order
    /// of their lowest nodes.
    #[must_use]
    pub fn components(&self) -> &[u32] {
        &self.components
    }

    /// How many connected pieces there are.
    #[must_use]
    pub fn component_count(&self) -> usize {
        self.component_count
    }

    /// How many nodes are branch nodes, where three or more segments meet.
    #[must_use]
    pub fn branch_count(&self) -> usize {
        self.degrees.iter().filter(|&&degree| degree > 2).count()
    }

    /// How many nodes are the end of one curve alone.
    #[must_use]
    pub fn end_count(&self) -> usize {
        self.degrees.iter().filter(|&&degree| degree == 1).count()
    }

    /// How many independent loops the graph has; that of a closed surface of one piece has as many
    /// as the surface has handles.
    #[must_use]
    pub fn loop_count(&self) -> usize {
        let segments: usize = self.curves.iter().map(|curve| curve.nodes.len() - 1).sum();
        segments + self.component_count - self.nodes.len()
    }

    /// The node nearest to a point; that of the lowest number where several are.
    #[must_use]
    pub fn nearest_node(&self, point: Vector) -> usize {
        let mut nearest = (f64::INFINITY, 0);
        for (number, &node) in self.nodes.iter().enumerate() {
            let away = subtract(node, point);
            let distance = dot(away, away);
            if distance < nearest.0 {
                nearest = (distance, number);
            }
        }
        nearest.1
    }

    /// The radius of the surface about each node: the mean distance to it of the vertices it
    /// carries, where `points` are those of the surface (`[v]`, as many as
    /// [`Skeleton::node_of_vertex`] has). A node that carries none has that of the nearest node
    /// along the graph that carries some, and 0 where there is none.
    #[must_use]
    pub fn radii(&self, points: &[Vector]) -> Vec<f64> {
        let mut sums = vec![(0.0f64, 0u32); self.nodes.len()];
        for (&point, &node) in points.iter().zip(&self.node_of_vertex) {
            let away = subtract(point, self.nodes[node as usize]);
            let (sum, count) = &mut sums[node as usize];
            *sum += length(away);
            *count += 1;
        }
        let mut radii: Vec<Option<f64>> =
            sums.iter().map(|&(sum, count)| (count > 0).then(|| sum / f64::from(count))).collect();
        let mut neighbours = vec![Vec::new(); self.nodes.len()];
        for pair in self.curves.iter().flat_map(|curve| curve.nodes.windows(2)) {
            neighbours[pair[0] as usize].push(pair[1]);
            neighbours[pair[1] as usize].push(pair[0]);
        }
        let mut queue: Vec<usize> =
            (0..radii.len()).filter(|&node| radii[node].is_some()).collect();
        let mut next = 0;
        while let Some(&node) = queue.get(next) {
            next += 1;
            for &other in &neighbours[node] {
                if radii[other as usize].is_none() {
                    radii[other as usize] = radii[node];
                    queue.push(other as usize);
                }
            }
        }
        radii.into_iter().map(|radius| radius.unwrap_or(0.0)).collect()
    }
}

/// The connected piece of each node, and how many there are.
fn components(nodes: usize, curves: &[Vec<u32>]) -> (Vec<u32>, usize) {
    let roots = DisjointSets::components(nodes, curves.iter().map(Vec::as_slice));
    let is_root = |node: &u32| roots[*node as usize] == *node;
    let lowest: Vec<u32> = (0..nodes as u32).filter(is_root).collect();
    let numbers = indices(nodes, &lowest);
    (roots.iter().map(|&root| numbers[root as usize]).collect(), lowest.len())
}

/// Why nodes and polylines are not a skeleton.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum InvalidSkeleton {
    /// There is no node.
    #[error("a skeleton needs at least one node")]
    NoNodes,
    /// A coordinate is NaN or infinite.
    #[error("node {node} of the skeleton has a coordinate that is not finite")]
    NotFinite {
        /// The node.
        node: usize,
    },
    /// A curve has too few nodes.
    #[error(
        "curve {curve} has {nodes} nodes: expected at least 2, or 4 where it starts and ends in the same node"
    )]
    ShortCurve {
        /// The curve.
        curve: usize,
        /// How many nodes it has.
        nodes: usize,
    },
    /// A curve names a node that is not there.
    #[error("curve {curve} names node {node}, but there are {nodes} nodes, counted from 0")]
    NoSuchNode {
        /// The curve.
        curve: usize,
        /// The number it names.
        node: u32,
        /// How many nodes there are.
        nodes: usize,
    },
    /// A surface vertex is carried by a node that is not there.
    #[error(
        "surface vertex {vertex} is carried by node {node}, but there are {nodes} nodes, counted from 0"
    )]
    NoSuchCarrier {
        /// The surface vertex.
        vertex: usize,
        /// The number it names.
        node: u32,
        /// How many nodes there are.
        nodes: usize,
    },
    /// A node between the ends of a curve is met again.
    #[error(
        "node {node} lies between the ends of curve {curve} and is met a second time: a curve must end where others begin"
    )]
    Crossing {
        /// The curve.
        curve: usize,
        /// The node.
        node: u32,
    },
    /// Two curves meet in a node where no other does.
    #[error(
        "curve {curve} ends in node {node}, where only one other begins: the two are one curve"
    )]
    Unjoined {
        /// The curve.
        curve: usize,
        /// The node.
        node: u32,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(count: usize) -> Vec<Vector> {
        (0..count).map(|number| [number as f64, 0.0, 0.0]).collect()
    }

    #[test]
    fn a_lollipop_has_one_end_one_branch_and_one_loop() {
        let skeleton =
            Skeleton::new(line(5), vec![vec![0, 1], vec![1, 2, 3, 4, 1]], vec![4; 7]).unwrap();
        assert_eq!(
            (skeleton.end_count(), skeleton.branch_count(), skeleton.loop_count()),
            (1, 1, 1)
        );
        assert_eq!(skeleton.component_count(), 1);
        assert_eq!(skeleton.degree(1), 3);
        assert!(skeleton.curves()[1].is_closed() && !skeleton.curves()[0].is_closed());
    }

    #[test]
    fn pieces_are_numbered_by_their_lowest_nodes() {
        let skeleton = Skeleton::new(line(6), vec![vec![5, 1], vec![2, 4, 3, 2]], vec![]).unwrap();
        assert_eq!(skeleton.components(), [0, 1, 2, 2, 2, 1]);
        assert_eq!((skeleton.component_count(), skeleton.loop_count()), (3, 1));
    }

    #[test]
    fn what_is_no_skeleton_is_named() {
        let fails = |nodes, curves, carriers| Skeleton::new(nodes, curves, carriers).unwrap_err();
        assert_eq!(fails(vec![], vec![], vec![]), InvalidSkeleton::NoNodes);
        assert_eq!(
            fails(vec![[0.0, f64::NAN, 0.0]], vec![], vec![]),
            InvalidSkeleton::NotFinite { node: 0 }
        );
        assert_eq!(
            fails(line(2), vec![vec![]], vec![]),
            InvalidSkeleton::ShortCurve { curve: 0, nodes: 0 }
        );
        assert_eq!(
            fails(line(2), vec![vec![0, 1, 0]], vec![]),
            InvalidSkeleton::ShortCurve { curve: 0, nodes: 3 }
        );
        assert_eq!(
            fails(line(2), vec![vec![0, 2]], vec![]),
            InvalidSkeleton::NoSuchNode { curve: 0, node: 2, nodes: 2 }
        );
        assert_eq!(
            fails(line(2), vec![], vec![0, 9]),
            InvalidSkeleton::NoSuchCarrier { vertex: 1, node: 9, nodes: 2 }
        );
        let crossing = fails(line(4), vec![vec![0, 1, 2], vec![1, 3]], vec![]);
        assert_eq!(crossing, InvalidSkeleton::Crossing { curve: 0, node: 1 });
        assert_eq!(
            fails(line(3), vec![vec![0, 1], vec![1, 2]], vec![]),
            InvalidSkeleton::Unjoined { curve: 0, node: 1 }
        );
    }

    #[test]
    fn a_node_without_vertices_has_the_radius_of_the_next() {
        let skeleton = Skeleton::new(line(3), vec![vec![0, 1, 2]], vec![0, 0, 0]).unwrap();
        let radii = skeleton.radii(&[[0.0, 2.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, 5.0]]);
        assert_eq!(radii, [3.0; 3]);
        assert_eq!(skeleton.nearest_node([1.6, 4.0, 0.0]), 2);
    }
}
