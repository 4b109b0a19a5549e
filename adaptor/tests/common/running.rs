//! A run that goes on by itself, and a client that steers it.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::JoinHandle,
    time::Duration,
};

use tombolo::{
    OrderStatus,
    client::{Client, ClientError, Event, Link, Options},
    pipelines::language::parse_valid,
};

use super::{PATIENCE, Solver, squeeze};

/// A solver that steps on a thread of its own until this is dropped.
pub struct Running {
    over: Arc<AtomicBool>,
    cycle: Arc<AtomicU64>,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    pub fn start(mut solver: Solver) -> Self {
        let (over, cycle) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let (is_over, at) = (Arc::clone(&over), Arc::clone(&cycle));
        let run = move || {
            while !is_over.load(Ordering::Relaxed) {
                solver.step();
                at.store(solver.cycle, Ordering::Relaxed);
                std::thread::sleep(Duration::from_millis(2));
            }
            solver.finish();
        };
        Self { over, cycle, thread: Some(std::thread::spawn(run)) }
    }

    pub fn cycle(&self) -> u64 {
        self.cycle.load(Ordering::Relaxed)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

pub fn connect(link: &Link) -> Result<Client, ClientError> {
    Client::connect(link, &Options::default())
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
