//! Regressors: contribution of each parameter of an effect to the torque of each joint, row by row, as the term of docs/reference/effects.md per unit
//! of its parameter.
//!
//! Terms that are nonlinear in the motion are evaluated at the sampling rate of the run on motion of a wider bandwidth, and then pass the filter of
//! the torque; linear terms are evaluated on filtered motion, which is equivalent. Friction with memory follows Dahl's law or a Maxwell-slip model.

use crate::engine::regression_data::Regressor;

use super::motion::{Motion, ROOM_C, Track};

/// A joint slower than this share of its RMS velocity is treated as at rest: the sign of the velocity is smoothed over it.
pub(super) const REST_VELOCITY_SHARE: f64 = 2e-4;

/// Number of elements of the Maxwell-slip model.
const SPRINGS: usize = 16;

/// A law with one linear parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TorqueTerm {
    /// Sign of the velocity, `sign(v)`: dry friction.
    VelocitySign,
    /// Velocity `v`: viscous friction.
    Velocity,
    /// Stribeck friction, `exp(−(v/v_s)²) sign(v)`.
    Stribeck { speed: f64 },
    /// Constant 1.
    Constant,
    /// Absolute velocity `|v|`.
    AbsoluteVelocity,
    /// Decrease of viscous friction with temperature, `v (1 − exp(−k (T − 20 °C)))/k`; `k` in 1/K.
    ThermalDecrease { per_kelvin: f64 },
    /// Minus the derivative of `v exp(−k (T − 20 °C))` with respect to `k`: `v (T − 20 °C) exp(−k (T − 20 °C))`.
    ThermalDerivative { per_kelvin: f64 },
    /// Viscous friction at temperature `T`, `v exp(−k (T − 20 °C))`.
    ThermalViscous { per_kelvin: f64 },
    /// Acceleration `a`: inertia.
    Acceleration,
    /// `cos q`: gravity.
    Cosine,
    /// `sin q`: gravity.
    Sine,
    /// Position `q`: spring.
    Position,
    /// Cube of the deflection from the rest position, `(q − q0)³`: spring hardening.
    CubedDeflection { rest: f64 },
    /// Dahl friction of unit height, with this reversal distance, rad or m.
    Dahl { distance: f64 },
    /// Maxwell-slip friction of unit height, with this reversal distance, rad or m.
    MaxwellSlip { distance: f64 },
}

impl TorqueTerm {
    /// The column of the law at one joint.
    pub(super) fn column(self, motion: &Motion, joint: usize) -> Regressor {
        let mut all = Vec::new();
        for (run, samples) in motion.runs.iter().zip(self.at_samples(motion, joint)) {
            if self.is_nonlinear() {
                all.extend(run.at_rows(&samples));
            } else {
                all.extend(run.rows.iter().map(|row| samples[*row]));
            }
        }
        Regressor { parts: vec![(joint, all.into())] }
    }

    /// Values of the law at every sample of each run.
    pub(super) fn at_samples(self, motion: &Motion, joint: usize) -> Vec<Vec<f64>> {
        let standing = REST_VELOCITY_SHARE * rms_velocity(motion, joint);
        motion.runs.iter().map(|run| self.samples(&run.joints[joint], standing)).collect()
    }

    /// Whether the law is nonlinear in the motion. It is then evaluated before filtering, as the torque arises: the filtered cube differs from the
    /// cube of the filtered position.
    fn is_nonlinear(self) -> bool {
        !matches!(self, Self::Constant | Self::Velocity | Self::Acceleration | Self::Position)
    }

    fn samples(self, track: &Track, standing: f64) -> Vec<f64> {
        let sign = |v: f64| libm::tanh(v / standing.max(1e-12));
        let [quick_q, quick_v, _] = track.wide_band_motion();
        let (places, speeds) =
            if self.is_nonlinear() { (quick_q, quick_v) } else { (&*track.q, &*track.v) };
        let v = speeds.iter().copied();
        let q = places.iter().copied();
        match self {
            Self::VelocitySign => v.map(sign).collect(),
            Self::Velocity => track.v.clone(),
            Self::Stribeck { speed } => {
                v.map(|v| libm::exp(-(v / speed) * (v / speed)) * sign(v)).collect()
            }
            Self::Constant => vec![1.0; track.q.len()],
            Self::AbsoluteVelocity => v.map(f64::abs).collect(),
            Self::ThermalDecrease { .. } | Self::ThermalDerivative { .. }
                if track.temperature.is_empty() =>
            {
                vec![0.0; track.q.len()]
            }
            Self::ThermalViscous { .. } if track.temperature.is_empty() => speeds.to_vec(),
            Self::ThermalDecrease { per_kelvin } => {
                let cooled = |t: f64| match per_kelvin {
                    0.0 => t - ROOM_C,
                    k => -libm::expm1(-k * (t - ROOM_C)) / k,
                };
                v.zip(&track.temperature).map(|(v, t)| v * cooled(*t)).collect()
            }
            Self::ThermalDerivative { per_kelvin } => {
                let left = |t: f64| (t - ROOM_C) * libm::exp(-per_kelvin * (t - ROOM_C));
                v.zip(&track.temperature).map(|(v, t)| v * left(*t)).collect()
            }
            Self::ThermalViscous { per_kelvin } => {
                let left = |t: f64| libm::exp(-per_kelvin * (t - ROOM_C));
                v.zip(&track.temperature).map(|(v, t)| v * left(*t)).collect()
            }
            Self::Acceleration => track.a.clone(),
            Self::Cosine => q.map(libm::cos).collect(),
            Self::Sine => q.map(libm::sin).collect(),
            Self::Position => track.q.clone(),
            Self::CubedDeflection { rest } => {
                q.map(|q| (q - rest) * (q - rest) * (q - rest)).collect()
            }
            Self::Dahl { distance } => dahl(places, distance),
            Self::MaxwellSlip { distance } => maxwell_slip(places, distance),
        }
    }
}

/// `sin n q` and `cos n q`, evaluated as nonlinear laws; n in cycles per revolution, or rad/m for a prismatic joint.
pub(super) fn sine_and_cosine(motion: &Motion, joint: usize, cycles: f64) -> [Regressor; 2] {
    let mut all = [Vec::new(), Vec::new()];
    for run in &motion.runs {
        let places = run.joints[joint].wide_band_motion()[0].iter();
        let (sines, cosines): (Vec<f64>, Vec<f64>) =
            places.map(|q| libm::sincos(cycles * q)).unzip();
        let passed = run.all_at_rows(&[sines, cosines]);
        all.iter_mut().zip(passed).for_each(|(all, samples)| all.extend(samples));
    }
    all.map(|values| Regressor { parts: vec![(joint, values.into())] })
}

/// Dahl friction of unit height: `dz/d|q| = (sign(dq) − z)/s`, starting at zero.
fn dahl(q: &[f64], distance: f64) -> Vec<f64> {
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

/// Maxwell-slip friction of unit height: parallel springs that slip at different deflections, so that minor loops close. With slip deflections
/// distributed by the density `x exp(−x)`, the sum after a full reversal equals that of [`dahl`].
pub(super) fn maxwell_slip(q: &[f64], distance: f64) -> Vec<f64> {
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

/// The value `x` at which the distribution function `1 − (1 + x) exp(−x)` reaches a share.
fn quantile(share: f64) -> f64 {
    let (mut low, mut high) = (0.0, 50.0);
    for _ in 0..50 {
        let x = 0.5 * (low + high);
        if 1.0 - (1.0 + x) * libm::exp(-x) < share { low = x } else { high = x }
    }
    0.5 * (low + high)
}

/// RMS velocity of a joint over all runs, rad/s or m/s.
pub(super) fn rms_velocity(motion: &Motion, joint: usize) -> f64 {
    let all = motion.runs.iter().flat_map(|run| {
        let track = &run.joints[joint];
        run.rows.iter().map(|row| track.v[*row])
    });
    let (sum, count) = all.fold((0.0, 0.0), |(sum, count), v| (sum + v * v, count + 1.0));
    if count > 0.0 { libm::sqrt(sum / count) } else { 0.0 }
}

/// RMS acceleration of a joint over all runs, rad/s² or m/s².
fn rms_acceleration(motion: &Motion, joint: usize) -> f64 {
    let all = motion.runs.iter().flat_map(|run| {
        let track = &run.joints[joint];
        run.rows.iter().map(|row| track.a[*row])
    });
    let (sum, count) = all.fold((0.0, 0.0), |(sum, count), a| (sum + a * a, count + 1.0));
    if count > 0.0 { libm::sqrt(sum / count) } else { 0.0 }
}

/// The shortest reversal distance that the wider band can distinguish from an abrupt reversal, rad or m: the distance covered from rest at the joint's
/// RMS acceleration in two periods of the band edge, `½ a (2/f)²`.
pub(super) fn shortest_reversal(motion: &Motion, joint: usize) -> f64 {
    2.0 * rms_acceleration(motion, joint) / (motion.wide_band_hz * motion.wide_band_hz)
}

/// The lowest velocity that the wider band can distinguish from rest, rad/s or m/s: what the joint's RMS acceleration reaches in a quarter of a
/// period of the band edge.
pub(super) fn lowest_velocity(motion: &Motion, joint: usize) -> f64 {
    0.25 * rms_acceleration(motion, joint) / motion.wide_band_hz
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn springs_that_slip_turn_over_as_a_memory_does_and_close_their_inner_loops() {
        let go =
            |from: f64, to: f64| (1..=1000).map(move |k| from + (to - from) * 1e-3 * f64::from(k));
        let q: Vec<f64> = go(0.0, 1.0).chain(go(1.0, 0.0)).collect();
        let both = [dahl(&q, 0.05), maxwell_slip(&q, 0.05)];
        let difference = |from: usize| {
            let pairs = both[0][from..].iter().zip(&both[1][from..]);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        assert!(difference(1000) < 0.1, "{}", difference(1000));
        // After a full stroke, a small reversal and a return, a Maxwell-slip model closes the minor loop; Dahl's law does not.
        let q: Vec<f64> = go(0.0, 1.0).chain(go(1.0, 0.98)).chain(go(0.98, 1.0)).collect();
        let gap = |z: Vec<f64>| (z[2999] - z[999]).abs();
        assert!(gap(maxwell_slip(&q, 0.05)) < 1e-9 && gap(dahl(&q, 0.05)) > 0.1);
    }

    #[test]
    fn a_memory_turns_over_within_its_distance() {
        let forward = (0..=1000).map(|k| 1e-3 * f64::from(k));
        let q: Vec<f64> = forward.clone().chain(forward.rev()).collect();
        let z = dahl(&q, 0.05);
        assert!((z[1000] - 1.0).abs() < 1e-6);
        // After a reversal, friction crosses zero at a distance of ln 2 times the reversal distance.
        let crossing = (1000..2001).find(|k| z[*k] < 0.0).unwrap_or(0) - 1001;
        assert!((crossing as f64 * 1e-3 - 0.05 * std::f64::consts::LN_2).abs() < 2e-3);
        assert!((z[2001] + 1.0).abs() < 1e-6);
    }
}
