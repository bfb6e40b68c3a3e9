//! Cuts predicted by `spectrum::stability`, compared with time-domain simulation
//! (`world::regeneration`), which includes teeth that leave the cut.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use glam::{DVec2, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use spectrum::stability::{CutAxes, Cutter, FlexibleMode, Stability};
use std::f64::consts::{FRAC_PI_2, PI};
use world::regeneration::{Regeneration, ToolMode};

const CUTS: usize = 40;
/// Cuts closer to the limit than this share of their depth are not compared.
const BORDER: f64 = 0.05;
const STEPS_PER_TOOTH: usize = 400;
const PASSINGS: usize = 400;

/// A random process: one or two modes, a cutter, a speed with regeneration from tooth to tooth.
struct Drawn {
    modes: Vec<ToolMode>,
    cutter: world::cutter::Cutter,
}

fn between(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

impl Drawn {
    fn new(rng: &mut ChaCha8Rng) -> Self {
        let frequency_hz = between(rng, 60.0, 900.0);
        let stiffness_n_per_m = between(rng, 1e6, 2e7);
        let first = between(rng, 0.0, PI);
        let mode = |frequency_hz, damping_ratio, angle| ToolMode {
            direction: DVec2::from_angle(angle),
            frequency_hz,
            damping_ratio,
            stiffness_n_per_m,
        };
        let mut modes = vec![mode(frequency_hz, between(rng, 0.01, 0.05), first)];
        if rng.random::<f64>() < 0.6 {
            let above_hz = frequency_hz * between(rng, 1.05, 1.4);
            modes.push(mode(above_hz, between(rng, 0.01, 0.05), first + FRAC_PI_2));
        }
        let teeth = 1 + (4.0 * rng.random::<f64>()) as u32;
        let arc_rad = between(rng, 0.6, PI);
        let is_up = rng.random::<bool>();
        let (entry_rad, exit_rad) = if is_up { (0.0, arc_rad) } else { (PI - arc_rad, PI) };
        let tangential = between(rng, 600e6, 900e6);
        let cutter = world::cutter::Cutter {
            teeth,
            spindle_hz: frequency_hz / between(rng, 0.4, 4.0) / f64::from(teeth),
            axial_depth_m: 0.0,
            entry_rad,
            exit_rad,
            chip_n_m2: DVec3::new(tangential, between(rng, 0.1, 0.5) * tangential, 0.0),
            edge_n_m: DVec3::ZERO,
        };
        Self { modes, cutter }
    }

    fn spindle_rpm(&self) -> f64 {
        60.0 * self.cutter.spindle_hz
    }

    fn predicted(&self) -> Stability {
        let mode = |one: &ToolMode| FlexibleMode {
            frequency_hz: one.frequency_hz,
            damping_ratio: one.damping_ratio,
            stiffness_n_per_m: one.stiffness_n_per_m,
            direction: [one.direction.x, one.direction.y, 0.0],
        };
        let cutter = Cutter {
            teeth: self.cutter.teeth,
            diameter_m: 0.01,
            helix_rad: 0.0,
            entry_rad: self.cutter.entry_rad,
            exit_rad: self.cutter.exit_rad,
            turning: false,
            chip_n_m2: self.cutter.chip_n_m2.into(),
        };
        let axes = CutAxes::new([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]).unwrap();
        Stability::new(&self.modes.iter().map(mode).collect::<Vec<_>>(), cutter, axes).unwrap()
    }

    /// Whether a small disturbance decays at a depth: the motion beyond the forced one late in the
    /// cut, compared with earlier.
    fn dies_out(&self, axial_depth_m: f64) -> bool {
        let cutter = world::cutter::Cutter { axial_depth_m, ..self.cutter };
        // The feed is so large that the disturbance alone lifts no tooth out of the cut.
        let feed_m_s = 1e-4 * cutter.tooth_passing_hz();
        let mut cut = Regeneration::new(cutter, feed_m_s, &[], &self.modes, STEPS_PER_TOOTH);
        let mut sums = [0.0; 2];
        for k in 0..PASSINGS * STEPS_PER_TOOTH {
            let push = if k < STEPS_PER_TOOTH { DVec2::new(0.02, 0.03) } else { DVec2::ZERO };
            let step = cut.next(1.0, push);
            let regenerative = (step.tool - step.forced).length_squared();
            match 4 * k / (PASSINGS * STEPS_PER_TOOTH) {
                1 => sums[0] += regenerative,
                3 => sums[1] += regenerative,
                _ => {}
            }
        }
        sums[1] < 0.7 * sums[0]
    }
}

#[test]
fn forty_simulated_cuts_fall_on_the_predicted_side() {
    let mut rng = ChaCha8Rng::seed_from_u64(17);
    let (mut stable, mut judged) = (0, 0);
    while judged < CUTS {
        let drawn = Drawn::new(&mut rng);
        let predicted = drawn.predicted();
        let Some(limit) = predicted.limit(drawn.spindle_rpm(), 0.1).unwrap() else { continue };
        let depth_m = limit.depth_m * between(&mut rng, -0.7, 0.7).exp();
        let holds = |part: f64| {
            predicted.multiplier(drawn.spindle_rpm(), part * depth_m).unwrap().norm() < 1.0
        };
        let is_stable = holds(1.0);
        if holds(1.0 - BORDER) != is_stable || holds(1.0 + BORDER) != is_stable {
            continue;
        }
        judged += 1;
        stable += usize::from(is_stable);
        assert_eq!(
            drawn.dies_out(depth_m),
            is_stable,
            "{depth_m} m, {:.2} of the limit, at {:.0} rpm, {:?} with {:?}",
            depth_m / limit.depth_m,
            drawn.spindle_rpm(),
            drawn.cutter,
            drawn.modes
        );
    }
    println!("{judged} cuts, {stable} of them stable");
    assert!(stable > 10 && stable < 30, "{stable} of {judged} are stable");
}
