//! Life cycle of a domain: one per cell, one epoch per start of the daemon.
//!
//! A process killed while it creates a service blocks that service permanently, and a killed peer leaves
//! its connections occupied. Therefore nothing of an earlier run is reused: each start creates a new epoch
//! (directory and prefix), announces it by an atomic rename, and removes the older ones completely.
//! Only the daemon creates services, and only the daemon cleans up after dead clients. A client that
//! still cannot connect requests a new epoch. Incomplete files of a killed process would block
//! others indefinitely: a thread of the daemon removes them.

mod announcement;
mod cell;
mod daemon;
mod error;
mod lock;
mod peer;
mod unsized_files;

pub use announcement::{Announcement, Contract};
pub use cell::{Cell, RUNTIME_DIR_ENV};
pub use daemon::{DaemonPorts, DaemonSide, Supervision, remove_leftovers};
pub use error::{DomainError, JoinError};
pub use peer::{JoinedEpoch, PeerControl, PeerPublisher, PeerSubscriber, Role, RoleClaim};

use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{Config, FileName, Path, SemanticString, Service, SignalHandlingMode};

/// How long the transport waits for an incomplete resource.
const CREATION_TIMEOUT: core::time::Duration = core::time::Duration::from_millis(100);

/// Creates the transport's node of this process in an epoch: no log, no signal handlers, no cleanup.
fn node<S: Service>(cell: &Cell, epoch: u64) -> Result<Node<S>, String> {
    cell::check_free_space()?;
    let mut config = Config::default();
    let dir = cell.epoch_dir(epoch);
    let root = Path::new(dir.to_string_lossy().as_bytes()).map_err(|e| format!("{e:?}"))?;
    config.global.set_root_path(&root);
    config.global.prefix =
        FileName::new(cell.epoch_prefix(epoch).as_bytes()).map_err(|e| format!("{e:?}"))?;
    config.global.creation_timeout = CREATION_TIMEOUT;
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<S>()
        .map_err(|e| format!("{e:?}"))
}
