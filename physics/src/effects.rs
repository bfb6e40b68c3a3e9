//! The list of effects. To add one, add a file and a line here.
//!
//! This is the only list of all effects, used by files, corrector, simulation, diagnosis and the
//! conformance suite. An effect is a copyable value, without heap or virtual table.

use crate::deviation::{Contribution, Deviation};
use crate::effect::{BuildContext, BuildError, Effect, Memory, ParameterValues};
use crate::laws::Law;
use crate::signals::Signals;
use crate::slopes::{Slope, SlopeSums};
use crate::spec::{Parameter, Spec};
use crate::{Arm, Inputs, JointKind};
pub use over_path::{OVER_PATHS, OverPath};

/// The three accessors of an effect that keeps `joint: usize` and `values: [f64; N]`.
macro_rules! of_joint {
    () => {
        fn joint(&self) -> Option<usize> {
            Some(self.joint)
        }
        of_robot!(@values);
    };
}

/// The same for an effect of the whole robot, which keeps `values: [f64; N]`.
macro_rules! of_robot {
    () => {
        fn joint(&self) -> Option<usize> {
            None
        }
        of_robot!(@values);
    };
    (@values) => {
        fn values(&self) -> &[f64] {
            &self.values
        }
        fn values_mut(&mut self) -> &mut [f64] {
            &mut self.values
        }
    };
}

/// The methods of an effect that is a law of its joint, by its `law_of_joint`.
macro_rules! by_law {
    () => {
        fn law(&self) -> Option<Law> {
            Some(self.law_of_joint())
        }

        fn predict(&self, signals: &Signals<'_>, _memory: &Memory) -> Contribution {
            self.law_of_joint().at(self.joint, signals).0
        }

        fn slope(&self, signals: &Signals<'_>) -> Slope {
            self.law_of_joint().at(self.joint, signals).1
        }
    };
}

pub mod over_path;

macro_rules! effects {
    (
        moving { $($module:ident :: $Kind:ident),+ $(,)? }
        driving { $($drive:ident :: $Drive:ident),+ $(,)? }
        cutting { $($cut:ident :: $Cut:ident),+ $(,)? }
    ) => {
        $(pub mod $module;)+

        /// Drive torques. These effects do not move the tool.
        pub mod drives {
            $(pub mod $drive;)+
        }

        /// Cutting forces and their measurement. These effects do not move the tool.
        pub mod cutting {
            $(pub mod $cut;)+
        }

        /// Any one effect.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[expect(
            clippy::large_enum_variant,
            reason = "an effect is a value without a heap; only a sag of sixteen bodies is this large"
        )]
        pub enum AnyEffect {
            $(#[doc = concat!("See [`", stringify!($module), "`].")] $Kind($module::$Kind),)+
            $(#[doc = concat!("See [`drives::", stringify!($drive), "`].")] $Drive(drives::$drive::$Drive),)+
            $(#[doc = concat!("See [`cutting::", stringify!($cut), "`].")] $Cut(cutting::$cut::$Cut),)+
            /// See [`over_path`].
            OverPath(OverPath),
        }

        /// Specs of all effects on the position of the tool.
        pub static SPECS: &[Spec] = &[$($module::$Kind::SPEC),+];

        /// Specs of all effects on drive torques.
        pub static DRIVES: &[Spec] = &[$(drives::$drive::$Drive::SPEC),+];

        /// Specs of all effects on the force of a cut, or on its measurement.
        pub static CUTTING: &[Spec] = &[$(cutting::$cut::$Cut::SPEC),+];

        impl AnyEffect {
            /// An effect by its name in files, with values in SI; `joint` is 0-based.
            ///
            /// # Errors
            /// What does not fit, see [`BuildError`].
            pub fn build(
                kind: &str,
                arm: &Arm,
                joint: Option<usize>,
                given: ParameterValues<'_>,
            ) -> Result<Self, BuildError> {
                let wanted = spec_of_stems(kind, given);
                $(if wanted == Some(&$module::$Kind::SPEC) {
                    let site = BuildContext::checked(&$module::$Kind::SPEC, arm, joint, given)?;
                    return $module::$Kind::build(&site).map(Self::$Kind);
                })+
                $(if wanted == Some(&drives::$drive::$Drive::SPEC) {
                    let site = BuildContext::checked(&drives::$drive::$Drive::SPEC, arm, joint, given)?;
                    return drives::$drive::$Drive::build(&site).map(Self::$Drive);
                })+
                $(if wanted == Some(&cutting::$cut::$Cut::SPEC) {
                    let site = BuildContext::checked(&cutting::$cut::$Cut::SPEC, arm, joint, given)?;
                    return cutting::$cut::$Cut::build(&site).map(Self::$Cut);
                })+
                OverPath::build(kind, arm, joint, given)
                    .map_or(Err(BuildError::UnknownKind), |built| built.map(Self::OverPath))
            }

            /// Its spec.
            pub fn spec(&self) -> &'static Spec {
                match self {
                    $(Self::$Kind(_) => const { &$module::$Kind::SPEC },)+
                    $(Self::$Drive(_) => const { &drives::$drive::$Drive::SPEC },)+
                    $(Self::$Cut(_) => const { &cutting::$cut::$Cut::SPEC },)+
                    Self::OverPath(effect) => effect.spec(),
                }
            }

            /// See [`Effect::joint`].
            pub fn joint(&self) -> Option<usize> {
                match self {
                    $(Self::$Kind(effect) => effect.joint(),)+
                    $(Self::$Drive(effect) => effect.joint(),)+
                    $(Self::$Cut(effect) => effect.joint(),)+
                    Self::OverPath(effect) => effect.joint(),
                }
            }

            /// See [`Effect::fitted`].
            pub fn fitted(&self) -> &'static [Parameter] {
                match self {
                    $(Self::$Kind(effect) => effect.fitted(),)+
                    $(Self::$Drive(effect) => effect.fitted(),)+
                    $(Self::$Cut(effect) => effect.fitted(),)+
                    Self::OverPath(effect) => effect.fitted(),
                }
            }

            /// See [`Effect::values`].
            pub fn values(&self) -> &[f64] {
                match self {
                    $(Self::$Kind(effect) => effect.values(),)+
                    $(Self::$Drive(effect) => effect.values(),)+
                    $(Self::$Cut(effect) => effect.values(),)+
                    Self::OverPath(effect) => effect.values(),
                }
            }

            /// See [`Effect::values_mut`].
            pub fn values_mut(&mut self) -> &mut [f64] {
                match self {
                    $(Self::$Kind(effect) => effect.values_mut(),)+
                    $(Self::$Drive(effect) => effect.values_mut(),)+
                    $(Self::$Cut(effect) => effect.values_mut(),)+
                    Self::OverPath(effect) => effect.values_mut(),
                }
            }

            /// See [`Effect::predict`].
            pub fn predict(&self, signals: &Signals<'_>, memory: &Memory) -> Contribution {
                match self {
                    $(Self::$Kind(effect) => effect.predict(signals, memory),)+
                    $(Self::$Drive(effect) => effect.predict(signals, memory),)+
                    $(Self::$Cut(effect) => effect.predict(signals, memory),)+
                    Self::OverPath(_) => Contribution::None,
                }
            }

            /// Adds [`AnyEffect::predict`] to a deviation and, if requested, [`AnyEffect::slope`]
            /// to a sum: one dispatch for both.
            #[inline(always)]
            pub(crate) fn act(
                &self,
                (signals, memory): (&Signals<'_>, &Memory),
                deviation: &mut Deviation,
                slopes: Option<&mut SlopeSums>,
            ) {
                match self {
                    $(Self::$Kind(effect) => {
                        let Some(slopes) = slopes else {
                            return deviation.add(&effect.predict(signals, memory));
                        };
                        let (adds, slope) = effect.predict_and_slope(signals, memory);
                        deviation.add(&adds);
                        slopes.add(effect.joint(), slope);
                    })+
                    _ => {}
                }
            }

            /// See [`Effect::law`].
            pub(crate) fn law(&self) -> Option<Law> {
                match self {
                    $(Self::$Kind(effect) => effect.law(),)+
                    _ => None,
                }
            }

            /// See [`Effect::derivative`].
            pub fn derivative(&self, k: usize, signals: &Signals<'_>, memory: &Memory) -> Contribution {
                match self {
                    $(Self::$Kind(effect) => effect.derivative(k, signals, memory),)+
                    $(Self::$Drive(effect) => effect.derivative(k, signals, memory),)+
                    $(Self::$Cut(effect) => effect.derivative(k, signals, memory),)+
                    Self::OverPath(_) => Contribution::None,
                }
            }

            /// See [`Effect::slope`].
            pub fn slope(&self, signals: &Signals<'_>) -> Slope {
                match self {
                    $(Self::$Kind(effect) => effect.slope(signals),)+
                    $(Self::$Drive(effect) => effect.slope(signals),)+
                    $(Self::$Cut(effect) => effect.slope(signals),)+
                    Self::OverPath(_) => Slope::Zero,
                }
            }

            /// See [`Effect::settle`].
            pub fn settle(&self, inputs: &Inputs, memory: &mut Memory) {
                match self {
                    $(Self::$Kind(effect) => effect.settle(inputs, memory),)+
                    $(Self::$Drive(effect) => effect.settle(inputs, memory),)+
                    $(Self::$Cut(effect) => effect.settle(inputs, memory),)+
                    Self::OverPath(_) => {}
                }
            }

            /// See [`Effect::advance`].
            pub fn advance(&self, inputs: &Inputs, memory: &mut Memory) {
                match self {
                    $(Self::$Kind(effect) => effect.advance(inputs, memory),)+
                    $(Self::$Drive(effect) => effect.advance(inputs, memory),)+
                    $(Self::$Cut(effect) => effect.advance(inputs, memory),)+
                    Self::OverPath(_) => {}
                }
            }

            /// See [`Effect::follow`].
            pub fn follow(&self, inputs: &Inputs, memory: &mut Memory) {
                match self {
                    $(Self::$Kind(effect) => effect.follow(inputs, memory),)+
                    $(Self::$Drive(effect) => effect.follow(inputs, memory),)+
                    $(Self::$Cut(effect) => effect.follow(inputs, memory),)+
                    Self::OverPath(_) => {}
                }
            }
        }
    };
}

effects! {
    moving {
        joint_offset::JointOffset,
        joint_ratio::JointRatio,
        joint_coupling::JointCoupling,
        joint_polynomial::JointPolynomial,
        transmission_error::TransmissionError,
        backlash::Backlash,
        lost_motion::LostMotion,
        hysteresis::Hysteresis,
        gravity_compliance::GravityCompliance,
        gravity_sag::GravitySag,
        load_compliance::LoadCompliance,
        joint_compliance::JointCompliance,
        stiffness_hardening::StiffnessHardening,
        bearing_compliance::BearingCompliance,
        base_compliance::BaseCompliance,
        tool_compliance::ToolCompliance,
        counterbalance::Counterbalance,
        axis_tilt::AxisTilt,
        axis_shift::AxisShift,
        tool_offset::ToolOffset,
        gravity_tilt::GravityTilt,
        payload::Payload,
        thermal_growth::ThermalGrowth,
        thermal_zero::ThermalZero,
        axis_wobble::AxisWobble,
        spindle_growth::SpindleGrowth,
        wrench_bias::WrenchBias,
        wrench_scale::WrenchScale,
        wrench_misalignment::WrenchMisalignment,
    }
    driving {
        coulomb_friction::CoulombFriction,
        viscous_friction::ViscousFriction,
        stribeck_friction::StribeckFriction,
        friction_asymmetry::FrictionAsymmetry,
        load_friction::LoadFriction,
        friction_temperature::FrictionTemperature,
        inertia::Inertia,
        gravity_torque::GravityTorque,
        torque_ripple::TorqueRipple,
        spring::Spring,
        spring_hardening::SpringHardening,
        torque_hysteresis::TorqueHysteresis,
        drive_gain::DriveGain,
    }
    cutting {
        edge_force::EdgeForce,
        cutting_force::CuttingForce,
        tool_wear::ToolWear,
        runout::Runout,
        chatter::Chatter,
        cross_talk::CrossTalk,
    }
}

/// Linear compliances of a joint, one of which `stiffness_hardening` needs.
pub const LINEAR_COMPLIANCES: [&str; 3] =
    ["joint_compliance", "gravity_compliance", "load_compliance"];

impl AnyEffect {
    /// Whether it is the hardening of a linear compliance.
    #[must_use]
    pub fn is_hardening(&self) -> bool {
        matches!(self, Self::StiffnessHardening(_))
    }

    /// Whether it is the hardening of this linear compliance: of the same joint.
    #[must_use]
    pub fn hardens(&self, compliance: &Self) -> bool {
        self.is_hardening()
            && self.joint() == compliance.joint()
            && LINEAR_COMPLIANCES.contains(&compliance.spec().kind)
    }
}

/// All specs of that name. Only `hysteresis` has two: of a position and of a torque.
pub fn specs_of(kind: &str) -> impl Iterator<Item = &'static Spec> {
    let all = SPECS.iter().chain(OVER_PATHS).chain(DRIVES).chain(CUTTING);
    all.filter(move |spec| spec.kind == kind)
}

/// The spec of that name that has most of these stems; in a tie the first.
fn spec_of_stems(kind: &str, given: ParameterValues<'_>) -> Option<&'static Spec> {
    let has = |spec: &Spec, stem: &str| spec.parameters.iter().any(|p| p.stem == stem);
    specs_of(kind).min_by_key(|spec| given.0.iter().filter(|(stem, _)| !has(spec, stem)).count())
}

/// The spec of that name that has most of these keys; in a tie the modelled one. `joint_kind`: that
/// of the effect's joint; `Revolute` for effects of the whole robot.
pub fn spec_for(kind: &str, joint_kind: JointKind, keys: &[&str]) -> Option<&'static Spec> {
    let strange = |spec: &&Spec| keys.iter().filter(|key| !spec.has_key(key, joint_kind)).count();
    specs_of(kind).min_by_key(strange)
}

/// Whether an effect of this spec acts on the position of the tool at a sample, so that it can be
/// compensated; others are loaded and listed as not compensated.
pub fn is_modelled(spec: &Spec) -> bool {
    SPECS.contains(spec)
}

#[cfg(test)]
pub(crate) mod conformance;
