//! What can be seen of an extract: the faces, lines and points that each rank has of it.

use std::collections::HashMap;
use std::sync::Arc;

use tombolo_deform::communicator::{Communicator, Reader, Writer};
use tombolo_deform::distributed::DistributedError;
use tombolo_deform::mesh::ghosts;

use super::merge::{merged, name};
use super::skin::{Faces, Outside};
use super::source::{Origin, Whole};
use super::supports::Support;
use super::{Association, Extract, Extracted, Field, GHOST_FIELD};

/// The part of an extract that one rank shows.
#[derive(Debug)]
pub(crate) struct Shown {
    /// Cells of dimension 2 and less.
    pub(crate) extract: Arc<Extract>,
    /// The points that other ranks may have too, and what all call them.
    pub(crate) shared: Vec<(u32, Support)>,
}

/// This rank's visible part of an extract. Together the ranks show what one process would, each face
/// once. Collective.
///
/// # Errors
/// [`DistributedError`] where a rank has no extract.
pub(crate) fn shown(
    communicator: &dyn Communicator,
    whole: Option<&Whole>,
    piece: &Extracted,
) -> Result<Shown, DistributedError> {
    // A surface of one process that has ghosts lies with the boundary too.
    let is_alone = communicator.size() == 1 && !matches!(piece.origin, Origin::Boundary);
    let Some(whole) = whole.filter(|_| !is_alone) else {
        let (extract, _) = seen(&piece.extract, outside)?;
        return Ok(Shown { extract, shared: Vec::new() });
    };
    match &piece.origin {
        // These hang together on rank 0 alone.
        Origin::Probe(..) | Origin::Whole => {
            let merged = merged(communicator, whole, Some(piece))?;
            let extract = match merged.filter(|_| communicator.rank() == 0) {
                Some(merged) => seen(&merged, outside)?.0,
                None => {
                    Arc::new(Extract { cells: Arc::default(), ..Extract::clone(&piece.extract) })
                }
            };
            Ok(Shown { extract, shared: Vec::new() })
        }
        Origin::Boundary => {
            let vertices = piece.extract.vertices.as_deref().unwrap_or_default();
            let faces = whole.boundary.faces();
            let most = vertices.iter().chain(faces.connectivity()).max();
            let mut numbers = vec![u32::MAX; most.map_or(0, |&most| most as usize + 1)];
            for (number, &vertex) in (0..).zip(vertices) {
                numbers[vertex as usize] = number;
            }
            let cells = Arc::new(faces.with_vertices(&numbers));
            let extract = Arc::new(Extract { cells, ..Extract::clone(&piece.extract) });
            Ok(Shown { extract, shared: shared(whole, piece, 0..vertices.len()) })
        }
        Origin::Vertices | Origin::Between(_) | Origin::Loose => {
            let is_of_volumes = piece.extract.cells.dimension() == 3;
            let mut outside = outside(&piece.extract);
            if communicator.any(is_of_volumes) {
                let name = |point: u32| name(whole, piece, point as usize);
                remove_inner(communicator, &mut outside, &name)?;
            }
            let (extract, points) = seen(&piece.extract, |_| outside)?;
            let shared = match points {
                Some(points) => shared(whole, piece, points.iter().map(|&point| point as usize)),
                None => shared(whole, piece, 0..extract.points.len()),
            };
            Ok(Shown { extract, shared })
        }
    }
}

/// The names of points of a piece, by their numbers among these, where other ranks have them too.
fn shared(
    whole: &Whole,
    piece: &Extracted,
    points: impl Iterator<Item = usize>,
) -> Vec<(u32, Support)> {
    let name = |(number, point)| match name(whole, piece, point) {
        Some((name, true)) => Some((number, name)),
        _ => None,
    };
    (0..).zip(points).filter_map(name).collect()
}

/// The outside of what is not hidden.
fn outside(extract: &Extract) -> Outside {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bits of 8")]
    let hidden = ghost_bits(extract)
        .map(|bits| bits.values.iter().map(|&bits| !ghosts::is_own(bits as u8)).collect());
    Outside::of(&extract.cells, hidden)
}

fn ghost_bits(extract: &Extract) -> Option<&Field> {
    extract
        .fields
        .iter()
        .find(|field| field.association == Association::Element && field.name == GHOST_FIELD)
}

/// The extract without hidden cells and without the inside of volumes, and which of its points are
/// left; `None` where all are.
fn seen(
    extract: &Arc<Extract>,
    outside: impl FnOnce(&Extract) -> Outside,
) -> Result<(Arc<Extract>, Option<Vec<u32>>), DistributedError> {
    if extract.cells.dimension() < 3 && ghost_bits(extract).is_none() {
        return Ok((Arc::clone(extract), None));
    }
    let (taken, points) = outside(extract).taken(extract)?;
    Ok((Arc::new(taken), Some(points)))
}

/// Takes out the faces that another rank has too: they lie between the parts. Collective.
fn remove_inner(
    communicator: &dyn Communicator,
    outside: &mut Outside,
    name: &dyn Fn(u32) -> Option<(Support, bool)>,
) -> Result<(), DistributedError> {
    let mut message = Writer::default();
    let mut candidates = Vec::new();
    for (number, face) in outside.faces().enumerate() {
        let names: Option<Vec<_>> = face.iter().map(|&point| name(point)).collect();
        let Some(names) = names else { continue };
        // Of a face that two triangles of different ranks fill, each rank has a diagonal at least.
        if names.iter().filter(|(_, is_shared)| *is_shared).count() < 2 {
            continue;
        }
        candidates.push(number);
        message.u64(names.len() as u64);
        for (name, _) in names {
            name.vertices.iter().for_each(|&vertex| message.u32(vertex));
            message.u64(name.layer);
        }
    }
    let messages = communicator.gather_all(&message.into_bytes());
    let mut numbers: HashMap<Support, u32> = HashMap::new();
    let mut faces = Faces::default();
    let (mut count, mut first) = (0, 0);
    for (rank, bytes) in messages.iter().enumerate() {
        if rank == communicator.rank() {
            first = count;
        }
        let mut reader = Reader::new(rank, bytes);
        while !reader.is_empty() {
            let corners = (0..reader.count(24)?).map(|_| {
                let mut vertices = [0; 4];
                for vertex in &mut vertices {
                    *vertex = reader.u32()?;
                }
                let name = Support { vertices, layer: reader.u64()? };
                #[expect(clippy::cast_possible_truncation, reason = "points of 32 bits")]
                let next = numbers.len() as u32;
                Ok(*numbers.entry(name).or_insert(next))
            });
            let corners = corners.collect::<Result<Vec<u32>, DistributedError>>()?;
            faces.push(count, &corners);
            count += 1;
        }
    }
    let mut is_outer = vec![false; count];
    faces.outside().owners().for_each(|face| is_outer[face] = true);
    let mut is_inner = vec![false; outside.faces().count()];
    for (index, &number) in candidates.iter().enumerate() {
        is_inner[number] = !is_outer[first + index];
    }
    outside.retain(|face| !is_inner[face]);
    Ok(())
}
