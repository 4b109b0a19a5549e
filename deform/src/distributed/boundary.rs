//! The boundary of a mesh of which each rank has a part.

use std::{collections::BTreeMap, sync::Arc};

use super::assembly::{Root, described};
use super::grids::outside_of_grids;
use super::positions::Doubt;
use super::{DistributedError, Part, TOLERANCE, handedness};
use crate::communicator::{Communicator, Garbled, Reader, Writer, agree};
use crate::features::FeatureSettings;
use crate::mesh::{Cells, SharedVertices, Vector, ghosts};
use crate::number::index;
use crate::surface::{BoundaryFaces, Surface, SurfaceError};
use crate::topology::{marked, marks};

/// The boundary of the whole mesh as one rank sees it: that of its own part, and on rank 0 the
/// surface that all of them make.
///
/// The surface has each vertex once, by its number in the whole mesh; its faces are in the order of
/// the ranks, or of the cells' global numbers where all ranks give them: then it is, bit for bit,
/// the surface of the whole mesh on one process.
///
/// ```
/// use tombolo_deform::{shapes::box_of_tets, features::FeatureSettings};
/// use tombolo_deform::{communicator::{Communicator, threads}, distributed::{Part, PartBoundary}};
///
/// let gathered = threads::run(2, |ranks| {
///     let ranks: std::sync::Arc<dyn Communicator> = std::sync::Arc::new(ranks);
///     let x = ranks.rank() as f64;
///     let mesh = box_of_tets([2, 2, 2], [x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]);
///     let part = Part { points: mesh.points().to_vec(), cells: mesh.cells().clone(), ..Part::default() };
///     let (shared, boundary) = PartBoundary::find(&ranks, &part, &FeatureSettings::default())?;
///     // A displacement that rank 0 has worked out comes to the ranks that have the vertices.
///     let lifted = boundary.surface().map(|surface| vec![[0.0, 0.0, 1.0]; surface.points().len()]);
///     let mine = boundary.scatter(&ranks, lifted.as_deref())?;
///     assert_eq!(mine.len(), boundary.vertices().len());
///     Ok::<_, tombolo_deform::distributed::DistributedError>((shared.count(), boundary.surface().cloned()))
/// });
/// let (count, surface) = gathered[0].clone()?;
/// assert_eq!((count, surface.map(|surface| surface.points().len())), (45, Some(42)));
/// # Ok::<(), tombolo_deform::distributed::DistributedError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct PartBoundary {
    vertices: Vec<u32>,
    /// The indices in `vertices` of those that this rank owns.
    owned: Vec<u32>,
    faces: Cells,
    face_cells: Vec<u32>,
    root: Option<Root>,
}

/// The faces of the part's own cells that belong to one of them only, in the dimension of the whole
/// mesh. Collective.
pub(super) fn outer_faces(
    communicator: &dyn Communicator,
    part: &Part,
) -> Result<BoundaryFaces, DistributedError> {
    faces_of_one_cell(communicator, part, part.left_out(ghosts::is_own).as_deref())
}

/// The faces of the part's own cells, but for those against copies of other ranks' cells on one
/// process. On several ranks the owner of a copy brings the face before it too, so that the ranks
/// find it to lie inside; one process has to look at its copies for that. Collective.
fn drawn_faces(
    communicator: &dyn Communicator,
    part: &Part,
) -> Result<BoundaryFaces, DistributedError> {
    if communicator.size() > 1 {
        return outer_faces(communicator, part);
    }
    let faces =
        faces_of_one_cell(communicator, part, part.left_out(ghosts::is_visible).as_deref())?;
    Ok(faces.of_cells(|cell| part.is_own(cell)))
}

/// The faces that belong to one cell only of those that are not `left_out`, in the dimension of the
/// whole mesh. Collective.
fn faces_of_one_cell(
    communicator: &dyn Communicator,
    part: &Part,
    left_out: Option<&[bool]>,
) -> Result<BoundaryFaces, DistributedError> {
    let dimension = communicator.most(part.cells.dimension());
    if dimension < 2 {
        return Err(no_faces(communicator, part, dimension).into());
    }
    let found = BoundaryFaces::find(&part.points, &part.cells, dimension, left_out);
    Ok(agree(communicator, found)?)
}

fn no_faces(communicator: &dyn Communicator, part: &Part, dimension: usize) -> SurfaceError {
    let cells = communicator.total((0..part.cells.len()).filter(|&cell| part.is_own(cell)).count());
    SurfaceError::NoFaces { cells, dimension }
}

impl PartBoundary {
    /// Finds the boundary of a mesh that is shown, but not moved: a vertex that could be one of two
    /// of another rank is taken for neither, and a mesh without faces has no boundary; the error is
    /// then what there is to say where somebody asks for it. Collective.
    ///
    /// # Errors
    /// [`DistributedError`], the same on all ranks.
    pub fn shown(
        communicator: &Arc<dyn Communicator>,
        part: &Part,
    ) -> Result<(SharedVertices, Self, Option<SurfaceError>), DistributedError> {
        let (outer, error) = match drawn_faces(&**communicator, part) {
            Err(DistributedError::Surface(error @ SurfaceError::NoFaces { .. })) => {
                (BoundaryFaces::default(), Some(error))
            }
            outer => (outer?, None),
        };
        let shared = SharedVertices::beside(communicator, part, &outer, TOLERANCE, Doubt::Apart)?;
        if let Some(error) = error {
            let none = Self {
                vertices: Vec::new(),
                owned: Vec::new(),
                faces: Cells::new(),
                face_cells: Vec::new(),
                root: None,
            };
            return Ok((shared, none, Some(error)));
        }
        let boundary = Self::of(communicator, part, &FeatureSettings::default(), outer, &shared)?;
        Ok((shared, boundary, None))
    }

    /// Finds the boundary together with the other ranks, and with it the vertices that they share.
    /// Collective.
    ///
    /// # Errors
    /// [`DistributedError`], the same on all ranks.
    pub fn find(
        communicator: &Arc<dyn Communicator>,
        part: &Part,
        settings: &FeatureSettings,
    ) -> Result<(SharedVertices, Self), DistributedError> {
        let outer = drawn_faces(&**communicator, part)?;
        handedness::check(&**communicator, &part.cells, &part.points)?;
        let shared = SharedVertices::beside(communicator, part, &outer, TOLERANCE, Doubt::Refused)?;
        let boundary = Self::of(communicator, part, settings, outer, &shared)?;
        Ok((shared, boundary))
    }

    fn of(
        communicator: &Arc<dyn Communicator>,
        part: &Part,
        settings: &FeatureSettings,
        outer: BoundaryFaces,
        shared: &SharedVertices,
    ) -> Result<Self, DistributedError> {
        let ranks = &**communicator;
        let outer = if ranks.most(part.cells.dimension()) == 3 {
            outside_of_grids(outer, part)
        } else {
            outer
        };
        let faces = boundary_faces(ranks, outer, shared)?;
        let mut on_boundary = marks(part.points.len(), faces.faces.connectivity());
        shared.halo().any(&mut on_boundary);
        let numbers = shared.numbers();
        let mut vertices = marked(&on_boundary);
        vertices.sort_unstable_by_key(|&vertex| numbers[vertex as usize]);
        let owned: Vec<u32> = (0..)
            .zip(&vertices)
            .filter(|(_, vertex)| shared.owns(**vertex))
            .map(|(index, _)| index)
            .collect();
        let message = described(part, shared, &vertices, &owned, &faces);
        let gathered = ranks.gather(0, &message);
        let root = gathered.map(|messages| Root::assembled(&messages, settings)).transpose();
        let root = agree(ranks, root)?;
        Ok(Self { vertices, owned, faces: faces.faces, face_cells: faces.cells, root })
    }

    /// The vertices of the part that lie on the boundary of the whole mesh, in the order of their
    /// numbers in it. They are those of the ghost cells and of the cells that touch the boundary by
    /// a corner too: each rank that has a vertex hears where it goes.
    #[must_use]
    pub fn vertices(&self) -> &[u32] {
        &self.vertices
    }

    /// The boundary vertices that this rank owns.
    pub fn owned_vertices(&self) -> impl Iterator<Item = u32> {
        self.owned.iter().map(|&index| self.vertices[index as usize])
    }

    /// The indices, among [`PartBoundary::vertices`], of those that this rank owns.
    pub fn owned_indices(&self) -> impl Iterator<Item = usize> {
        self.owned.iter().map(|&index| index as usize)
    }

    /// The boundary faces of the part's own cells.
    #[must_use]
    pub fn faces(&self) -> &Cells {
        &self.faces
    }

    /// The cell that each of them belongs to.
    #[must_use]
    pub fn face_cells(&self) -> &[u32] {
        &self.face_cells
    }

    /// The surface of the whole mesh, on rank 0.
    #[must_use]
    pub fn surface(&self) -> Option<&Arc<Surface>> {
        self.root.as_ref().map(|root| &root.surface)
    }

    /// The way between the surface and the ranks, on rank 0.
    #[must_use]
    pub fn root(&self) -> Option<&Root> {
        self.root.as_ref()
    }

    /// Hands values for the vertices of the surface, which rank 0 has, to all ranks that have these
    /// vertices: one for each of [`PartBoundary::vertices`]. Collective; ranks without boundary
    /// vertices hear nothing.
    ///
    /// # Errors
    /// [`DistributedError::Garbled`] where rank 0 did not bring one value for each vertex of its
    /// surface.
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
            None => Err(Garbled { rank: 0 }.into()),
            Some((from, bytes)) => {
                let mut reader = Reader::new(*from, bytes);
                Ok(self.vertices.iter().map(|_| reader.vector()).collect::<Result<_, _>>()?)
            }
        }
    }

    /// Brings what the owners have at the vertices of the surface to rank 0. `values` holds one
    /// value for each vertex of the part. Collective.
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
}

impl From<Arc<Surface>> for PartBoundary {
    /// The boundary of a mesh that one process has: its surface.
    fn from(surface: Arc<Surface>) -> Self {
        let all = |count: usize| -> Vec<u32> { (0..).take(count).collect() };
        let (points, faces) = (all(surface.points().len()), all(surface.faces().len()));
        Self {
            vertices: surface.vertices().to_vec(),
            owned: points.clone(),
            faces: surface.faces().with_vertices(surface.vertices()),
            face_cells: surface.owner_cells().to_vec(),
            root: Some(Root {
                surface,
                held: vec![points.clone()],
                owned: vec![points],
                faces: vec![faces],
            }),
        }
    }
}

/// Of the faces that belong to one cell of the part those that belong to one cell of the whole
/// mesh. Faces whose corners several ranks have meet on the lowest of these: all of them know which
/// one it is. Collective.
fn boundary_faces(
    communicator: &dyn Communicator,
    outer: BoundaryFaces,
    shared: &SharedVertices,
) -> Result<BoundaryFaces, DistributedError> {
    let rank = communicator.rank();
    let sharers = shared.sharers();
    let mut is_boundary = vec![true; outer.faces.len()];
    let mut messages: BTreeMap<usize, Writer> = BTreeMap::new();
    let mut common = Vec::new();
    let mut corners = Vec::new();
    for (face, (_, vertices)) in outer.faces.iter().enumerate() {
        common.clear();
        common.extend_from_slice(sharers.of(vertices[0]));
        for &vertex in &vertices[1..] {
            common.retain(|rank| sharers.of(vertex).contains(rank));
        }
        let Some(&lowest) = common.first() else { continue };
        is_boundary[face] = false;
        corners.clear();
        corners.extend(vertices.iter().map(|&vertex| shared.numbers()[vertex as usize]));
        corners.sort_unstable();
        let message = messages.entry(rank.min(lowest as usize)).or_default();
        message.u32(index(face));
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
            *is_boundary.get_mut(face as usize).ok_or(Garbled { rank: from })? = true;
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
        kept.positions.push(outer.positions[face]);
    }
    Ok(kept)
}
