use super::*;
use tombolo_deform::edit::EditError;
use tombolo_deform::mesh::{CellType, Cells};
use tombolo_deform::shapes;
use tombolo_deform::surface::check;

/// The same mesh of triangles, those chosen turned round.
fn with_turned(mesh: &Mesh, is_turned: impl Fn(usize) -> bool) -> Mesh {
    let corners = mesh.cells().iter().enumerate().flat_map(|(triangle, (_, corners))| {
        let [a, b, c] = [corners[0], corners[1], corners[2]];
        if is_turned(triangle) { [c, b, a] } else { [a, b, c] }
    });
    let cells = Cells::uniform(CellType::Triangle, corners.collect()).unwrap();
    Mesh::new(mesh.points().to_vec(), cells, mesh.features().clone()).unwrap()
}

fn runs_one_way(surface: &Surface) -> bool {
    let sides = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
    let mut all: Vec<[u32; 2]> = surface.triangles().iter().flat_map(sides).collect();
    let count = all.len();
    all.sort_unstable();
    all.dedup();
    all.len() == count
}

#[test]
fn closed_surfaces_face_outward_however_they_were_given() {
    let torus = shapes::torus(2.0, 0.5, [16, 9]);
    let mut random = noise(5);
    let patchwork: Vec<bool> = (0..torus.cells().len()).map(|_| random() < 0.45).collect();
    let grow = scale_normals(&["feature-0", "feature-1", "feature-2", "feature-3"], &[], 0.1);
    let expected = editor(&torus).displacement(std::slice::from_ref(&grow)).unwrap();
    for mesh in [with_turned(&torus, |_| true), with_turned(&torus, |triangle| patchwork[triangle])]
    {
        let mut editor = editor(&mesh);
        assert!(runs_one_way(editor.surface()));
        assert!(enclosed_volume(editor.surface(), mesh.points()) > 0.0);
        let displacement = editor.displacement(std::slice::from_ref(&grow)).unwrap();
        for (moved, expected) in displacement.iter().flatten().zip(expected.iter().flatten()) {
            assert!((moved - expected).abs() < 1e-14);
        }
    }
}

#[test]
fn an_open_surface_keeps_the_side_that_most_of_it_has() {
    let plate = shapes::plate([8, 6], [0.0, 0.0], [1.0, 1.0]);
    for (few, sign) in [(true, 1.0), (false, -1.0)] {
        let surface = extract(&with_turned(&plate, |triangle| (triangle % 5 == 2) == few));
        assert!(runs_one_way(&surface));
        let [a, b, c] = surface.triangles()[0].map(|vertex| surface.points()[vertex as usize]);
        assert!(sign * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) > 0.0);
    }
}

#[test]
fn a_cavity_still_faces_inward() {
    let outer = shapes::torus(2.0, 0.5, [16, 9]);
    let inner = with_turned(&shapes::torus(2.0, 0.2, [16, 9]), |_| true);
    let count = outer.points().len() as u32;
    let points = [outer.points(), inner.points()].concat();
    let corners = outer.cells().connectivity().iter().copied();
    let corners = corners.chain(inner.cells().connectivity().iter().map(|vertex| vertex + count));
    let cells = Cells::uniform(CellType::Triangle, corners.collect()).unwrap();
    let surface = extract(&Mesh::new(points, cells.clone(), FeatureSource::SharpEdges).unwrap());
    assert_eq!(surface.faces().connectivity(), cells.connectivity());
}

#[test]
fn an_offset_without_an_outer_side_is_refused_and_the_face_named() {
    let mesh = editing::moebius_strip();
    let mut editor = editor(&mesh);
    let all = ["feature-0", "feature-1", "feature-2"];
    match editor.displacement(&[scale_normals(&all, &[], 0.1)]).unwrap_err() {
        EditError::OneSided { edit: 0, face } => assert!((face as usize) < mesh.cells().len()),
        other => panic!("{other}"),
    }
    assert!(editor.displacement(&[scale_normals(&["feature-2"], &["feature-0"], 0.1)]).is_ok());
}

#[test]
fn a_closed_piece_turned_inside_out_is_named() {
    let surface = extract(&shapes::torus(2.0, 0.5, [16, 9]));
    let mirrored: Vec<Vector> = surface.points().iter().map(|&[x, y, z]| [x, y, 5.0 - z]).collect();
    let report = check(&surface, surface.points(), &mirrored);
    assert_eq!(report.inside_out.count, surface.faces().len());
    assert!(!report.is_sound() && report.to_string().contains("turned inside out"), "{report}");
    // Not a half turn, and nothing that is open.
    let turned: Vec<Vector> = surface.points().iter().map(|&[x, y, z]| [x, 7.0 - y, -z]).collect();
    assert!(check(&surface, surface.points(), &turned).is_sound());
    let plate = extract(&shapes::plate([4, 4], [0.0, 0.0], [1.0, 1.0]));
    let mirrored: Vec<Vector> = plate.points().iter().map(|&[x, y, z]| [-x, y, z]).collect();
    assert!(check(&plate, plate.points(), &mirrored).is_sound());
}
