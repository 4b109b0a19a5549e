use super::{extract, tagged};
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh, TaggedFaces};
use tombolo_deform::shapes;
use tombolo_deform::surface::Surface;

fn with_features(mesh: &Mesh, features: FeatureSource) -> Mesh {
    Mesh::new(mesh.points().to_vec(), mesh.cells().clone(), features).unwrap()
}

#[test]
fn tagged_faces_are_found_whatever_their_order() {
    for mesh in [
        shapes::box_of_tets([2, 3, 4], [0.0; 3], [1.0; 3]),
        shapes::box_of_hexahedra([2, 3, 4], [0.0; 3], [1.0; 3]),
    ] {
        let surface = extract(&mesh);
        let features = surface.features();
        assert_eq!(features.names(), shapes::BOX_FEATURES);
        for (axis, side, name) in [(0, 0.0, "x-min"), (1, 1.0, "y-max"), (2, 0.0, "z-min")] {
            let feature = features.index(name).unwrap();
            let expected: Vec<u32> = (0..surface.points().len())
                .filter(|&v| surface.points()[v][axis] == side)
                .map(|v| v as u32)
                .collect();
            assert_eq!(features.vertices(feature), expected);
        }
        assert!(features.vertices(6).is_empty(), "there is no seventh");
    }
}

#[test]
fn faces_without_a_tag_are_untagged_and_names_come_from_the_mesh() {
    let cube = shapes::single_cell(CellType::Hexahedron);
    let mut faces = Cells::new();
    faces.push(CellType::Quad, &[7, 4, 5, 6]).unwrap();
    faces.push(CellType::Quad, &[0, 3, 2, 1]).unwrap();
    faces.push(CellType::Quad, &[0, 1, 5, 4]).unwrap();
    // Tagged a second time: the first tag holds.
    faces.push(CellType::Quad, &[4, 5, 6, 7]).unwrap();
    // No face of the cube.
    faces.push(CellType::Quad, &[0, 1, 6, 7]).unwrap();
    let tags = vec![12, -3, 5, 99, 100];
    let names = vec![(12, "lid".to_string()), (5, "lid".to_string()), (100, "inside".to_string())];
    let surface =
        extract(&with_features(&cube, FeatureSource::Faces(TaggedFaces { faces, tags, names })));
    assert_eq!(surface.features().names(), ["feature--3", "lid", "untagged"]);
    let mut counts = [0; 3];
    for &feature in surface.features().face_features() {
        counts[feature as usize] += 1;
    }
    assert_eq!(counts, [1, 2, 3]);
    assert_eq!(surface.features().vertices(1), [0, 1, 4, 5, 6, 7]);
}

#[test]
fn quadrilaterals_may_be_tagged_as_two_triangles() {
    let mesh = shapes::box_of_hexahedra([2, 3, 2], [0.0; 3], [1.0; 3]);
    let FeatureSource::Faces(tagged) = mesh.features() else { panic!("a box is tagged") };
    let [mut faces, mut tags] = [Cells::new(), Cells::new()].map(|cells| (cells, Vec::new()));
    for ((number, (_, quad)), &tag) in tagged.faces.iter().enumerate().zip(&tagged.tags) {
        // Along either diagonal; in the second list one triangle of each is missing.
        let [a, b, c, d] =
            if number % 2 == 0 { [0, 1, 2, 3] } else { [1, 2, 3, 0] }.map(|place| quad[place]);
        faces.0.push(CellType::Triangle, &[c, a, b]).unwrap();
        faces.0.push(CellType::Triangle, &[a, c, d]).unwrap();
        faces.1.extend([tag; 2]);
        tags.0.push(CellType::Triangle, &[a, b, c]).unwrap();
        tags.1.push(tag);
    }
    let of = |(faces, tags): (Cells, Vec<i64>)| {
        let names = tagged.names.clone();
        extract(&with_features(&mesh, FeatureSource::Faces(TaggedFaces { faces, tags, names })))
    };
    assert_eq!(of(faces).features(), extract(&mesh).features());
    assert_eq!(of(tags).features().names(), ["untagged"]);
}

#[test]
fn vertices_vote_for_the_feature_of_their_face() {
    let cube = shapes::single_cell(CellType::Hexahedron);
    let surface = extract(&with_features(
        &cube,
        FeatureSource::Vertices(vec![7, 7, 7, 7, 2, 2, 2, 2].into()),
    ));
    assert_eq!(surface.features().names(), ["feature-2", "feature-7"]);
    // Bottom by majority; the four sides by the lowest number on a tie.
    let bottom = surface.features().face_features().iter().filter(|&&feature| feature == 1).count();
    assert_eq!(bottom, 1);
    assert_eq!(surface.features().vertices(1), [0, 1, 2, 3]);
}

#[test]
fn sharp_edges_part_a_box_into_its_sides() {
    let mesh = with_features(
        &shapes::box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]),
        FeatureSource::SharpEdges,
    );
    let surface = extract(&mesh);
    let features = surface.features();
    assert_eq!(
        features.names(),
        ["feature-1", "feature-2", "feature-3", "feature-4", "feature-5", "feature-6"]
    );
    assert_eq!(features.face_features()[0], 0, "features are numbered by their lowest face");
    for feature in 0..6 {
        assert_eq!(features.vertices(feature).len(), 16);
    }
    let all = Surface::extract(&mesh, &FeatureSettings { sharp_angle_degrees: 90.5 }).unwrap();
    assert_eq!(all.features().names(), ["feature-1"]);
}

#[test]
fn the_angle_decides_what_is_sharp() {
    // A prism of six sides turns by 60 degrees at its side edges and by 90 at its ends.
    let prism = shapes::single_cell(CellType::HexagonalPrism);
    let count = |degrees: f64| {
        let surface =
            Surface::extract(&prism, &FeatureSettings { sharp_angle_degrees: degrees }).unwrap();
        surface.features().names().len()
    };
    assert_eq!([count(59.9), count(60.1), count(89.9), count(90.1)], [8, 3, 3, 1]);
}

#[test]
fn neighbours_that_run_opposite_ways_round_are_not_sharp_for_that() {
    let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let cells = Cells::uniform(CellType::Triangle, vec![0, 1, 2, 0, 3, 2]).unwrap();
    let surface = extract(&Mesh::new(points, cells, FeatureSource::SharpEdges).unwrap());
    assert_eq!(surface.features().names().len(), 1);
}

#[test]
fn an_unknown_feature_is_answered_with_the_near_names_and_all_of_them() {
    let surface = extract(&shapes::box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]));
    let error = surface.features().index("X_Min").unwrap_err();
    assert_eq!(error.near[0], "x-min");
    assert_eq!(error.features, shapes::BOX_FEATURES);
    assert!(
        error.to_string().ends_with("the features are x-min, x-max, y-min, y-max, z-min, z-max"),
        "{error}"
    );
    let far = surface.features().index("quite different").unwrap_err();
    assert!(far.near.is_empty());
    assert!(!far.to_string().contains("did you mean"));
}

#[test]
fn features_do_not_depend_on_how_vertices_are_used_elsewhere() {
    let plate =
        tagged(&shapes::plate([4, 2], [0.0, 0.0], [4.0, 2.0]), |point| i64::from(point[0] > 2.0));
    let surface = extract(&plate);
    assert_eq!(surface.features().names(), ["feature-0", "feature-1"]);
    let right = surface.features().vertices(1);
    assert!(right.iter().all(|&vertex| surface.points()[vertex as usize][0] >= 2.0));
}
