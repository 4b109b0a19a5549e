//! Damage to an input: to its bytes, and to what is written in a text of JSON.

use serde_json::{Map, Value, json};

use crate::random::Random;

/// Numbers at which readers go wrong.
const NUMBERS: [&str; 18] = [
    "0",
    "-0",
    "-1",
    "1",
    "2",
    "0.5",
    "1e-308",
    "1e308",
    "1e999",
    "-1e999",
    "255",
    "65536",
    "2147483648",
    "4294967295",
    "4294967296",
    "9007199254740993",
    "18446744073709551615",
    "NaN",
];
/// Values of a list, and bytes of a text, that are made by repetition.
const LARGEST: usize = 1 << 20;
/// The depth of what is nested by chance.
const DEPTH: usize = 300;

/// Damages an input once; `other` is another one, of which a piece may be taken.
pub(crate) fn damage(input: &mut Vec<u8>, other: &[u8], is_text: bool, random: &mut Random) {
    match is_text.then(|| random.below(4)) {
        Some(1..) => text(input, other, random),
        _ => bytes(input, other, random),
    }
}

fn bytes(input: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    let at = random.below(input.len() + 1);
    let most = 1 << random.below(10);
    let length = 1 + random.below(most);
    let end = at.saturating_add(length).min(input.len());
    match random.below(8) {
        0 => input.truncate(at),
        1 => drop(input.drain(at..end)),
        2 => {
            let piece = input[at..end].to_vec();
            input.splice(at..at, piece);
        }
        3 => {
            let from = random.below(other.len());
            let piece = &other[from..other.len().min(from + length)];
            input.splice(at..end, piece.iter().copied());
        }
        4 => {
            // A number of two, four or eight bytes.
            let bytes = 2 << random.below(3);
            let number = [0, 1, u64::MAX, u64::MAX / 2, 1 << 31, 1 << 40, f64::NAN.to_bits()];
            let number = random.choose(&number).copied().unwrap_or_default();
            let last = (at + bytes).min(input.len());
            input[at..last].copy_from_slice(&number.to_le_bytes()[..last - at]);
        }
        5 => input.splice(at..at, (0..length).map(|_| random.next() as u8)).for_each(drop),
        6 => input[at..end].fill(random.next() as u8),
        _ => {
            if let Some(byte) = input.get_mut(at) {
                *byte ^= 1 << random.below(8);
            }
        }
    }
}

/// Damages one of the lines, where each is JSON by itself; else the whole text.
fn text(input: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    let whole = |bytes: &[u8]| serde_json::from_slice::<Value>(bytes).ok();
    if let Some(mut value) = whole(input) {
        value_damage(&mut value, &whole(other).unwrap_or_default(), random);
        *input = written(&value, random);
        return;
    }
    let mut lines: Vec<Vec<u8>> = input.split(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect();
    let others: Vec<&[u8]> = other.split(|byte| *byte == b'\n').collect();
    let (at, to) = (random.below(lines.len()), random.below(lines.len()));
    let taken = random.choose(&others).map_or(&[][..], |line| line);
    match random.below(6) {
        0 => lines.swap(at, to),
        1 => lines.insert(at, lines[to].clone()),
        2 => drop(lines.remove(at)),
        3 => lines.insert(at, taken.to_vec()),
        _ => match whole(&lines[at]) {
            Some(mut value) => {
                value_damage(&mut value, &whole(taken).unwrap_or_default(), random);
                lines[at] = written(&value, random);
            }
            None if random.below(2) == 0 => number(&mut lines[at], random),
            None => return bytes(input, other, random),
        },
    }
    *input = lines.join(&b'\n');
}

/// Puts another number in the place of one in a line.
fn number(line: &mut Vec<u8>, random: &mut Random) {
    let is_in_number = |byte: &u8| byte.is_ascii_digit() || b"+-.".contains(byte);
    let from = random.below(line.len());
    let Some(skipped) = line[from..].iter().position(u8::is_ascii_digit) else { return };
    let begin = from + skipped;
    let length = line[begin..].iter().take_while(|byte| is_in_number(byte)).count();
    let number = random.choose(&NUMBERS).map_or("0", |number| number);
    line.splice(begin..begin + length, number.bytes());
}

/// A value as JSON; one of its numbers may be one that `Value` cannot hold.
fn written(value: &Value, random: &mut Random) -> Vec<u8> {
    let text = value.to_string();
    let places: Vec<usize> = text.match_indices(MARK).map(|(at, _)| at).collect();
    if places.is_empty() {
        return text.into_bytes();
    }
    let number = random.choose(&NUMBERS).map_or("0", |number| number);
    text.replace(&format!("\"{MARK}\""), number).into_bytes()
}

/// The text that stands for a number of [`NUMBERS`].
const MARK: &str = "<a number of NUMBERS>";

fn value_damage(value: &mut Value, other: &Value, random: &mut Random) {
    let count = nodes(value);
    let mut index = random.below(count);
    let Some(node) = node(value, &mut index) else { return };
    let mut from = random.below(nodes(other));
    let mut taken = || find(other, &mut from).cloned().unwrap_or_default();
    match random.below(10) {
        0 | 1 => *node = json!(MARK),
        2 | 3 => *node = taken(),
        4 => *node = json!([node.clone(), node.clone()]),
        5 => {
            let name = ["", "a", "features", "file", "name", "\u{202e}", "../../x", "/dev/zero"];
            *node = json!(random.choose(&name));
        }
        6 => {
            let mut nested = node.take();
            for _ in 0..random.below(DEPTH) {
                nested = if random.below(2) == 0 { json!([nested]) } else { json!({"a": nested}) };
            }
            *node = nested;
        }
        7 => *node = [json!(null), json!(true), json!({}), json!([])][random.below(4)].clone(),
        _ => match node {
            Value::Array(items) => {
                let at = random.below(items.len() + 1);
                match random.below(3) {
                    0 if at < items.len() => drop(items.remove(at)),
                    1 => items.insert(at, taken()),
                    _ => {
                        let last = items.last().cloned();
                        let most = LARGEST / last.as_ref().map_or(1, nodes);
                        let count = random.below(400).min(most);
                        items.extend(std::iter::repeat_n(last, count).flatten());
                    }
                }
            }
            Value::Object(members) => object(members, &taken(), random),
            Value::String(text) => {
                // An input that is kept is damaged again: its texts must not become ever longer.
                let most = (1 << random.below(12)).min(LARGEST / text.len().max(1));
                *text = text.repeat(1 + random.below(most));
            }
            _ => *node = json!(MARK),
        },
    }
}

fn object(members: &mut Map<String, Value>, taken: &Value, random: &mut Random) {
    let names: Vec<String> = members.keys().cloned().collect();
    let name = random.choose(&names).cloned().unwrap_or_default();
    match (random.below(3), taken) {
        (0, _) => drop(members.remove(&name)),
        (1, Value::Object(others)) => members.extend(others.clone()),
        _ => {
            if let Some(value) = members.remove(&name) {
                // Misspelt.
                let cut: String = name.chars().skip(1).chain(['x']).collect();
                members.insert(cut, value);
            }
        }
    }
}

fn children(value: &Value) -> Box<dyn Iterator<Item = &Value> + '_> {
    match value {
        Value::Array(items) => Box::new(items.iter()),
        Value::Object(members) => Box::new(members.values()),
        _ => Box::new(std::iter::empty()),
    }
}

fn nodes(value: &Value) -> usize {
    1 + children(value).map(nodes).sum::<usize>()
}

fn find<'a>(value: &'a Value, index: &mut usize) -> Option<&'a Value> {
    if *index == 0 {
        return Some(value);
    }
    *index -= 1;
    children(value).find_map(|child| find(child, index))
}

fn node<'a>(value: &'a mut Value, index: &mut usize) -> Option<&'a mut Value> {
    if *index == 0 {
        return Some(value);
    }
    *index -= 1;
    match value {
        Value::Array(items) => items.iter_mut().find_map(|child| node(child, index)),
        Value::Object(members) => members.values_mut().find_map(|child| node(child, index)),
        _ => None,
    }
}
