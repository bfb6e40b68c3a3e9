//! Writes a case of forces as the files for a solver: a model without a robot, a recording, and the description of the cut
//! (docs/reference/recording.md).
//!
//! The files contain nothing that is hidden from the solver.

use std::fmt::Write as _;

use crate::case_files::{File, effect_entry, list};
use crate::transform::Vector3;

use super::case::{ForceCase, Measurements};
use super::kinds::Effect;
use super::laws::SimulatedPasses;
use super::passes::ToolState;

/// A dummy robot: a model is required to contain effects even if only forces are measured.
const NO_ROBOT: &str = r#"schema = "trued.model/1"
name = "a cut without a robot"

[[joint]]
name = "1"
kind = "prismatic"
axis = [1.0, 0.0, 0.0]
limits_mm = [-10.0, 10.0]

[tool]
tcp_mm = [0.0, 0.0, 0.0]
"#;

/// An effect as an entry of a model file; `sigma`: standard uncertainties of its first parameters, SI.
#[must_use]
pub fn effect(effect: &Effect, sigma: &[f64]) -> String {
    effect_entry(effect, false, None, sigma)
}

/// The model file for the solver.
#[must_use]
pub fn model(case: &ForceCase) -> String {
    let modelled = case.modelled.iter().map(|known| effect(&known.nominal, &known.sigma));
    NO_ROBOT.to_owned() + &modelled.collect::<String>()
}

/// The metadata of the recording, TOML.
#[must_use]
pub fn metadata(case: &ForceCase) -> String {
    let (cut, noise) = (&case.cut, &case.noise);
    let mut text = "schema = \"trued.recording/1\"\nmodel = \"model.toml\"\n".to_owned();
    let sigma = |axis: usize| noise.total_sigma(axis);
    let [x, y, z] = [sigma(0), sigma(1), sigma(2)];
    let _ = writeln!(text, "sigma = {{ fx_N = {x:?}, fy_N = {y:?}, fz_N = {z:?} }}");
    text.push_str("\n[cut]\n");
    if cut.turning {
        text.push_str("operation = \"turning\"\n");
    }
    let _ = writeln!(text, "teeth = {}", cut.teeth);
    for (key, value) in [
        ("diameter_mm", 2e3 * cut.radius_m),
        ("helix_deg", cut.helix_rad.to_degrees()),
        ("axial_depth_mm", 1e3 * cut.depth_m),
        ("entry_deg", cut.entry_rad.to_degrees()),
        ("exit_deg", cut.exit_rad.to_degrees()),
    ] {
        let _ = writeln!(text, "{key} = {value:?}");
    }
    let each = |parameters: Vector3, si: f64| list(&parameters.map(|x| x / si));
    let _ = writeln!(text, "coefficients_N_per_mm2 = {}", each(cut.chip, 1e6));
    let _ = writeln!(text, "coefficients_N_per_mm = {}", each(cut.edge, 1e3));
    text
}

/// The recording of the measurements, CSV.
#[must_use]
pub fn recording(ride: &SimulatedPasses<'_>, measured: &Measurements) -> String {
    let mut text = "t_s,segment,spindle_rpm,feed_mm_s,fx_N,fy_N,fz_N\n".to_owned();
    let rows = ride.rows.iter().zip(&measured.forces).zip(&measured.recorded);
    for ((row, [x, y, z]), _) in rows.filter(|(_, recorded)| **recorded) {
        append_process(&mut text, ride, row);
        let _ = writeln!(text, ",{x:.5},{y:.5},{z:.5}");
    }
    text
}

/// Passes with zero forces, as input of a program that evaluates a model.
#[must_use]
pub fn command(ride: &SimulatedPasses<'_>) -> String {
    let mut text = "t_s,segment,spindle_rpm,feed_mm_s,fx_N,fy_N,fz_N\n".to_owned();
    for row in &ride.rows {
        append_process(&mut text, ride, row);
        text.push_str(",0.0,0.0,0.0\n");
    }
    text
}

fn append_process(text: &mut String, ride: &SimulatedPasses<'_>, row: &ToolState) {
    let rpm = 60.0 * ride.scene.passes[row.pass].spindle_hz;
    let (t_s, pass, feed) = (row.t_s, row.pass, 1e3 * row.feed_m_s);
    let _ = write!(text, "{t_s:.9},{pass},{rpm:.3},{feed:.4}");
}

/// The files of a case for the solver.
#[must_use]
pub fn files(case: &ForceCase) -> [File; 3] {
    let ride = SimulatedPasses::of(&case.cut, &case.passes);
    let measured = case.simulate_measurements(&ride, 0);
    [
        ("model.toml", model(case)),
        ("recording.csv", recording(&ride, &measured)),
        ("recording.toml", metadata(case)),
    ]
}
