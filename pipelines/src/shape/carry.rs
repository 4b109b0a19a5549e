//! From the displacement of the surface to that of the volume.

use std::sync::Arc;

use tombolo_deform::{
    mesh::{Mesh, Vector},
    surface::Surface,
    volume::{Sliding, VolumeError, VolumeOperator, VolumeSolution},
};

use super::{Refused, boundary::Boundary};
use crate::language::DeformStage;

/// Faces around a vertex whose normals lie within this of each other (as a cosine: 30 degrees) are one surface to slide along.
const ONE_SURFACE: f64 = 0.866;

/// The operator of a volume, and what it takes of each vertex of its boundary.
#[derive(Debug)]
pub(super) struct Carrier {
    operator: Arc<VolumeOperator>,
    boundary: Arc<Boundary>,
    /// The places among the boundary's vertices whose displacement is prescribed, in the order in which the operator takes them;
    /// `None` for all.
    held: Option<Vec<u32>>,
    /// The place of each of the operator's sliding vertices.
    sliding: Vec<u32>,
}

impl Carrier {
    /// Sets up the operator of the reference mesh `mesh` with this boundary. Collective.
    pub(super) fn new(
        mesh: &Mesh,
        boundary: &Arc<Boundary>,
        deform: &DeformStage,
    ) -> Result<Self, Refused> {
        let (held, sliding) =
            if deform.lets_go() { roles(boundary, deform)? } else { (None, Vec::new()) };
        let vertices = boundary.vertices();
        let prescribed: Option<Vec<u32>> =
            held.as_ref().map(|held| held.iter().map(|&place| vertices[place as usize]).collect());
        let slides: Vec<Sliding> = sliding
            .iter()
            .map(|&(place, normal)| Sliding { vertex: vertices[place as usize], normal })
            .collect();
        let prescribed = prescribed.as_deref().unwrap_or(vertices);
        let operator = VolumeOperator::of_part(
            mesh,
            prescribed,
            &slides,
            &deform.equation,
            boundary.partition(),
        );
        let operator = if deform.lets_go() {
            held_somewhere(mesh, boundary, deform, operator)?
        } else {
            operator.map_err(Refused::from)
        };
        let operator = Arc::new(boundary.agree(operator)?);
        let sliding = sliding.into_iter().map(|(place, _)| place).collect();
        Ok(Self { operator, boundary: Arc::clone(boundary), held, sliding })
    }

    pub(super) fn operator(&self) -> &Arc<VolumeOperator> {
        &self.operator
    }

    /// Whether the boundary may end elsewhere than where it was told to.
    pub(super) fn lets_go(&self) -> bool {
        self.held.is_some()
    }

    /// The displacement of the volume for one of its boundary's vertices. Collective.
    pub(super) fn solve(&self, displacement: &[Vector]) -> Result<VolumeSolution, Refused> {
        let of = |places: &[u32]| -> Vec<Vector> {
            places.iter().map(|&place| displacement[place as usize]).collect()
        };
        let solution = match &self.held {
            None => self.operator.solve(displacement),
            Some(held) => self.operator.solve_sliding(&of(held), &of(&self.sliding)),
        };
        self.boundary.agree(solution.map_err(Refused::from))
    }

    /// Where the boundary comes to lie when it is told to move like this: as it was told, but for what slides or is free.
    /// Collective.
    pub(super) fn settle(&self, displacement: Vec<Vector>) -> Result<Vec<Vector>, Refused> {
        if !self.lets_go()
            || self.boundary.all(displacement.iter().all(|displacement| *displacement == [0.0; 3]))
        {
            return Ok(displacement);
        }
        let mut volume = self.solve(&displacement)?.displacement;
        self.boundary.take_from_owners(&mut volume)?;
        Ok(self.boundary.places(&volume))
    }
}

/// The operator; where there is none because nothing holds a part of the mesh, which features let go of it. Collective.
fn held_somewhere(
    mesh: &Mesh,
    boundary: &Boundary,
    deform: &DeformStage,
    operator: Result<VolumeOperator, VolumeError>,
) -> Result<Result<VolumeOperator, Refused>, Refused> {
    let loose = match &operator {
        Err(VolumeError::Unattached { vertex, .. }) => Some(*vertex),
        _ => None,
    };
    if boundary.all(loose.is_none()) {
        return Ok(operator.map_err(Refused::from));
    }
    // One process may have the vertices and another the features' names.
    let body =
        loose.map_or_else(|| vec![false; mesh.points().len()], |vertex| connected(mesh, vertex));
    let marks: Vec<Vector> =
        body.into_iter().map(|inside| [f64::from(u8::from(inside)), 0.0, 0.0]).collect();
    let marks = boundary.gather(&marks)?;
    let let_go = boundary.surface().map_or(Ok(()), |surface| {
        let features = surface.features();
        let touches = |name: &&String| {
            let of_body =
                |vertices: &[u32]| vertices.iter().any(|&vertex| marks[vertex as usize][0] > 0.0);
            features.index(name).is_ok_and(|feature| of_body(features.vertices(feature)))
        };
        let of = |names: &[String]| names.iter().filter(touches).cloned().collect::<Vec<_>>();
        match (of(&deform.sliding), of(&deform.free)) {
            (sliding, free) if sliding.is_empty() && free.is_empty() => Ok(()),
            (sliding, free) => Err(Refused::LetGo { sliding, free }),
        }
    });
    boundary.agree(let_go)?;
    Ok(operator.map_err(Refused::from))
}

/// Which vertices of a mesh hang together with one by its cells.
fn connected(mesh: &Mesh, vertex: usize) -> Vec<bool> {
    let mut parents: Vec<u32> = (0..).take(mesh.points().len()).collect();
    fn root(parents: &mut [u32], vertex: u32) -> u32 {
        let mut at = vertex;
        while parents[at as usize] != at {
            parents[at as usize] = parents[parents[at as usize] as usize];
            at = parents[at as usize];
        }
        at
    }
    for (_, vertices) in mesh.cells().iter() {
        for pair in vertices.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|vertex| root(&mut parents, vertex));
            parents[a.max(b) as usize] = a.min(b);
        }
    }
    let roots: Vec<u32> =
        (0..).take(mesh.points().len()).map(|vertex| root(&mut parents, vertex)).collect();
    roots.iter().map(|of| *of == roots[vertex]).collect()
}

/// The places among a boundary's vertices that are held, and those that slide. Collective.
fn roles(boundary: &Boundary, deform: &DeformStage) -> Result<Split, Refused> {
    let Some(surface) = boundary.surface() else { return spread(boundary, Ok((None, Vec::new()))) };
    let split = split(surface, deform);
    if boundary.partition().ranks() == 1 { split } else { spread(boundary, split) }
}

/// What rank 0 says of the surface's vertices, of the boundary's vertices on this process: first whether each is held, then the
/// directions across which it is, one after the other.
fn spread(boundary: &Boundary, split: Result<Split, Refused>) -> Result<Split, Refused> {
    let (kept, normals) = boundary.agree(split)?;
    let count = boundary.surface().map_or(0, |surface| surface.points().len());
    let mut layers: Vec<Vec<Vector>> = vec![vec![[0.0; 3]; count]];
    kept.iter().flatten().for_each(|&vertex| layers[0][vertex as usize] = [1.0, 0.0, 0.0]);
    for around in normals.chunk_by(|a, b| a.0 == b.0) {
        for (layer, &(vertex, normal)) in (1..).zip(around) {
            if layers.len() <= layer {
                layers.push(vec![[0.0; 3]; count]);
            }
            layers[layer][vertex as usize] = normal;
        }
    }
    #[expect(clippy::cast_precision_loss, reason = "the faces around a vertex")]
    let layer_count = boundary.of_root(layers.len() as f64);
    let held = boundary.scatter(Ok(std::mem::take(&mut layers[0])))?;
    let mut sliding: Vec<(u32, Vector)> = Vec::new();
    let mut layer = 1;
    #[expect(clippy::cast_precision_loss, reason = "the faces around a vertex")]
    while (layer as f64) < layer_count {
        let normals =
            boundary.scatter(Ok(layers.get_mut(layer).map(std::mem::take).unwrap_or_default()))?;
        sliding.extend((0..).zip(normals).filter(|(_, normal)| *normal != [0.0; 3]));
        layer += 1;
    }
    // The directions of one vertex in the order in which rank 0 has them.
    sliding.sort_by_key(|(place, _)| *place);
    let held = (0..).zip(held).filter(|(_, mark)| mark[0] > 0.0).map(|(place, _)| place).collect();
    Ok((Some(held), sliding))
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
    for (field, names, role) in
        [("sliding", &deform.sliding, Role::Slides), ("free", &deform.free, Role::Free)]
    {
        for name in names {
            let feature =
                features.index(name).map_err(|source| Refused::Feature { field, source })?;
            roles[feature as usize] = role;
        }
    }
    let count = surface.points().len();
    let (mut held, mut touched) = (vec![false; count], vec![false; count]);
    let mut normals: Vec<(u32, Vector)> = Vec::new();
    for (triangle, &face) in surface.triangles().iter().zip(surface.triangle_faces()) {
        let role = roles[features.face_features()[face as usize] as usize];
        let normal = (role == Role::Slides)
            .then(|| normal(triangle.map(|vertex| surface.points()[vertex as usize])));
        for &vertex in triangle {
            held[vertex as usize] |= role == Role::Held;
            touched[vertex as usize] = true;
            normals.extend(normal.map(|normal| (vertex, normal)));
        }
    }
    // A vertex of no face belongs to nothing that could let go of it.
    let all = (0_u32..).zip(held.iter().zip(&touched));
    let kept =
        all.filter(|(_, (held, touched))| **held || !**touched).map(|(vertex, _)| vertex).collect();
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
        sliding.extend(
            surfaces
                .into_iter()
                .filter(|normal| *normal != [0.0; 3])
                .map(|normal| (vertex, normal)),
        );
    }
    Ok((Some(kept), sliding))
}

/// Twice the area of a triangle, along its normal.
fn normal([a, b, c]: [Vector; 3]) -> Vector {
    let (u, v): (Vector, Vector) =
        (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

fn cosine(a: &Vector, b: &Vector) -> f64 {
    let dot = |a: &Vector, b: &Vector| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
}
