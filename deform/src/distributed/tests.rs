//! Parts of meshes against the same meshes on one process.

use std::{collections::BTreeSet, sync::Arc};

use crate::{
    features::FeatureSettings,
    mesh::{CellType, Cells, FeatureSource, Mesh, Vector},
    shapes::{box_of_hexahedra, box_of_tets},
    surface::Surface,
    volume::{Deform, Method, VolumeOperator},
};

use super::cut::random_order;
use super::*;
use crate::communicator::{Communicator, Counted, threads};
use crate::mesh::SharedVertices;

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
    let tags: Vec<i64> = tets.points().iter().map(|point| i64::from(point[0] > 1.0)).collect();
    let by_vertex = Mesh::new(
        tets.points().to_vec(),
        tets.cells().clone(),
        FeatureSource::Vertices(tags.into()),
    )
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
                        part = part.shuffled(shuffle + ranks.rank() as u64);
                    }
                    if !numbers {
                        (part.global_vertices, part.global_cells) = (None, None);
                    }
                    let ranks: Arc<dyn Communicator> = Arc::new(ranks);
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
        let part = Part::cut(&mesh, &of_cells, ranks.rank(), true).unwrap();
        let part = part.shuffled(11 + ranks.rank() as u64);
        let ranks: Arc<dyn Communicator> = Arc::new(ranks);
        let shared = SharedVertices::find(&ranks, &part).unwrap();
        // How many cells each vertex has, each rank counting its own.
        let mut counts = vec![[0.0; 3]; part.points.len()];
        for cell in (0..part.cells.len()).filter(|&cell| part.is_own(cell)) {
            part.cells.vertices(cell).iter().for_each(|&vertex| counts[vertex as usize][0] += 1.0);
        }
        shared.halo().sum(3, counts.as_flattened_mut());
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
        shared.halo().update(3, known.as_flattened_mut());
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
            let ranks: Arc<dyn Communicator> = Arc::new(ranks);
            PartBoundary::find(&ranks, &part, &FeatureSettings::default())
                .map(drop)
                .unwrap_err()
                .to_string()
        });
        assert!(outcomes.iter().all(|outcome| *outcome == outcomes[0]), "{outcomes:?}");
        outcomes[0].clone()
    };
    let said =
        fault(&|part| part.cells = Cells::uniform(CellType::Tetra, vec![0, 1, 2, 9999]).unwrap());
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

/// The part with each cell in the mirror, as a solver would lend it.
fn mirrored(part: &Part) -> Part {
    let mut cells = Cells::new();
    for (cell_type, vertices) in part.cells.as_given().iter() {
        let order: &[usize] =
            if cell_type == CellType::Tetra { &[1, 0, 2, 3] } else { &[4, 5, 6, 7, 0, 1, 2, 3] };
        let row: Vec<u32> = order.iter().map(|&local| vertices[local]).collect();
        cells.push(cell_type, &row).unwrap();
    }
    let given = Part { cells, ..part.clone() };
    Part::of(&given.view()).unwrap()
}

#[test]
fn cells_run_the_same_way_round_on_all_ranks() {
    for mesh in [
        box_of_tets([3, 3, 3], [0.0; 3], [1.0; 3]),
        box_of_hexahedra([3, 3, 3], [0.0; 3], [1.0; 3]),
    ] {
        let of_cells = dealt(&mesh, 4, None);
        let find = |is_left: &(dyn Fn(usize) -> bool + Sync)| {
            threads::run(4, |ranks| {
                let part = Part::cut(&mesh, &of_cells, ranks.rank(), true).unwrap();
                let part = if is_left(ranks.rank()) { mirrored(&part) } else { part };
                let ranks: Arc<dyn Communicator> = Arc::new(ranks);
                PartBoundary::find(&ranks, &part, &FeatureSettings::default()).map(drop)
            })
        };
        assert!(
            find(&|_| true).iter().all(Result::is_ok) && find(&|_| false).iter().all(Result::is_ok)
        );
        let cell_type = mesh.cells().types()[0];
        for left in 0..4 {
            let expected =
                DistributedError::Hands { cell_type, left, right: usize::from(left == 0) };
            let said = find(&|rank| rank == left);
            assert!(said.iter().all(|found| *found == Err(expected.clone())), "{said:?}");
        }
    }
}

/// A cell that is turned inside out is not taken for one of a program with left-handed cells because
/// it is the only one that its rank owns.
#[test]
fn a_rank_does_not_turn_its_only_cell() {
    let plain = box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]);
    let mut cells = Cells::new();
    for (cell, (cell_type, vertices)) in plain.cells().iter().enumerate() {
        let [a, b, c, d] = [0, 1, 2, 3].map(|index| vertices[index]);
        let turned = if cell == 5 { [b, a, c, d] } else { [a, b, c, d] };
        cells.push(cell_type, &turned).unwrap();
    }
    let mesh = Mesh::new(plain.points().to_vec(), cells, FeatureSource::SharpEdges).unwrap();
    let outcomes = threads::run(2, |ranks| {
        let part = Part::cut(&mesh, &[0, 0, 0, 0, 0, 1], ranks.rank(), true).unwrap();
        let ranks: Arc<dyn Communicator> = Arc::new(ranks);
        domain(&ranks, &part, &FeatureSettings::default()).map(drop)
    });
    for outcome in outcomes {
        assert!(matches!(outcome, Err(DistributedError::Hands { .. })), "{outcome:?}");
    }
}

/// Arrays may be longer than what cells use of them.
#[test]
fn points_that_no_cell_has_are_no_doubt() {
    let mesh = box_of_tets([3, 2, 2], [0.0; 3], [1.0; 3]);
    let of_cells = dealt(&mesh, 2, None);
    threads::run(2, |ranks| {
        let mut part = Part::cut(&mesh, &of_cells, ranks.rank(), false).unwrap();
        (part.global_vertices, part.global_cells) = (None, None);
        let used = part.points.len();
        part.points.resize(used + 3, [0.0; 3]);
        let ranks: Arc<dyn Communicator> = Arc::new(ranks);
        let shared = SharedVertices::find(&ranks, &part).unwrap();
        assert_eq!(shared.count(), mesh.points().len() as u64 + 6);
    });
}

#[test]
fn a_rank_hears_of_its_neighbours_alone() {
    // Slabs in a row: however many there are, one in the middle speaks to two others of what lies
    // between them.
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
            let counted = Arc::new(Counted::new(ranks));
            let ranks: Arc<dyn Communicator> = counted.clone();
            let part = Part::cut(&mesh, &of_cells, ranks.rank(), false).unwrap();
            let (shared, _) =
                PartBoundary::find(&ranks, &part, &FeatureSettings::default()).unwrap();
            assert!(shared.halo().neighbours().len() <= 2);
            let before = counted.traffic();
            shared.halo().sum(3, &mut vec![1.0; 3 * part.points.len()]);
            counted.traffic() - before
        });
        counts[2]
    };
    assert_eq!(sent(4), sent(8));
    assert_eq!(sent(8).messages_sent, 2);
}

/// The largest difference of a displacement of parts from that of one process, and the iterations
/// that it took: solved from the reference, and by an operator that was renewed.
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
        let (domain, boundary) = domain(&ranks, &part, &FeatureSettings::default()).unwrap();
        let own = domain.mesh();
        let operator = VolumeOperator::new(&domain, boundary.vertices(), &settings).unwrap();
        let again = operator.updated(own).unwrap();
        let numbers: Vec<usize> =
            part.global_vertices.iter().flatten().map(|&number| number as usize).collect();
        [&operator, &again].map(|operator| {
            let found = operator.solve(&on(own, boundary.vertices())).unwrap();
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

/// Parts that hang together nowhere, and ranks that have a handful of rows each: slower, but
/// solved.
#[test]
fn scattered_parts_are_solved_too() {
    let mesh = box_of_tets([14, 12, 11], [0.0; 3], [1.2, 1.0, 1.0]);
    let count = mesh.cells().len();
    for (ranks, of_cells) in [
        (3, random_order(count, 7).into_iter().map(|index| index % 3).collect::<Vec<usize>>()),
        (40, dealt(&mesh, 40, None)),
        (24, random_order(count, 9).into_iter().map(|index| index % 24).collect()),
    ] {
        let (off, iterations) = deformed_in_parts(&mesh, Method::Elasticity, ranks, &of_cells);
        assert!(off < 1e-8, "{ranks} ranks: {off:e} in {iterations} iterations");
        assert!(iterations <= 40, "{ranks} ranks: {iterations} iterations");
    }
}
