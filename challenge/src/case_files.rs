//! Writes a case as the files for a solver: model, recording and its metadata (docs/reference/model.md, `recording.md`).
//!
//! The files contain nothing that is hidden from the solver.

use std::fmt::Write as _;

use crate::arm::{Arm, JOINTS};
use crate::case::PositionCase;
use crate::effect;
use crate::effect::EffectKind;
use crate::instrument::Measurements;
use crate::kinds::Effect;
use crate::scene::Scene;
use crate::transform::{Transform, Vector3, column, origin, transform_point};

/// Name and content of a file.
pub type File = (&'static str, String);

pub(crate) fn list(parameters: &[f64]) -> String {
    let texts: Vec<String> = parameters.iter().map(|x| format!("{x:?}")).collect();
    format!("[{}]", texts.join(", "))
}

pub(crate) fn mm(v: Vector3) -> String {
    list(&v.map(|x| x * 1e3))
}

/// The model file for the solver.
#[must_use]
pub fn model(case: &PositionCase) -> String {
    let arm = &case.scene.arm;
    let link = |i: usize, frame: &Transform| {
        let mass = arm.masses.iter().find(|m| m.joint == i && !m.tool)?;
        let position = mm(transform_point(frame, mass.position));
        Some(format!("mass_kg = {:?}, com_mm = {position}", mass.kg))
    };
    let tool = arm.masses.iter().find(|m| m.tool);
    let mut text = geometry(arm, false, link);
    if let Some(mass) = tool {
        let zero = arm.frames(&[0.0; JOINTS]);
        text.push_str(&tool_mass(mass.kg, transform_point(&zero[mass.joint], mass.position)));
    }
    for modelled in &case.modelled {
        text.push_str(&effect(&modelled.nominal, &modelled.sigma));
    }
    text
}

/// Entry of the tool's mass, kg, and its centre of mass in base axes at the zero configuration, m.
pub(crate) fn tool_mass(kg: f64, position: Vector3) -> String {
    format!("mass_kg = {kg:?}\ncom_mm = {}\n", mm(position))
}

/// Entries of an arm's chain with revolute or prismatic joints, additional text per link, and the tool.
pub(crate) fn geometry(
    arm: &Arm,
    slides: bool,
    link: impl Fn(usize, &Transform) -> Option<String>,
) -> String {
    let zero = arm.frames(&[0.0; JOINTS]);
    let mut text = format!(
        "schema = \"trued.model/1\"\nname = \"{}, a case\"\ngravity_m_s2 = {}\n",
        arm.name,
        list(&arm.gravity)
    );
    let (kind, limits) = if slides {
        ("prismatic", "limits_mm = [-2000.0, 2000.0]\nmax_speed_mm_s = 2500.0")
    } else {
        ("revolute", "limits_deg = [-355.0, 355.0]\nmax_speed_deg_s = 250.0")
    };
    for (i, frame) in zero.iter().enumerate().take(arm.joint_count()) {
        let axis = column(frame, 2);
        let length = crate::transform::norm(axis);
        let _ = write!(
            text,
            "\n[[joint]]\nname = \"{}\"\nkind = \"{kind}\"\naxis = {}\npoint_mm = {}\n{limits}\n",
            i + 1,
            list(&axis.map(|x| x / length)),
            mm(origin(frame))
        );
        if let Some(link) = link(i, frame) {
            let _ = writeln!(text, "link = {{ {link} }}");
        }
    }
    let tool = &zero[arm.joint_count()];
    let rows: Vec<String> = tool.iter().take(3).map(|row| list(&row[..3])).collect();
    let _ = write!(
        text,
        "\n[tool]\ntcp_mm = {}\nbase_from_tool = [{}]\n",
        mm(origin(tool)),
        rows.join(", ")
    );
    text
}

/// An effect as an entry of a model file; `sigma`: standard uncertainties of its first parameters, SI.
#[must_use]
pub fn effect(effect: &Effect, sigma: &[f64]) -> String {
    let from = (effect.kind == crate::kinds::Kind::JointCoupling).then_some(effect.other_joint + 1);
    effect_entry(effect, false, from, sigma)
}

/// An entry of a model file: kind, joints, keys with values, and the standard uncertainties of the first key.
pub(crate) fn effect_entry<K: EffectKind>(
    effect: &effect::Effect<K>,
    slides: bool,
    from: Option<usize>,
    sigma: &[f64],
) -> String {
    let shown = |parameters: &[f64], si: f64| {
        let values: Vec<f64> = parameters.iter().map(|x| x / si).collect();
        if values.len() == 1 { format!("{:?}", values[0]) } else { list(&values) }
    };
    let mut text = format!("\n[[effect]]\nkind = \"{}\"\n", effect.kind.name().unwrap_or("none"));
    if let Some(joint) = effect.joint_number() {
        let _ = writeln!(text, "joint = {joint}");
    }
    if let Some(from) = from {
        let _ = writeln!(text, "from_joint = {from}");
    }
    for (entry, numbers) in effect.keyed_parameters() {
        let _ = writeln!(text, "{} = {}", entry.key(slides), shown(numbers, entry.si));
    }
    if let Some(first) = effect.kind.spec().keys.first().filter(|_| !sigma.is_empty()) {
        let _ = writeln!(text, "sigma = {{ {} = {} }}", first.key(slides), shown(sigma, first.si));
    }
    text
}

/// The metadata of the recording, TOML.
#[must_use]
pub fn metadata(case: &PositionCase) -> String {
    let mut text = "schema = \"trued.recording/1\"\nmodel = \"model.toml\"\n".to_owned();
    if case.scene.is_settled() {
        text.push_str("kind = \"poses\"\napproach = \"columns\"\n");
    }
    if case.instrument.frame_known {
        text.push_str("measuring_frame = \"base\"\n");
    }
    if case.instrument.targets && case.instrument.points_known {
        for (k, place) in case.instrument.points.iter().enumerate() {
            let _ = writeln!(text, "target{}_mm = {}", k + 1, mm(*place));
        }
    }
    if case.noise.stated {
        let si = measured_unit(case);
        let sigma = case.noise.sigma / si;
        let keys = measured_names(case).into_iter().map(|name| format!("{name} = {sigma:?}"));
        let _ = writeln!(text, "sigma = {{ {} }}", keys.collect::<Vec<_>>().join(", "));
    }
    text
}

fn measured_unit(case: &PositionCase) -> f64 {
    if case.instrument.points.is_empty() { std::f64::consts::PI / 180.0 } else { 1e-3 }
}

fn measured_names(case: &PositionCase) -> Vec<String> {
    let axes = ["x_mm", "y_mm", "z_mm"];
    if case.instrument.points.is_empty() {
        return (1..=case.scene.arm.joint_count()).map(|i| format!("ql{i}_deg")).collect();
    }
    if !case.instrument.targets {
        return axes.map(str::to_owned).to_vec();
    }
    let of_target = |k: usize| axes.map(|axis| format!("target{k}_{axis}"));
    (1..=case.instrument.points.len()).flat_map(of_target).collect()
}

/// The recording of `scene`, CSV.
#[must_use]
pub fn recording(case: &PositionCase, scene: &Scene, measured: &Measurements) -> String {
    let si = measured_unit(case);
    let digits = if case.instrument.points.is_empty() { 7 } else { 5 };
    let width = case.instrument.values_per_row(scene);
    let mut text = header(case, scene, &measured_names(case));
    for (k, row) in scene.rows.iter().enumerate() {
        append_inputs(&mut text, scene, k);
        for value in &measured.values[k * width..(k + 1) * width] {
            text.push(',');
            if measured.recorded[k] {
                let _ = write!(text, "{:.digits$}", value / si);
            }
        }
        append_environment(&mut text, case, row);
        text.push('\n');
    }
    text
}

fn header(case: &PositionCase, scene: &Scene, measured: &[String]) -> String {
    let n = scene.arm.joint_count();
    let mut names = vec!["t_s".to_owned(), "segment".to_owned()];
    names.extend((1..=n).map(|i| format!("q{i}_deg")));
    if scene.is_settled() {
        names.extend((1..=n).map(|i| format!("d{i}")));
    }
    names.extend(measured.iter().cloned());
    let recorded_inputs = case.scene.recorded;
    if recorded_inputs.wrench {
        names.extend(["fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm"].map(str::to_owned));
    }
    if recorded_inputs.ambient {
        names.push("temp_C".to_owned());
    }
    if recorded_inputs.joint_temperatures {
        names.extend((1..=n).map(|i| format!("temp{i}_C")));
    }
    if recorded_inputs.spindle {
        names.push("spindle_rpm".to_owned());
    }
    names.join(",") + "\n"
}

fn append_inputs(text: &mut String, scene: &Scene, k: usize) {
    let (row, n) = (&scene.rows[k], scene.arm.joint_count());
    let _ = write!(text, "{:.6},{}", row.t_s, row.segment);
    row.q.iter().take(n).for_each(|q| {
        let _ = write!(text, ",{:.8}", q.to_degrees());
    });
    if scene.is_settled() {
        row.approach.iter().take(n).for_each(|d| {
            let _ = write!(text, ",{d:.0}");
        });
    }
}

fn append_environment(text: &mut String, case: &PositionCase, row: &crate::scene::Row) {
    let (recorded_inputs, n) = (case.scene.recorded, case.scene.arm.joint_count());
    if recorded_inputs.wrench {
        row.wrench.iter().for_each(|x| {
            let _ = write!(text, ",{x:.5}");
        });
    }
    if recorded_inputs.ambient {
        let _ = write!(text, ",{:.2}", row.ambient_c);
    }
    if recorded_inputs.joint_temperatures {
        row.joint_c.iter().take(n).for_each(|c| {
            let _ = write!(text, ",{c:.2}");
        });
    }
    if recorded_inputs.spindle {
        let _ = write!(text, ",{:.0}", row.rpm);
    }
}

/// The files of a case for the solver.
#[must_use]
pub fn files(case: &PositionCase) -> [File; 3] {
    let measured = case.simulate_measurements(&case.scene, 0);
    [
        ("model.toml", model(case)),
        ("recording.csv", recording(case, &case.scene, &measured)),
        ("recording.toml", metadata(case)),
    ]
}
