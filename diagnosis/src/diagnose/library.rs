//! Candidate effects of a diagnosis: every effect that moves the tool, at every joint, as a missing effect; and a correction of every effect that the
//! model states.
//!
//! The order is the order of preference among effects that explain the same (docs/reference/effects.md, "What may answer for what"). The effects are
//! those of the crate `physics`; residuals are not used.

use crate::campaign::Campaign;
use crate::candidates::{Candidate, List, candidates, couples, over_paths, wave_candidate};
use crate::waves::CYCLES_MIN;
use physics::spec::{ActsOn, Need};
use physics::{Arm, JointKind, Model};
use std::f64::consts::TAU;

/// Thermal lags that are tried, as shares of the longest duration of a segment.
const LAGS: [f64; 3] = [0.05, 0.15, 0.4];

/// Waves per revolution of a joint that are candidates if its range of motion is too small for the search for waves: the orders of planets and of
/// poles. One and two waves per revolution are always candidates.
const ORDERS: [f64; 2] = [3.0, 4.0];
/// Range of motion below which a joint shows no wave, rad or m.
const STILL: f64 = 1e-3;

/// All candidates of effects that `model` may lack or state wrongly.
pub(super) fn library(model: &Model, campaign: &Campaign) -> Vec<Candidate> {
    let moves = |acts_on: ActsOn| !matches!(acts_on, ActsOn::DriveTorque | ActsOn::ToolForce);
    let known = model.effects().enumerate().filter(|(_, e)| moves(e.spec().acts_on));
    let mut all: Vec<Candidate> =
        known.map(|(place, effect)| Candidate::change(place, effect)).collect();
    all.extend(geometry(&model.arm, campaign));
    all.extend(candidates(&model.arm, campaign));
    all.extend(slow_waves(&model.arm, campaign));
    all.extend(couplings(&model.arm, campaign));
    all.extend(slow_heat(&model.arm, campaign));
    all.extend(over_paths(&model.arm, campaign));
    all.extend(sensor(model, campaign));
    // Counterbalance springs are searched for separately; see `springs`.
    all.retain(|candidate| !candidate.is_spring());
    // Compliances under gravity alone or the wrench alone come last: among equals docs/reference/effects.md prefers the compliance under both.
    let halves = |c: &Candidate| {
        let kind = c.probes.first().map(|probe| probe.effect.spec().kind);
        matches!(kind, Some("load_compliance" | "gravity_compliance" | "gravity_sag"))
    };
    all.sort_by_key(halves);
    all.retain(|candidate| !model.effects().any(|effect| candidate.is_told_by(effect)));
    all
}

/// Errors of the nominal geometry: zero offsets, displaced and tilted axes, tool offset.
fn geometry(arm: &Arm, campaign: &Campaign) -> Vec<Candidate> {
    let mut list = List::new(arm, campaign);
    for joint in 0..arm.count() {
        list.values("joint_offset", Some(joint), &[("offset", &[0.0])]);
        list.values("axis_shift", Some(joint), &[("shift", &[0.0; 3])]);
        list.values("axis_tilt", Some(joint), &[("tilt", &[0.0; 2])]);
    }
    list.values("tool_offset", None, &[("shift", &[0.0; 3]), ("turn", &[0.0; 3])]);
    list.found
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
        let is_slow = |cycles: &f64| cycles * range < CYCLES_MIN * TAU && range > STILL;
        let asked = ORDERS.map(|order| order * unit).into_iter().filter(is_slow);
        all.extend(asked.filter_map(|cycles| wave_candidate(arm, joint, cycles)));
    }
    all
}

/// Coupling of any joint to any other.
fn couplings(arm: &Arm, campaign: &Campaign) -> Vec<Candidate> {
    let mut list = List::new(arm, campaign);
    for joint in 0..arm.count() {
        let others = (0..arm.count()).filter(|from| *from != joint);
        for from in others.filter(|from| *from > joint || !couples(arm, *from, joint)) {
            let from = [(from + 1) as f64];
            list.values("joint_coupling", Some(joint), &[("ratio", &[0.0]), ("from_joint", &from)]);
        }
    }
    list.found
}

/// Errors of a force sensor. They are visible only through the compliances that the model states.
fn sensor(model: &Model, campaign: &Campaign) -> Vec<Candidate> {
    let gives_way = |effect: &physics::AnyEffect| effect.spec().needs.contains(&Need::Wrench);
    let pushed = |pose: &crate::Pose| pose.inputs.wrench_base != physics::Wrench::ZERO;
    let mut list = List::new(&model.arm, campaign);
    if model.effects().any(gives_way) && campaign.poses.iter().any(pushed) {
        list.values("wrench_bias", None, &[("bias", &[0.0; 3]), ("bias_Nm", &[0.0; 3])]);
        list.values("wrench_scale", None, &[("scale", &[0.0; 6])]);
        list.values("wrench_misalignment", None, &[("turn", &[0.0; 3])]);
    }
    list.found
}

/// Thermal drifts that follow a recorded temperature or spindle speed with a lag.
fn slow_heat(arm: &Arm, campaign: &Campaign) -> Vec<Candidate> {
    let longest_s = campaign.poses.iter().map(|pose| pose.inputs.time_s).fold(0.0, f64::max);
    let warms = campaign.poses.iter().any(|pose| pose.inputs.celsius(0).is_finite());
    let mut list = List::new(arm, campaign);
    for lag_s in LAGS.map(|share| share * longest_s).into_iter().filter(|lag| warms && *lag > 0.0) {
        for joint in 0..arm.count() {
            list.values("thermal_zero", Some(joint), &[("drift", &[0.0]), ("lag", &[lag_s])]);
            list.growth(joint, &[("growth", &[0.0]), ("lag", &[lag_s])]);
        }
        list.values("spindle_growth", None, &[("growth", &[0.0]), ("lag", &[lag_s])]);
    }
    let spins = campaign.poses.iter().any(|pose| pose.inputs.spindle_rpm > 0.0);
    if spins {
        list.values("spindle_growth", None, &[("growth_um", &[0.0])]);
        for lag_s in LAGS.map(|share| share * longest_s).into_iter().filter(|lag| *lag > 0.0) {
            list.values("spindle_growth", None, &[("growth_um", &[0.0]), ("lag", &[lag_s])]);
        }
    }
    if warms {
        list.values("spindle_growth", None, &[("growth", &[0.0])]);
    }
    list.found
}

#[cfg(test)]
mod tests {
    use super::slow_waves;
    use crate::made;

    #[test]
    fn a_joint_that_moves_a_third_of_a_turn_is_asked_for_waves_that_its_search_passes_over() {
        let mut campaign = made::empty(0, 200);
        for (k, pose) in campaign.poses.iter_mut().enumerate() {
            let share = k as f64 / 199.0;
            pose.inputs.q = Default::default();
            // Ranges of motion: a third of a turn, nine tenths of a turn, none.
            (pose.inputs.q[0], pose.inputs.q[1]) = (2.1 * share, 5.6 * share);
        }
        let found = slow_waves(&made::nominal().arm, &campaign);
        let of = |joint: usize| found.iter().filter(|one| one.joint == Some(joint)).count();
        assert_eq!((of(0), of(1), of(2)), (2, 0, 0));
    }
}
