//! The listening socket, as the server takes connections from it.

use std::{io, net::IpAddr, sync::Arc, time::Duration};

use axum::{extract::connect_info::Connected, serve::IncomingStream};
use tokio_rustls::TlsAcceptor;

use super::{
    connection::{Connection, TimedStream},
    pool::Pool,
    secured::Secured,
    socket::Listening,
};

/// A listening socket whose connections end in time, a bounded number of them at once.
pub(super) struct Listener {
    socket: Listening,
    acceptor: Option<TlsAcceptor>,
    pool: Arc<Pool>,
}

impl Listener {
    /// `most` connections at once may have shown a secret; with an acceptor all are encrypted.
    pub(super) fn new(socket: Listening, acceptor: Option<TlsAcceptor>, most: usize) -> Self {
        Self { socket, acceptor, pool: Arc::new(Pool::new(most)) }
    }
}

impl axum::serve::Listener for Listener {
    type Io = Secured;
    type Addr = IpAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        loop {
            match self.socket.accept().await {
                Ok(accepted) => {
                    let address = accepted.address;
                    let connection = Connection::enter(&self.pool, address);
                    let stream = TimedStream::new(accepted, connection);
                    return (Secured::new(stream, self.acceptor.as_ref()), address);
                }
                // Out of file descriptors, or a connection that was gone before it was taken: try
                // again a little later.
                Err(_) => tokio::time::sleep(Duration::from_millis(100)).await,
            }
        }
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

impl Connected<IncomingStream<'_, Listener>> for Connection {
    fn connect_info(stream: IncomingStream<'_, Listener>) -> Self {
        stream.io().connection.clone()
    }
}
