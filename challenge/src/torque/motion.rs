//! Motion of each joint in a torque case as a formula, with velocity and acceleration at any instant.
//!
//! Sums of sines with amplitudes that grow from rest, moves from stop to stop with rounded corners and a phase of constant velocity (trapezoids), or
//! moves with random stops between them. If temperatures are recorded, several runs at different temperatures. Position, velocity and acceleration
//! follow from one formula.

use crate::arm::{JOINTS, Joints};
use crate::rng::Rng;
use crate::scene::Excitation;

/// Position, velocity and acceleration.
pub type JointState = [f64; 3];

/// One joint's motion.
#[derive(Clone, Debug, PartialEq)]
pub enum JointMotion {
    /// Sines about a centre: amplitude, rate (rad/s), phase.
    Waves {
        /// Centre, rad or m.
        centre: f64,
        /// Amplitude (rad or m), angular frequency (rad/s), phase (rad).
        waves: Vec<[f64; 3]>,
        /// Time over which the amplitudes grow, s.
        swell_s: f64,
    },
    /// Successive moves, at rest between them.
    Moves(Vec<Move>),
}

/// A move from stop to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Start time, s.
    pub start_s: f64,
    /// Duration, s.
    pub duration_s: f64,
    /// Start and end position, rad or m.
    pub ends: [f64; 2],
    /// Fraction of the duration for acceleration, and the same for deceleration.
    pub ramp: f64,
}

impl JointMotion {
    /// State at an instant; before the first and after the last move at rest.
    #[must_use]
    pub fn at(&self, t_s: f64) -> JointState {
        match self {
            Self::Waves { centre, waves, swell_s } => {
                let t = t_s.max(0.0);
                let mut sum = [0.0; 3];
                for [amplitude, rate, phase] in waves {
                    let (s, c) = (rate * t + phase).sin_cos();
                    sum[0] += amplitude * s;
                    sum[1] += amplitude * rate * c;
                    sum[2] -= amplitude * rate * rate * s;
                }
                let [g, dg, ddg] = smooth_step(t / swell_s);
                let (dg, ddg) = (dg / swell_s, ddg / (swell_s * swell_s));
                [
                    centre + g * sum[0],
                    dg * sum[0] + g * sum[1],
                    ddg * sum[0] + 2.0 * dg * sum[1] + g * sum[2],
                ]
            }
            Self::Moves(moves) => {
                let begun = moves.iter().rev().find(|one| one.start_s <= t_s);
                match begun {
                    Some(one) => one.at(t_s),
                    None => [moves.first().map_or(0.0, |first| first.ends[0]), 0.0, 0.0],
                }
            }
        }
    }
}

/// Smooth step from 0 to 1 with rest at both ends: value, first and second derivative.
fn smooth_step(x: f64) -> JointState {
    if x >= 1.0 {
        return [1.0, 0.0, 0.0];
    }
    let (x2, x3) = (x * x, x * x * x);
    [
        x3 * (10.0 - 15.0 * x + 6.0 * x2),
        30.0 * x2 * (1.0 - 2.0 * x + x2),
        60.0 * x * (1.0 - 3.0 * x + 2.0 * x2),
    ]
}

impl Move {
    fn at(&self, t_s: f64) -> JointState {
        let [from, to] = self.ends;
        let (way, r) = (to - from, self.ramp);
        let x = (t_s - self.start_s) / self.duration_s;
        if x >= 1.0 {
            return [to, 0.0, 0.0];
        }
        let speed = 1.0 / (1.0 - r);
        // Velocity rises as 3 u² − 2 u³, so that the acceleration is continuous.
        let rising = |x: f64| {
            let u = x / r;
            let place = speed * r * u * u * u * (1.0 - 0.5 * u);
            [place, speed * u * u * (3.0 - 2.0 * u), speed * 6.0 * u * (1.0 - u) / r]
        };
        let [place, rate, gain] = if x < r {
            rising(x)
        } else if x > 1.0 - r {
            let [place, rate, gain] = rising(1.0 - x);
            [1.0 - place, rate, -gain]
        } else {
            [speed * (x - 0.5 * r), speed, 0.0]
        };
        [
            from + way * place,
            way * rate / self.duration_s,
            way * gain / (self.duration_s * self.duration_s),
        ]
    }
}

/// A run: motion of every joint, sampling times, temperatures.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// One per joint.
    pub tracks: Vec<JointMotion>,
    /// Sampling times, s from its start.
    pub times_s: Vec<f64>,
    /// Temperature of each joint at the start, °C.
    pub start_c: Joints,
    /// Temperature rate of each joint, K/s.
    pub warming_rate: Joints,
}

/// A motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Its runs.
    pub segments: Vec<Segment>,
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// Whether temperatures are recorded.
    pub has_temperatures: bool,
}

/// Range and maximum velocity of each joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointRange {
    /// Centre, rad or m.
    pub centre: f64,
    /// Half of the range, rad or m.
    pub half_range: f64,
    /// Maximum velocity, rad/s or m/s.
    pub max_speed: f64,
}

impl Segment {
    /// State of each joint at an instant.
    #[must_use]
    pub fn at(&self, t_s: f64) -> [JointState; JOINTS] {
        let mut all = [[0.0; 3]; JOINTS];
        all.iter_mut().zip(&self.tracks).for_each(|(state, track)| *state = track.at(t_s));
        all
    }

    /// Temperature of a joint at an instant, °C, as recorded.
    #[must_use]
    pub fn temperature_c(&self, joint: usize, t_s: f64) -> f64 {
        let warm = self.start_c[joint] + self.warming_rate[joint] * t_s;
        (warm * 100.0).round() / 100.0
    }
}

impl Motion {
    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.segments.iter().map(|segment| segment.times_s.len()).sum()
    }

    /// A random motion with this length, s, and rate, Hz.
    pub fn random(
        ranges: &[JointRange],
        (length_s, rate_hz): (f64, f64),
        has_temperatures: bool,
        excitation: Excitation,
        rng: &mut Rng,
    ) -> Self {
        let parts = if has_temperatures { 6 } else { 1 };
        let mut levels: Vec<usize> = (0..parts).collect();
        rng.shuffle(&mut levels);
        let style = rng.uniform_index(3);
        let rise: Joints = std::array::from_fn(|_| rng.uniform_between(8.0, 20.0));
        let moving = [rng.uniform_index(ranges.len()), rng.uniform_index(ranges.len())];
        let segments = levels.into_iter().map(|level| {
            let takes_s = length_s / parts as f64;
            let of_joint = |(joint, range): (usize, &JointRange)| match excitation {
                Excitation::Full => full_excitation(range, takes_s, style, rng),
                Excitation::Poor if moving.contains(&joint) => weak_excitation(range, rng),
                Excitation::Poor => at_rest(range, rng),
            };
            let tracks = ranges.iter().enumerate().map(of_joint).collect();
            let count = (takes_s * rate_hz).round() as usize;
            let times_s = (0..count).map(|k| (k as f64 / rate_hz * 1e6).round() * 1e-6).collect();
            let share = level as f64 / parts as f64;
            let start_c = rise.map(|rise| 20.0 + if has_temperatures { rise * share } else { 0.0 });
            let warming_rate =
                rise.map(|rise| if has_temperatures { 0.3 * rise / length_s } else { 0.0 });
            Segment { tracks, times_s, start_c, warming_rate }
        });
        Self { segments: segments.collect(), rate_hz, has_temperatures }
    }
}

/// One sinusoid of small amplitude.
fn weak_excitation(range: &JointRange, rng: &mut Rng) -> JointMotion {
    let amplitude = range.half_range * rng.uniform_between(0.1, 0.4);
    let rate = rng.uniform_between(1.0, 4.0).min(range.max_speed / amplitude);
    let waves = vec![[amplitude, rate, 0.0]];
    let centre = range.centre + 0.4 * range.half_range * rng.uniform_between(-1.0, 1.0);
    JointMotion::Waves { centre, waves, swell_s: 1.0 }
}

fn at_rest(range: &JointRange, rng: &mut Rng) -> JointMotion {
    let centre = range.centre + 0.5 * range.half_range * rng.uniform_between(-1.0, 1.0);
    JointMotion::Waves { centre, waves: Vec::new(), swell_s: 1.0 }
}

fn full_excitation(range: &JointRange, length_s: f64, style: usize, rng: &mut Rng) -> JointMotion {
    if style == 0 {
        let waves = [0.5, 0.25, 0.15, 0.1].iter().enumerate().map(|(k, share)| {
            let amplitude = share * range.half_range * rng.uniform_between(0.6, 1.0);
            let low = 0.5 * 1.8_f64.powi(k as i32);
            let rate =
                rng.log_uniform_between(low, 3.0 * low).min(0.7 * range.max_speed / amplitude);
            [amplitude, rate, rng.uniform_between(0.0, std::f64::consts::TAU)]
        });
        return JointMotion::Waves { centre: range.centre, waves: waves.collect(), swell_s: 1.0 };
    }
    let mut moves = Vec::new();
    let place = |rng: &mut Rng| range.centre + range.half_range * rng.uniform_between(-1.0, 1.0);
    let (mut t_s, mut from) = (rng.uniform_between(0.0, 0.3), place(rng));
    while t_s < length_s {
        let to = place(rng);
        // Trapezoids have long phases of constant velocity; the others have short ones or none.
        let ramp = if style == 1 {
            rng.uniform_between(0.15, 0.3)
        } else {
            rng.uniform_between(0.35, 0.5)
        };
        let speed = range.max_speed * rng.log_uniform_between(0.1, 1.0);
        let duration_s = ((to - from).abs() / ((1.0 - ramp) * speed)).max(0.25);
        moves.push(Move { start_s: t_s, duration_s, ends: [from, to], ramp });
        let stop_s = if style == 1 { 0.1 } else { rng.uniform_between(0.0, 0.8) };
        (t_s, from) = (t_s + duration_s + stop_s, to);
    }
    JointMotion::Moves(moves)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn velocity_and_acceleration_are_the_slopes_of_what_stands_before_them() {
        let range = JointRange { centre: 0.2, half_range: 1.0, max_speed: 2.0 };
        for style in 0..3 {
            let track = full_excitation(&range, 6.0, style, &mut Rng::new(4, style as u64));
            for k in 1..590 {
                let (t, h) = (0.01 * f64::from(k), 1e-5);
                let ([before, now, after], mut error) =
                    ([track.at(t - h), track.at(t), track.at(t + h)], 0.0_f64);
                for order in 0..2 {
                    let slope = (after[order] - before[order]) / (2.0 * h);
                    error = error.max((slope - now[order + 1]).abs());
                }
                // At the beginning and end of a ramp, the derivative of the acceleration is discontinuous.
                assert!(error < 2e-2, "style {style} at {t}: {error}");
                assert!((now[0] - 0.2).abs() < 1.1 && now[1].abs() < 4.0);
            }
        }
    }
}
