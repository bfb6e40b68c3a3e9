//! The client's side: its commands, its clock, and its own ramp.

use crate::cell_loop::{JOINTS, Tick, path};
use crate::chance::Chance;
use shm_schema::{Command, Corrected, JOINTS_MAX, JointBounds};
use trued_client::{Follower, Setpoint, Source};

/// How long after its command the robot's loop takes what there is, ns.
pub(super) const READ_AFTER_NS: u64 = 300_000;

/// The robot's loop.
pub(super) struct Client {
    follower: Follower,
    session: u64,
    seq: u64,
    sent: Option<Command>,
    newest: Option<Corrected>,
    clock_set_ns: i64,
}

impl Client {
    pub(super) fn new(bounds: &JointBounds) -> Self {
        let mut follower = Follower::new();
        follower.set_bounds(bounds);
        Self { follower, session: 1, seq: 0, sent: None, newest: None, clock_set_ns: 0 }
    }

    /// Another daemon was joined.
    pub(super) fn rejoined(&mut self) {
        self.newest = None;
        self.follower.rejoined();
    }

    /// Another run.
    pub(super) fn start_anew(&mut self, session: u64) {
        (self.session, self.seq) = (session, 0);
    }

    /// The clock that stamps commands jumps by up to a minute, or by up to a second.
    pub(super) fn set_clock(&mut self, chance: &mut Chance) {
        let most_ns = if chance.below(2) == 0 { 60_000_000_000 } else { 1_000_000_000 };
        let by_ns = chance.below(most_ns).cast_signed();
        self.clock_set_ns += if chance.below(2) == 0 { by_ns } else { -by_ns };
    }

    /// The command of this tick.
    pub(super) fn command(&mut self, now_ns: u64) -> Command {
        self.seq += 1;
        // A clock that shows no time before 1970.
        let t_ns = now_ns.saturating_add_signed(self.clock_set_ns).max(1);
        let setpoint = Setpoint::new(&path(now_ns)).at_ns(t_ns);
        let command = setpoint.command(self.seq, self.session, now_ns).expect("six joints");
        self.sent = Some(command);
        command
    }

    /// What the robot gets, given what has come.
    pub(super) fn read(&mut self, fresh: Option<Corrected>, now_ns: u64) -> Tick {
        self.newest = fresh.or(self.newest);
        let mut q_cmd = [0.0; JOINTS];
        q_cmd.copy_from_slice(&self.sent.map_or([0.0; JOINTS_MAX], |sent| sent.q)[..JOINTS]);
        let (newest, sent) = (self.newest.as_ref(), self.sent.as_ref());
        let target = self.follower.target(&q_cmd, newest, sent, now_ns);
        let answered = matches!((newest, sent), (Some(a), Some(s))
            if (a.command_session, a.command_seq) == (s.session, s.seq));
        let mut tick = Tick {
            q_cmd,
            target: [0.0; JOINTS],
            correction: [0.0; JOINTS],
            source: target.source(),
            answered,
        };
        tick.target.copy_from_slice(target.joints());
        for (i, q_cmd) in q_cmd.iter().enumerate() {
            tick.correction[i] = tick.target[i] - q_cmd;
        }
        if let (Source::Rejected, Some(said)) = (tick.source, newest) {
            tick.correction.copy_from_slice(&said.correction[..JOINTS]);
        }
        tick
    }
}
