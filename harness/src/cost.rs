//! Computing time of a correction: by joints, by effects, by cells of one daemon.
//!
//! Promises: each figure comes from a daemon of its own, over shared memory. Of a correction the lowest median of many short batches counts, as what
//! others take of the machine comes on top; the solve's steps stand beside it. Never: a judgement: what is told is the straight line, and how far the
//! worst figure is off it.

use std::path::Path;
use std::time::Duration;

use daemon::pacer::sleep_until;
use serde::Serialize;
use shm_schema::monotonic_ns;
use trued_client::Client;

use crate::arms::arm;
use crate::error::BenchError;
use crate::manners::Manners;
use crate::peers::ANSWER_WITHIN;
use crate::peers::trued::Trued;
use crate::place::Place;
use crate::plan::{Plan, Programs, Stage, Wait};
use crate::subject::{JOIN_WITHIN, Served, Setup, Subject};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The most joints of a robot.
const JOINTS: usize = trued_client::JOINTS_MAX;
/// The joints of the robot whose effects are counted.
const SIX: usize = 6;
/// The most effects beside the gears, and how many come at a time.
const EFFECTS: usize = 100;
const EFFECTS_STEP: usize = 10;
/// The most cells of one daemon.
pub(crate) const CELLS: usize = 8;
/// Trips of a batch.
const BATCH: usize = 100;
/// Between two batches both cores are left to others for so long.
const GIVE_WAY: Duration = Duration::from_micros(500);
/// The rate at which each of several cells is commanded, Hz: so that eight fit on one core.
const CELL_RATE_HZ: u64 = 25;
/// All is measured so many times, and the lowest counts: somebody else may be at work for as long as one figure takes.
const PASSES: usize = 2;
/// The part of a bench's part that one figure takes in a pass, and its bounds, s.
const SHARE: f64 = 0.1;
const SECONDS: [f64; 2] = [0.1, 2.0];

/// One figure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Point {
    /// How many.
    pub n: usize,
    /// What that many cost, µs.
    pub cost_us: f64,
    /// The steps of the solve, or the commands without an answer.
    pub beside: u64,
}

/// The straight line through figures, by least squares.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Line {
    /// Of one more, µs.
    pub slope_us: f64,
    /// Of none, µs.
    pub none_us: f64,
    /// How far the worst figure is off the line, as a share of the line there.
    pub worst: f64,
    /// Which that is.
    pub worst_at: usize,
}

/// Figures of one kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Costs {
    /// By number.
    pub points: Vec<Point>,
    /// The line.
    pub line: Line,
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Cost {
    /// Time of one correction, by joints, each with a gear that is off.
    pub joints: Costs,
    /// Time of one correction of six joints, by effects beside their gears.
    pub effects: Costs,
    /// Processor time of the daemon in a second, by cells that are each commanded at [`Cost::cell_rate_hz`].
    pub cells: Costs,
    /// The rate of each cell, Hz.
    pub cell_rate_hz: u64,
}

impl Costs {
    fn of(points: Vec<Point>) -> Self {
        let line = Line::through(&points);
        Self { points, line }
    }
}

impl Line {
    fn through(points: &[Point]) -> Self {
        let n = points.len() as f64;
        let mean = |of: fn(&Point) -> f64| points.iter().map(of).sum::<f64>() / n;
        let (x, y) = (mean(|p| p.n as f64), mean(|p| p.cost_us));
        let off = |p: &Point| (p.n as f64 - x, p.cost_us - y);
        let (mut along, mut square) = (0.0, 0.0);
        for (dx, dy) in points.iter().map(off) {
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

/// What is needed to measure.
pub(crate) struct Costing<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) programs: &'a dyn Programs,
    pub(crate) place: &'a Place,
    /// Of the measuring thread, and of the daemon's cycle.
    pub(crate) manners: [Manners; 2],
    pub(crate) stop: &'a AtomicBool,
}

impl Costing<'_> {
    pub(crate) fn run(&self) -> Result<Cost, BenchError> {
        std::thread::scope(|scope| {
            let measuring = scope.spawn(|| {
                let by_effects = (0..=EFFECTS).step_by(EFFECTS_STEP);
                let joints = lowest(1..=JOINTS, |n| self.correction(n, &arm(n, 0)))?;
                let effects = lowest(by_effects, |n| self.correction(n, &arm(SIX, n)))?;
                let cells = lowest(1..=CELLS, |n| self.cells(n, &arm(SIX, 0)))?;
                Ok(Cost { joints, effects, cells, cell_rate_hz: CELL_RATE_HZ })
            });
            measuring.join().unwrap_or(Err(BenchError::Thread(Stage::Cost.name())))
        })
    }

    /// The time of one correction with that model.
    fn correction(&self, n: usize, model: &str) -> Result<Point, BenchError> {
        let subject = self.serving(model, 1, Wait::Spin, crate::FLAT_PERIOD_S)?;
        let mut trued = Trued::new(subject.client()?);
        // In a thread of its own: the next daemon is started by one that is not real-time.
        let lowest = std::thread::scope(|scope| {
            let measuring = scope.spawn(|| {
                self.manners[0].take()?;
                self.batches(&mut trued)
            });
            measuring.join().unwrap_or(Err(BenchError::Thread(Stage::Cost.name())))
        })?;
        let beside = trued.newest.map_or(0, |answer| u64::from(answer.iterations));
        Ok(Point { n, cost_us: lowest as f64 * 1e-3, beside })
    }

    /// The lowest median of the batches, ns.
    fn batches(&self, trued: &mut Trued) -> Result<u64, BenchError> {
        let until_ns = monotonic_ns() + (self.seconds() * 1e9) as u64;
        let mut lowest_ns = u64::MAX;
        while lowest_ns == u64::MAX || monotonic_ns() < until_ns {
            let mut times: Vec<u64> = (0..BATCH).filter_map(|_| made_in_ns(trued)).collect();
            if times.len() < BATCH / 2 {
                let limit_ms = ANSWER_WITHIN.as_millis() as u64;
                return Err(BenchError::Silent { stage: Stage::Cost.name(), limit_ms });
            }
            times.sort_unstable();
            lowest_ns = lowest_ns.min(times[times.len() / 2]);
            self.go_on()?;
            std::thread::sleep(GIVE_WAY);
        }
        Ok(lowest_ns)
    }

    /// The daemon's processor time in a second, with so many cells at work.
    fn cells(&self, n: usize, model: &str) -> Result<Point, BenchError> {
        let period_ns = 1_000_000_000 / CELL_RATE_HZ;
        let subject = self.serving(model, n, Wait::Sleep, period_ns as f64 * 1e-9)?;
        let joined = (0..n).map(|k| Client::connect(&self.place.cell(k), JOIN_WITHIN));
        let mut clients =
            joined.map(|c| Ok(Trued::new(c?))).collect::<Result<Vec<_>, BenchError>>()?;
        let daemon = subject.daemon.as_ref().ok_or(BenchError::Thread(Stage::Cost.name()))?;
        let cycles = (self.seconds() * CELL_RATE_HZ as f64) as u64;
        let mut command_all = |cycles: u64| -> Result<u64, BenchError> {
            // At the same time within the period whenever it is called.
            let (start_ns, mut lost) = ((monotonic_ns() / period_ns + 2) * period_ns, 0);
            for cycle in 0..cycles {
                for (k, trued) in clients.iter_mut().enumerate() {
                    sleep_until(start_ns + cycle * period_ns + k as u64 * period_ns / n as u64);
                    lost += u64::from(trued.command(ANSWER_WITHIN).1.is_none());
                }
                self.go_on()?;
            }
            Ok(lost)
        };
        // A quarter before it counts: a sleeping cycle has to learn when commands come.
        command_all(cycles / 4)?;
        let pid = daemon.0.id();
        let (before_ns, since_ns) = (processor_ns(pid)?, monotonic_ns());
        let beside = command_all(cycles)?;
        let (spent_ns, passed_ns) = (processor_ns(pid)? - before_ns, monotonic_ns() - since_ns);
        Ok(Point { n, cost_us: spent_ns as f64 / passed_ns as f64 * 1e6, beside })
    }

    fn serving(
        &self,
        model: &str,
        cells: usize,
        wait: Wait,
        period_s: f64,
    ) -> Result<Subject, BenchError> {
        self.go_on()?;
        let setup = Setup { manners: self.manners[1], wait, period_s, listens: false };
        Subject::start(self.programs, self.place, Served { model, cells }, setup)
    }

    fn seconds(&self) -> f64 {
        (SHARE * self.plan.seconds).clamp(SECONDS[0], SECONDS[1])
    }

    fn go_on(&self) -> Result<(), BenchError> {
        if self.stop.load(Relaxed) { Err(BenchError::Interrupted) } else { Ok(()) }
    }
}

/// The lowest figure of all passes, for each number.
fn lowest(
    numbers: impl IntoIterator<Item = usize>,
    measure: impl Fn(usize) -> Result<Point, BenchError>,
) -> Result<Costs, BenchError> {
    let mut points = numbers.into_iter().map(&measure).collect::<Result<Vec<_>, _>>()?;
    for _ in 1..PASSES {
        for point in &mut points {
            let again = measure(point.n)?;
            *point = if again.cost_us < point.cost_us { again } else { *point };
        }
    }
    Ok(Costs::of(points))
}

/// The time in the daemon of one round trip, ns.
fn made_in_ns(trued: &mut Trued) -> Option<u64> {
    trued.command(ANSWER_WITHIN).1?;
    trued.newest.map(|answer| answer.made_ns.saturating_sub(answer.received_ns))
}

/// What all threads of a process have had of processors, ns.
fn processor_ns(pid: u32) -> Result<u64, BenchError> {
    let dir = format!("/proc/{pid}/task");
    let unread = |path: &Path, e| BenchError::io("read the processor time in", path, e);
    let tasks = std::fs::read_dir(&dir).map_err(|e| unread(Path::new(&dir), e))?;
    let mut sum_ns = 0;
    for task in tasks.flatten() {
        let path = task.path().join("schedstat");
        let text = std::fs::read_to_string(&path).map_err(|e| unread(&path, e))?;
        let first = text.split_whitespace().next().and_then(|word| word.parse::<u64>().ok());
        sum_ns += first.unwrap_or(0);
    }
    Ok(sum_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(of: impl Fn(f64) -> f64) -> Vec<Point> {
        (1..=8).map(|n| Point { n, cost_us: of(n as f64), beside: 0 }).collect()
    }

    #[test]
    fn the_line_through_a_line_is_that_line() {
        let line = Line::through(&points(|n| 3.0 + 0.5 * n));
        assert!((line.slope_us - 0.5).abs() < 1e-12 && (line.none_us - 3.0).abs() < 1e-12);
        assert!(line.worst < 1e-12, "{line:?}");
    }

    #[test]
    fn what_grows_faster_than_a_line_is_told_by_its_worst_figure() {
        let line = Line::through(&points(|n| n * n));
        assert!(line.worst > 0.3, "{line:?}");
        let one_off = Line::through(&points(|n| 10.0 + n + if n == 4.0 { 5.0 } else { 0.0 }));
        assert_eq!(one_off.worst_at, 4, "{one_off:?}");
    }
}
