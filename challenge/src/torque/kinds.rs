//! Kinds of hidden torque effects: names and keys in the model format (docs/reference/effects.md), and the conditions for them to be observable.
//! Parameters are SI, in the order of the keys. Their laws: [`super::laws`].

use crate::effect::{self, EffectKind, ParameterKey};
use Requirement::{Arm, OwnSpring, OwnViscous, Revolute, Several, Temperature};

/// Kinds of the torque dictionary, one per set of parameters, and kinds outside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(
    missing_docs,
    reason = "the names are the contract's; `laws` documents the kinds outside it"
)]
pub enum Kind {
    CoulombFriction,
    ViscousFriction,
    StribeckFriction,
    AsymmetryOffset,
    AsymmetrySlope,
    AsymmetryBoth,
    LoadFriction,
    FrictionTemperature,
    Inertia,
    GravityTorque,
    GravityMoment,
    TorqueRipple,
    Spring,
    SpringHardening,
    Hysteresis,
    DriveGain,
    TorqueDelay,
    Payload,
    SpeedCube,
    PlaceFriction,
    PlaceDamping,
    CrossTorque,
    Wander,
}

/// Condition for an effect to be observable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Requirement {
    /// A temperature that varies.
    Temperature,
    /// The model has viscous friction of the same joint.
    OwnViscous,
    /// The model has a spring of the same joint.
    OwnSpring,
    /// A revolute joint.
    Revolute,
    /// Several joints.
    Several,
    /// An arm.
    Arm,
}

/// Specification of a kind of effect.
pub type KindSpec = effect::KindSpec<Requirement>;
/// An effect with its parameters.
pub type Effect = effect::Effect<Kind>;

const fn one(key: &'static str) -> ParameterKey {
    ParameterKey::of(key, 1, 1.0)
}

const fn two(turns: &'static str, slides: &'static str) -> ParameterKey {
    ParameterKey { keys: [turns, slides], count: 1, si: 1.0, is_scored: true }
}

const fn milli(turns: &'static str, slides: &'static str) -> ParameterKey {
    ParameterKey { keys: [turns, slides], count: 1, si: 1e-3, is_scored: true }
}

const fn of(
    name: &'static str,
    keys: &'static [ParameterKey],
    linear_count: usize,
    non_negative: bool,
    needs: &'static [Requirement],
) -> KindSpec {
    let max_linear = f64::INFINITY;
    KindSpec {
        name: Some(name),
        per_joint: true,
        keys,
        linear_count,
        max_linear,
        non_negative,
        needs,
    }
}

const fn outside(needs: &'static [Requirement]) -> KindSpec {
    const SIZE: &[ParameterKey] = &[one("size")];
    KindSpec { name: None, ..of("", SIZE, 1, false, needs) }
}

const LEVEL: ParameterKey = two("level_Nm", "level_N");
const OFFSET: ParameterKey = two("offset_Nm", "offset_N");
const COEFFICIENT: ParameterKey = one("coefficient");
const PLACE: ParameterKey = ParameterKey::of("com_mm", 3, 1e-3);
const MOMENT: ParameterKey = ParameterKey::of("first_moment_kgm", 3, 1.0);
/// Elasto-slip elements and the law of the model format reach the same height, but along different curves.
const REVERSAL: ParameterKey = milli("reversal_mrad", "reversal_mm").unscored();

impl Kind {
    /// Every kind of the torque dictionary.
    pub const DICTIONARY: [Self; 18] = [
        Self::CoulombFriction,
        Self::ViscousFriction,
        Self::StribeckFriction,
        Self::AsymmetryOffset,
        Self::AsymmetrySlope,
        Self::AsymmetryBoth,
        Self::LoadFriction,
        Self::FrictionTemperature,
        Self::Inertia,
        Self::GravityTorque,
        Self::GravityMoment,
        Self::TorqueRipple,
        Self::Spring,
        Self::SpringHardening,
        Self::Hysteresis,
        Self::DriveGain,
        Self::TorqueDelay,
        Self::Payload,
    ];

    /// Kinds outside the candidate dictionary.
    pub const OUTSIDE: [Self; 5] =
        [Self::SpeedCube, Self::PlaceFriction, Self::PlaceDamping, Self::CrossTorque, Self::Wander];

    fn joint_spec(self) -> KindSpec {
        match self {
            Self::CoulombFriction => of("coulomb_friction", const { &[LEVEL] }, 1, true, &[]),
            Self::ViscousFriction => of("viscous_friction", const { &[COEFFICIENT] }, 1, true, &[]),
            Self::StribeckFriction => {
                of("stribeck_friction", const { &[LEVEL, one("stribeck_speed")] }, 1, true, &[])
            }
            Self::AsymmetryOffset => of("friction_asymmetry", const { &[OFFSET] }, 1, false, &[]),
            Self::AsymmetrySlope => {
                of("friction_asymmetry", const { &[COEFFICIENT] }, 1, false, &[])
            }
            Self::AsymmetryBoth => {
                of("friction_asymmetry", const { &[OFFSET, COEFFICIENT] }, 2, false, &[])
            }
            Self::LoadFriction => of("load_friction", const { &[COEFFICIENT] }, 1, true, &[]),
            Self::FrictionTemperature => of(
                "friction_temperature",
                const { &[one("per_K")] },
                1,
                false,
                &[Temperature, OwnViscous],
            ),
            Self::Inertia => {
                of("inertia", const { &[two("inertia_kgm2", "mass_kg")] }, 1, false, &[])
            }
            Self::GravityTorque => of(
                "gravity_torque",
                const { &[one("cos_Nm"), one("sin_Nm")] },
                2,
                false,
                &[Revolute],
            ),
            Self::GravityMoment => of("gravity_torque", const { &[MOMENT] }, 3, false, &[Arm]),
            Self::TorqueRipple => of(
                "torque_ripple",
                const {
                    &[
                        two("amplitude_Nm", "amplitude_N"),
                        two("cycles_per_rev", "cycles_per_m"),
                        one("phase_rad"),
                    ]
                },
                1,
                true,
                &[],
            ),
            Self::Spring => {
                of("spring", const { &[one("stiffness"), one("rest_position")] }, 1, true, &[])
            }
            Self::SpringHardening => {
                of("spring_hardening", const { &[one("cubic_stiffness")] }, 1, false, &[OwnSpring])
            }
            Self::Hysteresis => of(
                "hysteresis",
                const { &[two("amplitude_Nm", "amplitude_N"), REVERSAL] },
                1,
                true,
                &[],
            ),
            Self::DriveGain => of("drive_gain", const { &[one("gain")] }, 1, false, &[]),
            _ => self.robot_spec(),
        }
    }

    /// Facts of kinds without a joint, and of kinds outside the dictionary.
    fn robot_spec(self) -> KindSpec {
        const DELAY: &[ParameterKey] = &[milli("delay_ms", "delay_ms")];
        const MASS: &[ParameterKey] = &[one("mass_kg"), PLACE];
        match self {
            Self::TorqueDelay => {
                KindSpec { per_joint: false, ..of("torque_delay", DELAY, 1, true, &[]) }
            }
            Self::Payload => KindSpec { per_joint: false, ..of("payload", MASS, 1, true, &[]) },
            Self::CrossTorque => outside(&[Several]),
            _ => outside(&[]),
        }
    }
}

impl EffectKind for Kind {
    type Requirement = Requirement;

    fn spec(self) -> KindSpec {
        self.joint_spec()
    }

    fn step(effect: &Effect, number: usize) -> f64 {
        let size = effect.parameters[number].abs();
        match effect.kind {
            // A zero centre of mass, phase or rest position still needs a finite step.
            Self::Payload | Self::TorqueRipple | Self::Spring if number > 0 => size.max(0.1),
            _ => size.max(effect.linear_magnitude()).max(1e-9),
        }
    }

    fn bounded(effect: &Effect, number: usize, wanted: f64) -> f64 {
        let from = effect.parameters[number];
        // Velocities and distances stay positive; masses, centres and phases are unbounded.
        let scales =
            number == 1 && effect.kind.spec().linear_count == 1 && effect.parameters.len() <= 3;
        if scales && from > 0.0 { wanted.max(0.3 * from) } else { wanted }
    }
}
