//! What a monitoring system asks of a run, in Prometheus' text format.

use std::fmt::Write;

use axum::{
    Extension,
    extract::State,
    http::{HeaderName, header},
    response::{IntoResponse, Response},
};
use serde_json::Value;

use super::{Shared, credentials::Holder, hub::Hub};
use crate::{lock::lock, step::Moment};

const TEXT: [(HeaderName, &str); 1] =
    [(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")];

/// Answers `GET /metrics`.
pub(super) async fn metrics(
    State(shared): State<Shared>,
    Extension(_): Extension<Holder>,
) -> Response {
    let mut text = Metrics::default();
    shared.hub.measure(&mut text);
    for (status, count) in shared.commands.order_counts() {
        text.sample("tombolo_orders", &[("status", status)], count as f64);
    }
    (TEXT, text.0).into_response()
}

/// The lines of an answer.
#[derive(Default)]
struct Metrics(String);

impl Metrics {
    /// Says what the samples that follow are; a `counter` only rises.
    fn describe(&mut self, name: &str, kind: &str, help: &str) {
        let _ = writeln!(self.0, "# HELP {name} {help}\n# TYPE {name} {kind}");
    }

    fn sample(&mut self, name: &str, labels: &[(&str, &str)], value: f64) {
        let escaped =
            |text: &str| text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n");
        let labels: Vec<String> =
            labels.iter().map(|(key, text)| format!("{key}=\"{}\"", escaped(text))).collect();
        let labels =
            if labels.is_empty() { String::new() } else { format!("{{{}}}", labels.join(",")) };
        let _ = writeln!(self.0, "{name}{labels} {value}");
    }

    fn one(&mut self, name: &str, kind: &str, help: &str, value: f64) {
        self.describe(name, kind, help);
        self.sample(name, &[], value);
    }
}

impl Hub {
    #[expect(clippy::cast_precision_loss, reason = "counts below 2^53")]
    fn measure(&self, metrics: &mut Metrics) {
        let Moment { cycle, time } = self.clock.get();
        metrics.one("tombolo_cycle", "counter", "The step of the last call.", cycle as f64);
        metrics.one("tombolo_time", "gauge", "The simulated time then.", time);
        let counts = self.counts();
        for (name, help, value) in [
            ("tombolo_frames_total", "Frames that viewers were sent.", counts.frames),
            (
                "tombolo_frames_dropped_total",
                "Frames that made way for newer ones.",
                counts.dropped,
            ),
            ("tombolo_frame_bytes_total", "Bytes of the frames sent.", counts.bytes),
            ("tombolo_arrivals_total", "Viewers that have come.", self.arrivals()),
        ] {
            metrics.one(name, "counter", help, value as f64);
        }
        // The solver's thread takes this lock: what is behind it is copied, and written after it.
        let state = lock(&self.state);
        let flag = |is_so: bool| f64::from(u8::from(is_so));
        let condition =
            |name: &str| flag(state.conditions.get(name).and_then(Value::as_bool) == Some(true));
        let gauges = [
            ("tombolo_viewers", "Viewers now.", state.clients.len() as f64),
            ("tombolo_driver", "1 while somebody drives.", flag(state.wheel.driver().is_some())),
            ("tombolo_paused", "1 while the solver waits.", condition("paused")),
            ("tombolo_stopped", "1 once it is to end.", condition("stopped")),
            (
                "tombolo_journal_lost",
                "1 while the journal cannot be written.",
                flag(state.journal_lost.is_some()),
            ),
        ];
        let quality = state.conditions.get("quality").and_then(|quality| quality["min"].as_f64());
        let costs = state.costs.clone();
        drop(state);
        for (name, help, value) in gauges {
            metrics.one(name, "gauge", help, value);
        }
        if let Some(least) = quality {
            let help = "The least scaled Jacobian of the mesh.";
            metrics.one("tombolo_quality_min", "gauge", help, least);
        }
        for (name, help) in [
            ("tombolo_pipeline_runs_total", "Runs of a pipeline."),
            ("tombolo_pipeline_seconds_total", "Seconds inside the stages of a pipeline."),
        ] {
            metrics.describe(name, "counter", help);
            for (pipeline, cost) in &costs {
                let is_runs = name.contains("runs");
                let value = if is_runs { cost.runs as f64 } else { cost.seconds };
                metrics.sample(name, &[("pipeline", pipeline)], value);
            }
        }
        metrics.describe("tombolo_orders", "gauge", "Orders by what became of them.");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_sample_is_a_line_and_labels_are_escaped() {
        let mut metrics = Metrics::default();
        metrics.one("a_total", "counter", "As.", 3.0);
        metrics.sample("b", &[("name", "x\"y\\z\n")], 0.5);
        let expected = "# HELP a_total As.\n# TYPE a_total counter\na_total 3\nb{name=\"x\\\"y\\\\z\\n\"} 0.5\n";
        assert_eq!(metrics.0, expected);
    }
}
