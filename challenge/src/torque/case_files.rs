//! Writes a case of torques as the files for a solver: model, recording and its metadata (docs/reference/model.md, `recording.md`).
//!
//! The files contain nothing that is hidden from the solver.

use std::fmt::Write as _;

use crate::case_files::{File, effect_entry, geometry, list, mm, tool_mass};

use super::case::{Measurements, TorqueCase};
use super::kinds::Effect;
use super::laws::SampledMotion;
use super::motion::Motion;

/// An effect as an entry of a model file; `sigma`: standard uncertainty of its first parameter, SI.
#[must_use]
pub fn effect(effect: &Effect, slides: bool, sigma: &[f64]) -> String {
    effect_entry(effect, slides, None, sigma)
}

/// The model file for the solver.
#[must_use]
pub fn model(case: &TorqueCase) -> String {
    let rig = &case.rig;
    let mut text = geometry(&rig.arm, rig.is_prismatic, |joint, _| {
        let (kg, centre, inertia) = rig.body(joint, false).filter(|_| rig.masses_stated)?;
        let inertia = list(&inertia);
        Some(format!("mass_kg = {kg:?}, com_mm = {}, inertia_kgm2 = {inertia}", mm(centre)))
    });
    if let Some((kg, centre, _)) = rig.body(rig.count() - 1, true).filter(|_| rig.masses_stated) {
        text.push_str(&tool_mass(kg, centre));
    }
    for modelled in &case.modelled {
        text.push_str(&effect(&modelled.nominal, rig.is_prismatic, &modelled.sigma));
    }
    text
}

/// The metadata of the recording, TOML.
#[must_use]
pub fn metadata() -> String {
    "schema = \"trued.recording/1\"\nmodel = \"model.toml\"\n".to_owned()
}

/// Rows at rest before each run of a [`command`], so that numerical differentiation sees where the motion begins.
const BEFORE: usize = 8;

/// Indices of the rows of a [`command`] that are those of the motion.
#[must_use]
pub fn commanded(motion: &Motion, finer: usize) -> Vec<usize> {
    let mut from = 0;
    let mut rows = Vec::with_capacity(motion.rows());
    for segment in &motion.segments {
        let count = segment.times_s.len();
        rows.extend((0..count).map(|k| from + BEFORE + k * finer.max(1)));
        from += BEFORE + count * finer.max(1);
    }
    rows
}

/// A motion as commands, with `finer` rows for each of its own ([`commanded`]) and zero torques, as input of a program that evaluates a model. The
/// fine grid makes numerical differentiation accurate.
#[must_use]
pub fn command(case: &TorqueCase, motion: &Motion, finer: usize) -> String {
    let (n, finer) = (case.rig.count(), finer.max(1));
    let mut text = header(case, "q");
    for (number, segment) in motion.segments.iter().enumerate() {
        let between = |k: usize| {
            let (row, part) = (k / finer, (k % finer) as f64);
            segment.times_s[row] + part / (motion.rate_hz * finer as f64)
        };
        let rest = (1..=BEFORE).rev().map(|k| -(k as f64) / (motion.rate_hz * finer as f64));
        let moving = (0..segment.times_s.len() * finer).map(|k| (k / finer, between(k)));
        for (row, t_s) in rest.map(|t_s| (0, t_s)).chain(moving) {
            let states = segment.at(t_s.max(0.0));
            // A time error of 1e-7 s would be an acceleration error of half a radian per second squared.
            let _ = write!(text, "{t_s:.13},{number}");
            states.iter().take(n).for_each(|[q, _, _]| {
                let _ = write!(text, ",{q:.13}");
            });
            text.push_str(&",0.0".repeat(n));
            // Temperatures are those of the recorded row.
            warmth(&mut text, case, |i| segment.temperature_c(i, segment.times_s[row]));
            text.push('\n');
        }
    }
    text
}

/// The recording of the measurements, with positions as motor positions.
#[must_use]
pub fn recording(case: &TorqueCase, ride: &SampledMotion, measured: &Measurements) -> String {
    let n = case.rig.count();
    let mut text = header(case, "qa");
    for (row, (segment, t_s)) in
        ride.times.iter().enumerate().filter(|(row, _)| measured.recorded[*row])
    {
        let _ = write!(text, "{t_s:.6},{segment}");
        measured.encoder_positions[row].iter().take(n).for_each(|q| {
            let _ = write!(text, ",{q:.10}");
        });
        measured.torques[row].iter().take(n).for_each(|torque| {
            let _ = write!(text, ",{torque:.6}");
        });
        warmth(&mut text, case, |i| ride.temperatures_c[row][i]);
        text.push('\n');
    }
    text
}

fn warmth(text: &mut String, case: &TorqueCase, celsius: impl Fn(usize) -> f64) {
    if case.motion.has_temperatures {
        (0..case.rig.count()).for_each(|i| {
            let _ = write!(text, ",{:.2}", celsius(i));
        });
    }
}

fn header(case: &TorqueCase, stem: &str) -> String {
    let n = case.rig.count();
    let mut names = vec!["t_s".to_owned(), "segment".to_owned()];
    let (place, torque) = if case.rig.is_prismatic { ("m", "N") } else { ("rad", "Nm") };
    names.extend((1..=n).map(|i| format!("{stem}{i}_{place}")));
    names.extend((1..=n).map(|i| format!("tau{i}_{torque}")));
    if case.motion.has_temperatures {
        names.extend((1..=n).map(|i| format!("temp{i}_C")));
    }
    names.join(",") + "\n"
}

/// The files of a case for the solver.
#[must_use]
pub fn files(case: &TorqueCase) -> [File; 3] {
    let ride = SampledMotion::from_motion(&case.rig, &case.motion, 0.0);
    let measured = case.simulate_measurements(&case.motion, &ride, 0);
    [
        ("model.toml", model(case)),
        ("recording.csv", recording(case, &ride, &measured)),
        ("recording.toml", metadata()),
    ]
}
