//! Recordings of runs: what viewers are told, kept in a file.
//!
//! With `"record": "run.tombolo"` in its configuration a run writes one, whether anybody watches or
//! not; `tombolo play` shows it in the viewer, and `tombolo export` writes files for other programs.
//!
//! ```no_run
//! use tombolo::{pipelines::encode::Decoder, recording::{Recording, RecordedMessage}};
//!
//! let mut recording = Recording::open("run.tombolo")?;
//! println!("{} seconds, to cycle {}", recording.last().seconds, recording.last().cycle);
//! let mut decoder = Decoder::new();
//! while let Some(recorded) = recording.read_next()? {
//!     match recorded.message {
//!         RecordedMessage::Text(text) => println!("{text}"),
//!         RecordedMessage::Frame { bytes, .. } => {
//!             let frame = decoder.decode(&bytes)?;
//!             println!("{} at cycle {}: {} points", frame.view, frame.cycle, frame.points.len());
//!         }
//!     }
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod format;
mod reader;

pub(crate) use format::{HEAD, Head, Kind, MAGIC, find_head, write};
pub use reader::{Moment, RecordError, Recorded, RecordedMessage, Recording};

#[cfg(test)]
mod tests {
    use serde_json::json;
    use tombolo_deform::mesh::{CellType, Cells};
    use tombolo_pipelines::{
        encode::Encoder,
        extract::Extract,
        run::{Encoding, Frame},
    };

    use super::*;

    /// A recording of two views: a key frame of each every ten messages.
    fn bytes() -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        for number in 0..60_u64 {
            let text = format!("{{\"status\":{{\"cycle\":{number}}}}}");
            let (kind, view, message) = match number % 10 {
                0 if number == 0 => (Kind::Hello, 0, "{\"hello\":{}}".into()),
                1 => (Kind::KeyFrame, 0, format!("key {number}")),
                2 => (Kind::KeyFrame, 1, format!("key {number}")),
                3 => (Kind::Order, 0, format!("{{\"order\":{{\"id\":\"o{number}\"}}}}")),
                4..7 => (Kind::NextFrame, u32::from(number % 2 == 0), format!("next {number}")),
                _ => (Kind::of_text(&text), 0, text),
            };
            let moment = (number, 0.1 * number as f64);
            let head = Head::of(kind, view, moment, 100 * number, message.as_bytes()).unwrap();
            write(&mut out, &head, message.as_bytes()).unwrap();
        }
        out
    }

    fn opened(bytes: &[u8]) -> Result<Recording, RecordError> {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("run.tombolo");
        std::fs::write(&file, bytes).unwrap();
        Recording::open(&file)
    }

    fn all(recording: &mut Recording) -> Vec<Recorded> {
        std::iter::from_fn(|| recording.read_next().unwrap()).collect()
    }

    #[test]
    fn messages_come_back_in_their_order() {
        let mut recording = opened(&bytes()).unwrap();
        assert_eq!(recording.first(), Moment::default());
        assert_eq!(recording.last(), Moment { cycle: 59, time: 0.1 * 59.0, seconds: 5.9 });
        assert_eq!(recording.lost_bytes(), 0);
        let messages = all(&mut recording);
        assert_eq!(messages.len(), 60);
        assert!((0..60).zip(&messages).all(|(number, it)| it.moment.cycle == number));
    }

    #[test]
    fn it_is_gone_to_the_newest_key_frames_of_all_views() {
        let mut recording = opened(&bytes()).unwrap();
        for (seconds, expected) in [(0.0, 0), (0.15, 1), (2.15, 12), (3.9, 31), (100.0, 51)] {
            recording.seek(seconds);
            assert_eq!(recording.read_next().unwrap().unwrap().moment.cycle, expected, "{seconds}");
        }
        assert_eq!(recording.seconds_of_cycle(22), 2.2);
        // Also to where no key frame is.
        assert_eq!(recording.seconds_of_cycle(25), 2.5);
        assert_eq!(recording.seconds_of_time(0.1 * 37.0), 3.7);
        assert_eq!(recording.seconds_of_time(99.0), 5.9);
        assert_eq!(
            recording.orders(1.35),
            ["{\"order\":{\"id\":\"o3\"}}", "{\"order\":{\"id\":\"o13\"}}"]
        );
        assert_eq!(recording.hello(0.5).as_deref(), Some("{\"hello\":{}}"));
    }

    /// A key frame.
    fn frame(view: &str, cycle: u64) -> Vec<u8> {
        let cells = Cells::uniform(CellType::Triangle, vec![0, 1, 2]).unwrap();
        let extract = Extract {
            points: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            vertices: None,
            cells: cells.into(),
            features: None,
            fields: Vec::new(),
        };
        let (time, encoding) = (cycle as f64, Encoding::default());
        let frame = Frame { pipeline: view.into(), cycle, time, extract: extract.into(), encoding };
        Encoder::new().encode(&frame, false).unwrap().with_topology().to_vec()
    }

    #[test]
    fn no_view_is_shown_from_before_its_newest_key_frame_nor_one_that_is_gone() {
        let hello = |views: &[&str]| {
            let views: Vec<_> = views.iter().map(|name| json!({"name": name})).collect();
            (Kind::Hello, 0, json!({"hello": {"views": views}}).to_string().into_bytes())
        };
        let key = |number: u32, view: &str, cycle| (Kind::KeyFrame, number, frame(view, cycle));
        let next = |number: u32| (Kind::NextFrame, number, b"next".to_vec());
        let messages = [
            hello(&["rare", "often", "gone", "replaced"]),
            key(0, "rare", 1),
            key(1, "often", 2),
            key(2, "gone", 3),
            key(3, "replaced", 4),
            next(0),
            next(1),
            hello(&["rare", "often", "replaced"]),
            key(4, "replaced", 8),
            key(1, "often", 9),
            next(3),
            next(1),
            hello(&["rare", "often", "replaced", "gone"]),
            key(5, "gone", 13),
        ];
        let mut out = MAGIC.to_vec();
        for (number, (kind, view, message)) in (0..).zip(&messages) {
            let moment = (number, number as f64);
            let head = Head::of(*kind, *view, moment, 1000 * number, message).unwrap();
            write(&mut out, &head, message).unwrap();
        }
        let mut recording = opened(&out).unwrap();
        let mut shown = |seconds: f64| {
            recording.seek(seconds);
            let mut cycles = Vec::new();
            while recording.next_moment().is_some_and(|next| next.seconds <= seconds) {
                let recorded = recording.read_next().unwrap().unwrap();
                if let RecordedMessage::Frame { .. } = recorded.message {
                    cycles.push(recorded.moment.cycle);
                }
            }
            cycles
        };
        assert_eq!(shown(6.5), [1, 2, 3, 4, 5, 6]);
        assert_eq!(shown(11.5), [1, 5, 8, 9, 11]);
        assert_eq!(shown(13.0), [1, 5, 8, 9, 11, 13]);
        // What follows the moment is shown as it comes.
        assert_eq!(shown(11.5), [1, 5, 8, 9, 11]);
        let rest: Vec<u64> = all(&mut recording).iter().map(|it| it.moment.cycle).collect();
        assert_eq!(rest, [12, 13]);
    }

    #[test]
    fn what_was_cut_off_anywhere_is_read_up_to_there() {
        let whole = bytes();
        let expected = all(&mut opened(&whole).unwrap());
        let mut most = 0;
        for end in 0..whole.len() {
            match opened(&whole[..end]) {
                Ok(mut recording) => {
                    let found = all(&mut recording);
                    assert!(found[..] == expected[..found.len()] && found.len() >= most, "{end}");
                    most = found.len();
                }
                Err(RecordError::Other { .. } | RecordError::Empty { .. }) => assert_eq!(most, 0),
                Err(error) => panic!("{end}: {error}"),
            }
        }
        assert_eq!(most, 59);
    }

    #[test]
    fn what_was_damaged_anywhere_is_passed_over() {
        let whole = bytes();
        let expected = all(&mut opened(&whole).unwrap());
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 1 << (at % 8);
            let Ok(mut recording) = opened(&damaged) else { continue };
            let found = all(&mut recording);
            assert!(found.iter().all(|message| expected.contains(message)), "{at}");
            recording.seek(3.0);
            let _ = (recording.read_next(), recording.hello(3.0), recording.orders(3.0));
        }
    }

    #[test]
    fn what_lies_behind_a_damaged_head_is_found_again() {
        let whole = bytes();
        let expected = all(&mut opened(&whole).unwrap());
        // The key frame of view 0 at cycle 11: its next frames, 15, cannot be shown without it.
        let at = whole.windows(6).position(|bytes| bytes == b"key 11").unwrap() - HEAD;
        for byte in at..at + HEAD {
            let mut damaged = whole.clone();
            damaged[byte] ^= 0x10;
            let mut recording = opened(&damaged).unwrap();
            assert_eq!(recording.lost_bytes(), HEAD as u64 + 6, "byte {}", byte - at);
            assert_eq!(recording.last().cycle, 59);
            let found: Vec<u64> = all(&mut recording).iter().map(|it| it.moment.cycle).collect();
            let seen = expected.iter().map(|it| it.moment.cycle);
            // Nor is it known whose frame the damaged one was.
            let without: Vec<u64> = seen.filter(|cycle| ![11, 15].contains(cycle)).collect();
            assert_eq!(found, without, "byte {}", byte - at);
        }
    }

    #[test]
    fn lengths_that_lie_cost_no_memory() {
        let mut lying = MAGIC.to_vec();
        let mut head = Head::of(Kind::Hello, 0, (0, 0.0), 0, b"{\"hello\":{}}").unwrap();
        head.length = 1 << 30;
        write(&mut lying, &head, b"{\"hello\":{}}").unwrap();
        assert!(matches!(opened(&lying), Err(RecordError::Empty { .. })));
    }
}
