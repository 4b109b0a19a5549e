//! Servers and connections of this machine, over which inputs go.

use std::{
    io::{self, Read},
    net::{SocketAddr, TcpListener, TcpStream},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::Duration,
};

use tokio_tungstenite::tungstenite::{WebSocket, accept};

/// How long the other side may take for anything.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);
/// Bytes of the head of a request.
const HEAD: usize = 1 << 14;

/// A server on a thread of its own, which serves one connection after the other. Dropping it ends the
/// thread.
pub(crate) struct Server {
    address: SocketAddr,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    pub(crate) fn start(serve: impl FnMut(TcpStream) + Send + 'static) -> io::Result<Self> {
        let listener = TcpListener::bind(("127.0.0.1", 0))?;
        let address = listener.local_addr()?;
        let is_over = Arc::new(AtomicBool::new(false));
        let (over, mut serve) = (Arc::clone(&is_over), serve);
        let thread = std::thread::spawn(move || {
            while let Ok((stream, _)) = listener.accept() {
                if over.load(Ordering::Acquire) {
                    return;
                }
                if patient(&stream).is_ok() {
                    serve(stream);
                }
            }
        });
        Ok(Self { address, is_over, thread: Some(thread) })
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Release);
        let _ = TcpStream::connect(self.address);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Lets nothing on a connection take longer than [`PATIENCE`].
pub(crate) fn patient(stream: &TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))
}

/// Whether a request for a path comes over a connection, of which nothing is taken.
pub(crate) fn asks_for(stream: &TcpStream, path: &str) -> bool {
    let expected = format!("GET {path}");
    let mut found = vec![0; expected.len()];
    loop {
        match stream.peek(&mut found) {
            Ok(0) | Err(_) => return false,
            Ok(count) if count >= expected.len() => return found == expected.as_bytes(),
            Ok(count) if found[..count] != expected.as_bytes()[..count] => return false,
            Ok(_) => std::thread::sleep(Duration::from_millis(1)),
        }
    }
}

/// The head of a request.
pub(crate) fn head(stream: &mut TcpStream) -> String {
    let (mut head, mut byte) = (Vec::new(), [0]);
    while head.len() < HEAD && !head.ends_with(b"\r\n\r\n") && stream.read_exact(&mut byte).is_ok()
    {
        head.push(byte[0]);
    }
    String::from_utf8_lossy(&head).into_owned()
}

/// Answers a request for a WebSocket.
pub(crate) fn shake_hands(stream: TcpStream) -> Option<WebSocket<TcpStream>> {
    accept(stream).ok()
}

/// Reads until the other side has ended the connection.
pub(crate) fn read_to_end(socket: &mut WebSocket<TcpStream>) {
    while socket.read().is_ok() {}
}
