//! Reads recordings.

use std::{
    fs::File,
    io::{self, BufReader, Read},
    path::{Path, PathBuf},
};

use serde_json::Value;
use tombolo_pipelines::encode::view_of;

use super::format::{HEAD, Head, Kind, MAGIC, find_head, read_head, read_message};

/// Key frames whose places are kept, and steps whose moments are; in a longer recording every other
/// is forgotten, again and again.
const KEPT: usize = 1 << 18;
/// The most views whose frames are shown.
const MOST_VIEWS: usize = 64;
/// Texts about orders whose places are kept, the newest.
const ORDERS: usize = 1 << 16;

/// Why a recording cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The file cannot be read or written.
    #[error("the recording {}: {source}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file is something else.
    #[error("{} is no recording; expected a file that a run has written for its `record`", file.display())]
    Other {
        /// The file.
        file: PathBuf,
    },
    /// There is no whole message in the file.
    #[error("the recording {} is empty: the run ended before anything was recorded", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
}

/// A moment of a run, and of its recording.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Moment {
    /// The step.
    pub cycle: u64,
    /// The simulated time.
    pub time: f64,
    /// Seconds since the recording began.
    pub seconds: f64,
}

impl Moment {
    fn of(head: &Head) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "some years of milliseconds")]
        let seconds = head.milliseconds as f64 / 1e3;
        Self { cycle: head.cycle, time: head.time, seconds }
    }
}

/// The place of a message.
#[derive(Debug, Clone, Copy)]
struct Place {
    at: u64,
    view: u32,
    moment: Moment,
}

/// Places or moments of which, once there are many, one in so many is kept.
#[derive(Debug)]
struct Thinned<T> {
    kept: Vec<T>,
    every: usize,
    seen: usize,
}

impl<T> Thinned<T> {
    fn new() -> Self {
        Self { kept: Vec::new(), every: 1, seen: 0 }
    }

    fn push(&mut self, next: T) {
        if self.seen.is_multiple_of(self.every) {
            self.kept.push(next);
        }
        self.seen += 1;
        if self.kept.len() > KEPT {
            let mut index = 0;
            self.kept.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.every *= 2;
        }
    }
}

/// The names of the views that a greeting lists; `None` where it has no list.
fn names_of_views(hello: &str) -> Option<Vec<String>> {
    let hello: Value = serde_json::from_str(hello).ok()?;
    let views = hello["hello"]["views"].as_array()?;
    Some(views.iter().filter_map(|view| view["name"].as_str()).map(str::to_owned).collect())
}

/// A message of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Recorded {
    /// When it came.
    pub moment: Moment,
    /// The message, as viewers were sent it.
    pub message: RecordedMessage,
}

/// What was sent to viewers.
#[derive(Debug, Clone, PartialEq)]
pub enum RecordedMessage {
    /// A text message: JSON. A `stack` has the edits themselves in place of their number.
    Text(String),
    /// A frame, and whether it can be read by itself.
    Frame {
        /// The frame's message.
        bytes: Vec<u8>,
        /// Whether it goes on from no other.
        is_key: bool,
    },
}

/// A recording that is read: what was whole when it was opened.
///
/// A last message that a killed run left half-written is passed over, and so is one whose head is
/// damaged; [`Recording::lost_bytes`] says how much. Memory is bounded, however long the file is.
#[derive(Debug)]
pub struct Recording {
    path: PathBuf,
    file: BufReader<File>,
    /// Where the last whole message ends, and how long the file is.
    end: u64,
    length: u64,
    lost: u64,
    first: Moment,
    last: Moment,
    keys: Thinned<Place>,
    /// The first moment of each step.
    moments: Thinned<Moment>,
    hellos: Vec<Place>,
    orders: Vec<Place>,
    stacks: Vec<Place>,
    /// Where the next message to be read lies.
    next: u64,
    /// The views whose frames can be shown: their key frame was read since the last seek.
    shown: Vec<u32>,
    /// From which place on key frames of views are shown since the last seek; of others all are.
    from: Vec<(u32, u64)>,
}

impl Recording {
    /// Opens a file and looks at the heads of all its messages.
    ///
    /// # Errors
    /// [`RecordError`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, RecordError> {
        let path = path.as_ref();
        let failed = |source| RecordError::File { file: path.into(), source };
        let file = File::open(path).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        let mut file = BufReader::new(file);
        let mut magic = [0; MAGIC.len()];
        match file.read_exact(&mut magic) {
            Ok(()) if magic == *MAGIC => {}
            Err(error) if error.kind() != io::ErrorKind::UnexpectedEof => {
                return Err(failed(error));
            }
            _ => return Err(RecordError::Other { file: path.into() }),
        }
        let mut recording = Self {
            path: path.into(),
            file,
            end: MAGIC.len() as u64,
            length,
            lost: 0,
            first: Moment::default(),
            last: Moment::default(),
            keys: Thinned::new(),
            moments: Thinned::new(),
            hellos: Vec::new(),
            orders: Vec::new(),
            stacks: Vec::new(),
            next: MAGIC.len() as u64,
            shown: Vec::new(),
            from: Vec::new(),
        };
        recording.look_through().map_err(failed)?;
        if recording.hellos.is_empty() {
            return Err(RecordError::Empty { file: path.into() });
        }
        Ok(recording)
    }

    fn look_through(&mut self) -> io::Result<()> {
        let mut is_first = true;
        while let Some((at, head)) = find_head(&mut self.file, self.end, self.length)? {
            self.lost += at - self.end;
            self.end = at + HEAD as u64 + u64::from(head.length);
            let moment = Moment::of(&head);
            let place = Place { at, view: head.view, moment };
            match head.kind {
                Kind::Hello => self.hellos.push(place),
                Kind::Order => self.orders.push(place),
                Kind::Stack => self.stacks.push(place),
                Kind::KeyFrame => self.keys.push(place),
                _ => {}
            }
            if is_first || (moment.cycle, moment.time) != (self.last.cycle, self.last.time) {
                self.moments.push(moment);
            }
            for kept in [&mut self.hellos, &mut self.orders, &mut self.stacks] {
                if kept.len() > ORDERS {
                    kept.drain(..ORDERS / 2);
                }
            }
            if std::mem::take(&mut is_first) {
                self.first = moment;
            }
            self.last = moment;
        }
        self.lost += self.length - self.end;
        Ok(())
    }

    /// The first moment.
    #[must_use]
    pub fn first(&self) -> Moment {
        self.first
    }

    /// The moment of the first frame; the first moment where there is none.
    #[must_use]
    pub fn first_frame(&self) -> Moment {
        self.keys.kept.first().map_or(self.first, |key| key.moment)
    }

    /// The last moment.
    #[must_use]
    pub fn last(&self) -> Moment {
        self.last
    }

    /// Bytes of the file that cannot be read: those of messages whose heads are damaged, and what is
    /// half-written at its end.
    #[must_use]
    pub fn lost_bytes(&self) -> u64 {
        self.lost
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The next message that can be shown; `None` at the end. A message whose bytes are damaged is
    /// passed over, and so are frames that go on from one that was not read.
    ///
    /// # Errors
    /// [`RecordError::File`].
    pub fn read_next(&mut self) -> Result<Option<Recorded>, RecordError> {
        let path = self.path.clone();
        let failed = |source| RecordError::File { file: path.clone(), source };
        while let Some((at, head)) = self.next_head().map_err(failed)? {
            self.next = at + HEAD as u64 + u64::from(head.length);
            if self.is_past(at, &head) {
                continue;
            }
            let recorded = self.message(at, &head).map_err(failed)?;
            if self.can_be_shown(&head, recorded.is_some())
                && let Some(recorded) = recorded
            {
                return Ok(Some(recorded));
            }
        }
        self.next = self.end;
        Ok(None)
    }

    /// The next message, and its place. Where one before it is damaged, nobody knows whose frame
    /// that was: views are shown again from their next key frames on.
    fn next_head(&mut self) -> io::Result<Option<(u64, Head)>> {
        let found = find_head(&mut self.file, self.next, self.end)?;
        if found.is_some_and(|(at, _)| at > self.next) {
            self.shown.clear();
        }
        Ok(found)
    }

    /// Whether a message is a key frame of a view that is shown from a later one on.
    fn is_past(&self, at: u64, head: &Head) -> bool {
        head.kind == Kind::KeyFrame
            && self.from.iter().any(|&(view, from)| view == head.view && at < from)
    }

    /// Whether a message can be shown: of frames those whose key frame was read since the last seek,
    /// with nothing damaged in between.
    fn can_be_shown(&mut self, head: &Head, is_sound: bool) -> bool {
        if !head.kind.is_frame() {
            return true;
        }
        let is_key = head.kind == Kind::KeyFrame;
        if !is_sound || is_key {
            self.shown.retain(|view| *view != head.view);
        }
        if is_sound && is_key && self.shown.len() < MOST_VIEWS {
            self.shown.push(head.view);
        }
        self.shown.contains(&head.view)
    }

    /// When the next message came that can be shown; `None` at the end.
    pub fn next_moment(&mut self) -> Option<Moment> {
        while let Some((at, head)) = self.next_head().ok()? {
            let is_shown = head.kind != Kind::NextFrame || self.shown.contains(&head.view);
            if is_shown && !self.is_past(at, &head) {
                return Some(Moment::of(&head));
            }
            self.next = at + HEAD as u64 + u64::from(head.length);
        }
        None
    }

    fn message(&mut self, at: u64, head: &Head) -> io::Result<Option<Recorded>> {
        let Some(bytes) = read_message(&mut self.file, at, head)? else { return Ok(None) };
        let message = if head.kind.is_frame() {
            RecordedMessage::Frame { bytes, is_key: head.kind == Kind::KeyFrame }
        } else {
            match String::from_utf8(bytes) {
                Ok(text) => RecordedMessage::Text(text),
                Err(_) => return Ok(None),
            }
        };
        Ok(Some(Recorded { moment: Moment::of(head), message }))
    }

    fn text_at(&mut self, place: Place) -> Option<String> {
        let head = read_head(&mut self.file, place.at).ok()??;
        match self.message(place.at, &head).ok()??.message {
            RecordedMessage::Text(text) => Some(text),
            RecordedMessage::Frame { .. } => None,
        }
    }

    /// Goes to a moment: the next messages will be the newest key frame before then of each view that
    /// the greeting of that moment lists, and what came behind it; of no view comes anything older.
    /// Texts before the moment are to be passed over.
    pub fn seek(&mut self, seconds: f64) {
        let upto = self.keys.kept.partition_point(|key| key.moment.seconds <= seconds);
        let mut newest: Vec<Place> = Vec::new();
        for key in self.keys.kept[..upto].iter().rev() {
            if newest.iter().all(|known| known.view != key.view) {
                newest.push(*key);
            }
            // More views than this are not looked for: they begin where they have their next key.
            if newest.len() >= MOST_VIEWS {
                break;
            }
        }
        let mut listed = self.hello(seconds).and_then(|hello| names_of_views(&hello));
        self.shown.clear();
        self.from.clear();
        let mut first = None;
        // The newest first: a view that was replaced has the name of the one that came after it.
        for key in newest {
            let is_listed = match (&mut listed, self.view_at(key)) {
                (Some(listed), Some(name)) => {
                    let place = listed.iter().position(|known| *known == name);
                    place.map(|place| listed.swap_remove(place)).is_some()
                }
                // What cannot be told is shown.
                _ => true,
            };
            if is_listed {
                first = Some(key.at);
            }
            self.from.push((key.view, if is_listed { key.at } else { key.at + 1 }));
        }
        let oldest = self.from.iter().map(|(_, from)| *from).min();
        self.next = first.or(oldest).unwrap_or(MAGIC.len() as u64);
    }

    /// The name of the view that a frame is of.
    fn view_at(&mut self, place: Place) -> Option<String> {
        let head = read_head(&mut self.file, place.at).ok()??;
        match self.message(place.at, &head).ok()??.message {
            RecordedMessage::Frame { bytes, .. } => view_of(&bytes).ok(),
            RecordedMessage::Text(_) => None,
        }
    }

    /// The moment of a cycle: that of the first message of it or a later one. In a recording of more
    /// than 2^18 steps it may be that of a step soon after it.
    #[must_use]
    pub fn seconds_of_cycle(&self, cycle: u64) -> f64 {
        self.seconds_where(|moment| moment.cycle >= cycle)
    }

    /// The moment of a simulated time.
    #[must_use]
    pub fn seconds_of_time(&self, time: f64) -> f64 {
        self.seconds_where(|moment| moment.time >= time)
    }

    fn seconds_where(&self, has_come: impl Fn(&Moment) -> bool) -> f64 {
        let found = self.moments.kept.iter().find(|moment| has_come(moment));
        found.map_or(self.last.seconds, |moment| moment.seconds)
    }

    /// The newest greeting up to a moment.
    pub fn hello(&mut self, seconds: f64) -> Option<String> {
        let upto = self.hellos.partition_point(|hello| hello.moment.seconds <= seconds).max(1);
        let place = self.hellos.get(upto - 1).copied()?;
        self.text_at(place)
    }

    /// The newest stack of edits up to a moment, and its place in the file.
    pub(crate) fn stack(&mut self, seconds: f64) -> Option<(u64, String)> {
        let upto = self.stacks.partition_point(|stack| stack.moment.seconds <= seconds);
        let place = self.stacks.get(upto.checked_sub(1)?).copied()?;
        Some((place.at, self.text_at(place)?))
    }

    /// The place in the file of the newest stack of edits among the messages that were read.
    pub(crate) fn place_of_stack(&self) -> Option<u64> {
        let upto = self.stacks.partition_point(|stack| stack.at < self.next);
        Some(self.stacks.get(upto.checked_sub(1)?)?.at)
    }

    /// The stack of edits that lies at a place in a file; `None` where there is none.
    pub(crate) fn stack_at(path: &Path, place: u64) -> io::Result<Option<String>> {
        let mut file = BufReader::new(File::open(path)?);
        let head = read_head(&mut file, place)?.filter(|head| head.kind == Kind::Stack);
        let Some(head) = head else { return Ok(None) };
        Ok(read_message(&mut file, place, &head)?.and_then(|bytes| String::from_utf8(bytes).ok()))
    }

    /// What had become of orders up to a moment: texts about them, the oldest first.
    pub fn orders(&mut self, seconds: f64) -> Vec<String> {
        let upto = self.orders.partition_point(|order| order.moment.seconds <= seconds);
        let places = self.orders[..upto].to_vec();
        places.into_iter().filter_map(|place| self.text_at(place)).collect()
    }
}
