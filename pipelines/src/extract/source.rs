//! A channel's cells, and what is worked out of them once.

use std::sync::Arc;

use tombolo_deform::mesh::{Cells, Mesh, MeshView};
use tombolo_deform::quality::{Quality, quality, scaled_jacobians};
use tombolo_deform::surface::{FeatureSettings, Surface};

use super::gather::{self, Owners, Points};
use super::{Association, Channel, Extract, ExtractError, ExtractFeatures, Field, slice};
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
}

impl Extracted {
    /// Adds an element field given for each cell of the solver's mesh. Cells without a value (NaN) have 0.
    pub fn add_element_field(&mut self, name: &str, of_cells: &[f64]) {
        let value = |&cell: &u32| of_cells.get(cell as usize).copied().filter(|value| value.is_finite()).unwrap_or(0.0);
        let fields = &mut Arc::make_mut(&mut self.extract).fields;
        fields.retain(|field| field.name != name);
        fields.push(Field {
            name: name.to_owned(),
            association: Association::Element,
            components: 1,
            values: self.owners.iter().map(value).collect(),
        });
    }
}

/// A channel's cells, checked and owned, and its surface. Both are taken anew when the solver hands over other cells, which shows
/// in where they lie in memory, their number, or the generation that the solver counts up.
#[derive(Debug)]
pub struct Source {
    key: Key,
    cells: Arc<Cells>,
    boundary: Option<Boundary>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Key {
    identity: (usize, usize),
    cells: usize,
    points: usize,
    generation: u64,
}

impl Key {
    fn of(mesh: &MeshView) -> Self {
        Self {
            identity: mesh.cells.identity(),
            cells: mesh.cells.len(),
            points: mesh.points.len(),
            generation: mesh.generation,
        }
    }
}

#[derive(Debug)]
struct Boundary {
    surface: Arc<Surface>,
    cells: Arc<Cells>,
    vertices: Arc<[u32]>,
    owners: Arc<[u32]>,
    features: Arc<ExtractFeatures>,
}

impl Boundary {
    fn new(surface: Arc<Surface>) -> Self {
        let features = surface.features();
        let features =
            ExtractFeatures { names: features.names().to_vec(), of_cells: features.face_features().to_vec() };
        Self {
            cells: Arc::new(surface.faces().clone()),
            vertices: surface.vertices().into(),
            owners: surface.owner_cells().into(),
            features: Arc::new(features),
            surface,
        }
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
        Ok(Self { key: Key::of(&channel.mesh), cells: Arc::new(cells), boundary: None })
    }

    /// Whether the channel still has the cells that this was made of. Looks at no cell.
    #[must_use]
    pub fn is_of(&self, channel: &Channel) -> bool {
        self.key == Key::of(&channel.mesh)
    }

    /// The cells.
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
                let mesh = Mesh::new(points, Cells::clone(&self.cells), channel.mesh.features.clone())?;
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
        let boundary = self.boundary(channel)?;
        let points = gather::points(&channel.mesh.points, &boundary.vertices, cycle)?;
        let from = Points::Vertices(&boundary.vertices);
        let (fields, errors) = gather::fields(channel, cycle, wanted, &from, &Owners::Cells(&boundary.owners));
        let extract = Extract {
            points,
            vertices: Some(Arc::clone(&boundary.vertices)),
            cells: Arc::clone(&boundary.cells),
            features: Some(Arc::clone(&boundary.features)),
            fields,
        };
        Ok(Extracted { extract: Arc::new(extract), owners: Arc::clone(&boundary.owners), errors })
    }

    /// The cut of the mesh with a plane: polygons that turn counter-clockwise about its normal (lines where the mesh is a
    /// surface), vertex fields interpolated linearly along the cut edges, element fields carried over. Cells that share an edge
    /// share its point.
    ///
    /// # Errors
    /// [`ExtractError::PointNotFinite`]; fields as in [`surface`](Self::surface).
    pub fn slice(
        &self,
        channel: &Channel,
        plane: &Slice,
        cycle: u64,
        wanted: &dyn Fn(&str) -> bool,
    ) -> Result<Extracted, ExtractError> {
        let cut = slice::cut(&self.cells, &channel.mesh.points, plane, cycle)?;
        let from = Points::Crossings(&cut.crossings);
        let (fields, errors) = gather::fields(channel, cycle, wanted, &from, &Owners::Cells(&cut.owners));
        let extract =
            Extract { points: cut.points, vertices: None, cells: Arc::new(cut.cells), features: None, fields };
        Ok(Extracted { extract: Arc::new(extract), owners: cut.owners.into(), errors })
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
        let view = &channel.mesh.points;
        let points: Result<Vec<_>, _> = (0..view.len()).map(|vertex| gather::point(view, vertex, cycle)).collect();
        let (fields, errors) = gather::fields(channel, cycle, wanted, &Points::All, &Owners::All);
        #[expect(clippy::cast_possible_truncation, reason = "vertices and cells are numbered with 32 bits")]
        let numbers = |count: usize| (0..count as u32).collect::<Arc<[u32]>>();
        let extract = Extract {
            points: points?,
            vertices: Some(numbers(view.len())),
            cells: Arc::clone(&self.cells),
            features: None,
            fields,
        };
        Ok(Extracted { extract: Arc::new(extract), owners: numbers(self.cells.len()), errors })
    }

    /// The quality of the cells at the present coordinates.
    #[must_use]
    pub fn quality(&self, channel: &Channel) -> Quality {
        quality(&self.cells, &channel.mesh.points.to_vectors())
    }

    /// The scaled Jacobian of each cell at the present coordinates, NaN for those that have none.
    #[must_use]
    pub fn scaled_jacobians(&self, channel: &Channel) -> Vec<f64> {
        scaled_jacobians(&self.cells, &channel.mesh.points.to_vectors())
    }
}
