use std::sync::mpsc::channel;

use tombolo_deform::{features::FeatureSettings, shapes::box_of_tets};
use tombolo_pipelines::language::Command;

use super::*;
use crate::{
    journal::Journal,
    steering::{Events, OrderReport, OrderStatus, Received, Source},
    step::Moment,
};

/// An order that is cancelled while it is planned does not end the planning of the next one, which
/// the solver's thread begins before the planning thread has come back.
#[test]
fn an_order_is_planned_in_the_moment_in_which_another_is_cancelled() {
    let mesh = box_of_tets([8, 8, 8], [0.0; 3], [1.0; 3]);
    let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).unwrap());
    let shaper = Shaper::new(&mesh, surface).unwrap();
    let log = Arc::new(Log::new(Journal::none(), None, Events::default()));
    let queue = Arc::<Queue>::default();
    let mut steerer =
        Steerer::new(shaper, Defaults::default(), Arc::clone(&log), Arc::clone(&queue), false)
            .unwrap();
    let moment = Moment::default();
    let give = |steerer: &mut Steerer, id: &str, by: f64, steps: u32, background: bool| {
        let order: Order = serde_json::from_value(serde_json::json!({
            "edits": [{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, by]}}],
            "schedule": {"steps": steps}
        }))
        .unwrap();
        let command = Command::Order(order.clone());
        log.accept(Some(id.into()), &Source::Program, &command, moment).unwrap();
        steerer.take(id.into(), order, background, None, None);
        steerer.advance(moment, None);
    };
    give(&mut steerer, "long", -0.2, 10_000, true);
    // The planning thread tells the queue of a plan before it takes up anything else.
    let (begins, begun) = channel();
    let (ends, ended) = channel::<()>();
    let holding = std::thread::spawn(move || {
        let (source, command) = (Source::Program, Command::Resume {});
        let received = Received { source, id: "held".into(), command, reservation: None };
        queue.push_and_tell(received, || {
            begins.send(()).unwrap();
            let _ = ended.recv_timeout(Duration::from_secs(60));
        });
    });
    begun.recv().unwrap();
    std::thread::sleep(Duration::from_millis(50));
    assert_eq!(steerer.withdraw("long"), Some(Ok(0)));
    give(&mut steerer, "now", -0.01, 1, false);
    drop(ends);
    holding.join().unwrap();
    let refused = |report: &OrderReport| report.status == OrderStatus::Rejected;
    assert_eq!(log.reports().into_iter().find(refused), None);
}

/// A run that is stopped gives up the shapes that are being found. The order stays as it is, for the
/// checkpoint that may follow.
#[test]
fn an_order_whose_shapes_are_given_up_by_the_end_is_not_refused() {
    let mesh = box_of_tets([8, 8, 8], [0.0; 3], [1.0; 3]);
    let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).unwrap());
    for background in [true, false] {
        let shaper = Shaper::new(&mesh, Arc::clone(&surface)).unwrap();
        let log = Arc::new(Log::new(Journal::none(), None, Events::default()));
        let mut steerer =
            Steerer::new(shaper, Defaults::default(), Arc::clone(&log), Arc::default(), false)
                .unwrap();
        let moment = Moment::default();
        let jobs = Arc::clone(steerer.worker.as_ref().unwrap().jobs());
        let stops = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(20));
            jobs.give_up();
        });
        for id in ["long", "behind"] {
            let order: Order = serde_json::from_value(serde_json::json!({
                "edits": [{"translate": {"features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -0.2]}}],
                "schedule": {"steps": 10_000}
            }))
            .unwrap();
            log.accept(Some(id.into()), &Source::Program, &Command::Order(order.clone()), moment)
                .unwrap();
            steerer.take(id.into(), order, background, None, None);
            steerer.advance(moment, None);
        }
        stops.join().unwrap();
        let until = std::time::Instant::now() + Duration::from_secs(60);
        while !steerer.ends && std::time::Instant::now() < until {
            steerer.advance(moment, None);
            std::thread::sleep(Duration::from_millis(5));
        }
        // Neither waits for what does not come.
        steerer.advance(moment, None);
        let reports = log.reports();
        let statuses: Vec<_> = reports.iter().map(|report| (&*report.id, report.status)).collect();
        assert_eq!(
            statuses,
            [("long", OrderStatus::Computing), ("behind", OrderStatus::Accepted)],
            "background: {background}"
        );
        steerer.end(moment, false);
        let refused = log.reports().into_iter().map(|report| report.status);
        assert_eq!(refused.collect::<Vec<_>>(), [OrderStatus::Rejected; 2]);
    }
}

/// The operator of a large mesh takes seconds to set up, and the first step asks for these.
#[test]
fn what_stays_the_same_is_told_while_the_planner_is_at_work() {
    let mesh = box_of_tets([2, 2, 2], [0.0; 3], [1.0; 3]);
    let surface = Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).unwrap());
    let shaper = Shaper::new(&mesh, Arc::clone(&surface)).unwrap();
    let log = Arc::new(Log::new(Journal::none(), None, Events::default()));
    let steerer = Steerer::new(shaper, Defaults::default(), log, Arc::default(), false).unwrap();
    let planner = Arc::clone(&steerer.planner);
    let (begins, begun) = channel();
    let (ends, ended) = channel::<()>();
    let at_work = std::thread::spawn(move || {
        let _planner = lock(&planner);
        begins.send(()).unwrap();
        let _ = ended.recv_timeout(Duration::from_secs(10));
    });
    begun.recv().unwrap();
    assert!(steerer.surface().is_some_and(|told| Arc::ptr_eq(&told, &surface)));
    assert_eq!(steerer.mesh(), mesh);
    assert!(steerer.planner.try_lock().is_err(), "it was waited for");
    drop(ends);
    at_work.join().unwrap();
}
