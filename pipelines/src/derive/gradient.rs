//! Derivatives of fields along x, y and z, as `vtkGradientFilter` has them.

use tombolo_deform::communicator::Reduction;
use tombolo_deform::mesh::{CellType, Vector};
use tombolo_deform::vector::{add, cross, dot, length, mean, scale, subtract};

use super::{Basis, Operand};
use crate::extract::{ABSENT, Association};
use crate::interpolation::{Shape, center, corners, shape, solve};

/// The gradient of each component at each vertex or cell, tuple after tuple: the derivatives of the
/// first component along x, y and z, then those of the second. [`ABSENT`] where no own cell gives
/// any. Collective.
///
/// At a vertex it is the mean of the derivatives that the cells around have there. An element field
/// is brought to the vertices, as the mean over the cells around each; the gradient of a cell is
/// that at its centre. Cells of the mesh's greatest dimension count.
pub(super) fn gradients(
    basis: &Basis,
    operand: Option<&Operand>,
    association: Association,
    components: usize,
) -> Vec<f64> {
    let cells = basis.source.cells();
    let own = || (0..cells.len()).filter(|&cell| basis.source.counts(Association::Element, cell));
    let dimension = own().map(|cell| cells.cell_type(cell).dimension()).max().unwrap_or(0);
    let mut dimension = [dimension as u64];
    basis.communicator.reduce_integers(Reduction::Maximum, &mut dimension);
    let counting: Vec<usize> =
        own().filter(|&cell| cells.cell_type(cell).dimension() as u64 == dimension[0]).collect();
    let value = |entity: usize, component: usize| {
        operand.map_or(ABSENT, |operand| operand.value(entity, component))
    };
    let has = |entity: usize| operand.is_some_and(|operand| !operand.is_absent(entity));
    let derivatives = Derivatives { basis };
    let points = basis.source.points().len();
    if association == Association::Vertex {
        return means(basis, points, 3 * components, &counting, |cell, take| {
            let vertices = cells.vertices(cell);
            if !vertices.iter().all(|&vertex| has(vertex as usize)) {
                return;
            }
            let local =
                |vertex: usize, component: usize| value(vertices[vertex] as usize, component);
            derivatives.at_vertices(cell, components, &local, take);
        });
    }
    let of_vertices = means(basis, points, components, &counting, |cell, take| {
        if has(cell) {
            let values: Vec<f64> = (0..components).map(|part| value(cell, part)).collect();
            (0..cells.vertices(cell).len()).for_each(|vertex| take(vertex, &values));
        }
    });
    let mut gradients = vec![ABSENT; 3 * components * cells.len()];
    let tuples = &mut gradients;
    for cell in counting.into_iter().filter(|&cell| has(cell)) {
        let vertices = cells.vertices(cell);
        let local =
            |vertex: usize, part: usize| of_vertices[vertices[vertex] as usize * components + part];
        if let Some(values) = derivatives.at_center(cell, components, &local) {
            let start = 3 * components * cell;
            tuples[start..start + values.len()].copy_from_slice(&values);
        }
    }
    gradients
}

/// For each vertex the mean of what the cells around it give, `width` values each. `give` hands
/// over a vertex's position in the cell and its values. Collective.
fn means(
    basis: &Basis,
    points: usize,
    width: usize,
    own: &[usize],
    give: impl Fn(usize, &mut dyn FnMut(usize, &[f64])),
) -> Vec<f64> {
    let cells = basis.source.cells();
    let mut sums = vec![0.0; points * (width + 1)];
    for &cell in own {
        let vertices = cells.vertices(cell);
        give(cell, &mut |vertex, values| {
            let start = vertices[vertex] as usize * (width + 1);
            let sum = &mut sums[start..=start + width];
            sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
            sum[width] += 1.0;
        });
    }
    basis.source.sum_shared(width + 1, &mut sums);
    let mut means = Vec::with_capacity(points * width);
    for sum in sums.chunks(width + 1) {
        let count = sum[width];
        means.extend(sum[..width].iter().map(|sum| if count > 0.0 { sum / count } else { ABSENT }));
    }
    means
}

/// At the apex of a pyramid the derivatives depend on where one comes from: those are taken that
/// hold all along the line from the middle of its base.
const BELOW_APEX: Vector = [0.5, 0.5, 0.0];

struct Derivatives<'a> {
    basis: &'a Basis<'a>,
}

impl Derivatives<'_> {
    fn points(&self, cell: usize) -> Vec<Vector> {
        let vertices = self.basis.source.cells().vertices(cell);
        vertices.iter().map(|&vertex| self.basis.source.points()[vertex as usize]).collect()
    }

    /// The gradients at each vertex of a cell.
    fn at_vertices(
        &self,
        cell: usize,
        components: usize,
        value: &dyn Fn(usize, usize) -> f64,
        take: &mut dyn FnMut(usize, &[f64]),
    ) {
        let cell_type = self.basis.source.cells().cell_type(cell);
        let points = self.points(cell);
        let is_linear = matches!(cell_type, CellType::Tetra | CellType::Triangle);
        if is_linear || corners(cell_type).is_empty() {
            if let Some(values) = self.at_center(cell, components, value) {
                (0..points.len()).for_each(|vertex| take(vertex, &values));
            }
            return;
        }
        for (vertex, &at) in corners(cell_type).iter().enumerate() {
            let is_apex = cell_type == CellType::Pyramid && vertex == 4;
            let at = if is_apex { BELOW_APEX } else { at };
            if let Some(values) = derivatives(cell_type, &points, at, components, value) {
                take(vertex, &values);
            }
        }
    }

    /// The gradients at the centre of a cell. In a cell without parametric coordinates they are
    /// those of the linear function that is nearest to the values.
    fn at_center(
        &self,
        cell: usize,
        components: usize,
        value: &dyn Fn(usize, usize) -> f64,
    ) -> Option<Vec<f64>> {
        let cell_type = self.basis.source.cells().cell_type(cell);
        let points = self.points(cell);
        if cell_type.dimension() == 1 {
            return along(&points, components, value);
        }
        if corners(cell_type).is_empty() {
            return nearest_linear(&points, cell_type.dimension(), components, value);
        }
        derivatives(cell_type, &points, center(cell_type), components, value)
    }
}

fn derivatives(
    cell_type: CellType,
    points: &[Vector],
    at: Vector,
    components: usize,
    value: &dyn Fn(usize, usize) -> f64,
) -> Option<Vec<f64>> {
    let shape: Shape = shape(cell_type, at)?;
    let tangents = shape.tangents(points, cell_type.dimension());
    let mut all = Vec::with_capacity(3 * components);
    for component in 0..components {
        all.extend(solve(tangents, shape.slope(|vertex| value(vertex, component)))?);
    }
    Some(all)
}

/// The gradients along the parts of a line, weighted by the lengths of these; nothing is known across
/// it. `None` for a line without a length.
fn along(
    points: &[Vector],
    components: usize,
    value: &dyn Fn(usize, usize) -> f64,
) -> Option<Vec<f64>> {
    let parts: Vec<Vector> = points.windows(2).map(|ends| subtract(ends[1], ends[0])).collect();
    let whole: f64 = parts.iter().map(|part| length(*part)).sum();
    let mut all = Vec::with_capacity(3 * components);
    for component in 0..components {
        let mut sum = [0.0; 3];
        for (index, part) in parts.iter().enumerate().filter(|(_, part)| length(**part) > 0.0) {
            let rise = value(index + 1, component) - value(index, component);
            sum = add(sum, scale(*part, rise / length(*part)));
        }
        all.extend(scale(sum, 1.0 / whole));
    }
    (whole > 0.0).then_some(all)
}

/// The gradient of the linear function with the least squares of differences at the points.
fn nearest_linear(
    points: &[Vector],
    dimension: usize,
    components: usize,
    value: &dyn Fn(usize, usize) -> f64,
) -> Option<Vec<f64>> {
    let middle = mean(points.iter().copied());
    let from: Vec<Vector> = points.iter().map(|&point| subtract(point, middle)).collect();
    let mut rows = [[0.0; 3]; 3];
    for direction in &from {
        for (row, part) in rows.iter_mut().zip(direction) {
            *row = add(*row, scale(*direction, *part));
        }
    }
    if dimension == 2 {
        // Nothing is known across the face: the gradient has no part along its normal.
        // The widest of the triangles with the middle.
        let pairs = (1..from.len()).flat_map(|end| (0..end).map(move |start| (start, end)));
        let normals = pairs.map(|(start, end)| cross(from[start], from[end]));
        let normal = normals.max_by(|a, b| dot(*a, *a).total_cmp(&dot(*b, *b)))?;
        let weight = (rows[0][0] + rows[1][1] + rows[2][2]).sqrt() / length(normal);
        let normal = scale(normal, weight);
        for (row, part) in rows.iter_mut().zip(normal) {
            *row = add(*row, scale(normal, part));
        }
    }
    let mut all = Vec::with_capacity(3 * components);
    for component in 0..components {
        let products = from
            .iter()
            .enumerate()
            .fold([0.0; 3], |sum, (vertex, from)| add(sum, scale(*from, value(vertex, component))));
        all.extend(solve(rows, products)?);
    }
    Some(all)
}
