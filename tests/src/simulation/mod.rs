//! The daemon's own cycle and the client's own output in one thread, in virtual time, with faults drawn by seed.
//!
//! The product's code is used: [`Cycle`] runs as in the daemon, over a simulated connection instead
//! of shared memory, and [`Output`](trued_client::Output) as in the client. The same seed gives the
//! same run, bit for bit. No threads, no real clock.

pub mod bridges;
mod client;
pub mod feed;
pub mod instrument;
mod invariant_monitor;
pub mod lead;
mod requests;
pub mod run;
mod wire;

use crate::place::MODEL;
use crate::rng::TestRng;
use corrector::{Corrector, Mode, Settings};
use daemon::cycle::Cycle;
use daemon::exchange::{Exchange, LoadedModel};
use daemon::robot::Robot;
use daemon::sensor_inputs::{SensorInputs, WrenchSource};
use daemon::setup;
use envelope::Limits;
use physics::Model;
use recording::model::presets::preset;
use std::collections::BTreeMap;
use std::sync::Arc;
use wire::FaultyLink;

/// Ticks with faults, then without: afterwards everything must be normal again.
const STORM_TICKS: u64 = 1500;
const CALM_TICKS: u64 = 1500;
/// Largest number of restarts of the daemon in a storm.
const RESTARTS_MAX: u64 = 3;

/// Result of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Targets published by the daemon, each checked against the invariants.
    pub cycles: u64,
    /// Ticks of the robot's loop, each with a target checked as well.
    pub ticks: u64,
    /// Storms of faults, each followed by a calm in which everything recovered.
    pub storms: u64,
    /// Time from the last fault of each storm until the daemon's own correction was sent again, ms.
    pub back_after_ms: Vec<u64>,
    /// Counts of the daemon's statuses and reasons, and of the sources of the client's targets.
    pub counts: BTreeMap<String, u64>,
    /// Hash of all published numbers: distinguishes two runs.
    pub hash: u64,
    /// The violation, as text; a run ends with the first.
    pub broken: Option<String>,
}

/// The correction's settings of one run of a daemon, with the usual limits, tighter or wider ones.
fn settings(mode: Mode, which: u64) -> Settings {
    let (angle, rate, jerk) =
        [(0.02, 0.05, 5.0), (0.001, 0.005, 0.5), (0.01, 0.1, 50.0)][which as usize % 3];
    let limits = Limits::new(angle, rate, jerk).expect("positive");
    Settings { mode, ..Settings::with_envelope(limits) }
}

/// The models that are swapped.
fn models() -> [Model; 2] {
    let full = preset(MODEL).and_then(|p| p.model().ok()).expect("a preset of the house").physics;
    [full, Model::nominal(full.arm)]
}

/// Runs until `cycles` targets were published, or a violation.
#[must_use]
pub fn run(seed: u64, cycles: u64) -> Summary {
    let mut chance = TestRng::new(seed);
    let models = models();
    let mut settings = settings(Mode::Full, 0);
    let mut wire = FaultyLink::new(chance.next_u64(), &setup::bounds(&settings, &models[0].arm));
    let mut mode = Mode::Full;
    while wire.watch.summary.cycles < cycles && wire.watch.summary.broken.is_none() {
        // Each daemon but the last ends during the storm.
        let lives = chance.below(RESTARTS_MAX);
        for life in 0..=lives {
            let last = life == lives;
            let ticks = if last { STORM_TICKS } else { 1 + chance.below(STORM_TICKS) };
            let exchange = Arc::new(Exchange::new(mode, true));
            settings = self::settings(mode, if last { 0 } else { chance.below(3) });
            let bounds = setup::bounds(&settings, &models[0].arm);
            let calm = if last { CALM_TICKS } else { 0 };
            wire.begin(Arc::clone(&exchange), models, bounds, [ticks, calm]);
            wire = lived(wire, &exchange, models[0], settings);
        }
        mode = [Mode::Full, Mode::Limited, Mode::Shadow][chance.below(3) as usize];
        wire.watch.summary.storms += 1;
    }
    wire.watch.summary
}

/// One life of a daemon, from its start to its end.
fn lived(wire: FaultyLink, exchange: &Exchange, physics: Model, settings: Settings) -> FaultyLink {
    let mut cycle = Cycle {
        robot: Robot::with_link(wire),
        corrector: Corrector::new(settings),
        model: Box::new(LoadedModel::new(physics, 1)),
        sensor_inputs: SensorInputs::new(WrenchSource::Force),
        stale_ns: settings.stale_ns,
        period_ns: settings.period_ns,
        lockstep: false,
    };
    cycle.run(exchange);
    cycle.robot.link
}
