//! Detection of memory growth of long-running processes: by medians of thirds of the run,
//! insensitive to start-up and single peaks. The absolute size is not judged.

/// Largest ratio of the last third to the previous one that counts as constant. Freed pages are
/// returned late, and models differ in size.
pub const FLAT: f64 = 1.02;
/// Least number of samples per third; with fewer, the second third still belongs to the start-up.
const LEAST: usize = 60;

/// The medians of the three thirds, in order of time; `None` for too few samples.
#[must_use]
pub fn thirds(samples: &[u64]) -> Option<[u64; 3]> {
    let third = samples.len() / 3;
    if third < LEAST {
        return None;
    }
    Some([0, 1, 2].map(|k| {
        let mut part = samples[k * third..(k + 1) * third].to_vec();
        part.sort_unstable();
        part[third / 2]
    }))
}

/// Whether the last third exceeds the second by no more than [`FLAT`] allows; the first includes
/// the start.
#[must_use]
pub fn is_flat(thirds: [u64; 3]) -> bool {
    let [_, before, last] = thirds;
    last as f64 <= FLAT * before as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(samples: impl Iterator<Item = u64>) -> Option<bool> {
        thirds(&samples.collect::<Vec<_>>()).map(is_flat)
    }

    #[test]
    fn a_start_that_costs_and_a_peak_are_flat_and_what_grows_all_along_is_not() {
        let warm = |k: u64| 30_000 - 10_000 / (k + 1);
        assert_eq!(judged((0..180).map(warm)), Some(true));
        assert_eq!(judged((0..180).map(|k| if k == 179 { 90_000 } else { 30_000 })), Some(true));
        assert_eq!(judged((0..180).map(|k| 30_000 + 20 * k)), Some(false));
        // A comparison of the end with the larger of beginning and middle would accept this.
        let after_a_peak = |k: u64| if k < 3 { 40_000 } else { 30_000 + 20 * k };
        assert_eq!(judged((0..180).map(after_a_peak)), Some(false));
        assert_eq!(judged((0..179).map(|_| 1)), None);
    }
}
