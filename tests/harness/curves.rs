//! Curve skeletons as graphs, ours and CGAL's, to hold one against the other.

use std::io::Write as _;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use tombolo_deform::mesh::Vector;
use tombolo_deform::skeleton::Skeleton;
use tombolo_deform::surface::Surface;

use crate::{cgal_program, off};

/// The points and edges of a curve skeleton.
#[derive(Debug, Clone, PartialEq)]
pub struct CurveGraph {
    points: Vec<Vector>,
    edges: Vec<[usize; 2]>,
}

impl CurveGraph {
    /// Those of a skeleton of ours.
    #[must_use]
    pub fn of(skeleton: &Skeleton) -> Self {
        let segments = skeleton.curves().iter().flat_map(|curve| curve.nodes().windows(2));
        let edges = segments.map(|pair| [pair[0] as usize, pair[1] as usize]).collect();
        Self { points: skeleton.nodes().to_vec(), edges }
    }

    /// What CGAL finds and the seconds that its extraction takes, without reading; none where it takes longer than the limit,
    /// and is ended: it loops for ever on some surfaces.
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
        let mut number = || words.next().and_then(|word| word.parse::<f64>().ok()).expect("a number");
        let seconds = number();
        let [points, edges] = [number() as usize, number() as usize];
        let points = (0..points).map(|_| [number(), number(), number()]).collect();
        Some((seconds, Self { points, edges: (0..edges).map(|_| [number() as usize, number() as usize]).collect() }))
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
        let of_degree = |wanted: fn(usize) -> bool| degrees.iter().filter(|&&degree| wanted(degree)).count();
        let loops = self.edges.len() + piece.len() - self.points.len();
        [piece.len(), loops, of_degree(|degree| degree > 2), of_degree(|degree| degree == 1)]
    }

    /// The Hausdorff distance's two sides, as parts of the diagonal of the surface's bounding box: how far the points of this
    /// graph are from the other at most, and the other's from this. The curves are sampled at a thousandth of the diagonal.
    #[must_use]
    pub fn apart(&self, other: &Self, surface: &Surface) -> [f64; 2] {
        let [lower, upper] =
            surface.points().iter().fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[lower, upper], point| {
                [
                    std::array::from_fn(|axis| lower[axis].min(point[axis])),
                    std::array::from_fn(|axis| upper[axis].max(point[axis])),
                ]
            });
        let diagonal = distance(lower, upper);
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

fn distance(a: Vector, b: Vector) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}

/// The largest distance from one of the first to the nearest of the others.
fn away(from: &[Vector], to: &[Vector]) -> f64 {
    let nearest = |&a: &Vector| to.iter().map(|&b| distance(a, b)).fold(f64::INFINITY, f64::min);
    from.iter().map(nearest).fold(0.0, f64::max)
}
