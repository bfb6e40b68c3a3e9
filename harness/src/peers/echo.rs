//! The echo process for reference transports: plain transport, datagrams, pipes. Contains both ends.
//!
//! The bench sends it commands over a stream (`unix poll`, `end`); it replies `ready`, answers each
//! message, and reads the next command after a message with the number [`STOP`]. It ends with its
//! parent, and has the same core and policy as the daemon's cycle. It uses nothing of trued.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::process::{Signal, set_parent_process_death_signal};

use super::datagram::{self, Pipes};
use super::plain::PlainIpc;
use super::{RoundTrip, Transport, WakeMode};
use crate::ARGUMENT_SEPARATOR;
use crate::bench_directory::BenchDirectory;
use crate::child::ChildGuard;
use crate::error::BenchError;
use crate::plan::{Policy, Programs};
use crate::thread_settings::ThreadSettings;

/// The number of the message that ends a chunk.
pub(crate) const STOP: u64 = u64::MAX;
/// Time limit for the process to start, or to get ready.
const WITHIN: Duration = Duration::from_secs(10);

/// The bench's side.
pub(crate) struct Echo {
    control: BufReader<UnixStream>,
    pipes: Pipes,
    unix: datagram::Unix,
    udp: datagram::Udp,
    plain: PlainIpc,
    /// Dropped last: the others depend on its pipes.
    _process: ChildGuard,
}

impl Echo {
    /// Starts the process; the calling thread measures.
    pub(crate) fn start(
        programs: &dyn Programs,
        place: &BenchDirectory,
        thread_settings: ThreadSettings,
    ) -> Result<Self, BenchError> {
        let control = place.path("control");
        let io = |e| BenchError::io("listen at", &control, e);
        let _ = std::fs::remove_file(&control);
        let listener = UnixListener::bind(&control).map_err(io)?;
        listener.set_nonblocking(true).map_err(io)?;
        let ThreadSettings { core, policy, priority } = thread_settings;
        let dir = place.dir().to_string_lossy();
        let (core, priority) = (core.to_string(), priority.to_string());
        let arguments = ["echo", &dir, &core, policy.name(), &priority].join(ARGUMENT_SEPARATOR);
        let command = programs.part(&arguments).map_err(failed)?;
        let mut process = ChildGuard::spawn_piped(command).map_err(failed)?;
        let pipes = Pipes::of(&mut process).map_err(failed)?;
        let mut control = BufReader::new(accept(&listener, &mut process)?);
        let unix = datagram::Unix::new(place.dir(), "here").map_err(failed)?;
        let udp = datagram::Udp::new().map_err(failed)?;
        write_line(&mut control, &format!("port {}", udp.port().map_err(failed)?))?;
        let reply = read_line(&mut control)?;
        let port = reply.strip_prefix("port ").and_then(|port| port.parse().ok());
        udp.connect(port.ok_or_else(|| failed(&reply))?).map_err(failed)?;
        unix.connect(place.dir(), "there").map_err(failed)?;
        let plain = PlainIpc::open(place.dir())?;
        Ok(Self { control, pipes, unix, udp, plain, _process: process })
    }

    /// Starts an answering endpoint, and returns the asking one.
    pub(crate) fn begin(
        &mut self,
        kind: Transport,
        way: WakeMode,
    ) -> Result<&mut dyn RoundTrip, BenchError> {
        let how = if way == WakeMode::Poll { "poll" } else { "wake" };
        write_line(&mut self.control, &format!("{} {how}", kind.name()))?;
        let reply = read_line(&mut self.control)?;
        if reply != "ready" {
            return Err(failed(reply));
        }
        match kind {
            Transport::Unix => self.unix.wait(way).map_err(failed)?,
            Transport::Udp => self.udp.wait(way).map_err(failed)?,
            Transport::Pipe => self.pipes.wait(way).map_err(failed)?,
            _ => self.plain.wait(way),
        }
        Ok(self.end_of(kind))
    }

    /// Ends what [`Self::begin`] started.
    pub(crate) fn end(&mut self, kind: Transport) {
        // The stop message is answered too, which confirms its arrival; a loss shows at the next
        // `begin`.
        let _ = self.end_of(kind).round_trip(STOP);
    }

    fn end_of(&mut self, kind: Transport) -> &mut dyn RoundTrip {
        match kind {
            Transport::Unix => &mut self.unix,
            Transport::Udp => &mut self.udp,
            Transport::Pipe => &mut self.pipes,
            _ => &mut self.plain,
        }
    }
}

impl Drop for Echo {
    fn drop(&mut self) {
        // A process that has ended does not read.
        let _ = write_line(&mut self.control, "end");
        let _ = read_line(&mut self.control);
    }
}

fn accept(listener: &UnixListener, process: &mut ChildGuard) -> Result<UnixStream, BenchError> {
    let since = Instant::now();
    loop {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false).map_err(failed)?;
                stream.set_read_timeout(Some(WITHIN)).map_err(failed)?;
                return Ok(stream);
            }
            Err(e) if e.kind() != std::io::ErrorKind::WouldBlock => return Err(failed(e)),
            Err(_) => {}
        }
        if let Some(status) = process.try_exit_status() {
            return Err(failed(format!("it ended with {status}")));
        }
        if since.elapsed() > WITHIN {
            return Err(failed("no connection"));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn failed(why: impl std::fmt::Display) -> BenchError {
    BenchError::part("echo", format!("{why}"))
}

fn write_line(control: &mut BufReader<UnixStream>, line: &str) -> Result<(), BenchError> {
    control.get_mut().write_all(format!("{line}\n").as_bytes()).map_err(failed)
}

fn read_line(control: &mut BufReader<UnixStream>) -> Result<String, BenchError> {
    let mut line = String::new();
    control.read_line(&mut line).map_err(failed)?;
    if line.is_empty() {
        Err(failed("the connection was closed"))
    } else {
        Ok(line.trim().to_owned())
    }
}

/// The process itself: answers until it receives `end`.
pub(crate) fn run_echo(arguments: &[&str]) -> Result<(), BenchError> {
    // Without this signal a killed parent does not end the process: it ends when its stream closes.
    let _ = set_parent_process_death_signal(Some(Signal::KILL));
    let (dir, thread_settings) = parsed(arguments).ok_or_else(|| failed("arguments"))?;
    let stream = UnixStream::connect(dir.join("control")).map_err(failed)?;
    let mut control = BufReader::new(stream);
    if thread_settings.policy == Policy::Fifo {
        daemon::realtime::lock_memory()?;
    }
    let mut unix = datagram::Unix::new(dir, "there").map_err(failed)?;
    let mut udp = datagram::Udp::new().map_err(failed)?;
    let mut plain = PlainIpc::create(dir)?;
    let mut pipes = Pipes::inherited().map_err(failed)?;
    thread_settings.apply()?;
    let reply = read_line(&mut control)?;
    let port = reply.strip_prefix("port ").and_then(|port| port.parse().ok());
    udp.connect(port.ok_or_else(|| failed(&reply))?).map_err(failed)?;
    write_line(&mut control, &format!("port {}", udp.port().map_err(failed)?))?;
    loop {
        let task = read_line(&mut control)?;
        let (kind, how) = task.split_once(' ').unwrap_or((task.as_str(), ""));
        let way = if how == "wake" { WakeMode::Wake } else { WakeMode::Poll };
        match kind {
            "unix" => unix.wait(way).map_err(failed)?,
            "udp" => udp.wait(way).map_err(failed)?,
            "pipe" => pipes.wait(way).map_err(failed)?,
            "iceoryx2" => plain.wait(way),
            _ => return write_line(&mut control, "gone"),
        }
        write_line(&mut control, "ready")?;
        match kind {
            "unix" => unix.answer(dir),
            "udp" => udp.answer(),
            "pipe" => pipes.answer(),
            _ => plain.answer(),
        }
    }
}

fn parsed<'a>(arguments: &[&'a str]) -> Option<(&'a Path, ThreadSettings)> {
    let &[dir, core, policy, priority] = arguments else { return None };
    let policy = if policy == Policy::Fifo.name() { Policy::Fifo } else { Policy::Other };
    let thread_settings =
        ThreadSettings { core: core.parse().ok()?, policy, priority: priority.parse().ok()? };
    Some((Path::new(dir), thread_settings))
}
