//! Files of meshes and displacements.

use std::{fs, path::Path};

use tombolo::{
    deform::{
        features::FeatureSettings,
        mesh::{CellType, Cells, FeatureSource, Mesh, NumberType, TaggedFaces},
        shapes::box_of_tets,
        surface::Surface,
    },
    pipelines::{
        extract::{Association, Field},
        files::{
            Compression, parse_displacement, parse_mesh, read_displacement, read_mesh,
            write_displacement, write_mesh,
        },
    },
};

use crate::seeds::Seeds;

const GMSH_2: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 7 \"in let\"\n3 1 \"volume\"\n$EndPhysicalNames\n\
$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n9 1 1 1\n$EndNodes\n$Elements\n4\n1 15 2 0 1 1\n2 2 2 7 1 1 3 2\n3 4 2 1 1 1 2 3 4\n4 4 2 1 1 2 9 3 4\n$EndElements\n";
const GMSH_4: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 7 \"inlet\"\n$EndPhysicalNames\n\
$Entities\n0 0 1 1\n1 0 0 0 1 1 0 1 7 0\n1 0 0 0 1 1 1 0 1 1\n$EndEntities\n$Nodes\n1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n\
$Elements\n2 2 1 2\n2 1 2 1\n1 1 3 2\n3 1 4 1\n2 1 2 3 4\n$EndElements\n";
const LEGACY: &str = "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nFIELD FieldData 1\n\
feature_names 1 2 string\nin%20let\nout\nPOINTS 5 double\n0 0 0 1 0 0 0 1 0 0 0 1 5 5 5\nCELLS 3 13\n4 0 1 2 3\n3 0 2 1\n\
3 0 1 3\nCELL_TYPES 3\n10 5 5\nCELL_DATA 3\nSCALARS features int 1\nLOOKUP_TABLE default\n-1 0 1\nPOINT_DATA 5\n\
VECTORS u float\n0 0 0 1 0 0 2 0 0 3 0 0 4 0 0\nMETADATA\nINFORMATION 0\n\nSCALARS p double\nLOOKUP_TABLE default\n0 1 2 3 4\n";
const LEGACY_NEW: &str = "# vtk DataFile Version 5.1\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n\
0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 2 4\nOFFSETS vtktypeint64\n0 4\nCONNECTIVITY vtktypeint64\n0 1 2 3\nCELL_TYPES 1\n10\n";
/// A polyhedron.
const XML: &str = r#"<VTKFile type="UnstructuredGrid" version="2.3"><UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="1">
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points><Cells>
<DataArray type="Int64" Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">4</DataArray><DataArray type="UInt8" Name="types" format="ascii">42</DataArray>
<DataArray type="Int64" Name="face_connectivity" format="ascii">0 2 1 0 1 3 1 2 3 2 0 3</DataArray>
<DataArray type="Int64" Name="face_offsets" format="ascii">3 6 9 12</DataArray>
<DataArray type="Int64" Name="polyhedron_to_faces" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int64" Name="polyhedron_offsets" format="ascii">4</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>
"#;
/// Triangles in the open.
const POLYGONS: &str = r#"<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian"><PolyData>
<Piece NumberOfPoints="4" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" NumberOfPolys="2">
<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0 1 1 0</DataArray></Points>
<Polys><DataArray type="Int32" Name="connectivity" format="ascii">0 1 2 2 1 3</DataArray>
<DataArray type="Int32" Name="offsets" format="ascii">3 6</DataArray></Polys>
<CellData><DataArray type="Int32" Name="features" format="ascii">0 1</DataArray></CellData></Piece></PolyData></VTKFile>
"#;

/// Volume cells with tagged faces, or those faces themselves.
fn small(is_volume: bool) -> Result<Mesh, String> {
    let text = |error: tombolo::deform::mesh::MeshError| error.to_string();
    let mut faces = Cells::new();
    for face in [[0, 2, 1], [0, 1, 3], [1, 2, 3]] {
        faces.push(CellType::Triangle, &face).map_err(text)?;
    }
    let names = vec![(0, "in <let>".to_owned()), (1, "out".to_owned())];
    let tagged = TaggedFaces { tags: vec![0, 1, 1], names, faces: faces.clone() };
    let cells = if is_volume {
        let mut cells = Cells::new();
        cells.push(CellType::Tetra, &[0, 1, 2, 3]).map_err(text)?;
        cells
    } else {
        faces
    };
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 1.0]];
    Mesh::new(points, cells, FeatureSource::Faces(tagged)).map_err(text)
}

/// Sound files of a format, by its extension.
pub(crate) fn mesh_seeds(extension: &str, seeds: &Seeds) -> Vec<Vec<u8>> {
    let texts: &[&str] = match extension {
        "msh" => &[GMSH_2, GMSH_4],
        "vtk" => &[LEGACY, LEGACY_NEW],
        "vtu" => &[XML],
        _ => &[POLYGONS],
    };
    let mut files: Vec<Vec<u8>> = texts.iter().map(|text| text.as_bytes().to_vec()).collect();
    let file = seeds.folder.path().join("sound").with_extension(extension);
    for compression in [Compression::None, Compression::Zlib] {
        let Ok(mesh) = small(extension != "vtp") else { continue };
        let field = Field {
            name: "p".into(),
            association: Association::Vertex,
            components: 1,
            number: NumberType::F64,
            values: vec![0.5, -1.0, 1e300, 0.0],
        };
        if write_mesh(&file, &mesh, &[field], compression).is_ok() {
            files.extend(fs::read(&file));
        }
    }
    files
}

/// Whether two meshes have the same vertices, to the bit, and the same cells. Features are numbered anew
/// where a file has negative numbers for them.
fn same(one: &Mesh, other: &Mesh) -> bool {
    let bits =
        |mesh: &Mesh| mesh.points().iter().map(|it| it.map(f64::to_bits)).collect::<Vec<_>>();
    let (cells, others) = (one.cells(), other.cells());
    let is_same = |cell| {
        cells.cell_type(cell) == others.cell_type(cell)
            && cells.vertices(cell) == others.vertices(cell)
            && cells.polyhedron_faces(cell) == others.polyhedron_faces(cell)
    };
    bits(one) == bits(other) && cells.len() == others.len() && (0..cells.len()).all(is_same)
}

/// A mesh that was read is the same when it was written and read again.
pub(crate) fn mesh(extension: &str, seeds: &Seeds, input: &[u8]) -> Result<String, String> {
    let name = Path::new("damaged").with_extension(extension);
    let file = match parse_mesh(&name, input) {
        Ok(file) => file,
        Err(error) => return Ok(error.to_string()),
    };
    let again = seeds.folder.path().join("again.vtu");
    if let Err(error) = write_mesh(&again, &file.mesh, &[], Compression::None) {
        return Ok(format!("it is not written: {error}"));
    }
    let read =
        read_mesh(&again).map_err(|error| format!("what was written is not read: {error}"))?;
    if !same(&read.mesh, &file.mesh) {
        return Err("what was written is read as another".into());
    }
    let kinds = (file.mesh.cells().is_empty(), file.fields.len().min(9), file.notes);
    Ok(format!("{kinds:?}"))
}

/// The surface whose vertices move.
fn surface() -> Result<Surface, String> {
    let mesh = box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]);
    Surface::extract(&mesh, &FeatureSettings::default()).map_err(|error| error.to_string())
}

pub(crate) fn displacement_seeds(seeds: &Seeds) -> Vec<Vec<u8>> {
    let Ok(surface) = surface() else { return Vec::new() };
    let file = seeds.folder.path().join("sound.txt");
    let values: Vec<_> =
        (0..surface.points().len()).map(|vertex| [0.1 * vertex as f64, 0.0, -1e-9]).collect();
    let mut files = vec![
        b"0 0 0 0.1 0 0\n1 0 0 0 0 -0.1\n".to_vec(),
        b"x,y,z,dx,dy,dz\n0,0,0,0.1,0,0\n1,1,1,0,0,1e-3\n".to_vec(),
        b"vertex,dx,dy,dz\n0,0.1,0,0\n3,0,0,1\n".to_vec(),
    ];
    if write_displacement(&file, &surface, &values).is_ok() {
        files.extend(fs::read(&file));
    }
    files
}

/// A displacement that was read is the same, to the bit, when it was written and read again.
pub(crate) fn displacement(seeds: &Seeds, input: &[u8]) -> Result<String, String> {
    let surface = surface()?;
    let found = match parse_displacement(Path::new("damaged.txt"), input, &surface) {
        Ok(found) => found,
        Err(error) => return Ok(error.to_string()),
    };
    if found.vertices.len() != found.values.len() {
        return Err("not one value for each vertex".into());
    }
    let mut all = vec![[0.0; 3]; surface.points().len()];
    for (vertex, value) in found.vertices.iter().zip(&found.values) {
        let at = surface.vertices().iter().position(|known| known == vertex);
        all[at.ok_or("a vertex that the surface does not have")?] = *value;
    }
    let again = seeds.folder.path().join("again.txt");
    write_displacement(&again, &surface, &all).map_err(|error| error.to_string())?;
    let read = read_displacement(&again, &surface)
        .map_err(|error| format!("what was written is not read: {error}"))?;
    for (vertex, value) in found.vertices.iter().zip(&found.values) {
        let at = read.vertices.iter().position(|known| known == vertex);
        if at.and_then(|at| read.values.get(at)).map(|it| it.map(f64::to_bits))
            != Some(value.map(f64::to_bits))
        {
            return Err(format!("what was written of vertex {vertex} is read as another"));
        }
    }
    Ok(format!("{} vertices", "i".repeat(found.vertices.len().min(9))))
}
