//! Classification of chunks as near or far: a hypervisor moves virtual cores between the real ones,
//! which changes the latency of a cache line between two of them by a factor of five. Chunks are
//! classified by a reference measured before and after each.
//!
//! If the references do not form two groups there is one placement; a chunk whose two references
//! disagree belongs to none. The compared measurements are not used.

use serde::Serialize;

/// Relative placement of the two cores.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Placement {
    /// The only one, or the nearer of two.
    Near,
    /// The farther of two.
    Far,
    /// It changed within the chunk.
    Mixed,
}

/// Least ratio of the references between two groups.
const GROUP_RATIO_MIN: f64 = 2.0;
/// Share of the references that is ignored at either end.
const OUTLIER_SHARE: f64 = 0.05;

/// The threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacementClassifier {
    /// References above are far, ns; `None` if there is one placement.
    pub threshold_ns: Option<f64>,
}

impl PlacementClassifier {
    /// From all references of a run, ns.
    #[must_use]
    pub fn from_references(references_ns: &[f64]) -> Self {
        let mut sorted: Vec<f64> = references_ns.iter().copied().filter(|r| *r > 0.0).collect();
        sorted.sort_by(f64::total_cmp);
        let quantile =
            |share: f64| sorted.get((share * sorted.len().saturating_sub(1) as f64) as usize);
        let ends = quantile(OUTLIER_SHARE).zip(quantile(1.0 - OUTLIER_SHARE));
        let parted = ends.filter(|(low, high)| **high > GROUP_RATIO_MIN * **low);
        Self { threshold_ns: parted.map(|(low, high)| (low * high).sqrt()) }
    }

    /// Classifies a chunk by the references before and after it, ns.
    #[must_use]
    pub fn classify(&self, before_ns: f64, after_ns: f64) -> Placement {
        let Some(threshold_ns) = self.threshold_ns else { return Placement::Near };
        match (before_ns > threshold_ns, after_ns > threshold_ns) {
            (false, false) => Placement::Near,
            (true, true) => Placement::Far,
            _ => Placement::Mixed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_of_one_kind_are_one_placement_however_noisy() {
        let mut references: Vec<f64> = (0..100).map(|i| 100.0 + f64::from(i % 20)).collect();
        references[50] = 900.0;
        let sorter = PlacementClassifier::from_references(&references);
        assert_eq!(sorter.threshold_ns, None);
        assert_eq!(sorter.classify(100.0, 900.0), Placement::Near);
    }

    #[test]
    fn two_kinds_are_parted_and_a_change_within_a_chunk_is_seen() {
        let references: Vec<f64> =
            (0..100).map(|i| if i % 3 == 0 { 110.0 } else { 520.0 }).collect();
        let sorter = PlacementClassifier::from_references(&references);
        assert_eq!(sorter.classify(112.0, 108.0), Placement::Near);
        assert_eq!(sorter.classify(500.0, 530.0), Placement::Far);
        assert_eq!(sorter.classify(110.0, 530.0), Placement::Mixed);
    }

    #[test]
    fn nothing_measured_is_one_placement() {
        assert_eq!(PlacementClassifier::from_references(&[]).classify(1.0, 2.0), Placement::Near);
    }
}
