//! Result of the demo, with the keys of `trued.demo/1`.
#![expect(non_snake_case, reason = "the contract's keys carry units as they are written")]

use serde::{Deserialize, Serialize};

/// All measurements and reports.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Report {
    #[serde(flatten)]
    pub(super) milled: Milled,
    #[serde(flatten)]
    pub(super) told: Told,
    /// The error of the same path with the findings in the daemon's model; `None` if the model was
    /// not replaced.
    pub(super) tool_error_after_diagnosis_mm: Option<Spread>,
    pub(super) swap: Option<Swap>,
}

/// What the loop counted over a stretch of cycles.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Counts {
    pub(super) cycles: u64,
    pub(super) missed_cycles: u64,
    /// Since the daemon started.
    pub(super) rejected_commands: u64,
    /// Published targets that were not finite, outside the limits, further from the command than the envelope, or faster.
    pub(super) invariants_broken: u64,
}

impl Counts {
    /// Both stretches combined; `later` follows `self`.
    fn and(self, later: Self) -> Self {
        Self {
            cycles: self.cycles + later.cycles,
            missed_cycles: self.missed_cycles + later.missed_cycles,
            rejected_commands: later.rejected_commands,
            invariants_broken: self.invariants_broken + later.invariants_broken,
        }
    }
}

/// Result of milling with the model as calibrated.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Milled {
    pub(super) seed: u64,
    pub(super) quick: bool,
    pub(super) robot: String,
    pub(super) tool_error_mm: Errors,
    #[serde(flatten)]
    pub(super) counts: Counts,
    pub(super) vibration: Vec<Event>,
    pub(super) ringing: Ringing,
    pub(super) latency_ns: Latency,
}

/// An effect by its name in the contract; joints from 1, none for the whole robot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Named {
    pub(super) effect: String,
    pub(super) joint: Option<usize>,
}

/// The diagnosis of the measuring program, and the truth.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Told {
    pub(super) hidden_effect: Named,
    /// `None` if nothing was claimed.
    pub(super) said: Option<Named>,
    /// Whether the effect is the right one by name and joint, or is indistinguishable from it in
    /// this recording.
    pub(super) named_right: bool,
    /// Root mean square displacement of the tool on the work by the hidden effect.
    pub(super) hidden_effect_mm: f64,
    pub(super) verdict: String,
    /// The diagnosis in words, line by line.
    pub(super) says: Vec<String>,
    /// The hidden effect in words.
    pub(super) truth: String,
    /// How long the diagnosis took, s.
    pub(super) diagnosis_s: f64,
}

/// The change of model as the robot's side saw it.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Swap {
    /// Cycles while robot and daemon waited for the diagnosis, including the model's replacement.
    pub(super) cycles: u64,
    /// Of these, cycles without an answer in time.
    pub(super) missed: u64,
    /// The same in the second about the change.
    pub(super) missed_about: u64,
}

/// Result of milling the same path again.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Again {
    pub(super) error_mm: Spread,
    #[serde(flatten)]
    pub(super) counts: Counts,
    pub(super) swap: Swap,
}

impl Report {
    /// The complete report; `again`: `None` if the model was not replaced.
    pub(super) fn new(mut milled: Milled, told: Told, again: Option<Again>) -> Self {
        if let Some(again) = &again {
            milled.counts = milled.counts.and(again.counts);
        }
        let tool_error_after_diagnosis_mm = again.map(|again| again.error_mm);
        Self { milled, told, tool_error_after_diagnosis_mm, swap: again.map(|again| again.swap) }
    }
}

/// Tool error without and with correction.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Errors {
    pub(super) without: Spread,
    pub(super) with: Spread,
}

/// Mean, 95 % and largest.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Spread {
    pub(super) mean: f64,
    pub(super) p95: f64,
    pub(super) max: f64,
}

impl Spread {
    /// Of these values; zeros where there is none.
    pub(super) fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = values.collect();
        sorted.sort_by(f64::total_cmp);
        let Some(max) = sorted.last().copied() else {
            return Self { mean: 0.0, p95: 0.0, max: 0.0 };
        };
        let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
        let at = (0.95 * (sorted.len() - 1) as f64).ceil() as usize;
        Self { mean, p95: sorted[at], max }
    }
}

/// A change of state of a line of the force spectrum.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Event {
    pub(super) t_s: f64,
    pub(super) state: String,
    pub(super) frequency_Hz: f64,
    pub(super) amplitude_N: f64,
    pub(super) axis: String,
    pub(super) class: String,
    pub(super) suspect_alias: bool,
    /// The summary as a sentence, with a recommendation.
    pub(super) says: String,
    /// Since the robot began to ring; none before.
    pub(super) after_onset_ms: Option<f64>,
}

/// The truth about the ringing.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Ringing {
    pub(super) frequency_Hz: f64,
    pub(super) from_s: f64,
    pub(super) words: String,
}

/// Quantiles of the round trip, ns.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Latency {
    pub(super) p50: u64,
    pub(super) p99: u64,
    pub(super) p999: u64,
    pub(super) max: u64,
}
