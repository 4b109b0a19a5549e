//! The memory that decoding takes, counted at the allocator: what `docs/codec.md` states.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::fs;
use std::path::Path;

use tombolo_pipelines::codec::{Bound, Field, Topology};

/// Bytes for each point, triangle and line that a topology has.
const OF_A_TOPOLOGY: usize = 192;
/// Bytes for each value of a frame.
const OF_A_VALUE: usize = 32;
/// Bytes that go with any message: models and the like.
const ANYWAY: usize = 1 << 16;

/// Counts what each thread holds, and the most that it held.
struct Counting;

thread_local! {
    static HELD: Cell<isize> = const { Cell::new(0) };
    static MOST: Cell<isize> = const { Cell::new(0) };
}

fn count(bytes: isize) {
    HELD.set(HELD.get() + bytes);
    MOST.set(MOST.get().max(HELD.get()));
}

// SAFETY: every call is handed on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: the caller's own promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: the caller's own promise.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The result of `work`, and the most bytes that it held beyond what was held before.
fn most_held<R>(work: impl FnOnce() -> R) -> (R, usize) {
    let before = HELD.get();
    MOST.set(before);
    let result = work();
    (result, (MOST.get() - before) as usize)
}

/// A grid of points with two triangles in each square.
fn sheet(side: u32) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let point = |i: u32| [f64::from(i % side), f64::from(i / side), f64::from(i * i % 7) * 0.1];
    let squares = (0..side - 1).flat_map(|y| (0..side - 1).map(move |x| y * side + x));
    let triangles = squares.flat_map(|a| [[a, a + 1, a + side], [a + 1, a + side + 1, a + side]]);
    ((0..side * side).map(point).collect(), triangles.collect())
}

#[test]
fn a_topology_takes_so_many_bytes_for_each_point_triangle_and_line() {
    let (points, triangles) = sheet(120);
    let chain: Vec<[u32; 2]> = (1..14_400).map(|end| [end - 1, end]).collect();
    let star: Vec<[u32; 2]> = (1..14_400).map(|end| [0, end]).collect();
    let fan: Vec<[u32; 3]> = (2..14_400).map(|end| [0, end - 1, end]).collect();
    let features: Vec<u32> = (0..triangles.len() as u32).map(|triangle| triangle / 100).collect();
    for (name, triangles, lines) in [
        ("sheet", &triangles[..], &[][..]),
        ("fan", &fan[..], &[]),
        ("chain", &[], &chain[..]),
        ("star", &[], &star[..]),
        ("points", &[], &[]),
    ] {
        let features = features.get(..triangles.len());
        let coded = Topology::encode(&points, triangles, features, lines, 1e-3).unwrap();
        let (copy, most) = most_held(|| Topology::decode(&coded.message).unwrap());
        let (_, of_elements) = most_held(|| copy.elements().len());
        let count = points.len() + triangles.len() + lines.len();
        assert!(most.max(of_elements) < OF_A_TOPOLOGY * count + ANYWAY, "{name}: {most} bytes");
    }
}

#[test]
fn a_frame_takes_so_many_bytes_for_each_value() {
    let (points, triangles) = sheet(120);
    let coded = Topology::encode(&points, &triangles, None, &[], 1e-3).unwrap();
    let hierarchy = coded.topology.points();
    let wave: Vec<f64> =
        points.iter().flat_map(|[x, y, z]| [(0.1 * x).sin(), y * z, (x * y).cos()]).collect();
    let mostly: Vec<f64> = wave.iter().map(|value| value.max(0.9)).collect();
    for (name, values, bound) in [
        ("wave", &wave, Bound::Absolute(1e-4)),
        ("coarse", &wave, Bound::Absolute(0.1)),
        ("mostly one", &mostly, Bound::Absolute(1e-3)),
        ("exact", &wave, Bound::Exact),
        ("constant", &vec![1.0; wave.len()], Bound::Exact),
    ] {
        let (mut field, mut copy) = (Field::new(3), Field::new(3));
        for _ in 0..3 {
            let mut message = Vec::new();
            field.encode(hierarchy, &coded.points, values, bound, &mut message).unwrap();
            // What is worked out once in a process.
            drop(Field::new(3).decode(hierarchy, &mut &message[..]));
            let (_, most) = most_held(|| copy.decode(hierarchy, &mut &message[..]).unwrap());
            assert!(most < OF_A_VALUE * values.len() + ANYWAY, "{name}: {most} bytes");
        }
    }
}

#[test]
fn damaged_messages_take_no_more() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/codec");
    let sound = fs::read(corpus.join("topology")).unwrap();
    for at in 0..sound.len() {
        for by in [1, 0x40, 0x80, 0xff] {
            let mut message = sound.clone();
            message[at] ^= by;
            let (copy, most) = most_held(|| Topology::decode(&message));
            // A message of `n` bytes has no more than 1024 n points, triangles and lines.
            let count = copy.map_or(1024 * message.len(), |copy| {
                copy.points().len() + copy.triangles().len() + copy.lines().len()
            });
            assert!(most < OF_A_TOPOLOGY * count + ANYWAY, "byte {at} by {by}: {most} bytes");
        }
    }
}
