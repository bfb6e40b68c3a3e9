//! Second part of the demo: the recording of the measuring program is diagnosed as by `trued diagnose`, the model is loaded into the running daemon, and the truth is revealed last.
//!
//! The diagnosis sees the daemon's model file and the recording only; a wrong name is reported as
//! wrong. Nothing hidden is used before the verdict is given.

use std::path::Path;
use std::time::{Duration, Instant};

use diagnosis::diagnose::{Verdict, says};
use diagnosis_report::{Diagnosed, JSON, MODEL, PAGE, Settings, lead, lines};
use physics::JointKind;
use recording::model::RobotModel;
use recording::outputs::Outputs;
use recording::series::{self, Need};
use report::{TextLine, Tone};
use trued_client::{Answer, Monitor};

use crate::error::Error;
use crate::outcome::{Named, Told};
use crate::run::{Demo, Event, Tell};
use crate::scene::Scene;

/// The folder of the diagnosis, in the demo's.
pub const FOLDER: &str = "diagnosis";
/// How long the daemon may take to be found, and to answer.
const FOUND_WITHIN: Duration = Duration::from_secs(2);
const ANSWER_WITHIN: Duration = Duration::from_secs(5);

/// Diagnoses the measurements, reports the result, loads the resulting model into the daemon of
/// `cell` if it is to be used, and reveals the truth. Returns whether the model was replaced.
///
/// # Errors
/// Files that cannot be read or written; a daemon that does not answer.
pub(crate) fn play(
    demo: &Demo<'_>,
    cell: &str,
    tell: &mut Tell<'_>,
) -> Result<(Told, bool), Error> {
    let Demo { scene, out, .. } = demo;
    let start = Instant::now();
    let found = found(out, scene.seed)?;
    let diagnosis_s = start.elapsed().as_secs_f64();
    let folder = out.join(FOLDER);
    put(demo, &found, &folder)?;
    let mut says = Vec::new();
    for report in found.reports() {
        let verdict = report.verdict.replace('_', " ");
        let (lead, lines) = (lead(&report), lines(&report));
        says.push(format!("{verdict}: {lead}"));
        let head = TextLine::with_head(Tone::Plain, verdict, format!(": {lead}"));
        let rest = lines.iter().map(|line| line.as_str().into());
        tell(Event::Text(std::iter::once(head).chain(rest).collect()))?;
        says.extend(lines);
    }
    let verdict = found.diagnosis.as_ref().map_or(Verdict::Undetermined, |d| d.verdict);
    let claims = verdict == Verdict::MissingPhysics;
    let swapped = claims && load(cell, &folder.join(MODEL), tell)?;
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
fn found(out: &Path, seed: u64) -> Result<Diagnosed, Error> {
    let model = RobotModel::read(&out.join(MODEL))?;
    let recording = out.join("measured.csv");
    let recording = series::read(&recording, None, Need::Measurement)?;
    let settings = Settings { seed, ..Settings::default() };
    Ok(diagnosis_report::diagnose(model, vec![recording], &settings, &mut |_| {})?)
}

/// Writes diagnosis, model and page.
fn put(demo: &Demo<'_>, found: &Diagnosed, folder: &Path) -> Result<(), Error> {
    let [json, model, page] = [JSON, MODEL, PAGE].map(|name| folder.join(name));
    let outputs = Outputs::new(demo.may_replace).in_folder(folder);
    let mut outputs = outputs.result(&json).result(&model).result(&page);
    outputs.put(&json, found.json()?);
    outputs.put(&model, found.model_toml()?);
    outputs.put(&page, found.page(folder).provenance(demo.provenance.clone()).render());
    Ok(outputs.write()?)
}

/// Replaces the model as `trued reload` does; returns whether the daemon took it.
fn load(cell: &str, model: &Path, tell: &mut Tell<'_>) -> Result<bool, Error> {
    // The daemon has another working directory.
    let model = std::path::absolute(model).map_err(Error::system)?;
    let mut monitor = Monitor::connect(cell, FOUND_WITHIN).map_err(Error::system)?;
    let response = monitor.reload(Some(&model), ANSWER_WITHIN).map_err(Error::system)?;
    let message = response.message.to_string();
    let (is_taken, lines) = match response.answer().map_err(Error::system)? {
        Answer::Done => (true, vec![message.into()]),
        Answer::Refused => {
            let rejected = format!("rejected: {message}; the daemon keeps its current model");
            (false, vec![rejected.into()])
        }
        answer => return Err(Error::system(format!("{answer}: {message}"))),
    };
    tell(Event::Text(lines))?;
    Ok(is_taken)
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
