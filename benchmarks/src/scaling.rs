//! Meshes in parts: what it takes to find their surface and to move their volume, and what goes
//! from rank to rank for it.
//!
//! The ranks are threads of this process, so that the bytes and messages are those of MPI, and the
//! seconds those of as many cores as there are.

use std::sync::Arc;

use serde::Serialize;
use tombolo::{
    communicator::{Communicator, Counted, Traffic, threads},
    deform::{
        distributed::{Part, PartBoundary, domain},
        features::FeatureSettings,
        mesh::{Mesh, Vector},
        shapes::box_of_tets,
        volume::{Deform, VolumeOperator},
    },
};

use crate::measure::Times;
use crate::report::{Line, Report, Target};

/// Cubes along each edge of the box, each of six tetrahedra: the last is the size of the paper's
/// mesh.
const SIZES: [usize; 4] = [15, 30, 45, 60];
/// How the box is dealt out: ranks along each axis.
const RANKS: [[usize; 3]; 4] = [[1, 1, 1], [2, 1, 1], [2, 2, 1], [2, 2, 2]];
const RUNS: usize = 5;

/// One mesh on a number of ranks.
#[derive(Serialize)]
pub struct Row {
    tets: usize,
    ranks: usize,
    /// Vertices of the surface.
    surface: usize,
    /// Vertices that the rank with the most of them shares.
    shared: usize,
    /// Until rank 0 has the surface: the median.
    seconds: f64,
    /// The bytes that the busiest of the other ranks sent and heard for it, and rank 0.
    find: [Traffic; 2],
    /// The bytes that they sent and heard for handing out a displacement of the surface.
    scatter: [Traffic; 2],
    /// The bytes that they sent and heard for bringing the coordinates of the surface to rank 0.
    gather: [Traffic; 2],
    /// The bytes that they sent and heard for setting the volume's elasticity up, and of one solve.
    set_up: [Traffic; 2],
    solve: [Traffic; 2],
    /// The iterations of the solve.
    iterations: usize,
}

pub fn run() -> Result<Report<Row>, Box<dyn std::error::Error>> {
    let mut rows = Vec::new();
    for size in SIZES {
        let mesh = box_of_tets([size; 3], [0.0; 3], [1.0; 3]);
        for along in RANKS {
            rows.push(measured(&mesh, along)?);
        }
    }
    let seconds = |ranks: usize| {
        rows.iter().rev().find(|row| row.ranks == ranks).map_or(f64::NAN, |row| row.seconds)
    };
    let targets =
        vec![Target::at_most("surface of 1.29 M tets on 2 ranks, seconds", seconds(2), 0.150)];
    Ok(Report { rows, targets })
}

struct Measured {
    times: Times,
    surface: usize,
    shared: usize,
    traffic: [Traffic; 5],
    iterations: usize,
}

fn measured(mesh: &Mesh, along: [usize; 3]) -> Result<Row, Box<dyn std::error::Error>> {
    let count = along.iter().product();
    let of_cells: Vec<usize> = mesh
        .cells()
        .iter()
        .map(|(_, vertices)| {
            let place = |axis: usize| {
                let sum: f64 =
                    vertices.iter().map(|&vertex| mesh.points()[vertex as usize][axis]).sum();
                ((sum / vertices.len() as f64 * along[axis] as f64) as usize).min(along[axis] - 1)
            };
            place(0) + along[0] * (place(1) + along[1] * place(2))
        })
        .collect();
    let parts: Vec<Part> =
        (0..count).map(|rank| Part::cut(mesh, &of_cells, rank, false)).collect::<Result<_, _>>()?;
    let outcomes = threads::run(count, |ranks| {
        let counted = Arc::new(Counted::new(ranks));
        let ranks: Arc<dyn Communicator> = counted.clone();
        let part = &parts[ranks.rank()];
        let mut times = Times::new();
        let mut last = None;
        for _ in 0..RUNS {
            ranks.barrier();
            let before = counted.traffic();
            let found =
                times.of(|| PartBoundary::find(&ranks, part, &FeatureSettings::default()))?;
            last = Some((found, counted.traffic() - before));
        }
        let Some(((shared, boundary), find)) = last else { return Ok(None) };
        let before = counted.traffic();
        let displacement = boundary.surface().map(|surface| vec![[0.0; 3]; surface.points().len()]);
        boundary.scatter(&*ranks, displacement.as_deref())?;
        let scatter = counted.traffic() - before;
        let before = counted.traffic();
        let places = boundary.gather(&*ranks, &part.points)?;
        let gather = counted.traffic() - before;
        let surface = places.map_or(0, |places| places.len());
        let shares = shared.halo().shared().len();
        let (domain, boundary) = domain(&ranks, part, &FeatureSettings::default())?;
        let before = counted.traffic();
        let operator = VolumeOperator::new(&domain, boundary.vertices(), &Deform::default())?;
        let set_up = counted.traffic() - before;
        let wave = |[x, y, z]: Vector| {
            [0.02 * (9.0 * y).sin(), 0.02 * (8.0 * z).sin(), 0.02 * (7.0 * x).sin()]
        };
        let motion: Vec<Vector> =
            boundary.vertices().iter().map(|&vertex| wave(part.points[vertex as usize])).collect();
        let before = counted.traffic();
        let iterations = operator.solve(&motion)?.iterations;
        let traffic = [find, scatter, gather, set_up, counted.traffic() - before];
        Ok::<_, Box<dyn std::error::Error + Send + Sync>>(Some(Measured {
            times,
            surface,
            shared: shares,
            traffic,
            iterations,
        }))
    });
    let outcomes =
        outcomes.into_iter().collect::<Result<Vec<_>, _>>().map_err(|error| error.to_string())?;
    let outcomes: Vec<Measured> = outcomes.into_iter().flatten().collect();
    let traffic = |part: usize| {
        let of = |measured: &Measured| measured.traffic[part];
        let others = outcomes[1..]
            .iter()
            .map(of)
            .max_by_key(|traffic| traffic.bytes_sent + traffic.bytes_heard);
        [others.unwrap_or_default(), of(&outcomes[0])]
    };
    Ok(Row {
        tets: mesh.cells().len(),
        ranks: count,
        surface: outcomes[0].surface,
        shared: outcomes.iter().map(|measured| measured.shared).max().unwrap_or_default(),
        // Rank 0 has the surface last.
        seconds: outcomes[0].times.median(),
        find: traffic(0),
        scatter: traffic(1),
        gather: traffic(2),
        set_up: traffic(3),
        solve: traffic(4),
        iterations: outcomes[0].iterations,
    })
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] = &[
        "tets",
        "ranks",
        "surface",
        "shared",
        "seconds",
        "find: a rank",
        "find: rank 0",
        "scatter: rank 0",
        "gather: rank 0",
        "set-up: a rank",
        "solve: a rank",
        "iterations",
    ];

    fn cells(&self) -> Vec<String> {
        let said = |traffic: &Traffic| {
            let (bytes, messages) = (
                traffic.bytes_sent + traffic.bytes_heard,
                traffic.messages_sent + traffic.messages_heard,
            );
            format!("{bytes} B / {messages}")
        };
        let Self { find, scatter, gather, set_up, solve, .. } = self;
        let traffic =
            [&find[0], &find[1], &scatter[1], &gather[1], &set_up[0], &solve[0]].map(said);
        let counts =
            [self.tets, self.ranks, self.surface, self.shared].map(|count| count.to_string());
        let seconds = format!("{:.4}", self.seconds);
        counts
            .into_iter()
            .chain([seconds])
            .chain(traffic)
            .chain([self.iterations.to_string()])
            .collect()
    }
}
