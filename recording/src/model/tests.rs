//! Models: what is read, refused, written and read again.

use super::*;
use proptest::prelude::*;

pub(super) const TWO_JOINTS: &str = r#"
schema = "trued.model/1"
name = "slide and arm"

[meta]
maker = "us"
tested = 2026-11-20
limits = [1, 2.5, { a = true }]

[[joint]]
kind = "prismatic"
axis = [1.0, 0.0, 0.0]
limits_mm = [-500.0, 500.0]
max_speed_mm_s = 1000.0

[[joint]]
name = "2"
kind = "revolute"
axis = [0.0, 1.0, 0.0]
point_mm = [0.0, 0.0, 400.0]
limits_deg = [-90.0, 90.0]
gear_teeth = [[10, 131], [13, 129]]
link = { mass_kg = 5.0, com_mm = [100.0, 0.0, 400.0], inertia_kgm2 = [0.1, 0.1, 0.1, 0.0, 0.0, 0.0] }

[tool]
tcp_mm = [300.0, 0.0, 400.0]
base_from_tool = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
mass_kg = 1.0
com_mm = [280.0, 0.0, 400.0]

[[mode]]
frequency_Hz = 67.0
direction = [0.0, 1.0, 0.0]

[[effect]]
kind = "joint_offset"
joint = 1
offset_mm = 0.25
sigma = { offset_mm = 0.03 }

[[effect]]
kind = "servo_lag"
joint = 2
time_constant_ms = 12.0

[[effect]]
kind = "axis_tilt"
joint = 2
tilt_mrad = [0.1, -0.2]
sigma = { tilt_mrad = [0.01, 0.02] }
"#;

pub(super) fn parse(text: &str) -> Result<RobotModel, Faults> {
    RobotModel::parse("robot.toml", text)
}

#[test]
fn a_model_is_read_in_si() {
    let model = parse(TWO_JOINTS).unwrap();
    let arm = &model.physics.arm;
    assert_eq!(arm.joints()[0].limits, (-0.5, 0.5));
    assert_eq!(arm.joints()[1].point.z, 0.4);
    assert_eq!(arm.tool.base_from_tool.x_axis.to_array(), [0.0, 0.0, -1.0]);
    let effects: Vec<_> = model.physics.effects().collect();
    assert_eq!(effects[0].values(), [2.5e-4]);
    assert_eq!(model.entry_of, [0, 2]);
    assert_eq!(model.sigma, [vec![3e-5], vec![1e-5, 2e-5]]);
    assert_eq!(model.not_compensated_names(), ["servo_lag of joint 2"]);
    assert_eq!(model.file.joints[1].gear_teeth, [[10, 131], [13, 129]]);
    assert_eq!(model.file.modes[0].frequency_hz, 67.0);
}

#[test]
fn what_is_written_reads_back_bit_for_bit_and_has_the_same_hash() {
    let model = parse(TWO_JOINTS).unwrap();
    let again = parse(&model.file.to_toml()).unwrap();
    assert_eq!(again, model);
    assert_eq!(again.file.to_toml(), model.file.to_toml());
    let commented = TWO_JOINTS.replace("[tool]", "# the gripper\n[tool]");
    assert_eq!(parse(&commented).unwrap().hash, model.hash);
    assert_ne!(parse(&TWO_JOINTS.replace("0.25", "0.26")).unwrap().hash, model.hash);
}

/// Every line but the first is wrong.
const BAD_GEOMETRY: &str = r#"schema = "trued.model/1"
gravity = [0, 0, -9.81]
[[joint]]
kind = "revolut"
axis = [0.0, 0.0, 1.1]
limits_deg = [180.0, -180.0]
max_speed_rad_s = 1.0
link = { mass_kg = 65.0 }
[tool]
tcp_mm = [0, 0]
base_from_tool = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]
"#;

#[test]
fn every_fault_of_the_geometry_is_reported_at_once() {
    insta::assert_snapshot!(parse(BAD_GEOMETRY).unwrap_err(), @r#"
        error: `gravity`: has no unit, which does not match this key
         --> robot.toml:2:1
          |
        2 | gravity = [0, 0, -9.81]
          | ^^^^^^^ expected `gravity_m_s2`
          |
          = help: write `gravity_m_s2`

        error: `joint[1].point_mm`: is missing
         --> robot.toml:3:1
          |
        3 | [[joint]]
          | ^^^^^^^^^ expected a point [x, y, z] on the axis, base frame

        error: `joint[1].kind`: is "revolut"
         --> robot.toml:4:8
          |
        4 | kind = "revolut"
          |        ^^^^^^^^^ expected "revolute" or "prismatic" (did you mean "revolute"?)

        error: `joint[1].axis`: has length 1.1
         --> robot.toml:5:8
          |
        5 | axis = [0.0, 0.0, 1.1]
          |        ^^^^^^^^^^^^^^^ expected unit length within 1e-6

        error: `joint[1].limits_deg`: is [180, -180]
         --> robot.toml:6:14
          |
        6 | limits_deg = [180.0, -180.0]
          |              ^^^^^^^^^^^^^^^ expected the lower limit first

        error: `joint[1].max_speed_rad_s`: has the unit rad_s, which does not match this key
         --> robot.toml:7:1
          |
        7 | max_speed_rad_s = 1.0
          | ^^^^^^^^^^^^^^^ expected `max_speed_deg_s`
          |
          = help: write `max_speed_deg_s`, with the value multiplied by 57.29577951

        error: `joint[1].link.com_mm`: is missing
         --> robot.toml:8:8
          |
        8 | link = { mass_kg = 65.0 }
          |        ^^^^^^^^^^^^^^^^^^ expected the centre of mass [x, y, z], base frame, zero configuration

        error: `tool.tcp_mm`: has 2 numbers
          --> robot.toml:10:10
           |
        10 | tcp_mm = [0, 0]
           |          ^^^^^^ expected 3 numbers

        error: `tool.base_from_tool`: is not a rotation
          --> robot.toml:11:18
           |
        11 | base_from_tool = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]
           |                  ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^ expected three rows of a right-handed rotation, orthonormal within 1e-6
        "#);
}

#[test]
fn every_fault_of_the_effects_is_reported_at_once() {
    let text = r#"
[[effect]]
kind = "backlsh"
joint = 1
[[effect]]
kind = "backlash"
joint = 3
width_deg = 0.1
[[effect]]
kind = "joint_offset"
joint = 1
offset_mrad = 1.0
[[effect]]
kind = "axis_tilt"
joint = 1
tilt_mrad = [1.0]
sigma = { tilt = 1 }
"#;
    let whole = &TWO_JOINTS[..TWO_JOINTS.find("[[effect]]").unwrap()];
    insta::assert_snapshot!(parse(&format!("{whole}{text}")).unwrap_err(), @r#"
        error: `effect[1].kind`: is "backlsh", which is not a known effect
          --> robot.toml:37:8
           |
        37 | kind = "backlsh"
           |        ^^^^^^^^^ expected "backlash", or the name of another effect (docs/reference/effects.md)

        error: `effect[2].joint`: is 3
          --> robot.toml:41:9
           |
        41 | joint = 3
           |         ^ expected a whole number from 1 to 2

        error: `effect[2].width_deg`: has the unit deg, which does not match this key
          --> robot.toml:42:1
           |
        42 | width_deg = 0.1
           | ^^^^^^^^^ expected `width_mrad`
           |
           = help: write `width_mrad`, with the value multiplied by 17.45329252

        error: `effect[3].offset_mrad`: has the unit mrad, which does not match this key
          --> robot.toml:46:1
           |
        46 | offset_mrad = 1.0
           | ^^^^^^^^^^^ expected `offset_mm`
           |
           = help: write `offset_mm`

        error: `effect[4].tilt_mrad`: has 1 numbers
          --> robot.toml:50:13
           |
        50 | tilt_mrad = [1.0]
           |             ^^^^^ expected 2 numbers

        error: `effect[4].sigma.tilt`: has no unit, which does not match this key
          --> robot.toml:51:11
           |
        51 | sigma = { tilt = 1 }
           |           ^^^^ expected `tilt_mrad`
           |
           = help: write `tilt_mrad`
        "#);
}

#[test]
fn what_only_the_physics_knows_is_reported_at_its_effect() {
    let text = TWO_JOINTS
        .replace("tilt_mrad = [0.1, -0.2]", "tilt_mrad = [0.1, -0.2]\npivot_mm = [9, 0, 0]");
    insta::assert_snapshot!(parse(&text).unwrap_err(), @r#"
        error: `effect[3]: axis_tilt of joint 2`: `pivot` is 0.40010123718878954 m from the joint's axis, expected a point on the axis
          --> robot.toml:46:1
           |
        46 | [[effect]]
           | ^^^^^^^^^^
        "#);
}

#[test]
fn joint_compliance_stands_alone() {
    let text = format!(
        "{TWO_JOINTS}\n[[effect]]\nkind = \"joint_compliance\"\njoint = 2\ncompliance_mrad_per_kNm = 1\n\
         [[effect]]\nkind = \"load_compliance\"\njoint = 2\ncompliance_mrad_per_kNm = 1\n"
    );
    assert!(parse(&text).is_err());
}

#[test]
fn a_hardening_without_a_linear_compliance_of_its_joint_is_refused() {
    let hardening =
        "[[effect]]\nkind = \"stiffness_hardening\"\njoint = 2\ncubic_mrad_per_kNm3 = 1\n";
    for (beside, fits) in [
        ("", false),
        ("kind = \"load_compliance\"\njoint = 1\ncompliance_mm_per_kN = 1\n", false),
        ("kind = \"bearing_compliance\"\njoint = 2\ncompliance_mrad_per_kNm = 1\n", false),
        ("kind = \"load_compliance\"\njoint = 2\ncompliance_mrad_per_kNm = 1\n", true),
        ("kind = \"gravity_compliance\"\njoint = 2\ncompliance_mrad_per_kNm = 1\n", true),
    ] {
        let other = if beside.is_empty() { String::new() } else { format!("[[effect]]\n{beside}") };
        let read = parse(&format!("{TWO_JOINTS}\n{hardening}{other}"));
        assert_eq!(read.is_ok(), fits, "{beside}: {read:?}");
        if let Err(faults) = read {
            assert!(
                faults.to_string().contains("has no effect without a linear compliance"),
                "{faults}"
            );
        }
    }
}

/// Each kind of docs/reference/effects.md with realistic values; joint 2 is revolute.
pub(super) const EVERY_KIND: &[(&str, &str)] = &[
    ("joint_offset", "joint = 2\noffset_mrad = 1"),
    ("joint_ratio", "joint = 2\nratio = 1e-4"),
    ("joint_coupling", "joint = 2\nratio = 1e-4\nfrom_joint = 1"),
    ("joint_polynomial", "joint = 2\ncoefficients_mrad = [1, 2]\nrange_deg = [-90, 90]"),
    ("transmission_error", "joint = 2\namplitude_mrad = 0.1\ncycles_per_rev = 2\nphase_rad = 1"),
    ("backlash", "joint = 2\nwidth_mrad = 0.1"),
    ("lost_motion", "joint = 2\nwidth_mrad = 0.1\ntorque_Nm = 3"),
    ("hysteresis", "joint = 2\namplitude_mrad = 0.1\nreversal_mrad = 3"),
    ("gravity_compliance", "joint = 2\ncompliance_mrad_per_kNm = 2"),
    ("gravity_sag", "joint = 2\nsag_mrad = [1, 2, 3]"),
    ("load_compliance", "joint = 2\ncompliance_mrad_per_kNm = 2"),
    ("joint_compliance", "joint = 2\ncompliance_mrad_per_kNm = 2"),
    (
        "stiffness_hardening",
        "joint = 2\ncubic_mrad_per_kNm3 = 2\n\
         [[effect]]\nkind = \"joint_compliance\"\njoint = 2\ncompliance_mrad_per_kNm = 2",
    ),
    ("bearing_compliance", "joint = 2\ncompliance_mrad_per_kNm = 2"),
    ("base_compliance", "compliance_mrad_per_kNm = 2"),
    ("tool_compliance", "compliance_um_per_N = [1, 2, 3]"),
    (
        "counterbalance",
        "joint = 2\nstiffness_N_per_m = 1e4\nfree_length_mm = 100\na_mm = 200\nL_mm = 300\nangle_deg = 30",
    ),
    ("axis_tilt", "joint = 2\ntilt_mrad = [1, 2]"),
    ("axis_shift", "joint = 2\nshift_mm = [0.1, 0, 0.1]"),
    ("tool_offset", "shift_mm = [1, 2, 3]\nturn_mrad = [1, 2, 3]"),
    ("gravity_tilt", "tilt_mrad = [1, 2]"),
    ("payload", "mass_kg = 2\ncom_mm = [1, 2, 3]"),
    ("thermal_growth", "joint = 2\ngrowth_um_per_K = 7"),
    ("thermal_growth", "joint = 2\namplitude_um = 7\ntime_constant_s = 3600"),
    ("thermal_zero", "joint = 2\ndrift_mrad_per_K = 0.1\nlag_s = 100"),
    ("axis_wobble", "joint = 2\namplitude_mrad = [1, 2]\nphase_rad = [0, 1]\ncycles_per_rev = 1"),
    ("spindle_growth", "growth_um_per_krpm = 2"),
    ("time_delay", "delay_ms = 3\nchannel = \"ql\""),
    ("servo_lag", "joint = 2\ntime_constant_ms = 3"),
    ("flexible_mode", "joint = 2\nfrequency_Hz = 20\ndamping_ratio = 0.03"),
    ("flexible_mode", "axis = [0, 0, 1]\nfrequency_Hz = 20\ndamping_ratio = 0.03"),
    ("reversal_spike", "joint = 2\namplitude_mrad = 0.1\ntime_constant_ms = 30"),
    ("wrench_bias", "bias_N = [1, 2, 3]\nbias_Nm = [1, 2, 3]"),
    ("wrench_scale", "scale = [0, 0, 0, 0, 0, 0.1]"),
    ("wrench_misalignment", "turn_mrad = [1, 2, 3]"),
    ("coulomb_friction", "joint = 2\nlevel_Nm = 3"),
    ("viscous_friction", "joint = 2\ncoefficient = 3"),
    ("stribeck_friction", "joint = 2\nlevel_Nm = 3\nstribeck_speed = 0.1"),
    ("friction_asymmetry", "joint = 2\noffset_Nm = 3"),
    ("load_friction", "joint = 2\ncoefficient = 0.1"),
    ("friction_temperature", "joint = 2\nper_K = 0.01"),
    ("inertia", "joint = 2\ninertia_kgm2 = 0.1"),
    ("gravity_torque", "joint = 2\ncos_Nm = 1\nsin_Nm = 2"),
    ("torque_ripple", "joint = 2\namplitude_Nm = 1\ncycles_per_rev = 2\nphase_rad = 0"),
    ("spring", "joint = 2\nstiffness = 1\nrest_position = 0"),
    ("spring_hardening", "joint = 2\ncubic_stiffness = 1"),
    ("hysteresis", "joint = 2\namplitude_Nm = 0.1\nreversal_mrad = 3"),
    ("drive_gain", "joint = 2\ngain = 0.1"),
    ("torque_delay", "delay_ms = 1"),
    ("edge_force", "coefficient_N_per_mm = [1, 2, 3]"),
    ("cutting_force", "coefficient_N_per_mm2 = [1, 2, 3]"),
    ("tool_wear", "growth_per_m = 0.1"),
    ("runout", "radial_um = 1\nphase_rad = 0"),
    ("chatter", "frequency_Hz = 684\namplitude_N = 10"),
    ("cross_talk", "matrix = [1, 0, 0, 0, 1, 0, 0, 0, 1]"),
];

#[test]
fn every_kind_of_the_contract_loads_and_writes_back() {
    let mut unknown = Vec::new();
    for (kind, entries) in EVERY_KIND {
        let text = format!("{TWO_JOINTS}\n[[effect]]\nkind = \"{kind}\"\n{entries}\n");
        match parse(&text) {
            Ok(model) => assert_eq!(parse(&model.file.to_toml()).unwrap(), model, "{kind}"),
            Err(faults) => unknown.push(format!("{kind}: {faults}")),
        }
    }
    assert!(unknown.is_empty(), "{}", unknown.join("\n"));
}

#[test]
fn an_effect_made_in_si_is_the_one_that_its_text_says() {
    let model = parse(TWO_JOINTS).unwrap();
    let sigma = [1e-6];
    let parameter = SiParameter { stem: "width", values: &[4.2e-4], sigma: Some(&sigma) };
    let entry =
        EffectEntry::from_si(&model.physics.arm, "backlash", Some(1), &[parameter]).unwrap();
    let mut file = model.file.clone();
    file.effects.push(entry);
    let again = parse(&file.to_toml()).unwrap();
    let last = again.physics.effects().last().unwrap();
    assert!((last.values()[0] - 4.2e-4).abs() < 1e-18);
    assert!((again.sigma[2][0] - 1e-6).abs() < 1e-18);
}

proptest! {
    #[test]
    fn any_numbers_read_back_bit_for_bit(numbers in prop::collection::vec(prop::num::f64::NORMAL, 8)) {
        let mut file = parse(TWO_JOINTS).unwrap().file;
        file.tool.tcp_mm = [numbers[0], numbers[1], numbers[2]];
        file.gravity_m_s2 = [numbers[3], numbers[4], numbers[5]];
        file.effects[2].parameters[0].value = Numbers::List(vec![numbers[6], numbers[7]]);
        let again = super::read::parse("x", &file.to_toml()).unwrap().file;
        prop_assert_eq!(again, file);
    }

    #[test]
    fn no_text_makes_the_reader_panic(offset in any::<usize>(), byte in any::<u8>(), cut in any::<usize>()) {
        let mut text = TWO_JOINTS.as_bytes().to_vec();
        let length = text.len();
        text[offset % length] = byte;
        let _ = parse(&String::from_utf8_lossy(&text)).map_err(|faults| faults.plain());
        text.drain(cut % length..(cut % length + offset % 40).min(length));
        let _ = parse(&String::from_utf8_lossy(&text)).map_err(|faults| faults.styled());
    }
}
