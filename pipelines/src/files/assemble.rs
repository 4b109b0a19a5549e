//! From the cells of a file, of all dimensions mixed, to a mesh, its features and its fields.

use std::collections::{BTreeMap, HashMap, HashSet};

use tombolo_deform::mesh::{Cells, FeatureSource, Mesh, TaggedFaces, TaggedVertices, Vector};

use super::MeshFile;
use super::error::Flaw;
use crate::extract::{Association, Field};

/// The contents of a mesh file, as they stand there.
#[derive(Default)]
pub(super) struct FileContents {
    pub points: Vec<Vector>,
    /// Cells of all dimensions.
    pub cells: Cells,
    /// The feature of each cell, where the file gives any; only those of faces count.
    pub cell_tags: Option<Vec<Option<i64>>>,
    /// The feature of each point.
    pub point_tags: Option<Vec<i64>>,
    /// The features' names by number.
    pub names: BTreeMap<i64, String>,
    /// Cells to leave out, such as ghosts.
    pub left_out: Option<Vec<bool>>,
    pub fields: Vec<Field>,
    pub notes: Vec<String>,
}

impl FileContents {
    /// The cells of the highest dimension make the mesh, those of dimension 2 with a tag make its
    /// features.
    pub fn assemble(self) -> Result<MeshFile, Flaw> {
        let FileContents {
            points,
            cells,
            cell_tags,
            point_tags,
            names,
            left_out,
            mut fields,
            mut notes,
        } = self;
        cells.validate(points.len())?;
        let is_left_out =
            |cell: usize| left_out.as_ref().is_some_and(|out| out.get(cell) == Some(&true));
        let tag =
            |cell: usize| cell_tags.as_ref().and_then(|tags| tags.get(cell).copied().flatten());
        let dimension = (0..cells.len())
            .filter(|&cell| !is_left_out(cell))
            .map(|cell| cells.cell_type(cell).dimension())
            .max()
            .unwrap_or(0);
        let kept: Vec<usize> = (0..cells.len())
            .filter(|&cell| !is_left_out(cell) && cells.cell_type(cell).dimension() == dimension)
            .collect();
        let mut tagged: Vec<(usize, i64)> = (0..cells.len())
            .filter(|&cell| !is_left_out(cell) && cells.cell_type(cell).dimension() == 2)
            .filter_map(|cell| Some((cell, tag(cell)?)))
            .collect();
        if left_out.is_some() {
            note_count(
                &mut notes,
                (0..cells.len()).filter(|&cell| is_left_out(cell)).count(),
                "ghost or hidden cells",
            );
        }
        let faces_count = if dimension == 2 { 0 } else { tagged.len() };
        let lower =
            (0..cells.len()).filter(|&cell| !is_left_out(cell)).count() - kept.len() - faces_count;
        note_count(&mut notes, lower, "cells of lower dimension that carry no feature");

        // Vertices that no cell uses would be unknowns without an equation.
        let mut new_numbers = vec![u32::MAX; points.len()];
        let mut vertices = Vec::new();
        for &cell in &kept {
            for &vertex in cells.vertices(cell) {
                if let Some(slot) = new_numbers.get_mut(vertex as usize) {
                    *slot = 0;
                }
            }
        }
        for (vertex, slot) in new_numbers.iter_mut().enumerate() {
            if *slot == 0 {
                *slot = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
                vertices.push(vertex);
            }
        }
        note_count(&mut notes, points.len() - vertices.len(), "vertices that no cell uses");
        let select_points = vertices.len() < points.len();
        let select_cells = kept.len() < cells.len();
        for field in &mut fields {
            match field.association {
                Association::Vertex if select_points => select(field, &vertices),
                Association::Element if select_cells => select(field, &kept),
                _ => {}
            }
        }
        let features = if !tagged.is_empty() {
            let count = tagged.len();
            let is_numbered = |&vertex: &u32| new_numbers[vertex as usize] != u32::MAX;
            tagged.retain(|(cell, _)| cells.vertices(*cell).iter().all(is_numbered));
            note_count(
                &mut notes,
                count - tagged.len(),
                "tagged faces with vertices that no cell uses",
            );
            let (numbers, tags): (Vec<usize>, Vec<i64>) = tagged.into_iter().unzip();
            let faces = cells.subset(numbers).with_vertices(&new_numbers);
            let names = names_of(names, &tags);
            FeatureSource::Faces(TaggedFaces { faces, tags, names })
        } else if let Some(tags) = point_tags {
            let tags: Vec<i64> =
                vertices.iter().filter_map(|&vertex| tags.get(vertex).copied()).collect();
            let names = names_of(names, &tags);
            FeatureSource::Vertices(TaggedVertices { tags, names })
        } else {
            FeatureSource::SharpEdges
        };
        let mesh_cells = if select_cells || select_points {
            cells.subset(kept).with_vertices(&new_numbers)
        } else {
            cells
        };
        let mesh_points =
            vertices.iter().filter_map(|&vertex| points.get(vertex).copied()).collect();
        let mesh = Mesh::new(mesh_points, mesh_cells, features)?;
        notes.extend(mesh.cells().handedness_note());
        Ok(MeshFile { mesh, fields, notes })
    }
}

/// The names of the features that there are.
fn names_of(names: BTreeMap<i64, String>, tags: &[i64]) -> Vec<(i64, String)> {
    let there: HashSet<i64> = tags.iter().copied().collect();
    names.into_iter().filter(|(number, _)| there.contains(number)).collect()
}

fn select(field: &mut Field, kept: &[usize]) {
    let components = field.components;
    let values = kept
        .iter()
        .filter_map(|&tuple| field.values.get(tuple * components..(tuple + 1) * components))
        .flatten()
        .copied()
        .collect();
    field.values = values;
}

fn note_count(notes: &mut Vec<String>, count: usize, what: &str) {
    if count > 0 {
        notes.push(format!("left out: {count} {what}"));
    }
}

/// Which of the `cells` has each face, by the face's sorted vertices; the lowest number where two
/// do.
pub(super) fn owners_of_faces(cells: &Cells) -> HashMap<Vec<u32>, usize> {
    let mut owners = HashMap::new();
    for cell in 0..cells.len() {
        cells.for_each_face(cell, |face| {
            owners.entry(sorted(face)).or_insert(cell);
        });
    }
    owners
}

/// The vertices of a face in rising order.
pub(super) fn sorted(face: &[u32]) -> Vec<u32> {
    let mut key = face.to_vec();
    key.sort_unstable();
    key
}
