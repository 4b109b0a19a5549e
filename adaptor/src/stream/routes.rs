//! The routes of a run's server, and the answer to each request that passed the gate.

use std::sync::Arc;

use axum::{
    Extension, Router,
    extract::{
        ConnectInfo, Query, Request, State, WebSocketUpgrade,
        rejection::QueryRejection,
        ws::{CloseFrame, Message as Wire, rejection::WebSocketUpgradeRejection},
    },
    http::{HeaderName, Method, StatusCode, Uri, header},
    middleware,
    response::{IntoResponse, Response},
    routing::get,
};
use serde::Deserialize;
use tombolo_pipelines::{
    language::{order_schema, pipeline_schema},
    limits::DOCUMENT,
};

use super::{
    Shared,
    connection::Connection,
    credentials::{Access, Holder, parameter},
    gate,
    hub::Arrival,
    metrics, session,
};

/// The largest message that is read at all, in bytes: so much more than a document may have that
/// one too long is answered with an error.
const MESSAGE_SIZE: usize = DOCUMENT.most + (1 << 16);
/// The same for a client that can never command: nothing that it may say is near as long.
const WATCHED_SIZE: usize = 1 << 16;
/// Bytes of a viewer that are read at once. They are cleared before each read, on a core that may be the
/// solver's, and most messages are a few bytes.
const READ_BUFFER: usize = 1 << 12;

/// All routes, behind the gate.
pub(super) fn router(shared: Shared) -> Router {
    Router::new()
        .route("/ws", get(upgrade))
        .route("/surface", get(reference_surface))
        .route("/stack", get(stack_of_edits))
        .route("/pipelines", get(pipelines))
        .route("/schema", get(schema))
        .route("/schema/order", get(schema_of_order))
        .route("/metrics", get(metrics::metrics))
        .route_layer(middleware::from_fn(gate::holders_only))
        .fallback(file)
        .layer(middleware::from_fn_with_state(shared.clone(), gate::guard))
        .with_state(shared)
}

async fn upgrade(
    State(shared): State<Shared>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    Extension(holder): Extension<Holder>,
    uri: Uri,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Response {
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade,
        Err(rejection) => return rejection.into_response(),
    };
    let role = parameter(&uri, "role");
    let access = if role == Some("watch") { Access::Watch } else { holder.access };
    let takes_wheel = role != Some("idle");
    let most = match access {
        Access::Drive if shared.playback.is_none() => MESSAGE_SIZE,
        _ => WATCHED_SIZE,
    };
    let upgrade = upgrade.max_message_size(most).max_frame_size(most);
    upgrade.read_buffer_size(READ_BUFFER).on_upgrade(move |mut socket| async move {
        connection.upgraded();
        if let Some(shown) = &shared.playback {
            let shown = Arc::clone(shown);
            return shown.serve(socket, shared.limits.viewers.get() as usize).await;
        }
        let returning = parameter(&uri, "client").zip(parameter(&uri, "back"));
        let limit = shared.limits.viewers.get() as usize;
        let looks = parameter(&uri, "views") != Some("none");
        let refusal = match shared.hub.join(limit, access, takes_wheel, looks, returning) {
            Ok(Arrival::Client(client)) => {
                let address = connection.address();
                return session::serve(socket, client, holder, address, shared).await;
            }
            Ok(Arrival::Full) => format!("{limit} viewers watch already"),
            Err(error) => format!("no secret could be made: {error}"),
        };
        let _ =
            socket.send(Wire::Close(Some(CloseFrame { code: 1013, reason: refusal.into() }))).await;
    })
}

/// The reference surface as a frame, 404 as long as there is none.
async fn reference_surface(State(shared): State<Shared>) -> Response {
    let Some(surface) = shared.hub.surface() else {
        return (StatusCode::NOT_FOUND, "this run has no mesh whose shape could be changed\n")
            .into_response();
    };
    // Elsewhere: the others are served while it is encoded.
    let failed = |reason: String| (StatusCode::INTERNAL_SERVER_ERROR, reason).into_response();
    match tokio::task::spawn_blocking(move || surface.frame()).await {
        Ok(Ok(frame)) => {
            ([(header::CONTENT_TYPE, "application/octet-stream")], frame).into_response()
        }
        Ok(Err(reason)) => failed(format!("the surface was not encoded: {reason}\n")),
        Err(_) => failed("the encoder failed\n".into()),
    }
}

/// The part of an address that says from which edit on; and of a recording, which stack.
#[derive(Deserialize)]
struct Wanted {
    #[serde(default)]
    from: usize,
    revision: Option<u64>,
}

/// The edits that make the shape, from one on: as many as go into one answer.
async fn stack_of_edits(
    State(shared): State<Shared>,
    wanted: Result<Query<Wanted>, QueryRejection>,
) -> Response {
    let Ok(Query(Wanted { from, revision })) = wanted else {
        let expected = "from, revision: expected whole numbers, 0 or more\n";
        return (StatusCode::BAD_REQUEST, expected).into_response();
    };
    // Elsewhere: the others are served while it is written out.
    let written = move || {
        let answer = match &shared.playback {
            Some(shown) => shown.stack(revision, from)?,
            None => shared.hub.stack_of_edits().answer(from),
        };
        Some(serde_json::to_vec(&answer))
    };
    match tokio::task::spawn_blocking(written).await {
        Ok(Some(Ok(answer))) => (JSON, answer).into_response(),
        Ok(None) => (StatusCode::NOT_FOUND, "there is no such stack of edits\n").into_response(),
        _ => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

const JSON: [(HeaderName, &str); 1] = [(header::CONTENT_TYPE, "application/json")];

/// The pipelines as they are now, as JSON.
async fn pipelines(State(shared): State<Shared>) -> Response {
    (JSON, shared.hub.pipelines()).into_response()
}

/// The JSON Schema of a pipeline.
async fn schema() -> Response {
    (JSON, pipeline_schema().to_string()).into_response()
}

/// The JSON Schema of an order.
async fn schema_of_order() -> Response {
    (JSON, order_schema().to_string()).into_response()
}

async fn file(State(shared): State<Shared>, uri: Uri, request: Request) -> Response {
    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return StatusCode::METHOD_NOT_ALLOWED.into_response();
    }
    match shared.files.answer(uri.path(), request.headers()) {
        Some(answer) => answer,
        None => (StatusCode::NOT_FOUND, "no such file\n").into_response(),
    }
}
