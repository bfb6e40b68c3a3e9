//! Back-to-back round trips of trued and of all reference transports, in alternating short chunks.
//!
//! Every chunk has a reference of bare atomics before and after it, between the same two cores;
//! while others are measured the daemon is stopped, because its cycle would take their core; chunks
//! are short and leave both cores to other processes in between, so that the kernel's fair server
//! does not stall spinning threads. Results are quantiles, not means.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use shm_schema::monotonic_ns;

use crate::bench_directory::BenchDirectory;
use crate::chunks::{BackToBack, Chunk, Chunks};
use crate::cyclictest;
use crate::error::BenchError;
use crate::latencies::Latencies;
use crate::measured_daemon::MeasuredDaemon;
use crate::peers::atomics::Atomics;
use crate::peers::echo::Echo;
use crate::peers::trued::Trued;
use crate::peers::{ANSWER_WITHIN, RoundTrip, Transport, WakeMode};
use crate::plan::{Programs, Stage};
use crate::thread_settings::ThreadSettings;

/// Duration of a chunk, ns: about that of a placement.
const CHUNK_NS: u64 = 5_000_000;
/// The same if each trip includes a wake-up.
const WOKEN_CHUNK_NS: u64 = 20_000_000;
/// Warm-up trips before a chunk.
const WARM_UP: usize = 64;
/// Time limit until the daemon corrects: it ramps in, with a wrench more slowly.
const SETTLES_WITHIN: Duration = Duration::from_secs(5);
/// The same before each of its chunks, after the arm was at rest during the other ones.
const RESUMES_WITHIN: Duration = Duration::from_millis(300);
/// Chunks of trued in a row: resuming corrections takes longer than a chunk.
const TRUED_CHUNKS_IN_ROW: u32 = 4;
/// Number of trips of a reference.
const REFERENCE_TRIPS: usize = 1000;
/// Time between two chunks in which both cores are left to other processes.
const YIELD_TIME: Duration = Duration::from_micros(500);

/// Context of the measurement.
pub(crate) struct BackToBackMeasurement<'a> {
    pub(crate) subject: &'a MeasuredDaemon,
    pub(crate) programs: &'a dyn Programs,
    pub(crate) place: &'a BenchDirectory,
    /// Settings of the measuring thread, and of the daemon's cycle.
    pub(crate) thread_settings: [ThreadSettings; 2],
    pub(crate) way: WakeMode,
    pub(crate) has_cyclictest: bool,
    pub(crate) seconds: f64,
    pub(crate) stop: &'a AtomicBool,
}

impl BackToBackMeasurement<'_> {
    /// Measures in a thread with the requested settings.
    pub(crate) fn run(&self) -> Result<BackToBack, BenchError> {
        let client = self.subject.client()?;
        std::thread::scope(|scope| {
            let measuring = scope.spawn(|| {
                // The answering side uses the core and the priority of the daemon's cycle, which
                // may spin there. The daemon is stopped until its own chunks, and at the end: the
                // other side releases the core first.
                self.stop_daemon()?;
                // The process is started before this thread is real-time, which it would inherit.
                let echo = match &self.subject.daemon {
                    Some(_) => {
                        Some(Echo::start(self.programs, self.place, self.thread_settings[1])?)
                    }
                    None => None,
                };
                self.thread_settings[0].apply()?;
                let mut trued = Trued::new(client);
                self.settle(&mut trued, SETTLES_WITHIN)?;
                self.measure(trued, echo)
            });
            measuring.join().unwrap_or(Err(BenchError::Thread(self.stage().name())))
        })
    }

    fn stage(&self) -> Stage {
        if self.way == WakeMode::Poll { Stage::Flat } else { Stage::Woken }
    }

    fn kinds(&self) -> Vec<Transport> {
        let is_measured = |kind: &Transport| match (&self.subject.daemon, self.way) {
            // The core of a running cell is not available.
            (None, _) => *kind == Transport::Trued,
            (Some(_), WakeMode::Poll) => *kind != Transport::Cyclictest,
            (Some(_), WakeMode::Wake) => {
                ![Transport::Trued, Transport::Bare].contains(kind)
                    && (*kind != Transport::Cyclictest || self.has_cyclictest)
            }
        };
        Transport::ALL.into_iter().filter(is_measured).collect()
    }

    fn measure(&self, mut trued: Trued, mut echo: Option<Echo>) -> Result<BackToBack, BenchError> {
        let mut atomics = match &self.subject.daemon {
            Some(_) => Some(Atomics::start(self.thread_settings[1])?),
            None => None,
        };
        let mut chunks = Chunks::default();
        let until_ns = monotonic_ns() + (self.seconds * 1e9) as u64;
        let mut rounds = 0;
        while rounds == 0 || monotonic_ns() < until_ns {
            for kind in self.kinds() {
                if self.stop.load(Relaxed) {
                    return Err(BenchError::Interrupted);
                }
                let mut row = 1;
                if kind == Transport::Trued {
                    self.settle(&mut trued, RESUMES_WITHIN)?;
                    row = TRUED_CHUNKS_IN_ROW;
                }
                for _ in 0..row {
                    let before_ns = reference(atomics.as_mut());
                    let (trips, lost) =
                        self.chunk(kind, &mut trued, atomics.as_mut(), echo.as_mut())?;
                    let after_ns = reference(atomics.as_mut());
                    chunks.push(Chunk { kind, before_ns, after_ns, trips, lost });
                    std::thread::sleep(YIELD_TIME);
                }
            }
            rounds += 1;
        }
        Ok(chunks.finish(trued.answers))
    }

    fn chunk(
        &self,
        kind: Transport,
        trued: &mut Trued,
        atomics: Option<&mut Atomics>,
        echo: Option<&mut Echo>,
    ) -> Result<(Latencies, u64), BenchError> {
        match (kind, atomics, echo) {
            (Transport::Trued, ..) => {
                self.resume_daemon();
                let counted = self.trips(trued);
                self.stop_daemon()?;
                Ok(counted)
            }
            (Transport::Cyclictest, ..) => {
                cyclictest::chunk(self.thread_settings[1]).map(|trips| (trips, 0))
            }
            (Transport::Bare, Some(atomics), _) => Ok(self.trips(&mut atomics.bare())),
            (Transport::Atomics, Some(atomics), _) => {
                Ok(self.trips(&mut atomics.copying(self.way)))
            }
            (kind, _, Some(echo)) => {
                let counted = self.trips(echo.begin(kind, self.way)?);
                echo.end(kind);
                Ok(counted)
            }
            _ => Ok((Latencies::default(), 0)),
        }
        .and_then(|counted| self.require_answers(counted))
    }

    /// A measurement without any answer is an error.
    fn require_answers(&self, counted: (Latencies, u64)) -> Result<(Latencies, u64), BenchError> {
        if counted.0.count() == 0 && counted.1 > 0 {
            let limit_ms = ANSWER_WITHIN.as_millis() as u64;
            return Err(BenchError::Silent { stage: self.stage().name(), limit_ms });
        }
        Ok(counted)
    }

    fn trips(&self, peer: &mut dyn RoundTrip) -> (Latencies, u64) {
        let mut seq = 0;
        let mut next = || {
            seq += 1;
            peer.round_trip(seq)
        };
        let warm_up = if self.way == WakeMode::Poll { WARM_UP } else { WARM_UP / 16 };
        let mut lost = 0;
        for _ in 0..warm_up {
            if next().is_none() {
                return (Latencies::default(), 1);
            }
        }
        let length_ns = if self.way == WakeMode::Poll { CHUNK_NS } else { WOKEN_CHUNK_NS };
        let until_ns = monotonic_ns() + length_ns;
        let mut trips = Latencies::default();
        while monotonic_ns() < until_ns && lost < 3 {
            match next() {
                Some(duration_ns) => trips.record(duration_ns),
                None => lost += 1,
            }
        }
        (trips, lost)
    }

    /// Lets the daemon correct a moving arm, before it is stopped for a reference.
    fn settle(&self, trued: &mut Trued, within: Duration) -> Result<(), BenchError> {
        self.resume_daemon();
        trued.settle(within);
        self.stop_daemon()
    }

    fn stop_daemon(&self) -> Result<(), BenchError> {
        match &self.subject.daemon {
            Some(daemon) if !daemon.stop() => Err(BenchError::part("daemon", "it does not stop")),
            _ => Ok(()),
        }
    }

    fn resume_daemon(&self) {
        if let Some(daemon) = &self.subject.daemon {
            daemon.resume();
        }
    }
}

/// The median of a few trips of one word, ns; zero without atomics.
fn reference(atomics: Option<&mut Atomics>) -> f64 {
    let Some(atomics) = atomics else { return 0.0 };
    let mut reference = atomics.bare();
    let mut trips: Vec<u64> =
        (0..REFERENCE_TRIPS).filter_map(|_| reference.round_trip(0)).collect();
    trips.sort_unstable();
    trips.get(trips.len() / 2).map_or(0.0, |ns| *ns as f64)
}
