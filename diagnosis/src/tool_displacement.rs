//! Size of each effect at the tool.
//!
//! Each effect is compared with the same model without it, at the poses of the campaign, including its memory. A large effect can still be poorly
//! determined.

use crate::campaign::Campaign;
use crate::hypothesis::Hypothesis;
use crate::least_squares::visit_poses;
use glam::DVec3;
use physics::Model;

/// Displacement of the TCP in the base frame due to each effect, root mean square over the poses, m; one per effect of the model.
#[must_use]
pub fn tool_displacements(hypothesis: &Hypothesis, campaign: &Campaign) -> Vec<f64> {
    let places = |model: &Model| {
        let mut places: Vec<DVec3> = Vec::with_capacity(campaign.poses.len());
        visit_poses(model, campaign, None, |_, evaluation, _| {
            places.push(evaluation.real.base_from_tool.origin);
        });
        places
    };
    let all = places(&hypothesis.model);
    let share = |effect: usize| {
        let without = places(&hypothesis.without(effect).model);
        let squares = all.iter().zip(&without).map(|(a, b)| (*a - *b).length_squared());
        (squares.sum::<f64>() / all.len().max(1) as f64).sqrt()
    };
    (0..hypothesis.model.effects().len()).map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_campaigns::{nominal_robot, unmeasured_campaign};
    use physics::{AnyEffect, ParameterValues};

    #[test]
    fn a_turn_of_the_first_joint_moves_the_tool_by_its_distance_from_that_axis() {
        let campaign = unmeasured_campaign(1, 40);
        let mut hypothesis = Hypothesis::fixed(nominal_robot());
        let arm = hypothesis.model.arm;
        for (joint, offset) in [(0, 1e-4), (5, 0.0)] {
            let given: &[(&str, &[f64])] = &[("offset", &[offset])];
            let effect =
                AnyEffect::build("joint_offset", &arm, Some(joint), ParameterValues(given));
            hypothesis.add(effect.expect("built"), &[]).expect("room");
        }
        let squares = campaign.poses.iter().map(|pose| {
            let tool = physics::Chain::nominal(&arm, &pose.inputs.q).base_from_tool.origin;
            tool.truncate().length_squared()
        });
        let lever = (squares.sum::<f64>() / 40.0).sqrt();
        let shares = tool_displacements(&hypothesis, &campaign);
        assert!((shares[0] / (1e-4 * lever) - 1.0).abs() < 1e-3, "{shares:?}, {lever}");
        assert!(shares[1] < 1e-12, "{shares:?}");
    }
}
