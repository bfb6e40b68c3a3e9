//! Real-time settings of a thread: policy, core, locked memory.
//!
//! A refused request is reported with its remedy; the configuration (`[realtime] enforce`) decides
//! whether it ends the daemon. Settings are per thread, because helper threads would inherit those
//! of the process.

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::thread::{CpuSet, sched_setaffinity};
use std::io;
use std::num::NonZeroU64;
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// A setting that the system refused.
#[derive(Debug, thiserror::Error)]
pub enum RealtimeRefused {
    /// `SCHED_FIFO`.
    #[error(
        "SCHED_FIFO priority {priority} was denied: {why}; it requires an RTPRIO limit of {priority} or more (LimitRTPRIO={priority} in a \
         unit, rtprio {priority} in /etc/security/limits.d), or CAP_SYS_NICE"
    )]
    Policy {
        /// 1 to 99.
        priority: u8,
        /// The system's error.
        why: io::Error,
    },
    /// Pinning to a core.
    #[error("pinning to core {core} was denied: {why}; choose a core that this process may use")]
    Core {
        /// 0-based.
        core: usize,
        /// The system's error.
        why: io::Error,
    },
    /// Locking memory.
    #[error(
        "locking memory was denied: {why}; it requires an infinite MEMLOCK limit (LimitMEMLOCK=infinity in a unit, memlock \
         unlimited in /etc/security/limits.d), or CAP_IPC_LOCK"
    )]
    Memory {
        /// The system's error.
        why: io::Error,
    },
}

/// Locks all memory of the process, present and future, into RAM.
///
/// # Errors
/// If the system refuses.
pub fn lock_memory() -> Result<(), RealtimeRefused> {
    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE)
        .map_err(|why| RealtimeRefused::Memory { why: why.into() })
}

/// Gives the calling thread `SCHED_FIFO` at `priority` (1 to 99).
///
/// # Errors
/// If the system refuses.
pub fn set_fifo(priority: u8) -> Result<(), RealtimeRefused> {
    let refused = |why: io::Error| RealtimeRefused::Policy { priority, why };
    let value =
        ThreadPriorityValue::try_from(priority).map_err(|why| refused(io::Error::other(why)))?;
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy)
        .map_err(|why| match why {
            thread_priority::Error::OS(code) => refused(io::Error::from_raw_os_error(code)),
            other => refused(io::Error::other(other)),
        })
}

/// Sets the timer slack of the calling thread to the least value; the default is 50 µs. Without
/// effect under a real-time policy, which has no slack; after a refusal, sleeps are only less
/// exact.
pub fn minimize_timer_slack() {
    let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
}

/// Pins the calling thread to one core.
///
/// # Errors
/// If the system refuses, or the core does not exist.
pub fn pin_to(core: usize) -> Result<(), RealtimeRefused> {
    if core >= CpuSet::MAX_CPU {
        let why = io::Error::from(io::ErrorKind::InvalidInput);
        return Err(RealtimeRefused::Core { core, why });
    }
    let mut set = CpuSet::new();
    set.set(core);
    sched_setaffinity(None, &set).map_err(|why| RealtimeRefused::Core { core, why: why.into() })
}
