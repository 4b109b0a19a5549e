//! The ranks of MPI: started without `mpirun`, this program runs itself under it on 1 to 4 ranks.
#![allow(clippy::unwrap_used, reason = "a test")]

use std::{
    os::raw::c_int,
    process::{Command, ExitCode, ExitStatus, Stdio},
    sync::Arc,
    time::{Duration, Instant},
};

use tombolo::{
    Adaptor, Channel, FieldView, Settings, Step,
    communicator::{Alarm, Communicator, Counted, Reduction, threads},
    deform::{
        distributed::{Part, PartBoundary, domain, in_order},
        features::FeatureSettings,
        mesh::{Mesh, Vector},
        shapes::box_of_tets,
        surface::Surface,
        volume::{Deform, Method, VolumeOperator},
    },
    mpi::{Mpi, MpiError, rsmpi},
    petsc::{Petsc, Preconditioning},
    pipelines::{
        language::{parse, parse_json, parse_orders},
        run::History,
    },
};

unsafe extern "C" {
    fn PetscInitializeNoArguments() -> c_int;
    fn PetscFinalized(is: *mut c_int) -> c_int;
    fn PetscFinalize() -> c_int;
}

const PATIENCE: Duration = Duration::from_secs(900);
/// Set where one of the ranks is to fail in itself.
const FAILING: &str = "TOMBOLO_TEST_FAILING_RANK";

fn main() -> ExitCode {
    match std::env::var("OMPI_COMM_WORLD_SIZE").or_else(|_| std::env::var("PMI_SIZE")) {
        Ok(_) if std::env::var_os(FAILING).is_some() => as_failing_ranks(),
        Ok(_) => {
            as_rank();
            ExitCode::SUCCESS
        }
        Err(_) => launch(),
    }
}

/// This program on several ranks.
fn on(ranks: usize) -> Command {
    let mut command = Command::new("mpirun");
    command.args(["--oversubscribe", "--allow-run-as-root", "-n", &ranks.to_string()]);
    command.arg(std::env::current_exe().unwrap());
    command
}

/// Runs it to its end, which is waited for with patience.
fn finish(command: &mut Command) -> Option<ExitStatus> {
    let begun = Instant::now();
    let mut child =
        command.spawn().expect("mpirun: install openmpi-bin, or run scripts/setup --distributed");
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return Some(status);
        }
        if begun.elapsed() > PATIENCE {
            let _ = child.kill();
            return None;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Runs this program on several ranks.
fn launch() -> ExitCode {
    let mut outcomes: Vec<(String, bool)> = (1..=4)
        .map(|ranks| {
            (
                format!("ranks_{ranks}"),
                finish(&mut on(ranks)).is_some_and(|status| status.success()),
            )
        })
        .collect();
    // All ranks are ended where one has a defect: none waits for it.
    let said = tempfile::NamedTempFile::new().unwrap();
    let status = finish(on(3).env(FAILING, "1").stderr(Stdio::from(said.reopen().unwrap())));
    let said = std::fs::read_to_string(said.path()).unwrap();
    let ended =
        status.is_some_and(|status| !status.success()) && said.contains("rank 1 failed in itself");
    outcomes.push(("a_defect_on_one_rank_ends_all".into(), ended));
    let failed = outcomes.iter().filter(|(_, passed)| !passed).count();
    for (name, passed) in &outcomes {
        println!("test {name} ... {}", if *passed { "ok" } else { "FAILED" });
    }
    let outcome = if failed == 0 { "ok" } else { "FAILED" };
    println!(
        "\ntest result: {outcome}. {} passed; {failed} failed; 0 ignored",
        outcomes.len() - failed
    );
    if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// One rank fails in itself, and who called it goes on as if nothing were wrong; the others wait
/// for it. Ends with success where nobody ends it.
fn as_failing_ranks() -> ExitCode {
    tombolo::logging::start();
    let universe = rsmpi::initialize().unwrap();
    let ranks: Arc<dyn Communicator> = Arc::new(Mpi::new(&universe.world()).unwrap());
    let failed = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        let _alarm = Alarm::among(&ranks);
        assert!(ranks.rank() != 1, "a defect");
        ranks.barrier();
    }));
    if failed.is_ok() {
        ExitCode::SUCCESS
    } else {
        std::thread::sleep(2 * PATIENCE);
        ExitCode::SUCCESS
    }
}

fn as_rank() {
    assert_eq!(
        Mpi::new(&rsmpi::topology::SimpleCommunicator::world()).err(),
        Some(MpiError::NotInitialized)
    );
    let (universe, _) = rsmpi::initialize_with_threading(rsmpi::Threading::Funneled).unwrap();
    let world = Mpi::new(&universe.world()).unwrap();
    everything(&world);
    // Half of the ranks, in the other order.
    use rsmpi::topology::{Color, Communicator as _};
    let half = universe.world().split_by_color_with_key(
        Color::with_value(world.rank() as i32 % 2),
        -(world.rank() as i32),
    );
    let half = half.unwrap();
    everything(&Mpi::new(&half).unwrap());
    // PETSc on these ranks alone: one half is at it while the other has not begun, or is through.
    for preconditioning in PRECONDITIONINGS {
        solved(&half, preconditioning, [5, 4, 4]);
    }
    // Once more, on all of them: PETSc has come and gone.
    for preconditioning in PRECONDITIONINGS {
        solved(&universe.world(), preconditioning, [7, 6, 5]);
    }
    // Through several levels of multigrid.
    solved(&universe.world(), Some(Preconditioning::Multigrid), [17, 13, 12]);
    // A solver that has PETSc itself keeps it.
    let mut finalized = 1;
    // SAFETY: MPI is there; PETSc was finalized with the last of the above, and is initialized and
    // finalized once more here.
    unsafe {
        assert_eq!(PetscInitializeNoArguments(), 0);
        solved(&half, Some(Preconditioning::Multigrid), [4, 4, 4]);
        assert_eq!((PetscFinalized(&raw mut finalized), finalized), (0, 0));
        assert_eq!(PetscFinalize(), 0);
    }
    // By the handles that C and Fortran have.
    // SAFETY: the handle of a communicator that is alive.
    let again = unsafe { Mpi::from_raw(world.as_raw()) }.unwrap();
    assert_eq!((again.rank(), again.size()), (world.rank(), world.size()));
    // SAFETY: MPI is initialized, and the handle is alive.
    let fortran = unsafe { rsmpi::ffi::RSMPI_Comm_c2f(world.as_raw()) };
    // SAFETY: as above.
    everything(&unsafe { Mpi::from_fortran(fortran) }.unwrap());
    // SAFETY: the null handle.
    let none = unsafe { Mpi::from_raw(rsmpi::ffi::RSMPI_COMM_NULL) };
    assert_eq!(none.err(), Some(MpiError::Null));
    partitioned(Mpi::new(&universe.world()).unwrap());
    changed_pipelines(Arc::new(Mpi::new(&universe.world()).unwrap()));
    stopped_while_planning(Arc::new(Mpi::new(&universe.world()).unwrap()));
}

/// A stop ends the call in which several ranks find the shapes of an order that takes them long: on
/// all of them, and nothing has moved.
fn stopped_while_planning(ranks: Arc<dyn Communicator>) {
    /// Far more than a set-up takes, and far less than all shapes.
    const BOUND: Duration = Duration::from_secs(15);
    let (rank, size) = (ranks.rank(), ranks.size());
    if !(2..=3).contains(&size) {
        return;
    }
    let mesh = box_of_tets([20, 20, 40], [0.0; 3], [1.0, 1.0, 2.0]);
    let of_cells = in_order(mesh.cells().len(), size);
    let part = Part::cut(&mesh, &of_cells, rank, true).unwrap();
    let config = r#"{"version": 1, "pipelines": [{"name": "shape", "on": "order", "stages": [
        {"guard": {"min_scaled_jacobian": 0.05, "otherwise": "untangle", "surface": "allow"}}]}]}"#;
    let orders = r#"[{"at": {"cycle": 1}, "order": {"edits": [{"rotate": {
        "features": ["z-max"], "fixed": ["z-min"], "axis": [0, 0, 1], "degrees": 170}}]}}]"#;
    let settings = Settings {
        config: parse(config, "test.json").unwrap(),
        orders: parse_orders(orders, "orders.json").unwrap(),
        ..Settings::default()
    };
    let mut adaptor = settings.on(Arc::clone(&ranks)).start().unwrap();
    let execute = |adaptor: &mut Adaptor, cycle: u64| {
        let step = Step { cycle, time: 0.1 * cycle as f64, time_step: 0.1 };
        let steering = adaptor.execute(&step, &[Channel::new("fluid", part.view(), &[])]).unwrap();
        (steering.motion.is_some(), steering.stop)
    };
    assert_eq!(execute(&mut adaptor, 0), (false, false));
    let stopper = adaptor.stopper();
    let stopping = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs(3));
        if rank == 0 {
            stopper.stop();
        }
        Instant::now()
    });
    assert!(!execute(&mut adaptor, 1).0, "its shapes were found before the stop");
    let ended = Instant::now();
    let took = ended.saturating_duration_since(stopping.join().unwrap());
    assert!(took < BOUND, "rank {rank} of {size} went on for {took:?}");
    assert_eq!(execute(&mut adaptor, 2), (false, true));
    let report = adaptor.finalize().unwrap();
    if rank == 0 {
        let reason = report.orders[0].reason.as_deref().unwrap();
        assert!(reason.contains("the run ended"), "{reason}");
    }
}

/// Every call, against what threads make of it.
fn everything(ranks: &dyn Communicator) {
    let (rank, size) = (ranks.rank(), ranks.size());
    for root in 0..size {
        let mut bytes = if rank == root { vec![root as u8; 100_000] } else { vec![1, 2, 3] };
        ranks.broadcast(root, &mut bytes);
        assert_eq!(bytes, vec![root as u8; 100_000]);
        let gathered = ranks.gather(root, &vec![rank as u8; 1000 * rank]);
        assert_eq!(
            gathered,
            (rank == root).then(|| (0..size).map(|rank| vec![rank as u8; 1000 * rank]).collect())
        );
    }
    let values = |rank: usize| {
        [1.0 / (rank as f64 + 3.0), -(rank as f64), if rank == 1 { f64::NAN } else { 1e16 }]
    };
    for reduction in [Reduction::Sum, Reduction::Minimum, Reduction::Maximum] {
        let mut sum = values(rank);
        ranks.reduce(reduction, &mut sum);
        let by_threads = threads::run(size, |ranks| {
            let mut sum = values(ranks.rank());
            ranks.reduce(reduction, &mut sum);
            sum
        });
        assert_eq!(sum.map(f64::to_bits), by_threads[0].map(f64::to_bits));
    }
    for round in 0..200_u8 {
        // To all ranks but those that `round` leaves out, twice to the next one.
        let wanted = |from: usize, to: usize| !(from + to + round as usize).is_multiple_of(3);
        let mut messages: Vec<(usize, Vec<u8>)> = (0..size)
            .filter(|&to| wanted(rank, to))
            .map(|to| (to, vec![round; 10 * rank]))
            .collect();
        messages.push(((rank + 1) % size, vec![rank as u8, round]));
        let before = (rank + size - 1) % size;
        let mut expected: Vec<(usize, Vec<u8>)> = (0..size)
            .filter(|&from| wanted(from, rank))
            .map(|from| (from, vec![round; 10 * from]))
            .collect();
        expected.push((before, vec![before as u8, round]));
        expected.sort_by_key(|(from, _)| *from);
        assert_eq!(ranks.exchange(messages), expected);
    }
    for round in 0..200_u8 {
        // As neighbours do, each of whom knows the others; now and then something else comes
        // between.
        let hears = |to: usize, from: usize| !(from + to + round as usize).is_multiple_of(3);
        let message = |from: usize, to: usize| vec![round; 7 * from + to];
        let messages =
            (0..size).filter(|&to| hears(to, rank)).map(|to| (to, message(rank, to))).collect();
        let from: Vec<usize> = (0..size).filter(|&from| hears(rank, from)).collect();
        let expected: Vec<(usize, Vec<u8>)> =
            from.iter().map(|&from| (from, message(from, rank))).collect();
        assert_eq!(ranks.exchange_with(messages, &from), expected);
        if round.is_multiple_of(50) {
            let heard = ranks.exchange(vec![((rank + 1) % size, vec![round])]);
            assert_eq!(heard, [((rank + size - 1) % size, vec![round])]);
        }
    }
    // Longer than what MPI sends before it is asked for.
    let (next, before) = ((rank + 1) % size, (rank + size - 1) % size);
    let heard = ranks.exchange_with(vec![(next, vec![rank as u8; 3_000_000])], &[before]);
    assert_eq!(heard, [(before, vec![before as u8; 3_000_000])]);
    ranks.barrier();
}

const PRECONDITIONINGS: [Option<Preconditioning>; 5] = [
    None,
    Some(Preconditioning::Multigrid),
    Some(Preconditioning::IncompleteCholesky),
    Some(Preconditioning::Gamg),
    Some(Preconditioning::Jacobi),
];

/// PETSc moves the volume as one process does, again on cells that have moved, and says why it
/// cannot.
fn solved(
    world: &rsmpi::topology::SimpleCommunicator,
    preconditioning: Option<Preconditioning>,
    cells: [usize; 3],
) {
    let ranks: Arc<dyn Communicator> = Arc::new(Mpi::new(world).unwrap());
    let solvers = Petsc::solvers(world, preconditioning).unwrap();
    let mesh = box_of_tets(cells, [0.0; 3], [1.0; 3]);
    // The last rank has no cells.
    let (count, parts) = (mesh.cells().len(), (ranks.size() - 1).max(1));
    let of_cells = in_order(count, parts);
    let part = Part::cut(&mesh, &of_cells, ranks.rank(), false).unwrap();
    let (domain, boundary) = domain(&ranks, &part, &FeatureSettings::default()).unwrap();
    let own = domain.mesh();
    let numbers: Vec<usize> =
        part.global_vertices.iter().flatten().map(|&number| number as usize).collect();
    let wave = |[x, y, z]: Vector| [0.1 * (3.0 * y).sin(), 0.2 * x * z, -0.1 * (4.0 * x).cos()];
    let on = |mesh: &Mesh, vertices: &[u32]| -> Vec<Vector> {
        vertices.iter().map(|&vertex| wave(mesh.points()[vertex as usize])).collect()
    };
    let surface = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
    for method in [Method::Elasticity, Method::Harmonic] {
        let settings = Deform { method, tolerance: 1e-10, ..Deform::default() };
        let serial = VolumeOperator::new(&mesh, surface.vertices(), &settings).unwrap();
        let expected = serial.solve(&on(&mesh, surface.vertices())).unwrap().displacement;
        let operator =
            VolumeOperator::with_sliding(&domain, boundary.vertices(), &[], &settings, &*solvers)
                .unwrap();
        let again = operator.updated(own).unwrap();
        for operator in [&operator, &again] {
            let found = operator.solve(&on(own, boundary.vertices())).unwrap();
            for (value, &number) in found.displacement.iter().zip(&numbers) {
                let off = (0..3)
                    .map(|axis| (value[axis] - expected[number][axis]).abs())
                    .fold(0.0, f64::max);
                assert!(
                    off < 1e-8,
                    "{preconditioning:?} {method:?}: {off:e} in {} iterations",
                    found.iterations
                );
            }
        }
        let still = operator.solve(&vec![[0.0; 3]; boundary.vertices().len()]).unwrap();
        assert!(still.displacement.iter().all(|value| *value == [0.0; 3]));
        let mut bad = on(own, boundary.vertices());
        if let Some(first) = bad.first_mut() {
            first[1] = f64::NAN;
        }
        assert!(operator.solve(&bad).is_err(), "on all ranks");
    }
}

/// The surface of a mesh in parts is that of the whole.
fn partitioned(ranks: Mpi) {
    let counted = Arc::new(Counted::new(ranks));
    let ranks: Arc<dyn Communicator> = counted.clone();
    let mesh = box_of_tets([6, 5, 4], [0.0; 3], [1.0; 3]);
    let of_cells = in_order(mesh.cells().len(), ranks.size());
    let part = Part::cut(&mesh, &of_cells, ranks.rank(), true).unwrap();
    let (_, boundary) = PartBoundary::find(&ranks, &part, &FeatureSettings::default()).unwrap();
    if let Some(surface) = boundary.surface() {
        assert_eq!(**surface, Surface::extract(&mesh, &FeatureSettings::default()).unwrap());
    }
    assert_eq!(ranks.rank() == 0, boundary.surface().is_some());
    assert!(ranks.size() == 1 || counted.traffic().bytes_sent > 0);
}

/// All ranks add, replace and refuse pipelines at the same cycles, whether a file, the program or
/// rank 0 alone asks for it.
fn changed_pipelines(ranks: Arc<dyn Communicator>) {
    let mesh = box_of_tets([6, 5, 4], [0.0; 3], [1.0; 3]);
    let (rank, size) = (ranks.rank(), ranks.size());
    let of_cells = in_order(mesh.cells().len(), size);
    let part = Part::cut(&mesh, &of_cells, rank, true).unwrap();
    let heights: Vec<f64> = part.points.iter().map(|point| point[2]).collect();
    let of = |field: &str| {
        format!(
            r#"{{"name": "{field}", "stages": [{{"slice": {{"origin": [0.3, 0, 0], "normal": [1, 0, 0]}}}},
                {{"statistics": {{"field": "{field}"}}}}, {{"integrate": {{"name": "cut"}}}}]}}"#
        )
    };
    let orders = format!(
        r#"[{{"at": {{"cycle": 2}}, "pipelines": {{"set": [{}]}}}},
            {{"at": {{"cycle": 3}}, "pipelines": {{"set": [{}]}}}}]"#,
        of("height"),
        of("hieght"),
    );
    let settings = Settings {
        config: parse(r#"{"version": 1}"#, "test.json").unwrap(),
        orders: parse_orders(&orders, "orders.json").unwrap(),
        ..Settings::default()
    };
    let mut adaptor = settings.on(Arc::clone(&ranks)).start().unwrap();
    for cycle in 0..10 {
        if cycle == 5 {
            let text = r#"{"set": [{"name": "health", "stages": [{"quality": {}}]}]}"#;
            adaptor.change_pipelines(parse_json(text, "change").unwrap()).unwrap();
        }
        if cycle == 7 && rank == 0 {
            let text = r#"{"remove": ["height"]}"#;
            adaptor.change_pipelines(parse_json(text, "change").unwrap()).unwrap();
        }
        let step = Step { cycle, time: 0.1 * cycle as f64, time_step: 0.1 };
        let fields = [FieldView::vertex("height", &heights)];
        adaptor.execute(&step, &[Channel::new("fluid", part.view(), &fields)]).unwrap();
        assert_eq!(adaptor.history("height").is_some(), (2..7).contains(&cycle), "cycle {cycle}");
        assert_eq!(adaptor.history("health").is_some(), cycle >= 5, "cycle {cycle}");
        assert!(adaptor.history("hieght").is_none());
        if let Some(last) = adaptor.history("height").and_then(History::last) {
            let history = adaptor.history("height").unwrap();
            let area = history.monitors().iter().position(|it| it.name == "cut.size");
            assert_eq!(last.cycle, cycle);
            assert!((last.values[area.unwrap()] - 1.0).abs() < 1e-12, "{last:?}");
        }
    }
    assert_eq!(adaptor.history("health").unwrap().count(), 4);
    assert_eq!(adaptor.finalize().unwrap().pipelines.len(), 1);
}
