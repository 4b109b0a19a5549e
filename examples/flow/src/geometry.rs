//! The parts of a tetrahedral mesh that change when it moves.

use rayon::prelude::*;
use tombolo_deform::mesh::Vector;

use crate::linear::{Matrix, for_each_chunk};
use crate::topology::Topology;

/// A linear tetrahedron at its present place.
#[derive(Debug, Clone, Copy)]
pub struct Element {
    /// The gradient of each vertex's shape function (1/length).
    pub gradients: [Vector; 4],
    /// The volume; not positive where the element is inverted.
    pub volume: f64,
}

impl Element {
    /// The element with these corners.
    #[must_use]
    pub fn new(corners: [Vector; 4]) -> Self {
        let [a, b, c] = [1, 2, 3].map(|corner| minus(corners[corner], corners[0]));
        let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
        let determinant = dot(a, bc);
        let others = [bc, ca, ab].map(|area| area.map(|value| value / determinant));
        let first =
            std::array::from_fn(|axis| -(others[0][axis] + others[1][axis] + others[2][axis]));
        Self { gradients: [first, others[0], others[1], others[2]], volume: determinant / 6.0 }
    }

    /// The gradient of the linear function with these values at the vertices.
    #[inline]
    #[must_use]
    pub fn gradient(&self, values: [f64; 4]) -> Vector {
        let mut gradient = [0.0; 3];
        for (value, shape) in values.iter().zip(&self.gradients) {
            for axis in 0..3 {
                gradient[axis] += value * shape[axis];
            }
        }
        gradient
    }
}

/// Everything about the shape of the mesh that the scheme needs.
#[derive(Debug)]
pub struct Geometry {
    /// The coordinates, in the solver's numbering.
    pub points: Vec<Vector>,
    /// The elements.
    pub elements: Vec<Element>,
    /// The integral of each vertex's shape function.
    pub vertex_volumes: Vec<f64>,
}

impl Geometry {
    /// Measures the mesh at these coordinates (solver's numbering).
    #[must_use]
    pub fn new(topology: &Topology, points: Vec<Vector>) -> Self {
        let elements: Vec<Element> = topology
            .elements
            .par_iter()
            .map(|vertices| Element::new(vertices.map(|vertex| points[vertex as usize])))
            .collect();
        let mut vertex_volumes = vec![0.0; points.len()];
        for_each_chunk(&mut vertex_volumes, |start, chunk| {
            for (offset, volume) in chunk.iter_mut().enumerate() {
                *volume = topology
                    .around(start + offset)
                    .iter()
                    .map(|incidence| 0.25 * elements[incidence.element as usize].volume)
                    .sum();
            }
        });
        Self { points, elements, vertex_volumes }
    }

    /// The first element whose volume is not positive, if there is one.
    #[must_use]
    pub fn inverted(&self) -> Option<usize> {
        self.elements.iter().position(|element| element.volume.is_nan() || element.volume <= 0.0)
    }

    /// The stiffness matrix of the Laplacian: the integrals of products of the shape functions' gradients.
    #[must_use]
    pub fn laplacian(&self, topology: &Topology) -> Matrix {
        let mut matrix = Matrix::zeros(std::sync::Arc::clone(&topology.pattern));
        let pattern = &topology.pattern;
        let rows = row_slices(pattern.starts.as_slice(), &mut matrix.values);
        rows.into_par_iter().enumerate().with_min_len(512).for_each(|(row, values)| {
            for incidence in topology.around(row) {
                let element = &self.elements[incidence.element as usize];
                let own = element.gradients[incidence.local as usize];
                for (slot, other) in incidence.slots.iter().zip(&element.gradients) {
                    values[*slot as usize] += element.volume * dot(own, *other);
                }
            }
        });
        matrix
    }
}

/// The values of a matrix, row by row.
#[must_use]
pub fn row_slices<'a>(starts: &[usize], mut values: &'a mut [f64]) -> Vec<&'a mut [f64]> {
    let mut rows = Vec::with_capacity(starts.len().saturating_sub(1));
    for window in starts.windows(2) {
        let (row, rest) = values.split_at_mut(window[1] - window[0]);
        rows.push(row);
        values = rest;
    }
    rows
}

/// The scalar product.
#[inline]
#[must_use]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector product.
#[inline]
#[must_use]
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The difference.
#[inline]
#[must_use]
pub fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
