//! Skeletons against those of CGAL: the same pieces, loops and branches, and within 2 % of the bounding box of each other.

use std::io::Write as _;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use tombolo_deform::mesh::{CellType, Cells, FeatureSource, Mesh, Vector};
use tombolo_deform::shapes;
use tombolo_deform::skeleton::{Skeleton, SkeletonSettings};
use tombolo_deform::surface::{FeatureSettings, Surface};
use tombolo_pipelines::files::read_mesh;
use tombolo_tests::{cgal_program, generated_surfaces, off};

/// CGAL loops for ever on some surfaces.
const LIMIT: Duration = Duration::from_secs(100);

struct Graph {
    points: Vec<Vector>,
    edges: Vec<[usize; 2]>,
}

impl Graph {
    fn of(skeleton: &Skeleton) -> Self {
        let segments = skeleton.curves().iter().flat_map(|curve| curve.nodes().windows(2));
        let edges = segments.map(|pair| [pair[0] as usize, pair[1] as usize]).collect();
        Self { points: skeleton.nodes().to_vec(), edges }
    }

    /// What CGAL finds; the program is ended where it takes too long.
    fn of_cgal(surface: &Surface) -> Self {
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
            if start.elapsed() > LIMIT {
                child.kill().expect("a program can be ended");
                panic!("CGAL takes more than {LIMIT:?}");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let text = read.join().expect("the reader ends");
        let mut words = text.split_ascii_whitespace().skip(1);
        let mut number = || words.next().and_then(|word| word.parse::<f64>().ok()).expect("a number");
        let [points, edges] = [number() as usize, number() as usize];
        let points = (0..points).map(|_| [number(), number(), number()]).collect();
        Self { points, edges: (0..edges).map(|_| [number() as usize, number() as usize]).collect() }
    }

    /// Pieces, loops, branch nodes and ends.
    fn counts(&self) -> [usize; 4] {
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

/// Asserts that both skeletons of a surface have these pieces, loops, branch nodes and ends, and lie close together.
fn agree(name: &str, mesh: &Mesh, counts: [usize; 4]) {
    let surface = Surface::extract(mesh, &FeatureSettings::default()).expect("a surface");
    let ours = Graph::of(&Skeleton::extract(&surface, &SkeletonSettings::default()).expect("a skeleton"));
    let theirs = Graph::of_cgal(&surface);
    assert_eq!(ours.counts(), counts, "{name}: pieces, loops, branch nodes and ends");
    assert_eq!(theirs.counts(), counts, "{name}: those of CGAL");
    let [lower, upper] = surface.points().iter().fold([[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]], |[l, u], p| {
        [std::array::from_fn(|axis| l[axis].min(p[axis])), std::array::from_fn(|axis| u[axis].max(p[axis]))]
    });
    let diagonal = distance(lower, upper);
    let [a, b] = [&ours, &theirs].map(|graph| graph.samples(1e-3 * diagonal));
    let [there, back] = [away(&a, &b) / diagonal, away(&b, &a) / diagonal];
    println!("{name}: {:.2} % and {:.2} % of the diagonal apart", 100.0 * there, 100.0 * back);
    assert!(there <= 0.02 && back <= 0.02, "{name}: {there} {back}");
}

#[test]
fn a_torus() {
    agree("torus", &shapes::torus(1.0, 0.3, [82, 25]), [1, 1, 0, 0]);
}

#[test]
fn the_generated_meshes() {
    let cases = [("pipe-1", [1, 0, 0, 2]), ("bypass-0", [1, 1, 2, 2])];
    let names = cases.map(|(name, _)| name);
    for ((name, counts), file) in cases.into_iter().zip(generated_surfaces(&names)) {
        let mesh = read_mesh(&file).expect("a mesh").mesh;
        agree(name, &triangles_of(&mesh), counts);
    }
}

/// The triangles of a surface mesh alone.
fn triangles_of(mesh: &Mesh) -> Mesh {
    let surface = Surface::extract(mesh, &FeatureSettings::default()).expect("a surface");
    let cells = Cells::uniform(CellType::Triangle, surface.triangles().concat()).expect("triangles");
    Mesh::new(surface.points().to_vec(), cells, FeatureSource::SharpEdges).expect("a mesh")
}
