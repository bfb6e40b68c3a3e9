//! Possible hidden effects: every constant effect that moves the tool, at the largest size plausible for an arm of the IRB 1600's class.
//!
//! Effects are those of `physics`; joints, signs, phases and directions are random. Their size at
//! the tool is determined in [`super::draw`].

use core::f64::consts::TAU;
use glam::DVec3;
use libm::sqrt;
use physics::{AnyEffect, Arm, Chain, Inputs, JointKind, Loads, Model, ParameterValues};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Factor on the largest load of the measuring program for which a hardening law must hold.
const LOAD_RESERVE: f64 = 1.3;

/// All effects that can be hidden. A regression without physics (`joint_polynomial`), errors of the
/// force sensor and dynamic effects are excluded.
pub const KINDS: &[&str] = &[
    "joint_offset",
    "joint_ratio",
    "joint_coupling",
    "transmission_error",
    "backlash",
    "lost_motion",
    "hysteresis",
    "gravity_compliance",
    "gravity_sag",
    "load_compliance",
    "joint_compliance",
    "stiffness_hardening",
    "bearing_compliance",
    "base_compliance",
    "tool_compliance",
    "counterbalance",
    "axis_tilt",
    "axis_shift",
    "tool_offset",
    "gravity_tilt",
    "payload",
    "thermal_growth",
    "thermal_zero",
    "axis_wobble",
    "spindle_growth",
];

/// An effect of the largest size, and which of its values determine the size.
pub(super) struct EffectTemplate {
    pub(super) kind: &'static str,
    pub(super) joint: Option<usize>,
    parameters: Vec<(&'static str, Vec<f64>)>,
    scaled_count: usize,
}

impl EffectTemplate {
    /// The effect at `share` of the largest size; `None` if it cannot be built there.
    pub(super) fn build(&self, arm: &Arm, share: f64) -> Option<AnyEffect> {
        let mut numbers = self.parameters.clone();
        numbers.iter_mut().take(self.scaled_count).for_each(|(_, list)| {
            list.iter_mut().for_each(|x| *x *= share);
        });
        let given: Vec<(&str, &[f64])> = numbers.iter().map(|(s, x)| (*s, x.as_slice())).collect();
        AnyEffect::build(self.kind, arm, self.joint, ParameterValues(&given)).ok()
    }
}

/// One draw; `None` if the effect is not applicable to the joint drawn.
pub(super) fn draw(
    kind: &'static str,
    model: &Model,
    survey: &[Inputs],
    rng: &mut ChaCha8Rng,
) -> Option<EffectTemplate> {
    let arm = &model.arm;
    let i = rng.random_range(0..arm.count());
    let mut sampler = Sampler { rng };
    let wrist = i + 3 >= arm.count();
    let by = |main: f64, wrist_: f64| if wrist { wrist_ } else { main };
    let (mut scaled_count, mut joint) = (1, Some(i));
    let parameters = match kind {
        "joint_offset" => vec![("offset", vec![sampler.random_sign(1e-3)])],
        "joint_ratio" => vec![("ratio", vec![sampler.random_sign(2e-3)])],
        "joint_coupling" => {
            let from = vec![(random_coupled_joint(arm, i, &mut sampler)? + 1) as f64];
            vec![("ratio", vec![sampler.random_sign(2e-3)]), ("from_joint", from)]
        }
        "transmission_error" => {
            let cycles = vec![f64::from(sampler.rng.random_range(1_u8..=12))];
            let amplitude = vec![by(3e-4, 1e-3)];
            vec![("amplitude", amplitude), ("cycles", cycles), ("phase", vec![sampler.phase()])]
        }
        "axis_wobble" => {
            let cycles = f64::from(sampler.rng.random_range(1_u8..=2));
            let phases = vec![sampler.phase(), sampler.phase()];
            let amplitude = sampler.random_vector(2, 1e-3).iter().map(|x| x.abs()).collect();
            vec![("amplitude", amplitude), ("phase", phases), ("cycles", vec![cycles])]
        }
        "backlash" => vec![("width", vec![by(6e-4, 1.5e-3)])],
        "lost_motion" => {
            let torque = sampler.uniform(0.05, 0.3) * largest_load(arm, survey, i);
            vec![("width", vec![by(6e-4, 1.5e-3)]), ("torque", vec![torque])]
        }
        "hysteresis" => {
            let reversal = sampler.uniform(5e-3, 4e-2);
            vec![("amplitude", vec![by(6e-4, 1.5e-3)]), ("reversal", vec![reversal])]
        }
        "gravity_compliance" | "load_compliance" | "joint_compliance" => {
            vec![("compliance", vec![by(2e-5, 4e-4)])]
        }
        "bearing_compliance" => vec![("compliance", vec![by(5e-6, 4e-5)])],
        "gravity_sag" => vec![("sag", random_sag(arm, i, by(6e-4, 1.5e-3), &mut sampler))],
        "stiffness_hardening" => vec![("cubic", vec![hardening(model, survey, i)?])],
        "axis_tilt" => vec![("tilt", sampler.random_vector(2, 1e-3))],
        "axis_shift" => vec![("shift", normal_to_axis(arm, i, &sampler.random_vector(3, 1e-3)))],
        "thermal_growth" => {
            let link = (arm.next_point(i) - arm.joints()[i].point).length();
            vec![("growth", vec![4e-5 * link.max(0.3)])]
        }
        "thermal_zero" => vec![("drift", vec![sampler.random_sign(6e-5)])],
        "counterbalance" => random_counterbalance(&mut sampler),
        _ => {
            joint = None;
            let (numbers, all) = robot_parameters(kind, arm, &mut sampler)?;
            scaled_count = all;
            numbers
        }
    };
    let revolute = arm.joints()[i].kind == JointKind::Revolute;
    (revolute || joint.is_none()).then_some(EffectTemplate {
        kind,
        joint,
        parameters,
        scaled_count,
    })
}

/// Parameters of a counterbalance spring.
fn random_counterbalance(sampler: &mut Sampler<'_>) -> Vec<(&'static str, Vec<f64>)> {
    vec![
        ("stiffness", vec![1e5]),
        ("free_length", vec![sampler.uniform(0.2, 0.4)]),
        ("a", vec![sampler.uniform(0.15, 0.3)]),
        ("L", vec![0.5]),
        ("angle", vec![sampler.phase()]),
    ]
}

/// Parameters of an effect of the whole robot, and the number of its entries that determine its size.
#[expect(clippy::type_complexity, reason = "entries as `Given` takes them")]
fn robot_parameters(
    kind: &str,
    arm: &Arm,
    sampler: &mut Sampler<'_>,
) -> Option<(Vec<(&'static str, Vec<f64>)>, usize)> {
    let mut positive = |size: f64| -> Vec<f64> {
        sampler.random_vector(3, size).iter().map(|x| x.abs()).collect()
    };
    Some(match kind {
        "base_compliance" => (vec![("compliance", vec![2e-6])], 1),
        "tool_compliance" => (vec![("compliance", positive(8e-6))], 1),
        "tool_offset" => (
            vec![
                ("shift", sampler.random_vector(3, 1e-3)),
                ("turn", sampler.random_vector(3, 2e-3)),
            ],
            2,
        ),
        "gravity_tilt" => (vec![("tilt", sampler.random_vector(2, 0.05))], 1),
        "payload" => {
            let com = (arm.tool.tcp + DVec3::from_slice(&sampler.random_vector(3, 0.1))).to_array();
            (vec![("mass", vec![4.0]), ("com", com.to_vec())], 1)
        }
        "spindle_growth" => (vec![("growth", vec![4e-5])], 1),
        _ => return None,
    })
}

/// A joint that may be coupled to `joint`: a previous one in the wrist, or the second for the
/// third.
fn random_coupled_joint(arm: &Arm, joint: usize, sampler: &mut Sampler<'_>) -> Option<usize> {
    let wrist = arm.count().saturating_sub(3);
    match joint {
        2 => Some(1),
        _ if joint > wrist => Some(sampler.rng.random_range(wrist..joint)),
        _ => None,
    }
}

/// Gravity deflection of an arm with unknown masses: one vector for each body that the joint carries.
fn random_sag(arm: &Arm, joint: usize, size: f64, sampler: &mut Sampler<'_>) -> Vec<f64> {
    (joint..arm.count()).flat_map(|_| sampler.random_vector(3, size)).collect()
}

/// The component normal to the joint's axis; for the last joint, whose tool may be displaced along
/// it too, the whole vector.
fn normal_to_axis(arm: &Arm, joint: usize, shift: &[f64]) -> Vec<f64> {
    let shift = DVec3::from_slice(shift);
    let axis = arm.joints()[joint].axis;
    let barred = if joint + 1 < arm.count() { axis * axis.dot(shift) } else { DVec3::ZERO };
    (shift - barred).to_array().to_vec()
}

/// Hardening that is valid up to the largest load; `None` if the joint has no compliance.
fn hardening(model: &Model, survey: &[Inputs], joint: usize) -> Option<f64> {
    let is_compliant = |effect: &&AnyEffect| {
        let linear = matches!(
            effect,
            AnyEffect::JointCompliance(_)
                | AnyEffect::GravityCompliance(_)
                | AnyEffect::LoadCompliance(_)
        );
        linear && effect.joint() == Some(joint)
    };
    let compliance = model.effects().find(is_compliant)?.values().first()?;
    let most = LOAD_RESERVE * largest_load(&model.arm, survey, joint);
    (most > 0.0).then(|| compliance / (3.0 * most * most))
}

fn largest_load(arm: &Arm, rows: &[Inputs], joint: usize) -> f64 {
    let load = |row: &Inputs| {
        let chain = Chain::nominal(arm, &row.q);
        Loads::on(arm, &chain, row.wrench_base).torque(joint).abs()
    };
    rows.iter().step_by(5).map(load).fold(0.0, f64::max)
}

/// Random draws.
struct Sampler<'a> {
    rng: &'a mut ChaCha8Rng,
}

impl Sampler<'_> {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.rng.random_range(low..high)
    }

    fn phase(&mut self) -> f64 {
        self.uniform(-0.5 * TAU, 0.5 * TAU)
    }

    fn random_sign(&mut self, size: f64) -> f64 {
        if self.rng.random() { size } else { -size }
    }

    /// A vector of this length in a random direction.
    fn random_vector(&mut self, count: usize, length: f64) -> Vec<f64> {
        let any: Vec<f64> = (0..count).map(|_| self.rng.sample(StandardNormal)).collect();
        let norm = sqrt(any.iter().map(|x| x * x).sum::<f64>()).max(1e-9);
        any.iter().map(|x| x * length / norm).collect()
    }
}
