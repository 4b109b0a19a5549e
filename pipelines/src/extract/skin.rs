//! The outside of an extract of volume cells, which is what viewers can show of one.

use std::collections::HashSet;

use tombolo_deform::mesh::{CellType, Cells, MeshError};

use super::{Association, Extract, ExtractFeatures, Field};

/// The faces that only one cell of the extract has, and its cells of lower dimension, with their
/// fields; `None` where there is no volume cell. Element fields are those of the cell behind.
///
/// A quadrilateral of one cell and two triangles of another that fill it are a face of both.
///
/// # Errors
/// None for an extract whose cells are sound.
pub(crate) fn skin(extract: &Extract) -> Result<Option<Extract>, MeshError> {
    let cells = &extract.cells;
    if cells.dimension() < 3 {
        return Ok(None);
    }
    let mut faces = Vec::new();
    let mut corners = Vec::new();
    for cell in 0..cells.len() {
        if cells.cell_type(cell).dimension() == 3 {
            cells.for_each_face(cell, |face| {
                let start = corners.len();
                corners.extend(face);
                faces.push(Face { key: key(face), cell, start, end: corners.len() });
            });
        }
    }
    faces.sort_by_key(|face| (face.key, face.cell));
    let mut outer: Vec<&Face> = faces
        .chunk_by(|a, b| a.key == b.key)
        .filter_map(|same| if let [one] = same { Some(one) } else { None })
        .collect();
    remove_split(&mut outer, &corners);
    outer.sort_by_key(|face| (face.cell, face.start));

    let mut taken = Cells::new();
    let mut owners = Vec::new();
    let mut outer = outer.into_iter().peekable();
    for (cell, (cell_type, vertices)) in cells.iter().enumerate() {
        if cell_type.dimension() < 3 {
            taken.push(cell_type, vertices)?;
            owners.push(cell);
        }
        while let Some(face) = outer.next_if(|face| face.cell == cell) {
            let face = &corners[face.start..face.end];
            taken.push(face_type(face), face)?;
            owners.push(cell);
        }
    }
    Ok(Some(with_cells(extract, &taken, &owners)))
}

/// A face of a cell.
struct Face {
    /// Its four lowest corners; of a triangle three and `u32::MAX`.
    key: [u32; 4],
    cell: usize,
    start: usize,
    end: usize,
}

fn key(face: &[u32]) -> [u32; 4] {
    let mut sorted = face.to_vec();
    sorted.sort_unstable();
    sorted.resize(sorted.len().max(4), u32::MAX);
    [sorted[0], sorted[1], sorted[2], sorted[3]]
}

fn face_type(face: &[u32]) -> CellType {
    match face.len() {
        3 => CellType::Triangle,
        4 => CellType::Quad,
        _ => CellType::Polygon,
    }
}

/// Takes out quadrilaterals, with the two triangles that fill each of them.
fn remove_split(outer: &mut Vec<&Face>, corners: &[u32]) {
    let triangles: HashSet<[u32; 4]> =
        outer.iter().map(|face| face.key).filter(|key| key[3] == u32::MAX).collect();
    let mut inner = HashSet::new();
    for face in outer.iter().filter(|face| face.end - face.start == 4) {
        let [a, b, c, d] = [0, 1, 2, 3].map(|corner| corners[face.start + corner]);
        for halves in [[[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]] {
            let halves = halves.map(|half| key(&half));
            if halves.iter().all(|half| triangles.contains(half)) {
                inner.extend([face.key, halves[0], halves[1]]);
            }
        }
    }
    outer.retain(|face| !inner.contains(&face.key));
}

/// An extract of other cells, with the points that they have.
fn with_cells(extract: &Extract, cells: &Cells, owners: &[usize]) -> Extract {
    let mut numbers = vec![u32::MAX; extract.points.len()];
    let mut points: Vec<usize> = Vec::new();
    for &point in cells.connectivity() {
        if numbers[point as usize] == u32::MAX {
            numbers[point as usize] = 0;
            points.push(point as usize);
        }
    }
    points.sort_unstable();
    (0..).zip(&points).for_each(|(number, &point)| numbers[point] = number);
    let field = |field: &Field| {
        let of = |entities: &[usize]| {
            let tuple = |&entity: &usize| {
                &field.values[entity * field.components..(entity + 1) * field.components]
            };
            entities.iter().flat_map(tuple).copied().collect()
        };
        let values = match field.association {
            Association::Vertex => of(&points),
            Association::Element => of(owners),
            Association::Mesh => field.values.clone(),
        };
        Field { values, ..field.clone() }
    };
    let features = extract.features.as_ref().map(|features| {
        let of_cells = owners.iter().map(|&cell| features.of_cells[cell]).collect();
        ExtractFeatures { names: features.names.clone(), of_cells }.into()
    });
    Extract {
        vertices: extract
            .vertices
            .as_ref()
            .map(|vertices| points.iter().map(|&point| vertices[point]).collect()),
        cells: cells.with_vertices(&numbers).into(),
        features,
        fields: extract.fields.iter().map(field).collect(),
        points: points.iter().map(|&point| extract.points[point]).collect(),
    }
}
