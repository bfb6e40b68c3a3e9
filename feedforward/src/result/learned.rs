//! What was learned from measured runs, as JSON and text.

use joint_dynamics::plant::{Plant, UncertainValue};
use physics::{Arm, JointKind};
use serde::Serialize;

use super::{JointCorrection, MILLI, ToolErrors, digits, largest, rms};
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
    /// What a measurement is later than predicted from the commands by the model, after its clock offset.
    late_ms: Vec<f64>,
    /// Of the mean of the runs.
    tool_before: ToolErrors,
    /// Of these runs, by the model.
    tool_expected: ToolErrors,
    /// Of the next run, by the model.
    tool_next: ToolErrors,
    /// Why the next commands are those of the run before; none where they are learned.
    went_back: Option<WentBack>,
    /// What to check, as text.
    warnings: Vec<String>,
}

/// A run that was worse than the one before.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct WentBack {
    /// Root mean square tracking error of the tool in this run.
    pub run_rms_mm: f64,
    /// In the one before.
    pub before_rms_mm: f64,
    /// Share of the learned change that the next iteration uses.
    pub learning_share: f64,
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
        let [error, error_rms] = [error, error_rms].map(|value| digits(*value));
        text += &format!("; measured error ({measured}) at most {error}, {error_rms} rms");
        if let Some(deviation) = repeatability {
            text += &format!(", repeatability {} rms", digits(*deviation));
        }
        if let Some(by_run) = by_run {
            text += &format!("; {}", by_run.text());
        }
        text + "\n"
    }
}

impl LearnReport {
    /// Of the runs of a path and the next commands; `corrections`: where these go; `expected`: the errors of the joints in
    /// these runs by the model, rad or m.
    #[must_use]
    pub fn of(
        arm: &Arm,
        runs: &Runs<'_>,
        next: &NextRun,
        corrections: String,
        expected: &[Vec<f64>],
    ) -> Self {
        let Runs { step_s, wanted, measured, .. } = *runs;
        let tool = |reached: Vec<Vec<f64>>| ToolErrors::of(arm, wanted, &reached, step_s);
        let measured_joints = expected.iter().zip(&next.joints);
        let expected: Vec<Option<&Vec<f64>>> =
            measured_joints.map(|(error, joint)| joint.is_some().then_some(error)).collect();
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
            late_ms: measured.iter().map(|run| run.late_s * MILLI).collect(),
            tool_before: tool(next.reached(wanted, |learned| &learned.error)),
            tool_expected: tool(without(wanted, &expected)),
            tool_next: tool(next.reached(wanted, |learned| &learned.next.residual)),
            went_back: None,
            warnings: Vec::new(),
        }
    }

    /// The next commands are those of the run before.
    pub(crate) fn go_back(&mut self, went_back: WentBack) {
        self.went_back = Some(went_back);
    }

    /// Adds what to check.
    pub(crate) fn warn(&mut self, warning: String) {
        self.warnings.push(warning);
    }

    /// What to check, as text.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Whether the run was worse than the one before, whose commands are the next ones.
    #[must_use]
    pub fn is_back(&self) -> bool {
        self.went_back.is_some()
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
        text += &self.tool_expected.text("predicted for it");
        if let Some(WentBack { run_rms_mm, before_rms_mm, learning_share }) = &self.went_back {
            let [run, before] = [run_rms_mm, before_rms_mm].map(|mm| digits(*mm));
            let percent = 100.0 * learning_share;
            text += &format!(
                "went back           the tracking error is {run} mm rms, in the run before it was {before}: the next commands are those of the run before, and the next change will be {percent:.0} % of a full one; check clocks, path and model\n"
            );
        }
        text += self.tool_next.text("predicted next run").trim_end();
        if self.runs == 1 {
            text += "\nrepeatability       unknown from one run; give several recordings of the same commands";
        }
        text
    }
}

/// Where joints with these errors are; without an error at their target.
fn without(wanted: &[Vec<f64>], errors: &[Option<&Vec<f64>>]) -> Vec<Vec<f64>> {
    let reached = |(wanted, error): (&Vec<f64>, &Option<&Vec<f64>>)| match error {
        Some(error) => wanted.iter().zip(*error).map(|(w, e)| w - e).collect(),
        None => wanted.clone(),
    };
    wanted.iter().zip(errors).map(reached).collect()
}
