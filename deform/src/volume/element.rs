//! Gradients of the shape functions of volume cells at points of quadrature.

use crate::mesh::cell_geometry::{corner_tets, tet_determinant};
use crate::mesh::{CellType, Mesh, Vector};
use crate::number::real;
use crate::vector::{add, cross, dot, mean, scale, subtract};

/// Derivatives of the shape functions of one cell type, in its own coordinates, at the points of a
/// quadrature rule.
type Rule = Vec<(f64, Vec<Vector>)>;

/// The volume cells of a mesh as finite elements.
///
/// - Tetrahedra: linear, exact.
/// - Hexahedra and voxels: trilinear, 2×2×2 Gauss points.
/// - Wedges: linear by linear, 3×2 points. Pyramids: the hexahedron whose upper face is drawn
///   together, 2×2×2 points.
/// - Prisms and polyhedra: split into the tetrahedra that each edge of each face makes with the
///   mean of the face and the mean of the cell; the displacement of a mean is the mean of the
///   vertices' (no unknowns are added, neighbours agree on shared faces, linear fields are
///   represented exactly).
pub(super) struct Elements<'a> {
    mesh: &'a Mesh,
    hexahedron: Rule,
    voxel: Rule,
    wedge: Rule,
    pyramid: Rule,
}

/// Memory that is used again from cell to cell.
#[derive(Default)]
pub(super) struct Scratch {
    gradients: Vec<Vector>,
    tets: Vec<[Vector; 4]>,
}

impl<'a> Elements<'a> {
    pub(super) fn new(mesh: &'a Mesh) -> Self {
        let hexahedron = hexahedron_rule();
        let voxel = hexahedron
            .iter()
            .map(|(weight, derivatives)| {
                (*weight, [0, 1, 3, 2, 4, 5, 7, 6].map(|local: usize| derivatives[local]).to_vec())
            })
            .collect();
        Self { mesh, hexahedron, voxel, wedge: wedge_rule(), pyramid: pyramid_rule() }
    }

    /// The volume of a cell; `None` where it, or the determinant at a corner or point of
    /// quadrature, is not positive.
    pub(super) fn volume(&self, cell: usize, scratch: &mut Scratch) -> Option<f64> {
        let (mut volume, mut valid) = (0.0, true);
        self.for_each_point(cell, scratch, |weight, _| {
            volume += weight;
            valid &= weight > 0.0;
        });
        if self.mesh.cells().cell_type(cell) != CellType::Tetra {
            let points = self.mesh.points();
            corner_tets(
                self.mesh.cells(),
                cell,
                |vertex| points[vertex as usize],
                &mut scratch.tets,
            );
            valid &= scratch.tets.iter().all(|&tet| tet_determinant(tet) > 0.0);
        }
        (valid && volume.is_finite()).then_some(volume)
    }

    /// Calls `visit` with the weight (in units of volume) of each point of quadrature of a volume
    /// cell, and the gradients there of the shape functions of the cell's vertices.
    #[inline]
    pub(super) fn for_each_point(
        &self,
        cell: usize,
        scratch: &mut Scratch,
        mut visit: impl FnMut(f64, &[Vector]),
    ) {
        let cells = self.mesh.cells();
        let points = self.mesh.points();
        let vertices = cells.vertices(cell);
        let rule = match cells.cell_type(cell) {
            CellType::Tetra => {
                if let &[a, b, c, d] = vertices {
                    let (weight, gradients) =
                        tetra([a, b, c, d].map(|vertex| points[vertex as usize]));
                    visit(weight, &gradients);
                }
                return;
            }
            CellType::Hexahedron => &self.hexahedron,
            CellType::Voxel => &self.voxel,
            CellType::Wedge => &self.wedge,
            CellType::Pyramid => &self.pyramid,
            _ => return self.for_each_part(cell, &mut scratch.gradients, visit),
        };
        for (weight, derivatives) in rule {
            // The columns of the Jacobian.
            let mut jacobian = [[0.0; 3]; 3];
            for (&vertex, derivative) in vertices.iter().zip(derivatives) {
                for (column, &factor) in jacobian.iter_mut().zip(derivative) {
                    *column = add(*column, scale(points[vertex as usize], factor));
                }
            }
            let [r, s, t] = jacobian;
            let cofactors = [cross(s, t), cross(t, r), cross(r, s)];
            let determinant = dot(r, cofactors[0]);
            scratch.gradients.clear();
            scratch.gradients.extend(derivatives.iter().map(|derivative| {
                let sum = add(
                    add(scale(cofactors[0], derivative[0]), scale(cofactors[1], derivative[1])),
                    scale(cofactors[2], derivative[2]),
                );
                scale(sum, 1.0 / determinant)
            }));
            visit(weight * determinant, &scratch.gradients);
        }
    }

    /// A prism or polyhedron, by its tetrahedra.
    fn for_each_part(
        &self,
        cell: usize,
        gradients: &mut Vec<Vector>,
        mut visit: impl FnMut(f64, &[Vector]),
    ) {
        let cells = self.mesh.cells();
        let vertices = cells.vertices(cell);
        let point = |vertex: u32| self.mesh.points()[vertex as usize];
        let local = |vertex: u32| vertices.iter().position(|&other| other == vertex);
        let centre = mean(vertices.iter().map(|&vertex| point(vertex)));
        // Each tetrahedron has two or three vertices of the face, the mean of the cell and perhaps
        // that of the face.
        let mut part = |corners: [Vector; 4], own: &[u32], face: &[u32]| {
            let (weight, [first, second, third, last]) = tetra(corners);
            gradients.clear();
            gradients.resize(vertices.len(), share(last, vertices.len()));
            for (&vertex, gradient) in own.iter().zip([first, second, third]) {
                if let Some(local) = local(vertex) {
                    gradients[local] = add(gradients[local], gradient);
                }
            }
            for &vertex in face {
                if let Some(local) = local(vertex) {
                    gradients[local] = add(gradients[local], share(third, face.len()));
                }
            }
            visit(weight, gradients);
        };
        cells.for_each_face(cell, |face| {
            if let &[a, b, c] = face {
                part([point(b), point(a), point(c), centre], &[b, a, c], &[]);
                return;
            }
            let middle = mean(face.iter().map(|&vertex| point(vertex)));
            for (index, &a) in face.iter().enumerate() {
                let b = face[(index + 1) % face.len()];
                part([point(b), point(a), middle, centre], &[b, a], face);
            }
        });
    }
}

/// The part of a mean's gradient that falls to one of `count` vertices.
fn share(gradient: Vector, count: usize) -> Vector {
    scale(gradient, 1.0 / real(count))
}

/// The volume of a tetrahedron and the gradients of its linear shape functions.
#[inline]
fn tetra([p0, p1, p2, p3]: [Vector; 4]) -> (f64, [Vector; 4]) {
    let (a, b, c) = (subtract(p1, p0), subtract(p2, p0), subtract(p3, p0));
    let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
    let determinant = dot(a, bc);
    let inverse = 1.0 / determinant;
    let (g1, g2, g3) = (scale(bc, inverse), scale(ca, inverse), scale(ab, inverse));
    let g0 = scale(add(add(g1, g2), g3), -1.0);
    (determinant / 6.0, [g0, g1, g2, g3])
}

/// The two Gauss points of `0..=1`.
fn gauss() -> [f64; 2] {
    let offset = 0.5 / 3.0f64.sqrt();
    [0.5 - offset, 0.5 + offset]
}

/// The corners of the unit square in order around.
const SQUARE: [(f64, f64); 4] = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];

/// The linear function that is 1 at `end` (0 or 1) and 0 at the other end of `0..=1`: its value and
/// slope.
fn linear(end: f64, at: f64) -> (f64, f64) {
    if end > 0.5 { (at, 1.0) } else { (1.0 - at, -1.0) }
}

fn hexahedron_rule() -> Rule {
    cube_points()
        .map(|[r, s, t]| {
            let corners = [0.0, 1.0].into_iter().flat_map(|top| SQUARE.map(|(x, y)| (x, y, top)));
            let derivatives = corners.map(|(x, y, z)| {
                let ((x, dx), (y, dy), (z, dz)) = (linear(x, r), linear(y, s), linear(z, t));
                [dx * y * z, x * dy * z, x * y * dz]
            });
            (0.125, derivatives.collect())
        })
        .collect()
}

fn pyramid_rule() -> Rule {
    cube_points()
        .map(|[r, s, t]| {
            let base = SQUARE.map(|(x, y)| {
                let ((x, dx), (y, dy)) = (linear(x, r), linear(y, s));
                [dx * y * (1.0 - t), x * dy * (1.0 - t), -x * y]
            });
            (0.125, base.into_iter().chain([[0.0, 0.0, 1.0]]).collect())
        })
        .collect()
}

fn wedge_rule() -> Rule {
    let triangle = [(1.0 / 6.0, 1.0 / 6.0), (2.0 / 3.0, 1.0 / 6.0), (1.0 / 6.0, 2.0 / 3.0)];
    let places = triangle.into_iter().flat_map(|(r, s)| gauss().map(|t| (r, s, t)));
    places
        .map(|(r, s, t)| {
            let flat = [(1.0 - r - s, -1.0, -1.0), (r, 1.0, 0.0), (s, 0.0, 1.0)];
            let derivatives = [0.0, 1.0].into_iter().flat_map(|top| {
                let (z, dz) = linear(top, t);
                flat.map(|(value, dr, ds)| [dr * z, ds * z, value * dz])
            });
            (1.0 / 12.0, derivatives.collect())
        })
        .collect()
}

fn cube_points() -> impl Iterator<Item = Vector> {
    let line = gauss();
    line.into_iter().flat_map(move |r| line.into_iter().flat_map(move |s| line.map(|t| [r, s, t])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;

    /// Volumes of the unit cells, gradients that sum to zero and reproduce the coordinates.
    #[test]
    fn shape_functions_reproduce_linear_fields() {
        for cell_type in CellType::ALL.into_iter().filter(|cell| cell.dimension() == 3) {
            let mesh = shapes::single_cell(cell_type);
            let elements = Elements::new(&mesh);
            let mut scratch = Scratch::default();
            let vertices = mesh.cells().vertices(0).to_vec();
            let mut volume = 0.0;
            elements.for_each_point(0, &mut scratch, |weight, gradients| {
                volume += weight;
                for axis in 0..3 {
                    let field = |vertex: u32| mesh.points()[vertex as usize][axis] + 7.0;
                    let gradient = vertices
                        .iter()
                        .zip(gradients)
                        .fold([0.0; 3], |sum, (&vertex, &gradient)| {
                            add(sum, scale(gradient, field(vertex)))
                        });
                    for (other, value) in gradient.into_iter().enumerate() {
                        let exact = f64::from(u8::from(axis == other));
                        assert!((value - exact).abs() < 1e-13, "{cell_type}: {gradient:?}");
                    }
                }
            });
            let exact = match cell_type {
                CellType::Tetra => 1.0 / 6.0,
                CellType::Wedge => 0.5,
                CellType::Pyramid => 1.0 / 3.0,
                CellType::PentagonalPrism => 2.5 * (0.4 * std::f64::consts::PI).sin(),
                CellType::HexagonalPrism => 1.5 * 3.0f64.sqrt(),
                _ => 1.0,
            };
            assert!((volume - exact).abs() < 1e-13, "{cell_type}: {volume}");
            assert_eq!(elements.volume(0, &mut scratch), Some(volume));
        }
    }
}
