//! From the displacement of the surface to that of the volume.

use std::sync::Arc;

use tombolo_deform::{
    mesh::{Mesh, Vector},
    surface::Surface,
    volume::{Sliding, VolumeError, VolumeOperator, VolumeSolution},
};

use super::Refused;
use crate::language::DeformStage;

/// Faces around a vertex whose normals lie within this of each other (as a cosine: 30 degrees) are one surface to slide along.
const ONE_SURFACE: f64 = 0.866;

/// The operator of a volume, and what it takes of each vertex of the surface.
#[derive(Debug)]
pub(super) struct Carrier {
    operator: VolumeOperator,
    surface: Arc<Surface>,
    /// The surface vertices whose displacement is prescribed, in the order in which the operator takes them; `None` for all.
    held: Option<Vec<u32>>,
    /// The surface vertex of each of the operator's sliding vertices.
    sliding: Vec<u32>,
}

impl Carrier {
    /// Sets up the operator of the reference mesh `mesh`, whose surface is `surface`.
    pub(super) fn new(mesh: &Mesh, surface: &Arc<Surface>, deform: &DeformStage) -> Result<Self, Refused> {
        let (held, sliding) = if deform.lets_go() { split(surface, deform)? } else { (None, Vec::new()) };
        let boundary: Option<Vec<u32>> =
            held.as_ref().map(|held| held.iter().map(|&vertex| surface.vertices()[vertex as usize]).collect());
        let slides: Vec<Sliding> = sliding
            .iter()
            .map(|&(vertex, normal)| Sliding { vertex: surface.vertices()[vertex as usize], normal })
            .collect();
        let boundary = boundary.as_deref().unwrap_or(surface.vertices());
        let operator = VolumeOperator::with_sliding(mesh, boundary, &slides, &deform.equation)?;
        let sliding = sliding.into_iter().map(|(vertex, _)| vertex).collect();
        Ok(Self { operator, surface: Arc::clone(surface), held, sliding })
    }

    /// Whether the surface may end elsewhere than where it was told to.
    pub(super) fn lets_go(&self) -> bool {
        self.held.is_some()
    }

    /// The displacement of the volume for one of the surface.
    pub(super) fn solve(&self, surface: &[Vector]) -> Result<VolumeSolution, VolumeError> {
        let of =
            |vertices: &[u32]| -> Vec<Vector> { vertices.iter().map(|&vertex| surface[vertex as usize]).collect() };
        match &self.held {
            None => self.operator.solve(surface),
            Some(held) => self.operator.solve_sliding(&of(held), &of(&self.sliding)),
        }
    }

    /// Where the surface comes to lie when it is told to move like this: as it was told, but for what slides or is free.
    pub(super) fn settle(&self, surface: Vec<Vector>) -> Result<Vec<Vector>, VolumeError> {
        if !self.lets_go() || surface.iter().all(|displacement| *displacement == [0.0; 3]) {
            return Ok(surface);
        }
        let volume = self.solve(&surface)?.displacement;
        Ok(self.surface.vertices().iter().map(|&vertex| volume[vertex as usize]).collect())
    }
}

/// The surface vertices that are held, and those that slide, once for each direction across which they are held.
type Split = (Option<Vec<u32>>, Vec<(u32, Vector)>);

fn split(surface: &Surface, deform: &DeformStage) -> Result<Split, Refused> {
    /// What a feature does.
    #[derive(Clone, Copy, PartialEq)]
    enum Role {
        Held,
        Slides,
        Free,
    }
    let features = surface.features();
    let mut roles = vec![Role::Held; features.names().len()];
    for (field, names, role) in [("sliding", &deform.sliding, Role::Slides), ("free", &deform.free, Role::Free)] {
        for name in names {
            let feature = features.index(name).map_err(|source| Refused::Feature { field, source })?;
            roles[feature as usize] = role;
        }
    }
    let count = surface.points().len();
    let (mut held, mut touched) = (vec![false; count], vec![false; count]);
    let mut normals: Vec<(u32, Vector)> = Vec::new();
    for (triangle, &face) in surface.triangles().iter().zip(surface.triangle_faces()) {
        let role = roles[features.face_features()[face as usize] as usize];
        let normal = (role == Role::Slides).then(|| normal(triangle.map(|vertex| surface.points()[vertex as usize])));
        for &vertex in triangle {
            held[vertex as usize] |= role == Role::Held;
            touched[vertex as usize] = true;
            normals.extend(normal.map(|normal| (vertex, normal)));
        }
    }
    // A vertex of no face belongs to nothing that could let go of it.
    let all = (0_u32..).zip(held.iter().zip(&touched));
    let kept = all.filter(|(_, (held, touched))| **held || !**touched).map(|(vertex, _)| vertex).collect();
    normals.retain(|(vertex, _)| !held[*vertex as usize]);
    normals.sort_by_key(|(vertex, _)| *vertex);
    let mut sliding = Vec::new();
    for around in normals.chunk_by(|a, b| a.0 == b.0) {
        let mut surfaces: Vec<Vector> = Vec::new();
        for (_, normal) in around {
            match surfaces.iter_mut().find(|known| cosine(known, normal) > ONE_SURFACE) {
                Some(known) => (0..3).for_each(|axis| known[axis] += normal[axis]),
                None => surfaces.push(*normal),
            }
        }
        let vertex = around[0].0;
        sliding.extend(surfaces.into_iter().filter(|normal| *normal != [0.0; 3]).map(|normal| (vertex, normal)));
    }
    Ok((Some(kept), sliding))
}

/// Twice the area of a triangle, along its normal.
fn normal([a, b, c]: [Vector; 3]) -> Vector {
    let (u, v): (Vector, Vector) = (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

fn cosine(a: &Vector, b: &Vector) -> f64 {
    let dot = |a: &Vector, b: &Vector| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
}
