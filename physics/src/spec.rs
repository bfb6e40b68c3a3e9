//! Specification of an effect: name, parameters with unit, range and sign, needs, and where it
//! acts.
//!
//! The names are those of `docs/reference/effects.md`; a key in a file is a parameter's stem
//! followed by the suffix of its unit, which depends on the kind of joint (`offset_mrad`, on a
//! prismatic joint `offset_mm`).

use crate::JointKind;
use core::fmt;

/// The unit of a parameter in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A plain number, no suffix.
    One,
    /// Small angle, `_mrad`; on a prismatic joint `_mm`.
    Milliradian,
    /// Direction of an axis, a body or a tool: `_mrad` on every kind of joint, since it remains an angle.
    TurnMilliradian,
    /// Angle of a phase, `_rad` on every kind of joint.
    PhaseRadian,
    /// Joint position, `_deg`; on a prismatic joint `_mm`.
    JointDegree,
    /// Angle, `_deg` on every kind of joint.
    Degree,
    /// `_mm`.
    Millimetre,
    /// `_um`.
    Micrometre,
    /// `_Nm`; on a prismatic joint `_N`.
    NewtonMetre,
    /// `m`; on a prismatic joint nothing. For a torque or force whose stem ends in `_N`, to differ from the stem of an angle.
    MetreAfterNewton,
    /// `_Nm` on every kind of joint.
    Moment,
    /// `_N`.
    Newton,
    /// `_mrad_per_kNm`; on a prismatic joint `_mm_per_kN`.
    Compliance,
    /// `_mrad_per_kNm` on every kind of joint: a tilt under a moment.
    TurnCompliance,
    /// `_mrad_per_kNm3`; on a prismatic joint `_mm_per_kN3`.
    CubicCompliance,
    /// `_um_per_N`.
    MicrometrePerNewton,
    /// `_um_per_K`.
    MicrometrePerKelvin,
    /// `_per_krpm`, in µm: its stem ends in `_um`, to differ from the stem of a growth by temperature.
    MicrometrePerKrpm,
    /// `_mrad_per_K`; on a prismatic joint `_mm_per_K`.
    MilliradianPerKelvin,
    /// `_per_rev`; on a prismatic joint `_per_m`. Internally radians of phase per rad or m of joint motion.
    CyclesPerRevolution,
    /// `_s`.
    Second,
    /// `_ms`.
    Millisecond,
    /// `_Hz`.
    Hertz,
    /// `_kg`.
    Kilogram,
    /// `_N_per_m`.
    NewtonPerMetre,
    /// `_C`.
    Celsius,
    /// `_kgm2`.
    KilogramSquareMetre,
    /// `_kgm`.
    KilogramMetre,
    /// `_per_m`.
    PerMetre,
    /// `_N_per_mm`.
    NewtonPerMillimetre,
    /// `_N_per_mm2`.
    NewtonPerSquareMillimetre,
    /// A string, no suffix: not a number.
    Text,
}

impl Unit {
    /// The suffix of a key in a file, and the SI value of one such unit.
    pub fn suffix_and_si(self, kind: JointKind) -> (&'static str, f64) {
        use core::f64::consts::{PI, TAU};
        let slides = kind == JointKind::Prismatic;
        match self {
            Self::One | Self::Text => ("", 1.0),
            Self::Milliradian if slides => ("_mm", 1e-3),
            Self::Milliradian | Self::TurnMilliradian => ("_mrad", 1e-3),
            Self::PhaseRadian => ("_rad", 1.0),
            Self::JointDegree if slides => ("_mm", 1e-3),
            Self::JointDegree | Self::Degree => ("_deg", PI / 180.0),
            Self::Millimetre => ("_mm", 1e-3),
            Self::Micrometre => ("_um", 1e-6),
            Self::NewtonMetre if slides => ("_N", 1.0),
            Self::NewtonMetre | Self::Moment => ("_Nm", 1.0),
            Self::MetreAfterNewton if slides => ("", 1.0),
            Self::MetreAfterNewton => ("m", 1.0),
            Self::Newton => ("_N", 1.0),
            Self::Compliance if slides => ("_mm_per_kN", 1e-6),
            Self::Compliance | Self::TurnCompliance => ("_mrad_per_kNm", 1e-6),
            Self::CubicCompliance if slides => ("_mm_per_kN3", 1e-12),
            Self::CubicCompliance => ("_mrad_per_kNm3", 1e-12),
            Self::MicrometrePerNewton => ("_um_per_N", 1e-6),
            Self::MicrometrePerKelvin => ("_um_per_K", 1e-6),
            Self::MicrometrePerKrpm => ("_per_krpm", 1e-9),
            Self::MilliradianPerKelvin if slides => ("_mm_per_K", 1e-3),
            Self::MilliradianPerKelvin => ("_mrad_per_K", 1e-3),
            Self::CyclesPerRevolution if slides => ("_per_m", TAU),
            Self::CyclesPerRevolution => ("_per_rev", 1.0),
            Self::Second => ("_s", 1.0),
            Self::Millisecond => ("_ms", 1e-3),
            Self::Hertz => ("_Hz", 1.0),
            Self::Kilogram => ("_kg", 1.0),
            Self::NewtonPerMetre => ("_N_per_m", 1.0),
            Self::Celsius => ("_C", 1.0),
            Self::KilogramSquareMetre => ("_kgm2", 1.0),
            Self::KilogramMetre => ("_kgm", 1.0),
            Self::PerMetre => ("_per_m", 1.0),
            Self::NewtonPerMillimetre => ("_N_per_mm", 1e3),
            Self::NewtonPerSquareMillimetre => ("_N_per_mm2", 1e6),
        }
    }
}

/// Number of values of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count {
    /// One number.
    One,
    /// A list of exactly this many.
    Exactly(usize),
    /// A list of 1 to this many.
    UpTo(usize),
    /// Three for every body that the joint carries, its own first.
    ThreePerCarriedBody,
}

/// Valid values. Bounds are in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Range {
    /// Any finite number.
    Any,
    /// Zero or above.
    NotNegative,
    /// Above zero.
    Positive,
    /// Strictly between the two.
    Between(f64, f64),
}

impl Range {
    /// Whether a value lies in the range.
    pub fn holds(&self, value: f64) -> bool {
        value.is_finite()
            && match *self {
                Self::Any => true,
                Self::NotNegative => value >= 0.0,
                Self::Positive => value > 0.0,
                Self::Between(low, high) => value > low && value < high,
            }
    }

    /// The nearest value in the range; for an open end a value just inside.
    #[must_use]
    pub fn nearest(&self, value: f64) -> f64 {
        /// Distance from an open end, as a share of the distance between two ends.
        const WITHIN: f64 = 1e-3;
        match *self {
            Self::Any => value,
            Self::NotNegative => value.max(0.0),
            Self::Positive => value.max(f64::MIN_POSITIVE),
            Self::Between(low, high) => {
                let within = WITHIN * (high - low);
                value.clamp(low + within, high - within)
            }
        }
    }
}

/// One entry of an effect in a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// The key without the suffix of its unit; unique within an effect.
    pub stem: &'static str,
    /// Its unit in a file.
    pub unit: Unit,
    /// Number of values.
    pub count: Count,
    /// Valid values.
    pub range: Range,
    /// Whether it is required.
    pub required: bool,
    /// Its role in a fit.
    pub role: Role,
}

/// What a fit may do with an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The contribution is linear in it.
    Linear,
    /// Fitted; the contribution is not linear in it.
    Nonlinear,
    /// Stated by the user or an instrument and never fitted (a pivot, a reference temperature).
    Setting,
}

impl Parameter {
    /// A required linear parameter with one value.
    pub const fn linear(stem: &'static str, unit: Unit, range: Range) -> Self {
        Self { stem, unit, count: Count::One, range, required: true, role: Role::Linear }
    }

    /// A required nonlinear parameter with one value.
    pub const fn nonlinear(stem: &'static str, unit: Unit, range: Range) -> Self {
        Self { role: Role::Nonlinear, ..Self::linear(stem, unit, range) }
    }

    /// An optional setting with one value.
    pub const fn setting(stem: &'static str, unit: Unit, range: Range) -> Self {
        Self { required: false, role: Role::Setting, ..Self::linear(stem, unit, range) }
    }

    /// The same with another count.
    pub const fn of(self, count: Count) -> Self {
        Self { count, ..self }
    }

    /// The same, optional.
    pub const fn optional(self) -> Self {
        Self { required: false, ..self }
    }

    /// The same, required.
    pub const fn needed(self) -> Self {
        Self { required: true, ..self }
    }

    /// Its key in a file for a joint of this kind; effects of the whole robot take `Revolute`.
    pub fn key(&self, kind: JointKind) -> Key {
        Key { stem: self.stem, suffix: self.unit.suffix_and_si(kind).0 }
    }
}

/// A key in a file: stem and unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key {
    stem: &'static str,
    suffix: &'static str,
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.stem, self.suffix)
    }
}

impl PartialEq<str> for Key {
    fn eq(&self, other: &str) -> bool {
        other.strip_prefix(self.stem) == Some(self.suffix)
    }
}

/// Whether an effect belongs to a joint or to the whole robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EffectScope {
    /// A joint of either kind.
    Joint,
    /// A revolute joint.
    RevoluteJoint,
    /// A joint, or the base where `axis` is given instead.
    JointOrBase,
    /// The whole robot.
    Robot,
}

/// Where an effect acts, in the order of evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ActsOn {
    /// The loads, before compliances are applied.
    Loads,
    /// A joint's position.
    JointPosition,
    /// The geometry between joints, the base or the tool.
    Geometry,
    /// The torque of a drive.
    DriveTorque,
    /// The force on the tool.
    ToolForce,
}

/// A signal that an effect needs, besides the joints' positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// The sign of the joint's last motion, or its path.
    Direction,
    /// Masses of links or tool.
    Masses,
    /// The wrench on the tool.
    Wrench,
    /// A temperature.
    Temperature,
    /// Time since the segment began.
    Time,
    /// Spindle speed.
    SpindleSpeed,
    /// Joint speed.
    Velocity,
    /// Joint acceleration.
    Acceleration,
}

/// Specification of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spec {
    /// The name in files and results.
    pub kind: &'static str,
    /// Joint or robot.
    pub scope: EffectScope,
    /// Where it acts.
    pub acts_on: ActsOn,
    /// Required signals.
    pub needs: &'static [Need],
    /// Whether it has memory.
    pub has_memory: bool,
    /// Its entries in a file: parameters that a fit may change first, then settings. Which of them
    /// an effect has: [`crate::Effect::fitted`].
    pub parameters: &'static [Parameter],
}

impl Spec {
    /// Whether it has an entry of this key on a joint of this kind.
    pub fn has_key(&self, key: &str, kind: JointKind) -> bool {
        self.parameters.iter().any(|parameter| parameter.key(kind) == *key)
    }
}
