//! Alternatives to a hidden effect: every effect that could explain this recording, as columns. Nonlinear parameters are taken from a grid, one form
//! per grid point; effects whose inputs were not recorded are excluded.

use crate::arm::JOINTS;
use crate::case::PositionCase;
use crate::effect::EffectKind;
use crate::kinds::{Effect, Kind, Requirement};
use crate::scene::Scene;

/// An effect with its possible forms.
#[derive(Clone, Debug)]
pub struct Candidate<E = Effect> {
    /// Name in answers.
    pub name: &'static str,
    /// 1-based.
    pub joint: Option<usize>,
    /// Number of its parameters.
    pub parameter_count: usize,
    /// Whether its only parameter must not be negative.
    pub non_negative: bool,
    /// Each form: effects that are added with free coefficients.
    pub forms: Vec<Vec<E>>,
}

/// All candidates.
#[must_use]
pub fn candidates(case: &PositionCase, scene: &Scene) -> Vec<Candidate> {
    let mut all = Vec::new();
    for kind in Kind::DICTIONARY {
        let spec = kind.spec();
        let Some(name) = spec.name else { continue };
        if !is_admissible(case, kind) {
            continue;
        }
        let joints = if spec.per_joint { 0..scene.arm.joint_count() } else { 0..1 };
        for joint in joints {
            if !is_observable(case, scene, kind, joint) {
                continue;
            }
            let others: Vec<usize> = match kind {
                Kind::JointCoupling => {
                    (0..scene.arm.joint_count()).filter(|j| *j != joint).collect()
                }
                _ => vec![joint],
            };
            let one = |other_joint: usize, parameters: &[f64]| Effect {
                kind,
                joint,
                other_joint,
                parameters: parameters.to_vec(),
            };
            let forms = others
                .iter()
                .flat_map(|other| forms(kind, scene, &|parameters| one(*other, parameters)));
            all.push(Candidate {
                name,
                joint: spec.per_joint.then_some(joint + 1),
                parameter_count: free_parameter_count(kind, scene, joint),
                non_negative: spec.non_negative,
                forms: forms.collect(),
            });
        }
    }
    all
}

/// Number of free parameters: a shift of a joint's axis along itself is not observable, except at the last joint.
#[must_use]
pub fn free_parameter_count(kind: Kind, scene: &Scene, joint: usize) -> usize {
    let axial = kind == Kind::AxisShift && joint + 1 < scene.arm.joint_count();
    kind.count() - usize::from(axial)
}

/// Whether its inputs were recorded.
#[must_use]
pub fn is_admissible(case: &PositionCase, kind: Kind) -> bool {
    let recorded_inputs = case.scene.recorded;
    kind.spec().needs.iter().all(|need| match need {
        Requirement::Path => !case.scene.is_settled(),
        Requirement::Poses => case.scene.is_settled(),
        Requirement::Wrench => recorded_inputs.wrench || kind == Kind::GravityCompliance,
        Requirement::Temperature => recorded_inputs.ambient,
        Requirement::NoTemperature => !recorded_inputs.ambient,
        Requirement::Spindle => recorded_inputs.spindle,
        Requirement::Masses => !case.scene.arm.masses.is_empty(),
        Requirement::Compliance => {
            case.modelled.iter().any(|k| k.nominal.kind == Kind::JointCompliance)
        }
        Requirement::OwnCompliance => true,
    })
}

/// Whether it is possible on this joint, given the effects of the model.
#[must_use]
pub fn is_observable(case: &PositionCase, scene: &Scene, kind: Kind, joint: usize) -> bool {
    match kind {
        Kind::ThermalGrowth | Kind::ThermalGrowthLag | Kind::ThermalGrowthWarmUp => {
            scene.arm.has_thermal_growth(joint)
        }
        Kind::GravityCompliance | Kind::LoadCompliance => !case.has_modelled_compliance(joint),
        Kind::StiffnessHardening | Kind::Counterbalance => case.has_modelled_compliance(joint),
        _ => true,
    }
}

fn forms(kind: Kind, scene: &Scene, one: &dyn Fn(&[f64]) -> Effect) -> Vec<Vec<Effect>> {
    let unit = |count: usize, k: usize| -> Vec<f64> {
        (0..count).map(|n| if n == k { 1.0 } else { 0.0 }).collect()
    };
    let alone =
        |parameters: &[&[f64]]| parameters.iter().map(|numbers| vec![one(numbers)]).collect();
    let quarter = std::f64::consts::FRAC_PI_2;
    match kind {
        Kind::AxisShift => {
            let effect = one(&[0.0; 3]);
            let across = scene
                .arm
                .normals(effect.joint)
                .map(|n| one(&scene.arm.base_from_joint(effect.joint, n)));
            let mut form = across.to_vec();
            if effect.joint + 1 == scene.arm.joint_count() {
                form.push(one(&scene.arm.base_from_joint(effect.joint, [0.0, 0.0, 1.0])));
            }
            vec![form]
        }
        Kind::TransmissionError => [1.0, 2.0, 3.0]
            .iter()
            .map(|n| vec![one(&[1.0, *n, 0.0]), one(&[1.0, *n, quarter])])
            .collect(),
        Kind::AxisWobble => [1.0, 2.0]
            .iter()
            .map(|n| {
                let wave = |a: f64, b: f64, phase: f64| one(&[a, b, phase, phase, *n]);
                vec![
                    wave(1.0, 0.0, 0.0),
                    wave(1.0, 0.0, quarter),
                    wave(0.0, 1.0, 0.0),
                    wave(0.0, 1.0, quarter),
                ]
            })
            .collect(),
        // Contact backlash is not linear in its gap: the motion may not cross a gap at all.
        Kind::Backlash => alone(&[&[1e-4], &[3e-4], &[1e-3]]),
        Kind::LostMotion => alone(&[&[1.0, 5.0], &[1.0, 30.0], &[1.0, 150.0]]),
        Kind::Hysteresis => alone(&[&[1.0, 1.5e-3], &[1.0, 6e-3], &[1.0, 2.5e-2]]),
        Kind::ThermalGrowthLag | Kind::ThermalZeroLag => alone(&[&[1.0, 300.0], &[1.0, 1500.0]]),
        Kind::ThermalGrowthWarmUp | Kind::ThermalZeroWarmUp => {
            alone(&[&[1.0, 600.0], &[1.0, 1500.0], &[1.0, 4000.0]])
        }
        Kind::FlexibleMode => {
            alone(&[&[1.0, 5.0, 0.05], &[1.0, 9.0, 0.05], &[1.0, 14.0, 0.05], &[1.0, 25.0, 0.05]])
        }
        Kind::ReversalSpike => alone(&[&[1.0, 0.02], &[1.0, 0.07], &[1.0, 0.2]]),
        Kind::TimeDelay | Kind::ServoLag => alone(&[&[2e-3]]),
        Kind::Counterbalance => alone(&[&[1e4, 0.3, 0.15, 0.4, 0.3], &[1e4, 0.3, 0.15, 0.4, 1.9]]),
        Kind::Payload => {
            let zero = scene.arm.tool_pose(&[0.0; JOINTS]);
            let tcp = crate::transform::origin(&zero);
            let at = |by: [f64; 3]| one(&[1.0, tcp[0] + by[0], tcp[1] + by[1], tcp[2] + by[2]]);
            vec![vec![at([0.0; 3]), at([0.1, 0.0, 0.0]), at([0.0, 0.1, 0.0]), at([0.0, 0.0, 0.1])]]
        }
        Kind::WrenchScale | Kind::WrenchMisalignment | Kind::GravityTilt => {
            let count = kind.count();
            vec![
                (0..count)
                    .map(|k| one(&unit(count, k).iter().map(|x| 0.01 * x).collect::<Vec<_>>()))
                    .collect(),
            ]
        }
        _ => {
            let count = kind.count();
            vec![(0..count).map(|k| one(&unit(count, k))).collect()]
        }
    }
}
