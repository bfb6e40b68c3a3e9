//! A recording as setpoints of the robot's loop: one per row, in order.
//!
//! The same recording gives the same setpoints, bit for bit; their times increase strictly, across
//! segments too. A wrench that was not sampled in a row is left out (the daemon holds the last one
//! until it is stale); a temperature that was not sampled is the last known. Rows are not validated
//! here; the corrector does that.

use recording::series::{Channel, CoordinateFrame, DirectionSource, Recording, RecordingKind};
use trued_client::{Setpoint, WrenchFrame};

/// The time of the first row, ns: zero would mean "now".
const START_NS: u64 = 1_000_000_000;
/// Time from the end of a segment to the beginning of the next, ns: whatever was sampled then is stale.
const BETWEEN_SEGMENTS_NS: u64 = 2_000_000_000;
/// A joint has moved from pose to pose if it went further than this, rad or m (`corrector::Settings::reversal`).
const MOVED: f64 = 2e-6;

/// One row to be sent.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TimedSetpoint {
    /// Time of the target, ns.
    pub(crate) t_ns: u64,
    /// The first row of a segment: a new run without any state from the path before.
    pub(crate) starts_segment: bool,
    pub(crate) setpoint: Setpoint,
}

/// Goes through the rows of a recording.
#[derive(Debug)]
pub(crate) struct Setpoints<'r> {
    recording: &'r Recording,
    joints: usize,
    row: usize,
    /// Recorded time of the present segment's first row, and its setpoint time.
    base: (f64, u64),
    t_ns: u64,
    celsius: Vec<f64>,
    q_before: Vec<f64>,
    directions: Vec<i8>,
}

impl<'r> Setpoints<'r> {
    /// All rows, for a robot with the given number of joints; the recording's joints were checked
    /// before.
    pub(crate) fn new(recording: &'r Recording, joints: usize) -> Self {
        Self {
            recording,
            joints,
            row: 0,
            base: (0.0, 0),
            t_ns: 0,
            celsius: vec![f64::NAN; joints + 1],
            q_before: vec![f64::NAN; joints],
            directions: vec![0; joints],
        }
    }

    fn sample(&self, channel: Channel) -> f64 {
        value(self.recording.column(channel), self.row)
    }

    fn advance_time(&mut self, anew: bool) {
        let t_s = self.recording.t_s[self.row];
        if anew {
            let start_ns = self.t_ns.saturating_add(BETWEEN_SEGMENTS_NS);
            self.base = (t_s, if self.row == 0 { START_NS } else { start_ns });
        }
        let since_ns = ((t_s - self.base.0) * 1e9).round() as u64;
        self.t_ns = self.base.1.saturating_add(since_ns).max(self.t_ns.saturating_add(1));
    }

    fn direction(&mut self, anew: bool, q: &[f64]) -> Option<Vec<i8>> {
        let about = &self.recording.metadata;
        match (about.approach, about.kind) {
            (DirectionSource::Columns, _) => {
                let sign = |joint| self.sample(Channel::Direction(joint));
                Some((0..self.joints).map(|joint| sign(joint) as i8).collect())
            }
            (_, RecordingKind::Path) => None,
            (DirectionSource::Sequence, RecordingKind::Poses) => {
                self.update_directions(anew, q);
                Some(self.directions.clone())
            }
            (DirectionSource::Unknown, RecordingKind::Poses) => Some(vec![0; self.joints]),
        }
    }

    /// Derived from the previous pose; a joint that did not move keeps its direction.
    fn update_directions(&mut self, anew: bool, q: &[f64]) {
        if anew {
            self.directions.fill(0);
            self.q_before.fill(f64::NAN);
        }
        for (joint, q) in q.iter().enumerate() {
            let moved = q - self.q_before[joint];
            if moved.abs() > MOVED {
                self.directions[joint] = if moved > 0.0 { 1 } else { -1 };
            }
            if !q.is_nan() {
                self.q_before[joint] = *q;
            }
        }
    }

    /// The wrench if any component has a column and all existing columns were sampled; missing
    /// columns are zero.
    fn wrench(&self) -> Option<[f64; 6]> {
        let columns = [0, 1, 2, 3, 4, 5].map(|part| self.recording.column(Channel::Wrench(part)));
        let part =
            |column: Option<&[f64]>| column.map_or(0.0, |column| value(Some(column), self.row));
        let wrench = columns.map(part);
        let is_given = columns.iter().any(Option::is_some);
        (is_given && wrench.iter().all(|part| !part.is_nan())).then_some(wrench)
    }

    fn update_temperatures(&mut self) -> bool {
        let channels = (0..self.joints).map(Channel::JointTemperature);
        let channels: Vec<_> = std::iter::once(Channel::Ambient).chain(channels).collect();
        for (place, channel) in channels.iter().enumerate() {
            let sample = self.sample(*channel);
            if !sample.is_nan() {
                self.celsius[place] = sample;
            }
        }
        channels.iter().any(|channel| self.recording.column(*channel).is_some())
    }
}

impl Iterator for Setpoints<'_> {
    type Item = TimedSetpoint;

    fn next(&mut self) -> Option<TimedSetpoint> {
        let segment = *self.recording.segment.get(self.row)?;
        let before = self.row.checked_sub(1).and_then(|row| self.recording.segment.get(row));
        let starts_segment = before != Some(&segment);
        self.advance_time(starts_segment);
        let q: Vec<f64> =
            (0..self.joints).map(|joint| value(self.recording.input(joint), self.row)).collect();
        let mut setpoint = Setpoint::new(&q).at_ns(self.t_ns);
        if let Some(direction) = self.direction(starts_segment, &q) {
            setpoint = setpoint.direction(&direction);
        }
        if let Some(wrench) = self.wrench() {
            let in_base = self.recording.metadata.wrench_frame == Some(CoordinateFrame::Base);
            let frame = if in_base { WrenchFrame::Base } else { WrenchFrame::Tool };
            setpoint = setpoint.wrench(wrench, frame);
        }
        if self.update_temperatures() {
            setpoint = setpoint.temperatures(self.celsius[0], &self.celsius[1..]);
        }
        if self.recording.metadata.kind == RecordingKind::Poses {
            setpoint = setpoint.settled();
        }
        self.row += 1;
        Some(TimedSetpoint { t_ns: self.t_ns, starts_segment, setpoint })
    }
}

/// Whether any of the wrench was recorded.
pub(crate) fn has_wrench(recording: &Recording) -> bool {
    (0..6).any(|part| recording.column(Channel::Wrench(part)).is_some())
}

fn value(column: Option<&[f64]>, row: usize) -> f64 {
    column.and_then(|column| column.get(row)).copied().unwrap_or(f64::NAN)
}
