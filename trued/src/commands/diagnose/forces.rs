//! `trued diagnose` of forces (or accelerations) without joints: the same three files as for a robot, together or not at all.

use diagnosis_report::{DiagnosisJson, ForceDiagnosis, JSON, MODEL, PAGE, lines};
use recording::model::RobotModel;
use recording::series::Recording;

use super::{Diagnose, outputs};
use crate::exit::{Answer, Failure, Outcome};
use crate::output::{Console, Emphasis};
use crate::progress;

/// Diagnoses a recording without joints, of forces.
pub(super) fn diagnose_forces(
    options: &Diagnose,
    (base, recording): (RobotModel, Recording),
    console: &mut Console,
) -> Outcome {
    if options.apply.is_some() {
        return Err(Failure::input("--apply: forces alone do not determine tool position errors"));
    }
    if options.tolerance_mm.is_some() {
        return Err(Failure::input(
            "--tolerance-mm: forces alone do not determine tool position errors",
        ));
    }
    if options.band.is_some() {
        return Err(Failure::input(
            "--band has no effect: it is for the low-pass filter of drive torques, and only forces were recorded; leave it out",
        ));
    }
    let mut outputs = outputs(console.outputs(), &options.out);
    outputs.check(options.inputs())?;
    let spinner = progress::stages(console, "forces: phases, lines, cut");
    let found = ForceDiagnosis::of(base, &recording, options.seed.resolve())?;
    let report = found.report();
    outputs.put(&options.out.join(JSON), found.json()?);
    outputs.put(&options.out.join(MODEL), found.model_toml()?);
    outputs.put_page(&options.out.join(PAGE), found.page());
    spinner.finish_and_clear();
    console.write(
        outputs,
        "trued.diagnosis/1",
        &DiagnosisJson::of(std::slice::from_ref(&report)),
    )?;
    let head = console.paint(Emphasis::Strong, &report.verdict.replace('_', " "));
    console.say(format!("{head}: {}", report.heldout))?;
    for line in lines(&report) {
        console.say(line)?;
    }
    console.say(format!("written to {}", options.out.display()))?;
    Ok(Answer::Done)
}
