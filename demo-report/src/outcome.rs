//! Result of the demo, with the keys of `trued.demo/1`.
#![expect(non_snake_case, reason = "the contract's keys carry units as they are written")]

use serde::{Deserialize, Serialize};

/// All measurements and reports.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    #[serde(flatten)]
    /// Milling with the model as calibrated.
    pub milled: MillingResult,
    #[serde(flatten)]
    /// The diagnosis, and the truth.
    pub diagnosis: DiagnosisOutcome,
    /// The error of the same path with the findings in the daemon's model; `None` if the model was
    /// not replaced.
    pub tool_error_after_diagnosis_mm: Option<ErrorStatistics>,
    /// How the model was replaced; `None` if it was not.
    pub swap: Option<ModelChange>,
}

/// Counters of the loop over a part of the run.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Counts {
    /// Cycles at 1 kHz.
    pub cycles: u64,
    /// Cycles without an answer in time.
    pub missed_cycles: u64,
    /// Since the daemon started.
    pub rejected_commands: u64,
    /// Published targets that were not finite, outside the limits, further from the command than the envelope, or faster.
    pub invariants_broken: u64,
}

impl Counts {
    /// Both stretches combined; `later` follows `self`.
    fn merged_with(self, later: Self) -> Self {
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
pub struct MillingResult {
    /// The seed of all chance.
    pub seed: u64,
    /// Whether it was the short form.
    pub quick: bool,
    /// Name of the robot.
    pub robot: String,
    /// Tool error along the path.
    pub tool_error_mm: Errors,
    #[serde(flatten)]
    /// Counters along the path.
    pub counts: Counts,
    /// Messages of the vibration monitor.
    pub vibration: Vec<VibrationEvent>,
    /// The simulated chatter.
    pub ringing: SimulatedChatter,
    /// Round trip between two processes.
    pub latency_ns: Latency,
}

/// An effect by its name in the contract; joints from 1, none for the whole robot.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct EffectName {
    /// Name of the effect.
    pub effect: String,
    /// Its joint.
    pub joint: Option<usize>,
}

/// The diagnosis of the measuring program, and the truth.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DiagnosisOutcome {
    /// The effect that the model lacked.
    pub hidden_effect: EffectName,
    /// `None` if nothing was claimed.
    pub said: Option<EffectName>,
    /// Whether the effect is the right one by name and joint, or is indistinguishable from it in
    /// this recording.
    pub named_right: bool,
    /// Root mean square displacement of the tool on the work by the hidden effect.
    pub hidden_effect_mm: f64,
    /// The verdict of the diagnosis.
    pub verdict: String,
    /// The diagnosis in words, line by line.
    pub says: Vec<String>,
    /// The hidden effect in words.
    pub truth: String,
    /// How long the diagnosis took, s.
    pub diagnosis_s: f64,
}

/// The change of model as the robot's side saw it.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ModelChange {
    /// Cycles while robot and daemon waited for the diagnosis, including the model's replacement.
    pub cycles: u64,
    /// Of these, cycles without an answer in time.
    pub missed: u64,
    /// The same in the second about the change.
    pub missed_about: u64,
}

/// Result of milling the same path again.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RepeatRun {
    /// Tool error.
    pub error_mm: ErrorStatistics,
    #[serde(flatten)]
    /// Counters along the path.
    pub counts: Counts,
    /// How the model was replaced.
    pub swap: ModelChange,
}

impl Report {
    /// The complete report; `again`: `None` if the model was not replaced.
    pub fn new(
        mut milled: MillingResult,
        diagnosis: DiagnosisOutcome,
        again: Option<RepeatRun>,
    ) -> Self {
        if let Some(again) = &again {
            milled.counts = milled.counts.merged_with(again.counts);
        }
        let tool_error_after_diagnosis_mm = again.map(|again| again.error_mm);
        Self {
            milled,
            diagnosis,
            tool_error_after_diagnosis_mm,
            swap: again.map(|again| again.swap),
        }
    }
}

/// Tool error without and with correction.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Errors {
    /// Without correction.
    pub without: ErrorStatistics,
    /// With correction.
    pub with: ErrorStatistics,
}

/// Mean, 95 % and largest.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ErrorStatistics {
    /// Mean.
    pub mean: f64,
    /// 95 % of the values are not above it.
    pub p95: f64,
    /// The largest.
    pub max: f64,
}

impl ErrorStatistics {
    /// Of these values; zeros where there is none.
    pub fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = values.collect();
        sorted.sort_by(f64::total_cmp);
        let Some(max) = sorted.last().copied() else {
            return Self { mean: 0.0, p95: 0.0, max: 0.0 };
        };
        let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
        let index = (0.95 * (sorted.len() - 1) as f64).ceil() as usize;
        Self { mean, p95: sorted[index], max }
    }
}

/// A change of state of a line of the force spectrum.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct VibrationEvent {
    /// Time since the first tick, s.
    pub t_s: f64,
    /// `over`, `warn`, `alarm` or `confirmed`.
    pub state: String,
    /// Frequency of the line.
    pub frequency_Hz: f64,
    /// Amplitude of the force.
    pub amplitude_N: f64,
    /// Axis of the sensor.
    pub axis: String,
    /// Kind of the vibration.
    pub class: String,
    /// Whether the frequency may be an alias.
    pub suspect_alias: bool,
    /// The summary as a sentence, with a recommendation.
    pub says: String,
    /// Since the robot began to ring; none before.
    pub after_onset_ms: Option<f64>,
}

/// The truth about the ringing.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SimulatedChatter {
    /// Frequency of the chatter.
    pub frequency_Hz: f64,
    /// Time from which the robot vibrates, s.
    pub from_s: f64,
    /// The same in words.
    pub words: String,
}

/// Quantiles of the round trip, ns.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Latency {
    /// Median.
    pub p50: u64,
    /// 99 %.
    pub p99: u64,
    /// 99.9 %.
    pub p999: u64,
    /// The longest.
    pub max: u64,
}
