//! Derivatives of the effects by joint positions, compared with finite differences.

use super::{Sample, Scene, numbers, samples, seen};
use crate::frame::vector_from_rotation;
use crate::lanes::{Kernel, Lanes, run_widest};
use crate::spec::ActsOn;
use crate::{
    Arm, Chain, Deviation, Evaluation, Inputs, JOINTS_MAX, Joints, LoadSlopes, Loads, Memories,
    Memory, Model, SlopeSums, Wrench,
};
use glam::DVec3;

const STEP: f64 = 1e-6;

struct LoadSlopesKernel<'a>(&'a SlopeSums, &'a Arm, &'a Evaluation);

impl Kernel for LoadSlopesKernel<'_> {
    type Output = ([Joints; JOINTS_MAX], LoadSlopes);

    fn run<S: Lanes>(self, lanes: S) -> Self::Output {
        let Self(sums, arm, Evaluation { loads, .. }) = self;
        let (mut joints, mut following) = ([[0.0; JOINTS_MAX]; JOINTS_MAX], LoadSlopes::default());
        sums.load_slopes(lanes, loads, &mut following);
        for (i, row) in joints.iter_mut().enumerate().take(arm.count()) {
            for k in 0..S::PARTS {
                lanes.store(sums.row(lanes, (&following, loads), (i, k)), row, k);
            }
        }
        (joints, following)
    }
}

/// At rest, because inertial loads depend on the joints in another way.
fn at_rest(sample: &Sample) -> Inputs {
    let still = Inputs { velocity: [0.0; JOINTS_MAX], ..sample.scene.inputs };
    Inputs { acceleration: [0.0; JOINTS_MAX], direction: [1.0; JOINTS_MAX], ..still }
}

/// Predicted and actual change of the deviation of a model with this effect alone, for a step of
/// all joints.
fn followed(
    sample: &Sample,
    step: &[f64; JOINTS_MAX],
) -> Option<([f64; JOINTS_MAX], DVec3, [Evaluation; 2])> {
    let inputs = at_rest(sample);
    let mut model = Model::nominal(sample.scene.arm);
    model.push(sample.effect).expect("room");
    let mut memories = Memories::default();
    model.settle(&inputs, &mut memories);
    let (mut evaluation, mut slopes) = (Evaluation::default(), SlopeSums::default());
    model.deviate_into(&inputs, &memories, &mut evaluation, Some(&mut slopes));
    let beside = |times: f64| {
        let mut inputs = inputs;
        inputs.q.iter_mut().zip(step).for_each(|(q, step)| *q += times * step);
        model.evaluate(&inputs, &memories)
    };
    let (joints, following) =
        run_widest(model.arm.count(), LoadSlopesKernel(&slopes, &model.arm, &evaluation));
    let by = |rates: &[f64; JOINTS_MAX]| {
        rates.iter().zip(step).map(|(rate, step)| rate * step).sum::<f64>()
    };
    let joints = joints.map(|rates| by(&rates));
    let base = DVec3::new(by(&following.base_x), by(&following.base_y), 0.0);
    slopes.is_complete.then(|| (joints, base, [beside(-STEP), beside(STEP)]))
}

#[test]
fn slopes_of_effects_agree_with_differences() {
    let mut complete = 0;
    for sample in samples() {
        // One joint after the other, then all at once.
        for k in 0..=sample.scene.arm.count() {
            let one = |i: usize| {
                if k == i || k == sample.scene.arm.count() { 1.0 - 0.1 * i as f64 } else { 0.0 }
            };
            let step = core::array::from_fn(one);
            let Some((joints, base, [less, more])) = followed(&sample, &step) else { continue };
            complete += 1;
            let (a, b) = (less.deviation, more.deviation);
            for (i, analytic) in joints[..sample.scene.arm.count()].iter().enumerate() {
                let found = (b.joints[i] - a.joints[i]) / (2.0 * STEP);
                let close = (analytic - found).abs() < 1e-5 * found.abs().max(1e-3);
                assert!(close, "{}: joint {i} by {k}: {analytic} {found}", sample.name);
            }
            let turned = (b.base_turn - a.base_turn) / (2.0 * STEP);
            assert!((base - turned).length() < 1e-8, "{}: {base} {turned}", sample.name);
            // The other parts must not change.
            let rest = |d: &Deviation| {
                (
                    d.tool_shift,
                    d.tool_turn,
                    (0..=JOINTS_MAX).map(|i| d.link(i).copied()).collect::<Vec<_>>(),
                )
            };
            assert_eq!(rest(&a), rest(&b), "{}", sample.name);
            assert!((0..JOINTS_MAX).all(|i| a.axis(i) == b.axis(i)), "{}", sample.name);
        }
    }
    assert!(complete > 100, "{complete}");
}

#[test]
fn the_effect_of_a_deviation_on_the_tool_is_correct_to_first_order() {
    let moving =
        |s: &&Sample| matches!(s.effect.spec().acts_on, ActsOn::JointPosition | ActsOn::Geometry);
    let mut complete = 0;
    for sample in samples().iter().filter(moving) {
        let Scene { arm, inputs, .. } = &sample.scene;
        let mut memory = Memory::default();
        sample.effect.advance(inputs, &mut memory);
        let added = seen(arm, inputs, |signals| sample.effect.predict(signals, &memory));
        let size = numbers(&added).iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        if size == 0.0 {
            continue;
        }
        complete += 1;
        let mut deviation = Deviation::default();
        deviation.add(&added.times(STEP / size));
        let (nominal, real) =
            (Chain::nominal(arm, &inputs.q), Chain::real(arm, &inputs.q, &deviation));
        let (linear, angular) =
            deviation.moves(&nominal, &Loads::on(arm, &nominal, Wrench::ZERO).motions);
        let (nominal_tool, real_tool) = (&nominal.base_from_tool, &real.base_from_tool);
        let turned =
            vector_from_rotation(&(real_tool.rotation * nominal_tool.rotation.transpose()));
        assert!(
            (real_tool.origin - nominal_tool.origin - linear).length() < 1e-10,
            "{}",
            sample.name
        );
        assert!((turned - angular).length() < 1e-10, "{}", sample.name);
        assert!(linear.length() + angular.length() > 1e-9, "{} moves nothing", sample.name);
    }
    assert!(complete > 20, "{complete}");
}
