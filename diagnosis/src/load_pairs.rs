//! Pairs of loaded and unloaded poses in a campaign: joint stiffness (thesis 1.1 to 1.7), and the effect of load-induced changes of
//! geometry ([`crate::enhanced_stiffness`], thesis 1.8 to 1.10).
//!
//! Two poses with the same command, one of them under a wrench, are a pair: geometry, gravity deflection and offsets cancel in their difference.
//!
//! Each loaded pose is paired with the unloaded pose of the same command that was measured nearest before or after it. No fit is changed.

use crate::campaign::{Campaign, Pose, Reading, ToolPoint};
use crate::enhanced_stiffness::{self, EnhancedEffect};
use crate::extrinsics::Extrinsics;
use crate::rigid_motion::fit_rigid_motion;
use crate::single_joint::SAME_STEP_RAD;
use crate::stiffness::{
    Compliances, DifferenceNoise, LoadedPose, StiffnessError, estimate_simultaneously,
};
use glam::DVec3;
use physics::frame::vector_from_rotation;
use physics::{Arm, Chain, Joints, Model, Wrench};

/// Changes of the deflection by `K_C` below this are negligible, m.
pub const NEGLIGIBLE_M: f64 = 1e-6;

/// Effect of the load-induced change of geometry at one loaded pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnhancedEffectAtPose {
    /// Index into the campaign's poses.
    pub pose: usize,
    /// The change of the deflection; `None` if the arm buckles under the load.
    pub effect: Option<EnhancedEffect>,
}

/// The pairs of a campaign. Points are transformed to the base frame by the stations of `surroundings`, which also contains the target positions on
/// the tool.
#[must_use]
pub fn pairs(arm: &Arm, campaign: &Campaign, surroundings: &Extrinsics) -> Vec<LoadedPose> {
    let poses = campaign.poses.iter().enumerate();
    let loaded = poses.filter(|(_, pose)| pose.inputs.wrench_base != Wrench::ZERO);
    let one = |(index, pose): (usize, &Pose)| {
        let before = &campaign.poses[unloaded_twin(arm, campaign, index)?];
        let (shift, turn) = pose_difference(arm, before, pose, surroundings)?;
        let wrench_base = pose.inputs.wrench_base;
        Some(LoadedPose { q: pose.inputs.q, wrench_base, shift, turn })
    };
    loaded.filter_map(one).collect()
}

/// Index of the pose with the same command and no wrench that was measured nearest to pose `pose_index`.
pub(crate) fn unloaded_twin(arm: &Arm, campaign: &Campaign, pose_index: usize) -> Option<usize> {
    let pose = campaign.poses.get(pose_index)?;
    let same = |(_, other): &(usize, &Pose)| {
        let still = |k: usize| (other.inputs.q[k] - pose.inputs.q[k]).abs() <= SAME_STEP_RAD;
        other.inputs.wrench_base == Wrench::ZERO
            && other.recording == pose.recording
            && (0..arm.count()).all(still)
    };
    let unloaded = campaign.poses.iter().enumerate().filter(same);
    unloaded.map(|(other, _)| other).min_by_key(|other| other.abs_diff(pose_index))
}

/// Translation of the TCP, m, and rotation of the tool if three targets determine it, between two poses.
fn pose_difference(
    arm: &Arm,
    before: &Pose,
    after: &Pose,
    surroundings: &Extrinsics,
) -> Option<(DVec3, Option<DVec3>)> {
    let points = |pose: &Pose| -> Vec<(ToolPoint, DVec3)> {
        let point = |reading: &Reading| match *reading {
            Reading::Point { place, frame, at } => {
                let station = &surroundings.frames[frame].value.measuring_from_base;
                Some((place, station.inverse().point(at)))
            }
            _ => None,
        };
        pose.seen.iter().filter_map(|observation| point(&observation.reading)).collect()
    };
    let (first, second) = (points(before), points(after));
    let both: Vec<(ToolPoint, DVec3, DVec3)> = first
        .iter()
        .filter_map(|(place, first_point)| {
            let counterpart = second.iter().find(|(other, _)| other == place)?;
            Some((*place, *first_point, counterpart.1))
        })
        .collect();
    let (from, to): (Vec<DVec3>, Vec<DVec3>) = both.iter().map(|(_, a, b)| (*a, *b)).unzip();
    let tcp = both.iter().find(|(place, ..)| *place == ToolPoint::Tcp).map(|(_, a, b)| *b - *a);
    let Some(motion) = fit_rigid_motion(&from, &to) else { return tcp.map(|shift| (shift, None)) };
    let origin = Chain::nominal(arm, &before.inputs.q).base_from_tool.origin;
    Some((motion.point(origin) - origin, Some(vector_from_rotation(&motion.rotation))))
}

/// Compliances estimated from pairs; `None` without pairs. `noise_m` is the standard deviation of one coordinate of one point.
///
/// # Errors
/// Values that are not finite, or noise that is not positive.
pub fn compliances(
    arm: &Arm,
    pairs: &[LoadedPose],
    noise_m: f64,
) -> Result<Option<Compliances>, StiffnessError> {
    if pairs.is_empty() {
        return Ok(None);
    }
    // Targets are about a decimetre apart, so the uncertainty of a rotation is that of a translation over 0.1 m.
    let shift_m = noise_m * std::f64::consts::SQRT_2;
    let noise = DifferenceNoise { shift_m, turn_rad: shift_m / 0.1 };
    estimate_simultaneously(arm, pairs, noise).map(Some)
}

/// Effect of the load-induced change of geometry at each loaded pose, with the compliances of `model` under a wrench.
#[must_use]
pub fn enhanced_effects(model: &Model, campaign: &Campaign) -> Vec<EnhancedEffectAtPose> {
    let compliance = wrench_compliance(model);
    if compliance.iter().all(|c| *c == 0.0) {
        return Vec::new();
    }
    let poses = campaign.poses.iter().enumerate();
    let loaded = poses.filter(|(_, pose)| pose.inputs.wrench_base != Wrench::ZERO);
    let one = |(index, pose): (usize, &Pose)| {
        let wrench = pose.inputs.wrench_base;
        let effect =
            enhanced_stiffness::enhanced_effect(&model.arm, &pose.inputs.q, wrench, &compliance);
        EnhancedEffectAtPose { pose: index, effect }
    };
    loaded.map(one).collect()
}

/// Compliance of each joint under an external wrench, rad/Nm (m/N).
#[must_use]
pub fn wrench_compliance(model: &Model) -> Joints {
    let mut compliance = Joints::default();
    for effect in model.effects() {
        let kind = effect.spec().kind;
        if let Some(joint) = effect.joint().filter(|_| WRENCH_COMPLIANT_EFFECTS.contains(&kind)) {
            compliance[joint] += effect.values()[0];
        }
    }
    compliance
}

const WRENCH_COMPLIANT_EFFECTS: [&str; 2] = ["joint_compliance", "load_compliance"];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign_simulation;
    use crate::test_campaigns::{nominal_robot, unmeasured_campaign};
    use physics::{AnyEffect, ParameterValues};

    #[test]
    fn pairs_give_back_the_stiffness_and_what_bending_is_worth() {
        let effect = |joint, compliance: f64| {
            let given: &[(&str, &[f64])] = &[("compliance", &[compliance])];
            let arm = nominal_robot().arm;
            AnyEffect::build("joint_compliance", &arm, Some(joint), ParameterValues(given))
                .expect("built")
        };
        let (c2, c3) = (4e-6, 8e-6);
        let truth =
            Model::new(nominal_robot().arm, &[effect(1, c2), effect(2, c3)]).expect("sound");
        let mut campaign = unmeasured_campaign(3, 30);
        let unloaded = campaign.poses.clone();
        for (k, pose) in campaign.poses.iter_mut().enumerate() {
            let side = [DVec3::X, DVec3::Y, DVec3::NEG_Z][k % 3];
            pose.inputs.wrench_base = Wrench { force: side * 400.0, moment: DVec3::ZERO };
        }
        campaign.poses.extend(unloaded);
        let campaign = campaign_simulation::simulate_readings(
            &campaign,
            &truth,
            &campaign.surroundings,
            0.1,
            3,
        );
        let pairs = pairs(&truth.arm, &campaign, &campaign.surroundings);
        assert_eq!(pairs.len(), 30);
        let found = compliances(&truth.arm, &pairs, 5e-6).expect("finite").expect("pairs");
        for (joint, truth) in [(1, c2), (2, c3)] {
            let (value, sigma) = (found.value[joint].expect("determined"), found.sigma(joint));
            assert!((value - truth).abs() < 5.0 * sigma, "joint {joint}: {value} ± {sigma}");
            assert!(sigma < 0.1 * truth, "joint {joint}: {value} ± {sigma}");
        }
        let worth = enhanced_effects(&truth, &campaign);
        assert_eq!(worth.len(), 30);
        let most = |quantity: fn(&EnhancedEffect) -> f64| -> f64 {
            worth.iter().filter_map(|w| w.effect.as_ref()).map(quantity).fold(0.0, f64::max)
        };
        // A robot of this class deflects by a fraction of a millimetre; the change of geometry matters little.
        assert!(
            most(|e| e.deflection_m) > 1e-4
                && most(|e| e.by_wrench_m) < 1e-2 * most(|e| e.deflection_m)
        );
        assert!(super::enhanced_effects(&nominal_robot(), &campaign).is_empty());
    }
}
