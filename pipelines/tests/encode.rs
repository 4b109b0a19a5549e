//! Frames: what is decoded is what was encoded, and no bytes make the decoder panic.

use std::sync::Arc;

use proptest::prelude::*;
use tombolo_deform::mesh::{CellType, Cells, MeshView, NumberType};
use tombolo_deform::shapes;
use tombolo_pipelines::encode::{
    DataFrame, Decoded, EncodeError, Encoder, TopologyFrame, decode, encode,
};
use tombolo_pipelines::extract::{Association, Channel, Extract, Field, Source};
use tombolo_pipelines::language::ErrorBound;
use tombolo_pipelines::run::{Encoding, Frame};

fn surface_frame(encoding: Encoding) -> Frame {
    let mesh = shapes::box_of_hexahedra([5, 4, 3], [0.0; 3], [5.0, 4.0, 3.0]);
    let channel = Channel { name: "fluid", mesh: MeshView::from(&mesh), fields: &[] };
    let mut extract =
        Source::new(&channel).unwrap().surface(&channel, 0, &|_| true).unwrap().extract;
    let fields = &mut Arc::make_mut(&mut extract).fields;
    let (vertices, cells) = (6 * 5 * 4 - 4 * 3 * 2, 2 * (5 * 4 + 5 * 3 + 4 * 3));
    fields.push(Field {
        name: "velocity".into(),
        association: Association::Vertex,
        components: 3,
        number: NumberType::F64,
        values: (0..3 * vertices).map(|i| f64::from(i).sin() * 7.0).collect(),
    });
    fields.push(Field {
        name: "rank".into(),
        association: Association::Element,
        components: 1,
        number: NumberType::F64,
        values: (0..cells).map(f64::from).collect(),
    });
    Frame { pipeline: "hull".into(), cycle: 12, time: 0.25, extract, encoding }
}

fn decoded(frame: &Frame) -> (TopologyFrame, DataFrame) {
    let encoded = encode(frame).unwrap();
    match (decode(&encoded.topology).unwrap(), decode(&encoded.data).unwrap()) {
        (Decoded::Topology(topology), Decoded::Data(data)) => (topology, data),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_surface_comes_back_within_its_bounds() {
    let frame = surface_frame(Encoding::default());
    let extract = &frame.extract;
    let (topology, data) = decoded(&frame);
    assert_eq!((topology.view.as_str(), topology.points), ("hull", extract.points.len()));
    assert_eq!(
        topology.triangles.len(),
        2 * extract.cells.len(),
        "each quadrilateral is two triangles"
    );
    assert_eq!((data.cycle, data.time, &data.topology), (12, 0.25, &topology.topology));
    let diagonal = 50f64.sqrt();
    for (sent, received) in extract.points.as_flattened().iter().zip(data.points.as_flattened()) {
        assert!((sent - received).abs() <= 1e-5 * diagonal);
    }
    let velocity = (&extract.fields[0], &data.fields[0]);
    for (sent, received) in velocity.0.values.iter().zip(&velocity.1.values) {
        assert!((sent - received).abs() <= 1e-3 * 14.0);
    }
    let features = topology.triangle_features.unwrap();
    let of_cells = &extract.features.as_ref().unwrap().of_cells;
    for (triangle, (&feature, &rank)) in features.iter().zip(&data.fields[1].values).enumerate() {
        assert_eq!(feature, of_cells[triangle / 2]);
        assert!((rank - extract.fields[1].values[triangle / 2]).abs() <= 0.094);
    }
}

#[test]
fn lossless_is_exact() {
    let exact = Encoding { fields: ErrorBound::Lossless, positions: ErrorBound::Lossless };
    let frame = surface_frame(exact);
    let (_, data) = decoded(&frame);
    assert_eq!(data.points, frame.extract.points);
    assert_eq!(data.fields[0], frame.extract.fields[0]);
}

#[test]
fn a_topology_is_named_by_what_it_is() {
    let frame = surface_frame(Encoding::default());
    let mut encoder = Encoder::new();
    let (first, second) = (encoder.encode(&frame).unwrap(), encoder.encode(&frame).unwrap());
    assert!(Arc::ptr_eq(&first.topology, &second.topology), "kept, not made again");
    assert_eq!(encode(&surface_frame(Encoding::default())).unwrap().topology_id, first.topology_id);
    let mut other = Extract::clone(&frame.extract);
    let mut cells = Cells::clone(&other.cells);
    cells.push(CellType::Line, &[0, 1]).unwrap();
    other.cells = Arc::new(cells);
    other.fields.clear();
    let other = Frame { extract: Arc::new(other), ..frame };
    assert_ne!(encoder.encode(&other).unwrap().topology_id, first.topology_id);
    assert_eq!(decoded(&other).0.lines, [[0, 1]]);
}

#[test]
fn a_smooth_field_is_sent_in_less_than_a_fifth() {
    let mesh = shapes::torus(2.0, 0.5, [200, 100]);
    let points = mesh.points().to_vec();
    let values = points.iter().map(|p| p[0] * p[1]).collect();
    let field = Field {
        name: "p".into(),
        association: Association::Vertex,
        components: 1,
        number: NumberType::F64,
        values,
    };
    let cells = Arc::new(mesh.cells().clone());
    let extract =
        Arc::new(Extract { points, vertices: None, cells, features: None, fields: vec![field] });
    let frame =
        Frame { pipeline: "v".into(), cycle: 0, time: 0.0, extract, encoding: Encoding::default() };
    let encoded = encode(&frame).unwrap();
    assert_eq!(encoded.raw_bytes, 20_000 * 4 * 8);
    if cfg!(feature = "compression") {
        assert!(
            encoded.data.len() * 5 < encoded.raw_bytes,
            "{} of {}",
            encoded.data.len(),
            encoded.raw_bytes
        );
    }
}

#[test]
fn what_cannot_be_sent_is_named() {
    let frame = surface_frame(Encoding::default());
    let broken = |change: &dyn Fn(&mut Extract)| {
        let mut extract = Extract::clone(&frame.extract);
        change(&mut extract);
        encode(&Frame { extract: Arc::new(extract), ..frame.clone() }).unwrap_err()
    };
    let error = broken(&|extract| extract.fields[0].values[7] = f64::NAN);
    assert!(
        matches!(error, EncodeError::NotFinite { ref array, entity: 2, .. } if array == "velocity"),
        "{error}"
    );
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

proptest! {
    #[test]
    fn no_bytes_make_the_decoder_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200), kind in 0u8..4) {
        let _ = decode(&bytes);
        let mut framed = b"TMBL\x01\x00\x00\x00".to_vec();
        framed[5] = kind;
        framed.extend(bytes);
        let _ = decode(&framed);
    }

    #[test]
    fn no_mutation_makes_the_decoder_panic(
        is_data in any::<bool>(),
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        end in any::<prop::sample::Index>(),
        cut in any::<bool>(),
    ) {
        let encoded = encode(&surface_frame(Encoding::default())).unwrap();
        let mut bytes = if is_data { encoded.data } else { encoded.topology.to_vec() };
        for (place, byte) in changes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        if cut {
            bytes.truncate(end.index(bytes.len()));
        }
        if let Ok(Decoded::Topology(topology)) = decode(&bytes) {
            prop_assert!(topology.triangles.as_flattened().iter().all(|&point| (point as usize) < topology.points));
        }
    }
}
