//! Features that slide along their surface, or follow the volume.

use std::sync::Arc;

use serde_json::{Value, json};
use tombolo_deform::shape::{Plan, Refused, Request, Shaper};
use tombolo_deform::{
    edit::Edit,
    features::FeatureSettings,
    mesh::{FeatureSource, Mesh},
    quality::{Guard, Otherwise, quality},
    shapes::{box_of_hexahedra, box_of_tets},
    surface::Surface,
};
use tombolo_pipelines::language::{Deformation, Order, parse_valid};

const SIDES: [&str; 4] = ["x-min", "x-max", "y-min", "y-max"];

fn shaper(mesh: Mesh) -> Shaper {
    let mesh = Arc::new(mesh);
    let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).unwrap());
    Shaper::new(mesh, surface).unwrap()
}

fn lowered(by: f64) -> Vec<Edit> {
    serde_json::from_value(json!([
        {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -by], "harmonic_order": 2}}
    ]))
    .unwrap()
}

fn plan(
    shaper: &mut Shaper,
    edits: &[Edit],
    deform: Value,
    guard: &Guard,
) -> Result<Plan, Refused> {
    let deform: Deformation = serde_json::from_value(deform).unwrap();
    let here = Arc::clone(shaper.reference());
    shaper.plan(&Request { deformation: deform, guard: *guard, ..Request::new(edits, here) })
}

/// Between sides that let it slide, a block is compressed evenly, however the edit would bend the
/// sides; so it can be pressed further than where the surface of the edit itself folds.
#[test]
fn a_block_between_sliding_sides_is_pressed_evenly() {
    for mesh in [
        box_of_tets([3, 3, 6], [0.0; 3], [1.0, 1.0, 2.0]),
        box_of_hexahedra([3, 3, 6], [0.0; 3], [1.0, 1.0, 2.0]),
    ] {
        let mut shaper = shaper(mesh);
        let edits = lowered(1.6);
        let refused = plan(&mut shaper, &edits, json!({}), &Guard::default());
        assert!(matches!(refused, Err(Refused::Surface(_))), "{refused:?}");
        for method in ["elasticity", "harmonic"] {
            let sliding = json!({"method": method, "sliding": SIDES, "tolerance": 1e-12});
            let plan = plan(&mut shaper, &edits, sliding, &Guard::default()).unwrap();
            for (point, reference) in plan.end().iter().zip(shaper.mesh().points()) {
                let expected = [reference[0], reference[1], 0.2 * reference[2]];
                let off =
                    (0..3).map(|axis| (point[axis] - expected[axis]).abs()).fold(0.0, f64::max);
                assert!(off < 1e-9, "{method}: {reference:?} came to {point:?}");
            }
        }
    }
}

#[test]
fn free_features_follow_and_are_judged_as_any_other() {
    let mut shaper = shaper(box_of_tets([4, 4, 8], [0.0; 3], [1.0, 1.0, 2.0]));
    let turned: Vec<Edit> = serde_json::from_value(json!([
        {"rotate": {"features": ["z-max"], "fixed": ["z-min"], "axis": [0, 0, 1], "degrees": 70}}
    ]))
    .unwrap();
    let free = json!({"free": SIDES});
    let guard = Guard { otherwise: Otherwise::Untangle, ..Guard::default() };
    let plan = plan(&mut shaper, &turned, free, &guard).unwrap();
    let after = quality(shaper.mesh().cells(), plan.end());
    assert!(after.inverted == 0 && after.min >= guard.min_scaled_jacobian, "{after:?}");
    let surface = Arc::clone(shaper.surface().unwrap());
    let top = surface.features().index("z-max").unwrap();
    let told = shaper.editor().unwrap().displacement(&turned).unwrap();
    let off = |vertex: u32| {
        let at = surface.vertices()[vertex as usize] as usize;
        let (end, start) = (plan.end()[at], surface.points()[vertex as usize]);
        (0..3)
            .map(|axis| (end[axis] - start[axis] - told[vertex as usize][axis]).abs())
            .fold(0.0, f64::max)
    };
    assert!(surface.features().vertices(top).iter().all(|&vertex| off(vertex) < 1e-12));
    assert!((0..told.len() as u32).any(|vertex| off(vertex) > 0.01));
}

/// A body of its own whose whole surface slides: the list and its features are named, not those of
/// the body that is held.
#[test]
fn a_closed_body_that_slides_is_told_by_name() {
    let held = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let loose = box_of_tets([2, 2, 2], [3.0, 0.0, 0.0], [4.0, 1.0, 1.0]);
    let first = u32::try_from(held.points().len()).unwrap();
    let (mut cells, mut points) = (held.cells().clone(), held.points().to_vec());
    points.extend_from_slice(loose.points());
    let FeatureSource::Faces(mut tagged) = held.features().clone() else {
        panic!("a box names its faces")
    };
    for (cell_type, vertices) in loose.cells().iter() {
        cells
            .push(cell_type, &vertices.iter().map(|vertex| vertex + first).collect::<Vec<_>>())
            .unwrap();
    }
    let FeatureSource::Faces(others) = loose.features() else { panic!("a box names its faces") };
    for (cell_type, vertices) in others.faces.iter() {
        tagged
            .faces
            .push(cell_type, &vertices.iter().map(|vertex| vertex + first).collect::<Vec<_>>())
            .unwrap();
        tagged.tags.push(77);
    }
    tagged.names.push((77, "ball".into()));
    let mesh = Mesh::new(points, cells, FeatureSource::Faces(tagged)).unwrap();
    let mut shaper = shaper(mesh);
    for (deform, list) in [
        (json!({"sliding": ["ball", "x-min"]}), "sliding"),
        (json!({"free": ["ball"], "sliding": ["x-min"]}), "free"),
    ] {
        let refused =
            plan(&mut shaper, &lowered(0.1), deform, &Guard::default()).unwrap_err().to_string();
        let start = format!("deform.{list}: nothing holds the part of the mesh that 'ball' bounds");
        assert!(refused.starts_with(&start), "{refused}");
    }
    assert!(
        plan(&mut shaper, &lowered(0.1), json!({"sliding": ["x-min"]}), &Guard::default()).is_ok()
    );
}

#[test]
fn what_cannot_let_go_is_told_by_name() {
    let mut shaper = shaper(box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]));
    let refused =
        plan(&mut shaper, &lowered(0.1), json!({"sliding": ["x_min"]}), &Guard::default())
            .unwrap_err();
    assert!(
        refused
            .to_string()
            .starts_with("deform.sliding: there is no feature 'x_min'; did you mean"),
        "{refused}"
    );
    let all = ["x-min", "x-max", "y-min", "y-max", "z-min", "z-max"];
    let refused =
        plan(&mut shaper, &lowered(0.1), json!({"free": all}), &Guard::default()).unwrap_err();
    let text = refused.to_string();
    assert!(
        text.starts_with("deform.free: nothing holds the part of the mesh that 'x-min', "),
        "{text}"
    );
    for (deform, named) in [
        (r#"{"sliding": ["a", "a"]}"#, "sliding[1]"),
        (r#"{"sliding": ["a"], "free": ["b", "a"]}"#, "free[1]"),
        (r#"{"slidng": ["a"]}"#, "slidng"),
    ] {
        let order = format!(r#"{{"undo": 1, "deform": {deform}}}"#);
        let error = parse_valid::<Order>(&order, "order").unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    }
}
