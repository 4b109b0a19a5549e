//! Meshes whose vertices stand in other orders than VTK's.

use proptest::prelude::*;
use tombolo_deform::vector::determinant;
use tombolo_deform::{
    features::FeatureSettings,
    mesh::{CellType, Cells, FeatureSource, Mesh, MeshError, Vector},
    quality::{Guard, judge, quality, volumes},
    shapes,
    surface::Surface,
    volume::{Deform, VolumeError, VolumeOperator},
};

/// A mesh of each type of volume cell, tetrahedra to polyhedra.
fn meshes() -> Vec<Mesh> {
    let singles = CellType::ALL
        .into_iter()
        .filter(|cell_type| cell_type.dimension() == 3)
        .map(shapes::single_cell);
    let boxes = [
        shapes::box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]),
        shapes::box_of_hexahedra([3, 3, 3], [0.0; 3], [1.0; 3]),
        shapes::box_of_mixed_cells([3, 3, 4], [0.0; 3], [1.0; 3]),
    ];
    singles.chain(boxes).collect()
}

fn mirrored(points: &[Vector]) -> Vec<Vector> {
    points.iter().map(|&[x, y, z]| [-x, y, z]).collect()
}

/// The mesh in a mirror, with the cells as they were given.
fn mirror_image(mesh: &Mesh) -> Mesh {
    Mesh::new(
        mirrored(mesh.points()),
        mesh.cells().as_given().into_owned(),
        FeatureSource::SharpEdges,
    )
    .unwrap()
}

fn enclosed(surface: &Surface) -> f64 {
    let volume = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|vertex| surface.points()[vertex as usize]);
        determinant(a, b, c) / 6.0
    };
    surface.triangles().iter().map(volume).sum()
}

#[test]
fn a_mirrored_mesh_is_like_the_mesh_and_keeps_its_order() {
    for mesh in meshes() {
        let image = mirror_image(&mesh);
        let name = format!("{:?}", mesh.cells().types()[0]);
        assert_eq!(
            *image.cells().as_given(),
            *mesh.cells().as_given(),
            "{name}: what was given is given back"
        );
        let (ours, theirs) =
            (quality(mesh.cells(), mesh.points()), quality(image.cells(), image.points()));
        assert_eq!((ours.inverted, theirs.inverted), (0, 0), "{name}");
        assert!(
            (ours.min - theirs.min).abs() < 1e-12 && (ours.mean - theirs.mean).abs() < 1e-12,
            "{name}"
        );
        for (a, b) in
            volumes(mesh.cells(), mesh.points()).iter().zip(volumes(image.cells(), image.points()))
        {
            assert!(*a > 0.0 && (a - b).abs() < 1e-12, "{name}: {a} {b}");
        }
        let surfaces = [&mesh, &image]
            .map(|mesh| Surface::extract(mesh, &FeatureSettings::default()).unwrap());
        let [ours, theirs] = surfaces.each_ref().map(enclosed);
        assert!(ours > 0.0 && (ours - theirs).abs() < 1e-12, "{name}: outside stays outside");
        // What was a sound cell in the mirror is an inverted one out of it.
        assert!(
            judge(&image, image.points(), mesh.points(), &[1.0], &Guard::default()).is_err(),
            "{name}"
        );
        assert_eq!(quality(image.cells(), mesh.points()).inverted, mesh.cells().len(), "{name}");
        let told = image.cells().handedness_note();
        assert_eq!(
            told.is_some(),
            mesh.cells().uniform_type() != Some(CellType::Wedge),
            "{name}: {told:?}"
        );
        assert_eq!(mesh.cells().handedness_note(), None, "{name}");
    }
}

#[test]
fn the_volume_of_a_mirrored_mesh_follows_in_the_mirror() {
    for mesh in meshes().into_iter().filter(|mesh| mesh.cells().len() > 1) {
        let image = mirror_image(&mesh);
        let surface = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
        let settings = Deform { tolerance: 1e-12, ..Deform::default() };
        let bend = |&vertex: &u32| {
            let [x, y, z] = mesh.points()[vertex as usize];
            [0.2 * z * z, 0.1 * x * y, 0.05 * (3.0 * x).sin()]
        };
        let motion: Vec<Vector> = surface.vertices().iter().map(bend).collect();
        let moved = |mesh: &Mesh, motion: &[Vector]| {
            VolumeOperator::new(mesh, surface.vertices(), &settings)
                .unwrap()
                .solve(motion)
                .unwrap()
                .displacement
        };
        let (ours, theirs) = (moved(&mesh, &motion), mirrored(&moved(&image, &mirrored(&motion))));
        for (a, b) in ours.iter().flatten().zip(theirs.iter().flatten()) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }
}

#[test]
fn a_mesh_of_both_hands_is_refused_with_the_count_and_a_place() {
    let mesh = shapes::box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]);
    for wrong in [1, 5, mesh.cells().len() / 2 - 1] {
        let mut cells = Cells::new();
        for (cell, (cell_type, v)) in mesh.cells().iter().enumerate() {
            let row =
                if cell < wrong { [v[1], v[0], v[2], v[3]] } else { [v[0], v[1], v[2], v[3]] };
            cells.push(cell_type, &row).unwrap();
        }
        let mixed = Mesh::new(mesh.points().to_vec(), cells, FeatureSource::SharpEdges).unwrap();
        assert_eq!(mixed.cells().handedness_note(), None);
        let error = VolumeOperator::new(&mixed, &[0], &Deform::default()).unwrap_err();
        assert!(
            matches!(error, VolumeError::InvertedCell { cell: 0, count, left_handed, .. } if count == wrong && left_handed == wrong),
            "{error}"
        );
        let text = error.to_string();
        assert!(
            text.contains("cell 0 (tetra) at (")
                && text.contains(&format!("{wrong} of them left-handed")),
            "{text}"
        );
    }
}

/// The same mesh with the vertices of each cell of a type in another order.
fn reordered(mesh: &Mesh, of: CellType, order: &[usize]) -> Cells {
    let mut cells = Cells::new();
    for (cell_type, vertices) in mesh.cells().iter() {
        let row: Vec<u32> = if cell_type == of {
            order.iter().map(|&local| vertices[local]).collect()
        } else {
            vertices.to_vec()
        };
        cells.push(cell_type, &row).unwrap();
    }
    cells
}

#[test]
fn orders_of_other_programs_are_recognised() {
    let mixed = shapes::box_of_mixed_cells([3, 3, 4], [0.0; 3], [1.0, 2.0, 3.0]);
    let hexahedra = shapes::box_of_hexahedra([3, 2, 2], [0.0; 3], [1.0, 2.0, 3.0]);
    let lexicographic: &[usize] = &[0, 1, 3, 2, 4, 5, 7, 6];
    for (mesh, cell_type, order, who) in [
        (&hexahedra, CellType::Hexahedron, lexicographic, "deal.II"),
        (&mixed, CellType::Hexahedron, lexicographic, "lexicographic"),
        (&mixed, CellType::Pyramid, &[0, 1, 3, 2, 4][..], "deal.II"),
        (&mixed, CellType::Pyramid, &[4, 0, 1, 2, 3][..], "apex before the base"),
        (&mixed, CellType::Wedge, &[0, 3, 1, 4, 2, 5][..], "one edge"),
        (&mixed, CellType::Wedge, &[0, 1, 4, 3, 2, 5][..], "Nektar++"),
    ] {
        let cells = reordered(mesh, cell_type, order);
        let error =
            Mesh::new(mesh.points().to_vec(), cells, FeatureSource::SharpEdges).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("VTK's order is") && text.contains(who),
            "{cell_type} {order:?}: {text}"
        );
        let MeshError::OtherOrder(other) = error else { panic!("{text}") };
        assert_eq!(other.cell_type, cell_type);
    }
    // A hexahedron's order in cells that are said to be voxels.
    let cells = Cells::uniform(CellType::Voxel, hexahedra.cells().connectivity().to_vec()).unwrap();
    let error = Mesh::new(hexahedra.points().to_vec(), cells, FeatureSource::SharpEdges)
        .unwrap_err()
        .to_string();
    assert!(error.contains("hexahedron: give the cells that type"), "{error}");
}

/// Quadrilaterals on a paraboloid, or in the plane.
fn quadrilaterals(bend: f64, cell_type: CellType) -> Mesh {
    let number = |i: u32, j: u32| 5 * j + i;
    let point = |vertex: u32| {
        let (x, y) = (f64::from(vertex % 5), f64::from(vertex / 5));
        [x + 0.2 * y, y, bend * (x * x - y * y)]
    };
    let quad = |cell: u32| {
        let (i, j) = (cell % 4, cell / 4);
        [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)]
    };
    let cells = Cells::uniform(CellType::Quad, (0..12).flat_map(quad).collect()).unwrap();
    let mesh = Mesh::new((0..20).map(point).collect(), cells, FeatureSource::SharpEdges).unwrap();
    if cell_type == CellType::Quad {
        return mesh;
    }
    let cells = reordered(&mesh, CellType::Quad, &[0, 1, 3, 2]);
    let cells = Cells::uniform(cell_type, cells.connectivity().to_vec()).unwrap();
    Mesh::new(mesh.points().to_vec(), cells, FeatureSource::SharpEdges).unwrap()
}

#[test]
fn quadrilaterals_in_other_orders_are_recognised() {
    for bend in [0.0, 0.3] {
        for cell_type in [CellType::Quad, CellType::Pixel] {
            let mesh = quadrilaterals(bend, cell_type);
            let told = |order: &[usize]| {
                let cells = reordered(&mesh, cell_type, order);
                Mesh::new(mesh.points().to_vec(), cells, FeatureSource::SharpEdges).map(drop)
            };
            // The same quadrilateral from another corner, and the other way round, which surfaces
            // may be.
            let as_quad: [usize; 4] =
                if cell_type == CellType::Quad { [0, 1, 2, 3] } else { [0, 1, 3, 2] };
            for local in [[1, 2, 3, 0], [3, 2, 1, 0], [0, 3, 2, 1]] {
                let around = local.map(|corner| as_quad[corner]);
                let order = if cell_type == CellType::Quad {
                    around
                } else {
                    [0, 1, 3, 2].map(|corner| around[corner])
                };
                assert_eq!(told(&order), Ok(()), "{cell_type} {order:?}");
            }
            for crossed in [[0, 1, 3, 2], [0, 2, 1, 3], [2, 0, 3, 1]] {
                let around = crossed.map(|corner| as_quad[corner]);
                let order = if cell_type == CellType::Quad {
                    around
                } else {
                    [0, 1, 3, 2].map(|corner| around[corner])
                };
                let Err(MeshError::OtherOrder(other)) = told(&order) else {
                    panic!("{cell_type} {order:?}")
                };
                let right: Vec<usize> = other.order.iter().map(|&local| order[local]).collect();
                assert_eq!(told(&right), Ok(()), "{cell_type} {order:?}: {other}");
            }
            let Err(error) = told(&[0, 1, 3, 2]) else {
                panic!("{cell_type} with its last vertices swapped")
            };
            let (who, text) =
                (if cell_type == CellType::Quad { "deal.II" } else { "quad" }, error.to_string());
            assert!(text.contains("VTK's order is") && text.contains(who), "{text}");
        }
    }
}

/// The corners of such cells are sound, and they have no middle.
#[test]
fn cells_whose_top_is_turned_by_half_a_turn_are_recognised() {
    let mesh = shapes::box_of_hexahedra([3, 2, 2], [0.0; 3], [1.0; 3]);
    for order in [[0, 1, 2, 3, 6, 7, 4, 5], [3, 2, 1, 0, 5, 4, 7, 6]] {
        let cells = reordered(&mesh, CellType::Hexahedron, &order);
        let error = Mesh::new(mesh.points().to_vec(), cells, FeatureSource::SharpEdges);
        assert!(matches!(error, Err(MeshError::OtherOrder(_))), "{error:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever order all cells of a type are in: the mesh is sound, as it is or turned, or the
    /// error names an order that makes it so.
    #[test]
    fn what_is_said_of_an_order_is_true(
        order in Just((0..8).collect::<Vec<usize>>()).prop_shuffle(),
        moves in prop::collection::vec(prop::array::uniform3(-0.05..0.05f64), 36),
    ) {
        let mesh = shapes::box_of_hexahedra([3, 2, 2], [0.0; 3], [1.0; 3]);
        let points: Vec<Vector> = mesh.points().iter().zip(&moves)
            .map(|(p, d)| std::array::from_fn(|axis| p[axis] + d[axis])).collect();
        let cells = reordered(&mesh, CellType::Hexahedron, &order);
        match Mesh::new(points.clone(), cells.clone(), FeatureSource::SharpEdges) {
            // An order may twist cells without breaking them.
            Ok(mesh) => prop_assert!(quality(mesh.cells(), mesh.points()).inverted < mesh.cells().len()),
            Err(MeshError::OtherOrder(other)) => {
                let order = &other.order;
                let raw = Mesh::new(mesh.points().to_vec(), mesh.cells().clone(), FeatureSource::SharpEdges).unwrap();
                let mut right = Cells::new();
                for (cell_type, vertices) in cells.iter() {
                    let row: Vec<u32> = order.iter().map(|&local| vertices[local]).collect();
                    right.push(cell_type, &row).unwrap();
                }
                let right = Mesh::new(points.clone(), right, FeatureSource::SharpEdges).unwrap();
                let (ours, theirs) = (quality(raw.cells(), &points), quality(right.cells(), right.points()));
                prop_assert!((ours.min - theirs.min).abs() < 1e-9 && theirs.inverted == 0, "{} {}", ours.min, theirs.min);
            }
            Err(other) => prop_assert!(false, "{other}"),
        }
    }
}
