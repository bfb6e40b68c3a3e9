//! The connection: a thread that connects, monitors the daemon, and reconnects.
//!
//! Invariant: the caller only reads a channel; all system calls of connecting and disconnecting are
//! made by the thread. If the role is still held by a dead process, the thread waits; if the epoch cannot be
//! joined for a while although this process holds the role, it requests a new epoch.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use shm_schema::{Announcement, Cell, JoinError, JoinedEpoch, PortError, Role, RoleClaim};

use crate::{ConnectError, DisconnectReason};

/// Interval at which the thread checks the daemon and the epoch.
const WATCH_PERIOD: Duration = Duration::from_millis(20);
/// Interval of attempts to join.
const JOIN_PERIOD: Duration = Duration::from_millis(5);
/// Time of failed attempts after which a new epoch is requested.
pub(crate) const NEW_EPOCH_AFTER: Duration = Duration::from_millis(250);
/// Time limit for the thread to end.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_secs(1);
/// Largest number of events stored for the caller; older ones are dropped.
const EVENTS_MAX: usize = 16;

/// The ports that a role needs.
pub(crate) trait Ports: Sized + Send + 'static {
    const ROLE: Role;
    fn open(joined: &JoinedEpoch) -> Result<Self, PortError>;
}

/// State of the connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Connection {
    /// Joined; the daemon is running.
    Connected {
        /// The daemon's process.
        pid: u32,
        /// Changes with each start of the daemon.
        epoch: u64,
    },
    /// The daemon is gone; the library reconnects automatically.
    Lost,
}

/// A change of the connection.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ConnectionEvent {
    /// Joined a daemon.
    Connected {
        /// The daemon's process.
        pid: u32,
        /// Changes with each start of the daemon.
        epoch: u64,
    },
    /// The daemon is gone or cannot be reached, with the reason.
    Lost {
        /// The reason, for programs.
        disconnect_reason: DisconnectReason,
        /// The reason and the remedy, as text.
        why: String,
    },
}

/// Work for the thread, sent by the caller.
enum LinkTask<P> {
    /// Old ports, to be dropped.
    DropPorts(P),
    /// No answers arrive in this epoch: request a new one.
    RequestNewEpoch,
}

enum LinkUpdate<P> {
    Joined(P, Announcement),
    Lost(JoinError),
}

/// The caller's end of the connection.
pub(crate) struct Link<P: Ports> {
    updates: Receiver<LinkUpdate<P>>,
    /// Old ports are returned to the thread, which drops them; closing this channel ends the thread.
    tasks: Option<Sender<LinkTask<P>>>,
    thread: Option<JoinHandle<()>>,
    ports: Option<P>,
    connection: Connection,
    /// Why there is no connection; valid while disconnected.
    disconnect_reason: DisconnectReason,
    /// Process of the daemon that was joined last; 0 before the first.
    daemon: u32,
    /// Whether that daemon has terminated since.
    daemon_lost: bool,
    /// Connected to a new daemon, which has not been reported yet.
    restarted: bool,
    events: VecDeque<ConnectionEvent>,
}

impl<P: Ports> Link<P> {
    /// Starts the thread and waits for the connection, at most `limit`.
    pub(crate) fn connect(cell: &Cell, limit: Duration) -> Result<Self, ConnectError> {
        let mut link = Self::start(cell)?;
        let start = Instant::now();
        let mut last = None;
        while link.ports.is_none() {
            match link.updates.recv_timeout(limit.saturating_sub(start.elapsed())) {
                Ok(LinkUpdate::Lost(e)) if !e.is_transient() => {
                    return Err(ConnectError::Refused(e));
                }
                Ok(LinkUpdate::Lost(e)) => last = Some(e),
                Ok(joined) => link.apply(joined),
                Err(_) => {
                    let (cell, dir) = (cell.name().to_owned(), cell.dir().into());
                    let last = last.unwrap_or(JoinError::NoDaemon { cell, dir });
                    return Err(ConnectError::TimedOut { limit, last });
                }
            }
        }
        Ok(link)
    }

    fn start(cell: &Cell) -> Result<Self, ConnectError> {
        let (update_sender, updates) = channel();
        let (tasks, task_receiver) = channel();
        let mut keeper = LinkThread {
            role: RoleClaim::new(cell, P::ROLE),
            tell: update_sender,
            tasks: task_receiver,
            joined: None,
            trying_since: None,
            last_reported: None,
        };
        let thread = std::thread::Builder::new()
            .name("trued-link".to_owned())
            .spawn(move || keeper.run())?;
        Ok(Self {
            updates,
            tasks: Some(tasks),
            thread: Some(thread),
            ports: None,
            connection: Connection::Lost,
            disconnect_reason: DisconnectReason::DaemonLost,
            daemon: 0,
            daemon_lost: false,
            restarted: false,
            events: VecDeque::with_capacity(EVENTS_MAX),
        })
    }

    /// Reads the messages of the thread. No system call, and no allocation while nothing changes.
    pub(crate) fn refresh(&mut self) {
        while let Ok(news) = self.updates.try_recv() {
            self.apply(news);
        }
    }

    fn apply(&mut self, news: LinkUpdate<P>) {
        let event = match news {
            LinkUpdate::Joined(ports, Announcement { pid, epoch, .. }) => {
                let old = self.ports.replace(ports);
                self.return_ports(old);
                self.connection = Connection::Connected { pid, epoch };
                // The same process without interruption: the daemon renewed its epoch and kept its state.
                let another = self.daemon_lost || self.daemon != pid;
                self.restarted |= self.daemon != 0 && another;
                (self.daemon, self.daemon_lost) = (pid, false);
                ConnectionEvent::Connected { pid, epoch }
            }
            LinkUpdate::Lost(why) => {
                self.connection = Connection::Lost;
                self.disconnect_reason = DisconnectReason::from(&why);
                self.daemon_lost |= self.disconnect_reason == DisconnectReason::DaemonLost;
                if self.disconnect_reason != DisconnectReason::DaemonLost {
                    // The daemon is running and may be joined again in the same epoch, where the old ports still occupy their places.
                    let old = self.ports.take();
                    self.return_ports(old);
                }
                ConnectionEvent::Lost {
                    disconnect_reason: self.disconnect_reason,
                    why: why.to_string(),
                }
            }
        };
        if self.events.len() == EVENTS_MAX {
            self.events.pop_front();
        }
        self.events.push_back(event);
    }

    /// Passes ports to the thread to be dropped, because dropping makes system calls.
    fn return_ports(&self, old: Option<P>) {
        if let (Some(old), Some(tasks)) = (old, &self.tasks) {
            let _ = tasks.send(LinkTask::DropPorts(old));
        }
    }

    /// Requests a new epoch from the daemon, because no answers arrive in the joined one: the two ends may have mapped different memory of the same name.
    pub(crate) fn request_new_epoch(&self) {
        if let Some(tasks) = &self.tasks {
            let _ = tasks.send(LinkTask::RequestNewEpoch);
        }
    }

    pub(crate) fn connection(&self) -> Connection {
        self.connection
    }

    /// Why there is no connection; `None` while connected.
    pub(crate) fn disconnect_reason(&mut self) -> Option<DisconnectReason> {
        self.refresh();
        (self.connection == Connection::Lost).then_some(self.disconnect_reason)
    }

    pub(crate) fn next_event(&mut self) -> Option<ConnectionEvent> {
        self.refresh();
        self.events.pop_front()
    }

    /// The ports while connected.
    pub(crate) fn ports(&mut self) -> Option<&mut P> {
        self.refresh();
        match self.connection {
            Connection::Connected { .. } => self.ports.as_mut(),
            Connection::Lost => None,
        }
    }

    /// The ports for messages and requests, or the reason why there are none. A restart is reported once.
    pub(crate) fn ports_for_sending(&mut self) -> Result<&mut P, DisconnectReason> {
        self.refresh();
        if self.connection == Connection::Lost {
            return Err(self.disconnect_reason);
        }
        if std::mem::take(&mut self.restarted) {
            return Err(DisconnectReason::DaemonRestarted);
        }
        self.ports.as_mut().ok_or(self.disconnect_reason)
    }
}

impl<P: Ports> Drop for Link<P> {
    fn drop(&mut self) {
        // Ports are dropped first, because the thread releases the role when it ends.
        self.ports = None;
        self.tasks = None;
        // The thread ends within milliseconds, unless it is blocked by an incomplete file of a killed
        // process: then it is detached, and ends once the next daemon has cleaned up.
        let start = Instant::now();
        while self.thread.as_ref().is_some_and(|thread| !thread.is_finished()) {
            if start.elapsed() > SHUTDOWN_TIMEOUT {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The thread that maintains the connection.
struct LinkThread<P: Ports> {
    role: RoleClaim,
    tell: Sender<LinkUpdate<P>>,
    tasks: Receiver<LinkTask<P>>,
    joined: Option<u64>,
    trying_since: Option<(u64, Instant)>,
    /// The last reported error, so that each is reported once.
    last_reported: Option<String>,
}

impl<P: Ports> LinkThread<P> {
    fn run(&mut self) {
        loop {
            let alive = self.check_daemon();
            let period = if self.trying_since.is_some() { JOIN_PERIOD } else { WATCH_PERIOD };
            match self.tasks.recv_timeout(period) {
                Ok(LinkTask::DropPorts(old)) => drop(old),
                Ok(LinkTask::RequestNewEpoch) => {
                    if let Some(epoch) = self.joined {
                        self.role.request_new_epoch(epoch);
                    }
                }
                Err(RecvTimeoutError::Timeout) if alive => {}
                Err(_) => return,
            }
        }
    }

    /// Checks the daemon once; false if the caller's end is closed.
    fn check_daemon(&mut self) -> bool {
        match self.role.current_epoch() {
            Ok(current) if self.joined == Some(current.epoch) => true,
            Ok(current) => self.join(&current),
            Err(e) => {
                // An incomplete file of a killed daemon may block the caller's thread.
                self.role.remove_unsized_files();
                self.trying_since = None;
                self.report_loss(e)
            }
        }
    }

    fn join(&mut self, current: &Announcement) -> bool {
        let opened =
            self.role.join().and_then(|joined| Ok((P::open(&joined)?, joined.current().clone())));
        match opened {
            Ok((ports, current)) => {
                self.joined = Some(current.epoch);
                self.trying_since = None;
                self.last_reported = None;
                self.tell.send(LinkUpdate::Joined(ports, current)).is_ok()
            }
            Err(e) => {
                self.request_epoch_after_refusals(current.epoch, &e);
                self.report_loss(e)
            }
        }
    }

    /// Requests a new epoch if this one has refused the connection for a while. Not if all places for monitors are taken by
    /// running clients: a new epoch would move them all and free none.
    fn request_epoch_after_refusals(&mut self, epoch: u64, e: &JoinError) {
        let taken = matches!(e, JoinError::Port(PortError::Occupied { .. }));
        let full = taken && P::ROLE == Role::Monitor;
        if full || !matches!(e, JoinError::Transport { .. } | JoinError::Port(_)) {
            self.trying_since = None;
            return;
        }
        match self.trying_since {
            Some((tried, since)) if tried == epoch => {
                if since.elapsed() > NEW_EPOCH_AFTER {
                    self.role.request_new_epoch(epoch);
                }
            }
            _ => self.trying_since = Some((epoch, Instant::now())),
        }
    }

    fn report_loss(&mut self, e: JoinError) -> bool {
        self.joined = None;
        let message = e.to_string();
        if self.last_reported.as_ref() == Some(&message) {
            return true;
        }
        self.last_reported = Some(message);
        self.tell.send(LinkUpdate::Lost(e)).is_ok()
    }
}
