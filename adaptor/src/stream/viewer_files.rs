//! The files of the viewer: built into the library, in a directory, or a page that says that there
//! are none. Beside most of them lie compressed copies, `name.br` and `name.gz`, which the
//! viewer's build makes.

use std::{
    borrow::Cow,
    hash::{DefaultHasher, Hash, Hasher},
    path::{Path, PathBuf},
};

use axum::{
    http::{HeaderMap, HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};

/// The viewer as it was when the library was built; empty where it was not built then.
static EMBEDDED: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/viewer_files.rs"));

/// Names a directory that holds the viewer's files, instead of those built in.
pub(super) const DIRECTORY_VARIABLE: &str = "TOMBOLO_VIEWER";

const INDEX: &str = "index.html";
/// Where the viewer's build puts the files whose names hold a hash of what is in them.
const HASHED: &str = "assets/";
/// How files are compressed, the best first, and how the names of the copies end.
const ENCODINGS: [(&str, &str); 2] = [("br", "br"), ("gzip", "gz")];

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

    /// The answer to a request for the file at a URL's path, the index for `/`: compressed where
    /// the browser takes that, and empty where it has the file already. Files whose names hold
    /// a hash of what is in them are kept by the browser, the others asked for again.
    pub(super) fn answer(&self, path: &str, request: &HeaderMap) -> Option<Response> {
        let (name, plain) = self.get(path)?;
        let is_hashed = name.starts_with(HASHED);
        let caching = if is_hashed { "public, max-age=31536000, immutable" } else { "no-cache" };
        let mut headers = HeaderMap::new();
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static(caching));
        headers.insert(header::VARY, HeaderValue::from_static("accept-encoding"));
        if !is_hashed {
            // It stands for the file, however it is compressed.
            let mut hasher = DefaultHasher::new();
            plain.hash(&mut hasher);
            let tag = format!("W/\"{:016x}\"", hasher.finish());
            if says(request, header::IF_NONE_MATCH).any(|known| known == tag) {
                return Some((StatusCode::NOT_MODIFIED, headers).into_response());
            }
            headers.insert(header::ETAG, HeaderValue::from_str(&tag).ok()?);
        }
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(content_type(name)));
        let copy = ENCODINGS
            .into_iter()
            .filter(|(coding, _)| takes(request, coding))
            .find_map(|(coding, ending)| Some((coding, self.read(&format!("{name}.{ending}"))?)));
        let bytes = match copy {
            Some((coding, copy)) => {
                headers.insert(header::CONTENT_ENCODING, HeaderValue::from_static(coding));
                copy
            }
            None => plain,
        };
        Some((headers, bytes).into_response())
    }

    /// The file at a URL's path, with its name; the index for `/`.
    fn get<'a>(&self, path: &'a str) -> Option<(&'a str, Cow<'static, [u8]>)> {
        let name = path.strip_prefix('/').unwrap_or(path);
        let name = if name.is_empty() { INDEX } else { name };
        // Only plain names: no way up, no hidden file, no other drive.
        let plain = |part: &str| {
            !part.is_empty() && !part.starts_with('.') && !part.contains(['\\', ':', '\0', '%'])
        };
        if !name.split('/').all(plain) {
            return None;
        }
        match self.read(name) {
            None if name == INDEX => Some((name, Cow::Borrowed(NO_VIEWER.as_bytes()))),
            bytes => Some((name, bytes?)),
        }
    }

    /// A file by its plain name.
    fn read(&self, name: &str) -> Option<Cow<'static, [u8]>> {
        match self {
            Self::Embedded => EMBEDDED
                .iter()
                .find(|(known, _)| *known == name)
                .map(|(_, bytes)| Cow::Borrowed(*bytes)),
            Self::Directory(directory) => read_within(directory, name).map(Cow::Owned),
        }
    }
}

/// The entries of a header that holds a list.
fn says(headers: &HeaderMap, name: header::HeaderName) -> impl Iterator<Item = &str> {
    let values = headers.get_all(name).into_iter();
    values.filter_map(|value| value.to_str().ok()).flat_map(|list| list.split(',')).map(str::trim)
}

/// Whether a browser takes files that are compressed in a way.
fn takes(headers: &HeaderMap, coding: &str) -> bool {
    says(headers, header::ACCEPT_ENCODING).any(|entry| {
        let (name, weight) = entry.split_once(';').unwrap_or((entry, ""));
        let weight = weight.trim().strip_prefix("q=").and_then(|weight| weight.parse().ok());
        name.trim().eq_ignore_ascii_case(coding) && weight.unwrap_or(1.0_f32) > 0.0
    })
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

    /// A page, a script with its copies, and things beside them that nobody may see.
    fn files() -> (tempfile::TempDir, ViewerFiles) {
        let outer = tempfile::tempdir().unwrap();
        let inner = outer.path().join("viewer");
        std::fs::create_dir_all(inner.join("assets")).unwrap();
        std::fs::write(outer.path().join("secret.txt"), "secret").unwrap();
        for (name, text) in [
            ("index.html", "index"),
            ("index.html.gz", "index, gzip"),
            (".env", "hidden"),
            ("assets/kernel.wasm", "wasm"),
            ("assets/script-1a2b.js", "script"),
            ("assets/script-1a2b.js.br", "script, brotli"),
            ("assets/script-1a2b.js.gz", "script, gzip"),
        ] {
            std::fs::write(inner.join(name), text).unwrap();
        }
        #[cfg(unix)]
        std::os::unix::fs::symlink(outer.path().join("secret.txt"), inner.join("link.txt"))
            .unwrap();
        (outer, ViewerFiles::Directory(inner))
    }

    fn asking(name: header::HeaderName, value: &str) -> HeaderMap {
        HeaderMap::from_iter([(name, HeaderValue::from_str(value).unwrap())])
    }

    fn text(response: Response) -> String {
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        let bytes = runtime.block_on(axum::body::to_bytes(response.into_body(), 1000)).unwrap();
        String::from_utf8(bytes.into()).unwrap()
    }

    #[test]
    fn a_directory_is_served_and_nothing_beside_it() {
        let (_outer, files) = files();
        let get = |path| files.answer(path, &HeaderMap::new());
        assert_eq!(text(get("/").unwrap()), "index");
        let module = get("/assets/kernel.wasm").unwrap();
        assert_eq!(module.headers()[header::CONTENT_TYPE], "application/wasm");
        assert_eq!(text(module), "wasm");
        for outside in [
            "/../secret.txt",
            "/assets/../../secret.txt",
            "/link.txt",
            "/.env",
            "//etc/passwd",
            "/assets",
            "/%2e%2e/secret.txt",
        ] {
            assert!(get(outside).is_none(), "{outside}");
        }
    }

    #[test]
    fn a_browser_gets_the_smallest_copy_that_it_can_read() {
        let (_outer, files) = files();
        for (accepted, coding, body) in [
            ("gzip, deflate, br, zstd", "br", "script, brotli"),
            ("gzip, deflate", "gzip", "script, gzip"),
            ("br;q=0, GZIP;q=0.5", "gzip", "script, gzip"),
            ("deflate", "", "script"),
            ("br;q=0", "", "script"),
        ] {
            let request = asking(header::ACCEPT_ENCODING, accepted);
            let answer = files.answer("/assets/script-1a2b.js", &request).unwrap();
            let sent = answer.headers().get(header::CONTENT_ENCODING);
            assert_eq!(sent.map_or("", |sent| sent.to_str().unwrap()), coding, "{accepted}");
            assert_eq!(answer.headers()[header::CONTENT_TYPE], "text/javascript; charset=utf-8");
            assert_eq!(answer.headers()[header::VARY], "accept-encoding");
            assert_eq!(text(answer), body, "{accepted}");
        }
    }

    #[test]
    fn files_with_a_hash_are_kept_and_the_page_is_asked_for_again() {
        let (_outer, files) = files();
        let script = files.answer("/assets/script-1a2b.js", &HeaderMap::new()).unwrap();
        let caching = script.headers()[header::CACHE_CONTROL].to_str().unwrap();
        assert!(caching.contains("immutable"), "{caching}");
        let page = files.answer("/", &asking(header::ACCEPT_ENCODING, "gzip")).unwrap();
        assert_eq!(page.headers()[header::CACHE_CONTROL], "no-cache");
        let tag = page.headers()[header::ETAG].to_str().unwrap().to_owned();
        assert_eq!(text(page), "index, gzip");
        let again = files.answer("/", &asking(header::IF_NONE_MATCH, &tag)).unwrap();
        assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
        assert_eq!(text(again), "");
        let other = files.answer("/", &asking(header::IF_NONE_MATCH, "W/\"0\"")).unwrap();
        assert_eq!((other.status(), text(other).as_str()), (StatusCode::OK, "index"));
    }

    #[test]
    fn without_a_viewer_the_page_says_so() {
        let files = ViewerFiles::Directory("/nowhere".into());
        let page = files.answer("/", &HeaderMap::new()).unwrap();
        assert_eq!(page.headers()[header::CONTENT_TYPE], "text/html; charset=utf-8");
        assert!(text(page).contains("TOMBOLO_VIEWER"));
        assert!(files.answer("/app.js", &HeaderMap::new()).is_none());
    }

    /// The viewer that is built in, where there is one: what a browser loads before the first
    /// picture.
    #[test]
    fn the_first_load_of_the_viewer_is_small() {
        let least = |name: &str| {
            let copies = EMBEDDED.iter().filter(|(known, _)| {
                known.strip_prefix(name).is_some_and(|ending| ["", ".br"].contains(&ending))
            });
            copies.map(|(_, bytes)| bytes.len()).min().unwrap_or_default()
        };
        // The editor of pipelines and what checks them come when one is opened.
        let later = ["editor-", "language-", "check.worker-"];
        let is_first = |name: &&str| {
            let file = name.rsplit('/').next().unwrap_or(name);
            !name.ends_with(".br")
                && !name.ends_with(".gz")
                && !later.iter().any(|lazy| file.starts_with(lazy))
        };
        let names = EMBEDDED.iter().map(|(name, _)| *name);
        let wire: usize = names.filter(is_first).map(least).sum();
        assert!(wire <= 700_000, "{wire} bytes");
    }
}
