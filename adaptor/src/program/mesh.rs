//! `tombolo mesh info`.

use std::{collections::BTreeMap, path::Path};

use crate::{
    deform::{
        bounds::Bounds,
        features::{FeatureSettings, FeatureSize},
        mesh::{Mesh, Vector},
        quality::{Quality, quality},
        surface::Surface,
    },
    pipelines::files::read_mesh,
};
use serde::Serialize;

use super::{Failure, json, say};

#[derive(Serialize)]
struct Info {
    file: String,
    vertices: usize,
    cells: usize,
    cell_types: BTreeMap<&'static str, usize>,
    bounds: [Vector; 2],
    features: Vec<Feature>,
    quality: Quality,
    notes: Vec<String>,
}

#[derive(Serialize)]
struct Feature {
    name: String,
    faces: usize,
    vertices: usize,
}

pub(crate) fn info(file: &Path, as_json: bool) -> Result<(), Failure> {
    let read = read_mesh(file)?;
    let surface = Surface::extract(&read.mesh, &FeatureSettings::default())?;
    let info = Info {
        file: file.display().to_string(),
        vertices: read.mesh.points().len(),
        cells: read.mesh.cells().len(),
        cell_types: cell_types(&read.mesh),
        bounds: match read.mesh.points() {
            [] => [[0.0; 3]; 2],
            points => Bounds::around(points.iter().copied()).corners(),
        },
        features: surface.feature_sizes().into_iter().map(feature).collect(),
        quality: quality(read.mesh.cells(), read.mesh.points()),
        notes: read.notes,
    };
    if as_json {
        return json(&info);
    }
    say(format_args!("{}: {} vertices, {} cells", info.file, info.vertices, info.cells))?;
    for (cell_type, count) in &info.cell_types {
        say(format_args!("  {count} x {cell_type}"))?;
    }
    let [lower, upper] = info.bounds;
    say(format_args!("bounds {lower:?} to {upper:?}"))?;
    say("features")?;
    for Feature { name, faces, vertices } in &info.features {
        say(format_args!("  {name}: {faces} faces, {vertices} vertices"))?;
    }
    let Quality { min, mean, inverted, .. } = info.quality;
    say(format_args!(
        "scaled Jacobian: least {min:.4}, mean {mean:.4}; {inverted} inverted cell(s)"
    ))?;
    info.notes.iter().try_for_each(|note| say(format_args!("note: {note}")))
}

fn cell_types(mesh: &Mesh) -> BTreeMap<&'static str, usize> {
    let mut counts = BTreeMap::new();
    for cell_type in mesh.cells().types() {
        *counts.entry(cell_type.name()).or_default() += 1;
    }
    counts
}

fn feature(FeatureSize { name, faces, vertices, .. }: FeatureSize) -> Feature {
    Feature { name, faces, vertices }
}
