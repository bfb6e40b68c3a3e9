//! All keys as in docs/reference/effects.md, pinned for revolute and prismatic joints.
//!
//! Angles that stay angles on a prismatic joint (the direction of an axis, a tilt under a moment) keep `_mrad`.

use crate::JointKind::{Prismatic, Revolute};
use crate::ParameterValues;
use crate::effects::{
    AnyEffect, CUTTING, DRIVES, OVER_PATHS, SPECS, is_modelled, spec_for, specs_of,
};
use crate::spec::{ActsOn, EffectScope, Spec};

/// Name, keys, keys on a prismatic joint (empty: not available there). In the order of the lists.
const KEYS: &[(&str, &str, &str)] = &[
    ("joint_offset", "offset_mrad", "offset_mm"),
    ("joint_ratio", "ratio", "ratio"),
    ("joint_coupling", "ratio from_joint", "ratio from_joint"),
    ("joint_polynomial", "coefficients_mrad range_deg", "coefficients_mm range_mm"),
    (
        "transmission_error",
        "amplitude_mrad cycles_per_rev phase_rad",
        "amplitude_mm cycles_per_m phase_rad",
    ),
    ("backlash", "width_mrad", "width_mm"),
    ("lost_motion", "width_mrad torque_Nm", "width_mm torque_N"),
    ("hysteresis", "amplitude_mrad reversal_mrad", "amplitude_mm reversal_mm"),
    ("gravity_compliance", "compliance_mrad_per_kNm", "compliance_mm_per_kN"),
    ("gravity_sag", "sag_mrad", ""),
    ("load_compliance", "compliance_mrad_per_kNm", "compliance_mm_per_kN"),
    ("joint_compliance", "compliance_mrad_per_kNm", "compliance_mm_per_kN"),
    ("stiffness_hardening", "cubic_mrad_per_kNm3", "cubic_mm_per_kN3"),
    ("bearing_compliance", "compliance_mrad_per_kNm pivot_mm", "compliance_mrad_per_kNm pivot_mm"),
    ("base_compliance", "compliance_mrad_per_kNm", ""),
    ("tool_compliance", "compliance_um_per_N", ""),
    ("counterbalance", "stiffness_N_per_m free_length_mm a_mm L_mm angle_deg", ""),
    ("axis_tilt", "tilt_mrad pivot_mm", "tilt_mrad pivot_mm"),
    ("axis_shift", "shift_mm", "shift_mm"),
    ("tool_offset", "shift_mm turn_mrad", ""),
    ("gravity_tilt", "tilt_mrad", ""),
    ("payload", "mass_kg com_mm", ""),
    (
        "thermal_growth",
        "growth_um_per_K lag_s amplitude_um time_constant_s reference_C direction",
        "growth_um_per_K lag_s amplitude_um time_constant_s reference_C direction",
    ),
    (
        "thermal_zero",
        "drift_mrad_per_K lag_s amplitude_mrad time_constant_s reference_C",
        "drift_mm_per_K lag_s amplitude_mm time_constant_s reference_C",
    ),
    (
        "axis_wobble",
        "amplitude_mrad phase_rad cycles_per_rev pivot_mm",
        "amplitude_mrad phase_rad cycles_per_m pivot_mm",
    ),
    ("spindle_growth", "growth_um_per_K growth_um_per_krpm lag_s reference_C", ""),
    ("wrench_bias", "bias_N bias_Nm", ""),
    ("wrench_scale", "scale", ""),
    ("wrench_misalignment", "turn_mrad", ""),
    ("time_delay", "delay_ms channel", ""),
    ("servo_lag", "time_constant_ms", "time_constant_ms"),
    (
        "flexible_mode",
        "frequency_Hz damping_ratio participation dynamic_compliance_mrad_per_kNm axis",
        "frequency_Hz damping_ratio participation dynamic_compliance_mm_per_kN axis",
    ),
    ("reversal_spike", "amplitude_mrad time_constant_ms", "amplitude_mm time_constant_ms"),
    ("torque_delay", "delay_ms channel", ""),
    ("coulomb_friction", "level_Nm", "level_N"),
    ("viscous_friction", "coefficient", "coefficient"),
    ("stribeck_friction", "level_Nm stribeck_speed", "level_N stribeck_speed"),
    ("friction_asymmetry", "offset_Nm coefficient", "offset_N coefficient"),
    ("load_friction", "coefficient", "coefficient"),
    ("friction_temperature", "per_K reference_C", "per_K reference_C"),
    ("inertia", "inertia_kgm2 mass_kg", "inertia_kgm2 mass_kg"),
    ("gravity_torque", "cos_Nm sin_Nm first_moment_kgm", "cos_N sin_N first_moment_kgm"),
    (
        "torque_ripple",
        "amplitude_Nm cycles_per_rev phase_rad",
        "amplitude_N cycles_per_m phase_rad",
    ),
    ("spring", "stiffness rest_position", "stiffness rest_position"),
    ("spring_hardening", "cubic_stiffness", "cubic_stiffness"),
    ("hysteresis", "amplitude_Nm reversal_mrad", "amplitude_N reversal_mm"),
    ("drive_gain", "gain", "gain"),
    ("edge_force", "coefficient_N_per_mm", ""),
    ("cutting_force", "coefficient_N_per_mm2", ""),
    ("tool_wear", "growth_per_m", ""),
    ("runout", "radial_um phase_rad", ""),
    ("chatter", "frequency_Hz amplitude_N", ""),
    ("cross_talk", "matrix", ""),
];

fn all() -> impl Iterator<Item = &'static Spec> {
    SPECS.iter().chain(OVER_PATHS).chain(DRIVES).chain(CUTTING)
}

#[test]
fn every_key_is_the_contracts() {
    assert_eq!(all().count(), KEYS.len());
    for (spec, (kind, turns, slides)) in all().zip(KEYS) {
        assert_eq!(spec.kind, *kind);
        let keys = |joint| {
            let keys: Vec<_> = spec.parameters.iter().map(|p| p.key(joint).to_string()).collect();
            keys.join(" ")
        };
        assert_eq!(keys(Revolute), *turns, "{kind}");
        if !slides.is_empty() {
            assert_eq!(keys(Prismatic), *slides, "{kind}");
        }
        let may_slide = matches!(spec.scope, EffectScope::Joint | EffectScope::JointOrBase);
        assert_eq!(may_slide, !slides.is_empty(), "{kind}");
        for key in turns.split_whitespace() {
            assert!(spec.has_key(key, Revolute), "{kind}: {key}");
        }
    }
}

#[test]
fn stems_are_unique_within_an_effect() {
    for spec in all() {
        for (i, one) in spec.parameters.iter().enumerate() {
            assert!(spec.parameters[..i].iter().all(|p| p.stem != one.stem), "{}", spec.kind);
        }
    }
}

#[test]
fn a_key_with_a_wrong_unit_is_no_key() {
    let spec = specs_of("backlash").next().expect("modelled");
    assert!(spec.has_key("width_mrad", Revolute) && spec.has_key("width_mm", Prismatic));
    for wrong in ["width_mm", "width", "width_rad", "width_mrad_", "mrad", ""] {
        assert!(!spec.has_key(wrong, Revolute), "{wrong}");
    }
}

#[test]
fn the_unit_distinguishes_the_two_hystereses() {
    for (key, joint, modelled) in [
        ("amplitude_mrad", Revolute, true),
        ("amplitude_mm", Prismatic, true),
        ("amplitude_Nm", Revolute, false),
        ("amplitude_N", Prismatic, false),
    ] {
        let spec = spec_for("hysteresis", joint, &[key]).expect("a name of the contract");
        assert_eq!(is_modelled(spec), modelled, "{key}");
    }
    assert!(spec_for("poltergeist", Revolute, &[]).is_none());
}

#[test]
fn a_hysteresis_is_built_by_its_stems() {
    let arm = super::scene().arm;
    for (stem, acts_on) in
        [("amplitude", ActsOn::JointPosition), ("amplitude_N", ActsOn::DriveTorque)]
    {
        let given: &[(&str, &[f64])] = &[(stem, &[0.1]), ("reversal", &[0.2])];
        let built =
            AnyEffect::build("hysteresis", &arm, Some(1), ParameterValues(given)).expect("sound");
        assert_eq!(built.spec().acts_on, acts_on, "{stem}");
    }
}

#[test]
fn two_effects_of_one_name_are_the_exception() {
    for spec in all() {
        let wanted = if spec.kind == "hysteresis" { 2 } else { 1 };
        assert_eq!(specs_of(spec.kind).count(), wanted, "{}", spec.kind);
    }
}
