//! Walls that fluid slides along, and those that an inlet meets: what holds their vertices.

use tombolo_deform::mesh::Vector;
use tombolo_deform::vector::{dot, length};

use super::{Boundary, Condition, Patch, Rule, SlipVertex, triangle_area};

impl Boundary {
    /// Where a prescribed velocity meets walls, it rules, but not through the walls: what flows in then
    /// flows out, also where a wall slopes away from the inlet. What each wall has there goes to
    /// `walls`; `areas` is memory, zero before and after.
    pub(super) fn measure_rims(
        &self,
        points: &[Vector],
        areas: &mut [Vector],
        rows: usize,
        walls: &mut Vec<(u32, Vector)>,
    ) {
        let is_rim = |vertex: u32| {
            (vertex as usize) < rows && matches!(self.rules[vertex as usize], Rule::Prescribed(_))
        };
        let is_wall =
            |patch: &&Patch| matches!(patch.condition, Condition::NoSlip | Condition::Slip);
        for patch in self.patches.iter().filter(is_wall) {
            let mut rims = Vec::new();
            for triangle in patch
                .triangles
                .iter()
                .filter(|triangle| triangle.iter().any(|&vertex| is_rim(vertex)))
            {
                let area = triangle_area(points, *triangle);
                for &vertex in triangle.iter().filter(|&&vertex| is_rim(vertex)) {
                    rims.push(vertex);
                    for axis in 0..3 {
                        areas[vertex as usize][axis] += area[axis] / 3.0;
                    }
                }
            }
            rims.sort_unstable();
            rims.dedup();
            walls.extend(
                rims.into_iter()
                    .map(|vertex| (vertex, std::mem::take(&mut areas[vertex as usize]))),
            );
        }
    }

    /// Takes the directions that walls hold the vertices in from what each wall has of them.
    pub(super) fn hold(&mut self, mut walls: Vec<(u32, Vector)>) {
        walls.sort_by_key(|(vertex, _)| *vertex);
        for around in walls.chunk_by(|(one, _), (other, _)| one == other) {
            let vertex = around[0].0;
            for normal in normals(around.iter().map(|(_, area)| *area)) {
                if self.rules[vertex as usize] == Rule::Free
                    && let Some(axis) = (0..3).find(|&axis| normal[axis].abs() > 1.0 - 1e-12)
                {
                    self.held[vertex as usize][axis] = true;
                }
                self.slip.push(SlipVertex { vertex, normal });
            }
        }
    }
}

/// Walls that meet at less than this angle are one at a vertex: its cosine.
const ONE_WALL: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The perpendicular directions in which the walls at a vertex hold it, from the area that it has of
/// each. Of walls that meet at a blunt edge it is the sum that lets nothing pass: a stream along one
/// of them and then along the other crosses neither.
fn normals(areas: impl Iterator<Item = Vector>) -> Vec<Vector> {
    let mut walls: Vec<Vector> = Vec::new();
    for area in areas {
        let is_one =
            |wall: &&mut Vector| dot(**wall, area) > ONE_WALL * length(**wall) * length(area);
        match walls.iter_mut().find(is_one) {
            Some(wall) => *wall = std::array::from_fn(|axis| wall[axis] + area[axis]),
            None => walls.push(area),
        }
    }
    let mut normals: Vec<Vector> = Vec::new();
    for wall in walls {
        let mut rest = wall;
        for normal in &normals {
            let along = dot(rest, *normal);
            rest = std::array::from_fn(|axis| rest[axis] - along * normal[axis]);
        }
        let size = length(rest);
        if size > 1e-6 * length(wall) {
            normals.push(rest.map(|value| value / size));
        }
    }
    normals
}
