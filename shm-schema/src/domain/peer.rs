//! A client's side of a domain: acquires the lock of its role, joins the announced epoch.

use std::fs;
use std::sync::Arc;
use std::time::Duration;

use iceoryx2::node::Node;
use iceoryx2::prelude::ipc_threadsafe;

use super::announcement::{Announcement, Contract};
use super::cell::Cell;
use super::error::JoinError;
use super::lock::{Lock, LockError, is_held};
use super::unsized_files::UnsizedFiles;
use crate::port::{ControlClient, PortError, Publisher, Subscriber};
use crate::services::{OpenMode, Services, Topic};

/// A client's ports may move between threads, at the price of an uncontended lock per call.
type Transport = ipc_threadsafe::Service;
/// A client's sender.
pub type PeerPublisher<T> = Publisher<T, Transport>;
/// A client's receiver.
pub type PeerSubscriber<T> = Subscriber<T, Transport>;
/// A client's end of `/control`.
pub type PeerControl = ControlClient<Transport>;

/// Role of a client in the cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Sends commands and receives corrected targets: one per cell.
    Cell,
    /// Sends force blocks: one per cell.
    Force,
    /// Sends measured points of the tool: one per cell.
    Instrument,
    /// Monitors and sends requests: any number.
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

/// A role in a cell, held exclusively until it is dropped.
#[derive(Debug)]
pub struct RoleClaim {
    cell: Cell,
    role: Role,
    lock: Option<Lock>,
    unsized_files: UnsizedFiles,
}

/// A joined epoch: creates ports.
#[derive(Debug, Clone)]
pub struct JoinedEpoch {
    // The services are dropped before the node.
    services: Arc<Services<Transport>>,
    _node: Arc<Node<Transport>>,
    current: Announcement,
    role: Role,
}

impl RoleClaim {
    /// A claim to this role; it is acquired by the first [`join`](Self::join).
    #[must_use]
    pub fn new(cell: &Cell, role: Role) -> Self {
        Self { cell: cell.clone(), role, lock: None, unsized_files: UnsizedFiles::default() }
    }

    /// The cell.
    #[must_use]
    pub fn cell(&self) -> &Cell {
        &self.cell
    }

    /// The announcement of the running daemon. Takes some microseconds and system calls.
    ///
    /// # Errors
    /// [`JoinError`] as [`Announcement::read`], or [`JoinError::DaemonDied`].
    pub fn current_epoch(&self) -> Result<Announcement, JoinError> {
        let current = Announcement::read(&self.cell)?;
        if !is_held(&self.cell.file("daemon.lock")) {
            let cell = self.cell.name().to_owned();
            return Err(JoinError::DaemonDied { cell, pid: current.pid });
        }
        Ok(current)
    }

    /// Joins the announced epoch: one attempt, limited by the transport's 100 ms per incomplete resource.
    ///
    /// # Errors
    /// See [`JoinError`]; [`JoinError::is_transient`] states whether a retry may succeed.
    pub fn join(&mut self) -> Result<JoinedEpoch, JoinError> {
        let current = self.current_epoch()?;
        let ours = Contract::of_this_build();
        if !current.contract.is_compatible_with(&ours) {
            let (theirs, ours) = (Box::new(current.contract), Box::new(ours));
            return Err(JoinError::VersionMismatch { theirs, ours });
        }
        self.acquire()?;
        let epoch = current.epoch;
        let transport = |cause| JoinError::Transport { epoch, cause };
        let node = super::node(&self.cell, epoch).map_err(transport)?;
        let services =
            Services::open_all(&node, OpenMode::Open).map_err(|e| transport(e.to_string()))?;
        let (services, node) = (Arc::new(services), Arc::new(node));
        Ok(JoinedEpoch { services, _node: node, current, role: self.role })
    }

    /// Requests a new epoch from the daemon, because `epoch` cannot be joined although this process holds the role.
    pub fn request_new_epoch(&self, epoch: u64) {
        let _ = fs::write(self.cell.file("knock"), format!("{epoch:016x}\n"));
    }

    /// Removes incomplete files of a killed process, which unblocks threads that wait for them: to be called repeatedly while
    /// no daemon is running. A running daemon does this itself.
    pub fn remove_unsized_files(&mut self) {
        self.unsized_files.remove_expired(&self.cell);
    }

    fn acquire(&mut self) -> Result<(), JoinError> {
        let Some((role, file)) = self.role.lock_name() else { return Ok(()) };
        if self.lock.as_ref().is_some_and(Lock::is_valid) {
            return Ok(());
        }
        self.lock = None;
        let path = self.cell.file(file);
        match Lock::acquire(&path, Duration::ZERO) {
            Ok(lock) => self.lock = Some(lock),
            Err(LockError::Held(pid)) => return Err(JoinError::RoleTaken { role, pid }),
            Err(LockError::Io(e)) => {
                return Err(super::error::DomainError::io("lock", &path, e).into());
            }
        }
        Ok(())
    }
}

impl Drop for RoleClaim {
    fn drop(&mut self) {
        self.lock = None;
        self.cell.remove_if_empty();
    }
}

impl JoinedEpoch {
    /// The announcement of the joined epoch.
    #[must_use]
    pub fn current(&self) -> &Announcement {
        &self.current
    }

    /// A sender.
    ///
    /// # Errors
    /// [`PortError::Occupied`] until the place of a terminated predecessor is released.
    pub fn publisher<T: Topic>(&self) -> Result<PeerPublisher<T>, PortError> {
        Publisher::new(&self.services)
    }

    /// A receiver.
    ///
    /// # Errors
    /// As [`publisher`](Self::publisher); for a monitor also if all places but the cell's are taken.
    pub fn subscriber<T: Topic>(&self) -> Result<PeerSubscriber<T>, PortError> {
        let kept = if self.role == Role::Monitor { T::KEEPING.reserved_for_cell() } else { 0 };
        Subscriber::new(&self.services, kept)
    }

    /// The client of `/control`.
    ///
    /// # Errors
    /// As [`subscriber`](Self::subscriber).
    pub fn control(&self) -> Result<PeerControl, PortError> {
        ControlClient::new(&self.services, usize::from(self.role == Role::Monitor))
    }
}
