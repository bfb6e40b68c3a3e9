//! What was learned from measured runs, as JSON and text.

use joint_dynamics::plant::{Plant, UncertainValue};
use physics::{Arm, JointKind};
use serde::Serialize;

use super::{JointCorrection, MILLI, ToolErrors, largest, rms};
use crate::learn::{LearnedJoint, NextRun, Runs};
use crate::measured::MeasuredQuantity;

/// What was learned: `trued.learn/1` (docs/reference/results.md).
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LearnReport {
    corrections: String,
    runs: usize,
    step_ms: f64,
    /// What was added to the times of each measurement.
    clock_offsets_ms: Vec<f64>,
    joints: Vec<JointReport>,
    /// Joints, from 1, for which nothing was measured, or only the motor of a joint with a mode.
    not_learned: Vec<usize>,
    /// Of the mean of the runs.
    tool_before: ToolErrors,
    /// Of the next run, by the model.
    tool_next: ToolErrors,
}

/// What was learned of a joint.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointReport {
    /// `link`, `motor` or `tool`.
    measured: &'static str,
    error: f64,
    error_rms: f64,
    /// Standard deviation of one run from the mean; none of a single run.
    repeatability: Option<f64>,
    /// The joint over time as this run showed it; none where the model explains the run about as well, and was used.
    by_run: Option<RunDynamics>,
    #[serde(flatten)]
    next: JointCorrection,
}

/// A joint over time, by a run.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunDynamics {
    delay_ms: f64,
    lag_ms: f64,
    #[serde(rename = "frequencies_Hz")]
    frequencies_hz: Vec<f64>,
    damping_ratios: Vec<f64>,
}

impl RunDynamics {
    fn of(plant: &Plant) -> Self {
        let ms =
            |numbers: &[UncertainValue]| numbers.iter().map(|number| number.value * MILLI).sum();
        Self {
            delay_ms: ms(&plant.delays_s),
            lag_ms: ms(&plant.lags_s),
            frequencies_hz: plant.modes.iter().map(|mode| mode.frequency_hz.value).collect(),
            damping_ratios: plant.modes.iter().map(|mode| mode.damping_ratio.value).collect(),
        }
    }

    fn text(&self) -> String {
        let Self { delay_ms, lag_ms, frequencies_hz, .. } = self;
        let modes: Vec<String> = frequencies_hz.iter().map(|hz| format!(", {hz:.2} Hz")).collect();
        format!("estimated delay {delay_ms:.2} ms, lag {lag_ms:.2} ms{}", modes.concat())
    }
}

impl JointReport {
    fn of(index: usize, kind: JointKind, learned: &LearnedJoint) -> Self {
        Self {
            measured: match learned.quantity {
                MeasuredQuantity::Link => "link",
                MeasuredQuantity::Motor => "motor",
                MeasuredQuantity::Tool => "tool",
            },
            error: MILLI * largest(&learned.error),
            error_rms: MILLI * rms(&learned.error),
            repeatability: learned.repeatability.map(|deviation| MILLI * deviation),
            by_run: learned
                .identified
                .as_ref()
                .map(|identified| RunDynamics::of(&identified.plant)),
            next: JointCorrection::of(index, kind, &learned.next),
        }
    }

    fn text(&self) -> String {
        let Self { measured, error, error_rms, repeatability, by_run, next } = self;
        let mut text = next.text();
        text += &format!("; measured error ({measured}) at most {error:.3}, {error_rms:.3} rms");
        if let Some(deviation) = repeatability {
            text += &format!(", repeatability {deviation:.4} rms");
        }
        if let Some(by_run) = by_run {
            text += &format!("; {}", by_run.text());
        }
        text + "\n"
    }
}

impl LearnReport {
    /// Of the runs of a path and the next commands; `corrections`: where these go.
    #[must_use]
    pub fn of(arm: &Arm, runs: &Runs<'_>, next: &NextRun, corrections: String) -> Self {
        let Runs { step_s, wanted, measured, .. } = *runs;
        let without = |error: fn(&LearnedJoint) -> &Vec<f64>| -> Vec<Vec<f64>> {
            let joints = wanted.iter().zip(&next.joints);
            let reached = |(wanted, learned): (&Vec<f64>, &Option<LearnedJoint>)| match learned {
                Some(learned) => wanted.iter().zip(error(learned)).map(|(w, e)| w - e).collect(),
                None => wanted.clone(),
            };
            joints.map(reached).collect()
        };
        let tool = |reached: Vec<Vec<f64>>| ToolErrors::of(arm, wanted, &reached, step_s);
        let joints = next.joints.iter().zip(arm.joints()).enumerate();
        let joints = joints.filter_map(|(index, (learned, joint))| {
            Some(JointReport::of(index, joint.kind, learned.as_ref()?))
        });
        let not_learned = (1..).zip(&next.joints).filter(|(_, joint)| joint.is_none());
        Self {
            corrections,
            runs: measured.len(),
            step_ms: step_s * MILLI,
            clock_offsets_ms: measured.iter().map(|run| run.clock_offset_s * MILLI).collect(),
            joints: joints.collect(),
            not_learned: not_learned.map(|(number, _)| number).collect(),
            tool_before: tool(without(|learned| &learned.error)),
            tool_next: tool(without(|learned| &learned.next.residual)),
        }
    }

    /// Whether a limit reduced the correction of a joint.
    #[must_use]
    pub fn is_limited(&self) -> bool {
        self.joints.iter().any(|joint| joint.next.limited_rows > 0)
    }

    /// The result in lines of text.
    #[must_use]
    pub fn text(&self) -> String {
        let offsets: Vec<String> =
            self.clock_offsets_ms.iter().map(|ms| format!("{ms:.2} ms")).collect();
        let mut text = format!("clock offset        {}\n", offsets.join(", "));
        self.joints.iter().for_each(|joint| text += &joint.text());
        for joint in &self.not_learned {
            text += &format!(
                "joint {joint}: not learned; no measurement, or only at the motor, which does not observe the joint's flexible mode\n"
            );
        }
        text += &self.tool_before.text("measured error");
        text += self.tool_next.text("predicted next run").trim_end();
        if self.runs == 1 {
            text += "\nrepeatability       unknown from one run; give several recordings of the same commands";
        }
        text
    }
}
