//! `tombolo mesh info`.

use std::{collections::BTreeMap, path::Path};

use serde::Serialize;
use tombolo::{
    deform::{
        mesh::{Mesh, Vector},
        quality::{Quality, quality},
        surface::{FeatureSettings, Surface},
    },
    pipelines::files::read_mesh,
};

use crate::{Failure, json, say};

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
        bounds: bounds(read.mesh.points()),
        features: features(&surface),
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

fn bounds(points: &[Vector]) -> [Vector; 2] {
    let Some(&first) = points.first() else { return [[0.0; 3]; 2] };
    points.iter().fold([first; 2], |[lower, upper], point| {
        [
            std::array::from_fn(|axis| f64::min(lower[axis], point[axis])),
            std::array::from_fn(|axis| f64::max(upper[axis], point[axis])),
        ]
    })
}

fn features(surface: &Surface) -> Vec<Feature> {
    let features = surface.features();
    let faces =
        |feature: u32| features.face_features().iter().filter(|&&other| other == feature).count();
    let vertices = |feature: u32| features.vertices(feature).len();
    let named = features.names().iter().zip(0..);
    named
        .map(|(name, index)| Feature {
            name: name.clone(),
            faces: faces(index),
            vertices: vertices(index),
        })
        .collect()
}
