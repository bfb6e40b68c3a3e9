//! Output of a calibration: `trued.calibrate/1`.

use std::path::Path;

use diagnosis::gross::Suspicion;
use diagnosis::proof::Errors;
use recording::program;
use serde::Serialize;

use super::around::{Number, numbers};
use super::calibrated::{Approached, Calibrated, OfRecording, Outlier, Stationed};
use super::{Tolerance, mm, sweeps_and_loads};
use crate::entries::Entry;
use crate::error::Error;

/// Name of the format.
const FORMAT: &str = "trued.calibrate/1";
/// Number of bins of the histogram.
const BINS: u8 = 40;

/// A rejected calibration: `trued.calibrate/1`.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Refused<'a> {
    faults: Vec<&'a str>,
}

impl<'a> Refused<'a> {
    /// For these gross errors.
    #[must_use]
    pub fn of(faults: &'a [Suspicion]) -> Self {
        Self { faults: faults.iter().map(|fault| fault.says.as_str()).collect() }
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
    poses: Poses,
    heldout: Heldout<Figures>,
    heldout_errors: Heldout<Vec<f64>>,
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
    things: Vec<Number>,
    #[serde(flatten)]
    alone: sweeps_and_loads::Report,
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
struct Poses {
    training: usize,
    heldout: usize,
    written_model: usize,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Heldout<T> {
    nominal: T,
    calibrated: T,
    advanced: T,
}

impl<T> Heldout<T> {
    fn of(errors: &[Errors; 3], of: impl Fn(&Errors) -> T) -> Self {
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
    rising: ByModel,
    falling: ByModel,
}

type ByModel = Heldout<Figures>;

/// Number of held-out errors between each edge and the next.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct HistogramReport {
    edges: Vec<f64>,
    counts: Heldout<Vec<usize>>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct RecordingReport {
    recording: String,
    moves: &'static str,
    heldout: ByModel,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct StationReport {
    station: usize,
    recording: String,
    heldout: Heldout<Figures>,
}

fn figures(errors: &Errors) -> Figures {
    Figures {
        mean: mm(errors.mean()),
        median: mm(errors.quantile(0.5)),
        p95: mm(errors.quantile(0.95)),
        max: mm(errors.max()),
        points: errors.sorted_m.len(),
    }
}

fn station(found: &Calibrated, one: &Stationed) -> StationReport {
    let recording = found.recording(one.recording).to_owned();
    StationReport { station: one.frame + 1, recording, heldout: Heldout::of(&one.errors, figures) }
}

impl Calibrated {
    /// The result as an object. `written`: the file to which the model was written.
    #[must_use]
    pub fn report(&self, written: Option<&Path>) -> Report {
        let training = self.split.training.iter().filter(|trains| **trains).count();
        let all = self.split.training.len();
        let targets = self.fit.surroundings.targets.iter();
        let in_mm = |errors: &Errors| errors.sorted_m.iter().map(|e| mm(*e)).collect();
        Report {
            unit: "mm",
            model: self.base.file.name.clone(),
            robot: self.base.file.identity().to_string(),
            out: written.map(|path| path.display().to_string()),
            refused: self.refused.clone(),
            tolerance: self.tolerance(),
            seed: self.seed,
            split: self.split.says.clone(),
            poses: Poses { training, heldout: all - training, written_model: self.poses },
            heldout: Heldout::of(&self.errors, figures),
            heldout_errors: Heldout::of(&self.errors, in_mm),
            histogram: histogram(&self.errors),
            by_recording: by_recording(self),
            parameters: self.entries.iter().flat_map(parameters).collect(),
            outliers: self.outliers.iter().map(|outlier| outlier.row).collect(),
            outlier_poses: outliers(self),
            undetermined: self.undetermined(),
            left_open: self.left_open(),
            approach: approach(self),
            things: numbers(&self.fit),
            alone: self.sweeps_and_loads.report(),
            stations: self.stationed.iter().map(|one| station(self, one)).collect(),
            residuals: residuals(self),
            conditioning: conditioning(self),
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

fn residuals(found: &Calibrated) -> Vec<ResidualReport> {
    let Calibrated { campaign, fit, .. } = found;
    let reads = |place: usize| {
        campaign.poses.iter().flat_map(|pose| &pose.seen).any(|seen| seen.instrument == place)
    };
    let of = campaign.instruments.iter().zip(&fit.factors).enumerate();
    let report =
        |(_, (instrument, factor)): (usize, (&diagnosis::Instrument, &f64))| ResidualReport {
            instrument: instrument.name.clone(),
            noise_is_stated: instrument.noise_is_known,
            factor: *factor,
        };
    of.filter(|(place, _)| reads(*place)).map(report).collect()
}

fn conditioning(found: &Calibrated) -> ConditioningReport {
    let diagnosis::Conditioning { fitted, determined, condition } = found.fit.conditioning();
    ConditioningReport { fitted, determined, condition }
}

fn parameters(entry: &Entry) -> impl Iterator<Item = ParameterReport> + '_ {
    entry.numbers.iter().filter(|number| number.free).map(|number| ParameterReport {
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

fn outliers(found: &Calibrated) -> Vec<OutlierReport> {
    let outlier = |outlier: &Outlier| OutlierReport {
        recording: found.recording(outlier.recording).to_owned(),
        row: outlier.row,
        off_mm: mm(outlier.off_m),
    };
    found.outliers.iter().map(outlier).collect()
}

fn approach(found: &Calibrated) -> Vec<ApproachReport> {
    let of = |one: &Approached| {
        let side = |k: usize| {
            let [nominal, calibrated, advanced] = one.errors.each_ref().map(|e| figures(&e[k]));
            Heldout { nominal, calibrated, advanced }
        };
        ApproachReport { joint: one.joint + 1, rising: side(0), falling: side(1) }
    };
    found.approached.iter().map(of).collect()
}

/// Equal bins from zero to the largest error of all models.
fn histogram(errors: &[Errors; 3]) -> HistogramReport {
    let largest = errors.iter().map(|errors| mm(errors.max())).fold(0.0, f64::max);
    let width = largest / f64::from(BINS);
    let edges: Vec<f64> = (0..=BINS).map(|k| f64::from(k) * width).collect();
    let counts = |errors: &Errors| {
        let mut counts = vec![0; usize::from(BINS)];
        for error in &errors.sorted_m {
            let bin = edges[1..].iter().position(|edge| mm(*error) < *edge);
            counts[bin.unwrap_or(usize::from(BINS) - 1)] += 1;
        }
        counts
    };
    HistogramReport { counts: Heldout::of(errors, counts), edges }
}

fn by_recording(found: &Calibrated) -> Vec<RecordingReport> {
    let of = |one: &OfRecording| RecordingReport {
        recording: found.recording(one.recording).to_owned(),
        moves: moves_in(one.planar),
        heldout: Heldout::of(&one.errors, figures),
    };
    found.of_recordings.iter().map(of).collect()
}

/// Kind of motion of the tool between the poses of a recording.
pub(super) fn moves_in(planar: bool) -> &'static str {
    if planar { "planar" } else { "spatial" }
}
