//! Features that a solver names by faces: those that the mesh does not have are its mistake, those
//! inside it are told.

use std::sync::{Arc, Mutex};

use tombolo::communicator::threads;
use tombolo::deform::mesh::{CellType, Cells, FeatureSource, MeshView, TaggedFaces};
use tombolo::deform::shapes::box_of_tets;
use tombolo::logging::{self, LevelFilter};
use tombolo::pipelines::extract::Channel;
use tombolo::{Adaptor, Settings, Step};

/// Executes once on a box of its own for each rank, the boxes side by side, after `change` has
/// added tagged faces to those of the box.
fn call(
    settings: Settings,
    rank: usize,
    change: impl Fn(&mut TaggedFaces, &Cells),
) -> Result<(), String> {
    let mesh = box_of_tets([2, 2, 2], [rank as f64, 0.0, 0.0], [rank as f64 + 1.0, 1.0, 1.0]);
    let FeatureSource::Faces(mut tagged) = mesh.features().clone() else {
        panic!("the sides of a box")
    };
    change(&mut tagged, mesh.cells());
    let features = FeatureSource::Faces(tagged);
    let mesh = MeshView::from(&mesh).with_features(&features);
    let mut adaptor = Adaptor::initialize(settings).expect("initialize");
    let step = Step { cycle: 0, time: 0.0, time_step: 0.1 };
    adaptor
        .execute(&step, &[Channel { name: "solid", mesh, fields: &[] }])
        .map(|_| ())
        .map_err(|error| error.to_string())
}

/// On one rank, and on the second of three.
fn on_ranks(change: impl Fn(&mut TaggedFaces, &Cells) + Sync) -> [Result<(), String>; 2] {
    let alone = call(Settings::default(), 0, &change);
    let three = threads::run(3, |ranks| {
        let rank = threads_rank(&ranks);
        let settings = Settings { communicator: Arc::new(ranks), ..Settings::default() };
        call(settings, rank, |tagged, cells| {
            if rank == 1 {
                change(tagged, cells)
            }
        })
    });
    assert!(three.iter().all(|other| *other == three[0]), "{three:?}");
    [alone, three[0].clone()]
}

fn threads_rank(ranks: &impl tombolo::communicator::Communicator) -> usize {
    ranks.rank()
}

fn add(tagged: &mut TaggedFaces, vertices: &[u32], number: i64) {
    tagged.faces.push(CellType::Triangle, vertices).expect("a triangle");
    tagged.tags.push(number);
}

#[test]
fn the_sides_of_a_box_are_its_features() {
    assert_eq!(on_ranks(|_, _| ()), [Ok(()), Ok(())]);
}

#[test]
fn a_face_that_no_cell_has_is_refused_with_its_feature() {
    // Opposite corners of the box.
    for said in on_ranks(|tagged, _| add(tagged, &[0, 1, 26], 5)) {
        let said = said.expect_err("no face");
        let words = "cycle 0: channel 'solid': face 48 of those with features (z-min, vertices 0, 1, 26) is no face of any cell; \
                     so are 1 of 49 in all";
        assert!(said.ends_with(words), "{said}");
    }
}

#[test]
fn a_name_whose_number_no_face_has_is_refused() {
    for said in on_ranks(|tagged, _| tagged.names.push((9, "lid".into()))) {
        let said = said.expect_err("no such number");
        let words = "cycle 0: channel 'solid': feature 'lid' has the number 9, which no face has; the faces have 1, 2, 3, 4, 5, 6";
        assert!(said.ends_with(words), "{said}");
    }
}

#[test]
fn a_name_whose_faces_are_on_another_rank_is_none_of_it() {
    let said = threads::run(3, |ranks| {
        let rank = threads_rank(&ranks);
        let settings = Settings { communicator: Arc::new(ranks), ..Settings::default() };
        call(settings, rank, |tagged, _| {
            tagged.names.push((9, "lid".into()));
            if rank == 2 {
                tagged
                    .tags
                    .iter_mut()
                    .filter(|number| **number == 6)
                    .for_each(|number| *number = 9);
            }
        })
    });
    assert!(said.iter().all(Result::is_ok), "{said:?}");
}

#[test]
fn faces_inside_the_mesh_are_told_once() {
    let told = Arc::new(Mutex::new(Vec::new()));
    let kept = Arc::clone(&told);
    let sink = move |_, message: &str| kept.lock().expect("no panic").push(message.to_owned());
    logging::send_to(LevelFilter::WARN, Some(Box::new(sink))).expect("no other logger");
    let inner = |tagged: &mut TaggedFaces, cells: &Cells| {
        let shared = |other: usize| -> Vec<u32> {
            cells
                .vertices(0)
                .iter()
                .copied()
                .filter(|it| cells.vertices(other).contains(it))
                .collect()
        };
        let shared =
            (1..cells.len()).map(shared).find(|shared| shared.len() == 3).expect("a neighbour");
        add(tagged, &shared, 5);
    };
    assert_eq!(on_ranks(inner), [Ok(()), Ok(())]);
    logging::send_to(LevelFilter::WARN, None).expect("no other logger");
    let told = told.lock().expect("no panic");
    let words = "channel 'solid': 1 of 49 faces with features lie inside the mesh, and make no feature of its surface";
    assert_eq!(*told, [words, &words.replace("49", "145")]);
}
