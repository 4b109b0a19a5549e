use std::sync::LazyLock;

use tombolo_deform::{
    mesh::Vector,
    shape::{Request, ShapeSeconds},
};

use super::*;

type Told = Receiver<(&'static str, Option<&'static str>)>;
type Tell = Sender<(&'static str, Option<&'static str>)>;

fn jobs() -> (Jobs, Tell, Told) {
    let cancellation = Cancellation::default();
    let jobs = Jobs { state: Mutex::default(), changed: Condvar::new(), cancellation };
    let (tell, told) = channel();
    (jobs, tell, told)
}

/// One shape, always the same.
fn request() -> PlanRequest {
    static START: LazyLock<Arc<[Vector]>> = LazyLock::new(|| Arc::from([[0.0; 3]]));
    PlanRequest { request: Request::new([], Arc::clone(&START)), own: None }
}

/// Another shape than that of [`request`].
fn other() -> PlanRequest {
    let request = Request::new([], Arc::<[Vector]>::from([[1.0; 3]]));
    PlanRequest { request, own: None }
}

/// Asks for a forecast; what is told of it is its name, and why it is not answered.
fn ask(jobs: &Jobs, tell: &Tell, asker: u64, name: &'static str) {
    let tell = tell.clone();
    let answer = move |answer: Result<Forecast, &'static str>| {
        tell.send((name, answer.err())).unwrap();
    };
    jobs.forecast(asker, request(), Box::new(answer));
}

/// Takes the next job, which is a forecast.
fn begin(jobs: &Jobs) -> Question {
    match jobs.next() {
        Some(Job::Forecast(question)) => {
            assert!(jobs.begin_forecast());
            question
        }
        _ => panic!("no forecast is next"),
    }
}

fn end(jobs: &Jobs, question: Question) {
    let found = Forecast::rejected("found".into(), None, None, ShapeSeconds::default());
    jobs.answer(question, jobs.end_forecast().map_or(Ok(found), Err));
}

#[test]
fn no_forecast_is_left_without_an_answer() {
    let (jobs, tell, told) = jobs();
    ask(&jobs, &tell, 1, "first");
    ask(&jobs, &tell, 2, "of another");
    ask(&jobs, &tell, 1, "second");
    assert_eq!(told.try_iter().collect::<Vec<_>>(), [("first", Some(OVERTAKEN))]);
    jobs.close();
    let mut left: Vec<_> = told.try_iter().collect();
    left.sort_unstable();
    assert_eq!(left, [("of another", Some(GONE)), ("second", Some(GONE))]);
    ask(&jobs, &tell, 1, "too late");
    assert_eq!(told.try_iter().collect::<Vec<_>>(), [("too late", Some(GONE))]);
}

#[test]
fn a_forecast_makes_way_for_an_order_and_is_found_after_it() {
    let (jobs, tell, told) = jobs();
    ask(&jobs, &tell, 1, "forecast");
    let question = begin(&jobs);
    // One for the same shape takes what is found.
    jobs.plan(1, request());
    assert!(!jobs.cancellation.is_cancelled());
    jobs.plan(2, other());
    assert!(jobs.cancellation.is_cancelled());
    end(&jobs, question);
    assert!(matches!(jobs.next(), Some(Job::Plan(1, _))));
    assert!(matches!(jobs.next(), Some(Job::Plan(2, _))));
    assert!(!jobs.cancellation.is_cancelled());
    end(&jobs, begin(&jobs));
    assert_eq!(told.try_iter().collect::<Vec<_>>(), [("forecast", None)]);
}

/// The solver's thread does not wait for a forecast either, and none takes the kernel before it.
#[test]
fn a_forecast_makes_way_for_a_plan_of_another_thread() {
    let (jobs, tell, told) = jobs();
    ask(&jobs, &tell, 1, "under way");
    let question = begin(&jobs);
    let elsewhere = jobs.begin_elsewhere(&other());
    assert!(jobs.cancellation.is_cancelled());
    end(&jobs, question);
    // It waits again; what is next meanwhile is something else.
    jobs.change(|state| state.ahead = Some(request()));
    assert!(matches!(jobs.next(), Some(Job::Ahead(_))));
    jobs.renew();
    assert!(!jobs.cancellation.is_cancelled());
    drop(elsewhere);
    end(&jobs, begin(&jobs));
    assert_eq!(told.try_iter().collect::<Vec<_>>(), [("under way", None)]);
}

#[test]
fn a_forecast_is_given_up_once_nobody_waits_for_it() {
    let (jobs, tell, told) = jobs();
    ask(&jobs, &tell, 1, "of one who goes");
    let question = begin(&jobs);
    jobs.withdraw(2);
    assert!(!jobs.cancellation.is_cancelled());
    jobs.withdraw(1);
    assert!(jobs.cancellation.is_cancelled());
    // Neither an order that comes then brings it back, nor one who comes again.
    jobs.plan(1, request());
    lock(&jobs.state).at_forecast.as_mut().unwrap().begun = Instant::now().checked_sub(LONG);
    ask(&jobs, &tell, 1, "of one who comes again");
    end(&jobs, question);
    assert!(matches!(jobs.next(), Some(Job::Plan(1, _))));
    jobs.withdraw(1);
    let withdrawn = ["of one who goes", "of one who comes again"];
    let withdrawn = withdrawn.map(|asked| (asked, Some(WITHDRAWN)));
    assert_eq!(told.try_iter().collect::<Vec<_>>(), withdrawn);
    // While another thread makes a plan, the forecast has not begun: that plan is not given up for it.
    ask(&jobs, &tell, 1, "of one who goes too");
    let Some(Job::Forecast(_)) = jobs.next() else { panic!("no forecast is next") };
    jobs.withdraw(1);
    assert!(!jobs.cancellation.is_cancelled() && !jobs.begin_forecast());
    jobs.end_forecast();
    // One that takes its time, and one that does not.
    for (ago, is_given_up) in [(LONG, true), (Duration::ZERO, false)] {
        ask(&jobs, &tell, 1, "before");
        let question = begin(&jobs);
        let earlier = Instant::now().checked_sub(ago).unwrap();
        lock(&jobs.state).at_forecast.as_mut().unwrap().begun = Some(earlier);
        ask(&jobs, &tell, 1, "after");
        assert_eq!(jobs.cancellation.is_cancelled(), is_given_up);
        end(&jobs, question);
        end(&jobs, begin(&jobs));
        let why = is_given_up.then_some(OVERTAKEN);
        assert_eq!(told.try_iter().collect::<Vec<_>>(), [("before", why), ("after", None)]);
    }
}
