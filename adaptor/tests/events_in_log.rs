//! What a run tells of itself, in the logger of a host that has one of the crate `log` and no
//! subscriber of `tracing`.

mod common;

use std::sync::Mutex;

use common::{Solver, squeeze};
use log::{Level, LevelFilter, Log, Metadata, Record};
use serde_json::json;
use tombolo::{
    Settings,
    logging::{self, LoggingError},
    pipelines::language::parse_orders,
};

struct Keeping;

static KEPT: Mutex<Vec<(Level, String)>> = Mutex::new(Vec::new());

impl Log for Keeping {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target().starts_with("tombolo")
    }

    fn log(&self, record: &Record<'_>) {
        if self.enabled(record.metadata()) {
            KEPT.lock().expect("no panic").push((record.level(), record.args().to_string()));
        }
    }

    fn flush(&self) {}
}

#[test]
fn a_logger_of_the_crate_log_has_the_events() {
    log::set_logger(&Keeping).expect("no other logger");
    log::set_max_level(LevelFilter::Info);
    // It has them already, and goes on to have them.
    logging::start();
    let taken = logging::send_to(logging::LevelFilter::WARN, None);
    assert!(matches!(taken, Err(LoggingError::OtherLogger)));
    let orders = json!([{"id": "a", "at": {"cycle": 2}, "order": squeeze(0.2)}]);
    let orders = parse_orders(&orders.to_string(), "orders.json").expect("orders");
    let mut solver = Solver::new(Settings { orders, ..Settings::default() });
    let run = solver.adaptor.run_id().to_owned();
    solver.steps(5);
    solver.finish();
    let kept = KEPT.lock().expect("no panic");
    let (level, first) = kept.first().expect("something is told");
    assert_eq!(*level, Level::Info);
    assert!(first.starts_with("order 'a': accepted"), "{first}");
    for field in [format!("run=\"{run}\""), "cycle=2".into(), "order=\"a\"".into()] {
        assert!(first.contains(&field), "{field}: {first}");
    }
    assert!(kept.iter().any(|(_, text)| text.starts_with("order 'a': applied")), "{kept:?}");
    assert!(!kept.iter().any(|(_, text)| text.contains("computing")), "{kept:?}");
}
