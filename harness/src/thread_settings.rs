//! Real-time settings of the measuring threads: core, policy, memory locked.
//!
//! If a requested setting is refused, the bench ends; threads that are not part of the measurement
//! keep the ordinary policy. Settings are per thread, not for the whole process.

use daemon::realtime::{self, RealtimeRefused};
use rustix::thread::{CpuSet, sched_getaffinity};

use crate::error::BenchError;
use crate::plan::Policy;

/// Settings of a measuring thread.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ThreadSettings {
    pub(crate) core: usize,
    pub(crate) policy: Policy,
    pub(crate) priority: u8,
}

impl ThreadSettings {
    /// Applies them to the calling thread.
    pub(crate) fn apply(self) -> Result<(), RealtimeRefused> {
        realtime::minimize_timer_slack();
        realtime::pin_to(self.core)?;
        match self.policy {
            Policy::Fifo => realtime::set_fifo(self.priority),
            Policy::Other => Ok(()),
        }
    }

    /// The same with a priority higher by one: for observing a thread that spins.
    pub(crate) fn with_higher_priority(self) -> Self {
        Self { priority: (self.priority + 1).min(99), ..self }
    }
}

/// Whether this process may use the real-time policy at this priority, and lock memory.
#[must_use]
pub fn fifo_is_granted(priority: u8) -> bool {
    try_fifo(priority).is_ok() && realtime::lock_memory().is_ok()
}

/// Requests the real-time policy in a thread that ends at once.
pub(crate) fn try_fifo(priority: u8) -> Result<(), RealtimeRefused> {
    std::thread::spawn(move || realtime::set_fifo(priority)).join().unwrap_or(Ok(()))
}

/// The cores that this process may run on.
pub(crate) fn allowed_cores() -> Vec<usize> {
    let Ok(set) = sched_getaffinity(None) else { return Vec::new() };
    (0..CpuSet::MAX_CPU).filter(|core| set.is_set(*core)).collect()
}

/// The client's core and the daemon's: as requested, otherwise the last two isolated ones,
/// otherwise the last two.
pub(crate) fn choose_cores(
    requested: Option<[usize; 2]>,
    isolated: &[usize],
) -> Result<[usize; 2], BenchError> {
    let allowed = allowed_cores();
    choose(requested, isolated, &allowed)
}

fn choose(
    requested: Option<[usize; 2]>,
    isolated: &[usize],
    allowed: &[usize],
) -> Result<[usize; 2], BenchError> {
    if let Some([a, b]) = requested {
        if a != b && allowed.contains(&a) && allowed.contains(&b) {
            return Ok([a, b]);
        }
        let what = format!("cores {a} and {b}");
        return Err(BenchError::Cores { what, allowed: allowed.to_vec() });
    }
    let kept: Vec<usize> = isolated.iter().copied().filter(|core| allowed.contains(core)).collect();
    let from = if kept.len() >= 2 { &kept } else { allowed };
    match from {
        [.., a, b] => Ok([*a, *b]),
        _ => Err(BenchError::Cores { what: "no cores named".into(), allowed: allowed.to_vec() }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn isolated_cores_are_taken_before_others_and_what_is_asked_before_all() {
        let allowed = [0, 1, 2, 3, 4];
        assert_eq!(choose(None, &[1, 2], &allowed).expect("two"), [1, 2]);
        assert_eq!(choose(None, &[2], &allowed).expect("two"), [3, 4]);
        assert_eq!(choose(Some([4, 0]), &[1, 2], &allowed).expect("two"), [4, 0]);
    }

    #[test]
    fn one_core_twice_or_a_core_that_is_not_ours_is_refused() {
        for cores in [Some([1, 1]), Some([1, 7]), None] {
            let allowed: &[usize] = if cores.is_some() { &[0, 1] } else { &[3] };
            assert!(matches!(choose(cores, &[], allowed), Err(BenchError::Cores { .. })));
        }
    }
}
