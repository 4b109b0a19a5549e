//! Meshes in parts: what it takes to find their surface and to move their volume, and what goes from rank to rank for it.
//!
//! The ranks are threads of this process, so that the bytes and messages are those of MPI, and the seconds those of as many cores
//! as there are.

use std::{fmt, sync::Arc, time::Instant};

use serde::Serialize;
use tombolo::{
    comm::{Communicator, Counted, Traffic, threads},
    deform::{
        mesh::{FeatureSource, Mesh, Vector},
        partition::Partition,
        shapes::box_of_tets,
        surface::FeatureSettings,
        volume::{Deform, VolumeOperator},
    },
    pipelines::distributed::{Part, PartBoundary, Ranks},
};

use crate::report::Target;

/// Cubes along each edge of the box, each of six tetrahedra: the last is the size of the paper's mesh.
const SIZES: [usize; 4] = [15, 30, 45, 60];
/// How the box is dealt out: ranks along each axis.
const RANKS: [[usize; 3]; 4] = [[1, 1, 1], [2, 1, 1], [2, 2, 1], [2, 2, 2]];
const RUNS: usize = 5;

#[derive(Serialize)]
pub struct Scaling {
    rows: Vec<Row>,
    targets: Vec<Target>,
}

/// One mesh on a number of ranks.
#[derive(Serialize)]
struct Row {
    tets: usize,
    ranks: usize,
    /// Vertices of the surface.
    surface: usize,
    /// Vertices that the rank with the most of them shares.
    shared: usize,
    /// Until rank 0 has the surface: the median.
    seconds: f64,
    /// What the busiest of the other ranks sent and heard for it, and rank 0.
    find: [Traffic; 2],
    /// The same of handing out a displacement of the surface.
    scatter: [Traffic; 2],
    /// The same of bringing the coordinates of the surface to rank 0.
    gather: [Traffic; 2],
    /// The same of setting the volume's elasticity up, and of one solve.
    set_up: [Traffic; 2],
    solve: [Traffic; 2],
    /// The iterations of the solve.
    iterations: usize,
}

pub fn run() -> Result<Scaling, Box<dyn std::error::Error>> {
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
    Ok(Scaling { rows, targets })
}

struct Measured {
    seconds: Vec<f64>,
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
        let ranks = Arc::new(Counted::new(ranks));
        let part = &parts[ranks.rank()];
        let mut seconds = Vec::new();
        let mut last = None;
        for _ in 0..RUNS {
            ranks.barrier();
            let (begun, before) = (Instant::now(), ranks.traffic());
            let found = PartBoundary::find(&*ranks, part, &FeatureSettings::default())?;
            seconds.push(begun.elapsed().as_secs_f64());
            last = Some((found, ranks.traffic() - before));
        }
        let Some(((shared, boundary), find)) = last else { return Ok(None) };
        let before = ranks.traffic();
        let displacement = boundary.surface().map(|surface| vec![[0.0; 3]; surface.points().len()]);
        boundary.scatter(&*ranks, displacement.as_deref())?;
        let scatter = ranks.traffic() - before;
        let before = ranks.traffic();
        let places = boundary.gather(&*ranks, &part.points)?;
        let gather = ranks.traffic() - before;
        let surface = places.map_or(0, |places| places.len());
        let shares = shared.shared().count();
        let communicator: Arc<dyn Communicator> = Arc::<Counted<threads::Threads>>::clone(&ranks);
        let partition: Arc<dyn Partition> =
            Arc::new(Ranks::new(communicator, Arc::new(shared), &boundary, Vec::new()));
        let own = Mesh::new(part.points.clone(), part.cells.clone(), FeatureSource::SharpEdges)?;
        let before = ranks.traffic();
        let operator = VolumeOperator::of_part(
            &own,
            boundary.vertices(),
            &[],
            &Deform::default(),
            &partition,
        )?;
        let set_up = ranks.traffic() - before;
        let wave = |[x, y, z]: Vector| {
            [0.02 * (9.0 * y).sin(), 0.02 * (8.0 * z).sin(), 0.02 * (7.0 * x).sin()]
        };
        let motion: Vec<Vector> =
            boundary.vertices().iter().map(|&vertex| wave(part.points[vertex as usize])).collect();
        let before = ranks.traffic();
        let iterations = operator.solve(&motion)?.iterations;
        let traffic = [find, scatter, gather, set_up, ranks.traffic() - before];
        Ok::<_, Box<dyn std::error::Error + Send + Sync>>(Some(Measured {
            seconds,
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
    // Rank 0 has the surface last.
    let mut seconds = outcomes[0].seconds.clone();
    seconds.sort_by(f64::total_cmp);
    Ok(Row {
        tets: mesh.cells().len(),
        ranks: count,
        surface: outcomes[0].surface,
        shared: outcomes.iter().map(|measured| measured.shared).max().unwrap_or_default(),
        seconds: seconds[RUNS / 2],
        find: traffic(0),
        scatter: traffic(1),
        gather: traffic(2),
        set_up: traffic(3),
        solve: traffic(4),
        iterations: outcomes[0].iterations,
    })
}

impl Scaling {
    /// As one line of JSON.
    pub fn json(&self) -> String {
        serde_json::to_string(self).unwrap_or_else(|error| format!("{{\"error\": \"{error}\"}}"))
    }
}

impl fmt::Display for Scaling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:>9} {:>5} {:>8} {:>7} {:>9}   {:>22} {:>22} {:>22} {:>22} {:>22} {:>22} {:>10}",
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
            "iterations"
        )?;
        let said = |traffic: &Traffic| {
            let (bytes, messages) = (
                traffic.bytes_sent + traffic.bytes_heard,
                traffic.messages_sent + traffic.messages_heard,
            );
            format!("{bytes} B / {messages}")
        };
        for row in &self.rows {
            writeln!(
                f,
                "{:>9} {:>5} {:>8} {:>7} {:>9.4}   {:>22} {:>22} {:>22} {:>22} {:>22} {:>22} {:>10}",
                row.tets,
                row.ranks,
                row.surface,
                row.shared,
                row.seconds,
                said(&row.find[0]),
                said(&row.find[1]),
                said(&row.scatter[1]),
                said(&row.gather[1]),
                said(&row.set_up[0]),
                said(&row.solve[0]),
                row.iterations
            )?;
        }
        for target in &self.targets {
            let verdict = if target.holds { "holds" } else { "does not hold" };
            writeln!(
                f,
                "\n{}: {:.4}, at most {}: {verdict}",
                target.name, target.value, target.target
            )?;
        }
        Ok(())
    }
}
