//! The cut beside a slow one, bit for bit.

use tombolo_deform::shapes::{box_of_hexahedra, box_of_mixed_cells, box_of_tets};

use super::*;

/// Cuts cell after cell, with the points by their edges in a map.
struct Slow<'a> {
    points: &'a [Vector],
    value: &'a dyn Fn(usize, usize) -> f64,
    layer: usize,
    known: HashMap<(usize, [u32; 2]), u32>,
    cut: Cut,
}

impl Slow<'_> {
    fn value(&self, vertex: u32) -> f64 {
        (self.value)(self.layer, vertex as usize)
    }

    fn direction(&self, [behind, ahead]: [u32; 2]) -> Vector {
        subtract(self.points[ahead as usize], self.points[behind as usize])
    }

    fn crossing(&mut self, edge: [u32; 2]) -> u32 {
        let [a, b] = [edge[0].min(edge[1]), edge[0].max(edge[1])];
        let (at_a, at_b) = (self.value(a), self.value(b));
        let (edge, fraction) = match (at_a == 0.0, at_b == 0.0) {
            (true, _) => ([a, a], 0.0),
            (_, true) => ([b, b], 0.0),
            _ => ([a, b], at_a / (at_a - at_b)),
        };
        let next = numbered(self.cut.points.len());
        let point = *self.known.entry((self.layer, edge)).or_insert(next);
        if point == next {
            let crossing = Crossing { edge, fraction };
            let [from, to] = edge.map(|vertex| self.points[vertex as usize]);
            let at = [0, 1, 2].map(|axis| crossing.between(from[axis], to[axis]));
            self.cut.points.push(at);
            self.cut.crossings.push(crossing);
        }
        point
    }

    fn cell(&mut self, cells: &Cells, cell: usize) {
        let vertices = cells.vertices(cell);
        let is_ahead: Vec<bool> = vertices.iter().map(|&it| self.value(it) >= 0.0).collect();
        let is_nowhere = vertices.iter().any(|&it| self.value(it).is_nan());
        if is_nowhere || is_ahead.iter().all(|&it| it) || !is_ahead.contains(&true) {
            return;
        }
        let of_side = |side: bool| -> Vec<u32> {
            let with_sides = vertices.iter().zip(&is_ahead);
            with_sides.filter(|(_, is_ahead)| **is_ahead == side).map(|(it, _)| *it).collect()
        };
        let (ahead, behind) = (of_side(true), of_side(false));
        if cells.cell_type(cell) == CellType::Tetra {
            let ring: Vec<[u32; 2]> = match (&ahead[..], &behind[..]) {
                (&[a], &[d, e, f]) => vec![[d, a], [e, a], [f, a]],
                (&[a, b], &[d, e]) => vec![[d, a], [d, b], [e, b], [e, a]],
                (&[a, b, c], &[d]) => vec![[d, a], [d, b], [d, c]],
                other => panic!("{other:?}"),
            };
            let mut direction = [0.0; 3];
            for edge in &ring {
                direction = add(direction, self.direction(*edge));
            }
            let polygon = ring.iter().map(|&edge| self.crossing(edge)).collect();
            self.polygon(polygon, direction, cell);
            return;
        }
        let mut faces = Vec::new();
        match cells.cell_type(cell).dimension() {
            3 => cells.for_each_face(cell, |face| faces.push(face.to_vec())),
            _ => cells.for_each_polygon(cell, |face| faces.push(face.to_vec())),
        }
        let (mut segments, mut directions) = (Vec::new(), Vec::new());
        for face in faces {
            let is_ahead = |corner: usize| self.value(face[corner % face.len()]) >= 0.0;
            let Some(start) =
                (0..face.len()).find(|&corner| !is_ahead(corner) && is_ahead(corner + 1))
            else {
                continue;
            };
            let mut enter = None;
            for corner in start..start + face.len() {
                let edge = [face[corner % face.len()], face[(corner + 1) % face.len()]];
                match edge.map(|vertex| self.value(vertex) >= 0.0) {
                    [false, true] => {
                        let point = self.crossing(edge);
                        directions.push((point, self.direction(edge)));
                        enter = Some(point);
                    }
                    [true, false] => {
                        let leave = self.crossing(edge);
                        segments.extend(enter.take().map(|enter| (leave, enter)));
                    }
                    _ => {}
                }
            }
        }
        if cells.cell_type(cell).dimension() == 2 {
            for (from, to) in segments.into_iter().filter(|(from, to)| from != to) {
                self.push(CellType::Line, &[from, to], cell);
            }
            return;
        }
        while let Some((start, mut end)) = segments.pop() {
            let mut polygon = vec![start];
            while end != start {
                polygon.push(end);
                let Some(next) = segments.iter().position(|segment| segment.0 == end) else {
                    break;
                };
                end = segments.swap_remove(next).1;
            }
            let own = directions.iter().filter(|(point, _)| polygon.contains(point));
            let direction = own.fold([0.0; 3], |sum, (_, direction)| add(sum, *direction));
            self.polygon(polygon, direction, cell);
        }
    }

    fn polygon(&mut self, mut polygon: Vec<u32>, direction: Vector, cell: usize) {
        polygon.dedup();
        if polygon.len() > 1 && polygon.first() == polygon.last() {
            polygon.pop();
        }
        let at = |index: usize| self.cut.points[polygon[index] as usize];
        let triangle = |index: usize| {
            let [u, v] = [at(index), at(index + 1)].map(|corner| subtract(corner, at(0)));
            dot(cross(u, v), direction)
        };
        let turn: f64 = (1..polygon.len().saturating_sub(1)).map(triangle).sum();
        if turn < 0.0 {
            polygon.reverse();
        }
        match polygon.len() {
            0..3 => {}
            3 => self.push(CellType::Triangle, &polygon, cell),
            4 => self.push(CellType::Quad, &polygon, cell),
            _ => self.push(CellType::Polygon, &polygon, cell),
        }
    }

    fn push(&mut self, cell_type: CellType, points: &[u32], cell: usize) {
        self.cut.cells.push(cell_type, points).unwrap();
        self.cut.owners.push(numbered(cell));
    }
}

/// Quadrilaterals, pixels, triangles and strips on a grid of points, and what is no surface.
fn faces() -> Cells {
    let mut cells = Cells::new();
    for row in 0..6 {
        for column in 0..8 {
            let [a, b] = [9 * row + column, 9 * row + column + 1];
            let [c, d] = [b + 9, a + 9];
            match (row + 2 * column) % 5 {
                0 => cells.push(CellType::Quad, &[a, b, c, d]).unwrap(),
                1 => cells.push(CellType::Pixel, &[a, b, d, c]).unwrap(),
                2 => cells.push(CellType::TriangleStrip, &[a, b, d, c]).unwrap(),
                3 => cells.push(CellType::Polygon, &[a, b, c, d]).unwrap(),
                _ => {
                    cells.push(CellType::Triangle, &[a, b, c]).unwrap();
                    cells.push(CellType::Line, &[a, c]).unwrap();
                    cells.push(CellType::Triangle, &[a, c, d]).unwrap();
                }
            }
        }
    }
    cells
}

#[test]
fn cuts_are_those_of_a_slow_one_bit_for_bit() {
    let of_box = |mesh: &tombolo_deform::mesh::Mesh| (mesh.points().to_vec(), mesh.cells().clone());
    let sheet = |point: u32| {
        let [column, row] = [point % 9, point / 9].map(f64::from);
        [0.1 * column, 0.15 * row, 0.02 * column * row]
    };
    let meshes = [
        of_box(&box_of_tets([6, 5, 7], [0.0; 3], [1.0, 0.8, 1.2])),
        of_box(&box_of_hexahedra([6, 5, 4], [-1.0; 3], [1.0; 3])),
        of_box(&box_of_mixed_cells([7, 5, 6], [0.0; 3], [1.0; 3])),
        ((0..63).map(sheet).collect(), faces()),
        (Vec::new(), Cells::new()),
    ];
    for (name, (points, cells)) in meshes.iter().enumerate() {
        let curved = |vertex: usize| {
            let [x, y, z] = points[vertex];
            (x - 0.4) * (x + y) + 2.0 * (y - 0.3) * z
        };
        let sprinkled = |vertex: usize| (vertex * 37 % 11) as f64 - 5.0;
        // The last has vertices at which it is 0, and some at which it is nothing.
        let value = |layer: usize, vertex: usize| match layer {
            0 => curved(vertex),
            1 => points[vertex][0] - 0.5,
            2 => curved(vertex) - 0.1,
            _ if vertex % 29 == 3 => f64::NAN,
            _ => sprinkled(vertex),
        };
        let counts = |cell: usize| cell % 13 != 5;
        let blocks = Blocks::new(cells, points.len());
        let mut found = cut(cells, &blocks, points, 4, value, counts).unwrap();
        let known = HashMap::new();
        let mut slow = Slow { points, value: &value, layer: 0, known, cut: Cut::default() };
        for layer in 0..4 {
            slow.layer = layer;
            (0..cells.len()).filter(|&cell| counts(cell)).for_each(|cell| slow.cell(cells, cell));
            slow.cut.ends.push(numbered(slow.cut.points.len()));
        }
        let mut expected = slow.cut;
        assert!(expected.cells.is_empty() == cells.is_empty());
        let bits = |cut: &mut Cut| -> Vec<[u64; 3]> {
            cut.points.drain(..).map(|point| point.map(f64::to_bits)).collect()
        };
        assert_eq!(bits(&mut found), bits(&mut expected), "mesh {name}");
        assert_eq!(found.crossings, expected.crossings, "mesh {name}");
        assert_eq!(found.ends, expected.ends, "mesh {name}");
        assert_eq!(found.cells, expected.cells, "mesh {name}");
        assert_eq!(found.owners, expected.owners, "mesh {name}");
    }
}

/// More edges than are kept of those that were asked for a short time ago.
#[test]
fn a_point_is_found_however_long_ago_it_was_made() {
    let mesh = box_of_tets([14; 3], [0.0; 3], [1.0; 3]);
    let (points, cells) = (mesh.points(), mesh.cells());
    let blocks = Blocks::new(cells, points.len());
    let value = |_: usize, vertex: usize| (vertex * 37 % 11) as f64 - 5.5;
    let found = cut(cells, &blocks, points, 1, value, |_| true).unwrap();
    assert!(found.points.len() > 4 << RECENT);
    let mut edges: Vec<[u32; 2]> = found.crossings.iter().map(|crossing| crossing.edge).collect();
    edges.sort_unstable();
    edges.dedup();
    assert_eq!(edges.len(), found.points.len());
}
