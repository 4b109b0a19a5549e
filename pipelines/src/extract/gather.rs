//! Values from the solver's arrays to the points and cells of an extract.

use tombolo_deform::mesh::{ArrayView, NumberType, Vector};
use tombolo_deform::vector::{add, scale};

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

/// The sum of the vectors of some vertices by their weights.
pub(super) fn weighted(row: &[(u32, f64)], vectors: &[Vector]) -> Vector {
    let part = |&(vertex, weight): &(u32, f64)| scale(vectors[vertex as usize], weight);
    row.iter().map(part).fold([0.0; 3], add)
}

/// A point between the two ends of an edge, or a vertex where they are one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crossing {
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

/// The vectors of an array where they lie in memory as vectors do.
pub(super) fn lent<'a>(view: &ArrayView<'a>) -> Option<&'a [Vector]> {
    let values = view.contiguous().filter(|_| view.components() == 3)?;
    Some(values.as_chunks::<3>().0)
}

/// Whether all coordinates are finite. Without a branch, which processors do many at a time.
pub(super) fn are_finite(points: &[Vector]) -> bool {
    points.as_flattened().iter().fold(true, |finite, x| finite & x.is_finite())
}

/// The coordinates of these vertices.
pub(super) fn points(
    points: &ArrayView,
    vertices: &[u32],
    cycle: u64,
) -> Result<Vec<Vector>, ExtractError> {
    // As with fields, a slice is read faster than what asks for the type of each number.
    if let Some(all) = lent(points) {
        let found: Vec<Vector> = vertices.iter().map(|&vertex| all[vertex as usize]).collect();
        if are_finite(&found) {
            return Ok(found);
        }
    }
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
    // Most solvers have their values so; a slice is read twice as fast as what asks for the type of
    // each number.
    let values = match view.values.contiguous() {
        Some(values) => {
            let get = |entity: usize, component: usize| values[entity * components + component];
            gathered(view, cycle, points, owners, get)?
        }
        None => gathered(view, cycle, points, owners, |entity, component| {
            view.values.get(entity, component)
        })?,
    };
    // Between whole numbers there are others.
    let is_between = matches!(points, Points::Crossings(_) | Points::Rows(_));
    let number = match view.values.number() {
        number if number.is_real() => number,
        _ if is_between && view.association == Association::Vertex => NumberType::F64,
        number => number,
    };
    let association = match (view.association, owners) {
        (Association::Element, Owners::OfPoints(_)) => Association::Vertex,
        (association, _) => association,
    };
    let mut field = Field { name: view.name.to_owned(), association, components, number, values };
    field.settle();
    Ok(field)
}

/// The values of a field at points and cells; `get` reads one of an entity.
fn gathered(
    view: &FieldView,
    cycle: u64,
    points: &Points,
    owners: &Owners,
    get: impl Fn(usize, usize) -> f64 + Copy,
) -> Result<Vec<f64>, ExtractError> {
    let components = view.values.components();
    let read = |entity: usize, component: usize| {
        let value = get(entity, component);
        if value.is_finite() || is_absent(value) {
            return Ok(value);
        }
        let (field, association) = (view.name.to_owned(), view.association);
        Err(ExtractError::FieldNotFinite { field, association, entity, value, cycle })
    };
    let those = |entities: &[u32]| {
        let of = |tuple: usize| entities[tuple] as usize;
        let read = |tuple: usize, component: usize| read(of(tuple), component);
        tuples(entities.len(), components, |tuple, component| get(of(tuple), component), read)
    };
    match (view.association, points, owners) {
        (Association::Mesh, ..)
        | (Association::Vertex, Points::All, _)
        | (Association::Element, _, Owners::All) => {
            tuples(view.values.len(), components, get, read)
        }
        (Association::Vertex, Points::Vertices(vertices), _) => those(vertices),
        (Association::Element, _, Owners::Cells(cells) | Owners::OfPoints(cells)) => those(cells),
        (Association::Vertex, Points::Crossings(crossings), _) => {
            let between = |point: usize, component: usize| {
                let crossing = &crossings[point];
                let [a, b] = crossing.edge;
                crossing.between(get(a as usize, component), get(b as usize, component))
            };
            let read = |point: usize, component: usize| {
                let [a, b] = crossings[point].edge.map(|vertex| read(vertex as usize, component));
                let is_lacking = is_absent(a?) || is_absent(b?);
                Ok(if is_lacking { ABSENT } else { between(point, component) })
            };
            tuples(crossings.len(), components, between, read)
        }
        (Association::Vertex, Points::Rows(rows), _) => {
            let sum = |point: usize, component: usize| match *rows.row(point) {
                [(vertex, _)] => get(vertex as usize, component),
                ref row => {
                    let part =
                        |&(vertex, weight): &(u32, f64)| weight * get(vertex as usize, component);
                    row.iter().map(part).fold(0.0, |sum, part| sum + part)
                }
            };
            let read = |point: usize, component: usize| {
                let mut is_lacking = false;
                for &(vertex, _) in rows.row(point) {
                    is_lacking |= is_absent(read(vertex as usize, component)?);
                }
                Ok(if is_lacking { ABSENT } else { sum(point, component) })
            };
            tuples(rows.len(), components, sum, read)
        }
    }
}

/// The values of tuples, one after the other. Those that are not finite are read once more, which
/// finds what is wrong with them; all others cost no more than themselves.
fn tuples(
    count: usize,
    components: usize,
    get: impl Fn(usize, usize) -> f64,
    read: impl Fn(usize, usize) -> Result<f64, ExtractError>,
) -> Result<Vec<f64>, ExtractError> {
    let mut values = Vec::with_capacity(count * components);
    let mut are_finite = true;
    for tuple in 0..count {
        for component in 0..components {
            let value = get(tuple, component);
            are_finite &= value.is_finite();
            values.push(value);
        }
    }
    if !are_finite {
        for (index, value) in values.iter_mut().enumerate().filter(|(_, value)| !value.is_finite())
        {
            *value = read(index / components, index % components)?;
        }
    }
    Ok(values)
}
