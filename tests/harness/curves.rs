//! Curve skeletons as graphs, ours and CGAL's, to hold one against the other.

use std::io::Write as _;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use tombolo_deform::bounds::Bounds;
use tombolo_deform::mesh::Vector;
use tombolo_deform::skeleton::Skeleton;
use tombolo_deform::surface::Surface;
use tombolo_deform::vector::distance;

use crate::{cgal_program, off};

/// The points and edges of a curve skeleton.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveGraph {
    points: Vec<Vector>,
    edges: Vec<[usize; 2]>,
}

impl CurveGraph {
    /// The curves of a skeleton of ours.
    #[must_use]
    pub fn of(skeleton: &Skeleton) -> Self {
        let segments = skeleton.curves().iter().flat_map(|curve| curve.nodes().windows(2));
        let edges = segments.map(|pair| [pair[0] as usize, pair[1] as usize]).collect();
        Self { points: skeleton.nodes().to_vec(), edges }
    }

    /// The curves that CGAL finds and the seconds that its extraction takes, without reading; none
    /// where it takes longer than the limit, and is ended: it loops for ever on some surfaces.
    ///
    /// # Panics
    /// Where the program cannot be made or run.
    #[must_use]
    pub fn of_cgal(surface: &Surface, limit: Duration) -> Option<(f64, Self)> {
        let mut child = Command::new(cgal_program("skeleton"))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("a program that compiled starts");
        let mut input = child.stdin.take().expect("the input is a pipe");
        let mut output = child.stdout.take().expect("the output is a pipe");
        let text = off(surface.points(), surface.triangles());
        let read = std::thread::spawn(move || std::io::read_to_string(&mut output).expect("text"));
        input.write_all(text.as_bytes()).expect("the program reads its input");
        drop(input);
        let start = Instant::now();
        while child.try_wait().expect("a program can be asked").is_none() {
            if start.elapsed() > limit {
                child.kill().expect("a program can be ended");
                child.wait().expect("a program that was ended ends");
                return None;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let text = read.join().expect("the reader ends");
        let mut words = text.split_ascii_whitespace();
        let mut number =
            || words.next().and_then(|word| word.parse::<f64>().ok()).expect("a number");
        let seconds = number();
        let [points, edges] = [number() as usize, number() as usize];
        let points = (0..points).map(|_| [number(), number(), number()]).collect();
        Some((
            seconds,
            Self {
                points,
                edges: (0..edges).map(|_| [number() as usize, number() as usize]).collect(),
            },
        ))
    }

    /// The graph without the branches with a free end that are shorter than a part of the surface's
    /// diagonal, shortest first.
    #[must_use]
    pub fn without_spurs(&self, part: f64, surface: &Surface) -> Self {
        let bound = part * diagonal(surface);
        let mut edges = self.edges.clone();
        loop {
            let mut around = vec![Vec::new(); self.points.len()];
            for &[a, b] in &edges {
                around[a].push(b);
                around[b].push(a);
            }
            let shortest = (0..self.points.len())
                .filter(|&end| around[end].len() == 1)
                .filter_map(|end| {
                    let mut path = vec![end, around[end][0]];
                    let mut length = distance(self.points[end], self.points[path[1]]);
                    while let [a, b] = around[path[path.len() - 1]][..] {
                        let [before, here] = [path[path.len() - 2], path[path.len() - 1]];
                        path.push(if a == before { b } else { a });
                        length += distance(self.points[here], self.points[path[path.len() - 1]]);
                    }
                    let is_branch = around[path[path.len() - 1]].len() > 2;
                    (is_branch && length < bound).then_some((length, path))
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, path)) = shortest else { break };
            edges.retain(|&[a, b]| !path.windows(2).any(|pair| pair == [a, b] || pair == [b, a]));
        }
        // What is left, numbered from 0 on; points without an edge were points before or the cut
        // ends.
        let kept: Vec<usize> = (0..self.points.len())
            .filter(|&point| {
                edges.iter().any(|edge| edge.contains(&point))
                    || !self.edges.iter().any(|edge| edge.contains(&point))
            })
            .collect();
        let number =
            |point: usize| kept.iter().position(|&other| other == point).expect("it has an edge");
        Self {
            points: kept.iter().map(|&point| self.points[point]).collect(),
            edges: edges.iter().map(|edge| edge.map(number)).collect(),
        }
    }

    /// Pieces, loops, branch nodes and ends.
    #[must_use]
    pub fn counts(&self) -> [usize; 4] {
        let mut piece: Vec<usize> = (0..self.points.len()).collect();
        let mut degrees = vec![0; self.points.len()];
        for &[a, b] in &self.edges {
            degrees[a] += 1;
            degrees[b] += 1;
            let [from, to] = [piece[a].max(piece[b]), piece[a].min(piece[b])];
            piece.iter_mut().filter(|piece| **piece == from).for_each(|piece| *piece = to);
        }
        piece.sort_unstable();
        piece.dedup();
        let of_degree =
            |wanted: fn(usize) -> bool| degrees.iter().filter(|&&degree| wanted(degree)).count();
        let loops = self.edges.len() + piece.len() - self.points.len();
        [piece.len(), loops, of_degree(|degree| degree > 2), of_degree(|degree| degree == 1)]
    }

    /// The Hausdorff distance's two sides, as parts of the diagonal of the surface's bounding box:
    /// how far the points of this graph are from the other at most, and the other's from this. The
    /// curves are sampled at a thousandth of the diagonal.
    #[must_use]
    pub fn apart(&self, other: &Self, surface: &Surface) -> [f64; 2] {
        let diagonal = diagonal(surface);
        let [a, b] = [self, other].map(|graph| graph.samples(1e-3 * diagonal));
        [away(&a, &b) / diagonal, away(&b, &a) / diagonal]
    }

    /// Points on the edges, no two neighbours further apart than a step.
    fn samples(&self, step: f64) -> Vec<Vector> {
        let mut samples = self.points.clone();
        for &[a, b] in &self.edges {
            let [a, b] = [self.points[a], self.points[b]];
            let parts = (distance(a, b) / step).ceil().max(1.0);
            for part in 1..parts as usize {
                let along = part as f64 / parts;
                samples.push(std::array::from_fn(|axis| a[axis] + along * (b[axis] - a[axis])));
            }
        }
        samples
    }
}

/// The diagonal of a surface's bounding box.
fn diagonal(surface: &Surface) -> f64 {
    let Bounds { lower, upper } = Bounds::around(surface.points().iter().copied());
    distance(lower, upper)
}

/// The largest distance from one of the first to the nearest of the others.
fn away(from: &[Vector], to: &[Vector]) -> f64 {
    let nearest = |&a: &Vector| to.iter().map(|&b| distance(a, b)).fold(f64::INFINITY, f64::min);
    from.iter().map(nearest).fold(0.0, f64::max)
}
