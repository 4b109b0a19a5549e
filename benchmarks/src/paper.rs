//! `paper`: the paper's experiments on the quality of deformed meshes, its row beside ours, and a
//! sphere in its boundary layer.
//!
//! The meshes have the paper's geometry and, within 5 %, its number of tetrahedra; they are not the
//! paper's own.

use std::collections::BTreeMap;
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use tombolo::deform::edit::Edit;
use tombolo::deform::features::FeatureSettings;
use tombolo::deform::mesh::{Mesh, Vector};
use tombolo::deform::quality::{Guard, Otherwise, SurfaceRule, change, quality};
use tombolo::deform::shape::{Request, Shaper};
use tombolo::deform::surface::Surface;
use tombolo::deform::volume::Deform;
use tombolo::pipelines::files::read_mesh;
use tombolo::pipelines::language::Deformation;

use crate::peer::mesh_file;
use crate::report::{Line, Report, Target};

/// The paper's tables: amount, then mean, least and largest normalised scaled Jacobian.
const TABLES: &str = include_str!("paper.json");

#[derive(Deserialize)]
struct Table {
    tets: usize,
    rows: Vec<[f64; 4]>,
}

/// One deformation.
#[derive(Debug, Serialize)]
pub struct Row {
    case: String,
    /// Radii, percent or degrees.
    amount: f64,
    tets: usize,
    seconds: f64,
    /// Sub-steps beyond one solve from the reference; 0 where that one was enough.
    sub_steps: usize,
    ours: Figures,
    /// One linear solve from the reference and nothing else: with the default stiffening, the
    /// paper's own method on our mesh.
    one_solve: Figures,
    #[serde(skip_serializing_if = "Option::is_none")]
    paper_tets: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    paper: Option<Paper>,
    /// Why it was not reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    rejected: Option<String>,
}

/// The normalised scaled Jacobian over the cells, and the cells turned inside out.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Figures {
    /// Its mean.
    pub mean: f64,
    /// The least.
    pub min: f64,
    /// The largest.
    pub max: f64,
    /// How many cells are inverted.
    pub inverted: usize,
}

#[derive(Debug, Clone, Copy, Serialize)]
struct Paper {
    mean: f64,
    min: f64,
    max: f64,
}

/// Repeats the experiments. The meshes are those in `meshes/`, or are made there.
pub fn run() -> Result<Report<Row>, Box<dyn Error>> {
    let tables: BTreeMap<String, Table> = serde_json::from_str(TABLES)?;
    let mut rows = Vec::new();
    for (mesh, name) in [("cylinder-coarse", "shear, coarse"), ("cylinder-fine", "shear, fine")] {
        let amounts: Vec<f64> = (1..=12).map(f64::from).collect();
        rows.extend(measured(
            mesh,
            name,
            &amounts,
            tables.get(name),
            |radii| json!([{"translate": {"features": ["moved"], "fixed": ["fixed"], "by": [0.15 * radii, 0, 0]}}]),
        )?);
    }
    for (name, order) in [("compression, harmonic", 1), ("compression, biharmonic", 2)] {
        let amounts: Vec<f64> = (1..=9).map(|tenth| 10.0 * f64::from(tenth)).collect();
        rows.extend(measured("boundary-layer", name, &amounts, tables.get(name), |percent| {
            json!([{"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, -1e-3 * percent],
                "harmonic_order": order}}])
        })?);
    }
    let sphere = |body: Value| {
        let (name, mut body) = match body {
            Value::Object(body) => body.into_iter().next().unwrap_or_default(),
            _ => Default::default(),
        };
        body["features"] = json!(["sphere"]);
        body["fixed"] = json!(["walls"]);
        json!([{ name: body }])
    };
    rows.extend(measured(
        "sphere-layer",
        "sphere, gap of 3 radii closed by %",
        &[80.0, 95.0],
        None,
        |percent| sphere(json!({"translate": {"by": [0, 0.03 * percent, 0]}})),
    )?);
    for mesh in ["sphere-layer", "sphere-layer-fine"] {
        rows.extend(measured(mesh, "sphere, moved by radii", &[10.0], None, |radii| {
            sphere(json!({"translate": {"by": [radii, 0, 0]}}))
        })?);
    }
    rows.extend(measured(
        "sphere-layer",
        "sphere, turned by degrees",
        &[180.0],
        None,
        |degrees| {
            sphere(json!({"rotate": {"axis": [0, 0, 1], "degrees": degrees, "center": [0, 0, 0]}}))
        },
    )?);
    let targets = targets(&rows);
    Ok(Report { rows, targets })
}

fn targets(rows: &[Row]) -> Vec<Target> {
    let count = |test: &dyn Fn(&&Row) -> bool| rows.iter().filter(test).count() as f64;
    let none = |name: &str, value: f64| Target::at_most(name, value, 0.0);
    let below = |part: fn(&Figures, &Paper) -> bool| {
        count(&move |row| row.paper.as_ref().is_some_and(|paper| part(&row.ours, paper)))
    };
    let mut targets = vec![
        none("rows with inverted cells", count(&|row| row.ours.inverted > 0)),
        none("rows rejected", count(&|row| row.rejected.is_some())),
        none("rows with a mean below the paper's", below(|ours, paper| ours.mean < paper.mean)),
        none(
            "rows with a least value below the paper's",
            below(|ours, paper| ours.min < paper.min),
        ),
    ];
    if let Some(large) = rows.iter().find(|row| row.tets > 600_000) {
        targets.push(Target::at_most("sphere, moved by 10 radii, fine [s]", large.seconds, 15.0));
    }
    targets
}

/// One case at several amounts, each from the reference with everything set up anew.
fn measured(
    name: &str,
    case: &str,
    amounts: &[f64],
    table: Option<&Table>,
    edits: impl Fn(f64) -> Value,
) -> Result<Vec<Row>, Box<dyn Error>> {
    let mesh = Arc::new(read_mesh(&mesh_file(name)?)?.mesh);
    let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default())?);
    let guard =
        Guard { min_scaled_jacobian: 0.0, otherwise: Otherwise::Untangle, ..Guard::default() };
    let mut rows = Vec::new();
    for &amount in amounts {
        let stack: Vec<Edit> = serde_json::from_value(edits(amount))?;
        let mut shaper = Shaper::new(Arc::clone(&mesh), Arc::clone(&surface))?;
        let bare = Deformation::from(Deform { improve: 0, ..Deform::default() });
        let allowing = Guard { surface: SurfaceRule::Allow, ..guard };
        let one_solve = figures(&mesh, &shaper.target(&stack, &bare, &allowing)?.points);
        let mut shaper = Shaper::new(Arc::clone(&mesh), Arc::clone(&surface))?;
        let reference = Arc::clone(shaper.reference());
        let start = Instant::now();
        let plan = shaper.plan(&Request { guard, ..Request::new(stack, reference) });
        let seconds = start.elapsed().as_secs_f64();
        let (ours, sub_steps, rejected) = match &plan {
            Ok(plan) => (figures(&mesh, plan.end()), plan.target().sub_steps, None),
            Err(refused) => (figures(&mesh, mesh.points()), 0, Some(refused.to_string())),
        };
        let paper = table.and_then(|table| table.rows.iter().find(|row| row[0] == amount));
        rows.push(Row {
            case: case.into(),
            amount,
            tets: mesh.cells().len(),
            seconds,
            sub_steps,
            ours,
            one_solve,
            paper_tets: paper.and(table).map(|table| table.tets),
            paper: paper.map(|&[_, mean, min, max]| Paper { mean, min, max }),
            rejected,
        });
    }
    Ok(rows)
}

/// The figures of a mesh whose vertices have moved to `points`.
pub fn figures(mesh: &Mesh, points: &[Vector]) -> Figures {
    let spread = change(mesh, points).normalized_scaled_jacobian;
    let inverted = quality(mesh.cells(), points).inverted;
    Figures { mean: spread.mean, min: spread.min, max: spread.max, inverted }
}

impl Line for Row {
    const HEADINGS: &'static [&'static str] = &[
        "case",
        "amount",
        "tets",
        "seconds",
        "steps",
        "mean",
        "least",
        "inv.",
        "paper",
        "least",
        "one solve",
        "least",
        "inv.",
        "rejected",
    ];

    fn cells(&self) -> Vec<String> {
        let Row { case, amount, tets, seconds, sub_steps, rejected, .. } = self;
        let figures = |Figures { mean, min, inverted, .. }: Figures| {
            [format!("{mean:.5}"), format!("{min:.5}"), inverted.to_string()]
        };
        let paper = |paper: Paper| [format!("{:.5}", paper.mean), format!("{:.5}", paper.min)];
        [
            case.clone(),
            amount.to_string(),
            tets.to_string(),
            format!("{seconds:.2}"),
            sub_steps.to_string(),
        ]
        .into_iter()
        .chain(figures(self.ours))
        .chain(self.paper.map_or_else(Default::default, paper))
        .chain(figures(self.one_solve))
        .chain([rejected.clone().unwrap_or_default()])
        .collect()
    }
}
