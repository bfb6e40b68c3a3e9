//! Stability of a cut as an object: `trued.stability/1`.

use recording::program;
use serde::Serialize;
use spectrum::stability::{FeedDirectionLimits, Limit};

use super::analysis::{Analysis, signed_rad};
use crate::error::Error;

/// Stability of a cut: `trued.stability/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
pub struct Report {
    cut: CutReport,
    stable: bool,
    multiplier_modulus: f64,
    limit_mm: Option<f64>,
    zeroth_order_limit_mm: Option<f64>,
    mode_coupling_limit_mm: Option<f64>,
    mode_coupling_Hz: Option<f64>,
    chatter_Hz: Option<f64>,
    margin: f64,
    depth_max_mm: f64,
    nearest: NearestReport,
    best_direction: Option<DirectionReport>,
    modes: Vec<ModeReport>,
    chart: Vec<PointReport>,
    directions: Vec<DirectionReport>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct CutReport {
    spindle_rpm: f64,
    depth_mm: f64,
    teeth: u32,
    feed: [f64; 3],
    /// Out of the workpiece, unit length.
    up: [f64; 3],
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct NearestReport {
    spindle_rpm: Option<f64>,
    depth_mm: f64,
    direction: Option<DirectionReport>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz and N are units' names")]
struct ModeReport {
    frequency_Hz: f64,
    damping_ratio: f64,
    stiffness_N_per_um: f64,
    direction: [f64; 3],
    tap: Option<String>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct PointReport {
    spindle_rpm: f64,
    limit_mm: Option<f64>,
    chatter_Hz: Option<f64>,
    zeroth_order_limit_mm: Option<f64>,
    zeroth_order_chatter_Hz: Option<f64>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "Hz is the unit's name")]
struct DirectionReport {
    turn_deg: f64,
    feed: [f64; 3],
    limit_mm: Option<f64>,
    chatter_Hz: Option<f64>,
    mode_coupling_limit_mm: Option<f64>,
}

/// A limit's depth, mm.
pub(super) fn depth_mm(limit: Option<Limit>) -> Option<f64> {
    limit.map(|limit| 1e3 * limit.depth_m)
}

fn hz(limit: Option<Limit>) -> Option<f64> {
    limit.map(|limit| limit.frequency_hz)
}

impl DirectionReport {
    fn of(analysis: &Analysis, one: &FeedDirectionLimits) -> Self {
        Self {
            turn_deg: signed_rad(one.angle_rad).to_degrees(),
            feed: analysis.feed(one.angle_rad),
            limit_mm: depth_mm(one.limit),
            chatter_Hz: hz(one.limit),
            mode_coupling_limit_mm: depth_mm(one.mode_coupling),
        }
    }
}

impl Analysis {
    /// The result as an object.
    #[must_use]
    pub fn report(&self) -> Report {
        Report::of(self)
    }

    /// The same as JSON.
    ///
    /// # Errors
    /// [`Error::Internal`]
    pub fn json(&self) -> Result<String, Error> {
        let text = program::json("trued.stability/1", &self.report()).map_err(Error::internal)?;
        Ok(text + "\n")
    }
}

impl Report {
    fn of(analysis: &Analysis) -> Self {
        let (file, nearest) = (&analysis.cut.file, &analysis.nearest);
        let direction = |one: &FeedDirectionLimits| DirectionReport::of(analysis, one);
        let modes = analysis.cut.modes.iter().map(|one| ModeReport {
            frequency_Hz: one.mode.frequency_hz,
            damping_ratio: one.mode.damping_ratio,
            stiffness_N_per_um: 1e-6 * one.mode.stiffness_n_per_m,
            direction: one.mode.direction,
            tap: one.tap.as_ref().map(|tap| tap.display().to_string()),
        });
        let chart = analysis.chart.iter().map(|point| PointReport {
            spindle_rpm: point.spindle_rpm,
            limit_mm: depth_mm(point.limit),
            chatter_Hz: hz(point.limit),
            zeroth_order_limit_mm: depth_mm(point.zeroth_order),
            zeroth_order_chatter_Hz: hz(point.zeroth_order),
        });
        Self {
            cut: CutReport {
                spindle_rpm: file.spindle_rpm,
                depth_mm: 1e3 * file.cut.axial_depth_m,
                teeth: file.cut.teeth,
                feed: analysis.feed(0.0),
                up: analysis.up(),
            },
            stable: analysis.is_stable,
            multiplier_modulus: analysis.modulus,
            limit_mm: depth_mm(analysis.limit),
            zeroth_order_limit_mm: depth_mm(analysis.zeroth_order),
            mode_coupling_limit_mm: depth_mm(analysis.mode_coupling),
            mode_coupling_Hz: hz(analysis.mode_coupling),
            chatter_Hz: analysis.chatter_hz,
            margin: file.margin,
            depth_max_mm: 1e3 * file.chart.depth_max_m,
            nearest: NearestReport {
                spindle_rpm: nearest.spindle_rpm,
                depth_mm: 1e3 * nearest.depth_m,
                direction: nearest.turned.as_ref().map(direction),
            },
            best_direction: nearest.best.as_ref().map(direction),
            modes: modes.collect(),
            chart: chart.collect(),
            directions: analysis.directions.iter().map(direction).collect(),
            warnings: analysis.cut.warnings.clone(),
        }
    }
}
