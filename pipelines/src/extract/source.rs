//! A channel's cells, and what is worked out of them once.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use tombolo_deform::mesh::{Cells, Mesh, MeshView, NumberType, Vector};
use tombolo_deform::quality::{Quality, quality, scaled_jacobians};
use tombolo_deform::surface::{FeatureSettings, Surface, SurfaceError};

use super::gather::{self, Owners, Points};
use super::{
    Association, Channel, Extract, ExtractError, ExtractFeatures, Field, GHOST_FIELD, slice,
};
use crate::communicator::{Communicator, agree};
use crate::distributed::{DistributedError, Part, PartBoundary, SharedVertices};
use crate::language::Slice;

/// An extract, and what was wrong with the fields that it lacks.
#[derive(Debug, Clone)]
pub struct Extracted {
    /// The extract.
    pub extract: Arc<Extract>,
    /// The solver's cell that each cell of the extract is, lies on or is cut from.
    pub owners: Arc<[u32]>,
    /// One error for each field that was wanted and could not be taken.
    pub errors: Vec<ExtractError>,
    /// What its points are in the solver's mesh.
    pub(crate) origin: Origin,
}

/// What the points of an extract are in the solver's mesh.
#[derive(Debug, Clone)]
pub(crate) enum Origin {
    /// All vertices of all ranks: it needs no merging.
    Whole,
    /// Those of the boundary.
    Boundary,
    /// Other vertices.
    Vertices,
    /// On edges between these vertices.
    Edges(Vec<[u32; 2]>),
}

impl Extracted {
    /// Adds an element field given for each cell of the solver's mesh. Cells without a value (NaN) have 0.
    pub fn add_element_field(&mut self, name: &str, of_cells: &[f64]) {
        let value = |&cell: &u32| {
            of_cells.get(cell as usize).copied().filter(|value| value.is_finite()).unwrap_or(0.0)
        };
        let fields = &mut Arc::make_mut(&mut self.extract).fields;
        fields.retain(|field| field.name != name);
        fields.push(Field {
            name: name.to_owned(),
            association: Association::Element,
            components: 1,
            number: NumberType::F64,
            values: self.owners.iter().map(value).collect(),
        });
    }
}

/// A channel's cells, checked and owned, and its surface. Both are taken anew when the solver hands over other cells, which shows
/// in where they lie in memory, their number, or the generation that the solver counts up.
#[derive(Debug)]
pub struct Source {
    key: MeshKey,
    /// As the solver has them.
    cells: Arc<Cells>,
    /// As they are measured, once they are.
    right_handed: OnceLock<Arc<Cells>>,
    boundary: Option<Boundary>,
    /// What sets own cells apart from others: on several ranks, and where there are ghosts.
    whole: Option<Box<Whole>>,
    /// Whether other ranks have parts too.
    is_part: bool,
}

/// What a rank knows of a mesh of which it has a part.
#[derive(Debug)]
pub(crate) struct Whole {
    /// Whether this is rank 0.
    is_first: bool,
    ghosts: Option<Vec<bool>>,
    /// For each vertex whether it belongs to ghosts alone.
    is_ghostly: Vec<bool>,
    /// The cells but the ghosts.
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

/// What tells, without a look at a value, that a solver lends the same cells as before: where they lie in memory, how many cells and
/// vertices there are, and the generation that the solver counts up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshKey {
    identity: (usize, usize),
    cells: usize,
    points: usize,
    generation: u64,
}

impl MeshKey {
    /// That of a mesh as it is lent now.
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
    surface: Arc<Surface>,
    pub(crate) cells: Arc<Cells>,
    pub(crate) vertices: Arc<[u32]>,
    owners: Arc<[u32]>,
    pub(crate) features: Arc<ExtractFeatures>,
}

impl Boundary {
    fn new(surface: Arc<Surface>) -> Self {
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
            surface,
        }
    }
}

impl Whole {
    fn is_ghost(&self, cell: usize) -> bool {
        self.ghosts.as_ref().is_some_and(|ghosts| ghosts.get(cell).is_some_and(|&ghost| ghost))
    }

    /// What this rank has of the surface.
    fn piece_of_surface(
        &self,
        channel: &Channel,
        cycle: u64,
        wanted: &dyn Fn(&str) -> bool,
    ) -> Result<Extracted, ExtractError> {
        if let Some(error) = &self.no_surface {
            return Err(error.clone().into());
        }
        let (vertices, faces) = (self.boundary.vertices(), self.boundary.faces());
        let points = gather::points(&channel.mesh.points, vertices, cycle)?;
        let from = Points::Vertices(vertices);
        let (fields, errors) =
            gather::fields(channel, cycle, wanted, &from, &Owners::Cells(&faces.cells));
        let cells = Cells::new();
        let extract = Extract {
            points,
            vertices: Some(vertices.into()),
            cells: Arc::new(cells),
            features: None,
            fields,
        };
        let owners = faces.cells.as_slice().into();
        Ok(Extracted { extract: Arc::new(extract), owners, errors, origin: Origin::Boundary })
    }

    /// What this rank has of all cells.
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
        let owners: Vec<u32> =
            (0..cells.len()).filter(|&cell| !self.is_ghost(cell)).map(|cell| cell as u32).collect();
        // Vertices of ghosts alone, and what no cell has, are somebody else's.
        let mut places = vec![u32::MAX; channel.mesh.points.len()];
        self.own.connectivity().iter().for_each(|&vertex| places[vertex as usize] = 0);
        let vertices: Vec<u32> = (0..)
            .zip(&places)
            .filter(|(_, place)| **place == 0)
            .map(|(vertex, _)| vertex)
            .collect();
        (0..).zip(&vertices).for_each(|(place, &vertex)| places[vertex as usize] = place);
        let own = self.own.as_given().with_vertices(&places);
        let points = gather::points(&channel.mesh.points, &vertices, cycle)?;
        let from = Points::Vertices(&vertices);
        let (fields, errors) =
            gather::fields(channel, cycle, wanted, &from, &Owners::Cells(&owners));
        let extract = Extract {
            points,
            vertices: Some(vertices.into()),
            cells: Arc::new(own),
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

impl Source {
    /// Copies and checks the cells of a channel.
    ///
    /// # Errors
    /// [`ExtractError::Mesh`] with the first cell that is wrong.
    pub fn new(channel: &Channel) -> Result<Self, ExtractError> {
        let cells = channel.mesh.cells.to_cells()?;
        cells.validate(channel.mesh.points.len())?;
        Ok(Self::of(MeshKey::of(&channel.mesh), cells, OnceLock::new(), None, false))
    }

    /// Knows the cells of a channel of which each of several ranks has a part, or one process all, ghosts among them. What is taken
    /// is then of the rank's own cells, and makes one extract on rank 0 when it is merged; the whole mesh of one process has its
    /// ghosts too, and says which they are. Collective.
    ///
    /// # Errors
    /// [`ExtractError::Distributed`], the same on all ranks; on one process as [`new`](Self::new).
    pub fn distributed(
        channel: &Channel,
        communicator: &dyn Communicator,
    ) -> Result<Self, ExtractError> {
        let is_part = communicator.size() > 1;
        if !is_part && !channel.mesh.ghost_cells.is_some_and(|ghosts| ghosts.contains(&true)) {
            return Self::new(channel);
        }
        let part = agree(communicator, Part::of(&channel.mesh)).map_err(DistributedError::from)?;
        let own = part.own_cells();
        let (shared, boundary, error) = PartBoundary::shown(communicator, &part)?;
        let mut is_shared = vec![false; part.points.len()];
        shared.shared().for_each(|vertex| is_shared[vertex as usize] = true);
        let surface = boundary.surface().map(|surface| Boundary::new(Arc::clone(surface)));
        // Rank 0 tells it for all.
        let no_surface = error.filter(|_| communicator.rank() == 0);
        let mut is_ghostly = vec![false; part.points.len()];
        let of_ghosts = part.cells.iter().enumerate().filter(|(cell, _)| part.is_ghost(*cell));
        of_ghosts.for_each(|(_, (_, vertices))| {
            vertices.iter().for_each(|&vertex| is_ghostly[vertex as usize] = true)
        });
        own.connectivity().iter().for_each(|&vertex| is_ghostly[vertex as usize] = false);
        let is_first = communicator.rank() == 0;
        let whole = Whole {
            is_first,
            ghosts: part.ghosts,
            is_ghostly,
            own,
            shared,
            is_shared,
            boundary,
            surface,
            no_surface,
        };
        let given = part.cells.as_given().into_owned();
        let key = MeshKey::of(&channel.mesh);
        Ok(Self::of(key, given, Arc::new(part.cells).into(), Some(Box::new(whole)), is_part))
    }

    fn of(
        key: MeshKey,
        cells: Cells,
        right_handed: OnceLock<Arc<Cells>>,
        whole: Option<Box<Whole>>,
        is_part: bool,
    ) -> Self {
        Self { key, cells: Arc::new(cells), right_handed, boundary: None, whole, is_part }
    }

    /// What is known of the whole mesh where this is a part of one.
    pub(crate) fn whole_mesh(&self) -> Option<&Whole> {
        self.whole.as_deref()
    }

    /// Whether a vertex or cell counts to this rank: each counts to one. What belongs to the mesh as a whole counts to rank 0.
    #[must_use]
    pub fn counts(&self, association: Association, entity: usize) -> bool {
        self.whole.as_ref().is_none_or(|whole| match association {
            Association::Element => !whole.is_ghost(entity),
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

    /// The cells, as the solver has them.
    #[must_use]
    pub fn cells(&self) -> &Arc<Cells> {
        &self.cells
    }

    /// Takes a surface that was extracted from the same cells elsewhere, so that it need not be done twice.
    pub fn set_surface(&mut self, surface: Arc<Surface>) {
        self.boundary = Some(Boundary::new(surface));
    }

    /// The surface of the mesh as it was when it was first asked for: its features and topology.
    ///
    /// # Errors
    /// [`ExtractError::Mesh`] or [`ExtractError::Surface`] for a mesh without one.
    pub fn surface_of(&mut self, channel: &Channel) -> Result<Arc<Surface>, ExtractError> {
        Ok(Arc::clone(&self.boundary(channel)?.surface))
    }

    fn boundary(&mut self, channel: &Channel) -> Result<&Boundary, ExtractError> {
        let boundary = match self.boundary.take() {
            Some(boundary) => boundary,
            None => {
                let points = channel.mesh.points.to_vectors();
                let mesh =
                    Mesh::new(points, Cells::clone(&self.cells), channel.mesh.features.clone())?;
                Boundary::new(Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?))
            }
        };
        Ok(self.boundary.insert(boundary))
    }

    /// The boundary of the mesh at its present coordinates, with the fields whose names are `wanted`.
    ///
    /// # Errors
    /// As [`surface_of`](Self::surface_of), and [`ExtractError::PointNotFinite`]. A field that cannot be taken is no error of
    /// the extract: it is left out and named in [`Extracted::errors`].
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

    /// The cut of the mesh with a plane: polygons that turn counter-clockwise about its normal (lines where the mesh is a
    /// surface), vertex fields interpolated linearly along the cut edges, element fields carried over. Cells that share an edge
    /// share its point. `furthest_of_all` makes of a number the largest that any rank has; on one process it gives it back.
    ///
    /// # Errors
    /// [`ExtractError::PointNotFinite`]; fields as in [`surface`](Self::surface).
    pub fn slice(
        &self,
        channel: &Channel,
        plane: &Slice,
        cycle: u64,
        wanted: &dyn Fn(&str) -> bool,
        furthest_of_all: &dyn Fn(f64) -> f64,
    ) -> Result<Extracted, ExtractError> {
        let counts = |cell: usize| self.counts(Association::Element, cell);
        let cut =
            slice::cut(&self.cells, &channel.mesh.points, plane, cycle, &counts, furthest_of_all)?;
        let from = Points::Crossings(&cut.crossings);
        let (fields, errors) =
            gather::fields(channel, cycle, wanted, &from, &Owners::Cells(&cut.owners));
        let extract = Extract {
            points: cut.points,
            vertices: None,
            cells: Arc::new(cut.cells),
            features: None,
            fields,
        };
        let origin = Origin::Edges(cut.crossings.iter().map(|crossing| crossing.edge).collect());
        Ok(Extracted { extract: Arc::new(extract), owners: cut.owners.into(), errors, origin })
    }

    /// The whole mesh.
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
        let ghosts = channel.mesh.ghost_cells.filter(|ghosts| ghosts.contains(&true));
        let is_told =
            |field: &Field| field.name == GHOST_FIELD && field.association == Association::Element;
        if let Some(ghosts) = ghosts.filter(|_| !fields.iter().any(is_told)) {
            fields.push(Field {
                name: GHOST_FIELD.to_owned(),
                association: Association::Element,
                components: 1,
                number: NumberType::U8,
                values: ghosts.iter().map(|&is_ghost| f64::from(u8::from(is_ghost))).collect(),
            });
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
