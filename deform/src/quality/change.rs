//! How cells have changed since the reference.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{CHUNK, Measure, normalized_scaled_jacobians};
use crate::communicator::{Communicator, Reduction};
use crate::mesh::cell_geometry::Scratch;
use crate::mesh::cell_geometry::tet_determinant;
use crate::mesh::{CellType, Cells, Domain, Vector};
use crate::parallel;
use crate::vector::{cross, dot, length, mean, subtract};

/// How the cells of a mesh have changed since its reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Change {
    /// The scaled Jacobian of each cell by that of the same cell in the reference.
    pub normalized_scaled_jacobian: Spread,
    /// The volume of each cell (the area, in a mesh of polygons) by that of the same cell in the
    /// reference.
    pub volume_ratio: Spread,
}

/// The least, mean and largest of many values; 1 where there are none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Spread {
    /// The least.
    pub min: f64,
    /// The mean.
    pub mean: f64,
    /// The largest.
    pub max: f64,
}

impl Spread {
    /// The spread of what the ranks have between them; values that are NaN are passed over.
    /// Collective.
    #[must_use]
    pub fn of(values: &[f64], communicator: &dyn Communicator) -> Self {
        let (mut min, mut max, mut sum, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0u32);
        for &value in values.iter().filter(|value| !value.is_nan()) {
            min = min.min(value);
            max = max.max(value);
            sum += value;
            count += 1;
        }
        let (mut ends, mut sums) = ([min, -max], [sum, f64::from(count)]);
        communicator.reduce(Reduction::Minimum, &mut ends);
        communicator.reduce(Reduction::Sum, &mut sums);
        if sums[1] == 0.0 {
            Self { min: 1.0, mean: 1.0, max: 1.0 }
        } else {
            Self { min: ends[0], mean: sums[0] / sums[1], max: -ends[1] }
        }
    }
}

/// How the cells of a domain have changed where its vertices have moved to `points`. Collective.
///
/// # Panics
/// Where a cell names a vertex beyond `points`.
#[must_use]
pub fn change(domain: impl Into<Domain>, points: &[Vector]) -> Change {
    let domain = domain.into();
    let (cells, reference) = (domain.mesh().cells(), domain.mesh().points());
    let (before, after) = (volumes(cells, reference), volumes(cells, points));
    let ratios: Vec<f64> =
        before.iter().zip(after).map(|(&a, b)| if a == 0.0 { f64::NAN } else { b / a }).collect();
    let normalized = normalized_scaled_jacobians(cells, reference, points);
    let communicator = domain.communicator();
    Change {
        normalized_scaled_jacobian: Spread::of(&normalized, communicator),
        volume_ratio: Spread::of(&ratios, communicator),
    }
}

/// The volume of each volume cell; in a mesh of polygons, their areas. NaN for cells of lower
/// dimension.
///
/// A face of more than three vertices is taken as the triangles that its edges make with the mean
/// of its vertices: exact where it is flat, and for hexahedra the volume of the trilinear cell. So
/// cells that share a face agree on it, and the volumes of neighbours add up. Cells turned inside
/// out have a negative volume; cells that are no mesh's yet are taken as [`Cells::right_handed`]
/// has them.
///
/// # Panics
/// Where a cell names a vertex beyond `points`.
#[must_use]
pub fn volumes(cells: &Cells, points: &[Vector]) -> Vec<f64> {
    let cells = &*cells.right_handed(points);
    let measure = Measure::new(cells);
    let mut values = vec![f64::NAN; cells.len()];
    parallel::for_each_chunk(&mut values, CHUNK, |chunk, part| {
        let mut scratch = Scratch::default();
        for (index, value) in part.iter_mut().enumerate() {
            let cell = chunk * CHUNK + index;
            if measure.is_measured(cell) {
                *value = volume(&measure, cell, points, &mut scratch);
            }
        }
    });
    values
}

fn volume(measure: &Measure<'_>, cell: usize, points: &[Vector], scratch: &mut Scratch) -> f64 {
    let cells = measure.cells;
    let vertices = cells.vertices(cell);
    if let (CellType::Tetra, &[a, b, c, d]) = (cells.cell_type(cell), vertices) {
        return tet_determinant([a, b, c, d].map(|vertex| points[vertex as usize])) / 6.0;
    }
    if cells.cell_type(cell).dimension() == 2 {
        let mut sum = 0.0;
        cells.for_each_polygon(cell, |polygon| {
            scratch.points.clear();
            scratch.points.extend(polygon.iter().map(|&vertex| points[vertex as usize]));
            sum += 0.5 * length(crate::mesh::cell_geometry::vector_area(&scratch.points));
        });
        return sum;
    }
    let centre = mean(vertices.iter().map(|&vertex| points[vertex as usize]));
    let mut sum = 0.0;
    cells.for_each_face(cell, |face| {
        let middle = mean(face.iter().map(|&vertex| points[vertex as usize]));
        for (index, &a) in face.iter().enumerate() {
            let b = face[(index + 1) % face.len()];
            let [a, b] = [a, b].map(|vertex| subtract(points[vertex as usize], centre));
            sum += dot(subtract(middle, centre), cross(a, b));
        }
    });
    sum / 6.0
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::shapes;
    use crate::vector::{add, scale, subtract};

    /// The volume that a face sweeps while its vertices go straight from `start` to `end`, positive
    /// where it moves along its normal (that of a counter-clockwise face): the integral over time
    /// of velocity times area, by Gauss's rule of two points, which is exact. Faces of more than
    /// three vertices are taken as in [`volumes`], so that the swept volumes of a cell's faces sum
    /// up to its change of volume (the geometric conservation law of M. Lesoinne and C. Farhat
    /// 1996) to rounding.
    fn swept_volume(start: &[Vector], end: &[Vector]) -> f64 {
        let offset = 0.5 / 3.0f64.sqrt();
        let (middle, middle_end) = (mean(start.iter().copied()), mean(end.iter().copied()));
        let velocity = |index: usize| subtract(end[index], start[index]);
        let drift = subtract(middle_end, middle);
        [0.5 - offset, 0.5 + offset]
            .into_iter()
            .map(|time| {
                let at = |from: Vector, to: Vector| add(from, scale(subtract(to, from), time));
                let centre = at(middle, middle_end);
                let mut sum = 0.0;
                for index in 0..start.len().min(end.len()) {
                    let next = (index + 1) % start.len();
                    let a = subtract(at(start[index], end[index]), centre);
                    let b = subtract(at(start[next], end[next]), centre);
                    sum += dot(add(drift, add(velocity(index), velocity(next))), cross(a, b));
                }
                // Half for the two points of time, a sixth for the mean velocity of a triangle
                // times twice its area.
                sum / 12.0
            })
            .sum()
    }

    #[test]
    fn unit_cells_have_their_volumes() {
        for cell_type in CellType::ALL.into_iter().filter(|cell| cell.dimension() == 3) {
            let mesh = shapes::single_cell(cell_type);
            let exact = match cell_type {
                CellType::Tetra => 1.0 / 6.0,
                CellType::Wedge => 0.5,
                CellType::Pyramid => 1.0 / 3.0,
                CellType::PentagonalPrism => 2.5 * (0.4 * std::f64::consts::PI).sin(),
                CellType::HexagonalPrism => 1.5 * 3.0f64.sqrt(),
                _ => 1.0,
            };
            let value = volumes(mesh.cells(), mesh.points())[0];
            assert!((value - exact).abs() < 1e-14, "{cell_type}: {value}");
        }
    }

    #[test]
    fn a_stretched_mesh_has_changed_by_its_stretch() {
        let mesh = shapes::box_of_hexahedra([3, 2, 2], [0.0; 3], [1.0; 3]);
        let end: Vec<Vector> =
            mesh.points().iter().map(|&[x, y, z]| [3.0 * x, 0.5 * y, z]).collect();
        let change = change(&mesh, &end);
        for value in [change.volume_ratio.min, change.volume_ratio.mean, change.volume_ratio.max] {
            assert!((value - 1.5).abs() < 1e-13);
        }
        assert!(
            (change.normalized_scaled_jacobian.min - 1.0).abs() < 1e-12,
            "right angles stay right"
        );
        assert_eq!(
            Spread::of(&[], &crate::communicator::Solo),
            Spread { min: 1.0, mean: 1.0, max: 1.0 }
        );
    }

    proptest! {
        /// The volume swept by a cell's faces equals the change of its volume, for every cell type.
        #[test]
        fn swept_volumes_sum_up_to_the_change_of_volume(moves in prop::collection::vec(-0.4..0.4f64, 2 * 36)) {
            for cell_type in CellType::ALL.into_iter().filter(|cell| cell.dimension() == 3) {
                let mesh = shapes::single_cell(cell_type);
                let shift = |offset: usize| -> Vec<Vector> {
                    mesh.points().iter().enumerate().map(|(vertex, point)| {
                        std::array::from_fn(|axis| point[axis] + moves[offset + 3 * vertex + axis])
                    }).collect()
                };
                let (start, end) = (shift(0), shift(36));
                let mut swept = 0.0;
                mesh.cells().for_each_face(0, |face| {
                    let at = |points: &[Vector]| face.iter().map(|&vertex| points[vertex as usize]).collect::<Vec<_>>();
                    swept += swept_volume(&at(&start), &at(&end));
                });
                let before = Measure::new(mesh.cells());
                let mut scratch = Scratch::default();
                let grown = volume(&before, 0, &end, &mut scratch) - volume(&before, 0, &start, &mut scratch);
                prop_assert!((swept - grown).abs() < 1e-13 * (1.0 + grown.abs()), "{cell_type}: {swept} {grown}");
            }
        }
    }
}
