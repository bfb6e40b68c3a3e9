//! Output of a force diagnosis: phases of the cut, lines, sensor, with the keys of `trued.diagnosis/1`.
//!
//! A tone with a known cause is never reported as chatter. Only fitted values are reported.

use std::collections::BTreeMap;

use diagnosis::force::{Cause, Diagnosis, Finding, Phase, SpectralLine, State};
use report::significant;
use serde::Serialize;

use super::{
    Alternative, FindingLocation, NINETY_FIVE, Report, ReportedFinding, UntestedEffect, Value,
    force_action,
};
use crate::forces::ForceDiagnosis;

/// N/m² per N/mm².
const MEGA: f64 = 1e6;

/// A phase of the tool's engagement.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(crate) struct PhaseEntry {
    pub(crate) state: &'static str,
    pub(crate) from_s: f64,
    pub(crate) to_s: f64,
    /// For each channel.
    pub(crate) mean: Vec<f64>,
    pub(crate) scatter: Vec<f64>,
}

/// A spectral line of the cut.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[expect(non_snake_case, reason = "keys carry units")]
pub(crate) struct SpectralLineEntry {
    pub(crate) frequency_Hz: f64,
    pub(crate) amplitude: f64,
    pub(crate) amplitude_in_air: f64,
    pub(crate) share_of_swing: f64,
    pub(crate) channel: String,
    pub(crate) cause: String,
}

impl Report {
    /// The report of forces alone.
    pub(crate) fn of_forces(found: &ForceDiagnosis) -> Self {
        let empty = Self::empty("force", "N", found.seed);
        let diagnosis = match &found.result {
            Ok(diagnosis) => diagnosis,
            Err(doubt) => return empty.with_reason(doubt.to_string()),
        };
        let findings: Vec<ReportedFinding> =
            diagnosis.findings.iter().map(|one| reported_finding(diagnosis, one)).collect();
        let proof = diagnosis.findings.iter().find_map(|one| match one {
            Finding::Bias { heldout, .. } => Some(*heldout),
            Finding::Chatter { .. } => None,
        });
        let alone = Self {
            verdict: diagnosis.verdict.name(),
            unit: if diagnosis.is_force { "N" } else { "m/s²" },
            samples: diagnosis.rows,
            signal_rms: diagnosis.signal,
            noise_rms: diagnosis.noise,
            heldout_rms_before: proof.map(|[before, _]| before),
            heldout_rms_after: proof.map(|[_, after]| after),
            heldout: phases_text(diagnosis),
            next_experiment: next_experiment(diagnosis),
            findings,
            not_tested: diagnosis
                .not_tested
                .iter()
                .map(|(effect, why)| UntestedEffect { effect, joint: None, why: (*why).to_owned() })
                .collect(),
            phases: diagnosis.phases.iter().map(phase_entry).collect(),
            tones: diagnosis
                .spectral_lines
                .iter()
                .map(|tone| spectral_line_entry(diagnosis, tone))
                .collect(),
            notes: notes(diagnosis),
            ..empty
        };
        let report = match &diagnosis.cut_comparison {
            Ok(compared) => alone.with_cut_comparison(&found.base, compared),
            Err(_) => alone,
        };
        let action = force_action::action(found, diagnosis, &report);
        Self { action, ..report }
    }
}

fn phase_entry(phase: &Phase) -> PhaseEntry {
    PhaseEntry {
        state: phase.state.name(),
        from_s: phase.from_s,
        to_s: phase.to_s,
        mean: phase.mean.clone(),
        scatter: phase.scatter.clone(),
    }
}

fn spectral_line_entry(diagnosis: &Diagnosis, tone: &SpectralLine) -> SpectralLineEntry {
    SpectralLineEntry {
        frequency_Hz: tone.frequency_hz,
        amplitude: tone.amplitude,
        amplitude_in_air: tone.amplitude_in_air,
        share_of_swing: tone.share,
        channel: diagnosis.channels.get(tone.channel).cloned().unwrap_or_default(),
        cause: match tone.cause {
            Cause::Spindle(k) => format!("spindle, {k} per revolution"),
            Cause::Air => "also present in air".to_owned(),
            Cause::Minor => "present in the cut, small".to_owned(),
            Cause::SelfExcited => "present only in the cut".to_owned(),
        },
    }
}

fn phases_text(diagnosis: &Diagnosis) -> String {
    let one = |phase: &Phase| {
        let [from, to] = [phase.from_s, phase.to_s].map(|t| significant(t, 3));
        match phase.state {
            State::Unknown => format!("air and cut cannot be distinguished from {from} to {to} s"),
            state => format!("{} from {from} to {to} s", state.name()),
        }
    };
    diagnosis.phases.iter().map(one).collect::<Vec<String>>().join(", ")
}

fn notes(diagnosis: &Diagnosis) -> Vec<String> {
    let mut notes = Vec::new();
    let has_cut = diagnosis.phases.iter().any(|phase| phase.state == State::Cut);
    let of_cut = diagnosis.cut_comparison.iter().flat_map(|compared| &compared.findings);
    let chatters = diagnosis.spectral_lines.iter().any(|tone| tone.cause == Cause::SelfExcited)
        || of_cut.into_iter().any(|finding| finding.kind == "chatter");
    if has_cut && !chatters {
        notes.push("no chatter: no self-excited tone in the cut".to_owned());
    }
    notes.extend(
        diagnosis
            .specific_force_pa
            .map(|pa| format!("specific cutting force {} N/mm²", significant(pa / MEGA, 4))),
    );
    notes.extend(
        diagnosis.spindle_hz.map(|hz| format!("spindle {} rpm", significant(60.0 * hz, 4))),
    );
    notes.extend(diagnosis.notes.iter().cloned());
    notes
}

fn next_experiment(diagnosis: &Diagnosis) -> Option<String> {
    let open = |one: &Finding| matches!(one, Finding::Chatter { is_speed_known: false, .. });
    if diagnosis.findings.iter().any(open) {
        return Some("Record the spindle speed (spindle_rpm, or one pulse per revolution as tacho), and repeat the cut at another speed: chatter keeps its frequency.".to_owned());
    }
    let unknown = diagnosis.phases.iter().all(|phase| phase.state == State::Unknown);
    unknown.then(|| "Record the entry into the cut and the exit.".to_owned())
}

fn reported_finding(diagnosis: &Diagnosis, finding: &Finding) -> ReportedFinding {
    match finding {
        Finding::Bias { force, sigma, heldout } => {
            let ci95 = (0..3).map(|k| {
                Some([force[k] - NINETY_FIVE * sigma[k], force[k] + NINETY_FIVE * sigma[k]])
            });
            let value = Value::list(force.to_vec(), ci95.collect());
            let components = force.map(|force| significant(force, 3)).join(", ");
            ReportedFinding {
                effect: "wrench_bias",
                joint: None,
                change: "new",
                confidence: None,
                parameters: BTreeMap::from([("bias_N".to_owned(), value)]),
                heldout_rms_before: Some(heldout[0]),
                heldout_rms_after: Some(heldout[1]),
                heldout_rms_without: Some(heldout[0]),
                size: None,
                group: None,
                location: FindingLocation {
                    joint: None,
                    channels: diagnosis.channels.clone(),
                    condition: "constant, in air too".to_owned(),
                    intervals_s: intervals(diagnosis, State::Air).into_iter().take(1).collect(),
                    frequency_Hz: None,
                },
                alternatives: Vec::new(),
                says: format!(
                    "The sensor has an offset of {components} N (x, y, z) without contact."
                ),
            }
        }
        Finding::Chatter { line, resolution_hz, is_speed_known } => {
            chatter_finding(diagnosis, line, *resolution_hz, *is_speed_known)
        }
    }
}

/// Time intervals of this state, s.
fn intervals(diagnosis: &Diagnosis, wanted: State) -> Vec<[f64; 2]> {
    let phases = diagnosis.phases.iter().filter(|phase| phase.state == wanted);
    phases.map(|phase| [phase.from_s, phase.to_s]).collect()
}

fn chatter_finding(
    diagnosis: &Diagnosis,
    tone: &SpectralLine,
    resolution_hz: f64,
    is_alone: bool,
) -> ReportedFinding {
    // A single spectral line has neither scatter nor held-out rows: no interval is computed.
    let number = |value: f64| Value::one(value, None);
    let mut parameters = BTreeMap::from([("frequency_Hz".to_owned(), number(tone.frequency_hz))]);
    if diagnosis.is_force {
        parameters.insert("amplitude_N".to_owned(), number(tone.amplitude));
    }
    let forced =
        Alternative { effect: "runout", joint: None, confidence: None, is_indistinguishable: true };
    ReportedFinding {
        effect: "chatter",
        joint: None,
        change: "new",
        confidence: None,
        parameters,
        heldout_rms_before: None,
        heldout_rms_after: None,
        heldout_rms_without: None,
        size: None,
        group: None,
        location: FindingLocation {
            joint: None,
            channels: diagnosis.channels.get(tone.channel).cloned().into_iter().collect(),
            condition: "in the cut, not in air, at no multiple of the spindle frequency".to_owned(),
            intervals_s: intervals(diagnosis, State::Cut),
            frequency_Hz: Some(tone.frequency_hz),
        },
        alternatives: if is_alone { Vec::new() } else { vec![forced] },
        says: format!(
            "Self-excited vibration at {} Hz (resolution {} Hz): chatter, {} % of the vibration there.",
            significant(tone.frequency_hz, 4),
            significant(resolution_hz, 2),
            significant(100.0 * tone.share, 2)
        ),
    }
}
