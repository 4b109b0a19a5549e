//! Connections that cannot be held open by a client that says nothing, reads nothing, or never
//! finishes its request.

use std::{
    future::Future,
    io,
    net::IpAddr,
    pin::Pin,
    sync::{Arc, atomic::Ordering},
    task::{Context, Poll},
    time::Duration,
};

use tokio::{
    io::{AsyncRead, AsyncWrite, ReadBuf},
    time::{Instant, Sleep, sleep_until},
};

use super::{
    credentials::Access,
    pool::{Guest, Pool},
    refusals::Refused,
    socket::Accepted,
};

/// How long a connection may go without a request that shows a secret answered.
const UNKNOWN_TIME: Duration = Duration::from_secs(5);
/// How long one that has shown a secret may go without a request answered before it has become a
/// WebSocket.
const REQUEST_TIME: Duration = Duration::from_secs(15);
/// How long a WebSocket may go without a byte either way; it is pinged every [`super::PING_PERIOD`].
/// That a network is gone is noticed by the system, which has nothing acknowledged.
const SILENT_TIME: Duration = Duration::from_secs(30);
/// How long a write may wait for a client that takes no byte.
const WRITE_TIME: Duration = Duration::from_secs(20);

/// The connection that a request came by, as a handler knows it.
#[derive(Debug, Clone)]
pub(super) struct Connection {
    guest: Arc<Guest>,
    pool: Arc<Pool>,
    way: Way,
}

/// The way by which a connection has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    /// To the socket that the server listens on.
    Direct,
    /// Through a relay.
    Relayed {
        /// Whether the viewer's connection to the relay is encrypted.
        is_encrypted: bool,
    },
}

impl Connection {
    /// Takes in a connection from an address; where there are too many like it, another makes way.
    pub(super) fn enter(pool: &Arc<Pool>, address: IpAddr, way: Way) -> Self {
        Self { guest: pool.enter(address), pool: Arc::clone(pool), way }
    }

    pub(super) fn way(&self) -> Way {
        self.way
    }

    pub(super) fn address(&self) -> IpAddr {
        self.guest.address
    }

    /// Takes note that it has shown a secret; `false` where there are too many that have.
    pub(super) fn known(&self, access: Access) -> bool {
        self.pool.know(&self.guest, access)
    }

    /// Takes note of a request that the server answers once this is dropped: until then the client has
    /// nothing to say.
    pub(super) fn asked(&self) -> Asked {
        self.guest.unanswered.fetch_add(1, Ordering::AcqRel);
        Asked(Arc::clone(&self.guest))
    }

    /// From here on silence is measured from the last byte, not from the last answer.
    pub(super) fn upgraded(&self) {
        self.guest.is_upgraded.store(true, Ordering::Relaxed);
    }
}

/// A request that has not been answered.
pub(super) struct Asked(Arc<Guest>);

impl Drop for Asked {
    fn drop(&mut self) {
        self.0.unanswered.fetch_sub(1, Ordering::AcqRel);
    }
}

/// Bytes that the client's side has not taken yet, where the system tells.
#[cfg(target_os = "linux")]
fn untaken(accepted: &Accepted) -> Option<i32> {
    let mut bytes: libc::c_int = 0;
    // SAFETY: the descriptor is open as long as the stream is there, which is borrowed with it, and
    // the request writes one integer to where `bytes` is.
    let result = unsafe { libc::ioctl(accepted.descriptor, libc::TIOCOUTQ, &raw mut bytes) };
    (result == 0).then_some(bytes)
}

#[cfg(not(target_os = "linux"))]
fn untaken(_: &Accepted) -> Option<i32> {
    None
}

/// A stream that fails with [`io::ErrorKind::TimedOut`] instead of waiting for ever.
pub(super) struct TimedStream {
    accepted: Accepted,
    connection: Connection,
    read_deadline: Pin<Box<Sleep>>,
    /// Whether the client has sent something since it was answered last.
    has_begun: bool,
    /// When a write that waits is given up, unless fewer bytes than these are untaken then.
    write_deadline: Option<(Pin<Box<Sleep>>, Option<i32>)>,
}

impl TimedStream {
    pub(super) fn new(accepted: Accepted, connection: Connection) -> Self {
        Self {
            accepted,
            connection,
            read_deadline: Box::pin(sleep_until(Instant::now() + UNKNOWN_TIME)),
            has_begun: false,
            write_deadline: None,
        }
    }

    fn still_here(&mut self) {
        self.has_begun = false;
        let guest = &self.connection.guest;
        let time = if guest.is_upgraded.load(Ordering::Relaxed) {
            SILENT_TIME
        } else if guest.is_known.load(Ordering::Relaxed) {
            REQUEST_TIME
        } else {
            UNKNOWN_TIME
        };
        self.read_deadline.as_mut().reset(Instant::now() + time);
    }

    /// Tells that the connection ends in the midst of a request, where it does.
    fn tell_slow(&self) {
        let Connection { guest, pool, .. } = &self.connection;
        if self.has_begun && !guest.is_upgraded.load(Ordering::Relaxed) {
            let address = guest.address;
            let what = || format!("a connection from {address} was closed");
            pool.refusals.tell(address, Refused::Slow, None, what);
        }
    }

    /// Makes a pending write fail once the client has taken no byte for [`WRITE_TIME`].
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
        let (deadline, before) = self.write_deadline.get_or_insert_with(|| {
            (Box::pin(sleep_until(Instant::now() + WRITE_TIME)), untaken(&self.accepted))
        });
        while deadline.as_mut().poll(context).is_ready() {
            let now = untaken(&self.accepted);
            if now == *before {
                return Poll::Ready(Err(timed_out("the client does not read")));
            }
            *before = now;
            deadline.as_mut().reset(Instant::now() + WRITE_TIME);
        }
        Poll::Pending
    }
}

impl Drop for TimedStream {
    fn drop(&mut self) {
        self.connection.pool.leave(&self.connection.guest);
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
        let guest = &this.connection.guest;
        guest.waker.register(context.waker());
        if guest.is_cut.load(Ordering::Acquire) {
            return Poll::Ready(Err(timed_out("it makes way for a newer connection")));
        }
        let before = buffer.filled().len();
        let read = Pin::new(&mut this.accepted.stream).poll_read(context, buffer);
        if read.is_ready() {
            this.has_begun |= buffer.filled().len() > before;
            // Before the upgrade a byte now and then must not keep a connection open.
            if guest.is_upgraded.load(Ordering::Relaxed) {
                this.still_here();
            }
            return read;
        }
        while this.read_deadline.as_mut().poll(context).is_ready() {
            // One who is behind with reading is judged by that, and one who waits for an answer not at
            // all.
            let waits = this.connection.guest.unanswered.load(Ordering::Acquire) > 0;
            if this.write_deadline.is_none() && !waits {
                this.tell_slow();
                return Poll::Ready(Err(timed_out("the client says nothing")));
            }
            this.still_here();
        }
        Poll::Pending
    }
}

impl AsyncWrite for TimedStream {
    fn poll_write(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        let written = Pin::new(&mut this.accepted.stream).poll_write(context, bytes);
        this.timed_write(context, written)
    }

    fn poll_write_vectored(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        let written = Pin::new(&mut this.accepted.stream).poll_write_vectored(context, slices);
        this.timed_write(context, written)
    }

    fn is_write_vectored(&self) -> bool {
        self.accepted.stream.is_write_vectored()
    }

    fn poll_flush(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.get_mut().accepted.stream).poll_flush(context)
    }

    fn poll_shutdown(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.get_mut().accepted.stream).poll_shutdown(context)
    }
}
