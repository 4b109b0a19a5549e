//! Displacement files: what is written comes back, and what is wrong is named by line and column.

use std::path::Path;

use proptest::prelude::*;
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{NumberType, Vector};
use tombolo_deform::shapes::{box_of_hexahedra, box_of_tets, torus};
use tombolo_deform::surface::Surface;

use super::super::{
    parse_displacement, read_displacement, read_mesh, write_displacement, write_mesh,
};
use super::{Association, Compression, Field, one_of_each};

fn surface() -> Surface {
    Surface::extract(&box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]), &FeatureSettings::default())
        .unwrap()
}

fn waves(surface: &Surface) -> Vec<Vector> {
    let wave =
        |&[x, y, z]: &Vector| [(7.0 * x + y).sin() / 3.0, -(z * 1e-9), 1e10 * (x - y * z).exp()];
    surface.points().iter().map(wave).collect()
}

#[test]
fn what_is_written_comes_back_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let meshes = [
        box_of_tets([3, 2, 4], [0.1; 3], [1.0, 7.0, 1e-3]),
        box_of_hexahedra([2, 2, 2], [1e3; 3], [1001.0; 3]),
        torus(2.0, 0.7, [9, 8]),
        // Vertices in the same place can be told apart by their numbers alone.
        one_of_each(2),
    ];
    for mesh in meshes {
        let surface = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
        let waves = waves(&surface);
        for name in ["a.txt", "b.csv", "c.vtp"] {
            let file = folder.path().join(name);
            write_displacement(&file, &surface, &waves).unwrap();
            let found = read_displacement(&file, &surface).unwrap();
            assert_eq!(
                (found.vertices.as_slice(), &found.values),
                (surface.vertices(), &waves),
                "{name}"
            );
        }
    }
    let error = write_displacement(folder.path().join("a.txt"), &surface(), &[]).unwrap_err();
    assert!(error.to_string().contains("0 where there must be 26"), "{error}");
    let error = write_displacement(folder.path().join("a.vtu"), &surface(), &waves(&surface()))
        .unwrap_err();
    assert!(error.to_string().contains("known are .txt, .csv and .vtp"), "{error}");
}

#[test]
fn a_written_surface_shows_its_features_and_its_displacement() {
    let folder = tempfile::tempdir().unwrap();
    let (surface, file) = (surface(), folder.path().join("a.vtp"));
    write_displacement(&file, &surface, &waves(&surface)).unwrap();
    let read = read_mesh(&file).unwrap();
    assert_eq!(read.mesh.points(), surface.points());
    let again = Surface::extract(&read.mesh, &FeatureSettings::default()).unwrap();
    assert_eq!(again.features().names(), surface.features().names());
    assert!(read.fields.iter().any(|field| field.name == "displacement" && field.components == 3));
}

#[test]
fn a_volume_and_a_surface_in_single_precision_are_matched_by_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = box_of_tets([3, 3, 3], [0.0; 3], [0.3; 3]);
    let surface = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
    let rounded =
        mesh.points().iter().map(|point| point.map(|part| f64::from(part as f32))).collect();
    let mesh = mesh.with_points(rounded).unwrap();
    let values: Vec<f64> = mesh.points().iter().flat_map(|&[x, y, z]| [x + 1.0, y, z]).collect();
    let field = Field {
        name: "displacement".into(),
        association: Association::Vertex,
        components: 3,
        number: NumberType::F64,
        values,
    };
    let file = folder.path().join("volume.vtu");
    write_mesh(&file, &mesh, std::slice::from_ref(&field), Compression::Zlib).unwrap();
    let found = read_displacement(&file, &surface).unwrap();
    assert_eq!(found.vertices, surface.vertices());
    for (value, point) in found.values.iter().zip(surface.points()) {
        assert!((value[0] - 1.0 - point[0]).abs() < 1e-7);
    }

    let fields = [Field { name: "motion".into(), ..field }];
    write_mesh(&file, &mesh, &fields, Compression::None).unwrap();
    let error = read_displacement(&file, &surface).unwrap_err().to_string();
    assert!(error.contains("found the arrays motion (vertex of 3 components)"), "{error}");
    assert!(error.contains("a point array `displacement` of 3 components"), "{error}");
}

/// In geographic coordinates all vertices of a small body lie within what single precision rounds.
#[test]
fn a_small_body_far_from_the_origin_is_matched_by_its_nearest_vertices() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus(5.0, 1.5, [100, 80]);
    let moved = mesh.points().iter().map(|&[x, y, z]| [x + 5e6, y + 5e6, z]).collect();
    let mesh = mesh.with_points(moved).unwrap();
    let surface = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
    let values: Vec<Vector> = surface.points().iter().map(|&[x, y, z]| [z, x - y, 1.0]).collect();
    let file = folder.path().join("a.txt");
    write_displacement(&file, &surface, &values).unwrap();
    assert_eq!(read_displacement(&file, &surface).unwrap().values, values);
    // By coordinates, to the bit and to a centimetre.
    for digits in [20, 2] {
        let mut text = String::new();
        for ([x, y, z], [a, b, c]) in surface.points().iter().zip(&values) {
            text += &format!("{x:.digits$} {y:.digits$} {z:.digits$} {a:?} {b:?} {c:?}\n");
        }
        let found = parse_displacement(Path::new("a.txt"), text.as_bytes(), &surface).unwrap();
        assert_eq!((found.vertices.as_slice(), &found.values), (surface.vertices(), &values));
    }
    // Other vertices are neither near nor meant.
    let [x, y, z] = surface.points()[0];
    let number = surface.vertices()[0];
    for text in [
        format!("{} {y} {z} 0 0 0", x + 2.0),
        format!("vertex x y z dx dy dz\n{number} {} {y} {z} 0 0 0", x + 2.0),
    ] {
        assert!(parse_displacement(Path::new("a.txt"), text.as_bytes(), &surface).is_err());
    }
}

#[test]
fn text_is_read_in_all_its_forms() {
    let surface = surface();
    let read =
        |text: &str| parse_displacement(Path::new("a.txt"), text.as_bytes(), &surface).unwrap();
    let first = |text: &str| (read(text).vertices[0], read(text).values[0]);
    let corner =
        surface.vertices()[surface.points().iter().position(|point| *point == [1.0; 3]).unwrap()];
    for text in [
        "1 1 1 0.5 -2 1e-3",
        "\u{feff}# made by hand\r\n\r\n  1.0,1.0000001, 1\t.5 -2.0 0.001  # the corner\r\n",
        "x y z dx dy dz\n1 1 1 0.5 -2 1e-3",
        "\"displacement:0\",\"displacement:1\",\"displacement:2\",\"Point ID\",\"Points:0\",\"Points:1\",\"Points:2\"\n0.5,-2,0.001,7,1,1,1\n",
        "DZ DY DX Z Y X pressure\n1e-3 -2 .5 1 1 1 nan",
    ] {
        assert_eq!(first(text), (corner, [0.5, -2.0, 1e-3]), "{text}");
    }
    assert_eq!(first(&format!("{corner} 0.5 -2 1e-3")), (corner, [0.5, -2.0, 1e-3]));
    assert_eq!(
        first(&format!("vertex,dx,dy,dz,x,y,z\n{corner},0.5,-2,1e-3,1,1,1")),
        (corner, [0.5, -2.0, 1e-3])
    );
    assert_eq!(read("0 0 0 1 2 3\n1 0 0 4 5 6").values, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
}

#[test]
fn what_is_wrong_is_named_by_line_and_column() {
    let surface = surface();
    for (text, expected) in [
        (
            "0 0 0 0 0 1\n# all well so far\n1 0 0 0, 0.1.2 0",
            "a.txt, line 3, column 10: found \"0.1.2\" where a finite number",
        ),
        ("0 0 0 0 inf 1", "a.txt, line 1, column 9: found \"inf\" where a finite number"),
        ("0 0 0 NaN 0 1", "line 1, column 7: found \"NaN\""),
        (
            "1 2 3 4 5",
            "line 1, column 1: found 5 columns where 6 (x y z dx dy dz), 4 (vertex dx dy dz)",
        ),
        (
            "0 0 0 0 0 1\n1 0 0 0 0 1 7",
            "line 2, column 13: found 7 columns where 6 as in the lines before",
        ),
        ("0 0 0 0 0 1\n1 0 0 0 0", "line 2, column 10: found 5 columns"),
        (
            "x y z u v w\n",
            "line 1, column 1: found the columns x, y, z, u, v, w where each of dx, dy, dz",
        ),
        ("vertex dx dy\n", "found the columns vertex, dx, dy where"),
        ("vertex x dx dy dz\n", "found the columns vertex, x, dx, dy, dz where"),
        ("-1 0 0 0", "line 1, column 1: found \"-1\" where a mesh vertex number"),
        ("1.5 0 0 0", "found \"1.5\" where a mesh vertex number"),
        ("13 0 0 0", "line 1, column 1: found vertex 13 where a mesh vertex on the surface"),
        (
            "0 0 0 0 0 1\n0 0 0 0 0 1",
            "line 2, column 1: found vertex 0 again where each vertex once",
        ),
        ("0.1 0 0 0 0 1", "found the point [0.1, 0.0, 0.0], which is 1e-1 from the nearest vertex"),
        (
            "vertex x y z dx dy dz\n0 1 1 1 0 0 0",
            "found vertex 0 at [1.0, 1.0, 1.0] where its reference coordinates",
        ),
        ("", "a.txt: found no vertices where"),
        ("# nothing\n\n", "a.txt: found no vertices where"),
    ] {
        let error = parse_displacement(Path::new("a.txt"), text.as_bytes(), &surface)
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{text:?}: {error}");
    }
    let error = parse_displacement(Path::new("a.txt"), b"0 0 0 0 0 1\n1 0 \xff", &surface)
        .unwrap_err()
        .to_string();
    assert!(error.contains("line 2") && error.contains("UTF-8"), "{error}");
    let error = read_displacement("lift.dat", &surface).unwrap_err().to_string();
    assert!(error.contains("known are .txt, .csv, .vtp, .vtu and .vtk"), "{error}");
    assert!(
        read_displacement("no-such-file.txt", &surface)
            .unwrap_err()
            .to_string()
            .contains("no-such-file.txt")
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_text_is_read_or_refused(text in "[0-9eE+., #\"xyzdv\n-]{0,80}", bytes in proptest::collection::vec(any::<u8>(), 0..60)) {
        let surface = surface();
        for content in [text.as_bytes(), &bytes, format!("x y z dx dy dz\n{text}").as_bytes()] {
            if let Ok(found) = parse_displacement(Path::new("a.csv"), content, &surface) {
                prop_assert_eq!(found.vertices.len(), found.values.len());
                prop_assert!(found.values.iter().flatten().all(|part| part.is_finite()));
                prop_assert!(found.vertices.iter().all(|vertex| surface.vertices().contains(vertex)));
            }
        }
    }
}
