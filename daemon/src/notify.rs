//! What a service manager is told: ready, alive, ending (the protocol of `sd_notify(3)`; one datagram each).
//!
//! Promises: the watchdog is fed only while the cycle has gone on since the last time; without a manager nothing happens.
//! Never: a wait, a socket that anyone could send to.

use std::ffi::OsStr;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::{Duration, Instant};
use tracing::warn;

/// The service manager that started this process, where one did.
#[derive(Debug)]
pub struct Manager {
    to: Option<(UnixDatagram, SocketAddr)>,
    /// The watchdog's patience.
    patience: Option<Duration>,
    fed: Instant,
    turns: u64,
}

impl Manager {
    /// As this process's environment names it (`NOTIFY_SOCKET`, `WATCHDOG_USEC`, `WATCHDOG_PID`).
    #[must_use]
    pub fn of_environment() -> Self {
        let words = |key: &str| std::env::var(key).ok();
        let ours = words("WATCHDOG_PID").is_none_or(|pid| pid.parse() == Ok(std::process::id()));
        let microseconds = words("WATCHDOG_USEC").and_then(|us| us.parse().ok());
        let patience = microseconds.filter(|us| ours && *us > 0).map(Duration::from_micros);
        Self::at(std::env::var_os("NOTIFY_SOCKET").as_deref(), patience)
    }

    /// The manager at that socket: a path, or an abstract name behind an `@`.
    #[must_use]
    pub fn at(socket: Option<&OsStr>, patience: Option<Duration>) -> Self {
        let address = socket.map(|name| match name.as_bytes() {
            [b'@', name @ ..] => SocketAddr::from_abstract_name(name),
            _ => SocketAddr::from_pathname(name),
        });
        let to = address.map(|address| Ok((UnixDatagram::unbound()?, address?)));
        let to = to.transpose().inspect_err(|why: &std::io::Error| {
            warn!(%why, "the service manager cannot be told anything: NOTIFY_SOCKET");
        });
        Self { to: to.ok().flatten(), patience, fed: Instant::now(), turns: 0 }
    }

    /// The daemon serves. `words` are one line for people.
    pub fn ready(&self, words: &str) {
        self.tell(&format!("READY=1\nSTATUS={}", one_line(words)));
    }

    /// The daemon lives: told two to three times within the watchdog's patience, and only where `turns`, which the cycle counts,
    /// has changed.
    pub fn alive(&mut self, turns: u64, words: &str) {
        let Some(patience) = self.patience else { return };
        if turns == self.turns || self.fed.elapsed() < patience / 3 {
            return;
        }
        (self.fed, self.turns) = (Instant::now(), turns);
        self.tell(&format!("WATCHDOG=1\nSTATUS={}", one_line(words)));
    }

    /// The daemon ends.
    pub fn stopping(&self) {
        self.tell("STOPPING=1");
    }

    fn tell(&self, message: &str) {
        let Some((socket, address)) = &self.to else { return };
        // A manager that has gone, or is behind, is not the cell's trouble: it acts where it hears nothing.
        let _ = socket.set_nonblocking(true);
        let _ = socket.send_to_addr(message.as_bytes(), address);
    }
}

/// What a line end would cut in two, or make an order of.
fn one_line(words: &str) -> String {
    words.replace(['\n', '\r'], " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(manager: &UnixDatagram) -> Option<String> {
        let mut bytes = [0; 512];
        let length = manager.recv(&mut bytes).ok()?;
        Some(String::from_utf8_lossy(&bytes[..length]).into_owned())
    }

    fn manager(name: &str, patience: Duration) -> (UnixDatagram, Manager) {
        let name = format!("trued-notify-{}-{name}", std::process::id());
        let address = SocketAddr::from_abstract_name(&name).unwrap();
        let socket = UnixDatagram::bind_addr(&address).unwrap();
        socket.set_nonblocking(true).unwrap();
        (socket, Manager::at(Some(OsStr::new(&format!("@{name}"))), Some(patience)))
    }

    #[test]
    fn a_cycle_that_stands_feeds_no_watchdog() {
        let (socket, mut daemon) = manager("stands", Duration::from_nanos(3));
        daemon.ready("ready");
        assert_eq!(heard(&socket).unwrap(), "READY=1\nSTATUS=ready");
        for turns in 1..=3 {
            daemon.alive(turns, "it\nruns");
            assert_eq!(heard(&socket).unwrap(), "WATCHDOG=1\nSTATUS=it runs");
            daemon.alive(turns, "it runs");
            assert_eq!(heard(&socket), None, "the cycle has not gone on");
        }
        daemon.stopping();
        assert_eq!(heard(&socket).unwrap(), "STOPPING=1");
    }

    #[test]
    fn the_watchdog_is_not_fed_more_often_than_it_needs() {
        let (socket, mut daemon) = manager("often", Duration::from_secs(3600));
        (1..1000).for_each(|turns| daemon.alive(turns, ""));
        assert_eq!(heard(&socket), None);
    }

    #[test]
    fn without_a_manager_nothing_happens() {
        let mut alone = Manager::at(None, Some(Duration::from_nanos(1)));
        alone.ready("");
        alone.alive(1, "");
        let mut gone =
            Manager::at(Some(OsStr::new("/nowhere/at/all")), Some(Duration::from_nanos(1)));
        gone.alive(1, "");
        gone.stopping();
    }
}
