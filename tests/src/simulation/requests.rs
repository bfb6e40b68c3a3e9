//! Actions of the daemon's other threads on the cycle: requests, models, wrenches, and full rings.

use super::invariant_monitor::InvariantMonitor;
use crate::rng::TestRng;
use corrector::Mode;
use daemon::exchange::{Exchange, LoadedModel};
use daemon::sensor_inputs::MeasuredWrench;
use physics::Model;
use std::sync::atomic::Ordering::Relaxed;

/// An invalid wrench, or one with a wrong time.
fn wrench(rng: &mut TestRng) -> MeasuredWrench {
    let wild = [f64::NAN, f64::INFINITY, -1e300, 1e-320, 1e9];
    let odd = rng.below(10) == 0;
    let mut number = |size: f64| match odd {
        true => wild[rng.below(5) as usize],
        false => size * (rng.uniform() - 0.5),
    };
    let wrench = [number(200.0), number(200.0), number(200.0), number(10.0), number(10.0), 0.0];
    let t_ns = if odd { rng.next_u64() } else { u64::MAX };
    MeasuredWrench { wrench, in_base: true, t_ns, faulty: false }
}

/// Now and then one of everything.
pub(super) fn give(rng: &mut TestRng, exchange: &Exchange, models: &[Model; 2]) {
    if rng.below(10) == 0 {
        exchange.newest_wrench.force_push(wrench(rng));
    }
    match rng.below(1000) {
        0..3 => exchange.bypassed.store(rng.below(2) == 0, Relaxed),
        3..6 => {
            let mode = [Mode::Shadow, Mode::Limited, Mode::Full][rng.below(3) as usize];
            exchange.set_mode(mode);
        }
        6..12 if exchange.next_model.is_empty() => {
            // Like the supervisor: only while there is room for the returned model.
            while exchange.retired_models.pop().is_some() {}
            let epoch = 2 + rng.below(1000);
            let physics = models[rng.below(2) as usize];
            let _ = exchange.next_model.push(Box::new(LoadedModel::new(physics, epoch)));
        }
        12 => exchange.rearm_wrench.store(true, Relaxed),
        13 => exchange.spindle_rpm_bits.store(rng.next_u64(), Relaxed),
        _ => {}
    }
}

/// After a storm: no bypass, no wrench.
pub(super) fn calm(exchange: &Exchange) {
    exchange.bypassed.store(false, Relaxed);
    while exchange.newest_wrench.pop().is_some() {}
}

/// The recorder empties its ring, or sleeps for a long time.
pub(super) fn drain(
    rng: &mut TestRng,
    exchange: &Exchange,
    storms: bool,
    watch: &mut InvariantMonitor,
) {
    let sleeps = if storms { 4000 } else { 20 };
    if rng.below(sleeps) == 0 {
        while exchange.cycles.pop().is_some() {
            watch.recorded += 1;
        }
    }
    while exchange.path.pop().is_some() {}
}
