//! Expected tool error of the fitted model: covariance of the fit propagated to the TCP.
//!
//! `Cov_x = J_x Cov J_xᵀ`, where `J_x` is the Jacobian of the TCP in base axes by the free parameters. The part confounded with
//! an unknown measuring frame (the pose of the robot) is excluded, because a cell is taught in the controller's base frame.
//!
//! Valid if the form of the model is right; missing effects show only in the residuals of held-out poses.

use crate::campaign::{Arrival, Campaign};
use crate::extrinsics::Extrinsics;
use crate::fit_result::Fit;
use crate::least_squares::visit_poses;
use crate::tool_jacobian::ToolJacobian;
use crate::tool_motion::ToolMotion;
use physics::Inputs;

/// Standard uncertainty of the TCP position (root of the summed variances of the three axes), m, one per pose of `inputs`.
#[must_use]
pub fn tool_uncertainty(found: &Fit, inputs: &[Inputs]) -> Vec<f64> {
    let poses = inputs.iter().enumerate().map(|(row, inputs)| crate::Pose {
        inputs: *inputs,
        arrival: Arrival::Settled,
        recording: 0,
        row,
        seen: Vec::new(),
    });
    let campaign = Campaign {
        poses: poses.collect(),
        surroundings: Extrinsics::default(),
        instruments: Vec::new(),
        recordings: Vec::new(),
    };
    let first = found.surroundings.parameters().len();
    let mut uncertainty = Vec::with_capacity(inputs.len());
    let mut at_pose = ToolJacobian::of(&found.hypothesis);
    visit_poses(&found.hypothesis.model, &campaign, None, |pose, evaluation, memories| {
        let motions = at_pose.at(&inputs[pose], memories, evaluation);
        let share = |column: &usize, axis: usize| {
            let motion = column.checked_sub(first).and_then(|k| motions.get(k));
            motion.map_or(0.0, |motion: &ToolMotion| motion.shift[axis])
        };
        let variance = (0..3).map(|axis| {
            let shares: Vec<f64> = found.columns().iter().map(|c| share(c, axis)).collect();
            found.variance_of(&shares)
        });
        uncertainty.push(variance.sum::<f64>().sqrt());
    });
    uncertainty
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extrinsics::FitParameter;
    use crate::test_campaigns::{nominal_robot, unmeasured_campaign};
    use crate::{FitSettings, Influence, campaign_simulation, fit, geometry};
    use physics::Memories;

    #[test]
    fn the_tool_errs_by_as_much_as_is_expected() {
        let mut campaign = unmeasured_campaign(1, 50);
        // The frame is known; otherwise the pose of the robot would be part of the error.
        campaign.surroundings.frames[0] =
            FitParameter::known(campaign.surroundings.frames[0].value);
        campaign.surroundings.targets[0] =
            FitParameter::known(campaign.surroundings.targets[0].value);
        let truth = nominal_robot();
        let used = vec![true; 50];
        let settings = FitSettings::full(&used, Influence::Equal);
        let poses: Vec<Inputs> =
            unmeasured_campaign(1, 70).poses[50..].iter().map(|pose| pose.inputs).collect();
        let (mut expected, mut erred) = (0.0, 0.0);
        for seed in 0..30 {
            let made = campaign_simulation::simulate_readings(
                &campaign,
                &truth,
                &campaign.surroundings,
                1.0,
                seed,
            );
            let found = fit(&made, &geometry(&truth, &[]), &settings);
            expected += tool_uncertainty(&found, &poses).iter().map(|u| u * u).sum::<f64>();
            for inputs in &poses {
                let position = |model: &physics::Model| {
                    model.evaluate(inputs, &Memories::default()).real.base_from_tool.origin
                };
                erred += (position(&found.hypothesis.model) - position(&truth)).length_squared();
            }
        }
        // Thirty campaigns of a few dozen values each: random deviation about ten percent.
        let ratio = (erred / expected).sqrt();
        assert!((0.85..1.15).contains(&ratio), "{ratio}");
    }
}
