//! Gmsh's files: the same mesh in every version, as text and as bytes of either order.

use super::*;

/// A prism under a pyramid's neighbour, written by hand in each form: two volume cells, tagged and
/// untagged faces, a node that nothing uses, node tags with gaps.
const NODES: [(u64, Vector); 8] = [
    (3, [0.0, 0.0, 0.0]),
    (10, [1.0, 0.0, 0.0]),
    (11, [0.0, 1.0, 0.0]),
    (12, [0.0, 0.0, 1.0]),
    (20, [1.0, 0.0, 1.0]),
    (21, [0.0, 1.0, 1.0]),
    (22, [9.0, 9.0, 9.0]),
    (40, [0.1, 0.1, 2.0]),
];
/// Dimension, entity, Gmsh's element type, nodes.
const ELEMENTS: [(i32, i32, i32, &[u64]); 6] = [
    (0, 1, 15, &[3]),
    (1, 1, 1, &[3, 10]),
    (2, 1, 2, &[3, 11, 10]),
    (2, 2, 3, &[3, 10, 20, 12]),
    (3, 1, 6, &[3, 10, 11, 12, 20, 21]),
    (3, 1, 4, &[12, 20, 21, 40]),
];
/// The physical tags of entities (dimension, entity), several for one.
const PHYSICAL: [(i32, i32, &[i32]); 3] = [(2, 1, &[7, 8]), (3, 1, &[1]), (1, 1, &[5])];
const NAMES: &[u8] =
    b"$PhysicalNames\n3\n2 7 \"bottom of it\"\n2 8 \"other\"\n3 1 \"volume\"\n$EndPhysicalNames\n";

/// Writes numbers as text or bytes.
struct Writer {
    bytes: Vec<u8>,
    binary: bool,
    big_endian: bool,
    wide: bool,
}

impl Writer {
    fn put<const N: usize>(&mut self, mut little: [u8; N], text: &dyn std::fmt::Display) {
        if self.binary {
            if self.big_endian {
                little.reverse();
            }
            self.bytes.extend(little);
        } else {
            self.text(&format!("{text} "));
        }
    }

    fn text(&mut self, text: &str) {
        self.bytes.extend(text.as_bytes());
    }

    fn int(&mut self, value: i32) {
        self.put(value.to_le_bytes(), &value);
    }

    fn size(&mut self, value: u64) {
        if self.wide {
            self.put(value.to_le_bytes(), &value)
        } else {
            self.put((value as u32).to_le_bytes(), &value)
        }
    }

    fn point(&mut self, point: Vector) {
        point.into_iter().for_each(|value| self.put(value.to_le_bytes(), &value));
    }

    fn header(&mut self, version: &str) {
        let (kind, size) = (u8::from(self.binary), if self.wide { 8 } else { 4 });
        self.text(&format!("$MeshFormat\n{version} {kind} {size}\n"));
        if self.binary {
            self.int(1);
            self.text("\n");
        }
        self.text("$EndMeshFormat\n");
        self.bytes.extend(NAMES);
    }
}

fn physical(dimension: i32, entity: i32) -> &'static [i32] {
    PHYSICAL
        .iter()
        .find(|(d, e, _)| (*d, *e) == (dimension, entity))
        .map_or(&[], |(_, _, tags)| tags)
}

pub(super) fn version_4(binary: bool, big_endian: bool, wide: bool) -> Vec<u8> {
    let mut out = Writer { bytes: Vec::new(), binary, big_endian, wide };
    out.header("4.1");
    out.text("$Entities\n");
    let entities = [(0, 1), (1, 1), (2, 1), (2, 2), (3, 1)];
    for dimension in 0..4 {
        out.size(entities.iter().filter(|(d, _)| *d == dimension).count() as u64);
    }
    for (dimension, entity) in entities {
        out.int(entity);
        out.point([0.5; 3]);
        if dimension > 0 {
            out.point([1.5; 3]);
        }
        let tags = physical(dimension, entity);
        out.size(tags.len() as u64);
        tags.iter().for_each(|&tag| out.int(tag));
        if dimension > 0 {
            out.size(1);
            out.int(-1);
        }
    }
    out.text("\n$EndEntities\n$Nodes\n");
    [2, NODES.len() as u64, 3, 40].into_iter().for_each(|value| out.size(value));
    for (dimension, parametric, nodes) in [(2, 1, &NODES[..5]), (3, 0, &NODES[5..])] {
        [dimension, 1, parametric].into_iter().for_each(|value| out.int(value));
        out.size(nodes.len() as u64);
        nodes.iter().for_each(|(tag, _)| out.size(*tag));
        for (_, point) in nodes {
            out.point(*point);
            if parametric == 1 {
                out.put(0.25f64.to_le_bytes(), &0.25);
                out.put(0.75f64.to_le_bytes(), &0.75);
            }
        }
    }
    out.text("\n$EndNodes\n$Elements\n");
    [ELEMENTS.len() as u64, ELEMENTS.len() as u64, 1, 6]
        .into_iter()
        .for_each(|value| out.size(value));
    for (tag, (dimension, entity, kind, nodes)) in (1..).zip(ELEMENTS) {
        [dimension, entity, kind].into_iter().for_each(|value| out.int(value));
        out.size(1);
        out.size(tag);
        nodes.iter().for_each(|&node| out.size(node));
    }
    out.text("\n$EndElements\n");
    out.bytes
}

pub(super) fn version_2(binary: bool, big_endian: bool) -> Vec<u8> {
    let mut out = Writer { bytes: Vec::new(), binary, big_endian, wide: true };
    out.header("2.2");
    out.text(&format!("$Nodes\n{}\n", NODES.len()));
    for (tag, point) in NODES {
        out.int(tag as i32);
        out.point(point);
    }
    // An element of several physical groups stands once for each.
    let rows: Vec<_> = ELEMENTS
        .iter()
        .flat_map(|row| match physical(row.0, row.1) {
            [] => vec![(0, row)],
            tags => tags.iter().map(|&tag| (tag, row)).collect(),
        })
        .collect();
    out.text(&format!("\n$EndNodes\n$Elements\n{}\n", rows.len()));
    for (number, (physical, (_, entity, kind, nodes))) in (1..).zip(rows) {
        if binary {
            [*kind, 1, 2, number].into_iter().for_each(|value| out.int(value));
        } else {
            [number, *kind, 2].into_iter().for_each(|value| out.int(value));
        }
        [physical, *entity].into_iter().for_each(|value| out.int(value));
        nodes.iter().for_each(|&node| out.int(node as i32));
    }
    out.text("\n$EndElements\n");
    out.bytes
}

pub(super) fn all_forms() -> Vec<(String, Vec<u8>)> {
    let mut forms = vec![
        ("2.2 text".to_owned(), version_2(false, false)),
        ("4.1 text".to_owned(), version_4(false, false, true)),
    ];
    for big_endian in [false, true] {
        forms.push((format!("2.2 binary, big endian {big_endian}"), version_2(true, big_endian)));
        for wide in [false, true] {
            let name = format!("4.1 binary, big endian {big_endian}, wide {wide}");
            forms.push((name, version_4(true, big_endian, wide)));
        }
    }
    forms
}

fn parse(bytes: &[u8]) -> Result<MeshFile, crate::files::FileError> {
    parse_mesh(std::path::Path::new("a.msh"), bytes)
}

#[test]
fn every_form_gives_the_same_mesh() {
    for (form, bytes) in all_forms() {
        let file = parse(&bytes).unwrap_or_else(|error| panic!("{form}: {error}"));
        let points: Vec<Vector> =
            NODES.iter().filter(|(tag, _)| *tag != 22).map(|(_, point)| *point).collect();
        assert_eq!(file.mesh.points(), points, "{form}");
        let cells = file.mesh.cells().as_given();
        assert_eq!(cells.types(), [CellType::Wedge, CellType::Tetra], "{form}");
        // The first triangle of VTK's wedge looks outwards, Gmsh's inwards.
        assert_eq!(cells.vertices(0), [0, 2, 1, 3, 5, 4], "{form}");
        assert_eq!(cells.vertices(1), [3, 4, 5, 6], "{form}");
        let FeatureSource::Faces(tagged) = file.mesh.features() else {
            panic!("{form}: no features")
        };
        assert_eq!(
            tagged.tags,
            [7],
            "{form}: the first physical group; the untagged face has none"
        );
        assert_eq!(tagged.faces.vertices(0), [0, 2, 1], "{form}");
        assert_eq!(tagged.names, [(7, "bottom of it".to_owned())], "{form}");
        assert!(
            file.notes.iter().any(|note| note.contains("1 vertices")),
            "{form}: {:?}",
            file.notes
        );
    }
}

#[test]
fn refusals_say_where_and_what() {
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let message = |text: String| parse(text.as_bytes()).unwrap_err().to_string();
    let old = text(version_2(false, false));
    let new = text(version_4(false, false, true));
    let quadratic = old.replace("6 4 2 1 1 12 20 21 40", "6 11 2 1 1 12 20 21 40 3 10 11 3 10 11");
    let quadratic =
        quadratic.replace("7 4 2 1 1 12 20 21 40", "7 11 2 1 1 12 20 21 40 3 10 11 3 10 11");
    assert!(message(quadratic).contains("quadratic tetrahedron of 10 nodes"));
    assert!(message(old.replace("2.2 0 8", "4.0 0 8")).contains("version 4.0"));
    let missing = message(old.replace("12 20 21 40", "12 20 21 41"));
    assert!(missing.starts_with("a.msh, line ") && missing.contains("node 41"), "{missing}");
    assert!(message(old.replace("20 1 0 1", "20 1 zero 1")).contains("\"zero\""));
    assert!(message(old.replace("20 1 0 1", "20 1 NaN 1")).contains("coordinate y is NaN"));
    let many = message(new.replace("2 8 3 40", "2 99999999999999 3 40"));
    assert!(many.contains("99999999999999 nodes"), "{many}");
    assert!(message(String::new()).contains("$MeshFormat"));
    assert!(message(new.replace("$EndElements", "")).contains("$EndElements"));
}
