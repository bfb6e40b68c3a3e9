//! Force domain of `trued diagnose`: recordings of forces (or accelerations) without joints.
//!
//! Writes the same three files as for a robot, all or none. Effects that were not compared are not reported.

use std::path::PathBuf;

use diagnosis::force::{self, Diagnosis, DiagnosisError, Finding};
use recording::model::{EffectEntry, RobotModel, SiParameter};
use recording::series::Recording;

use report::Page;

use crate::drives::with_findings;
use crate::error::Error;
use crate::page;
use crate::result::{Report, json};

/// Diagnosis of a recording that contains only forces.
pub struct ForceDiagnosis {
    pub(crate) base: RobotModel,
    pub(crate) result: Result<Diagnosis, DiagnosisError>,
    pub(crate) seed: u64,
    /// The recording, for the commands on the page.
    pub(crate) file: PathBuf,
    /// Number of teeth of the cutter; 0 if the recording does not state it.
    pub(crate) teeth: u32,
}

impl ForceDiagnosis {
    /// Diagnoses a recording of forces (or accelerations) at the tool, without any joint.
    ///
    /// # Errors
    /// A model whose cutting effects cannot be used.
    pub fn of(base: RobotModel, recording: &Recording, seed: u64) -> Result<Self, Error> {
        let with_cutting = base.with_cutting().map_err(Error::input)?;
        let sigma: Vec<Vec<f64>> = base.sigma.iter().chain(&base.cutting_sigma).cloned().collect();
        let result = force::diagnose(&with_cutting, &sigma, recording);
        let teeth = recording.metadata.cut.as_ref().map_or(0, |cut| cut.teeth);
        Ok(Self { base, result, seed, file: recording.file.clone(), teeth })
    }

    /// The report of the force domain.
    #[must_use]
    pub fn report(&self) -> Report {
        Report::of_forces(self)
    }

    /// The result as `trued.diagnosis/1`.
    ///
    /// # Errors
    /// [`Error::Internal`]
    pub fn json(&self) -> Result<String, Error> {
        json(std::slice::from_ref(&self.report()))
    }

    /// The page.
    #[must_use]
    pub fn page(&self) -> Page {
        page::forces::render(self, &self.report())
    }

    /// The model with the findings, and its own refitted parameters.
    ///
    /// # Errors
    /// [`Error::Internal`]
    pub fn model_toml(&self) -> Result<String, Error> {
        let mut file = self.base.file.clone();
        if let Some(compared) =
            self.result.iter().find_map(|found| found.cut_comparison.as_ref().ok())
        {
            let findings = compared.findings.iter().chain(&compared.candidates);
            let refits = compared.refits.iter();
            file.effects = with_findings(&self.base, &file.effects, refits, findings);
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
        RobotModel::parse("the diagnosed model", &text).map_err(Error::internal)?;
        Ok(text)
    }
}
