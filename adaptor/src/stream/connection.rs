//! Connections that cannot be held open by a client that says nothing, reads nothing, or never
//! finishes its request.

use std::{
    future::Future,
    io,
    net::SocketAddr,
    pin::Pin,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    task::{Context, Poll},
    time::Duration,
};

use axum::{extract::connect_info::Connected, serve::IncomingStream};
use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    net::{TcpListener, TcpStream},
    sync::{OwnedSemaphorePermit, Semaphore},
    time::{Instant, Sleep, sleep_until},
};

/// How long a connection may go without a request answered before it has become a WebSocket.
const REQUEST_TIME: Duration = Duration::from_secs(15);
/// How long a WebSocket may go without a byte from the viewer, who answers a ping every
/// [`super::PING_PERIOD`].
const SILENT_TIME: Duration = Duration::from_secs(30);
/// How long a write may wait for a client that does not read.
pub(super) const WRITE_TIME: Duration = Duration::from_secs(10);
/// Connections open at once, viewers and others together. Beyond it the newest is closed
/// unanswered.
const CONNECTIONS: usize = 128;

/// The connection that a request came by, as a handler knows it.
#[derive(Debug, Clone)]
pub(super) struct Connection {
    upgraded: Arc<AtomicBool>,
}

impl Connection {
    /// From here on silence is measured from the last byte, not from the last answer.
    pub(super) fn upgraded(&self) {
        self.upgraded.store(true, Ordering::Relaxed);
    }
}

/// A listening socket whose connections are [`TimedStream`]s, a bounded number of them at once.
pub(super) struct Listener {
    socket: TcpListener,
    slots: Arc<Semaphore>,
}

impl Listener {
    pub(super) fn new(socket: TcpListener) -> Self {
        Self { socket, slots: Arc::new(Semaphore::new(CONNECTIONS)) }
    }
}

impl axum::serve::Listener for Listener {
    type Io = TimedStream;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        loop {
            match self.socket.accept().await {
                Ok((stream, address)) => {
                    let Ok(slot) = Arc::clone(&self.slots).try_acquire_owned() else { continue };
                    // Small messages (an order's outcome) should not wait for more bytes; a socket
                    // that cannot be told so works too.
                    let _ = stream.set_nodelay(true);
                    return (TimedStream::new(stream, slot), address);
                }
                // Out of file descriptors, or a connection that was gone before it was taken: try
                // again a little later.
                Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
            }
        }
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        self.socket.local_addr()
    }
}

impl Connected<IncomingStream<'_, Listener>> for Connection {
    fn connect_info(stream: IncomingStream<'_, Listener>) -> Self {
        Connection { upgraded: Arc::clone(&stream.io().upgraded) }
    }
}

/// A TCP stream that fails with [`io::ErrorKind::TimedOut`] instead of waiting for ever.
pub(super) struct TimedStream {
    stream: TcpStream,
    upgraded: Arc<AtomicBool>,
    read_deadline: Pin<Box<Sleep>>,
    write_deadline: Option<Pin<Box<Sleep>>>,
    _slot: OwnedSemaphorePermit,
}

impl TimedStream {
    fn new(stream: TcpStream, slot: OwnedSemaphorePermit) -> Self {
        Self {
            stream,
            upgraded: Arc::new(AtomicBool::new(false)),
            read_deadline: Box::pin(sleep_until(Instant::now() + REQUEST_TIME)),
            write_deadline: None,
            _slot: slot,
        }
    }

    fn still_here(&mut self) {
        let time = if self.upgraded.load(Ordering::Relaxed) { SILENT_TIME } else { REQUEST_TIME };
        self.read_deadline.as_mut().reset(Instant::now() + time);
    }

    /// Makes a pending write fail once it has been pending for [`WRITE_TIME`].
    fn timed_write<T>(
        &mut self,
        context: &mut Context<'_>,
        written: Poll<io::Result<T>>,
    ) -> Poll<io::Result<T>> {
        if written.is_ready() {
            self.write_deadline = None;
            self.still_here();
            return written;
        }
        let deadline = self
            .write_deadline
            .get_or_insert_with(|| Box::pin(sleep_until(Instant::now() + WRITE_TIME)));
        deadline.as_mut().poll(context).map(|()| Err(timed_out("the client does not read")))
    }
}

fn timed_out(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::TimedOut, what)
}

impl AsyncRead for TimedStream {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let this = self.get_mut();
        let read = Pin::new(&mut this.stream).poll_read(context, buffer);
        if read.is_ready() {
            // Before the upgrade a byte now and then must not keep a connection open.
            if this.upgraded.load(Ordering::Relaxed) {
                this.still_here();
            }
            return read;
        }
        this.read_deadline
            .as_mut()
            .poll(context)
            .map(|()| Err(timed_out("the client says nothing")))
    }
}

impl AsyncWrite for TimedStream {
    fn poll_write(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        let written = Pin::new(&mut this.stream).poll_write(context, bytes);
        this.timed_write(context, written)
    }

    fn poll_write_vectored(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        let written = Pin::new(&mut this.stream).poll_write_vectored(context, slices);
        this.timed_write(context, written)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.get_mut().stream).poll_flush(context)
    }

    fn poll_shutdown(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.get_mut().stream).poll_shutdown(context)
    }
}
