//! `skeleton`: curve skeletons of tori and of the bypass beside those of CGAL, on the same
//! triangles.

use std::error::Error;
use std::time::Duration;

use tombolo::deform::features::FeatureSettings;
use tombolo::deform::skeleton::{Skeleton, SkeletonSettings};
use tombolo::deform::surface::Surface;
use tombolo::pipelines::files::read_mesh;
use tombolo_tests::{CurveGraph, generated_surfaces};

use crate::measure::Times;
use crate::report::{Report, Row, Target};
use crate::surface::torus;

/// Vertices of each torus, runs of CGAL on it, which takes a minute for the largest, and the
/// seconds that ours may take.
const SIZES: [(usize, &str, usize, Option<f64>); 3] =
    [(2_000, "2 k", 3, None), (20_000, "20 k", 3, Some(0.8)), (200_000, "200 k", 1, Some(5.0))];
/// Branches shorter than this part of the diagonal are taken off both: CGAL has other ones in each
/// run.
const SPUR: f64 = 0.03;
/// Runs of ours.
const RUNS: usize = 5;
/// CGAL loops for ever on some surfaces.
const LIMIT: Duration = Duration::from_secs(300);

/// Measures the tori and the bypass: two minutes or three, and once as much again to make the
/// meshes and to compile CGAL.
///
/// # Errors
/// The first error of a part; a peer that is missing, or that finds nothing in time, is an error.
///
/// # Panics
/// Where CGAL's program does not compile, or the mesh of the bypass cannot be made.
pub fn run() -> Result<Report, Box<dyn Error>> {
    let mut report = Report { rows: Vec::new(), targets: Vec::new() };
    for (count, name, peer_runs, most) in SIZES {
        compare(&mut report, &format!("torus, {name}"), &torus(count)?, peer_runs, most)?;
    }
    for file in generated_surfaces(&["bypass-0"]) {
        let surface = Surface::extract(&read_mesh(&file)?.mesh, &FeatureSettings::default())?;
        compare(&mut report, "bypass 0", &surface, 3, None)?;
    }
    Ok(report)
}

fn compare(
    report: &mut Report,
    name: &str,
    surface: &Surface,
    peer_runs: usize,
    most: Option<f64>,
) -> Result<(), Box<dyn Error>> {
    let (mut ours, mut theirs) = (Times::new(), Times::new());
    let (mut skeleton, mut peer) = (None, None);
    for run in 0..RUNS.max(peer_runs) {
        skeleton = Some(ours.of(|| Skeleton::extract(surface, &SkeletonSettings::default()))?);
        if run < peer_runs {
            let (seconds, graph) = CurveGraph::of_cgal(surface, LIMIT)
                .ok_or_else(|| format!("{name}: CGAL takes more than {} s", LIMIT.as_secs()))?;
            theirs.add(seconds);
            peer = Some(graph);
        }
    }
    let (Some(skeleton), Some(peer)) = (skeleton.as_ref().map(CurveGraph::of), peer) else {
        return Err("nothing was run".into());
    };
    let (ours, theirs) = (ours.median(), theirs.median());
    let case = |what: &str| format!("{name}, {what}");
    let vertices = surface.points().len();
    for (what, seconds) in [(format!("{vertices} vertices"), ours), ("CGAL".to_owned(), theirs)] {
        report.rows.push(Row::new(case(&what), seconds));
    }
    let mut at_most = |what: &str, value: f64, most: f64| {
        report.targets.push(Target::at_most(case(what), value, most))
    };
    if let Some(most) = most {
        at_most("[s]", ours, most);
    }
    at_most("ours / CGAL", ours / theirs, 1.0);
    let [skeleton, peer] = [skeleton, peer].map(|graph| graph.without_spurs(SPUR, surface));
    let differences: usize =
        skeleton.counts().iter().zip(peer.counts()).map(|(&a, b)| a.abs_diff(b)).sum();
    at_most("pieces, loops, branches, ends unlike CGAL's", differences as f64, 0.0);
    let [there, back] = skeleton.apart(&peer, surface);
    at_most("Hausdorff distance from CGAL's [% of diagonal]", 100.0 * there.max(back), 2.0);
    Ok(())
}
