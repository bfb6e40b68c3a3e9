//! Analysis of recorded cutting forces (or accelerations, if no force was recorded).
//!
//! Without a stated cut: phases (air, entry, cut, exit), sensor bias in air, spectral lines of the cut and chatter. With a stated cut: comparison
//! with the predicted cutting forces and identification of effects of cutter and sensor. Forces in N, accelerations in m/s², frequencies in Hz.
//!
//! Reading order: `signal` (runs without gaps), `phases` (air, entry, cut, exit), `lines` (spectral lines of the cut compared with those of the air),
//! `cut` (comparison with the stated cut).
//!
//! Invariants: the same input gives the same bits; a line that is also in air, or at a harmonic of the spindle speed, is never reported as chatter;
//! without air no sensor bias is reported.

mod cut;
mod lines;
mod phases;
mod signal;
#[cfg(test)]
mod tests;

use crate::engine::statistics::median;
use physics::Model;
use recording::series::{Channel, Recording};

use crate::diagnose::Verdict;
use signal::Signal;

pub use cut::{CutComparison, ForceTrace, NoComparison, UnexplainedForce};
pub use lines::{Cause, SpectralLine};
pub use phases::{Phase, State};

/// Why an analysis is impossible.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DiagnosisError {
    /// No channel contains samples.
    #[error(
        "no force or acceleration has samples in it: record fx_N, fy_N, fz_N, or name them in a mapping"
    )]
    Empty,
    /// Every channel is constant.
    #[error(
        "every channel reads the same in every row: nothing was connected, or the sensor is overloaded"
    )]
    Constant,
    /// An amplifier or A/D converter is saturated.
    #[error(
        "{channel} stands at {limit} N (m/s²) in {percent:.1} % of its rows: the amplifier is at its limit there, so no force is known; record with a larger range"
    )]
    Saturated {
        /// Name of the channel.
        channel: String,
        /// Value at which it saturates, N or m/s².
        limit: f64,
        /// Share of the saturated rows, percent.
        percent: f64,
    },
    /// The recording is too short.
    #[error(
        "the longest run without a hole is {rows} rows, expected at least {least}: record more"
    )]
    TooShort {
        /// Rows of the longest run without gaps.
        rows: usize,
        /// Rows that are required.
        least: usize,
    },
}

/// An effect found without a stated cut.
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// Sensor bias: mean force in air, N.
    Bias {
        /// Components x, y, z; 0 for a channel that was not recorded.
        force: [f64; 3],
        /// Standard uncertainty of each component.
        sigma: [f64; 3],
        /// RMS force in held-out blocks of air, without and with the bias subtracted.
        heldout: [f64; 2],
    },
    /// A spectral line of the cut that is not forced: chatter.
    Chatter {
        /// The spectral line.
        line: SpectralLine,
        /// Half the width of a frequency bin, Hz.
        resolution_hz: f64,
        /// Whether the spindle speed is known, so that its harmonics are excluded as causes.
        is_speed_known: bool,
    },
}

/// Result of the analysis.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// Verdict.
    pub verdict: Verdict,
    /// Findings without a stated cut, most important first; empty if the forces were compared with a stated cut.
    pub findings: Vec<Finding>,
    /// Phases in time order, contiguous within a run.
    pub phases: Vec<Phase>,
    /// Spectral lines of the cut, strongest first.
    pub spectral_lines: Vec<SpectralLine>,
    /// Whether forces were recorded; otherwise accelerations.
    pub is_force: bool,
    /// Names of the analysed channels.
    pub channels: Vec<String>,
    /// Number of analysed rows.
    pub rows: usize,
    /// RMS of single values, N or m/s².
    pub signal: f64,
    /// Standard deviation of single values in air (over all rows if there is no air), N or m/s².
    pub noise: f64,
    /// Median spindle frequency in the cut, Hz, if known.
    pub spindle_hz: Option<f64>,
    /// For a stated turning cut: force along the cutting velocity per chip area, N/m².
    pub specific_force_pa: Option<f64>,
    /// Notes on the processing of the data, as text.
    pub notes: Vec<String>,
    /// Effects that this recording cannot show, with the reason.
    pub not_tested: Vec<(&'static str, &'static str)>,
    /// Comparison with the stated cut, or why there is none.
    pub cut_comparison: Result<CutComparison, NoComparison>,
    /// Level over time for the HTML page: time in s, level in N or m/s².
    pub level: Vec<(f64, f64)>,
}

/// Effects that only a comparison with a stated cut can show.
const CUT_EFFECTS: [&str; 7] = [
    "edge_force",
    "cutting_force",
    "tool_wear",
    "runout",
    "wrench_scale",
    "wrench_misalignment",
    "cross_talk",
];

/// Whether this is a recording of forces or accelerations without joints.
#[must_use]
pub fn has_force(recording: &Recording) -> bool {
    recording.joint_count() == 0
        && recording
            .channels()
            .any(|channel| matches!(channel, Channel::Wrench(_) | Channel::Acceleration(_)))
}

/// Analyses forces without and, if a cut is stated, with a model of the cut. `sigma`: standard uncertainties of the values of each of the model's
/// effects, SI units, in their order.
///
/// # Errors
/// [`DiagnosisError`] if the signals are empty, constant, saturated or too short.
pub fn diagnose(
    model: &Model,
    sigma: &[Vec<f64>],
    recording: &Recording,
) -> Result<Diagnosis, DiagnosisError> {
    let signal = Signal::from_recording(recording)?;
    let level = phases::block_levels(&signal);
    let phases = phases::find_phases(&signal, &level);
    let (spectral_lines, spindle_hz, resolution_hz) =
        lines::find_lines(&signal, &phases, recording);
    let mut findings = Vec::new();
    let mut not_tested = Vec::new();
    let has = |state: State| phases.iter().any(|phase| phase.state == state);
    let mut notes = signal.notes.clone();
    if has(State::Cut) {
        let line = spectral_lines.iter().find(|line| line.cause == Cause::SelfExcited).cloned();
        let is_speed_known = spindle_hz.is_some();
        findings.extend(line.map(|line| Finding::Chatter { line, resolution_hz, is_speed_known }));
    } else {
        not_tested.push(("chatter", "cutting and air cannot be distinguished in this recording"));
    }
    if !signal.is_force {
        not_tested.push(("wrench_bias", "no force was recorded"));
    } else if has(State::Air) {
        findings.extend(phases::bias_finding(&level, &phases));
        notes.extend(phases::drift_note(&level, &phases));
    } else {
        not_tested.push((
            "wrench_bias",
            "the tool is never in air, so the sensor is never known to be unloaded",
        ));
    }
    let cut_comparison = cut::compare(model, sigma, recording, &signal);
    match &cut_comparison {
        Ok(compared) => {
            findings.clear();
            not_tested.clone_from(&compared.not_tested);
        }
        Err(not_compared) => {
            not_tested.extend(CUT_EFFECTS.map(|kind| (kind, not_compared.reason())));
            // If the forces contradict the stated cut, findings from the same recording are not reliable.
            if not_compared.is_input_error() {
                findings.clear();
                notes.push(format!("not compared with the stated cut: {}", not_compared.reason()));
            }
        }
    }
    let verdict =
        cut_comparison.as_ref().map_or_else(|_| verdict_without_cut(&findings), |one| one.verdict);
    not_tested.sort_unstable();
    Ok(Diagnosis {
        verdict,
        findings,
        noise: phases::noise_in_air(&level, &phases),
        specific_force_pa: specific_force(&signal, &phases, recording, spindle_hz),
        phases,
        spectral_lines,
        is_force: signal.is_force,
        channels: signal.channel_names(),
        rows: signal.rows(),
        signal: signal.rms(),
        spindle_hz,
        notes,
        not_tested,
        cut_comparison,
        level: level.plot(),
    })
}

/// Verdict without a comparison with a stated cut.
fn verdict_without_cut(findings: &[Finding]) -> Verdict {
    let doubtful = |one: &Finding| matches!(one, Finding::Chatter { is_speed_known: false, .. });
    match findings {
        [] => Verdict::Undetermined,
        all if all.iter().any(doubtful) => Verdict::Undetermined,
        _ => Verdict::MissingPhysics,
    }
}

/// Specific cutting force of turning: force along the cutting velocity, less that in air, over depth of cut times feed per revolution, N/m².
fn specific_force(
    signal: &Signal,
    phases: &[Phase],
    recording: &Recording,
    spindle_hz: Option<f64>,
) -> Option<f64> {
    let cut = recording.metadata.cut.as_ref().filter(|cut| cut.turning)?;
    let along = signal.channels.iter().position(|(axis, _)| signal.is_force && *axis == 1)?;
    let longest = |state: State| {
        let of_state = phases.iter().filter(move |phase| phase.state == state);
        of_state.max_by_key(|phase| phase.rows.len())
    };
    let steady = longest(State::Cut)?;
    let air = longest(State::Air).map_or(0.0, |air| air.mean[along]);
    let feed = recording.column(Channel::Feed)?.get(steady.rows.clone())?;
    let feed = median(feed.iter().copied().filter(|feed| *feed > 0.0));
    let chip = cut.axial_depth_m * feed / spindle_hz?;
    (chip > 0.0).then(|| (steady.mean[along] - air).abs() / chip)
}
