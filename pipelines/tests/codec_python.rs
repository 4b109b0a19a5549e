//! A second decoder, written from docs/protocol.md and docs/codec.md in Python with NumPy alone,
//! reads the frames of live views: every bit.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

use tombolo_deform::mesh::{CellType, Cells, NumberType, Vector};
use tombolo_pipelines::encode::{DecodedFrame, Decoder, Encoded, Encoder};
use tombolo_pipelines::extract::{Association, Extract, ExtractFeatures, Field};
use tombolo_pipelines::language::ErrorBound::{self, Absolute, Lossless, Relative};
use tombolo_pipelines::run::{Encoding, Frame};

/// A Möbius band of triangles with holes, three lines at one of its points, and loose points.
fn band() -> (Vec<Vector>, Cells) {
    let (around, across) = (80u32, 8u32);
    let mut points = Vec::new();
    for i in 0..around {
        for j in 0..across {
            let (u, v) = (f64::from(i) * 0.0785, f64::from(j) / 7.0 - 0.5);
            let radius = 1.0 + v * (u / 2.0).cos();
            points.push([radius * u.cos(), radius * u.sin(), v * (u / 2.0).sin()]);
        }
    }
    let mut cells = Cells::new();
    for i in 0..around {
        for j in 0..across - 1 {
            let at = |i: u32, j: u32| {
                if i < around { i * across + j } else { across - 1 - j }
            };
            let corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            match (i * 7 + j * 5) % 11 {
                // Every eleventh square has a hole.
                3 => {}
                // Its two triangles have one value.
                5 => cells.push(CellType::Quad, &corners).unwrap(),
                _ => {
                    let [a, b, c, d] = corners;
                    cells.push(CellType::Triangle, &[a, b, c]).unwrap();
                    cells.push(CellType::Triangle, &[a, c, d]).unwrap();
                }
            }
        }
    }
    let first = points.len() as u32;
    // The last of them are all at one place.
    let along = (0..40).map(|i| f64::from(i.min(28)));
    points.extend(along.map(|i| [i * 0.03, i * i % 7.0 * 0.1, 2.0]));
    let line: Vec<u32> = [0].into_iter().chain(first..first + 20).collect();
    cells.push(CellType::PolyLine, &line).unwrap();
    cells.push(CellType::Line, &[0, first + 25]).unwrap();
    cells.push(CellType::Line, &[first + 3, first + 9]).unwrap();
    (points, cells)
}

/// Triangles between any three of some points: edges of many, twice the same, corners that coincide.
fn tangle() -> (Vec<Vector>, Cells) {
    let mut random = 1u64;
    let mut next = || {
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (random >> 40) as u32
    };
    let points = (0..60).map(|_| [0; 3].map(|_| f64::from(next() % 1000))).collect();
    let mut cells = Cells::new();
    for index in 0..240 {
        let first = index / 4;
        let corners = [first, (first + next() % 4) % 60, (first + next() % 9) % 60];
        cells.push(CellType::Triangle, &corners).unwrap();
    }
    (points, cells)
}

/// A square of so many cells along each side.
fn square(side: u32) -> (Vec<Vector>, Cells) {
    let point = |i: u32| [f64::from(i % (side + 1)), f64::from(i / (side + 1)), 0.0];
    let cells = (0..side * side).flat_map(|cell| {
        let first = cell % side + cell / side * (side + 1);
        [first, first + 1, first + side + 2, first + side + 1]
    });
    let points = (0..(side + 1).pow(2)).map(point).collect();
    (points, Cells::uniform(CellType::Quad, cells.collect()).unwrap())
}

fn field(name: &str, association: Association, components: usize, values: Vec<f64>) -> Field {
    Field { name: name.into(), association, components, number: NumberType::F64, values }
}

/// A value at a point or cell, smooth, with what no step reaches and with places that share one.
fn value(index: usize, time: f64) -> f64 {
    let place = index as f64 / 40.0 + 0.4 * time;
    match index % 97 {
        5 => f64::NAN,
        6 => f64::NEG_INFINITY,
        _ if place % 5.0 > 3.0 => 0.0,
        _ if place % 5.0 > 2.2 => -4.5,
        _ if place % 5.0 > 1.6 => f64::INFINITY,
        _ => (2.0 * place + time).sin() + place.cos() * time,
    }
}

/// How a mesh moves.
#[derive(Clone, Copy)]
enum Moved {
    /// So far along a straight line.
    Along(f64),
    /// So far in some other way.
    Freely(f64),
}

fn moved(points: &[Vector], by: Moved) -> Vec<Vector> {
    let point = |&[x, y, z]: &Vector| match by {
        Moved::Along(far) => [x + far * 0.1 * y, y, z + far * (0.2 * x).sin()],
        Moved::Freely(far) => [x + (far * y).sin(), y * (1.0 + 0.1 * far), z + (far * x).cos()],
    };
    points.iter().map(point).collect()
}

/// One frame of a view: where its mesh has moved, how exact its fields are.
struct Step {
    moved: Moved,
    fields: ErrorBound,
    is_key: bool,
}

/// A view, and the frames that are still to come.
struct View {
    name: &'static str,
    points: Vec<Vector>,
    cells: Arc<Cells>,
    features: Option<Arc<ExtractFeatures>>,
    positions: ErrorBound,
    steps: Vec<Step>,
    encoder: Encoder,
    topology: Option<u64>,
}

impl View {
    fn new(name: &'static str, (points, cells): (Vec<Vector>, Cells)) -> Self {
        Self {
            name,
            points,
            cells: Arc::new(cells),
            features: None,
            positions: Relative(1e-5),
            steps: vec![],
            encoder: Encoder::new(),
            topology: None,
        }
    }

    fn then(mut self, moved: Moved, fields: ErrorBound) -> Self {
        self.steps.push(Step { moved, fields, is_key: false });
        self
    }

    fn key(mut self, moved: Moved, fields: ErrorBound) -> Self {
        self.steps.push(Step { moved, fields, is_key: true });
        self
    }

    fn fields(&self, time: f64) -> Vec<Field> {
        let (points, cells) = (self.points.len(), self.cells.len());
        let velocity = (0..3 * points).map(|i| {
            let [x, y, z] = self.points[i / 3];
            (x + 2.0 * y - z + time * (i % 3) as f64).sin()
        });
        // In single precision: all the same at first, and then most of it as it was.
        let height = |i: usize| {
            let far = if i.is_multiple_of(7) { time } else { time.min(0.1) };
            f64::from(((i / 5) as f64).cos() as f32 * far as f32)
        };
        let pressure = (0..points).map(|i| value(i, time));
        let flux = (0..2 * cells).map(|i| value(i / 2, time));
        vec![
            field("pressure", Association::Vertex, 1, pressure.collect()),
            field("velocity", Association::Vertex, 3, velocity.collect()),
            field("flux", Association::Element, 2, flux.collect()),
            field("height", Association::Element, 1, (0..cells).map(height).collect()),
        ]
    }

    /// The message of a step, which brings the topology where that is new.
    fn message(&mut self, step: usize) -> Option<(Encoded, Vec<u8>)> {
        let Step { moved: by, fields, is_key } = *self.steps.get(step)?;
        let time = 0.1 * step as f64;
        let extract = Extract {
            points: moved(&self.points, by),
            vertices: None,
            cells: Arc::clone(&self.cells),
            features: self.features.clone(),
            fields: self.fields(time),
        };
        let encoding = Encoding { fields, positions: self.positions };
        let (pipeline, extract) = (self.name.into(), Arc::new(extract));
        let frame = Frame { pipeline, cycle: 10 * step as u64, time, extract, encoding };
        let encoded = self.encoder.encode(&frame, is_key).unwrap();
        let is_known = self.topology.replace(encoded.topology_id) == Some(encoded.topology_id);
        let message = if is_known { encoded.message.clone() } else { encoded.with_topology() };
        Some((encoded, message))
    }
}

fn bytes<const SIZE: usize, N: Copy>(numbers: &[N], bytes: impl Fn(N) -> [u8; SIZE]) -> Vec<u8> {
    numbers.iter().flat_map(|&number| bytes(number)).collect()
}

/// The arrays of a frame, each with what it is.
fn arrays(frame: &DecodedFrame) -> Vec<(String, Vec<u8>)> {
    let mut arrays = Vec::new();
    let mut push = |what: &str, bytes| {
        arrays.push((format!("{what} of {} in cycle {}", frame.view, frame.cycle), bytes))
    };
    if let Some(cells) = &frame.cells {
        let features = cells.triangle_features.as_deref().unwrap_or_default();
        push("triangles", bytes(cells.triangles.as_flattened(), u32::to_le_bytes));
        push("features", bytes(features, u32::to_le_bytes));
        push("lines", bytes(cells.lines.as_flattened(), u32::to_le_bytes));
    }
    push("positions", bytes(frame.points.as_flattened(), f64::to_le_bytes));
    for field in &frame.fields {
        push("name", [field.name.as_bytes(), b"\n"].concat());
        push(&field.name, bytes(&field.values, f64::to_le_bytes));
    }
    arrays
}

/// A message as a block of the codec.
fn block(message: &[u8]) -> Vec<u8> {
    let (mut block, mut count) = (Vec::new(), message.len());
    while count > 127 {
        block.push(count as u8 & 127 | 128);
        count >>= 7;
    }
    block.push(count as u8);
    [&block, message].concat()
}

#[test]
fn another_decoder_reads_every_bit() {
    use Moved::{Along, Freely};
    let cells_of_band = band().1.len() as u32;
    let features = ExtractFeatures {
        names: vec!["front".into(), "back".into(), "edge".into()],
        of_cells: (0..cells_of_band).map(|cell| cell / 50 % 3).collect(),
    };
    let mut views = [
        View { features: Some(Arc::new(features)), ..View::new("band", band()) }
            .then(Along(0.0), Absolute(1e-2))
            .then(Along(0.02), Absolute(1e-2))
            .then(Along(0.05), Absolute(5e-3))
            .then(Freely(0.1), Lossless)
            .then(Freely(0.12), Lossless)
            .key(Freely(0.12), Relative(1e-4))
            .then(Along(0.1), Absolute(1e-3))
            .then(Along(0.3), Absolute(1e-3)),
        // The whole square comes to stand somewhere else.
        View::new("cut", square(12))
            .then(Freely(0.3), Relative(1e-3))
            .then(Freely(0.3), Relative(1e-3))
            .then(Freely(0.35), Relative(1e-3))
            .then(Freely(0.4), Relative(1e-3))
            .then(Freely(0.45), Relative(1e-3)),
        View { positions: Lossless, ..View::new("every bit", square(8)) }
            .then(Along(0.0), Lossless)
            .then(Along(0.1), Lossless)
            .key(Freely(0.2), Lossless)
            .then(Freely(0.2), Lossless),
        View::new("tangle", tangle())
            .then(Along(0.0), Relative(1e-3))
            .then(Along(0.1), Relative(1e-3)),
    ];

    let (mut sent, mut expected) = (Vec::new(), Vec::new());
    let (mut decoder, mut motions) = (Decoder::new(), BTreeSet::new());
    for step in 0..8 {
        if step == 3 {
            // Its cells are others from here on.
            let (points, cells) = square(10);
            (views[1].points, views[1].cells) = (points, Arc::new(cells));
        }
        for view in &mut views {
            let Some((encoded, message)) = view.message(step) else { continue };
            let frame = decoder.decode(&message).unwrap();
            let DecodedFrame { view, topology, cycle, time, .. } = &frame;
            let text = format!("{view}|{topology}|{}|{cycle}|{time:?}\n", encoded.number);
            expected.push((format!("text of {view}"), text.into_bytes()));
            expected.extend(arrays(&frame));
            // Behind the header, whose number is below 128: how positions are sent, and how they moved.
            let [sort, motion] = [0, 1].map(|byte| encoded.message[8 + 1 + view.len() + 25 + byte]);
            motions.insert((sort, if sort == 0 { motion } else { 0 }));
            sent.extend(block(&message));
        }
    }
    // Still, along a line, along a new one, in any other way; and exactly.
    assert_eq!(Vec::from_iter(motions), [(0, 0), (0, 1), (0, 2), (0, 3), (1, 0)]);

    let folder = tempfile::tempdir().unwrap();
    let messages = folder.path().join("messages");
    fs::write(&messages, sent).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/codec.py");
    let mut command = Command::new("/usr/bin/python3");
    command.arg(script).stdin(File::open(messages).unwrap());
    let output = command.output().expect("python3 starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut found = &output.stdout[..];
    for (what, expected) in expected {
        let (array, rest) = found.split_at(expected.len().min(found.len()));
        let first = array.iter().zip(&expected).position(|(a, b)| a != b);
        assert_eq!((first, array.len()), (None, expected.len()), "{what}");
        found = rest;
    }
    assert!(found.is_empty());
}
