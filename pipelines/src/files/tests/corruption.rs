//! Damaged files: whatever the bytes, reading ends with a mesh or an error.

use std::path::Path;
use std::sync::LazyLock;

use proptest::prelude::*;

use super::*;
use crate::files::vtk::{self, Format};

/// Sound files of every form, by the extension that says how to read them.
static SOUND: LazyLock<Vec<(&str, Vec<u8>)>> = LazyLock::new(|| {
    let mut files: Vec<(&str, Vec<u8>)> =
        super::gmsh_files::all_forms().into_iter().map(|(_, bytes)| ("a.msh", bytes)).collect();
    for compression in [Compression::None, Compression::Zlib] {
        for (name, format) in [("a.vtu", Format::Unstructured), ("a.vtk", Format::Legacy)] {
            let volume = one_of_each_for(name, 3);
            let bytes = vtk::from_mesh(&volume, &fields(&volume), format, compression).unwrap();
            files.push((name, bytes));
        }
        let surface = extract(&one_of_each(2));
        let bytes = vtk::from_extract(&surface, Format::Polygonal, compression).unwrap();
        files.push(("a.vtp", bytes));
    }
    for (name, text) in
        [("a.vtk", LEGACY), ("a.vtk", LEGACY_NEW), ("a.vtu", INLINE), ("a.vtu", NEW_POLYHEDRA)]
    {
        files.push((name, text.as_bytes().to_vec()));
    }
    files
});

const LEGACY: &str = "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nFIELD FieldData 1\n\
feature_names 1 2 string\nin%20let\nout\nPOINTS 5 double\n0 0 0 1 0 0 0 1 0 0 0 1 5 5 5\nCELLS 3 13\n4 0 1 2 3\n3 0 2 1\n\
3 0 1 3\nCELL_TYPES 3\n10 5 5\nCELL_DATA 3\nSCALARS features int 1\nLOOKUP_TABLE default\n-1 0 1\nPOINT_DATA 5\n\
VECTORS u float\n0 0 0 1 0 0 2 0 0 3 0 0 4 0 0\nMETADATA\nINFORMATION 0\n\nSCALARS p double\nLOOKUP_TABLE default\n0 1 2 3 4\n";

const LEGACY_NEW: &str = "# vtk DataFile Version 5.1\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n\
0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 2 4\nOFFSETS vtktypeint64\n0 4\nCONNECTIVITY vtktypeint64\n0 1 2 3\nCELL_TYPES 1\n10\n";

/// One tetrahedron, its coordinates in base64 with a 32-bit header.
const INLINE: &str = r#"<?xml version="1.0"?><VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>
<Piece NumberOfPoints="4" NumberOfCells="1"><Points><DataArray type="Float32" NumberOfComponents="3" format="binary">
MAAAAAAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAAAAAACAPw==</DataArray></Points><Cells>
<DataArray type="Int32" Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int32" Name="offsets" format="ascii">4</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">10</DataArray></Cells>
<CellData><DataArray type="UInt8" Name="vtkGhostType" format="ascii">0</DataArray></CellData></Piece></UnstructuredGrid></VTKFile>"#;

/// A polyhedron in the form of file version 2.3.
const NEW_POLYHEDRA: &str = r#"<VTKFile type="UnstructuredGrid" version="2.3"><UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="1">
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points><Cells>
<DataArray type="Int64" Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">4</DataArray><DataArray type="UInt8" Name="types" format="ascii">42</DataArray>
<DataArray type="Int64" Name="face_connectivity" format="ascii">0 2 1 0 1 3 1 2 3 2 0 3</DataArray>
<DataArray type="Int64" Name="face_offsets" format="ascii">3 6 9 12</DataArray>
<DataArray type="Int64" Name="polyhedron_to_faces" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int64" Name="polyhedron_offsets" format="ascii">4</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>"#;

#[test]
fn the_sound_files_are_sound() {
    for (name, bytes) in SOUND.iter() {
        parse_mesh(Path::new(name), bytes).unwrap_or_else(|error| panic!("{error}"));
    }
    let legacy = parse_mesh(Path::new("a.vtk"), LEGACY.as_bytes()).unwrap();
    let FeatureSource::Faces(tagged) = legacy.mesh.features() else { panic!("no features") };
    assert_eq!(tagged.names, [(0, "in let".to_owned()), (1, "out".to_owned())]);
    assert_eq!(legacy.mesh.points().len(), 4, "the fifth is used by nothing");
    assert_eq!(legacy.fields[1].values, [0.0, 1.0, 2.0, 3.0]);
    let inline = parse_mesh(Path::new("a.vtu"), INLINE.as_bytes()).unwrap();
    assert_eq!(inline.mesh.points()[2], [0.0, 1.0, 0.0]);
    let polyhedra = parse_mesh(Path::new("a.vtu"), NEW_POLYHEDRA.as_bytes()).unwrap();
    assert_eq!(polyhedra.mesh.cells().polyhedron_faces(0)[2], [1, 2, 3]);
    let ghost = INLINE.replace("format=\"ascii\">0</", "format=\"ascii\">1</");
    assert!(parse_mesh(Path::new("a.vtu"), ghost.as_bytes()).unwrap().mesh.cells().is_empty());
    let quadratic = INLINE.replace(">10<", ">24<");
    let error = parse_mesh(Path::new("a.vtu"), quadratic.as_bytes()).unwrap_err().to_string();
    assert!(error.contains("quadratic tetra"), "{error}");
}

#[test]
fn every_truncation_ends_well() {
    for (name, bytes) in SOUND.iter() {
        for length in 0..bytes.len() {
            // What matters is that it returns.
            let _ = parse_mesh(Path::new(name), &bytes[..length]);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_damage_ends_well(
        file in any::<prop::sample::Index>(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..4u8), 1..6),
    ) {
        let (name, sound) = &SOUND[file.index(SOUND.len())];
        let mut bytes = sound.clone();
        for (place, value, action) in edits {
            let at = place.index(bytes.len());
            match action {
                0 => bytes[at] = value,
                1 => bytes[at] ^= 1 << (value % 8),
                2 => bytes.insert(at, b"0123456789 -\"<"[usize::from(value) % 14]),
                _ => drop(bytes.drain(at..(at + usize::from(value % 16)).min(bytes.len() - 1).max(at))),
            }
        }
        // What matters is that it returns.
        let _ = parse_mesh(Path::new(name), &bytes);
    }

    #[test]
    fn any_bytes_end_well(name in prop::sample::select(vec!["a.msh", "a.vtk", "a.vtu", "a.vtp"]), bytes: Vec<u8>) {
        prop_assert!(parse_mesh(Path::new(name), &bytes).is_err());
    }
}
