//! Latency of the cycle, counted by the cycle and read by the supervisor.
//!
//! Recording takes relaxed loads and stores, no lock and no allocation; a quantile is accurate to
//! 1/16 of its value (log-linear buckets).

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use shm_schema::{LATENCY_BUCKETS, latency_below_ns};

/// Buckets in each doubling of the value.
const PER_OCTAVE: u64 = 16;
/// Doublings covered: up to 2⁴⁰ ns, about 18 minutes.
const OCTAVES: u64 = 40;

/// A histogram of durations in ns.
#[derive(Debug)]
pub struct Latency {
    buckets: Box<[AtomicU64]>,
    sum_ns: AtomicU64,
    worst_ns: AtomicU64,
}

/// Summary of the histogram, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Quantiles {
    /// The median.
    pub p50_ns: u64,
    /// 99 %.
    pub p99_ns: u64,
    /// 99.9 %.
    pub p999_ns: u64,
    /// The maximum, exact.
    pub max_ns: u64,
    /// Number of durations.
    pub count: u64,
    /// Their sum.
    pub sum_ns: u64,
    /// Counts in the buckets of a status, see [`latency_below_ns`].
    pub counts: [u64; LATENCY_BUCKETS],
}

impl Default for Latency {
    fn default() -> Self {
        let buckets = (0..PER_OCTAVE * OCTAVES).map(|_| AtomicU64::new(0)).collect();
        Self { buckets, sum_ns: AtomicU64::new(0), worst_ns: AtomicU64::new(0) }
    }
}

impl Latency {
    /// Counts one duration. Only one thread records, so that nothing is lost between a load and its
    /// store.
    pub fn record(&self, duration_ns: u64) {
        if let Some(bucket) = self.buckets.get(index_of(duration_ns)) {
            bucket.store(bucket.load(Relaxed) + 1, Relaxed);
        }
        self.sum_ns.store(self.sum_ns.load(Relaxed).saturating_add(duration_ns), Relaxed);
        if duration_ns > self.worst_ns.load(Relaxed) {
            self.worst_ns.store(duration_ns, Relaxed);
        }
    }

    /// The quantiles so far; zeros without data.
    pub fn quantiles(&self) -> Quantiles {
        let counts: Vec<u64> = self.buckets.iter().map(|bucket| bucket.load(Relaxed)).collect();
        let count: u64 = counts.iter().sum();
        let max_ns = self.worst_ns.load(Relaxed);
        let quantile = |share: f64| {
            let rank = (share * count as f64).ceil().max(1.0) as u64;
            let mut cumulative = 0;
            let found = counts.iter().position(|n| {
                cumulative += n;
                cumulative >= rank
            });
            found.map_or(0, |index| upper_edge_ns(index as u64).min(max_ns))
        };
        Quantiles {
            p50_ns: quantile(0.5),
            p99_ns: quantile(0.99),
            p999_ns: quantile(0.999),
            max_ns,
            count,
            sum_ns: self.sum_ns.load(Relaxed),
            counts: octave_counts(&counts),
        }
    }
}

/// The buckets of a status: each is an octave, hence a union of whole buckets of this histogram.
fn octave_counts(counts: &[u64]) -> [u64; LATENCY_BUCKETS] {
    let mut sums = [0; LATENCY_BUCKETS];
    let mut bucket = 0;
    for (index, count) in counts.iter().enumerate() {
        while latency_below_ns(bucket).is_some_and(|below| upper_edge_ns(index as u64) >= below) {
            bucket += 1;
        }
        sums[bucket] += count;
    }
    sums
}

/// Values below 16 have a bucket each; above, 16 buckets per octave.
fn index_of(value: u64) -> usize {
    if value < PER_OCTAVE {
        return value as usize;
    }
    let octave = u64::from(value.ilog2() - PER_OCTAVE.ilog2());
    let within = (value >> octave) - PER_OCTAVE;
    let index = (octave + 1) * PER_OCTAVE + within;
    index.min(PER_OCTAVE * OCTAVES - 1) as usize
}

fn upper_edge_ns(index: u64) -> u64 {
    if index < PER_OCTAVE {
        return index;
    }
    let octave = index / PER_OCTAVE - 1;
    ((index % PER_OCTAVE + PER_OCTAVE + 1) << octave) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_right_to_a_sixteenth() {
        let latency = Latency::default();
        (1..=100_000).for_each(|ns| latency.record(ns));
        let q = latency.quantiles();
        assert_eq!((q.count, q.max_ns), (100_000, 100_000));
        for (found, truth) in [(q.p50_ns, 50_000.0), (q.p99_ns, 99_000.0), (q.p999_ns, 99_900.0)] {
            let found = found as f64;
            assert!(found >= truth && found <= truth * (1.0 + 1.0 / 16.0), "{found} for {truth}");
        }
    }

    #[test]
    fn each_duration_is_in_the_bucket_of_the_status_that_its_bounds_say() {
        for duration in [0, 1023, 1024, 1500, 2047, 2048, 999_999, (1 << 25) - 1, 1 << 25, u64::MAX]
        {
            let latency = Latency::default();
            latency.record(duration);
            let q = latency.quantiles();
            let bucket = q.counts.iter().position(|count| *count == 1).expect("one bucket");
            assert!(latency_below_ns(bucket).is_none_or(|below| duration < below), "{duration}");
            let begins = bucket.checked_sub(1).and_then(latency_below_ns).unwrap_or(0);
            assert!(duration >= begins, "{duration} in the bucket from {begins}");
            assert_eq!((q.counts.iter().sum::<u64>(), q.sum_ns), (1, duration));
        }
    }

    #[test]
    fn buckets_follow_each_other_without_a_hole() {
        let mut last = 0;
        for value in 0..100_000_u64 {
            let index = index_of(value);
            assert!(index == last || index == last + 1, "{value} jumps from {last} to {index}");
            assert!(upper_edge_ns(index as u64) >= value);
            last = index;
        }
    }

    #[test]
    fn a_duration_beyond_the_last_bucket_is_still_counted() {
        let latency = Latency::default();
        latency.record(u64::MAX);
        assert_eq!(latency.quantiles().count, 1);
        assert_eq!(latency.quantiles().max_ns, u64::MAX);
    }
}
