//! Curve deformation: how a curve of a skeleton bends when some of its nodes are dragged.

use crate::linear::cholesky::{factor_dense, solve_dense};
use crate::mesh::Vector;
use crate::vector::{dot, scale, subtract};

/// A polyline made ready for dragging some of its nodes, as if it were a metal wire.
///
/// # What it solves
/// The displacement `d` of the nodes solves the biharmonic equation of Wetterer-Nelson, Jansen and
/// Evans (section "Skeleton Interactivity"), `Lc Mc^-1 Lc d = 0`, with the central differences of
/// the inner nodes,
///
/// ```text
/// (Lc d)_i = (d_(i+1) - d_i) / h_i - (d_i - d_(i-1)) / h_(i-1),    Mc_ii = (h_i + h_(i-1)) / 2,
/// ```
///
/// `h_i` the length of the segment from node `i` to the next. The ends are boundary nodes: they
/// have no difference (their rows of `Lc` are zero) and their rows of the equation are replaced by
/// `d = 0`, those of dragged nodes by `d = by`. So a pinned end may turn but not move, as one on a
/// hinge, and the curve passes through the dragged nodes without a kink: `d` is the discrete
/// natural cubic spline of the drags over arc length.
///
/// In a closed polyline every node is an inner one, and nothing but the drags holds it: dragging
/// one node carries all of it along, and a node is held in place by dragging it by zero.
///
/// # How
/// The equation says that the bending moment `m = Mc^-1 Lc d` is linear in arc length between the
/// ends and the dragged nodes. So one small positive definite system of as many unknowns as there
/// are dragged nodes is factored, and two sums along the curve give what each drag does to each
/// node. After that a drag is a multiply-add.
///
/// # What it guarantees
/// Pinned ends move by exact zeros and dragged nodes as stated; dragging by zero moves nothing; the
/// result is linear in the drags, and as accurate as rounding allows also for curves of many nodes,
/// where the assembled matrix has lost all digits.
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
    /// A polyline of `[n]` nodes, `n >= 2`, of which those numbered in `dragged` will be dragged,
    /// in any order. The last node of a closed one is joined to its first, which is not given
    /// twice.
    ///
    /// Time and memory are linear in the nodes for each dragged one; to that comes the cube of the
    /// number dragged.
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

    /// The displacement of each node of the curve where one of the dragged nodes, by its index
    /// among them, moves by 1 along any axis.
    #[must_use]
    pub fn influence(&self, dragged: usize) -> Option<&[f64]> {
        self.influences.get(dragged).map(Vec::as_slice)
    }

    /// The displacement of each node where the dragged ones move by `by`, in the order in which
    /// they were named. Those that `by` is too short for stay where they are.
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

/// The nodes in the order of arc length, cut into spans at the ends and the dragged nodes; a closed
/// curve starts and ends in a dragged one.
struct Walk {
    nodes: Vec<usize>,
    /// Of each segment, in units of the whole length.
    lengths: Vec<f64>,
    /// Where in `nodes` the ends and the dragged nodes are, with the index of those that are
    /// dragged.
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
        let index = |node: usize| dragged.iter().position(|&other| other == node);
        let knots = nodes
            .iter()
            .enumerate()
            .map(|(step, &node)| (step, index(node)))
            .filter(|&(step, index)| index.is_some() || step == 0 || step == steps)
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
            Span { from, to, dragged: [first, last], length: self.lengths[from..to].iter().sum() }
        })
    }

    /// Calls `visit` with each inner step of a span, its mass, and how far along the span it lies,
    /// from 0 to 1.
    fn for_each_inner(&self, span: &Span, mut visit: impl FnMut(usize, f64, f64)) {
        let mut along = 0.0;
        for step in span.from + 1..span.to {
            along += self.lengths[step - 1];
            visit(step, self.mass(step), along / span.length);
        }
    }

    /// For each dragged node what its drag by 1 does to each node.
    ///
    /// With `H_k` the function linear between the knots that is 1 at knot `k` and 0 at the others,
    /// the moments `m_k` at the dragged nodes solve
    /// `sum_l (sum_i Mc_ii H_k(s_i) H_l(s_i)) m_l = the second difference of d at k over the
    /// knots`.
    fn influences(&self, count: usize, dragged: usize) -> Result<Vec<Vec<f64>>, CurveError> {
        let mut gram = vec![vec![0.0; dragged]; dragged];
        // The right sides, one for each dragged node, and then the solutions; the matrix of both is
        // symmetric.
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
            for (row, &index) in span.dragged.iter().enumerate() {
                let Some(index) = index else { continue };
                moments[index][index] -= 1.0 / span.length;
                if let Some(other) = span.dragged[1 - row] {
                    moments[index][other] += 1.0 / span.length;
                }
                for (column, &other) in span.dragged.iter().enumerate() {
                    if let Some(other) = other {
                        gram[index][other] += products[row][column];
                    }
                }
            }
        }
        for (knot, &(step, index)) in self.knots.iter().enumerate() {
            // A closed walk comes to its first node twice.
            if let Some(index) = index
                && knot + 1 < self.knots.len()
            {
                let before = if step == 0 { self.lengths.len() - 1 } else { step - 1 };
                gram[index][index] += 0.5 * (self.lengths[before] + self.lengths[step]);
            }
        }
        let factor = factor_dense(gram).ok_or(CurveError::NotSolvable)?;
        moments.iter_mut().for_each(|moments| solve_dense(&factor, moments));
        let influences: Vec<Vec<f64>> = (0..dragged)
            .map(|index| self.influence(count, index, |row| moments[index][row]))
            .collect();
        if influences.iter().flatten().all(|value| value.is_finite()) {
            Ok(influences)
        } else {
            Err(CurveError::NotSolvable)
        }
    }

    fn influence(&self, count: usize, index: usize, moment: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut result = vec![0.0; count];
        for span in self.spans() {
            let ends = span.dragged.map(|other| if other == Some(index) { 1.0 } else { 0.0 });
            let moments = span.dragged.map(|other| other.map_or(0.0, &moment));
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

struct Span {
    from: usize,
    to: usize,
    /// The index of either end among the dragged nodes.
    dragged: [Option<usize>; 2],
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
