//! Reports the counters of the loop and events of the connection, in a separate thread.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use trued_client::ConnectionEvent;

use crate::counts::{Count, Counts};
use crate::daemon_link::LinkEvent;

/// Interval between reports of faults.
const REPORT_EVERY: Duration = Duration::from_secs(1);

/// Starts reporting; ends when every sender of events is gone.
pub(crate) fn start(
    counts: Arc<Counts>,
    events: Receiver<LinkEvent>,
) -> std::io::Result<JoinHandle<()>> {
    std::thread::Builder::new().name("trued-tell".to_owned()).spawn(move || run(&counts, &events))
}

fn run(counts: &Counts, events: &Receiver<LinkEvent>) {
    let mut before = [0; Count::ALL.len()];
    let mut due = Instant::now() + REPORT_EVERY;
    loop {
        match events.recv_timeout(due.saturating_duration_since(Instant::now())) {
            Ok(event) => report(&event),
            Err(RecvTimeoutError::Timeout) => {
                counts.new_warnings(&mut before).iter().for_each(|line| tracing::warn!("{line}"));
                due = Instant::now() + REPORT_EVERY;
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

fn report(event: &LinkEvent) {
    match event {
        LinkEvent::Joined => tracing::info!("connected to the daemon"),
        LinkEvent::Unavailable(why) => tracing::warn!("no correction: {why}"),
        LinkEvent::Connection(ConnectionEvent::Connected { pid, .. }) => {
            tracing::info!("connected to the daemon, process {pid}");
        }
        LinkEvent::Connection(ConnectionEvent::Lost { why, .. }) => {
            tracing::warn!("the correction ramps to zero: {why}");
        }
    }
}
