//! Drive effects in files: built, listed as not compensated, without influence on a correction.

use super::tests::{EVERY_KIND, TWO_JOINTS, parse};
use super::{EffectEntry, SiParameter};

#[test]
fn drive_effects_are_built_and_listed_as_not_compensated() {
    let torques: Vec<_> =
        EVERY_KIND.iter().skip_while(|(kind, _)| *kind != "coulomb_friction").take(13).collect();
    let without_effects = parse(TWO_JOINTS).unwrap();
    for (kind, entries) in torques {
        let text = format!("{TWO_JOINTS}\n[[effect]]\nkind = \"{kind}\"\n{entries}\n");
        let model = parse(&text).unwrap();
        assert_eq!(model.physics, without_effects.physics, "{kind} takes part in the correction");
        assert_eq!(model.not_compensated_names().last(), Some(&format!("{kind} of joint 2")));
        let [effect] = model.drives[..] else { panic!("{kind} is not built") };
        assert_eq!((effect.spec().kind, effect.joint()), (*kind, Some(1)));
        let numbers = model.file.effects.last().unwrap().to_si(&model.physics.arm).unwrap();
        let numbers: Vec<(&str, &[f64])> =
            numbers.iter().map(|(stem, values)| (*stem, values.as_slice())).collect();
        let given: Vec<SiParameter<'_>> = numbers
            .iter()
            .map(|(stem, values)| SiParameter { stem, values, sigma: None })
            .collect();
        let again = EffectEntry::from_si(&model.physics.arm, kind, Some(1), &given).unwrap();
        assert_eq!(
            again.to_si(&model.physics.arm),
            model.file.effects.last().unwrap().to_si(&model.physics.arm)
        );
        let keys = |entry: &EffectEntry| -> Vec<String> {
            entry.parameters.iter().map(|p| p.key.clone()).collect()
        };
        assert_eq!(keys(&again), keys(model.file.effects.last().unwrap()), "{kind}");
    }
}

#[test]
fn inertias_of_links_reach_the_drives() {
    let model = parse(TWO_JOINTS).unwrap().physics;
    let mut inputs = physics::Inputs::at_rest(physics::Joints::default());
    inputs.acceleration[1] = 1.0;
    let torque = |text: &str| {
        let arm = parse(text).unwrap().physics.arm;
        physics::inverse_dynamics(&arm, &inputs)[1]
    };
    let axis = model.arm.joints()[1].axis;
    let more = torque(
        &TWO_JOINTS.replace("[0.1, 0.1, 0.1, 0.0, 0.0, 0.0]", "[0.3, 0.4, 0.5, 0.0, 0.0, 0.0]"),
    );
    let by = axis.dot(glam::DVec3::new(0.2, 0.3, 0.4) * axis);
    assert!((more - torque(TWO_JOINTS) - by).abs() < 1e-12, "{more}");
}

#[test]
fn cutting_effects_are_built_and_listed_as_not_compensated() {
    let cuts = EVERY_KIND.iter().skip_while(|(kind, _)| *kind != "edge_force").take(6);
    let without_effects = parse(TWO_JOINTS).unwrap();
    for (kind, entries) in cuts {
        let text = format!("{TWO_JOINTS}\n[[effect]]\nkind = \"{kind}\"\n{entries}\n");
        let model = parse(&text).unwrap();
        assert_eq!(model.physics, without_effects.physics, "{kind} takes part in the correction");
        assert_eq!(model.not_compensated_names().last().map(String::as_str), Some(*kind));
        let [effect] = model.cutting[..] else { panic!("{kind} is not built") };
        assert_eq!((effect.spec().kind, effect.joint()), (*kind, None));
        let again = parse(&model.file.to_toml()).unwrap();
        assert_eq!(again.cutting, model.cutting, "{kind}: other bits");
    }
}
