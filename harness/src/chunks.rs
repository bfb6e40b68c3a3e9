//! Chunks of round trips, classified by the placement of the two cores during the measurement.
//!
//! Memory is bounded however long a bench runs; a chunk during which the placement changed counts
//! in the total only.

use std::collections::BTreeMap;

use trued_client::CorrectionStatus;

use crate::latencies::Latencies;
use crate::peers::Transport;
use crate::peers::trued::Answers;
use crate::placement::{Placement, PlacementClassifier};

/// Least share of answers with a solved correction; below it the round trips are not
/// representative.
const SOLVED_SHARE_MIN: f64 = 0.9;
/// Limit on chunks that wait for classification: the more there are, the better the placements are
/// known by then.
const PENDING_MAX: usize = 128;
/// Limit on stored references while they do not form two groups.
const REFERENCES_MAX: usize = 20_000;

/// Measurements of one kind.
#[derive(Debug, Clone, Default)]
pub struct TripLatencies {
    /// In all chunks.
    pub all: Latencies,
    /// In chunks of the near placement.
    pub near: Latencies,
    /// In chunks of the far placement.
    pub far: Latencies,
    /// Trips without an answer.
    pub lost: u64,
    /// Number of chunks: near, far, mixed.
    pub chunks: [u64; 3],
}

/// Results of the back-to-back part.
#[derive(Debug, Clone)]
pub struct BackToBack {
    /// By kind, in the order of [`Transport::ALL`]; empty if not measured.
    pub counted: Vec<TripLatencies>,
    /// Threshold between near and far.
    pub sorter: PlacementClassifier,
    /// Medians of the references, near and far.
    pub reference: [Latencies; 2],
    /// Time in the daemon.
    pub correction: Latencies,
    /// The round trip of trued without that time.
    pub around: Latencies,
    /// Number of the daemon's answers by status.
    pub by_status: BTreeMap<&'static str, u64>,
    /// Number of answers with a solved correction.
    pub solved: u64,
}

impl BackToBack {
    /// Share of the daemon's answers with a solved correction; `None` without answers.
    #[must_use]
    pub fn solved_share(&self) -> Option<f64> {
        let all: u64 = self.by_status.values().sum();
        (all > 0).then(|| self.solved as f64 / all as f64)
    }

    /// Whether its trips are those of a daemon that corrects, so that they may be compared.
    pub(crate) fn is_of_corrections(&self) -> bool {
        self.solved_share().is_none_or(|share| share >= SOLVED_SHARE_MIN)
    }
}

/// One measured chunk.
#[derive(Debug)]
pub(crate) struct Chunk {
    pub(crate) kind: Transport,
    /// The reference before it, ns.
    pub(crate) before_ns: f64,
    /// The reference after it, ns.
    pub(crate) after_ns: f64,
    pub(crate) trips: Latencies,
    pub(crate) lost: u64,
}

/// All chunks so far.
#[derive(Debug)]
pub(crate) struct Chunks {
    pending: Vec<Chunk>,
    references_ns: Vec<f64>,
    sorter: PlacementClassifier,
    counted: Vec<TripLatencies>,
    reference: [Latencies; 2],
}

impl Default for Chunks {
    fn default() -> Self {
        Self {
            pending: Vec::with_capacity(PENDING_MAX),
            references_ns: Vec::new(),
            sorter: PlacementClassifier { threshold_ns: None },
            counted: vec![TripLatencies::default(); Transport::ALL.len()],
            reference: [Latencies::default(), Latencies::default()],
        }
    }
}

impl Chunks {
    pub(crate) fn push(&mut self, chunk: Chunk) {
        if self.references_ns.len() >= REFERENCES_MAX {
            self.references_ns.drain(..REFERENCES_MAX / 2);
        }
        self.references_ns.extend([chunk.before_ns, chunk.after_ns]);
        self.pending.push(chunk);
        if self.pending.len() == PENDING_MAX {
            self.classify_pending();
        }
    }

    pub(crate) fn finish(mut self, answers: Answers) -> BackToBack {
        self.classify_pending();
        let by_status = CorrectionStatus::ALL.iter().zip(answers.by_status);
        let by_status = by_status.filter(|(_, n)| *n > 0).map(|(status, n)| (status.name(), n));
        BackToBack {
            counted: self.counted,
            sorter: self.sorter,
            reference: self.reference,
            correction: answers.correction,
            around: answers.around,
            by_status: by_status.collect(),
            solved: answers.solved,
        }
    }

    fn classify_pending(&mut self) {
        // Once split, the threshold is kept: chunks already classified cannot be classified again.
        if self.sorter.threshold_ns.is_none() {
            self.sorter = PlacementClassifier::from_references(&self.references_ns);
            self.relabel_single_placement();
        }
        for chunk in self.pending.drain(..) {
            let of = &mut self.counted[chunk.kind.index()];
            let placement = self.sorter.classify(chunk.before_ns, chunk.after_ns);
            of.all.add(&chunk.trips);
            of.lost += chunk.lost;
            of.chunks[placement as usize] += 1;
            match placement {
                Placement::Near => of.near.add(&chunk.trips),
                Placement::Far => of.far.add(&chunk.trips),
                Placement::Mixed => continue,
            }
            self.reference[placement as usize].record(chunk.before_ns as u64);
        }
    }

    /// The only placement so far may turn out to be the far one.
    fn relabel_single_placement(&mut self) {
        let Some(threshold_ns) = self.sorter.threshold_ns else { return };
        if self.reference[0].at(0.5) as f64 <= threshold_ns {
            return;
        }
        self.reference.swap(0, 1);
        for of in &mut self.counted {
            std::mem::swap(&mut of.near, &mut of.far);
            of.chunks.swap(0, 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunk(reference_ns: f64, trip_ns: u64) -> Chunk {
        let mut trips = Latencies::default();
        trips.record(trip_ns);
        let (before_ns, after_ns) = (reference_ns, reference_ns);
        Chunk { kind: Transport::Unix, before_ns, after_ns, trips, lost: 0 }
    }

    #[test]
    fn chunks_sorted_before_the_nearer_placement_was_seen_are_named_again() {
        let mut chunks = Chunks::default();
        (0..PENDING_MAX).for_each(|_| chunks.push(chunk(500.0, 5000)));
        assert!(chunks.pending.is_empty());
        (0..PENDING_MAX).for_each(|_| chunks.push(chunk(100.0, 3000)));
        let unix = &chunks.counted[Transport::Unix.index()];
        assert_eq!(unix.chunks, [PENDING_MAX as u64, PENDING_MAX as u64, 0]);
        assert!(unix.near.at(0.5) < 4000 && unix.far.at(0.5) > 4000);
    }
}
