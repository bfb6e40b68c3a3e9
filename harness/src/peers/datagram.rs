//! Transports of the kernel: Unix datagrams, UDP over the loopback, pipes.
//!
//! Polled, an attempt is one non-blocking system call; woken, it is one blocking call.

use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, UdpSocket};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixDatagram;
use std::path::Path;

use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use shm_schema::monotonic_ns;

use super::echo::STOP;
use super::{ANSWER_BYTES, ANSWER_WITHIN, COMMAND_BYTES, RoundTrip, WakeMode, poll, seq_of};
use crate::child::ChildGuard;

/// An endpoint that sends and receives messages.
trait MessageEndpoint {
    fn send(&mut self, message: &[u8]) -> io::Result<usize>;
    fn receive(&mut self, message: &mut [u8]) -> io::Result<usize>;
    fn wake_mode(&self) -> WakeMode;

    /// The next message, complete; `None` on a time-out or an error.
    fn next(&mut self, message: &mut [u8]) -> Option<()> {
        let way = self.wake_mode();
        let mut broken = false;
        let found = poll(|| match self.receive(message) {
            Ok(n) if n == message.len() => Some(()),
            Err(e) if way == WakeMode::Poll && e.kind() == ErrorKind::WouldBlock => None,
            Err(e) if e.kind() == ErrorKind::Interrupted => None,
            // Any other result: time-out of a blocking call, closed peer, incomplete message.
            _ => {
                broken = true;
                Some(())
            }
        });
        found.filter(|()| !broken)
    }

    fn exchange(&mut self, seq: u64) -> Option<u64> {
        let (mut command, mut answer) = ([1; COMMAND_BYTES], [0; ANSWER_BYTES]);
        command[..8].copy_from_slice(&seq.to_le_bytes());
        let since_ns = monotonic_ns();
        self.send(&command).ok()?;
        loop {
            self.next(&mut answer)?;
            if seq_of(std::hint::black_box(&answer)) == Some(seq) {
                return Some(monotonic_ns() - since_ns);
            }
        }
    }

    /// Answers each message until the last one; a pause of [`ANSWER_WITHIN`] does not end it.
    fn answer_all(&mut self) {
        let (mut command, mut answer) = ([0; COMMAND_BYTES], [2; ANSWER_BYTES]);
        let mut timeouts = 0;
        while timeouts < TIMEOUTS_MAX {
            if self.next(&mut command).is_none() {
                timeouts += 1;
                continue;
            }
            timeouts = 0;
            let seq = seq_of(std::hint::black_box(&command)).unwrap_or(STOP);
            answer[..8].copy_from_slice(&seq.to_le_bytes());
            let sent = self.send(&answer);
            if seq == STOP || sent.is_err() {
                return;
            }
        }
    }
}

/// Number of pauses after which the other side is taken as gone.
const TIMEOUTS_MAX: u32 = 30;

/// Unix datagrams.
pub(crate) struct Unix(UnixDatagram, WakeMode);

impl Unix {
    /// A socket with this name; its peer may not exist yet.
    pub(crate) fn new(dir: &Path, name: &str) -> io::Result<Self> {
        let path = dir.join(format!("{name}.unix"));
        let _ = std::fs::remove_file(&path);
        let socket = UnixDatagram::bind(path)?;
        socket.set_read_timeout(Some(ANSWER_WITHIN))?;
        Ok(Self(socket, WakeMode::Wake))
    }

    pub(crate) fn connect(&self, dir: &Path, peer: &str) -> io::Result<()> {
        self.0.connect(dir.join(format!("{peer}.unix")))
    }

    pub(crate) fn wait(&mut self, way: WakeMode) -> io::Result<()> {
        self.1 = way;
        self.0.set_nonblocking(way == WakeMode::Poll)
    }

    pub(crate) fn answer(&mut self, dir: &Path) {
        // Its peer's socket exists by now.
        if self.connect(dir, "here").is_ok() {
            self.answer_all();
        }
    }
}

impl MessageEndpoint for Unix {
    fn send(&mut self, message: &[u8]) -> io::Result<usize> {
        self.0.send(message)
    }
    fn receive(&mut self, message: &mut [u8]) -> io::Result<usize> {
        self.0.recv(message)
    }
    fn wake_mode(&self) -> WakeMode {
        self.1
    }
}

/// UDP over the loopback.
pub(crate) struct Udp(UdpSocket, WakeMode);

impl Udp {
    pub(crate) fn new() -> io::Result<Self> {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        socket.set_read_timeout(Some(ANSWER_WITHIN))?;
        Ok(Self(socket, WakeMode::Wake))
    }

    pub(crate) fn port(&self) -> io::Result<u16> {
        Ok(self.0.local_addr()?.port())
    }

    pub(crate) fn connect(&self, port: u16) -> io::Result<()> {
        self.0.connect((Ipv4Addr::LOCALHOST, port))
    }

    pub(crate) fn wait(&mut self, way: WakeMode) -> io::Result<()> {
        self.1 = way;
        self.0.set_nonblocking(way == WakeMode::Poll)
    }

    pub(crate) fn answer(&mut self) {
        self.answer_all();
    }
}

impl MessageEndpoint for Udp {
    fn send(&mut self, message: &[u8]) -> io::Result<usize> {
        self.0.send(message)
    }
    fn receive(&mut self, message: &mut [u8]) -> io::Result<usize> {
        self.0.recv(message)
    }
    fn wake_mode(&self) -> WakeMode {
        self.1
    }
}

/// Two pipes, one per direction: messages are shorter than an atomic write to a pipe.
pub(crate) struct Pipes {
    out: File,
    back: File,
    way: WakeMode,
}

impl Pipes {
    /// The bench's ends: standard input and output of the process.
    pub(crate) fn of(process: &mut ChildGuard) -> io::Result<Self> {
        let broken_pipe = || io::Error::from(ErrorKind::BrokenPipe);
        let out = OwnedFd::from(process.0.stdin.take().ok_or_else(broken_pipe)?);
        let back = OwnedFd::from(process.0.stdout.take().ok_or_else(broken_pipe)?);
        Ok(Self { out: out.into(), back: back.into(), way: WakeMode::Wake })
    }

    /// The ends of the process itself.
    pub(crate) fn inherited() -> io::Result<Self> {
        let back = std::io::stdin().as_fd().try_clone_to_owned()?;
        let out = std::io::stdout().as_fd().try_clone_to_owned()?;
        Ok(Self { out: out.into(), back: back.into(), way: WakeMode::Wake })
    }

    pub(crate) fn wait(&mut self, way: WakeMode) -> io::Result<()> {
        self.way = way;
        let flags = fcntl_getfl(&self.back)?;
        let wanted =
            if way == WakeMode::Poll { flags | OFlags::NONBLOCK } else { flags - OFlags::NONBLOCK };
        Ok(fcntl_setfl(&self.back, wanted)?)
    }

    pub(crate) fn answer(&mut self) {
        self.answer_all();
    }
}

impl MessageEndpoint for Pipes {
    fn send(&mut self, message: &[u8]) -> io::Result<usize> {
        self.out.write(message)
    }
    fn receive(&mut self, message: &mut [u8]) -> io::Result<usize> {
        self.back.read(message)
    }
    fn wake_mode(&self) -> WakeMode {
        self.way
    }
}

impl RoundTrip for Unix {
    fn round_trip(&mut self, seq: u64) -> Option<u64> {
        self.exchange(seq)
    }
}

impl RoundTrip for Udp {
    fn round_trip(&mut self, seq: u64) -> Option<u64> {
        self.exchange(seq)
    }
}

impl RoundTrip for Pipes {
    fn round_trip(&mut self, seq: u64) -> Option<u64> {
        self.exchange(seq)
    }
}
