//! Second part of the demo: the recording of the measuring program is diagnosed as by `trued diagnose`, the model is loaded into the running daemon, and the truth is revealed last.
//!
//! The diagnosis sees the daemon's model file and the recording only; a wrong name is reported as
//! wrong. Nothing hidden is used before the verdict is given.

use std::path::Path;
use std::time::Instant;

use diagnosis::diagnose::{Verdict, says};
use diagnosis_report::{Diagnosed, MODEL, Settings, lead, lines};
use physics::JointKind;
use recording::model::RobotModel;
use recording::series::{self, Need};

use super::super::diagnose;
use super::super::reload::Swap;
use super::outcome::{Named, Told};
use super::scene::Scene;
use crate::exit::{Answer, Failure};
use crate::input::unusable;
use crate::output::{Console, Paint};

/// The folder of the diagnosis, in the demo's.
pub(super) const FOLDER: &str = "diagnosis";

/// Diagnoses the measurements, reports the result, loads the resulting model into the daemon of
/// `cell` if it is to be used, and reveals the truth. Returns whether the model was replaced.
///
/// # Errors
/// Files that cannot be read or written; a daemon that does not answer.
pub(super) fn play(
    console: &mut Console,
    scene: &Scene,
    cell: &str,
    out: &Path,
) -> Result<(Told, bool), Failure> {
    let start = Instant::now();
    let found = found(out, scene.seed)?;
    let diagnosis_s = start.elapsed().as_secs_f64();
    let folder = out.join(FOLDER);
    let mut outputs = diagnose::outputs(console.files(), &folder);
    diagnose::put(&mut outputs, &found, &folder)?;
    outputs.write()?;
    let mut says = Vec::new();
    for report in found.reports() {
        let verdict = report.verdict.replace('_', " ");
        says.push(format!("{verdict}: {}", lead(&report)));
        let head = console.paint(Paint::Strong, &verdict);
        console.say(format!("{head}: {}", lead(&report)))?;
        let lines = lines(&report);
        lines.iter().try_for_each(|line| console.say(line))?;
        says.extend(lines);
    }
    let verdict = found.diagnosis.as_ref().map_or(Verdict::Undetermined, |d| d.verdict);
    let claims = verdict == Verdict::MissingPhysics;
    let swapped = claims && swap(console, cell, &folder)?;
    let hidden = named(scene.hidden.effect.spec().kind, scene.hidden.effect.joint());
    let first = found.diagnosis.as_ref().and_then(|d| d.findings.first()).filter(|_| claims);
    let said = first.map(|one| named(one.effect.spec().kind, one.effect.joint()));
    let named_right = first.is_some_and(|one| {
        let alike = one.rivals.iter().filter(|(rival, _)| rival.alike);
        let rivals = alike.map(|(rival, _)| &rival.effect);
        said.as_ref().is_some_and(|said| same(said, &hidden))
            || rivals.map(|r| named(r.spec().kind, r.joint())).any(|rival| same(&rival, &hidden))
    });
    let told = Told {
        truth: truth(scene),
        hidden_effect: hidden,
        said,
        named_right,
        hidden_effect_mm: 1e3 * scene.hidden.on_work_m,
        verdict: verdict.name().to_owned(),
        says,
        diagnosis_s,
    };
    Ok((told, swapped))
}

/// The diagnosis of the measuring program's recording with the daemon's model.
fn found(out: &Path, seed: u64) -> Result<Diagnosed, Failure> {
    let model = RobotModel::read(&out.join(MODEL)).map_err(unusable)?;
    let recording = out.join("measured.csv");
    let recording = series::read(&recording, None, Need::Measurement).map_err(unusable)?;
    let settings = Settings { seed, ..Settings::default() };
    Ok(diagnosis_report::diagnose(model, vec![recording], &settings, &mut |_| {})?)
}

/// Replaces the model as `trued reload` does.
fn swap(console: &mut Console, cell: &str, folder: &Path) -> Result<bool, Failure> {
    let swap = Swap::ask(cell, Some(&folder.join(MODEL)))?;
    Ok(swap.tell(console)? == Answer::Done)
}

/// Whether two names are equivalent (docs/reference/effects.md, "What may answer for what"): sag
/// counts as gravity compliance.
fn same(said: &Named, hidden: &Named) -> bool {
    let family = |named: &Named| match named.effect.as_str() {
        "gravity_sag" => "gravity_compliance".to_owned(),
        name => name.to_owned(),
    };
    said.joint == hidden.joint && family(said) == family(hidden)
}

fn named(kind: &str, joint: Option<usize>) -> Named {
    Named { effect: kind.to_owned(), joint: joint.map(|joint| joint + 1) }
}

/// The hidden effect, in the words of a finding.
fn truth(scene: &Scene) -> String {
    let effect = &scene.hidden.effect;
    let kind = effect.joint().map(|joint| scene.model.physics.arm.joints()[joint].kind);
    says::sentence(effect, None, kind == Some(JointKind::Prismatic))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_true_name_on_the_true_joint_or_what_counts_as_it_is_right() {
        let hidden = named("gravity_sag", Some(2));
        assert!(same(&named("gravity_sag", Some(2)), &hidden));
        assert!(same(&named("gravity_compliance", Some(2)), &hidden));
        assert!(!same(&named("gravity_compliance", Some(1)), &hidden));
        assert!(!same(&named("joint_compliance", Some(2)), &hidden));
        assert!(!same(&named("backlash", Some(2)), &named("hysteresis", Some(2))));
    }
}
