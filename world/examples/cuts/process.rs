//! A random process: modes, cutter, engagement, and depth at its limit of stability.

use glam::{DVec2, DVec3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};
use world::cutter::Cutter;
use world::random::{Purpose, stream};
use world::regeneration::{Regeneration, ToolMode};

/// Approximate number of simulation steps per second.
const STEPS_HZ: f64 = 40_000.0;
/// Range of depths in which the limit of stability is searched, m.
const DEPTHS_M: [f64; 2] = [1e-5, 2e-2];

/// Tangential stiffness of a cut at its limit, relative to that of the first mode.
const STIFFEST_CUT: f64 = 0.3;
/// Streams before this one are used by the record.
const FIRST_STREAM: u32 = 16;

/// A process for any depth of cut.
pub(crate) struct Process {
    pub(crate) cutter: Cutter,
    pub(crate) feed_m_s: f64,
    pub(crate) runout_m: Vec<f64>,
    pub(crate) modes: Vec<ToolMode>,
    /// Noise of the sensor per sample, standard deviation, N.
    pub(crate) noise_n: f64,
    /// Broadband part of the cutting force, relative to its mean.
    pub(crate) rough: f64,
    pub(crate) entry_s: f64,
    pub(crate) exit_s: f64,
    /// Rotation of the sensor about the tool's axis, rad.
    pub(crate) turned_rad: f64,
}

pub(crate) fn between(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

impl Process {
    /// The first of a seed's processes that has a limit: beyond it the tool is pulled into the cut
    /// faster than its modes can follow.
    pub(crate) fn with_limit(seed: u64) -> (Self, f64) {
        let mut tried = 0;
        loop {
            let process = Self::drawn(seed, tried);
            let limit_m = process.limit_m();
            let cut_n_per_m = limit_m * process.cutter.chip_n_m2.x;
            if cut_n_per_m < STIFFEST_CUT * process.modes[0].stiffness_n_per_m {
                return (process, limit_m);
            }
            tried += 1;
        }
    }

    /// The structure of a robot, or spindle and tool, in slot, up or down milling.
    fn drawn(seed: u64, tried: u32) -> Self {
        let rng = &mut stream(seed, Purpose::Regeneration, FIRST_STREAM + tried);
        let structure = rng.random::<f64>() < 0.5;
        let (frequency_hz, n_per_m) = if structure {
            (between(rng, 20.0, 130.0), between(rng, 0.5e6, 3e6))
        } else {
            (between(rng, 250.0, 900.0), between(rng, 4e6, 20e6))
        };
        let teeth = 2 + (3.0 * rng.random::<f64>()) as u32;
        let tooth_hz = frequency_hz * between(rng, 0.35, 3.0);
        let spindle_hz = (tooth_hz / f64::from(teeth)).clamp(8.0, 400.0);
        let (entry_rad, exit_rad) = match (3.0 * rng.random::<f64>()) as u32 {
            0 => (0.0, PI),
            1 => (0.0, between(rng, 1.0, 2.2)),
            _ => (PI - between(rng, 1.0, 2.2), PI),
        };
        let tangential = between(rng, 600e6, 900e6);
        let radial = between(rng, 0.2, 0.4) * tangential;
        let cutter = Cutter {
            teeth,
            spindle_hz,
            axial_depth_m: 0.0,
            entry_rad,
            exit_rad,
            chip_n_m2: DVec3::new(tangential, radial, 0.15 * tangential),
            edge_n_m: DVec3::new(between(rng, 5e3, 15e3), between(rng, 5e3, 15e3), 2e3),
        };
        let tooth_feed_m = between(rng, 0.03e-3, 0.1e-3);
        let runout_m = between(rng, 0.0, 8e-6);
        Self {
            cutter,
            feed_m_s: tooth_feed_m * cutter.tooth_passing_hz(),
            runout_m: (0..teeth).map(|_| between(rng, -runout_m, runout_m)).collect(),
            modes: modes(rng, frequency_hz, n_per_m),
            noise_n: between(rng, 0.2, 1.0),
            rough: between(rng, 0.01, 0.05),
            entry_s: between(rng, 0.01, 0.2),
            exit_s: between(rng, 0.01, 0.1),
            turned_rad: between(rng, 0.0, TAU),
        }
    }

    /// The cut at a depth, at its first step.
    pub(crate) fn cut(&self, axial_depth_m: f64) -> Regeneration {
        self.cut_with(axial_depth_m, &self.runout_m)
    }

    fn cut_with(&self, axial_depth_m: f64, runout_m: &[f64]) -> Regeneration {
        let steps = (STEPS_HZ / self.cutter.tooth_passing_hz()).round().max(40.0);
        let cutter = Cutter { axial_depth_m, ..self.cutter };
        Regeneration::new(cutter, self.feed_m_s, runout_m, &self.modes, steps as usize)
    }

    /// The depth at which this speed becomes unstable, m, tested by the decay of a small
    /// disturbance.
    fn limit_m(&self) -> f64 {
        let [mut low, mut high] = DEPTHS_M;
        for _ in 0..11 {
            let middle = (low * high).sqrt();
            if self.grows(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        (low * high).sqrt()
    }

    fn grows(&self, axial_depth_m: f64) -> bool {
        // Runout moves the tool beyond the path of a rigid one in stable cuts too.
        let mut cut = self.cut_with(axial_depth_m, &[]);
        let slowest_hz = self.modes.iter().map(|m| m.frequency_hz).fold(f64::INFINITY, f64::min);
        let steps = ((30.0 / slowest_hz).clamp(0.3, 1.5) / cut.step_s()) as usize;
        let mut sums = [0.0; 2];
        for k in 0..steps {
            let push = if k == 0 { DVec2::new(0.01, 0.01) } else { DVec2::ZERO };
            let step = cut.next(1.0, push);
            if k > steps / 2 {
                sums[usize::from(k > 3 * steps / 4)] += (step.tool - step.forced).length_squared();
            }
        }
        sums[1] > sums[0]
    }
}

/// Two orthogonal modes near a frequency, and a stiffer one of the structure.
fn modes(rng: &mut ChaCha8Rng, frequency_hz: f64, n_per_m: f64) -> Vec<ToolMode> {
    let angle = between(rng, 0.0, PI);
    let mut mode = |angle: f64, frequency_hz: f64, stiffness_n_per_m: f64| ToolMode {
        direction: DVec2::from_angle(angle),
        frequency_hz,
        damping_ratio: between(rng, 0.012, 0.04),
        stiffness_n_per_m,
    };
    let first = mode(angle, frequency_hz, n_per_m);
    let second = mode(angle + 0.5 * PI, 1.13 * frequency_hz, 1.3 * n_per_m);
    let structure = mode(angle + 0.25 * PI, 17.0, 8.0 * n_per_m);
    vec![first, second, structure]
}
