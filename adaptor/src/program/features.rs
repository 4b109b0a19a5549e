//! `tombolo features`.

use std::path::PathBuf;

use crate::{
    deform::{
        features::{FeatureSettings, FeatureSize},
        mesh::{FeatureSource, Mesh, TaggedFaces},
        surface::{Surface, SurfaceError},
    },
    pipelines::files::{Compression, check_mesh_name, read_mesh, write_mesh},
};
use clap::Args;
use serde::Serialize;

use super::{Failure, json, say};

#[derive(Debug, Args)]
pub(crate) struct Options {
    /// The mesh: .vtu, .vtk, .vtp or .msh
    #[arg(long, value_name = "IN")]
    mesh: PathBuf,
    /// Part the surface where it turns by this many degrees or more, from 0 to 180, whatever
    /// features the mesh names
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    angle: Option<f64>,
    /// A surface file to write, with a cell array `features` and the names: .vtp or .vtu
    #[arg(long, value_name = "OUT.vtp")]
    out: Option<PathBuf>,
    /// List the numbers of this feature's faces, as the region `faces` of an edit takes them
    #[arg(long, value_name = "FEATURE")]
    faces: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Found {
    file: String,
    /// `mesh` where the mesh names its features, else `sharp edges`.
    source: &'static str,
    /// The angle of sharp edges, in degrees.
    angle: Option<f64>,
    features: Vec<FeatureSize>,
    /// The faces of the feature that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    faces: Option<Vec<u32>>,
}

pub(crate) fn features(options: &Options) -> Result<(), Failure> {
    let mesh = read_mesh(&options.mesh)?.mesh;
    let surface = surface(&mesh, options.angle)?;
    if let Some(out) = &options.out {
        check_mesh_name(out, surface.faces())?;
    }
    let by_angle = options.angle.is_some() || matches!(mesh.features(), FeatureSource::SharpEdges);
    let faces = match &options.faces {
        Some(name) => Some(surface.features().faces(surface.features().index(name)?).collect()),
        None => None,
    };
    let found = Found {
        file: options.mesh.display().to_string(),
        source: if by_angle { "sharp edges" } else { "mesh" },
        angle: by_angle
            .then(|| options.angle.unwrap_or(FeatureSettings::default().sharp_angle_degrees)),
        features: surface.feature_sizes(),
        faces,
    };
    if let Some(out) = &options.out {
        write_mesh(out, &as_mesh(&surface)?, &[], Compression::None)?;
    }
    if options.json { json(&found) } else { tell(&found, options) }
}

/// The surface of a mesh; with an angle, its features are those between sharp edges.
pub(crate) fn surface(mesh: &Mesh, angle: Option<f64>) -> Result<Surface, SurfaceError> {
    let surface = Surface::extract(mesh, &FeatureSettings::default())?;
    match angle {
        Some(sharp_angle_degrees) => {
            surface.with_sharp_features(&FeatureSettings { sharp_angle_degrees })
        }
        None => Ok(surface),
    }
}

/// The surface as a mesh of its own, its faces tagged from 0 in the order of the features.
fn as_mesh(surface: &Surface) -> Result<Mesh, Failure> {
    let features = surface.features();
    let tags = features.face_features().iter().map(|&feature| i64::from(feature)).collect();
    let names = (0..).zip(features.names().iter().cloned()).collect();
    let tagged = TaggedFaces { faces: surface.faces().clone(), tags, names };
    Ok(Mesh::new(surface.points().to_vec(), surface.faces().clone(), FeatureSource::Faces(tagged))?)
}

fn tell(found: &Found, options: &Options) -> Result<(), Failure> {
    match found.angle {
        Some(angle) => {
            say(format_args!("{}: features between edges of {angle} degrees or more", found.file))?
        }
        None => say(format_args!("{}: the mesh's own features", found.file))?,
    }
    for FeatureSize { name, faces, vertices, area, bounds: [lower, upper] } in &found.features {
        say(format_args!(
            "  {name}: {faces} faces, {vertices} vertices, area {area:.6e}, from {lower:?} to {upper:?}"
        ))?;
    }
    if let Some(faces) = &found.faces {
        let faces: Vec<String> = faces.iter().map(u32::to_string).collect();
        say(format_args!("faces: {}", faces.join(" ")))?;
    }
    match &options.out {
        Some(out) => say(format_args!("wrote {}", out.display())),
        None => Ok(()),
    }
}
