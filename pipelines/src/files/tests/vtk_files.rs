//! What is written is read back alike, by this crate and by VTK.

use std::path::{Path, PathBuf};
use std::process::Command;

use super::*;
use crate::files::{Series, write, write_compressed};

/// The files that hold meshes of any dimension.
const WHOLE_MESHES: [(&str, Compression); 3] = [
    ("mesh.vtu", Compression::None),
    ("mesh.vtu", Compression::Zlib),
    ("mesh.vtk", Compression::None),
];

#[test]
fn a_mesh_comes_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    for dimension in 0..=3 {
        for (name, compression) in WHOLE_MESHES {
            let mesh = one_of_each_for(name, dimension);
            let path = folder.path().join("deep").join(name);
            write_mesh(&path, &mesh, &fields(&mesh), compression).unwrap();
            let back = read_mesh(&path).unwrap();
            assert_eq!(back.mesh, mesh, "dimension {dimension}");
            assert_eq!(back.fields, fields(&mesh), "dimension {dimension}");
        }
    }
}

#[test]
fn numbers_keep_their_type() {
    let folder = tempfile::tempdir().unwrap();
    // The types of cells that each kind of file can hold.
    let mesh = one_of_each_for("mesh.vtk", 3);
    let counts = [
        (Association::Vertex, mesh.points().len()),
        (Association::Element, mesh.cells().len()),
        (Association::Mesh, 3),
    ];
    let field = |number: NumberType, (association, count): (Association, usize)| {
        let least = if number.name().starts_with('u') { 0.0 } else { -3.0 };
        let step = if number.is_real() { 0.25 } else { 1.0 };
        let values = (0..2 * count).map(|k| least + step * k as f64).collect();
        Field { name: number.name().into(), association, components: 2, number, values }
    };
    let all: Vec<Field> = counts
        .iter()
        .flat_map(|count| NumberType::ALL.map(|number| field(number, *count)))
        .collect();
    for (name, compression) in WHOLE_MESHES {
        let path = folder.path().join(name);
        write_mesh(&path, &mesh, &all, compression).unwrap();
        assert_eq!(read_mesh(&path).unwrap().fields, all);
        let written = Extract { fields: all.clone(), ..extract(&mesh) };
        write_compressed(&path, &written, compression).unwrap();
        let back = read_mesh(&path).unwrap().fields;
        assert_eq!(back.iter().filter(|field| all.contains(field)).count(), all.len());
    }
    write(folder.path().join("index.pvtu"), &Extract { fields: all, ..extract(&mesh) }).unwrap();
    let index = std::fs::read_to_string(folder.path().join("index.pvtu")).unwrap();
    assert_eq!(index.matches("type=\"UInt16\" Name=\"uint16\"").count(), 2, "{index}");
}

#[test]
fn an_extract_comes_back_with_its_features() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = one_of_each(2);
    let path = folder.path().join("extract.vtu");
    write(&path, &extract(&mesh)).unwrap();
    let back = read_mesh(&path).unwrap();
    assert_eq!(back.mesh.cells(), mesh.cells());
    let FeatureSource::Faces(tagged) = back.mesh.features() else {
        panic!("{:?}", back.mesh.features())
    };
    assert_eq!(tagged.tags, [0, 1, 0, 1, 0]);
    assert_eq!(tagged.names, [(0, "even".to_owned()), (1, "odd".to_owned())]);
}

#[test]
fn negative_tags_keep_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let mut cells = Cells::new();
    cells.push(CellType::Triangle, &[0, 1, 2]).unwrap();
    let tagged = TaggedFaces { faces: cells.clone(), tags: vec![-5], names: vec![] };
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = Mesh::new(points, cells, FeatureSource::Faces(tagged)).unwrap();
    let path = folder.path().join("mesh.vtu");
    write_mesh(&path, &mesh, &[], Compression::None).unwrap();
    let FeatureSource::Faces(back) = read_mesh(&path).unwrap().mesh.features().clone() else {
        panic!("no faces")
    };
    assert_eq!(back.names, [(back.tags[0], "feature--5".to_owned())]);
}

#[test]
fn features_of_vertices_keep_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let plain = one_of_each_for("mesh.vtk", 3);
    let tags: Vec<i64> = (0..plain.points().len() as i64).map(|vertex| vertex % 2).collect();
    let names = vec![(0, "inlet".to_owned()), (1, "outlet".to_owned())];
    let features = FeatureSource::Vertices(TaggedVertices { tags, names });
    let mesh = Mesh::new(plain.points().to_vec(), plain.cells().clone(), features).unwrap();
    for (name, compression) in WHOLE_MESHES {
        let path = folder.path().join(name);
        write_mesh(&path, &mesh, &[], compression).unwrap();
        assert_eq!(read_mesh(&path).unwrap().mesh.features(), mesh.features(), "{name}");
    }
}

/// Names that stand in an array of text, as they were written up to now and as other programs may
/// write them.
#[test]
fn names_as_text_are_read() {
    let text = |field_data: &str| {
        format!(
            "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\"><UnstructuredGrid><FieldData>{field_data}</FieldData>\
             <Piece NumberOfPoints=\"3\" NumberOfCells=\"1\"><CellData><DataArray type=\"Int64\" Name=\"features\">7</DataArray>\
             </CellData><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\">0 0 0 1 0 0 0 1 0</DataArray></Points>\
             <Cells><DataArray type=\"Int64\" Name=\"connectivity\">0 1 2</DataArray><DataArray type=\"Int64\" \
             Name=\"offsets\">3</DataArray><DataArray type=\"UInt8\" Name=\"types\">5</DataArray></Cells></Piece>\
             </UnstructuredGrid></VTKFile>"
        )
    };
    let names = |field_data: &str| {
        let read = parse_mesh(Path::new("a.vtu"), text(field_data).as_bytes()).unwrap();
        let FeatureSource::Faces(tagged) = read.mesh.features() else {
            panic!("{:?}", read.mesh.features())
        };
        tagged.names.clone()
    };
    let old = "<Array type=\"String\" Name=\"feature_names\" NumberOfTuples=\"2\" format=\"ascii\">105 110 0 111 117 116 0</Array>\
               <DataArray type=\"Int64\" Name=\"feature_numbers\" NumberOfTuples=\"2\">3 7</DataArray>";
    assert_eq!(names(old), [(7, "out".to_owned())]);
    // Numbers of other kinds are no names.
    let others = "<DataArray type=\"Float64\" Name=\"TimeValue\">7 2</DataArray><DataArray type=\"Int64\" Name=\"size\">7 3</DataArray>\
                  <DataArray type=\"Int64\" Name=\"cycle\">7</DataArray>";
    assert_eq!(names(others), []);
    assert_eq!(
        names(
            "<DataArray type=\"Int32\" Name=\"in\">3 2</DataArray><DataArray type=\"Int32\" Name=\"out\">7 2 8 2</DataArray>"
        ),
        [(7, "out".to_owned())]
    );
}

/// Each piece has its own arrays, and is not looked for among those of all.
#[test]
fn many_pieces_are_read_in_the_time_of_one() {
    let piece = |offset: usize| {
        format!(
            "<Piece NumberOfPoints=\"3\" NumberOfCells=\"1\"><PointData><DataArray type=\"Float64\" Name=\"p\">{offset} 0 1</DataArray>\
             </PointData><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\">{offset} 0 0 {offset} 1 0 {offset} 0 1</DataArray></Points>\
             <Cells><DataArray type=\"Int64\" Name=\"connectivity\">0 1 2</DataArray><DataArray type=\"Int64\" \
             Name=\"offsets\">3</DataArray><DataArray type=\"UInt8\" Name=\"types\">5</DataArray></Cells></Piece>"
        )
    };
    let file = |parts: &str| {
        format!(
            "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\"><UnstructuredGrid>{parts}</UnstructuredGrid></VTKFile>"
        )
    };
    let field_data = "<FieldData><DataArray type=\"Float64\" Name=\"q\">7</DataArray></FieldData>";
    let parts: String = (0..3).map(piece).collect();
    let (_, p) = values("a.vtu", file(&(parts + field_data)).as_bytes(), "p");
    assert_eq!(p, [0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 2.0, 0.0, 1.0]);

    let empty = "<Piece></Piece>".repeat(100_000);
    let arrays = "<PointData><DataArray type=\"Int64\" Name=\"a\"/></PointData>".repeat(100_000);
    let parts = format!("{empty}<Piece>{arrays}</Piece>");
    // What comes of it does not matter, but that it comes: by the square of the pieces it took minutes.
    let begun = std::time::Instant::now();
    let _ = parse_mesh(Path::new("a.vtu"), file(&parts).as_bytes());
    let _ = parse_mesh(
        Path::new("a.vtu"),
        file(&format!("<Piece>{arrays}</Piece>").repeat(2)).as_bytes(),
    );
    assert!(begun.elapsed().as_secs() < 30, "{:?}", begun.elapsed());
}

#[test]
fn refusals_name_the_file_and_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let message = |result: Result<(), crate::files::FileError>| result.unwrap_err().to_string();
    let mesh = one_of_each(3);
    assert!(
        message(write(folder.path().join("a.vtp"), &extract(&mesh))).contains("write it as .vtu")
    );
    assert!(message(write(folder.path().join("a.stl"), &extract(&mesh))).contains("'stl'"));
    let prisms = message(write(folder.path().join("a.vtk"), &extract(&mesh)));
    assert!(prisms.contains("type 15") && prisms.contains(".vtu"), "{prisms}");
    let mut twice = extract(&mesh);
    twice.fields[1].name = "features".into();
    assert!(message(write(folder.path().join("a.vtu"), &twice)).contains("'features'"));
    let mut short = extract(&mesh);
    short.fields[0].values.pop();
    assert!(message(write(folder.path().join("a.vtu"), &short)).contains("velocity"));
    assert!(
        read_mesh(folder.path().join("none.vtu")).unwrap_err().to_string().contains("none.vtu")
    );
    assert_eq!(
        std::fs::read_dir(folder.path()).unwrap().count(),
        0,
        "a refused file leaves nothing behind"
    );
}

#[test]
fn a_series_is_whole_after_every_entry() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.pvd");
    let mut series = Series::create(&path).unwrap();
    for step in 0..3 {
        series
            .push(f64::from(step) * 0.1, &folder.path().join(format!("run & {step}.vtu")))
            .unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.matches("<DataSet ").count(), step as usize + 1);
        assert!(text.contains(&format!("file=\"run &amp; {step}.vtu\"")), "{text}");
        assert!(text.ends_with("</Collection>\n</VTKFile>\n"));
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_series_names_files_from_where_it_lies() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a/b/run.pvd");
    let files = ["a/b/0/wall.vtu", "a/1.vtu", "c/2.vtu"].map(|file| folder.path().join(file));
    let mut series = Series::create(&path).unwrap();
    files.iter().for_each(|file| series.push(0.5, file).unwrap());
    // Once more, at another time.
    series.push(0.75, &files[2]).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    for file in ["0/wall.vtu", "../1.vtu", "../../c/2.vtu"] {
        assert_eq!(text.matches(&format!("file=\"{file}\"")).count(), 1, "{text}");
    }
    let found: Vec<(f64, PathBuf)> = Series::entries(&path).unwrap().collect();
    let of = |file: &str| folder.path().join("a/b").join(file);
    let expected = [(0.5, of("0/wall.vtu")), (0.5, of("../1.vtu")), (0.75, of("../../c/2.vtu"))];
    assert_eq!(found, expected);
    // What is read back is written as it was.
    Series::of(&path, found.into_iter()).unwrap();
    assert_eq!(Series::entries(&path).unwrap().collect::<Vec<_>>(), expected);
    assert_eq!(Series::entries(&folder.path().join("none.pvd")).unwrap().count(), 0);
}

/// The values of a field of a file.
fn values(name: &str, bytes: &[u8], field: &str) -> (NumberType, Vec<f64>) {
    let file = parse_mesh(Path::new(name), bytes).unwrap_or_else(|error| panic!("{error}"));
    let found = file.fields.iter().find(|known| known.name == field).expect(field);
    (found.number, found.values.clone())
}

#[test]
fn bits_and_large_numbers_are_read_as_vtk_reads_them() {
    let large = (1_u64 << 63) + 5;
    let expected = (NumberType::U64, vec![1.0, large as f64, 0.0, 7.0]);
    let on = (NumberType::U8, vec![1.0, 0.0, 1.0, 1.0]);
    for (form, bits, cell) in [("ascii", "1 0 1 1", "1"), ("binary", "AQAAALA=", "AQAAAIA=")] {
        let text = format!(
            r#"<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian"><UnstructuredGrid>
            <Piece NumberOfPoints="4" NumberOfCells="1"><PointData>
            <DataArray type="Bit" Name="on" format="{form}">{bits}</DataArray>
            <DataArray type="UInt64" Name="large" format="ascii">1 {large} 0 7</DataArray></PointData>
            <CellData><DataArray type="Bit" Name="cell" format="{form}">{cell}</DataArray></CellData>
            <Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>
            <Cells><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2 3</DataArray>
            <DataArray type="Int64" Name="offsets" format="ascii">4</DataArray>
            <DataArray type="UInt8" Name="types" format="ascii">10</DataArray></Cells>
            </Piece></UnstructuredGrid></VTKFile>"#
        );
        assert_eq!(values("a.vtu", text.as_bytes(), "on"), on, "{form}");
        assert_eq!(values("a.vtu", text.as_bytes(), "large"), expected, "{form}");
        assert_eq!(values("a.vtu", text.as_bytes(), "cell"), (NumberType::U8, vec![1.0]), "{form}");
    }
    let points = [0_u8, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1].map(f32::from);
    let legacy = |is_binary: bool| {
        let word = if is_binary { "BINARY" } else { "ASCII" };
        let mut file = format!(
            "# vtk DataFile Version 3.0\n\n{word}\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n"
        );
        let mut bytes = Vec::new();
        let mut put = |binary: &[u8], text: String, next: &str| {
            bytes.extend(std::mem::take(&mut file).into_bytes());
            bytes.extend(if is_binary { binary.to_vec() } else { text.into_bytes() });
            bytes.extend(format!("\n{next}\n").into_bytes());
        };
        put(
            &points.map(f32::to_be_bytes).concat(),
            points.map(|x| x.to_string()).join(" "),
            "CELLS 1 5",
        );
        put(
            &[4_i32, 0, 1, 2, 3].map(i32::to_be_bytes).concat(),
            "4 0 1 2 3".into(),
            "CELL_TYPES 1",
        );
        put(
            &10_i32.to_be_bytes(),
            "10".into(),
            "POINT_DATA 4\nSCALARS on bit\nLOOKUP_TABLE default",
        );
        put(
            &[0b1011_0000],
            "1 0 1 1".into(),
            "SCALARS large unsigned_long 1\nLOOKUP_TABLE default",
        );
        let numbers = [1, large, 0, 7];
        let text = numbers.map(|it| it.to_string()).join(" ");
        put(&numbers.map(u64::to_be_bytes).concat(), text, "COLOR_SCALARS colour 1");
        put(&[77, 0, 255, 128], "0.301961 0 1 0.5".into(), "");
        bytes
    };
    for is_binary in [false, true] {
        let bytes = legacy(is_binary);
        assert_eq!(values("a.vtk", &bytes, "on"), on, "binary: {is_binary}");
        assert_eq!(values("a.vtk", &bytes, "large"), expected, "binary: {is_binary}");
        let colour = (NumberType::U8, vec![77.0, 0.0, 255.0, 128.0]);
        assert_eq!(values("a.vtk", &bytes, "colour"), colour, "binary: {is_binary}");
    }
}

/// Runs `tests/vtk/read_back.py` with Debian's VTK; `None` where the environment says that there is
/// none.
fn vtk(arguments: &[&Path]) -> Option<String> {
    if std::env::var_os("TOMBOLO_WITHOUT_VTK").is_some() {
        eprintln!("skipped: TOMBOLO_WITHOUT_VTK is set, so VTK reads nothing back");
        return None;
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/vtk/read_back.py");
    let output = Command::new("/usr/bin/python3").arg(script).args(arguments).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "VTK (apt-get install python3-vtk9): {errors}");
    assert!(errors.is_empty(), "{errors}");
    Some(String::from_utf8(output.stdout).unwrap())
}

/// The output of `read_back.py` for a file: every number as its bits.
pub(super) fn described(
    points: &[Vector],
    cells: &[(u8, Vec<u32>)],
    arrays: &[(&str, &str, usize, Vec<f64>)],
) -> String {
    use std::fmt::Write;
    let bits = |values: &[f64]| {
        values
            .iter()
            .fold(String::new(), |text, value| text + &format!(" {:016x}", value.to_bits()))
    };
    let mut text = format!("points{}\n", bits(points.as_flattened()));
    for (cell_type, vertices) in cells {
        let vertices =
            vertices.iter().fold(String::new(), |text, vertex| text + &format!(" {vertex}"));
        writeln!(text, "cell {cell_type}{vertices}").unwrap();
    }
    for (place, name, components, values) in arrays {
        writeln!(text, "{place} {name:?} {components}{}", bits(values)).unwrap();
    }
    text
}

#[test]
fn vtk_reads_what_is_written() {
    let folder = tempfile::tempdir().unwrap();
    for dimension in 0..=3 {
        for name in ["e.vtu", "e.vtp", "e.vtk"] {
            let polygonal = name == "e.vtp";
            if polygonal && dimension == 3 {
                continue;
            }
            for compression in [Compression::None, Compression::Zlib] {
                let mesh = one_of_each_for(name, dimension);
                let path = folder.path().join(name);
                let mut extract = extract(&mesh);
                extract.fields[1].name = "p".into();
                write_compressed(&path, &extract, compression).unwrap();
                let Some(read) = vtk(&[&path]) else { return };
                // VTK's order of polygonal data, and its types there.
                let mut order: Vec<usize> = (0..mesh.cells().len()).collect();
                if polygonal {
                    let strip =
                        |&cell: &usize| mesh.cells().cell_type(cell) == CellType::TriangleStrip;
                    if dimension == 2 {
                        order.sort_by_key(strip);
                    }
                }
                let cells: Vec<(u8, Vec<u32>)> = order
                    .iter()
                    .map(|&cell| {
                        match (mesh.cells().cell_type(cell), mesh.cells().vertices(cell)) {
                            (CellType::Pixel, &[a, b, c, d]) if polygonal => {
                                (CellType::Quad.vtk(), vec![a, b, d, c])
                            }
                            (cell_type, vertices) => (cell_type.vtk(), vertices.to_vec()),
                        }
                    })
                    .collect();
                let permuted = |values: Vec<f64>, components: usize| -> Vec<f64> {
                    order
                        .iter()
                        .flat_map(|&cell| values[cell * components..][..components].to_vec())
                        .collect()
                };
                let tags = (0..cells.len()).map(|cell| (cell % 2) as f64).collect();
                let [velocity, pressure, stress] =
                    <[Field; 3]>::try_from(extract.fields.clone()).unwrap();
                let expected = described(
                    mesh.points(),
                    &cells,
                    &[
                        ("point", "velocity", 3, velocity.values),
                        ("cell", "features", 1, permuted(tags, 1)),
                        ("cell", "p", 1, permuted(pressure.values, 1)),
                        ("cell", "stress", 9, permuted(stress.values, 9)),
                        ("field", "even", 1, vec![0.0, 2.0]),
                        ("field", "odd", 1, vec![1.0, 2.0]),
                    ],
                );
                assert_eq!(read, expected, "dimension {dimension}, {name}, {compression:?}");
            }
        }
    }
}

/// A file that names another is read by VTK as that other is, but for field data, which VTK does
/// not look for there.
#[test]
fn vtk_finds_the_data_that_an_index_names() {
    let folder = tempfile::tempdir().unwrap();
    let without_field_data = |text: &str| -> Vec<String> {
        let kept = |line: &&str| !(line.starts_with("field ") || line.starts_with("text "));
        text.lines().filter(kept).map(str::to_owned).collect()
    };
    for (name, piece, dimension) in [
        ("a & b.vtpd", "a & b_0.vtu", 3),
        ("c.pvtu", "c_0.vtu", 3),
        ("d.pvtp", "d_0.vtp", 2),
        ("e.vtpd", "e_0.vtu", 2),
    ] {
        let mesh = one_of_each(dimension);
        let mut extract = extract(&mesh);
        extract.fields[0].name = "velocity <m/s>".into();
        let index = folder.path().join(name);
        write(&index, &extract).unwrap();
        let piece = index.with_extension("").join(piece);
        let (Some(found), Some(expected)) = (vtk(&[&index]), vtk(&[&piece])) else { return };
        assert_eq!(without_field_data(&found), without_field_data(&expected), "{name}");
        assert!(found.contains("velocity <m/s>"), "{found}");
    }
    let refused =
        write(folder.path().join("f.pvtp"), &extract(&one_of_each(3))).unwrap_err().to_string();
    assert!(refused.contains(".vtu"), "{refused}");
    assert!(!folder.path().join("f.pvtp").exists() && !folder.path().join("f").exists());
}

/// VTK writes its own files in every way it can; each reads the same.
#[test]
fn what_vtk_writes_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = one_of_each(3);
    let original = folder.path().join("original.vtu");
    write_mesh(&original, &mesh, &fields(&mesh), Compression::None).unwrap();
    let Some(names) = vtk(&[Path::new("--rewrite"), &original, folder.path()]) else { return };
    assert!(names.lines().count() >= 18, "{names}");
    for name in names.lines() {
        let back = read_mesh(folder.path().join(name)).unwrap_or_else(|error| panic!("{error}"));
        if name.contains("lossless") {
            assert_eq!(back.mesh.points(), mesh.points(), "{name}");
            assert_eq!(back.fields, fields(&mesh), "{name}");
        }
        assert_eq!(back.mesh.cells(), mesh.cells(), "{name}");
        assert_eq!(back.mesh.features(), mesh.features(), "{name}");
    }
    // Polygonal data with all four kinds of cells: the order of cell data is VTK's own.
    let Some(names) = vtk(&[Path::new("--polygonal"), folder.path()]) else { return };
    assert!(names.lines().count() >= 4, "{names}");
    for name in names.lines() {
        let back = read_mesh(folder.path().join(name)).unwrap_or_else(|error| panic!("{error}"));
        let sizes: Vec<f64> =
            back.mesh.cells().iter().map(|(_, vertices)| vertices.len() as f64).collect();
        assert_eq!(
            back.fields.iter().find(|field| field.name == "size").unwrap().values,
            sizes,
            "{name}"
        );
        assert_eq!(sizes, [3.0, 4.0, 5.0], "{name}: the two polygons and the strip");
    }
}
