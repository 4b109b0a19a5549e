//! Runs that go on by themselves, and a client that steers one.

use std::{
    net::SocketAddr,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use tombolo::{
    OrderStatus, Parameter, Report, Settings,
    client::{Client, ClientError, Event, Link, Options, Received},
    pipelines::language::parse_valid,
};

use super::{PATIENCE, Solver, config, squeeze};

/// A surface at each step, a monitor, and a parameter with a unit.
pub const MONITORED: &str = r#"{"version": 1, "stream": {"listen": "127.0.0.1:0"},
    "units": {"inflow": "m/s"}, "pipelines": [
    {"name": "boundary", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]},
    {"name": "health", "every": {"steps": 1}, "stages": [{"statistics": {"field": "speed"}}]}]}"#;

/// A solver that steps on a thread of its own, until a viewer or this stops it, or this is dropped.
pub struct Running {
    over: Arc<AtomicBool>,
    cycle: Arc<AtomicU64>,
    /// Milliseconds from step to step.
    rest: Arc<AtomicU64>,
    /// Milliseconds for which the solver rests now; 0 while it is in a call.
    rests_for: Arc<AtomicU64>,
    thread: Option<JoinHandle<Report>>,
}

impl Running {
    pub fn start(mut solver: Solver) -> Self {
        let over = Arc::new(AtomicBool::new(false));
        let [cycle, rest, rests_for] = [0, 2, 0].map(|value| Arc::new(AtomicU64::new(value)));
        let (is_over, at) = (Arc::clone(&over), Arc::clone(&cycle));
        let (resting, resting_for) = (Arc::clone(&rest), Arc::clone(&rests_for));
        let run = move || {
            while !solver.stopped && !is_over.load(Ordering::Relaxed) {
                solver.step();
                at.store(solver.cycle, Ordering::Relaxed);
                let begun = Instant::now();
                // A rest may be made longer, or ended, while it is taken.
                loop {
                    let rest = resting.load(Ordering::Relaxed);
                    resting_for.store(rest, Ordering::Relaxed);
                    let left = Duration::from_millis(rest).saturating_sub(begun.elapsed());
                    if left.is_zero() || is_over.load(Ordering::Relaxed) {
                        break;
                    }
                    std::thread::sleep(left.min(Duration::from_millis(5)));
                }
                resting_for.store(0, Ordering::Relaxed);
            }
            solver.finish()
        };
        Self { over, cycle, rest, rests_for, thread: Some(std::thread::spawn(run)) }
    }

    pub fn cycle(&self) -> u64 {
        self.cycle.load(Ordering::Relaxed)
    }

    /// Lets the solver rest for so many milliseconds from step to step.
    pub fn rest(&self, milliseconds: u64) {
        self.rest.store(milliseconds, Ordering::Relaxed);
    }

    /// Waits until the solver rests for so many milliseconds.
    pub fn wait_for_rest(&self, milliseconds: u64) {
        while self.rests_for.load(Ordering::Relaxed) != milliseconds {
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Has the solver stop after the step under way.
    pub fn stop(&self) {
        self.over.store(true, Ordering::Relaxed);
    }

    pub fn end(mut self) -> Report {
        self.stop();
        self.thread.take().expect("a run").join().expect("no panic")
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A run with a server and the parameter `inflow`, of which a step is taken.
pub struct Run {
    pub link: Link,
    pub address: SocketAddr,
    pub solver: Running,
}

impl Run {
    pub fn new(text: &str) -> Self {
        let parameter =
            Parameter { name: "inflow".into(), value: 1.0, minimum: 0.0, maximum: 10.0 };
        let settings =
            Settings { config: config(text), parameters: vec![parameter], ..Default::default() };
        let mut solver = Solver::new(settings);
        let link = solver.adaptor.link().expect("a server").parse().expect("a link");
        let address = solver.adaptor.address().expect("a server");
        solver.step();
        Self { link, address, solver: Running::start(solver) }
    }

    /// The link of this run through a port of this machine.
    pub fn over(&self, port: u16) -> Link {
        let own = format!(":{}/", self.address.port());
        self.link.to_string().replace(&own, &format!(":{port}/")).parse().expect("a link")
    }

    pub fn end(self) -> Report {
        self.solver.end()
    }
}

pub fn connect(link: &Link) -> Result<Client, ClientError> {
    Client::connect(link, &Options::default())
}

/// Reads until an event fits.
pub fn until<T>(client: &Client, what: &str, fits: impl Fn(&Received) -> Option<T>) -> T {
    loop {
        let told = client.next(PATIENCE).unwrap_or_else(|error| panic!("{what}: {error}"));
        let told = told.unwrap_or_else(|| panic!("no {what}"));
        if let Some(found) = fits(&told) {
            return found;
        }
    }
}

/// Steers a run through its link until the order is applied.
pub fn steer(link: &Link) -> Client {
    let client = connect(link).expect("connected");
    client.drive(PATIENCE).expect("nobody else drives");
    let order = parse_valid(&squeeze(0.2).to_string(), "order").expect("an order");
    let id = client.order(&order).expect("sent");
    loop {
        let received = client.next(PATIENCE).expect("connected").expect("something is said");
        match received.event {
            Event::Order(order) if order.id == id => match order.status {
                OrderStatus::Applied => break,
                OrderStatus::Rejected => panic!("{:?}", order.reason),
                _ => {}
            },
            _ => {}
        }
    }
    assert_eq!(client.stack().expect("an answer").len(), 1);
    client
}
