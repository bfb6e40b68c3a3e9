//! Inputs of a case row by row: motion, loads, temperatures, process state.
//!
//! Paths are sums of sines about a centre with amplitudes that grow from rest, known at any instant; poses are settled, each with the direction of
//! approach of every joint. Rows contain the inputs as recorded; the true inputs are computed by the laws.

use crate::arm::{Arm, JOINTS, Joints};
use crate::rng::Rng;

/// One sinusoid of one joint's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sinusoid {
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
    sinusoids: Vec<Sinusoid>,
    ramp_s: f64,
    /// Position of each joint within its backlash before it moves, −1 to 1.
    pub backlash_position: Joints,
}

impl Segment {
    /// Commanded position of a joint, rad.
    #[must_use]
    pub fn commanded_position(&self, joint: usize, t_s: f64) -> f64 {
        let s = (t_s / self.ramp_s).clamp(0.0, 1.0);
        let swell = s * s * s * (10.0 - s * (15.0 - 6.0 * s));
        let sines = self.sinusoids.iter().filter(|wave| wave.joint == joint);
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
    pub approach: Joints,
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
    pub recorded: RecordedInputs,
}

/// Which inputs a recording contains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RecordedInputs {
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
pub enum Excitation {
    /// All joints over large ranges.
    Full,
    /// A few joints over small ranges.
    Poor,
}

impl Scene {
    /// Whether it consists of settled poses.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.segments.is_empty()
    }

    /// Another motion of the same robot with the same inputs, which the solver never sees.
    #[must_use]
    pub fn new_motion(&self, rng: &mut Rng, excitation: Excitation) -> Self {
        let seconds = self.segments.iter().map(|segment| segment.times_s.len());
        if self.is_settled() {
            Self::random_poses(
                self.arm.clone(),
                self.recorded,
                self.rows.len().min(300),
                excitation,
                rng,
            )
        } else {
            let rows: usize = seconds.sum();
            let rate = 1.0 / (self.segments[0].times_s[1] - self.segments[0].times_s[0]);
            let rate = (rate / 10.0).round() * 10.0;
            Self::random_path(
                self.arm.clone(),
                self.recorded,
                (rows.min(1200), rate),
                excitation,
                rng,
            )
        }
    }

    /// Random settled poses.
    #[must_use]
    pub fn random_poses(
        arm: Arm,
        recorded_inputs: RecordedInputs,
        count: usize,
        excitation: Excitation,
        rng: &mut Rng,
    ) -> Self {
        let range = JointRanges::draw(&arm, excitation, rng);
        let climate = Temperatures::draw(rng);
        let mut rows = Vec::with_capacity(count);
        let mut t_s = 0.0;
        for _ in 0..count {
            let mut row = Row {
                t_s,
                segment: 0,
                q: [0.0; JOINTS],
                approach: [0.0; JOINTS],
                wrench: [0.0; 6],
                ambient_c: climate.ambient(t_s),
                joint_c: climate.joints(t_s),
                rpm: 0.0,
            };
            for i in 0..arm.joint_count() {
                row.q[i] = range.centre[i] + range.half_range[i] * rng.uniform_between(-1.0, 1.0);
                row.approach[i] = rng.random_sign();
            }
            if recorded_inputs.wrench {
                row.wrench = std::array::from_fn(|k| rng.normal() * if k < 3 { 90.0 } else { 8.0 });
            }
            if recorded_inputs.spindle {
                row.rpm = 3000.0 * rng.uniform_between(0.0, 8.0).floor();
            }
            rows.push(row);
            t_s += rng.uniform_between(12.0, 20.0);
        }
        Self { arm, segments: Vec::new(), rows, recorded: recorded_inputs }
    }

    /// A random path with this number of rows at this rate, Hz, in segments.
    #[must_use]
    pub fn random_path(
        arm: Arm,
        recorded_inputs: RecordedInputs,
        (count, rate_hz): (usize, f64),
        excitation: Excitation,
        rng: &mut Rng,
    ) -> Self {
        let range = JointRanges::draw(&arm, excitation, rng);
        let parts = (count as f64 / (rate_hz * 4.0)).round().clamp(4.0, 12.0) as usize;
        let climate = Temperatures::draw(rng);
        let mut scene = Self {
            arm,
            segments: Vec::new(),
            rows: Vec::with_capacity(count),
            recorded: recorded_inputs,
        };
        let mut order: Vec<usize> = (0..parts).collect();
        rng.shuffle(&mut order);
        for (number, hour) in order.into_iter().enumerate() {
            let segment =
                Segment::draw(&range, scene.arm.joint_count(), count / parts, rate_hz, rng);
            let clock_s = 1200.0 * hour as f64;
            let push: [f64; 6] =
                std::array::from_fn(|k| rng.normal() * if k < 3 { 70.0 } else { 6.0 });
            let swing: [f64; 6] =
                std::array::from_fn(|k| rng.normal() * if k < 3 { 40.0 } else { 4.0 });
            let rate = rng.uniform_between(0.5, 3.0);
            let rpm = 3000.0 * rng.uniform_between(0.0, 8.0).floor();
            for t_s in &segment.times_s {
                let mut q = [0.0; JOINTS];
                (0..scene.arm.joint_count())
                    .for_each(|i| q[i] = segment.commanded_position(i, *t_s));
                let component = |k: usize| push[k] + swing[k] * (rate * t_s + k as f64).sin();
                scene.rows.push(Row {
                    t_s: *t_s,
                    segment: number,
                    q,
                    approach: [0.0; JOINTS],
                    wrench: if recorded_inputs.wrench {
                        std::array::from_fn(component)
                    } else {
                        [0.0; 6]
                    },
                    ambient_c: climate.ambient(clock_s + t_s),
                    joint_c: climate.joints(clock_s + t_s),
                    rpm: if recorded_inputs.spindle { rpm } else { 0.0 },
                });
            }
            scene.segments.push(segment);
        }
        scene
    }
}

/// Range of each joint.
struct JointRanges {
    centre: Joints,
    half_range: Joints,
}

impl JointRanges {
    fn draw(arm: &Arm, excitation: Excitation, rng: &mut Rng) -> Self {
        let n = arm.joint_count();
        let mut range = Self { centre: arm.home, half_range: arm.half_range };
        if excitation == Excitation::Poor {
            let moving = [rng.uniform_index(n), rng.uniform_index(n)];
            for i in 0..n {
                range.centre[i] += arm.half_range[i] * rng.uniform_between(-0.5, 0.5);
                range.half_range[i] =
                    if moving.contains(&i) { rng.uniform_between(0.05, 0.25) } else { 0.0 };
            }
        }
        range
    }
}

impl Segment {
    fn draw(range: &JointRanges, joints: usize, rows: usize, rate_hz: f64, rng: &mut Rng) -> Self {
        let dt = 1.0 / rate_hz;
        // Time stamps are exact, but uneven by a few hundredths of a step.
        let times_s = (0..rows)
            .map(|k| if k == 0 { 0.0 } else { dt * (k as f64 + rng.uniform_between(-0.03, 0.03)) });
        let times_s = times_s.map(|t| (t * 1e6).round() * 1e-6).collect();
        let mut segment = Self {
            times_s,
            centre: range.centre,
            sinusoids: Vec::new(),
            ramp_s: rng.uniform_between(0.4, 0.9),
            backlash_position: std::array::from_fn(|_| rng.uniform_between(-1.0, 1.0)),
        };
        for joint in 0..joints {
            let half = range.half_range[joint];
            if half == 0.0 {
                continue;
            }
            let amplitude_max = half.min(1.2);
            segment.centre[joint] += (half - amplitude_max) * rng.uniform_between(-1.0, 1.0);
            for share in [0.7, 0.3] {
                let amplitude = share * amplitude_max * rng.uniform_between(0.5, 1.0);
                // At most 1.6 rad/s, attainable by arms of this size.
                let rate = rng.log_uniform_between(0.9, 7.0).min(1.6 / amplitude);
                let phase = rng.uniform_between(0.0, std::f64::consts::TAU);
                segment.sinusoids.push(Sinusoid { joint, amplitude, rate, phase });
            }
        }
        segment
    }
}

/// Temperatures over hours.
struct Temperatures {
    warm_up_c: f64,
    warm_up_time_constant_s: f64,
    oscillation_c: f64,
    joint_rise_c: Joints,
    joint_time_constant_s: Joints,
}

impl Temperatures {
    fn draw(rng: &mut Rng) -> Self {
        Self {
            warm_up_c: rng.uniform_between(5.0, 12.0),
            warm_up_time_constant_s: rng.uniform_between(1500.0, 4000.0),
            oscillation_c: rng.uniform_between(1.0, 3.0),
            joint_rise_c: std::array::from_fn(|_| rng.uniform_between(3.0, 18.0)),
            joint_time_constant_s: std::array::from_fn(|_| rng.uniform_between(600.0, 4000.0)),
        }
    }

    fn ambient(&self, t_s: f64) -> f64 {
        let warm = 17.0
            + self.warm_up_c * (1.0 - (-t_s / self.warm_up_time_constant_s).exp())
            + self.oscillation_c * (t_s / 700.0).sin();
        (warm * 100.0).round() / 100.0
    }

    fn joints(&self, t_s: f64) -> Joints {
        std::array::from_fn(|i| {
            let own_heat_c =
                self.joint_rise_c[i] * (1.0 - (-t_s / self.joint_time_constant_s[i]).exp());
            ((self.ambient(t_s) + own_heat_c) * 100.0).round() / 100.0
        })
    }
}
