//! `tombolo skeleton`.

use std::{path::PathBuf, sync::Arc, time::Instant};

use crate::{
    deform::{
        features::FeatureSettings,
        mesh::{CellType, Cells},
        skeleton::{Skeleton, SkeletonSettings},
        surface::Surface,
    },
    pipelines::{
        extract::{Association, Extract, Field},
        files::{check_mesh_name, read_mesh, write},
    },
};
use serde::Serialize;

use super::{Failure, json, say};

#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// The mesh: .vtu, .vtk, .vtp or .msh; its boundary is taken where it has volume cells
    #[arg(long, value_name = "IN")]
    mesh: PathBuf,
    /// The file to write: .vtp or .vtu. Polylines with the fields `curve` (of the polyline),
    /// `node`, `degree` and `radius`
    #[arg(long, value_name = "OUT.vtp")]
    out: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Summary {
    file: String,
    vertices: usize,
    nodes: usize,
    curves: usize,
    branches: usize,
    ends: usize,
    loops: usize,
    components: usize,
    seconds: f64,
}

pub(crate) fn skeleton(options: &Options) -> Result<(), Failure> {
    let read = read_mesh(&options.mesh)?;
    let surface = Surface::extract(&read.mesh, &FeatureSettings::default())?;
    if let Some(out) = &options.out {
        check_mesh_name(out, surface.faces())?;
    }
    let start = Instant::now();
    let skeleton = Skeleton::extract(&surface, &SkeletonSettings::default())?;
    let seconds = start.elapsed().as_secs_f64();
    if let Some(out) = &options.out {
        write(out, &polylines(&skeleton, &surface)?)?;
    }
    let summary = Summary {
        file: options.mesh.display().to_string(),
        vertices: surface.points().len(),
        nodes: skeleton.nodes().len(),
        curves: skeleton.curves().len(),
        branches: skeleton.branch_count(),
        ends: skeleton.end_count(),
        loops: skeleton.loop_count(),
        components: skeleton.component_count(),
        seconds,
    };
    if options.json {
        return json(&summary);
    }
    let Summary { file, vertices, nodes, curves, branches, ends, loops, components, .. } = &summary;
    say(format_args!(
        "{file}: {vertices} surface vertices on {nodes} nodes in {components} connected piece(s)"
    ))?;
    say(format_args!(
        "{curves} curve(s), {branches} branch node(s), {ends} end(s), {loops} loop(s); {seconds:.3} s"
    ))?;
    match &options.out {
        Some(out) => say(format_args!("wrote {}", out.display())),
        None => Ok(()),
    }
}

/// The curves as polylines; a node without a curve is a cell of one vertex, of curve -1.
fn polylines(skeleton: &Skeleton, surface: &Surface) -> Result<Extract, Failure> {
    let mut cells = Cells::new();
    let mut curve = Vec::new();
    let nodes = skeleton.nodes().len();
    for node in (0..nodes).filter(|&node| skeleton.degree(node) == 0) {
        cells.push(CellType::Vertex, &[u32::try_from(node)?])?;
        curve.push(-1.0);
    }
    for (number, polyline) in skeleton.curves().iter().enumerate() {
        cells.push(CellType::PolyLine, polyline.nodes())?;
        curve.push(number as f64);
    }
    let field = |name: &str, association, values| Field {
        name: name.to_owned(),
        association,
        components: 1,
        number: crate::deform::mesh::NumberType::F64,
        values,
    };
    let fields = vec![
        field("node", Association::Vertex, (0..nodes).map(|node| node as f64).collect()),
        field(
            "degree",
            Association::Vertex,
            (0..nodes).map(|node| skeleton.degree(node) as f64).collect(),
        ),
        field("radius", Association::Vertex, skeleton.radii(surface.points())),
        field("curve", Association::Element, curve),
    ];
    let points = skeleton.nodes().to_vec();
    Ok(Extract { points, vertices: None, cells: Arc::new(cells), features: None, fields })
}
