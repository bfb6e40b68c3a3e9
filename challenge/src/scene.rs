//! Inputs of a case row by row: motion, loads, temperatures, process state.
//!
//! Paths are sums of sines about a centre with amplitudes that grow from rest, known at any instant; poses are settled, each with the direction of
//! approach of every joint. Rows contain the inputs as recorded; the true inputs are computed by the laws.

use crate::arm::{Arm, JOINTS, Joints};
use crate::chance::Chance;

/// One sinusoid of one joint's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wave {
    joint: usize,
    amplitude: f64,
    rate: f64,
    phase: f64,
}

/// One segment of a path.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// Sampling times, s from its start.
    pub times_s: Vec<f64>,
    centre: Joints,
    waves: Vec<Wave>,
    ramp_s: f64,
    /// Position of each joint within its backlash before it moves, −1 to 1.
    pub start: Joints,
}

impl Segment {
    /// Commanded position of a joint, rad.
    #[must_use]
    pub fn command(&self, joint: usize, t_s: f64) -> f64 {
        let s = (t_s / self.ramp_s).clamp(0.0, 1.0);
        let swell = s * s * s * (10.0 - s * (15.0 - 6.0 * s));
        let sines = self.waves.iter().filter(|wave| wave.joint == joint);
        let sum: f64 = sines.map(|w| w.amplitude * (w.rate * t_s + w.phase).sin()).sum();
        self.centre[joint] + swell * sum
    }
}

/// Recorded inputs of one row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Time from the start of the segment, s.
    pub t_s: f64,
    /// 0-based.
    pub segment: usize,
    /// Commanded positions, rad.
    pub q: Joints,
    /// Direction of approach of each joint.
    pub d: Joints,
    /// Wrench as measured by the force sensor: tool axes, N and Nm about the TCP.
    pub wrench: [f64; 6],
    /// Ambient temperature, °C.
    pub ambient_c: f64,
    /// Temperature of each joint, °C.
    pub joint_c: Joints,
    /// Spindle speed, rev/min.
    pub rpm: f64,
}

/// A motion with all other inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The nominal arm.
    pub arm: Arm,
    /// Segments of a path; empty for settled poses.
    pub segments: Vec<Segment>,
    /// All rows in order.
    pub rows: Vec<Row>,
    /// Recorded inputs besides joint positions.
    pub has: Has,
}

/// Which inputs a recording contains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Has {
    /// A wrench.
    pub wrench: bool,
    /// The ambient temperature.
    pub ambient: bool,
    /// The joints' own temperatures.
    pub joint_temperatures: bool,
    /// The spindle's speed.
    pub spindle: bool,
}

/// Excitation of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Richness {
    /// All joints over large ranges.
    Full,
    /// A few joints over small ranges.
    Poor,
}

impl Scene {
    /// Whether it consists of settled poses.
    #[must_use]
    pub fn settled(&self) -> bool {
        self.segments.is_empty()
    }

    /// Another motion of the same robot with the same inputs, which the solver never sees.
    #[must_use]
    pub fn again(&self, chance: &mut Chance, richness: Richness) -> Self {
        let seconds = self.segments.iter().map(|segment| segment.times_s.len());
        if self.settled() {
            Self::poses(self.arm.clone(), self.has, self.rows.len().min(300), richness, chance)
        } else {
            let rows: usize = seconds.sum();
            let rate = 1.0 / (self.segments[0].times_s[1] - self.segments[0].times_s[0]);
            let rate = (rate / 10.0).round() * 10.0;
            Self::path(self.arm.clone(), self.has, (rows.min(1200), rate), richness, chance)
        }
    }

    /// Random settled poses.
    #[must_use]
    pub fn poses(
        arm: Arm,
        has: Has,
        count: usize,
        richness: Richness,
        chance: &mut Chance,
    ) -> Self {
        let range = Range::draw(&arm, richness, chance);
        let climate = Climate::draw(chance);
        let mut rows = Vec::with_capacity(count);
        let mut t_s = 0.0;
        for _ in 0..count {
            let mut row = Row {
                t_s,
                segment: 0,
                q: [0.0; JOINTS],
                d: [0.0; JOINTS],
                wrench: [0.0; 6],
                ambient_c: climate.ambient(t_s),
                joint_c: climate.joints(t_s),
                rpm: 0.0,
            };
            for i in 0..arm.count() {
                row.q[i] = range.centre[i] + range.half[i] * chance.between(-1.0, 1.0);
                row.d[i] = chance.sign();
            }
            if has.wrench {
                row.wrench =
                    std::array::from_fn(|k| chance.normal() * if k < 3 { 90.0 } else { 8.0 });
            }
            if has.spindle {
                row.rpm = 3000.0 * chance.between(0.0, 8.0).floor();
            }
            rows.push(row);
            t_s += chance.between(12.0, 20.0);
        }
        Self { arm, segments: Vec::new(), rows, has }
    }

    /// A random path with this number of rows at this rate, Hz, in segments.
    #[must_use]
    pub fn path(
        arm: Arm,
        has: Has,
        (count, rate_hz): (usize, f64),
        richness: Richness,
        chance: &mut Chance,
    ) -> Self {
        let range = Range::draw(&arm, richness, chance);
        let parts = (count as f64 / (rate_hz * 4.0)).round().clamp(4.0, 12.0) as usize;
        let climate = Climate::draw(chance);
        let mut scene = Self { arm, segments: Vec::new(), rows: Vec::with_capacity(count), has };
        let mut order: Vec<usize> = (0..parts).collect();
        chance.shuffle(&mut order);
        for (number, hour) in order.into_iter().enumerate() {
            let segment = Segment::draw(&range, scene.arm.count(), count / parts, rate_hz, chance);
            let clock_s = 1200.0 * hour as f64;
            let push: [f64; 6] =
                std::array::from_fn(|k| chance.normal() * if k < 3 { 70.0 } else { 6.0 });
            let swing: [f64; 6] =
                std::array::from_fn(|k| chance.normal() * if k < 3 { 40.0 } else { 4.0 });
            let rate = chance.between(0.5, 3.0);
            let rpm = 3000.0 * chance.between(0.0, 8.0).floor();
            for t_s in &segment.times_s {
                let mut q = [0.0; JOINTS];
                (0..scene.arm.count()).for_each(|i| q[i] = segment.command(i, *t_s));
                let at = |k: usize| push[k] + swing[k] * (rate * t_s + k as f64).sin();
                scene.rows.push(Row {
                    t_s: *t_s,
                    segment: number,
                    q,
                    d: [0.0; JOINTS],
                    wrench: if has.wrench { std::array::from_fn(at) } else { [0.0; 6] },
                    ambient_c: climate.ambient(clock_s + t_s),
                    joint_c: climate.joints(clock_s + t_s),
                    rpm: if has.spindle { rpm } else { 0.0 },
                });
            }
            scene.segments.push(segment);
        }
        scene
    }
}

/// Range of each joint.
struct Range {
    centre: Joints,
    half: Joints,
}

impl Range {
    fn draw(arm: &Arm, richness: Richness, chance: &mut Chance) -> Self {
        let n = arm.count();
        let mut range = Self { centre: arm.home, half: arm.reach };
        if richness == Richness::Poor {
            let moving = [chance.pick(n), chance.pick(n)];
            for i in 0..n {
                range.centre[i] += arm.reach[i] * chance.between(-0.5, 0.5);
                range.half[i] = if moving.contains(&i) { chance.between(0.05, 0.25) } else { 0.0 };
            }
        }
        range
    }
}

impl Segment {
    fn draw(range: &Range, joints: usize, rows: usize, rate_hz: f64, chance: &mut Chance) -> Self {
        let dt = 1.0 / rate_hz;
        // Time stamps are exact, but uneven by a few hundredths of a step.
        let times_s = (0..rows)
            .map(|k| if k == 0 { 0.0 } else { dt * (k as f64 + chance.between(-0.03, 0.03)) });
        let times_s = times_s.map(|t| (t * 1e6).round() * 1e-6).collect();
        let mut segment = Self {
            times_s,
            centre: range.centre,
            waves: Vec::new(),
            ramp_s: chance.between(0.4, 0.9),
            start: std::array::from_fn(|_| chance.between(-1.0, 1.0)),
        };
        for joint in 0..joints {
            let half = range.half[joint];
            if half == 0.0 {
                continue;
            }
            let far = half.min(1.2);
            segment.centre[joint] += (half - far) * chance.between(-1.0, 1.0);
            for share in [0.7, 0.3] {
                let amplitude = share * far * chance.between(0.5, 1.0);
                // At most 1.6 rad/s, attainable by arms of this size.
                let rate = chance.log_between(0.9, 7.0).min(1.6 / amplitude);
                let phase = chance.between(0.0, std::f64::consts::TAU);
                segment.waves.push(Wave { joint, amplitude, rate, phase });
            }
        }
        segment
    }
}

/// Temperatures over hours.
struct Climate {
    rise_c: f64,
    after_s: f64,
    sway_c: f64,
    own_c: Joints,
    own_s: Joints,
}

impl Climate {
    fn draw(chance: &mut Chance) -> Self {
        Self {
            rise_c: chance.between(5.0, 12.0),
            after_s: chance.between(1500.0, 4000.0),
            sway_c: chance.between(1.0, 3.0),
            own_c: std::array::from_fn(|_| chance.between(3.0, 18.0)),
            own_s: std::array::from_fn(|_| chance.between(600.0, 4000.0)),
        }
    }

    fn ambient(&self, t_s: f64) -> f64 {
        let warm = 17.0
            + self.rise_c * (1.0 - (-t_s / self.after_s).exp())
            + self.sway_c * (t_s / 700.0).sin();
        (warm * 100.0).round() / 100.0
    }

    fn joints(&self, t_s: f64) -> Joints {
        std::array::from_fn(|i| {
            let own = self.own_c[i] * (1.0 - (-t_s / self.own_s[i]).exp());
            ((self.ambient(t_s) + own) * 100.0).round() / 100.0
        })
    }
}
