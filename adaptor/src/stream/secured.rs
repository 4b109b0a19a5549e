//! Connections that are encrypted, or not: one type for both.

use std::{
    io,
    pin::Pin,
    task::{Context, Poll, ready},
};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio_rustls::{Accept, TlsAcceptor, server::TlsStream};

use super::connection::{Connection, TimedStream};

/// A connection. One that is encrypted shakes hands when it is first read or written, so that a client
/// which takes its time keeps nobody waiting.
pub(super) struct Secured {
    pub(super) connection: Connection,
    state: State,
}

enum State {
    Plain(TimedStream),
    Shaking(Box<Accept<TimedStream>>),
    Encrypted(Box<TlsStream<TimedStream>>),
    Failed,
}

impl Secured {
    pub(super) fn new(stream: TimedStream, acceptor: Option<&TlsAcceptor>) -> Self {
        let connection = stream.connection().clone();
        let state = match acceptor {
            None => State::Plain(stream),
            Some(acceptor) => State::Shaking(Box::new(acceptor.accept(stream))),
        };
        Self { connection, state }
    }

    /// The stream, once hands were shaken.
    fn poll_open(
        &mut self,
        context: &mut Context<'_>,
    ) -> Poll<io::Result<Pin<&mut dyn super::socket::Stream>>> {
        if let State::Shaking(accept) = &mut self.state {
            self.state = match ready!(Pin::new(accept.as_mut()).poll(context)) {
                Ok(stream) => State::Encrypted(Box::new(stream)),
                Err(error) => {
                    self.state = State::Failed;
                    return Poll::Ready(Err(error));
                }
            };
        }
        Poll::Ready(match &mut self.state {
            State::Plain(stream) => Ok(Pin::new(stream)),
            State::Encrypted(stream) => Ok(Pin::new(stream.as_mut())),
            State::Shaking(_) | State::Failed => Err(io::ErrorKind::NotConnected.into()),
        })
    }
}

impl AsyncRead for Secured {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        ready!(self.get_mut().poll_open(context))?.poll_read(context, buffer)
    }
}

impl AsyncWrite for Secured {
    fn poll_write(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        ready!(self.get_mut().poll_open(context))?.poll_write(context, bytes)
    }

    fn poll_write_vectored(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        slices: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        ready!(self.get_mut().poll_open(context))?.poll_write_vectored(context, slices)
    }

    fn is_write_vectored(&self) -> bool {
        matches!(self.state, State::Plain(_))
    }

    fn poll_flush(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(self.get_mut().poll_open(context))?.poll_flush(context)
    }

    fn poll_shutdown(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(self.get_mut().poll_open(context))?.poll_shutdown(context)
    }
}
