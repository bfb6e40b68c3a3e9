//! Life cycle of a domain: one per cell, one epoch per start of the daemon.
//!
//! A process killed while it creates a service blocks that service permanently, and a killed peer leaves
//! its connections occupied. Therefore nothing of an earlier run is reused: each start creates a new epoch
//! (directory and prefix), announces it by an atomic rename, and removes the older ones completely.
//! Only the daemon creates services, and only the daemon cleans up after dead clients. A client that
//! still cannot connect requests a new epoch. Incomplete files of a killed process would block
//! others indefinitely: a thread of the daemon removes them.

mod current;
mod daemon;
mod error;
mod lock;
mod mender;
mod peer;
mod place;

pub use current::{Contract, Current};
pub use daemon::{DaemonPorts, DaemonSide, Supervision, sweep};
pub use error::{DomainError, JoinError};
pub use peer::{Joined, PeerControl, PeerPublisher, PeerSubscriber, Role, Seat};
pub use place::{Cell, RUNTIME_DIR_ENV};

use iceoryx2::node::{Node, NodeBuilder};
use iceoryx2::prelude::{Config, FileName, Path, SemanticString, Service, SignalHandlingMode};

/// How long the transport waits for a half-made resource.
const CREATION_TIMEOUT: core::time::Duration = core::time::Duration::from_millis(100);

/// Joins an epoch as a process: the transport's node, quiet, without signal handlers, cleaning nothing.
fn node<S: Service>(cell: &Cell, epoch: u64) -> Result<Node<S>, String> {
    place::check_room()?;
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
