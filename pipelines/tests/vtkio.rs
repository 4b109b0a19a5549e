//! Files of vtkio, a reader and writer of VTK's formats that we did not write, are read rightly.
//!
//! vtkio is not the reader itself, because a damaged file makes it panic or ask for memory by a
//! count that it has not checked, and because it does not read arrays appended raw, as VTK writes
//! them by default.
#![cfg(feature = "files")]

use tombolo_deform::mesh::{CellType, Mesh};
use tombolo_deform::shapes;
use tombolo_pipelines::files::read_mesh;
use vtkio::model::{ByteOrder, DataSet, UnstructuredGridPiece, Version, VertexNumbers, Vtk};

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
            offsets: mesh.cells().offsets()[1..].iter().map(|&offset| offset as u64).collect(),
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
