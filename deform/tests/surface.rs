//! Surfaces: what is extracted, which features are found, and what edits do.

#[path = "surface/accuracy.rs"]
mod accuracy;
#[path = "surface/actions.rs"]
mod actions;
#[path = "surface/checks.rs"]
mod checks;
#[path = "surface/editing.rs"]
mod editing;
#[path = "surface/extraction.rs"]
mod extraction;
#[path = "surface/features.rs"]
mod features;
#[path = "surface/orientation.rs"]
mod orientation;
#[path = "surface/random.rs"]
mod random;

use std::sync::Arc;

use tombolo_deform::edit::{Edit, Editor, HarmonicOrder, ScaleDirection, ScaleNormals, Translate};
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{FeatureSource, Mesh, Vector};
use tombolo_deform::surface::Surface;
use tombolo_deform::vector::determinant;

const ORDERS: [HarmonicOrder; 3] =
    [HarmonicOrder::Harmonic, HarmonicOrder::Biharmonic, HarmonicOrder::Triharmonic];

fn extract(mesh: &Mesh) -> Surface {
    Surface::extract(mesh, &FeatureSettings::default()).expect("a surface")
}

fn editor(mesh: &Mesh) -> Editor {
    Editor::new(Arc::new(extract(mesh))).expect("an editor")
}

/// The same mesh with a feature number for each vertex.
fn tagged(mesh: &Mesh, tag: impl Fn(Vector) -> i64) -> Mesh {
    let tags: Vec<i64> = mesh.points().iter().map(|&point| tag(point)).collect();
    Mesh::new(mesh.points().to_vec(), mesh.cells().clone(), FeatureSource::Vertices(tags.into()))
        .expect("a mesh")
}

fn names(list: &[&str]) -> Vec<String> {
    list.iter().map(|name| (*name).to_string()).collect()
}

fn translate(features: &[&str], fixed: &[&str], by: Vector, harmonic_order: HarmonicOrder) -> Edit {
    Edit::Translate(Translate {
        features: names(features),
        fixed: names(fixed),
        by,
        harmonic_order,
        ..Translate::default()
    })
}

fn scale(
    features: &[&str],
    fixed: &[&str],
    factors: Vector,
    harmonic_order: HarmonicOrder,
) -> Edit {
    Edit::ScaleDirection(ScaleDirection {
        features: names(features),
        fixed: names(fixed),
        factors,
        harmonic_order,
        ..ScaleDirection::default()
    })
}

fn scale_normals(features: &[&str], fixed: &[&str], distance: f64) -> Edit {
    Edit::ScaleNormals(ScaleNormals {
        features: names(features),
        fixed: names(fixed),
        distance,
        ..ScaleNormals::default()
    })
}

/// The volume that the triangles of a closed surface enclose, positive where they run outward.
fn enclosed_volume(surface: &Surface, points: &[Vector]) -> f64 {
    let mut six = 0.0;
    for triangle in surface.triangles() {
        let [a, b, c] = triangle.map(|vertex| points[vertex as usize]);
        six += determinant(a, b, c);
    }
    six / 6.0
}

fn moved(surface: &Surface, displacement: &[Vector]) -> Vec<Vector> {
    let add =
        |(point, by): (&Vector, &Vector)| [point[0] + by[0], point[1] + by[1], point[2] + by[2]];
    surface.points().iter().zip(displacement).map(add).collect()
}

/// Numbers from 0 to 1 that are the same in every run.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}
