//! What preview compensation does, as JSON and text.

use joint_dynamics::plant::Plants;
use physics::{Arm, Joint, JointKind};
use serde::Serialize;

use super::{JointCorrection, MILLI, ToolErrors, digits};
use crate::bounds::{JointBounds, LimitedBy};
use crate::grid::Extended;
use crate::path_check::PathDeviation;
use crate::preview::{Preview, Reduction};

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
    /// Corrections reduced so that the path deviation does not increase; none where that was not necessary.
    reduced: Option<ReductionReport>,
    /// Joints that the path by itself moves faster than the model allows.
    too_fast: Vec<TooFast>,
    /// Effects over time that are not compensated.
    left_out: Vec<String>,
}

/// A reduction of all corrections.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct ReductionReport {
    /// Bandwidth of all joints; 0: nothing is compensated.
    bandwidth_Hz: f64,
    /// What all joints remain late together, which keeps the tool on the path.
    late_ms: f64,
    /// Largest path deviation without the reduction by the model, and without compensation.
    unreduced_mm: f64,
    without_mm: f64,
    /// The limit that made the reduction necessary in most rows; none if it is the bandwidth.
    limited_by: Option<LimitedBy>,
}

impl ReductionReport {
    fn of(reduction: &Reduction) -> Self {
        let Reduction { bandwidth_hz, late_s, unreduced, limited_by } = *reduction;
        let PathDeviation { without_m, with_m } = unreduced;
        Self {
            bandwidth_Hz: bandwidth_hz,
            late_ms: late_s * MILLI,
            unreduced_mm: MILLI * with_m,
            without_mm: MILLI * without_m,
            limited_by,
        }
    }

    fn text(&self) -> String {
        let Self { bandwidth_Hz, late_ms, unreduced_mm, without_mm, limited_by } = self;
        let how = if *bandwidth_Hz > 0.0 {
            format!("reduced             to {bandwidth_Hz:.1} Hz, all joints {late_ms:.1} ms late")
        } else {
            "not compensated".to_owned()
        };
        let why = match limited_by {
            Some(by) => format!("within their limits ({}; {})", by.name(), by.remedy()),
            None => {
                "at the stated bandwidth (raise --bandwidth-hz, or blend the corners)".to_owned()
            }
        };
        let [unreduced, without] = [unreduced_mm, without_mm].map(|mm| digits(*mm));
        format!(
            "{how}: {why} the full ones would increase the path deviation, by the model from {without} to {unreduced} mm"
        )
    }
}

/// A joint that the path by itself moves faster than the model allows.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct TooFast {
    /// From 1.
    joint: usize,
    unit: &'static str,
    /// Largest speed of the path, and of the joint.
    speed: f64,
    max_speed: f64,
    rows: usize,
    /// In the file, from 1.
    first_row: usize,
}

impl TooFast {
    fn of(arm: &Arm, path: &Extended, wanted: &[Vec<f64>]) -> Vec<Self> {
        let all = JointBounds::of(arm).into_iter().zip(arm.joints()).zip(wanted).enumerate();
        let one =
            |(index, ((bounds, joint), wanted)): (usize, ((JointBounds, &Joint), &Vec<f64>))| {
                let (rows, speed) = bounds.too_fast(wanted, path.step_s);
                let first = *rows.first()?;
                let (unit, per_si) = match joint.kind {
                    JointKind::Revolute => ("deg/s", 1f64.to_degrees()),
                    JointKind::Prismatic => ("mm/s", MILLI),
                };
                let at = path.source.at(path.recording.t_s.get(first).copied().unwrap_or(f64::NAN));
                Some(Self {
                    joint: index + 1,
                    unit,
                    speed: speed * per_si,
                    max_speed: bounds.speed * per_si,
                    rows: rows.len(),
                    first_row: at.row,
                })
            };
        all.filter_map(one).collect()
    }

    fn text(&self) -> String {
        let Self { joint, unit, rows, first_row, .. } = self;
        let [speed, most] = [self.speed, self.max_speed].map(digits);
        format!(
            "joint {joint}: the path itself moves at up to {speed} {unit}, the model allows {most}, in {rows} rows from row {first_row} on; slow the path down"
        )
    }
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
            reduced: preview.reduced.as_ref().map(ReductionReport::of),
            too_fast: TooFast::of(arm, path, wanted),
            left_out: plants.left_out.clone(),
        }
    }

    /// Number of rows, over all joints, in which a limit reduced the correction.
    #[must_use]
    pub fn limited_rows(&self) -> usize {
        self.joints.iter().map(|joint| joint.limited_rows).sum()
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
        if let Some(reduced) = &self.reduced {
            text += &format!("\n{}", reduced.text());
        }
        for joint in &self.too_fast {
            text += &format!("\n{}", joint.text());
        }
        for effect in &self.left_out {
            text += &format!("\nnot compensated     {effect}");
        }
        text
    }
}
