//! Non-blocking datagram sockets, and one wait for all of them.
//!
//! No allocation; a datagram larger than the buffer is discarded.

use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::error::BridgeError;

/// The largest datagram that is read: EGM's and RSI's are below 4 kB.
pub(crate) const DATAGRAM_MAX: usize = 16_384;
/// Largest number of datagrams taken from one socket before the other is checked.
pub(crate) const DRAIN_MAX: usize = 64;

/// A bound non-blocking socket.
pub(crate) fn bind(address: SocketAddr) -> Result<UdpSocket, BridgeError> {
    let socket =
        UdpSocket::bind(address).map_err(|why| BridgeError::Listen { at: address, why })?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

/// Receives a datagram into `buffer`; `None` if there is none.
pub(crate) fn receive(socket: &UdpSocket, buffer: &mut [u8]) -> Option<(usize, SocketAddr)> {
    loop {
        match socket.recv_from(buffer) {
            // A datagram that fills the buffer may have been truncated.
            Ok((length, from)) if length < buffer.len() => return Some((length, from)),
            Ok((_, from)) => return Some((0, from)),
            Err(why) if why.kind() == ErrorKind::Interrupted => {}
            // An absent peer is reported as an error once: the next call receives datagrams again.
            Err(why) if why.kind() == ErrorKind::ConnectionRefused => {}
            Err(_) => return None,
        }
    }
}

/// Waits until one of the sockets has a datagram, at most `limit_ns`.
pub(crate) fn wait(sockets: [Option<&UdpSocket>; 2], limit_ns: u32) {
    let limit = Timespec { tv_sec: 0, tv_nsec: i64::from(limit_ns) };
    // A signal may end the wait early: the caller checks again.
    let _ = match sockets {
        [Some(one), Some(other)] => poll(
            &mut [PollFd::new(one, PollFlags::IN), PollFd::new(other, PollFlags::IN)],
            Some(&limit),
        ),
        [Some(one), None] | [None, Some(one)] => {
            poll(&mut [PollFd::new(one, PollFlags::IN)], Some(&limit))
        }
        [None, None] => Ok(0),
    };
}
