//! The boundary of a mesh of which each rank has a part.

use std::{collections::BTreeMap, sync::Arc};

use tombolo_deform::{
    mesh::{CellType, Cells, Vector},
    surface::{BoundaryFaces, FaceTags, FeatureSettings, Surface, SurfaceError, face_tags},
};

use super::message::{Reader, Writer};
use super::places::Doubt;
use super::shared::SharedVertices;
use super::{DistributedError, Part, TOLERANCE};
use crate::communicator::{Communicator, Reduction, agree};

/// The boundary of the whole mesh as one rank sees it: its own piece, and on rank 0 the surface that all of them make.
///
/// The surface has each vertex once, by its number in the whole mesh; its faces are in the order of the ranks, or of the cells'
/// global numbers where all ranks give them: then it is, bit for bit, the surface of the whole mesh on one process.
///
/// ```
/// use tombolo_deform::{shapes::box_of_tets, surface::FeatureSettings};
/// use tombolo_pipelines::{communicator::{Communicator, threads}, distributed::{Part, PartBoundary, SharedVertices}};
///
/// let gathered = threads::run(2, |ranks| {
///     let x = ranks.rank() as f64;
///     let mesh = box_of_tets([2, 2, 2], [x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]);
///     let part = Part { points: mesh.points().to_vec(), cells: mesh.cells().clone(), ..Part::default() };
///     let (shared, boundary) = PartBoundary::find(&ranks, &part, &FeatureSettings::default())?;
///     // A displacement that rank 0 has worked out comes to the ranks that have the vertices.
///     let lifted = boundary.surface().map(|surface| vec![[0.0, 0.0, 1.0]; surface.points().len()]);
///     let mine = boundary.scatter(&ranks, lifted.as_deref())?;
///     assert_eq!(mine.len(), boundary.vertices().len());
///     Ok::<_, tombolo_pipelines::distributed::DistributedError>((shared.count(), boundary.surface().cloned()))
/// });
/// let (count, surface) = gathered[0].clone()?;
/// assert_eq!((count, surface.map(|surface| surface.points().len())), (45, Some(42)));
/// # Ok::<(), tombolo_pipelines::distributed::DistributedError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct PartBoundary {
    vertices: Vec<u32>,
    /// The places in `vertices` of those that this rank owns.
    owned: Vec<u32>,
    faces: BoundaryFaces,
    root: Option<Root>,
}

/// What rank 0 knows besides.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Root {
    surface: Arc<Surface>,
    /// For each rank the surface vertices that it has, those of them that it owns, and the surface faces that it has.
    held: Vec<Vec<u32>>,
    pub(crate) owned: Vec<Vec<u32>>,
    pub(crate) faces: Vec<Vec<u32>>,
}

/// The faces of the part's own cells that belong to one of them only, in the dimension of the whole mesh. Collective.
pub(super) fn outer_faces(
    communicator: &dyn Communicator,
    part: &Part,
) -> Result<BoundaryFaces, DistributedError> {
    faces_of_one_cell(communicator, part, part.ghosts.as_deref())
}

/// The faces that are drawn of the part's own cells. On several ranks the owner of a ghost brings the face before it too, so that the
/// ranks find it to lie inside; one process has to look at its ghosts for that. Collective.
fn drawn_faces(
    communicator: &dyn Communicator,
    part: &Part,
) -> Result<BoundaryFaces, DistributedError> {
    if communicator.size() > 1 {
        return outer_faces(communicator, part);
    }
    let faces = faces_of_one_cell(communicator, part, None)?;
    Ok(faces.of_cells(|cell| !part.is_ghost(cell)))
}

/// The faces that belong to one cell only of those that are no `ghosts`, in the dimension of the whole mesh. Collective.
fn faces_of_one_cell(
    communicator: &dyn Communicator,
    part: &Part,
    ghosts: Option<&[bool]>,
) -> Result<BoundaryFaces, DistributedError> {
    #[expect(clippy::cast_precision_loss, reason = "at most 3")]
    let mut dimension = [part.cells.dimension() as f64];
    communicator.reduce(Reduction::Maximum, &mut dimension);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 3")]
    let dimension = dimension[0] as usize;
    if dimension < 2 {
        return Err(no_faces(communicator, part, dimension).into());
    }
    let found = BoundaryFaces::find(&part.points, &part.cells, dimension, ghosts);
    Ok(agree(communicator, found)?)
}

fn no_faces(communicator: &dyn Communicator, part: &Part, dimension: usize) -> SurfaceError {
    #[expect(clippy::cast_precision_loss, reason = "a count below 2^53")]
    let mut cells = [(0..part.cells.len()).filter(|&cell| !part.is_ghost(cell)).count() as f64];
    communicator.reduce(Reduction::Sum, &mut cells);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
    let cells = cells[0] as usize;
    SurfaceError::NoFaces { cells, dimension }
}

impl PartBoundary {
    /// What is to be shown of a mesh, but not moved: a vertex that could be one of two of another rank is taken for neither, and a
    /// mesh without faces has no boundary; the error is then what there is to say where somebody asks for it. Collective.
    ///
    /// # Errors
    /// [`DistributedError`], the same on all ranks.
    pub(crate) fn shown(
        communicator: &dyn Communicator,
        part: &Part,
    ) -> Result<(SharedVertices, Self, Option<SurfaceError>), DistributedError> {
        let (outer, error) = match drawn_faces(communicator, part) {
            Err(DistributedError::Surface(error @ SurfaceError::NoFaces { .. })) => {
                (BoundaryFaces::default(), Some(error))
            }
            outer => (outer?, None),
        };
        let shared = SharedVertices::beside(communicator, part, &outer, TOLERANCE, Doubt::Apart)?;
        if let Some(error) = error {
            let none = Self { vertices: Vec::new(), owned: Vec::new(), faces: outer, root: None };
            return Ok((shared, none, Some(error)));
        }
        let boundary = Self::of(communicator, part, &FeatureSettings::default(), outer, &shared)?;
        Ok((shared, boundary, None))
    }

    /// Finds the boundary together with the other ranks, and with it the vertices that they share. Collective.
    ///
    /// # Errors
    /// [`DistributedError`], the same on all ranks.
    pub fn find(
        communicator: &dyn Communicator,
        part: &Part,
        settings: &FeatureSettings,
    ) -> Result<(SharedVertices, Self), DistributedError> {
        let outer = outer_faces(communicator, part)?;
        let shared = SharedVertices::beside(communicator, part, &outer, TOLERANCE, Doubt::Refused)?;
        let boundary = Self::of(communicator, part, settings, outer, &shared)?;
        Ok((shared, boundary))
    }

    fn of(
        communicator: &dyn Communicator,
        part: &Part,
        settings: &FeatureSettings,
        outer: BoundaryFaces,
        shared: &SharedVertices,
    ) -> Result<Self, DistributedError> {
        let faces = boundary_faces(communicator, outer, shared)?;
        let mut marks = vec![false; part.points.len()];
        faces.faces.connectivity().iter().for_each(|&vertex| marks[vertex as usize] = true);
        shared.any(communicator, &mut marks);
        let numbers = shared.numbers();
        let mut vertices: Vec<u32> =
            (0..).zip(&marks).filter(|(_, mark)| **mark).map(|(vertex, _)| vertex).collect();
        vertices.sort_unstable_by_key(|&vertex| numbers[vertex as usize]);
        let owned = (0..)
            .zip(&vertices)
            .filter(|(_, vertex)| shared.owns(**vertex))
            .map(|(place, _)| place)
            .collect();
        let mut boundary = Self { vertices, owned, faces, root: None };
        let message = boundary.described(part, shared);
        let gathered = communicator.gather(0, &message);
        let root = gathered.map(|messages| Root::assembled(&messages, settings)).transpose();
        boundary.root = agree(communicator, root)?;
        Ok(boundary)
    }

    /// The vertices of the part that lie on the boundary of the whole mesh, in the order of their numbers in it. They are those of
    /// the ghost cells and of the cells that touch the boundary by a corner too: each rank that has a vertex hears where it goes.
    #[must_use]
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// Those of them that this rank owns.
    pub fn owned_vertices(&self) -> impl Iterator<Item = u32> {
        self.owned.iter().map(|&place| self.vertices[place as usize])
    }

    pub(crate) fn owned_places(&self) -> impl Iterator<Item = usize> {
        self.owned.iter().map(|&place| place as usize)
    }

    /// The boundary faces of the part's own cells.
    #[must_use]
    pub fn faces(&self) -> &BoundaryFaces {
        &self.faces
    }

    /// The surface of the whole mesh, on rank 0.
    #[must_use]
    pub fn surface(&self) -> Option<&Arc<Surface>> {
        self.root.as_ref().map(|root| &root.surface)
    }

    pub(crate) fn root(&self) -> Option<&Root> {
        self.root.as_ref()
    }

    /// Hands values for the vertices of the surface, which rank 0 has, to all ranks that have these vertices: one for each of
    /// [`PartBoundary::vertices`]. Collective; ranks without boundary vertices hear nothing.
    ///
    /// # Errors
    /// [`DistributedError::Garbled`] where rank 0 did not bring one value for each vertex of its surface.
    pub fn scatter(
        &self,
        communicator: &dyn Communicator,
        values: Option<&[Vector]>,
    ) -> Result<Vec<Vector>, DistributedError> {
        let mut messages = Vec::new();
        if let (Some(root), Some(values)) = (&self.root, values) {
            for (rank, held) in root.held.iter().enumerate().filter(|(_, held)| !held.is_empty()) {
                let mut message = Writer::with_capacity(24 * held.len());
                held.iter()
                    .filter_map(|&vertex| values.get(vertex as usize))
                    .for_each(|value| message.f64s(value));
                messages.push((rank, message.into_bytes()));
            }
        }
        match communicator.exchange(messages).first() {
            None if self.vertices.is_empty() => Ok(Vec::new()),
            None => Err(DistributedError::Garbled { rank: 0 }),
            Some((from, bytes)) => {
                let mut reader = Reader::new(*from, bytes);
                self.vertices.iter().map(|_| reader.vector()).collect()
            }
        }
    }

    /// Brings what the owners have at the vertices of the surface to rank 0. `values` holds one value for each vertex of the part.
    /// Collective.
    ///
    /// # Errors
    /// [`DistributedError::Garbled`].
    pub fn gather(
        &self,
        communicator: &dyn Communicator,
        values: &[Vector],
    ) -> Result<Option<Vec<Vector>>, DistributedError> {
        let mut message = Writer::with_capacity(24 * self.owned.len());
        self.owned_vertices()
            .filter_map(|vertex| values.get(vertex as usize))
            .for_each(|value| message.f64s(value));
        let gathered = communicator.gather(0, &message.into_bytes());
        let (Some(root), Some(messages)) = (&self.root, gathered) else { return Ok(None) };
        let mut whole = vec![[0.0; 3]; root.surface.points().len()];
        for (rank, bytes) in messages.iter().enumerate() {
            let mut reader = Reader::new(rank, bytes);
            for &vertex in &root.owned[rank] {
                whole[vertex as usize] = reader.vector()?;
            }
        }
        Ok(Some(whole))
    }

    /// What rank 0 is told of this rank's piece.
    fn described(&self, part: &Part, shared: &SharedVertices) -> Vec<u8> {
        let mut message =
            Writer::with_capacity(64 + 40 * self.vertices.len() + 32 * self.faces.cells.len());
        message.u64(part.cells.len() as u64);
        message.u8(u8::from(self.faces.may_run_either_way));
        let numbers: Vec<u32> =
            self.vertices.iter().map(|&vertex| shared.numbers()[vertex as usize]).collect();
        message.u32s(&numbers);
        message.u32s(&self.owned);
        self.owned_vertices().for_each(|vertex| message.f64s(&part.points[vertex as usize]));
        let mut places = vec![0; part.points.len()];
        (0..).zip(&self.vertices).for_each(|(place, &vertex)| places[vertex as usize] = place);
        let sizes: Vec<u32> =
            self.faces.faces.offsets().windows(2).map(|row| (row[1] - row[0]) as u32).collect();
        let corners: Vec<u32> =
            self.faces.faces.connectivity().iter().map(|&vertex| places[vertex as usize]).collect();
        message.u32s(&self.faces.cells);
        message.u32s(&self.faces.places);
        message.u32s(&sizes);
        message.u32s(&corners);
        match &part.global_cells {
            None => message.u8(0),
            Some(numbers) => {
                message.u8(1);
                self.faces.cells.iter().for_each(|&cell| message.u64(numbers[cell as usize]));
            }
        }
        match face_tags(&part.features, &self.faces.faces) {
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
}

/// A rank's piece as rank 0 reads it.
struct Piece {
    cells: u64,
    may_run_either_way: bool,
    numbers: Vec<u32>,
    owned: Vec<u32>,
    points: Vec<Vector>,
    face_cells: Vec<u32>,
    face_places: Vec<u32>,
    sizes: Vec<u32>,
    corners: Vec<u32>,
    global_cells: Option<Vec<u64>>,
    tags: Option<FaceTags>,
}

impl Piece {
    fn read(rank: usize, bytes: &[u8]) -> Result<Self, DistributedError> {
        let mut reader = Reader::new(rank, bytes);
        let (cells, may_run_either_way) = (reader.u64()?, reader.u8()? != 0);
        let (numbers, owned) = (reader.u32s()?, reader.u32s()?);
        let points = owned.iter().map(|_| reader.vector()).collect::<Result<_, _>>()?;
        let (face_cells, face_places) = (reader.u32s()?, reader.u32s()?);
        let (sizes, corners) = (reader.u32s()?, reader.u32s()?);
        let sum: u64 = sizes.iter().map(|&size| u64::from(size)).sum();
        let fits = face_cells.len() == sizes.len()
            && face_places.len() == sizes.len()
            && sum == corners.len() as u64
            && corners.iter().chain(&owned).all(|&place| (place as usize) < numbers.len());
        if !fits {
            return Err(DistributedError::Garbled { rank });
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
            face_places,
            sizes,
            corners,
            global_cells,
            tags,
        })
    }
}

impl Root {
    fn assembled(
        messages: &[Vec<u8>],
        settings: &FeatureSettings,
    ) -> Result<Self, DistributedError> {
        let pieces: Vec<Piece> = messages
            .iter()
            .enumerate()
            .map(|(rank, bytes)| Piece::read(rank, bytes))
            .collect::<Result<_, _>>()?;
        // Each vertex once, by its owner.
        let mut owned: Vec<(u32, usize, usize)> = Vec::new();
        for (rank, piece) in pieces.iter().enumerate() {
            let numbers = piece.owned.iter().map(|&place| piece.numbers[place as usize]);
            owned.extend(numbers.enumerate().map(|(place, number)| (number, rank, place)));
        }
        owned.sort_unstable();
        let vertices: Vec<u32> = owned.iter().map(|&(number, ..)| number).collect();
        let points: Vec<Vector> =
            owned.iter().map(|&(_, rank, place)| pieces[rank].points[place]).collect();
        let held: Vec<Vec<u32>> = pieces
            .iter()
            .enumerate()
            .map(|(rank, piece)| {
                places_in(&vertices, &piece.numbers).ok_or(DistributedError::Garbled { rank })
            })
            .collect::<Result<_, _>>()?;
        let owned = pieces.iter().zip(&held);
        let owned = owned
            .map(|(piece, held)| piece.owned.iter().map(|&place| held[place as usize]).collect())
            .collect();

        // The faces in the order of their cells' global numbers, or else of the ranks.
        let known = |piece: &Piece| {
            let numbers = piece.global_cells.as_ref();
            piece.face_cells.is_empty()
                || numbers.is_some_and(|numbers| {
                    numbers.iter().all(|&number| number < u64::from(u32::MAX))
                })
        };
        let all_known = pieces.iter().all(known);
        let mut order: Vec<(u32, u32, usize, usize, usize)> = Vec::new();
        let mut first_cell = 0_u64;
        for (rank, piece) in pieces.iter().enumerate() {
            let mut start = 0;
            for face in 0..piece.face_cells.len() {
                let global =
                    piece.global_cells.as_ref().filter(|_| all_known).map(|numbers| numbers[face]);
                let cell = global.unwrap_or(first_cell + u64::from(piece.face_cells[face]));
                let cell = u32::try_from(cell).unwrap_or(u32::MAX);
                order.push((cell, piece.face_places[face], rank, face, start));
                start += piece.sizes[face] as usize;
            }
            first_cell += piece.cells;
        }
        order.sort_unstable();
        let either_way =
            pieces.iter().any(|piece| piece.may_run_either_way && !piece.face_cells.is_empty());
        let tagged = pieces.iter().any(|piece| piece.tags.is_some());
        let mut tags = FaceTags::default();
        for piece in &pieces {
            tags.names.extend(piece.tags.iter().flat_map(|tags| tags.names.iter().cloned()));
        }
        let mut faces = Cells::new();
        let mut owner_cells = Vec::with_capacity(order.len());
        let mut of_ranks: Vec<Vec<u32>> =
            pieces.iter().map(|piece| vec![0; piece.face_cells.len()]).collect();
        let mut corners = Vec::new();
        for (number, &(cell, _, rank, face, start)) in (0..).zip(&order) {
            let piece = &pieces[rank];
            corners.clear();
            let of_face = &piece.corners[start..start + piece.sizes[face] as usize];
            corners.extend(of_face.iter().map(|&place| held[rank][place as usize]));
            let cell_type = match corners.len() {
                3 => CellType::Triangle,
                4 => CellType::Quad,
                _ => CellType::Polygon,
            };
            faces.push(cell_type, &corners)?;
            owner_cells.push(cell);
            of_ranks[rank][face] = number;
            if tagged {
                tags.tags.push(piece.tags.as_ref().and_then(|tags| tags.tags[face]));
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
}

/// Where each of some rising numbers stands among all, which rise too.
fn places_in(all: &[u32], some: &[u32]) -> Option<Vec<u32>> {
    let mut places = (0..).zip(all);
    some.iter()
        .map(|number| places.find(|(_, other)| *other == number).map(|(place, _)| place))
        .collect()
}

/// Of the faces that belong to one cell of the part those that belong to one cell of the whole mesh. Faces whose corners several
/// ranks have meet on the lowest of these: all of them know which one it is. Collective.
fn boundary_faces(
    communicator: &dyn Communicator,
    outer: BoundaryFaces,
    shared: &SharedVertices,
) -> Result<BoundaryFaces, DistributedError> {
    let rank = communicator.rank();
    let (starts, ranks) = shared.sharers();
    let sharers = |vertex: u32| &ranks[starts[vertex as usize]..starts[vertex as usize + 1]];
    let mut is_boundary = vec![true; outer.faces.len()];
    let mut messages: BTreeMap<usize, Writer> = BTreeMap::new();
    let mut common = Vec::new();
    let mut corners = Vec::new();
    for (face, (_, vertices)) in outer.faces.iter().enumerate() {
        common.clear();
        common.extend_from_slice(sharers(vertices[0]));
        for &vertex in &vertices[1..] {
            common.retain(|rank| sharers(vertex).contains(rank));
        }
        let Some(&lowest) = common.first() else { continue };
        is_boundary[face] = false;
        corners.clear();
        corners.extend(vertices.iter().map(|&vertex| shared.numbers()[vertex as usize]));
        corners.sort_unstable();
        let message = messages.entry(rank.min(lowest as usize)).or_default();
        #[expect(clippy::cast_possible_truncation, reason = "cells are numbered with 32 bits")]
        message.u32(face as u32);
        message.u32s(&corners);
    }
    let messages =
        messages.into_iter().map(|(rank, message)| (rank, message.into_bytes())).collect();
    let mut met: Vec<(Vec<u32>, usize, u32)> = Vec::new();
    for (from, bytes) in communicator.exchange(messages) {
        let mut reader = Reader::new(from, &bytes);
        while !reader.is_empty() {
            let (face, corners) = (reader.u32()?, reader.u32s()?);
            met.push((corners, from, face));
        }
    }
    met.sort_unstable();
    let mut answers: BTreeMap<usize, Writer> = BTreeMap::new();
    let mut fault = None;
    for same in met.chunk_by(|a, b| a.0 == b.0) {
        match same {
            [(_, from, face)] => answers.entry(*from).or_default().u32(*face),
            [_, _] => {}
            more => {
                let ranks = more.iter().map(|(_, rank, _)| *rank).collect();
                let vertices = more[0].0.clone();
                fault.get_or_insert(DistributedError::SharedFace {
                    vertices,
                    ranks,
                    count: more.len(),
                });
            }
        }
    }
    agree(communicator, fault.map_or(Ok(()), Err))?;
    let answers = answers.into_iter().map(|(rank, message)| (rank, message.into_bytes())).collect();
    for (from, bytes) in communicator.exchange(answers) {
        let mut reader = Reader::new(from, &bytes);
        while !reader.is_empty() {
            let face = reader.u32()?;
            *is_boundary
                .get_mut(face as usize)
                .ok_or(DistributedError::Garbled { rank: from })? = true;
        }
    }
    if is_boundary.iter().all(|&is| is) {
        return Ok(outer);
    }
    let mut kept =
        BoundaryFaces { may_run_either_way: outer.may_run_either_way, ..BoundaryFaces::default() };
    for (face, (cell_type, vertices)) in
        outer.faces.iter().enumerate().filter(|(face, _)| is_boundary[*face])
    {
        kept.faces.push(cell_type, vertices)?;
        kept.cells.push(outer.cells[face]);
        kept.places.push(outer.places[face]);
    }
    Ok(kept)
}
