//! The meshes and the motion by which volume motion is measured, on threads and on ranks.

use std::error::Error;

use tombolo::deform::bounds::Bounds;
use tombolo::deform::mesh::{Mesh, Vector};
use tombolo::deform::shapes::box_of_tets;
use tombolo::pipelines::files;

use crate::peer::known_mesh;

pub const TOLERANCE: f64 = 1e-6;

/// The threads of everything measured, as many as PETSc has ranks.
pub const THREADS: usize = 2;

/// The paper's meshes, of [`mesh`].
pub const MESHES: usize = 5;

/// The paper's bypass where `scripts/meshes` has made it already (the largest takes it a quarter of
/// an hour); else a box with as many tetrahedra, made in a moment.
pub fn mesh(number: usize) -> Result<(String, Mesh), Box<dyn Error>> {
    let name = format!("bypass-{number}");
    let file = known_mesh(&name);
    if file.exists() {
        return Ok((name, files::read_mesh(&file)?.mesh));
    }
    let counts: [usize; MESHES] = [22, 27, 34, 43, 60];
    Ok(("box".into(), jiggled_box(*counts.get(number).ok_or("the paper has five meshes")?)?))
}

/// A box of `6 count³` tetrahedra, its inner vertices moved about.
pub fn jiggled_box(count: usize) -> Result<Mesh, Box<dyn Error>> {
    let mesh = box_of_tets([count; 3], [0.0; 3], [1.0; 3]);
    let mut state = 1u64;
    let mut noise = move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        0.3 / count as f64 * ((state >> 33) as f64 / (1u64 << 31) as f64 - 0.5)
    };
    let inside = |point: &Vector| point.iter().all(|&x| x > 0.0 && x < 1.0);
    let points = mesh.points().iter();
    let points = points
        .map(|point| if inside(point) { point.map(|x| x + noise()) } else { *point })
        .collect();
    Ok(mesh.with_points(points)?)
}

/// A smooth motion by up to a tenth of the domain.
pub fn motion(mesh: &Mesh, boundary: &[u32]) -> Vec<Vector> {
    let points = || boundary.iter().map(|&vertex| mesh.points()[vertex as usize]);
    let bounds = Bounds::around(points());
    let (lower, size) = (bounds.lower, bounds.extent().into_iter().fold(0.0, f64::max));
    points()
        .map(|point| {
            let [x, y, z] = std::array::from_fn(|axis| (point[axis] - lower[axis]) / size);
            [(3.0 * y).sin(), 0.4 * (5.0 * x).cos(), x * z].map(|value| 0.1 * size * value)
        })
        .collect()
}
