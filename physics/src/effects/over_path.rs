//! Effects over a whole path (delay, lag, modes, reversal spikes), which the real-time cycle cannot compute.
//!
//! Laws: docs/reference/effects.md. They run over paths in `world::dynamics`; this file defines their names and parameters for files,
//! simulation and diagnosis.
//!
//! They add nothing to a sample: [`crate::Model::evaluate`] is the same with and without them. They
//! have no state here.

use crate::Arm;
use crate::effect::{BuildContext, BuildError, ParameterValues};
use crate::spec::{ActsOn, Count, EffectScope, Need, Parameter, Range, Role, Spec, Unit};
use glam::DVec3;

/// Specs of the effects over paths.
pub static OVER_PATHS: &[Spec] = &[
    Spec {
        kind: "time_delay",
        scope: EffectScope::Robot,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Time],
        has_memory: true,
        parameters: &[
            // Linear to first order: the delayed motion is the present motion minus speed times
            // delay.
            Parameter::linear("delay", Unit::Millisecond, Range::Any),
            Parameter::setting("channel", Unit::Text, Range::Any),
        ],
    },
    Spec {
        kind: "servo_lag",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Time],
        has_memory: true,
        parameters: &[Parameter::linear("time_constant", Unit::Millisecond, Range::NotNegative)],
    },
    Spec {
        kind: "flexible_mode",
        scope: EffectScope::JointOrBase,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Acceleration, Need::Wrench, Need::Time],
        has_memory: true,
        parameters: &[
            Parameter::nonlinear("frequency", Unit::Hertz, Range::Positive),
            Parameter::nonlinear("damping_ratio", Unit::One, Range::Between(0.0, 1.0)),
            Parameter::linear("participation", Unit::One, Range::Any).optional(),
            Parameter::linear("dynamic_compliance", Unit::Compliance, Range::NotNegative)
                .optional(),
            Parameter::setting("axis", Unit::One, Range::Any).of(Count::Exactly(3)),
        ],
    },
    Spec {
        kind: "reversal_spike",
        scope: EffectScope::Joint,
        acts_on: ActsOn::JointPosition,
        needs: &[Need::Direction, Need::Time],
        has_memory: true,
        parameters: &[
            Parameter::linear("amplitude", Unit::Milliradian, Range::Any),
            Parameter::nonlinear("time_constant", Unit::Millisecond, Range::Positive),
        ],
    },
    Spec {
        kind: "torque_delay",
        scope: EffectScope::Robot,
        acts_on: ActsOn::DriveTorque,
        needs: &[Need::Time],
        has_memory: true,
        parameters: &[
            // Linear to first order, as above.
            Parameter::linear("delay", Unit::Millisecond, Range::Any),
            Parameter::setting("channel", Unit::Text, Range::Any),
        ],
    },
];

/// Largest number of values of one of them.
const VALUES_MAX: usize = 4;

/// `time_delay`, `servo_lag`, `flexible_mode`, `reversal_spike` or `torque_delay`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OverPath {
    spec: &'static Spec,
    joint: Option<usize>,
    axis: Option<DVec3>,
    values: [f64; VALUES_MAX],
}

impl OverPath {
    /// One of these by its name; `None` for another name.
    pub(super) fn build(
        kind: &str,
        arm: &Arm,
        joint: Option<usize>,
        given: ParameterValues<'_>,
    ) -> Option<Result<Self, BuildError>> {
        let spec = OVER_PATHS.iter().find(|spec| spec.kind == kind)?;
        Some(
            BuildContext::checked(spec, arm, joint, given)
                .and_then(|site| Self::at(spec, joint, &site)),
        )
    }

    fn at(
        spec: &'static Spec,
        joint: Option<usize>,
        site: &BuildContext<'_>,
    ) -> Result<Self, BuildError> {
        let axis = match site.vector("axis") {
            None => None,
            Some(axis) => {
                let Some(axis) = axis.try_normalize() else {
                    return Err(BuildError::Combination("an `axis` that is not zero"));
                };
                Some(axis)
            }
        };
        if spec.scope == EffectScope::JointOrBase && joint.is_some() == axis.is_some() {
            return Err(BuildError::Combination("either `joint` or `axis`"));
        }
        let mut values = [0.0; VALUES_MAX];
        for (value, parameter) in values.iter_mut().zip(fitted(spec)) {
            let default = if parameter.stem == "participation" { 1.0 } else { 0.0 };
            *value = site.optional_value(parameter.stem).unwrap_or(default);
        }
        Ok(Self { spec, joint, axis, values })
    }

    /// Its spec.
    pub fn spec(&self) -> &'static Spec {
        self.spec
    }

    /// The 0-based joint that it belongs to; `None` for the whole robot.
    pub fn joint(&self) -> Option<usize> {
        self.joint
    }

    /// The base axis of the vibration, unit vector.
    pub fn axis(&self) -> Option<DVec3> {
        self.axis
    }

    /// See [`crate::Effect::fitted`].
    pub fn fitted(&self) -> &'static [Parameter] {
        fitted(self.spec)
    }

    /// See [`crate::Effect::values`].
    pub fn values(&self) -> &[f64] {
        &self.values[..fitted(self.spec).len()]
    }

    /// See [`crate::Effect::values_mut`].
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values[..fitted(self.spec).len()]
    }
}

fn fitted(spec: &'static Spec) -> &'static [Parameter] {
    let count = spec.parameters.iter().take_while(|p| p.role != Role::Setting).count();
    &spec.parameters[..count]
}
