//! `tombolo status`.

use serde_json::{Value, json};

use crate::client::{Client, Drives, Event, Hello, ParameterInformation, Status};

use super::{ANSWER, Target, connect, failed};
use crate::program::{Failure, say};

pub(crate) fn status(target: &Target) -> Result<(), Failure> {
    let client = connect(target, Drives::Never)?;
    loop {
        let Some(told) = client.next(ANSWER).map_err(failed)? else {
            return Err(Failure::Wrong("the run tells nothing".into()));
        };
        match told.event {
            Event::Status(_) if target.json => {
                return say(whole(&told.text, client.hello().as_deref()));
            }
            Event::Status(status) => {
                say(line(&status, is_recording(&client)))?;
                return client.hello().map_or(Ok(()), |hello| describe(&hello));
            }
            _ => {}
        }
    }
}

/// The message of a status, with the parameters and orders of the run beside it.
fn whole(status: &str, hello: Option<&Hello>) -> Value {
    let mut whole: Value = serde_json::from_str(status).unwrap_or_default();
    if let (Some(whole), Some(Hello { parameters, orders, .. })) = (whole.as_object_mut(), hello) {
        whole.insert("parameters".into(), json!(parameters));
        whole.insert("orders".into(), json!(orders));
    }
    whole
}

/// Whether a recording is shown, and no run.
pub(super) fn is_recording(client: &Client) -> bool {
    client.hello().is_some_and(|hello| hello.recording.is_some())
}

/// How far the solver is, in one line; or how far a recording is shown, with what was told then.
pub(super) fn line(status: &Status, is_recording: bool) -> String {
    let how = match (is_recording, status.stopped, status.paused) {
        (true, ..) => "recording",
        (_, true, _) => "stopping",
        (_, _, true) => "paused",
        _ => "running",
    };
    let mut line = format!("{how}: cycle {}, time {}", status.cycle, rounded(status.time));
    if let Some(seconds) = status.step_seconds {
        line += &format!(", {seconds:.3} s a step");
    }
    if let Some(quality) = &status.quality {
        line += &format!(
            ", scaled Jacobian least {:.4}, mean {:.4}, {} inverted",
            quality.min, quality.mean, quality.inverted
        );
    }
    if is_recording {
        return line;
    }
    let driver = status.driver.as_deref().unwrap_or("nobody");
    // The one that asks is one of them.
    let others = status.viewers.saturating_sub(1);
    line + &format!(", {others} other viewer(s), {driver} drives")
}

/// A time in so many digits as are not those of adding up steps.
pub(super) fn rounded(time: f64) -> f64 {
    format!("{time:.11e}").parse().unwrap_or(time)
}

fn describe(hello: &Hello) -> Result<(), Failure> {
    for parameter in &hello.parameters {
        let ParameterInformation { name, value, minimum, maximum, unit } = parameter;
        let unit = unit.iter().map(|unit| format!(" {unit}")).collect::<String>();
        say(format_args!("parameter {name}: {value}, from {minimum} to {maximum}{unit}"))?;
    }
    for order in &hello.orders {
        say(super::order::line(order))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_status_as_json_has_parameters_and_orders_beside_it() {
        let hello = r#"{"protocol": 2, "client": "c1", "role": "watcher",
            "parameters": [{"name": "inflow", "value": 1.0, "minimum": 0.0, "maximum": 2.0}]}"#;
        let hello: Hello = serde_json::from_str(hello).expect("a hello");
        let told = whole(r#"{"status": {"cycle": 7}}"#, Some(&hello));
        assert_eq!(told["status"], json!({"cycle": 7}));
        assert_eq!(told["parameters"][0]["name"], "inflow");
        assert_eq!(told["orders"], json!([]));
    }

    #[test]
    fn a_line_counts_the_others_and_shows_no_digits_of_rounding() {
        let told = r#"{"cycle": 7, "time": 16.134000000001937, "viewers": 3, "driver": "c2"}"#;
        let status: Status = serde_json::from_str(told).expect("a status");
        assert_eq!(
            line(&status, false),
            "running: cycle 7, time 16.134, 2 other viewer(s), c2 drives"
        );
        assert_eq!(line(&status, true), "recording: cycle 7, time 16.134");
        for time in [0.0, -1.5e-9, 1e300, f64::NAN] {
            assert_eq!(rounded(time).to_bits(), time.to_bits());
        }
    }
}
