//! The nozzle of the demos, small enough to run in a second.

use std::fmt::Write as _;
use std::path::Path;

use tombolo_deform::mesh::Vector;
use tombolo_deform::shapes;

/// The features of the nozzle, in the order of their physical numbers from 1.
pub const NOZZLE_FEATURES: [&str; 5] = ["inlet", "upstream", "throat", "downstream", "outlet"];

const LOWER: Vector = [-0.025, -0.525, -0.05];
const UPPER: Vector = [0.025, 0.525, 0.05];
const COUNTS: [usize; 3] = [2, 42, 4];

/// Writes a channel along y of about 2 000 tetrahedra as Gmsh 2.2, its throat between y = -0.1 and
/// 0.1.
///
/// # Panics
/// Where the file cannot be written.
pub fn write_nozzle(path: &Path) {
    let mesh = shapes::box_of_tets(COUNTS, LOWER, UPPER);
    let points = mesh.points();
    let mut text = String::from("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n6\n");
    for (number, name) in NOZZLE_FEATURES.iter().enumerate() {
        let _ = writeln!(text, "2 {} \"{name}\"", number + 1);
    }
    let _ = writeln!(text, "3 6 \"fluid\"\n$EndPhysicalNames\n$Nodes\n{}", points.len());
    for (vertex, [x, y, z]) in points.iter().enumerate() {
        let _ = writeln!(text, "{} {x:?} {y:?} {z:?}", vertex + 1);
    }
    let tombolo_deform::mesh::FeatureSource::Faces(tagged) = mesh.features() else {
        panic!("a box has tagged faces");
    };
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", tagged.faces.len() + mesh.cells().len());
    let mut element = 0;
    let mut push = |kind: u32, physical: usize, vertices: &[u32]| {
        element += 1;
        let _ = write!(text, "{element} {kind} 2 {physical} {physical}");
        for vertex in vertices {
            let _ = write!(text, " {}", vertex + 1);
        }
        text.push('\n');
    };
    for (_, vertices) in tagged.faces.iter() {
        let corners: Vec<Vector> = vertices.iter().map(|&vertex| points[vertex as usize]).collect();
        push(2, physical(&corners), vertices);
    }
    for (_, vertices) in mesh.cells().iter() {
        push(4, 6, vertices);
    }
    text.push_str("$EndElements\n");
    std::fs::write(path, text).expect("a mesh can be written");
}

fn physical(corners: &[Vector]) -> usize {
    let all = |wanted: f64| corners.iter().all(|corner| (corner[1] - wanted).abs() < 1e-12);
    let centre = corners.iter().map(|corner| corner[1]).sum::<f64>() / corners.len() as f64;
    if all(LOWER[1]) {
        1
    } else if all(UPPER[1]) {
        5
    } else if centre < -0.1 {
        2
    } else if centre > 0.1 {
        4
    } else {
        3
    }
}
