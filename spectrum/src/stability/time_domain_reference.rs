//! Independent reference implementation for the tests: the delay differential equation integrated
//! in time, tooth by tooth (fourth-order Runge-Kutta).
//!
//! No code is shared with the tested implementation: forces as vectors of single teeth, velocities
//! in m/s, the delayed displacement by cubic Hermite interpolation through stored positions and
//! velocities. Steps end at the entry and exit angles of the teeth. Straight teeth in one plane.

use super::{Cutter, FlexibleMode};
use std::f64::consts::{PI, TAU};

type Plane = [f64; 2];

/// A time step: its rotation angle from the start of the tooth period, its duration, and the angles
/// at the start of the tooth period of the teeth that cut in it.
struct TimeStep {
    angle: f64,
    step_s: f64,
    cutting: Vec<f64>,
}

pub(super) struct TimeDomainReference<'a> {
    modes: &'a [FlexibleMode],
    cutter: Cutter,
    spindle_rad_s: f64,
    depth_m: f64,
    time_steps: Vec<TimeStep>,
}

impl<'a> TimeDomainReference<'a> {
    pub(super) fn new(
        modes: &'a [FlexibleMode],
        cutter: Cutter,
        spindle_rpm: f64,
        depth_m: f64,
    ) -> Self {
        let spindle_rad_s = spindle_rpm * PI / 30.0;
        let pitch = TAU / f64::from(cutter.teeth);
        let mut edges = vec![0.0, pitch];
        edges.extend([cutter.entry_rad, cutter.exit_rad].map(|edge| edge.rem_euclid(pitch)));
        edges.sort_by(f64::total_cmp);
        let mut time_steps = Vec::new();
        let highest = modes.iter().map(|mode| mode.frequency_hz).fold(0.0, f64::max);
        for pair in edges.windows(2) {
            let span = pair[1] - pair[0];
            if span < 1e-9 {
                continue;
            }
            let waves = highest * span / spindle_rad_s;
            let count = (30.0 * waves).max(span / 0.08).ceil();
            for k in 0..count as usize {
                let angle = pair[0] + span * k as f64 / count;
                let middle = angle + 0.5 * span / count;
                let teeth = (0..cutter.teeth).map(|tooth| pitch * f64::from(tooth));
                let is_cutting = |tooth: &f64| {
                    let tooth_angle = (middle + tooth - cutter.entry_rad).rem_euclid(TAU);
                    tooth_angle < cutter.exit_rad - cutter.entry_rad
                };
                let cutting = teeth.filter(is_cutting).collect();
                time_steps.push(TimeStep { angle, step_s: span / count / spindle_rad_s, cutting });
            }
        }
        Self { modes, cutter, spindle_rad_s, depth_m, time_steps }
    }

    /// Force on the tool at an angle, from its displacement relative to one tooth period before.
    fn force(&self, tick: &TimeStep, angle: f64, displacement: Plane) -> Plane {
        let [tangential, radial, _] = self.cutter.chip_n_m2;
        let mut force = [0.0; 2];
        for tooth in &tick.cutting {
            let (sin, cos) = (angle + tooth).sin_cos();
            let chip = displacement[0] * sin + displacement[1] * cos;
            let (f_t, f_r) = (tangential * chip * self.depth_m, radial * chip * self.depth_m);
            force[0] -= f_t * cos + f_r * sin;
            force[1] += f_t * sin - f_r * cos;
        }
        force
    }

    fn rates(&self, state: &[Plane], force: Plane) -> Vec<Plane> {
        let rate = |(mode, [q, v]): (&FlexibleMode, &Plane)| {
            let omega = TAU * mode.frequency_hz;
            let push = mode.direction[0] * force[0] + mode.direction[1] * force[1];
            let stiff = omega * omega * (push / mode.stiffness_n_per_m - q);
            [*v, stiff - 2.0 * mode.damping_ratio * omega * v]
        };
        self.modes.iter().zip(state).map(rate).collect()
    }

    /// Position and velocity of the tip.
    fn tip(&self, state: &[Plane]) -> [Plane; 2] {
        let sum = |axis: usize, order: usize| -> f64 {
            self.modes.iter().zip(state).map(|(mode, s)| mode.direction[axis] * s[order]).sum()
        };
        [[sum(0, 0), sum(1, 0)], [sum(0, 1), sum(1, 1)]]
    }

    /// Logarithm of the growth per tooth period. After enough periods one multiplier remains, or a
    /// conjugate pair: then the motion over the last three obeys `y'' = a y' + b y`, and the
    /// multipliers are the roots of `z² = a z + b`.
    pub(super) fn growth(&self, passings: usize) -> f64 {
        let mut state: Vec<Plane> = self.modes.iter().map(|_| [1e-6, 0.0]).collect();
        let mut all = vec![vec![[[0.0; 2]; 2]; self.time_steps.len() + 1]];
        for _ in 0..passings {
            let before = all.last().unwrap();
            let mut now = vec![self.tip(&state)];
            for (tick, ends) in self.time_steps.iter().zip(before.windows(2)) {
                state = self.step(tick, &state, ends);
                now.push(self.tip(&state));
            }
            let squares: f64 = now.iter().map(|[r, _]| r[0] * r[0] + r[1] * r[1]).sum();
            let scale = 1.0 / squares.sqrt().max(1e-300);
            all.push(now);
            state.iter_mut().for_each(|s| *s = s.map(|x| x * scale));
            all.iter_mut().flatten().for_each(|s| *s = s.map(|r| r.map(|x| x * scale)));
            all.drain(..all.len().saturating_sub(3));
        }
        let dot = |i: usize, j: usize| -> f64 {
            let pairs = all[i].iter().zip(&all[j]);
            pairs.map(|([r, _], [s, _])| r[0] * s[0] + r[1] * s[1]).sum()
        };
        let determinant = dot(1, 1) * dot(0, 0) - dot(0, 1) * dot(0, 1);
        if determinant < 1e-9 * dot(1, 1) * dot(0, 0) {
            // One real multiplier remains.
            return (dot(2, 1) / dot(1, 1)).abs().ln();
        }
        let a = (dot(2, 1) * dot(0, 0) - dot(2, 0) * dot(0, 1)) / determinant;
        let b = (dot(2, 0) * dot(1, 1) - dot(2, 1) * dot(0, 1)) / determinant;
        let inside = 0.25 * a * a + b;
        let modulus = if inside < 0.0 { (-b).sqrt() } else { 0.5 * a.abs() + inside.sqrt() };
        modulus.ln()
    }

    fn step(&self, tick: &TimeStep, state: &[Plane], ends: &[[Plane; 2]]) -> Vec<Plane> {
        let h = tick.step_s;
        let delayed = |axis: usize, part: f64| {
            let (p, q) = (ends[0][0][axis], ends[1][0][axis]);
            let (v, w) = (ends[0][1][axis] * h, ends[1][1][axis] * h);
            let (s, t) = (part, 1.0 - part);
            p * (1.0 + 2.0 * s) * t * t + v * s * t * t + q * (3.0 - 2.0 * s) * s * s
                - w * s * s * t
        };
        let rates = |state: &[Plane], part: f64| {
            let [r, _] = self.tip(state);
            let displacement = [r[0] - delayed(0, part), r[1] - delayed(1, part)];
            let angle = tick.angle + part * h * self.spindle_rad_s;
            self.rates(state, self.force(tick, angle, displacement))
        };
        let moved = |rate: &[Plane], by: f64| -> Vec<Plane> {
            let one = |(s, k): (&Plane, &Plane)| [s[0] + by * k[0], s[1] + by * k[1]];
            state.iter().zip(rate).map(one).collect()
        };
        let k1 = rates(state, 0.0);
        let k2 = rates(&moved(&k1, 0.5 * h), 0.5);
        let k3 = rates(&moved(&k2, 0.5 * h), 0.5);
        let k4 = rates(&moved(&k3, h), 1.0);
        let mean = |i: usize, order: usize| {
            (k1[i][order] + 2.0 * k2[i][order] + 2.0 * k3[i][order] + k4[i][order]) / 6.0
        };
        let one = |(i, s): (usize, &Plane)| [s[0] + h * mean(i, 0), s[1] + h * mean(i, 1)];
        state.iter().enumerate().map(one).collect()
    }
}
