//! The files of the viewer: built into the library, in a directory, or a page that says that there
//! are none.

use std::{
    borrow::Cow,
    path::{Path, PathBuf},
};

/// The viewer as it was when the library was built; empty where it was not built then.
static EMBEDDED: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/viewer_files.rs"));

/// Names a directory that holds the viewer's files, instead of those built in.
pub(super) const DIRECTORY_VARIABLE: &str = "TOMBOLO_VIEWER";

const NO_VIEWER: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>Tombolo</title>\
<body><h1>The solver is running</h1><p>This program was built without the viewer. Build it \
(<code>npm ci &amp;&amp; npm run build</code> in <code>viewer/</code>) and the program after it, or start the program with \
<code>TOMBOLO_VIEWER</code> naming the directory of a built viewer.</p>\
<p>Other programs connect to <code>/ws?token=...</code> on this address.</p></body></html>";

/// Where the viewer's files are.
#[derive(Debug, Clone)]
pub(super) enum ViewerFiles {
    Embedded,
    Directory(PathBuf),
}

impl ViewerFiles {
    pub(super) fn find() -> Self {
        match std::env::var_os(DIRECTORY_VARIABLE) {
            Some(directory) if !directory.is_empty() => Self::Directory(directory.into()),
            _ => Self::Embedded,
        }
    }

    /// The file at a URL's path with its content type; the index for `/`.
    pub(super) fn get(&self, path: &str) -> Option<(&'static str, Cow<'static, [u8]>)> {
        let name = path.strip_prefix('/').unwrap_or(path);
        let name = if name.is_empty() { "index.html" } else { name };
        // Only plain names: no way up, no hidden file, no other drive.
        let plain = |part: &str| {
            !part.is_empty() && !part.starts_with('.') && !part.contains(['\\', ':', '\0', '%'])
        };
        if !name.split('/').all(plain) {
            return None;
        }
        let bytes = match self {
            Self::Embedded => EMBEDDED
                .iter()
                .find(|(known, _)| *known == name)
                .map(|(_, bytes)| Cow::Borrowed(*bytes)),
            Self::Directory(directory) => read_within(directory, name).map(Cow::Owned),
        };
        match bytes {
            None if name == "index.html" => {
                Some((content_type(name), Cow::Borrowed(NO_VIEWER.as_bytes())))
            }
            None => None,
            Some(bytes) => Some((content_type(name), bytes)),
        }
    }
}

/// A file of a directory, unless a link leads out of it.
fn read_within(directory: &Path, name: &str) -> Option<Vec<u8>> {
    let directory = directory.canonicalize().ok()?;
    let file = directory.join(name).canonicalize().ok()?;
    if !file.starts_with(&directory) || !file.is_file() {
        return None;
    }
    std::fs::read(file).ok()
}

fn content_type(name: &str) -> &'static str {
    match name.rsplit_once('.').map(|(_, extension)| extension) {
        Some("html") => "text/html; charset=utf-8",
        Some("js" | "mjs") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("json" | "map") => "application/json",
        Some("wasm") => "application/wasm",
        Some("svg") => "image/svg+xml",
        Some("png") => "image/png",
        Some("jpg" | "jpeg") => "image/jpeg",
        Some("ico") => "image/x-icon",
        Some("woff2") => "font/woff2",
        Some("txt") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_directory_is_served_and_nothing_beside_it() {
        let outer = tempfile::tempdir().unwrap();
        let inner = outer.path().join("viewer");
        std::fs::create_dir_all(inner.join("assets")).unwrap();
        std::fs::write(outer.path().join("secret.txt"), "secret").unwrap();
        std::fs::write(inner.join("index.html"), "index").unwrap();
        std::fs::write(inner.join(".env"), "hidden").unwrap();
        std::fs::write(inner.join("assets/kernel.wasm"), "wasm").unwrap();
        #[cfg(unix)]
        std::os::unix::fs::symlink(outer.path().join("secret.txt"), inner.join("link.txt"))
            .unwrap();
        let files = ViewerFiles::Directory(inner);
        assert_eq!(files.get("/").unwrap().1, &b"index"[..]);
        let (content_type, bytes) = files.get("/assets/kernel.wasm").unwrap();
        assert_eq!((content_type, &*bytes), ("application/wasm", &b"wasm"[..]));
        for outside in [
            "/../secret.txt",
            "/assets/../../secret.txt",
            "/link.txt",
            "/.env",
            "//etc/passwd",
            "/assets",
            "/%2e%2e/secret.txt",
        ] {
            assert!(files.get(outside).is_none(), "{outside}");
        }
    }

    #[test]
    fn without_a_viewer_the_page_says_so() {
        let files = ViewerFiles::Directory("/nowhere".into());
        let (content_type, page) = files.get("/").unwrap();
        assert!(content_type.starts_with("text/html"));
        assert!(String::from_utf8_lossy(&page).contains("TOMBOLO_VIEWER"));
        assert!(files.get("/app.js").is_none());
    }
}
