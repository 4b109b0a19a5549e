//! What each request must pass: the name and the page that it comes by, and what it shows.

use std::sync::Arc;

use axum::{
    extract::{ConnectInfo, Request, State},
    http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, Uri, header},
    middleware::Next,
    response::{IntoResponse, Response},
};

use super::{
    Shared,
    connection::{Connection, Way},
    credentials::{Access, Credentials, Holder, Shown, parameter},
    refusals::{Refusals, Refused},
    relay_messages::ACCESS,
};
use tombolo_pipelines::language::{Embedders, JournalNote, PageOrigin, RefusedRequest};

const UNAUTHORIZED: &str = "the token or cookie is missing, wrong or of another run; open the link that was printed when it began\n";
const USED: &str = "this link opens one browser, once: it has been used, or is of another run. In the browser that it opened, \
go to this address without the key. For another browser take a link from the file that the run named when it began\n";

const HEADERS: [(HeaderName, &str); 3] = [
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
];

/// The content security policy of the viewer, up to the names of the pages that may show it in a frame.
/// Styles are let in: the editor of pipelines brings its own as elements, and browsers write them as
/// attributes where somebody types in it.
const POLICY: &str = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; \
    img-src 'self' data: blob:; worker-src 'self'; connect-src 'self'; object-src 'none'; \
    base-uri 'none'; form-action 'none'; frame-ancestors";

/// The policy that allows nothing at all.
const NOTHING: &str = "default-src 'none'; frame-ancestors 'none'";

/// Says which pages may show the viewer inside of them.
#[derive(Debug)]
pub(super) struct Framing {
    policy: HeaderValue,
    is_allowed: bool,
}

impl Framing {
    pub(super) fn of(embedders: &Embedders) -> Self {
        let pages: Vec<&str> = embedders.iter().map(PageOrigin::as_str).collect();
        let pages = if pages.is_empty() { "'none'".into() } else { pages.join(" ") };
        // An origin is made of letters that a header may have; were it not, nothing would be allowed.
        let policy = HeaderValue::from_str(&format!("{POLICY} {pages}"));
        let is_allowed = policy.is_ok() && !embedders.is_empty();
        let policy = policy.unwrap_or(HeaderValue::from_static(NOTHING));
        Self { policy, is_allowed }
    }
}

/// Lets in to a server: under which names, and by which secrets.
pub(super) struct Gate {
    pub(super) credentials: Arc<Credentials>,
    pub(super) refusals: Arc<Refusals>,
    /// Whether it listens on a loopback address.
    pub(super) is_loopback: bool,
    /// The host of the address that a proxy before it has, if one was named.
    pub(super) public: Option<String>,
    pub(super) is_encrypted: bool,
    pub(super) framing: Framing,
}

/// Refuses requests under a foreign name, from a foreign page or with a wrong secret, trades what a
/// link shows for a cookie, and puts the headers on every answer.
pub(super) async fn guard(
    State(shared): State<Shared>,
    ConnectInfo(connection): ConnectInfo<Connection>,
    mut request: Request,
    next: Next,
) -> Response {
    let _asked = connection.asked();
    let answer = shared.gate.admit(&connection, &mut request);
    let access = request.extensions().get::<Holder>().map(|holder| holder.access);
    let mut response = match answer {
        None => next.run(request).await,
        Some(answer) => answer,
    };
    if shared.gate.log_refusal(&connection, &response) {
        let address = connection.address().to_string();
        shared.commands.note(JournalNote::Refused(RefusedRequest { address }));
    }
    shared.gate.add_headers(&mut response);
    // The relay gives those who have shown a secret more time.
    if let (Way::Relayed { .. }, Some(access)) = (connection.way(), access) {
        response.headers_mut().insert(ACCESS, HeaderValue::from_static(access.name()));
    }
    response
}

impl Gate {
    /// Puts the headers on an answer that keep it where it belongs.
    pub(super) fn add_headers(&self, response: &mut Response) {
        let headers = response.headers_mut();
        for (name, value) in HEADERS {
            headers.insert(name, HeaderValue::from_static(value));
        }
        headers.insert(header::CONTENT_SECURITY_POLICY, self.framing.policy.clone());
        // It knows no list of pages: it is left out where there is one.
        if !self.framing.is_allowed {
            headers.insert(header::X_FRAME_OPTIONS, HeaderValue::from_static("DENY"));
        }
        // No cache keeps an answer: it may hold data of the run, or a secret.
        headers.entry(header::CACHE_CONTROL).or_insert(HeaderValue::from_static("no-store"));
    }

    /// Takes note of who asks, or has the answer for who goes no further.
    pub(super) fn admit(&self, connection: &Connection, request: &mut Request) -> Option<Response> {
        if let Some(answer) = self.foreign(connection, request) {
            return Some(answer);
        }
        let is_page = matches!(request.uri().path(), "/" | "/index.html");
        if is_page
            && request.method() == Method::GET
            && let Some(answer) = self.trade(connection, request)
        {
            return Some(answer);
        }
        match self.credentials.shown(request.headers(), request.uri()) {
            Shown::Right(holder) if connection.known(holder.access) => {
                request.extensions_mut().insert(holder);
                None
            }
            Shown::Right(_) => {
                let reason = "too many connections are open already\n";
                Some((StatusCode::SERVICE_UNAVAILABLE, reason).into_response())
            }
            Shown::Wrong => Some(unauthorized()),
            Shown::Nothing => None,
        }
    }

    /// The answer to a request under a foreign name or from a foreign page. Through a relay the name is
    /// the relay's, which has looked at it.
    pub(super) fn foreign(&self, connection: &Connection, request: &Request) -> Option<Response> {
        let is_loopback = self.is_loopback && connection.way() == Way::Direct;
        foreign(request.uri(), request.headers(), is_loopback, self.public.as_deref())
            .map(|reason| (StatusCode::FORBIDDEN, reason).into_response())
    }

    /// Logs a refusal once in a while for each address; whether it did.
    pub(super) fn log_refusal(&self, connection: &Connection, response: &Response) -> bool {
        let refused = match response.status() {
            StatusCode::UNAUTHORIZED => Refused::Secret,
            StatusCode::FORBIDDEN => Refused::Foreign,
            _ => return false,
        };
        let address = connection.address();
        let what = || format!("a request from {address} was refused");
        self.refusals.tell(address, refused, None, what)
    }

    /// Answers a link of a browser with a cookie, and with the same page without what must stay secret.
    fn trade(&self, connection: &Connection, request: &Request) -> Option<Response> {
        let (uri, headers) = (request.uri(), request.headers());
        let visitor = self.credentials.visitor(headers).map(|holder| holder.access);
        let access = match (parameter(uri, "key"), parameter(uri, "token")) {
            (Some(key), _) => match self.credentials.sessions.redeem(key).or(visitor) {
                Some(access) => access,
                None => return Some((StatusCode::UNAUTHORIZED, USED).into_response()),
            },
            (None, Some(token)) => match self.credentials.holder(token) {
                Some(holder) => holder.access,
                None => return Some(unauthorized()),
            },
            (None, None) => return None,
        };
        let mut response = StatusCode::SEE_OTHER.into_response();
        let rest = uri.query().unwrap_or_default().split('&');
        let rest: Vec<&str> =
            rest.filter(|pair| !pair.starts_with("key=") && !pair.starts_with("token=")).collect();
        // Relative, so that it holds behind a proxy's prefix too.
        let place = if rest.is_empty() { "./".into() } else { format!("./?{}", rest.join("&")) };
        if let Ok(place) = HeaderValue::from_str(&place) {
            response.headers_mut().insert(header::LOCATION, place);
        }
        // One who has the cookie already keeps it.
        if visitor != Some(access) {
            match self.cookie(connection, headers, access) {
                Some(cookie) => drop(response.headers_mut().insert(header::SET_COOKIE, cookie)),
                None => return Some(StatusCode::INTERNAL_SERVER_ERROR.into_response()),
            }
        }
        Some(response)
    }

    /// A cookie for the directory of the page, as the browser sees it: under a prefix it goes to what is
    /// below the prefix alone.
    fn cookie(
        &self,
        connection: &Connection,
        headers: &HeaderMap,
        access: Access,
    ) -> Option<HeaderValue> {
        let id = self.credentials.sessions.begin(access, connection.address()).ok()?;
        let name = self.credentials.cookie_name(headers);
        let is_encrypted = match connection.way() {
            Way::Direct => self.is_encrypted,
            Way::Relayed { is_encrypted } => is_encrypted,
        };
        let secure = if is_encrypted { "; Secure" } else { "" };
        let cookie = format!("{name}={}; HttpOnly; SameSite=Strict{secure}", id.as_str());
        HeaderValue::from_str(&cookie).ok()
    }
}

fn unauthorized() -> Response {
    (StatusCode::UNAUTHORIZED, UNAUTHORIZED).into_response()
}

/// Lets only those on who have shown a secret.
pub(super) async fn holders_only(request: Request, next: Next) -> Response {
    match request.extensions().get::<Holder>() {
        Some(_) => next.run(request).await,
        None => unauthorized(),
    }
}

/// Why a request is refused for the name or the page that it comes by. A server on a loopback address
/// answers to the names of this machine, and to the public one of its proxy.
fn foreign(
    uri: &Uri,
    headers: &HeaderMap,
    loopback: bool,
    public: Option<&str>,
) -> Option<&'static str> {
    let text = |name: HeaderName| headers.get(name).map(|value| value.to_str().unwrap_or(""));
    let host = text(header::HOST).unwrap_or("");
    if headers.get_all(header::HOST).iter().count() > 1
        || uri.authority().is_some_and(|authority| authority.as_str() != host)
    {
        return Some("this request names more than one host\n");
    }
    // Any port will do: a tunnel may end on another one.
    let name = without_port(host);
    let is_own = matches!(name, "localhost" | "127.0.0.1" | "[::1]");
    if loopback && !is_own && !public.is_some_and(|public| name.eq_ignore_ascii_case(public)) {
        return Some("this server answers to localhost, 127.0.0.1 and [::1] only\n");
    }
    match text(header::ORIGIN) {
        Some(origin) if origin.split_once("://").map(|(_, authority)| authority) != Some(host) => {
            Some("this request comes from a page of another site\n")
        }
        _ => None,
    }
}

/// The host of an address such as `host:7070` or `[::1]`.
pub(super) fn without_port(authority: &str) -> &str {
    authority
        .rsplit_once(':')
        .map_or(authority, |(name, port)| if port.ends_with(']') { authority } else { name })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(host: &'static str, origin: Option<&'static str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(header::HOST, HeaderValue::from_static(host));
        if let Some(origin) = origin {
            headers.insert(header::ORIGIN, HeaderValue::from_static(origin));
        }
        headers
    }

    #[test]
    fn foreign_pages_and_names_are_refused() {
        for (host, origin) in [
            ("127.0.0.1:7070", None),
            ("localhost:9000", Some("http://localhost:9000")),
            ("[::1]:7070", Some("http://[::1]:7070")),
            ("localhost", Some("https://localhost")),
        ] {
            assert_eq!(
                foreign(&Uri::from_static("/"), &headers(host, origin), true, None),
                None,
                "{host} {origin:?}"
            );
        }
        for (host, origin) in [
            ("rebound.example:7070", None),
            ("127.0.0.1:7070", Some("http://evil.example")),
            ("127.0.0.1:7070", Some("null")),
            ("127.0.0.1:7070", Some("http://127.0.0.1:8080")),
            ("127.0.0.1.evil.example:7070", None),
            ("", None),
        ] {
            assert!(
                foreign(&Uri::from_static("/"), &headers(host, origin), true, None).is_some(),
                "{host} {origin:?}"
            );
        }
        assert_eq!(
            foreign(&Uri::from_static("/"), &headers("cluster.example:7070", None), false, None),
            None
        );
        // A proxy before it keeps the name that the browser has used.
        for (host, is_well) in
            [("Portal.example", true), ("portal.example:8443", true), ("other.example", false)]
        {
            let headers = headers(host, None);
            let found = foreign(&Uri::from_static("/"), &headers, true, Some("portal.example"));
            assert_eq!(found.is_none(), is_well, "{host}");
        }
    }
}
