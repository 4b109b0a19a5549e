//! All points at once beside each by itself.

use tombolo_deform::communicator::Solo;
use tombolo_deform::mesh::{FeatureSource, Mesh, MeshView};
use tombolo_deform::shapes::{box_of_hexahedra, box_of_mixed_cells, box_of_tets};
use tombolo_deform::vector::{add, scale};

use super::*;
use crate::extract::Channel;

/// Numbers from 0 to 1 that follow no order.
fn scattered(index: usize) -> f64 {
    (real(index) * 0.754_877_666).fract()
}

/// Points in, between and beside the cells of a mesh, and some that are nowhere.
fn points_of(mesh: &Mesh) -> Vec<Vector> {
    let within = |index: usize| [0, 1, 2].map(|axis| 1.2 * scattered(3 * index + axis) - 0.1);
    let mut points: Vec<Vector> = (0..500).map(within).collect();
    points.extend(mesh.points());
    for (cell, (_, vertices)) in mesh.cells().iter().enumerate().step_by(3) {
        let at = |corner: usize| mesh.points()[vertices[corner % vertices.len()] as usize];
        let middle = |count: usize| {
            let sum = (0..count).fold([0.0; 3], |sum, corner| add(sum, at(corner + cell)));
            scale(sum, 1.0 / real(count))
        };
        points.extend([2, 3, vertices.len()].map(middle));
        // Beside a vertex by about as much as may be.
        points.push(add(at(cell), [1e-9, -2e-9, scale(at(0), 1e-9)[2]]));
    }
    points.extend([[f64::NAN, 0.5, 0.5], [0.5, f64::INFINITY, 0.5], [1e300; 3], [-1e9, 0.5, 0.5]]);
    points
}

/// A tilted sheet of quadrilaterals, triangles and pixels.
fn sheet() -> Mesh {
    let point = |point: u32| {
        let [column, row] = [point % 9, point / 9].map(f64::from);
        [0.1 * column, 0.15 * row, 0.3 + 0.02 * column]
    };
    let mut cells = Cells::new();
    for row in 0..6 {
        for column in 0..8 {
            let [a, b] = [9 * row + column, 9 * row + column + 1];
            let [c, d] = [b + 9, a + 9];
            match (row + 2 * column) % 4 {
                0 => cells.push(CellType::Quad, &[a, b, c, d]).unwrap(),
                1 => cells.push(CellType::Pixel, &[a, b, d, c]).unwrap(),
                2 => cells.push(CellType::Polygon, &[a, b, c, d]).unwrap(),
                _ => {
                    cells.push(CellType::Triangle, &[a, b, c]).unwrap();
                    cells.push(CellType::Triangle, &[a, c, d]).unwrap();
                }
            }
        }
    }
    Mesh::new((0..63).map(point).collect(), cells, FeatureSource::SharpEdges).unwrap()
}

#[test]
fn all_points_at_once_are_found_where_each_is_found_by_itself() {
    let meshes = [
        box_of_tets([5, 4, 6], [0.0; 3], [1.0; 3]),
        box_of_hexahedra([4, 5, 3], [0.0; 3], [1.0; 3]),
        box_of_mixed_cells([5, 4, 4], [0.0; 3], [1.0; 3]),
        sheet(),
    ];
    for (mesh, name) in meshes.iter().zip(["tetrahedra", "hexahedra", "mixed cells", "faces"]) {
        let channel = Channel::new("fluid", MeshView::from(mesh), &[]);
        let mut source = Source::new(&channel).unwrap();
        let input = Input { channel: &channel, cycle: 0, wanted: &|_| false, communicator: &Solo };
        source.update(&input).unwrap();
        let points = points_of(mesh);
        // Numbers that rise, fall, and follow no order.
        let keys: [&dyn Fn(u32) -> u64; 3] =
            [&u64::from, &|cell| 1_000_000 - u64::from(cell), &|cell| {
                u64::from(cell.wrapping_mul(0x9e37_79b1))
            }];
        for method in [ProbeMethod::Interpolated, ProbeMethod::Nearest] {
            let finder = Finder::new(&source, method);
            for key in keys {
                let all = finder.find_all(&points, key);
                let mut count = 0;
                for (index, point) in points.iter().enumerate() {
                    let Some(Found { cell, row }) = finder.find(*point, key) else {
                        assert_eq!(all.keys[index], u64::MAX, "{name}: {point:?}");
                        continue;
                    };
                    count += 1;
                    assert_eq!((all.keys[index], all.cells[index]), (key(cell), cell), "{name}");
                    let bits = |row: &[(u32, f64)]| -> Vec<(u32, u64)> {
                        row.iter().map(|(vertex, weight)| (*vertex, weight.to_bits())).collect()
                    };
                    let found = all.rows.row(all.numbers[index]);
                    assert_eq!(bits(found), bits(&row), "{name}: {point:?}");
                }
                assert!(count > mesh.points().len() && count < points.len(), "{name}: {count}");
            }
        }
    }
}
