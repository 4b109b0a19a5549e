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
    let Ordered { points, vertices, mut triangles } = Ordered::new(surface);
    if triangles.is_empty() {
        return Err(SkeletonError::NoTriangles);
    }
    let mesh_vertex = |vertex: u32| surface.vertices()[vertices[vertex as usize] as usize];
    let joined = join_open_edges(&points, &triangles);
    if joined.iter().zip(0u32..).any(|(&into, vertex)| into != vertex) {
        triangles
            .iter_mut()
            .for_each(|triangle| *triangle = triangle.map(|vertex| joined[vertex as usize]));
        triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    }
    let mut twins = twins(&triangles, points.len(), mesh_vertex)?;
    let piece_of = orient(&mut triangles, &mut twins, mesh_vertex)?;
    let corners = part_sheets(&triangles, &twins);
    let mut pieces = pieces(&points, &triangles, &twins, &piece_of, &corners, mesh_vertex)?;
    for (vertex, &representative) in joined.iter().enumerate() {
        let (piece, number) = pieces.stands_for[representative as usize];
        if let Some(piece) = pieces.closed.get_mut(piece as usize) {
            piece.vertices.push((vertices[vertex], number));
        }
    }
    Ok(pieces.closed)
}

/// A surface in an order that does not depend on how it is numbered: vertices by their coordinates, triangles by their vertices.
struct Ordered {
    points: Vec<Vector>,
    /// The surface's own number of each vertex.
    vertices: Vec<u32>,
    /// Those with three different vertices, from the lowest on.
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
        let mut ranks = vec![0u32; ordered.len()];
        for (&(_, vertex), rank) in ordered.iter().zip(0..) {
            ranks[vertex as usize] = rank;
        }
        let mut triangles: Vec<[u32; 3]> = surface
            .triangles()
            .iter()
            .map(|triangle| lowest_first(triangle.map(|vertex| ranks[vertex as usize])))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect();
        triangles.sort_unstable();
        let (points, vertices) = ordered.into_iter().unzip();
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

/// For each vertex the lowest one it is joined with: those on open edges that have the same place to the last bit.
fn join_open_edges(points: &[Vector], triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut joined: Vec<u32> = (0..points.len() as u32).collect();
    let mut is_open = vec![false; points.len()];
    Sides::new(triangles, points.len()).for_each_edge(|ends, sides| {
        if sides.len() == 1 {
            ends.into_iter().for_each(|end| is_open[end as usize] = true);
        }
    });
    // Vertices that lie in the same place follow each other.
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

/// The sides of triangles (three each) by the lower of their ends.
struct Sides {
    starts: Vec<u32>,
    /// The higher end, and the number of the side.
    sides: Vec<(u32, u32)>,
}

impl Sides {
    fn new(triangles: &[[u32; 3]], vertices: usize) -> Self {
        let mut starts = vec![0u32; vertices + 1];
        for [lower, _] in triangles.iter().flat_map(sides_of).map(sorted) {
            starts[lower as usize + 1] += 1;
        }
        for vertex in 0..vertices {
            starts[vertex + 1] += starts[vertex];
        }
        let mut next = starts.clone();
        let mut sides = vec![(0, 0); 3 * triangles.len()];
        for ([lower, higher], side) in triangles.iter().flat_map(sides_of).map(sorted).zip(0u32..) {
            let place = &mut next[lower as usize];
            sides[*place as usize] = (higher, side);
            *place += 1;
        }
        for pair in starts.windows(2) {
            sides[pair[0] as usize..pair[1] as usize].sort_unstable();
        }
        Self { starts, sides }
    }

    /// Calls `work` with the ends of each edge, the lower first, and its sides.
    fn for_each_edge(&self, mut work: impl FnMut([u32; 2], &[(u32, u32)])) {
        for (pair, lower) in self.starts.windows(2).zip(0u32..) {
            for same in self.sides[pair[0] as usize..pair[1] as usize].chunk_by(|a, b| a.0 == b.0) {
                work([lower, same[0].0], same);
            }
        }
    }
}

fn sides_of(triangle: &[u32; 3]) -> [[u32; 2]; 3] {
    let [a, b, c] = *triangle;
    [[a, b], [b, c], [c, a]]
}

fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

const OPEN: u32 = u32::MAX;

/// For each side (three a triangle) the side of the other triangle at its edge. `mesh_vertex` names vertices in errors.
fn twins(
    triangles: &[[u32; 3]],
    vertices: usize,
    mesh_vertex: impl Fn(u32) -> u32,
) -> Result<Vec<u32>, SkeletonError> {
    let mut twins = vec![OPEN; 3 * triangles.len()];
    let mut fault = None;
    Sides::new(triangles, vertices).for_each_edge(|ends, sides| match sides {
        [(_, a), (_, b)] => {
            twins[*a as usize] = *b;
            twins[*b as usize] = *a;
        }
        [_] | [] => {}
        more => fault = fault.or(Some((ends, more.len()))),
    });
    match fault {
        Some((edge, faces)) => {
            Err(SkeletonError::NonManifoldEdge { edge: sorted(edge.map(mesh_vertex)), faces })
        }
        None => Ok(twins),
    }
}

/// Turns triangles, and their sides with them, so that neighbours run alike, and gives each the number of its connected piece.
fn orient(
    triangles: &mut [[u32; 3]],
    twins: &mut [u32],
    mesh_vertex: impl Fn(u32) -> u32,
) -> Result<Vec<u32>, SkeletonError> {
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
                    return Err(SkeletonError::OneSided { edge: side(own).map(mesh_vertex) });
                }
            }
        }
        pieces += 1;
    }
    if turned.contains(&true) {
        // A triangle [a, b, c] becomes [a, c, b]: its first side and its last change places.
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
            if let Some(there) =
                triangles[twin as usize / 3].iter().position(|&other| other == vertex)
            {
                let [a, b] =
                    [root(&mut sheets, own), root(&mut sheets, twin - twin % 3 + there as u32)];
                sheets[a.max(b) as usize] = a.min(b);
            }
        }
    }
    for corner in 0..sheets.len() as u32 {
        sheets[corner as usize] = root(&mut sheets, corner);
    }
    sheets
}

struct Pieces {
    closed: Vec<Piece>,
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
            let renumbered = [0, 1, 2].map(|place| {
                let sheet = corners[3 * triangle + place] as usize;
                let vertex = triangles[triangle][place] as usize;
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
        closed.push(Piece { mesh, frame, vertices: Vec::new() });
    }
    Ok(Pieces { closed, stands_for })
}

/// Closes every loop of open edges by triangles about its centre. At most one open edge leaves each vertex.
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
        for (place, &from) in rim.iter().enumerate() {
            triangles.push([rim[(place + 1) % rim.len()], from, centre]);
        }
    }
}
