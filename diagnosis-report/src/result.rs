//! Output of a diagnosis: `trued.diagnosis/1` and text.
//!
//! Keys, units and signs as documented in docs/reference/results.md; a revised effect is reported as the difference. Only fitted values are reported.

mod cut;
mod drives;
mod file;
pub(crate) mod force_action;
mod forces;
mod lines;

use std::collections::BTreeMap;

use diagnosis::diagnose::experiment::ProposedExperiment;
use diagnosis::diagnose::{Diagnosis, Finding, MapCell, Verdict, sentences};
use diagnosis::hypothesis::parameter_key;
use diagnosis::torque::JointValidation;
use physics::spec::{Count, Range};
use physics::{AnyEffect, Arm, JointKind};
use report::significant;
use serde::Serialize;

pub use file::DiagnosisJson;
pub(crate) use file::json;
pub(crate) use force_action::Action;
pub use lines::lines;

use crate::robot::RobotDiagnosis;
use crate::tolerance::Tolerance;

/// Coverage factor of a 95 % interval, in standard uncertainties.
const NINETY_FIVE: f64 = 1.96;
/// A remaining probability above this is listed as an alternative of its own; less is rounding.
const LEAST_LISTED: f64 = 1e-6;
/// mm per m, mrad per rad.
const MILLI: f64 = 1e3;

/// Result of one domain: `trued.diagnosis/1` (docs/reference/results.md).
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "the contract's keys")]
pub struct Report {
    /// `consistent`, `missing_physics`, `unknown_structure` or `undetermined`.
    pub verdict: &'static str,
    /// `position`, `torque` or `force`.
    pub domain: &'static str,
    /// Unit of every root mean square and size.
    pub unit: &'static str,
    /// Number of rows in use.
    pub samples: usize,
    /// RMS of the measured values about their means.
    pub signal_rms: f64,
    band_Hz: Option<[f64; 2]>,
    /// RMS of the noise, estimated from the residual.
    pub noise_rms: f64,
    /// RMS error on held-out rows with the given model; null if nothing was held out.
    pub heldout_rms_before: Option<f64>,
    /// RMS error on held-out rows with the findings.
    pub heldout_rms_after: Option<f64>,
    /// Description of the held-out rows.
    pub heldout: String,
    /// The tool's held-out errors compared with the tolerance; null if none was stated, and for torques and forces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Tolerance>,
    /// Claimed effects, with a probability of at least one half each. At most [`Settings::findings_most`](crate::Settings::findings_most).
    pub findings: Vec<ReportedFinding>,
    /// Also claimed; each has a smaller effect on the measurement than any of `findings`.
    pub minor: Vec<ReportedFinding>,
    /// Effects that are not claimed, although a part of the deviation correlates with them.
    pub candidates: Vec<ReportedFinding>,
    /// How the reduction of the held-out error is attributed to the findings, one after the other.
    attribution: &'static str,
    /// Description of the motion or load that would distinguish the alternatives.
    pub next_experiment: Option<String>,
    experiment: Option<ProposedExperimentReport>,
    /// The step for what was found, for page and text; it takes precedence over `next_experiment`.
    #[serde(skip)]
    pub(crate) action: Option<Action>,
    pub(crate) not_tested: Vec<UntestedEffect>,
    pub(crate) unexplained: Option<Unexplained>,
    pub(crate) map: Vec<MapCellReport>,
    /// Validation of each joint, in the torque domain.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) joints: Vec<JointErrors>,
    /// Phases of the tool's engagement, in the force domain.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) phases: Vec<forces::PhaseEntry>,
    /// Spectral lines of the cut, in the force domain.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) tones: Vec<forces::SpectralLineEntry>,
    /// How the data were processed.
    pub notes: Vec<String>,
    seed: u64,
}

/// A finding in file units.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ReportedFinding {
    /// Name of the effect, as in model files.
    pub effect: &'static str,
    /// 1-based; null for effects of the whole robot.
    pub joint: Option<usize>,
    /// `new`, or `revised` where the model has the effect with another value.
    pub change: &'static str,
    /// Posterior probability; null if not computed.
    pub confidence: Option<f64>,
    /// Parameters by key, as in model files; for a revised effect the difference.
    pub parameters: BTreeMap<String, Value>,
    /// RMS error on held-out rows with all preceding findings of the list; null if nothing was held out.
    pub heldout_rms_before: Option<f64>,
    /// The same including this finding.
    pub heldout_rms_after: Option<f64>,
    /// RMS error on held-out rows if only this finding is removed and all others are refitted; null if nothing was held out.
    pub heldout_rms_without: Option<f64>,
    /// Effect of this finding alone on the measurement; null if not computed.
    pub size: Option<Size>,
    /// Name of a group of findings that are determined only jointly; null if it is determined separately, or if this is not computed.
    pub group: Option<String>,
    #[serde(rename = "where")]
    location: FindingLocation,
    pub(crate) alternatives: Vec<Alternative>,
    /// Cause and size as a sentence.
    pub says: String,
}

/// Effect of one finding alone on the measured values, in the report's unit.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Size {
    /// Root mean square.
    pub rms: f64,
    /// Largest absolute value.
    pub max: f64,
}

impl Size {
    /// In a unit of which `per_si` make one SI unit.
    pub(crate) fn of(size: diagnosis::effect_size::EffectSize, per_si: f64) -> Self {
        Self { rms: per_si * size.rms, max: per_si * size.largest }
    }
}

/// A parameter with its 95 % interval, in the unit of its key.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum Value {
    /// A scalar.
    One {
        /// The estimate.
        value: f64,
        /// Its interval.
        ci95: Interval,
        /// Whether the data determine it; otherwise the interval is that of its prior.
        determined: bool,
    },
    /// A list.
    List {
        /// The estimates.
        value: Vec<f64>,
        /// The interval of each.
        ci95: Vec<Interval>,
        /// Whether the data determine each; otherwise its interval is that of its prior.
        determined: Vec<bool>,
    },
}

impl Value {
    /// A scalar that the data determine.
    pub(crate) fn one(value: f64, ci95: Interval) -> Self {
        Self::One { value, ci95, determined: true }
    }

    /// A list of values that the data determine.
    pub(crate) fn list(value: Vec<f64>, ci95: Vec<Interval>) -> Self {
        let determined = vec![true; value.len()];
        Self::List { value, ci95, determined }
    }
}

/// A 95 % interval; `None` if not computed.
pub type Interval = Option<[f64; 2]>;

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "the contract's keys")]
struct FindingLocation {
    joint: Option<usize>,
    channels: Vec<String>,
    condition: String,
    intervals_s: Vec<[f64; 2]>,
    frequency_Hz: Option<f64>,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct Alternative {
    pub(crate) effect: &'static str,
    pub(crate) joint: Option<usize>,
    /// Null if not computed.
    pub(crate) confidence: Option<f64>,
    #[serde(skip)]
    is_indistinguishable: bool,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct UntestedEffect {
    pub(crate) effect: &'static str,
    pub(crate) joint: Option<usize>,
    pub(crate) why: String,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct Unexplained {
    rms: f64,
    pub(crate) depends_on: Vec<String>,
    heldout_rms_after: f64,
    pub(crate) says: String,
}

/// The proposed experiment, for `trued plan --for`.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ProposedExperimentReport {
    name: String,
    expected_separation: f64,
    takes_s: f64,
    /// Columns to be measured, without units.
    measure: Vec<String>,
}

impl ProposedExperimentReport {
    fn of(proposed: &ProposedExperiment) -> Self {
        Self {
            name: proposed.experiment.name.clone(),
            expected_separation: proposed.separation,
            takes_s: proposed.experiment.takes_s(),
            measure: proposed.measured.channels.iter().map(|channel| channel.base()).collect(),
        }
    }
}

/// A cell of the map of deviations: the joint deviation that would explain the recording there.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct MapCellReport {
    pub(crate) joint: usize,
    pub(crate) depends_on: String,
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) off: f64,
    pub(crate) ci95: [f64; 2],
}

/// Held-out errors of one joint's torque, Nm or N.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct JointErrors {
    pub(crate) joint: usize,
    pub(crate) torque_rms: f64,
    pub(crate) heldout_rms_before: f64,
    pub(crate) heldout_rms_after: f64,
    /// Without the zones of low speed described in the notes.
    pub(crate) heldout_rms_after_outside: f64,
    pub(crate) noise_rms: f64,
}

impl JointErrors {
    fn of(proof: &JointValidation) -> Self {
        Self {
            joint: proof.joint + 1,
            torque_rms: proof.torque,
            heldout_rms_before: proof.before,
            heldout_rms_after: proof.after,
            heldout_rms_after_outside: proof.after_outside,
            noise_rms: proof.noise,
        }
    }
}

impl Report {
    pub(crate) fn of(found: &RobotDiagnosis) -> Self {
        let Some(diagnosis) = &found.diagnosis else { return Self::without_positions(found) };
        let proof = &diagnosis.test_errors;
        let least = found.settings.experiment_separation_least;
        let (proposed, insufficient) = proposal(diagnosis, least);
        let arm = &found.base.physics.arm;
        Self {
            verdict: diagnosis.verdict.name(),
            domain: "position",
            unit: if proof.is_length { "mm" } else { "mrad" },
            samples: found.rows,
            signal_rms: MILLI * diagnosis.signal_rms,
            band_Hz: None,
            noise_rms: MILLI * proof.noise,
            heldout_rms_before: Some(MILLI * proof.before),
            heldout_rms_after: Some(MILLI * proof.after),
            heldout: proof.says.clone(),
            tolerance: found.tolerance(),
            findings: diagnosis.findings.iter().map(|one| ReportedFinding::of(arm, one)).collect(),
            minor: Vec::new(),
            candidates: diagnosis
                .candidates
                .iter()
                .map(|one| ReportedFinding::of(arm, one))
                .collect(),
            attribution: "shapley",
            next_experiment: proposed.map(|next| next.says.clone()),
            experiment: proposed.map(ProposedExperimentReport::of),
            action: None,
            not_tested: diagnosis
                .not_tested
                .iter()
                .map(|one| UntestedEffect {
                    effect: one.effect,
                    joint: one.joint.map(|joint| joint + 1),
                    why: one.why.clone(),
                })
                .collect(),
            unexplained: diagnosis.unexplained.as_ref().map(|one| Unexplained {
                rms: MILLI * one.heldout[0],
                depends_on: one.depends_on.clone(),
                heldout_rms_after: MILLI * one.heldout[1],
                says: sentences::structure(one.location, &one.depends_on, one.section),
            }),
            map: diagnosis.map.iter().map(MapCellReport::of).collect(),
            joints: Vec::new(),
            phases: Vec::new(),
            tones: Vec::new(),
            notes: found
                .notes
                .iter()
                .chain(&diagnosis.notes)
                .cloned()
                .chain(insufficient)
                .collect(),
            seed: found.settings.seed,
        }
    }

    /// The report if positions cannot be diagnosed.
    fn without_positions(found: &RobotDiagnosis) -> Self {
        let empty = Self::empty("position", "mm", found.settings.seed);
        let (samples, notes, tolerance) = (found.rows, found.notes.clone(), found.tolerance());
        Self { samples, notes, tolerance, ..empty }.with_reason(found.objections.join(" Or: "))
    }

    /// A report without results.
    fn empty(domain: &'static str, unit: &'static str, seed: u64) -> Self {
        Self {
            verdict: Verdict::Undetermined.name(),
            domain,
            unit,
            samples: 0,
            signal_rms: 0.0,
            band_Hz: None,
            noise_rms: 0.0,
            heldout_rms_before: None,
            heldout_rms_after: None,
            heldout: "no errors are reported: the recordings cannot be evaluated".to_owned(),
            tolerance: None,
            findings: Vec::new(),
            minor: Vec::new(),
            candidates: Vec::new(),
            attribution: "sequence",
            next_experiment: None,
            experiment: None,
            action: None,
            not_tested: Vec::new(),
            unexplained: None,
            map: Vec::new(),
            joints: Vec::new(),
            phases: Vec::new(),
            tones: Vec::new(),
            notes: Vec::new(),
            seed,
        }
    }

    /// The report with the reason why there is no result.
    fn with_reason(self, sentence: String) -> Self {
        let why = Unexplained {
            rms: 0.0,
            depends_on: Vec::new(),
            heldout_rms_after: 0.0,
            says: sentence,
        };
        Self { unexplained: Some(why), ..self }
    }
}

/// The proposed experiment, if a reasonable number of its runs would decide; otherwise the note that none would.
fn proposal(
    diagnosis: &Diagnosis,
    separation_least: f64,
) -> (Option<&ProposedExperiment>, Option<String>) {
    match &diagnosis.next_experiment {
        Some(one) if one.separation < separation_least => {
            (None, Some(insufficient_experiment(&one.says, one.separation)))
        }
        proposed => (proposed.as_ref(), None),
    }
}

/// The note that no known experiment would decide between the alternatives that an instruction names before its colon.
fn insufficient_experiment(instruction: &str, separation: f64) -> String {
    let names = instruction.split(':').next().unwrap_or_default();
    let names = names.strip_prefix("To distinguish ").unwrap_or("the alternatives");
    format!(
        "no known motion or load would distinguish {names} at this noise: the best one has an expected log-likelihood ratio of {} per run; measure with less noise, or use the model as it is: both predict these poses equally well",
        significant(separation, 1)
    )
}

/// Name of an effect with its joint (1-based), for users.
fn effect_name(effect: &str, joint: Option<usize>) -> String {
    let whose = joint.map_or(String::new(), |joint| format!(" of joint {joint}"));
    format!("{}{whose}", effect.replace('_', " "))
}

/// The `most` findings with the largest effects on the measurement, and the others; both in their order. A finding without a size counts as large.
fn partition_by_size(
    findings: Vec<ReportedFinding>,
    most: usize,
) -> (Vec<ReportedFinding>, Vec<ReportedFinding>) {
    let size =
        |reported: &ReportedFinding| reported.size.as_ref().map_or(f64::INFINITY, |size| size.rms);
    let mut sizes: Vec<f64> = findings.iter().map(size).collect();
    sizes.sort_by(|a, b| b.total_cmp(a));
    let beyond = sizes.get(most).copied().unwrap_or(f64::NEG_INFINITY);
    findings.into_iter().partition(|reported| size(reported) > beyond)
}

impl ReportedFinding {
    pub(crate) fn name(&self) -> String {
        effect_name(self.effect, self.joint)
    }

    fn of(arm: &Arm, finding: &Finding) -> Self {
        let effect = &finding.effect;
        let joint = effect.joint().map(|joint| joint + 1);
        let slides = effect.joint().is_some_and(|j| arm.joints()[j].kind == JointKind::Prismatic);
        let alternatives = finding.alternatives.iter().map(|(rival, confidence)| Alternative {
            effect: rival.effect.spec().kind,
            joint: rival.effect.joint().map(|joint| joint + 1),
            confidence: Some(*confidence),
            is_indistinguishable: rival.is_indistinguishable,
        });
        let alternatives = Alternative::with_remainder(finding.confidence, alternatives.collect());
        Self {
            effect: effect.spec().kind,
            joint,
            change: if finding.stated.is_some() { "revised" } else { "new" },
            confidence: Some(finding.confidence),
            parameters: parameters(finding, slides),
            heldout_rms_before: Some(MILLI * finding.held_out_rms[0]),
            heldout_rms_after: Some(MILLI * finding.held_out_rms[1]),
            heldout_rms_without: Some(MILLI * finding.held_out_rms_without),
            size: Some(Size::of(finding.size, MILLI)),
            group: finding.group.map(|number| format!("group {number}")),
            location: FindingLocation {
                joint,
                channels: finding.seen.channels.clone(),
                condition: sentences::condition(effect),
                intervals_s: finding.seen.intervals_s.clone(),
                frequency_Hz: None,
            },
            alternatives,
            says: sentences::sentence(effect, finding.stated.as_deref(), slides),
        }
    }
}

/// Parameters in file units, with 95 % intervals; differences for effects that the model had.
fn parameters(finding: &Finding, slides: bool) -> BTreeMap<String, Value> {
    let kind = if slides { JointKind::Prismatic } else { JointKind::Revolute };
    let effect: &AnyEffect = &finding.effect;
    let mut all: BTreeMap<String, Value> = BTreeMap::new();
    for (k, value) in effect.values().iter().enumerate() {
        let Some(entry) = parameter_key(effect, k) else { continue };
        let si = entry.parameter.unit.suffix_and_si(kind).1;
        let stated =
            finding.stated.as_ref().and_then(|stated| stated.get(k)).copied().unwrap_or(0.0);
        let change = (value - stated) / si;
        let bounded = finding.stated.is_none() && entry.parameter.range == Range::NotNegative;
        let ci = finding.sigma.get(k).copied().flatten().map(|sigma| {
            let spread = NINETY_FIVE * sigma / si;
            let low = if bounded { (change - spread).max(0.0) } else { change - spread };
            [low, change + spread]
        });
        let is_determined = finding.determined.get(k).copied().unwrap_or(true);
        let key = entry.parameter.key(kind).to_string();
        if entry.parameter.count == Count::One {
            all.insert(key, Value::One { value: change, ci95: ci, determined: is_determined });
            continue;
        }
        let list = all.entry(key).or_insert_with(|| Value::list(Vec::new(), Vec::new()));
        if let Value::List { value, ci95, determined } = list {
            value.push(change);
            ci95.push(ci);
            determined.push(is_determined);
        }
    }
    for (stem, numbers) in &finding.settings {
        let Some(parameter) = effect.spec().parameters.iter().find(|p| p.stem == *stem) else {
            continue;
        };
        let si = parameter.unit.suffix_and_si(kind).1;
        let numbers: Vec<f64> = numbers.iter().map(|x| x / si).collect();
        let value = match numbers.as_slice() {
            [one] => Value::one(*one, Some([*one; 2])),
            _ => {
                let ci95 = numbers.iter().map(|x| Some([*x; 2])).collect();
                Value::list(numbers, ci95)
            }
        };
        all.insert(parameter.key(kind).to_string(), value);
    }
    all
}

impl MapCellReport {
    fn of(cell: &MapCell) -> Self {
        let (deviation, spread) = (MILLI * cell.off, MILLI * NINETY_FIVE * cell.sigma);
        Self {
            joint: cell.joint + 1,
            depends_on: cell.word.clone(),
            from: cell.range[0],
            to: cell.range[1],
            off: deviation,
            ci95: [deviation - spread, deviation + spread],
        }
    }
}

impl Report {
    /// The report limited to the largest findings; the others become minor.
    pub(crate) fn limited_to(self, findings_most: usize) -> Self {
        let (findings, minor) = partition_by_size(self.findings, findings_most);
        Self { findings, minor, ..self }
    }

    /// All claimed effects, large and small.
    pub fn all_findings(&self) -> impl Iterator<Item = &ReportedFinding> {
        self.findings.iter().chain(&self.minor)
    }

    /// Whether `trued plan --for` can write the proposed experiment.
    pub(crate) fn has_experiment(&self) -> bool {
        self.experiment.is_some()
    }
}

/// The result in one sentence, with the evaluation of a tolerance if one was stated.
#[must_use]
pub fn summary(report: &Report) -> String {
    let lead = deviation(report);
    match &report.tolerance {
        Some(tolerance) => format!("{lead}; tolerance of {}", tolerance.evaluation()),
        None => lead,
    }
}

/// The deviation between model and recording as text.
fn deviation(report: &Report) -> String {
    let held = report.heldout_rms_before.zip(report.heldout_rms_after);
    let Some((before, after)) = held.filter(|(before, _)| report.samples > 0 && *before > 0.0)
    else {
        return match (&report.unexplained, held) {
            (Some(rest), _) => rest.says.clone(),
            (None, Some((0.0, _))) if report.samples > 0 => {
                "the given model predicts every held-out reading exactly".to_owned()
            }
            (None, _) => "no held-out reading tests the given model".to_owned(),
        };
    };
    let count = report.all_findings().count();
    // Without findings the second figure differs only by nuisance parameters.
    let found = match count {
        0 => String::new(),
        _ => format!(", {} with the findings", significant(after, 3)),
    };
    let errors = format!(
        "held-out error ({}): {} {} with the given model{found}; the residual scatter is {}",
        report.error_kind(),
        significant(before, 3),
        report.unit,
        significant(report.noise_rms, 3)
    );
    match count {
        0 if report.unexplained.is_none() => {
            format!("no structure above the residual scatter; {errors}")
        }
        0 => format!("no known effect explains it; {errors}"),
        1 => format!("one effect; {errors}"),
        count => format!("{count} effects; {errors}"),
    }
}

impl Report {
    /// Which mean the errors of this domain are (docs/reference/results.md).
    pub(crate) fn error_kind(&self) -> &'static str {
        match self.domain {
            "position" => "RMS of single values",
            "torque" => "RMS, each joint weighted by its noise",
            _ => "RMS",
        }
    }
}

impl Alternative {
    /// The alternatives of a finding, with the probability of unlisted ones as one more entry, so that all probabilities add up to one.
    pub(crate) fn with_remainder(confidence: f64, mut listed: Vec<Self>) -> Vec<Self> {
        let sum = confidence + listed.iter().filter_map(|one| one.confidence).sum::<f64>();
        if 1.0 - sum > LEAST_LISTED {
            let confidence = Some(1.0 - sum);
            listed.push(Self {
                effect: "other",
                joint: None,
                confidence,
                is_indistinguishable: false,
            });
        }
        listed
    }

    pub(crate) fn name(&self) -> String {
        effect_name(self.effect, self.joint)
    }
}
