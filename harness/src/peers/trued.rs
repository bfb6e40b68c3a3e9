//! The measured round trip: client library, daemon with its correction, client library.
//!
//! Every trip commands another pose, at a realistic speed, with a wrench and temperatures, so that
//! no part of the correction is skipped; the answers are counted by status.

use std::time::Duration;

use trued_client::{
    Client, Corrected, CorrectionStatus, Reason, Setpoint, WrenchFrame, monotonic_ns,
};

use super::{ANSWER_WITHIN, RoundTrip};
use crate::latencies::Latencies;

/// Amplitude of each joint's oscillation, as a share of its range, and its period, s.
const SWING: f64 = 0.02;
const SWING_S: f64 = 4.0;
/// Centre of the oscillation, as a share of the range: not in the middle, where many wrists are
/// singular.
const CENTRE: f64 = 0.65;
/// Load on the tool, N and N·m.
const WRENCH: [f64; 6] = [50.0, -20.0, 30.0, 0.5, 0.2, 0.1];
const AMBIENT_C: f64 = 24.0;
/// Number of consecutive corrected answers after which the daemon counts as settled.
const SETTLED_ANSWERS: u32 = 16;
/// Time between commands meanwhile.
const SETTLING_INTERVAL: Duration = Duration::from_millis(1);

/// The client's side.
pub(crate) struct Trued {
    pub(crate) client: Client,
    ranges: Vec<(f64, f64)>,
    /// Time along the path, and the clock when it was reached, ns.
    path_ns: u64,
    there_ns: u64,
    pub(crate) answers: Answers,
    pub(crate) newest: Option<Corrected>,
}

/// Counts of the answers.
#[derive(Debug, Default)]
pub(crate) struct Answers {
    /// Time in the daemon, from the reception of a command to its answer.
    pub(crate) correction: Latencies,
    /// The rest of the trip: both libraries and the transport.
    pub(crate) around: Latencies,
    /// By [`CorrectionStatus`], and those with a solved correction, even if it is still ramping.
    pub(crate) by_status: [u64; CorrectionStatus::ALL.len()],
    pub(crate) solved: u64,
}

impl Trued {
    pub(crate) fn new(mut client: Client) -> Self {
        let bounds = client.status().map(|status| (status.joints as usize, status.bounds));
        let ranges = bounds.map_or_else(Vec::new, |(joints, bounds)| {
            let range = |i: usize| (bounds.min[i], bounds.max[i] - bounds.min[i]);
            (0..joints).map(range).map(|(min, width)| (min + CENTRE * width, width)).collect()
        });
        Self {
            client,
            ranges,
            path_ns: 0,
            there_ns: monotonic_ns(),
            answers: Answers::default(),
            newest: None,
        }
    }

    /// The arm was at rest since the last command: a daemon that was stopped for other measurements
    /// must find it at the same place, or it would ramp.
    fn hold_position(&mut self) {
        self.there_ns = monotonic_ns();
    }

    /// Sends commands until the daemon corrects, for at most `within`, without counting. The arm
    /// continues from there: a sudden start would cause a ramp.
    pub(crate) fn settle(&mut self, within: Duration) {
        self.hold_position();
        let counted = std::mem::take(&mut self.answers);
        let until_ns = monotonic_ns() + within.as_nanos() as u64;
        let mut row = 0;
        while row < SETTLED_ANSWERS && monotonic_ns() < until_ns {
            let answered = self.command(ANSWER_WITHIN).1.is_some();
            let corrected =
                self.newest.is_some_and(|made| made.status() == Ok(CorrectionStatus::Corrected));
            row = if answered && corrected { row + 1 } else { 0 };
            std::thread::sleep(SETTLING_INTERVAL);
        }
        self.answers = counted;
    }

    /// The position on the path at `t_ns`.
    fn setpoint(&mut self, t_ns: u64) -> Setpoint {
        let mut q = [0.0; trued_client::JOINTS_MAX];
        self.path_ns += t_ns.saturating_sub(self.there_ns);
        self.there_ns = t_ns;
        let phase = std::f64::consts::TAU * self.path_ns as f64 * 1e-9 / SWING_S;
        for (i, (lower, width)) in self.ranges.iter().enumerate() {
            q[i] = lower + SWING * width * (phase + i as f64).sin();
        }
        // The exact position on the path at this time; otherwise a trip's jitter would be a jerk.
        Setpoint::new(&q[..self.ranges.len()])
            .at_ns(t_ns)
            .wrench(WRENCH, WrenchFrame::Tool)
            .temperatures(AMBIENT_C, &[])
    }

    /// Sends a command and awaits the answer for at most `limit`; returns the times of sending and
    /// of the answer.
    pub(crate) fn command(&mut self, limit: Duration) -> (u64, Option<u64>) {
        let setpoint = self.setpoint(monotonic_ns());
        let sent_ns = monotonic_ns();
        let Ok(seq) = self.client.send(&setpoint) else { return (sent_ns, None) };
        let Some(answer) = self.client.wait_corrected(seq, limit) else { return (sent_ns, None) };
        let here_ns = monotonic_ns();
        self.count_answer(&answer, here_ns - sent_ns);
        (sent_ns, Some(here_ns))
    }

    fn count_answer(&mut self, answer: &Corrected, trip_ns: u64) {
        let made_in_ns = answer.made_ns.saturating_sub(answer.received_ns);
        let counted = &mut self.answers;
        counted.correction.record(made_in_ns);
        counted.around.record(trip_ns.saturating_sub(made_in_ns));
        if let Some(count) = counted.by_status.get_mut(answer.status as usize) {
            *count += 1;
        }
        counted.solved += u64::from(is_solved(answer));
        self.newest = Some(*answer);
    }
}

/// Whether a correction was solved for, limited or not.
fn is_solved(answer: &Corrected) -> bool {
    let made = [
        CorrectionStatus::Corrected,
        CorrectionStatus::Ramping,
        CorrectionStatus::Shadow,
        CorrectionStatus::Limited,
    ];
    let is_expected = answer.status().is_ok_and(|status| made.contains(&status));
    is_expected
        && answer
            .reason()
            .is_ok_and(|reason| ![Reason::NotConverged, Reason::Stale].contains(&reason))
}

impl RoundTrip for Trued {
    fn round_trip(&mut self, _: u64) -> Option<u64> {
        let (sent_ns, here_ns) = self.command(ANSWER_WITHIN);
        here_ns.map(|here_ns| here_ns - sent_ns)
    }
}
