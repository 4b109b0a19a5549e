//! Damaged messages: the corpus of `tests/corpus/codec`, and what becomes of it by chance.
//!
//! `TOMBOLO_FUZZ=100000 cargo test --release -p tombolo-pipelines --test codec_fuzz` goes on for so
//! many rounds a file; `TOMBOLO_UPDATE=1` writes the sound messages of the corpus again. A message
//! that once did harm is added to it by hand.

use std::fs;
use std::path::{Path, PathBuf};

use tombolo_pipelines::codec::{Bound, Field, Motion, Topology};

/// Numbers that are the same in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, most: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.0 >> 33) as usize % most.max(1)
    }
}

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/codec")
}

/// A patch of triangles with a fan and a line, and its messages: the topology, fields, positions.
fn sound() -> (Topology, Vec<(&'static str, Vec<u8>)>) {
    let side = 9u32;
    let points: Vec<[f64; 3]> = (0..side * side + 2)
        .map(|i| [f64::from(i % side), f64::from(i / side), f64::from(i * i % 5) * 0.1])
        .collect();
    let mut triangles: Vec<[u32; 3]> = (0..side - 1)
        .flat_map(|y| (0..side - 1).map(move |x| y * side + x))
        .flat_map(|a| [[a, a + 1, a + side], [a + 1, a + side + 1, a + side]])
        .collect();
    triangles.extend([[0, 0, 5], [0, 40, 80], [3, 1, 2]]);
    let features: Vec<u32> = (0..triangles.len() as u32).map(|t| t / 40).collect();
    let lines = [[0, 81], [81, 82], [4, 5]];
    let coded = Topology::encode(&points, &triangles, Some(&features), &lines, 1e-3).unwrap();
    let mut messages = vec![("topology", coded.message.clone())];
    let values: Vec<f64> = points
        .iter()
        .enumerate()
        .flat_map(|(i, p)| [if i % 40 == 7 { f64::NAN } else { p[0].max(4.0) }, p[1] * p[2]])
        .collect();
    let hierarchy = coded.topology.points();
    for (name, bound) in [("grid", Bound::Absolute(1e-2)), ("exact", Bound::Exact)] {
        let (mut field, mut message) = (Field::new(2), Vec::new());
        for _ in 0..3 {
            field.encode(hierarchy, &coded.points, &values, bound, &mut message).unwrap();
        }
        messages.push((name, message));
    }
    let (mut motion, mut message) = (Motion::new(&coded.topology), Vec::new());
    for frame in 0..5 {
        let moved: Vec<[f64; 3]> =
            points.iter().map(|[x, y, z]| [*x, *y, z + f64::from(frame / 2 * frame) * x]).collect();
        motion.encode(&coded.topology, &coded.points, &moved, 4e-3, &mut message).unwrap();
    }
    messages.push(("motion", message));
    (coded.topology, messages)
}

/// Reads a message as everything that it could be.
fn read(topology: &Topology, message: &[u8]) {
    if let Ok(copy) = Topology::decode(message) {
        let points = copy.points().len();
        assert!(points <= 1024 * message.len());
        assert!(copy.triangles().as_flattened().iter().all(|&point| (point as usize) < points));
        assert!(copy.lines().as_flattened().iter().all(|&point| (point as usize) < points));
        assert_eq!(copy.elements().len(), copy.triangles().len() + copy.lines().len());
    }
    for components in [1, 2] {
        let (mut field, mut rest) = (Field::new(components), message);
        while let Ok(values) = field.decode(topology.points(), &mut rest) {
            assert_eq!(values.len(), components * topology.points().len());
        }
    }
    let (mut motion, mut rest) = (Motion::new(topology), message);
    while motion.decode(topology, &mut rest).is_ok() {}
}

#[test]
fn no_damage_makes_a_decoder_panic() {
    let (topology, messages) = sound();
    if std::env::var_os("TOMBOLO_UPDATE").is_some() {
        fs::create_dir_all(corpus()).unwrap();
        for (name, message) in &messages {
            fs::write(corpus().join(name), message).unwrap();
        }
    }
    let rounds = std::env::var("TOMBOLO_FUZZ").ok().and_then(|rounds| rounds.parse().ok());
    let rounds: usize = rounds.unwrap_or(2000);
    let mut files: Vec<PathBuf> =
        fs::read_dir(corpus()).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= messages.len(), "the corpus is not there");
    let all: Vec<Vec<u8>> = files.iter().map(|file| fs::read(file).unwrap()).collect();
    let mut random = Random(2026);
    for whole in &all {
        read(&topology, whole);
        for _ in 0..rounds {
            let mut message = whole.clone();
            for _ in 0..=random.below(4) {
                let at = random.below(message.len());
                match random.below(6) {
                    0 => message.truncate(at + 1),
                    1 => message.insert(at, random.below(256) as u8),
                    2 => drop(message.remove(at)),
                    3 => {
                        let other = &all[random.below(all.len())];
                        let from = random.below(other.len());
                        message.truncate(at);
                        message.extend(&other[from..]);
                    }
                    4 => message[at] = [0, 1, 0x7f, 0x80, 0xff][random.below(5)],
                    _ => message[at] ^= 1 << random.below(8),
                }
                if message.is_empty() {
                    message.push(0);
                }
            }
            read(&topology, &message);
        }
    }
}

#[test]
fn a_message_that_says_it_holds_more_than_it_can_is_refused_at_once() {
    // 2²⁶ points and as many triangles, in a few bytes.
    let mut message = vec![0x80, 0x80, 0x80, 0x20, 0x80, 0x80, 0x80, 0x20, 0, 0];
    message.resize(60, 0);
    let failure = Topology::decode(&message).unwrap_err().to_string();
    assert!(failure.contains("at most 61440 are read"), "{failure}");
}
