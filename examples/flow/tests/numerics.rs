//! The scheme against closed forms and invariants.

use std::f64::consts::PI;
use std::sync::Arc;

use tombolo_deform::communicator::{Communicator, Halo, threads};
use tombolo_deform::mesh::{FeatureSource, Mesh, Vector};
use tombolo_deform::shapes::{BOX_FEATURES, box_of_tets};
use tombolo_deform::{
    distributed::{Part, in_order},
    mesh::SharedVertices,
};
use tombolo_flow::{Condition, Fluid, Motion, Patch, Settings, Solver, SolverError, Value};

const WATERY: Fluid = Fluid { density: 1.0, viscosity: 0.01 };

/// The six sides of a box with their conditions, in the order of `BOX_FEATURES`.
fn sides(mesh: &Mesh, conditions: [Condition; 6]) -> Vec<Patch> {
    let FeatureSource::Faces(tagged) = mesh.features() else { panic!("a box has tagged faces") };
    let patch = |(side, condition): (usize, Condition)| Patch {
        name: BOX_FEATURES[side].into(),
        triangles: (0..tagged.faces.len())
            .filter(|&face| tagged.tags[face] == side as i64 + 1)
            .map(|face| tagged.faces.vertices(face).try_into().unwrap())
            .collect(),
        condition,
    };
    conditions.into_iter().enumerate().map(patch).collect()
}

fn uniform(velocity: Vector) -> Condition {
    Condition::Velocity(velocity.map(Value::Uniform))
}

fn outlet() -> Condition {
    Condition::Pressure(Value::Uniform(0.0))
}

/// The root mean square over the mesh of the difference between the linear velocity field and
/// `exact`, by the quadrature of second order that samples the middles of edges and the vertices.
fn mean_square(mesh: &Mesh, velocity: &[Vector], exact: impl Fn(Vector) -> Vector) -> f64 {
    let (mut total, mut whole) = (0.0, 0.0);
    for (_, vertices) in mesh.cells().iter() {
        let corner = |local: usize| mesh.points()[vertices[local] as usize];
        let edge =
            |local| -> Vector { std::array::from_fn(|axis| corner(local)[axis] - corner(0)[axis]) };
        let (a, b, c) = (edge(1), edge(2), edge(3));
        let volume = (a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0]))
            / 6.0;
        for first in 0..4 {
            for second in first..4 {
                let middle = |of: &[Vector]| -> Vector {
                    let (a, b) = (of[vertices[first] as usize], of[vertices[second] as usize]);
                    std::array::from_fn(|axis| 0.5 * (a[axis] + b[axis]))
                };
                let weight = volume * if first == second { -0.05 } else { 0.2 };
                let (found, wanted) = (middle(velocity), exact(middle(mesh.points())));
                total +=
                    weight * length(std::array::from_fn(|axis| found[axis] - wanted[axis])).powi(2);
                whole += weight;
            }
        }
    }
    (total / whole).sqrt()
}

fn length(vector: Vector) -> f64 {
    vector.iter().map(|value| value * value).sum::<f64>().sqrt()
}

/// Numbers in [-1, 1) from a fixed seed (xorshift).
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Plane Poiseuille flow between walls at y = 0 and y = 1, driven by its inlet profile, on a mesh
/// whose inner vertices are shaken by `shake` edge lengths, lest a regular mesh flatter the scheme;
/// mean velocity 2/3.
fn poiseuille(counts: [usize; 3], shake: f64) -> (Mesh, Solver) {
    let upper = [2.0, 1.0, 0.25];
    let mesh = box_of_tets(counts, [0.0; 3], upper);
    let mut number = random(11);
    let move_inside = |point: &Vector| -> Vector {
        std::array::from_fn(|axis| {
            let inside = point[axis] > 1e-9 && point[axis] < upper[axis] - 1e-9;
            let edge = upper[axis] / counts[axis] as f64;
            point[axis] + if inside { shake * edge * number() } else { 0.0 }
        })
    };
    let mesh = mesh.with_points(mesh.points().iter().map(move_inside).collect()).unwrap();
    let profile = || Value::function(|place, _| 4.0 * place[1] * (1.0 - place[1]));
    let inlet = Condition::Velocity([profile(), Value::Uniform(0.0), Value::Uniform(0.0)]);
    let patches = sides(
        &mesh,
        [inlet, outlet(), Condition::NoSlip, Condition::NoSlip, Condition::Slip, Condition::Slip],
    );
    let fluid = Fluid { density: 1.0, viscosity: 0.1 };
    let mut solver =
        Solver::new(&mesh, &Halo::none(), patches, fluid, Settings::default()).unwrap();
    solver.initialise(
        &[profile(), Value::Uniform(0.0), Value::Uniform(0.0)],
        &Value::function(|place, _| 0.8 * (2.0 - place[0])),
    );
    (mesh, solver)
}

#[test]
fn poiseuille_flow_converges_with_second_order() {
    let errors: Vec<(f64, f64)> = [1, 2, 4]
        .map(|n| {
            let (mesh, mut solver) = poiseuille([8 * n, 4 * n, n], 0.15);
            for _ in 0..60 {
                solver.step(0.1, None).unwrap();
            }
            let velocity = solver.velocity();
            let error = mean_square(&mesh, &velocity, |[_, y, _]| [4.0 * y * (1.0 - y), 0.0, 0.0]);
            let drop = solver.mean_pressures()[0].0 - solver.mean_pressures()[1].0;
            (error, (drop - 1.6).abs())
        })
        .into();
    for pair in errors.windows(2) {
        let order = (pair[0].0 / pair[1].0).log2();
        assert!(order > 1.8, "velocity errors {errors:?}");
        assert!(
            pair[1].1 < 0.5 * pair[0].1,
            "errors of the pressure drop, which is 1.6: {errors:?}"
        );
    }
}

#[test]
fn mass_in_is_mass_out_in_every_step() {
    let (_, mut solver) = poiseuille([16, 8, 2], 0.15);
    solver.initialise(&[0.0; 3].map(Value::Uniform), &Value::Uniform(0.0));
    for step in 0..20 {
        let outcome = solver.step(0.02, None).unwrap();
        assert!(
            outcome.momentum.converged && outcome.pressure.converged,
            "step {step}: {outcome:?}"
        );
        let inward = -solver.fluxes()[0];
        assert!(inward > 0.15, "{inward}");
        assert!(
            outcome.imbalance.abs() < 1e-5 * inward,
            "step {step}: {} of {inward}",
            outcome.imbalance
        );
    }
}

#[test]
fn uniform_stream_stays_uniform_whatever_the_mesh_does() {
    let mesh = box_of_tets([6, 5, 4], [0.0; 3], [1.5, 1.0, 0.8]);
    let stream = [1.0, -0.4, 0.3];
    let conditions =
        [uniform(stream), outlet(), outlet(), uniform(stream), uniform(stream), uniform(stream)];
    let mut solver =
        Solver::new(&mesh, &Halo::none(), sides(&mesh, conditions), WATERY, Settings::default())
            .unwrap();
    solver.initialise(&stream.map(Value::Uniform), &Value::Uniform(0.0));
    let inside = |point: Vector| {
        [1.5, 1.0, 0.8].iter().zip(point).all(|(upper, value)| value > 1e-9 && value < upper - 1e-9)
    };
    let mut number = random(7);
    for step in 0..60 {
        // Up to the largest random motion that keeps every element; now and then the mesh rests, or
        // the whole box is sheared and stretched at once.
        let amplitude = if step % 3 == 0 { 0.04 } else { 0.02 };
        let shear = if step % 10 == 5 { 0.8 } else { 0.1 * (step as f64).sin() };
        let points: Vec<Vector> = mesh
            .points()
            .iter()
            .map(|&point| {
                let shake: Vector = std::array::from_fn(|_| {
                    amplitude * number() * if inside(point) { 1.0 } else { 0.0 }
                });
                [
                    point[0] + shake[0] + shear * point[1],
                    (point[1] + shake[1]) * (1.0 + 0.5 * shear),
                    point[2] + shake[2] - 0.3 * shear * point[0],
                ]
            })
            .collect();
        let motion = (step % 7 != 6).then_some(Motion { points: &points });
        solver.step(0.03, motion).unwrap();
    }
    let worst = solver
        .velocity()
        .iter()
        .map(|velocity| length(std::array::from_fn(|axis| velocity[axis] - stream[axis])))
        .fold(0.0, f64::max);
    assert!(worst < 1e-10, "{worst:e}");
    let pressure = solver.pressure().iter().fold(0.0, |worst: f64, value| worst.max(value.abs()));
    assert!(pressure < 1e-9, "{pressure:e}");
}

/// A piston at x = s(t) pushes the fluid in a duct with frictionless walls: u = s'(t) everywhere,
/// and the pressure falls linearly from -(density) s'' (x - 1) to 0 at the open end.
#[test]
fn piston_accelerates_the_fluid_with_the_pressure_of_newton() {
    let mesh = box_of_tets([10, 3, 3], [0.0; 3], [1.0, 0.3, 0.3]);
    let conditions = [
        Condition::NoSlip,
        outlet(),
        Condition::Slip,
        Condition::Slip,
        Condition::Slip,
        Condition::Slip,
    ];
    let fluid = Fluid { density: 2.0, viscosity: 0.01 };
    let mut solver =
        Solver::new(&mesh, &Halo::none(), sides(&mesh, conditions), fluid, Settings::default())
            .unwrap();
    let (time_step, acceleration) = (0.01, 0.8);
    let place = |time: f64| 0.5 * acceleration * time * time;
    let mut late = 0;
    for step in 1..=60 {
        let shift = place(f64::from(step) * time_step);
        let points: Vec<Vector> =
            mesh.points().iter().map(|&[x, y, z]| [x + shift * (1.0 - x), y, z]).collect();
        let outcome = solver.step(time_step, Some(Motion { points: &points })).unwrap();
        late += if (41..=50).contains(&step) { outcome.momentum.iterations } else { 0 };
    }
    // The solve begins with a velocity that has grown on as before, which here is the solution.
    assert!(late < 40, "{late} iterations in ten steps");
    let speed = (place(0.6) - place(0.59)) / time_step;
    for (velocity, (pressure, point)) in
        solver.velocity().iter().zip(solver.pressure().iter().zip(solver.points()))
    {
        assert!(
            length([velocity[0] - speed, velocity[1], velocity[2]]) < 1e-3 * speed,
            "{velocity:?}, {speed}"
        );
        let exact = fluid.density * acceleration * (1.0 - point[0]);
        assert!(
            (pressure - exact).abs() < 2e-2 * fluid.density * acceleration,
            "{pressure} {exact} at {point:?}"
        );
    }
}

/// A stream that is driven faster and faster has the pressure of Newton in every step, however long
/// the steps are.
#[test]
fn steps_of_other_lengths_keep_the_acceleration() {
    let mesh = box_of_tets([8, 3, 3], [0.0; 3], [1.0, 0.3, 0.3]);
    let acceleration = 0.8;
    let speed = Value::function(move |_, time| acceleration * time);
    let conditions = [
        Condition::Velocity([speed, Value::Uniform(0.0), Value::Uniform(0.0)]),
        outlet(),
        Condition::Slip,
        Condition::Slip,
        Condition::Slip,
        Condition::Slip,
    ];
    let patches = sides(&mesh, conditions);
    let mut solver =
        Solver::new(&mesh, &Halo::none(), patches, WATERY, Settings::default()).unwrap();
    for step in 0..60 {
        let time_step = [0.02, 0.01, 0.015, 0.05, 0.04][step / 12];
        solver.step(time_step, None).unwrap();
        let driven = WATERY.density * acceleration;
        let drop = solver.mean_pressures()[0].0 - solver.mean_pressures()[1].0;
        assert!(step < 6 || (drop - driven).abs() < 2e-2 * driven, "step {step}: {drop} {driven}");
    }
}

/// Decaying Taylor-Green vortices in a periodic cell's quarter (frictionless walls), on a fixed
/// mesh and on a shaken one.
fn vortex_error(n: usize, time_step: f64, amplitude: f64) -> f64 {
    let mesh = box_of_tets([n, n, 2], [0.0; 3], [1.0, 1.0, 2.0 / n as f64]);
    let slip = || Condition::Slip;
    let mut solver = Solver::new(
        &mesh,
        &Halo::none(),
        sides(&mesh, [slip(), slip(), slip(), slip(), slip(), slip()]),
        WATERY,
        Settings::default(),
    )
    .unwrap();
    let start = [
        Value::function(|p, _| (PI * p[0]).sin() * (PI * p[1]).cos()),
        Value::function(|p, _| -(PI * p[0]).cos() * (PI * p[1]).sin()),
        Value::Uniform(0.0),
    ];
    solver.initialise(
        &start,
        &Value::function(|p, _| 0.25 * ((2.0 * PI * p[0]).cos() + (2.0 * PI * p[1]).cos())),
    );
    let steps = (0.5 / time_step).round() as usize;
    for step in 1..=steps {
        let time = step as f64 * time_step;
        let shake = amplitude * (4.0 * PI * time).sin();
        let points: Vec<Vector> = mesh
            .points()
            .iter()
            .map(|&[x, y, z]| {
                let bump = shake * (PI * x).sin() * (PI * y).sin();
                [x + bump, y - 0.7 * bump, z]
            })
            .collect();
        let motion = (amplitude > 0.0).then_some(Motion { points: &points });
        solver.step(time_step, motion).unwrap();
    }
    let decay = (-2.0 * PI * PI * WATERY.viscosity * 0.5).exp();
    let mesh = mesh.with_points(solver.points()).unwrap();
    mean_square(&mesh, &solver.velocity(), |[x, y, _]| {
        [decay * (PI * x).sin() * (PI * y).cos(), -decay * (PI * x).cos() * (PI * y).sin(), 0.0]
    })
}

#[test]
fn vortices_decay_as_they_should_on_a_mesh_that_moves() {
    let fixed = [8, 16, 32].map(|n| vortex_error(n, 0.16 / n as f64, 0.0));
    let moving = [8, 16, 32].map(|n| vortex_error(n, 0.16 / n as f64, 0.05));
    assert!((fixed[1] / fixed[2]).log2() > 1.7, "{fixed:?}");
    // The mesh velocity is of first order in time.
    assert!((moving[1] / moving[2]).log2() > 0.9, "{moving:?}");
    assert!(moving[2] < 0.02, "{moving:?}");
}

#[test]
fn threads_do_not_change_a_bit() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (mesh, mut solver) = poiseuille([40, 20, 10], 0.0);
            let points: Vec<Vector> = mesh
                .points()
                .iter()
                .map(|&[x, y, z]| [x, y * (1.0 - 0.2 * (PI * x / 2.0).sin()), z])
                .collect();
            for step in 0..6 {
                let motion = (step == 3).then_some(Motion { points: &points });
                solver.step(0.05, motion).unwrap();
            }
            let bits: Vec<[u64; 3]> =
                solver.velocity().iter().map(|v| v.map(f64::to_bits)).collect();
            (bits, solver.pressure().iter().map(|p| p.to_bits()).collect::<Vec<_>>())
        })
    };
    let one = run(1);
    assert!(one == run(2) && one == run(3), "the bits depend on the number of threads");
}

/// The wall closes half of the channel within one step, ten times as fast as the fluid.
#[test]
fn survives_a_wall_that_jumps() {
    let mesh = box_of_tets([40, 8, 4], [0.0; 3], [4.0, 1.0, 0.5]);
    let inlet = uniform([1.0, 0.0, 0.0]);
    let conditions =
        [inlet, outlet(), Condition::NoSlip, Condition::NoSlip, Condition::Slip, Condition::Slip];
    let fluid = Fluid { density: 1.0, viscosity: 1e-3 };
    let mut solver =
        Solver::new(&mesh, &Halo::none(), sides(&mesh, conditions), fluid, Settings::default())
            .unwrap();
    let time_step = 0.05;
    for _ in 0..40 {
        solver.step(time_step, None).unwrap();
    }
    let before = -solver.fluxes()[0];
    let pinched: Vec<Vector> = mesh
        .points()
        .iter()
        .map(|&[x, y, z]| [x, y * (1.0 - 0.25 * (1.0 - (PI * x / 2.0).cos())), z])
        .collect();
    let outcome = solver.step(time_step, Some(Motion { points: &pinched })).unwrap();
    // What the wall displaces leaves with the stream: half of the closing volume's 0.25 * 4 * 0.5
    // per step.
    let displaced = 0.5 / time_step;
    assert!(
        (solver.fluxes()[1] - before - displaced).abs() < 0.03 * displaced,
        "{} {before}",
        solver.fluxes()[1]
    );
    assert!(outcome.imbalance.abs() < 1e-5 * displaced, "{outcome:?}");
    for _ in 0..120 {
        solver.step(time_step, None).unwrap();
    }
    let fastest = solver.velocity().iter().map(|&v| length(v)).fold(0.0, f64::max);
    assert!(fastest > 1.9 && fastest < 3.5, "{fastest}");
    // What flows in flows out and not through the walls, of which one slopes away from the inlet
    // now.
    let fluxes: Vec<f64> = solver.fluxes();
    assert!((fluxes[0] + before).abs() < 2e-4 * before, "{fluxes:?}");
    assert!((fluxes[1] + fluxes[0]).abs() < 1e-6 * before, "{fluxes:?}");
    assert!(fluxes[2].abs().max(fluxes[3].abs()) < 1e-12, "{fluxes:?}");
}

/// The projections of an impulse need not be solved well: the flow is the same, for half of the
/// iterations.
#[test]
fn an_impulse_costs_no_more_than_it_is_worth() {
    let run = |impulse_tolerance: f64| {
        let mesh = box_of_tets([24, 12, 6], [0.0; 3], [2.0, 1.0, 0.5]);
        let conditions = [
            uniform([1.0, 0.0, 0.0]),
            outlet(),
            Condition::NoSlip,
            Condition::NoSlip,
            Condition::Slip,
            Condition::Slip,
        ];
        let settings = Settings { impulse_tolerance, ..Settings::default() };
        let mut solver =
            Solver::new(&mesh, &Halo::none(), sides(&mesh, conditions), WATERY, settings).unwrap();
        for _ in 0..10 {
            solver.step(0.05, None).unwrap();
        }
        let pinched: Vec<Vector> = mesh
            .points()
            .iter()
            .map(|&[x, y, z]| [x, y * (1.0 - 0.2 * (PI * x / 2.0).sin()), z])
            .collect();
        let outcome = solver.step(0.05, Some(Motion { points: &pinched })).unwrap();
        assert!(outcome.pressure.converged);
        // What flows in flows out, however the impulse was solved.
        assert!(outcome.imbalance.abs() < 1e-5, "{outcome:?}");
        (outcome.pressure.iterations, solver.velocity())
    };
    let (many, exact) = run(Settings::default().pressure_tolerance);
    let (few, found) = run(Settings::default().impulse_tolerance);
    assert!(10 * few < 7 * many, "{few} iterations in place of {many}");
    let fastest = exact.iter().map(|&velocity| length(velocity)).fold(0.0, f64::max);
    for (found, exact) in found.iter().zip(&exact) {
        let apart = length(std::array::from_fn(|axis| found[axis] - exact[axis]));
        assert!(apart < 1e-2 * fastest, "{found:?} {exact:?}, of {fastest}");
    }
}

/// Once the mesh rests, the pressure is solved as well as on a mesh that never was another.
#[test]
fn a_mesh_that_has_come_to_rest_costs_no_more_than_one_that_never_moved() {
    let mesh = box_of_tets([24, 8, 8], [0.0; 3], [3.0, 1.0, 1.0]);
    let pinched = |by: f64| -> Vec<Vector> {
        let narrow = |x: f64| 1.0 - 0.5 * by * (1.0 - (2.0 * PI * x / 3.0).cos());
        mesh.points().iter().map(|&[x, y, z]| [x, y * narrow(x), z * narrow(x)]).collect()
    };
    // The stream swells and ebbs, so that there is always something to solve.
    let swelling = || {
        let speed = Value::function(|_, time| 1.0 + 0.5 * (12.0 * time).sin());
        Condition::Velocity([speed, Value::Uniform(0.0), Value::Uniform(0.0)])
    };
    let conditions = || {
        let [a, b, c, d] = std::array::from_fn(|_| Condition::NoSlip);
        [swelling(), outlet(), a, b, c, d]
    };
    let iterations = |mesh: &Mesh, moves: bool| -> usize {
        let (halo, settings) = (Halo::none(), Settings::default());
        let patches = sides(mesh, conditions());
        let mut solver = Solver::new(mesh, &halo, patches, WATERY, settings).unwrap();
        let mut step = |step: usize| {
            let points = pinched(0.03 * step.min(10) as f64);
            let motion = (moves && step <= 10).then_some(Motion { points: &points });
            solver.step(0.02, motion).unwrap().pressure.iterations
        };
        for number in 1..=25 {
            step(number);
        }
        (26..=40).map(step).sum()
    };
    let expected = iterations(&mesh.with_points(pinched(0.3)).unwrap(), false);
    let found = iterations(&mesh, true);
    assert!(found <= expected + 15, "{found} iterations in 15 steps, where {expected} will do");
}

#[test]
fn refuses_what_it_cannot_solve() {
    let (mesh, mut solver) = poiseuille([8, 4, 1], 0.0);
    let mut points = mesh.points().to_vec();
    points[60][1] += 5.0;
    let before = solver.points();
    let refused = solver.step(0.1, Some(Motion { points: &points }));
    assert!(matches!(refused, Err(SolverError::Inverted { cycle: 0, .. })), "{refused:?}");
    assert_eq!(solver.points(), before);
    assert!(matches!(
        solver.step(0.1, Some(Motion { points: &points[1..] })),
        Err(SolverError::Length { .. })
    ));
    assert!(matches!(solver.step(f64::NAN, None), Err(SolverError::NotPositive { .. })));
    assert!(solver.set_fluid(Fluid { density: -1.0, viscosity: 1.0 }).is_err());

    let hexahedra = tombolo_deform::shapes::box_of_hexahedra([1, 1, 1], [0.0; 3], [1.0; 3]);
    let refused = Solver::new(&hexahedra, &Halo::none(), Vec::new(), WATERY, Settings::default());
    assert!(matches!(refused, Err(SolverError::CellType { .. })));

    let conditions = [
        Condition::Velocity([
            Value::function(|_, time| if time > 0.25 { f64::NAN } else { 1.0 }),
            Value::Uniform(0.0),
            Value::Uniform(0.0),
        ]),
        outlet(),
        Condition::Slip,
        Condition::Slip,
        Condition::Slip,
        Condition::Slip,
    ];
    let mut solver =
        Solver::new(&mesh, &Halo::none(), sides(&mesh, conditions), WATERY, Settings::default())
            .unwrap();
    solver.step(0.1, None).unwrap();
    solver.step(0.1, None).unwrap();
    match solver.step(0.1, None) {
        Err(SolverError::Diverged { cycle: 3, time, .. }) => assert!((time - 0.3).abs() < 1e-12),
        other => panic!("{other:?}"),
    }
}

/// Frictionless walls let nothing through, neither where two of them meet at an angle nor where one
/// slopes away from an inlet.
#[test]
fn frictionless_walls_let_nothing_through() {
    let mesh = box_of_tets([16, 4, 4], [0.0; 3], [2.0, 1.0, 1.0]);
    for start in [1.0, 0.0] {
        let slope = |&[x, y, z]: &Vector| [x, y, z * (1.0 + 0.3 * f64::max(0.0, x - start))];
        let mesh = mesh.with_points(mesh.points().iter().map(slope).collect()).unwrap();
        let slip = || Condition::Slip;
        let conditions = [uniform([1.0, 0.0, 0.0]), outlet(), slip(), slip(), slip(), slip()];
        let mut patches = sides(&mesh, conditions);
        // The upper side in two: before and behind the kink.
        let mut upper = patches.pop().unwrap();
        let is_before = |triangle: &[u32; 3]| {
            triangle.iter().all(|&vertex| mesh.points()[vertex as usize][0] < 1.0 + 1e-9)
        };
        let (before, behind) = upper.triangles.iter().copied().partition(is_before);
        upper.triangles = before;
        patches.push(upper.clone());
        upper.triangles = behind;
        patches.push(upper);
        let mut solver =
            Solver::new(&mesh, &Halo::none(), patches, WATERY, Settings::default()).unwrap();
        for _ in 0..40 {
            solver.step(0.05, None).unwrap();
        }
        let fluxes = solver.fluxes();
        let through = (fluxes[5] + fluxes[6]).abs();
        assert!(through < 1e-12 && fluxes[0] < -0.9, "{start}: {fluxes:?}");
        assert!((fluxes[0] + fluxes[1]).abs() < 1e-4, "{start}: {fluxes:?}");
    }
}

/// Without an outlet a mesh that loses volume compresses the fluid, and the outcome says so; an
/// outlet that lies on walls with all of its vertices is none.
#[test]
fn says_where_nothing_can_get_out() {
    let mesh = box_of_tets([8, 4, 4], [0.0; 3], [2.0, 1.0, 1.0]);
    let closed = sides(&mesh, std::array::from_fn(|_| Condition::NoSlip));
    let mut solver =
        Solver::new(&mesh, &Halo::none(), closed, WATERY, Settings::default()).unwrap();
    assert_eq!(solver.step(0.1, None).unwrap().stretch, 0.0);
    let flat: Vec<Vector> = mesh.points().iter().map(|&[x, y, z]| [x, 0.98 * y, z]).collect();
    let outcome = solver.step(0.1, Some(Motion { points: &flat })).unwrap();
    assert!((outcome.stretch + 0.02 / 0.98).abs() < 1e-9, "{outcome:?}");

    let thin = box_of_tets([8, 1, 1], [0.0; 3], [2.0, 0.1, 0.1]);
    let conditions = [
        uniform([1.0, 0.0, 0.0]),
        outlet(),
        Condition::NoSlip,
        Condition::NoSlip,
        Condition::NoSlip,
        Condition::NoSlip,
    ];
    let patches = sides(&thin, conditions);
    let refused = Solver::new(&thin, &Halo::none(), patches, WATERY, Settings::default());
    assert!(
        matches!(&refused, Err(SolverError::Outlet { patch }) if *patch == BOX_FEATURES[1]),
        "{:?}",
        refused.err()
    );
}

/// Parts on several ranks make the same equations as the whole: solved well, the same flow. Through
/// an outlet, past walls of each kind, while all of the mesh moves; and in a closed box that is
/// squeezed without losing volume.
#[test]
fn ranks_solve_the_same_equations() {
    let settings = Settings {
        momentum_tolerance: 1e-12,
        pressure_tolerance: 1e-10,
        impulse_tolerance: 1e-10,
        iteration_limit: 500,
    };
    let mesh = box_of_tets([9, 5, 4], [0.0; 3], [2.0, 1.0, 0.8]);
    let inlet = || {
        let profile = Value::function(|place, time| place[1] * (1.0 - place[1]) * (1.0 + time));
        Condition::Velocity([profile, Value::Uniform(0.0), Value::Uniform(0.0)])
    };
    let open =
        || [inlet(), outlet(), Condition::NoSlip, Condition::Slip, Condition::NoSlip, outlet()];
    let closed =
        || std::array::from_fn(|side| if side < 4 { Condition::NoSlip } else { Condition::Slip });
    let waved = |points: &[Vector], step: usize, is_open: bool| -> Vec<Vector> {
        let by = 0.03 * (1.0 + step as f64);
        let squeezed = |&[x, y, z]: &Vector| {
            if is_open {
                [x, y - by * x * (2.0 - x) * y, z]
            } else {
                [x * (1.0 + by), y / (1.0 + by), z]
            }
        };
        points.iter().map(squeezed).collect()
    };
    let of_cells = in_order(mesh.cells().len(), 3);
    for is_open in [true, false] {
        let conditions = || if is_open { open() } else { closed() };
        let advance = |solver: &mut Solver, points: &[Vector]| {
            for step in 0..6 {
                let points = waved(points, step, is_open);
                let outcome = solver
                    .step(0.05, (step % 3 > 0).then_some(Motion { points: &points }))
                    .unwrap();
                assert!(outcome.momentum.converged && outcome.pressure.converged, "{outcome:?}");
            }
        };
        let mut whole =
            Solver::new(&mesh, &Halo::none(), sides(&mesh, conditions()), WATERY, settings)
                .unwrap();
        advance(&mut whole, mesh.points());
        let (velocity, pressure) = (whole.velocity(), whole.pressure());
        let largest = velocity.iter().map(|&velocity| length(velocity)).fold(0.0, f64::max);
        let steepest = pressure.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        assert!(largest > 0.01 && steepest > 0.01, "{largest} {steepest}");
        let apart = threads::run(3, |ranks| {
            let communicator: Arc<dyn Communicator> = Arc::new(ranks);
            let part = Part::cut(&mesh, &of_cells, communicator.rank(), true).unwrap();
            let shared = SharedVertices::find(&communicator, &part).unwrap();
            let own = part.view().to_mesh().unwrap();
            let patches = sides(&own, conditions());
            let mut solver = Solver::new(&own, shared.halo(), patches, WATERY, settings).unwrap();
            advance(&mut solver, own.points());
            let numbers = part.global_vertices.unwrap();
            let mut apart = [0.0_f64; 2];
            for ((number, own), own_pressure) in
                numbers.iter().zip(solver.velocity()).zip(solver.pressure())
            {
                let (velocity, pressure) = (velocity[*number as usize], pressure[*number as usize]);
                apart[0] = apart[0]
                    .max(length(std::array::from_fn(|axis| own[axis] - velocity[axis])) / largest);
                apart[1] = apart[1].max((own_pressure - pressure).abs() / steepest);
            }
            (
                apart,
                solver
                    .fluxes()
                    .iter()
                    .zip(whole.fluxes())
                    .map(|(a, b)| (a - b).abs())
                    .fold(0.0, f64::max),
            )
        });
        for (apart, flux) in apart {
            assert!(
                apart[0] < 1e-8 && apart[1] < 1e-7 && flux < 1e-9,
                "open: {is_open}: {apart:?} {flux:e}"
            );
        }
    }
}

/// A prescribed velocity brings fluid in, takes it out, or drags it along.
#[test]
fn a_patch_knows_what_it_is_to_the_flow() {
    // The triangle's normal is z.
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let role = |condition| {
        let patch = Patch { name: "lid".into(), triangles: vec![[0, 1, 2]], condition };
        patch.role(&points, &[2.0])
    };
    let velocity = |velocity: [f64; 3]| role(Condition::Velocity(velocity.map(Value::Uniform)));
    assert_eq!(velocity([0.0, 0.0, -1.0]), tombolo::Condition::Inflow);
    assert_eq!(velocity([3.0, 0.0, 0.5]), tombolo::Condition::Outflow);
    assert_eq!(velocity([3.0, 1.0, 0.0]), tombolo::Condition::Wall);
    assert_eq!(velocity([0.0; 3]), tombolo::Condition::Wall);
    assert_eq!(role(Condition::Pressure(Value::Uniform(0.0))), tombolo::Condition::Outflow);
    assert_eq!(role(Condition::Slip), tombolo::Condition::Wall);
}
