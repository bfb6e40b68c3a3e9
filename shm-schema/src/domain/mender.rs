//! A thread that removes what killed processes left half-made, as other threads may be stuck on it.
//!
//! It never touches the transport, so it cannot get stuck itself. See [`Cell::mend`].

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use super::place::Cell;

const PERIOD: Duration = Duration::from_millis(20);

/// Mends a cell's memory until it is dropped.
#[derive(Debug)]
pub(crate) struct Mender {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Mender {
    pub(crate) fn start(cell: &Cell) -> std::io::Result<Self> {
        let (stop, stopped) = channel();
        let cell = cell.clone();
        let thread =
            std::thread::Builder::new().name("trued-mender".to_owned()).spawn(move || {
                while stopped.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                    cell.mend();
                }
            })?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Mender {
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
