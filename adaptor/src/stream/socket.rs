//! The sockets that a server may listen on: an address of the network, or a path of this machine.

use std::{
    io,
    net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener},
    path::{Path, PathBuf},
};

use tokio::net::TcpStream;
use tombolo_pipelines::language::Listen;

use crate::dial::Stream;

/// Where a server listens, once it does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Place {
    Address(SocketAddr),
    Socket(PathBuf),
}

/// A listening socket.
pub(super) enum Socket {
    Tcp(TcpListener),
    #[cfg(unix)]
    Unix {
        socket: std::os::unix::net::UnixListener,
        _file: SocketFile,
    },
}

/// The file of a socket, which goes with it.
pub(super) struct SocketFile(PathBuf);

impl Drop for SocketFile {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

impl Socket {
    /// Listens. A socket on a path can be reached by its owner alone (mode 0600), from the moment it
    /// is there; one that nobody listens on any more makes way.
    pub(super) fn bind(wanted: &Listen) -> io::Result<(Self, Place)> {
        match wanted {
            Listen::Address(address) => {
                let (socket, address) = Self::bind_address(*address)?;
                Ok((socket, Place::Address(address)))
            }
            Listen::Socket(path) => bind_path(path),
        }
    }

    /// Listens on an address of the network.
    pub(super) fn bind_address(address: SocketAddr) -> io::Result<(Self, SocketAddr)> {
        let socket = TcpListener::bind(address)?;
        let address = socket.local_addr()?;
        socket.set_nonblocking(true)?;
        Ok((Self::Tcp(socket), address))
    }

    /// The same socket, for the server's runtime.
    pub(super) fn listener(&self) -> io::Result<Listening> {
        match self {
            Self::Tcp(socket) => {
                tokio::net::TcpListener::from_std(socket.try_clone()?).map(Listening::Tcp)
            }
            #[cfg(unix)]
            Self::Unix { socket, .. } => {
                tokio::net::UnixListener::from_std(socket.try_clone()?).map(Listening::Unix)
            }
        }
    }
}

#[cfg(unix)]
fn bind_path(path: &Path) -> io::Result<(Socket, Place)> {
    use std::os::unix::{
        fs::{DirBuilderExt, FileTypeExt, PermissionsExt},
        net::{UnixListener, UnixStream},
    };
    let path = std::path::absolute(path)?;
    if UnixStream::connect(&path).is_ok() {
        return Err(io::ErrorKind::AddrInUse.into());
    }
    match std::fs::symlink_metadata(&path) {
        Ok(file) if !file.file_type().is_socket() => {
            return Err(io::Error::other("there is another file of this name"));
        }
        _ => {}
    }
    // Made where nobody else gets in, and moved when nobody else can connect.
    let folder = path.with_extension(format!("{}.new", std::process::id()));
    std::fs::DirBuilder::new().mode(0o700).create(&folder)?;
    let made = folder.join("s");
    let listening = UnixListener::bind(&made).and_then(|socket| {
        std::fs::set_permissions(&made, PermissionsExt::from_mode(0o600))?;
        std::fs::rename(&made, &path)?;
        socket.set_nonblocking(true)?;
        Ok(socket)
    });
    let _ = std::fs::remove_file(&made);
    let _ = std::fs::remove_dir(&folder);
    let socket = Socket::Unix { socket: listening?, _file: SocketFile(path.clone()) };
    Ok((socket, Place::Socket(path)))
}

#[cfg(not(unix))]
fn bind_path(_: &Path) -> io::Result<(Socket, Place)> {
    Err(io::Error::new(io::ErrorKind::Unsupported, "this system has no such sockets"))
}

/// A listening socket of the server's runtime.
pub(super) enum Listening {
    Tcp(tokio::net::TcpListener),
    #[cfg(unix)]
    Unix(tokio::net::UnixListener),
}

/// A connection, its number in the system, and the address that it comes from: the machine's own for
/// one through a path.
pub(super) struct Accepted {
    pub(super) stream: Box<dyn Stream>,
    #[cfg(unix)]
    pub(super) descriptor: std::os::fd::RawFd,
    pub(super) address: IpAddr,
}

/// Bytes that the system may hold for a client: frames that lie there are not the newest when they
/// are read.
const SEND_BUFFER: usize = 64 << 10;
/// Of these, bytes that are not on their way yet when more are asked for.
#[cfg(target_os = "linux")]
const UNSENT: u32 = 16 << 10;

/// How long the network of a client may leave unacknowledged what it was sent before its connection
/// ends. Pings, one every [`super::PING_PERIOD`], are sent also where there is nothing else.
#[cfg(target_os = "linux")]
const UNACKNOWLEDGED: std::time::Duration = std::time::Duration::from_secs(30);

impl Listening {
    pub(super) async fn accept(&self) -> io::Result<Accepted> {
        match self {
            Self::Tcp(socket) => {
                let (stream, address) = socket.accept().await?;
                hold_little(&stream);
                Ok(Accepted {
                    #[cfg(unix)]
                    descriptor: std::os::fd::AsRawFd::as_raw_fd(&stream),
                    stream: Box::new(stream),
                    address: address.ip().to_canonical(),
                })
            }
            #[cfg(unix)]
            Self::Unix(socket) => {
                let (stream, _) = socket.accept().await?;
                let _ = socket2::SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER);
                Ok(Accepted {
                    descriptor: std::os::fd::AsRawFd::as_raw_fd(&stream),
                    stream: Box::new(stream),
                    address: Ipv4Addr::LOCALHOST.into(),
                })
            }
        }
    }
}

/// Small messages (an order's outcome) do not wait for more bytes, and little lies in the system's
/// buffers; a client whose network is gone loses its connection. A socket that cannot be set so works too.
pub(super) fn hold_little(stream: &TcpStream) {
    let _ = stream.set_nodelay(true);
    let settings = socket2::SockRef::from(stream);
    let _ = settings.set_send_buffer_size(SEND_BUFFER);
    #[cfg(target_os = "linux")]
    {
        let _ = settings.set_tcp_notsent_lowat(UNSENT);
        let _ = settings.set_tcp_user_timeout(Some(UNACKNOWLEDGED));
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_network_that_is_gone_ends_a_connection_in_time() {
        let socket = tokio::net::TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = socket.local_addr().expect("an address");
        let _client = TcpStream::connect(address).await.expect("connected");
        let (stream, _) = socket.accept().await.expect("accepted");
        hold_little(&stream);
        let time = socket2::SockRef::from(&stream).tcp_user_timeout().expect("told");
        assert_eq!(time, Some(UNACKNOWLEDGED));
    }
}
