//! Text output on sweeps and loads.
//!
//! Values are given with their uncertainty, if any; all are contained in the JSON.

use report::{fixed, pluralise, significant};

use super::MILLI;
use super::{AxesReport, CompliantJoint, StiffnessReport, SweepReport, TiltReport};

/// A larger turn between two targets on the base is no tilt of a base, mrad; above 0. Origin: a choice, far above what a robot's base yields (below
/// 1 mrad) and below what exchanged targets show.
const TILT_MOST_MRAD: f64 = 50.0;

impl SweepReport {
    pub(super) fn line(&self) -> String {
        let head =
            format!("joint {} alone (rows {} to {})", self.joint, self.rows[0], self.rows[1]);
        if let Some(fault) = &self.fault {
            return format!("{head}: {fault}");
        }
        let largest = |list: &[f64]| list.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let mut parts = Vec::new();
        if let (Some(tilt), Some(shift)) = (&self.tilt_mrad, &self.shift_um) {
            parts.push(format!(
                "axis tilted by {} ± {} mrad and shifted by {} ± {} µm",
                significant(tilt[0].hypot(tilt[1]), 2),
                significant(largest(&self.sigma_tilt_mrad.unwrap_or_default()), 2),
                significant(shift.iter().map(|x| x * x).sum::<f64>().sqrt(), 2),
                significant(largest(&self.sigma_shift_um.unwrap_or_default()), 2)
            ));
        }
        let mean_errors: Vec<f64> = self.steps.iter().map(|step| step.mean_mrad).collect();
        parts.push(format!("position error up to {} mrad", significant(largest(&mean_errors), 2)));
        let lost: Vec<f64> =
            self.steps.iter().filter_map(|step| step.half_lost_motion_mrad).collect();
        if !lost.is_empty() {
            let mean = 2.0 * lost.iter().sum::<f64>() / lost.len() as f64;
            parts.push(format!("lost motion {} mrad", significant(mean, 2)));
        }
        if let Some(sag) = &self.sag {
            parts.push(if sag.taken_out {
                format!(
                    "gravity deflection of the other joints subtracted: points by up to {} µm, the axis by {} mrad and {} µm",
                    significant(sag.moved_points_um, 2),
                    significant(sag.turned_axis_mrad, 2),
                    significant(sag.shifted_axis_um, 2)
                )
            } else {
                "gravity deflection of the other joints not subtracted".to_owned()
            });
        }
        format!("{head}: {}", parts.join("; "))
    }
}

impl TiltReport {
    pub(super) fn line(&self) -> String {
        let [x, y, z] = self.turn_mrad;
        let turn = (x * x + y * y + z * z).sqrt();
        if turn > TILT_MOST_MRAD {
            return format!(
                "the two targets on the base are turned by {} degrees against the first pose (row {}, of {}): they were exchanged or moved, so that no tilt of the base is known",
                significant((turn / MILLI).to_degrees(), 2),
                self.row,
                pluralise(self.poses, "pose")
            );
        }
        format!(
            "the base tilted by up to {} ± {} mrad (row {}, of {}); a rotation about the line through its two targets is not observable",
            significant(turn, 2),
            significant(self.sigma_mrad, 2),
            self.row,
            pluralise(self.poses, "pose")
        )
    }
}

impl AxesReport {
    pub(super) fn line(&self) -> String {
        format!(
            "axes {} and {}: {} ± {} mrad, {} ± {} mm apart",
            self.joints[0],
            self.joints[1],
            fixed(self.angle_mrad, 3),
            significant(self.sigma_angle_mrad, 2),
            fixed(self.distance_mm, 3),
            significant(self.sigma_distance_mm, 2)
        )
    }
}

impl StiffnessReport {
    pub(super) fn lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let joint = |joint: &CompliantJoint| {
            let (value, sigma) = (significant(joint.compliance_mrad_per_knm, 3), joint.sigma);
            format!("joint {} {value} ± {}", joint.joint, significant(sigma, 2))
        };
        let pairs = pluralise(self.pairs, "loaded and unloaded pose");
        for (joints, from) in [
            (&self.joints, format!("from {pairs}")),
            (&self.one_by_one, "joint by joint, from targets on links".to_owned()),
        ] {
            let all: Vec<String> = joints.iter().map(joint).collect();
            if !all.is_empty() {
                lines.push(format!("compliance {from}, mrad/kNm: {}", all.join(", ")));
            }
        }
        lines.extend(self.by_load_um.as_ref().map(|load| {
            format!(
                "the loads move the tool by {} µm (largest {}); deflection of the arm by them (K_c) accounts for {} µm of it, at most {}; at most {} µm at {} of {}",
                significant(load.deflection_median, 2),
                significant(load.deflection_max, 2),
                significant(load.enhanced_median, 2),
                significant(load.enhanced_max, 2),
                load.negligible_below,
                load.negligible_rows.len(),
                pluralise(load.poses, "pose")
            )
        }));
        lines
    }
}
