//! Connects to the daemon in a separate thread: a bridge never waits for it longer than its time limit, and without it the correction is zero.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use trued_client::{
    Client, ConnectError, CorrectionStatus, JOINTS_MAX, NotSent, RobotState, Setpoint, Source,
};

use crate::link::{Correction, Link};
use crate::settings::JoinRules;

/// Events of the connection, for the log.
#[derive(Debug)]
pub enum Event {
    /// A daemon was joined for the first time.
    Joined,
    /// It cannot be joined; reported once for each reason.
    Away(ConnectError),
    /// The connection changed since.
    Connection(trued_client::ConnectionEvent),
}

/// The client library, once a thread has joined the daemon.
pub struct Joining {
    client: Option<Client>,
    joined: Receiver<Client>,
    events: Sender<Event>,
    over: Arc<AtomicBool>,
    answer_within: Duration,
    /// The feed override before a daemon is joined.
    lost_feed: f64,
}

impl Joining {
    /// Starts joining the daemon of `cell` in a thread; events are sent to `events`. An answer is
    /// awaited for `answer_within`, and counts as fresh for `fresh`. Until then the feed override
    /// is `lost_feed`.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(
        cell: &str,
        answer_within: Duration,
        fresh: Duration,
        lost_feed: f64,
        events: Sender<Event>,
    ) -> std::io::Result<Self> {
        let (tell, joined) = channel();
        let over = Arc::new(AtomicBool::new(false));
        let (cell, say, until) = (cell.to_owned(), events.clone(), Arc::clone(&over));
        std::thread::Builder::new().name("trued-join".to_owned()).spawn(move || {
            let found = keep_trying(|within| Client::connect(&cell, within), &say, &until);
            if let Some(mut client) = found {
                client.set_fresh(fresh);
                client.start_feed(lost_feed);
                // The receiver is gone if the bridge has ended.
                let _ = tell.send(client);
            }
        })?;
        Ok(Self { client: None, joined, events, over, answer_within, lost_feed })
    }

    /// The client, once joined.
    fn client(&mut self) -> Option<&mut Client> {
        if self.client.is_none()
            && let Ok(client) = self.joined.try_recv()
        {
            let _ = self.events.send(Event::Joined);
            self.client = Some(client);
        }
        let client = self.client.as_mut()?;
        while let Some(event) = client.next_event() {
            let _ = self.events.send(Event::Connection(event));
        }
        Some(client)
    }
}

impl Link for Joining {
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
        self.client.as_ref().map_or(self.lost_feed, Client::last_feed_override)
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
            // A lost state is only missing in a recording.
            let _ = client.send_state(state);
        }
    }

    fn look(&mut self) {
        self.client();
    }
}

#[cfg(test)]
impl Joining {
    /// A link that never finds a daemon.
    pub(crate) fn nowhere() -> Self {
        let (joined, events) = (channel().1, channel().0);
        let (over, answer_within) = (Arc::default(), Duration::ZERO);
        Self { client: None, joined, events, over, answer_within, lost_feed: 1.0 }
    }
}

impl Drop for Joining {
    fn drop(&mut self) {
        self.over.store(true, Relaxed);
    }
}

/// The client reports a restart of the daemon once instead of sending; the second call sends.
fn send(client: &mut Client, setpoint: &Setpoint) -> Result<u64, NotSent> {
    match client.send(setpoint) {
        Err(NotSent::Away(trued_client::Away::DaemonRestarted)) => client.send(setpoint),
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
pub(crate) fn keep_trying<T>(
    mut connect: impl FnMut(Duration) -> Result<T, ConnectError>,
    events: &Sender<Event>,
    over: &AtomicBool,
) -> Option<T> {
    let rules = JoinRules::default();
    let mut said = String::new();
    while !over.load(Relaxed) {
        match connect(rules.within) {
            Ok(joined) => return Some(joined),
            Err(why) => {
                let words = why.to_string();
                if words != said {
                    said = words;
                    let _ = events.send(Event::Away(why));
                }
            }
        }
        std::thread::sleep(rules.again_after);
    }
    None
}
