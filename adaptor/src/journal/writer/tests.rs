//! What is written, what waits and what is left out, on a disk that answers as the test says.

use std::{
    io,
    sync::mpsc::{Receiver, Sender, channel},
};

use tombolo_pipelines::language::{Change, Command, Order, RunEnd};

use super::*;

/// A disk that answers as the test says: each write waits for its word.
struct Disk {
    answers: Receiver<io::Result<()>>,
    written: Arc<Mutex<String>>,
}

impl Append for Disk {
    fn append(&mut self, lines: &[u8]) -> io::Result<()> {
        self.answers.recv().unwrap_or(Ok(()))?;
        lock(&self.written).push_str(std::str::from_utf8(lines).unwrap());
        Ok(())
    }

    fn path(&self) -> &Path {
        Path::new("journal.jsonl")
    }
}

/// The outcome of the line of this name.
type Answer = (String, Outcome);

struct Desk {
    journal: Journal,
    disk: Sender<io::Result<()>>,
    written: Arc<Mutex<String>>,
    told: Arc<Mutex<Vec<Option<String>>>>,
    answer: Sender<Answer>,
    answers: Receiver<Answer>,
}

impl Desk {
    fn new() -> Self {
        let (disk, answers) = channel();
        let (written, told) = (Arc::<Mutex<String>>::default(), Arc::<Mutex<Vec<_>>>::default());
        let store = Disk { answers, written: Arc::clone(&written) };
        let tells = Arc::clone(&told);
        let tell = move |reason: Option<&str>| lock(&tells).push(reason.map(str::to_owned));
        let journal = Journal::start(store, String::new(), tell).unwrap();
        let (answer, answers) = channel();
        Self { journal, disk, written, told, answer, answers }
    }

    fn ask(&self, id: &str) {
        self.ask_for(&entry(id));
    }

    fn ask_for(&self, entry: &JournalEntry) {
        let (tell, id) = (self.answer.clone(), entry.id.clone());
        self.journal.ask(entry, move |outcome| tell.send((id, outcome)).unwrap());
    }

    /// Lets the write under way have lasted for as long as a disk may take.
    fn let_patience_end(&self) {
        let shared = self.journal.shared.as_ref().unwrap();
        lock(&shared.state).since = Instant::now().checked_sub(PATIENCE);
    }

    fn outcome(&self) -> (String, Outcome) {
        self.answers.recv_timeout(Duration::from_secs(100)).unwrap()
    }

    /// Waits until the thread is at the disk.
    fn wait_for_write(&self) {
        let shared = self.journal.shared.as_ref().unwrap();
        while lock(&shared.state).since.is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn finish(self) -> (String, Vec<Option<String>>) {
        drop(self.disk);
        self.journal.close();
        (lock(&self.written).clone(), lock(&self.told).clone())
    }
}

fn entry(id: &str) -> JournalEntry {
    JournalEntry {
        id: id.into(),
        status: OrderStatus::Accepted,
        cycle: 1,
        time: 0.5,
        command: Some(Command::Order(Order::from(Change::Stack(Vec::new())))),
        by: None,
        reason: None,
        min_scaled_jacobian: None,
        fraction: None,
    }
}

/// A line of so many bytes and some more.
fn long(id: &str, bytes: usize) -> JournalEntry {
    JournalEntry { reason: Some("x".repeat(bytes)), ..entry(id) }
}

fn end(cycle: u64) -> JournalNote {
    JournalNote::End(RunEnd { cycle, time: 0.0 })
}

#[test]
fn what_came_meanwhile_is_written_together_and_then_answered() {
    let desk = Desk::new();
    desk.ask("a");
    desk.wait_for_write();
    desk.ask("b");
    desk.journal.note(&end(7));
    desk.ask("c");
    assert!(desk.answers.try_recv().is_err(), "nothing is on disk yet");
    desk.disk.send(Ok(())).unwrap();
    assert_eq!(desk.outcome(), ("a".into(), Ok(())));
    desk.disk.send(Ok(())).unwrap();
    assert_eq!([desk.outcome().0, desk.outcome().0], ["b", "c"]);
    let (written, told) = desk.finish();
    assert_eq!((written.lines().count(), told.len()), (4, 0));
}

#[test]
fn a_journal_goes_on_by_itself_where_nothing_else_is_to_be_written() {
    let desk = Desk::new();
    desk.ask("a");
    desk.disk.send(Err(io::Error::other("no space left"))).unwrap();
    assert_eq!(desk.outcome(), ("a".into(), Err("no space left".into())));
    // Once in vain, and then it goes on.
    desk.disk.send(Err(io::Error::other("no space left"))).unwrap();
    desk.disk.send(Ok(())).unwrap();
    while desk.journal.lost().is_some() {
        std::thread::sleep(Duration::from_millis(1));
    }
    desk.disk.send(Ok(())).unwrap();
    desk.ask("b");
    assert_eq!(desk.outcome(), ("b".into(), Ok(())));
    let (written, told) = desk.finish();
    assert_eq!(told, [Some("no space left".into()), None]);
    let (first, rest) = written.split_once('\n').unwrap();
    assert_eq!(first, r#"{"lost":{"lines":0}}"#);
    assert!(rest.starts_with(r#"{"id":"b","status":"accepted""#), "{rest}");
}

#[test]
fn the_line_about_a_checkpoint_keeps_its_place_where_it_cannot_be_written_at_once() {
    let desk = Desk::new();
    desk.journal.note(&end(1));
    desk.wait_for_write();
    std::thread::scope(|threads| {
        let saved = CheckpointNote { id: "k".into(), cycle: 2, time: 0.0 };
        let saving = threads.spawn(|| desk.journal.checkpoint(saved));
        desk.disk.send(Ok(())).unwrap();
        desk.disk.send(Err(io::Error::other("no space left"))).unwrap();
        saving.join().unwrap();
    });
    desk.journal.note(&end(3));
    desk.disk.send(Ok(())).unwrap();
    while desk.journal.lost().is_some() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let (written, _) = desk.finish();
    let cycles = ["\"end\":{\"cycle\":1", "\"checkpoint\":{\"id\":\"k\"", "\"end\":{\"cycle\":3"];
    let lines: Vec<&str> = written.lines().collect();
    assert_eq!(lines.len(), 3, "{written}");
    assert!(lines.iter().zip(cycles).all(|(line, part)| line.contains(part)), "{written}");
}

#[test]
fn on_a_full_disk_nothing_is_accepted_and_nothing_else_is_lost() {
    let desk = Desk::new();
    let full = || Err(io::Error::other("no space left"));
    desk.ask("a");
    desk.wait_for_write();
    desk.journal.note(&end(1));
    desk.disk.send(full()).unwrap();
    assert_eq!(desk.outcome(), ("a".into(), Err("no space left".into())));
    desk.ask("b");
    assert_eq!(desk.outcome(), ("b".into(), Err("no space left".into())));
    assert_eq!(desk.journal.lost().as_deref(), Some("no space left"));
    desk.journal.note(&end(2));
    desk.disk.send(full()).unwrap();
    desk.disk.send(Ok(())).unwrap();
    while desk.journal.lost().is_some() {
        std::thread::sleep(Duration::from_millis(1));
    }
    desk.disk.send(Ok(())).unwrap();
    desk.ask("c");
    assert_eq!(desk.outcome(), ("c".into(), Ok(())));
    let (written, told) = desk.finish();
    assert_eq!(told, [Some("no space left".into()), None]);
    for (held, text) in [("\"cycle\":1,\"time\":0.0", 1), ("\"cycle\":2", 1), ("\"c\"", 1)] {
        assert_eq!(written.matches(held).count(), text, "{held} in {written}");
    }
    for id in ["a", "b"] {
        assert!(!written.contains(&format!("\"{id}\",\"status\":\"accepted\"")), "{written}");
    }
}

#[test]
fn what_hangs_is_refused_and_taken_back_when_it_was_written_after_all() {
    let desk = Desk::new();
    desk.ask("a");
    desk.wait_for_write();
    desk.ask("b");
    desk.journal.look_at_time();
    assert!(desk.answers.try_recv().is_err(), "it has not waited long enough");
    desk.let_patience_end();
    desk.journal.look_at_time();
    for id in ["a", "b"] {
        let (refused, outcome) = desk.outcome();
        assert_eq!(refused, id);
        assert!(outcome.unwrap_err().contains("has not answered"));
    }
    let (written, told) = desk.finish();
    assert_eq!(told.len(), 2, "{told:?}");
    assert!(written.contains("\"a\",\"status\":\"accepted\""), "{written}");
    assert!(written.contains("\"a\",\"status\":\"rejected\""), "{written}");
    assert!(!written.contains("\"b\""), "{written}");
}

#[test]
fn more_than_can_be_kept_is_counted() {
    let desk = Desk::new();
    desk.journal.note(&end(1));
    desk.wait_for_write();
    desk.let_patience_end();
    let long = long("a", 1 << 20);
    (0..10).for_each(|_| desk.journal.write(&long));
    let (written, _) = desk.finish();
    assert_eq!(written.lines().count(), 1 + 3 + 1);
    assert!(written.ends_with("{\"lost\":{\"lines\":7}}\n"), "{}", &written[..80]);
}

#[test]
fn while_long_lines_are_written_no_other_is_lost() {
    let desk = Desk::new();
    desk.ask_for(&long("asked", 2 * KEPT));
    desk.wait_for_write();
    desk.journal.note(&end(1));
    // As an order of a file with the numbers of a displacement.
    desk.journal.write(&long("of a file", 2 * KEPT));
    desk.journal.note(&end(2));
    let (written, _) = desk.finish();
    assert_eq!(written.lines().count(), 4);
    assert!(!written.contains("\"lost\""));
}

#[test]
fn on_a_slow_disk_only_lines_that_nobody_waits_for_count() {
    let desk = Desk::new();
    desk.ask_for(&long("under way", 2 * KEPT));
    desk.wait_for_write();
    desk.ask_for(&long("behind it", 2 * KEPT));
    desk.let_patience_end();
    desk.journal.note(&end(1));
    desk.journal.look_at_time();
    desk.journal.note(&end(2));
    let (written, _) = desk.finish();
    // The first, the line that takes it back, and the two notes.
    assert_eq!(written.lines().count(), 4);
    assert!(!written.contains("\"lost\""));
}

#[test]
fn what_is_kept_is_counted_to_the_byte() {
    let desk = Desk::new();
    desk.ask("a");
    desk.wait_for_write();
    desk.journal.note(&end(1));
    desk.ask("b");
    desk.disk.send(Err(io::Error::other("no space left"))).unwrap();
    assert_eq!([desk.outcome().0, desk.outcome().0], ["a", "b"]);
    desk.journal.note(&end(2));
    let shared = Arc::clone(desk.journal.shared.as_ref().unwrap());
    let kept = [end(1), end(2)].map(|note| line(&note).len()).iter().sum::<usize>();
    assert_eq!(lock(&shared.state).kept, kept);
    desk.finish();
    // After a write that failed, closing does not wait for the next one.
    let begun = Instant::now();
    while lock(&shared.state).kept > 0 && begun.elapsed() < Duration::from_secs(100) {
        std::thread::sleep(Duration::from_millis(1));
    }
    let state = lock(&shared.state);
    assert_eq!((state.kept, state.bytes), (0, 0));
}

#[test]
fn whoever_waits_for_a_line_may_be_the_last_to_hold_the_journal() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("journal.jsonl");
    let (go, gone) = channel::<()>();
    let journal =
        Arc::new(Journal::start(Store::open(&path).unwrap(), String::new(), |_| {}).unwrap());
    let last = Arc::clone(&journal);
    journal.ask(&entry("o1"), move |_| {
        let _ = gone.recv();
        drop(last);
    });
    drop(journal);
    drop(go);
    let until = Instant::now() + Duration::from_secs(20);
    while let Err(error) = Store::open(&path) {
        assert!(Instant::now() < until, "{error}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// A run that goes on would stop at such a line.
#[test]
fn a_line_that_nobody_would_read_is_not_written() {
    let desk = Desk::new();
    let long = JournalEntry { reason: Some("x".repeat(DOCUMENT.most)), ..entry("a") };
    assert_eq!(desk.journal.try_write(&long), Err(DOCUMENT.check(line(&long).len()).unwrap_err()));
    desk.ask_for(&long);
    let (id, outcome) = desk.outcome();
    assert!(id == "a" && outcome.unwrap_err().contains("in its line of the journal"));
    let many = JournalEntry { reason: Some("[".repeat(VALUES.most)), ..entry("b") };
    assert!(desk.journal.try_write(&many).is_err());
    assert_eq!(desk.journal.try_write(&entry("c")), Ok(()));
    desk.disk.send(Ok(())).unwrap();
    desk.journal.wait();
    assert_eq!(lock(&desk.written).matches("\"id\"").count(), 1);
}
