//! A client's side of a domain: take the lock of its role, join the announced epoch.

use std::fs;
use std::sync::Arc;
use std::time::Duration;

use iceoryx2::node::Node;
use iceoryx2::prelude::ipc_threadsafe;

use super::current::{Contract, Current};
use super::error::JoinError;
use super::lock::{Lock, LockError, is_held};
use super::mender::HalfMade;
use super::place::Cell;
use crate::port::{ControlClient, PortError, Publisher, Subscriber};
use crate::services::{Services, Topic, Way};

/// A client's ports may move between threads, at the price of an uncontended lock per call.
type Transport = ipc_threadsafe::Service;
/// A client's sender.
pub type PeerPublisher<T> = Publisher<T, Transport>;
/// A client's receiver.
pub type PeerSubscriber<T> = Subscriber<T, Transport>;
/// A client's end of `/control`.
pub type PeerControl = ControlClient<Transport>;

/// What a client does in the cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Sends commands and takes corrected targets: one per cell.
    Cell,
    /// Sends force blocks: one per cell.
    Force,
    /// Sends measured points of the tool: one per cell.
    Instrument,
    /// Looks and asks: several.
    Monitor,
}

impl Role {
    const fn lock_name(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Cell => Some(("cell", "cell.lock")),
            Self::Force => Some(("force", "force.lock")),
            Self::Instrument => Some(("instrument", "instrument.lock")),
            Self::Monitor => None,
        }
    }
}

/// A role in a cell, held against all other processes until it is dropped.
#[derive(Debug)]
pub struct Seat {
    cell: Cell,
    role: Role,
    lock: Option<Lock>,
    half_made: HalfMade,
}

/// An epoch, joined: makes the ports.
#[derive(Debug, Clone)]
pub struct Joined {
    // The services before the node, which outlives them.
    services: Arc<Services<Transport>>,
    _node: Arc<Node<Transport>>,
    current: Current,
    role: Role,
}

impl Seat {
    /// A seat for that role; it is taken with the first [`join`](Self::join).
    #[must_use]
    pub fn new(cell: &Cell, role: Role) -> Self {
        Self { cell: cell.clone(), role, lock: None, half_made: HalfMade::default() }
    }

    /// The cell.
    #[must_use]
    pub fn cell(&self) -> &Cell {
        &self.cell
    }

    /// Whether a daemon lives, and with which epoch announced. Some microseconds and system calls.
    ///
    /// # Errors
    /// [`JoinError`] as [`Current::read`], or [`JoinError::DaemonDied`].
    pub fn look(&self) -> Result<Current, JoinError> {
        let current = Current::read(&self.cell)?;
        if !is_held(&self.cell.file("daemon.lock")) {
            let cell = self.cell.name().to_owned();
            return Err(JoinError::DaemonDied { cell, pid: current.pid });
        }
        Ok(current)
    }

    /// Joins the announced epoch: one try, bounded by the transport's 100 ms per half-made resource.
    ///
    /// # Errors
    /// See [`JoinError`]; [`JoinError::is_passing`] tells whether to try again.
    pub fn join(&mut self) -> Result<Joined, JoinError> {
        let current = self.look()?;
        let ours = Contract::ours();
        if !current.contract.fits(&ours) {
            let (theirs, ours) = (Box::new(current.contract), Box::new(ours));
            return Err(JoinError::VersionMismatch { theirs, ours });
        }
        self.take()?;
        let epoch = current.epoch;
        let transport = |cause| JoinError::Transport { epoch, cause };
        let node = super::node(&self.cell, epoch).map_err(transport)?;
        let services = Services::make(&node, Way::Open).map_err(|e| transport(e.to_string()))?;
        let (services, node) = (Arc::new(services), Arc::new(node));
        Ok(Joined { services, _node: node, current, role: self.role })
    }

    /// Asks the daemon for a new epoch, as `epoch` cannot be joined although this seat is ours.
    pub fn knock(&self, epoch: u64) {
        let _ = fs::write(self.cell.file("knock"), format!("{epoch:016x}\n"));
    }

    /// Removes what a killed process left half-made, and frees threads that are stuck on it: to be called again and again while
    /// no daemon lives. One that lives does this itself.
    pub fn mend(&mut self) {
        self.half_made.mend(&self.cell);
    }

    fn take(&mut self) -> Result<(), JoinError> {
        let Some((role, file)) = self.role.lock_name() else { return Ok(()) };
        if self.lock.as_ref().is_some_and(Lock::holds) {
            return Ok(());
        }
        self.lock = None;
        let path = self.cell.file(file);
        match Lock::take(&path, Duration::ZERO) {
            Ok(lock) => self.lock = Some(lock),
            Err(LockError::Held(pid)) => return Err(JoinError::RoleTaken { role, pid }),
            Err(LockError::Io(e)) => {
                return Err(super::error::DomainError::io("lock", &path, e).into());
            }
        }
        Ok(())
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.lock = None;
        self.cell.leave();
    }
}

impl Joined {
    /// What was joined.
    #[must_use]
    pub fn current(&self) -> &Current {
        &self.current
    }

    /// A sender.
    ///
    /// # Errors
    /// [`PortError::Occupied`] while a dead forerunner's place is not cleaned up.
    pub fn publisher<T: Topic>(&self) -> Result<PeerPublisher<T>, PortError> {
        Publisher::new(&self.services)
    }

    /// A receiver.
    ///
    /// # Errors
    /// As [`publisher`](Self::publisher); for a monitor also where all places but the cell's are taken.
    pub fn subscriber<T: Topic>(&self) -> Result<PeerSubscriber<T>, PortError> {
        let kept = if self.role == Role::Monitor { T::KEEPING.kept_for_the_cell() } else { 0 };
        Subscriber::new(&self.services, kept)
    }

    /// The end of `/control` that asks.
    ///
    /// # Errors
    /// As [`subscriber`](Self::subscriber).
    pub fn control(&self) -> Result<PeerControl, PortError> {
        ControlClient::new(&self.services, usize::from(self.role == Role::Monitor))
    }
}
