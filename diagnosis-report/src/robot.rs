//! Selection of the diagnosis (positions, torques) for the recordings of a robot, and its results.

use std::path::Path;

use diagnosis::diagnose::{Diagnosis, ScreeningReport, ThinnedRecordings, screen_recordings};
use diagnosis::gross_errors::SuspectedError;
use diagnosis::progress::{Listener, Progress, Stage};
use diagnosis::{AddedEffect, campaign_import, torque};
use recording::model::RobotModel;
use recording::series::{HeldOut, Recording};
use report::Page;

use crate::drives::TorqueDiagnosis;
use crate::entries::{FittedEffect, fitted_effects, updated_file};
use crate::error::Error;
use crate::page;
use crate::result::{Report, json};
use crate::tolerance::Tolerance;

/// Settings of a diagnosis and of its report.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Seed of the split into training and test rows. Default 0.
    pub seed: u64,
    /// Torque and motion are compared below this frequency, Hz; above 0, and only with recorded torques. Default: none, which is 40 or a tenth of the sampling rate.
    pub band_hz: Option<f64>,
    /// Least number of measured rows for a diagnosis of positions; from 1. Default 30. Origin: a choice; fewer cannot be split into training and test
    /// rows.
    pub rows_least: usize,
    /// Largest number of findings that are reported one by one; those with the smallest effects on the measurement are `minor`. From 1. Default 20.
    /// Origin: a choice, as many as a person can read and act on; no fit depends on it.
    pub findings_most: usize,
    /// Allowed error of the tool, mm; above 0. Default: none, so that no tolerance is evaluated. It affects neither fits nor the verdict.
    pub tolerance_mm: Option<f64>,
    /// Least expected log-likelihood ratio of one run of a proposed experiment; no unit, above 0. Default 0.25. Origin: alternatives are distinguished
    /// at a ratio of 5, and nobody runs an experiment more than twenty times.
    pub experiment_separation_least: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 0,
            band_hz: None,
            rows_least: 30,
            findings_most: 20,
            tolerance_mm: None,
            experiment_separation_least: 0.25,
        }
    }
}

/// Message if a tolerance cannot be evaluated.
const NO_POSITION: &str =
    "a tool tolerance was given, but only drive torques were recorded; measure the tool";

/// Message if a band would have no effect.
const NO_TORQUE: &str = "a band (--band) has no effect: it is for the low-pass filter of drive torques, and none were recorded; leave it out";

/// Diagnosis of the positions and drive torques of a robot.
pub struct RobotDiagnosis {
    pub(crate) base: RobotModel,
    pub(crate) settings: Settings,
    /// Result for positions; `None` if they cannot be diagnosed, or were not recorded.
    pub diagnosis: Option<Diagnosis>,
    /// The model's effects including the findings.
    entries: Vec<FittedEffect>,
    /// Reasons why positions cannot be diagnosed.
    pub(crate) objections: Vec<String>,
    /// Observations on the recordings before any fit, and how they were handled.
    pub(crate) notes: Vec<String>,
    pub(crate) rows: usize,
    /// Whether the recordings contain positions.
    has_positions: bool,
    /// Result for drive torques, if they were recorded.
    drives: Option<TorqueDiagnosis>,
}

/// Diagnoses `base` by recordings of one robot; `listener` is told of the progress, by [`Stage::TORQUES`] if torques were recorded,
/// then by [`Stage::POSITIONS`] if positions were.
///
/// # Errors
/// Recordings that cannot be used with this model.
pub fn diagnose(
    base: RobotModel,
    mut recordings: Vec<Recording>,
    settings: &Settings,
    listener: Listener<'_>,
) -> Result<RobotDiagnosis, Error> {
    let settings = *settings;
    let drives = TorqueDiagnosis::diagnose_if_recorded(
        &base,
        &mut recordings,
        settings.band_hz,
        settings.seed,
        listener,
    )?;
    if drives.is_none() && settings.band_hz.is_some() {
        return Err(Error::input(NO_TORQUE));
    }
    if drives.is_some() && recordings.is_empty() {
        if settings.tolerance_mm.is_some() {
            return Err(Error::input(NO_POSITION));
        }
        return Ok(RobotDiagnosis {
            drives,
            has_positions: false,
            ..RobotDiagnosis::empty(base, settings)
        });
    }
    let positions = RobotDiagnosis::diagnose_positions(base, recordings, settings, listener)?;
    Ok(RobotDiagnosis { drives, ..positions })
}

impl RobotDiagnosis {
    fn empty(base: RobotModel, settings: Settings) -> Self {
        Self {
            base,
            settings,
            diagnosis: None,
            entries: Vec::new(),
            objections: Vec::new(),
            notes: Vec::new(),
            rows: 0,
            has_positions: true,
            drives: None,
        }
    }

    fn diagnose_positions(
        base: RobotModel,
        mut recordings: Vec<Recording>,
        settings: Settings,
        listener: Listener<'_>,
    ) -> Result<Self, Error> {
        listener(Stage::Screening, Progress::Begun);
        let arm = base.physics.arm;
        let has_positions = crate::drives::positions_are_recorded(&recordings);
        let unjudged = |base, objections, notes, rows| {
            Ok(Self { objections, notes, rows, has_positions, ..Self::empty(base, settings) })
        };
        let ScreeningReport { notes, doubts } = screen_recordings(&arm, &mut recordings);
        if !doubts.is_empty() {
            return unjudged(base, doubts, notes, 0);
        }
        let thinned = ThinnedRecordings::select(&arm, &recordings).map_err(Error::input)?;
        let rows = thinned.rows;
        let objections = self::position_objections(&base, &thinned, settings.rows_least);
        if !objections.is_empty() {
            return unjudged(base, objections, notes, rows);
        }
        let is_said = |recording: &Recording| recording.metadata.heldout != HeldOut::Unspecified;
        let held = recordings.iter().any(is_said);
        let held = held.then(|| campaign_import::held_out(&thinned.campaign, &recordings));
        drop(recordings);
        let diagnosis = thinned.diagnose(&base.physics, &base.sigma, held, settings.seed, listener);
        if let Some(objection) = diagnosis.reason_not_to_claim() {
            return unjudged(base, vec![objection], notes, rows);
        }
        let chosen: Vec<AddedEffect> = diagnosis
            .findings
            .iter()
            .chain(&diagnosis.candidates)
            .map(|finding| AddedEffect {
                effect: finding.effect_index,
                gain: finding.gain,
                settings: finding.settings.clone(),
            })
            .collect();
        let entries = fitted_effects(&base, &diagnosis.fit, &chosen, &[])?;
        let diagnosis = Some(diagnosis);
        let empty = Self::empty(base, settings);
        Ok(Self { diagnosis, entries, notes, rows, has_positions, ..empty })
    }

    /// The tool's held-out errors compared with the tolerance, if one was stated.
    pub(crate) fn tolerance(&self) -> Option<Tolerance> {
        self.settings.tolerance_mm.map(|mm| Tolerance::of(mm, self.diagnosis.as_ref()))
    }

    /// Result for the torques, if they could be diagnosed.
    pub(crate) fn torques(&self) -> Option<&torque::Diagnosis> {
        self.drives.as_ref().and_then(|drives| drives.result.as_ref().ok())
    }

    /// Reports of the recorded domains: positions first, then torques.
    #[must_use]
    pub fn reports(&self) -> Vec<Report> {
        let of_positions = self.has_positions || self.drives.is_none();
        let mut reports: Vec<Report> = of_positions.then(|| Report::of(self)).into_iter().collect();
        if let Some(drives) = &self.drives {
            reports.push(Report::of_drives(&self.base, drives, &[], self.settings.seed));
        }
        let most = self.settings.findings_most;
        reports.into_iter().map(|report| report.limited_to(most)).collect()
    }

    /// The result as `trued.diagnosis/1`.
    ///
    /// # Errors
    /// [`Error::Internal`]
    pub fn json(&self) -> Result<String, Error> {
        json(&self.reports())
    }

    /// The page. `dir`: the folder of `diagnosis.json` and [`MODEL`](crate::MODEL), for the commands shown on the page.
    #[must_use]
    pub fn page(&self, dir: &Path) -> Page {
        page::render(self, &self.reports(), dir)
    }

    /// The model with the findings, as text of a model file.
    ///
    /// # Errors
    /// [`Error::Internal`]
    pub fn model_toml(&self) -> Result<String, Error> {
        let mut file = updated_file(&self.base, &self.entries);
        if let Some(drives) = &self.drives {
            file.effects = drives.effects_with_findings(&self.base, &file.effects);
        }
        let by = format!("trued diagnose {}", env!("CARGO_PKG_VERSION"));
        file.meta.insert("diagnosed_by".to_owned(), by.into());
        let base = format!("{}, {:016x}", self.base.file.name, self.base.hash);
        file.meta.insert("diagnosed_from_model".to_owned(), base.into());
        let robot = self.base.file.identity().to_string();
        file.meta.insert("diagnosed_robot".to_owned(), robot.into());
        let text = file.to_toml();
        RobotModel::parse("the diagnosed model", &text).map_err(Error::internal)?;
        Ok(text)
    }
}

/// Reasons why positions cannot be diagnosed with these recordings.
fn position_objections(
    base: &RobotModel,
    thinned: &ThinnedRecordings,
    rows_min: usize,
) -> Vec<String> {
    let rows = thinned.rows;
    if rows < rows_min {
        return vec![format!(
            "only {rows} rows were measured, expected at least {rows_min}; record more"
        )];
    }
    if !thinned.moves {
        return vec!["no joint moves in the recording; record a motion of the arm".to_owned()];
    }
    thinned
        .faults(&base.physics)
        .into_iter()
        .map(|SuspectedError { message, .. }| message)
        .collect()
}
