//! Output of `trued calibrate`: text and JSON.

use diagnosis::proof::Errors;
use report::{TextTable, count, fixed, significant};
use serde::Serialize;

use super::Calibrate;
use super::alone::Alone;
use super::found::{Found, MODELS, Stationed};
use super::things::{Thing, lines, things};
use crate::table::on_stdout;
use diagnosis_report::entries::Entry;

/// Effects that move the tool by less than this share of what the largest does are not told on the console.
const TOLD: f64 = 0.02;
/// Effects told of one joint.
const EFFECTS: usize = 4;
/// Outliers told by name.
const NAMED: usize = 2;
/// Bins of the histogram.
const BINS: u8 = 40;

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Report {
    unit: &'static str,
    model: String,
    /// Maker, type and serial number as far as the model states them, and the hash of its nominal geometry.
    robot: String,
    /// None where no model was written.
    out: Option<String>,
    /// Why the model is not to be used.
    refused: Vec<String>,
    /// None where none was stated.
    tolerance: Option<super::Tolerance>,
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
    things: Vec<Thing>,
    #[serde(flatten)]
    alone: super::alone::Report,
    warnings: Vec<String>,
}

/// The residuals of an instrument against its noise.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ResidualReport {
    instrument: String,
    noise_is_stated: bool,
    /// Residuals against the noise that is stated, or else assumed.
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

/// How many held-out errors lie between each edge and the next.
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

/// Metres in mm.
pub(super) fn mm(metres: f64) -> f64 {
    metres * 1e3
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

fn station(found: &Found, one: &Stationed) -> StationReport {
    let recording = found.recording(one.recording).to_owned();
    StationReport { station: one.frame + 1, recording, heldout: Heldout::of(&one.errors, figures) }
}

impl Report {
    pub(super) fn of(command: &Calibrate, found: &Found, alone: &Alone) -> Self {
        let training = found.split.training.iter().filter(|trains| **trains).count();
        let all = found.split.training.len();
        let targets = found.last.surroundings.targets.iter();
        let in_mm = |errors: &Errors| errors.sorted_m.iter().map(|e| mm(*e)).collect();
        Self {
            unit: "mm",
            model: found.base.file.name.clone(),
            robot: found.base.file.identity().to_string(),
            out: command.is_written(found).then(|| command.out.display().to_string()),
            refused: found.refused.clone(),
            tolerance: command.tolerance(found),
            seed: found.seed,
            split: found.split.says.clone(),
            poses: Poses { training, heldout: all - training, written_model: found.poses },
            heldout: Heldout::of(&found.errors, figures),
            heldout_errors: Heldout::of(&found.errors, in_mm),
            histogram: histogram(&found.errors),
            by_recording: by_recording(found),
            parameters: found.entries.iter().flat_map(parameters).collect(),
            outliers: found.outliers.iter().map(|outlier| outlier.row).collect(),
            outlier_poses: outliers(found),
            undetermined: found.undetermined(),
            left_open: found.left_open(),
            approach: approach(found),
            things: things(&found.last),
            alone: alone.report(),
            stations: found.stationed.iter().map(|one| station(found, one)).collect(),
            residuals: residuals(found),
            conditioning: conditioning(found),
            targets_tool_mm: targets.map(|target| (target.value * 1e3).to_array()).collect(),
            warnings: found.warnings.clone(),
        }
    }
}

fn residuals(found: &Found) -> Vec<ResidualReport> {
    let Found { campaign, last, .. } = found;
    let reads = |place: usize| {
        campaign.poses.iter().flat_map(|pose| &pose.seen).any(|seen| seen.instrument == place)
    };
    let of = campaign.instruments.iter().zip(&last.factors).enumerate();
    let report =
        |(_, (instrument, factor)): (usize, (&diagnosis::Instrument, &f64))| ResidualReport {
            instrument: instrument.name.clone(),
            noise_is_stated: instrument.noise_is_known,
            factor: *factor,
        };
    of.filter(|(place, _)| reads(*place)).map(report).collect()
}

fn conditioning(found: &Found) -> ConditioningReport {
    let diagnosis::Conditioning { fitted, determined, condition } = found.last.conditioning();
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

fn outliers(found: &Found) -> Vec<OutlierReport> {
    let outlier = |outlier: &super::found::Outlier| OutlierReport {
        recording: found.recording(outlier.recording).to_owned(),
        row: outlier.row,
        off_mm: mm(outlier.off_m),
    };
    found.outliers.iter().map(outlier).collect()
}

fn approach(found: &Found) -> Vec<ApproachReport> {
    let of = |one: &super::found::Approached| {
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

fn by_recording(found: &Found) -> Vec<RecordingReport> {
    let of = |one: &super::found::OfRecording| RecordingReport {
        recording: found.recording(one.recording).to_owned(),
        moves: moves_in(one.planar),
        heldout: Heldout::of(&one.errors, figures),
    };
    found.of_recordings.iter().map(of).collect()
}

/// How the tool moves between the poses of a recording.
pub(super) fn moves_in(planar: bool) -> &'static str {
    if planar { "planar" } else { "spatial" }
}

/// The lines on the console.
pub(super) fn told(command: &Calibrate, found: &Found, alone: &Alone) -> String {
    let mut table = TextTable::new(["held out, mm", "mean", "median", "95 %", "largest"]);
    for (name, errors) in MODELS.iter().zip(&found.errors) {
        let of = [errors.mean(), errors.quantile(0.5), errors.quantile(0.95), errors.max()];
        let cells = of.map(|error| fixed(mm(error), 3));
        table = table.row(std::iter::once((*name).to_owned()).chain(cells));
    }
    let mut text = format!("{}: {}\n{}", found.base.file.name, found.split.says, on_stdout(&table));
    text += "found, by how much it moves the tool (root mean square, mm)\n";
    for line in per_joint(found) {
        text += &format!("  {line}\n");
    }
    for line in lines(&things(&found.last)).into_iter().chain(alone.lines()) {
        text += &format!("  {line}\n");
    }
    for sentence in found.nests() {
        text += &format!("frame     {sentence}\n");
    }
    for sentence in found.left_open() {
        text += &format!("open      {sentence}\n");
    }
    let rest = |all: usize| if all > NAMED { "; …" } else { "" };
    if !found.outliers.is_empty() {
        let row = |outlier: &super::found::Outlier| {
            let name = found.recording(outlier.recording);
            format!("{name} row {} by {} mm", outlier.row, significant(mm(outlier.off_m), 2))
        };
        let some: Vec<String> = found.outliers.iter().take(NAMED).map(row).collect();
        let many = count(found.outliers.len(), "outlier");
        text += &format!("off       {many}: {}{}\n", some.join("; "), rest(found.outliers.len()));
    }
    if let Some(tolerance) = command.tolerance(found) {
        text += &format!("tolerance {}\n", in_tolerance(tolerance));
    }
    let poses = count(found.poses, "pose");
    text += &format!("model     {}, fitted to {poses}", command.written(found));
    if command.is_written(found) {
        text += &format!("\ncheck     {}", check(command, found));
    }
    text
}

/// The verdict against a tolerance.
pub(super) fn in_tolerance(tolerance: super::Tolerance) -> String {
    let super::Tolerance { tolerance_mm, p95_mm, met } = tolerance;
    let word = if met { "met" } else { "not met" };
    format!(
        "{} mm {word}: 95 of 100 held-out errors stay within {} mm",
        significant(tolerance_mm, 3),
        significant(p95_mm, 3)
    )
}

/// The smallest noise that a check is planned with, mm: no instrument is better.
const LEAST_SIGMA_MM: f64 = 1e-4;

/// The command that plans a check with this model: the targets where the fit found them, and its held-out error per axis as the noise.
pub(super) fn check(command: &Calibrate, found: &Found) -> String {
    let [.., advanced] = &found.errors;
    let square = advanced.sorted_m.iter().map(|error| error * error).sum::<f64>();
    let axis_m = (square / (3 * advanced.sorted_m.len()).max(1) as f64).sqrt();
    let out = command.out.display();
    let mut text = format!(
        "trued plan --check --model {out} --sigma-mm {:.4}",
        mm(axis_m).max(LEAST_SIGMA_MM)
    );
    for target in &found.last.surroundings.targets {
        let [x, y, z] = (target.value * 1e3).to_array().map(|mm| format!("{mm:.3}"));
        // A minus sign that the option takes: no typographic one.
        text += &format!(" --target={x},{y},{z}");
    }
    if !found.last.surroundings.targets.is_empty() {
        text += " --targets-known";
    }
    text
}

/// Lines of the effects that matter, per joint, those that move the tool most first.
fn per_joint(found: &Found) -> Vec<String> {
    let mut told: Vec<&Entry> = found.entries.iter().filter(|entry| !entry.is_empty()).collect();
    told.sort_by(|a, b| b.share_m.total_cmp(&a.share_m));
    let least = TOLD * told.first().map_or(0.0, |entry| entry.share_m);
    let mut joints: Vec<Option<usize>> = Vec::new();
    for entry in &told {
        if !joints.contains(&entry.joint()) {
            joints.push(entry.joint());
        }
    }
    let line = |joint: Option<usize>| {
        let of = told.iter().filter(|entry| entry.joint() == joint && entry.share_m >= least);
        let words = of.map(|entry| format!("{} {}", words(entry.kind()), moves(entry)));
        let words: Vec<String> = words.take(EFFECTS).collect();
        let whose = joint.map_or("robot".to_owned(), |joint| format!("joint {joint}"));
        (!words.is_empty()).then(|| format!("{whose}: {}", words.join(", ")))
    };
    joints.into_iter().filter_map(line).collect()
}

/// `axis_tilt` as people write it.
pub(super) fn words(kind: &str) -> String {
    match kind {
        "joint_polynomial" => "a remainder without a name".to_owned(),
        _ => kind.replace('_', " "),
    }
}

fn moves(entry: &Entry) -> String {
    significant(mm(entry.share_m), 2)
}
