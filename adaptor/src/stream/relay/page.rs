//! The page of a relay, which lists its runs, and the same list for programs.

use std::{fmt::Write, sync::Arc, time::SystemTime};

use axum::{
    extract::State,
    response::{Html, IntoResponse, Response},
};
use serde_json::json;

use super::RelayState;

const HEAD: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta http-equiv=\"refresh\" content=\"5\">\
<meta name=\"viewport\" content=\"width=device-width\"><title>Tombolo: runs</title>\
<style>body{font:16px/1.5 system-ui,sans-serif;max-width:44rem;margin:3rem auto;padding:0 1rem;color:#1c2733}\
table{border-collapse:collapse;width:100%}td,th{text-align:left;padding:.4rem .8rem .4rem 0;border-bottom:1px solid #d5dce3}</style>\
<body><h1>Runs</h1>";
const NONE: &str = "<p>No run is connected to this relay.</p>";
const NOTE: &str =
    "<p>A run opens with its own link, which it has printed; after that from here too.</p>";

/// The runs as a page. Their names hold nothing that means something in HTML.
pub(super) async fn page(State(relay): State<Arc<RelayState>>) -> Response {
    let runs = relay.runs.list();
    let mut page = String::from(HEAD);
    if runs.is_empty() {
        page += NONE;
    } else {
        page += "<table><tr><th>Run<th>Connected for<th>From<th>Connections";
        for (run, open) in runs {
            let (name, address, minutes) = (&run.name, run.address, seconds(run.since) / 60);
            let _ = write!(
                page,
                "<tr><td><a href=\"{name}/\">{name}</a><td>{minutes} min<td>{address}<td>{open}"
            );
        }
        page += "</table>";
    }
    page += NOTE;
    Html(page).into_response()
}

/// The runs as JSON.
pub(super) async fn list(State(relay): State<Arc<RelayState>>) -> Response {
    let runs = relay.runs.list();
    let runs: Vec<_> = runs
        .iter()
        .map(|(run, open)| {
            json!({"name": run.name, "address": run.address, "seconds": seconds(run.since),
                   "connections": open})
        })
        .collect();
    let kind = [(axum::http::header::CONTENT_TYPE, "application/json")];
    (kind, json!({ "runs": runs }).to_string()).into_response()
}

fn seconds(since: SystemTime) -> u64 {
    since.elapsed().unwrap_or_default().as_secs()
}
