//! The client side: commands, clock, and targets sent to the robot.

use crate::cell_loop::{JOINTS, path};
use crate::rng::TestRng;
use shm_schema::{Command, Corrected, JOINTS_MAX, JointBounds};
use trued_client::{Output, Setpoint, Source};

/// Time after its command at which the robot's loop reads the answer, ns.
pub(super) const READ_AFTER_NS: u64 = 300_000;

/// Data sent to the robot in one tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sent {
    /// Stamp of the last command sent to the daemon, ns.
    pub(super) stamp_ns: u64,
    /// The command, rad.
    pub(super) command: [f64; JOINTS],
    /// The target, rad.
    pub(super) target: [f64; JOINTS],
    /// Source of its correction.
    pub(super) source: Source,
    /// The correction, rad.
    pub(super) correction: [f64; JOINTS_MAX],
}

/// The robot's loop.
pub(super) struct Client {
    output: Output,
    session: u64,
    seq: u64,
    q_cmd: [f64; JOINTS],
    sent: Option<Command>,
    newest: Option<Corrected>,
    clock_set_ns: i64,
    /// Temporary offset of the path's joints, rad, and its remaining ticks.
    odd: ([f64; JOINTS], u64),
}

impl Client {
    pub(super) fn new(bounds: &JointBounds) -> Self {
        let mut output = Output::new();
        output.set_bounds(bounds);
        Self {
            output,
            session: 1,
            seq: 0,
            q_cmd: [0.0; JOINTS],
            sent: None,
            newest: None,
            clock_set_ns: 0,
            odd: ([0.0; JOINTS], 0),
        }
    }

    pub(super) fn set_bounds(&mut self, bounds: &JointBounds) {
        self.output.set_bounds(bounds);
    }

    /// Another daemon was joined.
    pub(super) fn rejoined(&mut self) {
        self.newest = None;
    }

    /// Starts another session; the correction continues.
    pub(super) fn start_anew(&mut self, session: u64) {
        (self.session, self.seq) = (session, 0);
    }

    /// Another run; the robot is at its command.
    pub(super) fn start_at_zero(&mut self, session: u64) {
        self.start_anew(session);
        self.output.start_from(&[]);
    }

    /// The clock that stamps commands jumps by up to a minute, or by up to a second.
    pub(super) fn set_clock(&mut self, rng: &mut TestRng) {
        let most_ns = if rng.below(2) == 0 { 60_000_000_000 } else { 1_000_000_000 };
        let by_ns = rng.below(most_ns).cast_signed();
        self.clock_set_ns += if rng.below(2) == 0 { by_ns } else { -by_ns };
    }

    /// The commands leave the model's limits for a while, jump, or are not finite.
    pub(super) fn go_astray(&mut self, rng: &mut TestRng) {
        let by = [1.0, 10.0, -7.0, 1e3, f64::NAN, f64::INFINITY][rng.below(6) as usize];
        let mut odd = [0.0; JOINTS];
        odd[rng.below(JOINTS as u64) as usize] = by;
        self.odd = (odd, 1 + rng.below(300));
    }

    /// The command of this tick, as sent to the daemon; `None` if it is not finite.
    pub(super) fn command(&mut self, now_ns: u64, calm: bool) -> Option<Command> {
        self.q_cmd = path(now_ns);
        let (odd, ticks) = &mut self.odd;
        *ticks = if calm { 0 } else { ticks.saturating_sub(1) };
        if *ticks > 0 {
            self.q_cmd.iter_mut().zip(odd).for_each(|(q, odd)| *q += *odd);
        }
        // A clock that shows no time before 1970.
        let t_ns = now_ns.saturating_add_signed(self.clock_set_ns).max(1);
        let setpoint = Setpoint::new(&self.q_cmd).at_ns(t_ns);
        let command = setpoint.command(self.seq + 1, self.session, now_ns).ok()?;
        self.seq += 1;
        self.sent = Some(command);
        Some(command)
    }

    /// The target for the robot, given the answer received; none for a command that is not finite.
    pub(super) fn send(&mut self, fresh: Option<Corrected>, now_ns: u64) -> Option<Sent> {
        self.newest = fresh.or(self.newest);
        let (newest, sent) = (self.newest.as_ref(), self.sent.as_ref());
        let target = self.output.target(&self.q_cmd, newest, sent, now_ns).ok()?;
        let mut joints = [0.0; JOINTS];
        joints.copy_from_slice(target.joints());
        Some(Sent {
            stamp_ns: sent.map_or(0, |sent| sent.t_ns),
            command: self.q_cmd,
            target: joints,
            source: target.source(),
            correction: self.output.correction(),
        })
    }

    /// The daemon's newest answer to the newest command.
    pub(super) fn answered(&self) -> Option<&Corrected> {
        let (newest, sent) = (self.newest.as_ref()?, self.sent?);
        let is_answer = (newest.command_session, newest.command_seq) == (sent.session, sent.seq);
        Some(newest).filter(|_| is_answer)
    }
}
