//! Sensor signal of a cut, and the true motion of the tool.

use crate::process::{Process, between};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;
use std::fmt;
use world::random::{Purpose, normals, stream};

pub(crate) const RATE_HZ: f64 = 10_000.0;
/// Duration of the air before the cut, the cut, and the air after it, s.
pub(crate) const AIR_S: f64 = 1.0;
const CUT_S: f64 = 2.5;
const AFTER_S: f64 = 0.5;
/// Ranges of the depth, relative to the limit of stability, for stable and unstable cuts.
const BELOW: [f64; 2] = [0.3, 0.8];
const ABOVE: [f64; 2] = [1.25, 2.5];
/// Ratio of a vibration to the forced one from which it counts as developed chatter, and below
/// which the cut counts as stable.
const DEVELOPED: f64 = 1.5;
const QUIET: f64 = 0.5;

/// True state of the cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Truth {
    /// Little more than the forced vibration.
    Stable,
    /// The vibration grew beyond the forced one.
    Chatter { onset_s: f64, frequency_hz: f64 },
    /// Neither.
    Marginal,
}

/// A recorded cut.
pub(crate) struct Record {
    pub(crate) process: Process,
    /// Forces, N, three channels interleaved.
    pub(crate) samples: Vec<f64>,
    pub(crate) truth: Truth,
    depth_m: f64,
    limit_m: f64,
}

impl fmt::Display for Record {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Process { cutter, modes, .. } = &self.process;
        write!(
            f,
            "{:.0} rpm, {} teeth at {:.1} Hz, modes {:.1} {:.1} Hz, {:.2} mm of {:.2}, {:?}",
            60.0 * cutter.spindle_hz,
            cutter.teeth,
            cutter.tooth_passing_hz(),
            modes[0].frequency_hz,
            modes[1].frequency_hz,
            1e3 * self.depth_m,
            1e3 * self.limit_m,
            self.truth
        )
    }
}

impl Record {
    pub(crate) fn of(seed: u64, above: bool) -> Self {
        let (process, limit_m) = Process::with_limit(seed);
        let rng = &mut stream(seed, Purpose::Regeneration, 1);
        let [low, high] = if above { ABOVE } else { BELOW };
        let depth_m = limit_m * between(rng, low, high);
        let (samples, motion) = recorded(&process, depth_m, seed);
        let truth = truth(&process, &motion);
        Self { process, samples, truth, depth_m, limit_m }
    }
}

/// Motion of the tool beyond the forced vibration, and the forced vibration, per sample.
struct Motion {
    regenerative: Vec<DVec2>,
    forced: Vec<DVec2>,
}

fn recorded(process: &Process, depth_m: f64, seed: u64) -> (Vec<f64>, Motion) {
    let mut cut = process.cut(depth_m);
    let mut rough = normals(seed, Purpose::Regeneration, 2);
    let mut noise = normals(seed, Purpose::Regeneration, 3);
    let mean_n = {
        let cutter = world::cutter::Cutter { axial_depth_m: depth_m, ..process.cutter };
        cutter.mean_force(process.feed_m_s).length()
    };
    let total = ((AIR_S + CUT_S + AFTER_S) * RATE_HZ) as usize;
    let (sin, cos) = process.turned_rad.sin_cos();
    let mut samples = Vec::with_capacity(3 * total);
    let mut motion = Motion { regenerative: Vec::new(), forced: Vec::new() };
    let (mut t_s, step_s) = (0.0, cut.step_s());
    for k in 0..total {
        let (mut force, mut steps) = (DVec3::ZERO, 0.0);
        while t_s < (k + 1) as f64 / RATE_HZ {
            let part = engaged(process, t_s);
            let push = DVec2::new(rough(), rough()) * (process.rough * mean_n * part);
            let step = cut.next(part, push);
            force += step.force + push.extend(0.0);
            steps += 1.0;
            if motion.regenerative.len() == k {
                motion.regenerative.push(step.tool - step.forced);
                motion.forced.push(step.forced);
            }
            t_s += step_s;
        }
        if motion.regenerative.len() == k {
            motion.regenerative.push(*motion.regenerative.last().unwrap_or(&DVec2::ZERO));
            motion.forced.push(*motion.forced.last().unwrap_or(&DVec2::ZERO));
        }
        let f = force / f64::max(steps, 1.0);
        for along in [cos * f.x - sin * f.y, sin * f.x + cos * f.y, f.z] {
            samples.push(along + process.noise_n * noise());
        }
    }
    (samples, motion)
}

/// The share of the full depth at a time.
fn engaged(process: &Process, t_s: f64) -> f64 {
    let rising = (t_s - AIR_S) / process.entry_s;
    let falling = (AIR_S + CUT_S - t_s) / process.exit_s;
    rising.min(falling).clamp(0.0, 1.0)
}

fn truth(process: &Process, motion: &Motion) -> Truth {
    let window = (RATE_HZ / process.cutter.spindle_hz.min(process.modes[0].frequency_hz)) as usize;
    let end = ((AIR_S + CUT_S - process.exit_s) * RATE_HZ) as usize;
    let start = ((AIR_S + process.entry_s) * RATE_HZ) as usize;
    let ratio = |k: usize| {
        let run = k - window..k;
        (variance(&motion.regenerative[run.clone()]) / variance(&motion.forced[run]).max(1e-18))
            .sqrt()
    };
    let hop = (0.005 * RATE_HZ) as usize;
    let ratios: Vec<(usize, f64)> =
        (start + window..end).step_by(hop).map(|k| (k, ratio(k))).collect();
    let settled = start + (0.3 * RATE_HZ) as usize;
    let largest = ratios.iter().filter(|(k, _)| *k > settled).map(|r| r.1).fold(0.0, f64::max);
    let last = ratios.iter().rev().take(100).map(|r| r.1).fold(f64::INFINITY, f64::min);
    if largest < QUIET {
        return Truth::Stable;
    }
    let below = ratios.iter().rposition(|(_, ratio)| *ratio < 1.0);
    let onset = ratios.get(below.map_or(0, |index| index + 1)).map(|(k, _)| *k as f64 / RATE_HZ);
    match onset {
        Some(onset_s) if last > DEVELOPED => {
            let from = end - (0.8 * RATE_HZ) as usize;
            Truth::Chatter { onset_s, frequency_hz: strongest_hz(&motion.regenerative[from..end]) }
        }
        _ => Truth::Marginal,
    }
}

fn variance(run: &[DVec2]) -> f64 {
    let n = run.len() as f64;
    let mean = run.iter().sum::<DVec2>() / n;
    run.iter().map(|x| (x - mean).length_squared()).sum::<f64>() / n
}

/// The frequency with the largest amplitude of a motion, Hz, on a grid of 0.25 Hz.
fn strongest_hz(motion: &[DVec2]) -> f64 {
    let n = motion.len() as f64;
    let mean = motion.iter().sum::<DVec2>() / n;
    let hann = |i: usize| 0.5 - 0.5 * (TAU * (i as f64 + 0.5) / n).cos();
    let windowed: Vec<DVec2> =
        motion.iter().enumerate().map(|(i, x)| (x - mean) * hann(i)).collect();
    let power = |hz: f64| {
        // Goertzel: two running values per axis.
        let turn = 2.0 * (TAU * hz / RATE_HZ).cos();
        let (mut one, mut two) = (DVec2::ZERO, DVec2::ZERO);
        for x in &windowed {
            (one, two) = (*x + turn * one - two, one);
        }
        one.length_squared() + two.length_squared() - turn * one.dot(two)
    };
    let grid = (20..5000).map(|k| 0.25 * f64::from(k));
    grid.max_by(|a, b| power(*a).total_cmp(&power(*b))).unwrap_or(0.0)
}
