//! Laws of joints summed in lanes, compared with the separate effects.

use super::{effect, six_joints};
use crate::{AnyEffect, Arm, Contribution, Inputs, Joints, Memories, Model, Wrench};
use glam::DVec3;
use proptest::prelude::*;

/// More waves on the first joint than fit into the sums, every kind of law on the second.
fn effects(arm: &Arm, size: f64) -> Vec<AnyEffect> {
    let mut effects = Vec::new();
    let mut push = |kind: &str, joint: usize, given: &[(&str, &[f64])]| {
        effects.push(effect(arm, kind, joint, given));
    };
    for n in 1..=6 {
        let n = f64::from(n);
        let wave: &[(&str, &[f64])] =
            &[("amplitude", &[1e-4 * n * size]), ("cycles", &[3.0 * n]), ("phase", &[0.4 * n])];
        push("transmission_error", 0, wave);
    }
    push("joint_offset", 1, &[("offset", &[2e-3 * size])]);
    push("joint_offset", 1, &[("offset", &[1e-3])]);
    push("joint_ratio", 1, &[("ratio", &[1e-3 * size])]);
    push("gravity_compliance", 1, &[("compliance", &[2e-6 * size])]);
    push("load_compliance", 1, &[("compliance", &[3e-6 * size])]);
    push("joint_compliance", 2, &[("compliance", &[4e-6 * size])]);
    push("backlash", 2, &[("width", &[1e-4 * size])]);
    push("joint_ratio", 5, &[("ratio", &[-5e-4 * size])]);
    effects
}

/// Contributions of the effects to the joints, one by one.
fn one_by_one(model: &Model, inputs: &Inputs, memories: &Memories) -> Joints {
    let mut sum = [0.0; crate::JOINTS_MAX];
    model.contributions(inputs, memories, |_, contribution| {
        if let Contribution::Joint { joint, delta } = *contribution {
            sum[joint] += delta;
        }
    });
    sum
}

proptest! {
    #[test]
    fn laws_side_by_side_are_the_sum_of_the_effects_whatever_was_changed_before(
        q in six_joints(), velocity in six_joints(), acceleration in six_joints(), force in prop::array::uniform3(-80.0..80.0_f64),
        size in -2.0..2.0_f64, swapped in 0..14_usize,
    ) {
        let arm = super::loads::arms()[0];
        let wrench_base = Wrench { force: DVec3::from_array(force), moment: DVec3::new(1.0, -2.0, 3.0) };
        let inputs = Inputs { velocity, acceleration, wrench_base, direction: [1.0; crate::JOINTS_MAX], ..Inputs::at_rest(q) };
        let (first, then) = (effects(&arm, 1.0), effects(&arm, size.abs()));
        let mut model = Model::nominal(arm);
        first.iter().for_each(|effect| model.push(*effect).expect("room"));
        for (index, effect) in then.iter().enumerate() {
            model.change(index, |place| *place = *effect).expect("there");
        }
        // An effect of another kind replaces one and is replaced again.
        model.change(swapped, |place| *place = first[12]).expect("there");
        let mut memories = Memories::default();
        model.settle(&inputs, &mut memories);
        let found = model.evaluate(&inputs, &memories).deviation.joints;
        for (found, expected) in found.iter().zip(one_by_one(&model, &inputs, &memories)) {
            prop_assert!((found - expected).abs() < 1e-15, "{found} {expected}");
        }
    }
}

#[test]
fn a_missing_effect_is_not_changed() {
    let mut model = Model::nominal(super::loads::arms()[0]);
    assert_eq!(model.change(0, |_| ()), None);
}

#[test]
fn an_effect_that_takes_the_place_of_another_kind_is_felt_as_if_it_had_been_there_from_the_start() {
    let arm = super::loads::arms()[0];
    let built_effect = |kind: &str, joint: Option<usize>, given: &[(&str, &[f64])]| {
        super::effect(&arm, kind, joint, given)
    };
    let compliance = built_effect("joint_compliance", Some(1), &[("compliance", &[1e-6])]);
    let offset = built_effect("joint_offset", Some(1), &[("offset", &[1e-3])]);
    let payload = built_effect("payload", None, &[("mass", &[4.0]), ("com", &[0.1, 0.0, 0.2])]);
    let hardening = built_effect("stiffness_hardening", Some(1), &[("cubic", &[1e-9])]);
    let inputs = Inputs::at_rest([0.3; crate::JOINTS_MAX]);
    let evaluation = |model: &Model| model.evaluate(&inputs, &Memories::default());
    for comes in [payload, hardening] {
        let built = Model::new(arm, &[compliance, comes]).expect("they fit");
        let mut changed = Model::new(arm, &[compliance, offset]).expect("they fit");
        changed.change(1, |place| *place = comes).expect("there");
        assert_eq!(evaluation(&changed), evaluation(&built), "{}", comes.spec().kind);
        assert_eq!(changed.has_hardening(), built.has_hardening());
        changed.change(1, |place| *place = offset).expect("there");
        let plain = Model::new(arm, &[compliance, offset]).expect("they fit");
        assert_eq!(evaluation(&changed), evaluation(&plain), "without {}", comes.spec().kind);
        assert!(!changed.has_hardening());
    }
}
