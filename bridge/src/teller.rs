//! Reports the counters of the loop and events of the connection, in a separate thread.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use trued_client::ConnectionEvent;

use crate::counts::{Count, Counts};
use crate::joining::News;

/// How often faults are told.
const TELL_EVERY: Duration = Duration::from_secs(1);

/// Starts telling; ends when every sender of news is gone.
pub(crate) fn start(counts: Arc<Counts>, news: Receiver<News>) -> std::io::Result<JoinHandle<()>> {
    std::thread::Builder::new().name("trued-tell".to_owned()).spawn(move || run(&counts, &news))
}

fn run(counts: &Counts, news: &Receiver<News>) {
    let mut before = [0; Count::ALL.len()];
    let mut due = Instant::now() + TELL_EVERY;
    loop {
        match news.recv_timeout(due.saturating_duration_since(Instant::now())) {
            Ok(news) => tell(&news),
            Err(RecvTimeoutError::Timeout) => {
                counts.risen(&mut before).iter().for_each(|line| tracing::warn!("{line}"));
                due = Instant::now() + TELL_EVERY;
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

fn tell(news: &News) {
    match news {
        News::Joined => tracing::info!("joined the daemon"),
        News::Away(why) => tracing::warn!("nothing is corrected: {why}"),
        News::Connection(ConnectionEvent::Connected { pid, .. }) => {
            tracing::info!("the daemon is process {pid}");
        }
        News::Connection(ConnectionEvent::Lost { why, .. }) => {
            tracing::warn!("the correction ramps out: {why}");
        }
    }
}
