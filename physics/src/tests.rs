//! Comparison of the physics with independent formulas: 4×4 matrices, energies, virtual work,
//! reciprocity.

mod cut;
mod drives;
mod dynamics;
mod geometric_effects;
mod geometry;
mod laws;
mod load_effects;
mod loads;
mod matrix;
mod nominal_loads;

use crate::effects::AnyEffect;
use crate::{Arm, Evaluation, Inputs, JOINTS_MAX, Joints, Memories, Model, ParameterValues};
use proptest::prelude::*;

/// An effect from its entries; `joint` is 0-based.
fn effect(
    arm: &Arm,
    kind: &str,
    joint: impl Into<Option<usize>>,
    given: &[(&str, &[f64])],
) -> AnyEffect {
    AnyEffect::build(kind, arm, joint.into(), ParameterValues(given))
        .unwrap_or_else(|e| panic!("{kind}: {e}"))
}

/// Evaluation of a model of these effects, settled.
fn evaluated(arm: Arm, effects: &[AnyEffect], inputs: &Inputs) -> Evaluation {
    let model = Model::new(arm, effects).expect("effects that fit each other");
    let mut memories = Memories::default();
    model.settle(inputs, &mut memories);
    model.evaluate(inputs, &memories)
}

prop_compose! {
    /// Arbitrary positions of six joints; for a prismatic joint rad are taken as m, which is a long
    /// motion.
    fn six_joints()(six in prop::array::uniform6(-2.5..2.5_f64)) -> Joints {
        let mut q = [0.0; JOINTS_MAX];
        q[..6].copy_from_slice(&six);
        q
    }
}
