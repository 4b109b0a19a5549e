//! Boundaries that the inside cannot follow in a straight line.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Instant;

use tombolo_deform::cancellation::Cancellation;
use tombolo_deform::linear::BuiltIn;
use tombolo_deform::mesh::Domain;
use tombolo_deform::mesh::{Mesh, Vector};
use tombolo_deform::quality::{Guard, keeps, quality};
use tombolo_deform::shapes;
use tombolo_deform::volume::{
    BoundaryMotion, Deform, FollowError, Route, Stalled, Untangler, Volume, follow,
};
use tombolo_deform::warps::Warp;

fn boundary(mesh: &Mesh) -> Vec<u32> {
    let height = mesh.points().iter().map(|p| p[2]).fold(0.0, f64::max);
    let on =
        |p: &Vector| p[..2].iter().any(|&x| x == 0.0 || x == 1.0) || p[2] == 0.0 || p[2] == height;
    (0..).zip(mesh.points()).filter(|(_, p)| on(p)).map(|(v, _)| v).collect()
}

/// The boundary of a mesh on its way along a warp.
struct Warped<'a> {
    mesh: &'a Mesh,
    boundary: &'a [u32],
    warp: Warp,
    /// Whether shapes whose boundary is elsewhere may be handed out.
    free: bool,
}

impl BoundaryMotion for Warped<'_> {
    type Error = Infallible;

    fn at(&mut self, _: f64, to: f64, _: &[Vector]) -> Result<Vec<Vector>, Infallible> {
        Ok(self.warp.positions(self.mesh.points(), self.boundary, to))
    }

    fn is_sound(&self, _: &[Vector]) -> bool {
        self.free
    }
}

/// Follows a warp. Whatever comes of it, every straight piece of the way is valid and the boundary
/// of its end is as stated.
fn followed(mesh: &Mesh, warp: Warp, guard: &Guard) -> Result<Route, Box<Stalled>> {
    followed_if(mesh, warp, guard, true)
}

/// Follows a warp where shapes whose boundary is not where the warp has it may be handed out, or
/// not.
fn followed_if(mesh: &Mesh, warp: Warp, guard: &Guard, free: bool) -> Result<Route, Box<Stalled>> {
    let boundary = boundary(mesh);
    let domain = Domain::from(mesh);
    let start: Arc<[Vector]> = mesh.points().into();
    let untangler = Arc::new(Untangler::new(mesh, &boundary));
    let untangler = || Arc::clone(&untangler);
    let wanted = Cancellation::default();
    let volume = Volume {
        domain: &domain,
        boundary: &boundary,
        solvers: &BuiltIn,
        operator: None,
        cancellation: &wanted,
    };
    let mut motion = Warped { mesh, boundary: &boundary, warp, free };
    let result = follow(volume, &start, &mut motion, &Deform::default(), guard, Some(&untangler));
    let result = result.map_err(|error| match error {
        FollowError::Stalled(stalled) => stalled,
        error => panic!("{warp:?}: {error}"),
    });
    let route = result.as_ref().unwrap_or_else(|stalled| &stalled.route);
    let (mut before, mut fraction) = (&start, 0.0);
    for waypoint in &route.waypoints {
        assert!(
            keeps(mesh, before, &waypoint.points, guard),
            "{warp:?}: from {fraction} to {}",
            waypoint.fraction
        );
        assert!(waypoint.fraction > fraction && waypoint.fraction <= 1.0);
        (before, fraction) = (&waypoint.points, waypoint.fraction);
    }
    assert_eq!(quality(mesh.cells(), before).inverted, 0);
    for (&vertex, position) in
        boundary.iter().zip(warp.positions(mesh.points(), &boundary, fraction))
    {
        assert_eq!(before[vertex as usize], position, "{warp:?}");
    }
    if result.is_ok() {
        assert_eq!(fraction, 1.0);
    }
    result
}

fn column(size: usize, height: usize) -> Mesh {
    let across = (size as f64 / 6.0 / height as f64).cbrt().round().max(2.0) as usize;
    shapes::box_of_tets([across, across, across * height], [0.0; 3], [1.0, 1.0, height as f64])
}

/// Problems of about as many cells, and whether there is a valid mesh at the end.
fn problems(size: usize) -> Vec<(Mesh, Warp, bool)> {
    let mut all = Vec::new();
    for degrees in [180.0, 360.0, 540.0] {
        all.push((column(size, 2), Warp::Twist { degrees }, true));
    }
    for degrees in [180.0, 300.0] {
        all.push((column(size, 6), Warp::Bend { degrees }, true));
    }
    for factor in [0.1, 3.0, 10.0] {
        all.push((column(size, 2), Warp::Bulge { factor }, true));
    }
    all.push((column(size, 24), Warp::Knot, true));
    for (amount, valid) in [(0.1, true), (0.2, false), (0.3, false)] {
        all.push((column(size, 2), Warp::Wobble { amount, seed: (amount * 10.0) as u64 }, valid));
    }
    for (cells, valid) in [(0.2, true), (0.4, false), (0.6, false)] {
        let mesh = column(size, 1);
        let amount = cells / (mesh.cells().len() as f64 / 6.0).cbrt();
        all.push((mesh, Warp::Shake { amount, seed: (cells * 5.0) as u64 }, valid));
    }
    all
}

const GUARD: f64 = 0.0;

/// Each problem ends with a valid mesh, or with the proof that there is none and the part of the
/// way that there is one for.
#[test]
fn every_problem_is_solved_or_proved_to_have_no_solution() {
    for (mesh, warp, valid) in problems(1000) {
        match followed(&mesh, warp, &Guard { min_scaled_jacobian: GUARD, ..Guard::default() }) {
            Ok(_) => assert!(valid, "{warp:?}"),
            Err(stalled) => {
                assert!(
                    !valid && stalled.impossible.is_some(),
                    "{warp:?}: {} {:?}",
                    stalled.fraction(),
                    stalled.impossible
                );
                assert!(stalled.fraction() > 0.2, "{warp:?}: {}", stalled.fraction());
            }
        }
    }
}

/// Cells other than tetrahedra, which are untangled by the tetrahedra at their corners.
#[test]
fn hexahedra_wedges_and_pyramids_are_followed_too() {
    let upper = [1.0, 1.0, 2.0];
    for mesh in [
        shapes::box_of_hexahedra([4, 4, 8], [0.0; 3], upper),
        shapes::box_of_mixed_cells([4, 4, 8], [0.0; 3], upper),
    ] {
        for warp in [Warp::Twist { degrees: 270.0 }, Warp::Bulge { factor: 3.0 }] {
            followed(&mesh, warp, &Guard { min_scaled_jacobian: 0.0, ..Guard::default() }).unwrap();
        }
    }
}

/// A way on which the boundary goes elsewhere is none where the surface would be broken on it: the
/// order stalls, its end being valid.
#[test]
fn a_way_over_broken_surfaces_is_not_gone() {
    let mesh = column(1000, 24);
    let guard = Guard { min_scaled_jacobian: 0.0, ..Guard::default() };
    let stalled = followed_if(&mesh, Warp::Knot, &guard, false).unwrap_err();
    assert!(stalled.end_is_valid && stalled.impossible.is_none());
    assert!((0.2..0.6).contains(&stalled.fraction()), "{}", stalled.fraction());
}

/// A knot of several thousand cells, whose straight way to it no mesh can go.
#[test]
fn a_knot_of_many_cells_is_reached() {
    let route = followed(
        &column(10_000, 24),
        Warp::Knot,
        &Guard { min_scaled_jacobian: 0.0, ..Guard::default() },
    );
    assert!(route.is_ok_and(|route| route.untangled > 0));
}

/// Prisms and hexahedra turned so far that some are broken inside while their corners are not.
#[test]
fn cells_are_made_valid_inside() {
    let mesh = shapes::box_of_mixed_cells([6, 6, 12], [0.0; 3], [1.0, 1.0, 2.0]);
    followed(
        &mesh,
        Warp::Twist { degrees: 600.0 },
        &Guard { min_scaled_jacobian: 0.0, ..Guard::default() },
    )
    .unwrap();
}

/// An order that is proved to be impossible costs little, and is followed nearly as far as there is
/// no proof.
#[test]
fn what_is_impossible_costs_a_few_solves() {
    let mesh = column(10_000, 2);
    let warp = Warp::Wobble { amount: 0.3, seed: 3 };
    let stalled =
        followed(&mesh, warp, &Guard { min_scaled_jacobian: 0.0, ..Guard::default() }).unwrap_err();
    assert!(stalled.impossible.is_some() && stalled.fraction() > 0.4, "{}", stalled.fraction());
    assert!(stalled.route.rejected < 15, "{}", stalled.route.rejected);
}

/// A box whose inside is shaken until the least scaled Jacobian is `least`.
fn slivers(least: f64, seed: u64) -> Mesh {
    let mesh = shapes::box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let inside = |p: &Vector| p.iter().all(|&x| x > 0.0 && x < 1.0);
    let shaken = |amount: f64| -> Vec<Vector> {
        let warp = Warp::Shake { amount, seed };
        let position = |(vertex, &point): (u32, &Vector)| {
            if inside(&point) { warp.position(point, vertex, 1.0, 1.0) } else { point }
        };
        (0..).zip(mesh.points()).map(position).collect()
    };
    let (mut low, mut high) = (0.0, 0.25);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if quality(mesh.cells(), &shaken(middle)).min > least {
            low = middle
        } else {
            high = middle
        }
    }
    mesh.with_points(shaken(low)).unwrap()
}

/// A hundred moves of meshes that are below the guard's floor to begin with, each `large` times a
/// moderate one: each is done, or proved to be impossible. Says how many are done.
fn a_hundred_moves(large: f64) -> usize {
    let mut done = 0;
    for seed in 0..100 {
        let least = 0.001 * (1.0 + (seed % 10) as f64);
        let mesh = slivers(least, seed);
        let amount = large * (1.0 + (seed % 7) as f64);
        let warp = match seed % 4 {
            0 => Warp::Twist { degrees: 18.0 * amount },
            1 => Warp::Bend { degrees: 12.0 * amount },
            2 => Warp::Bulge { factor: 1.0 + 0.1 * amount },
            _ => Warp::Wobble { amount: 0.01 * amount, seed },
        };
        match followed(&mesh, warp, &Guard::default()) {
            Ok(_) => done += 1,
            Err(stalled) => {
                assert!(stalled.impossible.is_some(), "{least} {warp:?} {}", stalled.fraction());
            }
        }
    }
    done
}

#[test]
fn moderate_moves_of_meshes_with_slivers_are_done_or_proved_impossible() {
    let done = a_hundred_moves(1.0);
    assert!(done >= 95, "{done} done");
}

#[test]
fn large_moves_of_meshes_with_slivers_are_done_or_proved_impossible() {
    let done = a_hundred_moves(4.0);
    assert!(done >= 60, "{done} done");
}

/// `SIZE=200000 cargo test --release -p tombolo-deform --test untangling -- --ignored --nocapture`
#[test]
#[ignore = "figures of larger meshes"]
fn figures() {
    let size = std::env::var("SIZE").map_or(10_000, |size| size.parse().unwrap());
    let only = std::env::var("ONLY").unwrap_or_default();
    for (mesh, warp, _) in problems(size) {
        if !format!("{warp:?}").contains(&only) {
            continue;
        }
        let now = Instant::now();
        let result =
            followed(&mesh, warp, &Guard { min_scaled_jacobian: GUARD, ..Guard::default() });
        let (route, proof) = match &result {
            Ok(route) => (route, String::from("reached")),
            Err(stalled) => (
                &stalled.route,
                format!(
                    "{:.3}, valid end: {}, {:?}",
                    stalled.fraction(),
                    stalled.end_is_valid,
                    stalled.impossible
                ),
            ),
        };
        let least =
            route.waypoints.last().map_or(f64::NAN, |last| quality(mesh.cells(), &last.points).min);
        println!(
            "{:7} cells {warp:?}: {proof}; {} shapes, {} untangled, least {least:.4}, {:.2} s",
            mesh.cells().len(),
            route.waypoints.len(),
            route.untangled,
            now.elapsed().as_secs_f64()
        );
    }
}
