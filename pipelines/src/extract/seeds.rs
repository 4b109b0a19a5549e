//! The places that streamlines begin at, and glyphs stand at.

use tombolo_deform::communicator::{Reader, Writer, agree};
use tombolo_deform::distributed::DistributedError;
use tombolo_deform::mesh::Vector;
use tombolo_deform::number::real;
use tombolo_deform::vector::{add, length, mean, polygon_normal, scale, subtract};

use super::input::Input;
use super::merge::merged;
use super::probe::points;
use super::source::Source;
use super::{Extract, ExtractError, unknown_feature};
use crate::language::{ProbeAt, SeedFeatures, SeedPlane, Seeds};

/// How far inside of the mesh seeds of features lie, as part of the size of a face.
const INSIDE: f64 = 1e-3;

/// The seeds, the same on all ranks. Collective.
///
/// # Errors
/// [`ExtractError::Seeds`] where a feature is not known, [`ExtractError::Surface`] where there is
/// no surface; the same on all ranks.
pub(super) fn of(
    source: &mut Source,
    input: &Input,
    seeds: &Seeds,
) -> Result<Vec<Vector>, ExtractError> {
    Ok(match seeds {
        Seeds::Points(points) => points.clone(),
        Seeds::Line(line) => points(&ProbeAt::Line(*line)).0,
        Seeds::Grid(grid) => points(&ProbeAt::Grid(*grid)).0,
        Seeds::Plane(plane) => of_plane(plane),
        Seeds::Features(features) => return of_features(source, input, features),
    })
}

fn of_plane(plane: &SeedPlane) -> Vec<Vector> {
    let [first, second] = [plane.first, plane.second].map(|corner| subtract(corner, plane.origin));
    let part = |index: usize, count: usize| {
        if count > 1 { real(index) / real(count - 1) } else { 0.5 }
    };
    let [along, across] = plane.counts;
    let at = |j: usize, i: usize| {
        let sides = add(scale(first, part(i, along)), scale(second, part(j, across)));
        add(plane.origin, sides)
    };
    (0..across).flat_map(|j| (0..along).map(move |i| (j, i))).map(|(j, i)| at(j, i)).collect()
}

fn of_features(
    source: &mut Source,
    input: &Input,
    features: &SeedFeatures,
) -> Result<Vec<Vector>, ExtractError> {
    let communicator = input.communicator;
    let taken = source.surface(input.channel, input.cycle, &|_| false);
    let is_flat = communicator.most(source.cells().dimension()) < 3;
    let surface = match source.whole_mesh() {
        Some(whole) => merged(communicator, whole, taken.as_ref().ok())?,
        None => Some(taken?.extract),
    };
    let seeds = surface.map(|surface| spread(&surface, is_flat, features)).transpose();
    let seeds = agree(communicator, seeds).map_err(|error| ExtractError::Seeds(error.message))?;
    let mut message = Writer::default();
    seeds.iter().flatten().for_each(|seed| message.f64s(seed));
    let mut bytes = message.into_bytes();
    communicator.broadcast(0, &mut bytes);
    let mut reader = Reader::new(0, &bytes);
    let mut all = Vec::with_capacity(features.count);
    while !reader.is_empty() {
        all.push(reader.vector().map_err(DistributedError::from)?);
    }
    Ok(all)
}

/// Points spread over features of a surface: the middles of the faces at equal steps of the area, a
/// little inside of the mesh, where the mesh is not flat as the surface is.
fn spread(
    surface: &Extract,
    is_flat: bool,
    features: &SeedFeatures,
) -> Result<Vec<Vector>, String> {
    let Some(known) = &surface.features else { return Err("the surface has no features".into()) };
    if let Some(name) = features.names.iter().find(|&name| !known.names.contains(name)) {
        return Err(unknown_feature(name, &known.names));
    }
    let is_in = |face: &usize| {
        let feature = known.of_cells[*face] as usize;
        known.names.get(feature).is_some_and(|name| features.names.contains(name))
    };
    let faces: Vec<usize> = (0..surface.cells.len()).filter(is_in).collect();
    let normal = |face: usize| polygon_normal(&surface.points, surface.cells.vertices(face));
    let sizes: Vec<f64> = faces.iter().map(|&face| length(normal(face))).collect();
    let all: f64 = sizes.iter().sum();
    let mut seeds = Vec::with_capacity(features.count);
    let mut passed = 0.0;
    for (&face, &size) in faces.iter().zip(&sizes) {
        passed += size;
        let due = |count: usize| passed >= all * (real(count) + 0.5) / real(features.count);
        // A face that is larger than a step has its point once.
        let mut is_due = false;
        while seeds.len() < features.count && due(seeds.len()) && !is_due {
            is_due = true;
            let vertices = surface.cells.vertices(face);
            let middle = mean(vertices.iter().map(|&vertex| surface.points[vertex as usize]));
            let depth = if is_flat { 0.0 } else { INSIDE * size.sqrt() };
            seeds.push(add(middle, scale(normal(face), -depth / size)));
        }
    }
    if seeds.is_empty() {
        return Err("the features have no faces to begin at".into());
    }
    Ok(seeds)
}
