//! The corrector, with every kind of effect.

use crate::heap_of;
use corrector::{Command, Corrector, CycleInputs, Mode, Outcome, Settings, WrenchSample};
use envelope::Limits;
use glam::DVec3;
use physics::spec::{Count, EffectScope, Parameter, Range, Role, Spec};
use physics::{AnyEffect, Arm, Model, ParameterValues, Wrench};
use recording::model::presets::preset;
use tests::cell_loop::{JOINTS, TICK_NS, path};

const CYCLES: u64 = 100_000;
/// The joint that the effects belong to.
const JOINT: usize = 1;

fn settings(wrench: Option<f64>) -> Settings {
    let mut settings = Settings::with_envelope(Limits::new(0.02, 0.05, 5.0).unwrap());
    settings.wrench.process_stiffness = wrench;
    settings
}

fn values(spec: &Spec, parameter: &Parameter, arm: &Arm, setting: f64) -> Vec<f64> {
    let joint = &arm.joints()[JOINT];
    match (spec.kind, parameter.stem) {
        (_, "pivot") => return joint.point.to_array().to_vec(),
        (_, "direction") => return vec![0.0, 0.6, 0.8],
        (_, "range") => return vec![-2.0, 2.5],
        (_, "from_joint") => return vec![4.0],
        ("axis_shift", _) => {
            return (joint.axis.any_orthogonal_vector() * 1e-5).to_array().to_vec();
        }
        _ => {}
    }
    let one = match (parameter.range, parameter.role) {
        (Range::Between(low, high), _) => 0.5 * (low + high),
        (_, Role::Setting) => setting,
        _ => 1e-5,
    };
    let count = match parameter.count {
        Count::One => 1,
        Count::Exactly(n) => n,
        Count::UpTo(n) => n.min(6),
        Count::ThreePerCarriedBody => 3 * (arm.count() - JOINT),
    };
    vec![one; count]
}

/// The effect with as many of its parameters as it can have at once.
fn effect(spec: &Spec, arm: &Arm) -> Option<AnyEffect> {
    let all: Vec<&Parameter> = spec.parameters.iter().collect();
    let mut sets: Vec<u32> = (0..1 << all.len()).collect();
    sets.sort_by_key(|set| std::cmp::Reverse(set.count_ones()));
    let joint = (spec.scope != EffectScope::Robot).then_some(JOINT);
    [1e-5, 1.0, 0.0].into_iter().find_map(|setting| {
        sets.iter().find_map(|set| {
            let chosen = all.iter().enumerate().filter(|(i, _)| set >> i & 1 == 1);
            let entries: Vec<(&str, Vec<f64>)> =
                chosen.map(|(_, p)| (p.stem, values(spec, p, arm, setting))).collect();
            let given: Vec<(&str, &[f64])> =
                entries.iter().map(|(stem, values)| (*stem, values.as_slice())).collect();
            AnyEffect::build(spec.kind, arm, joint, ParameterValues(&given)).ok()
        })
    })
}

/// Every kind of effect in a separate model, and a whole calibrated robot.
fn models() -> Vec<(String, Model)> {
    let thesis = preset("irb1600-6-145-thesis").unwrap().model().unwrap().physics;
    let mut models: Vec<(String, Model)> = physics::effects::SPECS
        .iter()
        .map(|spec| {
            let mut model = Model::nominal(thesis.arm);
            let effect = effect(spec, &thesis.arm);
            let effect = effect.unwrap_or_else(|| panic!("{}: no set of parameters", spec.kind));
            model.push(effect).unwrap();
            (spec.kind.to_owned(), model)
        })
        .collect();
    models.push(("all of the thesis".to_owned(), thesis));
    models
}

fn world(k: u64) -> CycleInputs {
    let force = DVec3::new(20.0 + (k % 7) as f64, -5.0, 3.0);
    let wrench = Wrench { force, moment: DVec3::new(0.1, 0.2, 0.3) };
    let in_base = k.is_multiple_of(3);
    CycleInputs {
        wrench: (k % 1000 < 900).then_some(WrenchSample {
            wrench,
            in_base,
            age_ns: 1_000_000,
            faulty: false,
        }),
        ambient_celsius: 25.0,
        joint_celsius: [35.0; physics::JOINTS_MAX],
        spindle_rpm: 12_000.0,
        ..CycleInputs::default()
    }
}

/// Good commands, and now and then one of each kind that is refused.
fn command(k: u64) -> Command {
    let mut command = Command::new(k, k * TICK_NS, &path(k * TICK_NS));
    match k % 97 {
        11 => command.q[0] = f64::NAN,
        22 => command.q[0] = 99.0,
        33 => command.joints = JOINTS + 1,
        44 => command.seq = k - 1,
        55 => command.t_ns = 0,
        66 => command.age_ns = u64::MAX,
        77 => command.direction = Some([1.0; physics::JOINTS_MAX]),
        88 => command.session = k,
        _ => {}
    }
    command
}

/// Everything that the daemon's cycle calls, through all of its states.
fn run(corrector: &mut Corrector, model: &Model, cycles: u64) -> Outcome {
    let mut last = Outcome::default();
    for k in 1..=cycles {
        let now_ns = k * TICK_NS;
        corrector.set_bypass(k % 500 > 450);
        corrector.set_mode([Mode::Full, Mode::Limited, Mode::Shadow][(k / 700 % 3) as usize]);
        if k.is_multiple_of(400) {
            corrector.model_changed(model);
        }
        if k.is_multiple_of(600) {
            corrector.rearm_wrench();
        }
        if k % 300 > 250 {
            // A silence.
            continue;
        }
        let wanted = corrector.correct(model, &command(k), &world(k), now_ns);
        last = corrector.limit(model, &wanted);
        corrector.prepare(model);
    }
    last
}

#[test]
fn a_hundred_thousand_cycles_with_all_kinds_of_effects_take_nothing_from_the_heap() {
    let models = models();
    let cycles = CYCLES.div_ceil(2 * models.len() as u64);
    for (kind, model) in &models {
        for stiffness in [None, Some(1e6)] {
            let mut corrector = Corrector::new(settings(stiffness));
            let mut last = None;
            let heap = heap_of(|| last = Some(run(&mut corrector, model, cycles)));
            assert_eq!((heap.count_total, heap.count_current), (0, 0), "{kind}");
            assert!(last.is_some(), "{kind}: it ran");
        }
    }
}
