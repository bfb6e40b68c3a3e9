//! The kinds of hidden effects of torques: their names and keys in the contract (`effects.md`), and what they need to show.
//!
//! Promises: numbers are SI in the order of the keys. Never: a law; see [`super::laws`].

use Need::{Arm, OwnSpring, OwnViscous, Revolute, Several, Temperature};

/// Kinds that the torque table of the contract has, one per set of parameters, and kinds that it has not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[expect(
    missing_docs,
    reason = "the names are the contract's; what stands outside it is told in `laws`"
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

/// What must be there for an effect to show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// A temperature that changes.
    Temperature,
    /// Viscous friction of this very joint that the model knows.
    OwnViscous,
    /// A spring of this very joint that the model knows.
    OwnSpring,
    /// A joint that turns.
    Revolute,
    /// Several joints.
    Several,
    /// An arm.
    Arm,
}

/// A key of an effect in a model file, on a joint that turns and on one that slides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Key with its unit where the joint turns, and where it slides.
    pub keys: [&'static str; 2],
    /// Numbers.
    pub count: usize,
    /// SI of one such unit.
    pub si: f64,
    /// Whether intervals are counted on it: not where the contract's law and the one here have no common number.
    pub counted: bool,
}

/// What is said of a kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facts {
    /// Name in the contract; none outside the library.
    pub name: Option<&'static str>,
    /// Whether it belongs to a joint.
    pub of_joint: bool,
    /// Keys in order.
    pub entries: &'static [Entry],
    /// How many numbers, from the first, the effect is proportional to.
    pub leads: usize,
    /// Whether the leading number may not be negative.
    pub not_negative: bool,
    /// What it needs.
    pub needs: &'static [Need],
}

const fn one(key: &'static str) -> Entry {
    Entry { keys: [key; 2], count: 1, si: 1.0, counted: true }
}

const fn two(turns: &'static str, slides: &'static str) -> Entry {
    Entry { keys: [turns, slides], count: 1, si: 1.0, counted: true }
}

const fn milli(turns: &'static str, slides: &'static str) -> Entry {
    Entry { keys: [turns, slides], count: 1, si: 1e-3, counted: true }
}

const fn of(
    name: &'static str,
    entries: &'static [Entry],
    leads: usize,
    not_negative: bool,
    needs: &'static [Need],
) -> Facts {
    Facts { name: Some(name), of_joint: true, entries, leads, not_negative, needs }
}

const fn outside(needs: &'static [Need]) -> Facts {
    const SIZE: &[Entry] = &[one("size")];
    Facts { name: None, of_joint: true, entries: SIZE, leads: 1, not_negative: false, needs }
}

const LEVEL: Entry = two("level_Nm", "level_N");
const OFFSET: Entry = two("offset_Nm", "offset_N");
const COEFFICIENT: Entry = one("coefficient");
const PLACE: Entry = Entry { keys: ["com_mm"; 2], count: 3, si: 1e-3, counted: true };
const MOMENT: Entry = Entry { keys: ["first_moment_kgm"; 2], count: 3, si: 1.0, counted: true };
/// Springs that slip and the contract's law reach the same height, not by the same way.
const REVERSAL: Entry = Entry { counted: false, ..milli("reversal_mrad", "reversal_mm") };

impl Kind {
    /// Every kind of the contract's torque table.
    pub const LIBRARY: [Self; 18] = [
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

    /// Physics that no library of the contract has.
    pub const OUTSIDE: [Self; 5] =
        [Self::SpeedCube, Self::PlaceFriction, Self::PlaceDamping, Self::CrossTorque, Self::Wander];

    /// What is said of it.
    #[must_use]
    pub fn facts(self) -> Facts {
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
            _ => self.facts_of_the_whole(),
        }
    }

    /// Of what belongs to no joint, and of what no library has.
    fn facts_of_the_whole(self) -> Facts {
        const DELAY: &[Entry] = &[milli("delay_ms", "delay_ms")];
        const MASS: &[Entry] = &[one("mass_kg"), PLACE];
        match self {
            Self::TorqueDelay => {
                Facts { of_joint: false, ..of("torque_delay", DELAY, 1, true, &[]) }
            }
            Self::Payload => Facts { of_joint: false, ..of("payload", MASS, 1, true, &[]) },
            Self::CrossTorque => outside(&[Several]),
            _ => outside(&[]),
        }
    }

    /// Its name in answers; outside the library none.
    #[must_use]
    pub fn name(self) -> Option<&'static str> {
        self.facts().name
    }

    /// How many numbers it has.
    #[must_use]
    pub fn count(self) -> usize {
        self.facts().entries.iter().map(|entry| entry.count).sum()
    }

    /// Whether it needs this.
    #[must_use]
    pub fn needs(self, need: Need) -> bool {
        self.facts().needs.contains(&need)
    }
}

/// An effect with its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Effect {
    /// Which law.
    pub kind: Kind,
    /// From 0; 0 for effects of the whole robot.
    pub joint: usize,
    /// The other joint of a law outside the library, from 0.
    pub other: usize,
    /// SI, in the order of the keys.
    pub numbers: Vec<f64>,
}

impl Effect {
    /// An effect of one joint.
    #[must_use]
    pub fn of(kind: Kind, joint: usize, numbers: &[f64]) -> Self {
        Self { kind, joint, other: joint, numbers: numbers.to_vec() }
    }

    /// The same with its leading numbers times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        scaled.numbers.iter_mut().take(self.kind.facts().leads).for_each(|x| *x *= factor);
        scaled
    }

    /// The largest of its leading numbers.
    #[must_use]
    pub fn lead(&self) -> f64 {
        let leads = self.numbers.iter().take(self.kind.facts().leads);
        leads.fold(0.0, |most, x| most.max(x.abs()))
    }

    /// The joint as answers name it, from 1.
    #[must_use]
    pub fn joint_said(&self) -> Option<usize> {
        self.kind.facts().of_joint.then_some(self.joint + 1)
    }

    /// Whether the other is of the same name at the same place.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        self.kind.name() == other.kind.name() && self.joint_said() == other.joint_said()
    }
}
