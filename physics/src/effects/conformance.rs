//! Conformance suite for all effects of the list, including new ones.
//!
//! No test for allocation is needed: the crate is `no_std` without `alloc`.

mod joint_slopes;
mod keys;
mod samples;
mod scene;

pub(crate) use scene::{Scene, scene, seen, sliding_scene, with_inputs};

use crate::cut::ForceTerm;
use crate::deviation::Contribution;
use crate::drive::DriveTerm;
use crate::effects::{AnyEffect, CUTTING, DRIVES, SPECS};
use crate::spec::{ActsOn, Parameter, Range, Role};
use crate::{Arm, Inputs, JOINTS_MAX, Memories, Memory, Model, Wrench};
use glam::DVec3;
use proptest::prelude::*;
use samples::{Sample, lengths, samples};

/// Steps of every joint, rad or m: a long one, one back, a short one further back, and one forward by less than any gap.
const PATH: [f64; 4] = [0.05, -0.03, -0.004, 1.2e-4];

fn numbers(contribution: &Contribution) -> Vec<f64> {
    let wrench = |w: &Wrench| [w.force.to_array(), w.moment.to_array()].concat();
    match contribution {
        Contribution::None => vec![],
        Contribution::Joint { delta: x, .. } | Contribution::JointLoad { load: x, .. } => vec![*x],
        Contribution::DriveTorque { term, .. } => match term {
            DriveTerm::Torque(x)
            | DriveTerm::Viscous(x)
            | DriveTerm::ViscousShare(x)
            | DriveTerm::Spring { torque: x, .. }
            | DriveTerm::SpringCubic(x)
            | DriveTerm::Recorded(x) => vec![*x],
            DriveTerm::Carried(v) => v.to_array().to_vec(),
        },
        Contribution::Axis { turn: v, .. }
        | Contribution::LinkTurn { turn: v, .. }
        | Contribution::LinkShift { shift: v, .. }
        | Contribution::BaseTurn { turn: v }
        | Contribution::GravityTurn { turn: v } => v.to_array().to_vec(),
        Contribution::Tool { shift, turn } => [shift.to_array(), turn.to_array()].concat(),
        Contribution::Mass { mass, first_moment: m } => vec![*mass, m.x, m.y, m.z],
        Contribution::Sensor { bias, scale, turn } => {
            [wrench(bias), wrench(scale), turn.to_array().to_vec()].concat()
        }
        Contribution::ToolForce(term) => match term {
            ForceTerm::Edge(v) | ForceTerm::Chip(v) => v.to_array().to_vec(),
            ForceTerm::Wear(x) | ForceTerm::Oscillation(x) => vec![*x],
            ForceTerm::Runout(pair) => pair.to_vec(),
            ForceTerm::CrossTalk(matrix) => matrix.to_cols_array().to_vec(),
        },
    }
}

fn place(contribution: &Contribution) -> Option<ActsOn> {
    Some(match contribution {
        Contribution::None => return None,
        Contribution::Joint { .. } => ActsOn::JointPosition,
        Contribution::Axis { .. }
        | Contribution::LinkTurn { .. }
        | Contribution::LinkShift { .. }
        | Contribution::BaseTurn { .. }
        | Contribution::Tool { .. } => ActsOn::Geometry,
        Contribution::JointLoad { .. }
        | Contribution::GravityTurn { .. }
        | Contribution::Mass { .. }
        | Contribution::Sensor { .. } => ActsOn::Loads,
        Contribution::DriveTorque { .. } => ActsOn::DriveTorque,
        Contribution::ToolForce(_) => ActsOn::ToolForce,
    })
}

fn path(start: &Inputs) -> Vec<Inputs> {
    path_towards(start, 1.0)
}

/// The inputs at each end of the path's steps, or of its mirror image, the first one settled.
fn path_towards(start: &Inputs, sign: f64) -> Vec<Inputs> {
    let mut inputs = Inputs { direction: [sign; JOINTS_MAX], ..*start };
    let mut all = vec![inputs];
    for step in PATH.map(|step| sign * step) {
        inputs.q_before = inputs.q;
        inputs.q = inputs.q.map(|q| q + step);
        inputs.direction = [step.signum(); JOINTS_MAX];
        (inputs.dt_s, inputs.time_s) = (200.0, inputs.time_s + 200.0);
        inputs.ambient_celsius += 100.0 * step;
        inputs.spindle_rpm *= 1.0 - step;
        inputs.velocity = [0.3 * step.signum(); JOINTS_MAX];
        inputs.acceleration = [0.7; JOINTS_MAX];
        all.push(inputs);
    }
    all
}

/// The contribution of an effect after the path, with its own memory, and its derivatives there.
fn run(
    effect: &AnyEffect,
    arm: &Arm,
    path: &[Inputs],
) -> (Memory, Contribution, Vec<Contribution>) {
    let mut memory = Memory::default();
    effect.settle(&path[0], &mut memory);
    for inputs in &path[1..] {
        effect.advance(inputs, &mut memory);
    }
    seen(arm, &path[path.len() - 1], |signals| {
        let slopes = (0..effect.values().len()).map(|k| effect.derivative(k, signals, &memory));
        (memory, effect.predict(signals, &memory), slopes.collect())
    })
}

fn added(sample: &Sample, effect: &AnyEffect) -> Contribution {
    run(effect, &sample.scene.arm, &path(&sample.scene.inputs)).1
}

#[test]
fn every_effect_of_the_list_has_a_sample_that_does_something() {
    let samples = samples();
    for spec in SPECS.iter().chain(DRIVES).chain(CUTTING) {
        let of_kind: Vec<_> = samples.iter().filter(|s| s.effect.spec() == spec).collect();
        assert!(!of_kind.is_empty(), "{} has no sample", spec.kind);
        for sample in of_kind {
            let contributions = numbers(&added(sample, &sample.effect));
            assert!(contributions.iter().any(|x| *x != 0.0), "{} does nothing", sample.name);
        }
    }
}

#[test]
fn linear_parameters_of_zero_do_nothing() {
    for sample in samples() {
        let silent = sample.scaled(0.0);
        assert!(numbers(&added(&sample, &silent)).iter().all(|x| *x == 0.0), "{}", sample.name);
        let model = Model::new(sample.scene.arm, &[]).expect("nominal");
        let mut silenced = model;
        silenced.push(silent).expect("room for one");
        let mut memories = Memories::default();
        for inputs in path(&sample.scene.inputs) {
            silenced.advance(&inputs, &mut memories);
            let evaluation = silenced.evaluate(&inputs, &memories);
            assert_eq!(
                evaluation.real, evaluation.nominal,
                "{}: not the same to the bit",
                sample.name
            );
            assert_eq!(
                evaluation.loads,
                model.evaluate(&inputs, &memories).loads,
                "{}",
                sample.name
            );
            let drive = silenced.drive(&inputs, &memories);
            let without = model.drive(&inputs, &memories);
            for i in 0..JOINTS_MAX {
                assert_eq!(drive.recorded(i), without.recorded(i), "{}", sample.name);
            }
        }
    }
}

#[test]
fn effects_on_loads_alone_do_not_move_the_tool() {
    for sample in samples().iter().filter(|s| s.effect.spec().acts_on == ActsOn::Loads) {
        let model = Model::new(sample.scene.arm, &[sample.effect]).expect("sound");
        let evaluation = model.evaluate(&sample.scene.inputs, &Memories::default());
        let nominal = Model::nominal(sample.scene.arm);
        let without = nominal.evaluate(&sample.scene.inputs, &Memories::default());
        assert_eq!(evaluation.real, evaluation.nominal, "{}", sample.name);
        assert_ne!(evaluation.loads, without.loads, "{} changes no load", sample.name);
    }
}

#[test]
fn effects_on_drives_or_cuts_change_neither_position_nor_loads() {
    let elsewhere =
        |s: &&Sample| matches!(s.effect.spec().acts_on, ActsOn::DriveTorque | ActsOn::ToolForce);
    for sample in samples().iter().filter(elsewhere) {
        let model = Model::new(sample.scene.arm, &[sample.effect]).expect("sound");
        let nominal = Model::nominal(sample.scene.arm);
        let (mut memories, inputs) = (Memories::default(), &path(&sample.scene.inputs)[1]);
        model.advance(inputs, &mut memories);
        let evaluation = model.evaluate(inputs, &memories);
        assert_eq!(evaluation, nominal.evaluate(inputs, &Memories::default()), "{}", sample.name);
    }
}

#[test]
fn every_contribution_has_the_place_that_its_spec_says() {
    for sample in samples() {
        let (_, contribution, slopes) =
            run(&sample.effect, &sample.scene.arm, &path(&sample.scene.inputs));
        let acts_on = Some(sample.effect.spec().acts_on);
        assert_eq!(place(&contribution), acts_on, "{}", sample.name);
        for slope in &slopes {
            assert_eq!(place(slope), acts_on, "{}: a derivative", sample.name);
        }
    }
}

#[test]
fn derivatives_agree_with_finite_differences_along_a_path() {
    for (sample, sign) in samples().iter().flat_map(|s| [(s, 1.0), (s, -1.0)]) {
        let (arm, path) = (&sample.scene.arm, path_towards(&sample.scene.inputs, sign));
        let (_, centre, slopes) = run(&sample.effect, arm, &path);
        let whole = numbers(&centre).iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        for (k, slope) in slopes.iter().enumerate() {
            let value = sample.effect.values()[k];
            let h = if value == 0.0 { 1e-6 } else { 1e-4 * value.abs() };
            let beside = |value: f64| {
                let mut effect = sample.effect;
                effect.values_mut()[k] = value;
                run(&effect, arm, &path).1
            };
            let difference = beside(value + h).minus(&beside(value - h)).times(0.5 / h);
            let (analytic, found) = (numbers(slope), numbers(&difference));
            let size = analytic.iter().chain(&found).fold(0.0_f64, |m, x| m.max(x.abs()));
            let error = 1e-6 * size + 1e-15 * whole / h;
            for (s, f) in analytic.iter().zip(&found) {
                assert!((s - f).abs() <= error, "{} value {k}: {s} not {f}", sample.name);
            }
        }
    }
}

#[test]
fn linear_effects_are_linear_where_they_have_settled() {
    for sample in samples().iter().filter(|sample| sample.linear().contains(&true)) {
        let inputs = Inputs { direction: [-1.0; JOINTS_MAX], ..sample.scene.inputs };
        let settled = |effect: &AnyEffect| numbers(&run(effect, &sample.scene.arm, &[inputs]).1);
        let (one, other) = (settled(&sample.scaled(1.0)), settled(&sample.scaled(2.5)));
        for (a, b) in one.iter().zip(&other) {
            assert!((2.5 * a - b).abs() <= 1e-14 * b.abs(), "{}: {a} became {b}", sample.name);
        }
    }
}

#[test]
fn values_are_as_many_as_the_spec_says() {
    for sample in samples() {
        let effect = &sample.effect;
        assert_eq!(lengths(effect).iter().sum::<usize>(), effect.values().len(), "{}", sample.name);
        assert_eq!(sample.linear().len(), effect.values().len());
        assert!(effect.fitted().iter().all(|p| p.role != Role::Setting));
        let known = effect.fitted().iter().all(|p| effect.spec().parameters.contains(p));
        assert!(known, "{} fits what its spec does not have", sample.name);
        let given = |p: &Parameter| sample.given(p.stem).is_some();
        assert!(effect.fitted().iter().all(given), "{} fits what was not given", sample.name);
        let flat: Vec<f64> = effect
            .fitted()
            .iter()
            .flat_map(|p| sample.given(p.stem).expect("given"))
            .copied()
            .collect();
        assert_eq!(flat, effect.values(), "{}: numbers out of order", sample.name);
    }
}

#[test]
fn a_value_out_of_its_range_is_refused() {
    for sample in samples() {
        for (parameter, n) in sample.effect.fitted().iter().zip(lengths(&sample.effect)) {
            let bad = match parameter.range {
                Range::Any => f64::NAN,
                Range::NotNegative => -1e-9,
                Range::Positive => 0.0,
                Range::Between(low, _) => low,
            };
            let rebuilt = sample.rebuilt(parameter.stem, &vec![bad; n]);
            let refused = matches!(rebuilt, Err(crate::BuildError::OutOfRange { .. }));
            assert!(refused, "{}: {} = {bad} gave {rebuilt:?}", sample.name, parameter.stem);
        }
    }
}

prop_compose! {
    fn any_inputs()(
        q in prop::array::uniform16(-50.0..50.0), q_before in prop::array::uniform16(-50.0..50.0),
        sign in prop::array::uniform16(-1..=1_i32), force in prop::array::uniform6(-1e5..1e5),
        ambient in prop_oneof![Just(f64::NAN), -60.0..200.0], time_s in -1e5..1e9, dt_s in -10.0..1e6,
        rpm in prop_oneof![Just(f64::NAN), 0.0..1e5], velocity in prop::array::uniform16(-1e3..1e3),
        acceleration in prop::array::uniform16(-1e4..1e4),
    ) -> Inputs {
        Inputs {
            q_before, velocity, acceleration,
            direction: sign.map(f64::from),
            wrench_base: Wrench { force: DVec3::from_slice(&force), moment: DVec3::from_slice(&force[3..]) },
            ambient_celsius: ambient, spindle_rpm: rpm, time_s, dt_s,
            ..Inputs::at_rest(q)
        }
    }
}

/// A memory after an arbitrary sequence of inputs.
fn lived(sample: &Sample, life: &[(Inputs, u8)]) -> Memory {
    let mut memory = Memory::default();
    for (inputs, what) in life {
        match what {
            0 => sample.effect.settle(inputs, &mut memory),
            1 => sample.effect.advance(inputs, &mut memory),
            _ => sample.effect.follow(inputs, &mut memory),
        }
    }
    memory
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn memory_settles_to_the_same_state_whatever_was_before(
        life in prop::collection::vec((any_inputs(), 0..3_u8), 1..6), last in any_inputs(),
    ) {
        for sample in samples() {
            let mut memory = lived(&sample, &life);
            let mut fresh = Memory::default();
            sample.effect.settle(&last, &mut memory);
            sample.effect.settle(&last, &mut fresh);
            prop_assert_eq!(memory, fresh, "{}", sample.name);
            if !sample.effect.spec().has_memory {
                prop_assert_eq!(memory, Memory::default(), "{} remembers", sample.name);
            }
        }
    }

    #[test]
    fn finite_inputs_give_finite_contributions(
        life in prop::collection::vec((any_inputs(), 0..3_u8), 0..6), last in any_inputs(),
    ) {
        for sample in samples() {
            let memory = lived(&sample, &life);
            prop_assert!(memory.0.iter().all(|x| x.is_finite()), "{}: {memory:?}", sample.name);
            seen(&sample.scene.arm, &last, |signals| {
                let predicted = sample.effect.predict(signals, &memory);
                prop_assert!(numbers(&predicted).iter().all(|x| x.is_finite()), "{}: {predicted:?}", sample.name);
                for k in 0..sample.effect.values().len() {
                    let slope = sample.effect.derivative(k, signals, &memory);
                    prop_assert!(numbers(&slope).iter().all(|x| x.is_finite()), "{}", sample.name);
                }
                Ok(())
            })?;
        }
    }
}
