//! Newest known position of the arm: written by the cycle, read by the supervisor.
//!
//! Lock-free; each joint's value is consistent, but the joints of one reading can be from two
//! adjacent cycles. Plausibility is not checked.

use shm_schema::JOINTS_MAX;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering::Relaxed};

/// The joint positions last reported by one source.
#[derive(Debug, Default)]
pub struct ReportedPosition {
    q: [AtomicU64; JOINTS_MAX],
    joints: AtomicU32,
    at_ns: AtomicU64,
}

/// A reading of a [`ReportedPosition`].
#[derive(Clone, Debug, PartialEq)]
pub struct PositionReading {
    /// Joint positions, rad or m.
    pub q: Vec<f64>,
    /// When they were reported, ns, by the cycle's clock.
    pub at_ns: u64,
}

impl ReportedPosition {
    /// Records a report of the joints' positions.
    pub fn store(&self, q: &[f64], at_ns: u64) {
        for (slot, q) in self.q.iter().zip(q) {
            slot.store(q.to_bits(), Relaxed);
        }
        self.joints.store(q.len().min(JOINTS_MAX) as u32, Relaxed);
        self.at_ns.store(at_ns, Relaxed);
    }

    /// The newest report; `None` before the first.
    #[must_use]
    pub fn reading(&self) -> Option<PositionReading> {
        let joints = self.joints.load(Relaxed) as usize;
        let q = self.q.iter().take(joints).map(|q| f64::from_bits(q.load(Relaxed))).collect();
        (joints > 0).then(|| PositionReading { q, at_ns: self.at_ns.load(Relaxed) })
    }
}

/// Last position of the arm.
#[derive(Debug, Default)]
pub struct Positions {
    /// By the newest command.
    pub commanded: ReportedPosition,
    /// By the newest measurement.
    pub measured: ReportedPosition,
}

/// A report that is older than another by more than this is ignored, ns.
const OUTDATED_NS: u64 = 1_000_000_000;

impl Positions {
    /// The positions that are up to date, each with the name of its source.
    #[must_use]
    pub fn newest(&self) -> Vec<(&'static str, PositionReading)> {
        let mut reading: Vec<(&str, PositionReading)> =
            [("commanded", &self.commanded), ("measured", &self.measured)]
                .into_iter()
                .filter_map(|(name, position)| Some((name, position.reading()?)))
                .collect();
        let newest_ns = reading.iter().map(|(_, reading)| reading.at_ns).max().unwrap_or(0);
        reading.retain(|(_, reading)| newest_ns - reading.at_ns <= OUTDATED_NS);
        reading
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_outdated_command_or_measurement_is_ignored() {
        let positions = Positions::default();
        assert!(positions.newest().is_empty());
        positions.commanded.store(&[1.0, 2.0], 5_000_000_000);
        positions.measured.store(&[1.1, 2.1], 5_900_000_000);
        assert_eq!(positions.newest().len(), 2);
        positions.measured.store(&[1.2, 2.2], 6_100_000_000);
        let [(name, reading)] = &positions.newest()[..] else { panic!("one of them") };
        assert_eq!((*name, &reading.q[..]), ("measured", &[1.2, 2.2][..]));
    }
}
