//! The Laplacian of a surface, robust against bad triangles.

use super::double_double::DoubleDouble;
use super::intrinsic::Triangulation;
use crate::surface::Surface;
use crate::surface::adjacency::Adjacency;

/// The cotangent Laplacian of a surface with its lumped mass, on the intrinsic Delaunay
/// triangulation.
///
/// `(L u)_i = sum over j of w_ij (u_i - u_j)` with `w_ij = (cot a + cot b) / 2` for the angles
/// opposite the edge. Where the sum of cotangents of an inner edge is negative, the edge is flipped
/// within the surface, which changes no length and no angle of the surface itself but only what is
/// a triangle (Bobenko and Springborn 2007); so the weights of inner edges are not negative. `L` is
/// symmetric and positive semidefinite; its kernel are the constants on each component. At an open
/// rim the natural boundary condition holds: no flux.
///
/// The mass of a vertex is its mixed Voronoi area (Meyer, Desbrun, Schröder and Barr 2003) divided
/// by the mean of all, so that nothing here depends on the units of the mesh.
///
/// Triangles without area are given one by lengthening all edges by the same least amount (Sharp
/// and Crane 2020), so that the longest side of each triangle is shorter than the two others by at
/// least `slack` of its length; surfaces without such triangles are taken as they are.
#[derive(Debug, Clone)]
pub(crate) struct Laplacian {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    weights: Vec<f64>,
    diagonal: Vec<f64>,
    mass: Vec<f64>,
}

impl Laplacian {
    /// Time and memory are linear in the surface, but for the flips.
    pub fn new(surface: &Surface, adjacency: &Adjacency, slack: f64) -> Self {
        let mut triangulation = Triangulation::new(surface, adjacency, slack);
        triangulation.make_delaunay();
        let mass = triangulation.mass(surface.points().len());
        let (offsets, columns, weights) = triangulation.compressed_rows(surface.points().len());
        let diagonal = offsets.windows(2).map(|row| weights[row[0]..row[1]].iter().sum()).collect();
        Self { offsets, columns, weights, diagonal, mass }
    }

    /// How many vertices the surface has.
    pub fn len(&self) -> usize {
        self.mass.len()
    }

    /// The mass of each vertex; their mean is 1.
    pub fn mass(&self) -> &[f64] {
        &self.mass
    }

    /// The neighbours of a vertex with their weights.
    pub fn neighbours(&self, vertex: usize) -> impl Iterator<Item = (usize, f64)> {
        let row = self.offsets[vertex]..self.offsets[vertex + 1];
        self.columns[row.clone()]
            .iter()
            .zip(&self.weights[row])
            .map(|(&column, &weight)| (column as usize, weight))
    }

    /// The row of `L` of a vertex, its diagonal first.
    pub fn row(&self, vertex: usize) -> impl Iterator<Item = (usize, f64)> {
        std::iter::once((vertex, self.diagonal[vertex]))
            .chain(self.neighbours(vertex).map(|(column, weight)| (column, -weight)))
    }

    /// `L u`. Constants give exact zeros.
    pub fn apply(&self, values: &[f64]) -> Vec<f64> {
        (0..self.len())
            .map(|vertex| {
                let own = values[vertex];
                self.neighbours(vertex)
                    .map(|(column, weight)| weight * (own - values[column]))
                    .sum()
            })
            .collect()
    }

    /// `(L M^-1)^(order - 1) L u`.
    pub fn apply_power(&self, order: usize, values: &[f64]) -> Vec<f64> {
        let mut result = self.apply(values);
        for _ in 1..order {
            for (value, mass) in result.iter_mut().zip(&self.mass) {
                *value /= mass;
            }
            result = self.apply(&result);
        }
        result
    }

    /// [`Laplacian::apply_power`] in twice the digits.
    pub(super) fn apply_power_exactly(
        &self,
        order: usize,
        values: &[DoubleDouble],
    ) -> Vec<DoubleDouble> {
        let apply = |values: &[DoubleDouble]| -> Vec<DoubleDouble> {
            let row = |vertex: usize| {
                let terms = self
                    .neighbours(vertex)
                    .map(|(column, weight)| (values[vertex] - values[column]).times(weight));
                terms.fold(DoubleDouble::default(), |sum, term| sum + term)
            };
            (0..self.len()).map(row).collect()
        };
        let mut result = apply(values);
        for _ in 1..order {
            let divided: Vec<DoubleDouble> =
                result.iter().zip(&self.mass).map(|(value, &mass)| value.over(mass)).collect();
            result = apply(&divided);
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::FeatureSettings;
    use crate::mesh::{FeatureSource, Mesh, Vector};
    use crate::shapes;

    fn laplacian(mesh: &Mesh, warp: impl Fn(Vector) -> Vector) -> (Surface, Laplacian) {
        let points = mesh.points().iter().map(|&point| warp(point)).collect();
        let mesh = Mesh::new(points, mesh.cells().clone(), FeatureSource::SharpEdges).unwrap();
        let surface = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
        let laplacian = Laplacian::new(&surface, &Adjacency::new(&surface).unwrap(), 1e-9);
        (surface, laplacian)
    }

    /// A plate sheared and bent within its plane, so that most of its triangles are obtuse, some by
    /// 170 degrees.
    fn sheared([x, y, _]: Vector) -> Vector {
        [x + 4.0 * y + 0.1 * (3.0 * y).sin(), y + 0.03 * (5.0 * x).sin(), 0.0]
    }

    #[test]
    fn inner_edges_of_obtuse_triangles_have_no_negative_weight() {
        let torus = shapes::torus(2.0, 0.5, [30, 18]);
        let (_, laplacian) = laplacian(&torus, |[x, y, z]| [x + 3.0 * z, 4.0 * y + 2.0 * x, z]);
        let lowest = (0..laplacian.len())
            .flat_map(|vertex| laplacian.neighbours(vertex))
            .map(|(_, weight)| weight);
        assert!(lowest.fold(f64::INFINITY, f64::min) > -1e-9);
        let mean = laplacian.mass().iter().sum::<f64>() / laplacian.len() as f64;
        assert!((mean - 1.0).abs() < 1e-12 && laplacian.mass().iter().all(|&mass| mass > 0.0));
    }

    #[test]
    fn flips_change_neither_the_energy_nor_the_kernel_of_linear_functions() {
        let plate = shapes::plate([12, 10], [0.0, 0.0], [1.2, 1.0]);
        let (surface, laplacian) = laplacian(&plate, sheared);
        let triangles = surface.triangles();
        let flipped = (0..laplacian.len()).any(|vertex| {
            laplacian.neighbours(vertex).any(|(other, weight)| {
                let joined =
                    |t: &[u32; 3]| t.contains(&(vertex as u32)) && t.contains(&(other as u32));
                weight > 1e-6 && !triangles.iter().any(joined)
            })
        });
        assert!(flipped, "the test would show nothing");
        let area: f64 = triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|vertex| surface.points()[vertex as usize]);
                0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
            })
            .sum();
        for axis in 0..2 {
            let values: Vec<f64> = surface.points().iter().map(|point| point[axis]).collect();
            let image = laplacian.apply(&values);
            // The energy of a coordinate is the integral of 1 over the plate.
            let energy: f64 = values.iter().zip(&image).map(|(value, image)| value * image).sum();
            assert!((energy / area - 1.0).abs() < 1e-11, "{energy} {area}");
            for j in 1..10 {
                for i in 1..12 {
                    assert!(image[i + 13 * j].abs() < 1e-11);
                }
            }
        }
    }

    #[test]
    fn the_laplacian_is_symmetric_and_annihilates_constants() {
        let (_, laplacian) = laplacian(&shapes::torus(2.0, 0.5, [20, 12]), |[x, y, z]| {
            [x, y + 0.3 * x * z, 3.0 * z]
        });
        for vertex in 0..laplacian.len() {
            for (other, weight) in laplacian.neighbours(vertex) {
                let back: Vec<f64> = laplacian
                    .neighbours(other)
                    .filter(|(back, _)| *back == vertex)
                    .map(|(_, weight)| weight)
                    .collect();
                assert_eq!(back, [weight]);
            }
        }
        for order in 1..4 {
            assert!(
                laplacian
                    .apply_power(order, &vec![0.1; laplacian.len()])
                    .iter()
                    .all(|&value| value == 0.0)
            );
        }
    }

    /// `M^-1 L` of the coordinates is twice the mean curvature times the normal.
    #[test]
    fn the_curvature_of_a_torus_converges() {
        let error = |count: usize| {
            let (surface, laplacian) =
                laplacian(&shapes::torus(2.0, 1.0, [2 * count, count]), |point| point);
            let total: f64 = 4.0 * std::f64::consts::PI.powi(2) * 2.0;
            let area = total / laplacian.len() as f64;
            let images = [0, 1, 2].map(|axis| {
                laplacian.apply(&surface.points().iter().map(|p| p[axis]).collect::<Vec<f64>>())
            });
            (0..laplacian.len())
                .map(|vertex| {
                    let [x, y, z] = surface.points()[vertex];
                    let cosine = x.hypot(y) - 2.0;
                    let expected = (2.0 + 2.0 * cosine) / (2.0 + cosine);
                    let image = images
                        .each_ref()
                        .map(|image| image[vertex] / (laplacian.mass()[vertex] * area));
                    let normal = [cosine * x / x.hypot(y), cosine * y / x.hypot(y), z];
                    let found: f64 = (0..3).map(|axis| image[axis] * normal[axis]).sum();
                    (found - expected).abs()
                })
                .fold(0.0, f64::max)
        };
        let [coarse, fine] = [error(24), error(48)];
        assert!(coarse / fine > 3.0 && fine < 0.02, "{coarse} {fine}");
    }
}
