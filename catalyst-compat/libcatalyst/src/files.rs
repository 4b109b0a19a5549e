//! Trees in files.

use std::fs;
use std::path::Path;

use crate::error::{Error, Result};
use crate::node::Node;
use crate::print::{Detail, Style};
use crate::schema::{self, Protocol};

/// The content of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    /// Compact data, and beside them in `FILE_json` their schema.
    Binary,
    Text(Protocol),
}

fn format(path: &str, protocol: &str) -> Result<Format> {
    let name = if protocol.is_empty() {
        let known = ["conduit_base64_json", "conduit_json", "conduit_bin", "json", "yaml"];
        known.into_iter().find(|name| path.ends_with(&format!(".{name}"))).unwrap_or("conduit_bin")
    } else {
        protocol
    };
    if name == "conduit_bin" {
        Ok(Format::Binary)
    } else {
        Protocol::from_name(name).map(Format::Text)
    }
}

/// Writes a tree. Without a protocol the end of the path says which, else it is `conduit_bin`.
///
/// # Errors
/// The file cannot be written, or a leaf has no data.
pub fn save(node: &Node, path: &str, protocol: &str) -> Result<()> {
    let write = |path: &str, bytes: &[u8]| {
        fs::write(Path::new(path), bytes)
            .map_err(|error| Error::new(format!("'{path}' cannot be written: {error}")))
    };
    let style = Style::default();
    match format(path, protocol)? {
        Format::Binary => {
            let (schema, data) = schema::serialize(node)?;
            write(path, &data)?;
            write(&format!("{path}_json"), schema.as_bytes())
        }
        Format::Text(Protocol::Json) => {
            write(path, node.to_json(&style, Detail::Values).as_bytes())
        }
        Format::Text(Protocol::Schema) => {
            write(path, node.to_json(&style, Detail::Everything).as_bytes())
        }
        Format::Text(Protocol::Yaml) => write(path, node.to_yaml(&style).as_bytes()),
        Format::Text(Protocol::Base64) => write(path, schema::to_base64_json(node)?.as_bytes()),
    }
}

/// Reads a tree. Without a protocol the end of the path says which, else it is `conduit_bin`.
///
/// # Errors
/// The file cannot be read, or is not what the protocol says.
pub fn load(path: &str, protocol: &str) -> Result<Node> {
    let read = |path: &str| {
        fs::read(Path::new(path))
            .map_err(|error| Error::new(format!("'{path}' cannot be read: {error}")))
    };
    let text = |path: &str| read(path).map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    let inside = |error: Error| Error::new(format!("'{path}': {error}"));
    match format(path, protocol)? {
        Format::Binary => {
            schema::within(&text(&format!("{path}_json"))?, &mut read(path)?).map_err(inside)
        }
        Format::Text(protocol) => schema::parse(&text(path)?, protocol).map_err(inside),
    }
}
