//! Time of one step of the filter: six joints with delay, lag and mode at 1 kHz, without a horizon and with 128 setpoints known ahead. Lowest of 50 batches.
#![expect(clippy::expect_used, clippy::print_stdout, reason = "an example that prints a figure")]

use joint_dynamics::plant::{Mode, Plant, Plants, UncertainValue};
use joint_dynamics::{Filter, FilterTaps, TapsSettings};
use physics::JOINTS_MAX;
use std::hint::black_box;
use std::time::Instant;

const BATCH: u64 = 2000;

fn main() {
    let uncertain = |value| UncertainValue { value, sigma: 0.02 * value };
    let mode = Mode {
        frequency_hz: uncertain(8.0),
        damping_ratio: uncertain(0.02),
        participation: uncertain(1.0),
    };
    let plant = Plant {
        delays_s: vec![uncertain(0.018)],
        lags_s: vec![uncertain(0.012)],
        modes: vec![mode],
    };
    let plants = Plants { joints: vec![plant; 6], left_out: Vec::new() };
    let taps = FilterTaps::new(&plants, 0.001, &TapsSettings::default()).expect("taps");
    let mut filter = Filter::new(taps, [f64::INFINITY; JOINTS_MAX]);
    for known in [0, 128] {
        let ahead = [[0.1; JOINTS_MAX]; 128];
        let mut lowest_ns = f64::INFINITY;
        for batch in 0..50 {
            let start = Instant::now();
            for k in 0..BATCH {
                let cycle = batch * BATCH + k;
                let q = [1e-4 * (cycle % 1000) as f64; JOINTS_MAX];
                black_box(filter.step(black_box(&q), cycle * 1_000_000, &ahead[..known]));
            }
            lowest_ns = lowest_ns.min(start.elapsed().as_nanos() as f64 / BATCH as f64);
        }
        println!("{known:3} setpoints ahead: {lowest_ns:.0} ns a step");
    }
}
