//! Computing time of a correction: by joints, by effects, by cells of one daemon.
//!
//! Each figure comes from a separate daemon, over shared memory. The time of a correction is the
//! lowest median of many short batches, because other load on the machine only adds to it; the
//! number of Newton steps is reported with it. The result is a straight line through the figures,
//! and the largest deviation from it.

use std::path::Path;
use std::time::Duration;

use daemon::pacer::sleep_until;
use serde::Serialize;
use shm_schema::monotonic_ns;
use trued_client::Client;

use crate::artificial_robots::robot_model;
use crate::bench_directory::BenchDirectory;
use crate::error::BenchError;
use crate::measured_daemon::{JOIN_WITHIN, MeasuredDaemon, ServedModel, Setup};
use crate::peers::ANSWER_WITHIN;
use crate::peers::trued::Trued;
use crate::plan::{Plan, Programs, Stage, Wait};
use crate::thread_settings::ThreadSettings;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Largest number of joints.
const JOINTS: usize = trued_client::JOINTS_MAX;
/// Number of joints of the robot for the measurement by effects.
const ARM_JOINTS: usize = 6;
/// Largest number of effects besides the gear errors, and the increment.
const EFFECTS: usize = 100;
const EFFECTS_STEP: usize = 10;
/// Largest number of cells of one daemon.
pub(crate) const CELLS: usize = 8;
/// Trips per batch.
const BATCH: usize = 100;
/// Time between two batches in which both cores are left to other processes.
const YIELD_TIME: Duration = Duration::from_micros(500);
/// Command rate of each of several cells, Hz: low enough for eight on one core.
const CELL_RATE_HZ: u64 = 25;
/// Number of passes, of which the lowest counts: other load may last as long as the measurement of
/// one figure.
const PASSES: usize = 2;
/// Share of a part's time for one figure in a pass, and its limits, s.
const TIME_SHARE: f64 = 0.1;
const TIME_LIMITS_S: [f64; 2] = [0.1, 2.0];

/// One figure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CostPoint {
    /// Number of joints, effects or cells.
    pub n: usize,
    /// Its cost, µs.
    pub cost_us: f64,
    /// Newton steps of the solve, or the commands without an answer.
    pub beside: u64,
}

/// Least-squares line through the figures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CostLine {
    /// Cost of one more, µs.
    pub slope_us: f64,
    /// Cost at zero, µs.
    pub none_us: f64,
    /// Largest relative deviation of a figure from the line.
    pub worst: f64,
    /// The number at which it occurs.
    pub worst_at: usize,
}

/// Figures of one kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CostSeries {
    /// By number.
    pub points: Vec<CostPoint>,
    /// The line.
    pub line: CostLine,
}

/// Results.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Cost {
    /// Time of one correction, by joints, each with a gear ratio error.
    pub joints: CostSeries,
    /// Time of one correction of six joints, by effects besides their gear errors.
    pub effects: CostSeries,
    /// Processor time of the daemon in a second, by cells that are each commanded at [`Cost::cell_rate_hz`].
    pub cells: CostSeries,
    /// The rate of each cell, Hz.
    pub cell_rate_hz: u64,
}

impl CostSeries {
    fn of(points: Vec<CostPoint>) -> Self {
        let line = CostLine::fit(&points);
        Self { points, line }
    }
}

impl CostLine {
    fn fit(points: &[CostPoint]) -> Self {
        let n = points.len() as f64;
        let mean = |of: fn(&CostPoint) -> f64| points.iter().map(of).sum::<f64>() / n;
        let (x, y) = (mean(|p| p.n as f64), mean(|p| p.cost_us));
        let deviation = |p: &CostPoint| (p.n as f64 - x, p.cost_us - y);
        let (mut along, mut square) = (0.0, 0.0);
        for (dx, dy) in points.iter().map(deviation) {
            along += dx * dy;
            square += dx * dx;
        }
        let slope_us = along / square;
        let mut line = Self { slope_us, none_us: y - slope_us * x, worst: 0.0, worst_at: 0 };
        for point in points {
            let share = (point.cost_us / line.at(point.n) - 1.0).abs();
            if share >= line.worst {
                (line.worst, line.worst_at) = (share, point.n);
            }
        }
        line
    }

    /// The line's value, µs.
    #[must_use]
    pub fn at(&self, n: usize) -> f64 {
        self.none_us + self.slope_us * n as f64
    }
}

/// Context of the measurement.
pub(crate) struct CostMeasurement<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) programs: &'a dyn Programs,
    pub(crate) place: &'a BenchDirectory,
    /// Settings of the measuring thread, and of the daemon's cycle.
    pub(crate) thread_settings: [ThreadSettings; 2],
    pub(crate) stop: &'a AtomicBool,
}

impl CostMeasurement<'_> {
    pub(crate) fn run(&self) -> Result<Cost, BenchError> {
        std::thread::scope(|scope| {
            let measuring = scope.spawn(|| {
                let by_effects = (0..=EFFECTS).step_by(EFFECTS_STEP);
                let joints = lowest(1..=JOINTS, |n| self.correction(n, &robot_model(n, 0)))?;
                let effects =
                    lowest(by_effects, |n| self.correction(n, &robot_model(ARM_JOINTS, n)))?;
                let cells = lowest(1..=CELLS, |n| self.cells(n, &robot_model(ARM_JOINTS, 0)))?;
                Ok(Cost { joints, effects, cells, cell_rate_hz: CELL_RATE_HZ })
            });
            measuring.join().unwrap_or(Err(BenchError::Thread(Stage::Cost.name())))
        })
    }

    /// The time of one correction with this model.
    fn correction(&self, n: usize, model: &str) -> Result<CostPoint, BenchError> {
        let subject = self.serving(model, 1, Wait::Spin, crate::FLAT_PERIOD_S)?;
        let mut trued = Trued::new(subject.client()?);
        // In a separate thread: the next daemon is started by a thread that is not real-time.
        let lowest = std::thread::scope(|scope| {
            let measuring = scope.spawn(|| {
                self.thread_settings[0].apply()?;
                self.batches(&mut trued)
            });
            measuring.join().unwrap_or(Err(BenchError::Thread(Stage::Cost.name())))
        })?;
        let beside = trued.newest.map_or(0, |answer| u64::from(answer.iterations));
        Ok(CostPoint { n, cost_us: lowest as f64 * 1e-3, beside })
    }

    /// The lowest median of the batches, ns.
    fn batches(&self, trued: &mut Trued) -> Result<u64, BenchError> {
        let until_ns = monotonic_ns() + (self.seconds() * 1e9) as u64;
        let mut lowest_ns = u64::MAX;
        while lowest_ns == u64::MAX || monotonic_ns() < until_ns {
            let mut times: Vec<u64> =
                (0..BATCH).filter_map(|_| correction_time_ns(trued)).collect();
            if times.len() < BATCH / 2 {
                let limit_ms = ANSWER_WITHIN.as_millis() as u64;
                return Err(BenchError::Silent { stage: Stage::Cost.name(), limit_ms });
            }
            times.sort_unstable();
            lowest_ns = lowest_ns.min(times[times.len() / 2]);
            self.check_interrupted()?;
            std::thread::sleep(YIELD_TIME);
        }
        Ok(lowest_ns)
    }

    /// The daemon's processor time in a second, with `n` cells running.
    fn cells(&self, n: usize, model: &str) -> Result<CostPoint, BenchError> {
        let period_ns = 1_000_000_000 / CELL_RATE_HZ;
        let subject = self.serving(model, n, Wait::Sleep, period_ns as f64 * 1e-9)?;
        let joined = (0..n).map(|k| Client::connect(&self.place.cell(k), JOIN_WITHIN));
        let mut clients =
            joined.map(|c| Ok(Trued::new(c?))).collect::<Result<Vec<_>, BenchError>>()?;
        let daemon = subject.daemon.as_ref().ok_or(BenchError::Thread(Stage::Cost.name()))?;
        let cycles = (self.seconds() * CELL_RATE_HZ as f64) as u64;
        let mut command_all = |cycles: u64| -> Result<u64, BenchError> {
            // At the same phase of the period in every call.
            let (start_ns, mut lost) = ((monotonic_ns() / period_ns + 2) * period_ns, 0);
            for cycle in 0..cycles {
                for (k, trued) in clients.iter_mut().enumerate() {
                    sleep_until(start_ns + cycle * period_ns + k as u64 * period_ns / n as u64);
                    lost += u64::from(trued.command(ANSWER_WITHIN).1.is_none());
                }
                self.check_interrupted()?;
            }
            Ok(lost)
        };
        // A quarter of the cycles as warm-up: a sleeping cycle has to learn when commands arrive.
        command_all(cycles / 4)?;
        let pid = daemon.0.id();
        let (before_ns, since_ns) = (processor_ns(pid)?, monotonic_ns());
        let beside = command_all(cycles)?;
        let (spent_ns, passed_ns) = (processor_ns(pid)? - before_ns, monotonic_ns() - since_ns);
        Ok(CostPoint { n, cost_us: spent_ns as f64 / passed_ns as f64 * 1e6, beside })
    }

    fn serving(
        &self,
        model: &str,
        cells: usize,
        wait: Wait,
        period_s: f64,
    ) -> Result<MeasuredDaemon, BenchError> {
        self.check_interrupted()?;
        let setup =
            Setup { thread_settings: self.thread_settings[1], wait, period_s, listens: false };
        MeasuredDaemon::start(self.programs, self.place, ServedModel { model, cells }, setup)
    }

    fn seconds(&self) -> f64 {
        (TIME_SHARE * self.plan.seconds).clamp(TIME_LIMITS_S[0], TIME_LIMITS_S[1])
    }

    fn check_interrupted(&self) -> Result<(), BenchError> {
        if self.stop.load(Relaxed) { Err(BenchError::Interrupted) } else { Ok(()) }
    }
}

/// The lowest figure of all passes, for each number.
fn lowest(
    numbers: impl IntoIterator<Item = usize>,
    measure: impl Fn(usize) -> Result<CostPoint, BenchError>,
) -> Result<CostSeries, BenchError> {
    let mut points = numbers.into_iter().map(&measure).collect::<Result<Vec<_>, _>>()?;
    for _ in 1..PASSES {
        for point in &mut points {
            let again = measure(point.n)?;
            *point = if again.cost_us < point.cost_us { again } else { *point };
        }
    }
    Ok(CostSeries::of(points))
}

/// The time of one round trip in the daemon, ns.
fn correction_time_ns(trued: &mut Trued) -> Option<u64> {
    trued.command(ANSWER_WITHIN).1?;
    trued.newest.map(|answer| answer.made_ns.saturating_sub(answer.received_ns))
}

/// Processor time of all threads of a process, ns.
fn processor_ns(pid: u32) -> Result<u64, BenchError> {
    let dir = format!("/proc/{pid}/task");
    let unread = |path: &Path, e| BenchError::io("read the processor time in", path, e);
    let tasks = std::fs::read_dir(&dir).map_err(|e| unread(Path::new(&dir), e))?;
    let mut sum_ns = 0;
    for task in tasks.flatten() {
        let path = task.path().join("schedstat");
        let text = std::fs::read_to_string(&path).map_err(|e| unread(&path, e))?;
        let first = text.split_whitespace().next().and_then(|field| field.parse::<u64>().ok());
        sum_ns += first.unwrap_or(0);
    }
    Ok(sum_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(of: impl Fn(f64) -> f64) -> Vec<CostPoint> {
        (1..=8).map(|n| CostPoint { n, cost_us: of(n as f64), beside: 0 }).collect()
    }

    #[test]
    fn the_line_through_a_line_is_that_line() {
        let line = CostLine::fit(&points(|n| 3.0 + 0.5 * n));
        assert!((line.slope_us - 0.5).abs() < 1e-12 && (line.none_us - 3.0).abs() < 1e-12);
        assert!(line.worst < 1e-12, "{line:?}");
    }

    #[test]
    fn nonlinear_growth_shows_in_the_largest_deviation() {
        let line = CostLine::fit(&points(|n| n * n));
        assert!(line.worst > 0.3, "{line:?}");
        let one_off = CostLine::fit(&points(|n| 10.0 + n + if n == 4.0 { 5.0 } else { 0.0 }));
        assert_eq!(one_off.worst_at, 4, "{one_off:?}");
    }
}
