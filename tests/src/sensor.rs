//! A force sensor with faults: noise on every channel, lines on some, and modifications of its blocks.
//!
//! Its blocks carry the stream's own times and are sent as fast as the daemon accepts them, so that
//! tests do not depend on the speed of the machine: the number of blocks in transit is limited to
//! the capacity of the transport.

use crate::place::TestDirectory;
use crate::rng::TestRng;
use shm_schema::{
    ForceBlock, JoinedEpoch, PeerPublisher, Role, RoleClaim, SendOutcome, monotonic_ns, new_session,
};
use std::time::{Duration, Instant};
use trued_client::{Monitor, Status, Verdict};

/// Limit on blocks in transit: half of the transport's capacity.
const UNDER_WAY: u64 = 32;
/// Time limit for anything awaited.
const LIMIT: Duration = Duration::from_secs(20);

/// Lines of `[force]` for a daemon that accepts blocks at any rate: their stamps are the stream's
/// own, not the machine's.
pub const ANY_CLOCK: &str = "ahead_ms = 60000\nlate_ms = 3600000\n";

/// The sensor and an observer of the daemon.
pub struct Sensor {
    /// The daemon's observer.
    pub monitor: Monitor,
    /// Verdicts so far.
    pub verdicts: Vec<Verdict>,
    /// Number of blocks sent.
    pub sent: u64,
    /// The next block, without its samples.
    pub block: Box<ForceBlock>,
    blocks: PeerPublisher<ForceBlock>,
    _seat: (RoleClaim, JoinedEpoch),
    chance: TestRng,
    frames: u64,
    samples_before: u64,
    start_ns: u64,
}

impl Sensor {
    /// Joins the daemon of that place; blocks of 10 ms, or of 512 samples where that is less.
    #[must_use]
    pub fn join(place: &TestDirectory, rate_hz: f64, channels: u32) -> Self {
        let mut seat = RoleClaim::new(&place.cell(), Role::Force);
        let joined = seat.join().expect("a daemon that is ready");
        let samples = (0.01 * rate_hz).min(512.0) as u32;
        let session = new_session();
        let block = ForceBlock { session, rate_hz, channels, samples, ..ForceBlock::default() };
        Self {
            monitor: Monitor::connect_to(&place.cell(), LIMIT).expect("a daemon that is ready"),
            verdicts: Vec::new(),
            sent: 0,
            block: Box::new(block),
            blocks: joined.publisher().expect("the place of the force source"),
            _seat: (seat, joined),
            chance: TestRng::new(7),
            frames: 0,
            samples_before: 0,
            start_ns: monotonic_ns(),
        }
    }

    /// Runs for that long in the stream's time. `signal(channel, t_s)` is added to noise of rms
    /// 0.6.
    pub fn run(&mut self, seconds: f64, signal: impl Fn(u32, f64) -> f64) {
        self.run_broken(seconds, signal, |_| {});
    }

    /// The same with blocks that are modified by `broken` before they are sent.
    pub fn run_broken(
        &mut self,
        seconds: f64,
        signal: impl Fn(u32, f64) -> f64,
        mut broken: impl FnMut(&mut ForceBlock),
    ) {
        let end = self.frames + (seconds * self.block.rate_hz) as u64;
        while self.frames < end {
            self.fill(&signal);
            let mut block = self.block.clone();
            broken(&mut block);
            self.send(&block);
        }
    }

    /// Drops blocks, like a sender without a receiver.
    pub fn lose(&mut self, blocks: u64) {
        for _ in 0..blocks {
            self.fill(&|_, _| 0.0);
        }
    }

    /// Starts another session: numbers and counts restart.
    pub fn start_anew(&mut self) {
        (self.block.session, self.block.seq, self.samples_before) = (new_session(), 0, 0);
    }

    /// Sends a block once the daemon has room for it.
    pub fn send(&mut self, block: &ForceBlock) {
        let start = Instant::now();
        while self.sent - self.blocks_received() >= UNDER_WAY {
            assert!(start.elapsed() < LIMIT, "the daemon takes no blocks: {:?}", self.status());
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(self.blocks.send(block), SendOutcome::Delivered);
        self.sent += 1;
        self.verdicts.extend(std::iter::from_fn(|| self.monitor.vibration()));
    }

    /// The next status made after this call.
    pub fn status(&mut self) -> Status {
        let now_ns = monotonic_ns();
        self.wait("a status", |status| status.t_ns > now_ns)
    }

    /// The first status for which the condition holds.
    pub fn wait(&mut self, what: &str, holds: impl Fn(&Status) -> bool) -> Status {
        let start = Instant::now();
        loop {
            self.verdicts.extend(std::iter::from_fn(|| self.monitor.vibration()));
            let status = self.monitor.status().filter(|status| holds(status));
            if let Some(status) = status {
                return status;
            }
            assert!(start.elapsed() < LIMIT, "{what} did not come: {:?}", self.monitor.status());
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// The first status after the daemon has processed everything sent.
    pub fn settled(&mut self) -> Status {
        let sent = self.sent;
        self.wait("the last block", |status| blocks_received(status) >= sent);
        // The sensor status is updated every 20 ms.
        let heard_ns = monotonic_ns() + 40_000_000;
        self.wait("an account", |status| status.t_ns > heard_ns)
    }

    /// Writes the next block: its samples, numbers and times.
    fn fill(&mut self, signal: &impl Fn(u32, f64) -> f64) {
        let block = &mut *self.block;
        let samples = block.samples as usize;
        block.seq += 1;
        block.samples_before = self.samples_before;
        let t_s = self.frames as f64 / block.rate_hz;
        block.t_ns = self.start_ns + (t_s * 1e9) as u64;
        block.sent_ns = monotonic_ns();
        for channel in 0..block.channels {
            for s in 0..samples {
                let noise: f64 = (0..4).map(|_| self.chance.uniform() - 0.5).sum();
                let value = noise + signal(channel, t_s + s as f64 / block.rate_hz);
                block.data[channel as usize * samples + s] = value;
            }
        }
        self.frames += u64::from(block.samples);
        self.samples_before += u64::from(block.samples);
    }

    fn blocks_received(&mut self) -> u64 {
        self.monitor.status().map_or(0, |status| blocks_received(&status))
    }
}

/// Blocks received by the daemon, accepted or not.
fn blocks_received(status: &Status) -> u64 {
    status.force_blocks + status.force_refused
}
