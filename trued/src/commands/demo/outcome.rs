//! What the demo found, by the contract's keys (`trued.demo/1`).
#![expect(non_snake_case, reason = "the contract's keys carry units as they are written")]

use serde::{Deserialize, Serialize};

/// Everything that was measured.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Report {
    pub(super) seed: u64,
    pub(super) quick: bool,
    pub(super) robot: String,
    pub(super) tool_error_mm: Errors,
    pub(super) cycles: u64,
    pub(super) missed_cycles: u64,
    pub(super) rejected_commands: u64,
    /// Published targets that were not finite, outside the limits, further from the command than the envelope, or faster.
    pub(super) invariants_broken: u64,
    pub(super) vibration: Vec<Event>,
    pub(super) ringing: Ringing,
    pub(super) latency_ns: Latency,
    /// What the daemon's model lacks.
    pub(super) lacking: Vec<String>,
}

/// Tool error without and with correction.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Errors {
    pub(super) without: Spread,
    pub(super) with: Spread,
}

/// Mean, 95 % and largest.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
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
pub(super) struct Event {
    pub(super) t_s: f64,
    pub(super) state: String,
    pub(super) frequency_Hz: f64,
    pub(super) amplitude_N: f64,
    pub(super) axis: String,
    pub(super) class: String,
    pub(super) suspect_alias: bool,
    /// All of it as a sentence, with what to do.
    pub(super) says: String,
    /// Since the robot began to ring; none before.
    pub(super) after_onset_ms: Option<f64>,
}

/// The truth about the ringing.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Ringing {
    pub(super) frequency_Hz: f64,
    pub(super) from_s: f64,
    pub(super) words: String,
}

/// Quantiles of the round trip, ns.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Latency {
    pub(super) p50: u64,
    pub(super) p99: u64,
    pub(super) p999: u64,
    pub(super) max: u64,
}
