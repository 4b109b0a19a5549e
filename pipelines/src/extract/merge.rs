//! Extracts of the ranks, merged to one on rank 0.

use std::{collections::HashMap, sync::Arc};

use tombolo_deform::mesh::{CellType, Cells, NumberType, Vector};

use super::layout::Layout;
use super::source::{Origin, Whole};
use super::supports::Support;
use super::{ABSENT, Association, Extract, Extracted, Field, is_absent};
use tombolo_deform::communicator::{Communicator, Garbled, Reader, Writer, agree};
use tombolo_deform::distributed::DistributedError;

/// The piece that one rank brings.
struct RankPiece {
    points: Vec<Vector>,
    /// Points and what all ranks call them: the vertices of the edge that they lie on; and whether
    /// other ranks may bring them too.
    named: Vec<(u32, Support, bool)>,
    cells: Cells,
    fields: Vec<Field>,
}

/// The extract that the pieces of the ranks make, on rank 0. Points on the borders of the parts
/// come once; of what several ranks have there, the lowest rank's holds. Collective.
///
/// A field is there where every rank that has vertices (or cells) in the extract brings it.
///
/// # Errors
/// Where a rank has no piece; the same on all ranks.
pub(crate) fn merged(
    communicator: &dyn Communicator,
    whole: &Whole,
    extracted: Option<&Extracted>,
) -> Result<Option<Arc<Extract>>, DistributedError> {
    let piece = extracted.ok_or("it has no extract");
    let piece = agree(communicator, piece)?;
    let result = match &piece.origin {
        Origin::Whole => return Ok(Some(Arc::clone(&piece.extract))),
        Origin::Boundary => on_boundary(communicator, whole, piece),
        Origin::Vertices | Origin::Between(_) | Origin::Loose => {
            anywhere(communicator, whole, piece)
        }
        Origin::Probe(layout, indices) => probed(communicator, layout, indices, piece),
    };
    Ok(agree(communicator, result)?)
}

/// Of the surface all is known but where it is and what the fields are.
fn on_boundary(
    communicator: &dyn Communicator,
    whole: &Whole,
    piece: &Extracted,
) -> Result<Option<Arc<Extract>>, DistributedError> {
    let extract = &piece.extract;
    let owned: Vec<usize> = whole.boundary.owned_indices().collect();
    let mut message = Writer::default();
    owned.iter().for_each(|&index| message.f64s(&extract.points[index]));
    write_fields(&mut message, &extract.fields, &owned);
    let gathered = communicator.gather(0, &message.into_bytes());
    let (Some(root), Some(surface), Some(messages)) =
        (whole.boundary.root(), &whole.surface, gathered)
    else {
        return Ok(None);
    };
    let mut points = vec![[0.0; 3]; surface.vertices.len()];
    let mut merging = Fields::default();
    for (rank, bytes) in messages.iter().enumerate() {
        let mut reader = Reader::new(rank, bytes);
        let (owned, faces) = (root.owned(rank), root.faces(rank));
        for &vertex in owned {
            points[vertex as usize] = reader.vector()?;
        }
        let fields = read_fields(&mut reader, owned.len(), faces.len())?;
        merging.add(fields, owned, faces);
    }
    Ok(Some(Arc::new(Extract {
        fields: merging.finish(points.len(), surface.cells.len()),
        points,
        vertices: Some(Arc::clone(&surface.vertices)),
        cells: Arc::clone(&surface.cells),
        features: Some(Arc::clone(&surface.features)),
    })))
}

/// Of other extracts nothing is known before.
fn anywhere(
    communicator: &dyn Communicator,
    whole: &Whole,
    piece: &Extracted,
) -> Result<Option<Arc<Extract>>, DistributedError> {
    let message = described(whole, piece);
    let Some(messages) = communicator.gather(0, &message) else { return Ok(None) };
    let mut points = Vec::new();
    let mut cells = Cells::new();
    let mut merging = Fields::default();
    let mut by_name: HashMap<Support, u32> = HashMap::new();
    let mut vertices = Vec::new();
    for (rank, bytes) in messages.iter().enumerate() {
        let piece = RankPiece::read(rank, bytes)?;
        let mut numbers = vec![u32::MAX; piece.points.len()];
        let mut names = piece.named.into_iter().peekable();
        for (index, point) in (0..).zip(&piece.points) {
            #[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
            let next = points.len() as u32;
            let named = names.next_if(|(named, ..)| *named == index);
            let name = named.map(|(_, name, _)| name);
            let number = match named {
                Some((_, name, true)) => *by_name.entry(name).or_insert(next),
                _ => next,
            };
            numbers[index as usize] = number;
            if number == next {
                points.push(*point);
                vertices.push(name.map_or(u32::MAX, |name| name.vertices[0]));
            }
        }
        let first_cell = cells.len();
        let renumbered = piece.cells.with_vertices(&numbers);
        for (cell, (cell_type, vertices)) in renumbered.iter().enumerate() {
            match renumbered.polyhedron_faces(cell) {
                [] => cells.push(cell_type, vertices)?,
                faces => cells.push_polyhedron(faces)?,
            }
        }
        #[expect(clippy::cast_possible_truncation, reason = "cells are numbered with 32 bits")]
        let merged_cells: Vec<u32> = (first_cell as u32..cells.len() as u32).collect();
        merging.add(piece.fields, &numbers, &merged_cells);
    }
    let fields = merging.finish(points.len(), cells.len());
    let vertices = matches!(piece.origin, Origin::Vertices).then(|| vertices.into());
    Ok(Some(Arc::new(Extract { points, vertices, cells: Arc::new(cells), features: None, fields })))
}

/// Of a probe all is known but which rank has found which point.
fn probed(
    communicator: &dyn Communicator,
    layout: &Layout,
    indices: &[u32],
    piece: &Extracted,
) -> Result<Option<Arc<Extract>>, DistributedError> {
    let extract = &piece.extract;
    let mut message = Writer::default();
    message.u32s(indices);
    extract.points.iter().for_each(|point| message.f64s(point));
    write_fields(&mut message, &extract.fields, &(0..indices.len()).collect::<Vec<_>>());
    let Some(messages) = communicator.gather(0, &message.into_bytes()) else { return Ok(None) };
    let mut pieces = Vec::with_capacity(messages.len());
    let mut numbers = vec![u32::MAX; layout.points];
    for (rank, bytes) in messages.iter().enumerate() {
        let mut reader = Reader::new(rank, bytes);
        let indices = reader.u32s()?;
        for &index in &indices {
            *numbers.get_mut(index as usize).ok_or(reader.garbled())? = 0;
        }
        let points = indices.iter().map(|_| reader.vector()).collect::<Result<Vec<_>, _>>()?;
        let fields = read_fields(&mut reader, indices.len(), 0)?;
        pieces.push((indices, points, fields));
    }
    let found = numbers.iter_mut().filter(|number| **number == 0);
    let count = (0..).zip(found).map(|(number, slot)| *slot = number).count();
    let mut points = vec![[0.0; 3]; count];
    let mut merging = Fields::default();
    for (indices, of_rank, fields) in pieces {
        let indices: Vec<u32> = indices.iter().map(|&index| numbers[index as usize]).collect();
        indices.iter().zip(of_rank).for_each(|(&index, point)| points[index as usize] = point);
        merging.add(fields, &indices, &[]);
    }
    let cells = layout.cells(&numbers)?;
    Ok(Some(Arc::new(Extract {
        fields: merging.finish(count, cells.len()),
        points,
        vertices: None,
        cells: Arc::new(cells),
        features: None,
    })))
}

/// The name that all ranks give a point of an extract, and whether other ranks may have it too;
/// `None` for a point that none has.
pub(super) fn name(whole: &Whole, piece: &Extracted, index: usize) -> Option<(Support, bool)> {
    let numbers = whole.shared.numbers();
    let support = match &piece.origin {
        Origin::Between(supports) => supports.of(index),
        Origin::Loose => return None,
        _ => Support::new(&[piece.extract.vertices.as_ref()?[index]], 0),
    };
    let is_shared = support.vertices().all(|vertex| whole.is_shared[vertex as usize]);
    let vertices: Vec<u32> = support.vertices().map(|vertex| numbers[vertex as usize]).collect();
    Some((Support::new(&vertices, support.layer), is_shared))
}

/// A rank's piece as it is sent.
fn described(whole: &Whole, piece: &Extracted) -> Vec<u8> {
    let extract = &piece.extract;
    // Points between vertices that other ranks have too are shared; of a vertex extract all are
    // named, for their own sake.
    let is_between = matches!(piece.origin, Origin::Between(_));
    let name =
        |index: usize| name(whole, piece, index).filter(|(_, is_shared)| *is_shared || !is_between);
    let named = (0..extract.points.len()).filter_map(|index| Some((index, name(index)?)));
    let named: Vec<(usize, (Support, bool))> = named.collect();
    let mut message =
        Writer::with_capacity(32 * extract.points.len() + 4 * extract.cells.connectivity().len());
    message.u64(extract.points.len() as u64);
    extract.points.iter().for_each(|point| message.f64s(point));
    message.u64(named.len() as u64);
    for (index, (support, is_shared)) in named {
        #[expect(clippy::cast_possible_truncation, reason = "points are numbered with 32 bits")]
        message.u32(index as u32);
        support.vertices.iter().for_each(|&vertex| message.u32(vertex));
        message.u64(support.layer);
        message.u8(u8::from(is_shared));
    }
    message.u64(extract.cells.len() as u64);
    for (cell, (cell_type, vertices)) in extract.cells.iter().enumerate() {
        message.u8(cell_type.vtk());
        match extract.cells.polyhedron_faces(cell) {
            [] => message.u32s(vertices),
            faces => {
                message.u64(faces.len() as u64);
                faces.iter().for_each(|face| message.u32s(face));
            }
        }
    }
    write_fields(&mut message, &extract.fields, &(0..extract.points.len()).collect::<Vec<_>>());
    message.into_bytes()
}

impl RankPiece {
    fn read(rank: usize, bytes: &[u8]) -> Result<Self, DistributedError> {
        let garbled = || DistributedError::from(Garbled { rank });
        let mut reader = Reader::new(rank, bytes);
        let count = reader.count(24)?;
        let points = (0..count).map(|_| reader.vector()).collect::<Result<Vec<_>, _>>()?;
        let count = reader.count(29)?;
        let named = (0..count).map(|_| {
            let index = reader.u32()?;
            let mut vertices = [0; 4];
            for vertex in &mut vertices {
                *vertex = reader.u32()?;
            }
            let support = Support { vertices, layer: reader.u64()? };
            Ok((index, support, reader.u8()? != 0))
        });
        let named = named.collect::<Result<Vec<_>, DistributedError>>()?;
        let mut cells = Cells::new();
        for _ in 0..reader.count(1)? {
            match CellType::from_vtk(reader.u8()?).ok_or_else(garbled)? {
                CellType::Polyhedron => {
                    let faces = reader.count(8)?;
                    cells.push_polyhedron(&(0..faces).map(|_| reader.u32s()).collect::<Result<
                        Vec<_>,
                        _,
                    >>(
                    )?)?;
                }
                cell_type => cells.push(cell_type, &reader.u32s()?)?,
            }
        }
        cells.validate(points.len())?;
        let fields = read_fields(&mut reader, points.len(), cells.len())?;
        Ok(Self { points, named, cells, fields })
    }
}

/// The fields, of the points only these.
fn write_fields(message: &mut Writer, fields: &[Field], points: &[usize]) {
    message.u64(fields.len() as u64);
    for field in fields {
        message.text(&field.name);
        message.u8(association_code(field.association));
        message.u8(number_code(field.number));
        message.u64(field.components as u64);
        match field.association {
            Association::Mesh => {
                message.u64(field.values.len() as u64);
                message.f64s(&field.values);
            }
            Association::Element => message.f64s(&field.values),
            Association::Vertex => {
                for &point in points {
                    message.f64s(
                        &field.values[point * field.components..(point + 1) * field.components],
                    );
                }
            }
        }
    }
}

const ASSOCIATIONS: [Association; 3] =
    [Association::Vertex, Association::Element, Association::Mesh];

fn association_code(association: Association) -> u8 {
    (0..).zip(ASSOCIATIONS).find(|(_, known)| *known == association).map_or(0, |(code, _)| code)
}

fn number_code(number: NumberType) -> u8 {
    (0..).zip(NumberType::ALL).find(|(_, known)| *known == number).map_or(0, |(code, _)| code)
}

fn read_fields(
    reader: &mut Reader,
    points: usize,
    cells: usize,
) -> Result<Vec<Field>, DistributedError> {
    (0..reader.count(18)?)
        .map(|_| {
            let name = reader.text()?;
            let association =
                *ASSOCIATIONS.get(usize::from(reader.u8()?)).ok_or(reader.garbled())?;
            let number = *NumberType::ALL.get(usize::from(reader.u8()?)).ok_or(reader.garbled())?;
            let components = usize::try_from(reader.u64()?).unwrap_or(usize::MAX);
            let count = match association {
                Association::Vertex => points.saturating_mul(components),
                Association::Element => cells.saturating_mul(components),
                Association::Mesh => reader.count(8)?,
            };
            let values = reader.f64s(count)?;
            Ok(Field { name, association, components, number, values })
        })
        .collect()
}

/// Fields that come together.
#[derive(Default)]
struct Fields {
    /// Each with how many values were set.
    fields: Vec<(Field, usize)>,
    points: usize,
    cells: usize,
    /// The fields of the rank without a point or a cell of the extract that knows most of them.
    without_values: Vec<Field>,
    /// Fields of the mesh as a whole, from the lowest rank that brings it.
    of_mesh: Vec<Field>,
}

impl Fields {
    /// Takes in what one rank brings for these points and cells of the whole. What a lower rank
    /// brought for a point stays.
    fn add(&mut self, fields: Vec<Field>, points: &[u32], cells: &[u32]) {
        let mut without_values = Vec::new();
        for field in fields {
            let (indices, before) = match field.association {
                Association::Mesh => {
                    if self.of_mesh.iter().all(|known| known.name != field.name) {
                        self.of_mesh.push(field);
                    }
                    continue;
                }
                Association::Vertex => (points, self.points),
                Association::Element => (cells, self.cells),
            };
            if indices.is_empty() {
                without_values.push(field);
                continue;
            }
            let same = |(known, _): &(Field, usize)| {
                (&known.name, known.association, known.components)
                    == (&field.name, field.association, field.components)
            };
            let known = match self.fields.iter().position(same) {
                Some(known) => known,
                None => {
                    let Field { ref name, association, components, number, .. } = field;
                    let empty = Field {
                        name: name.clone(),
                        association,
                        components,
                        number,
                        values: Vec::new(),
                    };
                    self.fields.push((empty, 0));
                    self.fields.len() - 1
                }
            };
            let (known, set) = &mut self.fields[known];
            // Only a field that every rank before this one has brought can be whole.
            if *set < before {
                continue;
            }
            if known.number != field.number {
                known.number = NumberType::F64;
            }
            let components = known.components;
            for (index, values) in indices.iter().zip(field.values.chunks(components.max(1))) {
                let start = *index as usize * components;
                if known.values.len() < start + components {
                    known.values.resize(start + components, ABSENT);
                }
                if is_absent(known.values[start]) {
                    known.values[start..start + components].copy_from_slice(values);
                }
            }
            *set = before + indices.len();
        }
        // A rank without any of the mesh knows fewer than one that has nothing of the extract.
        if without_values.len() > self.without_values.len() {
            self.without_values = without_values;
        }
        self.points += points.len();
        self.cells += cells.len();
    }

    /// The fields that all ranks have brought.
    fn finish(self, points: usize, cells: usize) -> Vec<Field> {
        let (all_points, all_cells) = (self.points, self.cells);
        // Where all of the extract is empty, its fields are too.
        let is_empty = |field: &Field| match field.association {
            Association::Vertex => points == 0,
            Association::Element => cells == 0,
            Association::Mesh => false,
        };
        let without_values = self.without_values.into_iter().filter(is_empty);
        let whole = |(mut field, set): (Field, usize)| {
            let (brought, count) = match field.association {
                Association::Vertex => (all_points, points),
                Association::Element => (all_cells, cells),
                Association::Mesh => return None,
            };
            field.settle();
            (set == brought && field.values.len() == count * field.components).then_some(field)
        };
        self.fields
            .into_iter()
            .filter_map(whole)
            .chain(without_values)
            .chain(self.of_mesh)
            .collect()
    }
}
