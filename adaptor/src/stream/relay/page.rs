//! The page of a relay, which lists its runs, and the same list for programs.

use std::{fmt::Write, sync::Arc, time::SystemTime};

use axum::{
    extract::State,
    http::header::CONTENT_TYPE,
    response::{Html, IntoResponse, Response},
};
use serde_json::json;

use super::RelayState;

const HEAD: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">\
<meta name=\"viewport\" content=\"width=device-width\"><title>Tombolo: runs</title>\
<style>:root{color-scheme:light dark}body{font:16px/1.5 system-ui,sans-serif;max-width:44rem;margin:3rem auto;padding:0 1rem}\
table{border-collapse:collapse;width:100%}td,th{text-align:left;padding:.4rem .8rem .4rem 0;border-bottom:1px solid #8886}</style>\
<script src=\"-/page.js\" defer></script><body><main><h1>Runs</h1><div id=\"runs\">";
const NONE: &str = "<p>No run is connected to this relay.</p>";
const NOTE: &str = "</div><p>A run opens with its own link, which it has printed; after that from here too.</p></main>";

/// Keeps the list new, and leaves the focus where it is as long as the list is the same.
const SCRIPT: &str = r#"const list = document.getElementById("runs");
async function renew() {
  try {
    const answer = await fetch(".", { cache: "no-store", signal: AbortSignal.timeout(10000) });
    const page = new DOMParser().parseFromString(answer.ok ? await answer.text() : "", "text/html");
    const runs = page.getElementById("runs");
    if (runs && runs.innerHTML !== list.innerHTML) list.innerHTML = runs.innerHTML;
  } catch {
    // The relay is away for a moment.
  }
  setTimeout(renew, 5000);
}
setTimeout(renew, 5000);
"#;

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

/// The script of the page.
pub(super) async fn script() -> Response {
    ([(CONTENT_TYPE, "text/javascript")], SCRIPT).into_response()
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
    ([(CONTENT_TYPE, "application/json")], json!({ "runs": runs }).to_string()).into_response()
}

fn seconds(since: SystemTime) -> u64 {
    since.elapsed().unwrap_or_default().as_secs()
}
