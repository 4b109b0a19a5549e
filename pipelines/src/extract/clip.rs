//! The part of a mesh in which all of some functions are at least 0, or that in which one is not.
//!
//! A cell that is cut is decomposed into tetrahedra. In a tetrahedron a function is linear: what is left of it is a tetrahedron, a pyramid or a wedge. With
//! several functions these are decomposed in turn, by the names of their points.

use tombolo_deform::mesh::{CellType, Cells, MeshError, Vector};
use tombolo_deform::vector::{add, cross, determinant, dot, scale, subtract};

use super::cut::{ByVertices, mixed};
use super::decompose::Faces;
use super::gather::Rows;
use super::pattern::{Base, Pattern};
use super::source::Origin;
use super::supports::{Support, Supports};

/// A vertex, or a point that was cut out.
#[derive(Clone, Copy)]
struct Node {
    /// The vertices it lies between, and the nodes between which it was cut out, as one number that
    /// all ranks find.
    support: Support,
    /// The weights of the vertices of the support.
    weights: [f64; 4],
    /// By bits, the functions that are 0 there.
    zero: u8,
    /// Its number among the points of the extract; `u32::MAX` before it is used.
    number: u32,
}

/// A cell by its nodes.
#[derive(Clone, Copy)]
struct Piece {
    cell_type: CellType,
    nodes: [u32; 6],
}

impl Piece {
    fn new(cell_type: CellType, nodes: &[u32]) -> Self {
        let mut all = [u32::MAX; 6];
        all.iter_mut().zip(nodes).for_each(|(slot, node)| *slot = *node);
        Self { cell_type, nodes: all }
    }

    fn nodes(&self) -> &[u32] {
        &self.nodes[..self.cell_type.vertex_count().unwrap_or(0)]
    }
}

/// The signs of the functions at a vertex.
#[derive(Clone, Copy, Default)]
struct Signs {
    /// By bits, the functions that are below 0.
    below: u8,
    /// By bits, the functions that are 0 or below.
    not_above: u8,
    /// Whether a function is NaN.
    is_lacking: bool,
}

/// Clips cell after cell.
pub(super) struct Clipper<'a> {
    cells: &'a Cells,
    points: &'a [Vector],
    /// The values of at most eight functions at the vertices.
    values: &'a [Vec<f64>],
    /// The numbers of the vertices in the whole mesh, where this is a part of one.
    numbers: Option<&'a [u32]>,
    invert: bool,
    signs: Vec<Signs>,
    nodes: Vec<Node>,
    /// The node of each vertex, and its point; `u32::MAX` before they are used.
    of_vertices: Vec<u32>,
    points_of_vertices: Vec<u32>,
    /// Nodes by the two between which they lie, and the function that is 0 there.
    between: ByVertices<(u32, u32, usize)>,
    faces: Faces,
    simplices: Vec<[u32; 4]>,
    /// The normal of the triangle that is clipped, where the cell is a face.
    normal: Vector,
    /// The points of the cell that is taken whole.
    points_of_cell: Vec<u32>,
    cell: u32,
    made: Cells,
    owners: Vec<u32>,
    /// The node of each point.
    used: Vec<u32>,
}

impl<'a> Clipper<'a> {
    pub(super) fn new(
        cells: &'a Cells,
        points: &'a [Vector],
        values: &'a [Vec<f64>],
        numbers: Option<&'a [u32]>,
        invert: bool,
    ) -> Self {
        let mut signs = vec![Signs::default(); points.len()];
        for (index, of_function) in values.iter().enumerate() {
            for (signs, &value) in signs.iter_mut().zip(of_function) {
                signs.below |= u8::from(value < 0.0) << index;
                signs.not_above |= u8::from(value <= 0.0) << index;
                signs.is_lacking |= value.is_nan();
            }
        }
        Self {
            cells,
            points,
            values,
            numbers,
            invert,
            signs,
            nodes: Vec::new(),
            of_vertices: vec![u32::MAX; points.len()],
            points_of_vertices: vec![u32::MAX; points.len()],
            between: ByVertices::default(),
            faces: Faces::default(),
            simplices: Vec::new(),
            normal: [0.0; 3],
            points_of_cell: Vec::new(),
            cell: 0,
            made: Cells::new(),
            owners: Vec::new(),
            used: Vec::new(),
        }
    }

    /// Takes what is to be kept of one cell.
    pub(super) fn cell(&mut self, cell: usize) -> Result<(), MeshError> {
        let dimension = self.cells.cell_type(cell).dimension();
        let vertices = self.cells.vertices(cell);
        let (mut below, mut not_above, mut is_lacking) = (0, u8::MAX, false);
        for &vertex in vertices {
            let signs = self.signs[vertex as usize];
            below |= signs.below;
            not_above &= signs.not_above;
            is_lacking |= signs.is_lacking;
        }
        if is_lacking || dimension < 2 {
            return Ok(());
        }
        let (is_inside, is_outside) = (below == 0, below & not_above != 0);
        match (is_inside, is_outside) {
            (true, _) if self.invert => Ok(()),
            (_, true) if !self.invert => Ok(()),
            (true, _) | (_, true) => self.whole(cell),
            _ => self.decomposed(cell, dimension),
        }
    }

    /// Takes a cell as it is, unless it is of lower dimension.
    pub(super) fn whole(&mut self, cell: usize) -> Result<(), MeshError> {
        let cells = self.cells;
        let cell_type = cells.cell_type(cell);
        if cell_type.dimension() < 2 {
            return Ok(());
        }
        let mut points = std::mem::take(&mut self.points_of_cell);
        if cell_type == CellType::Polyhedron {
            let mut numbered = |face: &Vec<u32>| {
                self.numbered(face, &mut points);
                points.clone()
            };
            let faces: Vec<_> = cells.polyhedron_faces(cell).iter().map(&mut numbered).collect();
            self.made.push_polyhedron(&faces)?;
        } else {
            self.numbered(cells.vertices(cell), &mut points);
            self.made.push(cell_type, &points)?;
        }
        self.points_of_cell = points;
        self.owners.push(as_u32(cell));
        Ok(())
    }

    fn decomposed(&mut self, cell: usize, dimension: usize) -> Result<(), MeshError> {
        let numbers = self.numbers;
        let key = |vertex: u32| numbers.map_or(vertex, |numbers| numbers[vertex as usize]);
        self.cell = as_u32(cell);
        let mut simplices = std::mem::take(&mut self.simplices);
        simplices.clear();
        self.faces.decompose(self.cells, cell, key, &mut simplices);
        let cell_type = if dimension == 3 { CellType::Tetra } else { CellType::Triangle };
        for simplex in &simplices {
            if let &[a, b, c, u32::MAX] = simplex {
                let [a, b, c] = [a, b, c].map(|vertex| self.points[vertex as usize]);
                self.normal = cross(subtract(b, a), subtract(c, a));
            }
            let nodes = simplex.map(|v| if v == u32::MAX { v } else { self.vertex(v) });
            self.simplex(Piece::new(cell_type, &nodes), 0)?;
        }
        self.simplices = simplices;
        Ok(())
    }

    /// Takes what is to be kept of a simplex, by the functions from this one on.
    fn simplex(&mut self, simplex: Piece, from: usize) -> Result<(), MeshError> {
        let functions = from..self.values.len();
        let is_below = |function: &usize| {
            simplex.nodes().iter().any(|&node| self.value(node, *function) < 0.0)
        };
        let Some(function) = functions.clone().find(is_below) else {
            return if self.invert { Ok(()) } else { self.push(&simplex) };
        };
        if self.invert
            && let Some(outside) = self.part(&simplex, function, -1.0)
        {
            self.push(&outside)?;
        }
        let Some(inside) = self.part(&simplex, function, 1.0) else { return Ok(()) };
        let is_cut = (function + 1..functions.end)
            .any(|next| inside.nodes().iter().any(|&node| self.value(node, next) < 0.0));
        if !is_cut {
            return if self.invert { Ok(()) } else { self.push(&inside) };
        }
        for simplex in self.simplices(&inside) {
            self.simplex(simplex, function + 1)?;
        }
        Ok(())
    }

    /// The part of a simplex in which the function, times a sign, is above 0.
    fn part(&mut self, simplex: &Piece, function: usize, sign: f64) -> Option<Piece> {
        let (mut ahead, mut behind) = ([0; 4], [0; 4]);
        let (mut ahead_count, mut behind_count) = (0, 0);
        let mut is_above = false;
        for &node in simplex.nodes() {
            let value = sign * self.value(node, function);
            is_above |= value > 0.0;
            let (side, count) = if value >= 0.0 {
                (&mut ahead, &mut ahead_count)
            } else {
                (&mut behind, &mut behind_count)
            };
            side[*count] = node;
            *count += 1;
        }
        if !is_above {
            return None;
        }
        let is_zero = |nodes: &Self, node: u32| nodes.value(node, function) == 0.0;
        let piece = match (&ahead[..ahead_count], &behind[..behind_count]) {
            (_, []) => *simplex,
            (&[a], &[b, c]) => {
                let [ab, ac] = [b, c].map(|other| self.between(a, other, function));
                Piece::new(CellType::Triangle, &[a, ab, ac])
            }
            (&[a, b], &[c]) => {
                let (a, b) = if is_zero(self, b) { (b, a) } else { (a, b) };
                let bc = self.between(b, c, function);
                if is_zero(self, a) {
                    Piece::new(CellType::Triangle, &[a, b, bc])
                } else {
                    let ac = self.between(a, c, function);
                    Piece::new(CellType::Quad, &[a, b, bc, ac])
                }
            }
            (&[a], &[b, c, d]) => {
                let [ab, ac, ad] = [b, c, d].map(|other| self.between(a, other, function));
                Piece::new(CellType::Tetra, &[a, ab, ac, ad])
            }
            (&[a, b], &[c, d]) => {
                let (a, b) = if is_zero(self, b) { (b, a) } else { (a, b) };
                let [bc, bd] = [c, d].map(|other| self.between(b, other, function));
                if is_zero(self, a) {
                    Piece::new(CellType::Tetra, &[b, bc, bd, a])
                } else {
                    let [ac, ad] = [c, d].map(|other| self.between(a, other, function));
                    Piece::new(CellType::Wedge, &[a, ac, ad, b, bc, bd])
                }
            }
            (&[a, b, c], &[d]) => {
                // Those at which the function is 0 first.
                let mut corners = [a, b, c];
                corners.sort_by_key(|&corner| !is_zero(self, corner));
                let [a, b, c] = corners;
                match corners.iter().filter(|&&corner| is_zero(self, corner)).count() {
                    0 => {
                        let [ad, bd, cd] = corners.map(|near| self.between(near, d, function));
                        Piece::new(CellType::Wedge, &[a, b, c, ad, bd, cd])
                    }
                    1 => {
                        let [bd, cd] = [b, c].map(|near| self.between(near, d, function));
                        Piece::new(CellType::Pyramid, &[b, c, cd, bd, a])
                    }
                    _ => {
                        let cd = self.between(c, d, function);
                        Piece::new(CellType::Tetra, &[a, b, c, cd])
                    }
                }
            }
            _ => return None,
        };
        Some(piece)
    }

    /// The simplices of a piece.
    fn simplices(&mut self, piece: &Piece) -> Vec<Piece> {
        if matches!(piece.cell_type, CellType::Tetra | CellType::Triangle) {
            return vec![*piece];
        }
        let mut faces = std::mem::take(&mut self.faces);
        faces.clear();
        let mut simplices = Vec::new();
        let key = |node: u32| self.nodes[node as usize].support.layer;
        let cell_type = if piece.cell_type == CellType::Quad {
            faces.push(piece.nodes());
            faces.triangles(key, &mut simplices);
            CellType::Triangle
        } else {
            for face in piece.cell_type.faces() {
                let nodes: Vec<u32> = face.iter().map(|&local| piece.nodes[local]).collect();
                faces.push(&nodes);
            }
            faces.tetrahedra(key, &mut simplices);
            CellType::Tetra
        };
        self.faces = faces;
        simplices.iter().map(|nodes| Piece::new(cell_type, nodes)).collect()
    }

    fn value(&self, node: u32, function: usize) -> f64 {
        let Node { support, weights, zero, .. } = &self.nodes[node as usize];
        if zero >> function & 1 == 1 {
            return 0.0;
        }
        let values = &self.values[function];
        let parts = support.vertices().zip(weights);
        parts.map(|(vertex, weight)| weight * values[vertex as usize]).sum()
    }

    /// The node of a vertex.
    fn vertex(&mut self, vertex: u32) -> u32 {
        if self.of_vertices[vertex as usize] == u32::MAX {
            let Signs { below, not_above, .. } = self.signs[vertex as usize];
            let number = self.numbers.map_or(vertex, |numbers| numbers[vertex as usize]);
            self.of_vertices[vertex as usize] = self.add(Node {
                support: Support::new(&[vertex], mixed(0, u64::from(number))),
                weights: [1.0, 0.0, 0.0, 0.0],
                zero: not_above & !below,
                number: u32::MAX,
            });
        }
        self.of_vertices[vertex as usize]
    }

    fn add(&mut self, node: Node) -> u32 {
        self.nodes.push(node);
        as_u32(self.nodes.len() - 1)
    }

    /// The node between two others at which the function is 0.
    fn between(&mut self, near: u32, far: u32, function: usize) -> u32 {
        let (at_near, at_far) = (self.value(near, function), self.value(far, function));
        if at_near == 0.0 {
            return near;
        }
        let key = (near.min(far), near.max(far), function);
        if let Some(&known) = self.between.get(&key) {
            return known;
        }
        let fraction = at_near / (at_near - at_far);
        let [a, b] = [near, far].map(|node| self.nodes[node as usize]);
        let [one, other] = [a, b].map(|node| node.support.layer);
        let name = mixed(mixed(one.min(other), one.max(other)), function as u64);
        let support = a.support.with(&b.support, name);
        let weight = |node: &Node, vertex: u32| {
            let mut parts = node.support.vertices().zip(node.weights);
            parts.find(|(known, _)| *known == vertex).map_or(0.0, |(_, weight)| weight)
        };
        let mut weights = [0.0; 4];
        for (slot, vertex) in weights.iter_mut().zip(support.vertices()) {
            *slot = (1.0 - fraction) * weight(&a, vertex) + fraction * weight(&b, vertex);
        }
        let zero = a.zero & b.zero | 1 << function;
        let node = self.add(Node { support, weights, zero, number: u32::MAX });
        self.between.insert(key, node);
        node
    }

    fn position(&self, node: u32) -> Vector {
        let Node { support, weights, .. } = &self.nodes[node as usize];
        let mut parts = support.vertices().zip(weights);
        let part = |(vertex, weight): (u32, &f64)| scale(self.points[vertex as usize], *weight);
        let first = parts.next().map_or([0.0; 3], part);
        parts.map(part).fold(first, add)
    }

    fn number(&mut self, node: u32) -> u32 {
        let number = &mut self.nodes[node as usize].number;
        if *number == u32::MAX {
            *number = as_u32(self.used.len());
            self.used.push(node);
        }
        *number
    }

    /// Finds the points at vertices.
    fn numbered(&mut self, vertices: &[u32], points: &mut Vec<u32>) {
        points.clear();
        for &vertex in vertices {
            let mut point = self.points_of_vertices[vertex as usize];
            if point == u32::MAX {
                let node = self.vertex(vertex);
                point = self.number(node);
                self.points_of_vertices[vertex as usize] = point;
            }
            points.push(point);
        }
    }

    /// Appends a piece, turned right-handed, or of a face as the face is.
    fn push(&mut self, piece: &Piece) -> Result<(), MeshError> {
        let at = |local: usize| self.position(piece.nodes[local]);
        let along = |from: usize, to: usize| subtract(at(to), at(from));
        let volume = match piece.cell_type {
            CellType::Tetra => determinant(along(0, 1), along(0, 2), along(0, 3)),
            CellType::Pyramid => determinant(along(0, 1), along(0, 3), along(0, 4)),
            CellType::Wedge => determinant(
                along(0, 1),
                along(0, 2),
                add(along(0, 3), add(along(1, 4), along(2, 5))),
            ),
            _ => dot(cross(along(0, 1), along(0, 2)), self.normal),
        };
        let mut nodes = piece.nodes;
        if volume < 0.0 {
            match piece.cell_type {
                CellType::Pyramid | CellType::Quad => nodes.swap(1, 3),
                CellType::Wedge => {
                    nodes.swap(1, 2);
                    nodes.swap(4, 5);
                }
                _ => nodes.swap(1, 2),
            }
        }
        let count = piece.nodes().len();
        let points = nodes.map(|node| if node == u32::MAX { node } else { self.number(node) });
        self.made.push(piece.cell_type, &points[..count])?;
        self.owners.push(self.cell);
        Ok(())
    }

    pub(super) fn finish(self) -> Pattern {
        let points = self.used.iter().map(|&node| self.position(node)).collect();
        let mut rows = Rows::default();
        let mut supports = Vec::with_capacity(self.used.len());
        for Node { support, weights, .. } in self.used.iter().map(|&node| self.nodes[node as usize])
        {
            rows.push(support.vertices().zip(weights));
            supports.push(support);
        }
        Pattern {
            points,
            base: Base::Rows(rows),
            cells: self.made.into(),
            owners: self.owners.into(),
            origin: Origin::Between(Supports::Each(supports.into())),
        }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "cells are numbered with 32 bits, and so are their vertices and what lies between these"
)]
fn as_u32(index: usize) -> u32 {
    index as u32
}
