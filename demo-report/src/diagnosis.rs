//! Second part of the demo: the recording of the measuring program is diagnosed as by `trued diagnose`, the model is loaded into the running daemon, and the truth is revealed last.
//!
//! The diagnosis sees the daemon's model file and the recording only; a wrong name is reported as
//! wrong. Nothing hidden is used before the verdict is given.

use std::path::Path;
use std::time::{Duration, Instant};

use diagnosis::diagnose::{Verdict, sentences};
use diagnosis_report::progress::Listener;
use diagnosis_report::{JSON, MODEL, PAGE, RobotDiagnosis, Settings, lines, summary};
use physics::JointKind;
use recording::model::RobotModel;
use recording::outputs::Outputs;
use recording::series::{self, RequiredData};
use report::{TextLine, Tone};
use trued_client::{Answer, Monitor};

use crate::error::Error;
use crate::outcome::{DiagnosisOutcome, EffectName};
use crate::run::{Demo, Event, EventSink};
use crate::scene::Scene;

/// The folder of the diagnosis, in the demo's.
pub const FOLDER: &str = "diagnosis";
/// How long the daemon may take to be found, and to answer.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);

/// Diagnoses the measurements, reports the result, loads the resulting model into the daemon of
/// `cell` if it is to be used, and reveals the truth. Returns whether the model was replaced.
///
/// # Errors
/// Files that cannot be read or written; a daemon that does not answer.
pub(crate) fn run(
    demo: &Demo<'_>,
    cell: &str,
    tell: &mut EventSink<'_>,
    listener: Listener<'_>,
) -> Result<(DiagnosisOutcome, bool), Error> {
    let Demo { scene, out, .. } = demo;
    let start = Instant::now();
    let found = diagnose_recording(out, scene.seed, listener)?;
    let diagnosis_s = start.elapsed().as_secs_f64();
    let folder = out.join(FOLDER);
    tell(Event::Stage("figures and files"))?;
    write_files(demo, &found, &folder)?;
    tell(Event::Ended)?;
    let mut says = Vec::new();
    for report in found.reports() {
        let verdict = report.verdict.replace('_', " ");
        let (lead, lines) = (summary(&report), lines(&report));
        says.push(format!("{verdict}: {lead}"));
        let head = TextLine::with_head(Tone::Plain, verdict, format!(": {lead}"));
        let rest = lines.iter().map(|line| line.as_str().into());
        tell(Event::Text(std::iter::once(head).chain(rest).collect()))?;
        says.extend(lines);
    }
    let verdict = found.diagnosis.as_ref().map_or(Verdict::Undetermined, |d| d.verdict);
    let is_claimed = verdict == Verdict::MissingPhysics;
    let swapped = is_claimed && load_model(cell, &folder.join(MODEL), tell)?;
    let hidden = effect_name(scene.hidden.effect.spec().kind, scene.hidden.effect.joint());
    let first = found.diagnosis.as_ref().and_then(|d| d.findings.first()).filter(|_| is_claimed);
    let said = first.map(|one| effect_name(one.effect.spec().kind, one.effect.joint()));
    let named_right = first.is_some_and(|one| {
        let indistinguishable =
            one.alternatives.iter().filter(|(rival, _)| rival.is_indistinguishable);
        let rivals = indistinguishable.map(|(rival, _)| &rival.effect);
        said.as_ref().is_some_and(|said| are_equivalent(said, &hidden))
            || rivals
                .map(|r| effect_name(r.spec().kind, r.joint()))
                .any(|rival| are_equivalent(&rival, &hidden))
    });
    let outcome = DiagnosisOutcome {
        truth: truth_sentence(scene),
        hidden_effect: hidden,
        said,
        named_right,
        hidden_effect_mm: 1e3 * scene.hidden.on_work_m,
        verdict: verdict.name().to_owned(),
        says,
        diagnosis_s,
    };
    Ok((outcome, swapped))
}

/// The diagnosis of the measuring program's recording with the daemon's model.
fn diagnose_recording(
    out: &Path,
    seed: u64,
    listener: Listener<'_>,
) -> Result<RobotDiagnosis, Error> {
    let model = RobotModel::read(&out.join(MODEL))?;
    let recording = out.join("measured.csv");
    let recording = series::read(&recording, None, RequiredData::Measurement)?;
    let settings = Settings { seed, ..Settings::default() };
    Ok(diagnosis_report::diagnose(model, vec![recording], &settings, listener)?)
}

/// Writes diagnosis, model and page.
fn write_files(demo: &Demo<'_>, found: &RobotDiagnosis, folder: &Path) -> Result<(), Error> {
    let [json, model, page] = [JSON, MODEL, PAGE].map(|name| folder.join(name));
    let outputs = Outputs::new(demo.may_replace).in_folder(folder);
    let mut outputs = outputs.result(&json).result(&model).result(&page);
    outputs.put(&json, found.json()?);
    outputs.put(&model, found.model_toml()?);
    outputs.put(&page, found.page(folder).provenance(demo.provenance.clone()).render());
    Ok(outputs.write()?)
}

/// Replaces the model as `trued reload` does; returns whether the daemon took it.
fn load_model(cell: &str, model: &Path, tell: &mut EventSink<'_>) -> Result<bool, Error> {
    // The daemon has another working directory.
    let model = std::path::absolute(model).map_err(Error::system)?;
    let mut monitor = Monitor::connect(cell, CONNECT_TIMEOUT).map_err(Error::system)?;
    let response = monitor.reload(Some(&model), ANSWER_TIMEOUT).map_err(Error::system)?;
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
fn are_equivalent(reported: &EffectName, hidden: &EffectName) -> bool {
    let family = |named: &EffectName| match named.effect.as_str() {
        "gravity_sag" => "gravity_compliance".to_owned(),
        name => name.to_owned(),
    };
    reported.joint == hidden.joint && family(reported) == family(hidden)
}

fn effect_name(kind: &str, joint: Option<usize>) -> EffectName {
    EffectName { effect: kind.to_owned(), joint: joint.map(|joint| joint + 1) }
}

/// The hidden effect, in the words of a finding.
fn truth_sentence(scene: &Scene) -> String {
    let effect = &scene.hidden.effect;
    let kind = effect.joint().map(|joint| scene.model.physics.arm.joints()[joint].kind);
    sentences::sentence(effect, None, kind == Some(JointKind::Prismatic))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_true_name_on_the_true_joint_or_what_counts_as_it_is_right() {
        let hidden = effect_name("gravity_sag", Some(2));
        assert!(are_equivalent(&effect_name("gravity_sag", Some(2)), &hidden));
        assert!(are_equivalent(&effect_name("gravity_compliance", Some(2)), &hidden));
        assert!(!are_equivalent(&effect_name("gravity_compliance", Some(1)), &hidden));
        assert!(!are_equivalent(&effect_name("joint_compliance", Some(2)), &hidden));
        assert!(!are_equivalent(
            &effect_name("backlash", Some(2)),
            &effect_name("hysteresis", Some(2))
        ));
    }
}
