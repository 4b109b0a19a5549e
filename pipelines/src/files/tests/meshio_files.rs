//! What is written is read by meshio, and what meshio writes is read here.

use std::path::Path;
use std::process::Command;

use super::vtk_files::described;
use super::*;
use crate::files::write_compressed;

/// Runs `tests/meshio/read_back.py`.
fn meshio(arguments: &[&Path]) -> String {
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut run = Command::new(project.join(".venv/bin/python"));
    let output = run.arg(project.join("tests/meshio/read_back.py")).args(arguments).output();
    let output = output.unwrap_or_else(|error| panic!("{error}; scripts/setup makes .venv"));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "meshio (scripts/setup installs it): {errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// The cells of a mesh that meshio has a name for.
fn known(mesh: &Mesh) -> Mesh {
    let unknown = [
        CellType::PolyVertex,
        CellType::PolyLine,
        CellType::TriangleStrip,
        CellType::Pixel,
        CellType::Voxel,
        CellType::HexagonalPrism,
        CellType::PentagonalPrism,
        // A file of these beside any other cells is refused.
        CellType::Polyhedron,
    ];
    let mut cells = Cells::new();
    for (cell_type, vertices) in
        mesh.cells().iter().filter(|(cell_type, _)| !unknown.contains(cell_type))
    {
        cells.push(cell_type, vertices).unwrap();
    }
    Mesh::new(mesh.points().to_vec(), cells, FeatureSource::SharpEdges).unwrap()
}

fn polyhedra() -> Mesh {
    let all = one_of_each(3);
    let mut cells = Cells::new();
    let cell = all
        .cells()
        .types()
        .iter()
        .position(|&cell_type| cell_type == CellType::Polyhedron)
        .unwrap();
    let faces: Vec<Vec<u32>> =
        all.cells().polyhedron_faces(cell).iter().map(|face| face.to_vec()).collect();
    cells.push_polyhedron(&faces).unwrap();
    cells.push_polyhedron(&faces).unwrap();
    Mesh::new(all.points().to_vec(), cells, FeatureSource::SharpEdges).unwrap()
}

#[test]
fn meshio_reads_what_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.vtu");
    for mesh in (0..=3).map(|dimension| known(&one_of_each(dimension))).chain([polyhedra()]) {
        for compression in [Compression::None, Compression::Zlib] {
            let extract = extract(&mesh);
            write_compressed(&path, &extract, compression).unwrap();
            let sorted = |mut vertices: Vec<u32>| {
                vertices.sort_unstable();
                vertices
            };
            let cells: Vec<(u8, Vec<u32>)> = mesh
                .cells()
                .iter()
                .map(|(cell_type, vertices)| match cell_type {
                    CellType::Polyhedron => (cell_type.vtk(), sorted(vertices.to_vec())),
                    _ => (cell_type.vtk(), vertices.to_vec()),
                })
                .collect();
            let [velocity, pressure, stress] = <[Field; 3]>::try_from(extract.fields).unwrap();
            let expected = described(
                mesh.points(),
                &cells,
                &[
                    ("point", "velocity", 3, velocity.values),
                    (
                        "cell",
                        "features",
                        1,
                        (0..cells.len()).map(|cell| (cell % 2) as f64).collect(),
                    ),
                    ("cell", "p <rgh>", 1, pressure.values),
                    ("cell", "stress", 9, stress.values),
                    ("field", "even", 1, vec![0.0, 2.0]),
                    ("field", "odd", 1, vec![1.0, 2.0]),
                ],
            );
            assert_eq!(meshio(&[&path]), expected, "{:?}, {compression:?}", mesh.cells().types());
        }
    }
}

/// Features keep their numbers and names on the way through meshio, as physical groups of Gmsh's
/// format too.
#[test]
fn what_meshio_writes_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = tombolo_deform::shapes::box_of_tets([2, 2, 1], [0.0; 3], [1.0 / 3.0, 1.0, 1.0]);
    let original = folder.path().join("original.vtu");
    let fields = fields(&mesh);
    write_mesh(&original, &mesh, &fields, Compression::None).unwrap();
    let FeatureSource::Faces(tagged) = mesh.features() else { panic!("{:?}", mesh.features()) };
    let names = meshio(&[Path::new("--rewrite"), &original, folder.path()]);
    assert_eq!(names.lines().count(), 8, "{names}");
    for name in names.lines() {
        let back = read_mesh(folder.path().join(name)).unwrap_or_else(|error| panic!("{error}"));
        let FeatureSource::Faces(found) = back.mesh.features() else { panic!("{name}: no faces") };
        assert_eq!(back.mesh.cells(), mesh.cells(), "{name}");
        assert_eq!((&found.faces, &found.tags), (&tagged.faces, &tagged.tags), "{name}");
        // meshio writes field data to Gmsh's files only.
        if name.ends_with(".msh") {
            assert_eq!(found.names, tagged.names, "{name}");
        } else {
            assert_eq!(back.fields.len(), fields.len(), "{name}");
        }
        if !name.contains("text") {
            assert_eq!(back.mesh.points(), mesh.points(), "{name}");
        }
    }
}
