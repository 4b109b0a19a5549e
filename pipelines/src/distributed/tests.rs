//! Parts of meshes against the same meshes on one process.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use tombolo_deform::{
    mesh::{ArrayView, CellType, Cells, FeatureSource, Mesh, NumberType, TaggedFaces, Vector},
    partition::Partition,
    shapes::{box_of_hexahedra, box_of_tets},
    surface::{FeatureSettings, Surface},
    volume::{Deform, Method, VolumeOperator},
};

use super::*;
use crate::communicator::{Communicator, Counted, threads};
use crate::extract::{Association, Channel, Extract, FieldView, Snapshot};
use crate::run::{Output, Runner};

/// A repeatable shuffle.
fn shuffled(count: usize, seed: u64) -> Vec<usize> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut order: Vec<usize> = (0..count).collect();
    for place in (1..count).rev() {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        order.swap(place, (state >> 33) as usize % (place + 1));
    }
    order
}

/// The same part with its vertices and cells in another order.
pub(crate) fn renumbered(part: &Part, seed: u64) -> Part {
    let vertices = shuffled(part.points.len(), seed);
    let cells = shuffled(part.cells.len(), seed + 1);
    let mut new = vec![0; vertices.len()];
    vertices.iter().enumerate().for_each(|(number, &vertex)| new[vertex] = number as u32);
    let renumber = |of: &[u32]| of.iter().map(|&vertex| new[vertex as usize]).collect::<Vec<u32>>();
    let mut own = Cells::new();
    for &cell in &cells {
        own.push(part.cells.cell_type(cell), &renumber(part.cells.vertices(cell))).unwrap();
    }
    let features = match &part.features {
        FeatureSource::Faces(tagged) => {
            let mut faces = Cells::new();
            tagged
                .faces
                .iter()
                .for_each(|(cell_type, face)| faces.push(cell_type, &renumber(face)).unwrap());
            FeatureSource::Faces(TaggedFaces { faces, ..tagged.clone() })
        }
        FeatureSource::Vertices(tags) => {
            FeatureSource::Vertices(vertices.iter().map(|&old| tags[old]).collect())
        }
        FeatureSource::SharpEdges => FeatureSource::SharpEdges,
    };
    let pick = |numbers: &Option<Vec<u64>>, order: &[usize]| {
        numbers.as_ref().map(|numbers| order.iter().map(|&old| numbers[old]).collect())
    };
    Part {
        points: vertices.iter().map(|&vertex| part.points[vertex]).collect(),
        cells: own,
        features,
        global_vertices: pick(&part.global_vertices, &vertices),
        global_cells: pick(&part.global_cells, &cells),
        ghosts: part.ghosts.as_ref().map(|ghosts| cells.iter().map(|&cell| ghosts[cell]).collect()),
    }
}

/// Cells dealt out by where they lie, in slanted slabs; `empty` gets none.
pub(crate) fn dealt(mesh: &Mesh, ranks: usize, empty: Option<usize>) -> Vec<usize> {
    let ranks: Vec<usize> = (0..ranks).filter(|&rank| Some(rank) != empty).collect();
    let places: Vec<f64> = mesh
        .cells()
        .iter()
        .map(|(_, vertices)| {
            let sum = |axis: usize| {
                vertices.iter().map(|&vertex| mesh.points()[vertex as usize][axis]).sum::<f64>()
            };
            (sum(0) + 0.3 * sum(1) + 0.2 * sum(2)) / vertices.len() as f64
        })
        .collect();
    let (low, high) =
        places.iter().fold((f64::MAX, f64::MIN), |(low, high), &x| (low.min(x), high.max(x)));
    let slab = |place: f64| {
        (((place - low) / (high - low) * ranks.len() as f64) as usize).min(ranks.len() - 1)
    };
    places.into_iter().map(|place| ranks[slab(place)]).collect()
}

fn meshes() -> Vec<Mesh> {
    let tets = box_of_tets([5, 4, 3], [0.0; 3], [2.0, 1.0, 1.0]);
    let sharp =
        Mesh::new(tets.points().to_vec(), tets.cells().clone(), FeatureSource::SharpEdges).unwrap();
    let tags = tets.points().iter().map(|point| i64::from(point[0] > 1.0)).collect();
    let by_vertex =
        Mesh::new(tets.points().to_vec(), tets.cells().clone(), FeatureSource::Vertices(tags))
            .unwrap();
    let surface = Surface::extract(&tets, &FeatureSettings::default()).unwrap();
    let plane =
        Mesh::new(surface.points().to_vec(), surface.faces().clone(), FeatureSource::SharpEdges)
            .unwrap();
    vec![tets, sharp, by_vertex, box_of_hexahedra([4, 3, 3], [-1.0; 3], [1.0; 3]), plane]
}

/// The faces of each feature by the places of their corners, whatever the numbering.
fn by_place(surface: &Surface) -> BTreeSet<BTreeSet<Vec<[u64; 3]>>> {
    let place = |vertex: u32| surface.points()[vertex as usize].map(f64::to_bits);
    let face = |face: u32| {
        let mut corners: Vec<_> =
            surface.faces().vertices(face as usize).iter().map(|&vertex| place(vertex)).collect();
        let lowest = (0..corners.len()).min_by_key(|&corner| corners[corner]).unwrap();
        corners.rotate_left(lowest);
        corners
    };
    let feature = |feature: u32| surface.features().faces(feature).map(face).collect();
    (0..surface.features().names().len() as u32).map(feature).collect()
}

#[test]
fn the_surface_is_that_of_one_process() {
    for mesh in meshes() {
        let serial = Surface::extract(&mesh, &FeatureSettings::default()).unwrap();
        for (ranks, empty) in [(1, None), (2, None), (3, Some(1)), (4, None), (4, Some(0))] {
            let of_cells = dealt(&mesh, ranks, empty);
            for (ghosts, shuffle, numbers) in [
                (false, 0, true),
                (true, 0, true),
                (true, 7, true),
                (false, 3, false),
                (true, 5, false),
            ] {
                let outcomes = threads::run(ranks, |ranks| {
                    let mut part = Part::cut(&mesh, &of_cells, ranks.rank(), ghosts).unwrap();
                    if shuffle > 0 {
                        part = renumbered(&part, shuffle + ranks.rank() as u64);
                    }
                    if !numbers {
                        (part.global_vertices, part.global_cells) = (None, None);
                    }
                    let (shared, boundary) =
                        PartBoundary::find(&ranks, &part, &FeatureSettings::default()).unwrap();
                    assert_eq!(shared.count(), mesh.points().len() as u64);
                    // Out and back: each vertex of the boundary hears its own place.
                    let places = boundary.surface().map(|surface| surface.points().to_vec());
                    let mine = boundary.scatter(&ranks, places.as_deref()).unwrap();
                    let expected: Vec<Vector> = boundary
                        .vertices()
                        .iter()
                        .map(|&vertex| part.points[vertex as usize])
                        .collect();
                    assert_eq!(mine, expected);
                    assert_eq!(boundary.gather(&ranks, &part.points).unwrap(), places);
                    (shared.owned(), boundary.surface().cloned())
                });
                assert_eq!(
                    outcomes.iter().map(|(owned, _)| owned).sum::<usize>(),
                    mesh.points().len()
                );
                let surface = outcomes[0].1.clone().unwrap();
                if numbers {
                    assert_eq!(*surface, serial);
                } else {
                    assert_eq!(by_place(&surface), by_place(&serial));
                    assert_eq!(surface.points().len(), serial.points().len());
                }
            }
        }
    }
}

#[test]
fn values_at_shared_vertices_are_the_same_everywhere() {
    let mesh = box_of_tets([4, 4, 4], [0.0; 3], [1.0; 3]);
    let of_cells = dealt(&mesh, 4, None);
    let whole: Vec<usize> = {
        let mut count = vec![0; mesh.points().len()];
        mesh.cells().connectivity().iter().for_each(|&vertex| count[vertex as usize] += 1);
        count
    };
    threads::run(4, |ranks| {
        let part = renumbered(
            &Part::cut(&mesh, &of_cells, ranks.rank(), true).unwrap(),
            11 + ranks.rank() as u64,
        );
        let shared = SharedVertices::find(&ranks, &part).unwrap();
        // How many cells each vertex has, each rank counting its own.
        let mut counts = vec![[0.0; 3]; part.points.len()];
        for cell in (0..part.cells.len()).filter(|&cell| !part.is_ghost(cell)) {
            part.cells.vertices(cell).iter().for_each(|&vertex| counts[vertex as usize][0] += 1.0);
        }
        shared.sum(&ranks, &mut counts).unwrap();
        for (count, &number) in counts.iter().zip(shared.numbers()) {
            assert_eq!(count[0], whole[number as usize] as f64);
        }
        // Only the owner knows; all hear it.
        let mut known: Vec<Vector> = (0..part.points.len() as u32)
            .map(
                |vertex| {
                    if shared.owns(vertex) { part.points[vertex as usize] } else { [f64::NAN; 3] }
                },
            )
            .collect();
        shared.take_from_owners(&ranks, &mut known).unwrap();
        assert_eq!(known, part.points);
    });
}

#[test]
fn what_is_wrong_on_one_rank_is_known_to_all() {
    let mesh = box_of_tets([3, 2, 2], [0.0; 3], [1.0; 3]);
    let of_cells = dealt(&mesh, 3, None);
    let fault = |break_it: &(dyn Fn(&mut Part) + Sync)| {
        let outcomes = threads::run(3, |ranks| {
            let mut part = Part::cut(&mesh, &of_cells, ranks.rank(), false).unwrap();
            if ranks.rank() == 1 {
                break_it(&mut part);
            }
            PartBoundary::find(&ranks, &part, &FeatureSettings::default())
                .map(drop)
                .unwrap_err()
                .to_string()
        });
        assert!(outcomes.iter().all(|outcome| *outcome == outcomes[0]), "{outcomes:?}");
        outcomes[0].clone()
    };
    let said = fault(&|part| {
        part.cells =
            Cells::uniform(tombolo_deform::mesh::CellType::Tetra, vec![0, 1, 2, 9999]).unwrap()
    });
    assert!(said.starts_with("rank 1: ") && said.contains("vertex 9999"), "{said}");
    let said = fault(&|part| part.global_vertices = None);
    assert!(said.starts_with("rank 1: ") && said.contains("global numbers"), "{said}");
    let said = fault(&|part| {
        let mut numbers = part.global_vertices.clone().unwrap();
        let last = numbers.len() - 1;
        numbers[0] = numbers[last];
        part.global_vertices = Some(numbers);
    });
    assert!(said.starts_with("rank 1: ") && said.contains("the same global number"), "{said}");
}

#[test]
fn a_rank_hears_of_its_neighbours_alone() {
    // Slabs in a row: however many there are, one in the middle speaks to two others of what lies between them.
    let sent = |ranks: usize| {
        let mesh = box_of_tets([2 * ranks, 3, 3], [0.0; 3], [ranks as f64, 1.0, 1.0]);
        let of_cells: Vec<usize> = (0..mesh.cells().len())
            .map(|cell| {
                let vertices = mesh.cells().vertices(cell);
                let x =
                    vertices.iter().map(|&vertex| mesh.points()[vertex as usize][0]).sum::<f64>()
                        / 4.0;
                (x as usize).min(ranks - 1)
            })
            .collect();
        let counts = threads::run(ranks, |ranks| {
            let ranks = Counted::new(ranks);
            let part = Part::cut(&mesh, &of_cells, ranks.rank(), false).unwrap();
            let (shared, _) =
                PartBoundary::find(&ranks, &part, &FeatureSettings::default()).unwrap();
            assert!(shared.neighbours().len() <= 2);
            let before = ranks.traffic();
            shared.sum(&ranks, &mut vec![[1.0; 3]; part.points.len()]).unwrap();
            ranks.traffic() - before
        });
        counts[2]
    };
    assert_eq!(sent(4), sent(8));
    assert_eq!(sent(8).messages_sent, 2);
}

const PIPELINES: &str = r#"{"version": 1, "pipelines": [
    {"name": "surface", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]},
    {"name": "cut", "every": {"steps": 1}, "stages": [
        {"slice": {"origin": [1.05, 0.3, 0.4], "normal": [1, 0.2, 0.1]}}, {"quality": {}}, {"stream": {}}]},
    {"name": "along a grid plane", "every": {"steps": 1}, "stages": [
        {"slice": {"origin": [0.8, 0, 0], "normal": [1, 0, 0]}}, {"stream": {}}]},
    {"name": "all", "every": {"steps": 1}, "stages": [{"write": {"file": "all-{cycle}.vtu"}}]},
    {"name": "health", "every": {"steps": 1}, "stages": [
        {"quality": {}}, {"statistics": {"field": "speed"}}, {"statistics": {"field": "load"}}],
        "when": "quality.min < 2", "then": [{"pause": {}}]}]}"#;

type Rounded = Vec<i64>;

fn rounded(values: &[f64]) -> Rounded {
    values.iter().map(|value| (value * 1e9).round() as i64).collect()
}

/// The cells of an extract with all that is on them, whatever the numbering.
fn content(extract: &Extract) -> (usize, BTreeSet<(Vec<Rounded>, Rounded)>) {
    let corner = |point: u32| {
        let mut all = extract.points[point as usize].to_vec();
        for field in extract.fields.iter().filter(|field| field.association == Association::Vertex)
        {
            all.extend(&field.values[point as usize * field.components..][..field.components]);
        }
        rounded(&all)
    };
    let cell = |(cell, (_, points)): (usize, (tombolo_deform::mesh::CellType, &[u32]))| {
        let mut corners: Vec<Rounded> = points.iter().map(|&point| corner(point)).collect();
        corners.sort();
        let mut values = Vec::new();
        for field in extract.fields.iter().filter(|field| field.association == Association::Element)
        {
            values.extend(&field.values[cell * field.components..][..field.components]);
        }
        (corners, rounded(&values))
    };
    (extract.points.len(), extract.cells.iter().enumerate().map(cell).collect())
}

/// Extracts by the names of their pipelines, and the values of monitors.
type Made = (BTreeMap<String, Arc<Extract>>, Vec<(String, f64)>);

/// What the pipelines make of a part.
fn made(part: &Part, communicator: Arc<dyn Communicator>) -> Made {
    let speed: Vec<f64> = part.points.iter().map(|[x, y, z]| x + y * z).collect();
    let number = |cell: usize| {
        part.global_cells.as_ref().map_or(cell as f64, |numbers| numbers[cell] as f64)
    };
    // What stands in ghosts is nobody's business.
    let load: Vec<f64> = (0..part.cells.len())
        .map(|cell| if part.is_ghost(cell) { f64::NAN } else { number(cell) })
        .collect();
    let fields = [
        FieldView {
            name: "speed",
            association: Association::Vertex,
            values: ArrayView::scalars(&speed),
        },
        FieldView {
            name: "load",
            association: Association::Element,
            values: ArrayView::scalars(&load),
        },
    ];
    let shown = if part.points.is_empty() { &fields[..0] } else { &fields[..] };
    let channels = [Channel { name: "fluid", mesh: part.view(), fields: shown }];
    let config = crate::language::parse(PIPELINES, "test.json").unwrap();
    let rank = communicator.rank();
    let mut runner = Runner::with_communicator(&config, communicator).unwrap();
    let (mut extracts, mut values, mut pauses) = (BTreeMap::new(), Vec::new(), 0);
    for cycle in 0..2 {
        for output in runner.run(&Snapshot { cycle, time: 0.0, channels: &channels }) {
            match output {
                Output::Frame(frame) => {
                    drop(extracts.insert(frame.pipeline.to_string(), frame.extract))
                }
                Output::Write { pipeline, extract, .. } => {
                    drop(extracts.insert(pipeline.to_string(), extract))
                }
                Output::Monitor(monitor) => values.extend(monitor.values),
                Output::Pause { .. } => pauses += 1,
                other => panic!("{other:?}"),
            }
        }
    }
    assert_eq!(pauses, 2);
    assert!(rank == 0 || extracts.is_empty());
    (extracts, values)
}

#[test]
fn extracts_are_those_of_one_process() {
    let mesh = box_of_tets([5, 4, 3], [0.0; 3], [2.0, 1.0, 1.0]);
    let whole = Part::cut(&mesh, &vec![0; mesh.cells().len()], 0, false).unwrap();
    let (serial, monitors) = made(&whole, Arc::new(crate::communicator::Solo));
    for (ranks, empty, ghosts, shuffle) in
        [(2, None, false, 0), (3, Some(1), true, 0), (4, None, true, 9), (4, Some(0), false, 5)]
    {
        let of_cells = dealt(&mesh, ranks, empty);
        let outcomes = threads::run(ranks, |ranks| {
            let mut part = Part::cut(&mesh, &of_cells, ranks.rank(), ghosts).unwrap();
            if shuffle > 0 {
                part = renumbered(&part, shuffle + ranks.rank() as u64);
                part.global_vertices = None;
            }
            made(&part, Arc::new(ranks))
        });
        let (extracts, _) = &outcomes[0];
        assert_eq!(extracts.keys().collect::<Vec<_>>(), serial.keys().collect::<Vec<_>>());
        for (name, extract) in extracts {
            assert_eq!(content(extract), content(&serial[name]), "{name} on {ranks} ranks");
        }
        for (_, values) in &outcomes {
            assert_eq!(values.len(), monitors.len());
            for ((name, value), (expected_name, expected)) in values.iter().zip(&monitors) {
                assert_eq!(name, expected_name);
                assert!(
                    (value - expected).abs() <= 1e-12 * expected.abs(),
                    "{name}: {value}, {expected}"
                );
            }
        }
    }
}

#[test]
fn a_field_that_is_wrong_on_one_rank_stops_nobody() {
    let mesh = box_of_tets([3, 2, 2], [0.0; 3], [2.0, 1.0, 1.0]);
    let of_cells = dealt(&mesh, 3, None);
    let outcomes = threads::run(3, |ranks| {
        let rank = ranks.rank();
        let part = Part::cut(&mesh, &of_cells, rank, false).unwrap();
        let mut speed: Vec<f64> = part.points.iter().map(|point| point[0]).collect();
        if rank == 2 {
            *speed.last_mut().unwrap() = f64::NAN;
        }
        // Rank 1 lacks one field.
        let fields = [
            FieldView {
                name: "speed",
                association: Association::Vertex,
                values: ArrayView::scalars(&speed),
            },
            FieldView {
                name: "other",
                association: Association::Vertex,
                values: ArrayView::scalars(&speed),
            },
        ];
        let shown = &fields[..if rank == 1 { 1 } else { 2 }];
        let channels = [Channel { name: "fluid", mesh: part.view(), fields: shown }];
        let text = r#"{"version": 1, "pipelines": [{"name": "all", "every": {"steps": 1}, "stages": [
            {"surface": {}}, {"statistics": {"field": "other"}}, {"statistics": {"field": "speed"}}, {"stream": {}}]}]}"#;
        let mut runner = Runner::with_communicator(
            &crate::language::parse(text, "test.json").unwrap(),
            Arc::new(ranks),
        )
        .unwrap();
        let outputs = runner.run(&Snapshot { cycle: 0, time: 0.0, channels: &channels });
        let mut said = Vec::new();
        for output in outputs {
            match output {
                Output::Error { message, .. } => said.push(message),
                Output::Frame(frame) => {
                    assert!(
                        frame.extract.fields.is_empty(),
                        "a field with NaN, and one that is missing"
                    )
                }
                Output::Monitor(monitor) => {
                    let value = |name: &str| {
                        monitor.values.iter().find(|(other, _)| other == name).unwrap().1
                    };
                    assert!(value("other.max").is_nan());
                    assert_eq!((value("speed.max"), value("speed.non_finite")), (2.0, 1.0));
                }
                _ => {}
            }
        }
        said
    });
    assert!(outcomes[1].is_empty() && outcomes[2].is_empty(), "rank 0 speaks for all");
    let said = outcomes[0].join("\n");
    assert!(said.contains("rank 1: statistics: the channel has no field `other`"), "{said}");
    assert!(said.contains("rank 2: cycle 0: field `speed` is NaN"), "{said}");
}

#[test]
fn points_alone_are_never_merged() {
    for global in [None, Some(vec![0, 1])] {
        let extracts = threads::run(2, |ranks| {
            let mut cells = Cells::new();
            (0..2).for_each(|vertex| cells.push(CellType::Vertex, &[vertex]).unwrap());
            // Both ranks have points at the same places, and by the same numbers.
            let points = vec![[0.0; 3], [1.0, 0.0, 0.0]];
            let part = Part { points, cells, global_vertices: global.clone(), ..Part::default() };
            let mass = [ranks.rank() as f64, 2.0];
            let fields = [FieldView {
                name: "mass",
                association: Association::Vertex,
                values: ArrayView::scalars(&mass).copied_from(NumberType::F32),
            }];
            let channels = [Channel { name: "drops", mesh: part.view(), fields: &fields }];
            let text = r#"{"version": 1, "pipelines": [{"name": "all", "stages": [{"write": {"file": "a.vtu"}}]}]}"#;
            let config = crate::language::parse(text, "test.json").unwrap();
            let mut runner = Runner::with_communicator(&config, Arc::new(ranks)).unwrap();
            let outputs = runner.run(&Snapshot { cycle: 0, time: 0.0, channels: &channels });
            outputs.into_iter().find_map(|output| match output {
                Output::Write { extract, .. } => Some(extract),
                _ => None,
            })
        });
        let extract = extracts[0].as_ref().unwrap();
        assert_eq!((extract.points.len(), extract.cells.len()), (4, 4));
        assert_eq!(extract.fields[0].values, [0.0, 2.0, 1.0, 2.0]);
        assert_eq!(extract.fields[0].number, NumberType::F32);
    }
}

/// The largest difference of a displacement of parts from that of one process, and the iterations that it took: solved from the
/// reference, and by an operator that was renewed.
fn deformed_in_parts(
    mesh: &Mesh,
    method: Method,
    ranks: usize,
    of_cells: &[usize],
) -> (f64, usize) {
    let settings = Deform { method, tolerance: 1e-10, ..Deform::default() };
    let wave = |[x, y, z]: Vector| [0.1 * (3.0 * y).sin(), 0.2 * x * z, -0.1 * (4.0 * x).cos()];
    let on = |mesh: &Mesh, vertices: &[u32]| -> Vec<Vector> {
        vertices.iter().map(|&vertex| wave(mesh.points()[vertex as usize])).collect()
    };
    let surface = Surface::extract(mesh, &FeatureSettings::default()).unwrap();
    let serial = VolumeOperator::new(mesh, surface.vertices(), &settings).unwrap();
    let expected = serial.solve(&on(mesh, surface.vertices())).unwrap().displacement;
    let found = threads::run(ranks, |ranks| {
        let part = Part::cut(mesh, of_cells, ranks.rank(), false).unwrap();
        let ranks: Arc<dyn Communicator> = Arc::new(ranks);
        let (shared, boundary) =
            PartBoundary::find(&*ranks, &part, &FeatureSettings::default()).unwrap();
        let partition: Arc<dyn Partition> =
            Arc::new(Ranks::new(ranks, Arc::new(shared), &boundary, Vec::new()));
        let own =
            Mesh::new(part.points.clone(), part.cells.clone(), FeatureSource::SharpEdges).unwrap();
        let operator =
            VolumeOperator::of_part(&own, boundary.vertices(), &[], &settings, &partition).unwrap();
        let again = operator.updated(&own).unwrap();
        let numbers: Vec<usize> =
            part.global_vertices.iter().flatten().map(|&number| number as usize).collect();
        [&operator, &again].map(|operator| {
            let found = operator.solve(&on(&own, boundary.vertices())).unwrap();
            let off = found.displacement.iter().zip(&numbers).flat_map(|(value, &number)| {
                let expected = expected[number];
                (0..3).map(move |axis| (value[axis] - expected[axis]).abs())
            });
            (off.fold(0.0, f64::max), found.iterations)
        })
    });
    let found = found.as_flattened();
    assert!(
        found.iter().all(|(_, iterations)| *iterations == found[0].1),
        "all ranks iterate together"
    );
    (found.iter().fold(0.0, |most: f64, (off, _)| most.max(*off)), found[0].1)
}

/// Cutting a mesh costs no iterations to speak of: multigrid sees through the borders.
#[test]
fn multigrid_over_ranks_takes_the_iterations_of_one_process() {
    let mesh = box_of_tets([17, 13, 12], [0.0; 3], [1.5, 1.0, 1.0]);
    for method in [Method::Elasticity, Method::Harmonic] {
        let (_, alone) = deformed_in_parts(&mesh, method, 1, &vec![0; mesh.cells().len()]);
        for (ranks, empty) in [(2, None), (3, None), (4, Some(1)), (5, None)] {
            let (off, iterations) =
                deformed_in_parts(&mesh, method, ranks, &dealt(&mesh, ranks, empty));
            assert!(off < 1e-8, "{method:?} on {ranks} ranks: {off:e}");
            assert!(
                iterations <= alone + 3,
                "{method:?} on {ranks} ranks: {iterations} iterations, alone {alone}"
            );
        }
    }
}

/// Parts that hang together nowhere, and ranks that have a handful of rows each: slower, but solved.
#[test]
fn scattered_parts_are_solved_too() {
    let mesh = box_of_tets([14, 12, 11], [0.0; 3], [1.2, 1.0, 1.0]);
    let count = mesh.cells().len();
    for (ranks, of_cells) in [
        (3, shuffled(count, 7).into_iter().map(|place| place % 3).collect::<Vec<usize>>()),
        (40, dealt(&mesh, 40, None)),
        (24, shuffled(count, 9).into_iter().map(|place| place % 24).collect()),
    ] {
        let (off, iterations) = deformed_in_parts(&mesh, Method::Elasticity, ranks, &of_cells);
        assert!(off < 1e-8, "{ranks} ranks: {off:e} in {iterations} iterations");
        assert!(iterations <= 40, "{ranks} ranks: {iterations} iterations");
    }
}
