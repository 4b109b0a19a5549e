//! The directions that surfaces look in, smooth but for sharp edges.

use std::collections::HashMap;

use tombolo_deform::communicator::{Communicator, Reader, Writer};
use tombolo_deform::distributed::DistributedError;
use tombolo_deform::mesh::Vector;
use tombolo_deform::topology::Groups;
use tombolo_deform::vector::{cross, dot, length, scale, subtract};

use super::lattice::Lattice;
use super::scene::Scene;
use crate::extract::{Shown, Support};

/// The cosine of the angle between two faces from which on their edge is sharp: 40 degrees.
const SHARP: f64 = 0.766;
/// The steps in which normals are added up, so that the order does not matter.
const STEPS: f64 = (1 << 20) as f64;

/// The normal of each face, of length 1; 0 where it has none.
pub(super) fn of_faces(scene: &Scene, lattice: &Lattice) -> Vec<Vector> {
    let normal = |face: usize| {
        let corners = scene.face(face);
        let at = |corner: usize| lattice.position(scene.points[corners[corner] as usize]);
        let Some(first) = corners.first().map(|_| at(0)) else { return [0.0; 3] };
        let mut sum = [0.0; 3];
        for corner in 2..corners.len() {
            let (a, b) = (subtract(at(corner - 1), first), subtract(at(corner), first));
            let part = cross(a, b);
            (0..3).for_each(|axis| sum[axis] += part[axis]);
        }
        let length = length(sum);
        if length > 0.0 { scale(sum, 1.0 / length) } else { [0.0; 3] }
    };
    (0..scene.faces()).map(normal).collect()
}

/// The normal at each corner of each face, or its opposite: the mean of those of the faces around
/// the point that make no sharp edge with its own. Of faces on other ranks they are asked for. Collective.
pub(super) fn of_corners(
    communicator: &dyn Communicator,
    scene: &Scene,
    shown: &Shown,
    faces: &[Vector],
) -> Result<Vec<Vector>, DistributedError> {
    #[expect(clippy::cast_possible_truncation, reason = "faces of 32 bits")]
    let corners = (0..scene.faces())
        .flat_map(|face| scene.face(face).iter().map(move |&point| (point, face as u32)));
    let around = Groups::new(scene.points.len(), corners);
    let of_point = |point: u32| around.of(point).iter().map(|&face| faces[face as usize]);
    let elsewhere = elsewhere(communicator, shown, &of_point)?;
    let mut normals = Vec::with_capacity(scene.corners.len());
    for (face, &own) in faces.iter().enumerate() {
        for &point in scene.face(face) {
            let mut sum = [0_i64; 3];
            let others = elsewhere.get(&point).into_iter().flatten().copied();
            for normal in of_point(point).chain(others) {
                // Faces of cells that were given left-handed look inwards.
                let along = dot(normal, own);
                if along.abs() > SHARP {
                    let steps = along.signum() * STEPS;
                    #[expect(clippy::cast_possible_truncation, reason = "at most 2^20")]
                    (0..3).for_each(|axis| sum[axis] += (normal[axis] * steps).round() as i64);
                }
            }
            #[expect(clippy::cast_precision_loss, reason = "sums of a few")]
            let sum = sum.map(|part| part as f64);
            let length = length(sum);
            normals.push(if length > 0.0 { scale(sum, 1.0 / length) } else { own });
        }
    }
    Ok(normals)
}

/// The normals of faces of other ranks around the points that they share. Collective.
fn elsewhere<I: Iterator<Item = Vector>>(
    communicator: &dyn Communicator,
    shown: &Shown,
    of_point: &dyn Fn(u32) -> I,
) -> Result<HashMap<u32, Vec<Vector>>, DistributedError> {
    let mut found: HashMap<u32, Vec<Vector>> = HashMap::new();
    if communicator.size() == 1 {
        return Ok(found);
    }
    let mut message = Writer::default();
    for (point, name) in &shown.shared {
        let normals: Vec<Vector> = of_point(*point).collect();
        name.vertices.iter().for_each(|&vertex| message.u32(vertex));
        message.u64(name.layer);
        message.u64(normals.len() as u64);
        normals.iter().for_each(|normal| message.f64s(normal));
    }
    let messages = communicator.gather_all(&message.into_bytes());
    let own: HashMap<Support, u32> =
        shown.shared.iter().map(|(point, name)| (*name, *point)).collect();
    for (rank, bytes) in messages.iter().enumerate() {
        let mut reader = Reader::new(rank, bytes);
        while !reader.is_empty() {
            let mut vertices = [0; 4];
            for vertex in &mut vertices {
                *vertex = reader.u32()?;
            }
            let name = Support { vertices, layer: reader.u64()? };
            let point = own.get(&name).filter(|_| rank != communicator.rank());
            for _ in 0..reader.count(24)? {
                let normal = reader.vector()?;
                if let Some(&point) = point {
                    found.entry(point).or_default().push(normal);
                }
            }
        }
    }
    Ok(found)
}
