//! A second decoder, written from docs/codec.md in Python with NumPy alone, reads what the codec
//! writes: every bit.

use std::fs;
use std::path::Path;
use std::process::Command;

use tombolo_pipelines::codec::{Bound, Field, Topology};

/// Points, triangles and lines.
type Parts = (Vec<[f64; 3]>, Vec<[u32; 3]>, Vec<[u32; 2]>);

/// A Möbius band of triangles, a patch with a hole beside it, a polyline and loose points.
fn mesh() -> Parts {
    let (around, across) = (90u32, 9u32);
    let mut points = Vec::new();
    for i in 0..around {
        for j in 0..across {
            let (u, v) = (f64::from(i) * 0.0698, f64::from(j) / 8.0 - 0.5);
            let radius = 1.0 + v * (u / 2.0).cos();
            points.push([radius * u.cos(), radius * u.sin(), v * (u / 2.0).sin()]);
        }
    }
    let mut triangles = Vec::new();
    for i in 0..around {
        for j in 0..across - 1 {
            let at = |i: u32, j: u32| {
                if i < around { i * across + j } else { across - 1 - j }
            };
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            // Every eleventh square has a hole.
            if (i * 7 + j * 5) % 11 != 3 {
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    let first = points.len() as u32;
    points.extend((0..60).map(|i| [f64::from(i) * 0.03, f64::from(i * i % 7) * 0.1, 2.0]));
    let mut lines: Vec<[u32; 2]> = (first..first + 40).map(|i| [i, i + 1]).collect();
    lines.extend([[0, first + 45], [first + 3, first + 9]]);
    (points, triangles, lines)
}

#[test]
fn another_decoder_reads_every_bit() {
    let python = Path::new("/usr/bin/python3");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/codec.py");
    let (points, triangles, lines) = mesh();
    let features: Vec<u32> = (0..triangles.len() as u32).map(|t| t / 100).collect();
    let coded = Topology::encode(&points, &triangles, Some(&features), &lines, 2e-5).unwrap();
    let topology = &coded.topology;

    let mut expected: Vec<u8> = Vec::new();
    expected.extend(topology.positions().as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    expected.extend(topology.triangles().as_flattened().iter().flat_map(|x| x.to_le_bytes()));
    expected.extend(topology.features().unwrap().iter().flat_map(|x| x.to_le_bytes()));
    expected.extend(topology.lines().as_flattened().iter().flat_map(|x| x.to_le_bytes()));

    let elements: Vec<u32> = (0..topology.elements().len() as u32).collect();
    let mut fields: Vec<u8> = Vec::new();
    let value = |i: usize, time: f64| {
        let [x, y, z] = points[i % points.len()];
        match i % 97 {
            5 => f64::NAN,
            6 => 1e12,
            _ if x > 0.9 => 0.0,
            _ => (3.0 * x + time).sin() + y * z,
        }
    };
    let absolute = |bound| Some(Bound::Absolute(bound));
    let series: [(u8, usize, &[Option<Bound>]); 5] = [
        (0, 1, &[absolute(1e-2), absolute(1e-2), absolute(5e-3), absolute(1e-4), None]),
        (0, 3, &[absolute(1e-3), absolute(1e-3), absolute(1e-3)]),
        (1, 1, &[absolute(1e-3), absolute(1e-3)]),
        (0, 2, &[Some(Bound::Exact), Some(Bound::Exact), absolute(1e-5)]),
        (1, 1, &[Some(Bound::Exact)]),
    ];
    for (index, (of, components, bounds)) in series.into_iter().enumerate() {
        let (hierarchy, order) = if of == 0 {
            (topology.points(), &coded.points)
        } else {
            (topology.elements(), &elements)
        };
        fields.extend([of, components as u8, bounds.len() as u8]);
        let (mut field, mut copy) = (Field::new(components), Field::new(components));
        for (frame, bound) in bounds.iter().enumerate() {
            let mut values: Vec<f64> = (0..order.len() * components)
                .map(|i| value(i / components, 0.05 * frame as f64 + (i % components) as f64))
                .collect();
            if index == 4 {
                // In single precision; and where no bound is given, all the same.
                values.iter_mut().for_each(|value| *value = f64::from(*value as f32).max(-9.0));
            }
            let bound = bound.unwrap_or_else(|| {
                values.fill(-7.5);
                Bound::Exact
            });
            let mut message = Vec::new();
            field.encode(hierarchy, order, &values, bound, &mut message).unwrap();
            let decoded = copy.decode(hierarchy, &mut &message[..]).unwrap();
            expected.extend(decoded.iter().flat_map(|x| x.to_le_bytes()));
            fields.extend((message.len() as u32).to_le_bytes());
            fields.extend(message);
        }
    }

    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("topology"), &coded.message).unwrap();
    fs::write(folder.path().join("fields"), fields).unwrap();
    let output = Command::new(python).arg(script).arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found = fs::read(folder.path().join("decoded")).unwrap();
    let first = found.iter().zip(&expected).position(|(a, b)| a != b);
    assert_eq!((first, found.len()), (None, expected.len()));
}
