//! Values from the solver's arrays to the points and cells of an extract.

use tombolo_deform::mesh::{ArrayView, NumberType, Vector};

use super::{ABSENT, Association, Channel, ExtractError, Field, FieldView, is_absent};

/// Where the points of an extract come from.
pub(super) enum Points<'a> {
    /// Every vertex of the mesh.
    All,
    /// These vertices.
    Vertices(&'a [u32]),
    /// Between vertices.
    Crossings(&'a [Crossing]),
    /// Among several vertices.
    Rows(&'a Rows),
}

/// Points as weighted sums of vertices, in compressed rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rows {
    offsets: Vec<usize>,
    entries: Vec<(u32, f64)>,
}

impl Default for Rows {
    fn default() -> Self {
        Self { offsets: vec![0], entries: Vec::new() }
    }
}

impl Rows {
    /// Bytes of memory.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.offsets) + size_of_val(&*self.entries)
    }

    /// Appends a point: its vertices and their weights, whose sum is 1.
    pub(super) fn push(&mut self, entries: impl IntoIterator<Item = (u32, f64)>) {
        self.entries.extend(entries);
        self.offsets.push(self.entries.len());
    }

    pub(super) fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The vertices of a point and their weights.
    pub(super) fn row(&self, point: usize) -> &[(u32, f64)] {
        &self.entries[self.offsets[point]..self.offsets[point + 1]]
    }
}

/// A point between the two ends of an edge, or a vertex where they are one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Crossing {
    /// The ends, the lower number first.
    pub(super) edge: [u32; 2],
    /// How far from the first to the second, 0 to 1.
    pub(super) fraction: f64,
}

impl Crossing {
    /// Linear between the values at the ends, and never outside them.
    pub(super) fn between(&self, first: f64, second: f64) -> f64 {
        if self.edge[0] == self.edge[1] || first == second {
            return first;
        }
        first * (1.0 - self.fraction) + second * self.fraction
    }
}

/// Where the cells of an extract come from.
pub(super) enum Owners<'a> {
    /// Every cell of the mesh.
    All,
    /// These cells.
    Cells(&'a [u32]),
    /// These cells, one for each point, which gets their values.
    OfPoints(&'a [u32]),
}

/// The coordinates of these vertices.
pub(super) fn points(
    points: &ArrayView,
    vertices: &[u32],
    cycle: u64,
) -> Result<Vec<Vector>, ExtractError> {
    vertices.iter().map(|&vertex| point(points, vertex as usize, cycle)).collect()
}

/// The coordinates of one vertex.
pub(super) fn point(points: &ArrayView, vertex: usize, cycle: u64) -> Result<Vector, ExtractError> {
    let point = points.vector(vertex);
    match point.iter().find(|x| !x.is_finite()) {
        Some(&value) => Err(ExtractError::PointNotFinite { vertex, value, cycle }),
        None => Ok(point),
    }
}

/// The wanted fields, and what was wrong with those that are left out.
pub(super) fn fields(
    channel: &Channel,
    cycle: u64,
    wanted: &dyn Fn(&str) -> bool,
    points: &Points,
    owners: &Owners,
) -> (Vec<Field>, Vec<ExtractError>) {
    let (mut fields, mut errors) = (Vec::new(), Vec::new());
    for view in channel.fields.iter().filter(|view| wanted(view.name)) {
        match field(channel, cycle, view, points, owners) {
            Ok(field) => fields.push(field),
            Err(error) => errors.push(error),
        }
    }
    (fields, errors)
}

/// Refuses a field that has not one tuple for each vertex or cell.
pub(crate) fn check_length(channel: &Channel, view: &FieldView) -> Result<(), ExtractError> {
    let expected = match view.association {
        Association::Vertex => channel.mesh.points.len(),
        Association::Element => channel.mesh.cells.len(),
        Association::Mesh => return Ok(()),
    };
    if view.values.len() == expected {
        return Ok(());
    }
    Err(ExtractError::FieldLength {
        field: view.name.to_owned(),
        association: view.association,
        found: view.values.len(),
        expected,
    })
}

fn field(
    channel: &Channel,
    cycle: u64,
    view: &FieldView,
    points: &Points,
    owners: &Owners,
) -> Result<Field, ExtractError> {
    check_length(channel, view)?;
    let components = view.values.components();
    let read = |entity: usize, component: usize| {
        let value = view.values.get(entity, component);
        if value.is_finite() || is_absent(value) {
            return Ok(value);
        }
        let (field, association) = (view.name.to_owned(), view.association);
        Err(ExtractError::FieldNotFinite { field, association, entity, value, cycle })
    };
    let (mut values, mut number) = (Vec::new(), view.values.number());
    let mut copy = |entities: &mut dyn Iterator<Item = usize>| -> Result<(), ExtractError> {
        values.reserve(entities.size_hint().0 * components);
        for entity in entities {
            for component in 0..components {
                values.push(read(entity, component)?);
            }
        }
        Ok(())
    };
    match (view.association, points, owners) {
        (Association::Vertex, Points::All, _) => copy(&mut (0..view.values.len()))?,
        (Association::Vertex, Points::Vertices(vertices), _) => {
            copy(&mut vertices.iter().map(|&v| v as usize))?
        }
        (Association::Mesh, ..) | (Association::Element, _, Owners::All) => {
            copy(&mut (0..view.values.len()))?
        }
        (Association::Element, _, Owners::Cells(cells) | Owners::OfPoints(cells)) => {
            copy(&mut cells.iter().map(|&cell| cell as usize))?
        }
        (Association::Vertex, Points::Crossings(crossings), _) => {
            values.reserve(crossings.len() * components);
            // Between whole numbers there are others.
            number = if number.is_real() { number } else { NumberType::F64 };
            for crossing in *crossings {
                for component in 0..components {
                    let [a, b] = crossing.edge.map(|vertex| read(vertex as usize, component));
                    let (a, b) = (a?, b?);
                    values.push(if is_absent(a) || is_absent(b) {
                        ABSENT
                    } else {
                        crossing.between(a, b)
                    });
                }
            }
        }
        (Association::Vertex, Points::Rows(rows), _) => {
            values.reserve(rows.len() * components);
            number = if number.is_real() { number } else { NumberType::F64 };
            for row in (0..rows.len()).map(|point| rows.row(point)) {
                for component in 0..components {
                    values.push(match *row {
                        [(vertex, _)] => read(vertex as usize, component)?,
                        _ => weighted(row, |vertex| read(vertex as usize, component))?,
                    });
                }
            }
        }
    }
    let association = match (view.association, owners) {
        (Association::Element, Owners::OfPoints(_)) => Association::Vertex,
        (association, _) => association,
    };
    let mut field = Field { name: view.name.to_owned(), association, components, number, values };
    field.settle();
    Ok(field)
}

/// A weighted sum of values; absent where one of them is.
fn weighted(
    row: &[(u32, f64)],
    read: impl Fn(u32) -> Result<f64, ExtractError>,
) -> Result<f64, ExtractError> {
    let mut sum = 0.0;
    for &(vertex, weight) in row {
        let value = read(vertex)?;
        if is_absent(value) {
            return Ok(ABSENT);
        }
        sum += weight * value;
    }
    Ok(sum)
}
