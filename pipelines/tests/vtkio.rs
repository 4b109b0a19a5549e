//! Files of vtkio, a reader and writer of VTK's formats that we did not write, are read rightly, and
//! its model holds our meshes.
//!
//! vtkio is not the reader itself, because a damaged file makes it panic or ask for memory by a
//! count that it has not checked, and because it does not read arrays appended raw, as VTK writes
//! them by default.
#![cfg(feature = "vtkio")]

use tombolo_deform::mesh::{CellType, FeatureSource, Mesh, NumberType};
use tombolo_deform::shapes;
use tombolo_pipelines::extract::{Association, Field};
use tombolo_pipelines::files::{
    Compression, extract_from_vtkio, extract_to_vtkio, mesh_from_vtkio, mesh_to_vtkio, read_mesh,
    write_mesh,
};
use vtkio::model::{ByteOrder, DataSet, Piece, UnstructuredGridPiece, Version, VertexNumbers, Vtk};

fn mesh() -> Mesh {
    let tets = shapes::box_of_tets([2, 1, 1], [0.0; 3], [1.0 / 3.0, 1.0, 1.0]);
    // Without the tagged faces, so that the file holds the tetrahedra alone.
    Mesh::new(tets.points().to_vec(), tets.cells().clone(), Default::default()).unwrap()
}

#[test]
fn we_read_what_vtkio_writes() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = mesh();
    let cells = vtkio::model::Cells {
        cell_verts: VertexNumbers::XML {
            connectivity: mesh
                .cells()
                .connectivity()
                .iter()
                .map(|&vertex| u64::from(vertex))
                .collect(),
            offsets: mesh.cells().offsets().skip(1).map(|offset| offset as u64).collect(),
        },
        types: vec![vtkio::model::CellType::Tetra; mesh.cells().len()],
    };
    let file = Vtk {
        version: Version::new(),
        title: "box".into(),
        byte_order: ByteOrder::BigEndian,
        file_path: None,
        data: DataSet::inline(UnstructuredGridPiece {
            points: mesh.points().as_flattened().to_vec().into(),
            cells,
            data: Default::default(),
        }),
    };
    for name in ["xml.vtu", "legacy.vtk", "text.vtk"] {
        let path = folder.path().join(name);
        let file = file.clone();
        if name == "text.vtk" {
            file.export_ascii(&path).unwrap()
        } else {
            file.export(&path).unwrap()
        }
        let back = read_mesh(&path).unwrap();
        assert_eq!(back.mesh.points(), mesh.points(), "{name}");
        assert_eq!(back.mesh.cells(), mesh.cells(), "{name}");
        assert_eq!(back.mesh.cells().uniform_type(), Some(CellType::Tetra));
    }
}

/// Through the model a mesh stays what it is through a file of ours: cells, tagged faces, fields and
/// their types of numbers. Through vtkio's own files too.
#[test]
fn meshes_go_to_the_model_and_back() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = shapes::box_of_tets([3, 2, 1], [0.0; 3], [1.0 / 3.0, 1.0, 1.0]);
    let field = |name: &str, association, components: usize, count: usize, number| Field {
        name: name.into(),
        association,
        components,
        number,
        values: (0..components * count).map(|k| k as f64 - 3.0).collect(),
    };
    let (points, cells) = (mesh.points().len(), mesh.cells().len());
    let fields = vec![
        field("velocity of flow", Association::Vertex, 3, points, NumberType::F32),
        field("tag", Association::Element, 1, cells, NumberType::I16),
    ];
    let ours = folder.path().join("ours.vtu");
    write_mesh(&ours, &mesh, &fields, Compression::None).unwrap();
    let expected = read_mesh(&ours).unwrap();

    let model = mesh_to_vtkio(&mesh, &fields).unwrap();
    let direct = mesh_from_vtkio(&model).unwrap();
    let theirs = folder.path().join("theirs.vtu");
    model.clone().export(&theirs).unwrap();
    let mut imported = Vtk::import(&theirs).unwrap();
    imported.load_all_pieces().unwrap();
    for back in [direct, mesh_from_vtkio(&imported).unwrap(), read_mesh(&theirs).unwrap()] {
        assert_eq!(back.mesh.points(), mesh.points());
        assert_eq!(back.mesh.cells(), mesh.cells());
        assert_eq!(back.fields, expected.fields);
        // The names of features have no place in the model.
        let tags = |mesh: &Mesh| match mesh.features() {
            FeatureSource::Faces(tagged) => tagged.tags.clone(),
            other => panic!("{other:?}"),
        };
        assert_eq!(tags(&back.mesh), tags(&mesh));
    }

    let extract = extract_from_vtkio(&model).unwrap();
    assert_eq!(extract.points, mesh.points());
    assert!(extract.cells.len() > mesh.cells().len(), "the tagged faces are cells here");
    let again = extract_from_vtkio(&extract_to_vtkio(&extract).unwrap()).unwrap();
    assert_eq!(again, extract);
}

/// Makes a piece one that holds no mesh.
type Change = fn(&mut UnstructuredGridPiece);

/// What is no mesh is refused by name, whatever the model says.
#[test]
fn models_that_hold_no_mesh_are_refused() {
    let model = mesh_to_vtkio(&mesh(), &[]).unwrap();
    let changed = |change: Change| {
        let mut model = model.clone();
        if let DataSet::UnstructuredGrid { pieces, .. } = &mut model.data
            && let [Piece::Inline(piece)] = pieces.as_mut_slice()
        {
            change(piece);
        }
        (mesh_from_vtkio(&model).unwrap_err().to_string(), extract_from_vtkio(&model).is_err())
    };
    let cases: [(&str, Change); 6] = [
        ("point coordinates", |piece| piece.points = vec![0.0_f64; 4].into()),
        ("vertex", |piece| piece.points = vec![0.0_f64; 6].into()),
        ("cells with vertices", |piece| piece.cells.types.truncate(2)),
        ("polyhedron", |piece| piece.cells.types[0] = vtkio::model::CellType::Polyhedron),
        ("quadratic", |piece| piece.cells.types[0] = vtkio::model::CellType::QuadraticTetra),
        ("values of array 'p'", |piece| {
            piece.data.point = vec![vtkio::model::Attribute::generic("p", 1).with_data(vec![1.0])];
        }),
    ];
    for (word, change) in cases {
        let (message, extract_refused) = changed(change);
        assert!(message.contains(word) && extract_refused, "{word}: {message}");
    }
    let named = Vtk {
        data: DataSet::UnstructuredGrid {
            meta: None,
            pieces: vec![Piece::Source("piece_0.vtu".into(), None)],
        },
        ..model
    };
    let message = mesh_from_vtkio(&named).unwrap_err().to_string();
    assert!(message.contains("piece_0.vtu") && message.contains("load_all_pieces"), "{message}");
}
