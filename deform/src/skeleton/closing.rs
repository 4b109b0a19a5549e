//! From a surface to closed pieces: open edges that lie on each other are joined, vertices where
//! sheets touch are parted, triangles are turned alike, holes are closed.

use std::collections::HashMap;

use super::SkeletonError;
use super::triangulation::Triangulation;
use crate::bounds::Bounds;
use crate::mesh::Vector;
use crate::surface::Surface;
use crate::topology::{CrowdedEdge, DisjointSets, OPEN, SidesOfEdges, ends_of_sides, indices};
use crate::vector::{add, length, scale};

/// A connected piece of the surface, closed, about the origin and of diagonal 1.
pub(super) struct ClosedPiece {
    pub mesh: Triangulation,
    /// Where it lies in the surface.
    pub frame: Frame,
    /// The surface vertices of the piece, each with the vertex of the mesh that stands for it.
    pub vertices: Vec<(u32, u32)>,
}

/// The frame of a piece: its points are taken about `centre` in units of `diagonal`, all of it in
/// units of `unit`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    centre: Vector,
    diagonal: f64,
    unit: f64,
}

impl Frame {
    /// The frame of some points, none of which has a larger coordinate than `unit`; `None` where
    /// they are one point.
    fn new(points: &[Vector], unit: f64) -> Option<Self> {
        let bounds = Bounds::around(points.iter().map(|point| point.map(|value| value / unit)));
        let diagonal = length(bounds.extent());
        (diagonal > 0.0).then(|| Self {
            centre: scale(add(bounds.lower, bounds.upper), 0.5),
            diagonal,
            unit,
        })
    }

    /// A point of the surface in the coordinates of the piece.
    pub fn enter(&self, point: Vector) -> Vector {
        [0, 1, 2].map(|axis| (point[axis] / self.unit - self.centre[axis]) / self.diagonal)
    }

    /// A point of the piece in the coordinates of the surface.
    pub fn leave(&self, point: Vector) -> Vector {
        [0, 1, 2].map(|axis| (point[axis] * self.diagonal + self.centre[axis]) * self.unit)
    }
}

/// The enclosed volume of a piece, in units of its area to the power 1.5, under which it is flat. A
/// ball has 0.094.
const FLAT: f64 = 1e-7;

/// The closed pieces of a surface.
///
/// # Errors
/// [`SkeletonError`] for a surface that cannot be closed, or that encloses nothing.
pub(super) fn closed_pieces(surface: &Surface) -> Result<Vec<ClosedPiece>, SkeletonError> {
    // 1. Order: vertices by coordinates, triangles by vertices, so that no numbering changes a bit
    //    of what follows.
    let Ordered { points, vertices, mut triangles } = Ordered::new(surface);
    if triangles.is_empty() {
        return Err(SkeletonError::NoTriangles);
    }
    let mesh_vertex = |vertex: u32| surface.vertices()[vertices[vertex as usize] as usize];
    // 2. Join: vertices of open edges that have the same coordinates become the lowest of them.
    let joined = join_open_edges(&points, &triangles);
    if joined.iter().zip(0u32..).any(|(&into, vertex)| into != vertex) {
        triangles
            .iter_mut()
            .for_each(|triangle| *triangle = triangle.map(|vertex| joined[vertex as usize]));
        triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    }
    // 3. Twins: each side of a triangle gets the side of the other triangle at its edge.
    let mut twins = SidesOfEdges::new(&triangles, points.len()).twins().map_err(
        |CrowdedEdge { ends, triangles }| {
            let [a, b] = ends.map(mesh_vertex);
            SkeletonError::NonManifoldEdge { edge: [a.min(b), a.max(b)], faces: triangles }
        },
    )?;
    // 4. Orient: neighbours run the same way round. What edges hold together is a piece.
    let piece_of = orient(&mut triangles, &mut twins, mesh_vertex)?;
    // 5. Part: sheets that touch in a vertex alone get a vertex each.
    let corners = part_sheets(&triangles, &twins);
    // 6. Close: each piece is taken out, its holes are filled, it is brought about the origin and
    //    turned outward.
    let mut pieces = pieces(&points, &triangles, &twins, &piece_of, &corners, mesh_vertex)?;
    // 7. Account for every vertex of the surface: those that were joined go with the lowest.
    for (vertex, &representative) in joined.iter().enumerate() {
        let (piece, number) = pieces.stands_for[representative as usize];
        if let Some(piece) = pieces.closed.get_mut(piece as usize) {
            piece.vertices.push((vertices[vertex], number));
        }
    }
    Ok(pieces.closed)
}

/// A surface in an order that does not depend on how it is numbered: vertices by their coordinates,
/// triangles by their vertices.
struct Ordered {
    points: Vec<Vector>,
    /// The surface's own number of each vertex.
    vertices: Vec<u32>,
    /// The triangles with three different vertices, each from its lowest on.
    triangles: Vec<[u32; 3]>,
}

impl Ordered {
    fn new(surface: &Surface) -> Self {
        // Adding 0 makes one zero of the two there are.
        let mut ordered: Vec<(Vector, u32)> =
            surface.points().iter().map(|point| point.map(|value| value + 0.0)).zip(0..).collect();
        ordered.sort_unstable_by(|(a, own), (b, other)| {
            let [x, y, z] = [0, 1, 2].map(|axis| a[axis].total_cmp(&b[axis]));
            x.then(y).then(z).then(own.cmp(other))
        });
        let (points, vertices): (Vec<Vector>, Vec<u32>) = ordered.into_iter().unzip();
        let ranks = indices(vertices.len(), &vertices);
        let mut triangles: Vec<[u32; 3]> = surface
            .triangles()
            .iter()
            .map(|triangle| lowest_first(triangle.map(|vertex| ranks[vertex as usize])))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect();
        triangles.sort_unstable();
        Self { points, vertices, triangles }
    }
}

/// A triangle from its lowest vertex on.
fn lowest_first([a, b, c]: [u32; 3]) -> [u32; 3] {
    if a <= b && a <= c {
        [a, b, c]
    } else if b <= c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

/// For each vertex the lowest one it is joined with: those on open edges with the same coordinates
/// to the last bit.
fn join_open_edges(points: &[Vector], triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut joined: Vec<u32> = (0..points.len() as u32).collect();
    let mut is_open = vec![false; points.len()];
    for (ends, sides) in SidesOfEdges::new(triangles, points.len()).edges() {
        if sides.len() == 1 {
            ends.into_iter().for_each(|end| is_open[end as usize] = true);
        }
    }
    // Vertices with the same coordinates follow each other.
    let mut first: Option<u32> = None;
    for vertex in (0..points.len() as u32).filter(|&vertex| is_open[vertex as usize]) {
        match first {
            Some(first) if points[first as usize] == points[vertex as usize] => {
                joined[vertex as usize] = first
            }
            _ => first = Some(vertex),
        }
    }
    joined
}

/// Turns triangles, and their sides with them, so that neighbours run alike, and gives each the
/// number of its connected piece.
fn orient(
    triangles: &mut [[u32; 3]],
    twins: &mut [u32],
    mesh_vertex: impl Fn(u32) -> u32,
) -> Result<Vec<u32>, SkeletonError> {
    let original = triangles.to_vec();
    let side = |side: u32| ends_of_sides(&original[side as usize / 3])[side as usize % 3];
    let mut piece_of = vec![OPEN; triangles.len()];
    let mut turned = vec![false; triangles.len()];
    let mut pieces = 0;
    let mut waiting = Vec::new();
    for first in 0..triangles.len() as u32 {
        if piece_of[first as usize] != OPEN {
            continue;
        }
        piece_of[first as usize] = pieces;
        waiting.push(first);
        while let Some(triangle) = waiting.pop() {
            for own in 3 * triangle..3 * triangle + 3 {
                let twin = twins[own as usize];
                if twin == OPEN {
                    continue;
                }
                let other = twin / 3;
                let turn = turned[triangle as usize] ^ (side(own) == side(twin));
                if piece_of[other as usize] == OPEN {
                    piece_of[other as usize] = pieces;
                    turned[other as usize] = turn;
                    waiting.push(other);
                } else if turned[other as usize] != turn {
                    return Err(SkeletonError::OneSided { edge: side(own).map(mesh_vertex) });
                }
            }
        }
        pieces += 1;
    }
    if turned.contains(&true) {
        // A triangle [a, b, c] becomes [a, c, b]: its first side and its last are exchanged.
        let now =
            |side: u32| if turned[side as usize / 3] { side + 2 - 2 * (side % 3) } else { side };
        let old = twins.to_vec();
        for (side, twin) in (0u32..).zip(old) {
            twins[now(side) as usize] = if twin == OPEN { OPEN } else { now(twin) };
        }
        for (triangle, _) in triangles.iter_mut().zip(&turned).filter(|(_, turned)| **turned) {
            triangle.swap(1, 2);
        }
    }
    Ok(piece_of)
}

/// The sheet of each corner (three a triangle): corners at one vertex that edges join are in one
/// sheet, so that sheets which touch in a vertex alone are parted.
fn part_sheets(triangles: &[[u32; 3]], twins: &[u32]) -> Vec<u32> {
    let mut sheets = DisjointSets::new(twins.len());
    for (side, &twin) in twins.iter().enumerate() {
        if twin == OPEN {
            continue;
        }
        for corner in [side % 3, (side + 1) % 3] {
            let vertex = triangles[side / 3][corner];
            let own = (side - side % 3 + corner) as u32;
            if let Some(there) =
                triangles[twin as usize / 3].iter().position(|&other| other == vertex)
            {
                sheets.join(own, twin - twin % 3 + there as u32);
            }
        }
    }
    (0..twins.len() as u32).map(|corner| sheets.root(corner)).collect()
}

struct Pieces {
    closed: Vec<ClosedPiece>,
    /// The piece of each vertex and its number there, by the first sheet met.
    stands_for: Vec<(u32, u32)>,
}

fn pieces(
    all_points: &[Vector],
    triangles: &[[u32; 3]],
    twins: &[u32],
    piece_of: &[u32],
    corners: &[u32],
    mesh_vertex: impl Fn(u32) -> u32,
) -> Result<Pieces, SkeletonError> {
    let count = piece_of.iter().max().map_or(0, |&last| last as usize + 1);
    let mut members = vec![Vec::new(); count];
    for (triangle, &piece) in piece_of.iter().enumerate() {
        members[piece as usize].push(triangle);
    }
    // The number within its piece of each sheet, by its first corner.
    let mut numbers = vec![OPEN; corners.len()];
    let mut stands_for = vec![(OPEN, OPEN); all_points.len()];
    let mut closed = Vec::with_capacity(count);
    let largest =
        all_points.iter().flatten().fold(0.0f64, |largest, value| largest.max(value.abs()));
    let unit = if largest > 0.0 { largest } else { 1.0 };
    for (piece, members) in members.iter().enumerate() {
        let mut points = Vec::new();
        let mut own = Vec::with_capacity(members.len());
        for &triangle in members {
            let renumbered = [0, 1, 2].map(|corner| {
                let sheet = corners[3 * triangle + corner] as usize;
                let vertex = triangles[triangle][corner] as usize;
                if numbers[sheet] == OPEN {
                    numbers[sheet] = points.len() as u32;
                    points.push(all_points[vertex]);
                }
                if stands_for[vertex].0 == OPEN {
                    stands_for[vertex] = (piece as u32, numbers[sheet]);
                }
                numbers[sheet]
            });
            own.push(renumbered);
        }
        let mut next: HashMap<u32, u32> = HashMap::new();
        let mut starts = Vec::new();
        for (index, &triangle) in members.iter().enumerate() {
            for (side, [from, to]) in ends_of_sides(&own[index]).into_iter().enumerate() {
                if twins[3 * triangle + side] == OPEN {
                    next.insert(from, to);
                    starts.push(from);
                }
            }
        }
        close_holes(&mut points, &mut own, &starts, &mut next);
        let vertex = members.first().map_or(0, |&triangle| triangles[triangle][0]);
        let flat = SkeletonError::Flat { vertex: mesh_vertex(vertex), triangles: members.len() };
        let Some(frame) = Frame::new(&points, unit) else { return Err(flat) };
        points.iter_mut().for_each(|point| *point = frame.enter(*point));
        let mut mesh = Triangulation::new(points, own);
        let volume = mesh.signed_volume() / 6.0;
        if volume < 0.0 {
            let turned = mesh.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
            mesh = Triangulation::new(mesh.points, turned);
        }
        let area = mesh.area();
        let encloses = volume.abs() > FLAT * area.powf(1.5);
        if !encloses {
            return Err(flat);
        }
        closed.push(ClosedPiece { mesh, frame, vertices: Vec::new() });
    }
    Ok(Pieces { closed, stands_for })
}

/// Closes every loop of open edges by triangles about its centre. At most one open edge leaves each
/// vertex.
fn close_holes(
    points: &mut Vec<Vector>,
    triangles: &mut Vec<[u32; 3]>,
    starts: &[u32],
    next: &mut HashMap<u32, u32>,
) {
    for &start in starts {
        let mut rim = Vec::new();
        let mut vertex = start;
        while let Some(to) = next.remove(&vertex) {
            rim.push(vertex);
            vertex = to;
        }
        if rim.len() < 2 {
            continue;
        }
        let centre = points.len() as u32;
        let sum = rim.iter().fold([0.0; 3], |sum, &vertex| add(sum, points[vertex as usize]));
        points.push(scale(sum, 1.0 / rim.len() as f64));
        for (index, &from) in rim.iter().enumerate() {
            triangles.push([rim[(index + 1) % rim.len()], from, centre]);
        }
    }
}
