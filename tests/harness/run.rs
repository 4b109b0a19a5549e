//! Programs, built once and run as processes.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use crate::{Link, PATIENCE, project};

/// Where cargo puts the programs of this profile; they are built at the first call.
///
/// # Panics
/// Where they do not build.
#[must_use]
pub fn programs() -> &'static Path {
    static PROGRAMS: OnceLock<PathBuf> = OnceLock::new();
    // With a test among the targets, the dependencies have the features that `cargo test` gave
    // them: nothing is built twice.
    PROGRAMS.get_or_init(|| {
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let mut build = Command::new(cargo);
        // What cargo says of the test alone: a dependency that looks at it would be built again.
        let names = std::env::vars_os().filter_map(|(name, _)| name.into_string().ok());
        names.filter(|name| is_of_package(name)).for_each(|name| {
            build.env_remove(name);
        });
        let output = build
            .current_dir(project())
            .args([
                "build",
                "--quiet",
                "--workspace",
                "--bins",
                "--example",
                "heat",
                "--test",
                "browser",
            ])
            .args(cfg!(feature = "distributed").then_some("--features=tombolo-tests/distributed"))
            .output()
            .expect("cargo runs");
        assert!(
            output.status.success(),
            "the programs do not build:\n{}",
            String::from_utf8_lossy(&output.stderr)
        );
        // A test lies in target/debug/deps, the programs in target/debug.
        let test = std::env::current_exe().expect("a running test has a path");
        test.ancestors().nth(2).expect("a test lies in target/debug/deps").to_owned()
    })
}

/// Whether cargo sets this variable for the programs of one package.
fn is_of_package(variable: &str) -> bool {
    variable == "OUT_DIR"
        || ["CARGO_PKG_", "CARGO_MANIFEST_"].iter().any(|prefix| variable.starts_with(prefix))
}

/// A program by name, ready for arguments, run from the root of the project.
#[must_use]
pub fn program(name: &str) -> Command {
    let mut command = Command::new(programs().join(name));
    command.current_dir(project());
    command
}

/// Runs `tombolo` to its end.
///
/// # Panics
/// Where it cannot be started.
pub fn tombolo<S: AsRef<OsStr>>(arguments: &[S]) -> Output {
    program("tombolo").args(arguments).output().expect("tombolo starts")
}

/// A program that runs beside the test. It is killed when it is dropped.
pub struct Run {
    child: Child,
    lines: Receiver<String>,
    text: Arc<Mutex<String>>,
}

impl Run {
    /// Starts `flow` with these arguments.
    ///
    /// # Panics
    /// Where it cannot be started.
    pub fn flow<S: AsRef<OsStr>>(arguments: &[S]) -> Run {
        Self::start(program("flow").args(arguments))
    }

    /// Starts `flow` with these arguments on several ranks of MPI.
    ///
    /// # Panics
    /// Where it cannot be started.
    pub fn flow_on<S: AsRef<OsStr>>(ranks: usize, arguments: &[S]) -> Run {
        let mut command = Command::new("mpirun");
        // More ranks than cores, and as whoever runs the tests.
        command.args(["--oversubscribe", "--allow-run-as-root", "-n", &ranks.to_string()]);
        Self::start(command.current_dir(project()).arg(programs().join("flow")).args(arguments))
    }

    /// Starts any program.
    ///
    /// # Panics
    /// Where it cannot be started.
    pub fn start(command: &mut Command) -> Run {
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("flow starts");
        let (sender, lines) = channel();
        let text = Arc::new(Mutex::new(String::new()));
        let pipes: [Option<Box<dyn Read + Send>>; 2] = [
            child.stdout.take().map(|pipe| Box::new(pipe) as Box<dyn Read + Send>),
            child.stderr.take().map(|pipe| Box::new(pipe) as Box<dyn Read + Send>),
        ];
        for pipe in pipes.into_iter().flatten() {
            let (sender, text) = (sender.clone(), Arc::clone(&text));
            std::thread::spawn(move || {
                for line in BufReader::new(pipe).lines().map_while(Result::ok) {
                    {
                        let mut text = text.lock().unwrap_or_else(PoisonError::into_inner);
                        text.push_str(&line);
                        text.push('\n');
                    }
                    let _ = sender.send(line);
                }
            });
        }
        Run { child, lines, text }
    }

    /// Everything the program has printed so far, both streams together.
    #[must_use]
    pub fn text(&self) -> String {
        self.text.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Waits for the link to the viewer.
    ///
    /// # Panics
    /// Where the program ends or long passes before it prints one.
    pub fn link(&mut self) -> Link {
        self.line("a link", Link::find)
    }

    /// Waits for a line in which `found` finds something.
    ///
    /// # Panics
    /// Where the program ends or long passes before it prints one.
    pub fn line<T>(&mut self, what: &str, found: impl Fn(&str) -> Option<T>) -> T {
        let until = Instant::now() + PATIENCE;
        loop {
            match self.lines.recv_timeout(until.saturating_duration_since(Instant::now())) {
                Ok(line) => {
                    if let Some(found) = found(&line) {
                        return found;
                    }
                }
                Err(RecvTimeoutError::Timeout) => {
                    panic!("{what} was not printed in {PATIENCE:?}:\n{}", self.text())
                }
                Err(RecvTimeoutError::Disconnected) => {
                    panic!("the program ended and did not print {what}:\n{}", self.text())
                }
            }
        }
    }

    /// Whether the program still runs.
    ///
    /// # Panics
    /// Where the system does not say.
    pub fn is_running(&mut self) -> bool {
        self.child.try_wait().expect("the system knows its children").is_none()
    }

    /// The number of its process.
    #[must_use]
    pub fn process(&self) -> u32 {
        self.child.id()
    }

    /// Sends the program a signal, such as `TERM`.
    ///
    /// # Panics
    /// Where it cannot be sent.
    pub fn signal(&self, name: &str) {
        let process = self.child.id().to_string();
        let sent = Command::new("kill").args(["-s", name, &process]).status();
        assert!(sent.is_ok_and(|status| status.success()), "{name} was not sent");
    }

    /// Waits for the program's end, at most `limit`.
    ///
    /// # Panics
    /// Where it runs longer; the message holds what it printed.
    pub fn finish(mut self, limit: Duration) -> (ExitStatus, String) {
        let until = Instant::now() + limit;
        loop {
            if let Some(status) = self.child.try_wait().expect("the system knows its children") {
                // The readers end with the pipes.
                while self.lines.recv_timeout(Duration::from_secs(5)).is_ok() {}
                return (status, self.text());
            }
            assert!(Instant::now() < until, "flow ran longer than {limit:?}:\n{}", self.text());
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
