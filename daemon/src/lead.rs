//! Lead compensation: the values added to the commands of a robot in motion to compensate delay, lags and modes of its joints. Passes commands and the client's horizon to the filter of the model.
//!
//! Runs in the cycle, without allocation; a cell without `[dynamic]` computes nothing. The equations are in `joint_dynamics::Filter`.

use crate::exchange::LeadCounters;
use joint_dynamics::plant::Plants;
use joint_dynamics::{Filter, FilterTaps, TapsSettings};
use physics::{JOINTS_MAX, Joints};
use recording::model::RobotModel;
use shm_schema::{Command, Horizon, LeadState};

/// Largest difference of a command from the setpoint that the horizon stated for it, rad or m; beyond, the path has been changed since. Far above rounding, and below what a joint in motion
/// moves in a delay.
const SETPOINT_TOLERANCE: f64 = 1e-3;

/// Settings of the lead.
#[derive(Clone, Copy, Debug)]
pub struct LeadSettings {
    /// Settings of the filter.
    pub taps: TapsSettings,
    /// Between two commands, s; short enough for the bandwidth.
    pub period_s: f64,
    /// A command that moves a joint faster than this many times its stated speed is a jump, from which the path restarts.
    pub jump_margin: f64,
}

impl LeadSettings {
    /// The filter for a model; `None` if it has no delay, lag or mode of a joint.
    #[must_use]
    pub fn filter(&self, model: &RobotModel) -> Option<Box<Filter>> {
        let plants = Plants::of(model, self.taps.unstated);
        let taps = FilterTaps::new(&plants, self.period_s, &self.taps).ok()?;
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
    /// The newest horizon; without points once it is refused.
    horizon: Box<Horizon>,
    /// Run and number of the last command.
    last: Option<(u64, u64)>,
    refused: u64,
}

impl Lead {
    /// Buffer for the newest horizon.
    pub fn horizon_mut(&mut self) -> &mut Horizon {
        &mut self.horizon
    }

    /// Shows the state before the first command.
    pub fn publish_initial(&self, filter: Option<&Filter>, counters: &LeadCounters) {
        let used_at_most = filter.map_or(0, Filter::commands_ahead) as u32;
        let state = if filter.is_some() { LeadState::NoHorizon } else { LeadState::NothingInTime };
        counters.store(state, 0, used_at_most, self.refused);
    }

    /// Refuses a new horizon in which a joint moves faster than it can.
    pub fn check_horizon(&mut self, filter: Option<&Filter>) {
        let Some(filter) = filter else { return };
        let jumps = |ends: &[Joints]| filter.is_jump(&ends[0], &ends[1]);
        if self.horizon.points().windows(2).any(jumps) {
            self.refuse_horizon();
        }
    }

    fn refuse_horizon(&mut self) {
        self.horizon.count = 0;
        self.refused += 1;
    }

    /// The lead of `command`, rad or m.
    pub fn step(
        &mut self,
        filter: Option<&mut Filter>,
        command: &Command,
        counters: &LeadCounters,
    ) -> Joints {
        let Some(filter) = filter else {
            self.publish_initial(None, counters);
            return [0.0; JOINTS_MAX];
        };
        match self.last {
            Some((session, seq)) if session == command.session => {
                if command.seq <= seq {
                    // The corrector refuses it: it is not part of the path.
                    return [0.0; JOINTS_MAX];
                }
            }
            _ => filter.restart(),
        }
        self.last = Some((command.session, command.seq));
        let mut q = [0.0; JOINTS_MAX];
        q[..command.joints().len()].copy_from_slice(command.joints());
        self.check_command(filter, command, &q);
        let following = self.upcoming_setpoints(command);
        let (lead, ahead) = filter.step(&q, command.t_ns, following);
        let state = match ahead.known {
            _ if !ahead.is_sufficient() => LeadState::NoHorizon,
            known if known < ahead.used_at_most => LeadState::ShortHorizon,
            _ => LeadState::Horizon,
        };
        counters.store(state, ahead.known as u32, ahead.used_at_most as u32, self.refused);
        lead
    }

    /// Number of commands since the horizon was stated, if it belongs to the command's run.
    fn commands_since(&self, command: &Command) -> Option<usize> {
        let passed = command.seq.checked_sub(self.horizon.command_seq)?;
        let is_of_this_run = self.horizon.session == command.session;
        usize::try_from(passed).ok().filter(|_| is_of_this_run)
    }

    /// The setpoints that are known to follow a command.
    fn upcoming_setpoints(&self, command: &Command) -> &[Joints] {
        let passed = self.commands_since(command);
        passed.and_then(|passed| self.horizon.points().get(passed..)).unwrap_or(&[])
    }

    /// Refuses the horizon if this command, at `q`, differs from the setpoint that it stated, or if no joint could move from here to the next one.
    fn check_command(&mut self, filter: &Filter, command: &Command, q: &Joints) {
        let Some(passed) = self.commands_since(command) else { return };
        let points = self.horizon.points();
        // A non-finite command is refused by the corrector and contains no information on the path.
        let is_off = |(q, foretold): (&f64, &f64)| (q - foretold).abs() > SETPOINT_TOLERANCE;
        let foretold = passed.checked_sub(1).and_then(|place| points.get(place));
        let has_left = foretold.is_some_and(|foretold| q.iter().zip(foretold).any(is_off));
        if has_left || points.get(passed).is_some_and(|next| filter.is_jump(q, next)) {
            self.refuse_horizon();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use joint_dynamics::plant::{Plant, UncertainValue};
    use shm_schema::Status;

    const PERIOD_NS: u64 = 4_000_000;
    /// rad per command.
    const SPEED: f64 = 1e-3;

    struct Bench {
        lead: Lead,
        filter: Filter,
        counters: LeadCounters,
    }

    /// One joint with a delay of 20 ms: five commands.
    fn bench() -> Bench {
        bench_of(f64::INFINITY)
    }

    /// The same for a joint that moves by at most `reach` from one command to the next.
    fn bench_of(reach: f64) -> Bench {
        let delay = UncertainValue { value: 0.02, sigma: 0.0 };
        let plant = Plant { delays_s: vec![delay], ..Plant::default() };
        let plants = Plants { joints: vec![plant], left_out: Vec::new() };
        let taps =
            FilterTaps::new(&plants, 1e-9 * PERIOD_NS as f64, &TapsSettings::default()).unwrap();
        let filter = Filter::new(taps, [reach; JOINTS_MAX]);
        Bench { lead: Lead::default(), filter, counters: LeadCounters::default() }
    }

    fn position(k: u64) -> Joints {
        let mut q = [0.0; JOINTS_MAX];
        q[0] = SPEED * k as f64;
        q
    }

    impl Bench {
        /// The horizon after command `seq` of a run.
        fn know(&mut self, session: u64, seq: u64, count: u32) {
            let horizon = self.lead.horizon_mut();
            (horizon.session, horizon.command_seq, horizon.count) = (session, seq, count);
            for (k, point) in (1..).zip(&mut horizon.points) {
                *point = position(seq + k);
            }
        }

        /// The lead of command `seq` of a run, and the status after it.
        fn step(&mut self, session: u64, seq: u64) -> (f64, Status) {
            let command = Command {
                session,
                seq,
                t_ns: seq * PERIOD_NS,
                joints: 1,
                q: position(seq),
                ..Command::default()
            };
            let lead = self.lead.step(Some(&mut self.filter), &command, &self.counters);
            let mut status = Status::default();
            self.counters.write_status(&mut status);
            (lead[0], status)
        }
    }

    #[test]
    fn the_state_is_shown_before_the_first_command() {
        let Bench { lead, filter, counters } = bench();
        for (filter, state) in
            [(Some(&filter), LeadState::NoHorizon), (None, LeadState::NothingInTime)]
        {
            lead.publish_initial(filter, &counters);
            let mut status = Status::default();
            counters.write_status(&mut status);
            assert_eq!(status.lead_state(), Ok(state));
        }
    }

    #[test]
    fn a_horizon_serves_the_commands_that_it_states_until_less_than_the_delay_is_left() {
        let mut bench = bench();
        bench.know(7, 1, 100);
        for seq in 1..=101 {
            let (lead, status) = bench.step(7, seq);
            let left = 101 - seq;
            assert_eq!(u64::from(status.horizon_points), left);
            assert_eq!(lead > 0.0, left >= 5, "{seq}: {lead}");
            let state = if left >= 5 { LeadState::ShortHorizon } else { LeadState::NoHorizon };
            assert_eq!(status.lead_state(), Ok(state));
            assert_eq!(status.horizons_refused, 0);
        }
    }

    #[test]
    fn a_horizon_ends_with_the_first_command_that_differs_and_is_counted_once() {
        let mut bench = bench();
        bench.know(7, 1, 100);
        (1..20).for_each(|seq| assert!(bench.step(7, seq).0 > 0.0));
        bench.lead.horizon_mut().points[18][0] += 0.9e-3;
        assert!(bench.step(7, 20).0 > 0.0, "within a milliradian");
        bench.lead.horizon_mut().points[19][0] += 1.1e-3;
        for seq in 21..30 {
            let (lead, status) = bench.step(7, seq);
            assert_eq!((lead, status.horizons_refused), (0.0, 1));
        }
    }

    #[test]
    fn a_horizon_of_another_run_or_of_a_later_command_is_not_used() {
        let mut bench = bench();
        bench.know(8, 1, 100);
        assert_eq!(bench.step(7, 2).0, 0.0);
        bench.know(7, 40, 100);
        assert_eq!(bench.step(7, 3).0, 0.0);
        assert_eq!(bench.step(7, 4).1.horizons_refused, 0);
    }

    #[test]
    fn a_horizon_that_no_joint_could_follow_is_refused() {
        for (place, refused) in [(0, 1), (50, 1), (99, 1), (100, 0)] {
            let mut bench = bench_of(2.5 * SPEED);
            bench.know(7, 1, 100);
            bench.lead.horizon_mut().points[place][0] += 0.1;
            bench.lead.check_horizon(Some(&bench.filter));
            let (lead, status) = bench.step(7, 1);
            assert_eq!((lead > 0.0, status.horizons_refused), (refused == 0, refused), "{place}");
        }
        // From the command itself to the first setpoint.
        let mut bench = bench_of(2.5 * SPEED);
        bench.know(7, 4, 100);
        bench.lead.horizon_mut().command_seq = 1;
        bench.lead.check_horizon(Some(&bench.filter));
        let (lead, status) = bench.step(7, 1);
        assert_eq!((lead, status.horizons_refused), (0.0, 1));
    }

    #[test]
    fn commands_that_come_again_or_too_late_are_no_part_of_the_path() {
        let (mut plain, mut shaken) = (bench(), bench());
        plain.know(7, 1, 120);
        shaken.know(7, 1, 120);
        for seq in 1..60 {
            let expected = plain.step(7, seq).0;
            assert_eq!(shaken.step(7, seq).0, expected);
            if seq > 10 {
                assert_eq!(shaken.step(7, seq).0, 0.0);
                assert_eq!(shaken.step(7, seq - 3).0, 0.0);
            }
        }
    }

    #[test]
    fn another_run_begins_at_rest() {
        let mut bench = bench();
        for seq in 1..60 {
            let _ = bench.step(7, seq);
        }
        let mut fresh = self::bench();
        bench.know(8, 60, 100);
        fresh.know(8, 60, 100);
        assert_eq!(bench.step(8, 60).0, fresh.step(8, 60).0);
    }
}
