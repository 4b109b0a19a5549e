//! Connections on their way to the server: each is given its time and its place among the others, and
//! shakes hands where it is encrypted.

use std::{io, sync::Arc, time::Duration};

use axum::{extract::connect_info::Connected, serve::IncomingStream};
use tokio::{sync::mpsc, task::JoinSet};
use tokio_rustls::TlsAcceptor;
use tombolo_pipelines::language::StreamLimits;

use super::{
    connection::{Connection, TimedStream, Way},
    pool::Pool,
    refusals::Refusals,
    socket::{Accepted, Listening},
};
use crate::dial::Stream;

/// Connections that are ready and that the server has not taken yet.
const READY: usize = 16;

type Ready = (Box<dyn Stream>, Connection);

/// Hands connections to the server that end in time, a bounded number of them at once.
pub(super) struct Listener {
    ready: mpsc::Receiver<Ready>,
    /// Ends with it.
    _accepting: JoinSet<()>,
}

/// Takes connections in, whichever side has made them.
#[derive(Clone)]
pub(super) struct Entrance {
    pool: Arc<Pool>,
    ready: mpsc::Sender<Ready>,
}

impl Listener {
    /// Takes connections from a socket, if there is one, of which so many may be open; with an acceptor all are
    /// encrypted. The entrance is for those that come otherwise.
    pub(super) fn new(
        socket: Option<Listening>,
        acceptor: Option<TlsAcceptor>,
        limits: &StreamLimits,
        refusals: &Arc<Refusals>,
    ) -> (Self, Entrance) {
        let (sender, ready) = mpsc::channel(READY);
        let pool = Arc::new(Pool::new(limits, Arc::clone(refusals)));
        let entrance = Entrance { pool, ready: sender };
        let mut accepting = JoinSet::new();
        if let Some(socket) = socket {
            accepting.spawn(accept(socket, acceptor, entrance.clone()));
        }
        (Self { ready, _accepting: accepting }, entrance)
    }
}

impl Entrance {
    /// Gives a connection its time, and its place among the others.
    fn timed(&self, accepted: Accepted, way: Way) -> (TimedStream, Connection) {
        let connection = Connection::enter(&self.pool, accepted.address, way);
        (TimedStream::new(accepted, connection.clone()), connection)
    }

    /// Hands the server a connection that is not encrypted, or was before it came here.
    pub(super) async fn take(&self, accepted: Accepted, way: Way) {
        let (stream, connection) = self.timed(accepted, way);
        let _ = self.ready.send((Box::new(stream), connection)).await;
    }
}

/// Takes connections in for ever. One that takes its time to shake hands keeps nobody waiting.
async fn accept(socket: Listening, acceptor: Option<TlsAcceptor>, entrance: Entrance) {
    // Bounded by the pool: what makes way for others ends.
    let mut shaking = JoinSet::new();
    loop {
        while shaking.try_join_next().is_some() {}
        let Ok(accepted) = socket.accept().await else {
            // Out of file descriptors, or a connection that was gone before it was taken: try again a
            // little later.
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        let Some(acceptor) = &acceptor else {
            entrance.take(accepted, Way::Direct).await;
            continue;
        };
        let (stream, connection) = entrance.timed(accepted, Way::Direct);
        let (shaken, ready) = (acceptor.accept(stream), entrance.ready.clone());
        shaking.spawn(async move {
            if let Ok(stream) = shaken.await {
                let _ = ready.send((Box::new(stream), connection)).await;
            }
        });
    }
}

impl axum::serve::Listener for Listener {
    type Io = Box<dyn Stream>;
    type Addr = Connection;

    async fn accept(&mut self) -> Ready {
        match self.ready.recv().await {
            Some(ready) => ready,
            None => std::future::pending().await,
        }
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

impl Connected<IncomingStream<'_, Listener>> for Connection {
    fn connect_info(stream: IncomingStream<'_, Listener>) -> Self {
        stream.remote_addr().clone()
    }
}
