//! What several test files need.
#![allow(dead_code, reason = "each test file uses a part")]

use proptest::prelude::*;

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
