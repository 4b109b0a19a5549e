//! Requests of viewers, which a relay passes on to the run that the first part of their path names.
//!
//! The run sees them as they came, under its own paths, and answers them itself: its secrets, its
//! cookies and the WebSocket go through unread. Each request has a connection of its own to the run, so
//! that one who reads slowly holds up nobody else.

use std::{sync::Arc, time::Duration};

use axum::{
    body::Body,
    extract::{ConnectInfo, Request, State},
    http::{
        HeaderMap, HeaderName, HeaderValue, Method, StatusCode, Uri, Version, header,
        uri::PathAndQuery,
    },
    response::{IntoResponse, Response},
};
use hyper::{client::conn::http1, upgrade::OnUpgrade};
use hyper_util::rt::TokioIo;
use tokio::time::timeout;

use super::{
    RelayState,
    runs::{Carried, Room, Unreached},
};
use crate::stream::{connection::Connection, credentials::Access, relay_messages::ACCESS};

/// How long a run may take to answer. The first request for a surface has it encoded.
const ANSWER: Duration = Duration::from_secs(120);
/// Said of a run that is not connected, and of one that does not answer: programs know a relay by them.
pub(crate) const NOT_CONNECTED: &str = "no run of this name is connected to this relay\n";
pub(crate) const SILENT_RUN: &str = "the run does not answer the relay\n";
/// Headers that belong to one connection, and not to what goes through it.
const OF_CONNECTION: [HeaderName; 8] = [
    header::CONNECTION,
    header::PROXY_AUTHENTICATE,
    header::PROXY_AUTHORIZATION,
    header::TE,
    header::TRAILER,
    header::TRANSFER_ENCODING,
    header::UPGRADE,
    HeaderName::from_static("keep-alive"),
];

/// Passes a request on, and its answer back.
pub(super) async fn forward(
    State(relay): State<Arc<RelayState>>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    request: Request,
) -> Response {
    let said = |status: StatusCode, text: &'static str| (status, text).into_response();
    // A run takes nothing else, so that no body goes to it.
    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return said(StatusCode::METHOD_NOT_ALLOWED, "");
    }
    let (name, rest) = named(request.uri());
    let Some(run) = relay.runs.find(name) else {
        return said(StatusCode::NOT_FOUND, NOT_CONNECTED);
    };
    let Some(rest) = rest else {
        let query = request.uri().query().map_or_else(String::new, |query| format!("?{query}"));
        // Relative, so that it holds behind a proxy's prefix too.
        let place = [(header::LOCATION, format!("{}/{query}", run.name))];
        return (StatusCode::PERMANENT_REDIRECT, place).into_response();
    };
    let Ok(rest) = rest.parse::<PathAndQuery>() else {
        return said(StatusCode::BAD_REQUEST, "this path cannot be read\n");
    };
    let (carried, room) = match relay.runs.dial(&run, connection.address()).await {
        Ok(connected) => connected,
        Err(Unreached::TooMany) => {
            return said(
                StatusCode::SERVICE_UNAVAILABLE,
                "too many connections are open already\n",
            );
        }
        Err(Unreached::NoAnswer) => {
            return said(StatusCode::BAD_GATEWAY, SILENT_RUN);
        }
    };
    let request = passed_on(request, rest, &relay);
    match timeout(ANSWER, exchange(carried, request, room, &connection)).await {
        Ok(Ok(response)) => response,
        Ok(Err(_)) => said(StatusCode::BAD_GATEWAY, "the run has ended this connection\n"),
        Err(_) => said(StatusCode::GATEWAY_TIMEOUT, "the run does not answer\n"),
    }
}

/// The name of the run in a path, and the path behind it with the query; no path where the slash
/// behind the name is missing.
fn named(uri: &Uri) -> (&str, Option<&str>) {
    let whole = uri.path_and_query().map_or("/", PathAndQuery::as_str);
    let whole = whole.strip_prefix('/').unwrap_or(whole);
    match whole.find(['/', '?']) {
        Some(end) if whole[end..].starts_with('/') => (&whole[..end], Some(&whole[end..])),
        Some(end) => (&whole[..end], None),
        None => (whole, None),
    }
}

/// The request as the run is to see it.
fn passed_on(request: Request, rest: PathAndQuery, relay: &RelayState) -> Request {
    let (mut parts, _) = request.into_parts();
    parts.uri = rest.into();
    parts.version = Version::HTTP_11;
    let is_upgrade = is_websocket(&parts.headers);
    without_those_of_connection(&mut parts.headers);
    parts.headers.remove(header::CONTENT_LENGTH);
    parts.headers.remove(header::EXPECT);
    if is_upgrade {
        switch_to_websocket(&mut parts.headers);
    }
    let cookies = relay.credentials.without_own_cookie(&parts.headers);
    parts.headers.remove(header::COOKIE);
    if let Some(cookies) = cookies.and_then(|text| HeaderValue::from_str(&text).ok()) {
        parts.headers.insert(header::COOKIE, cookies);
    }
    Request::from_parts(parts, Body::empty())
}

fn is_websocket(headers: &HeaderMap) -> bool {
    let upgrade = headers.get(header::UPGRADE).and_then(|value| value.to_str().ok());
    upgrade.is_some_and(|value| value.eq_ignore_ascii_case("websocket"))
}

fn switch_to_websocket(headers: &mut HeaderMap) {
    headers.insert(header::CONNECTION, HeaderValue::from_static("upgrade"));
    headers.insert(header::UPGRADE, HeaderValue::from_static("websocket"));
}

fn without_those_of_connection(headers: &mut HeaderMap) {
    // The headers that `Connection` names belong to it too.
    let named: Vec<HeaderName> = headers
        .get_all(header::CONNECTION)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|list| list.split(','))
        .filter_map(|name| name.trim().parse().ok())
        .collect();
    for name in named.iter().chain(&OF_CONNECTION) {
        headers.remove(name);
    }
}

/// Sends a request to a run; its room is taken until all of the answer has gone through.
async fn exchange(
    Carried { stream, asked }: Carried,
    mut request: Request,
    room: Room,
    viewer: &Connection,
) -> hyper::Result<Response> {
    let room = Arc::new(room);
    let of_viewer = request.extensions_mut().remove::<OnUpgrade>();
    let (mut sender, connection) = http1::handshake(stream).await?;
    let taken = Arc::clone(&room);
    tokio::spawn(async move {
        let _taken = taken;
        let _ = connection.with_upgrades().await;
    });
    let mut response = sender.send_request(request).await?;
    drop(asked);
    if let Some(access) = response.headers_mut().remove(ACCESS) {
        let is_driver = access.as_bytes() == Access::Drive.name().as_bytes();
        viewer.known(if is_driver { Access::Drive } else { Access::Watch });
    }
    let is_switched = response.status() == StatusCode::SWITCHING_PROTOCOLS;
    without_those_of_connection(response.headers_mut());
    if is_switched && let Some(of_viewer) = of_viewer {
        let of_run = hyper::upgrade::on(&mut response);
        switch_to_websocket(response.headers_mut());
        let viewer = viewer.clone();
        tokio::spawn(async move {
            let _room = room;
            if let (Ok(of_viewer), Ok(of_run)) = (of_viewer.await, of_run.await) {
                viewer.upgraded();
                let (mut one, mut other) = (TokioIo::new(of_viewer), TokioIo::new(of_run));
                let _ = tokio::io::copy_bidirectional(&mut one, &mut other).await;
            }
        });
    }
    Ok(response.map(Body::new))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_part_of_a_path_names_the_run() {
        for (uri, expected) in [
            ("/nozzle/", ("nozzle", Some("/"))),
            ("/nozzle/ws?token=a/b", ("nozzle", Some("/ws?token=a/b"))),
            ("/nozzle//x", ("nozzle", Some("//x"))),
            ("/nozzle", ("nozzle", None)),
            ("/nozzle?key=1/2", ("nozzle", None)),
            ("/", ("", None)),
        ] {
            assert_eq!(named(&uri.parse().expect("a path")), expected, "{uri}");
        }
    }

    #[test]
    fn what_belongs_to_a_connection_stays_there() {
        let mut headers = HeaderMap::new();
        for (name, value) in [
            ("connection", "keep-alive, X-Hop, Upgrade"),
            ("x-hop", "1"),
            ("upgrade", "websocket"),
            ("transfer-encoding", "chunked"),
            ("host", "relay.example"),
            ("origin", "https://relay.example"),
        ] {
            headers.insert(name, HeaderValue::from_static(value));
        }
        without_those_of_connection(&mut headers);
        let mut left: Vec<&str> = headers.keys().map(HeaderName::as_str).collect();
        left.sort_unstable();
        assert_eq!(left, ["host", "origin"]);
    }
}
