//! Curve deformation: how a curve of a skeleton bends when some of its nodes are dragged.

use super::Skeleton;
use crate::mesh::Vector;
use crate::number::Position;
use crate::vector::{dot, scale, subtract};

/// A polyline made ready for dragging some of its nodes, as if it were a metal wire.
///
/// # What it solves
/// The displacement `d` of the nodes solves the biharmonic equation of Wetterer-Nelson, Jansen and Evans (section "Skeleton
/// Interactivity"), `Lc Mc^-1 Lc d = 0`, with the central differences of the inner nodes,
///
/// ```text
/// (Lc d)_i = (d_(i+1) - d_i) / h_i - (d_i - d_(i-1)) / h_(i-1),    Mc_ii = (h_i + h_(i-1)) / 2,
/// ```
///
/// `h_i` the length of the segment from node `i` to the next. The ends are boundary nodes: they have no difference (their rows of
/// `Lc` are zero) and their rows of the equation are replaced by `d = 0`, those of dragged nodes by `d = by`. So a pinned end may
/// turn but not move, as one on a hinge, and the curve passes through the dragged nodes without a kink: `d` is the discrete natural
/// cubic spline of the drags over arc length.
///
/// In a closed polyline every node is an inner one, and nothing but the drags holds it: dragging one node carries all of it along,
/// and a node is held in place by dragging it by zero.
///
/// # How
/// The equation says that the bending moment `m = Mc^-1 Lc d` is linear in arc length between the ends and the dragged nodes.
/// So one small positive definite system of as many unknowns as there are dragged nodes is factored, and two sums along the
/// curve give what each drag does to each node. After that a drag is a multiply-add.
///
/// # What it guarantees
/// Pinned ends move by exact zeros and dragged nodes as stated; dragging by zero moves nothing; the result is linear in the drags,
/// and as accurate as rounding allows also for curves of many nodes, where the assembled matrix has lost all digits.
///
/// ```
/// use tombolo_deform::skeleton::CurveDeformation;
///
/// let nodes: Vec<_> = (0..=8).map(|i| [f64::from(i), 0.0, 0.0]).collect();
/// let wire = CurveDeformation::new(&nodes, false, &[4])?;
/// let bent = wire.displacement(&[[0.0, 2.0, 0.0]]);
/// assert_eq!((bent[0], bent[4], bent[8]), ([0.0; 3], [0.0, 2.0, 0.0], [0.0; 3]));
/// assert!(bent[2][1] > 1.0, "bent like a wire, not like a string");
/// # Ok::<(), tombolo_deform::skeleton::CurveError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct CurveDeformation {
    nodes: usize,
    /// For each dragged node what its drag by 1 does to each node.
    influences: Vec<Vec<f64>>,
}

impl CurveDeformation {
    /// A polyline of `[n]` nodes, `n >= 2`, of which those numbered in `dragged` will be dragged, in any order. The last node of a
    /// closed one is joined to its first, which is not given twice.
    ///
    /// Time and memory are linear in the nodes for each dragged one; to that comes the cube of the number dragged.
    ///
    /// # Errors
    /// [`CurveError`].
    pub fn new(nodes: &[Vector], closed: bool, dragged: &[usize]) -> Result<Self, CurveError> {
        for (slot, &node) in dragged.iter().enumerate() {
            if node >= nodes.len() || (!closed && (node == 0 || node + 1 == nodes.len())) {
                return Err(CurveError::NotInner { node, nodes: nodes.len() });
            }
            if dragged[..slot].contains(&node) {
                return Err(CurveError::Twice { node });
            }
        }
        let Some(&first) = dragged.iter().min() else {
            return Ok(Self { nodes: nodes.len(), influences: Vec::new() });
        };
        let walk = Walk::new(nodes, closed, if closed { first } else { 0 }, dragged)?;
        Ok(Self { nodes: nodes.len(), influences: walk.influences(nodes.len(), dragged.len())? })
    }

    /// What the drag of the dragged node of this place, by 1 along any axis, does to each node of the curve.
    #[must_use]
    pub fn influence(&self, place: usize) -> Option<&[f64]> {
        self.influences.get(place).map(Vec::as_slice)
    }

    /// The displacement of each node where the dragged ones move by `by`, in the order in which they were named. Those that `by` is
    /// too short for stay where they are.
    #[must_use]
    pub fn displacement(&self, by: &[Vector]) -> Vec<Vector> {
        let mut displacement = vec![[0.0; 3]; self.nodes];
        for (influence, by) in self.influences.iter().zip(by) {
            for (moved, factor) in displacement.iter_mut().zip(influence) {
                for axis in 0..3 {
                    moved[axis] += factor * by[axis];
                }
            }
        }
        displacement
    }
}

/// The nodes in the order of arc length, cut into spans at the ends and the dragged nodes; a closed curve starts and ends in a
/// dragged one.
struct Walk {
    nodes: Vec<usize>,
    /// Of each segment, in units of the whole length.
    lengths: Vec<f64>,
    /// Where in `nodes` the ends and the dragged nodes are, with the place of those that are dragged.
    knots: Vec<(usize, Option<usize>)>,
}

impl Walk {
    fn new(
        points: &[Vector],
        closed: bool,
        start: usize,
        dragged: &[usize],
    ) -> Result<Self, CurveError> {
        let count = points.len();
        let steps = if closed { count } else { count - 1 };
        let nodes: Vec<usize> = (0..=steps).map(|step| (start + step) % count).collect();
        let mut lengths: Vec<f64> = nodes
            .windows(2)
            .map(|pair| {
                let segment = subtract(points[pair[1]], points[pair[0]]);
                // In units of the largest part, so that no square overflows.
                let unit = segment.iter().fold(0.0f64, |largest, value| largest.max(value.abs()));
                if unit > 0.0 {
                    unit * dot(scale(segment, 1.0 / unit), scale(segment, 1.0 / unit)).sqrt()
                } else {
                    0.0
                }
            })
            .collect();
        let total: f64 = lengths.iter().sum();
        let is_bad = |length: &f64| !(*length > 0.0 && length.is_finite());
        let bad = lengths
            .iter()
            .position(is_bad)
            .or_else(|| lengths.iter().position(|length| is_bad(&(length / total))));
        if let Some(segment) = bad {
            return Err(CurveError::Segment { nodes: [nodes[segment], nodes[segment + 1]] });
        }
        lengths.iter_mut().for_each(|length| *length /= total);
        let place = |node: usize| dragged.iter().position(|&other| other == node);
        let knots = nodes
            .iter()
            .enumerate()
            .map(|(step, &node)| (step, place(node)))
            .filter(|&(step, place)| place.is_some() || step == 0 || step == steps)
            .collect();
        Ok(Self { nodes, lengths, knots })
    }

    /// The mass of the inner node at a step.
    fn mass(&self, step: usize) -> f64 {
        0.5 * (self.lengths[step - 1] + self.lengths[step])
    }

    fn spans(&self) -> impl Iterator<Item = Span> {
        self.knots.windows(2).map(|pair| {
            let [(from, first), (to, last)] = [pair[0], pair[1]];
            Span { from, to, places: [first, last], length: self.lengths[from..to].iter().sum() }
        })
    }

    /// Calls `visit` with each inner step of a span, its mass, and how far along the span it lies, from 0 to 1.
    fn for_each_inner(&self, span: &Span, mut visit: impl FnMut(usize, f64, f64)) {
        let mut along = 0.0;
        for step in span.from + 1..span.to {
            along += self.lengths[step - 1];
            visit(step, self.mass(step), along / span.length);
        }
    }

    /// For each dragged node what its drag by 1 does to each node.
    ///
    /// With `H_k` the function linear between the knots that is 1 at knot `k` and 0 at the others, the moments `m_k` at the dragged
    /// nodes solve `sum_l (sum_i Mc_ii H_k(s_i) H_l(s_i)) m_l = the second difference of d at k over the knots`.
    fn influences(&self, count: usize, dragged: usize) -> Result<Vec<Vec<f64>>, CurveError> {
        let mut gram = vec![vec![0.0; dragged]; dragged];
        // The right sides, one for each dragged node, and then the solutions; the matrix of both is symmetric.
        let mut moments = gram.clone();
        for span in self.spans() {
            let mut products = [[0.0; 2]; 2];
            self.for_each_inner(&span, |_, mass, along| {
                let hats = [1.0 - along, along];
                for (row, products) in products.iter_mut().enumerate() {
                    for (column, product) in products.iter_mut().enumerate() {
                        *product += mass * hats[row] * hats[column];
                    }
                }
            });
            for (row, &place) in span.places.iter().enumerate() {
                let Some(place) = place else { continue };
                moments[place][place] -= 1.0 / span.length;
                if let Some(other) = span.places[1 - row] {
                    moments[place][other] += 1.0 / span.length;
                }
                for (column, &other) in span.places.iter().enumerate() {
                    if let Some(other) = other {
                        gram[place][other] += products[row][column];
                    }
                }
            }
        }
        for (knot, &(step, place)) in self.knots.iter().enumerate() {
            // A closed walk comes to its first node twice.
            if let Some(place) = place
                && knot + 1 < self.knots.len()
            {
                let before = if step == 0 { self.lengths.len() - 1 } else { step - 1 };
                gram[place][place] += 0.5 * (self.lengths[before] + self.lengths[step]);
            }
        }
        let factor = cholesky(gram).ok_or(CurveError::NotSolvable)?;
        moments.iter_mut().for_each(|moments| solve(&factor, moments));
        let influences: Vec<Vec<f64>> = (0..dragged)
            .map(|place| self.influence(count, place, |row| moments[place][row]))
            .collect();
        if influences.iter().flatten().all(|value| value.is_finite()) {
            Ok(influences)
        } else {
            Err(CurveError::NotSolvable)
        }
    }

    fn influence(&self, count: usize, place: usize, moment: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut result = vec![0.0; count];
        for span in self.spans() {
            let ends = span.places.map(|other| if other == Some(place) { 1.0 } else { 0.0 });
            let moments = span.places.map(|other| other.map_or(0.0, &moment));
            let at = |along: f64| moments[0] * (1.0 - along) + moments[1] * along;
            let mut slope = (ends[1] - ends[0]) / span.length;
            self.for_each_inner(&span, |_, mass, along| slope -= (1.0 - along) * mass * at(along));
            let mut value = ends[0] + self.lengths[span.from] * slope;
            result[self.nodes[span.from]] = ends[0];
            self.for_each_inner(&span, |step, mass, along| {
                result[self.nodes[step]] = value;
                slope += mass * at(along);
                value += self.lengths[step] * slope;
            });
            result[self.nodes[span.to]] = ends[1];
        }
        result
    }
}

/// The lower factor of a symmetric positive definite matrix.
fn cholesky(mut matrix: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    for row in 0..matrix.len() {
        for column in 0..=row {
            let (done, rest) = matrix.split_at(row);
            let other = if column < row { &done[column] } else { &rest[0] };
            let product: f64 =
                rest[0][..column].iter().zip(&other[..column]).map(|(a, b)| a * b).sum();
            let value = rest[0][column] - product;
            matrix[row][column] =
                if column < row { value / matrix[column][column] } else { value.sqrt() };
        }
        // Also where the root was of a negative number.
        if !(matrix[row][row] > 0.0 && matrix[row][row].is_finite()) {
            return None;
        }
    }
    Some(matrix)
}

/// Solves with the lower factor of a symmetric positive definite matrix, in place.
fn solve(factor: &[Vec<f64>], values: &mut [f64]) {
    for row in 0..values.len() {
        let product: f64 = factor[row][..row].iter().zip(&values[..row]).map(|(a, b)| a * b).sum();
        values[row] = (values[row] - product) / factor[row][row];
    }
    for row in (0..values.len()).rev() {
        let product: f64 =
            (row + 1..values.len()).map(|below| factor[below][row] * values[below]).sum();
        values[row] = (values[row] - product) / factor[row][row];
    }
}

struct Span {
    from: usize,
    to: usize,
    places: [Option<usize>; 2],
    length: f64,
}

/// Why a curve cannot be made ready for dragging.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CurveError {
    /// A node that cannot be dragged.
    #[error(
        "node {node} cannot be dragged: expected an inner node of the curve, which has {nodes} nodes counted from 0"
    )]
    NotInner {
        /// The node.
        node: usize,
        /// How many there are.
        nodes: usize,
    },
    /// A node is dragged twice at once.
    #[error("node {node} is dragged twice")]
    Twice {
        /// The node.
        node: usize,
    },
    /// A segment without a length, or too long to measure.
    #[error("nodes {} and {} of the curve are at the same place, or too far apart to measure", nodes[0], nodes[1])]
    Segment {
        /// Its nodes.
        nodes: [usize; 2],
    },
    /// The lengths of the segments differ too much.
    #[error("the lengths of the curve's segments differ too much for it to be bent")]
    NotSolvable,
}

/// A skeleton made ready for dragging some of its nodes: only the curves that they lie on move.
///
/// Ends and branch nodes are pinned, whatever is dragged, so that each curve bends by itself ([`CurveDeformation`]).
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
    places: Vec<usize>,
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
        for (place, &node) in dragged.iter().enumerate() {
            if dragged[..place].contains(&node) {
                return Err(DragError::Twice { node });
            }
            let Some(curve) = owners.get(node).copied().flatten() else {
                return Err(DragError::pinned(skeleton, &owners, node));
            };
            match by_curve.iter_mut().find(|(known, _)| *known == curve) {
                Some((_, places)) => places.push(place),
                None => by_curve.push((curve, vec![place])),
            }
        }
        by_curve.sort_unstable();
        let curves = by_curve
            .into_iter()
            .map(|(curve, places)| {
                let closed = is_free_loop(skeleton, curve);
                let mut nodes = skeleton.curves()[curve].nodes().to_vec();
                if closed {
                    nodes.pop();
                }
                let points: Vec<Vector> =
                    nodes.iter().map(|&node| skeleton.nodes()[node as usize]).collect();
                let inner =
                    |&place: &usize| nodes.iter().position(|&node| node as usize == dragged[place]);
                let wanted: Vec<usize> = places.iter().filter_map(inner).collect();
                let deformation = CurveDeformation::new(&points, closed, &wanted)
                    .map_err(|source| DragError::Curve { curve, source })?;
                Ok(DraggedCurve { curve, nodes, places, deformation })
            })
            .collect::<Result<_, DragError>>()?;
        Ok(Self { nodes: skeleton.nodes().len(), curves })
    }

    /// The numbers of the curves that move, rising.
    pub fn curves(&self) -> impl Iterator<Item = usize> {
        self.curves.iter().map(|dragged| dragged.curve)
    }

    /// The displacement of each node of the skeleton where the dragged ones move by `by`, in the order in which they were named.
    #[must_use]
    pub fn displacement(&self, by: &[Vector]) -> Vec<Vector> {
        let mut displacement = vec![[0.0; 3]; self.nodes];
        for dragged in &self.curves {
            let own: Vec<Vector> = dragged
                .places
                .iter()
                .map(|&place| by.get(place).copied().unwrap_or_default())
                .collect();
            // A node where a curve comes back to its own branch node is met twice, both times unmoved.
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
        /// What is wrong.
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
#[path = "curve_tests.rs"]
mod tests;
