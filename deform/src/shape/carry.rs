//! From the displacement of the surface to that of the volume.

use std::sync::Arc;

use crate::{
    mesh::{Mesh, Vector},
    surface::Surface,
    volume::{Sliding, VolumeError, VolumeOperator, VolumeSolution},
};

use super::{Deformation, Refused, body::Body};
use crate::communicator::Communicator;
use crate::topology::DisjointSets;
use crate::vector::{dot, triangle_normal};

/// Faces around a vertex whose normals lie within this of each other (as a cosine: 30 degrees) are
/// one surface to slide along.
const ONE_SURFACE: f64 = 0.866;

/// The operator of a volume, and what it takes of each vertex of its boundary.
#[derive(Debug)]
pub(super) struct Carrier {
    operator: Arc<VolumeOperator>,
    body: Arc<Body>,
    /// The indices among the boundary's vertices whose displacement is prescribed, in the order in
    /// which the operator takes them; `None` for all.
    held: Option<Vec<u32>>,
    /// The index of each of the operator's sliding vertices.
    sliding: Vec<u32>,
}

impl Carrier {
    /// Sets up the operator of a body. Collective.
    pub(super) fn new(body: &Arc<Body>, deform: &Deformation) -> Result<Self, Refused> {
        let (held, sliding) =
            if deform.lets_go() { roles(body, deform)? } else { (None, Vec::new()) };
        let vertices = body.vertices();
        let prescribed: Option<Vec<u32>> =
            held.as_ref().map(|held| held.iter().map(|&index| vertices[index as usize]).collect());
        let slides: Vec<Sliding> = sliding
            .iter()
            .map(|&(index, normal)| Sliding { vertex: vertices[index as usize], normal })
            .collect();
        let prescribed = prescribed.as_deref().unwrap_or(vertices);
        let (domain, solvers) = (&body.domain, &*body.solvers);
        let operator =
            VolumeOperator::with_sliding(domain, prescribed, &slides, &deform.equation, solvers);
        let operator = if deform.lets_go() {
            held_somewhere(body, deform, operator)?
        } else {
            operator.map_err(Refused::from)
        };
        let operator = Arc::new(body.agree(operator)?);
        let sliding = sliding.into_iter().map(|(index, _)| index).collect();
        Ok(Self { operator, body: Arc::clone(body), held, sliding })
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
        let of = |indices: &[u32]| -> Vec<Vector> {
            indices.iter().map(|&index| displacement[index as usize]).collect()
        };
        let solution = match &self.held {
            None => self.operator.solve(displacement),
            Some(held) => self.operator.solve_sliding(&of(held), &of(&self.sliding)),
        };
        self.body.agree(solution.map_err(Refused::from))
    }

    /// Where the boundary comes to lie when it is told to move like this: as it was told, but for
    /// what slides or is free. Collective.
    pub(super) fn settle(&self, displacement: Vec<Vector>) -> Result<Vec<Vector>, Refused> {
        if !self.lets_go()
            || self
                .body
                .communicator()
                .all(displacement.iter().all(|displacement| *displacement == [0.0; 3]))
        {
            return Ok(displacement);
        }
        let mut volume = self.solve(&displacement)?.displacement;
        self.body.update(&mut volume);
        Ok(self.body.positions(&volume))
    }
}

/// The operator; where there is none because nothing holds a part of the mesh, which features let
/// go of it. Collective.
fn held_somewhere(
    body: &Body,
    deform: &Deformation,
    operator: Result<VolumeOperator, VolumeError>,
) -> Result<Result<VolumeOperator, Refused>, Refused> {
    let loose = match &operator {
        Err(VolumeError::Unattached { vertex, .. }) => Some(*vertex),
        _ => None,
    };
    if body.communicator().all(loose.is_none()) {
        return Ok(operator.map_err(Refused::from));
    }
    // One process may have the vertices and another the features' names.
    let mesh = body.domain.mesh();
    let inside =
        loose.map_or_else(|| vec![false; mesh.points().len()], |vertex| connected(mesh, vertex));
    let marks: Vec<Vector> =
        inside.into_iter().map(|inside| [f64::from(u8::from(inside)), 0.0, 0.0]).collect();
    let marks = body.gather(&marks)?;
    let let_go = body.surface().map_or(Ok(()), |surface| {
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
    body.agree(let_go)?;
    Ok(operator.map_err(Refused::from))
}

/// Marks the vertices of a mesh that hang together with one of them by cells.
fn connected(mesh: &Mesh, vertex: usize) -> Vec<bool> {
    let roots = DisjointSets::components(
        mesh.points().len(),
        mesh.cells().iter().map(|(_, vertices)| vertices),
    );
    roots.iter().map(|root| *root == roots[vertex]).collect()
}

/// The indices among a boundary's vertices that are held, and those that slide. Collective.
fn roles(body: &Body, deform: &Deformation) -> Result<Split, Refused> {
    let Some(surface) = body.surface() else { return spread(body, Ok((None, Vec::new()))) };
    let split = split(surface, deform);
    if body.communicator().size() == 1 { split } else { spread(body, split) }
}

/// Hands the roles of the surface's vertices, which rank 0 knows, to the ranks that have these
/// vertices: first whether each is held, then the directions across which it is, one after the
/// other.
fn spread(body: &Body, split: Result<Split, Refused>) -> Result<Split, Refused> {
    let (kept, normals) = body.agree(split)?;
    let count = body.surface().map_or(0, |surface| surface.points().len());
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
    let layer_count = body.of_root(layers.len());
    let held = body.scatter(Ok(std::mem::take(&mut layers[0])))?;
    let mut sliding: Vec<(u32, Vector)> = Vec::new();
    for layer in 1..layer_count {
        let normals =
            body.scatter(Ok(layers.get_mut(layer).map(std::mem::take).unwrap_or_default()))?;
        sliding.extend((0..).zip(normals).filter(|(_, normal)| *normal != [0.0; 3]));
    }
    // The directions of one vertex in the order in which rank 0 has them.
    sliding.sort_by_key(|(index, _)| *index);
    let held = (0..).zip(held).filter(|(_, mark)| mark[0] > 0.0).map(|(index, _)| index).collect();
    Ok((Some(held), sliding))
}

/// The surface vertices that are held, and those that slide, once for each direction across which
/// they are held.
type Split = (Option<Vec<u32>>, Vec<(u32, Vector)>);

fn split(surface: &Surface, deform: &Deformation) -> Result<Split, Refused> {
    /// The role of a feature.
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
        let corners = triangle.map(|vertex| surface.points()[vertex as usize]);
        let normal = (role == Role::Slides).then(|| triangle_normal(corners));
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

fn cosine(a: &Vector, b: &Vector) -> f64 {
    dot(*a, *b) / (dot(*a, *a) * dot(*b, *b)).sqrt()
}
