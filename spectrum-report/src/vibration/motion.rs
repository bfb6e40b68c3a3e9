//! State of the machine during a recording: spindle, feed, path, joints; as stated, otherwise from the recording.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use physics::chain::Chain;
use physics::{JOINTS_MAX, JointKind, Joints};
use recording::model::RobotModel;
use recording::series::Channel;
use spectrum::ProcessState;
use spectrum::offline::{LineConditions, feed_along_path, path_mm, speed_from_pulses};

use super::input::Inputs;

/// A quantity over the samples: empty if unknown, one value if constant, otherwise one per sample.
type Series = Vec<f64>;

/// Recorded quantities beside the waveforms, SI.
type RecordedColumns = BTreeMap<Channel, Vec<f64>>;

/// The machine's motion during one piece.
#[derive(Debug, Default)]
pub(super) struct Motion {
    /// Rev/min.
    spindle_rpm: Series,
    /// mm/s.
    feed_mm_s: Series,
    /// Length of the path at each sample, mm; empty if unknown.
    pub(super) path_mm: Vec<f64>,
    /// How the path was determined, as text.
    pub(super) path_by: &'static str,
    /// Joint positions at each sample, rad or m, those that are recorded.
    joints: Vec<(usize, Vec<f64>)>,
}

impl Motion {
    pub(super) fn of(
        inputs: &Inputs,
        beside: &RecordedColumns,
        samples: usize,
        rate_hz: f64,
        model: Option<&RobotModel>,
        notes: &mut Vec<String>,
    ) -> Self {
        let column = |channel: Channel| beside.get(&channel).map(|values| hold_last(values));
        let tacho = || {
            let speed = speed_from_pulses(beside.get(&Channel::Tacho)?, rate_hz);
            notes.push(if speed.is_empty() {
                "the tacho shows no pulses".to_owned()
            } else {
                "the spindle's speed is that of the tacho's pulses, one per revolution".to_owned()
            });
            Some(speed)
        };
        let given = inputs.spindle_rpm.map(|rpm| vec![rpm]);
        let spindle_rpm = given.or_else(|| column(Channel::Spindle)).or_else(tacho);
        let joints = (0..JOINTS_MAX)
            .filter_map(|joint| {
                let commanded = column(Channel::Command(joint));
                Some((joint, commanded.or_else(|| column(Channel::Motor(joint)))?))
            })
            .collect();
        let mut motion =
            Self { spindle_rpm: spindle_rpm.unwrap_or_default(), joints, ..Self::default() };
        let feed = inputs.feed_mm_s.map(|feed| vec![feed]);
        let recorded = || column(Channel::Feed).map(|feed| feed.iter().map(|v| 1e3 * v).collect());
        if let Some(feed) = feed.or_else(recorded) {
            motion.path_by =
                if inputs.feed_mm_s.is_some() { "the feed given" } else { "the recorded feed" };
            motion.path_mm = integrated(&feed, samples, rate_hz);
            motion.feed_mm_s = feed;
        } else if let Some((by, position_mm)) = motion.positions(beside, samples, model) {
            motion.path_by = by;
            motion.path_mm = path_mm(&position_mm, rate_hz);
            motion.feed_mm_s = feed_along_path(&motion.path_mm, rate_hz);
        }
        motion
    }

    /// The tool's positions, mm: measured, or by the model from the joints.
    fn positions(
        &self,
        beside: &RecordedColumns,
        samples: usize,
        model: Option<&RobotModel>,
    ) -> Option<(&'static str, Vec<[f64; 3]>)> {
        let axis = |axis: usize| beside.get(&Channel::Position(axis));
        if (0..3).any(|i| axis(i).is_some()) {
            let coordinate = |i: usize, row: usize| {
                axis(i).map_or(0.0, |x| x.get(row).map_or(f64::NAN, |x| 1e3 * x))
            };
            let rows = (0..samples)
                .map(|row| [coordinate(0, row), coordinate(1, row), coordinate(2, row)]);
            return Some(("the measured positions", rows.collect()));
        }
        let arm = &model?.physics.arm;
        if self.joints.len() != arm.count() {
            return None;
        }
        let place = |row: usize| {
            let mut q: Joints = [0.0; JOINTS_MAX];
            for (joint, values) in &self.joints {
                q[*joint] = values.get(row).copied().unwrap_or(f64::NAN);
            }
            (Chain::nominal(arm, &q).base_from_tool.origin * 1e3).to_array()
        };
        Some(("the joints through the model's geometry", (0..samples).map(place).collect()))
    }

    /// The state at a sample.
    pub(super) fn state(&self, sample: usize, teeth: u32) -> ProcessState {
        ProcessState {
            spindle_rpm: value_at(&self.spindle_rpm, sample),
            teeth,
            feed_mm_s: value_at(&self.feed_mm_s, sample),
            in_cut: None,
        }
    }

    /// Whether the spindle speed is given, or recorded.
    pub(super) fn has_spindle_speed(&self) -> bool {
        !self.spindle_rpm.is_empty()
    }

    /// The median spindle speed while it turns, rev/min.
    pub(super) fn median_rpm(&self) -> Option<f64> {
        median(self.spindle_rpm.iter().copied().filter(|rpm| *rpm > 0.0))
    }

    /// The median feed while it moves, mm/s.
    pub(super) fn median_feed_mm_s(&self) -> Option<f64> {
        median(self.feed_mm_s.iter().copied().filter(|feed| *feed > 0.01))
    }

    /// State of the process for a line of the whole recording: while the spindle turned, and the
    /// tool moved.
    pub(super) fn line_conditions(&self, teeth: u32, uncertainty_hz: f64) -> LineConditions {
        let process = ProcessState {
            spindle_rpm: self.median_rpm().unwrap_or(0.0),
            teeth,
            feed_mm_s: self.median_feed_mm_s().unwrap_or(0.0),
            in_cut: None,
        };
        let spindle_rpm = range(&self.spindle_rpm).unwrap_or_default();
        LineConditions { process, spindle_rpm, uncertainty_hz }
    }

    /// Least and largest feed while it moves, mm/s.
    pub(super) fn feed_range_mm_s(&self) -> Option<[f64; 2]> {
        range(&self.feed_mm_s)
    }

    /// Revolutions of a joint per mm of path, in each of `parts` equal parts of the piece; `None`
    /// if joint or path is unknown.
    pub(super) fn gear_frequencies(
        &self,
        joint: usize,
        parts: usize,
        rate_hz: f64,
    ) -> Option<Vec<f64>> {
        let (_, q) = self.joints.iter().find(|(index, _)| *index == joint)?;
        let travelled = path_mm(&q.iter().map(|q| [*q, 0.0, 0.0]).collect::<Vec<_>>(), rate_hz);
        if travelled.is_empty() || self.path_mm.len() != travelled.len() {
            return None;
        }
        let last = travelled.len() - 1;
        let part = |k: usize| {
            let (from, to) = (k * last / parts, (k + 1) * last / parts);
            let length_mm = self.path_mm[to] - self.path_mm[from];
            (length_mm > 0.1).then(|| (travelled[to] - travelled[from]) / TAU / length_mm)
        };
        let found: Vec<f64> = (0..parts).filter_map(part).collect();
        (!found.is_empty()).then_some(found)
    }

    /// Whether joint positions were recorded.
    pub(super) fn has_joints(&self) -> bool {
        !self.joints.is_empty()
    }
}

/// Whether a joint's gears turn with an angle.
pub(super) fn turns(kind: JointKind) -> bool {
    kind == JointKind::Revolute
}

/// Missing samples take the previous value.
fn hold_last(values: &[f64]) -> Series {
    let mut last = values.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
    let next = |v: &f64| {
        if v.is_finite() {
            last = *v;
        }
        last
    };
    values.iter().map(next).collect()
}

fn value_at(course: &Series, sample: usize) -> f64 {
    course.get(sample).or(course.last()).copied().unwrap_or(0.0)
}

fn integrated(feed_mm_s: &Series, samples: usize, rate_hz: f64) -> Vec<f64> {
    let mut place_mm = 0.0;
    let step = |sample: usize| {
        let begin_mm = place_mm;
        place_mm += value_at(feed_mm_s, sample).max(0.0) / rate_hz;
        begin_mm
    };
    (0..samples).map(step).collect()
}

/// Minimum and maximum of the middle four fifths of the positive values, which excludes starting
/// and stopping.
fn range(course: &Series) -> Option<[f64; 2]> {
    let mut moving: Vec<f64> = course.iter().copied().filter(|x| *x > 0.01).collect();
    moving.sort_by(f64::total_cmp);
    let last = moving.len().checked_sub(1)? as f64;
    Some([0.1, 0.9].map(|part| moving[(part * last) as usize]))
}

/// The median of some values, of an even number the upper one.
pub(super) fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    let half = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(half, f64::total_cmp).1)
}
