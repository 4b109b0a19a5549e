//! Frames: what is decoded is what was encoded, and no bytes make the decoder panic.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Arc;

use proptest::prelude::*;
use serde_json::{Value, json};
use tombolo_deform::mesh::{CellType, Cells, MeshView, NumberType, Vector};
use tombolo_deform::shapes;
use tombolo_pipelines::encode::{
    DecodedFrame, Decoder, EncodeError, Encoded, Encoder, decode_surface,
};
use tombolo_pipelines::extract::{Association, Channel, Extract, Field, Source};
use tombolo_pipelines::language::ErrorBound;
use tombolo_pipelines::run::{Encoding, Frame};

fn field(name: &str, association: Association, components: usize, values: Vec<f64>) -> Field {
    Field { name: name.into(), association, components, number: NumberType::F64, values }
}

fn surface_frame(encoding: Encoding) -> Frame {
    let mesh = shapes::box_of_hexahedra([5, 4, 3], [0.0; 3], [5.0, 4.0, 3.0]);
    let channel = Channel { name: "fluid", mesh: MeshView::from(&mesh), fields: &[] };
    let mut extract =
        Source::new(&channel).unwrap().surface(&channel, 0, &|_| true).unwrap().extract;
    let fields = &mut Arc::make_mut(&mut extract).fields;
    let (vertices, cells) = (6 * 5 * 4 - 4 * 3 * 2, 2 * (5 * 4 + 5 * 3 + 4 * 3));
    let velocity = (0..3 * vertices).map(|i| f64::from(i).sin() * 7.0).collect();
    fields.push(field("velocity", Association::Vertex, 3, velocity));
    let ranks = (0..cells).map(f64::from).collect();
    fields.push(field("rank", Association::Element, 1, ranks));
    Frame { pipeline: "hull".into(), cycle: 12, time: 0.25, extract, encoding }
}

/// The same view one step later: moved and changed by functions of the step.
fn later(frame: &Frame, step: u32) -> Frame {
    let mut next = frame.clone();
    let extract = Arc::make_mut(&mut next.extract);
    for point in &mut extract.points {
        point[2] += 0.01 * f64::from(step) * point[0];
    }
    for field in &mut extract.fields {
        field.values.iter_mut().enumerate().for_each(|(index, value)| {
            *value += 0.1 * (f64::from(step) + index as f64 / 50.0).sin();
        });
    }
    Frame { cycle: frame.cycle + u64::from(step), ..next }
}

fn encode(frame: &Frame) -> Result<Encoded, EncodeError> {
    Encoder::new().encode(frame, false)
}

fn decoded(frame: &Frame) -> DecodedFrame {
    Decoder::new().decode(&encode(frame).unwrap().with_topology()).unwrap()
}

fn range(values: &[f64], components: usize) -> f64 {
    let of = |component: usize| {
        let values = values.iter().skip(component).step_by(components);
        values.clone().copied().fold(f64::MIN, f64::max) - values.copied().fold(f64::MAX, f64::min)
    };
    (0..components).map(of).fold(0.0, f64::max)
}

/// The point of the extract that each decoded point is, by its place in the first frame.
fn sources(reference: &[Vector], decoded: &[Vector]) -> Vec<usize> {
    let distance = |a: &Vector, b: &Vector| (0..3).map(|axis| (a[axis] - b[axis]).abs()).sum();
    let nearest = |point: &Vector| -> usize {
        let all =
            reference.iter().enumerate().map(|(index, other)| (index, distance(point, other)));
        all.min_by(|a, b| f64::total_cmp(&a.1, &b.1)).unwrap().0
    };
    let found: Vec<usize> = decoded.iter().map(nearest).collect();
    let mut sorted = found.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, (0..reference.len()).collect::<Vec<_>>(), "each point once");
    found
}

/// Checks every value of a frame against its extract. `points` says which point of the extract each
/// decoded point is, `cells` which cell each element is part of.
fn check(frame: &Frame, decoded: &DecodedFrame, points: &[usize], cells: &[usize]) {
    assert_eq!((decoded.cycle, decoded.time), (frame.cycle, frame.time));
    let extract = &frame.extract;
    let diagonal = (0..3).map(|axis| {
        let of = extract.points.iter().map(|point| point[axis]);
        of.clone().fold(f64::MIN, f64::max) - of.fold(f64::MAX, f64::min)
    });
    let diagonal = diagonal.fold(0.0, f64::hypot);
    let bound = |error: ErrorBound, extent: f64| match error {
        ErrorBound::Relative(part) => part * extent,
        ErrorBound::Absolute(bound) => bound,
        ErrorBound::Lossless => 0.0,
    };
    let most = bound(frame.encoding.positions, diagonal);
    for (point, &source) in decoded.points.iter().zip(points) {
        for (a, b) in point.iter().zip(extract.points[source]) {
            assert!((a - b).abs() <= most, "{a} is not {b}");
        }
    }
    assert_eq!(decoded.fields.len(), extract.fields.len());
    for (received, sent) in decoded.fields.iter().zip(&extract.fields) {
        assert_eq!((&received.name, received.association), (&sent.name, sent.association));
        let components = sent.components;
        let most = bound(frame.encoding.fields, range(&sent.values, components));
        let of = if sent.association == Association::Element { cells } else { points };
        assert_eq!(received.values.len(), of.len() * components);
        for (index, value) in received.values.iter().enumerate() {
            let expected = sent.values[of[index / components] * components + index % components];
            let error = (value - expected).abs();
            assert!(error <= most || value.to_bits() == expected.to_bits(), "{value}, {expected}");
        }
    }
}

/// The cell that each triangle of a frame is part of.
fn cells_of(frame: &Frame, decoded: &DecodedFrame, points: &[usize]) -> Vec<usize> {
    let cells = decoded.cells.as_ref().unwrap();
    let mut by_corners = BTreeMap::new();
    for (cell, (_, corners)) in frame.extract.cells.iter().enumerate() {
        for other in corners[1..].windows(2) {
            let mut triangle = [corners[0], other[0], other[1]].map(|point| point as usize);
            triangle.sort_unstable();
            by_corners.insert(triangle, cell);
        }
    }
    let find = |triangle: &[u32; 3]| {
        let mut corners = triangle.map(|point| points[point as usize]);
        corners.sort_unstable();
        by_corners[&corners]
    };
    cells.triangles.iter().map(find).collect()
}

#[test]
fn a_surface_comes_back_within_its_bounds() {
    let frame = surface_frame(Encoding::default());
    let decoded = decoded(&frame);
    assert_eq!(decoded.view, "hull");
    let points = sources(&frame.extract.points, &decoded.points);
    let cells = cells_of(&frame, &decoded, &points);
    assert_eq!(cells.len(), 2 * frame.extract.cells.len(), "each quadrilateral is two triangles");
    check(&frame, &decoded, &points, &cells);
    let features = decoded.cells.unwrap().triangle_features.unwrap();
    let of_cells = &frame.extract.features.as_ref().unwrap().of_cells;
    assert!(features.iter().zip(&cells).all(|(feature, &cell)| *feature == of_cells[cell]));
}

#[test]
fn every_frame_of_a_chain_keeps_its_bounds() {
    for positions in [ErrorBound::Relative(1e-5), ErrorBound::Absolute(1e-3), ErrorBound::Lossless]
    {
        let first = surface_frame(Encoding { positions, ..Encoding::default() });
        let (mut encoder, mut decoder) = (Encoder::new(), Decoder::new());
        let encoded = encoder.encode(&first, false).unwrap();
        assert!(encoded.is_key());
        let decoded = decoder.decode(&encoded.with_topology()).unwrap();
        let points = sources(&first.extract.points, &decoded.points);
        let cells = cells_of(&first, &decoded, &points);
        for step in 1..12 {
            let frame = later(&first, step);
            let encoded = encoder.encode(&frame, step == 7).unwrap();
            assert_eq!(encoded.number, if step < 7 { step } else { step - 7 } as usize);
            let decoded = decoder.decode(&encoded.message).unwrap();
            assert!(decoded.cells.is_none());
            check(&frame, &decoded, &points, &cells);
        }
    }
}

#[test]
fn a_frame_needs_the_one_before_it() {
    let first = surface_frame(Encoding::default());
    let mut encoder = Encoder::new();
    let frames: Vec<Encoded> =
        (0..5).map(|step| encoder.encode(&later(&first, step), step == 3).unwrap()).collect();
    let mut decoder = Decoder::new();
    let unread = decoder.decode(&frames[0].message).unwrap_err();
    assert!(unread.to_string().contains("of this view was not read"), "{unread}");
    decoder.decode(&frames[0].with_topology()).unwrap();
    let missed = decoder.decode(&frames[2].message).unwrap_err();
    assert_eq!(missed.to_string(), "header: frame 2 goes on from frame 1, which was not read");
    assert!(decoder.decode(&frames[1].message).is_err(), "an error ends the chain");
    // A late joiner needs one message.
    let mut late = Decoder::new();
    let key = late.decode(&frames[3].with_topology()).unwrap();
    assert_eq!(decoder.decode(&frames[3].message).unwrap(), DecodedFrame { cells: None, ..key });
    assert_eq!(
        late.decode(&frames[4].message).unwrap(),
        decoder.decode(&frames[4].message).unwrap()
    );
}

#[test]
fn other_fields_begin_a_chain() {
    let first = surface_frame(Encoding::default());
    let mut encoder = Encoder::new();
    encoder.encode(&first, false).unwrap();
    let mut other = later(&first, 1);
    Arc::make_mut(&mut other.extract).fields.swap(0, 1);
    assert!(encoder.encode(&other, false).unwrap().is_key());
    assert!(!encoder.encode(&later(&other, 1), false).unwrap().is_key());
    let mut broken = later(&other, 2);
    Arc::make_mut(&mut broken.extract).fields[0].values.pop();
    encoder.encode(&broken, false).unwrap_err();
    assert!(encoder.encode(&later(&other, 3), false).unwrap().is_key(), "after an error");
}

#[test]
fn lossless_is_exact() {
    let exact = Encoding { fields: ErrorBound::Lossless, positions: ErrorBound::Lossless };
    let mut frame = surface_frame(exact);
    let values = &mut Arc::make_mut(&mut frame.extract).fields[0].values;
    (values[4], values[9], values[11]) = (f64::NAN, -0.0, f64::NEG_INFINITY);
    let decoded = decoded(&frame);
    let points = sources(&frame.extract.points, &decoded.points);
    let cells = cells_of(&frame, &decoded, &points);
    check(&frame, &decoded, &points, &cells);
    let moved = &decoded.points;
    assert!(
        points.iter().zip(moved).all(|(&source, point)| *point == frame.extract.points[source])
    );
}

#[test]
fn numbers_that_are_not_finite_come_back() {
    let mut frame = surface_frame(Encoding::default());
    let values = &mut Arc::make_mut(&mut frame.extract).fields[0].values;
    (values[7], values[30]) = (f64::NAN, f64::INFINITY);
    let velocity = decoded(&frame).fields[0].values.clone();
    assert_eq!(velocity.iter().filter(|value| value.is_nan()).count(), 1);
    assert_eq!(velocity.iter().filter(|value| **value == f64::INFINITY).count(), 1);
}

#[test]
fn a_topology_is_named_by_what_it_is() {
    let frame = surface_frame(Encoding::default());
    let mut encoder = Encoder::new();
    let id = encoder.encode(&frame, false).unwrap().topology_id;
    assert_eq!(encoder.encode(&later(&frame, 1), false).unwrap().topology_id, id);
    assert_eq!(encode(&surface_frame(Encoding::default())).unwrap().topology_id, id);
    let mut other = Extract::clone(&frame.extract);
    let mut cells = Cells::clone(&other.cells);
    cells.push(CellType::Line, &[0, 1]).unwrap();
    other.cells = Arc::new(cells);
    other.fields.clear();
    let other = Frame { extract: Arc::new(other), ..frame };
    let encoded = encoder.encode(&other, false).unwrap();
    assert!(encoded.topology_id != id && encoded.is_key());
    let decoded = Decoder::new().decode(&encoded.with_topology()).unwrap();
    let points = sources(&other.extract.points, &decoded.points);
    let lines = decoded.cells.unwrap().lines;
    assert_eq!(
        lines.iter().map(|line| line.map(|p| points[p as usize])).collect::<Vec<_>>(),
        [[0, 1]]
    );
}

#[test]
fn a_smooth_field_takes_little() {
    let mesh = shapes::torus(2.0, 0.5, [200, 100]);
    let points = mesh.points().to_vec();
    let cells = Arc::new(mesh.cells().clone());
    let frame = |step: u64| {
        let wave = |p: &Vector| p[0] * p[1] + 0.05 * (p[2] + step as f64 / 10.0).sin();
        let fields = vec![field("p", Association::Vertex, 1, points.iter().map(wave).collect())];
        let (points, cells) = (points.clone(), Arc::clone(&cells));
        let extract = Extract { points, vertices: None, cells, features: None, fields };
        let (extract, encoding) = (Arc::new(extract), Encoding::default());
        Frame { pipeline: "v".into(), cycle: step, time: 0.0, extract, encoding }
    };
    let mut encoder = Encoder::new();
    let key = encoder.encode(&frame(0), false).unwrap();
    assert_eq!(key.raw_bytes, 20_000 * 4 * 8);
    // A value in eight bits at most, and positions in none; the topology some twenty bits a point.
    assert!(key.message.len() < 20_000, "{}", key.message.len());
    assert!(key.with_topology().len() - key.message.len() < 100_000);
    let next = encoder.encode(&frame(1), false).unwrap();
    assert!(next.message.len() < key.message.len(), "{}", next.message.len());
}

#[test]
fn what_cannot_be_sent_is_named() {
    let frame = surface_frame(Encoding::default());
    let broken = |change: &dyn Fn(&mut Extract)| {
        let mut extract = Extract::clone(&frame.extract);
        change(&mut extract);
        encode(&Frame { extract: Arc::new(extract), ..frame.clone() }).unwrap_err()
    };
    let error = broken(&|extract| extract.points[4][1] = f64::INFINITY);
    assert!(
        matches!(error, EncodeError::NotFinite { ref array, entity: 4, .. } if array == "points"),
        "{error}"
    );
    let error = broken(&|extract| extract.fields[1].values.truncate(93));
    assert!(matches!(error, EncodeError::Length { found: 93, expected: 94, .. }), "{error}");
    let error = broken(&|extract| {
        extract.fields.clear();
        extract.cells = Arc::new(Cells::uniform(CellType::Tetra, vec![0, 1, 2, 3]).unwrap());
    });
    assert!(matches!(error, EncodeError::VolumeCell { cell: 0, .. }), "{error}");
}

/// Fields that say the same everywhere take few bytes, however many values that is.
#[test]
fn a_message_unfolds_to_so_many_values_and_no_more() {
    let points = vec![[0.5; 3]; 16_000];
    let frame = |fields: Vec<Field>| {
        let (points, cells) = (points.clone(), Arc::new(Cells::new()));
        let extract = Extract { points, vertices: None, cells, features: None, fields };
        Frame { extract: Arc::new(extract), ..surface_frame(Encoding::default()) }
    };
    let bare = encode(&frame(Vec::new())).unwrap().with_topology();
    let constant = field("c", Association::Vertex, 9, vec![1.0; 9 * points.len()]);
    let one = encode(&frame(vec![constant])).unwrap().with_topology();
    // The count of the fields is the last byte of the first message; the field stands behind it in the second.
    let (head, of_field) = (&bare[..bare.len() - 1], &one[bare.len()..]);
    assert_eq!((&one[..head.len()], one[head.len()]), (head, 1));
    let of = |count: usize| {
        let mut message = head.to_vec();
        message.extend([(count & 0x7f) as u8 | 0x80, (count >> 7) as u8]);
        (0..count).for_each(|_| message.extend(of_field));
        Decoder::new().decode(&message)
    };
    assert_eq!(of(130).unwrap().fields.len(), 130);
    let refused = of(1024).unwrap_err().to_string();
    assert!(refused.contains("values, at most 134217728 are read"), "{refused}");
}

#[test]
fn what_holds_little_is_sent_too() {
    let of = |points: Vec<Vector>, cells: Cells| {
        let count = points.len();
        let fields = vec![field("p", Association::Vertex, 1, vec![1.5; count])];
        let extract =
            Extract { points, vertices: None, cells: Arc::new(cells), features: None, fields };
        let (extract, encoding) = (Arc::new(extract), Encoding::default());
        decoded(&Frame { pipeline: "v".into(), cycle: 0, time: 0.0, extract, encoding })
    };
    assert!(of(vec![], Cells::new()).points.is_empty());
    let point = of(vec![[1.0, 2.0, 3.0]], Cells::uniform(CellType::Vertex, vec![0]).unwrap());
    assert_eq!((point.points, point.fields[0].values[0]), (vec![[1.0, 2.0, 3.0]], 1.5));
    let same = of(vec![[1.0; 3]; 3], Cells::uniform(CellType::Triangle, vec![0, 1, 2]).unwrap());
    assert_eq!(same.points, [[1.0; 3]; 3]);
}

/// The frames that the viewer's tests read, and what is in them.
fn viewer_frames() -> Value {
    let first = surface_frame(Encoding::default());
    let mut encoder = Encoder::new();
    let mut other = Extract::clone(&first.extract);
    other.cells = Arc::new(Cells::uniform(CellType::Line, (0..6).collect()).unwrap());
    (other.fields, other.features) = (Vec::new(), None);
    let other = Frame { pipeline: "line".into(), extract: Arc::new(other), ..first.clone() };
    let mut messages = vec![encoder.encode(&first, false).unwrap().with_topology()];
    messages.push(encoder.encode(&later(&first, 1), false).unwrap().message);
    messages.push(encode(&other).unwrap().with_topology());
    messages.push(encoder.encode(&later(&first, 2), false).unwrap().message);
    let mut decoder = Decoder::new();
    let read = |message: &Vec<u8>| {
        let frame = decoder.decode(message).unwrap();
        let fields = frame.fields.iter().map(|field| {
            json!({"name": field.name, "association": field.association, "components": field.components,
                   "values": field.values})
        });
        let cells = frame.cells.map(|cells| {
            json!({"triangles": cells.triangles.as_flattened(), "lines": cells.lines.as_flattened(),
                   "features": cells.triangle_features})
        });
        json!({"view": frame.view, "topology": format!("{:016x}", frame.topology), "cycle": frame.cycle,
               "time": frame.time, "fields": fields.collect::<Vec<_>>(), "cells": cells,
               "points": frame.points.as_flattened().iter().map(|&x| x as f32).collect::<Vec<_>>()})
    };
    let frames: Vec<Value> = messages.iter().map(read).collect();
    let hex = |message: &Vec<u8>| {
        message.iter().fold(String::new(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        })
    };
    json!({"messages": messages.iter().map(hex).collect::<Vec<_>>(), "frames": frames})
}

/// The same bits on every machine: those that the viewer's tests have.
#[test]
fn frames_are_the_same_everywhere() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../viewer/test/frames.json");
    let frames = viewer_frames();
    if std::env::var_os("TOMBOLO_UPDATE").is_some() {
        std::fs::write(path, format!("{frames}\n")).unwrap();
    }
    let known: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let is_same = known == serde_json::from_str::<Value>(&frames.to_string()).unwrap();
    let how = "TOMBOLO_UPDATE=1 cargo test -p tombolo-pipelines --test encode";
    assert!(is_same, "viewer/test/frames.json is out of date; write it anew: {how}");
}

proptest! {
    #[test]
    fn no_bytes_make_the_decoder_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200), kind in 0u8..5) {
        let _ = Decoder::new().decode(&bytes);
        let mut framed = b"TMBL\x02\x00\x00\x00".to_vec();
        framed[5] = kind;
        framed.extend(bytes);
        let _ = Decoder::new().decode(&framed);
        let _ = decode_surface(&framed);
    }

    #[test]
    fn no_mutation_makes_the_decoder_panic(
        is_later in any::<bool>(),
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        end in any::<prop::sample::Index>(),
        cut in any::<bool>(),
    ) {
        let first = surface_frame(Encoding::default());
        let (mut encoder, mut decoder) = (Encoder::new(), Decoder::new());
        let mut bytes = encoder.encode(&first, false).unwrap().with_topology();
        if is_later {
            decoder.decode(&bytes).unwrap();
            bytes = encoder.encode(&later(&first, 1), false).unwrap().message;
        }
        for (place, byte) in changes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        if cut {
            bytes.truncate(end.index(bytes.len()));
        }
        if let Ok(DecodedFrame { cells: Some(cells), points, .. }) = decoder.decode(&bytes) {
            let named = cells.triangles.as_flattened().iter().chain(cells.lines.as_flattened());
            prop_assert!(named.copied().all(|point| (point as usize) < points.len()));
        }
    }

    #[test]
    fn any_chain_keeps_its_bounds(
        frames in proptest::collection::vec(
            (proptest::collection::vec(any::<f64>(), 4), proptest::array::uniform4(-1e3..1e3f64), any::<bool>()), 1..6),
        bound in prop_oneof![Just(ErrorBound::Lossless), (1e-9..1e3f64).prop_map(ErrorBound::Absolute)],
    ) {
        let cells = Arc::new(Cells::uniform(CellType::Triangle, vec![0, 1, 2, 2, 1, 3]).unwrap());
        let (mut encoder, mut decoder) = (Encoder::new(), Decoder::new());
        let mut points = Vec::new();
        for (step, (values, heights, key)) in frames.into_iter().enumerate() {
            let corners = [[0.0, 0.0], [1e4, 0.0], [0.0, 1e4], [1e4, 1e4]];
            let extract = Extract {
                points: std::iter::zip(corners, heights).map(|([x, y], z)| [x, y, z]).collect(),
                vertices: None,
                cells: Arc::clone(&cells),
                features: None,
                fields: vec![field("p", Association::Vertex, 1, values)],
            };
            let encoding = Encoding { fields: bound, positions: ErrorBound::Absolute(1e-4) };
            let frame = Frame { pipeline: "v".into(), cycle: step as u64, time: 0.0, extract: Arc::new(extract), encoding };
            let encoded = encoder.encode(&frame, key).unwrap();
            let decoded = decoder.decode(&if step == 0 { encoded.with_topology() } else { encoded.message }).unwrap();
            if step == 0 {
                points = sources(&frame.extract.points, &decoded.points);
            }
            for (place, value) in decoded.fields[0].values.iter().enumerate() {
                let sent = frame.extract.fields[0].values[points[place]];
                let most = if let ErrorBound::Absolute(bound) = bound { bound } else { 0.0 };
                prop_assert!((value - sent).abs() <= most || value.to_bits() == sent.to_bits());
            }
            for (point, &source) in decoded.points.iter().zip(&points) {
                let sent = frame.extract.points[source];
                prop_assert!((0..3).all(|axis| (point[axis] - sent[axis]).abs() <= 1e-4));
            }
        }
    }
}
