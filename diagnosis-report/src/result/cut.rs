//! Output of a force comparison with a stated cut, with the keys of `trued.diagnosis/1`.
//!
//! Indistinguishable effects are reported with the recording that would distinguish them. Only fitted values are reported.

use diagnosis::diagnose::Verdict;
use diagnosis::force::{CutComparison, UnexplainedForce};
use diagnosis::torque::Finding;
use recording::model::{EffectEntry, RobotModel};
use report::significant;

use super::drives::{alternatives, parameters};
use super::{FindingLocation, Report, ReportedFinding, Size, Unexplained, UntestedEffect};
use crate::drives::file_entry;

/// Names of the axes in files.
const CHANNELS: [&str; 3] = ["fx_N", "fy_N", "fz_N"];

impl Report {
    /// The report with the results of the comparison instead of those of the forces alone.
    pub(crate) fn with_cut_comparison(self, base: &RobotModel, compared: &CutComparison) -> Self {
        let not_tested = |(effect, why): &(&'static str, &'static str)| UntestedEffect {
            effect,
            joint: None,
            why: (*why).to_owned(),
        };
        let mut notes = self.notes;
        notes.extend(compared.notes.iter().cloned());
        Self {
            verdict: compared.verdict.name(),
            samples: compared.rows,
            signal_rms: compared.signal,
            noise_rms: compared.noise,
            heldout_rms_before: Some(compared.heldout[0]),
            heldout_rms_after: Some(compared.heldout[1]),
            heldout: compared.heldout_description.clone(),
            findings: compared.findings.iter().map(|one| reported_finding(base, one)).collect(),
            candidates: compared.candidates.iter().map(|one| reported_finding(base, one)).collect(),
            next_experiment: next_experiment(compared),
            not_tested: compared.not_tested.iter().map(not_tested).collect(),
            unexplained: compared.unexplained.as_ref().map(unexplained),
            notes,
            ..self
        }
    }
}

fn reported_finding(base: &RobotModel, finding: &Finding) -> ReportedFinding {
    let entry = file_entry(base, finding);
    let frequency = finding.parameters.iter().find(|number| number.stem == "frequency");
    ReportedFinding {
        effect: finding.kind,
        joint: None,
        change: if finding.is_change { "revised" } else { "new" },
        confidence: Some(finding.confidence),
        parameters: entry.as_ref().map(parameters).unwrap_or_default(),
        heldout_rms_before: Some(finding.heldout[0]),
        heldout_rms_after: Some(finding.heldout[1]),
        heldout_rms_without: Some(finding.heldout_without),
        size: Some(Size::of(finding.size, 1.0)),
        group: None,
        location: FindingLocation {
            joint: None,
            channels: CHANNELS.map(str::to_owned).to_vec(),
            condition: condition(finding.kind).to_owned(),
            intervals_s: Vec::new(),
            frequency_Hz: frequency.and_then(|number| number.values.first()).copied(),
        },
        alternatives: alternatives(finding),
        says: sentence(finding, entry.as_ref()),
    }
}

/// Condition under which an effect's force occurs, for users.
fn condition(kind: &str) -> &'static str {
    match kind {
        "cutting_force" => "proportional to the chip thickness of each tooth",
        "edge_force" => "proportional to the depth of cut, independent of the feed",
        "tool_wear" => "increases along the cut",
        "runout" => "periodic with the spindle revolution, not only with the teeth",
        "chatter" => "in the cut, not in air, at no multiple of the spindle frequency",
        "wrench_bias" => "constant, in air too",
        "wrench_scale" => "proportional to the force of each axis",
        "wrench_misalignment" => "like a rotation of the force",
        "cross_talk" => "proportional to the force of another axis",
        _ => "over the whole recording",
    }
}

/// Cause and size of a finding as a sentence.
fn sentence(finding: &Finding, entry: Option<&EffectEntry>) -> String {
    let list = |stem: &str| -> Vec<f64> {
        let found = entry.and_then(|e| e.parameters.iter().find(|p| p.key.starts_with(stem)));
        found.map(|p| p.value.as_slice().to_vec()).unwrap_or_default()
    };
    let values = |stem: &str| {
        list(stem).iter().map(|x| significant(*x, 3)).collect::<Vec<String>>().join(", ")
    };
    let share = |k: usize| significant(100.0 * list("scale").get(k).copied().unwrap_or(0.0), 3);
    match finding.kind {
        "cutting_force" => format!(
            "The shear coefficients of the workpiece are {} N/mm² higher than stated (tangential, radial, axial).",
            values("coefficient")
        ),
        "edge_force" => format!(
            "The edge coefficients are {} N per mm of depth higher than stated (tangential, radial, axial).",
            values("coefficient")
        ),
        "tool_wear" => {
            format!("Tool wear: the edge force increases by {} per metre of cut.", values("growth"))
        }
        "runout" => format!(
            "The tool has a runout of {} µm: one tooth cuts more than the others.",
            values("radial")
        ),
        "chatter" => format!(
            "Self-excited vibration at {} Hz, {} N: chatter.",
            values("frequency"),
            values("amplitude")
        ),
        "wrench_bias" => format!("The sensor has an offset of {} N (x, y, z).", values("bias")),
        "wrench_scale" => format!(
            "The sensor has scale errors of {}, {}, {} % (x, y, z).",
            share(0),
            share(1),
            share(2)
        ),
        "wrench_misalignment" => format!(
            "The sensor is rotated by {} mrad (about x, y, z) from its stated orientation.",
            values("turn")
        ),
        "cross_talk" => "The sensor has cross talk between channels.".to_owned(),
        other => format!("{}.", other.replace('_', " ")),
    }
}

fn unexplained(rest: &UnexplainedForce) -> Unexplained {
    let sentence = match rest.tone_hz {
        Some(hz) => format!(
            "A tone of {} Hz is present in the forces with and without cutting: it is not caused by the cut.",
            significant(hz, 4)
        ),
        None => {
            let names: Vec<&str> =
                rest.depends_on.iter().map(|covariate| covariate_name(covariate)).collect();
            format!(
                "An unmodelled force along {}, depending on {}, remains.",
                CHANNELS[rest.axis],
                names.join(" and ")
            )
        }
    };
    Unexplained {
        rms: rest.heldout[0],
        depends_on: rest.depends_on.clone(),
        heldout_rms_after: rest.heldout[1],
        says: sentence,
    }
}

/// A covariate for users.
fn covariate_name(covariate: &str) -> &str {
    match covariate {
        "spindle_rpm" => "the turn of the spindle",
        "feed_mm_s" => "the feed",
        "wrench" => "the force itself",
        "t_s" => "time",
        other => other,
    }
}

/// The experiment that would resolve open questions.
fn next_experiment(compared: &CutComparison) -> Option<String> {
    let open = |one: &&Finding| one.alternatives.iter().any(|rival| rival.is_indistinguishable);
    let Some(one) = compared.findings.iter().find(open) else {
        let rests = compared.verdict == Verdict::UnknownStructure;
        return rests.then(|| {
            "Repeat the cut at half the depth and at another feed, with 10 s of air before it: forces that depend on neither are not caused by the cut.".to_owned()
        });
    };
    let is_among = |kinds: &[&str]| {
        kinds.contains(&one.kind)
            || one
                .alternatives
                .iter()
                .any(|rival| rival.is_indistinguishable && kinds.contains(&rival.kind))
    };
    let of_coefficients = ["cutting_force", "edge_force", "tool_wear"];
    let of_sensor = ["wrench_scale", "wrench_misalignment", "cross_talk"];
    Some(if is_among(&["wrench_bias"]) && !compared.has_air {
        "Record 2 s in air before the cut, where the signal is that of the sensor alone.".to_owned()
    } else if is_among(&of_sensor) {
        "Hang a known weight on the sensor along x, along y and along z, and record it: this separates the sensor's errors from the cut.".to_owned()
    } else if is_among(&of_coefficients) && compared.has_one_feed {
        "Repeat the cut at three feeds with ratios of at least 1:2:4, all else unchanged: shear forces depend on the feed, edge forces do not.".to_owned()
    } else if is_among(&of_coefficients) {
        "Repeat the cut with a new edge, and with the used one over a longer distance: effects of the edge change, those of the workpiece do not.".to_owned()
    } else {
        "Repeat the cut at half the width of cut and at another feed, sampled at least twenty times per tooth.".to_owned()
    })
}
