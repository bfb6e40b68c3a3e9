//! Size of each effect at the tool, after registration: what remains of it once measuring frames and targets are estimated without it.
//!
//! A zero offset of the first joint moves the tool by centimetres, but an unknown measuring frame turns with it, so that no measurement shows it. Sizes
//! therefore compare the predictions of two models for the measured points, as for the findings of a diagnosis: the resulting one, and the same without
//! this effect, with frames and targets fitted again. Root mean square of the distances, m.

use diagnosis::fit::refit_with_fixed_weights;
use diagnosis::tool_displacement::tool_displacements;
use diagnosis::{Campaign, Fit, Hypothesis};

/// The size of each effect of the model, in its order. Without measured points nothing can be registered: then the displacement of the tool by each
/// effect, base frame. `used`: the poses of the fit.
pub(super) fn registered_sizes(campaign: &Campaign, fit: &Fit, used: &[bool]) -> Vec<f64> {
    let all = fit.residuals(campaign);
    if !all.iter().any(|one| one.is_length) {
        return tool_displacements(&fit.hypothesis, campaign);
    }
    let size = |effect: usize| {
        let without = Hypothesis::fixed(*fit.hypothesis.without(effect).model);
        let registered = refit_with_fixed_weights(campaign, &without, fit, used);
        let pairs = all.iter().zip(registered.residuals(campaign));
        let squares: Vec<f64> = pairs
            .filter(|(with, _)| with.is_length)
            .map(|(with, without)| (with.residual - without.residual).length_squared())
            .collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    };
    (0..fit.hypothesis.model.effects().len()).map(size).collect()
}

#[cfg(test)]
mod tests {
    use diagnosis::{FitSettings, Influence, campaign_import, fit};
    use glam::DVec3;
    use physics::{AnyEffect, Arm, Chain, ParameterValues};
    use recording::model::presets::preset;
    use recording::series::{RequiredData, read_text};

    use super::*;

    /// Sixty poses of an arm that is measured by an instrument of unknown position.
    fn campaign(arm: &Arm) -> Campaign {
        let mut text = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n".to_owned();
        for k in 0..60 {
            let angle = |step: f64, reach: f64| reach * (step * f64::from(k)).sin();
            let deg = [angle(0.7, 60.0), angle(1.3, 25.0), angle(1.9, 25.0)];
            let wrist = [angle(2.3, 80.0), 40.0 + angle(2.9, 30.0), angle(3.7, 90.0)];
            let mut q = physics::Joints::default();
            deg.iter().chain(&wrist).zip(q.iter_mut()).for_each(|(d, q)| *q = d.to_radians());
            let at = 1e3 * Chain::tool_at(arm, &q).origin + DVec3::new(3000.0, -500.0, 200.0);
            let row = deg.iter().chain(&wrist).copied().chain(at.to_array());
            let row: Vec<String> = row.map(|number| number.to_string()).collect();
            text += &format!("{k},{}\n", row.join(","));
        }
        let recording = read_text("poses.csv", &text, None, None, RequiredData::Measurement);
        campaign_import::campaign(arm, &[recording.expect("a recording")]).expect("a campaign")
    }

    #[test]
    fn an_offset_that_the_measuring_frame_takes_up_has_no_size_and_one_of_the_elbow_has() {
        let model = preset("irb120").expect("a preset").model().expect("a model");
        let arm = model.physics.arm;
        let campaign = campaign(&arm);
        let mut hypothesis = Hypothesis::fixed(model.physics);
        for joint in [0, 2] {
            let given: &[(&str, &[f64])] = &[("offset", &[0.002])];
            let effect =
                AnyEffect::build("joint_offset", &arm, Some(joint), ParameterValues(given));
            hypothesis.add(effect.expect("an effect"), &["offset"]).expect("room");
        }
        let used = vec![true; campaign.poses.len()];
        let settings = FitSettings::full(&used, Influence::Equal);
        let fitted = fit(&campaign, &hypothesis, &settings);
        let [first, elbow] = registered_sizes(&campaign, &fitted, &used)[..] else {
            panic!("two effects")
        };
        let shift = tool_displacements(&hypothesis, &campaign);
        assert!(shift[0] > 5e-4, "the offset moves the tool in the base frame: {shift:?}");
        assert!(first < 0.01 * shift[0], "the frame takes it up: {first}");
        assert!(elbow > 1e-4, "{elbow}");
    }
}
