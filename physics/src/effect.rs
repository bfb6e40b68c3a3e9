//! The central interface: one physical effect.
//!
//! Correction sums effects, simulation runs them forward, diagnosis fits their parameters: all through this trait.
//! An effect contains its parameters (SI) but not its state (a [`Memory`], kept by the caller), so that one
//! set of parameters can be used in many runs. It adds one [`Contribution`] at one place: position, load, torque or force.
//!
//! Guarantees of every effect, verified by the conformance suite (`effects/conformance.rs`): zero parameters do nothing;
//! derivatives agree with finite differences; a contribution has the place stated in its [`Spec`]; memory settles
//! to the same state for any history; no panic on finite input.
//! No clock, no heap, no access to another effect.

use crate::deviation::Contribution;
use crate::laws::Law;
use crate::signals::Signals;
use crate::slopes::Slope;
use crate::spec::{Count, EffectScope, Parameter, Range, Role, Spec};
use crate::{Arm, Inputs, JOINTS_MAX, JointKind};
use glam::DVec3;
use thiserror::Error;

/// Largest number of values of an effect.
pub const VALUES_MAX: usize = 3 * JOINTS_MAX;

/// State of an effect between samples. All zeros initially.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Memory(pub [f64; 4]);

/// One physical effect with its parameters.
pub trait Effect: Copy + Sized {
    /// Name, parameters and needs.
    const SPEC: Spec;

    /// The effect with the given values at the given site; the generic checks of [`BuildContext::checked`]
    /// are done.
    ///
    /// # Errors
    /// Errors that only this effect can detect.
    fn build(site: &BuildContext<'_>) -> Result<Self, BuildError>;

    /// The 0-based joint that it belongs to; `None` for the whole robot.
    fn joint(&self) -> Option<usize>;

    /// The parameters that [`Effect::values`] holds, in that order: those of the spec without its
    /// settings and without optional ones that were not given.
    fn fitted(&self) -> &'static [Parameter] {
        let parameters = Self::SPEC.parameters;
        let count = parameters.iter().take_while(|p| p.role != Role::Setting).count();
        &parameters[..count]
    }

    /// The parameters that a fit may change, SI, in the order of [`Effect::fitted`], lists
    /// flattened.
    fn values(&self) -> &[f64];

    /// The same, to be changed.
    fn values_mut(&mut self) -> &mut [f64];

    /// Its contribution for these signals and this memory.
    fn predict(&self, signals: &Signals<'_>, memory: &Memory) -> Contribution;

    /// The effect as a law of its joint alone, if it is one; [`Effect::predict`] and
    /// [`Effect::slope`] then agree with it.
    fn law(&self) -> Option<Law> {
        None
    }

    /// The derivative of [`Effect::predict`] by value `k`, for a memory that was settled or
    /// advanced with the same values (including the memory's dependence on them). Exact if the
    /// effect is linear in the value, otherwise a central difference, unless the effect provides a
    /// better one.
    fn derivative(&self, k: usize, signals: &Signals<'_>, memory: &Memory) -> Contribution {
        derivative_of(self, k, signals, memory)
    }

    /// Derivative of its contribution by the joints, for constant memory; unknown unless the effect
    /// provides it. It speeds up a solve without affecting its accuracy.
    fn slope(&self, _signals: &Signals<'_>) -> Slope {
        Slope::Unknown
    }

    /// Both at once, for an effect with common subexpressions.
    #[inline(always)]
    fn predict_and_slope(&self, signals: &Signals<'_>, memory: &Memory) -> (Contribution, Slope) {
        (self.predict(signals, memory), self.slope(signals))
    }

    /// Sets the memory to its state after a long move that ended in `inputs.direction`.
    fn settle(&self, _inputs: &Inputs, _memory: &mut Memory) {}

    /// Advances the memory by one sample, with the motor moving from `inputs.q_before` to
    /// `inputs.q`.
    fn advance(&self, _inputs: &Inputs, _memory: &mut Memory) {}

    /// The inverse: advances the memory by one sample in which the LINK is to move from
    /// `inputs.q_before` to `inputs.q`, and the motor as required. Used by the corrector.
    fn follow(&self, inputs: &Inputs, memory: &mut Memory) {
        self.advance(inputs, memory);
    }
}

/// Where an effect is to be built, and its values.
#[derive(Clone, Copy, Debug)]
pub struct BuildContext<'a> {
    /// The arm.
    pub arm: &'a Arm,
    /// 0-based joint; 0 for effects of the whole robot.
    pub joint: usize,
    given: ParameterValues<'a>,
}

/// The values of an effect: stems of [`crate::spec::Parameter`] with values in SI.
#[derive(Clone, Copy, Debug)]
pub struct ParameterValues<'a>(pub &'a [(&'a str, &'a [f64])]);

impl<'a> ParameterValues<'a> {
    /// The values of one entry.
    pub fn list(&self, stem: &str) -> Option<&'a [f64]> {
        self.0.iter().find(|(name, _)| *name == stem).map(|(_, values)| *values)
    }
}

/// Why an effect cannot be built. Joints are 1-based here, as in files; values are SI.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum BuildError {
    /// No effect of this name is modelled.
    #[error("no effect of this kind is modelled")]
    UnknownKind,
    /// The effect belongs to a joint and none was given.
    #[error("this effect belongs to a joint: `joint` is missing")]
    NeedsJoint,
    /// The effect belongs to the whole robot and a joint was given.
    #[error("this effect belongs to the whole robot and has no `joint`")]
    TakesNoJoint,
    /// The joint does not exist.
    #[error("joint {joint} does not exist, the arm has {count}")]
    NoSuchJoint {
        /// 1-based.
        joint: usize,
        /// Number of joints of the arm.
        count: usize,
    },
    /// The effect needs a revolute joint.
    #[error("this effect needs a revolute joint")]
    NeedsRevolute,
    /// A required entry is missing.
    #[error("`{stem}` is missing")]
    Missing {
        /// Stem of the entry.
        stem: &'static str,
    },
    /// An entry that the effect does not have.
    #[error("an entry that this effect does not have")]
    Unknown {
        /// Its index in [`ParameterValues`].
        index: usize,
    },
    /// A list of the wrong length.
    #[error("`{stem}` has {found} numbers, expected {expected:?}")]
    WrongCount {
        /// Stem of the entry.
        stem: &'static str,
        /// Numbers found.
        found: usize,
        /// Numbers expected.
        expected: Count,
    },
    /// A value out of its range.
    #[error("`{stem}` is {value} (SI), expected {range:?}")]
    OutOfRange {
        /// Stem of the entry.
        stem: &'static str,
        /// The value, SI.
        value: f64,
        /// The range, SI.
        range: Range,
    },
    /// A pivot that is not on the joint's axis (to 1e-6 m).
    #[error("`pivot` is {distance_m} m from the joint's axis, expected a point on the axis")]
    PivotOffAxis {
        /// Distance, m.
        distance_m: f64,
    },
    /// Two points coincide and no direction was given.
    #[error("the two points that define the direction coincide; `direction` is required")]
    NeedsDirection,
    /// Entries that exclude each other, or of which one is needed.
    #[error("expected {0}")]
    Combination(&'static str),
}

impl<'a> BuildContext<'a> {
    /// A site whose values fit the spec: names, counts, ranges, joint.
    ///
    /// # Errors
    /// The first value that does not fit.
    pub fn checked(
        spec: &Spec,
        arm: &'a Arm,
        joint: Option<usize>,
        given: ParameterValues<'a>,
    ) -> Result<Self, BuildError> {
        let joint = check_place(spec, arm, joint)?;
        for (index, (name, _)) in given.0.iter().enumerate() {
            if !spec.parameters.iter().any(|p| p.stem == *name) {
                return Err(BuildError::Unknown { index });
            }
        }
        for parameter in spec.parameters {
            let stem = parameter.stem;
            let Some(values) = given.list(stem) else {
                if parameter.required {
                    return Err(BuildError::Missing { stem });
                }
                continue;
            };
            let fits = match parameter.count {
                Count::One => values.len() == 1,
                Count::Exactly(n) => values.len() == n,
                Count::UpTo(n) => (1..=n).contains(&values.len()),
                Count::ThreePerCarriedBody => values.len() == 3 * (arm.count() - joint),
            };
            if !fits {
                let (found, expected) = (values.len(), parameter.count);
                return Err(BuildError::WrongCount { stem, found, expected });
            }
            if let Some(&value) = values.iter().find(|v| !parameter.range.holds(**v)) {
                return Err(BuildError::OutOfRange { stem, value, range: parameter.range });
            }
        }
        Ok(Self { arm, joint, given })
    }

    /// A required value; zero for an optional one that was not given.
    pub fn one(&self, stem: &str) -> f64 {
        self.optional_value(stem).unwrap_or(0.0)
    }

    /// An optional value.
    pub fn optional_value(&self, stem: &str) -> Option<f64> {
        self.given.list(stem).and_then(|values| values.first().copied())
    }

    /// The values of an entry; empty if it is missing.
    pub fn list(&self, stem: &str) -> &'a [f64] {
        self.given.list(stem).unwrap_or(&[])
    }

    /// The first `N` values of an entry; zeros if it is missing or shorter.
    pub fn array<const N: usize>(&self, stem: &str) -> [f64; N] {
        let mut values = [0.0; N];
        for (slot, value) in values.iter_mut().zip(self.list(stem)) {
            *slot = *value;
        }
        values
    }

    /// An optional vector.
    pub fn vector(&self, stem: &str) -> Option<DVec3> {
        self.given.list(stem).map(|_| DVec3::from_array(self.array(stem)))
    }

    /// The joint's pivot: its point, or `pivot` if given.
    ///
    /// # Errors
    /// A pivot that is not on the axis.
    pub fn pivot(&self) -> Result<DVec3, BuildError> {
        let joint = &self.arm.joints()[self.joint];
        let Some(pivot) = self.vector("pivot") else { return Ok(joint.point) };
        let distance = (pivot - joint.point).cross(joint.axis);
        let distance_m = libm::sqrt(distance.length_squared());
        if distance_m > 1e-6 { Err(BuildError::PivotOffAxis { distance_m }) } else { Ok(pivot) }
    }
}

fn check_place(spec: &Spec, arm: &Arm, joint: Option<usize>) -> Result<usize, BuildError> {
    match (spec.scope, joint) {
        (EffectScope::Robot, None) => Ok(0),
        (EffectScope::Robot, Some(_)) => Err(BuildError::TakesNoJoint),
        (EffectScope::JointOrBase, None) => Ok(0),
        (_, None) => Err(BuildError::NeedsJoint),
        (place, Some(joint)) => {
            let Some(found) = arm.joints().get(joint) else {
                return Err(BuildError::NoSuchJoint { joint: joint + 1, count: arm.count() });
            };
            if place == EffectScope::RevoluteJoint && found.kind != JointKind::Revolute {
                return Err(BuildError::NeedsRevolute);
            }
            Ok(joint)
        }
    }
}

/// Exact for a linear value (the effect with that value one and its other linear values zero), a
/// central difference for a nonlinear one.
fn derivative_of<E: Effect>(
    effect: &E,
    k: usize,
    signals: &Signals<'_>,
    memory: &Memory,
) -> Contribution {
    let mut probe = *effect;
    if role_of(effect, k) == Role::Linear {
        for j in 0..probe.values().len() {
            if role_of(effect, j) == Role::Linear {
                probe.values_mut()[j] = if j == k { 1.0 } else { 0.0 };
            }
        }
        return probe.predict(signals, memory);
    }
    let value = effect.values()[k];
    let step = 1e-6 * libm::fabs(value).max(1e-3);
    probe.values_mut()[k] = value + step;
    let above = probe.predict(signals, memory);
    probe.values_mut()[k] = value - step;
    let below = probe.predict(signals, memory);
    above.minus(&below).times(0.5 / step)
}

/// The role of flat value `k`: the spec's fit parameters, each with its length in this effect.
fn role_of<E: Effect>(effect: &E, k: usize) -> Role {
    let mut first = 0;
    for parameter in effect.fitted() {
        let length = match parameter.count {
            Count::One => 1,
            Count::Exactly(n) => n,
            Count::UpTo(_) | Count::ThreePerCarriedBody => effect.values().len() - first,
        };
        if k < first + length {
            return parameter.role;
        }
        first += length;
    }
    Role::Nonlinear
}
