//! The correction for one target after the other, whatever has become of the daemon: the client library behind a gate.
//!
//! Promises: never waits longer than it was told to; without a daemon the answer is the target itself; a correction begins
//! and ends at zero by the client's own rule, never by a step. At the beginning of a run what is left of the run before is
//! ramped out first. Never: a correction of its own.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use trued_client::{Client, ConnectError, JOINTS_MAX, NotSent, Setpoint, Source, Target};

/// How long one try to join may take, and the pause between two.
const JOIN_WITHIN: Duration = Duration::from_secs(1);
const JOIN_AGAIN: Duration = Duration::from_millis(200);

/// The answer to one target.
#[derive(Debug, Clone, Copy)]
pub struct Correction {
    /// Target minus command, rad; for a refused command the daemon's last good correction.
    pub rad: [f64; JOINTS_MAX],
    /// In place of a refused command, the daemon's last good target, rad.
    pub instead: Option<[f64; JOINTS_MAX]>,
    /// Where it comes from.
    pub source: Source,
}

impl Correction {
    /// None.
    pub const ZERO: Self = Self { rad: [0.0; JOINTS_MAX], instead: None, source: Source::Plain };

    /// Whether the target goes out as it came.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.instead.is_none() && self.is_zero()
    }

    fn is_zero(&self) -> bool {
        self.rad == [0.0; JOINTS_MAX]
    }
}

/// What the feed has to say, for whoever logs.
#[derive(Debug)]
pub enum News {
    /// A daemon was joined for the first time.
    Joined,
    /// It cannot be joined; told once for each reason.
    Away(ConnectError),
    /// The connection changed since.
    Connection(trued_client::ConnectionEvent),
}

/// The way to the daemon.
pub struct Feed {
    client: Option<Client>,
    joined: Receiver<Client>,
    news: Sender<News>,
    over: Arc<AtomicBool>,
    answer_within: Duration,
    /// What the daemon was told last, and of how many joints.
    last: Option<(Setpoint, usize)>,
    /// Corrections go out. Shut, what is left of one ramps out, and then nothing goes out.
    is_open: bool,
}

impl Feed {
    /// Starts joining the daemon of `cell` in a thread; its news go to `news`. An answer is awaited for `answer_within`,
    /// and counts as fresh for `fresh`.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(
        cell: &str,
        answer_within: Duration,
        fresh: Duration,
        news: Sender<News>,
    ) -> std::io::Result<Self> {
        let (tell, joined) = channel();
        let over = Arc::new(AtomicBool::new(false));
        let (cell, say, until) = (cell.to_owned(), news.clone(), Arc::clone(&over));
        std::thread::Builder::new().name("trued-join".to_owned()).spawn(move || {
            let found = keep_trying(|| Client::connect(&cell, JOIN_WITHIN), &say, &until);
            if let Some(mut client) = found {
                client.set_fresh(fresh);
                // Nobody takes it any more where the bridge has ended.
                let _ = tell.send(client);
            }
        })?;
        Ok(Self { client: None, joined, news, over, answer_within, last: None, is_open: false })
    }

    /// The correction of a new target, rad (m where prismatic).
    pub fn command(&mut self, q: &[f64], now_ns: u64) -> Correction {
        let setpoint = Setpoint::new(q);
        self.last = Some((setpoint, q.len().min(JOINTS_MAX)));
        if !self.open(q, now_ns) {
            return Correction::ZERO;
        }
        let within = self.answer_within;
        let Some(client) = self.client() else { return Correction::ZERO };
        if let Ok(seq) = send(client, &setpoint) {
            let _ = client.wait_corrected(seq, within);
        }
        self.correction(q, trued_client::monotonic_ns())
    }

    /// The correction as it stands, for a target that the daemon knows already.
    pub fn repeat(&mut self, q: &[f64], now_ns: u64) -> Correction {
        if self.is_open { self.correction(q, now_ns) } else { Correction::ZERO }
    }

    /// Tells the daemon the last target again, so that its correction stands while the robot does.
    pub fn keep(&mut self) {
        if !self.is_open {
            return;
        }
        if let (Some((setpoint, _)), Some(client)) = (self.last, self.client()) {
            let _ = send(client, &setpoint);
        }
    }

    /// The robot is not guided: nothing is told to the daemon, and what is left of the correction ramps out.
    pub fn rest(&mut self, now_ns: u64) {
        self.is_open = false;
        // Where the joints are does not matter to a ramp, their number does. Before the first target it only joins.
        let joints = self.last.map_or(0, |(_, joints)| joints);
        self.correction(&[0.0; JOINTS_MAX][..joints], now_ns);
    }

    /// The client, once joined.
    pub fn client(&mut self) -> Option<&mut Client> {
        if self.client.is_none() {
            self.client = self.joined.try_recv().ok();
            if self.client.is_some() {
                let _ = self.news.send(News::Joined);
            }
        }
        let client = self.client.as_mut()?;
        while let Some(event) = client.next_event() {
            let _ = self.news.send(News::Connection(event));
        }
        Some(client)
    }

    /// Whether corrections may go out for this run: at its beginning, once nothing is left of the run before.
    fn open(&mut self, q: &[f64], now_ns: u64) -> bool {
        if !self.is_open && self.correction(q, now_ns).is_zero() {
            self.is_open = true;
            if let Some(client) = self.client() {
                client.start_anew();
            }
        }
        self.is_open
    }

    fn correction(&mut self, q: &[f64], now_ns: u64) -> Correction {
        let Some(client) = self.client() else { return Correction::ZERO };
        let target = client.target_for(q, now_ns);
        of_target(&target, q, || client.newest().map(|newest| newest.correction))
    }
}

#[cfg(test)]
impl Feed {
    /// A feed that never finds a daemon.
    pub(crate) fn nowhere() -> Self {
        let (joined, news) = (channel().1, channel().0);
        let (over, answer_within) = (Arc::default(), Duration::ZERO);
        Self { client: None, joined, news, over, answer_within, last: None, is_open: false }
    }
}

impl Drop for Feed {
    fn drop(&mut self) {
        self.over.store(true, Relaxed);
    }
}

/// A restart of the daemon is told once instead of sending: then it is sent again.
fn send(client: &mut Client, setpoint: &Setpoint) -> Result<u64, NotSent> {
    match client.send(setpoint) {
        Err(NotSent::Away(trued_client::Away::DaemonRestarted)) => client.send(setpoint),
        sent => sent,
    }
}

fn of_target(
    target: &Target,
    q: &[f64],
    last_good: impl FnOnce() -> Option<[f64; JOINTS_MAX]>,
) -> Correction {
    let source = target.source();
    let mut rad = [0.0; JOINTS_MAX];
    if source == Source::Rejected {
        let mut instead = [0.0; JOINTS_MAX];
        instead.iter_mut().zip(target.joints()).for_each(|(to, q)| *to = *q);
        return Correction { rad: last_good().unwrap_or(rad), instead: Some(instead), source };
    }
    for (rad, (target, q)) in rad.iter_mut().zip(target.joints().iter().zip(q)) {
        *rad = target - q;
    }
    Correction { rad, instead: None, source }
}

/// Tries until it succeeds or the bridge ends; says each obstacle once.
pub(crate) fn keep_trying<T>(
    mut connect: impl FnMut() -> Result<T, ConnectError>,
    news: &Sender<News>,
    over: &AtomicBool,
) -> Option<T> {
    let mut said = String::new();
    while !over.load(Relaxed) {
        match connect() {
            Ok(joined) => return Some(joined),
            Err(why) => {
                let words = why.to_string();
                if words != said {
                    said = words;
                    let _ = news.send(News::Away(why));
                }
            }
        }
        std::thread::sleep(JOIN_AGAIN);
    }
    None
}
