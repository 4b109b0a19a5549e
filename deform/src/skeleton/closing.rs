//! From a surface to closed pieces: open edges that lie on each other are joined, vertices where sheets touch are parted,
//! triangles are turned alike, holes are closed.

use std::collections::HashMap;

use super::SkeletonError;
use super::triangulation::Triangulation;
use crate::mesh::Vector;
use crate::surface::Surface;
use crate::vector::{add, dot, scale, subtract};

/// A connected piece of the surface, closed, about the origin and of diagonal 1.
pub(super) struct Piece {
    pub mesh: Triangulation,
    /// Where it lies: the centre, in units of the largest coordinate, the diagonal in these units, and the unit.
    pub frame: Frame,
    /// The surface vertices of the piece, each with the vertex of the mesh that stands for it.
    pub vertices: Vec<(u32, u32)>,
}

/// What brings a piece back to its place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    centre: Vector,
    diagonal: f64,
    unit: f64,
}

impl Frame {
    /// The frame of some points, none of which has a larger coordinate than `unit`; `None` where they are one point.
    fn new(points: &[Vector], unit: f64) -> Option<Self> {
        let mut lower = [f64::INFINITY; 3];
        let mut upper = [f64::NEG_INFINITY; 3];
        for axis in 0..3 {
            for point in points {
                lower[axis] = lower[axis].min(point[axis] / unit);
                upper[axis] = upper[axis].max(point[axis] / unit);
            }
        }
        let extent = subtract(upper, lower);
        let diagonal = dot(extent, extent).sqrt();
        (diagonal > 0.0).then(|| Self { centre: scale(add(lower, upper), 0.5), diagonal, unit })
    }

    pub fn enter(&self, point: Vector) -> Vector {
        [0, 1, 2].map(|axis| (point[axis] / self.unit - self.centre[axis]) / self.diagonal)
    }

    /// Where a point of the piece lies in the surface's own coordinates.
    pub fn leave(&self, point: Vector) -> Vector {
        [0, 1, 2].map(|axis| (point[axis] * self.diagonal + self.centre[axis]) * self.unit)
    }
}

/// The enclosed volume of a piece, in units of its area to the power 1.5, under which it is flat. A ball has 0.094.
const FLAT: f64 = 1e-7;

pub(super) fn closed_pieces(surface: &Surface) -> Result<Vec<Piece>, SkeletonError> {
    let triangles: Vec<[u32; 3]> =
        surface.triangles().iter().copied().filter(|[a, b, c]| a != b && b != c && c != a).collect();
    if triangles.is_empty() {
        return Err(SkeletonError::NoTriangles);
    }
    let joined = join_open_edges(surface.points(), &triangles);
    let mut triangles: Vec<[u32; 3]> =
        triangles.iter().map(|triangle| triangle.map(|vertex| joined[vertex as usize])).collect();
    triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    let twins = twins(surface, &triangles)?;
    let piece_of = orient(surface, &mut triangles, &twins)?;
    // Orientation may have turned triangles, and with them the order of their sides.
    let twins = self::twins(surface, &triangles)?;
    let corners = part_sheets(&triangles, &twins);
    pieces(surface, &triangles, &twins, &piece_of, &corners, &joined)
}

/// For each vertex the lowest one it is joined with: those on open edges that have the same place to the last bit.
fn join_open_edges(points: &[Vector], triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut sides: Vec<[u32; 2]> = triangles.iter().flat_map(sides_of).map(sorted).collect();
    sides.sort_unstable();
    let mut joined: Vec<u32> = (0..points.len() as u32).collect();
    let mut first_at: HashMap<[u64; 3], u32> = HashMap::new();
    let mut open: Vec<u32> =
        sides.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).flat_map(|same| same[0]).collect();
    open.sort_unstable();
    open.dedup();
    for vertex in open {
        // Adding 0 makes one zero of the two there are.
        let key = points[vertex as usize].map(|value| (value + 0.0).to_bits());
        joined[vertex as usize] = *first_at.entry(key).or_insert(vertex);
    }
    joined
}

fn sides_of(triangle: &[u32; 3]) -> [[u32; 2]; 3] {
    let [a, b, c] = *triangle;
    [[a, b], [b, c], [c, a]]
}

fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

const OPEN: u32 = u32::MAX;

/// For each side (three a triangle) the side of the other triangle at its edge.
fn twins(surface: &Surface, triangles: &[[u32; 3]]) -> Result<Vec<u32>, SkeletonError> {
    let mut sides: Vec<([u32; 2], u32)> = triangles.iter().flat_map(sides_of).map(sorted).zip(0u32..).collect();
    sides.sort_unstable();
    let mut twins = vec![OPEN; sides.len()];
    for same in sides.chunk_by(|a, b| a.0 == b.0) {
        match same {
            [(_, a), (_, b)] => {
                twins[*a as usize] = *b;
                twins[*b as usize] = *a;
            }
            [_] | [] => {}
            more => {
                return Err(SkeletonError::NonManifoldEdge {
                    edge: more[0].0.map(|vertex| surface.vertices()[vertex as usize]),
                    faces: more.len(),
                });
            }
        }
    }
    Ok(twins)
}

/// Turns triangles so that neighbours run alike, and gives each the number of its connected piece.
fn orient(surface: &Surface, triangles: &mut [[u32; 3]], twins: &[u32]) -> Result<Vec<u32>, SkeletonError> {
    let original = triangles.to_vec();
    let side = |side: u32| sides_of(&original[side as usize / 3])[side as usize % 3];
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
                    let edge = side(own).map(|vertex| surface.vertices()[vertex as usize]);
                    return Err(SkeletonError::OneSided { edge });
                }
            }
        }
        pieces += 1;
    }
    for (triangle, turned) in triangles.iter_mut().zip(turned) {
        if turned {
            triangle.swap(1, 2);
        }
    }
    Ok(piece_of)
}

/// A number for each corner (three a triangle) that is the same for corners at a vertex joined by edges, so that sheets which
/// touch in a vertex alone have one each.
fn part_sheets(triangles: &[[u32; 3]], twins: &[u32]) -> Vec<u32> {
    let mut sheets: Vec<u32> = (0..twins.len() as u32).collect();
    fn root(sheets: &mut [u32], mut corner: u32) -> u32 {
        while sheets[corner as usize] != corner {
            let above = sheets[sheets[corner as usize] as usize];
            sheets[corner as usize] = above;
            corner = above;
        }
        corner
    }
    for (side, &twin) in twins.iter().enumerate() {
        if twin == OPEN {
            continue;
        }
        for place in [side % 3, (side + 1) % 3] {
            let vertex = triangles[side / 3][place];
            let own = (side - side % 3 + place) as u32;
            if let Some(there) = triangles[twin as usize / 3].iter().position(|&other| other == vertex) {
                let [a, b] = [root(&mut sheets, own), root(&mut sheets, twin - twin % 3 + there as u32)];
                sheets[a.max(b) as usize] = a.min(b);
            }
        }
    }
    for corner in 0..sheets.len() as u32 {
        sheets[corner as usize] = root(&mut sheets, corner);
    }
    sheets
}

fn pieces(
    surface: &Surface,
    triangles: &[[u32; 3]],
    twins: &[u32],
    piece_of: &[u32],
    corners: &[u32],
    joined: &[u32],
) -> Result<Vec<Piece>, SkeletonError> {
    let count = piece_of.iter().max().map_or(0, |&last| last as usize + 1);
    let mut members = vec![Vec::new(); count];
    for (triangle, &piece) in piece_of.iter().enumerate() {
        members[piece as usize].push(triangle);
    }
    // The number within its piece of each sheet, by its first corner.
    let mut numbers = vec![OPEN; corners.len()];
    // The piece and the number of each vertex, by the first sheet met.
    let mut stands_for = vec![(OPEN, OPEN); joined.len()];
    let mut closed = Vec::with_capacity(count);
    let largest = surface.points().iter().flatten().fold(0.0f64, |largest, value| largest.max(value.abs()));
    let unit = if largest > 0.0 { largest } else { 1.0 };
    for (piece, members) in members.iter().enumerate() {
        let mut points = Vec::new();
        let mut own = Vec::with_capacity(members.len());
        for &triangle in members {
            let renumbered = [0, 1, 2].map(|place| {
                let sheet = corners[3 * triangle + place] as usize;
                let vertex = triangles[triangle][place] as usize;
                if numbers[sheet] == OPEN {
                    numbers[sheet] = points.len() as u32;
                    points.push(surface.points()[vertex]);
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
        for (place, &triangle) in members.iter().enumerate() {
            for (side, [from, to]) in sides_of(&own[place]).into_iter().enumerate() {
                if twins[3 * triangle + side] == OPEN {
                    next.insert(from, to);
                    starts.push(from);
                }
            }
        }
        close_holes(&mut points, &mut own, &starts, &mut next);
        let vertex = members.first().map_or(0, |&triangle| triangles[triangle][0]);
        let flat = SkeletonError::Flat { vertex: surface.vertices()[vertex as usize], triangles: members.len() };
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
        closed.push(Piece { mesh, frame, vertices: Vec::new() });
    }
    for (vertex, &representative) in joined.iter().enumerate() {
        let (piece, number) = stands_for[representative as usize];
        if let Some(piece) = closed.get_mut(piece as usize) {
            piece.vertices.push((vertex as u32, number));
        }
    }
    Ok(closed)
}

/// Closes every loop of open edges by triangles about its centre. At most one open edge leaves each vertex.
fn close_holes(points: &mut Vec<Vector>, triangles: &mut Vec<[u32; 3]>, starts: &[u32], next: &mut HashMap<u32, u32>) {
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
        for (place, &from) in rim.iter().enumerate() {
            triangles.push([rim[(place + 1) % rim.len()], from, centre]);
        }
    }
}
