//! A channel's cells, and what is worked out of them once.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::{Cells, Mesh, MeshView, NumberType, Vector, ghosts};
use tombolo_deform::quality::{Quality, quality, scaled_jacobians};
use tombolo_deform::surface::{Surface, SurfaceError};

use super::blocks::Blocks;
use super::gather::{self, Owners, Points};
use super::input::Input;
use super::layout::Layout;
use super::positions::Positions;
use super::search::Search;
use super::supports::Supports;
use super::{Association, Channel, Extract, ExtractError, ExtractFeatures, Field, GHOST_FIELD};
use tombolo_deform::communicator::{Communicator, agree};
use tombolo_deform::distributed::{DistributedError, Part, PartBoundary};
use tombolo_deform::mesh::SharedVertices;

/// An extract, and the errors of the fields that it lacks.
#[derive(Debug, Clone)]
pub struct Extracted {
    /// The extract.
    pub extract: Arc<Extract>,
    /// The solver's cell that each cell of the extract is, lies on or is cut from; of a probe, that
    /// each point lies in.
    pub owners: Arc<[u32]>,
    /// One error for each field that was wanted and could not be taken.
    pub errors: Vec<ExtractError>,
    /// The origin of its points in the solver's mesh.
    pub(crate) origin: Origin,
}

/// The origin of the points of an extract in the solver's mesh.
#[derive(Debug, Clone)]
pub(crate) enum Origin {
    /// All vertices of all ranks: it needs no merging.
    Whole,
    /// Vertices of the boundary.
    Boundary,
    /// Other vertices.
    Vertices,
    /// Between vertices.
    Between(Supports),
    /// Points that no other rank has, as of glyphs.
    Loose,
    /// The points of a probe, by their numbers there.
    Probe(Layout, Arc<[u32]>),
}

impl Extracted {
    /// Adds an element field given for each cell of the solver's mesh. Cells without a value (NaN)
    /// have 0.
    pub fn add_element_field(&mut self, name: &str, of_cells: &[f64]) {
        let value = |&cell: &u32| {
            of_cells.get(cell as usize).copied().filter(|value| value.is_finite()).unwrap_or(0.0)
        };
        let fields = &mut Arc::make_mut(&mut self.extract).fields;
        fields.retain(|field| field.name != name);
        fields.push(Field {
            name: name.to_owned(),
            association: match self.origin {
                Origin::Probe(..) => Association::Vertex,
                _ => Association::Element,
            },
            components: 1,
            number: NumberType::F64,
            values: self.owners.iter().map(value).collect(),
        });
    }
}

/// A channel's cells, checked and owned, and its surface. Both are taken anew when the solver hands
/// over other cells, which shows in where they lie in memory, their number, or the generation that
/// the solver counts up.
#[derive(Debug)]
pub struct Source {
    key: MeshKey,
    /// As the solver has them.
    cells: Arc<Cells>,
    /// As they are measured, once they are.
    right_handed: OnceLock<Arc<Cells>>,
    pub(super) boundary: Option<Boundary>,
    /// The blocks of the cells, once something was cut.
    blocks: OnceLock<Blocks>,
    /// Its own cells as they lie now, with the tree in which points are looked for in them, once
    /// that was done at a step.
    search: OnceLock<Arc<Search>>,
    /// Where the vertices were when that was last taken note of.
    pub(super) positions: Positions,
    /// The knowledge that sets own cells apart from others: on several ranks, and where there are
    /// ghosts.
    pub(super) whole: Option<Box<Whole>>,
    /// Whether other ranks have parts too.
    is_part: bool,
}

/// The whole mesh, as a rank knows it that has a part.
#[derive(Debug)]
pub(crate) struct Whole {
    /// Whether this is rank 0.
    is_first: bool,
    ghosts: Option<Vec<u8>>,
    /// Whether any rank has cells of its own that are hidden.
    has_hidden: bool,
    /// For each vertex whether it belongs to no cell of this rank's own, but to others.
    pub(super) is_ghostly: Vec<bool>,
    /// The cells that are this rank's own.
    own: Cells,
    pub(crate) shared: SharedVertices,
    /// For each vertex whether other ranks have it too.
    pub(crate) is_shared: Vec<bool>,
    pub(crate) boundary: PartBoundary,
    /// The surface of the whole mesh, on rank 0.
    pub(crate) surface: Option<Boundary>,
    /// Why there is none.
    no_surface: Option<SurfaceError>,
}

/// The identity of lent cells, told without a look at a value: where they lie in memory, how many
/// cells and vertices there are, and the generation that the solver counts up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshKey {
    identity: u64,
    cells: usize,
    points: usize,
    generation: u64,
}

impl MeshKey {
    /// The key of a mesh as it is lent now.
    #[must_use]
    pub fn of(mesh: &MeshView) -> Self {
        Self {
            identity: mesh.cells.identity(),
            cells: mesh.cells.len(),
            points: mesh.points.len(),
            generation: mesh.generation,
        }
    }
}

#[derive(Debug)]
pub(crate) struct Boundary {
    pub(crate) cells: Arc<Cells>,
    pub(crate) vertices: Arc<[u32]>,
    pub(super) owners: Arc<[u32]>,
    pub(crate) features: Arc<ExtractFeatures>,
}

impl Boundary {
    fn new(surface: &Surface) -> Self {
        let features = surface.features();
        let features = ExtractFeatures {
            names: features.names().to_vec(),
            of_cells: features.face_features().to_vec(),
        };
        Self {
            cells: Arc::new(surface.faces().clone()),
            vertices: surface.vertices().into(),
            owners: surface.owner_cells().into(),
            features: Arc::new(features),
        }
    }
}

impl Whole {
    pub(super) fn ghost_bits(&self, cell: usize) -> u8 {
        self.ghosts.as_ref().and_then(|bits| bits.get(cell)).copied().unwrap_or(0)
    }

    /// The piece of the surface that this rank has.
    fn piece_of_surface(
        &self,
        channel: &Channel,
        cycle: u64,
        wanted: &dyn Fn(&str) -> bool,
    ) -> Result<Extracted, ExtractError> {
        if let Some(error) = &self.no_surface {
            return Err(error.clone().into());
        }
        let (vertices, face_cells) = (self.boundary.vertices(), self.boundary.face_cells());
        let points = gather::points(&channel.mesh.points, vertices, cycle)?;
        let from = Points::Vertices(vertices);
        let (fields, errors) =
            gather::fields(channel, cycle, wanted, &from, &Owners::Cells(face_cells));
        let cells = Cells::new();
        let extract = Extract {
            points,
            vertices: Some(vertices.into()),
            cells: Arc::new(cells),
            features: None,
            fields,
        };
        let owners = face_cells.into();
        Ok(Extracted { extract: Arc::new(extract), owners, errors, origin: Origin::Boundary })
    }

    /// The piece of all cells that this rank has: those but copies of others. Where some are
    /// hidden, it says which.
    fn piece(
        &self,
        channel: &Channel,
        cycle: u64,
        wanted: &dyn Fn(&str) -> bool,
        cells: &Arc<Cells>,
    ) -> Result<Extracted, ExtractError> {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "vertices and cells are numbered with 32 bits"
        )]
        let owners: Vec<u32> = (0..cells.len())
            .filter(|&cell| self.ghost_bits(cell) & ghosts::DUPLICATE == 0)
            .map(|cell| cell as u32)
            .collect();
        let taken = cells.subset(owners.iter().map(|&cell| cell as usize));
        // Vertices of copies alone are somebody else's; those of no cell, as those that finer grids
        // cover, are not matched between the ranks, and nobody's.
        let (taken, vertices) = taken.compact(channel.mesh.points.len());
        let points = gather::points(&channel.mesh.points, &vertices, cycle)?;
        let from = Points::Vertices(&vertices);
        let (mut fields, errors) =
            gather::fields(channel, cycle, wanted, &from, &Owners::Cells(&owners));
        if self.has_hidden {
            tell_ghosts(&mut fields, owners.iter().map(|&cell| self.ghost_bits(cell as usize)));
        }
        let extract = Extract {
            points,
            vertices: Some(vertices.into()),
            cells: Arc::new(taken),
            features: None,
            fields,
        };
        Ok(Extracted {
            extract: Arc::new(extract),
            owners: owners.into(),
            errors,
            origin: Origin::Vertices,
        })
    }
}

/// Has the fields say which cells are ghosts or hidden, by their bits.
fn tell_ghosts(fields: &mut Vec<Field>, bits: impl Iterator<Item = u8>) {
    fields.retain(|field| field.name != GHOST_FIELD || field.association != Association::Element);
    fields.push(Field {
        name: GHOST_FIELD.to_owned(),
        association: Association::Element,
        components: 1,
        number: NumberType::U8,
        values: bits.map(f64::from).collect(),
    });
}

impl Source {
    /// Copies and checks the cells of a channel.
    ///
    /// # Errors
    /// [`ExtractError::Mesh`] with the first cell that is wrong.
    pub fn new(channel: &Channel) -> Result<Self, ExtractError> {
        let cells = channel.mesh.cells.to_cells()?;
        cells.validate(channel.mesh.points.len())?;
        Ok(Self::of(MeshKey::of(&channel.mesh), Arc::new(cells), OnceLock::new(), None, false))
    }

    /// The cells of a channel that were taken over as this mesh already, without another copy of
    /// them. The channel has no ghosts.
    #[must_use]
    pub fn of_mesh(channel: &Channel, mesh: &Mesh) -> Self {
        let right_handed = mesh.shared_cells();
        let given = match right_handed.as_given() {
            Cow::Borrowed(_) => Arc::clone(right_handed),
            Cow::Owned(given) => Arc::new(given),
        };
        let key = MeshKey::of(&channel.mesh);
        Self::of(key, given, Arc::clone(right_handed).into(), None, false)
    }

    /// The cells of a channel of which each of several ranks has a part, or one process all, ghosts
    /// among them. Collective.
    ///
    /// Extracts are then of the rank's own cells, and are merged into one on rank 0; the whole mesh
    /// of one process has its ghosts too, and says which they are.
    ///
    /// # Errors
    /// [`ExtractError::Distributed`], the same on all ranks; on one process as [`new`](Self::new).
    pub fn distributed(
        channel: &Channel,
        communicator: &Arc<dyn Communicator>,
    ) -> Result<Self, ExtractError> {
        let is_part = communicator.size() > 1;
        if !is_part && channel.mesh.is_plain() {
            return Self::new(channel);
        }
        let part = agree(communicator, Part::of(&channel.mesh)).map_err(DistributedError::from)?;
        let own = part.own_cells();
        let (shared, boundary, error) = PartBoundary::shown(communicator, &part)?;
        let mut is_shared = vec![false; part.points.len()];
        shared.halo().shared().iter().for_each(|&vertex| is_shared[vertex as usize] = true);
        let surface = boundary.surface().map(|surface| Boundary::new(surface));
        // Rank 0 tells it for all.
        let no_surface = error.filter(|_| communicator.rank() == 0);
        let mut is_ghostly = vec![false; part.points.len()];
        let of_ghosts = part.cells.iter().enumerate().filter(|(cell, _)| !part.is_own(*cell));
        of_ghosts.for_each(|(_, (_, vertices))| {
            vertices.iter().for_each(|&vertex| is_ghostly[vertex as usize] = true)
        });
        own.connectivity().iter().for_each(|&vertex| is_ghostly[vertex as usize] = false);
        let is_first = communicator.rank() == 0;
        let is_hidden = |&bits: &u8| bits & ghosts::DUPLICATE == 0 && !ghosts::is_visible(bits);
        let has_hidden = communicator.any(part.ghosts.iter().flatten().any(is_hidden));
        let ghosts = part.ghosts;
        let whole = Whole {
            is_first,
            ghosts,
            has_hidden,
            is_ghostly,
            own,
            shared,
            is_shared,
            boundary,
            surface,
            no_surface,
        };
        let given = Arc::new(part.cells.as_given().into_owned());
        let key = MeshKey::of(&channel.mesh);
        Ok(Self::of(key, given, Arc::new(part.cells).into(), Some(Box::new(whole)), is_part))
    }

    fn of(
        key: MeshKey,
        cells: Arc<Cells>,
        right_handed: OnceLock<Arc<Cells>>,
        whole: Option<Box<Whole>>,
        is_part: bool,
    ) -> Self {
        Self {
            key,
            cells,
            right_handed,
            boundary: None,
            blocks: OnceLock::new(),
            search: OnceLock::new(),
            positions: Positions::default(),
            whole,
            is_part,
        }
    }

    /// The whole mesh, where this is a part of one.
    pub(crate) fn whole_mesh(&self) -> Option<&Whole> {
        self.whole.as_deref()
    }

    /// Whether this rank owns a vertex or cell: each has one owner. What belongs to the mesh as a
    /// whole is rank 0's.
    #[must_use]
    pub fn counts(&self, association: Association, entity: usize) -> bool {
        self.whole.as_ref().is_none_or(|whole| match association {
            Association::Element => ghosts::is_own(whole.ghost_bits(entity)),
            Association::Vertex => {
                let is_ghostly = whole.is_ghostly.get(entity).is_some_and(|&is_ghostly| is_ghostly);
                !is_ghostly && u32::try_from(entity).is_ok_and(|vertex| whole.shared.owns(vertex))
            }
            Association::Mesh => whole.is_first,
        })
    }

    /// Whether the channel still has the cells that this was made of. Looks at no cell.
    #[must_use]
    pub fn is_of(&self, channel: &Channel) -> bool {
        self.key == MeshKey::of(&channel.mesh)
    }

    /// The blocks of the cells.
    pub(super) fn blocks(&self) -> &Blocks {
        self.blocks.get_or_init(|| Blocks::new(&self.cells, self.key.points))
    }

    /// The tree in which points are looked for, kept until the mesh moves.
    pub(super) fn search(&self) -> &Arc<Search> {
        self.search.get_or_init(|| Arc::new(self.new_search()))
    }

    /// That tree where it was made already, else one that is not kept.
    pub(super) fn search_once(&self) -> Arc<Search> {
        self.search.get().cloned().unwrap_or_else(|| Arc::new(self.new_search()))
    }

    fn new_search(&self) -> Search {
        let counts = |cell: usize| self.counts(Association::Element, cell);
        Search::new(self.cells(), &self.positions.points, counts)
    }

    /// Takes note of where the vertices are now.
    ///
    /// # Errors
    /// [`ExtractError::PointNotFinite`]; there are no points then.
    pub(crate) fn update(&mut self, input: &Input) -> Result<(), ExtractError> {
        let before = self.positions.version;
        let updated = self.positions.update(&input.channel.mesh.points, input.cycle);
        if self.positions.version != before {
            self.search = OnceLock::new();
        }
        updated
    }

    /// The cells, as the solver has them.
    #[must_use]
    pub fn cells(&self) -> &Arc<Cells> {
        &self.cells
    }

    /// Takes a surface that was extracted from the same cells elsewhere, so that it need not be
    /// done twice.
    pub fn set_surface(&mut self, surface: &Surface) {
        self.boundary = Some(Boundary::new(surface));
    }

    fn boundary(&mut self, channel: &Channel) -> Result<&Boundary, ExtractError> {
        let boundary = match self.boundary.take() {
            Some(boundary) => boundary,
            None => {
                let points = channel.mesh.points.to_vectors();
                let mesh =
                    Mesh::new(points, Cells::clone(&self.cells), channel.mesh.features.clone())?;
                Boundary::new(&Surface::extract(&mesh, &FeatureSettings::default())?)
            }
        };
        Ok(self.boundary.insert(boundary))
    }

    /// The boundary of the mesh at its present coordinates, with the fields whose names are
    /// `wanted`.
    ///
    /// # Errors
    /// [`ExtractError::Mesh`] or [`ExtractError::Surface`] for a mesh without one,
    /// [`ExtractError::PointNotFinite`]. A field that cannot be taken is no error of the extract:
    /// it is left out and named in [`Extracted::errors`].
    pub fn surface(
        &mut self,
        channel: &Channel,
        cycle: u64,
        wanted: &dyn Fn(&str) -> bool,
    ) -> Result<Extracted, ExtractError> {
        if let Some(whole) = &self.whole {
            return whole.piece_of_surface(channel, cycle, wanted);
        }
        let boundary = self.boundary(channel)?;
        let points = gather::points(&channel.mesh.points, &boundary.vertices, cycle)?;
        let from = Points::Vertices(&boundary.vertices);
        let (fields, errors) =
            gather::fields(channel, cycle, wanted, &from, &Owners::Cells(&boundary.owners));
        let extract = Extract {
            points,
            vertices: Some(Arc::clone(&boundary.vertices)),
            cells: Arc::clone(&boundary.cells),
            features: Some(Arc::clone(&boundary.features)),
            fields,
        };
        let owners = Arc::clone(&boundary.owners);
        Ok(Extracted { extract: Arc::new(extract), owners, errors, origin: Origin::Boundary })
    }

    /// An extract of the whole mesh.
    ///
    /// # Errors
    /// [`ExtractError::PointNotFinite`]; fields as in [`surface`](Self::surface).
    pub fn whole(
        &self,
        channel: &Channel,
        cycle: u64,
        wanted: &dyn Fn(&str) -> bool,
    ) -> Result<Extracted, ExtractError> {
        if let Some(whole) = self.whole.as_ref().filter(|_| self.is_part) {
            return whole.piece(channel, cycle, wanted, &self.cells);
        }
        let view = &channel.mesh.points;
        let points: Result<Vec<_>, _> =
            (0..view.len()).map(|vertex| gather::point(view, vertex, cycle)).collect();
        let wanted = |name: &str| name == GHOST_FIELD || wanted(name);
        let (mut fields, errors) =
            gather::fields(channel, cycle, &wanted, &Points::All, &Owners::All);
        if let Some(bits) =
            channel.mesh.ghost_cells.filter(|bits| bits.iter().any(|&bits| bits != 0))
        {
            tell_ghosts(&mut fields, bits.iter().copied());
        }
        #[expect(
            clippy::cast_possible_truncation,
            reason = "vertices and cells are numbered with 32 bits"
        )]
        let numbers = |count: usize| (0..count as u32).collect::<Arc<[u32]>>();
        let extract = Extract {
            points: points?,
            vertices: Some(numbers(view.len())),
            cells: Arc::clone(&self.cells),
            features: None,
            fields,
        };
        let owners = numbers(self.cells.len());
        Ok(Extracted { extract: Arc::new(extract), owners, errors, origin: Origin::Whole })
    }

    /// The quality of the cells at the present coordinates.
    #[must_use]
    pub fn quality(&self, channel: &Channel) -> Quality {
        let points = channel.mesh.points.to_vectors();
        match &self.whole {
            Some(whole) => quality(&whole.own, &points),
            None => quality(self.right_handed(&points), &points),
        }
    }

    /// The scaled Jacobian of each cell at the present coordinates, NaN for those that have none.
    #[must_use]
    pub fn scaled_jacobians(&self, channel: &Channel) -> Vec<f64> {
        let points = channel.mesh.points.to_vectors();
        scaled_jacobians(self.right_handed(&points), &points)
    }

    /// The cells as they are measured: which of them were given left-handed the first points tell.
    fn right_handed(&self, points: &[Vector]) -> &Cells {
        self.right_handed.get_or_init(|| match self.cells.right_handed(points) {
            Cow::Borrowed(_) => Arc::clone(&self.cells),
            Cow::Owned(turned) => Arc::new(turned),
        })
    }
}
