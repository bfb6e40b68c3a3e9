//! Candidate effects of a diagnosis: every effect that moves the tool, at every joint, as a missing effect; and a correction of every effect that the
//! model states.
//!
//! The order is the order of preference among effects that explain the same (docs/reference/effects.md, "What may answer for what"). The effects are
//! those of the crate `physics`; residuals are not used.

use crate::campaign::Campaign;
use crate::candidates::{
    Candidate, CandidateList, candidates, may_be_coupled, path_candidates, wave_candidate,
};
use crate::periodogram::CYCLES_MIN;
use physics::spec::{ActsOn, Need};
use physics::{Arm, JointKind, Model};
use std::f64::consts::TAU;

/// Thermal lags that are tried, as shares of the longest duration of a segment.
const LAG_SHARES: [f64; 3] = [0.05, 0.15, 0.4];

/// Waves per revolution of a joint that are candidates if its range of motion is too small for the search for waves: the orders of planets and of
/// poles. One and two waves per revolution are always candidates.
const WAVE_ORDERS: [f64; 2] = [3.0, 4.0];
/// Range of motion below which a joint shows no wave, rad or m.
const RANGE_MIN: f64 = 1e-3;

/// All candidates of effects that `model` may lack or state wrongly.
pub(super) fn candidate_dictionary(model: &Model, campaign: &Campaign) -> Vec<Candidate> {
    let moves = |acts_on: ActsOn| !matches!(acts_on, ActsOn::DriveTorque | ActsOn::ToolForce);
    let known = model.effects().enumerate().filter(|(_, e)| moves(e.spec().acts_on));
    let mut all: Vec<Candidate> =
        known.map(|(place, effect)| Candidate::change(place, effect)).collect();
    all.extend(geometry(&model.arm, campaign));
    all.extend(candidates(&model.arm, campaign));
    all.extend(slow_waves(&model.arm, campaign));
    all.extend(couplings(&model.arm, campaign));
    all.extend(lagged_thermal_drifts(&model.arm, campaign));
    all.extend(path_candidates(&model.arm, campaign));
    all.extend(force_sensor_errors(model, campaign));
    // Counterbalance springs are searched for separately; see `springs`.
    all.retain(|candidate| !candidate.is_spring());
    // Compliances under gravity alone or the wrench alone come last: among equals docs/reference/effects.md prefers the compliance under both.
    let halves = |c: &Candidate| {
        let kind = c.probes.first().map(|probe| probe.effect.spec().kind);
        matches!(kind, Some("load_compliance" | "gravity_compliance" | "gravity_sag"))
    };
    all.sort_by_key(halves);
    all.retain(|candidate| !model.effects().any(|effect| candidate.is_covered_by(effect)));
    all
}

/// Errors of the nominal geometry: zero offsets, displaced and tilted axes, tool offset.
fn geometry(arm: &Arm, campaign: &Campaign) -> Vec<Candidate> {
    let mut list = CandidateList::new(arm, campaign);
    for joint in 0..arm.count() {
        list.add_effect("joint_offset", Some(joint), &[("offset", &[0.0])]);
        list.add_effect("axis_shift", Some(joint), &[("shift", &[0.0; 3])]);
        list.add_effect("axis_tilt", Some(joint), &[("tilt", &[0.0; 2])]);
    }
    list.add_effect("tool_offset", None, &[("shift", &[0.0; 3]), ("turn", &[0.0; 3])]);
    list.candidates
}

/// Waves that are too slow in a joint's range of motion for the search (`waves`) and too fast for the list of every joint. Without them, several
/// waves of that list and an offset would be selected in place of one of these.
fn slow_waves(arm: &Arm, campaign: &Campaign) -> Vec<Candidate> {
    let mut all = Vec::new();
    for (joint, about) in arm.joints().iter().enumerate() {
        let unit = if about.kind == JointKind::Prismatic { TAU } else { 1.0 };
        let positions = || campaign.poses.iter().map(|pose| pose.inputs.q[joint]);
        let range = positions().fold(f64::NEG_INFINITY, f64::max)
            - positions().fold(f64::INFINITY, f64::min);
        let is_slow = |cycles: &f64| cycles * range < CYCLES_MIN * TAU && range > RANGE_MIN;
        let slow = WAVE_ORDERS.map(|order| order * unit).into_iter().filter(is_slow);
        all.extend(slow.filter_map(|cycles| wave_candidate(arm, joint, cycles)));
    }
    all
}

/// Coupling of any joint to any other.
fn couplings(arm: &Arm, campaign: &Campaign) -> Vec<Candidate> {
    let mut list = CandidateList::new(arm, campaign);
    for joint in 0..arm.count() {
        let others = (0..arm.count()).filter(|from| *from != joint);
        for from in others.filter(|from| *from > joint || !may_be_coupled(arm, *from, joint)) {
            let from = [(from + 1) as f64];
            list.add_effect(
                "joint_coupling",
                Some(joint),
                &[("ratio", &[0.0]), ("from_joint", &from)],
            );
        }
    }
    list.candidates
}

/// Errors of a force sensor. They are visible only through the compliances that the model states.
fn force_sensor_errors(model: &Model, campaign: &Campaign) -> Vec<Candidate> {
    let is_compliant = |effect: &physics::AnyEffect| effect.spec().needs.contains(&Need::Wrench);
    let pushed = |pose: &crate::Pose| pose.inputs.wrench_base != physics::Wrench::ZERO;
    let mut list = CandidateList::new(&model.arm, campaign);
    if model.effects().any(is_compliant) && campaign.poses.iter().any(pushed) {
        list.add_effect("wrench_bias", None, &[("bias", &[0.0; 3]), ("bias_Nm", &[0.0; 3])]);
        list.add_effect("wrench_scale", None, &[("scale", &[0.0; 6])]);
        list.add_effect("wrench_misalignment", None, &[("turn", &[0.0; 3])]);
    }
    list.candidates
}

/// Thermal drifts that follow a recorded temperature or spindle speed with a lag.
fn lagged_thermal_drifts(arm: &Arm, campaign: &Campaign) -> Vec<Candidate> {
    let longest_s = campaign.poses.iter().map(|pose| pose.inputs.time_s).fold(0.0, f64::max);
    let warms = campaign.poses.iter().any(|pose| pose.inputs.celsius(0).is_finite());
    let mut list = CandidateList::new(arm, campaign);
    for lag_s in
        LAG_SHARES.map(|share| share * longest_s).into_iter().filter(|lag| warms && *lag > 0.0)
    {
        for joint in 0..arm.count() {
            list.add_effect("thermal_zero", Some(joint), &[("drift", &[0.0]), ("lag", &[lag_s])]);
            list.add_growth(joint, &[("growth", &[0.0]), ("lag", &[lag_s])]);
        }
        list.add_effect("spindle_growth", None, &[("growth", &[0.0]), ("lag", &[lag_s])]);
    }
    let spins = campaign.poses.iter().any(|pose| pose.inputs.spindle_rpm > 0.0);
    if spins {
        list.add_effect("spindle_growth", None, &[("growth_um", &[0.0])]);
        for lag_s in LAG_SHARES.map(|share| share * longest_s).into_iter().filter(|lag| *lag > 0.0)
        {
            list.add_effect("spindle_growth", None, &[("growth_um", &[0.0]), ("lag", &[lag_s])]);
        }
    }
    if warms {
        list.add_effect("spindle_growth", None, &[("growth", &[0.0])]);
    }
    list.candidates
}

#[cfg(test)]
mod tests {
    use super::slow_waves;
    use crate::test_campaigns;

    #[test]
    fn a_joint_that_moves_a_third_of_a_turn_is_asked_for_waves_that_its_search_passes_over() {
        let mut campaign = test_campaigns::unmeasured_campaign(0, 200);
        for (k, pose) in campaign.poses.iter_mut().enumerate() {
            let share = k as f64 / 199.0;
            pose.inputs.q = Default::default();
            // Ranges of motion: a third of a turn, nine tenths of a turn, none.
            (pose.inputs.q[0], pose.inputs.q[1]) = (2.1 * share, 5.6 * share);
        }
        let found = slow_waves(&test_campaigns::nominal_robot().arm, &campaign);
        let count_of = |joint: usize| found.iter().filter(|one| one.joint == Some(joint)).count();
        assert_eq!((count_of(0), count_of(1), count_of(2)), (2, 0, 0));
    }
}
