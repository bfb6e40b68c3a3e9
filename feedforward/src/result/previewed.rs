//! What preview compensation does, as JSON and text.

use joint_dynamics::plant::Plants;
use physics::{Arm, JointKind};
use serde::Serialize;

use super::{JointCorrection, MILLI, ToolErrors};
use crate::grid::Extended;
use crate::preview::Preview;

/// What was compensated in time.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PreviewReport {
    step_ms: f64,
    /// Duration of the standstill before and after the path.
    lead_s: f64,
    resampled: bool,
    joints: Vec<JointCorrection>,
    /// Predicted by the model, with the static correction only.
    tool_without: ToolErrors,
    tool_with: ToolErrors,
    /// Effects over time that are not compensated.
    left_out: Vec<String>,
}

impl PreviewReport {
    /// Of a path on an even time grid, whose joints shall be at `wanted`, rad or m.
    #[must_use]
    pub fn of(
        arm: &Arm,
        plants: &Plants,
        path: &Extended,
        wanted: &[Vec<f64>],
        preview: &Preview,
    ) -> Self {
        let Extended { step_s, lead_rows, is_resampled, .. } = path;
        let kinds = arm.joints().iter().map(|joint| joint.kind);
        let joints = (preview.joints.iter().zip(kinds).enumerate()).filter_map(
            |(index, (stepped, kind)): (usize, (_, JointKind))| {
                Some(JointCorrection::of(index, kind, stepped.as_ref()?))
            },
        );
        Self {
            step_ms: step_s * MILLI,
            lead_s: *lead_rows as f64 * step_s,
            resampled: *is_resampled,
            joints: joints.collect(),
            tool_without: ToolErrors::of(arm, wanted, &preview.without, *step_s),
            tool_with: ToolErrors::of(arm, wanted, &preview.with, *step_s),
            left_out: plants.left_out.clone(),
        }
    }

    /// Number of rows, over all joints, in which a limit reduced the correction.
    #[must_use]
    pub fn limited_rows(&self) -> usize {
        self.joints.iter().map(|joint| joint.limited_rows).sum()
    }

    /// Largest distance of the compensated tool from the path by the model, mm.
    #[must_use]
    pub fn path_deviation_mm(&self) -> f64 {
        self.tool_with.from_path_mm.largest
    }

    /// The result in lines of text.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = format!("rows                every {:.3} ms", self.step_ms);
        if self.resampled {
            text += ", resampled from uneven time steps; other columns are left out";
        }
        text += &format!("; the arm stands still for {:.3} s at both ends\n", self.lead_s);
        self.joints.iter().for_each(|joint| text += &(joint.text() + "\n"));
        text += &self.tool_without.text("uncompensated error");
        text += self.tool_with.text("compensated error").trim_end();
        for effect in &self.left_out {
            text += &format!("\nnot compensated     {effect}");
        }
        text
    }
}
