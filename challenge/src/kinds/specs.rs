//! Table of all kinds of hidden position effects: keys with units and limits as in the model format (docs/reference/effects.md), and the inputs each
//! needs to be observable. One line per kind, in the order of [`Kind`].

use super::{Kind, KindSpec, Requirement};
use crate::effect::ParameterKey;
use Requirement::{
    Compliance, Masses, NoTemperature, OwnCompliance, Path, Poses, Spindle, Temperature, Wrench,
};

const fn one(key: &'static str, si: f64) -> ParameterKey {
    ParameterKey::of(key, 1, si)
}

const fn many(key: &'static str, count: usize, si: f64) -> ParameterKey {
    ParameterKey::of(key, count, si)
}

const fn loose(key: &'static str, si: f64) -> ParameterKey {
    ParameterKey::of(key, 1, si).unscored()
}

const fn of(
    name: &'static str,
    per_joint: bool,
    keys: &'static [ParameterKey],
    linear_count: usize,
    max_linear: f64,
    non_negative: bool,
    needs: &'static [Requirement],
) -> KindSpec {
    KindSpec { name: Some(name), per_joint, keys, linear_count, max_linear, non_negative, needs }
}

const fn outside(
    keys: &'static [ParameterKey],
    max_linear: f64,
    needs: &'static [Requirement],
) -> KindSpec {
    KindSpec {
        name: None,
        per_joint: true,
        keys,
        linear_count: 1,
        max_linear,
        non_negative: false,
        needs,
    }
}

const DEG: f64 = std::f64::consts::PI / 180.0;
const STIFF: &[ParameterKey] = &[one("compliance_mrad_per_kNm", 1e-6)];
const WIDE: &[ParameterKey] = &[one("amplitude_mrad", 1e-3), loose("time_constant_s", 1.0)];

/// The facts of every kind, in order.
pub(super) static SPECS: [(Kind, KindSpec); 41] = [
    (Kind::JointOffset, of("joint_offset", true, &[one("offset_mrad", 1e-3)], 1, 5e-3, false, &[])),
    (Kind::JointRatio, of("joint_ratio", true, &[one("ratio", 1.0)], 1, 3e-3, false, &[])),
    (Kind::JointCoupling, of("joint_coupling", true, &[one("ratio", 1.0)], 1, 3e-3, false, &[])),
    (
        Kind::TransmissionError,
        of(
            "transmission_error",
            true,
            &[one("amplitude_mrad", 1e-3), one("cycles_per_rev", 1.0), one("phase_rad", 1.0)],
            1,
            1e-3,
            true,
            &[],
        ),
    ),
    (Kind::Backlash, of("backlash", true, &[one("width_mrad", 1e-3)], 1, 2e-3, true, &[])),
    (
        Kind::LostMotion,
        of(
            "lost_motion",
            true,
            &[one("width_mrad", 1e-3), one("torque_Nm", 1.0)],
            1,
            2e-3,
            true,
            &[Masses],
        ),
    ),
    (
        Kind::Hysteresis,
        of(
            "hysteresis",
            true,
            &[one("amplitude_mrad", 1e-3), one("reversal_mrad", 1e-3)],
            1,
            2e-3,
            true,
            &[Path],
        ),
    ),
    (
        Kind::GravityCompliance,
        of("gravity_compliance", true, STIFF, 1, 3e-5, true, &[Masses, Wrench]),
    ),
    (Kind::LoadCompliance, of("load_compliance", true, STIFF, 1, 3e-5, true, &[Masses, Wrench])),
    (Kind::JointCompliance, of("joint_compliance", true, STIFF, 1, 3e-5, true, &[Masses])),
    (
        Kind::StiffnessHardening,
        of(
            "stiffness_hardening",
            true,
            &[one("cubic_mrad_per_kNm3", 1e-12)],
            1,
            1e-10,
            true,
            &[Masses, OwnCompliance],
        ),
    ),
    (Kind::BearingCompliance, of("bearing_compliance", true, STIFF, 1, 3e-5, true, &[Masses])),
    (Kind::BaseCompliance, of("base_compliance", false, STIFF, 1, 2e-5, true, &[Masses])),
    (
        Kind::ToolCompliance,
        of(
            "tool_compliance",
            false,
            &[many("compliance_um_per_N", 3, 1e-6)],
            3,
            2e-5,
            true,
            &[Wrench],
        ),
    ),
    (
        Kind::Counterbalance,
        of(
            "counterbalance",
            true,
            &[
                loose("stiffness_N_per_m", 1.0),
                loose("free_length_mm", 1e-3),
                loose("a_mm", 1e-3),
                loose("L_mm", 1e-3),
                loose("angle_deg", DEG),
            ],
            1,
            1e5,
            true,
            &[OwnCompliance],
        ),
    ),
    (Kind::AxisTilt, of("axis_tilt", true, &[many("tilt_mrad", 2, 1e-3)], 2, 5e-3, false, &[])),
    (Kind::AxisShift, of("axis_shift", true, &[many("shift_mm", 3, 1e-3)], 3, 5e-3, false, &[])),
    (Kind::ToolOffset, of("tool_offset", false, &[many("shift_mm", 3, 1e-3)], 3, 1e-2, false, &[])),
    (
        Kind::GravityTilt,
        of(
            "gravity_tilt",
            false,
            &[many("tilt_mrad", 2, 1e-3)],
            2,
            5e-2,
            false,
            &[Masses, Compliance],
        ),
    ),
    (
        Kind::Payload,
        of(
            "payload",
            false,
            &[one("mass_kg", 1.0), many("com_mm", 3, 1e-3)],
            1,
            15.0,
            false,
            &[Masses, Compliance],
        ),
    ),
    (
        Kind::ThermalGrowth,
        of("thermal_growth", true, &[one("growth_um_per_K", 1e-6)], 1, 1e-4, false, &[Temperature]),
    ),
    (
        Kind::ThermalGrowthLag,
        of(
            "thermal_growth",
            true,
            &[one("growth_um_per_K", 1e-6), loose("lag_s", 1.0)],
            1,
            1e-4,
            false,
            &[Temperature, Poses],
        ),
    ),
    (
        Kind::ThermalGrowthWarmUp,
        of(
            "thermal_growth",
            true,
            &[one("amplitude_um", 1e-6), loose("time_constant_s", 1.0)],
            1,
            1e-3,
            false,
            &[NoTemperature, Poses],
        ),
    ),
    (
        Kind::ThermalZero,
        of("thermal_zero", true, &[one("drift_mrad_per_K", 1e-3)], 1, 1e-4, false, &[Temperature]),
    ),
    (
        Kind::ThermalZeroLag,
        of(
            "thermal_zero",
            true,
            &[one("drift_mrad_per_K", 1e-3), loose("lag_s", 1.0)],
            1,
            1e-4,
            false,
            &[Temperature, Poses],
        ),
    ),
    (
        Kind::ThermalZeroWarmUp,
        of("thermal_zero", true, WIDE, 1, 1e-3, false, &[NoTemperature, Poses]),
    ),
    (
        Kind::AxisWobble,
        of(
            "axis_wobble",
            true,
            &[
                many("amplitude_mrad", 2, 1e-3),
                many("phase_rad", 2, 1.0),
                one("cycles_per_rev", 1.0),
            ],
            2,
            1e-3,
            true,
            &[],
        ),
    ),
    (
        Kind::SpindleGrowth,
        of(
            "spindle_growth",
            false,
            &[one("growth_um_per_K", 1e-6)],
            1,
            5e-5,
            false,
            &[Temperature],
        ),
    ),
    (
        Kind::SpindleGrowthSpeed,
        of("spindle_growth", false, &[one("growth_um_per_krpm", 1e-9)], 1, 5e-8, false, &[Spindle]),
    ),
    (Kind::TimeDelay, of("time_delay", false, &[one("delay_ms", 1e-3)], 1, 4e-2, true, &[Path])),
    (
        Kind::ServoLag,
        of("servo_lag", true, &[one("time_constant_ms", 1e-3)], 1, 6e-2, true, &[Path]),
    ),
    (
        Kind::FlexibleMode,
        of(
            "flexible_mode",
            true,
            &[loose("participation", 1.0), one("frequency_Hz", 1.0), loose("damping_ratio", 1.0)],
            1,
            1.5,
            true,
            &[Path],
        ),
    ),
    (
        Kind::ReversalSpike,
        of(
            "reversal_spike",
            true,
            &[one("amplitude_mrad", 1e-3), one("time_constant_ms", 1e-3)],
            1,
            2e-3,
            false,
            &[Path],
        ),
    ),
    (
        Kind::WrenchBias,
        of(
            "wrench_bias",
            false,
            &[many("bias_N", 3, 1.0), many("bias_Nm", 3, 1.0)],
            6,
            200.0,
            false,
            &[Wrench, Compliance],
        ),
    ),
    (
        Kind::WrenchScale,
        of("wrench_scale", false, &[many("scale", 6, 1.0)], 6, 0.4, false, &[Wrench, Compliance]),
    ),
    (
        Kind::WrenchMisalignment,
        of(
            "wrench_misalignment",
            false,
            &[many("turn_mrad", 3, 1e-3)],
            3,
            0.4,
            false,
            &[Wrench, Compliance],
        ),
    ),
    (Kind::CableDrag, outside(&[one("drag_s", 1.0)], 2e-2, &[Path])),
    (Kind::VaryingDelay, outside(&[one("delay_ms", 1e-3)], 3e-2, &[Path])),
    (Kind::SpeedCube, outside(&[one("cube_s3_per_rad2", 1.0)], 2e-2, &[Path])),
    (Kind::CrossJoint, outside(&[one("amplitude_mrad", 1e-3)], 3e-3, &[])),
    (Kind::VaryingPlay, outside(&[one("width_mrad", 1e-3)], 3e-3, &[])),
];
