//! The round trip that is judged: client library, daemon with its correction, client library.
//!
//! Promises: every trip commands another pose, at a speed that robots have, with a wrench and temperatures, so that nothing of the
//! correction can be left out; the answers are counted by how they were made.

use std::time::Duration;

use trued_client::{Client, Corrected, CorrectionStatus, Setpoint, WrenchFrame, monotonic_ns};

use super::{ANSWER_WITHIN, Peer};
use crate::latencies::Latencies;

/// Swing of each joint about its pose, as a share of its range, and the time of a swing, s.
const SWING: f64 = 0.02;
const SWING_S: f64 = 4.0;
/// Where in its range each joint stands: beside the middle, where many wrists are singular.
const STANDS: f64 = 0.65;
/// What acts on the tool, N and N·m.
const WRENCH: [f64; 6] = [50.0, -20.0, 30.0, 0.5, 0.2, 0.1];
const AMBIENT_C: f64 = 24.0;

/// The client's end.
pub(crate) struct Trued {
    pub(crate) client: Client,
    stands: Vec<(f64, f64)>,
    /// Time in the daemon, from taking a command to its answer.
    pub(crate) correction: Latencies,
    /// The trip without that time: what both libraries and the transport take.
    pub(crate) around: Latencies,
    /// Answers by [`CorrectionStatus`].
    pub(crate) by_status: [u64; CorrectionStatus::ALL.len()],
    pub(crate) newest: Option<Corrected>,
}

impl Trued {
    pub(crate) fn new(mut client: Client) -> Self {
        let bounds = client.status().map(|status| (status.joints as usize, status.bounds));
        let stands = bounds.map_or_else(Vec::new, |(joints, bounds)| {
            let range = |i: usize| (bounds.min[i], bounds.max[i] - bounds.min[i]);
            (0..joints).map(range).map(|(min, width)| (min + STANDS * width, width)).collect()
        });
        let by_status = [0; CorrectionStatus::ALL.len()];
        let (correction, around) = (Latencies::default(), Latencies::default());
        Self { client, stands, correction, around, by_status, newest: None }
    }

    /// Where the path is at `t_ns`.
    fn setpoint(&self, t_ns: u64) -> Setpoint {
        let mut q = [0.0; trued_client::JOINTS_MAX];
        let phase = std::f64::consts::TAU * t_ns as f64 * 1e-9 / SWING_S;
        for (i, (stands, width)) in self.stands.iter().enumerate() {
            q[i] = stands + SWING * width * (phase + i as f64).sin();
        }
        // The path is where it is said to be at that time, or a trip's jitter would be a jerk.
        Setpoint::new(&q[..self.stands.len()])
            .at_ns(t_ns)
            .wrench(WRENCH, WrenchFrame::Tool)
            .temperatures(AMBIENT_C, &[])
    }

    /// Commands and awaits the answer for at most `limit`; tells when it was sent and when the answer was there.
    pub(crate) fn command(&mut self, limit: Duration) -> (u64, Option<u64>) {
        let setpoint = self.setpoint(monotonic_ns());
        let sent_ns = monotonic_ns();
        let Ok(seq) = self.client.send(&setpoint) else { return (sent_ns, None) };
        let Some(answer) = self.client.wait_corrected(seq, limit) else { return (sent_ns, None) };
        let here_ns = monotonic_ns();
        self.note(&answer, here_ns - sent_ns);
        (sent_ns, Some(here_ns))
    }

    fn note(&mut self, answer: &Corrected, trip_ns: u64) {
        let made_in_ns = answer.made_ns.saturating_sub(answer.received_ns);
        self.correction.record(made_in_ns);
        self.around.record(trip_ns.saturating_sub(made_in_ns));
        if let Some(count) = self.by_status.get_mut(answer.status as usize) {
            *count += 1;
        }
        self.newest = Some(*answer);
    }
}

impl Peer for Trued {
    fn round_trip(&mut self, _: u64) -> Option<u64> {
        let (sent_ns, here_ns) = self.command(ANSWER_WITHIN);
        here_ns.map(|here_ns| here_ns - sent_ns)
    }
}
