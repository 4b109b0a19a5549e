use std::collections::HashMap;

use super::{editor, enclosed_volume, extract};
use tombolo_deform::edit::Editor;
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh, Vector};
use tombolo_deform::shapes;
use tombolo_deform::surface::{Surface, SurfaceError};

fn mesh(points: Vec<Vector>, cells: Cells) -> Mesh {
    Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap()
}

fn refused(mesh: &Mesh) -> SurfaceError {
    Surface::extract(mesh, &FeatureSettings::default()).unwrap_err()
}

/// Every side of a closed surface is walked once in each direction.
fn is_closed(surface: &Surface) -> bool {
    let mut sides: HashMap<(u32, u32), i32> = HashMap::new();
    for &[a, b, c] in surface.triangles() {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *sides.entry((from.min(to), from.max(to))).or_default() +=
                if from < to { 1 } else { 10 };
        }
    }
    sides.values().all(|&count| count == 11)
}

#[test]
fn the_surface_of_one_cell_of_each_type_is_its_faces_outward() {
    for cell_type in CellType::ALL {
        let mesh = shapes::single_cell(cell_type);
        if cell_type.dimension() < 2 {
            assert_eq!(
                refused(&mesh),
                SurfaceError::NoFaces { cells: 1, dimension: cell_type.dimension() }
            );
            continue;
        }
        let surface = extract(&mesh);
        assert_eq!(surface.points(), mesh.points(), "{cell_type}");
        assert!(surface.owner_cells().iter().all(|&cell| cell == 0));
        let ring = |sides: f64| 0.5 * sides * (std::f64::consts::TAU / sides).sin();
        let (faces, volume) = match cell_type {
            CellType::Tetra => (4, 1.0 / 6.0),
            CellType::Pyramid => (5, 1.0 / 3.0),
            CellType::Wedge => (5, 0.5),
            CellType::PentagonalPrism => (7, ring(5.0)),
            CellType::HexagonalPrism => (8, ring(6.0)),
            CellType::TriangleStrip => (2, 0.0),
            _ if cell_type.dimension() == 2 => (1, 0.0),
            _ => (6, 1.0),
        };
        assert_eq!(surface.faces().len(), faces, "{cell_type}");
        assert_eq!(is_closed(&surface), cell_type.dimension() == 3, "{cell_type}");
        assert!(
            (enclosed_volume(&surface, surface.points()) - volume).abs() < 1e-12,
            "{cell_type}"
        );
        if cell_type.dimension() == 2 {
            for triangle in surface.triangles() {
                let [a, b, c] = triangle.map(|vertex| surface.points()[vertex as usize]);
                assert!(
                    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0,
                    "{cell_type}"
                );
            }
        }
    }
}

/// Mesh generators and VTK's manual number a wedge the other way round; either way the faces look
/// outward.
#[test]
fn wedges_of_either_hand_face_outward() {
    let left = shapes::single_cell(CellType::Wedge);
    let [a, b, c, d, e, f] = left.cells().vertices(0) else { panic!("six vertices") };
    let mut cells = Cells::new();
    cells.push(CellType::Wedge, &[*d, *e, *f, *a, *b, *c]).unwrap();
    let right = mesh(left.points().to_vec(), cells);
    for surface in [extract(&left), extract(&right)] {
        assert!(is_closed(&surface));
        assert!((enclosed_volume(&surface, surface.points()) - 0.5).abs() < 1e-15);
    }
}

#[test]
fn boxes_have_the_surface_of_the_box() {
    for mesh in [
        shapes::box_of_tets([5, 4, 3], [-1.0; 3], [1.0, 2.0, 3.0]),
        shapes::box_of_hexahedra([5, 4, 3], [-1.0; 3], [1.0, 2.0, 3.0]),
    ] {
        let surface = extract(&mesh);
        assert!(is_closed(&surface));
        assert_eq!(surface.triangles().len(), 2 * 2 * (5 * 4 + 4 * 3 + 3 * 5));
        assert_eq!(surface.points().len(), 6 * 5 * 4 - 4 * 3 * 2);
        assert!((enclosed_volume(&surface, surface.points()) - 24.0).abs() < 1e-12);
        assert!(surface.vertices().is_sorted());
        for (point, &vertex) in surface.points().iter().zip(surface.vertices()) {
            assert_eq!(*point, mesh.points()[vertex as usize]);
        }
        for (face, (_, vertices)) in surface.faces().iter().enumerate() {
            let cell = mesh.cells().vertices(surface.owner_cells()[face] as usize);
            assert!(
                vertices.iter().all(|&vertex| cell.contains(&surface.vertices()[vertex as usize]))
            );
        }
    }
}

/// A cube with a pyramid on its top, a wedge at its side, a tetrahedron on a triangle of the wedge
/// and a polyhedral cube below.
fn mixed_mesh() -> Mesh {
    let mut points = shapes::single_cell(CellType::Hexahedron).points().to_vec();
    points.extend([
        [0.5, 0.5, 2.0],
        [2.0, 0.0, 0.0],
        [2.0, 1.0, 0.0],
        [2.0, -1.0, 1.0],
        [0.0, 0.0, -1.0],
        [1.0, 0.0, -1.0],
        [1.0, 1.0, -1.0],
        [0.0, 1.0, -1.0],
    ]);
    let mut cells = Cells::new();
    cells.push(CellType::Hexahedron, &[0, 1, 2, 3, 4, 5, 6, 7]).unwrap();
    cells.push(CellType::Pyramid, &[4, 5, 6, 7, 8]).unwrap();
    // Triangles 1-5-9 and 2-6-10, the first with its normal out of the cell, along -y.
    cells.push(CellType::Wedge, &[1, 9, 5, 2, 10, 6]).unwrap();
    cells.push(CellType::Tetra, &[1, 9, 5, 11]).unwrap();
    let below: Vec<Vec<u32>> = CellType::Hexahedron
        .faces()
        .iter()
        .map(|face| face.iter().map(|&corner| [12, 13, 14, 15, 0, 1, 2, 3][corner]).collect())
        .collect();
    cells.push_polyhedron(&below).unwrap();
    // Cells of lower dimension do not count.
    cells.push(CellType::Triangle, &[1, 5, 9]).unwrap();
    cells.push(CellType::Quad, &[0, 1, 2, 3]).unwrap();
    cells.push(CellType::Line, &[0, 1]).unwrap();
    mesh(points, cells)
}

#[test]
fn cells_of_different_types_share_their_faces() {
    let mesh = mixed_mesh();
    let surface = extract(&mesh);
    assert!(is_closed(&surface));
    // 6 + 5 + 5 + 4 + 6 faces, less two at each of the four meetings.
    assert_eq!(surface.faces().len(), 18);
    let tetra = (mesh.points()[11][1]).abs() * 0.5 / 3.0;
    let expected = 1.0 + 1.0 / 3.0 + 0.5 + tetra + 1.0;
    assert!((enclosed_volume(&surface, surface.points()) - expected).abs() < 1e-12);
}

#[test]
fn polygons_with_many_corners_match_by_all_of_them() {
    // Two hexagonal prisms on each other share a hexagon, and no face of one is taken for another
    // with the same lowest corners.
    let prism = shapes::single_cell(CellType::HexagonalPrism);
    let mut points = prism.points().to_vec();
    points.extend(prism.points()[6..].iter().map(|point| [point[0], point[1], 2.0]));
    let mut cells = Cells::new();
    cells.push(CellType::HexagonalPrism, &(0..12).collect::<Vec<u32>>()).unwrap();
    cells.push(CellType::HexagonalPrism, &(6..18).collect::<Vec<u32>>()).unwrap();
    let surface = extract(&mesh(points, cells));
    assert_eq!(surface.faces().len(), 2 + 12);
    assert!(is_closed(&surface));
}

#[test]
fn a_face_that_bends_inward_is_covered_once() {
    // An arrowhead: a fan from most of its corners would leave it.
    let points = vec![[0.0, 0.0, 0.0], [2.0, -1.0, 0.0], [0.5, 0.0, 0.0], [2.0, 1.0, 0.0]];
    let mut cells = Cells::new();
    cells.push(CellType::Polygon, &[0, 1, 2, 3]).unwrap();
    let surface = extract(&mesh(points, cells));
    for triangle in surface.triangles() {
        let [a, b, c] = triangle.map(|vertex| surface.points()[vertex as usize]);
        assert!((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0);
    }
}

#[test]
fn collapsed_cells_count_with_what_is_left_of_them() {
    // A hexahedron collapsed to a wedge by naming two vertices twice.
    let points = shapes::single_cell(CellType::Hexahedron).points().to_vec();
    let mut cells = Cells::new();
    cells.push(CellType::Hexahedron, &[0, 1, 2, 2, 4, 5, 6, 6]).unwrap();
    let surface = extract(&mesh(points, cells));
    assert!(is_closed(&surface));
    assert_eq!(surface.points().len(), 6);
    assert!((enclosed_volume(&surface, surface.points()) - 0.5).abs() < 1e-12);
}

#[test]
fn duplicate_cells_are_named() {
    let points = shapes::box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]).points().to_vec();
    let mut cells = Cells::new();
    cells.push(CellType::Tetra, &[0, 1, 2, 4]).unwrap();
    cells.push(CellType::Tetra, &[1, 2, 4, 7]).unwrap();
    cells.push(CellType::Tetra, &[4, 2, 1, 0]).unwrap();
    assert_eq!(
        refused(&mesh(points.clone(), cells)),
        SurfaceError::DuplicateCells { first: 0, second: 2 }
    );
    let mut cells = Cells::new();
    cells.push(CellType::Tetra, &[0, 1, 2, 4]).unwrap();
    cells.push(CellType::Tetra, &[0, 1, 2, 4]).unwrap();
    assert_eq!(
        refused(&mesh(points.clone(), cells)),
        SurfaceError::DuplicateCells { first: 0, second: 1 }
    );
    let mut cells = Cells::new();
    cells.push(CellType::Triangle, &[0, 1, 2]).unwrap();
    cells.push(CellType::Triangle, &[2, 0, 1]).unwrap();
    assert_eq!(refused(&mesh(points, cells)), SurfaceError::DuplicateCells { first: 0, second: 1 });
}

#[test]
fn a_face_of_three_cells_is_named() {
    let mut points = shapes::single_cell(CellType::Tetra).points().to_vec();
    points.extend([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]]);
    let mut cells = Cells::new();
    for apex in [0, 4, 5] {
        cells.push(CellType::Tetra, &[1, 2, 3, apex]).unwrap();
    }
    match refused(&mesh(points, cells)) {
        SurfaceError::SharedFace { mut vertices, cells } => {
            vertices.sort_unstable();
            assert_eq!((vertices, cells), (vec![1, 2, 3], vec![0, 1, 2]));
        }
        other => panic!("{other}"),
    }
}

#[test]
fn an_edge_of_four_faces_can_be_seen_but_not_edited() {
    let mut points = shapes::single_cell(CellType::Hexahedron).points().to_vec();
    // A second cube that touches the first along the edge 2-6 only.
    points.extend([
        [2.0, 1.0, 0.0],
        [2.0, 2.0, 0.0],
        [1.0, 2.0, 0.0],
        [2.0, 1.0, 1.0],
        [2.0, 2.0, 1.0],
        [1.0, 2.0, 1.0],
    ]);
    let mut cells = Cells::new();
    cells.push(CellType::Hexahedron, &[0, 1, 2, 3, 4, 5, 6, 7]).unwrap();
    cells.push(CellType::Hexahedron, &[2, 8, 9, 10, 6, 11, 12, 13]).unwrap();
    let surface = extract(&mesh(points, cells));
    assert_eq!(surface.faces().len(), 12);
    let error = Editor::new(surface.into()).unwrap_err();
    assert_eq!(error, SurfaceError::NonManifoldEdge { edge: [2, 6], faces: 4 });
}

#[test]
fn meshes_without_a_surface_are_refused() {
    assert_eq!(
        refused(&mesh(vec![], Cells::new())),
        SurfaceError::NoFaces { cells: 0, dimension: 0 }
    );
    let mut cells = Cells::new();
    cells.push(CellType::Tetra, &[0, 0, 0, 0]).unwrap();
    assert_eq!(refused(&mesh(vec![[0.0; 3]], cells)), SurfaceError::NoBoundary);
    let cube = shapes::single_cell(CellType::Hexahedron);
    for angle in [-1.0, 181.0, f64::NAN, f64::INFINITY] {
        let settings = FeatureSettings { sharp_angle_degrees: angle };
        assert!(matches!(Surface::extract(&cube, &settings), Err(SurfaceError::SharpAngle(_))));
    }
}

#[test]
fn vertices_that_no_cell_uses_are_not_on_the_surface() {
    let tetra = shapes::single_cell(CellType::Tetra);
    let mut points = vec![[9.0; 3]];
    points.extend(tetra.points());
    let cells = Cells::uniform(CellType::Tetra, vec![1, 2, 3, 4]).unwrap();
    let surface = extract(&mesh(points, cells));
    assert_eq!(surface.vertices(), [1, 2, 3, 4]);
}

#[test]
fn a_surface_is_its_own_surface() {
    let torus = shapes::torus(2.0, 0.5, [12, 8]);
    let surface = extract(&torus);
    assert_eq!(surface.faces(), torus.cells());
    assert!(is_closed(&surface));
    editor(&torus);
}
