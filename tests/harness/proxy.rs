//! A reverse proxy with a certificate, as a site puts one before its services.

use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::{PATIENCE, Run, project};

/// Where the page about operation says how nginx is set up, and what stands there for the path and the
/// service behind it.
const PAGE: &str = include_str!("../../docs/operations.md");
const PATH: &str = "/runs/nozzle/";
const SERVICE: &str = "http://unix:/run/tombolo/nozzle.sock:/";

/// nginx, encrypted, before a service on this machine, set up as the page about operation says. It ends
/// when it is dropped.
pub struct Proxy {
    _run: Run,
    _directory: TempDir,
}

impl Proxy {
    /// Passes what is asked for below `path` of one port of this machine on to another port.
    ///
    /// # Panics
    /// Where nginx does not start.
    #[must_use]
    pub fn start(port: u16, path: &str, to: u16) -> Proxy {
        let directory = TempDir::new().expect("a temporary directory");
        let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]);
        let made = made.expect("a certificate can be made");
        let write = |name: &str, text: &str| {
            std::fs::write(directory.path().join(name), text).expect("a file can be written");
        };
        write("certificate.pem", &made.cert.pem());
        write("key.pem", &made.signing_key.serialize_pem());
        let (_, rest) = PAGE.split_once("```nginx\n").expect("the page has a block for nginx");
        let (block, _) = rest.split_once("```").expect("the block ends");
        assert!(block.contains(PATH) && block.contains(SERVICE), "{block}");
        let block = block.replace(PATH, path).replace(SERVICE, &format!("http://127.0.0.1:{to}/"));
        let folders = ["client_body", "proxy", "fastcgi", "uwsgi", "scgi"]
            .map(|kind| format!("{kind}_temp_path {kind};\n"))
            .concat();
        write(
            "nginx.conf",
            &format!(
                "daemon off;\npid nginx.pid;\nerror_log stderr;\nevents {{}}\nhttp {{\naccess_log off;\n\
                 {folders}server {{\nlisten 127.0.0.1:{port} ssl;\nssl_certificate certificate.pem;\n\
                 ssl_certificate_key key.pem;\n{block}}}\n}}\n"
            ),
        );
        let mut nginx = Command::new(project().join(".venv/nginx/usr/sbin/nginx"));
        nginx.arg("-p").arg(directory.path()).args(["-e", "stderr", "-c", "nginx.conf"]);
        let mut run = Run::start(&mut nginx);
        let begun = Instant::now();
        while TcpStream::connect(("127.0.0.1", port)).is_err() {
            assert!(run.is_running() && begun.elapsed() < PATIENCE, "nginx:\n{}", run.text());
            std::thread::sleep(Duration::from_millis(20));
        }
        Proxy { _run: run, _directory: directory }
    }
}

/// Ports of this machine on which nothing listened just now, no two the same.
///
/// # Panics
/// Where there are none.
#[must_use]
pub fn free_ports<const COUNT: usize>() -> [u16; COUNT] {
    let bound = [(); COUNT].map(|()| TcpListener::bind(("127.0.0.1", 0)).expect("a free port"));
    bound.map(|listener| listener.local_addr().expect("it has an address").port())
}
