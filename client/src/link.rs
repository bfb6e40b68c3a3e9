//! The connection: a thread that connects, monitors the daemon, and reconnects.
//!
//! Promise: the calling side only reads a channel; all system calls of connecting and disconnecting are
//! made by the thread. A role still held by a dead process is waited for; if the epoch cannot be
//! joined for a while although the role is held, a new epoch is requested.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use shm_schema::{Cell, Current, JoinError, Joined, PortError, Role, Seat};

use crate::{Away, ConnectError};

/// Interval at which the thread checks the daemon and the epoch.
const WATCH_PERIOD: Duration = Duration::from_millis(20);
/// How often it tries to get in.
const JOIN_PERIOD: Duration = Duration::from_millis(5);
/// How long it tries before it knocks.
pub(crate) const KNOCK_AFTER: Duration = Duration::from_millis(250);
/// How long leaving may take.
const LEAVE_LIMIT: Duration = Duration::from_secs(1);
/// Most events kept for the caller; older ones are dropped.
const EVENTS_MAX: usize = 16;

/// The ports that a role needs.
pub(crate) trait Ports: Sized + Send + 'static {
    const ROLE: Role;
    fn open(joined: &Joined) -> Result<Self, PortError>;
}

/// State of the connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Connection {
    /// Joined, and the daemon lives.
    Connected {
        /// The daemon's process.
        pid: u32,
        /// Changes with each start of the daemon.
        epoch: u64,
    },
    /// The daemon is gone; the library reconnects automatically.
    Lost,
}

/// What happened to the connection.
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
        /// Why, for programs.
        away: Away,
        /// In words, with what to do.
        why: String,
    },
}

/// What goes back to the thread.
enum Errand<P> {
    /// Old ports, to be dropped.
    Retired(P),
    /// Nobody answers in this epoch.
    Knock,
}

enum News<P> {
    Joined(P, Current),
    Lost(JoinError),
}

/// The caller's end of the connection.
pub(crate) struct Link<P: Ports> {
    news: Receiver<News<P>>,
    /// Old ports go back to the thread, which drops them; closing it ends the thread.
    errands: Option<Sender<Errand<P>>>,
    thread: Option<JoinHandle<()>>,
    ports: Option<P>,
    connection: Connection,
    /// Why not connected, while that is so.
    away: Away,
    /// The daemon's process joined last; 0 before the first.
    daemon: u32,
    /// That daemon has gone since.
    gone: bool,
    /// Connected to a new daemon, not yet reported.
    restarted: bool,
    events: VecDeque<ConnectionEvent>,
}

impl<P: Ports> Link<P> {
    /// Starts the thread and waits until it is connected, at most `limit`.
    pub(crate) fn connect(cell: &Cell, limit: Duration) -> Result<Self, ConnectError> {
        let mut link = Self::start(cell)?;
        let start = Instant::now();
        let mut last = None;
        while link.ports.is_none() {
            match link.news.recv_timeout(limit.saturating_sub(start.elapsed())) {
                Ok(News::Lost(e)) if !e.is_passing() => return Err(ConnectError::Refused(e)),
                Ok(News::Lost(e)) => last = Some(e),
                Ok(joined) => link.take(joined),
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
        let (tell, news) = channel();
        let (errands, leavings) = channel();
        let mut keeper = Keeper {
            seat: Seat::new(cell, P::ROLE),
            tell,
            leavings,
            joined: None,
            trying_since: None,
            said: None,
        };
        let thread = std::thread::Builder::new()
            .name("trued-link".to_owned())
            .spawn(move || keeper.run())?;
        Ok(Self {
            news,
            errands: Some(errands),
            thread: Some(thread),
            ports: None,
            connection: Connection::Lost,
            away: Away::DaemonLost,
            daemon: 0,
            gone: false,
            restarted: false,
            events: VecDeque::with_capacity(EVENTS_MAX),
        })
    }

    /// Reads the messages of the thread. No system call, and no allocation while nothing changes.
    pub(crate) fn refresh(&mut self) {
        while let Ok(news) = self.news.try_recv() {
            self.take(news);
        }
    }

    fn take(&mut self, news: News<P>) {
        let event = match news {
            News::Joined(ports, Current { pid, epoch, .. }) => {
                let old = self.ports.replace(ports);
                self.retire(old);
                self.connection = Connection::Connected { pid, epoch };
                // The same process, never gone: an epoch that the daemon renewed, and it knows what it knew.
                let another = self.gone || self.daemon != pid;
                self.restarted |= self.daemon != 0 && another;
                (self.daemon, self.gone) = (pid, false);
                ConnectionEvent::Connected { pid, epoch }
            }
            News::Lost(why) => {
                self.connection = Connection::Lost;
                self.away = Away::from(&why);
                self.gone |= self.away == Away::DaemonLost;
                if self.away != Away::DaemonLost {
                    // That daemon lives, and may be joined again in the same epoch, where our places are still taken: by us.
                    let old = self.ports.take();
                    self.retire(old);
                }
                ConnectionEvent::Lost { away: self.away, why: why.to_string() }
            }
        };
        if self.events.len() == EVENTS_MAX {
            self.events.pop_front();
        }
        self.events.push_back(event);
    }

    /// Ports are dropped by the thread, as that makes system calls.
    fn retire(&self, old: Option<P>) {
        if let (Some(old), Some(errands)) = (old, &self.errands) {
            let _ = errands.send(Errand::Retired(old));
        }
    }

    /// Asks the daemon for a new epoch, as this one was joined and nobody answers in it: each end may have memory of its own under one name.
    pub(crate) fn knock(&self) {
        if let Some(errands) = &self.errands {
            let _ = errands.send(Errand::Knock);
        }
    }

    pub(crate) fn connection(&self) -> Connection {
        self.connection
    }

    /// The reason for not being connected; none while connected.
    pub(crate) fn away(&mut self) -> Option<Away> {
        self.refresh();
        (self.connection == Connection::Lost).then_some(self.away)
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
    pub(crate) fn ports_to_tell(&mut self) -> Result<&mut P, Away> {
        self.refresh();
        if self.connection == Connection::Lost {
            return Err(self.away);
        }
        if std::mem::take(&mut self.restarted) {
            return Err(Away::DaemonRestarted);
        }
        self.ports.as_mut().ok_or(self.away)
    }
}

impl<P: Ports> Drop for Link<P> {
    fn drop(&mut self) {
        // Ports first, as the thread gives up the role when it ends.
        self.ports = None;
        self.errands = None;
        // The thread ends within milliseconds, unless a killed process left something half-made that
        // it is stuck on: then it is left alone, and ends when the next daemon has cleaned up.
        let start = Instant::now();
        while self.thread.as_ref().is_some_and(|thread| !thread.is_finished()) {
            if start.elapsed() > LEAVE_LIMIT {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The thread's side.
struct Keeper<P: Ports> {
    seat: Seat,
    tell: Sender<News<P>>,
    leavings: Receiver<Errand<P>>,
    joined: Option<u64>,
    trying_since: Option<(u64, Instant)>,
    /// The last reported obstacle, so that each is reported once.
    said: Option<String>,
}

impl<P: Ports> Keeper<P> {
    fn run(&mut self) {
        loop {
            let alive = self.watch();
            let period = if self.trying_since.is_some() { JOIN_PERIOD } else { WATCH_PERIOD };
            match self.leavings.recv_timeout(period) {
                Ok(Errand::Retired(old)) => drop(old),
                Ok(Errand::Knock) => {
                    if let Some(epoch) = self.joined {
                        self.seat.knock(epoch);
                    }
                }
                Err(RecvTimeoutError::Timeout) if alive => {}
                Err(_) => return,
            }
        }
    }

    /// One look; false when the caller's end is gone.
    fn watch(&mut self) -> bool {
        match self.seat.look() {
            Ok(current) if self.joined == Some(current.epoch) => true,
            Ok(current) => self.join(&current),
            Err(e) => {
                // A daemon killed at a bad moment may have left the caller's thread stuck.
                self.seat.mend();
                self.trying_since = None;
                self.lost(e)
            }
        }
    }

    fn join(&mut self, current: &Current) -> bool {
        let opened =
            self.seat.join().and_then(|joined| Ok((P::open(&joined)?, joined.current().clone())));
        match opened {
            Ok((ports, current)) => {
                self.joined = Some(current.epoch);
                self.trying_since = None;
                self.said = None;
                self.tell.send(News::Joined(ports, current)).is_ok()
            }
            Err(e) => {
                self.insist(current.epoch, &e);
                self.lost(e)
            }
        }
    }

    /// Knocks when an epoch has refused us for a while for no reason of its own. Places that many may have are taken by others
    /// who live: a new epoch would move them all and free none.
    fn insist(&mut self, epoch: u64, e: &JoinError) {
        let taken = matches!(e, JoinError::Port(PortError::Occupied { .. }));
        let full = taken && P::ROLE == Role::Monitor;
        if full || !matches!(e, JoinError::Transport { .. } | JoinError::Port(_)) {
            self.trying_since = None;
            return;
        }
        match self.trying_since {
            Some((tried, since)) if tried == epoch => {
                if since.elapsed() > KNOCK_AFTER {
                    self.seat.knock(epoch);
                }
            }
            _ => self.trying_since = Some((epoch, Instant::now())),
        }
    }

    fn lost(&mut self, e: JoinError) -> bool {
        self.joined = None;
        let words = e.to_string();
        if self.said.as_ref() == Some(&words) {
            return true;
        }
        self.said = Some(words);
        self.tell.send(News::Lost(e)).is_ok()
    }
}
