//! What several test files need.
#![allow(dead_code, reason = "each test file uses a part")]

use std::sync::Arc;

use proptest::prelude::*;
use tombolo_deform::{communicator::Communicator, distributed::Part};
use tombolo_pipelines::{extract::FieldView, language::parse, run::Runner};

/// Runs pipelines, given one after another with commas between them.
#[track_caller]
pub fn runner(pipelines: &str, communicator: Arc<dyn Communicator>) -> Runner {
    let text = format!(r#"{{"version": 1, "pipelines": [{pipelines}]}}"#);
    let config = parse(&text, "test.json").unwrap_or_else(|error| panic!("{error}"));
    Runner::with_communicator(&config, communicator).unwrap()
}

/// The number of each cell in the whole mesh. What stands in ghosts is nobody's business.
pub fn cell_numbers(part: &Part) -> Vec<f64> {
    let number =
        |cell: usize| part.global_cells.as_ref().map_or(cell as f64, |all| all[cell] as f64);
    let of_cell = |cell: usize| if part.is_own(cell) { number(cell) } else { f64::NAN };
    (0..part.cells.len()).map(of_cell).collect()
}

/// The fields of a part, and none where it is empty.
pub fn shown<'a, 'b>(part: &Part, fields: &'a [FieldView<'b>]) -> &'a [FieldView<'b>] {
    if part.points.is_empty() { &[] } else { fields }
}

/// Adds bits to those of a part's cells: `bits` are of the cells of the whole mesh.
pub fn hide(part: &mut Part, bits: &[u8]) {
    let numbers = part.global_cells.clone().unwrap();
    let of_cells = part.ghosts.get_or_insert_with(|| vec![0; numbers.len()]);
    of_cells.iter_mut().zip(numbers).for_each(|(of, number)| *of |= bits[number as usize]);
}

/// Compares errors with what is expected, whose lines may be indented.
#[track_caller]
pub fn assert_told(found: &str, expected: &str) {
    let expected: Vec<&str> =
        expected.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(found.lines().collect::<Vec<_>>(), expected, "\n{found}");
}

/// A text with some characters overwritten, removed or doubled.
pub fn mutated(text: &'static str) -> impl Strategy<Value = String> {
    let character = r#"[\[\]{}:,"0-9a-e\\. é-]"#;
    let change = (any::<prop::sample::Index>(), 0..3u8, character);
    proptest::collection::vec(change, 1..6).prop_map(move |changes| {
        let mut characters: Vec<char> = text.chars().collect();
        for (place, action, replacement) in changes {
            let place = place.index(characters.len());
            match action {
                0 => characters[place] = replacement.chars().next().unwrap_or(' '),
                1 => {
                    characters.remove(place);
                }
                _ => characters.insert(place, characters[place]),
            }
        }
        characters.into_iter().collect()
    })
}
