//! Notifications to the service manager: ready, watchdog, stopping (`sd_notify(3)`; one datagram each).
//!
//! The watchdog is triggered only while the cycles of all running cells have advanced since the
//! last time; stopping is sent when the last cell ends; without a service manager nothing happens.
//! It never waits and receives nothing.

use std::ffi::OsStr;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::{Duration, Instant};
use tracing::warn;

/// The service manager that started this process, if any.
#[derive(Debug)]
pub struct ServiceManager {
    to: Option<(UnixDatagram, SocketAddr)>,
    /// The watchdog's time limit.
    watchdog: Option<Duration>,
    triggered_at: Instant,
    cells: Vec<CellState>,
}

/// Last state of a cell.
#[derive(Clone, Debug, Default)]
struct CellState {
    /// Iterations of its cycle: now, and when the watchdog was last triggered.
    iterations: u64,
    iterations_at_trigger: u64,
    /// One line for users.
    summary: String,
    has_ended: bool,
}

impl ServiceManager {
    /// From this process's environment (`NOTIFY_SOCKET`, `WATCHDOG_USEC`, `WATCHDOG_PID`), for a
    /// number of cells.
    #[must_use]
    pub fn from_environment(cells: usize) -> Self {
        let variable = |key: &str| std::env::var(key).ok();
        let ours = variable("WATCHDOG_PID").is_none_or(|pid| pid.parse() == Ok(std::process::id()));
        let microseconds = variable("WATCHDOG_USEC").and_then(|us| us.parse().ok());
        let patience = microseconds.filter(|us| ours && *us > 0).map(Duration::from_micros);
        Self::with_socket(std::env::var_os("NOTIFY_SOCKET").as_deref(), patience, cells)
    }

    /// The manager at this socket: a path, or an abstract name after an `@`.
    #[must_use]
    pub fn with_socket(socket: Option<&OsStr>, watchdog: Option<Duration>, cells: usize) -> Self {
        let address = socket.map(|name| match name.as_bytes() {
            [b'@', name @ ..] => SocketAddr::from_abstract_name(name),
            _ => SocketAddr::from_pathname(name),
        });
        let to = address.map(|address| Ok((UnixDatagram::unbound()?, address?)));
        let to = to.transpose().inspect_err(|why: &std::io::Error| {
            warn!(%why, "the service manager cannot be notified: NOTIFY_SOCKET");
        });
        Self {
            to: to.ok().flatten(),
            watchdog,
            triggered_at: Instant::now(),
            cells: vec![CellState::default(); cells],
        }
    }

    /// The daemon is ready.
    pub fn ready(&self) {
        self.send(&format!("READY=1\nSTATUS={}", self.status_text()));
    }

    /// Cell `place` is alive. The manager is notified two to three times within the watchdog's time
    /// limit, and only if `turns`, counted by the cycle, has changed in every cell. `words` is one
    /// line for users.
    pub fn report_alive(&mut self, place: usize, turns: u64, summary: &str) {
        let Some(cell) = self.cells.get_mut(place) else { return };
        cell.iterations = turns;
        summary.clone_into(&mut cell.summary);
        let Some(patience) = self.watchdog else { return };
        let is_stalled = self
            .cells
            .iter()
            .any(|cell| !cell.has_ended && cell.iterations == cell.iterations_at_trigger);
        if is_stalled || self.triggered_at.elapsed() < patience / 3 {
            return;
        }
        self.triggered_at = Instant::now();
        self.cells.iter_mut().for_each(|cell| cell.iterations_at_trigger = cell.iterations);
        self.send(&format!("WATCHDOG=1\nSTATUS={}", self.status_text()));
    }

    fn status_text(&self) -> String {
        let all: Vec<_> = self.cells.iter().map(|cell| one_line(&cell.summary)).collect();
        all.join("; ")
    }

    /// Cell `place` has ended. The manager is notified when all have.
    pub fn ended(&mut self, place: usize) {
        let Some(cell) = self.cells.get_mut(place) else { return };
        let is_news = !std::mem::replace(&mut cell.has_ended, true);
        if is_news && self.cells.iter().all(|cell| cell.has_ended) {
            self.stopping();
        }
    }

    /// The process ends.
    pub fn stopping(&self) {
        self.send("STOPPING=1");
    }

    fn send(&self, message: &str) {
        let Some((socket, address)) = &self.to else { return };
        // A manager that has terminated or lags does not affect the cell; a manager acts when the
        // notifications stop.
        let _ = socket.set_nonblocking(true);
        let _ = socket.send_to_addr(message.as_bytes(), address);
    }
}

/// Replaces line ends, which would cut the message or form another assignment.
fn one_line(text: &str) -> String {
    text.replace(['\n', '\r'], " ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn received(manager: &UnixDatagram) -> Option<String> {
        let mut bytes = [0; 512];
        let length = manager.recv(&mut bytes).ok()?;
        Some(String::from_utf8_lossy(&bytes[..length]).into_owned())
    }

    fn manager(name: &str, patience: Duration, cells: usize) -> (UnixDatagram, ServiceManager) {
        let name = format!("trued-notify-{}-{name}", std::process::id());
        let address = SocketAddr::from_abstract_name(&name).unwrap();
        let socket = UnixDatagram::bind_addr(&address).unwrap();
        socket.set_nonblocking(true).unwrap();
        (
            socket,
            ServiceManager::with_socket(
                Some(OsStr::new(&format!("@{name}"))),
                Some(patience),
                cells,
            ),
        )
    }

    #[test]
    fn a_stopped_cycle_does_not_trigger_the_watchdog() {
        let (socket, mut daemon) = manager("stands", Duration::from_nanos(3), 1);
        daemon.report_alive(0, 0, "ready");
        daemon.ready();
        assert_eq!(received(&socket).unwrap(), "READY=1\nSTATUS=ready");
        for turns in 1..=3 {
            daemon.report_alive(0, turns, "it\nruns");
            assert_eq!(received(&socket).unwrap(), "WATCHDOG=1\nSTATUS=it runs");
            daemon.report_alive(0, turns, "it runs");
            assert_eq!(received(&socket), None, "the cycle has not gone on");
        }
        daemon.ended(0);
        assert_eq!(received(&socket).unwrap(), "STOPPING=1");
    }

    #[test]
    fn the_end_is_reported_once_when_the_last_cell_ends() {
        let (socket, mut daemon) = manager("ends", Duration::from_nanos(3), 3);
        daemon.ended(1);
        daemon.ended(1);
        daemon.ended(0);
        assert_eq!(received(&socket), None, "a cell is left");
        daemon.report_alive(2, 1, "c runs");
        assert_eq!(received(&socket).unwrap(), "WATCHDOG=1\nSTATUS=; ; c runs");
        daemon.ended(2);
        daemon.ended(2);
        assert_eq!(received(&socket).unwrap(), "STOPPING=1");
        assert_eq!(received(&socket), None);
    }

    #[test]
    fn one_stopped_cycle_of_several_does_not_trigger_the_watchdog() {
        let (socket, mut daemon) = manager("several", Duration::from_nanos(3), 2);
        (1..100).for_each(|turns| daemon.report_alive(0, turns, "a runs"));
        assert_eq!(received(&socket), None, "the second has not gone on");
        daemon.report_alive(1, 1, "b runs");
        assert_eq!(received(&socket).unwrap(), "WATCHDOG=1\nSTATUS=a runs; b runs");
        (1..100).for_each(|_| daemon.report_alive(1, 1, "b stands"));
        daemon.report_alive(0, 101, "a runs");
        assert_eq!(received(&socket), None, "the second stands");
    }

    #[test]
    fn the_watchdog_is_not_fed_more_often_than_it_needs() {
        let (socket, mut daemon) = manager("often", Duration::from_secs(3600), 1);
        (1..1000).for_each(|turns| daemon.report_alive(0, turns, ""));
        assert_eq!(received(&socket), None);
    }

    #[test]
    fn without_a_manager_nothing_happens() {
        let patience = Some(Duration::from_nanos(1));
        let mut alone = ServiceManager::with_socket(None, patience, 1);
        alone.ready();
        alone.report_alive(0, 1, "");
        let mut without_manager =
            ServiceManager::with_socket(Some(OsStr::new("/nowhere/at/all")), patience, 1);
        without_manager.report_alive(0, 1, "");
        without_manager.stopping();
    }
}
