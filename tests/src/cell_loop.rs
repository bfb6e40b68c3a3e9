//! A robot's loop at 1 kHz: all joints on sines. Every target that it would send is checked by the
//! oracle, in every state; violations are kept as text.

use crate::oracle::Oracle;
use shm_schema::Cell;
use std::time::Duration;
use trued_client::{
    Client, ConnectError, CorrectionStatus, Mode, SendError, Setpoint, Source, Status, monotonic_ns,
};

/// Joints of the arm.
pub const JOINTS: usize = 6;
/// Time between commands, ns.
pub const TICK_NS: u64 = 1_000_000;
/// Centre of the sines, rad.
pub const MIDDLE: [f64; JOINTS] = [0.2, 0.3, -0.2, 0.3, 0.8, 0.1];
const SWING_RAD: f64 = 0.05;
const PERIOD_S: f64 = 5.0;
/// Largest delay of the client's knowledge of changed limits, s: a status is published every 40 ms.
pub(crate) const STATUS_S: f64 = 0.2;

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

/// Result of one tick.
#[derive(Clone, Copy, Debug)]
pub struct Tick {
    /// The command, rad.
    pub q_cmd: [f64; JOINTS],
    /// The target sent to the robot, rad.
    pub target: [f64; JOINTS],
    /// Target minus command, rad.
    pub correction: [f64; JOINTS],
    /// Source of its correction.
    pub source: Source,
    /// Whether the daemon answered this command in time.
    pub answered: bool,
    /// Whether it refused it.
    pub refused: bool,
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
    /// Violations, as text.
    pub broken: Vec<String>,
    oracle: Oracle,
    status: Status,
    patience: Duration,
    /// Offset of the clock that stamps the commands, ns.
    pub clock_set_ns: i64,
    due_ns: u64,
    /// Stamp of the command sent last, ns.
    stamp_ns: u64,
}

impl CellLoop {
    /// Joins the cell's daemon; each tick waits for its answer for at most `patience`.
    ///
    /// # Errors
    /// See [`ConnectError`].
    pub fn join(cell: &Cell, patience: Duration) -> Result<Self, ConnectError> {
        let mut client = Client::connect_to(cell, Duration::from_secs(10))?;
        let status = client.status().expect("connected with a status");
        let oracle = Oracle::new(&status.bounds, STATUS_S);
        let (ticks, broken, due_ns) = (0, Vec::new(), monotonic_ns());
        Ok(Self {
            client,
            ticks,
            broken,
            oracle,
            status,
            patience,
            clock_set_ns: 0,
            due_ns,
            stamp_ns: 0,
        })
    }

    /// Waits until the next tick is due, sends a command, and checks the answer.
    pub fn tick(&mut self) -> Tick {
        self.due_ns = (self.due_ns + TICK_NS).max(monotonic_ns().saturating_sub(TICK_NS));
        let early_ns = self.due_ns.saturating_sub(monotonic_ns());
        std::thread::sleep(Duration::from_nanos(early_ns));
        let q_cmd = path(monotonic_ns());
        let sent_ns = monotonic_ns();
        let t_ns = sent_ns.saturating_add_signed(self.clock_set_ns);
        let sent = self.client.send(&Setpoint::new(&q_cmd).at_ns(t_ns));
        // The client paces itself by the stamp of the last target sent.
        if matches!(sent, Ok(_) | Err(SendError::Lost)) {
            self.stamp_ns = t_ns;
        }
        let answer = sent.ok().and_then(|seq| self.client.wait_corrected(seq, self.patience));
        let now_ns = monotonic_ns();
        let target = self.client.target_for(&q_cmd, now_ns).expect("a command of numbers");
        let rejected = CorrectionStatus::Rejected.code();
        let mut tick = Tick {
            q_cmd,
            target: [0.0; JOINTS],
            correction: [0.0; JOINTS],
            source: target.source(),
            answered: answer.is_some(),
            refused: answer.is_some_and(|answer| answer.status == rejected),
        };
        tick.target.copy_from_slice(target.joints());
        for (i, q_cmd) in q_cmd.iter().enumerate() {
            tick.correction[i] = tick.target[i] - q_cmd;
        }
        self.ticks += 1;
        self.watch_status(now_ns, &tick);
        tick
    }

    /// Ticks until `enough` holds, or `limit` has passed.
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

    fn watch_status(&mut self, now_ns: u64, tick: &Tick) {
        if let Some(status) = self.client.status() {
            self.status = status;
            self.oracle.set_bounds(now_ns, &status.bounds);
            let is_shadow = status.mode == Mode::Shadow.code();
            self.oracle.set_shadow(now_ns, is_shadow && tick.source != Source::Plain);
        }
        if let Err(violation) = self.oracle.take(now_ns, self.stamp_ns, &tick.q_cmd, &tick.target) {
            self.broken.push(format!("tick {} ({:?}): {violation}", self.ticks, tick.source));
        }
    }
}
