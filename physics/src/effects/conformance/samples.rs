//! One or more examples of every effect of the list, from its spec: any new effect is in the suite at once.

use super::scene::{Scene, scene, sliding_scene};
use crate::effects::{AnyEffect, CUTTING, DRIVES, SPECS};
use crate::frame::normals;
use crate::spec::{Count, EffectScope, Parameter, Range, Role, Spec, Unit};
use crate::{Arm, JointKind, ParameterValues};

/// An effect in a suitable scene.
pub(super) struct Sample {
    pub(super) name: String,
    pub(super) scene: Scene,
    pub(super) effect: AnyEffect,
    entries: Vec<(&'static str, Vec<f64>)>,
}

/// Effects that take one of several sets of parameters; all others take all parameters of their
/// spec.
const ALTERNATIVES: &[(&str, &[&[&str]])] = &[
    ("thermal_growth", &[&["growth"], &["growth", "lag"], &["amplitude", "time_constant"]]),
    ("thermal_zero", &[&["drift"], &["drift", "lag"], &["amplitude", "time_constant"]]),
    ("spindle_growth", &[&["growth", "lag"], &["growth_um", "lag"], &["growth_um"]]),
    ("tool_offset", &[&["shift"], &["turn"], &["shift", "turn"]]),
    ("wrench_bias", &[&["bias"], &["bias_Nm"], &["bias", "bias_Nm"]]),
    ("friction_asymmetry", &[&["offset"], &["coefficient"], &["offset", "coefficient"]]),
    ("inertia", &[&["inertia"], &["mass"]]),
    ("gravity_torque", &[&["cos", "sin"], &["first_moment"]]),
];

/// The joint of the samples: the second, which is prismatic in the second scene.
const JOINT: usize = 1;

pub(super) fn samples() -> Vec<Sample> {
    SPECS
        .iter()
        .chain(DRIVES)
        .chain(CUTTING)
        .flat_map(|spec| sets(spec).into_iter().flat_map(|set| of_set(spec, &set)))
        .collect()
}

fn sets(spec: &Spec) -> Vec<Vec<&'static Parameter>> {
    let settings = || spec.parameters.iter().filter(|p| p.role == Role::Setting);
    match ALTERNATIVES.iter().find(|(kind, _)| *kind == spec.kind) {
        None => vec![spec.parameters.iter().collect()],
        Some((_, sets)) => sets
            .iter()
            .map(|set| {
                spec.parameters.iter().filter(|p| set.contains(&p.stem)).chain(settings()).collect()
            })
            .collect(),
    }
}

fn of_set(spec: &'static Spec, set: &[&'static Parameter]) -> Vec<Sample> {
    let has = |stem: &str| set.iter().any(|p| p.stem == stem);
    let scenes = match spec.scope {
        // A revolute joint has an inertia, a prismatic one a mass.
        EffectScope::Joint if spec.kind == "inertia" && has("inertia") => vec![scene()],
        EffectScope::Joint if spec.kind == "inertia" => vec![sliding_scene()],
        EffectScope::Joint => vec![scene(), sliding_scene()],
        _ => vec![scene()],
    };
    let sample = |scene: Scene| {
        let entries: Vec<_> = set.iter().map(|p| (p.stem, numbers(spec, p, &scene.arm))).collect();
        let effect = built(spec, &scene.arm, &entries);
        let kind = scene.arm.joints()[JOINT].kind;
        let stems: Vec<_> = set.iter().map(|p| p.stem).collect();
        Sample { name: format!("{} {stems:?} {kind:?}", spec.kind), scene, effect, entries }
    };
    scenes.into_iter().map(sample).collect()
}

fn built(spec: &Spec, arm: &Arm, entries: &[(&'static str, Vec<f64>)]) -> AnyEffect {
    let given: Vec<(&str, &[f64])> = entries.iter().map(|(s, v)| (*s, v.as_slice())).collect();
    let joint = (spec.scope != EffectScope::Robot).then_some(JOINT);
    AnyEffect::build(spec.kind, arm, joint, ParameterValues(&given))
        .unwrap_or_else(|e| panic!("{}: {e}", spec.kind))
}

impl Sample {
    /// The same effect with each linear value times `factor`; without linear values, each value.
    pub(super) fn scaled(&self, factor: f64) -> AnyEffect {
        let mut effect = self.effect;
        let linear = self.linear();
        let none = !linear.contains(&true);
        for (value, _) in effect.values_mut().iter_mut().zip(&linear).filter(|(_, l)| none || **l) {
            *value *= factor;
        }
        effect
    }

    /// Which of the values are linear.
    pub(super) fn linear(&self) -> Vec<bool> {
        let lengths = lengths(&self.effect);
        let roles = self.effect.fitted().iter().map(|p| p.role == Role::Linear);
        roles.zip(lengths).flat_map(|(linear, n)| std::iter::repeat_n(linear, n)).collect()
    }

    /// The values that it was built from.
    pub(super) fn given(&self, stem: &str) -> Option<&[f64]> {
        self.entries.iter().find(|(s, _)| *s == stem).map(|(_, numbers)| numbers.as_slice())
    }

    /// The effect rebuilt with other values of one entry.
    pub(super) fn rebuilt(
        &self,
        stem: &str,
        numbers: &[f64],
    ) -> Result<AnyEffect, crate::BuildError> {
        let given: Vec<(&str, &[f64])> = self
            .entries
            .iter()
            .map(|(s, v)| (*s, if *s == stem { numbers } else { v.as_slice() }))
            .collect();
        AnyEffect::build(
            self.effect.spec().kind,
            &self.scene.arm,
            self.effect.joint(),
            ParameterValues(&given),
        )
    }
}

/// Number of values of each fitted parameter in this effect.
pub(super) fn lengths(effect: &AnyEffect) -> Vec<usize> {
    let mut left = effect.values().len();
    let mut take = |p: &Parameter| {
        let n = match p.count {
            Count::One => 1,
            Count::Exactly(n) => n,
            Count::UpTo(_) | Count::ThreePerCarriedBody => left,
        };
        left = left.checked_sub(n).expect("as many values as the spec says");
        n
    };
    effect.fitted().iter().map(&mut take).collect()
}

/// Values of realistic size, SI, all different.
fn numbers(spec: &Spec, parameter: &Parameter, arm: &Arm) -> Vec<f64> {
    let joint = &arm.joints()[JOINT];
    match (spec.kind, parameter.stem) {
        (_, "pivot") => return (joint.point + joint.axis * 0.1).to_array().to_vec(),
        (_, "direction") => return vec![0.0, 0.6, 0.8],
        (_, "range") => return vec![-2.0, 2.5],
        (_, "from_joint") => return vec![4.0],
        ("axis_shift", _) => {
            let (n1, n2) = normals(joint.axis);
            return (n1 * 3e-4 - n2 * 2e-4).to_array().to_vec();
        }
        ("payload", "com") => return vec![0.9, 0.1, 1.2],
        ("hysteresis", "reversal") => return vec![5e-3],
        _ => {}
    }
    let count = match parameter.count {
        Count::One => 1,
        Count::Exactly(n) => n,
        Count::UpTo(n) => n.min(6),
        Count::ThreePerCarriedBody => 3 * (arm.count() - JOINT),
    };
    let size = size(parameter);
    let signed = |x: f64| if matches!(parameter.range, Range::NotNegative) { x.abs() } else { x };
    (0..count).map(|i| signed(size * [1.0, -0.6, 1.7, 0.4, -1.3, 0.8][i % 6])).collect()
}

fn size(parameter: &Parameter) -> f64 {
    match (parameter.stem, parameter.unit) {
        ("free_length", _) => 0.4,
        ("a", _) => 0.2,
        ("L", _) => 0.6,
        ("scale", _) => 0.05,
        ("bias_Nm", _) => 2.0,
        ("lag", _) => 900.0,
        ("reference", _) => 21.0,
        ("cycles", _) => 3.0,
        ("stribeck_speed", _) => 0.4,
        ("per_K", _) => 0.01,
        ("amplitude_N", _) => 30.0,
        (_, Unit::One) => 2e-4,
        (_, Unit::Milliradian | Unit::TurnMilliradian) => 4e-4,
        (_, Unit::PhaseRadian) => 0.7,
        (_, Unit::Degree) => 0.5,
        (_, Unit::Millimetre) => 3e-4,
        (_, Unit::Micrometre) => 5e-5,
        (_, Unit::NewtonMetre) => 400.0,
        (_, Unit::Newton) => 5.0,
        (_, Unit::Compliance) => 2e-6,
        (_, Unit::TurnCompliance) => 5e-7,
        (_, Unit::CubicCompliance) => 1e-13,
        (_, Unit::MicrometrePerNewton) => 2e-6,
        (_, Unit::MicrometrePerKelvin) => 1.6e-5,
        (_, Unit::MicrometrePerKrpm) => 1e-9,
        (_, Unit::MilliradianPerKelvin) => 1e-5,
        (_, Unit::Second) => 1200.0,
        (_, Unit::Kilogram) => 2.5,
        (_, Unit::NewtonPerMetre) => 8e4,
        (_, Unit::KilogramSquareMetre | Unit::KilogramMetre) => 1.5,
        (_, Unit::PerMetre) => 0.02,
        (_, Unit::NewtonPerMillimetre) => 8e3,
        (_, Unit::NewtonPerSquareMillimetre) => 8e8,
        // A period of hours: the scene's times are far from the segment's start.
        (_, Unit::Hertz) => 1e-4,
        (_, unit) => panic!("no sample for {} in {unit:?}", parameter.stem),
    }
}

#[test]
fn a_sliding_joint_is_among_the_samples() {
    let slides = |s: &Sample| s.scene.arm.joints()[JOINT].kind == JointKind::Prismatic;
    assert!(samples().iter().filter(|s| slides(s)).count() >= 15);
}
