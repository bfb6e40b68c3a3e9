//! Histograms of durations, and their summary.
//!
//! Three significant digits from 1 ns to 100 s; longer durations count as 100 s, and the maximum
//! shows it. A quantile is only shown if at least ten values are beyond it.

use hdrhistogram::Histogram;
use serde::Serialize;

const LONGEST_NS: u64 = 100_000_000_000;
/// Least number of values beyond a quantile that is shown.
const VALUES_BEYOND_MIN: f64 = 10.0;
/// The quantiles shown.
pub(crate) const SHARES: [f64; 6] = [0.5, 0.9, 0.99, 0.999, 0.9999, 0.99999];

/// A histogram of durations.
#[derive(Debug, Clone)]
pub struct Latencies(Histogram<u64>);

/// Quantiles, ns; all zero without data.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Quantiles {
    /// The median.
    pub p50: u64,
    /// 90 %.
    pub p90: u64,
    /// 99 %.
    pub p99: u64,
    /// 99.9 %.
    pub p999: u64,
    /// 99.99 %.
    pub p9999: u64,
    /// 99.999 %.
    pub p99999: u64,
    /// The maximum.
    pub max: u64,
    /// Number of durations.
    pub n: u64,
}

impl Default for Latencies {
    fn default() -> Self {
        let made = Histogram::new_with_bounds(1, LONGEST_NS, 3).or_else(|_| Histogram::new(3));
        // Both constructors are valid for these arguments.
        Self(made.unwrap_or_else(|_| unreachable!("three digits are allowed")))
    }
}

impl Latencies {
    /// Counts one duration. Never allocates.
    pub fn record(&mut self, duration_ns: u64) {
        self.0.saturating_record(duration_ns);
    }

    /// Adds the counts of another histogram.
    pub fn add(&mut self, other: &Self) {
        // Both have the same bounds, so that this cannot fail.
        let _ = self.0.add(&other.0);
    }

    /// Number of durations.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.0.len()
    }

    /// The value that this share of all does not exceed.
    #[must_use]
    pub fn at(&self, share: f64) -> u64 {
        self.0.value_at_quantile(share).min(self.0.max())
    }

    /// Summary.
    #[must_use]
    pub fn quantiles(&self) -> Quantiles {
        let [p50, p90, p99, p999, p9999, p99999] = SHARES.map(|share| self.at(share));
        Quantiles { p50, p90, p99, p999, p9999, p99999, max: self.0.max(), n: self.count() }
    }

    /// Points of the curve of quantiles: the inverse of the share beyond, and the value in µs. The last one is the largest value, one of all.
    #[must_use]
    pub fn curve(&self) -> Vec<(f64, f64)> {
        let last = self.count() as f64 / VALUES_BEYOND_MIN;
        let steps = (0_i32..).map(|k| 10_f64.powf(f64::from(k) / 8.0) * 1.25);
        steps
            .take_while(|one_in| *one_in <= last.max(2.0) && self.count() > 0)
            .map(|one_in| (one_in, self.at(1.0 - 1.0 / one_in) as f64 * 1e-3))
            .chain(self.worst())
            .collect()
    }
}

impl Latencies {
    /// The end of the curve: the largest value, which one of all reaches.
    fn worst(&self) -> Option<(f64, f64)> {
        (self.count() > 1).then(|| (self.count() as f64, self.0.max() as f64 * 1e-3))
    }
}

impl Quantiles {
    /// Number of values for which the quantile of this share is shown.
    #[must_use]
    pub fn trips_for(share: f64) -> u64 {
        (VALUES_BEYOND_MIN / (1.0 - share)).round() as u64
    }

    /// Each quantile below the maximum, if at least ten values are beyond it.
    #[must_use]
    pub fn supported_quantiles(&self) -> [Option<u64>; 6] {
        let values = [self.p50, self.p90, self.p99, self.p999, self.p9999, self.p99999];
        let mut sure = values.map(Some);
        for (value, share) in sure.iter_mut().zip(SHARES) {
            // The share is a decimal fraction: slightly less than ten, by rounding, counts as ten.
            if self.n as f64 * (1.0 - share) < VALUES_BEYOND_MIN - 1e-6 {
                *value = None;
            }
        }
        sure
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counted(n: u64) -> Latencies {
        let mut latencies = Latencies::default();
        (1..=n).for_each(|ns| latencies.record(ns));
        latencies
    }

    #[test]
    fn quantiles_are_right_to_three_digits_and_in_order() {
        let q = counted(100_000).quantiles();
        assert_eq!(q.n, 100_000);
        for (found, truth) in [(q.p50, 50_000.0), (q.p99, 99_000.0), (q.p999, 99_900.0)] {
            assert!((found as f64 / truth - 1.0).abs() < 1e-3, "{found} for {truth}");
        }
        let all = [q.p50, q.p90, q.p99, q.p999, q.p9999, q.p99999, q.max];
        assert!(all.windows(2).all(|pair| pair[0] <= pair[1]), "{all:?}");
    }

    #[test]
    fn a_quantile_with_fewer_than_ten_values_beyond_is_not_shown() {
        assert!(counted(9_999).quantiles().supported_quantiles()[3].is_none());
        assert!(counted(10_000).quantiles().supported_quantiles()[3].is_some());
        assert!(counted(10_000).quantiles().supported_quantiles()[4].is_none());
    }

    #[test]
    fn nothing_counted_is_reported_as_nothing() {
        assert_eq!(Latencies::default().quantiles(), Quantiles::default());
        assert!(Latencies::default().curve().is_empty());
    }

    #[test]
    fn a_curve_ends_at_the_largest_value() {
        let mut latencies = counted(1500);
        latencies.record(4_755_000);
        let curve = latencies.curve();
        let (one_in, worst_us) = curve.last().copied().unwrap_or_default();
        assert_eq!(one_in, 1501.0);
        assert!((worst_us / 4755.0 - 1.0).abs() < 1e-3, "{worst_us}");
        assert!(curve.windows(2).all(|pair| pair[0].0 < pair[1].0 && pair[0].1 <= pair[1].1));
    }

    #[test]
    fn a_duration_beyond_all_bounds_is_counted() {
        let mut latencies = Latencies::default();
        latencies.record(u64::MAX);
        assert_eq!(latencies.count(), 1);
        assert!(latencies.quantiles().max >= LONGEST_NS);
    }
}
