//! The parts of a tetrahedral mesh that change when it moves.

use rayon::prelude::*;
use tombolo_deform::linear::SparseMatrix;
use tombolo_deform::mesh::Vector;
use tombolo_deform::vector::{cross, dot, subtract};

use crate::linear::for_each;
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
        let [a, b, c] = [1, 2, 3].map(|corner| subtract(corners[corner], corners[0]));
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
        for_each(&mut vertex_volumes, |vertex, volume| {
            let around = topology.around(vertex).iter();
            *volume =
                around.map(|incidence| 0.25 * elements[incidence.element as usize].volume).sum();
        });
        Self { points, elements, vertex_volumes }
    }

    /// The first element whose volume is not positive, if there is one.
    #[must_use]
    pub fn inverted(&self) -> Option<usize> {
        self.elements.iter().position(|element| element.volume.is_nan() || element.volume <= 0.0)
    }

    /// The stiffness matrix of the Laplacian: the integrals of products of the shape functions'
    /// gradients.
    #[must_use]
    pub fn laplacian(&self, topology: &Topology) -> SparseMatrix<1> {
        let mut matrix = topology.zeros.clone();
        let rows = topology.own_rows(&mut matrix);
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
