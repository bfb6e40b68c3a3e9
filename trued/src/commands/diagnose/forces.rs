//! Force domain of `trued diagnose`: recordings of forces (or accelerations) without joints.
//!
//! Promises: the same three files as for a robot, together or not at all. Never: a claim of what was not compared.

use diagnosis::force::{self, Diagnosis, Doubt, Finding};
use recording::model::{EffectEntry, RobotModel, SiParameter};
use recording::series::Recording;

use super::drives::written;
use super::{Diagnose, JSON, MODEL, PAGE, outputs, page, told};
use crate::exit::{Answer, Failure, Outcome};
use crate::output::{Console, Paint};

/// What was found in the forces.
pub(super) struct Forces {
    pub(super) base: RobotModel,
    pub(super) result: Result<Diagnosis, Doubt>,
    pub(super) seed: u64,
}

/// Diagnoses a recording without joints, of forces.
pub(super) fn alone(
    asked: &Diagnose,
    (base, recording): (RobotModel, Recording),
    console: &mut Console,
) -> Outcome {
    if asked.apply.is_some() {
        return Err(Failure::input("--apply: forces alone say nothing of where the tool is"));
    }
    let mut outputs = outputs(console.outputs(), &asked.out);
    outputs.check(asked.inputs())?;
    let seed = asked.seed.settle();
    let found = Forces::of(base, &recording, seed)?;
    let report = told::Report::of_forces(&found);
    let reports = std::slice::from_ref(&report);
    outputs.put(&asked.out.join(JSON), told::json(reports)?);
    outputs.put(&asked.out.join(MODEL), found.model()?);
    outputs.put_page(&asked.out.join(PAGE), page::forces::render(&found, &report));
    console.write(outputs, "trued.diagnosis/1", &told::Whole::of(reports))?;
    let head = console.paint(Paint::Strong, &report.verdict.replace('_', " "));
    console.say(format!("{head}: {}", report.heldout))?;
    for line in told::lines(&report) {
        console.say(line)?;
    }
    console.say(format!("written to {}", asked.out.display()))?;
    Ok(Answer::Done)
}

impl Forces {
    /// Diagnoses a recording of forces alone.
    pub(super) fn of(base: RobotModel, recording: &Recording, seed: u64) -> Result<Self, Failure> {
        let with_cutting = base.with_cutting().map_err(Failure::input)?;
        let sigma: Vec<Vec<f64>> = base.sigma.iter().chain(&base.cutting_sigma).cloned().collect();
        let result = force::diagnose(&with_cutting, &sigma, recording);
        Ok(Self { base, result, seed })
    }

    /// The model with what was found, and its own numbers as they were fitted along.
    fn model(&self) -> Result<String, Failure> {
        let mut file = self.base.file.clone();
        if let Some(compared) = self.result.iter().find_map(|found| found.compared.as_ref().ok()) {
            let findings = compared.findings.iter().chain(&compared.candidates);
            let refits = compared.refits.iter();
            file.effects = written(&self.base, &file.effects, refits, findings);
        }
        for finding in self.result.iter().flat_map(|found| &found.findings) {
            if let Finding::Bias { force, sigma, .. } = finding {
                let bias = SiParameter { stem: "bias", values: force, sigma: Some(sigma) };
                let arm = &self.base.physics.arm;
                file.effects.extend(EffectEntry::from_si(arm, "wrench_bias", None, &[bias]));
            }
        }
        let by = format!("trued diagnose {}", env!("CARGO_PKG_VERSION"));
        file.meta.insert("diagnosed_by".to_owned(), by.into());
        let text = file.to_toml();
        RobotModel::parse("the diagnosed model", &text).map_err(Failure::system)?;
        Ok(text)
    }
}
