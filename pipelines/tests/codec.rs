//! The codec: what is decoded is what was coded, within the bound, and no bytes make it panic.

use std::collections::BTreeMap;

use proptest::prelude::*;
use tombolo_pipelines::codec::{Bound, CodecError, Coded, Field, Motion, Topology};

/// Triangles with their lowest point first, in order.
fn sorted(triangles: impl Iterator<Item = [u32; 3]>) -> Vec<[u32; 3]> {
    let mut triangles: Vec<[u32; 3]> = triangles
        .map(|t| *[t, [t[1], t[2], t[0]], [t[2], t[0], t[1]]].iter().min().unwrap())
        .collect();
    triangles.sort_unstable();
    triangles
}

fn check(points: &[[f64; 3]], triangles: &[[u32; 3]], lines: &[[u32; 2]], bound: f64) -> Coded {
    let features: Vec<u32> = (0..triangles.len() as u32).map(|t| t * t % 7 / 3).collect();
    let coded = Topology::encode(points, triangles, Some(&features), lines, bound).unwrap();
    let copy = Topology::decode(&coded.message).unwrap();
    let old = |point: u32| coded.points[point as usize];
    assert_eq!(
        sorted(copy.triangles().iter().map(|t| t.map(old))),
        sorted(triangles.iter().copied())
    );
    assert_eq!(copy.lines().iter().map(|line| line.map(old)).collect::<Vec<_>>(), lines);
    for (new, &triangle) in coded.triangles.iter().enumerate() {
        assert_eq!(copy.features().unwrap()[new], features[triangle as usize]);
        assert_eq!(
            sorted([copy.triangles()[new].map(old)].into_iter()),
            sorted([triangles[triangle as usize]].into_iter())
        );
    }
    for (position, &point) in copy.positions().iter().zip(&coded.points) {
        for axis in 0..3 {
            assert!((position[axis] - points[point as usize][axis]).abs() <= bound);
        }
    }
    assert_eq!(
        (copy.points(), copy.elements()),
        (coded.topology.points(), coded.topology.elements())
    );
    coded
}

/// The message of a frame of a moving mesh, which a copy reads within the bound.
fn motion_frame(
    [motion, copy]: [&mut Motion; 2],
    coded: &Coded,
    points: &[[f64; 3]],
    bound: f64,
    frame: u32,
) -> Vec<u8> {
    let mut message = Vec::new();
    motion.encode(&coded.topology, &coded.points, points, bound, &mut message).unwrap();
    let mut rest = &message[..];
    let read = copy.decode(&coded.topology, &mut rest).unwrap();
    assert!(rest.is_empty() && read == motion.positions());
    for (read, &point) in read.iter().zip(&coded.points) {
        for axis in 0..3 {
            let off = (read[axis] - points[point as usize][axis]).abs();
            assert!(off <= bound, "frame {frame}: {off} of {bound}");
        }
    }
    message
}

/// A grid of points in a bent plane, two triangles in each square.
fn sheet(side: u32) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let points = (0..side * side)
        .map(|i| [i % side, i / side].map(|x| f64::from(x) / f64::from(side)))
        .map(|[x, y]| [x + 0.01 * (31.0 * y).sin(), y + 0.01 * (17.0 * x).cos(), x * y])
        .collect();
    let triangles = (0..side - 1)
        .flat_map(|y| (0..side - 1).map(move |x| y * side + x))
        .flat_map(|a| [[a, a + 1, a + side], [a + 1, a + side + 1, a + side]])
        .collect();
    (points, triangles)
}

fn encode(field: &mut Field, coded: &Coded, values: &[f64], bound: Bound) -> Vec<u8> {
    let mut message = Vec::new();
    let hierarchy = coded.topology.points();
    field.encode(hierarchy, &coded.points, values, bound, &mut message).unwrap();
    message
}

/// Codes the next frame, decodes it, and holds every value against its bound.
fn exchange(
    fields: &mut [Field; 2],
    coded: &Coded,
    values: &[f64],
    bound: Bound,
) -> (Vec<u8>, Vec<f64>) {
    let [field, copy] = fields;
    let message = encode(field, coded, values, bound);
    let mut rest = &message[..];
    let decoded = copy.decode(coded.topology.points(), &mut rest).unwrap();
    assert!(rest.is_empty());
    let components = field.components();
    for (place, &tuple) in coded.points.iter().enumerate() {
        for component in 0..components {
            let sent = values[tuple as usize * components + component];
            let read = decoded[place * components + component];
            let holds = match bound {
                Bound::Absolute(bound) if sent.is_finite() => (read - sent).abs() <= bound,
                _ => read.to_bits() == sent.to_bits(),
            };
            assert!(holds, "{sent} became {read}, {bound:?}");
        }
    }
    (message, decoded)
}

#[test]
fn topologies_of_all_kinds_come_back() {
    let (points, triangles) = sheet(30);
    let coded = check(&points, &triangles, &[], 1e-5);
    let bits = 8.0 * coded.message.len() as f64 / points.len() as f64;
    assert!(bits < 40.0, "{bits} bits a point");
    check(&points, &triangles, &[[0, 899], [899, 4], [4, 3], [7, 8]], 1e-5);
    // Points alone, lines alone, nothing, one of each.
    check(&points, &[], &[], 1e-3);
    check(&points, &[], &(0..899).map(|i| [i, i + 1]).collect::<Vec<_>>(), 1e-3);
    check(&[], &[], &[], 1e-3);
    check(&points[..1], &[], &[], 1e-3);
    check(&points[..3], &[[2, 0, 1]], &[], 1e-3);
    // All in one place; twice the same; both sides; an edge with many triangles; degenerate ones.
    check(&[[1.0; 3]; 4], &[[0, 1, 2], [0, 1, 2], [2, 1, 0], [0, 1, 3]], &[], 1e-9);
    check(&points[..6], &[[0, 1, 2], [0, 1, 3], [1, 0, 4], [0, 0, 5], [5, 5, 5]], &[[2, 2]], 1e-6);
    let fan: Vec<[u32; 3]> = (1..899).map(|i| [0, i, i + 1]).collect();
    check(&points, &fan, &[], 1e-5);
}

#[test]
fn connectivity_of_a_regular_surface_takes_less_than_three_bits_a_triangle() {
    let (mut points, triangles) = sheet(100);
    // All in one place: positions cost nothing.
    points.fill([1.0; 3]);
    let coded = Topology::encode(&points, &triangles, None, &[], 1e-5).unwrap();
    let bits = 8.0 * coded.message.len() as f64 / triangles.len() as f64;
    assert!(bits < 3.0, "{bits}");
}

#[test]
fn what_cannot_be_coded_is_named() {
    let (points, triangles) = sheet(4);
    let wrong = |points: &[[f64; 3]], triangles: &[[u32; 3]], bound| {
        Topology::encode(points, triangles, None, &[], bound).unwrap_err()
    };
    let found = wrong(&points, &[[0, 1, 16]], 1e-3);
    assert_eq!(found, CodecError::Point { point: 16, points: 16 });
    assert_eq!(wrong(&points, &triangles, 0.0), CodecError::Positions);
    assert_eq!(wrong(&points, &triangles, 1e-12), CodecError::Positions);
    assert_eq!(wrong(&[[f64::NAN; 3]; 3], &[[0, 1, 2]], 1e-3), CodecError::Positions);
    let coded = Topology::encode(&points, &triangles, None, &[], 1e-3).unwrap();
    let hierarchy = coded.topology.points();
    let mut message = Vec::new();
    let found =
        Field::new(2).encode(hierarchy, &coded.points, &[0.0; 31], Bound::Exact, &mut message);
    assert_eq!(found, Err(CodecError::Length { found: 31, expected: 32 }));
}

#[test]
fn a_smooth_field_takes_few_bits_and_fewer_where_it_changes_slowly() {
    let (points, triangles) = sheet(80);
    let coded = check(&points, &triangles, &[], 1e-5);
    let mut fields = [Field::new(1), Field::new(1)];
    let mut bits = Vec::new();
    for frame in 0..4 {
        let time = 0.02 * f64::from(frame);
        let values: Vec<f64> =
            points.iter().map(|p| (5.0 * p[0] - time).sin() + (4.0 * p[1] + time).cos()).collect();
        let (message, _) = exchange(&mut fields, &coded, &values, Bound::Absolute(4e-3));
        bits.push(8.0 * message.len() as f64 / points.len() as f64);
    }
    assert!(bits[0] < 1.2 && bits[3] < 0.5 * bits[0], "{bits:?}");
}

#[test]
fn a_field_that_is_mostly_one_value_costs_its_border() {
    let (points, triangles) = sheet(80);
    let coded = check(&points, &triangles, &[], 1e-5);
    let values: Vec<f64> = points
        .iter()
        .flat_map(|p| if p[0] > 0.9 { [p[1], p[0] * p[1], -p[1]] } else { [0.0; 3] })
        .collect();
    let mut fields = [Field::new(3), Field::new(3)];
    let (message, decoded) = exchange(&mut fields, &coded, &values, Bound::Absolute(1e-4));
    assert!(message.len() * 8 < values.len(), "{}", message.len());
    let (message, _) = exchange(&mut fields, &coded, &values, Bound::Absolute(1e-4));
    assert!(message.len() < 120, "{}", message.len());
    let zeros = decoded.chunks(3).filter(|tuple| *tuple == [0.0; 3]).count();
    assert_eq!(zeros, values.chunks(3).filter(|tuple| *tuple == [0.0; 3]).count());
}

#[test]
fn grids_change_with_the_bound_and_with_the_range() {
    let (points, triangles) = sheet(20);
    let coded = check(&points, &triangles, &[], 1e-5);
    let mut fields = [Field::new(1), Field::new(1)];
    let bounds = [1e-3, 1e-4, 1e-1, 1e-9, 1e-3, 1e-300, 1e-30, 0.0, 1e-3, 1e30, 1e-3];
    for (frame, bound) in bounds.into_iter().enumerate() {
        let size = [1.0, 3.0, 1e-3, 1e6][frame % 4];
        let values: Vec<f64> = points.iter().map(|p| size * (p[0] + p[2])).collect();
        exchange(&mut fields, &coded, &values, Bound::Absolute(bound));
        if frame % 3 == 0 {
            exchange(&mut fields, &coded, &values, Bound::Exact);
            exchange(&mut fields, &coded, &values, Bound::Exact);
        }
    }
}

#[test]
fn a_mesh_that_moves_in_a_line_sends_it_once() {
    let (still, triangles) = sheet(40);
    let bound = 1e-5;
    let coded = check(&still, &triangles, &[], bound / 2.0);
    let [mut motion, mut copy] = [Motion::new(&coded.topology), Motion::new(&coded.topology)];
    // Two lines, one after the other, with stops; then round a circle.
    let at = |frame: u32, [x, y, z]: [f64; 3]| {
        let part = if y > 0.6 { (y - 0.6) * (1.0 + x) } else { 0.0 };
        let along = |first: u32| f64::from(frame.clamp(first, first + 8) - first) * 0.03 * part;
        let angle = f64::from(frame.max(24) - 24) * 0.1;
        [
            x + along(2),
            y + along(2) * x + (angle.cos() - 1.0) * part,
            z - along(13) + angle.sin() * part,
        ]
    };
    let mut sizes = Vec::new();
    for frame in 0..30 {
        let points: Vec<[f64; 3]> = still.iter().map(|&point| at(frame, point)).collect();
        let message = motion_frame([&mut motion, &mut copy], &coded, &points, bound, frame);
        sizes.push(message.len());
    }
    assert_eq!(sizes[..3], [1; 3]);
    assert_eq!(sizes[4..=10], [9; 7]);
    assert_eq!(sizes[11..=13], [1; 3]);
    assert_eq!(sizes[15..=21], [9; 7]);
    assert_eq!(sizes[22..=24], [1; 3]);
    // Most points never move.
    let point = 8.0 / still.len() as f64;
    assert!(sizes[3] as f64 * point < 30.0 && sizes[29] as f64 * point < 12.0, "{sizes:?}");
    let lost = Motion::new(&coded.topology).decode(&coded.topology, &mut &[1; 9][..]).is_err();
    assert!(lost, "nothing is known of the line");
}

#[test]
fn positions_that_stay_are_coded_again_within_a_smaller_bound() {
    let (still, triangles) = sheet(20);
    let coded = check(&still, &triangles, &[], 1e-6);
    let [mut motion, mut copy] = [Motion::new(&coded.topology), Motion::new(&coded.topology)];
    let moved: Vec<[f64; 3]> = still.iter().map(|[x, y, z]| [x + y * y, y - z, *z]).collect();
    let sizes = [1e-2, 1e-2, 1e-5, 1e-4]
        .map(|bound| motion_frame([&mut motion, &mut copy], &coded, &moved, bound, 0).len());
    assert!(sizes[0] > 1 && sizes[1] == 1 && sizes[2] > 1 && sizes[3] == 1, "{sizes:?}");
}

/// Where the bound is near the rounding of the coordinates, or below that of the displacement.
#[test]
fn a_mesh_that_moves_freely_stays_within_a_bound_near_rounding() {
    let (sheet, triangles) = sheet(20);
    for (offset, size, bound) in [(1000.0, 1.0, 2.9e-13), (5e6, 1.0, 2.5e-9), (0.0, 1e6, 1e-12)] {
        let still: Vec<[f64; 3]> =
            sheet.iter().map(|point| point.map(|x| offset + size * x)).collect();
        // The positions of a topology are on a grid of less than 2^28 steps.
        let coded = check(&still, &triangles, &[], 1e-6 * size);
        let [mut motion, mut copy] = [Motion::new(&coded.topology), Motion::new(&coded.topology)];
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for frame in 0..12 {
            // Near the reference, then near zero or moved by a little.
            let near = if frame < 6 || offset > 0.0 { 1.0 } else { 0.0 };
            let points: Vec<[f64; 3]> =
                still.iter().map(|point| point.map(|x| near * x + 0.1 * random())).collect();
            motion_frame([&mut motion, &mut copy], &coded, &points, bound, frame);
        }
    }
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let (points, triangles) = sheet(25);
    let once = || {
        let coded = Topology::encode(&points, &triangles, None, &[], 1e-5).unwrap();
        let values: Vec<f64> = points.iter().flat_map(|p| [p[0], p[1] * p[2]]).collect();
        let mut field = Field::new(2);
        let mut bytes = coded.message.clone();
        for _ in 0..2 {
            bytes.extend(encode(&mut field, &coded, &values, Bound::Absolute(1e-3)));
        }
        bytes
    };
    let bytes = once();
    assert_eq!(bytes, once());
    // What the bytes are on one machine they are on any other, WebAssembly among them.
    let sum = sum_of(&bytes);
    assert_eq!((bytes.len(), sum), (1137, 0x7b6f_57b3_a1c4_5015), "{sum:016x}");
}

/// The sum of bytes by which two programs that write different ones are told apart.
fn sum_of(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[test]
fn frames_of_all_kinds_have_the_bytes_that_they_always_had() {
    /// The bytes of a series: how many, and their sum.
    const STORED: [(usize, u64); 9] = [
        (1222, 0xd26c_87e1_0cd0_b9bb),
        (970, 0x3f49_b448_b0bc_7893),
        (23_346, 0x3b43_6a4f_b974_cdad),
        (30_158, 0x00d4_0363_fdb5_0ff7),
        (3387, 0xee78_c8c6_37fe_1325),
        (99_314, 0xf89b_fba6_307c_42d5),
        (49_950, 0x36a5_1f8c_39cc_7620),
        (156_712, 0x7919_1f9e_ff24_3aff),
        (32_481, 0x4766_be1a_78b2_b99b),
    ];
    // Neither sines nor roots: every machine has the same values.
    let wave = |x: f64, frame: f64| {
        let x = (3.0 * x + 0.05 * frame).rem_euclid(2.0) - 1.0;
        x * (1.0 - x.abs())
    };
    let noise = |index: usize| {
        let index = index as u64;
        ((index * 7919 + index * index % 613) % 1000) as f64 / 1000.0 - 0.5
    };
    let value = |kind: usize, at: [f64; 3], index: usize, frame: f64| match kind {
        // Smooth, noisy, mostly zero, and with values that no step reaches.
        0 => wave(at[0] + at[1] * at[1], frame),
        1 => wave(at[0] * at[1], frame) + 0.1 * noise(index + 3 * frame as usize),
        2 if at[0] < 0.8 => 0.0,
        2 => wave(at[0] + at[1], frame),
        _ if index % 97 == 5 => [f64::NAN, f64::INFINITY, 1e300][index % 3],
        _ => 40.0 * wave(at[1], frame) + noise(index),
    };
    let series = [
        // Points to a side, components, kind, bound; a side of 260 has eight lanes.
        (30, 1, 0, 1e-3),
        (80, 1, 0, 1e-2),
        (80, 1, 1, 1e-4),
        (80, 2, 1, 1e-3),
        (80, 3, 2, 1e-3),
        (50, 2, 3, 1e-2),
        (50, 1, 1, 1e-9),
        (260, 1, 1, 1e-3),
        (260, 3, 2, 1e-4),
    ];
    let mut found = Vec::new();
    for (side, components, kind, bound) in series {
        let (points, triangles) = sheet(side);
        let coded = Topology::encode(&points, &triangles, None, &[], 1e-5).unwrap();
        let mut fields = [Field::new(components), Field::new(components)];
        let mut bytes = Vec::new();
        for frame in 0..3 {
            let values: Vec<f64> = (0..points.len() * components)
                .map(|index| {
                    let (x, y) =
                        (index / components % side as usize, index / components / side as usize);
                    let at = [x as f64, y as f64, 0.0].map(|x| x / f64::from(side));
                    value(kind, at, index, f64::from(frame) + 10.0 * (index % components) as f64)
                })
                .collect();
            bytes.extend(exchange(&mut fields, &coded, &values, Bound::Absolute(bound)).0);
        }
        found.push((bytes.len(), sum_of(&bytes)));
    }
    assert_eq!(found, STORED, "{found:#x?}");
}

/// Values of all kinds.
fn any_value() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -10.0..10.0,
        2 => Just(0.0),
        1 => any::<f64>(),
        1 => Just(f64::NAN),
        1 => Just(f64::NEG_INFINITY),
        1 => Just(5e-324),
        1 => Just(-0.0),
    ]
}

fn any_bound() -> impl Strategy<Value = Bound> {
    prop_oneof![
        6 => (-12i32..3).prop_map(|exponent| Bound::Absolute(10f64.powi(exponent))),
        1 => Just(Bound::Absolute(0.0)),
        1 => Just(Bound::Absolute(1e300)),
        1 => Just(Bound::Exact),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn any_values_come_back_within_any_bound(
        side in 2u32..7,
        components in 1usize..4,
        frames in prop::collection::vec((any_bound(), any::<u64>()), 1..5),
        values in prop::collection::vec(any_value(), 40..120),
    ) {
        let (points, triangles) = sheet(side);
        let coded = check(&points, &triangles, &[], 1e-6);
        let mut fields = [Field::new(components), Field::new(components)];
        for (bound, seed) in frames {
            let pick = |index: usize| values[(index * 7 + seed as usize % 13) % values.len()];
            let values: Vec<f64> = (0..points.len() * components).map(pick).collect();
            exchange(&mut fields, &coded, &values, bound);
        }
    }

    #[test]
    fn any_triangles_come_back(
        points in 1u32..40,
        triangles in prop::collection::vec([0u32..40, 0u32..40, 0u32..40], 0..120),
        lines in prop::collection::vec([0u32..40, 0u32..40], 0..20),
    ) {
        let places: Vec<[f64; 3]> =
            (0..points).map(|i| [0, 1, 2].map(|axis| f64::from(i * (7 + axis) % 23))).collect();
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|p| p % points)).collect();
        let lines: Vec<[u32; 2]> = lines.iter().map(|l| l.map(|p| p % points)).collect();
        check(&places, &triangles, &lines, 1e-3);
    }

    #[test]
    fn no_bytes_make_a_decoder_panic(
        bytes in prop::collection::vec(any::<u8>(), 0..200),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..8),
        cut in any::<prop::sample::Index>(),
    ) {
        let _ = Topology::decode(&bytes);
        let (points, triangles) = sheet(6);
        let coded = check(&points, &triangles, &[[3, 5]], 1e-4);
        let mut damaged = coded.message.clone();
        for (at, byte) in &changes {
            *at.get_mut(&mut damaged) = *byte;
        }
        damaged.truncate(cut.index(damaged.len()) + 1);
        if let Ok(topology) = Topology::decode(&damaged) {
            let points = topology.points().len() as u32;
            prop_assert!(topology.triangles().as_flattened().iter().all(|&p| p < points));
            prop_assert!(topology.lines().as_flattened().iter().all(|&p| p < points));
        }

        let values: Vec<f64> = points.iter().flat_map(|p| [p[0].max(0.5), p[1]]).collect();
        let mut frames = BTreeMap::new();
        for (frame, bound) in [Bound::Absolute(1e-3), Bound::Exact].into_iter().enumerate() {
            let mut field = Field::new(2);
            let first = encode(&mut field, &coded, &values, bound);
            frames.insert(frame, [first, encode(&mut field, &coded, &values, bound)]);
        }
        for [first, second] in frames.values() {
            for (which, message) in [first, second].into_iter().enumerate() {
                let mut damaged = message.clone();
                for (at, byte) in &changes {
                    *at.get_mut(&mut damaged) = *byte;
                }
                let mut field = Field::new(2);
                if which == 1 {
                    field.decode(coded.topology.points(), &mut &first[..]).unwrap();
                }
                if let Ok(values) = field.decode(coded.topology.points(), &mut &damaged[..]) {
                    prop_assert_eq!(values.len(), 72);
                }
                let mut field = Field::new(3);
                let _ = field.decode(coded.topology.points(), &mut &damaged[..]);
                let _ = field.decode(coded.topology.points(), &mut &bytes[..]);
            }
        }
    }
}
