//! The daemon's side of a domain: only the daemon creates, announces, cleans up and removes.

use std::fs;
use std::io::ErrorKind;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use iceoryx2::node::Node;
use iceoryx2::prelude::ipc;

use super::announcement::{Announcement, Contract};
use super::cell::Cell;
use super::error::{DomainError, JoinError};
use super::lock::{Lock, LockError};
use super::unsized_files::UnsizedFileCleaner;
use crate::port::{ControlServer, PortError, Publisher, Subscriber};
use crate::services::{OpenMode, Services, Topic};

/// How long a start waits for the lock: a client's check of it takes microseconds.
const LOCK_TIMEOUT: Duration = Duration::from_millis(200);

/// A cell, claimed: this process is its one daemon until the value is dropped.
///
/// Life cycle: [`create`](Self::create); hand [`ports`](Self::ports) to the threads; when they have created
/// their ports and the first `Status` is out, [`announce`](Self::announce); from then on
/// [`supervise`](Self::supervise) every 20 to 50 ms, from a thread that is not real-time.
#[derive(Debug)]
pub struct DaemonSide {
    // Dropped in this order: the transport's own cleanup first, the claim last.
    ports: DaemonPorts,
    node: Node<ipc::Service>,
    _mender: UnsizedFileCleaner,
    /// The last epoch whose announcement was attempted; 0 before the first.
    announced: AtomicU64,
    claim: CellClaim,
}

/// A cell's lock; dropping it removes the cell's remaining files.
#[derive(Debug)]
struct CellClaim {
    cell: Cell,
    lock: Option<Lock>,
}

/// Creates ports of one epoch. Cheap to clone; send a clone to each thread.
#[derive(Debug, Clone)]
pub struct DaemonPorts {
    services: Arc<Services<ipc::Service>>,
    epoch: u64,
}

/// Result of supervising the clients.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Supervision {
    /// Terminated processes whose resources were released.
    pub cleaned: u64,
    /// Terminated processes whose resources could not be released.
    pub failed: u64,
    /// A client cannot join and has requested a new epoch: call [`DaemonSide::renew`].
    pub epoch_requested: bool,
    /// Files by which clients find this daemon were removed or changed: call [`DaemonSide::renew`].
    pub files_damaged: bool,
}

impl DaemonSide {
    /// Claims the cell, removes what earlier daemons left, and creates all services of a new epoch.
    ///
    /// # Errors
    /// [`DomainError::AlreadyServed`] where another daemon lives; see [`DomainError`] for the rest.
    pub fn create(cell: &Cell) -> Result<Self, DomainError> {
        let claim = CellClaim::new(cell)?;
        claim.clear();
        let mender = UnsizedFileCleaner::start(cell)
            .map_err(|e| DomainError::io("start a thread for", cell.dir(), e))?;
        let (node, ports) = open_epoch(cell)?;
        Ok(Self { ports, node, _mender: mender, announced: AtomicU64::new(0), claim })
    }

    /// The factory of ports of the present epoch.
    #[must_use]
    pub fn ports(&self) -> DaemonPorts {
        self.ports.clone()
    }

    /// The cell served.
    #[must_use]
    pub fn cell(&self) -> &Cell {
        &self.claim.cell
    }

    /// Opens the present epoch to clients, and removes all older ones.
    ///
    /// # Errors
    /// [`DomainError::Io`] where the announcement could not be written.
    pub fn announce(&self) -> Result<(), DomainError> {
        let epoch = self.ports.epoch;
        // Set in any case: a failed announcement is repaired like one that was removed.
        self.announced.store(epoch, Relaxed);
        self.announcement().write(&self.claim.cell)?;
        self.claim.cell.remove_epochs_except(Some(epoch));
        Ok(())
    }

    fn announcement(&self) -> Announcement {
        Announcement {
            contract: Contract::of_this_build(),
            epoch: self.ports.epoch,
            pid: std::process::id(),
        }
    }

    /// Releases the resources of terminated clients, and checks whether a client requests a new epoch and whether the cell's files are intact.
    pub fn supervise(&self) -> Supervision {
        let state = self.node.try_cleanup_dead_nodes();
        let knock = self.claim.cell.file("knock");
        let epoch = format!("{:016x}", self.ports.epoch);
        let epoch_requested = fs::read_to_string(&knock).is_ok_and(|text| text.trim() == epoch);
        let files_damaged =
            self.announced.load(Relaxed) == self.ports.epoch && !self.is_discoverable();
        Supervision {
            cleaned: state.cleanups,
            failed: state.failed_cleanups,
            epoch_requested,
            files_damaged,
        }
    }

    /// Whether clients can find this daemon. A directory that now belongs to another user cannot be repaired by this daemon.
    fn is_discoverable(&self) -> bool {
        let cell = &self.claim.cell;
        match Announcement::read(cell) {
            Err(JoinError::WrongUser { .. }) => !cell.is_readable_by_others(),
            found => {
                found.is_ok_and(|found| found == self.announcement())
                    && self.claim.is_valid()
                    && cell.epoch_dir(self.ports.epoch).is_dir()
            }
        }
    }

    /// Creates a new epoch in addition to the present one. Its ports come from [`ports`](Self::ports); when
    /// the threads have switched to them, [`announce`](Self::announce) moves the clients.
    ///
    /// # Errors
    /// See [`DomainError`]; the present epoch then stays. [`DomainError::AlreadyServed`]: another daemon has
    /// taken over the cell.
    pub fn renew(&mut self) -> Result<(), DomainError> {
        self.claim.reclaim()?;
        let (node, ports) = open_epoch(&self.claim.cell)?;
        self.node = node;
        self.ports = ports;
        let _ = fs::remove_file(self.claim.cell.file("knock"));
        Ok(())
    }
}

impl Drop for DaemonSide {
    fn drop(&mut self) {
        // No client may join an epoch that is being removed.
        if self.claim.is_valid() {
            let _ = fs::remove_file(self.claim.cell.file("current"));
        }
    }
}

impl CellClaim {
    fn new(cell: &Cell) -> Result<Self, DomainError> {
        Ok(Self { cell: cell.clone(), lock: Some(acquire_lock(cell)?) })
    }

    /// Whether this process still owns the cell: the lock file may have been removed.
    fn is_valid(&self) -> bool {
        self.lock.as_ref().is_some_and(Lock::is_valid)
    }

    /// Acquires the cell again if its files were removed.
    fn reclaim(&mut self) -> Result<(), DomainError> {
        if self.is_valid() {
            return self.cell.make_dir();
        }
        self.lock = Some(acquire_lock(&self.cell)?);
        Ok(())
    }

    fn clear(&self) {
        let _ = fs::remove_file(self.cell.file("current"));
        let _ = fs::remove_file(self.cell.file("current.new"));
        let _ = fs::remove_file(self.cell.file("knock"));
        self.cell.remove_epochs_except(None);
    }
}

impl Drop for CellClaim {
    fn drop(&mut self) {
        // Without the lock, the files belong to another daemon.
        if self.reclaim().is_err() {
            return;
        }
        self.clear();
        // Lock files of terminated clients are removed too; those of running ones stay.
        for role in ["cell.lock", "force.lock", "instrument.lock"] {
            drop(Lock::acquire(&self.cell.file(role), Duration::ZERO));
        }
        self.lock = None;
        self.cell.remove_if_empty();
    }
}

impl DaemonPorts {
    /// Identifies the epoch.
    #[must_use]
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// A sender, for the calling thread.
    ///
    /// # Errors
    /// [`PortError::Occupied`] if the daemon has already created it.
    pub fn publisher<T: Topic>(&self) -> Result<Publisher<T>, PortError> {
        Publisher::new(&self.services)
    }

    /// A receiver, for the calling thread.
    ///
    /// # Errors
    /// [`PortError::Occupied`] if the daemon has already created it.
    pub fn subscriber<T: Topic>(&self) -> Result<Subscriber<T>, PortError> {
        Subscriber::new(&self.services, 0)
    }

    /// The server of `/control`, for the calling thread.
    ///
    /// # Errors
    /// [`PortError::Refused`] if the daemon has already created it.
    pub fn control(&self) -> Result<ControlServer, PortError> {
        ControlServer::new(&self.services)
    }
}

/// Removes all files that terminated daemons and clients of the cell left behind.
///
/// # Errors
/// [`DomainError::AlreadyServed`] if a daemon is running.
pub fn remove_leftovers(cell: &Cell) -> Result<(), DomainError> {
    drop(CellClaim::new(cell)?);
    Ok(())
}

/// Creates the cell's directory and acquires the daemon's lock in it.
fn acquire_lock(cell: &Cell) -> Result<Lock, DomainError> {
    let path = cell.file("daemon.lock");
    // A client that ends removes an empty directory; the next attempt creates it again.
    for _ in 0..10 {
        cell.make_dir()?;
        match Lock::acquire(&path, LOCK_TIMEOUT) {
            Ok(lock) => return Ok(lock),
            Err(LockError::Io(e)) if e.kind() == ErrorKind::NotFound => {}
            Err(LockError::Io(e)) => return Err(DomainError::io("lock", &path, e)),
            Err(LockError::Held(pid)) => {
                return Err(DomainError::AlreadyServed { cell: cell.name().to_owned(), pid });
            }
        }
    }
    Err(DomainError::io("lock", &path, ErrorKind::NotFound.into()))
}

fn open_epoch(cell: &Cell) -> Result<(Node<ipc::Service>, DaemonPorts), DomainError> {
    let epoch = new_epoch();
    let dir = cell.epoch_dir(epoch);
    fs::create_dir(&dir).map_err(|e| DomainError::io("create the directory", &dir, e))?;
    let transport = |cause| DomainError::Transport { cell: cell.name().to_owned(), cause };
    let node = super::node(cell, epoch).map_err(transport)?;
    cell.restrict_to_owner(epoch)
        .map_err(|e| DomainError::io("close to other users the memory of", &dir, e))?;
    let services = Arc::new(Services::open_all(&node, OpenMode::Create)?);
    Ok((node, DaemonPorts { services, epoch }))
}

/// A number that no earlier epoch of this cell has: the time of day in ns, or a new session number if the clock is before 1970.
fn new_epoch() -> u64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or_else(|_| crate::clock::new_session(), |t| t.as_nanos() as u64)
}
