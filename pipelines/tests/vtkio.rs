//! Files agree with vtkio, a reader and writer of VTK's formats that we did not write.
//!
//! It is a judge here and not the reader itself, because a damaged file makes it panic or ask for memory by a count that it has
//! not checked.
#![cfg(feature = "files")]

use tombolo_deform::mesh::{CellType, Mesh};
use tombolo_deform::shapes;
use tombolo_pipelines::extract::{Association, Field};
use tombolo_pipelines::files::{Compression, read_mesh, write_mesh};
use vtkio::model::{Attribute, DataSet, Piece, UnstructuredGridPiece, Version, VertexNumbers, Vtk};

fn mesh() -> Mesh {
    let tets = shapes::box_of_tets([2, 1, 1], [0.0; 3], [1.0 / 3.0, 1.0, 1.0]);
    // Without the tagged faces, so that the file holds the tetrahedra alone.
    Mesh::new(tets.points().to_vec(), tets.cells().clone(), Default::default()).unwrap()
}

fn field(mesh: &Mesh) -> Field {
    let values = mesh.points().iter().map(|point| point[0] * point[1] / 7.0).collect();
    Field { name: "pressure".into(), association: Association::Vertex, components: 1, values }
}

fn piece(data: DataSet) -> UnstructuredGridPiece {
    let DataSet::UnstructuredGrid { mut pieces, .. } = data else { panic!("not an unstructured grid") };
    assert_eq!(pieces.len(), 1);
    let Piece::Inline(piece) = pieces.remove(0) else { panic!("not inline") };
    *piece
}

#[test]
fn vtkio_reads_what_we_write() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.vtu");
    let mesh = mesh();
    let field = field(&mesh);
    write_mesh(&path, &mesh, std::slice::from_ref(&field), Compression::None).unwrap();

    let mut file = Vtk::import(&path).unwrap();
    file.load_all_pieces().unwrap();
    let piece = piece(file.data);
    assert_eq!(piece.points.cast_into::<f64>().unwrap(), mesh.points().as_flattened());
    let (connectivity, offsets) = piece.cells.cell_verts.into_xml();
    assert!(connectivity.iter().copied().eq(mesh.cells().connectivity().iter().map(|&vertex| u64::from(vertex))));
    assert!(offsets.iter().copied().eq(mesh.cells().offsets()[1..].iter().map(|&offset| offset as u64)));
    let found = piece.data.point.iter().find_map(|attribute| match attribute {
        Attribute::DataArray(array) if array.name == "pressure" => array.data.cast_into::<f64>(),
        _ => None,
    });
    assert_eq!(found, Some(field.values));
}

#[test]
fn we_read_what_vtkio_writes() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = mesh();
    let cells = vtkio::model::Cells {
        cell_verts: VertexNumbers::XML {
            connectivity: mesh.cells().connectivity().iter().map(|&vertex| u64::from(vertex)).collect(),
            offsets: mesh.cells().offsets()[1..].iter().map(|&offset| offset as u64).collect(),
        },
        types: vec![vtkio::model::CellType::Tetra; mesh.cells().len()],
    };
    let file = Vtk {
        version: Version::new(),
        title: "box".into(),
        byte_order: vtkio::model::ByteOrder::LittleEndian,
        file_path: None,
        data: DataSet::inline(UnstructuredGridPiece {
            points: mesh.points().as_flattened().to_vec().into(),
            cells,
            data: Default::default(),
        }),
    };
    for name in ["xml.vtu", "legacy.vtk"] {
        let path = folder.path().join(name);
        file.clone().export(&path).unwrap();
        let back = read_mesh(&path).unwrap();
        assert_eq!(back.mesh.points(), mesh.points(), "{name}");
        assert_eq!(back.mesh.cells(), mesh.cells(), "{name}");
        assert_eq!(back.mesh.cells().uniform_type(), Some(CellType::Tetra));
    }
}
