//! Output of a calibration: `trued.calibrate/1`.

use std::path::Path;

use diagnosis::gross_errors::SuspectedError;
use diagnosis::hold_out::PositionErrors;
use recording::program;
use serde::Serialize;

use super::fixed_objects::{ObjectParameter, object_parameters};
use super::models::{ApproachErrors, CalibrationResult, Outlier, RecordingErrors, StationErrors};
use super::{Tolerance, mm, sweeps_and_loads};
use crate::entries::FittedEffect;
use crate::error::Error;

/// Name of the format.
const FORMAT: &str = "trued.calibrate/1";
/// Number of bins of the histogram.
const BINS: u8 = 40;

/// A rejected calibration: `trued.calibrate/1`.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Rejection<'a> {
    faults: Vec<&'a str>,
}

impl<'a> Rejection<'a> {
    /// For these gross errors.
    #[must_use]
    pub fn of(faults: &'a [SuspectedError]) -> Self {
        Self { faults: faults.iter().map(|fault| fault.message.as_str()).collect() }
    }
}

/// Result of a calibration: `trued.calibrate/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    unit: &'static str,
    model: String,
    /// Maker, type and serial number as stated in the model, and the hash of its nominal geometry.
    robot: String,
    /// Null if no model was written.
    out: Option<String>,
    /// Reasons why the model must not be used.
    refused: Vec<String>,
    /// Null if none was stated.
    tolerance: Option<Tolerance>,
    seed: Option<u64>,
    split: String,
    poses: PoseCounts,
    heldout: PerModel<Figures>,
    heldout_errors: PerModel<Vec<f64>>,
    histogram: HistogramReport,
    by_recording: Vec<RecordingReport>,
    parameters: Vec<ParameterReport>,
    outliers: Vec<usize>,
    outlier_poses: Vec<OutlierReport>,
    undetermined: Vec<String>,
    left_open: Vec<String>,
    approach: Vec<ApproachReport>,
    stations: Vec<StationReport>,
    residuals: Vec<ResidualReport>,
    conditioning: ConditioningReport,
    targets_tool_mm: Vec<[f64; 3]>,
    things: Vec<ObjectParameter>,
    #[serde(flatten)]
    alone: sweeps_and_loads::SweepsAndLoadsReport,
    warnings: Vec<String>,
}

/// Residuals of an instrument relative to its noise.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ResidualReport {
    instrument: String,
    noise_is_stated: bool,
    /// Ratio of the residuals to the stated or assumed noise.
    factor: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ConditioningReport {
    fitted: usize,
    determined: usize,
    condition: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct PoseCounts {
    training: usize,
    heldout: usize,
    written_model: usize,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct PerModel<T> {
    nominal: T,
    calibrated: T,
    advanced: T,
}

impl<T> PerModel<T> {
    fn of(errors: &[PositionErrors; 3], of: impl Fn(&PositionErrors) -> T) -> Self {
        let [nominal, calibrated, advanced] = errors.each_ref().map(of);
        Self { nominal, calibrated, advanced }
    }
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Figures {
    mean: f64,
    median: f64,
    p95: f64,
    max: f64,
    points: usize,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ParameterReport {
    effect: &'static str,
    joint: Option<usize>,
    parameter: String,
    index: Option<usize>,
    value: f64,
    sigma: Option<f64>,
    identifiable: bool,
    moves_tool_mm: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct OutlierReport {
    recording: String,
    row: usize,
    off_mm: f64,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ApproachReport {
    joint: usize,
    rising: FiguresPerModel,
    falling: FiguresPerModel,
}

type FiguresPerModel = PerModel<Figures>;

/// Number of held-out errors between each edge and the next.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct HistogramReport {
    edges: Vec<f64>,
    counts: PerModel<Vec<usize>>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct RecordingReport {
    recording: String,
    moves: &'static str,
    heldout: FiguresPerModel,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct StationReport {
    station: usize,
    recording: String,
    heldout: PerModel<Figures>,
}

fn figures(errors: &PositionErrors) -> Figures {
    Figures {
        mean: mm(errors.mean()),
        median: mm(errors.quantile(0.5)),
        p95: mm(errors.quantile(0.95)),
        max: mm(errors.max()),
        points: errors.sorted_m.len(),
    }
}

fn station_report(found: &CalibrationResult, one: &StationErrors) -> StationReport {
    let recording = found.recording_name(one.recording).to_owned();
    StationReport { station: one.frame + 1, recording, heldout: PerModel::of(&one.errors, figures) }
}

impl CalibrationResult {
    /// The result as an object. `written`: the file to which the model was written.
    #[must_use]
    pub fn report(&self, written: Option<&Path>) -> Report {
        let training = self.split.training.iter().filter(|trains| **trains).count();
        let all = self.split.training.len();
        let targets = self.fit.surroundings.targets.iter();
        let in_mm = |errors: &PositionErrors| errors.sorted_m.iter().map(|e| mm(*e)).collect();
        Report {
            unit: "mm",
            model: self.base.file.name.clone(),
            robot: self.base.file.identity().to_string(),
            out: written.map(|path| path.display().to_string()),
            refused: self.rejection_reasons.clone(),
            tolerance: self.tolerance(),
            seed: self.seed,
            split: self.split.description.clone(),
            poses: PoseCounts { training, heldout: all - training, written_model: self.poses },
            heldout: PerModel::of(&self.errors, figures),
            heldout_errors: PerModel::of(&self.errors, in_mm),
            histogram: histogram(&self.errors),
            by_recording: recording_reports(self),
            parameters: self.entries.iter().flat_map(parameter_reports).collect(),
            outliers: self.outliers.iter().map(|outlier| outlier.row).collect(),
            outlier_poses: outlier_reports(self),
            undetermined: self.undetermined_sentences(),
            left_open: self.undetermined_by_reason(),
            approach: approach_reports(self),
            things: object_parameters(&self.fit),
            alone: self.sweeps_and_loads.report(),
            stations: self.station_errors.iter().map(|one| station_report(self, one)).collect(),
            residuals: residual_reports(self),
            conditioning: conditioning_report(self),
            targets_tool_mm: targets.map(|target| (target.value * 1e3).to_array()).collect(),
            warnings: self.warnings.clone(),
        }
    }

    /// The result as JSON.
    ///
    /// # Errors
    /// [`Error::Internal`]
    pub fn json(&self, written: Option<&Path>) -> Result<String, Error> {
        let text = program::json(FORMAT, &self.report(written)).map_err(Error::internal)?;
        Ok(text + "\n")
    }
}

fn residual_reports(found: &CalibrationResult) -> Vec<ResidualReport> {
    let CalibrationResult { campaign, fit, .. } = found;
    let reads = |place: usize| {
        campaign
            .poses
            .iter()
            .flat_map(|pose| &pose.seen)
            .any(|observation| observation.instrument == place)
    };
    let instruments = campaign.instruments.iter().zip(&fit.factors).enumerate();
    let report =
        |(_, (instrument, factor)): (usize, (&diagnosis::Instrument, &f64))| ResidualReport {
            instrument: instrument.name.clone(),
            noise_is_stated: instrument.noise_is_known,
            factor: *factor,
        };
    instruments.filter(|(place, _)| reads(*place)).map(report).collect()
}

fn conditioning_report(found: &CalibrationResult) -> ConditioningReport {
    let diagnosis::Conditioning { fitted, determined, condition } = found.fit.conditioning();
    ConditioningReport { fitted, determined, condition }
}

fn parameter_reports(entry: &FittedEffect) -> impl Iterator<Item = ParameterReport> + '_ {
    entry.parameters.iter().filter(|number| number.free).map(|number| ParameterReport {
        effect: entry.kind(),
        joint: entry.joint(),
        parameter: number.key.clone(),
        index: number.index,
        value: number.value,
        sigma: number.sigma,
        identifiable: number.sigma.is_some(),
        moves_tool_mm: mm(entry.share_m),
    })
}

fn outlier_reports(found: &CalibrationResult) -> Vec<OutlierReport> {
    let outlier = |outlier: &Outlier| OutlierReport {
        recording: found.recording_name(outlier.recording).to_owned(),
        row: outlier.row,
        off_mm: mm(outlier.error_m),
    };
    found.outliers.iter().map(outlier).collect()
}

fn approach_reports(found: &CalibrationResult) -> Vec<ApproachReport> {
    let report = |one: &ApproachErrors| {
        let side = |k: usize| {
            let [nominal, calibrated, advanced] = one.errors.each_ref().map(|e| figures(&e[k]));
            PerModel { nominal, calibrated, advanced }
        };
        ApproachReport { joint: one.joint + 1, rising: side(0), falling: side(1) }
    };
    found.approach_errors.iter().map(report).collect()
}

/// Equal bins from zero to the largest error of all models.
fn histogram(errors: &[PositionErrors; 3]) -> HistogramReport {
    let largest = errors.iter().map(|errors| mm(errors.max())).fold(0.0, f64::max);
    let width = largest / f64::from(BINS);
    let edges: Vec<f64> = (0..=BINS).map(|k| f64::from(k) * width).collect();
    let counts = |errors: &PositionErrors| {
        let mut counts = vec![0; usize::from(BINS)];
        for error in &errors.sorted_m {
            let bin = edges[1..].iter().position(|edge| mm(*error) < *edge);
            counts[bin.unwrap_or(usize::from(BINS) - 1)] += 1;
        }
        counts
    };
    HistogramReport { counts: PerModel::of(errors, counts), edges }
}

fn recording_reports(found: &CalibrationResult) -> Vec<RecordingReport> {
    let report = |one: &RecordingErrors| RecordingReport {
        recording: found.recording_name(one.recording).to_owned(),
        moves: motion_kind(one.planar),
        heldout: PerModel::of(&one.errors, figures),
    };
    found.recording_errors.iter().map(report).collect()
}

/// Kind of motion of the tool between the poses of a recording.
pub(super) fn motion_kind(planar: bool) -> &'static str {
    if planar { "planar" } else { "spatial" }
}
