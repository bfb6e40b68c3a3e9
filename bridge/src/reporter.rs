//! Reports the counters of the loop and events of the connection, in a separate thread.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use trued_client::ConnectionEvent;

use crate::counts::{Count, Counts};
use crate::joining::Event;

/// Interval between reports of faults.
const REPORT_EVERY: Duration = Duration::from_secs(1);

/// Starts reporting; ends when every sender of events is gone.
pub(crate) fn start(
    counts: Arc<Counts>,
    events: Receiver<Event>,
) -> std::io::Result<JoinHandle<()>> {
    std::thread::Builder::new().name("trued-tell".to_owned()).spawn(move || run(&counts, &events))
}

fn run(counts: &Counts, events: &Receiver<Event>) {
    let mut before = [0; Count::ALL.len()];
    let mut due = Instant::now() + REPORT_EVERY;
    loop {
        match events.recv_timeout(due.saturating_duration_since(Instant::now())) {
            Ok(event) => report(&event),
            Err(RecvTimeoutError::Timeout) => {
                counts.risen(&mut before).iter().for_each(|line| tracing::warn!("{line}"));
                due = Instant::now() + REPORT_EVERY;
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

fn report(event: &Event) {
    match event {
        Event::Joined => tracing::info!("connected to the daemon"),
        Event::Away(why) => tracing::warn!("no correction: {why}"),
        Event::Connection(ConnectionEvent::Connected { pid, .. }) => {
            tracing::info!("connected to the daemon, process {pid}");
        }
        Event::Connection(ConnectionEvent::Lost { why, .. }) => {
            tracing::warn!("the correction ramps to zero: {why}");
        }
    }
}
