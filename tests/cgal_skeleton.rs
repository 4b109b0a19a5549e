//! Skeletons against those of CGAL: the same pieces, loops and branches, and within 2 % of the bounding box of each other.

use std::time::Duration;

use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh};
use tombolo_deform::shapes;
use tombolo_deform::skeleton::{Skeleton, SkeletonSettings};
use tombolo_deform::surface::{FeatureSettings, Surface};
use tombolo_pipelines::files::read_mesh;
use tombolo_tests::{CurveGraph, generated_surfaces};

const LIMIT: Duration = Duration::from_secs(100);

/// Asserts that both skeletons of a surface have these pieces, loops, branch nodes and ends, and lie close together.
fn agree(name: &str, mesh: &Mesh, counts: [usize; 4]) {
    let surface = Surface::extract(mesh, &FeatureSettings::default()).expect("a surface");
    let ours = CurveGraph::of(&Skeleton::extract(&surface, &SkeletonSettings::default()).expect("a skeleton"));
    let (_, theirs) = CurveGraph::of_cgal(&surface, LIMIT).expect("CGAL ends in time");
    assert_eq!(ours.counts(), counts, "{name}: pieces, loops, branch nodes and ends");
    assert_eq!(theirs.counts(), counts, "{name}: those of CGAL");
    let [there, back] = ours.apart(&theirs, &surface);
    println!("{name}: {:.2} % and {:.2} % of the diagonal apart", 100.0 * there, 100.0 * back);
    assert!(there <= 0.02 && back <= 0.02, "{name}: {there} {back}");
}

#[test]
fn a_torus() {
    agree("torus", &shapes::torus(1.0, 0.3, [82, 25]), [1, 1, 0, 0]);
}

#[test]
fn the_generated_meshes() {
    let cases = [("pipe-1", [1, 0, 0, 2]), ("bypass-0", [1, 1, 2, 2])];
    let names = cases.map(|(name, _)| name);
    for ((name, counts), file) in cases.into_iter().zip(generated_surfaces(&names)) {
        let mesh = read_mesh(&file).expect("a mesh").mesh;
        agree(name, &triangles_of(&mesh), counts);
    }
}

/// The triangles of a surface mesh alone.
fn triangles_of(mesh: &Mesh) -> Mesh {
    let surface = Surface::extract(mesh, &FeatureSettings::default()).expect("a surface");
    let cells = Cells::uniform(CellType::Triangle, surface.triangles().concat()).expect("triangles");
    Mesh::new(surface.points().to_vec(), cells, FeatureSource::SharpEdges).expect("a mesh")
}
