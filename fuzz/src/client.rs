//! What a client reads: links, the events of a run, its answers to requests. Another server than a
//! run may stand behind a link.

use std::{
    io::Write,
    net::{Shutdown, TcpStream},
};

use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::{Message, WebSocket};
use tombolo::{
    client::{Client, ClientError, Link, LinkError, Options},
    deform::{features::FeatureSettings, shapes::box_of_tets, surface::Surface},
    pipelines::{encode::encode_surface, language::RelayAddress, limits::EDITS},
};

use crate::{
    seeds::Seeds,
    server::{PATIENCE, Server, asks_for, head, read_to_end, shake_hands},
};

pub(crate) fn link_seeds() -> Vec<Vec<u8>> {
    let digits = "0a".repeat(32);
    let links = [
        "http://127.0.0.1:7070/runs/wing/?token=0123456789abcdef".to_owned(),
        "http://[::1]:7070/?token=abc".to_owned(),
        "http://host/a/b/?x=1&token=t-1#page".to_owned(),
        format!("https://host.example/?token=t-1#sha256={digits}"),
        "unix:/run/user/1000/tombolo.sock?token=t-1".to_owned(),
        "relay.example.org:7400".to_owned(),
        format!("[::1]:7400#sha256={digits}"),
        "http://127.0.0.1:7400/".to_owned(),
    ];
    links.map(String::into_bytes).to_vec()
}

/// A link that was read is the same when it was printed and read again.
pub(crate) fn link(text: &str) -> Result<String, String> {
    let relay = text.parse::<RelayAddress>();
    if let Ok(address) = &relay
        && address.to_string().parse().as_ref() != Ok(address)
    {
        return Err(format!("the relay {address} is printed as another"));
    }
    let link = text.parse::<Link>();
    if let Ok(link) = &link
        && link.to_string().parse().as_ref() != Ok(link)
    {
        return Err(format!("what is printed is another link: {link}"));
    }
    let link = link.map_or_else(|error| error.to_string(), |link| link.host().to_owned());
    Ok(format!("{link} {}", relay.map_or_else(|reason| reason, |it| it.authority().into())))
}

/// A `hello` for a client that steers.
fn hello() -> Value {
    json!({"hello": {"protocol": 2, "client": "c1", "back": "0123456789abcdef", "role": "driver",
                     "views": [{"name": "boundary", "kind": "surface"}],
                     "parameters": [{"name": "heating", "value": 1.0, "minimum": 0.0, "maximum": 2.0}]}})
}

/// What a run tells: the messages that are in the recording, and one of each other kind.
pub(crate) fn event_seeds(seeds: &Seeds) -> Vec<Vec<u8>> {
    let note = json!({"number": 1, "text": "here", "at": [0, 0, 1], "cycle": 3, "by": "Anna"});
    let others = [
        json!({"stack": {"revision": 2, "edits": 1, "kept": 0, "undoable": 1}}),
        json!({"precision": {"view": "boundary", "coarser": 8.0}}),
        json!({"monitor": {"pipeline": "health", "cycle": 2, "time": 0.1, "values": {"min": 0.5, "max": null}}}),
        json!({"pipelines": {"id": "p", "status": "applied", "cycle": 3}}),
        json!({"done": {"id": "a", "cycle": 3, "time": 0.1}}),
        json!({"link": {"for": "watch", "path": "?key=0123456789abcdef", "id": "b"}}),
        json!({"people": {"viewers": [{"client": "c1", "name": "Anna", "role": "driver", "may_drive": true}]}}),
        json!({"note": note}),
        json!({"note_removed": {"number": 1}}),
        json!({"error": {"message": "wrong", "id": "c"}}),
        json!({"wheel": {"asked_by": "c2", "name": null}}),
        json!({"kept": {"by": "c1", "name": null}}),
        json!({"end": {"how": "finished", "cycle": 11, "time": 0.11}}),
    ];
    let lines = |said: Vec<String>| {
        let hello = hello().to_string();
        std::iter::once(hello).chain(said).collect::<Vec<_>>().join("\n").into_bytes()
    };
    vec![lines(seeds.texts.clone()), lines(others.map(|told| told.to_string()).to_vec())]
}

/// A client is told the lines of a text by a server that has nothing else to say.
pub(crate) fn events(text: &str) -> Result<String, String> {
    let lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let said = lines.clone();
    let server = Server::start(move |stream| {
        let Some(mut socket) = shake_hands(stream) else { return };
        let all = said.iter().try_for_each(|line| socket.send(Message::text(line.as_str())));
        if all.is_ok() && socket.close(None).is_ok() {
            read_to_end(&mut socket);
        }
    });
    let server = server.map_err(|error| error.to_string())?;
    let client = match connected(&server, true)? {
        Ok(client) => client,
        Err(error) => return printed(&error),
    };
    let mut left = lines.iter();
    let mut kinds = String::new();
    loop {
        match client.next(PATIENCE) {
            Ok(Some(received)) => {
                let kind = format!("{:?}", received.event);
                kinds += kind.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
                // What the client itself tells has no text.
                if !received.text.is_empty() && !left.any(|line| **line == *received.text) {
                    return Err(format!("it was not told, or before: {}", received.text));
                }
            }
            Ok(None) => return Err("nothing comes any more, and it is not said why".into()),
            Err(error) => {
                let ended = (client.end().is_some(), client.drives());
                return printed(&error).map(|error| format!("{kinds} {ended:?} {error}"));
            }
        }
    }
}

/// A client of a server; the outer error says what is wrong here.
fn connected(server: &Server, views: bool) -> Result<Result<Client, ClientError>, String> {
    let link: Link = format!("http://{}/?token=t", server.address())
        .parse()
        .map_err(|error: LinkError| error.to_string())?;
    let options = Options { views, attempts: 0, ..Options::default() };
    Ok(Client::connect(&link, &options))
}

/// An error as it is printed, to a terminal too.
fn printed(error: &ClientError) -> Result<String, String> {
    let text = error.to_string();
    if text.chars().any(char::is_control) {
        return Err(format!("the error holds control characters: {text:?}"));
    }
    Ok(text)
}

/// Answers to the requests of a client, without their length: the connection ends behind them.
pub(crate) fn answer_seeds(seeds: &Seeds) -> Vec<Vec<u8>> {
    let edit = json!({"translate": {"features": ["feature-6"], "by": [0, 0, -0.1]}});
    let stack = json!({"revision": 1, "count": 1, "from": 0, "edits": [edit]});
    let none = json!({"revision": 1, "count": 0, "from": 0, "edits": []});
    let pipelines = json!([{"name": "boundary", "stages": [{"surface": {}}, {"stream": {}}]}]);
    let mut bodies: Vec<Vec<u8>> =
        [stack, none, pipelines].map(|body| body.to_string().into_bytes()).to_vec();
    let mesh = box_of_tets([1, 1, 1], [0.0; 3], [1.0; 3]);
    let surface = Surface::extract(&mesh, &FeatureSettings::default()).ok();
    bodies.extend(surface.and_then(|surface| encode_surface(&surface).ok()));
    bodies.extend(seeds.frames.first().cloned());
    let answer = |body: Vec<u8>| {
        [&b"HTTP/1.0 200 OK\r\nContent-Type: application/json\r\n\r\n"[..], &body[..]].concat()
    };
    let mut answers: Vec<Vec<u8>> = bodies.into_iter().map(answer).collect();
    answers.push(b"HTTP/1.1 404 Not Found\r\nContent-Length: 8\r\n\r\nnothing\n".to_vec());
    answers
}

/// A client asks for what a run serves beside its WebSocket, and has the same answer each time.
pub(crate) fn answers(input: &[u8]) -> Result<String, String> {
    let answer = input.to_vec();
    let mut told: Vec<WebSocket<TcpStream>> = Vec::new();
    let server = Server::start(move |mut stream| {
        if asks_for(&stream, "/ws") {
            if let Some(mut socket) = shake_hands(stream) {
                let _ = socket.send(Message::text(hello().to_string()));
                told.push(socket);
            }
            return;
        }
        head(&mut stream);
        let _ = stream.write_all(&answer);
        let _ = stream.shutdown(Shutdown::Write);
    });
    let server = server.map_err(|error| error.to_string())?;
    let client = connected(&server, false)?.map_err(|error| error.to_string())?;
    let stack = match client.stack() {
        Ok(stack) if stack.len() > EDITS.most => return Err("the stack is too long".into()),
        Ok(stack) => format!("{} edits", "i".repeat(stack.len().min(9))),
        Err(error) => printed(&error)?,
    };
    let pipelines =
        client.pipelines().map_or_else(|it| printed(&it), |_| Ok("pipelines".into()))?;
    let surface = client.surface().map_or_else(|it| printed(&it), |_| Ok("a surface".into()))?;
    Ok(format!("{stack}, {pipelines}, {surface}"))
}
