//! Tests of the mesh files.

mod corruption;
mod displacement_files;
mod gmsh_files;
mod meshio_files;
mod vtk_files;

use std::sync::Arc;

use tombolo_deform::mesh::{
    CellType, Cells, FeatureSource, Mesh, NumberType, TaggedFaces, TaggedVertices, Vector,
};

use super::{Compression, MeshFile, parse_mesh, read_mesh, write_mesh};
use crate::extract::{Association, Extract, ExtractFeatures, Field};

/// One cell of each type of a dimension, none sharing a vertex, at coordinates that no short
/// decimal gives exactly.
fn one_of_each(dimension: usize) -> Mesh {
    one_of_some(dimension, |_| true)
}

/// One cell of each type of a dimension that legacy files can be written with: vtkio has no type
/// for prisms of five and six sides.
fn one_of_each_for(file: &str, dimension: usize) -> Mesh {
    one_of_some(dimension, |cell_type| {
        let is_prism = matches!(cell_type, CellType::PentagonalPrism | CellType::HexagonalPrism);
        !file.ends_with(".vtk") || !is_prism
    })
}

fn one_of_some(dimension: usize, is_chosen: impl Fn(CellType) -> bool) -> Mesh {
    let mut points: Vec<Vector> = Vec::new();
    let mut cells = Cells::new();
    for cell_type in CellType::ALL
        .into_iter()
        .filter(|&cell_type| cell_type.dimension() == dimension && is_chosen(cell_type))
    {
        let first = points.len() as u32;
        let count = cell_type.vertex_count().unwrap_or(5) as u32;
        for k in 0..count {
            let (a, b) = (f64::from(first + k), f64::from(k));
            points.push([a.sqrt() / 3.0, (0.7 * b).sin() * 1e-7, (1.0 + a).ln() * 1e5]);
        }
        let rows: Vec<u32> = (first..first + count).collect();
        if cell_type == CellType::Polyhedron {
            let at = |k: [u32; 3]| k.map(|k| first + k).to_vec();
            let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 4], [0, 4, 2], [2, 4, 3]].map(at);
            cells.push_polyhedron(&faces).unwrap();
        } else {
            cells.push(cell_type, &rows).unwrap();
        }
    }
    let features = match dimension {
        3 => {
            let mut faces = Cells::new();
            let mut tags = Vec::new();
            for cell in 0..cells.len() {
                cells.for_each_face(cell, |face| {
                    let kind = CellType::of_polygon(face.len());
                    faces.push(kind, face).unwrap();
                    tags.push(if cell % 2 == 0 { 17 } else { 4 });
                });
            }
            let names =
                vec![(4, "side & \"end\" <of> Straße".to_owned()), (17, "inlet".to_owned())];
            FeatureSource::Faces(TaggedFaces { faces, tags, names })
        }
        2 => FeatureSource::Faces(TaggedFaces {
            tags: (0..cells.len() as i64).collect(),
            names: vec![(0, "first".into())],
            faces: cells.clone(),
        }),
        _ => {
            let tags: Vec<i64> = (0..points.len() as i64).map(|vertex| vertex % 3 - 1).collect();
            FeatureSource::Vertices(tags.into())
        }
    };
    Mesh::new(points, cells, features).unwrap()
}

fn fields(mesh: &Mesh) -> Vec<Field> {
    let values = |count: usize| (0..count).map(|k| (k as f64 * 1.7).exp().recip() - 0.1).collect();
    let (vertices, cells) = (mesh.points().len(), mesh.cells().len());
    vec![
        Field {
            name: "velocity".into(),
            association: Association::Vertex,
            components: 3,
            number: NumberType::F64,
            values: values(3 * vertices),
        },
        Field {
            name: "p <rgh>".into(),
            association: Association::Element,
            components: 1,
            number: NumberType::F64,
            values: values(cells),
        },
        Field {
            name: "stress".into(),
            association: Association::Element,
            components: 9,
            number: NumberType::F64,
            values: values(9 * cells),
        },
    ]
}

/// A mesh as an extract whose features are those of its cells.
fn extract(mesh: &Mesh) -> Extract {
    let names = vec!["even".to_owned(), "odd".to_owned()];
    let of_cells = (0..mesh.cells().len() as u32).map(|cell| cell % 2).collect();
    Extract {
        points: mesh.points().to_vec(),
        vertices: None,
        cells: Arc::new(mesh.cells().clone()),
        features: Some(Arc::new(ExtractFeatures { names, of_cells })),
        fields: fields(mesh),
    }
}
