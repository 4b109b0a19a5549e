//! `untangle`: boundaries that the inside of a mesh cannot follow in a straight line, at several
//! sizes and with several types of cells.

use std::convert::Infallible;
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;
use tombolo::deform::bounds::Bounds;
use tombolo::deform::cancellation::Cancellation;
use tombolo::deform::features::FeatureSettings;
use tombolo::deform::linear::BuiltIn;
use tombolo::deform::mesh::{Cells, Domain, FeatureSource, Mesh, Vector};
use tombolo::deform::quality::{Guard, quality};
use tombolo::deform::shapes::{box_of_hexahedra, box_of_mixed_cells, box_of_tets};
use tombolo::deform::surface::Surface;
use tombolo::deform::volume::{BoundaryMotion, Deform, FollowError, Untangler, Volume, follow};
use tombolo::deform::warps::Warp;
use tombolo::pipelines::files::read_mesh;

use crate::peer::mesh_file;
use crate::report::{Line, Report};

/// How many cells the boxes have, about.
const SIZES: [usize; 4] = [1_000, 10_000, 100_000, 200_000];

/// One boundary of one mesh.
#[derive(Debug, Serialize)]
pub struct Row {
    mesh: &'static str,
    cells: usize,
    warp: String,
    outcome: Outcome,
    /// How much of the way was gone.
    fraction: f64,
    /// The least scaled Jacobian there.
    least: f64,
    shapes: usize,
    untangled: usize,
    seconds: f64,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "snake_case")]
enum Outcome {
    /// No cell is inverted with the boundary in its place.
    Reached,
    /// It is proved that no motion of the inside does that.
    Impossible,
    /// A valid mesh was found, and no way to it.
    NoWay,
    /// Neither.
    NotFound,
}

/// Boxes of tetrahedra of all sizes, boxes of other cells, and a vessel: some minutes.
pub fn run() -> Result<Report<Row>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for size in SIZES {
        for (height, warp) in problems() {
            let mesh = shuffled(&box_of_tets(
                counts(size, 6, height),
                [0.0; 3],
                [1.0, 1.0, f64::from(height)],
            ))?;
            rows.push(row("tetrahedra", &mesh, warp)?);
        }
    }
    for (height, warp) in problems() {
        let upper = [1.0, 1.0, f64::from(height)];
        let mesh = shuffled(&box_of_hexahedra(counts(5_000, 1, height), [0.0; 3], upper))?;
        rows.push(row("hexahedra", &mesh, warp)?);
        let mesh = shuffled(&box_of_mixed_cells(counts(5_000, 3, height), [0.0; 3], upper))?;
        rows.push(row("hexahedra, prisms, pyramids", &mesh, warp)?);
    }
    let vessel = upright(&read_mesh(&mesh_file("bypass-0")?)?.mesh)?;
    for warp in [
        Warp::Twist { degrees: 180.0 },
        Warp::Bend { degrees: 180.0 },
        Warp::Bulge { factor: 3.0 },
        Warp::Wobble { amount: 0.1, seed: 1 },
    ] {
        rows.push(row("vessel (bypass-0)", &vessel, warp)?);
    }
    Ok(Report { rows, targets: Vec::new() })
}

fn problems() -> Vec<(u32, Warp)> {
    let mut all = vec![
        (2, Warp::Twist { degrees: 360.0 }),
        (2, Warp::Twist { degrees: 540.0 }),
        (6, Warp::Bend { degrees: 300.0 }),
        (2, Warp::Bulge { factor: 10.0 }),
        (2, Warp::Bulge { factor: 0.1 }),
        (24, Warp::Knot),
    ];
    all.extend([0.1, 0.2, 0.3].map(|amount| (2, Warp::Wobble { amount, seed: 3 })));
    all
}

fn counts(cells: usize, per_cube: usize, height: u32) -> [usize; 3] {
    let across =
        (cells as f64 / per_cube as f64 / f64::from(height)).cbrt().round().max(2.0) as usize;
    [across, across, across * height as usize]
}

/// A mesh whose vertices and cells are numbered at random.
fn shuffled(mesh: &Mesh) -> Result<Mesh, Box<dyn Error>> {
    let mut state = 1u64;
    let mut order = |count: usize| {
        let mut order: Vec<usize> = (0..count).collect();
        for last in (1..count).rev() {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            order.swap(last, ((state >> 33) % (last as u64 + 1)) as usize);
        }
        order
    };
    let vertices = order(mesh.points().len());
    let mut new = vec![0u32; vertices.len()];
    for (number, &vertex) in (0..).zip(&vertices) {
        new[vertex] = number;
    }
    let mut cells = Cells::new();
    for cell in order(mesh.cells().len()) {
        let renumbered: Vec<u32> =
            mesh.cells().vertices(cell).iter().map(|&vertex| new[vertex as usize]).collect();
        cells.push(mesh.cells().cell_type(cell), &renumbered)?;
    }
    let points = vertices.iter().map(|&vertex| mesh.points()[vertex]).collect();
    Ok(Mesh::new(points, cells, FeatureSource::SharpEdges)?)
}

/// A mesh turned so that it is longest along z, and scaled into the box over the unit square.
fn upright(mesh: &Mesh) -> Result<Mesh, Box<dyn Error>> {
    let bounds = Bounds::around(mesh.points().iter().copied());
    let (lower, extent) = (bounds.lower, bounds.extent());
    let longest = bounds.longest_axis();
    let axes = [(longest + 1) % 3, (longest + 2) % 3, longest];
    let scale = 1.0 / extent[axes[0]].max(extent[axes[1]]);
    let place = |point: &Vector| axes.map(|axis| scale * (point[axis] - lower[axis]));
    Ok(mesh.with_points(mesh.points().iter().map(place).collect())?)
}

/// The boundary of a mesh on its way along a warp.
struct Warped<'a> {
    points: &'a [Vector],
    boundary: &'a [u32],
    warp: Warp,
}

impl BoundaryMotion for Warped<'_> {
    type Error = Infallible;

    fn at(&mut self, _: f64, to: f64, _: &[Vector]) -> Result<Vec<Vector>, Infallible> {
        Ok(self.warp.positions(self.points, self.boundary, to))
    }
}

fn row(name: &'static str, mesh: &Mesh, warp: Warp) -> Result<Row, Box<dyn Error>> {
    let surface = Surface::extract(mesh, &FeatureSettings::default())?;
    let boundary = surface.vertices();
    let (domain, start) = (Domain::from(mesh), Arc::<[Vector]>::from(mesh.points()));
    let guard = Guard { min_scaled_jacobian: 0.0, ..Guard::default() };
    let (solvers, wanted) = (&BuiltIn, Cancellation::default());
    let volume =
        Volume { domain: &domain, boundary, solvers, operator: None, cancellation: &wanted };
    let mut motion = Warped { points: mesh.points(), boundary, warp };
    let now = Instant::now();
    let untangler = || Arc::new(Untangler::new(mesh, boundary));
    let known = std::cell::OnceCell::new();
    let untangler = || Arc::clone(known.get_or_init(untangler));
    let result = follow(volume, &start, &mut motion, &Deform::default(), &guard, Some(&untangler));
    let seconds = now.elapsed().as_secs_f64();
    let (route, outcome) = match result {
        Ok(route) => (route, Outcome::Reached),
        Err(FollowError::Stalled(stalled)) => {
            let outcome = match (stalled.impossible, stalled.end_is_valid) {
                (Some(_), _) => Outcome::Impossible,
                (None, true) => Outcome::NoWay,
                (None, false) => Outcome::NotFound,
            };
            (stalled.route, outcome)
        }
        Err(error) => return Err(error.to_string().into()),
    };
    let last = route.waypoints.last();
    let least = quality(mesh.cells(), last.map_or(mesh.points(), |last| &last.points)).min;
    Ok(Row {
        mesh: name,
        cells: mesh.cells().len(),
        warp: format!("{warp:?}"),
        outcome,
        fraction: last.map_or(0.0, |last| last.fraction),
        least,
        shapes: route.waypoints.len(),
        untangled: route.untangled,
        seconds,
    })
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] =
        &["mesh", "cells", "boundary", "outcome", "part", "least", "shapes", "seconds"];

    fn cells(&self) -> Vec<String> {
        let outcome = match self.outcome {
            Outcome::Reached => "reached",
            Outcome::Impossible => "proved impossible",
            Outcome::NoWay => "valid end, no way",
            Outcome::NotFound => "not found",
        };
        vec![
            self.mesh.into(),
            self.cells.to_string(),
            self.warp.clone(),
            outcome.into(),
            format!("{:.3}", self.fraction),
            format!("{:.4}", self.least),
            self.shapes.to_string(),
            format!("{:.2}", self.seconds),
        ]
    }
}
