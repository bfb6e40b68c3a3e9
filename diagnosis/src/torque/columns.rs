//! Regressors: contribution of each parameter of an effect to the torque of each joint, row by row.
//!
//! Laws that are not linear in the motion are evaluated at the rate of the run, on motion in a wider band, and then pass the filter of the torque; linear ones are evaluated on
//! what has passed it, which is the same.
//!
//! Promises: a column is the term of docs/reference/effects.md per unit of its parameter. Never: a decision.

use crate::engine::table::Column;

use super::motion::{Motion, ROOM_C, Track};

/// Below this share of a joint's usual speed it counts as standing.
pub(super) const STANDING: f64 = 2e-4;

/// Springs that a friction with memory is made of where it is made of springs.
const SPRINGS: usize = 16;

/// One law of one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Law {
    /// `sign(v)`.
    Direction,
    /// `v`.
    Speed,
    /// `exp(−(v/v_s)²) sign(v)`.
    Stribeck { speed: f64 },
    /// 1.
    One,
    /// `|v|`.
    AbsoluteSpeed,
    /// `v (1 − exp(−k (T − 20 °C)))/k`.
    Warmth { per_kelvin: f64 },
    /// `v (T − 20 °C) exp(−k (T − 20 °C))`: what friction loses as `k` grows.
    Warmer { per_kelvin: f64 },
    /// `v exp(−k (T − 20 °C))`: what warmth leaves of friction.
    Warm { per_kelvin: f64 },
    /// `a`.
    Acceleration,
    /// `cos q`.
    Cosine,
    /// `sin q`.
    Sine,
    /// `q`.
    Position,
    /// `(q − q0)³`.
    Cube { rest: f64 },
    /// `z` of unit height that turns over after each reversal within a distance.
    Memory { distance: f64 },
    /// The same by many springs that slip one after the other.
    Slip { distance: f64 },
}

impl Law {
    /// The column of a law at one joint.
    pub(super) fn column(self, motion: &Motion, joint: usize) -> Column {
        let mut all = Vec::new();
        for (run, samples) in motion.runs.iter().zip(self.at_samples(motion, joint)) {
            if self.is_nonlinear() {
                all.extend(run.at_rows(&samples));
            } else {
                all.extend(run.rows.iter().map(|row| samples[*row]));
            }
        }
        Column { parts: vec![(joint, all.into())] }
    }

    /// Its values at every sample of each run.
    pub(super) fn at_samples(self, motion: &Motion, joint: usize) -> Vec<Vec<f64>> {
        let standing = STANDING * usual_speed(motion, joint);
        motion.runs.iter().map(|run| self.samples(&run.joints[joint], standing)).collect()
    }

    /// Whether the law is not linear in the motion: then it is formed before the filter, as the torque was, since the filtered cube is not the cube of what was filtered.
    fn is_nonlinear(self) -> bool {
        !matches!(self, Self::One | Self::Speed | Self::Acceleration | Self::Position)
    }

    fn samples(self, track: &Track, standing: f64) -> Vec<f64> {
        let sign = |v: f64| libm::tanh(v / standing.max(1e-12));
        let [quick_q, quick_v, _] = track.quick();
        let (places, speeds) =
            if self.is_nonlinear() { (quick_q, quick_v) } else { (&*track.q, &*track.v) };
        let v = speeds.iter().copied();
        let q = places.iter().copied();
        match self {
            Self::Direction => v.map(sign).collect(),
            Self::Speed => track.v.clone(),
            Self::Stribeck { speed } => {
                v.map(|v| libm::exp(-(v / speed) * (v / speed)) * sign(v)).collect()
            }
            Self::One => vec![1.0; track.q.len()],
            Self::AbsoluteSpeed => v.map(f64::abs).collect(),
            Self::Warmth { .. } | Self::Warmer { .. } if track.temperature.is_empty() => {
                vec![0.0; track.q.len()]
            }
            Self::Warm { .. } if track.temperature.is_empty() => speeds.to_vec(),
            Self::Warmth { per_kelvin } => {
                let cooled = |t: f64| match per_kelvin {
                    0.0 => t - ROOM_C,
                    k => -libm::expm1(-k * (t - ROOM_C)) / k,
                };
                v.zip(&track.temperature).map(|(v, t)| v * cooled(*t)).collect()
            }
            Self::Warmer { per_kelvin } => {
                let left = |t: f64| (t - ROOM_C) * libm::exp(-per_kelvin * (t - ROOM_C));
                v.zip(&track.temperature).map(|(v, t)| v * left(*t)).collect()
            }
            Self::Warm { per_kelvin } => {
                let left = |t: f64| libm::exp(-per_kelvin * (t - ROOM_C));
                v.zip(&track.temperature).map(|(v, t)| v * left(*t)).collect()
            }
            Self::Acceleration => track.a.clone(),
            Self::Cosine => q.map(libm::cos).collect(),
            Self::Sine => q.map(libm::sin).collect(),
            Self::Position => track.q.clone(),
            Self::Cube { rest } => q.map(|q| (q - rest) * (q - rest) * (q - rest)).collect(),
            Self::Memory { distance } => memory(places, distance),
            Self::Slip { distance } => slip(places, distance),
        }
    }
}

/// `sin n q` and `cos n q`, told as sharp laws are; n in cycles per revolution, or radians per metre.
pub(super) fn waves(motion: &Motion, joint: usize, cycles: f64) -> [Column; 2] {
    let mut all = [Vec::new(), Vec::new()];
    for run in &motion.runs {
        let places = run.joints[joint].quick()[0].iter();
        let (sines, cosines): (Vec<f64>, Vec<f64>) =
            places.map(|q| libm::sincos(cycles * q)).unzip();
        let passed = run.each_at_rows(&[sines, cosines]);
        all.iter_mut().zip(passed).for_each(|(all, own)| all.extend(own));
    }
    all.map(|values| Column { parts: vec![(joint, values.into())] })
}

/// `dz/d|q| = (sign(dq) − z)/s`, from nothing at the start (Dahl's law; the height is one).
fn memory(q: &[f64], distance: f64) -> Vec<f64> {
    let mut z = 0.0;
    let mut before = q.first().copied().unwrap_or(0.0);
    let step = |q: &f64| {
        let moved = q - before;
        before = *q;
        let goal = if moved < 0.0 { -1.0 } else { 1.0 };
        z = goal + (z - goal) * libm::exp(-moved.abs() / distance.max(1e-12));
        z
    };
    q.iter().map(step).collect()
}

/// Springs in parallel that slip once stretched so far, each its share of a height of one (Maxwell): loops within a loop close. After a whole reversal the sum turns
/// over as [`memory`] does, as the distances at which springs slip are spread by `x exp(−x)`.
pub(super) fn slip(q: &[f64], distance: f64) -> Vec<f64> {
    let yields: [f64; SPRINGS] =
        std::array::from_fn(|k| 0.5 * distance * quantile((k as f64 + 0.5) / SPRINGS as f64));
    let mut stretched = [0.0; SPRINGS];
    let mut before = q.first().copied().unwrap_or(0.0);
    let step = |q: &f64| {
        let moved = q - before;
        before = *q;
        let springs = stretched.iter_mut().zip(&yields);
        let each = springs.map(|(stretched, yields)| {
            *stretched = (*stretched + moved).clamp(-yields, *yields);
            *stretched / yields.max(1e-12)
        });
        each.sum::<f64>() / SPRINGS as f64
    };
    q.iter().map(step).collect()
}

/// Where `1 − (1 + x) exp(−x)` reaches a share.
fn quantile(share: f64) -> f64 {
    let (mut low, mut high) = (0.0, 50.0);
    for _ in 0..50 {
        let x = 0.5 * (low + high);
        if 1.0 - (1.0 + x) * libm::exp(-x) < share { low = x } else { high = x }
    }
    0.5 * (low + high)
}

/// The root mean square of a joint's speed in all runs.
pub(super) fn usual_speed(motion: &Motion, joint: usize) -> f64 {
    let all = motion.runs.iter().flat_map(|run| {
        let track = &run.joints[joint];
        run.rows.iter().map(|row| track.v[*row])
    });
    let (sum, count) = all.fold((0.0, 0.0), |(sum, count), v| (sum + v * v, count + 1.0));
    if count > 0.0 { libm::sqrt(sum / count) } else { 0.0 }
}

/// The root mean square of a joint's acceleration in all runs.
fn usual_acceleration(motion: &Motion, joint: usize) -> f64 {
    let all = motion.runs.iter().flat_map(|run| {
        let track = &run.joints[joint];
        run.rows.iter().map(|row| track.a[*row])
    });
    let (sum, count) = all.fold((0.0, 0.0), |(sum, count), a| (sum + a * a, count + 1.0));
    if count > 0.0 { libm::sqrt(sum / count) } else { 0.0 }
}

/// The shortest way after a reversal that the band can tell from a sudden turn: what the joint's usual acceleration goes in two periods of the edge
/// of the band that sharp laws are told from.
pub(super) fn shortest_way(motion: &Motion, joint: usize) -> f64 {
    2.0 * usual_acceleration(motion, joint) / (motion.quick_hz * motion.quick_hz)
}

/// The lowest speed that the band can tell from rest: what the joint's usual acceleration reaches in a quarter of a period of its edge.
pub(super) fn lowest_speed(motion: &Motion, joint: usize) -> f64 {
    0.25 * usual_acceleration(motion, joint) / motion.quick_hz
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn springs_that_slip_turn_over_as_a_memory_does_and_close_their_inner_loops() {
        let go =
            |from: f64, to: f64| (1..=1000).map(move |k| from + (to - from) * 1e-3 * f64::from(k));
        let q: Vec<f64> = go(0.0, 1.0).chain(go(1.0, 0.0)).collect();
        let both = [memory(&q, 0.05), slip(&q, 0.05)];
        let off = |from: usize| {
            let pairs = both[0][from..].iter().zip(&both[1][from..]);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        assert!(off(1000) < 0.1, "{}", off(1000));
        // There, a little back, and there again: springs remember where they were, the other law does not.
        let q: Vec<f64> = go(0.0, 1.0).chain(go(1.0, 0.98)).chain(go(0.98, 1.0)).collect();
        let gap = |z: Vec<f64>| (z[2999] - z[999]).abs();
        assert!(gap(slip(&q, 0.05)) < 1e-9 && gap(memory(&q, 0.05)) > 0.1);
    }

    #[test]
    fn a_memory_turns_over_within_its_distance() {
        let there = (0..=1000).map(|k| 1e-3 * f64::from(k));
        let q: Vec<f64> = there.clone().chain(there.rev()).collect();
        let z = memory(&q, 0.05);
        assert!((z[1000] - 1.0).abs() < 1e-6);
        // Half a distance of ln 2 after the reversal it has lost all its height.
        let crossing = (1000..2001).find(|k| z[*k] < 0.0).unwrap_or(0) - 1001;
        assert!((crossing as f64 * 1e-3 - 0.05 * std::f64::consts::LN_2).abs() < 2e-3);
        assert!((z[2001] + 1.0).abs() < 1e-6);
    }
}
