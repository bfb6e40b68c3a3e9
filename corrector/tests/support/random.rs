//! Random robots and poses.

use crate::support::{effect, portal, seven, six};
use physics::{Arm, Model};
use proptest::prelude::*;

/// Numbers from −1 to 1 for each joint's errors, then the tool's and the base's.
pub(crate) type Errors = (Vec<[f64; 5]>, [f64; 7]);

pub(crate) fn errors() -> impl Strategy<Value = Errors> {
    let number = || -1.0..1.0_f64;
    (prop::collection::vec(prop::array::uniform5(number()), 7), prop::array::uniform7(number()))
}

pub(crate) fn places() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(0.0..1.0_f64, 7)
}

/// Six revolute joints, three slides with a wrist, or seven joints.
pub(crate) fn arm(which: u8) -> Arm {
    [six(), portal(), seven()][usize::from(which % 3)]
}

/// A robot with these errors, times `size`.
pub(crate) fn erring(arm: Arm, (joints, whole): &Errors, size: f64) -> Model {
    let mut model = Model::nominal(arm);
    let mut push = |kind: &str, joint: Option<usize>, given: &[(&str, &[f64])]| {
        model.push(effect(&arm, kind, joint, given)).expect("room");
    };
    for (i, [offset, ratio, amplitude, phase, compliance]) in
        joints.iter().enumerate().take(arm.count())
    {
        let joint = Some(i);
        push("joint_offset", joint, &[("offset", &[2e-3 * size * offset])]);
        push("joint_ratio", joint, &[("ratio", &[3e-4 * size * ratio])]);
        let wave: &[(&str, &[f64])] = &[
            ("amplitude", &[1e-4 * size * amplitude.abs()]),
            ("cycles", &[(40.0 * ratio.abs()).round() + 1.0]),
            ("phase", &[3.0 * phase]),
        ];
        push("transmission_error", joint, wave);
        push("joint_compliance", joint, &[("compliance", &[4e-6 * size * compliance.abs()])]);
    }
    let [x, y, z, a, b, c, base] = whole.map(|x| x * size);
    push(
        "tool_offset",
        None,
        &[("shift", &[5e-4 * x, 5e-4 * y, 5e-4 * z]), ("turn", &[5e-4 * a, 5e-4 * b, 5e-4 * c])],
    );
    push("base_compliance", None, &[("compliance", &[1e-7 * base.abs()])]);
    model
}

/// A pose in the middle eight tenths of the joints' ranges.
pub(crate) fn pose(arm: &Arm, places: &[f64]) -> Vec<f64> {
    let within = |(joint, share): (&physics::Joint, &f64)| {
        let (low, high) = joint.limits;
        low + (high - low) * (0.1 + 0.8 * share)
    };
    arm.joints().iter().zip(places).map(within).collect()
}
