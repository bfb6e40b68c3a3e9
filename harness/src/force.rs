//! Latency from force blocks to vibration verdicts.
//!
//! The bench simulates a sensor: noise, and an intermittent tone. A verdict contains the time of
//! its newest sample, which identifies the block that caused it, when that block was due and when
//! it was sent. A verdict is counted once; blocks sent and blocks received are compared at the end.
//! The sender never waits for the daemon.

use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use daemon::pacer::sleep_until;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use shm_schema::monotonic_ns;
use trued_client::{ForceSamples, ForceSource, Monitor, Samples, Verdict, WrenchFrame};

use crate::error::BenchError;
use crate::latencies::Latencies;
use crate::measured_daemon::{FORCE_RATE_HZ, MeasuredDaemon};
use crate::plan::Stage;
use crate::thread_settings::ThreadSettings;

/// Blocks per second.
pub(crate) const BLOCKS_PER_S: u64 = 1000;
const SAMPLES: usize = (FORCE_RATE_HZ as u64 / BLOCKS_PER_S) as usize;
const CHANNELS: usize = 3;
const BLOCK_NS: u64 = 1_000_000_000 / BLOCKS_PER_S;
/// Duration of pure noise at the start, in which the monitor learns the noise floor, s.
const LEARN_S: f64 = 1.5;
/// Duration of a tone, and of the pause after it, s.
const TONE_S: f64 = 0.2;
/// The tones, Hz, in turn: each causes separate lines.
const TONES_HZ: [f64; 3] = [83.0, 137.0, 211.0];
const TONE_N: f64 = 20.0;
const NOISE_N: f64 = 1.0;
/// Time limit until the last blocks are counted.
const SETTLE_WITHIN: Duration = Duration::from_secs(5);

/// Results.
#[derive(Debug, Clone, Default)]
pub struct Force {
    /// From the due time of a block to the verdict that it caused, at the client.
    pub scheduled: Latencies,
    /// From its actual sending.
    pub actual: Latencies,
    /// From its sending to the completion of the verdict in the daemon.
    pub one_way: Latencies,
    /// Blocks simulated.
    pub blocks: u64,
    /// Blocks received by the daemon.
    pub taken: u64,
    /// Blocks that could not be sent.
    pub lost: u64,
}

/// Context of the measurement.
pub(crate) struct ForceMeasurement<'a> {
    pub(crate) subject: &'a MeasuredDaemon,
    pub(crate) thread_settings: ThreadSettings,
    pub(crate) seconds: f64,
    pub(crate) stop: &'a AtomicBool,
}

impl ForceMeasurement<'_> {
    pub(crate) fn run(&self) -> Result<Force, BenchError> {
        let (source, monitor) = (self.subject.force()?, self.subject.monitor()?);
        std::thread::scope(|scope| {
            let measuring = scope.spawn(|| {
                self.thread_settings.apply()?;
                self.send_blocks(source, monitor)
            });
            measuring.join().unwrap_or(Err(BenchError::Thread(Stage::Force.name())))
        })
    }

    fn send_blocks(
        &self,
        mut source: ForceSource,
        mut monitor: Monitor,
    ) -> Result<Force, BenchError> {
        let taken_before = received_blocks(&mut monitor);
        let start_ns = monotonic_ns() + 10 * BLOCK_NS;
        let blocks = ((LEARN_S + self.seconds) * BLOCKS_PER_S as f64) as u64;
        let mut sent_ns: Vec<u64> = Vec::with_capacity(blocks as usize);
        let mut force = Force { blocks, ..Force::default() };
        let mut sensor = Sensor(ChaCha8Rng::seed_from_u64(1));
        let mut samples = [0.0; SAMPLES * CHANNELS];
        for block in 0..blocks {
            let due_ns = start_ns + block * BLOCK_NS;
            sensor.fill(&mut samples, block);
            self.poll_until(due_ns, &mut monitor, start_ns, &sent_ns, &mut force);
            sent_ns.push(monotonic_ns());
            let block = ForceSamples {
                t_ns: due_ns,
                rate_hz: FORCE_RATE_HZ,
                channels: CHANNELS,
                frame: WrenchFrame::Tool,
                samples: Samples::F64(&samples),
            };
            force.lost += u64::from(source.send(&block).is_err());
            if self.stop.load(Relaxed) {
                return Err(BenchError::Interrupted);
            }
        }
        let since = Instant::now();
        while since.elapsed() < SETTLE_WITHIN {
            force.taken = received_blocks(&mut monitor) - taken_before;
            if force.taken + force.lost >= blocks {
                break;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Ok(force)
    }

    /// Polls for verdicts until the next block is due.
    fn poll_until(
        &self,
        due_ns: u64,
        monitor: &mut Monitor,
        start_ns: u64,
        sent_ns: &[u64],
        force: &mut Force,
    ) {
        while monotonic_ns() < due_ns {
            while let Some(verdict) = monitor.vibration() {
                count(&verdict, monotonic_ns(), start_ns, sent_ns, force);
            }
            // Short sleeps: a core that is never released is eventually stalled by the kernel.
            sleep_until((monotonic_ns() + POLL_INTERVAL_NS).min(due_ns));
        }
    }
}

/// Polling interval of the bench, ns: the largest delay that it adds.
const POLL_INTERVAL_NS: u64 = 20_000;

/// Counts a verdict for the block that caused it.
fn count(verdict: &Verdict, here_ns: u64, start_ns: u64, sent_ns: &[u64], force: &mut Force) {
    let Some(block) = verdict.t_ns.checked_sub(start_ns).map(|t_ns| t_ns / BLOCK_NS) else {
        return;
    };
    let Some(sent_ns) = sent_ns.get(block as usize) else { return };
    let due_ns = start_ns + block * BLOCK_NS;
    force.scheduled.record(here_ns.saturating_sub(due_ns));
    force.actual.record(here_ns.saturating_sub(*sent_ns));
    force.one_way.record(verdict.made_ns.saturating_sub(*sent_ns));
}

fn received_blocks(monitor: &mut Monitor) -> u64 {
    monitor.status().map_or(0, |status| status.force_blocks)
}

/// The simulated sensor.
struct Sensor<R: Rng>(R);

impl<R: Rng> Sensor<R> {
    fn fill(&mut self, samples: &mut [f64; SAMPLES * CHANNELS], block: u64) {
        let first = block * SAMPLES as u64;
        for (i, frame) in samples.chunks_exact_mut(CHANNELS).enumerate() {
            let t_s = (first + i as u64) as f64 / FORCE_RATE_HZ;
            for (channel, value) in frame.iter_mut().enumerate() {
                // Uniform noise has a root mean square of its half width over the square root of
                // three.
                let noise = self.0.random_range(-1.0..1.0) * NOISE_N * 3_f64.sqrt();
                *value = noise + if channel == 1 { tone(t_s) } else { 0.0 };
            }
        }
    }
}

/// The tone at this time, N; zero between two tones and while the monitor learns.
fn tone(t_s: f64) -> f64 {
    let since_s = t_s - LEARN_S;
    let turn = (since_s / TONE_S).floor();
    if since_s < 0.0 || turn as u64 % 2 == 1 {
        return 0.0;
    }
    let frequency_hz = TONES_HZ[(turn as usize / 2) % TONES_HZ.len()];
    TONE_N * (TAU * frequency_hz * since_s).sin()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_verdict_is_counted_from_the_block_that_holds_its_newest_sample() {
        let start_ns = 1_000_000_000;
        let sent_ns = [start_ns + 5000, start_ns + BLOCK_NS + 7000];
        let t_ns = start_ns + BLOCK_NS + BLOCK_NS / 2;
        let here_ns = start_ns + BLOCK_NS + 107_000;
        let verdict = Verdict { t_ns, made_ns: here_ns - 40_000, ..Verdict::default() };
        let mut force = Force::default();
        count(&verdict, here_ns, start_ns, &sent_ns, &mut force);
        assert_eq!(force.actual.at(1.0), 100_031, "three digits of 100 000");
        assert!(force.scheduled.at(0.5) > force.actual.at(0.5));
        assert!(force.one_way.at(0.5) < force.actual.at(0.5));
        let foreign = Verdict { t_ns: 5, ..Verdict::default() };
        count(&foreign, here_ns, start_ns, &sent_ns, &mut force);
        assert_eq!(force.actual.count(), 1, "a verdict on somebody else's samples");
    }

    #[test]
    fn tones_come_and_go_after_the_floor_was_learned() {
        let loudest = |from_s: f64| {
            (0..1000).map(|i| tone(from_s + f64::from(i) * 1e-4).abs()).fold(0.0, f64::max)
        };
        assert_eq!(loudest(0.0), 0.0);
        assert!(loudest(LEARN_S) > 0.9 * TONE_N);
        assert_eq!(loudest(LEARN_S + TONE_S + 0.01), 0.0);
    }
}
