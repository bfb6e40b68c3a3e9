//! Computing time of a stability chart: 200 spindle speeds, two modes, three teeth in a slot and at
//! half immersion.
//!
//! `cargo run --release -p spectrum --example stability_speed`
#![expect(clippy::print_stdout, reason = "what was measured is said")]

use spectrum::stability::{
    CutAxes, Cutter, FlexibleMode, Stability, StabilityError, limits_by_speed,
};
use std::f64::consts::{FRAC_PI_2, PI};
use std::time::Instant;

const POINTS: usize = 200;

fn main() -> Result<(), StabilityError> {
    let mode = |frequency_hz, stiffness_n_per_m, direction| FlexibleMode {
        frequency_hz,
        damping_ratio: 0.035,
        stiffness_n_per_m,
        direction,
    };
    let modes = [mode(603.0, 5.6e6, [1.0, 0.0, 0.0]), mode(666.0, 5.7e6, [0.0, 1.0, 0.0])];
    let axes = CutAxes::new([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])?;
    for (name, exit_rad) in [("slot", PI), ("half immersion", FRAC_PI_2)] {
        let cutter = Cutter {
            teeth: 3,
            diameter_m: 0.02,
            helix_rad: 0.0,
            entry_rad: 0.0,
            exit_rad,
            turning: false,
            chip_n_m2: [6e8, 4.2e7, 0.0],
        };
        let stability = Stability::new(&modes, cutter, axes)?;
        let start = Instant::now();
        let points = limits_by_speed(&stability, [4000.0, 20_000.0], POINTS, 0.05)?;
        println!("{name}: {} speeds in {:.2} s", points.len(), start.elapsed().as_secs_f64());
    }
    Ok(())
}
