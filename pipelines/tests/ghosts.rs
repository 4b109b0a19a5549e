//! Cells that are copies, hidden, or covered by finer ones, against what VTK draws of the same
//! cells.

mod common;

use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use common::{hide, runner, shown};
use proptest::prelude::*;
use serde_json::Value;
use tombolo_deform::bounds::Bounds;
use tombolo_deform::communicator::{Communicator, Solo, threads};
use tombolo_deform::distributed::{Part, in_order};
use tombolo_deform::mesh::{CellType, Cells, Mesh, Vector, ghosts};
use tombolo_deform::shapes::{box_of_hexahedra, box_of_mixed_cells};
use tombolo_deform::vector::{add, cross, length, subtract};
use tombolo_pipelines::extract::{Channel, Extract, FieldView, Snapshot};
use tombolo_pipelines::files;
use tombolo_pipelines::run::Output;

/// The bits that cells may have: their own and their neighbours' connectivity, and the outside,
/// change nothing.
const BITS: [u8; 8] = [0, 0, ghosts::DUPLICATE, ghosts::REFINED, ghosts::HIDDEN, 33, 2 | 4, 16];

const PIPELINES: &str = r#"
    {"name": "surface", "stages": [{"surface": {}}, {"stream": {}}]},
    {"name": "cut", "stages": [{"slice": {"origin": [1.05, 0.3, 0.45], "normal": [1, 0.2, 0.1]}}, {"stream": {}}]},
    {"name": "written", "stages": [{"select": {"fields": ["load"]}}, {"write": {"file": "all.vtu"}}]},
    {"name": "health", "stages": [{"quality": {}}, {"statistics": {"field": "speed"}}, {"statistics": {"field": "load"}}]}"#;

/// What pipelines make of a part: the extracts of the first three, and the values of the last.
#[derive(Debug, Default)]
struct Made {
    extracts: Vec<Arc<Extract>>,
    values: Vec<f64>,
}

fn made(part: &Part, communicator: Arc<dyn Communicator>) -> Made {
    let speed: Vec<f64> = part.points.iter().map(|[x, y, z]| x + y * z).collect();
    let number = |cell: usize| {
        part.global_cells.as_ref().map_or(cell as f64, |numbers| numbers[cell] as f64)
    };
    let load: Vec<f64> = (0..part.cells.len()).map(number).collect();
    let fields = [FieldView::vertex("speed", &speed), FieldView::element("load", &load)];
    let channels = [Channel::new("fluid", part.view(), shown(part, &fields))];
    let mut runner = runner(PIPELINES, communicator);
    let mut made = Made::default();
    for output in runner.run(&Snapshot { cycle: 0, time: 0.0, channels: &channels }) {
        match output {
            Output::Frame(frame) => made.extracts.push(frame.extract),
            Output::Write { extract, .. } => made.extracts.push(extract),
            Output::Monitor(monitor) => {
                made.values = monitor.values.into_iter().map(|(_, value)| value).collect()
            }
            other => panic!("{other:?}"),
        }
    }
    made
}

fn area(points: &[Vector], cells: &Cells) -> f64 {
    let of_cell = |vertices: &[u32]| {
        let corner = |index: usize| points[vertices[index] as usize];
        let twice = (1..vertices.len() - 1).fold([0.0; 3], |sum, index| {
            add(
                sum,
                cross(subtract(corner(index), corner(0)), subtract(corner(index + 1), corner(0))),
            )
        });
        0.5 * length(twice)
    };
    cells.iter().map(|(_, vertices)| of_cell(vertices)).sum()
}

/// What VTK finds by a script of tests/vtk.
fn vtk(script: &str, arguments: &[String]) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/vtk").join(script);
    let output = Command::new("/usr/bin/python3")
        .arg(script)
        .args(arguments)
        .output()
        .expect("scripts/setup installs VTK");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("JSON")
}

fn is_measured(extract: &Extract, by_vtk: &Value) {
    assert_eq!(extract.cells.len(), by_vtk["faces"]);
    let (area, expected) =
        (area(&extract.points, &extract.cells), by_vtk["area"].as_f64().unwrap());
    assert!((area - expected).abs() < 1e-9 * expected.max(1.0), "{area}, {expected}");
}

fn bits_of(extract: &Extract) -> Option<Vec<u8>> {
    let field = extract.fields.iter().find(|field| field.name == "vtkGhostType")?;
    Some(field.values.iter().map(|&bits| bits as u8).collect())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, max_shrink_iters: 0, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn one_process_shows_what_vtk_does(bits in prop::collection::vec(prop::sample::select(&BITS[..]), 60), copies in any::<bool>()) {
        let bits: Vec<u8> = bits.into_iter().map(|bits| if copies { bits } else { bits & !ghosts::DUPLICATE }).collect();
        prop_assume!(bits.iter().any(|&bits| !ghosts::is_own(bits)) && bits.iter().any(|&bits| ghosts::is_own(bits)));
        let mesh = box_of_hexahedra([5, 4, 3], [0.0; 3], [2.0, 1.0, 1.0]);
        let part = Part { ghosts: Some(bits.clone()), ..Part::of(&(&mesh).into()).unwrap() };
        let Made { extracts, values } = made(&part, Arc::new(Solo));
        let [surface, cut, written] = &extracts[..] else { panic!("{extracts:?}") };

        // What is written is the whole mesh, which says what is what.
        prop_assert_eq!(written.cells.len(), 60);
        prop_assert_eq!(bits_of(written), Some(bits.clone()));
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("all.vtu");
        files::write(&file, written).unwrap();
        let plane = ["1.05", "0.3", "0.45", "1", "0.2", "0.1"].map(String::from);
        let arguments = [&[file.to_string_lossy().into_owned()][..], &plane[..]].concat();
        let by_vtk = vtk("ghosts.py", &arguments);
        prop_assert_eq!(&by_vtk["bits"], &serde_json::json!(bits));
        is_measured(surface, &by_vtk["surface"]);
        is_measured(cut, &by_vtk["cut"]);

        // What is shown and measured are the own cells.
        let own: Vec<usize> = (0..60).filter(|&cell| ghosts::is_own(bits[cell])).collect();
        let loads: Vec<f64> = own.iter().map(|&cell| cell as f64).collect();
        let mut touched = vec![false; mesh.points().len()];
        own.iter().flat_map(|&cell| mesh.cells().vertices(cell)).for_each(|&vertex| touched[vertex as usize] = true);
        let speeds = mesh.points().iter().zip(touched).filter(|(_, touched)| *touched).map(|([x, y, z], _)| x + y * z);
        let fastest = speeds.fold(f64::NEG_INFINITY, f64::max);
        // Least, mean, largest and inverted of the quality; least, largest, mean, ... of each
        // field.
        prop_assert_eq!(values[5], fastest);
        prop_assert_eq!((values[9], values[10]), (loads[0], *loads.last().unwrap()));
    }
}

/// Hidden cells on several ranks, with copies of cells that border on them: all is as on one.
#[test]
fn ranks_show_what_one_process_does() {
    let meshes = [
        box_of_hexahedra([5, 4, 3], [0.0; 3], [2.0, 1.0, 1.0]),
        box_of_mixed_cells([3, 3, 4], [0.0; 3], [2.0, 1.0, 1.0]),
    ];
    for mesh in meshes {
        let count = mesh.cells().len();
        let hidden: Vec<u8> = (0..count)
            .map(|cell| [0, 0, ghosts::HIDDEN, 0, ghosts::REFINED, 0, 16][cell * cell % 7])
            .collect();
        let serial = made(
            &Part { ghosts: Some(hidden.clone()), ..Part::of(&(&mesh).into()).unwrap() },
            Arc::new(Solo),
        );
        for (ranks, copies) in [(1, true), (2, true), (3, false), (4, true)] {
            let of_cells = in_order(count, ranks);
            let mut outcomes = threads::run(ranks, |ranks| {
                let mut part = Part::cut(&mesh, &of_cells, ranks.rank(), copies).unwrap();
                hide(&mut part, &hidden);
                made(&part, Arc::new(ranks))
            });
            let Made { extracts, values } = outcomes.swap_remove(0);
            for (extract, expected) in extracts.iter().zip(&serial.extracts) {
                assert_eq!(extract.cells.len(), expected.cells.len(), "{ranks} ranks");
                if extract.cells.types().iter().all(|of_cell| of_cell.dimension() == 2) {
                    let (found, expected) = (
                        area(&extract.points, &extract.cells),
                        area(&expected.points, &expected.cells),
                    );
                    assert!(
                        (found - expected).abs() < 1e-12 * expected,
                        "{ranks} ranks: {found}, {expected}"
                    );
                }
            }
            assert_eq!(bits_of(&extracts[2]), Some(hidden.clone()));
            for (found, expected) in values.iter().zip(&serial.values) {
                assert!(
                    (found - expected).abs() < 1e-12,
                    "{ranks} ranks: {values:?}, {:?}",
                    serial.values
                );
            }
        }
    }
}

/// A grid of two levels as a solver has it: each coarse cell, or eight fine ones, by their corners.
fn grid_of_levels(counts: [usize; 3], refined: &[bool]) -> Vec<(usize, Vec<[Vector; 8]>)> {
    let corners = |lower: Vector, size: f64| -> [Vector; 8] {
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
            .map(|corner| std::array::from_fn(|axis| lower[axis] + f64::from(corner[axis]) * size))
    };
    let cells = (0..refined.len()).map(|cell| {
        let lower =
            [cell % counts[0], cell / counts[0] % counts[1], cell / (counts[0] * counts[1])]
                .map(|at| at as f64);
        let fine = |octant: usize| {
            corners([0, 1, 2].map(|axis| lower[axis] + 0.5 * (octant >> axis & 1) as f64), 0.5)
        };
        (cell, if refined[cell] { (0..8).map(fine).collect() } else { vec![corners(lower, 1.0)] })
    });
    cells.collect()
}

fn part_of_levels(grids: &[(usize, Vec<[Vector; 8]>)], boxes: &[Bounds]) -> Part {
    let (mut points, mut cells) = (Vec::<Vector>::new(), Cells::new());
    for corners in grids.iter().flat_map(|(_, cells)| cells) {
        let vertices = corners.map(|corner| {
            let known = points.iter().position(|point| *point == corner);
            known.unwrap_or_else(|| {
                points.push(corner);
                points.len() - 1
            }) as u32
        });
        cells.push(CellType::Hexahedron, &vertices).unwrap();
    }
    let mesh = Mesh::new(points, cells, Default::default()).unwrap();
    Part { grid_boxes: boxes.to_vec(), ..Part::of(&(&mesh).into()).unwrap() }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, max_shrink_iters: 0, failure_persistence: None, ..ProptestConfig::default() })]

    /// Faces between levels are inside: the area is that of the box, and the faces are those that
    /// VTK draws of a vtkHyperTreeGrid.
    #[test]
    fn nothing_between_levels_is_drawn(refined in prop::collection::vec(any::<bool>(), 24), seed in any::<u64>()) {
        let counts = [4, 3, 2];
        let grids = grid_of_levels(counts, &refined);
        let boxes: Vec<Bounds> = grids.iter().map(|(_, cells)| Bounds::around(cells.iter().flatten().copied())).collect();
        let descriptor: String = refined.iter().map(|&refined| if refined { 'R' } else { '.' }).collect();
        let [x, y, z] = counts.map(|count| count.to_string());
        let by_vtk = vtk("levels.py", &[x, y, z, descriptor]);
        for ranks in 1..=4 {
            let rank_of = |cell: usize| (seed >> (2 * cell)) as usize % ranks;
            let mut outcomes = threads::run(ranks, |communicator| {
                let rank = communicator.rank();
                let own: Vec<_> = grids.iter().filter(|(cell, _)| rank_of(*cell) == rank).cloned().collect();
                made(&part_of_levels(&own, &boxes), Arc::new(communicator))
            });
            let surface = outcomes.swap_remove(0).extracts.swap_remove(0);
            is_measured(&surface, &by_vtk);
            let box_area = 2.0 * f64::from(4 * 3 + 3 * 2 + 2 * 4);
            prop_assert!((area(&surface.points, &surface.cells) - box_area).abs() < 1e-12 * box_area);
        }
    }
}
