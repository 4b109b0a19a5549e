//! `stiffening`: the quality that one linear solve reaches, and how far sub-steps must help, at
//! several exponents of the stiffening.

use std::error::Error;
use std::sync::Arc;

use serde::Serialize;
use serde_json::{Value, json};
use tombolo::deform::edit::Edit;
use tombolo::deform::features::FeatureSettings;
use tombolo::deform::quality::{Guard, Otherwise, SurfaceRule};
use tombolo::deform::shape::{Request, Shaper};
use tombolo::deform::surface::Surface;
use tombolo::deform::volume::Deform;
use tombolo::pipelines::files::read_mesh;
use tombolo::pipelines::language::Deformation;

use crate::paper::{Figures, figures};
use crate::peer::mesh_file;
use crate::report::{Line, Report};

/// The exponents that are compared.
const EXPONENTS: [f64; 4] = [0.0, 0.5, 1.0, 1.5];

/// One deformation with one exponent.
#[derive(Debug, Serialize)]
pub struct Row {
    case: &'static str,
    exponent: f64,
    /// One linear solve from the reference.
    one_solve: Figures,
    /// With sub-steps and untangling, where one solve left inverted cells.
    #[serde(skip_serializing_if = "Option::is_none")]
    followed: Option<Figures>,
    sub_steps: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    rejected: Option<String>,
}

/// Each case with each exponent, on the meshes of `scripts/meshes`: some minutes.
pub fn run() -> Result<Report<Row>, Box<dyn Error>> {
    let sphere =
        |by: Value| json!([{"translate": {"features": ["sphere"], "fixed": ["walls"], "by": by}}]);
    let press = |by: f64| json!([{"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, by]}}]);
    let shear = |by: f64| json!([{"translate": {"features": ["moved"], "fixed": ["fixed"], "by": [by, 0, 0]}}]);
    let cases = [
        ("shear by 3 radii", "cylinder-coarse", shear(0.45)),
        ("shear by 8 radii", "cylinder-coarse", shear(1.2)),
        ("compression by 30 %", "boundary-layer", press(-0.03)),
        ("compression by 60 %", "boundary-layer", press(-0.06)),
        ("sphere, gap closed by 50 %", "sphere-layer", sphere(json!([0, 1.5, 0]))),
        ("sphere, gap closed by 80 %", "sphere-layer", sphere(json!([0, 2.4, 0]))),
        ("sphere, moved by 5 radii", "sphere-layer", sphere(json!([5, 0, 0]))),
        (
            "bypass widened",
            "bypass-0",
            json!([{"scale_normals": {"features": ["bypass"], "fixed": ["inlet", "outlet"], "distance": 5e-4,
                "harmonic_order": 2}}]),
        ),
        (
            "pipe widened twofold",
            "pipe-1",
            json!([{"scale_direction": {"features": ["wall", "outlet"], "fixed": ["inlet"], "factors": [2, 2, 1],
                "harmonic_order": 2}}]),
        ),
    ];
    let mut rows = Vec::new();
    for (case, mesh, edits) in cases {
        let mesh = Arc::new(read_mesh(&mesh_file(mesh)?)?.mesh);
        let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?);
        let stack: Vec<Edit> = serde_json::from_value(edits)?;
        let guard =
            Guard { min_scaled_jacobian: 0.0, otherwise: Otherwise::Untangle, ..Guard::default() };
        let allowing = Guard { surface: SurfaceRule::Allow, ..guard };
        for exponent in EXPONENTS {
            let deform = Deformation::from(Deform {
                stiffening: exponent,
                tolerance: 1e-6,
                ..Deform::default()
            });
            let mut shaper = Shaper::new(Arc::clone(&mesh), Arc::clone(&surface))?;
            let one_solve = figures(&mesh, &shaper.target(&stack, &deform, &allowing)?.points);
            let (mut followed, mut sub_steps, mut rejected) = (None, 0, None);
            if one_solve.inverted > 0 {
                let start = Arc::clone(shaper.reference());
                match shaper.plan(&Request {
                    deformation: deform.clone(),
                    guard,
                    ..Request::new(&stack[..], start)
                }) {
                    Ok(plan) => {
                        followed = Some(figures(&mesh, plan.end()));
                        sub_steps = plan.target().sub_steps;
                    }
                    Err(refused) => rejected = Some(refused.to_string()),
                }
            }
            rows.push(Row { case, exponent, one_solve, followed, sub_steps, rejected });
        }
    }
    Ok(Report { rows, targets: Vec::new() })
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] =
        &["case", "exponent", "mean", "least", "inv.", "steps", "mean", "least", "rejected"];

    fn cells(&self) -> Vec<String> {
        let Row { case, exponent, one_solve, followed, sub_steps, rejected } = self;
        let after = followed.map_or_else(Default::default, |Figures { mean, min, .. }| {
            [sub_steps.to_string(), format!("{mean:.4}"), format!("{min:.4}")]
        });
        let Figures { mean, min, inverted, .. } = one_solve;
        let before = [
            (*case).into(),
            exponent.to_string(),
            format!("{mean:.4}"),
            format!("{min:.4}"),
            inverted.to_string(),
        ];
        before.into_iter().chain(after).chain([rejected.clone().unwrap_or_default()]).collect()
    }
}
