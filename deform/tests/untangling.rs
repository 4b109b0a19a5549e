//! Boundaries that the inside cannot follow in a straight line.
use std::{sync::Arc, time::Instant, convert::Infallible};
use tombolo_deform::{
    mesh::{Mesh, Vector}, partition::whole, quality::{quality, Guard}, shapes,
    volume::{BoundaryMotion, Deform, Domain, FollowError, Untangler, VolumeOperator, follow}, warps::Warp,
};

fn on_boundary(mesh: &Mesh) -> Vec<u32> {
    let height = mesh.points().iter().map(|p| p[2]).fold(0.0, f64::max);
    let on = |p: &Vector| p[0] == 0.0 || p[0] == 1.0 || p[1] == 0.0 || p[1] == 1.0 || p[2] == 0.0 || p[2] == height;
    (0..).zip(mesh.points()).filter(|(_, p)| on(p)).map(|(v, _)| v).collect()
}

struct Places<'a>(&'a Mesh, &'a [u32], Warp);
impl BoundaryMotion for Places<'_> {
    type Error = Infallible;
    fn at(&mut self, _: f64, to: f64, _: &[Vector]) -> Result<Vec<Vector>, Infallible> {
        Ok(self.2.places(self.0.points(), self.1, to))
    }
}

fn direct(name: &str, mesh: &Mesh, warp: Warp) {
    let boundary = on_boundary(mesh);
    let places = warp.places(mesh.points(), &boundary, 1.0);
    let now = Instant::now();
    let operator = VolumeOperator::new(mesh, &boundary, &Deform { tolerance: 1e-3, ..Deform::default() }).unwrap();
    let motion: Vec<Vector> = boundary.iter().zip(&places).map(|(&v, p)| std::array::from_fn(|a| p[a] - mesh.points()[v as usize][a])).collect();
    let solution = operator.solve(&motion).unwrap();
    let mut points: Vec<Vector> = mesh.points().iter().zip(&solution.displacement).map(|(a, b)| std::array::from_fn(|i| a[i] + b[i])).collect();
    for (&v, p) in boundary.iter().zip(&places) { points[v as usize] = *p; }
    let start = std::env::var("START").unwrap_or_default();
    let mut fixed = vec![false; points.len()];
    for &v in &boundary { fixed[v as usize] = true; }
    for (v, p) in points.iter_mut().enumerate() { if !fixed[v] {
        if start == "centre" { *p = [0.5, 0.5, 0.5]; }
        if start == "reference" { *p = mesh.points()[v]; }
        if start == "random" { *p = Warp::Shake { amount: 0.5, seed: 5 }.place([0.5, 0.5, 0.5], v as u32, 1.0, 1.0); }
    } }
    let before = quality(mesh.cells(), &points);
    let linear = now.elapsed().as_secs_f64();
    let now = Instant::now();
    let done = Untangler::new(mesh, &boundary).untangle(mesh, &mut points, 0.0);
    let after = quality(mesh.cells(), &points);
    eprintln!("direct {name:20} {:7} cells: inverted {:6} -> {:6} min {:.4} {done} linear {linear:.2} s, untangle {:.2} s", mesh.cells().len(), before.inverted, after.inverted, after.min, now.elapsed().as_secs_f64());
}

fn way(name: &str, mesh: &Mesh, warp: Warp) {
    let boundary = on_boundary(mesh);
    let partition = whole();
    let start: Arc<[Vector]> = mesh.points().into();
    let untangler = Arc::new(Untangler::new(mesh, &boundary));
    let untangler = || Arc::clone(&untangler);
    let domain = Domain { mesh, boundary: &boundary, partition: &partition, operator: None };
    let guard = Guard { min_scaled_jacobian: 0.0, ..Guard::default() };
    let now = Instant::now();
    let result = follow(domain, &start, &mut Places(mesh, &boundary, warp), &Deform::default(), &guard, Some(&untangler));
    let text = match &result {
        Ok(route) => format!("ok {} shapes, {} untangled, {} rejected", route.waypoints.len(), route.untangled, route.rejected),
        Err(FollowError::Stalled(s)) => format!("stalled {:.4} {} shapes, {} untangled, {} rejected, end {}, {:?}", s.fraction(), s.route.waypoints.len(), s.route.untangled, s.route.rejected, s.end_is_valid, s.impossible.map(|i| i.to_string())),
        Err(e) => format!("{e}"),
    };
    eprintln!("way    {name:20} {:7} cells: {text} {:.2} s", mesh.cells().len(), now.elapsed().as_secs_f64());
}

fn cases(size: usize) -> Vec<(String, Mesh, Warp)> {
    let column = |h: usize| { let n = (size as f64 / 6.0 / h as f64).cbrt().round().max(2.0) as usize; shapes::box_of_tets([n, n, n * h], [0.0; 3], [1.0, 1.0, h as f64]) };
    let mut all = Vec::new();
    for d in [90.0, 180.0, 360.0, 540.0] { all.push((format!("twist {d}"), column(2), Warp::Twist { degrees: d })); }
    for d in [180.0, 300.0] { all.push((format!("bend {d}"), column(6), Warp::Bend { degrees: d })); }
    for d in [0.1, 0.3, 3.0, 10.0] { all.push((format!("bulge {d}"), column(2), Warp::Bulge { factor: d })); }
    all.push(("knot".into(), column(24), Warp::Knot));
    for (d, s) in [(0.1, 1), (0.2, 2), (0.3, 3), (0.4, 4)] { all.push((format!("wobble {d}"), column(2), Warp::Wobble { amount: d, seed: s })); }
    for (d, s) in [(0.2, 1), (0.4, 2), (0.6, 3)] { let m = column(1); let n = (m.cells().len() as f64 / 6.0).cbrt(); all.push((format!("shake {d}"), m, Warp::Shake { amount: d / n, seed: s })); }
    all
}

#[test]
#[ignore = "figures"]
fn figures() {
    let size: usize = std::env::var("SIZE").map_or(1000, |s| s.parse().unwrap());
    let only = std::env::var("ONLY").unwrap_or_default();
    let mode = std::env::var("MODE").unwrap_or("both".into());
    for (name, mesh, warp) in cases(size) {
        if !name.contains(&only) { continue; }
        let boundary: Vec<u32> = (0..mesh.points().len() as u32).collect();
        let whole = warp.places(mesh.points(), &boundary, 1.0);
        let q = quality(mesh.cells(), &whole);
        eprintln!("       {name} mapped whole: {} inverted, least {:.4}", q.inverted, q.min);
        if mode != "way" { direct(&name, &mesh, warp); }
        if mode != "direct" { way(&name, &mesh, warp); }
    }
}

/// A box with vertices pushed together, so that the least scaled Jacobian of the reference is `least` or a little less.
fn slivers(counts: [usize; 3], least: f64, seed: u64) -> Mesh {
    let mesh = shapes::box_of_tets(counts, [0.0; 3], [1.0; 3]);
    let mut points = mesh.points().to_vec();
    let h = 1.0 / counts[0] as f64;
    let inside = |p: &Vector| p.iter().all(|&x| x > 0.0 && x < 1.0);
    for (vertex, point) in (0u32..).zip(&mut points) {
        if !inside(point) { continue; }
        let whole = *point;
        let mut amount = 0.9;
        let wild = Warp::Shake { amount: h, seed }.place(whole, vertex, 1.0, 1.0);
        // As far as the cells about it allow.
        let about: Vec<usize> = (0..mesh.cells().len()).filter(|&c| mesh.cells().vertices(c).contains(&vertex)).collect();
        let _ = about;
        if (vertex as u64 * 7 + seed) % 5 != 0 { amount = 0.1; }
        *point = std::array::from_fn(|a| whole[a] + amount * (wild[a] - whole[a]));
    }
    // Back towards the box as far as it takes.
    let (mut low, mut high) = (0.0, 1.0);
    let at = |t: f64| -> Vec<Vector> { mesh.points().iter().zip(&points).map(|(a, b)| std::array::from_fn(|i| a[i] + t * (b[i] - a[i]))).collect() };
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if quality(mesh.cells(), &at(middle)).min > least { low = middle } else { high = middle }
    }
    mesh.with_points(at(low)).unwrap()
}

#[test]
fn a_mesh_with_slivers_is_followed_or_told_how_far() {
    let partition = whole();
    let (mut done, mut stalled) = (0, 0);
    for seed in 0..100u64 {
        let least = 0.001 * (1.0 + (seed % 10) as f64);
        let mesh = slivers([5, 5, 5], least, seed);
        assert!(quality(mesh.cells(), mesh.points()).min < 1.1 * least);
        let boundary = on_boundary(&mesh);
        let start: Arc<[Vector]> = mesh.points().into();
        let untangler = Arc::new(Untangler::new(&mesh, &boundary));
        let untangler = || Arc::clone(&untangler);
        let domain = Domain { mesh: &mesh, boundary: &boundary, partition: &partition, operator: None };
        let warp = match seed % 4 { 0 => Warp::Twist { degrees: 120.0 }, 1 => Warp::Bend { degrees: 90.0 }, 2 => Warp::Bulge { factor: 1.6 }, _ => Warp::Wobble { amount: 0.12, seed } };
        match follow(domain, &start, &mut Places(&mesh, &boundary, warp), &Deform::default(), &Guard::default(), Some(&untangler)) {
            Ok(_) => done += 1,
            Err(FollowError::Stalled(s)) => { eprintln!("{seed} {warp:?} {} {:?} {}", s.fraction(), s.impossible, s.refusal); stalled += 1 }
            Err(error) => panic!("{seed}: {error}"),
        }
    }
    eprintln!("done {done}, stalled {stalled}");
}
