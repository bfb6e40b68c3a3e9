//! Serves page, metrics and stream of one cell, each in a thread.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;

use trued_client::Monitor;

use crate::access::Access;
use crate::cell_watch::{self, CellWatch};
use crate::robot::RobotModelFile;
use crate::{foxglove, web};

/// Addresses and access.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The address of page, report, status and metrics. Port 0: a free port.
    pub http: SocketAddr,
    /// The address of the stream for Foxglove; `None`: no stream.
    pub foxglove: Option<SocketAddr>,
    /// Who may view the cell.
    pub access: Access,
    /// The cell's model file, by which the page draws the robot; `None`: not drawn.
    pub model: Option<PathBuf>,
}

/// Why the view cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// The address is in use or does not belong to this machine.
    #[error("cannot listen on {address}: {why}; choose another address or port")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The system's error.
        why: String,
    },
    /// Other machines could view the cell without a token.
    #[error(
        "{0} is reachable from other computers: set a token (TRUED_LIVE_TOKEN), or listen on 127.0.0.1"
    )]
    Open(SocketAddr),
    /// The system refused a thread.
    #[error("cannot start a thread: {0}")]
    Thread(std::io::Error),
}

/// A running live view.
#[derive(Debug)]
pub struct Live {
    /// Address of page, status and metrics.
    pub http: SocketAddr,
    /// Address of the stream.
    pub foxglove: Option<SocketAddr>,
    stop: Arc<AtomicBool>,
    threads: Vec<thread::JoinHandle<()>>,
}

impl Live {
    /// Starts serving the state of the cell from `monitor`.
    ///
    /// # Errors
    /// See [`LiveError`].
    pub fn start(cell: &str, monitor: Monitor, settings: &Settings) -> Result<Self, LiveError> {
        for address in settings.foxglove.iter().chain([&settings.http]) {
            if !address.ip().is_loopback() && settings.access == Access::ThisMachine {
                return Err(LiveError::Open(*address));
            }
        }
        let stop = Arc::new(AtomicBool::new(false));
        let watch = Arc::new(CellWatch::default());
        let web = web::Server::listen(settings.http, settings.access.clone())?;
        let foxglove = settings
            .foxglove
            .map(|address| foxglove::Server::bind(address, cell, settings.access.clone()));
        let foxglove = foxglove.transpose()?;
        let (http, stream) = (web.address(), foxglove.as_ref().map(foxglove::Server::address));
        let mut live = Self { http, foxglove: stream, stop, threads: Vec::new() };
        let (name, shared) = (cell.to_owned(), Arc::clone(&watch));
        let robot = settings.model.clone().map(RobotModelFile::new);
        live.spawn("watch", move |stop| {
            cell_watch::run(&name, monitor, robot, true, &shared, stop);
        })?;
        let shared = Arc::clone(&watch);
        live.spawn("web", move |stop| web.run(&shared, stop))?;
        if let Some(server) = foxglove {
            live.spawn("foxglove", move |stop| server.run(&watch, stop))?;
        }
        Ok(live)
    }

    fn spawn(
        &mut self,
        name: &str,
        run: impl FnOnce(&Arc<AtomicBool>) + Send + 'static,
    ) -> Result<(), LiveError> {
        let stop = Arc::clone(&self.stop);
        let thread = thread::Builder::new().name(name.to_owned());
        let thread = thread.spawn(move || run(&stop)).map_err(LiveError::Thread)?;
        self.threads.push(thread);
        Ok(())
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
        for thread in self.threads.drain(..) {
            // A thread that panicked has already reported it.
            let _ = thread.join();
        }
    }
}
