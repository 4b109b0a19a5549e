//! `tombolo status`.

use crate::client::{Event, Hello, Status};

use super::{ANSWER, Target, connect, failed};
use crate::program::{Failure, say};

pub(crate) fn status(target: &Target) -> Result<(), Failure> {
    let client = connect(target, true)?;
    loop {
        let Some(told) = client.next(ANSWER).map_err(failed)? else {
            return Err(Failure::Wrong("the run tells nothing".into()));
        };
        match told.event {
            Event::Status(_) if target.json => return say(&told.text),
            Event::Status(status) => {
                say(line(&status))?;
                return client.hello().map_or(Ok(()), |hello| describe(&hello));
            }
            _ => {}
        }
    }
}

/// How far the solver is, in one line.
pub(super) fn line(status: &Status) -> String {
    let how = match (status.stopped, status.paused) {
        (true, _) => "stopping",
        (_, true) => "paused",
        _ => "running",
    };
    let mut line = format!("{how}: cycle {}, time {}", status.cycle, status.time);
    if let Some(seconds) = status.step_seconds {
        line += &format!(", {seconds:.3} s a step");
    }
    if let Some(quality) = &status.quality {
        line += &format!(
            ", scaled Jacobian least {:.4}, mean {:.4}, {} inverted",
            quality.min, quality.mean, quality.inverted
        );
    }
    let driver = status.driver.as_deref().unwrap_or("nobody");
    line + &format!(", {} viewer(s), {driver} drives", status.viewers)
}

fn describe(hello: &Hello) -> Result<(), Failure> {
    for parameter in &hello.parameters {
        let crate::Parameter { name, value, minimum, maximum } = parameter;
        say(format_args!("parameter {name}: {value}, from {minimum} to {maximum}"))?;
    }
    for order in &hello.orders {
        say(super::order::line(order))?;
    }
    Ok(())
}
