//! `trued correct --dynamic`: preview compensation of a path on top of its static correction.

use feedforward::preview::{check_joint_limits, lead_s};
use feedforward::{Settings, grid, preview};
use joint_dynamics::plant::Plants;
use serde::Serialize;

use crate::corrections::Corrections;
use crate::exit::Failure;
use crate::in_time::{OfJoint, OfTool, plants, settled};
use crate::input::Input;

/// A path with even time stamps and standstill at both ends, and the dynamics of its robot's
/// joints.
pub(super) struct Dynamic {
    settings: Settings,
    plants: Plants,
    step_s: f64,
    lead_rows: usize,
    is_resampled: bool,
}

/// What was compensated in time.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Report {
    step_ms: f64,
    /// Duration of the standstill before and after the path.
    lead_s: f64,
    resampled: bool,
    joints: Vec<OfJoint>,
    /// Predicted by the model, with the static correction only.
    tool_without: OfTool,
    tool_with: OfTool,
    /// Effects over time that are not compensated.
    left_out: Vec<String>,
}

impl Dynamic {
    /// Extends the input's path.
    pub(super) fn extend(input: &mut Input, settings: Settings) -> Result<Self, Failure> {
        let plants = plants(input, &settings)?;
        let lead_s = lead_s(&plants, &settings);
        let extended = grid::extended(&input.recording, &input.joint_kinds, lead_s);
        let grid::Extended { recording, step_s, lead_rows, is_resampled } =
            extended.map_err(Failure::input)?;
        input.recording = recording;
        Ok(Self { settings, plants, step_s, lead_rows, is_resampled })
    }

    /// Replaces the static commands by dynamically compensated ones.
    pub(super) fn compensate(
        self,
        input: &Input,
        corrections: &mut Corrections,
    ) -> Result<Report, Failure> {
        let Self { settings, plants, step_s, lead_rows, is_resampled } = self;
        let wanted = settled(corrections)?;
        let preview = preview(&plants, step_s, &wanted, &settings).map_err(Failure::input)?;
        check_joint_limits(&input.model.physics.arm, &preview.commanded).map_err(Failure::input)?;
        let joints = (preview.joints.iter().zip(&input.joint_kinds).enumerate())
            .filter_map(|(at, (stepped, kind))| Some(OfJoint::of(at, *kind, stepped.as_ref()?)));
        let report = Report {
            step_ms: step_s * 1e3,
            lead_s: lead_rows as f64 * step_s,
            resampled: is_resampled,
            joints: joints.collect(),
            tool_without: OfTool::of(input, &wanted, &preview.without, step_s),
            tool_with: OfTool::of(input, &wanted, &preview.with, step_s),
            left_out: plants.left_out,
        };
        corrections.put_joints(preview.commanded);
        Ok(report)
    }
}

impl Report {
    /// Number of rows, over all joints, in which a limit reduced the correction.
    pub(super) fn limited_rows(&self) -> usize {
        self.joints.iter().map(|joint| joint.limited_rows).sum()
    }

    pub(super) fn told(&self) -> String {
        let mut text = format!("rows                every {:.3} ms", self.step_ms);
        if self.resampled {
            text += ", resampled: those of the path are not even, other columns are left out";
        }
        text += &format!("; the arm stands still for {:.3} s at both ends\n", self.lead_s);
        self.joints.iter().for_each(|joint| text += &joint.told());
        text += &self.tool_without.told("error without");
        text += self.tool_with.told("error in time with").trim_end();
        for effect in &self.left_out {
            text += &format!("\nnot compensated     {effect}");
        }
        text
    }
}
