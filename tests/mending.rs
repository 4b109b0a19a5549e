//! Orders that one linear solve cannot carry out: followed in sub-steps, untangled, clamped or
//! refused.

use std::{cell::RefCell, process::Command, sync::Arc};

use proptest::{prelude::*, test_runner::TestRunner};
use serde_json::{Value, json};
use tombolo_deform::shape::{CurrentShape, Outcome, Plan, Refused, Request, Shaper};
use tombolo_deform::vector::determinant;
use tombolo_deform::{
    edit::Edit,
    features::FeatureSettings,
    mesh::{CellType, Cells, FeatureSource, Mesh, Vector},
    quality::{Guard, Otherwise, Refusal, keeps, quality, scaled_jacobians},
    schedule::Schedule,
    shapes,
    surface::Surface,
};
use tombolo_pipelines::files::{Compression, write_mesh};
use tombolo_tests::project;

fn shaper(mesh: Mesh) -> Shaper {
    let mesh = Arc::new(mesh);
    let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).unwrap());
    Shaper::new(mesh, surface).unwrap()
}

fn column() -> Shaper {
    shaper(shapes::box_of_tets([3, 3, 6], [0.0; 3], [1.0, 1.0, 2.0]))
}

fn edits(value: Value) -> Vec<Edit> {
    serde_json::from_value(value).unwrap()
}

fn half_turn() -> Vec<Edit> {
    edits(
        json!([{"rotate": {"features": ["z-max"], "fixed": ["z-min"], "axis": [0, 0, 1], "degrees": 170}}]),
    )
}

fn guard(otherwise: Otherwise) -> Guard {
    Guard { min_scaled_jacobian: 0.01, otherwise, ..Guard::default() }
}

fn schedule(steps: u32) -> Schedule {
    serde_json::from_value(json!({"steps": steps})).unwrap()
}

fn asked(stack: &[Edit], start: &CurrentShape, steps: u32, guard: &Guard) -> Request {
    Request { schedule: schedule(steps), guard: *guard, ..Request::new(stack, start.clone()) }
}

fn reach(
    shaper: &mut Shaper,
    stack: &[Edit],
    start: &CurrentShape,
    steps: u32,
    guard: &Guard,
) -> Result<Plan, Refused> {
    shaper.plan(&asked(stack, start, steps, guard))
}

/// Goes along a plan shape by shape as a solver does, and looks at every step; the place where it
/// ends.
fn walk(mesh: &Mesh, plan: &Plan, guard: &Guard) -> CurrentShape {
    let mut before: Arc<[Vector]> = Arc::clone(plan.start());
    let mut place = CurrentShape::from(Arc::clone(&before));
    assert_eq!(plan.quality().shapes.len(), plan.shapes() as usize);
    for shape in 1..=plan.shapes() {
        let mut points = vec![[0.0; 3]; before.len()];
        plan.write_shape(shape, &mut points);
        assert!(keeps(mesh, &before, &points, guard), "shape {shape} of {}", plan.shapes());
        let measured = quality(mesh.cells(), &points);
        assert_eq!(measured.inverted, 0);
        assert!((measured.min - plan.quality().shapes[shape as usize - 1].min).abs() < 1e-12);
        let points: Arc<[Vector]> = points.into();
        place = plan.reached(f64::from(shape), Arc::clone(&points));
        before = points;
    }
    assert_eq!(before, *plan.end());
    place
}

fn here(shaper: &Shaper) -> CurrentShape {
    Arc::clone(shaper.reference()).into()
}

#[test]
fn a_half_turn_is_mended_and_taken_back_exactly() {
    let mut shaper = column();
    let mesh = shaper.mesh().clone();
    let start = here(&shaper);
    let (rejecting, mending) = (guard(Otherwise::Reject), guard(Otherwise::Untangle));
    let refused = reach(&mut shaper, &half_turn(), &start, 1, &rejecting).unwrap_err();
    assert!(
        matches!(refused, Refused::Guard(Refusal::Quality(_)) | Refused::Surface(_)),
        "{refused}"
    );

    for steps in [1, 3, 40] {
        let plan = reach(&mut shaper, &half_turn(), &start, steps, &mending).unwrap();
        assert!(
            plan.target().sub_steps > 1 && plan.shapes() >= steps.max(2),
            "{} shapes",
            plan.shapes()
        );
        assert_eq!(plan.asked().steps.get(), steps);
        let there = walk(&mesh, &plan, &mending);
        // The handle has made the motion that the edit states, and what is fixed has not moved.
        let (sine, cosine) = 170f64.to_radians().sin_cos();
        for (point, reference) in there.points.iter().zip(mesh.points()) {
            let [x, y, z] = *reference;
            let (u, v) = (x - 0.5, y - 0.5);
            let stated = [0.5 + cosine * u - sine * v, 0.5 + sine * u + cosine * v, z];
            for axis in 0..3 {
                assert!(z != 2.0 || (point[axis] - stated[axis]).abs() < 1e-12);
                assert!(z != 0.0 || point[axis] == reference[axis]);
            }
        }
        // Back, with a guard that mends nothing: the way is known.
        let back = reach(&mut shaper, &[], &there, steps, &rejecting).unwrap();
        let home = walk(&mesh, &back, &rejecting);
        assert_eq!(&*home.points, mesh.points());
    }
}

/// The shape is a function of the reference and the stack, not of the way there or of what was
/// asked before.
#[test]
fn the_shape_does_not_depend_on_where_the_mesh_is() {
    let mending = guard(Otherwise::Untangle);
    let mut shaper = column();
    let mesh = shaper.mesh().clone();
    let start = here(&shaper);
    let first = reach(&mut shaper, &half_turn(), &start, 1, &mending).unwrap();

    let mut other = column();
    let lift = edits(
        json!([{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.1, 0.0, 0.6]}}]),
    );
    let ground = here(&other);
    let lifted = reach(&mut other, &lift, &ground, 1, &mending).unwrap();
    let place = walk(&mesh, &lifted, &mending);
    let second = reach(&mut other, &half_turn(), &place, 4, &mending).unwrap();
    walk(&mesh, &second, &mending);
    assert_eq!(first.end(), second.end());

    // In the middle of the way, back to where it came from and on to somewhere else.
    let middle = second.shapes() / 2;
    let mut points = vec![[0.0; 3]; mesh.points().len()];
    second.write_shape(middle, &mut points);
    let place = second.reached(f64::from(middle), points.into());
    let undone = reach(&mut other, &lift, &place, 3, &mending).unwrap();
    walk(&mesh, &undone, &mending);
    assert_eq!(undone.end(), lifted.end());
}

/// An edit on top of a shape that was mended goes on from that shape.
#[test]
fn edits_pile_up_on_a_mended_shape() {
    let mending = guard(Otherwise::Untangle);
    let mut shaper = column();
    let mesh = shaper.mesh().clone();
    let start = here(&shaper);
    let turned = reach(&mut shaper, &half_turn(), &start, 1, &mending).unwrap();
    let place = walk(&mesh, &turned, &mending);
    let mut stack = half_turn();
    stack.extend(edits(
        json!([{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.3, 0.0, 0.2]}}]),
    ));
    let plan = reach(&mut shaper, &stack, &place, 2, &mending).unwrap();
    let there = walk(&mesh, &plan, &mending);
    let fresh = {
        let mut shaper = column();
        let start = here(&shaper);
        reach(&mut shaper, &stack, &start, 2, &mending).unwrap()
    };
    assert_eq!(fresh.end(), plan.end());
    let home = reach(&mut shaper, &[], &there, 1, &mending).unwrap();
    assert_eq!(&*walk(&mesh, &home, &mending).points, mesh.points());
}

#[test]
fn the_largest_feasible_fraction_is_done_and_reported() {
    let clamping = guard(Otherwise::Clamp);
    for stack in [
        edits(
            json!([{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -3.0]}}]),
        ),
        half_turn(),
    ] {
        let mut shaper = column();
        let mesh = shaper.mesh().clone();
        let start = here(&shaper);
        let plan = reach(&mut shaper, &stack, &start, 3, &clamping).unwrap();
        let fraction = plan.target().fraction;
        assert!(fraction > 0.05 && fraction < 0.95, "{fraction}");
        walk(&mesh, &plan, &clamping);
        let scaled =
            |fraction: f64| stack.iter().map(|edit| edit.scaled(fraction)).collect::<Vec<_>>();
        let again =
            reach(&mut shaper, &scaled(fraction), &start, 3, &guard(Otherwise::Reject)).unwrap();
        assert_eq!(again.end(), plan.end());
        assert!(
            reach(&mut shaper, &scaled(fraction + 0.02), &start, 3, &guard(Otherwise::Reject))
                .is_err()
        );
        let forecast = shaper.forecast(&asked(&stack, &start, 3, &clamping));
        assert_eq!((forecast.outcome, forecast.fraction), (Outcome::Clamped, Some(fraction)));
        assert_eq!(forecast.quality.unwrap().inverted, 0);
    }
}

#[test]
fn edits_that_are_there_already_are_not_clamped() {
    let mut shaper = column();
    let start = here(&shaper);
    let stack = edits(json!([
        {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, 0.5]}},
        {"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -4.0]}}
    ]));
    let clamping = guard(Otherwise::Clamp);
    let first = shaper.plan(&asked(&stack[..1], &start, 1, &clamping)).unwrap();
    let place = first.reached(1.0, Arc::clone(first.end()));
    let plan = shaper.plan(&Request { kept: 1, ..asked(&stack, &place, 1, &clamping) }).unwrap();
    let fraction = plan.target().fraction;
    let top = plan.end().iter().map(|point| point[2]).fold(0.0, f64::max);
    assert!((top - (2.5 - 4.0 * fraction)).abs() < 1e-9 && fraction < 0.6, "{top} {fraction}");
    let whole = shaper.plan(&Request { kept: 2, ..asked(&stack, &place, 1, &clamping) });
    assert!(
        matches!(whole, Err(Refused::Guard(_) | Refused::Surface(_))),
        "nothing is left to clamp"
    );
}

#[test]
fn what_cannot_be_mended_says_how_far_it_came() {
    let mut shaper = column();
    let start = here(&shaper);
    let stack = edits(
        json!([{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -3.0],
        "harmonic_order": 1}}]),
    );
    let refused = reach(&mut shaper, &stack, &start, 1, &guard(Otherwise::Untangle)).unwrap_err();
    let Refused::Stalled { edit: 0, name: "translate", fraction, .. } = refused else {
        panic!("{refused}")
    };
    assert!((0.3..0.67).contains(&fraction), "the column is flat at two thirds: {fraction}");
    assert_eq!(refused.feasible_fraction(), Some(fraction));
    let text = refused.to_string();
    assert!(
        text.contains("edit 0 (translate) can be done to") && text.contains("beyond that"),
        "{text}"
    );
    // The fractions of the sub-step that failed are not the order's: one is said.
    assert!(!text.contains("feasible fraction") && !text.contains("of the way"), "{text}");
    assert_eq!(text.matches(" % ").count(), 1, "{text}");
}

/// Cells at an edge of the column have all their vertices on the surface, and would be inside out:
/// that is said, and how far it can go.
#[test]
fn what_no_mesh_can_do_is_proved() {
    let mut shaper = column();
    let mesh = shaper.mesh().clone();
    assert_eq!(mesh.points()[3], [1.0, 0.0, 0.0]);
    let pushed = |fraction: f64| {
        let by = [-0.9, 0.9, 0.9].map(|by| by * fraction);
        edits(json!([{"displacement": {"vertices": [3], "values": [by]}}]))
    };
    let start = here(&shaper);
    let allowing = Guard {
        surface: tombolo_deform::quality::SurfaceRule::Allow,
        ..guard(Otherwise::Untangle)
    };
    let refused = reach(&mut shaper, &pushed(1.0), &start, 1, &allowing).unwrap_err();
    let Refused::Stalled { impossible: Some(_), fraction, end_is_valid: false, .. } = &refused
    else {
        panic!("{refused}")
    };
    assert!(*fraction > 0.1 && *fraction < 1.0 / 5.4, "{fraction}");
    assert!(
        refused
            .to_string()
            .contains("no motion of the inside gives a valid mesh at its whole amount: "),
        "{refused}"
    );
    let plan = reach(&mut shaper, &pushed(*fraction), &start, 1, &allowing).unwrap();
    walk(&mesh, &plan, &allowing);
}

fn any_edit() -> impl Strategy<Value = Value> {
    let feature = prop::sample::select(shapes::BOX_FEATURES.to_vec());
    let amount = (-1.0..1.0f64, -1.0..3.0f64).prop_map(|(sign, power)| sign * 10f64.powf(power));
    let vector = prop::array::uniform3(amount.clone());
    (feature.clone(), feature, 0..5usize, vector, amount, 1..=3u32).prop_map(
        |(handle, fixed, kind, vector, amount, order)| {
            let fixed = if fixed == handle { vec![] } else { vec![fixed] };
            let (name, own) = match kind {
                0 => ("translate", json!({"by": vector})),
                1 => ("rotate", json!({"axis": [vector[0], vector[1], 1.0], "degrees": 60.0 * amount})),
                2 => ("scale_direction", json!({"factors": vector})),
                3 => ("scale_normals", json!({"distance": amount})),
                _ => ("affine", json!({"matrix": [vector, [0.0, 1.0, 0.0], [0.0, 0.3, 1.0]], "translation": vector})),
            };
            let mut body = own;
            body["features"] = json!([handle]);
            body["fixed"] = json!(fixed);
            body["harmonic_order"] = json!(order);
            json!({ name: body })
        },
    )
}

/// A box of prisms, two for each hexahedron of the box of these, in the order of VTK's manual or in
/// that of its programs.
fn box_of_prisms(counts: [usize; 3], upper: Vector, manual: bool) -> Mesh {
    let hexahedra = shapes::box_of_hexahedra(counts, [0.0; 3], upper);
    let mut cells = Cells::new();
    for (_, v) in hexahedra.cells().iter() {
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
            let [b, c] = if manual { [c, b] } else { [b, c] };
            cells.push(CellType::Wedge, &[v[a], v[b], v[c], v[a + 4], v[b + 4], v[c + 4]]).unwrap();
        }
    }
    // The halves of the squares are tagged as these are, along whichever diagonal.
    let FeatureSource::Faces(squares) = hexahedra.features() else {
        panic!("a box names its faces")
    };
    let mut tagged = squares.clone();
    for ((_, v), &tag) in squares.faces.iter().zip(&squares.tags) {
        for half in [[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]] {
            tagged.faces.push(CellType::Triangle, &half.map(|corner| v[corner])).unwrap();
            tagged.tags.push(tag);
        }
    }
    Mesh::new(hexahedra.points().to_vec(), cells, FeatureSource::Faces(tagged)).unwrap()
}

/// A floor is held by the worst corner of prisms, in whichever order they are written.
#[test]
fn the_floor_of_prisms_is_that_of_their_worst_corner() {
    let floor = |at: f64| Guard { min_scaled_jacobian: at, ..Guard::default() };
    let shear = |by: f64| {
        edits(
            json!([{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [by, 0.0, 0.0], "harmonic_order": 1}}]),
        )
    };
    let least = |points: &[Vector], cells: &Cells| -> f64 {
        let corner = |v: &[u32], at: usize| {
            let top = at / 3 * 3;
            let [a, b, c]: [Vector; 3] = [top + (at + 1) % 3, top + (at + 2) % 3, (at + 3) % 6]
                .map(|to| {
                    std::array::from_fn(|k| points[v[to] as usize][k] - points[v[at] as usize][k])
                });
            let product = [a, b, c]
                .iter()
                .map(|x| x.iter().map(|x| x * x).sum::<f64>().sqrt())
                .product::<f64>();
            let volume = determinant(a, b, c);
            // Sound cells: each corner has the sign of its order.
            2.0 / 3.0f64.sqrt() * volume.abs() / product
        };
        cells
            .iter()
            .flat_map(|(_, v)| (0..6).map(move |at| corner(v, at)))
            .fold(f64::INFINITY, f64::min)
    };
    let mut reached = Vec::new();
    for manual in [true, false] {
        let mut shaper = shaper(box_of_prisms([3, 3, 3], [1.0, 1.0, 1.0], manual));
        let mesh = shaper.mesh().clone();
        let start = here(&shaper);
        let refused = reach(&mut shaper, &shear(2.0), &start, 2, &floor(0.5)).unwrap_err();
        let fraction = refused.feasible_fraction().unwrap();
        assert!(fraction > 0.1 && fraction < 1.0, "{fraction}");
        let plan = reach(&mut shaper, &shear(2.0 * fraction), &start, 2, &floor(0.5)).unwrap();
        let independent = least(plan.end(), &mesh.cells().as_given());
        assert!(
            (0.5 - 1e-9..0.501).contains(&independent),
            "the floor is just kept: {independent}"
        );
        assert!((plan.quality().min_scaled_jacobian - independent).abs() < 1e-12);
        reached.push(fraction);
    }
    assert!((reached[0] - reached[1]).abs() < 1e-9, "{reached:?}");
}

/// One of the meshes, two orders one after the other, what is to be done where they go too far, and
/// in how many steps.
fn any_run() -> impl Strategy<Value = (usize, [Vec<Value>; 2], Otherwise, u32)> {
    let order = || prop::collection::vec(any_edit(), 1..3);
    let otherwise =
        prop::sample::select(vec![Otherwise::Reject, Otherwise::Untangle, Otherwise::Clamp]);
    (0..MESHES, [order(), order()], otherwise, 1..4u32)
}

const MESHES: usize = 6;

fn mesh(kind: usize) -> Mesh {
    let upper = [1.0, 1.0, 2.0];
    match kind {
        0 => shapes::box_of_tets([2, 3, 3], [0.0; 3], upper),
        1 => shapes::box_of_hexahedra([3, 2, 3], [0.0; 3], upper),
        2 => shapes::box_of_mixed_cells([3, 2, 3], [0.0; 3], upper),
        3 | 4 => box_of_prisms([2, 2, 3], upper, kind == 3),
        _ => {
            let mesh = shapes::box_of_mixed_cells([3, 2, 3], [0.0; 3], upper);
            let mirrored = mesh.points().iter().map(|&[x, y, z]| [-x, y, z]).collect();
            Mesh::new(mirrored, mesh.cells().as_given().into_owned(), mesh.features().clone())
                .unwrap()
        }
    }
}

/// Whatever is asked for: every shape on the way is valid, also to VTK, or it is refused with a
/// reason and the mesh has not moved.
#[test]
fn nothing_broken_is_ever_handed_out() {
    let seen: RefCell<[Vec<Vec<Vector>>; MESHES]> = RefCell::default();
    let settings = ProptestConfig {
        cases: 80,
        max_shrink_iters: 20,
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    let mut runner = TestRunner::new(settings);
    let outcome = runner.run(&any_run(), |(kind, orders, otherwise, steps)| {
        let mut shaper = shaper(mesh(kind));
        let mesh = shaper.mesh().clone();
        let guard = guard(otherwise);
        let mut place = here(&shaper);
        let mut stack: Vec<Edit> = Vec::new();
        for order in orders {
            let kept = stack.len();
            let mut wanted = stack.clone();
            wanted.extend(edits(Value::Array(order)));
            match shaper.plan(&Request { kept, ..asked(&wanted, &place, steps, &guard) }) {
                Ok(plan) => {
                    prop_assert_eq!(&plan.start()[..], &place.points[..]);
                    place = walk(&mesh, &plan, &guard);
                    for shape in 1..=plan.shapes() {
                        let mut points = vec![[0.0; 3]; mesh.points().len()];
                        plan.write_shape(shape, &mut points);
                        seen.borrow_mut()[kind].push(points);
                    }
                    let fraction = plan.target().fraction;
                    prop_assert!(fraction > 0.0 && fraction <= 1.0);
                    for edit in &mut wanted[kept..] {
                        *edit = edit.scaled(fraction);
                    }
                    stack = wanted;
                }
                Err(refused) => prop_assert!(!refused.to_string().is_empty()),
            }
        }
        let back = shaper.plan(&asked(&[], &place, steps, &guard));
        if let Ok(plan) = back {
            let home = walk(&mesh, &plan, &guard);
            prop_assert_eq!(&*home.points, mesh.points());
        } else {
            prop_assert!(
                otherwise != Otherwise::Untangle,
                "a shape that was mended has a way back"
            );
        }
        Ok(())
    });
    outcome.unwrap_or_else(|failure| panic!("{failure}"));
    for (kind, shapes) in seen.into_inner().into_iter().enumerate() {
        assert!(shapes.len() > 5, "{} shapes of mesh {kind}", shapes.len());
        valid_to_vtk(&mesh(kind), &shapes);
    }
}

/// Has VTK look at shapes of a mesh.
fn valid_to_vtk(mesh: &Mesh, shapes: &[Vec<Vector>]) {
    if std::env::var_os("TOMBOLO_WITHOUT_VTK").is_some() {
        eprintln!("skipped: TOMBOLO_WITHOUT_VTK is set, so VTK looks at nothing");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, points: &[Vector]| {
        let shape = mesh.with_points(points.to_vec()).unwrap();
        write_mesh(folder.path().join(name), &shape, &[], Compression::None).unwrap();
    };
    write("reference.vtu", mesh.points());
    for (number, points) in shapes.iter().enumerate() {
        write(&format!("shape-{number:04}.vtu"), points);
    }
    let read = Command::new("/usr/bin/python3")
        .arg(project().join("tests/vtk/path.py"))
        .arg(folder.path())
        .output();
    let read = read.expect("python3 starts");
    assert!(
        read.status.success(),
        "VTK (apt-get install python3-vtk9): {}",
        String::from_utf8_lossy(&read.stderr)
    );
    let text = String::from_utf8(read.stdout).unwrap();
    assert_eq!(text.lines().count(), shapes.len());
    for (line, points) in text.lines().zip(shapes) {
        let mut words = line.split_whitespace().skip(1);
        let least = f64::from_bits(u64::from_str_radix(words.next().unwrap(), 16).unwrap());
        assert_eq!(words.next(), Some("0"), "{line}: cells that VTK has inside out");
        let ours = scaled_jacobians(mesh.cells(), points).into_iter().fold(2.0, f64::min);
        assert!((least - ours).abs() < 1e-10, "{line}: {least} to VTK, {ours} to us");
        assert!(least > 0.01 - 1e-9, "{line}: under the floor that was asked for");
    }
}
