//! The thread that writes a recording: it is told what a viewer is told, and nobody waits for it.

use std::{
    collections::HashMap,
    fs::{File, OpenOptions, TryLockError},
    io::{self, BufWriter, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use serde_json::{Value, json};

use crate::{
    recording::{HEAD, Head, Kind, MAGIC, RecordError, find_head, write},
    step::Moment,
    stream::{EXACT, Hub, Observed, Observer},
};

/// After how long a view is recorded with a key frame again, so that it can be gone to.
const KEY_PERIOD: Duration = Duration::from_secs(10);
/// How long the thread waits for something to write.
const PERIOD: Duration = Duration::from_millis(100);
/// How long the end of a run waits for the last messages to be written.
const END: Duration = Duration::from_secs(2);

/// A recording under way.
pub(crate) struct Recorder {
    hub: Arc<Hub>,
    is_done: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// Encodes frames, where no server does.
    encoder: Option<JoinHandle<()>>,
}

impl Recorder {
    /// Begins to record, below what is in the file already. `serves` says whether the run has a server,
    /// which looks after the status; `orders` are those so far.
    pub(crate) fn start(
        file: &Path,
        most_bytes: u64,
        hub: &Arc<Hub>,
        orders: Value,
        serves: bool,
    ) -> Result<Self, RecordError> {
        let error = |source| RecordError::File { file: file.into(), source };
        let out = Out::open(file)?;
        let observer = Observer::of(hub).map_err(error)?;
        let is_done = Arc::new(AtomicBool::new(false));
        let mut writing = Writing {
            path: file.into(),
            out,
            most_bytes,
            hub: Arc::clone(hub),
            observer,
            orders: Some(orders),
            serves,
            keys: HashMap::new(),
            is_incomplete: false,
        };
        let done = Arc::clone(&is_done);
        let work = move || {
            let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
                writing.write_until_end()
            }));
            let ended = match outcome {
                Ok(Ok(())) => None,
                Ok(Err(reason)) => Some(reason),
                Err(_) => Some("the recorder failed, which is a fault of Tombolo".into()),
            };
            writing.hub.stop_observing();
            if let Some(reason) = ended {
                let message = format!(
                    "the recording {} ends here: {reason}; the run goes on",
                    writing.path.display()
                );
                let (run, path) = (writing.hub.run(), writing.path.display());
                tracing::warn!(run, %path, reason, "{message}");
                writing.hub.tell(move || json!({"error": {"message": message}}));
            }
            done.store(true, Ordering::Release);
        };
        let thread = std::thread::Builder::new().name("tombolo-record".into());
        let thread = Some(thread.spawn(work).map_err(error)?);
        let mut recorder = Self { hub: Arc::clone(hub), is_done, thread, encoder: None };
        if !serves {
            let hub = Arc::clone(hub);
            let encoder = std::thread::Builder::new().name("tombolo-encode".into());
            let encoder = encoder.spawn(move || hub.encode_until_closed());
            recorder.encoder = Some(encoder.map_err(error)?);
        }
        Ok(recorder)
    }
}

impl Drop for Recorder {
    /// Writes what was told so far, if the disk lets it within two seconds.
    fn drop(&mut self) {
        // Where there was a server, its end has told how the run ends.
        let serves = self.encoder.is_none();
        if let Some(encoder) = self.encoder.take() {
            self.hub.close();
            let _ = encoder.join();
        }
        self.hub.end_observing(!serves);
        let until = Instant::now() + END;
        while !self.is_done.load(Ordering::Acquire) {
            if Instant::now() >= until {
                let run = self.hub.run();
                tracing::warn!(
                    run,
                    "the end of the recording is not on disk: the disk does not answer"
                );
                return;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Writing {
    path: PathBuf,
    out: Out,
    most_bytes: u64,
    hub: Arc<Hub>,
    observer: Observer,
    orders: Option<Value>,
    serves: bool,
    /// By view, when its last key frame was written, and whether it was asked for another.
    keys: HashMap<usize, (Instant, bool)>,
    /// Whether it was said that frames are left out.
    is_incomplete: bool,
}

impl Writing {
    /// Writes what comes; the error says why it is given up.
    fn write_until_end(&mut self) -> Result<(), String> {
        loop {
            match self.observer.next() {
                Some(Observed::Hello) => {
                    let orders = self.orders.take();
                    let is_first = orders.is_some();
                    let text = self.hub.hello_for_all(orders);
                    self.put(Kind::Hello, 0, text.as_bytes())?;
                    if is_first {
                        let text = self.hub.whole_stack(None);
                        self.put(Kind::Stack, 0, text.as_bytes())?;
                    }
                }
                Some(Observed::Text(text)) => {
                    let text = text.written();
                    self.put(Kind::of_text(&text), 0, text.as_bytes())?;
                }
                Some(Observed::Stack(change)) => {
                    let text = self.hub.whole_stack(Some(change));
                    self.put(Kind::Stack, 0, text.as_bytes())?;
                }
                Some(Observed::Frame { view, is_key, bytes }) => {
                    let number = u32::try_from(view).unwrap_or(u32::MAX);
                    let kind = if is_key { Kind::KeyFrame } else { Kind::NextFrame };
                    self.put(kind, number, &bytes)?;
                    let (last, has_asked) =
                        self.keys.entry(view).or_insert((Instant::now(), false));
                    if is_key {
                        (*last, *has_asked) = (Instant::now(), false);
                    } else if last.elapsed() > KEY_PERIOD && !std::mem::replace(has_asked, true) {
                        self.hub.want_key(view, EXACT);
                    }
                }
                Some(Observed::Behind(view)) => self.hub.want_key(view, EXACT),
                Some(Observed::End) => {
                    self.say_what_is_missing();
                    return self.out.flush().map_err(|error| error.to_string());
                }
                Some(Observed::TooMuch) => {
                    return Err("the disk is too slow for what viewers are sent".into());
                }
                None => {
                    self.out.flush().map_err(|error| error.to_string())?;
                    self.say_what_is_missing();
                    self.observer.wait(PERIOD);
                    if !self.serves {
                        self.hub.status();
                    }
                }
            }
        }
    }

    /// Says once, as soon as it is so, that frames are left out; the report counts them.
    fn say_what_is_missing(&mut self) {
        if self.is_incomplete || self.hub.counts().unrecorded == 0 {
            return;
        }
        self.is_incomplete = true;
        let (run, path) = (self.hub.run(), self.path.display());
        tracing::warn!(
            run,
            %path,
            "the recording {path} has not all frames: they come faster than they are encoded and \
             written, and the solver does not wait; the report counts those that are missing"
        );
    }

    fn put(&mut self, kind: Kind, view: u32, message: &[u8]) -> Result<(), String> {
        if self.out.bytes + (HEAD + message.len()) as u64 > self.most_bytes {
            self.out.flush().map_err(|error| error.to_string())?;
            return Err(format!(
                "it has come to {} MB, the most that `record_megabytes` lets it have",
                self.most_bytes >> 20
            ));
        }
        let Moment { cycle, time } = self.hub.clock.get();
        self.out.put(kind, view, (cycle, time), message).map_err(|error| error.to_string())
    }
}

/// The file. It is locked as long as this lives.
struct Out {
    file: BufWriter<File>,
    bytes: u64,
    begun: Instant,
    /// Milliseconds of what was in the file before.
    before: u64,
}

impl Out {
    /// Opens a file to go on at its end, or makes one, and the directory for it where there is none.
    fn open(path: &Path) -> Result<Self, RecordError> {
        let failed = |source| RecordError::File { file: path.into(), source };
        if let Some(directory) = path.parent().filter(|it| !it.as_os_str().is_empty()) {
            std::fs::create_dir_all(directory).map_err(failed)?;
        }
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let mut file = options.open(path).map_err(failed)?;
        match file.try_lock() {
            // Some file systems have no locks; a recording there is still better than none.
            Ok(()) | Err(TryLockError::Error(_)) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(failed(io::Error::other("another run writes to it")));
            }
        }
        let length = file.metadata().map_err(failed)?.len();
        let (mut end, mut before) = (MAGIC.len() as u64, 0);
        let mut magic = vec![0; MAGIC.len().min(usize::try_from(length).unwrap_or(usize::MAX))];
        file.read_exact(&mut magic).map_err(failed)?;
        if !MAGIC.starts_with(&magic) {
            return Err(RecordError::Other { file: path.into() });
        }
        if magic.len() < MAGIC.len() {
            file.seek(SeekFrom::Start(0)).map_err(failed)?;
            file.write_all(MAGIC).map_err(failed)?;
        }
        // What a killed run left half-written is cut off; what lies behind a damaged head is not.
        while let Some((at, head)) = find_head(&mut file, end, length).map_err(failed)? {
            end = at + HEAD as u64 + u64::from(head.length);
            before = head.milliseconds.saturating_add(1);
        }
        file.set_len(end).map_err(failed)?;
        file.seek(SeekFrom::Start(end)).map_err(failed)?;
        let file = BufWriter::with_capacity(1 << 20, file);
        Ok(Self { file, bytes: end, begun: Instant::now(), before })
    }

    fn put(&mut self, kind: Kind, view: u32, moment: (u64, f64), message: &[u8]) -> io::Result<()> {
        let passed = u64::try_from(self.begun.elapsed().as_millis()).unwrap_or(u64::MAX);
        let milliseconds = self.before.saturating_add(passed);
        if let Some(head) = Head::of(kind, view, moment, milliseconds, message) {
            self.bytes += write(&mut self.file, &head, message)?;
        }
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
