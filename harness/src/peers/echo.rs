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
use super::plain::Plain;
use super::{Kind, Peer, Way};
use crate::BETWEEN_WORDS;
use crate::child::Guarded;
use crate::error::BenchError;
use crate::place::Place;
use crate::plan::{Policy, Programs};
use crate::thread_settings::ThreadSettings;

/// The number of the message that ends a chunk.
pub(crate) const STOP: u64 = u64::MAX;
/// Time limit for the process to start, or to get ready.
const WITHIN: Duration = Duration::from_secs(10);

/// The bench's side.
pub(crate) struct Echo {
    words: BufReader<UnixStream>,
    pipes: Pipes,
    unix: datagram::Unix,
    udp: datagram::Udp,
    plain: Plain,
    /// Dropped last: the others depend on its pipes.
    _process: Guarded,
}

impl Echo {
    /// Starts the process; the calling thread measures.
    pub(crate) fn start(
        programs: &dyn Programs,
        place: &Place,
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
        let words = ["echo", &dir, &core, policy.name(), &priority].join(BETWEEN_WORDS);
        let command = programs.part(&words).map_err(failed)?;
        let mut process = Guarded::spawn_piped(command).map_err(failed)?;
        let pipes = Pipes::of(&mut process).map_err(failed)?;
        let mut words = BufReader::new(accept(&listener, &mut process)?);
        let unix = datagram::Unix::new(place.dir(), "here").map_err(failed)?;
        let udp = datagram::Udp::new().map_err(failed)?;
        tell(&mut words, &format!("port {}", udp.port().map_err(failed)?))?;
        let told = hear(&mut words)?;
        let port = told.strip_prefix("port ").and_then(|port| port.parse().ok());
        udp.connect(port.ok_or_else(|| failed(&told))?).map_err(failed)?;
        unix.connect(place.dir(), "there").map_err(failed)?;
        let plain = Plain::open(place.dir())?;
        Ok(Self { words, pipes, unix, udp, plain, _process: process })
    }

    /// Starts an answering endpoint, and returns the asking one.
    pub(crate) fn begin(&mut self, kind: Kind, way: Way) -> Result<&mut dyn Peer, BenchError> {
        let how = if way == Way::Poll { "poll" } else { "wake" };
        tell(&mut self.words, &format!("{} {how}", kind.name()))?;
        let told = hear(&mut self.words)?;
        if told != "ready" {
            return Err(failed(told));
        }
        match kind {
            Kind::Unix => self.unix.wait(way).map_err(failed)?,
            Kind::Udp => self.udp.wait(way).map_err(failed)?,
            Kind::Pipe => self.pipes.wait(way).map_err(failed)?,
            _ => self.plain.wait(way),
        }
        Ok(self.end_of(kind))
    }

    /// Ends what [`Self::begin`] started.
    pub(crate) fn end(&mut self, kind: Kind) {
        // The stop message is answered too, which confirms its arrival; a loss shows at the next
        // `begin`.
        let _ = self.end_of(kind).round_trip(STOP);
    }

    fn end_of(&mut self, kind: Kind) -> &mut dyn Peer {
        match kind {
            Kind::Unix => &mut self.unix,
            Kind::Udp => &mut self.udp,
            Kind::Pipe => &mut self.pipes,
            _ => &mut self.plain,
        }
    }
}

impl Drop for Echo {
    fn drop(&mut self) {
        // A process that has ended does not read.
        let _ = tell(&mut self.words, "end");
        let _ = hear(&mut self.words);
    }
}

fn accept(listener: &UnixListener, process: &mut Guarded) -> Result<UnixStream, BenchError> {
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
        if let Some(status) = process.ended() {
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

fn tell(words: &mut BufReader<UnixStream>, line: &str) -> Result<(), BenchError> {
    words.get_mut().write_all(format!("{line}\n").as_bytes()).map_err(failed)
}

fn hear(words: &mut BufReader<UnixStream>) -> Result<String, BenchError> {
    let mut line = String::new();
    words.read_line(&mut line).map_err(failed)?;
    if line.is_empty() {
        Err(failed("the connection was closed"))
    } else {
        Ok(line.trim().to_owned())
    }
}

/// The process itself: answers until it receives `end`.
pub(crate) fn answer(arguments: &[&str]) -> Result<(), BenchError> {
    // Without this signal a killed parent does not end the process: it ends when its stream closes.
    let _ = set_parent_process_death_signal(Some(Signal::KILL));
    let (dir, thread_settings) = parsed(arguments).ok_or_else(|| failed("arguments"))?;
    let stream = UnixStream::connect(dir.join("control")).map_err(failed)?;
    let mut words = BufReader::new(stream);
    if thread_settings.policy == Policy::Fifo {
        daemon::realtime::lock_memory()?;
    }
    let mut unix = datagram::Unix::new(dir, "there").map_err(failed)?;
    let mut udp = datagram::Udp::new().map_err(failed)?;
    let mut plain = Plain::create(dir)?;
    let mut pipes = Pipes::inherited().map_err(failed)?;
    thread_settings.take()?;
    let told = hear(&mut words)?;
    let port = told.strip_prefix("port ").and_then(|port| port.parse().ok());
    udp.connect(port.ok_or_else(|| failed(&told))?).map_err(failed)?;
    tell(&mut words, &format!("port {}", udp.port().map_err(failed)?))?;
    loop {
        let task = hear(&mut words)?;
        let (kind, how) = task.split_once(' ').unwrap_or((task.as_str(), ""));
        let way = if how == "wake" { Way::Wake } else { Way::Poll };
        match kind {
            "unix" => unix.wait(way).map_err(failed)?,
            "udp" => udp.wait(way).map_err(failed)?,
            "pipe" => pipes.wait(way).map_err(failed)?,
            "iceoryx2" => plain.wait(way),
            _ => return tell(&mut words, "gone"),
        }
        tell(&mut words, "ready")?;
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
