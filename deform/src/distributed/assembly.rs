//! The surface of a whole mesh, put together on rank 0 from the boundaries of the ranks' parts.

use std::sync::Arc;

use super::{DistributedError, Part};
use crate::communicator::{Garbled, Reader, Writer};
use crate::features::{FaceTags, FeatureSettings, face_tags};
use crate::mesh::{CellType, Cells, SharedVertices, Vector};
use crate::number::index;
use crate::surface::{BoundaryFaces, Surface};
use crate::topology::indices;

/// The way between the surface of the whole mesh and the ranks that have its vertices, as rank 0
/// knows it.
#[derive(Debug, Clone, PartialEq)]
pub struct Root {
    pub(super) surface: Arc<Surface>,
    /// For each rank the surface vertices that it has, those of them that it owns, and the surface
    /// faces that it has.
    pub(super) held: Vec<Vec<u32>>,
    pub(super) owned: Vec<Vec<u32>>,
    pub(super) faces: Vec<Vec<u32>>,
}

/// The message by which rank 0 is told of the boundary of this rank's part.
pub(super) fn described(
    part: &Part,
    shared: &SharedVertices,
    vertices: &[u32],
    owned: &[u32],
    faces: &BoundaryFaces,
) -> Vec<u8> {
    let mut message = Writer::with_capacity(64 + 40 * vertices.len() + 32 * faces.cells.len());
    message.u64(part.cells.len() as u64);
    message.u8(u8::from(faces.may_run_either_way));
    let numbers: Vec<u32> =
        vertices.iter().map(|&vertex| shared.numbers()[vertex as usize]).collect();
    message.u32s(&numbers);
    message.u32s(owned);
    let owned_vertices = owned.iter().map(|&index| vertices[index as usize]);
    owned_vertices.for_each(|vertex| message.f64s(&part.points[vertex as usize]));
    let index_of = indices(part.points.len(), vertices);
    let sizes: Vec<u32> = faces.faces.iter().map(|(_, vertices)| index(vertices.len())).collect();
    let corners: Vec<u32> =
        faces.faces.connectivity().iter().map(|&vertex| index_of[vertex as usize]).collect();
    message.u32s(&faces.cells);
    message.u32s(&faces.positions);
    message.u32s(&sizes);
    message.u32s(&corners);
    match &part.global_cells {
        None => message.u8(0),
        Some(numbers) => {
            message.u8(1);
            faces.cells.iter().for_each(|&cell| message.u64(numbers[cell as usize]));
        }
    }
    match face_tags(&part.features, &faces.faces) {
        None => message.u8(0),
        Some(FaceTags { tags, names }) => {
            message.u8(1);
            for tag in tags {
                message.u8(u8::from(tag.is_some()));
                message.i64(tag.unwrap_or_default());
            }
            message.u64(names.len() as u64);
            for (tag, name) in names {
                message.i64(tag);
                message.text(&name);
            }
        }
    }
    message.into_bytes()
}

/// The boundary of one rank's part, as rank 0 reads it.
struct RankBoundary {
    cells: u64,
    may_run_either_way: bool,
    numbers: Vec<u32>,
    owned: Vec<u32>,
    points: Vec<Vector>,
    face_cells: Vec<u32>,
    face_numbers: Vec<u32>,
    sizes: Vec<u32>,
    corners: Vec<u32>,
    global_cells: Option<Vec<u64>>,
    tags: Option<FaceTags>,
}

impl RankBoundary {
    fn read(rank: usize, bytes: &[u8]) -> Result<Self, DistributedError> {
        let mut reader = Reader::new(rank, bytes);
        let (cells, may_run_either_way) = (reader.u64()?, reader.u8()? != 0);
        let (numbers, owned) = (reader.u32s()?, reader.u32s()?);
        let points = owned.iter().map(|_| reader.vector()).collect::<Result<_, _>>()?;
        let (face_cells, face_numbers) = (reader.u32s()?, reader.u32s()?);
        let (sizes, corners) = (reader.u32s()?, reader.u32s()?);
        let sum: u64 = sizes.iter().map(|&size| u64::from(size)).sum();
        let fits = face_cells.len() == sizes.len()
            && face_numbers.len() == sizes.len()
            && sum == corners.len() as u64
            && corners.iter().chain(&owned).all(|&index| (index as usize) < numbers.len());
        if !fits {
            return Err(Garbled { rank }.into());
        }
        let global_cells = match reader.u8()? {
            0 => None,
            _ => Some(face_cells.iter().map(|_| reader.u64()).collect::<Result<_, _>>()?),
        };
        let tags = match reader.u8()? {
            0 => None,
            _ => {
                let tag = |reader: &mut Reader| -> Result<Option<i64>, DistributedError> {
                    let is_there = reader.u8()? != 0;
                    let tag = reader.i64()?;
                    Ok(is_there.then_some(tag))
                };
                let tags = face_cells.iter().map(|_| tag(&mut reader)).collect::<Result<_, _>>()?;
                let count = reader.count(16)?;
                let names = (0..count).map(|_| Ok((reader.i64()?, reader.text()?)));
                let names = names.collect::<Result<_, DistributedError>>()?;
                Some(FaceTags { tags, names })
            }
        };
        Ok(Self {
            cells,
            may_run_either_way,
            numbers,
            owned,
            points,
            face_cells,
            face_numbers,
            sizes,
            corners,
            global_cells,
            tags,
        })
    }
}

impl Root {
    /// The surface that the messages of all ranks make.
    pub(super) fn assembled(
        messages: &[Vec<u8>],
        settings: &FeatureSettings,
    ) -> Result<Self, DistributedError> {
        let parts: Vec<RankBoundary> = messages
            .iter()
            .enumerate()
            .map(|(rank, bytes)| RankBoundary::read(rank, bytes))
            .collect::<Result<_, _>>()?;
        // Each vertex once, by its owner.
        let mut owned: Vec<(u32, usize, usize)> = Vec::new();
        for (rank, part) in parts.iter().enumerate() {
            let numbers = part.owned.iter().map(|&index| part.numbers[index as usize]);
            owned.extend(numbers.enumerate().map(|(index, number)| (number, rank, index)));
        }
        owned.sort_unstable();
        let vertices: Vec<u32> = owned.iter().map(|&(number, ..)| number).collect();
        let points: Vec<Vector> =
            owned.iter().map(|&(_, rank, index)| parts[rank].points[index]).collect();
        let held: Vec<Vec<u32>> = parts
            .iter()
            .enumerate()
            .map(|(rank, part)| positions_in(&vertices, &part.numbers).ok_or(Garbled { rank }))
            .collect::<Result<_, _>>()?;
        let owned = parts.iter().zip(&held);
        let owned = owned
            .map(|(part, held)| part.owned.iter().map(|&index| held[index as usize]).collect())
            .collect();

        // The faces in the order of their cells' global numbers, or else of the ranks.
        let known = |part: &RankBoundary| {
            let numbers = part.global_cells.as_ref();
            part.face_cells.is_empty()
                || numbers.is_some_and(|numbers| {
                    numbers.iter().all(|&number| number < u64::from(u32::MAX))
                })
        };
        let all_known = parts.iter().all(known);
        let mut order: Vec<(u32, u32, usize, usize, usize)> = Vec::new();
        let mut first_cell = 0_u64;
        for (rank, part) in parts.iter().enumerate() {
            let mut start = 0;
            for face in 0..part.face_cells.len() {
                let global =
                    part.global_cells.as_ref().filter(|_| all_known).map(|numbers| numbers[face]);
                let cell = global.unwrap_or(first_cell + u64::from(part.face_cells[face]));
                let cell = u32::try_from(cell).unwrap_or(u32::MAX);
                order.push((cell, part.face_numbers[face], rank, face, start));
                start += part.sizes[face] as usize;
            }
            first_cell += part.cells;
        }
        order.sort_unstable();
        let either_way =
            parts.iter().any(|part| part.may_run_either_way && !part.face_cells.is_empty());
        let tagged = parts.iter().any(|part| part.tags.is_some());
        let mut tags = FaceTags::default();
        for part in &parts {
            tags.names.extend(part.tags.iter().flat_map(|tags| tags.names.iter().cloned()));
        }
        let mut faces = Cells::new();
        let mut owner_cells = Vec::with_capacity(order.len());
        let mut of_ranks: Vec<Vec<u32>> =
            parts.iter().map(|part| vec![0; part.face_cells.len()]).collect();
        let mut corners = Vec::new();
        for (number, &(cell, _, rank, face, start)) in (0..).zip(&order) {
            let part = &parts[rank];
            corners.clear();
            let of_face = &part.corners[start..start + part.sizes[face] as usize];
            corners.extend(of_face.iter().map(|&index| held[rank][index as usize]));
            let cell_type = CellType::of_polygon(corners.len());
            faces.push(cell_type, &corners)?;
            owner_cells.push(cell);
            of_ranks[rank][face] = number;
            if tagged {
                tags.tags.push(part.tags.as_ref().and_then(|tags| tags.tags[face]));
            }
        }
        let surface = Surface::assemble(
            points,
            vertices,
            faces,
            owner_cells,
            either_way,
            tagged.then_some(&tags),
            settings,
        )?;
        Ok(Self { surface: Arc::new(surface), held, owned, faces: of_ranks })
    }

    /// The vertices of the surface that a rank owns.
    #[must_use]
    pub fn owned(&self, rank: usize) -> &[u32] {
        self.owned.get(rank).map_or(&[], Vec::as_slice)
    }

    /// The faces of the surface that a rank has.
    #[must_use]
    pub fn faces(&self, rank: usize) -> &[u32] {
        self.faces.get(rank).map_or(&[], Vec::as_slice)
    }
}

/// Where each of some rising numbers stands among all, which rise too.
fn positions_in(all: &[u32], some: &[u32]) -> Option<Vec<u32>> {
    let mut numbered = (0..).zip(all);
    some.iter()
        .map(|number| numbered.find(|(_, other)| *other == number).map(|(index, _)| index))
        .collect()
}
