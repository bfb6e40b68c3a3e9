//! What the joints lead their commands by in motion: passes commands and the horizon of the robot's client to the filter of the model.
//!
//! Runs in the cycle, without allocation; a cell without `[dynamic]` computes nothing. The equations are in `joint_dynamics::Filter`.

use crate::exchange::LeadCounters;
use joint_dynamics::plant::Plants;
use joint_dynamics::{Filter, Taps, TapsSettings};
use physics::{JOINTS_MAX, Joints};
use recording::model::RobotModel;
use shm_schema::{Command, Horizon, LeadState};

/// A command may differ so much from its setpoint of the horizon, rad or m; more means that the path has been changed since. Far above rounding, and less than joints in motion
/// move in a delay.
const SETPOINT_TOLERANCE: f64 = 1e-3;

/// Settings of the lead.
#[derive(Clone, Copy, Debug)]
pub struct LeadSettings {
    /// Of the filter.
    pub taps: TapsSettings,
    /// Between two commands, s; short enough for the bandwidth.
    pub period_s: f64,
    /// A command that moves a joint faster than so many times its stated speed is a jump: the path begins anew.
    pub jump_margin: f64,
}

impl LeadSettings {
    /// The filter for a model; `None` if it has no delay, lag or mode of a joint.
    #[must_use]
    pub fn filter(&self, model: &RobotModel) -> Option<Box<Filter>> {
        let plants = Plants::of(model, self.taps.unstated);
        let taps = Taps::new(&plants, self.period_s, &self.taps).ok()?;
        let mut reach = [f64::INFINITY; JOINTS_MAX];
        for (reach, joint) in reach.iter_mut().zip(model.physics.arm.joints()) {
            *reach = self.jump_margin * joint.max_speed * self.period_s;
        }
        Some(Box::new(Filter::new(taps, reach)))
    }
}

/// The lead of a cell.
#[derive(Debug, Default)]
pub struct Lead {
    /// The newest horizon; without points once the path has left it.
    horizon: Box<Horizon>,
    session: u64,
    refused: u64,
}

impl Lead {
    /// Where the newest horizon is to be read into.
    pub fn horizon_mut(&mut self) -> &mut Horizon {
        &mut self.horizon
    }

    /// What the joints are to lead `command` by, rad or m.
    pub fn step(
        &mut self,
        filter: Option<&mut Filter>,
        command: &Command,
        counters: &LeadCounters,
    ) -> Joints {
        let Some(filter) = filter else {
            counters.show(LeadState::NothingInTime, 0, 0, self.refused);
            return [0.0; JOINTS_MAX];
        };
        if command.session != self.session {
            self.session = command.session;
            filter.restart();
        }
        let mut q = [0.0; JOINTS_MAX];
        q[..command.joints().len()].copy_from_slice(command.joints());
        self.drop_if_left(command.seq, &q);
        let following = self.following(command);
        let (lead, ahead) = filter.step(&q, command.t_ns, following);
        let state = match ahead.known {
            _ if !ahead.is_enough() => LeadState::NoHorizon,
            known if known < ahead.used_at_most => LeadState::ShortHorizon,
            _ => LeadState::Horizon,
        };
        counters.show(state, ahead.known as u32, ahead.used_at_most as u32, self.refused);
        lead
    }

    /// The setpoints that are known to follow a command.
    fn following(&self, command: &Command) -> &[Joints] {
        let of_this_run = self.horizon.session == command.session;
        let passed = command.seq.checked_sub(self.horizon.command_seq).filter(|_| of_this_run);
        let passed = passed.and_then(|passed| usize::try_from(passed).ok());
        passed.and_then(|passed| self.horizon.points().get(passed..)).unwrap_or(&[])
    }

    /// Drops the horizon where this command is not the setpoint that it foretold.
    fn drop_if_left(&mut self, seq: u64, q: &Joints) {
        let passed = seq.checked_sub(self.horizon.command_seq).filter(|passed| *passed > 0);
        let place = passed.and_then(|passed| usize::try_from(passed - 1).ok());
        let Some(foretold) = place.and_then(|place| self.horizon.points().get(place)) else {
            return;
        };
        // A command without a number is refused elsewhere, and says nothing of the path.
        let is_off = |(q, foretold): (&f64, &f64)| (q - foretold).abs() > SETPOINT_TOLERANCE;
        if q.iter().zip(foretold).any(is_off) {
            self.horizon.count = 0;
            self.refused += 1;
        }
    }
}
