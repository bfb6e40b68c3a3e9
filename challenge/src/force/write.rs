//! Writes a case of forces as the files for a solver: a model without a robot, a recording, and the description of the cut (docs/reference/recording.md).
//!
//! Promises: nothing that is hidden is in them. Never: read back.

use std::fmt::Write as _;

use crate::space::V3;
use crate::write::{File, entry, list};

use super::case::{Case, Measured};
use super::kinds::Effect;
use super::laws::Ride;
use super::scene::Row;

/// A tool that hangs on nothing: where forces alone are measured a model has to hold effects.
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

/// An effect as an entry of a model; `sigma` of its first numbers, SI.
#[must_use]
pub fn effect(effect: &Effect, sigma: &[f64]) -> String {
    entry(effect, false, None, sigma)
}

/// The model that the solver is given.
#[must_use]
pub fn model(case: &Case) -> String {
    let known = case.known.iter().map(|known| effect(&known.nominal, &known.sigma));
    NO_ROBOT.to_owned() + &known.collect::<String>()
}

/// What the recording says of itself.
#[must_use]
pub fn about(case: &Case) -> String {
    let (cut, noise) = (&case.cut, &case.noise);
    let mut text = "schema = \"trued.recording/1\"\nmodel = \"model.toml\"\n".to_owned();
    let sigma = |axis: usize| noise.total(axis);
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
    let each = |numbers: V3, si: f64| list(&numbers.map(|x| x / si));
    let _ = writeln!(text, "coefficients_N_per_mm2 = {}", each(cut.chip, 1e6));
    let _ = writeln!(text, "coefficients_N_per_mm = {}", each(cut.edge, 1e3));
    text
}

/// A recording of what was measured.
#[must_use]
pub fn recording(ride: &Ride<'_>, measured: &Measured) -> String {
    let mut text = "t_s,segment,spindle_rpm,feed_mm_s,fx_N,fy_N,fz_N\n".to_owned();
    let rows = ride.rows.iter().zip(&measured.forces).zip(&measured.there);
    for ((row, [x, y, z]), _) in rows.filter(|(_, there)| **there) {
        process(&mut text, ride, row);
        let _ = writeln!(text, ",{x:.5},{y:.5},{z:.5}");
    }
    text
}

/// Passes without a force that says anything, for a program that runs a model over them.
#[must_use]
pub fn command(ride: &Ride<'_>) -> String {
    let mut text = "t_s,segment,spindle_rpm,feed_mm_s,fx_N,fy_N,fz_N\n".to_owned();
    for row in &ride.rows {
        process(&mut text, ride, row);
        text.push_str(",0.0,0.0,0.0\n");
    }
    text
}

fn process(text: &mut String, ride: &Ride<'_>, row: &Row) {
    let rpm = 60.0 * ride.scene.passes[row.pass].spindle_hz;
    let (t_s, pass, feed) = (row.t_s, row.pass, 1e3 * row.feed_m_s);
    let _ = write!(text, "{t_s:.9},{pass},{rpm:.3},{feed:.4}");
}

/// The files of a case that the solver is given.
#[must_use]
pub fn files(case: &Case) -> [File; 3] {
    let ride = Ride::of(&case.cut, &case.scene);
    let measured = case.measured(&ride, 0);
    [
        ("model.toml", model(case)),
        ("recording.csv", recording(&ride, &measured)),
        ("recording.toml", about(case)),
    ]
}
