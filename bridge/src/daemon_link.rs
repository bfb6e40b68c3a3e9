//! The connection to the daemon, established in a separate thread: a bridge never waits longer than its time limit, and without a daemon the correction is zero.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use trued_client::{
    Client, ConnectError, CorrectionStatus, JOINTS_MAX, RobotState, SendError, Setpoint, Source,
};

use crate::link::{Correction, Link};
use crate::settings::JoinRules;

/// Events of the connection, for the log.
#[derive(Debug)]
pub enum LinkEvent {
    /// A daemon was joined for the first time.
    Joined,
    /// No daemon can be joined; reported once for each reason.
    Unavailable(ConnectError),
    /// The connection changed since.
    Connection(trued_client::ConnectionEvent),
}

/// The client library, once a thread has joined the daemon.
pub struct DaemonLink {
    client: Option<Client>,
    joined: Receiver<Client>,
    events: Sender<LinkEvent>,
    stop: Arc<AtomicBool>,
    answer_within: Duration,
    /// The feed override before a daemon is joined.
    feed_without_daemon: f64,
}

impl DaemonLink {
    /// Starts joining the daemon of `cell` in a thread; events are sent to `events`. An answer is
    /// awaited for `answer_within`, and counts as fresh for `fresh`. Until then the feed override
    /// is `feed_without_daemon`.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(
        cell: &str,
        answer_within: Duration,
        fresh: Duration,
        feed_without_daemon: f64,
        events: Sender<LinkEvent>,
    ) -> std::io::Result<Self> {
        let (tell, joined) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let (cell, say, until) = (cell.to_owned(), events.clone(), Arc::clone(&stop));
        std::thread::Builder::new().name("trued-join".to_owned()).spawn(move || {
            let found = retry_connect(|within| Client::connect(&cell, within), &say, &until);
            if let Some(mut client) = found {
                client.set_fresh(fresh);
                client.start_feed(feed_without_daemon);
                // The receiver is gone if the bridge has ended.
                let _ = tell.send(client);
            }
        })?;
        Ok(Self { client: None, joined, events, stop, answer_within, feed_without_daemon })
    }

    /// The client, once joined.
    fn client(&mut self) -> Option<&mut Client> {
        if self.client.is_none()
            && let Ok(client) = self.joined.try_recv()
        {
            let _ = self.events.send(LinkEvent::Joined);
            self.client = Some(client);
        }
        let client = self.client.as_mut()?;
        while let Some(event) = client.next_event() {
            let _ = self.events.send(LinkEvent::Connection(event));
        }
        Some(client)
    }
}

impl Link for DaemonLink {
    fn command(&mut self, q: &[f64]) -> Correction {
        let within = self.answer_within;
        let Some(client) = self.client() else { return Correction::ZERO };
        if let Ok(seq) = send(client, &Setpoint::new(q)) {
            let _ = client.wait_corrected(seq, within);
        }
        correction(client, q)
    }

    fn repeat(&mut self, q: &[f64]) -> Correction {
        self.client().map_or(Correction::ZERO, |client| correction(client, q))
    }

    fn last_correction(&self) -> [f64; JOINTS_MAX] {
        self.client.as_ref().map_or([0.0; JOINTS_MAX], Client::last_correction)
    }

    fn feed_override(&self) -> f64 {
        self.client.as_ref().map_or(self.feed_without_daemon, Client::last_feed_override)
    }

    fn start_anew(&mut self) {
        if let Some(client) = self.client() {
            client.start_anew();
        }
    }

    fn start_from(&mut self, correction: &[f64; JOINTS_MAX]) {
        if let Some(client) = self.client() {
            client.start_from(correction);
        }
    }

    fn send_state(&mut self, state: &RobotState) {
        if let Some(client) = self.client() {
            // A lost state is missing only in the recording.
            let _ = client.send_state(state);
        }
    }

    fn check_connection(&mut self) {
        self.client();
    }
}

#[cfg(test)]
impl DaemonLink {
    /// A link that never finds a daemon.
    pub(crate) fn nowhere() -> Self {
        let (joined, events) = (channel().1, channel().0);
        let (stop, answer_within) = (Arc::default(), Duration::ZERO);
        Self { client: None, joined, events, stop, answer_within, feed_without_daemon: 1.0 }
    }
}

impl Drop for DaemonLink {
    fn drop(&mut self) {
        self.stop.store(true, Relaxed);
    }
}

/// The client reports a restart of the daemon once instead of sending; the second call sends.
fn send(client: &mut Client, setpoint: &Setpoint) -> Result<u64, SendError> {
    match client.send(setpoint) {
        Err(SendError::Disconnected(trued_client::DisconnectReason::DaemonRestarted)) => {
            client.send(setpoint)
        }
        sent => sent,
    }
}

fn correction(client: &mut Client, q: &[f64]) -> Correction {
    // Targets without finite values are filtered earlier; otherwise the last target is repeated.
    let target = client.target_for(q, trued_client::monotonic_ns()).ok();
    let rejected = CorrectionStatus::Rejected.code();
    Correction {
        rad: client.last_correction(),
        source: target.map_or(Source::Ramping, |target| target.source()),
        is_refused: client.newest().is_some_and(|newest| newest.status == rejected),
    }
}

/// Tries until it succeeds or the bridge ends; reports each obstacle once.
pub(crate) fn retry_connect<T>(
    mut connect: impl FnMut(Duration) -> Result<T, ConnectError>,
    events: &Sender<LinkEvent>,
    over: &AtomicBool,
) -> Option<T> {
    let rules = JoinRules::default();
    let mut last_message = String::new();
    while !over.load(Relaxed) {
        match connect(rules.attempt_timeout) {
            Ok(joined) => return Some(joined),
            Err(why) => {
                let message = why.to_string();
                if message != last_message {
                    last_message = message;
                    let _ = events.send(LinkEvent::Unavailable(why));
                }
            }
        }
        std::thread::sleep(rules.retry_after);
    }
    None
}
