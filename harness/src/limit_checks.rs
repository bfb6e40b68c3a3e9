//! Acceptance limits of the figures: ratios of medians in one run, and counts.
//!
//! Parts that were not measured are not judged, nor are trips without a correction; near is
//! compared with near, far with far. Absolute tails are not judged, because on most machines they
//! depend mainly on the machine.

use serde::Serialize;

use crate::chunks::{BackToBack, TripLatencies};
use crate::findings::{Findings, Setting};
use crate::latencies::Latencies;
use crate::peers::Transport;

/// Least number of trips for a median.
const TRIPS_MIN: u64 = 100;
/// Least number of trips for a quantile of 99.9 %.
const TRIPS_MIN_FOR_P999: u64 = 10_000;
/// The rate at which missed cycles are counted, Hz.
const RATE_HZ: u32 = 1000;

/// One figure with its limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LimitCheck {
    /// The figure.
    pub what: String,
    /// The measured value.
    pub measured: f64,
    /// The largest accepted value.
    pub bar: f64,
    /// Unit; empty for a ratio or a count.
    pub unit: &'static str,
    /// Whether it is within the limit.
    pub ok: bool,
}

impl LimitCheck {
    fn new(what: impl Into<String>, measured: f64, limit: f64, unit: &'static str) -> Self {
        // False for NaN.
        Self { what: what.into(), measured, bar: limit, unit, ok: measured <= limit }
    }
}

/// Compares all measured figures with their limits.
#[must_use]
pub fn check_limits(findings: &Findings) -> Vec<LimitCheck> {
    let strict = || findings.settings.iter().filter(|s| s.policy == findings.machine.scheduling);
    let mut judged = Vec::new();
    let flat = strict().filter(|s| s.load.is_empty()).chain(strict()).find_map(|s| s.flat.as_ref());
    if let Some(flat) = flat.filter(|flat| flat.is_of_corrections()) {
        judged.extend(check_round_trips(flat));
    }
    judged.extend(strict().flat_map(check_missed));
    if let Some(starts) = findings.starts.as_ref().filter(|starts| starts.count() > 0) {
        let worst_ms = starts.quantiles().max as f64 * 1e-6;
        judged.push(LimitCheck::new(
            "first corrected target after a start, worst",
            worst_ms,
            100.0,
            "ms",
        ));
    }
    if let Some(swap) = findings.swap.as_ref().filter(|swap| swap.swaps > 0) {
        let beyond = swap.paced.missed_beyond_empty as f64;
        judged.push(LimitCheck::new(
            "cycles missed over model swaps, beyond the empty cycle's",
            beyond,
            0.0,
            "",
        ));
        let step = swap.step_over_bound;
        judged.push(LimitCheck::new(
            "largest step of the correction over a swap, over its bound",
            step,
            1.0,
            "",
        ));
    }
    judged
}

fn check_round_trips(flat: &BackToBack) -> Vec<LimitCheck> {
    let mut judged = Vec::new();
    type LatencySelector = fn(&TripLatencies) -> &Latencies;
    let placements: [(&str, LatencySelector, f64); 2] =
        [("near", |c| &c.near, 0.5), ("far", |c| &c.far, 0.7)];
    // With a single placement it is unknown which it is; the stricter limits apply.
    let parted = flat.sorter.threshold_ns.is_some();
    for (name, placed, unix_bar) in placements {
        let name = if parted { name } else { "one placement" };
        let of = |kind: Transport, count_min: u64| {
            let found = flat.counted.get(kind.index()).map(placed);
            found.filter(|latencies| latencies.count() >= count_min)
        };
        let mut median = |other: Transport, what: &str, bar: f64| {
            let both = of(Transport::Trued, TRIPS_MIN).zip(of(other, TRIPS_MIN));
            if let Some((trued, other)) = both {
                let ratio = trued.at(0.5) as f64 / other.at(0.5) as f64;
                judged.push(LimitCheck::new(
                    format!("round trip over {what}, {name}"),
                    ratio,
                    bar,
                    "",
                ));
            }
        };
        median(Transport::Iceoryx2, "plain iceoryx2", 2.0);
        median(Transport::Unix, "a Unix datagram", unix_bar);
        let both = of(Transport::Trued, TRIPS_MIN_FOR_P999)
            .zip(of(Transport::Atomics, TRIPS_MIN_FOR_P999));
        if let Some((trued, atomics)) = both {
            let spread = |l: &Latencies| l.at(0.999) as f64 / l.at(0.5) as f64;
            let ratio = spread(trued) / spread(atomics);
            let what = format!("p99.9 over p50, over that of atomics with a copy, {name}");
            judged.push(LimitCheck::new(what, ratio, 1.5, ""));
        }
    }
    judged
}

fn check_missed(setting: &Setting) -> Vec<LimitCheck> {
    let at_rate = setting.paced.iter().filter(|run| run.rate_hz == RATE_HZ);
    let judged = at_rate.map(|run| {
        let what = format!(
            "cycles missed at {RATE_HZ} Hz beyond the empty cycle's, of {}, {}, daemon by {}",
            run.paced.cycles,
            setting.load_name(),
            run.wait.name()
        );
        LimitCheck::new(what, run.paced.missed_beyond_empty as f64, 0.0, "")
    });
    judged.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::placement::PlacementClassifier;
    use std::collections::BTreeMap;

    fn counted(near_ns: u64, far_ns: u64, n: u64) -> TripLatencies {
        let filled = |ns: u64| {
            let mut latencies = Latencies::default();
            (0..n).for_each(|_| latencies.record(ns));
            latencies
        };
        TripLatencies { near: filled(near_ns), far: filled(far_ns), ..TripLatencies::default() }
    }

    fn flat(n: u64) -> BackToBack {
        let mut all = vec![TripLatencies::default(); Transport::ALL.len()];
        all[Transport::Trued.index()] = counted(1500, 4000, n);
        all[Transport::Iceoryx2.index()] = counted(700, 2300, n);
        all[Transport::Unix.index()] = counted(4000, 5000, n);
        all[Transport::Atomics.index()] = counted(140, 660, n);
        BackToBack {
            counted: all,
            sorter: PlacementClassifier { threshold_ns: Some(250.0) },
            reference: [Latencies::default(), Latencies::default()],
            correction: Latencies::default(),
            around: Latencies::default(),
            by_status: BTreeMap::new(),
            solved: 0,
        }
    }

    #[test]
    fn near_is_compared_with_near_and_far_with_far() {
        let judged = check_round_trips(&flat(20_000));
        assert_eq!(judged.len(), 6);
        let check = |what: &str| judged.iter().find(|j| j.what.contains(what)).expect("judged");
        assert!(!check("plain iceoryx2, near").ok && check("plain iceoryx2, far").ok);
        assert!(check("Unix datagram, near").ok && !check("Unix datagram, far").ok);
        assert!((check("atomics with a copy, near").measured - 1.0).abs() < 1e-9);
    }

    #[test]
    fn too_few_trips_are_not_judged() {
        assert_eq!(check_round_trips(&flat(99)).len(), 0);
        assert_eq!(check_round_trips(&flat(9_999)).len(), 4, "medians, no tails");
    }

    #[test]
    fn nan_is_not_within_its_bar() {
        assert!(!LimitCheck::new("nothing", f64::NAN, 1.0, "").ok);
    }
}
