//! Cells whose vertices stand in the order of another program.

use super::cell_type::Types;
use super::handedness::{Hand, hand, hands};
use super::{CellType, Cells, MeshError, Vector};
use crate::mesh::cell_geometry::{centroid, scaled_jacobian};
use crate::number::real;
use crate::vector::Position;

/// How many cells of a type are looked at.
const SAMPLE: usize = 32;

/// An order that no program is known for is only named where it makes as many cells valid: few
/// could be so by chance.
const FEW: usize = 8;

/// The least mean of scaled Jacobians by which an order is told: rounding makes flat cells valid in
/// some order.
const SOUND: f64 = 0.05;

/// Scaled Jacobians that differ by less are of the same cell, read from another corner.
const SAME: f64 = 1e-9;

/// The orders of other programs that are known by name: their type, which vertices VTK's order
/// takes first, and who has them.
const KNOWN: [(CellType, &[usize], &str); 8] = [
    (
        CellType::Quad,
        &[0, 1, 3, 2],
        "lexicographic (tensor-product) order, as in deal.II, p4est and VTK's pixel",
    ),
    (
        CellType::Pixel,
        &[0, 1, 3, 2],
        "the order of VTK's quadrilateral (quad): give the cells that type",
    ),
    (
        CellType::Hexahedron,
        &[0, 1, 3, 2, 4, 5, 7, 6],
        "lexicographic (tensor-product) order, as in deal.II, p4est and VTK's voxel",
    ),
    (
        CellType::Voxel,
        &[0, 1, 3, 2, 4, 5, 7, 6],
        "the order of VTK's hexahedron: give the cells that type",
    ),
    (
        CellType::Pyramid,
        &[0, 1, 3, 2, 4],
        "the base in lexicographic (tensor-product) order, as in deal.II",
    ),
    (CellType::Pyramid, &[1, 2, 3, 4, 0], "the apex before the base"),
    (CellType::Wedge, &[0, 2, 4, 1, 3, 5], "one edge between the triangles after the other"),
    (
        CellType::Wedge,
        &[0, 1, 4, 3, 2, 5],
        "a quadrilateral before the edge across from it, as in Nektar++",
    ),
];

/// Cells whose vertices stand in another order than VTK's.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherOrder {
    /// The first such cell.
    pub cell: usize,
    /// Its type.
    pub cell_type: CellType,
    /// The mean of its vertices.
    pub centroid: Vector,
    /// Which of the vertices, as they stand, should come first, which next.
    pub order: Vec<usize>,
    /// The order that it looks like, where it is a known one.
    pub name: Option<&'static str>,
}

impl std::fmt::Display for OtherOrder {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let order: Vec<String> = self.order.iter().map(ToString::to_string).collect();
        write!(
            formatter,
            "cell {} ({}) at {} has its vertices in another order than VTK's, and so have most cells of its type: VTK's order is {}; \
             this looks like {}: give the vertices {} of each cell, as they are counted now",
            self.cell,
            self.cell_type,
            Position(self.centroid),
            of_vtk(self.cell_type),
            self.name.unwrap_or("that of another program"),
            order.join(" ")
        )
    }
}

impl Cells {
    /// The cells of a mesh, right-handed.
    ///
    /// # Errors
    /// [`MeshError::OtherOrder`].
    pub(super) fn of_mesh(mut self, points: &[Vector]) -> Result<Self, MeshError> {
        // Another mesh may have had them elsewhere.
        self.turn(self.turned_types().unwrap_or_default());
        let (turned, neither) = hands(&self, points);
        if let Some(other) = other_order(&self, points, neither) {
            return Err(other);
        }
        self.turn(turned);
        Ok(self.with_turned_types(Some(turned)))
    }
}

/// The error for cells of the types `neither`, most of which are neither right- nor left-handed. It
/// names the order in which all cells of the sample would be valid; there is no error where no
/// order does that.
fn other_order(cells: &Cells, points: &[Vector], neither: Types) -> Option<MeshError> {
    CellType::ALL.into_iter().filter(|&cell_type| neither.contains(cell_type)).find_map(
        |cell_type| {
            let size = cell_type.vertex_count().filter(|&size| size <= 8)?;
            let mut tets = Vec::new();
            let of_type = |cell: &usize| cells.cell_type(*cell) == cell_type;
            let count = (0..cells.len()).filter(of_type).count();
            let sample: Vec<usize> = (0..cells.len())
                .filter(of_type)
                .step_by(count.div_ceil(SAMPLE))
                .take(SAMPLE)
                .collect();
            let wrong = (0..cells.len())
                .filter(of_type)
                .find(|&cell| hand(cells, cell, points, &mut tets) == Hand::Neither)?;
            let samples: Vec<Vec<Vector>> = sample
                .iter()
                .map(|&cell| {
                    cells.vertices(cell).iter().map(|&vertex| points[vertex as usize]).collect()
                })
                .collect();
            let mut best: Option<(f64, Vec<usize>)> = None;
            let mut consider = |order: &[usize]| {
                let Some(value) = worth(cell_type, &samples, order) else { return };
                if best.as_ref().is_none_or(|(least, _)| value > least + SAME) {
                    best = Some((value, order.to_vec()));
                }
            };
            // A known order is preferred to its like.
            let known = || KNOWN.iter().filter(|(of, _, _)| *of == cell_type);
            known().for_each(|(_, order, _)| consider(order));
            if samples.len() >= FEW {
                for_each_order(size, &mut consider);
            }
            let (_, order) = best?;
            let name = known().find(|(_, known, _)| *known == order).map(|&(_, _, name)| name);
            let centroid = centroid(cells, wrong, points);
            Some(MeshError::OtherOrder(Box::new(OtherOrder {
                cell: wrong,
                cell_type,
                centroid,
                order,
                name,
            })))
        },
    )
}

/// The sum of the scaled Jacobians of cells whose vertices are read in another order; `None` where
/// one of them is not valid then.
fn worth(cell_type: CellType, samples: &[Vec<Vector>], order: &[usize]) -> Option<f64> {
    let mut sum = 0.0;
    let (mut cells, mut tets) = (Cells::new(), Vec::new());
    let local: Vec<u32> = (0..).take(order.len()).collect();
    cells.push(cell_type, &local).ok()?;
    for sample in samples {
        let points: Vec<Vector> = order.iter().map(|&index| sample[index]).collect();
        if hand(&cells, 0, &points, &mut tets) != Hand::Right {
            return None;
        }
        sum += scaled_jacobian(cell_type, &points)?;
    }
    (sum >= SOUND * real(samples.len())).then_some(sum)
}

/// Calls `visit` with every order of `0..size`, the lexicographically first one first.
fn for_each_order(size: usize, visit: &mut impl FnMut(&[usize])) {
    let mut order: Vec<usize> = (0..size).collect();
    loop {
        visit(&order);
        let Some(index) = (1..size).rev().find(|&index| order[index - 1] < order[index]) else {
            return;
        };
        let Some(next) = (index..size).rev().find(|&next| order[next] > order[index - 1]) else {
            return;
        };
        order.swap(index - 1, next);
        order[index..].reverse();
    }
}

/// VTK's order of the vertices of a cell, in words.
fn of_vtk(cell_type: CellType) -> &'static str {
    match cell_type {
        CellType::Hexahedron => "the bottom quadrilateral around, then the top one above it",
        CellType::Quad => "around the quadrilateral",
        CellType::Pixel => "x fastest, then y",
        CellType::Voxel => "x fastest, then y, then z",
        CellType::Wedge => "one triangle around, then the other, vertex over vertex",
        CellType::Pyramid => "the base around, then the apex",
        _ => "that of its manual",
    }
}
