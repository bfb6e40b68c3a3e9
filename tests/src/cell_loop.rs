//! A robot's loop at 1 kHz: all joints on sines, and a look at everything that it would publish.
//!
//! Promises: every published target is held against limits, envelope and rate; what breaks is kept in words.

use crate::gauge::Gauge;
use shm_schema::Cell;
use std::time::Duration;
use trued_client::{Client, ConnectError, Connection, Setpoint, Source, Status, monotonic_ns};

/// Joints of the arm.
pub const JOINTS: usize = 6;
/// Time between commands, ns.
pub const TICK_NS: u64 = 1_000_000;
/// Where the sines are zero, rad.
pub const MIDDLE: [f64; JOINTS] = [0.2, 0.3, -0.2, 0.3, 0.8, 0.1];
const SWING_RAD: f64 = 0.05;
const PERIOD_S: f64 = 5.0;
/// By how much the times of command and target may part between two ticks in which nobody is held up, s.
const STAMPED_S: f64 = 5e-5;
/// Rounding of a sum and a difference, rad.
const ROUNDING: f64 = 1e-12;

/// The command at a time of `CLOCK_MONOTONIC`.
#[must_use]
pub fn path(t_ns: u64) -> [f64; JOINTS] {
    let turns = t_ns as f64 * 1e-9 / PERIOD_S;
    let mut q = MIDDLE;
    for (i, q) in q.iter_mut().enumerate() {
        *q += SWING_RAD * (std::f64::consts::TAU * (turns + 0.1 * i as f64)).sin();
    }
    q
}

/// What one tick came to.
#[derive(Clone, Copy, Debug)]
pub struct Tick {
    /// The command, rad.
    pub q_cmd: [f64; JOINTS],
    /// What the robot gets, rad.
    pub target: [f64; JOINTS],
    /// Target minus command; for a refused command what the daemon said, rad.
    pub correction: [f64; JOINTS],
    /// Where the target comes from.
    pub source: Source,
    /// Whether the daemon answered this very command in time.
    pub answered: bool,
}

impl Tick {
    /// The largest correction of a joint, rad.
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.correction.iter().fold(0.0, |most: f64, c| most.max(c.abs()))
    }
}

/// The loop.
pub struct CellLoop {
    /// The client; free for requests between ticks.
    pub client: Client,
    /// Ticks so far.
    pub ticks: u64,
    /// What broke, in words.
    pub broken: Vec<String>,
    /// The rate of what is published.
    gauge: Gauge,
    /// The rate of what the daemon says, which the client's own bounds may hide; and which daemon it is.
    said: (u64, Gauge),
    status: Status,
    patience: Duration,
    /// By how much the clock that stamps the commands has been set, ns.
    pub clock_set_ns: i64,
    due_ns: u64,
    before: Option<([u64; 2], Tick)>,
}

impl CellLoop {
    /// Joins the cell's daemon; each tick waits for its answer for at most `patience`.
    ///
    /// # Errors
    /// See [`ConnectError`].
    pub fn join(cell: &Cell, patience: Duration) -> Result<Self, ConnectError> {
        let mut client = Client::connect_to(cell, Duration::from_secs(10))?;
        let status = client.status().expect("connected with a status");
        let gauge = Gauge::new(&status.bounds.rate[..JOINTS]);
        let said = (0, gauge.clone());
        let (ticks, broken, due_ns) = (0, Vec::new(), monotonic_ns());
        Ok(Self {
            client,
            ticks,
            broken,
            gauge,
            said,
            status,
            patience,
            clock_set_ns: 0,
            due_ns,
            before: None,
        })
    }

    /// Waits until the next tick is due, commands, and looks at what comes.
    pub fn tick(&mut self) -> Tick {
        self.due_ns = (self.due_ns + TICK_NS).max(monotonic_ns().saturating_sub(TICK_NS));
        let early_ns = self.due_ns.saturating_sub(monotonic_ns());
        std::thread::sleep(Duration::from_nanos(early_ns));
        let q_cmd = path(monotonic_ns());
        let sent_ns = monotonic_ns();
        let t_ns = sent_ns.saturating_add_signed(self.clock_set_ns);
        let sent = self.client.send(&Setpoint::new(&q_cmd).at_ns(t_ns));
        let answer = sent.ok().and_then(|seq| self.client.wait_corrected(seq, self.patience));
        let now_ns = monotonic_ns();
        let target = self.client.target_for(&q_cmd, now_ns);
        let mut tick = Tick {
            q_cmd,
            target: [0.0; JOINTS],
            correction: [0.0; JOINTS],
            source: target.source(),
            answered: answer.is_some(),
        };
        tick.target.copy_from_slice(target.joints());
        for (i, q_cmd) in q_cmd.iter().enumerate() {
            tick.correction[i] = tick.target[i] - q_cmd;
        }
        if let (Source::Rejected, Some(said)) = (tick.source, self.client.newest()) {
            tick.correction.copy_from_slice(&said.correction[..JOINTS]);
        }
        self.ticks += 1;
        self.look([now_ns, sent_ns], &tick);
        tick
    }

    /// Ticks until `enough` holds, or `limit` is over.
    pub fn tick_until(
        &mut self,
        limit: Duration,
        mut enough: impl FnMut(&mut Self, &Tick) -> bool,
    ) -> bool {
        let end_ns = monotonic_ns() + limit.as_nanos() as u64;
        while monotonic_ns() < end_ns {
            let tick = self.tick();
            if enough(self, &tick) {
                return true;
            }
        }
        false
    }

    fn look(&mut self, at_ns: [u64; 2], tick: &Tick) {
        let bounds = &self.status.bounds;
        let mut broken = Vec::new();
        for i in 0..JOINTS {
            let (q, correction) = (tick.target[i], tick.correction[i]);
            if !(bounds.min[i]..=bounds.max[i]).contains(&q) {
                broken.push(format!("joint {i} is at {q}"));
            }
            let within = bounds.angle[i] + ROUNDING;
            if correction.is_nan() || correction.abs() > within {
                broken.push(format!("joint {i} is corrected by {correction}"));
            }
        }
        broken.extend(self.gauge.take(at_ns[0], &tick.correction).err());
        broken.extend(self.steps_in_a_ramp(at_ns, tick));
        broken.extend(self.step_of_the_daemon());
        let about = |words| format!("tick {} ({:?}): {words}", self.ticks, tick.source);
        self.broken.extend(broken.into_iter().map(about));
        self.before = Some((at_ns, *tick));
    }

    /// A daemon that has just started knows nothing of the one before.
    fn step_of_the_daemon(&mut self) -> Option<String> {
        let Connection::Connected { epoch, .. } = self.client.connection() else { return None };
        if epoch != self.said.0 {
            self.said = (epoch, Gauge::new(&self.status.bounds.rate[..JOINTS]));
        }
        let said = self.client.newest()?;
        let broken = self.said.1.take(said.made_ns, &said.correction[..JOINTS]).err();
        broken.map(|words| format!("the daemon itself: {words}"))
    }

    /// While the client itself ramps out, not even the daemon's allowance for a pause holds. A ramp takes the time between targets or between commands,
    /// whichever is longer: a loop that is held up between its command and its target parts the two.
    fn steps_in_a_ramp(&self, at_ns: [u64; 2], tick: &Tick) -> Option<String> {
        let (before_ns, before) = self.before.as_ref()?;
        if tick.source != Source::Ramping {
            return None;
        }
        let [of_targets, of_commands] = [0, 1].map(|k| at_ns[k] - before_ns[k]);
        let dt_s = of_targets.max(of_commands) as f64 * 1e-9;
        (0..JOINTS).find_map(|i| {
            let moved = (tick.correction[i] - before.correction[i]).abs();
            let most = self.status.bounds.rate[i] * (dt_s + STAMPED_S);
            (moved > most).then(|| format!("joint {i} stepped by {moved:.3e} in {dt_s:.6} s"))
        })
    }
}
