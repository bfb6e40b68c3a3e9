//! The daemon's side of a domain: only the daemon creates, announces, cleans up and removes.

use std::fs;
use std::io::ErrorKind;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use iceoryx2::node::Node;
use iceoryx2::prelude::ipc;

use super::current::{Contract, Current};
use super::error::{DomainError, JoinError};
use super::lock::{Lock, LockError};
use super::mender::Mender;
use super::place::Cell;
use crate::port::{ControlServer, PortError, Publisher, Subscriber};
use crate::services::{Services, Topic, Way};

/// How long a start waits for the lock: a client's look at it takes microseconds.
const LOCK_PATIENCE: Duration = Duration::from_millis(200);

/// A cell, claimed: this process is its one daemon until the value is dropped.
///
/// Life: [`create`](Self::create); hand [`ports`](Self::ports) to the threads; when they have made
/// their ports and the first `Status` is out, [`announce`](Self::announce); from then on
/// [`supervise`](Self::supervise) every 20 to 50 ms, from a thread that is not real-time.
#[derive(Debug)]
pub struct DaemonSide {
    // Dropped in this order: the transport's own tidying first, the claim last.
    ports: DaemonPorts,
    node: Node<ipc::Service>,
    _mender: Mender,
    /// The epoch that was announced to clients, or was to be; 0 before the first.
    announced: AtomicU64,
    claim: Claim,
}

/// A cell's lock; what is left of the cell goes with it.
#[derive(Debug)]
struct Claim {
    cell: Cell,
    lock: Option<Lock>,
}

/// Makes ports of one epoch. Cheap to clone; send a clone to each thread.
#[derive(Debug, Clone)]
pub struct DaemonPorts {
    services: Arc<Services<ipc::Service>>,
    epoch: u64,
}

/// What a look after the clients found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Supervision {
    /// Dead processes cleaned up after.
    pub cleaned: u64,
    /// Dead processes that could not be cleaned up after.
    pub failed: u64,
    /// A client cannot get in: [`DaemonSide::renew`] helps.
    pub knocked: bool,
    /// Somebody has removed or changed files by which clients find this daemon: [`DaemonSide::renew`] helps too.
    pub torn: bool,
}

impl DaemonSide {
    /// Claims the cell, removes what earlier daemons left, and creates all services of a new epoch.
    ///
    /// # Errors
    /// [`DomainError::AlreadyServed`] where another daemon lives; see [`DomainError`] for the rest.
    pub fn create(cell: &Cell) -> Result<Self, DomainError> {
        let claim = Claim::new(cell)?;
        claim.clear();
        let mender = Mender::start(cell)
            .map_err(|e| DomainError::io("start a thread for", cell.dir(), e))?;
        let (node, ports) = open_epoch(cell)?;
        Ok(Self { ports, node, _mender: mender, announced: AtomicU64::new(0), claim })
    }

    /// What makes the ports of the present epoch.
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
        // Whether it succeeds or not: an announcement that failed is as torn as one that was removed.
        self.announced.store(epoch, Relaxed);
        self.announcement().write(&self.claim.cell)?;
        self.claim.cell.sweep_epochs(Some(epoch));
        Ok(())
    }

    fn announcement(&self) -> Current {
        Current { contract: Contract::ours(), epoch: self.ports.epoch, pid: std::process::id() }
    }

    /// Cleans up after clients that died, so that their places are free, looks whether one knocks, and whether all is in its place.
    pub fn supervise(&self) -> Supervision {
        let state = self.node.try_cleanup_dead_nodes();
        let knock = self.claim.cell.file("knock");
        let epoch = format!("{:016x}", self.ports.epoch);
        let knocked = fs::read_to_string(&knock).is_ok_and(|text| text.trim() == epoch);
        let torn = self.announced.load(Relaxed) == self.ports.epoch && !self.is_found();
        Supervision { cleaned: state.cleanups, failed: state.failed_cleanups, knocked, torn }
    }

    /// Whether a client that looks for this daemon finds it. A directory that was given to others is not this daemon's to mend.
    fn is_found(&self) -> bool {
        let cell = &self.claim.cell;
        match Current::read(cell) {
            Err(JoinError::WrongUser { .. }) => !cell.is_ajar(),
            found => {
                found.is_ok_and(|found| found == self.announcement())
                    && self.claim.holds()
                    && cell.epoch_dir(self.ports.epoch).is_dir()
            }
        }
    }

    /// Makes a new epoch beside the present one. Its ports come from [`ports`](Self::ports); when
    /// the threads have changed over, [`announce`](Self::announce) moves the clients.
    ///
    /// # Errors
    /// See [`DomainError`]; the present epoch then stays. [`DomainError::AlreadyServed`]: the cell was taken away, and another
    /// daemon has it.
    pub fn renew(&mut self) -> Result<(), DomainError> {
        self.claim.claim_again()?;
        let (node, ports) = open_epoch(&self.claim.cell)?;
        self.node = node;
        self.ports = ports;
        let _ = fs::remove_file(self.claim.cell.file("knock"));
        Ok(())
    }
}

impl Drop for DaemonSide {
    fn drop(&mut self) {
        // Nobody shall join what is about to go.
        if self.claim.holds() {
            let _ = fs::remove_file(self.claim.cell.file("current"));
        }
    }
}

impl Claim {
    fn new(cell: &Cell) -> Result<Self, DomainError> {
        Ok(Self { cell: cell.clone(), lock: Some(locked(cell)?) })
    }

    /// Whether the cell is still this process's: somebody may have removed the lock's file.
    fn holds(&self) -> bool {
        self.lock.as_ref().is_some_and(Lock::holds)
    }

    /// Takes the cell again where its files were removed.
    fn claim_again(&mut self) -> Result<(), DomainError> {
        if self.holds() {
            return self.cell.make_dir();
        }
        self.lock = Some(locked(&self.cell)?);
        Ok(())
    }

    fn clear(&self) {
        let _ = fs::remove_file(self.cell.file("current"));
        let _ = fs::remove_file(self.cell.file("current.new"));
        let _ = fs::remove_file(self.cell.file("knock"));
        self.cell.sweep_epochs(None);
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // Without the lock, what stands there is another daemon's.
        if self.claim_again().is_err() {
            return;
        }
        self.clear();
        // A dead client's lock file goes with ours; a living one's stays with it.
        for role in ["cell.lock", "force.lock", "instrument.lock"] {
            drop(Lock::take(&self.cell.file(role), Duration::ZERO));
        }
        self.lock = None;
        self.cell.leave();
    }
}

impl DaemonPorts {
    /// Names the epoch.
    #[must_use]
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// A sender, for the calling thread.
    ///
    /// # Errors
    /// [`PortError::Occupied`] where the daemon has made it already.
    pub fn publisher<T: Topic>(&self) -> Result<Publisher<T>, PortError> {
        Publisher::new(&self.services)
    }

    /// A receiver, for the calling thread.
    ///
    /// # Errors
    /// [`PortError::Occupied`] where the daemon has made it already.
    pub fn subscriber<T: Topic>(&self) -> Result<Subscriber<T>, PortError> {
        Subscriber::new(&self.services, 0)
    }

    /// The end of `/control` that answers, for the calling thread.
    ///
    /// # Errors
    /// [`PortError::Refused`] where the daemon has made it already.
    pub fn control(&self) -> Result<ControlServer, PortError> {
        ControlServer::new(&self.services)
    }
}

/// Removes all that dead daemons and clients of the cell left behind.
///
/// # Errors
/// [`DomainError::AlreadyServed`] where a daemon lives.
pub fn sweep(cell: &Cell) -> Result<(), DomainError> {
    drop(Claim::new(cell)?);
    Ok(())
}

/// The cell's directory, and the daemon's lock in it.
fn locked(cell: &Cell) -> Result<Lock, DomainError> {
    let path = cell.file("daemon.lock");
    // A client that leaves removes an empty directory; then the next try makes it again.
    for _ in 0..10 {
        cell.make_dir()?;
        match Lock::take(&path, LOCK_PATIENCE) {
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
    cell.close_to_others(epoch)
        .map_err(|e| DomainError::io("close to other users the memory of", &dir, e))?;
    let services = Arc::new(Services::make(&node, Way::Create)?);
    Ok((node, DaemonPorts { services, epoch }))
}

/// A number that no earlier epoch of this cell has: the time of day in ns, or at worst one of its kind.
fn new_epoch() -> u64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or_else(|_| crate::clock::new_session(), |t| t.as_nanos() as u64)
}
