//! How the vertices of a handle move.

use super::error::EditError;
use super::handle::{Handle, Role};
use super::kinds::{Displacement, Edit};
use crate::bounds::Bounds;
use crate::mesh::Vector;
use crate::surface::Surface;
use crate::vector::{add, cross, length, scale, subtract, triangle_normal, unit};

/// The motion of a handle as a sum of scalar fields on its vertices times constant vectors:
/// `displacement(v) = sum_j bases[j][v] * coefficients[j]`, in the order of [`Handle::vertices`].
///
/// Since what follows depends on the handle's motion linearly, each base need be carried to the
/// free surface once, and another amount (another angle, another factor) of the same edit costs a
/// sum for each vertex.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Motion {
    /// For each base its value at each vertex of the handle, of the order of 1.
    pub bases: Vec<Vec<f64>>,
    /// The length that coordinates are divided by in the bases.
    pub unit: f64,
}

impl Motion {
    /// The bases of the motion that `edit` asks of its handle on the shape that the edits before it
    /// have reached, whatever its amount; `None` for edits that give each vertex its own
    /// displacement ([`displacement`], skeletons).
    ///
    /// # Errors
    /// [`EditError::NoNormal`].
    pub fn new(
        surface: &Surface,
        edit: &Edit,
        index: usize,
        handle: &Handle,
        shape: &[Vector],
    ) -> Result<Option<Self>, EditError> {
        let ones = || vec![1.0; handle.vertices.len()];
        Ok(Some(match edit {
            Edit::Translate(_) => Self { bases: vec![ones()], unit: 1.0 },
            Edit::Rotate(edit) => Self::coordinates(handle, shape, edit.center),
            Edit::ScaleDirection(edit) => Self::coordinates(handle, shape, edit.center),
            Edit::Affine(edit) => {
                let mut motion = Self::coordinates(handle, shape, edit.center);
                motion.bases.push(ones());
                motion
            }
            Edit::ScaleNormals(_) => {
                let normals = handle_normals(surface, handle, shape, index)?;
                let bases =
                    [0, 1, 2].map(|axis| normals.iter().map(|normal| normal[axis]).collect());
                Self { bases: bases.to_vec(), unit: 1.0 }
            }
            Edit::Displacement(_) | Edit::Skeleton(_) => return Ok(None),
        }))
    }

    /// The vectors that the bases of [`Motion::new`] are multiplied by for the amount of an edit;
    /// none for edits without bases.
    pub fn coefficients(edit: &Edit, unit: f64) -> Vec<Vector> {
        match edit {
            Edit::Translate(edit) => vec![edit.by],
            Edit::Rotate(edit) => rotation_minus_identity(edit.axis, edit.degrees)
                .map(|column| scale(column, unit))
                .to_vec(),
            Edit::ScaleDirection(edit) => {
                diagonal(edit.factors.map(|factor| (factor - 1.0) * unit))
            }
            Edit::Affine(edit) => {
                let mut columns =
                    [0, 1, 2].map(|column| edit.matrix.map(|row| row[column])).to_vec();
                for (axis, column) in columns.iter_mut().enumerate() {
                    column[axis] -= 1.0;
                    *column = scale(*column, unit);
                }
                columns.push(edit.translation);
                columns
            }
            Edit::ScaleNormals(edit) => diagonal([edit.distance; 3]),
            Edit::Displacement(_) | Edit::Skeleton(_) => Vec::new(),
        }
    }

    /// The coordinates from a centre, in units of about their largest.
    fn coordinates(handle: &Handle, shape: &[Vector], center: Option<Vector>) -> Self {
        let points = || handle.vertices.iter().map(|&vertex| shape[vertex as usize]);
        let bounds = Bounds::around(points());
        let center = center.unwrap_or_else(|| bounds.center());
        let reach = bounds
            .corners()
            .map(|corner| subtract(corner, center))
            .as_flattened()
            .iter()
            .fold(0.0f64, |largest, value| largest.max(value.abs()));
        // A power of two changes no digit.
        let unit =
            if reach.is_normal() { reach.log2().ceil().clamp(-1000.0, 1000.0).exp2() } else { 1.0 };
        let bases = [0, 1, 2]
            .map(|axis| points().map(|point| (point[axis] - center[axis]) / unit).collect());
        Self { bases: bases.to_vec(), unit }
    }
}

fn diagonal(values: Vector) -> Vec<Vector> {
    let along = |axis: usize| {
        let mut vector = [0.0; 3];
        vector[axis] = values[axis];
        vector
    };
    [0, 1, 2].map(along).to_vec()
}

/// The columns of `R - 1` for the rotation `R` about an axis through the origin (Rodrigues),
/// without the digits that the difference would lose where the angle is small.
fn rotation_minus_identity(axis: Vector, degrees: f64) -> [Vector; 3] {
    // In units of its largest part, so that no length overflows.
    let largest = axis.iter().fold(0.0f64, |largest, part| largest.max(part.abs()));
    let axis = axis.map(|part| part / largest);
    let axis = unit(axis);
    let (sine, versine) = sine_and_versine(degrees);
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|unit| {
        let turned = cross(axis, unit);
        add(scale(turned, sine), scale(cross(axis, turned), versine))
    })
}

/// `sin` and `1 - cos` of an angle in degrees, exact at multiples of 90.
fn sine_and_versine(degrees: f64) -> (f64, f64) {
    let turn = degrees % 360.0;
    let quarter = (turn / 90.0).round();
    let rest = turn - 90.0 * quarter;
    let (sine, cosine) = rest.to_radians().sin_cos();
    let half = (0.5 * rest).to_radians().sin();
    let versine = 2.0 * half * half;
    match quarter.rem_euclid(4.0) as u8 {
        0 => (sine, versine),
        1 => (cosine, 1.0 + sine),
        2 => (-sine, 1.0 + cosine),
        _ => (-cosine, 1.0 - sine),
    }
}

/// The unit normal of each vertex of the handle: the area-weighted mean of the normals of the
/// handle's own triangles around it, or of all triangles around it where none of its triangles is
/// wholly in the handle. Fixed vertices need none and get 0.
fn handle_normals(
    surface: &Surface,
    handle: &Handle,
    shape: &[Vector],
    index: usize,
) -> Result<Vec<Vector>, EditError> {
    let largest = shape.iter().flatten().fold(0.0f64, |largest, value| largest.max(value.abs()));
    let unit = if largest > 0.0 { largest } else { 1.0 };
    let mut own = vec![[0.0; 3]; shape.len()];
    let mut has_own = vec![false; shape.len()];
    let mut all = vec![[0.0; 3]; shape.len()];
    for (triangle, &face) in surface.triangles().iter().zip(surface.triangle_faces()) {
        let normal = triangle_normal(
            triangle.map(|vertex| shape[vertex as usize].map(|value| value / unit)),
        );
        for &vertex in triangle {
            let vertex = vertex as usize;
            all[vertex] = add(all[vertex], normal);
            if handle.faces[face as usize] {
                own[vertex] = add(own[vertex], normal);
                has_own[vertex] = true;
            }
        }
    }
    if let Some(face) = first_turned(surface, handle) {
        return Err(EditError::OneSided { edit: index, face });
    }
    let unit_normal = |&vertex: &u32| {
        let local = vertex as usize;
        if handle.roles[local] == Role::Fixed {
            return Ok([0.0; 3]);
        }
        let normal = if has_own[local] { own[local] } else { all[local] };
        let length = length(normal);
        if length > 0.0 && length.is_finite() {
            Ok(normal.map(|part| part / length))
        } else {
            Err(EditError::NoNormal { edit: index, vertex: surface.vertices()[local] })
        }
    };
    handle.vertices.iter().map(unit_normal).collect()
}

/// The first face of the handle that walks an edge the same way as another one of it.
fn first_turned(surface: &Surface, handle: &Handle) -> Option<u32> {
    let triangles = surface.triangles().iter().zip(surface.triangle_faces());
    let mut sides: Vec<([u32; 2], u32)> = triangles
        .filter(|(_, face)| handle.faces[**face as usize])
        .flat_map(|(&[a, b, c], &face)| [([a, b], face), ([b, c], face), ([c, a], face)])
        .collect();
    sides.sort_unstable();
    sides.windows(2).filter(|pair| pair[0].0 == pair[1].0).map(|pair| pair[1].1).min()
}

/// The displacement that an import adds to each surface vertex.
pub(super) fn displacement(surface: &Surface, edit: &Displacement, handle: &Handle) -> Vec<Vector> {
    let mut displacement = vec![[0.0; 3]; surface.points().len()];
    for (vertex, &value) in edit.vertices.iter().zip(&*edit.values) {
        // Known to be on the surface since the handle was found.
        if let Ok(local) = surface.vertices().binary_search(vertex)
            && handle.roles[local] == Role::Handle
        {
            displacement[local] = scale(value, edit.scale);
        }
    }
    displacement
}
