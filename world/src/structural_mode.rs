//! A cut with chatter: a force that grows and then stays constant, and the structural mode that it excites.
//!
//! The chatter is prescribed, not self-excited: its growth and limit are stated, so that a test
//! knows its amplitude at any time. Mode (docs/reference/effects.md, `flexible_mode`, its force
//! part): `x'' + 2ζω x' + ω² x = ω² C_d F`, exact between samples.
//!
//! Zero outside its cut; deterministic.

use glam::DVec3;
use libm::{exp, exp2, sincos, sqrt};
use std::f64::consts::TAU;

/// A chatter force in one cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chatter {
    /// The cut (0-based) with chatter.
    pub cut: usize,
    /// Start of the chatter after the start of the cut, s.
    pub after_s: f64,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Initial amplitude, N.
    pub seed_n: f64,
    /// Doubling time, s.
    pub doubling_s: f64,
    /// Final amplitude, N.
    pub limit_n: f64,
    /// Share of the amplitude along base x, y, z.
    pub shares_base: DVec3,
    /// Phase lead of x relative to y and z, rad: a quarter turn makes the path an ellipse, as mode
    /// coupling does.
    pub lead_rad: f64,
}

impl Chatter {
    /// Chatter of the demo: 72 Hz, from 0.02 N doubling every 30 ms to 6 N, strongest along y, on an elliptic path.
    pub const fn at_72_hz(cut: usize) -> Self {
        Self {
            cut,
            after_s: 0.3,
            frequency_hz: 72.0,
            seed_n: 0.02,
            doubling_s: 0.03,
            limit_n: 6.0,
            shares_base: DVec3::new(0.6, 1.0, 0.2),
            lead_rad: 0.25 * TAU,
        }
    }

    /// Amplitude `in_cut_s` after the start of the cut, N; zero before the chatter starts.
    pub fn amplitude_n(&self, in_cut_s: f64) -> f64 {
        let grown = in_cut_s - self.after_s;
        if grown < 0.0 {
            0.0
        } else {
            (self.seed_n * exp2(grown / self.doubling_s)).min(self.limit_n)
        }
    }

    /// Force on the tool `in_cut_s` after the start of its cut, base axes, N.
    pub fn force_base(&self, in_cut_s: f64) -> DVec3 {
        let amplitude = self.amplitude_n(in_cut_s);
        let angle = TAU * self.frequency_hz * in_cut_s;
        let (along, across) = (sincos(angle + self.lead_rad).0, sincos(angle).0);
        amplitude * self.shares_base * DVec3::new(along, across, across)
    }
}

/// A structural mode of the robot, at the TCP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// Natural frequency, Hz, above zero.
    pub frequency_hz: f64,
    /// Damping ratio, 0 to below 1.
    pub damping_ratio: f64,
    /// Dynamic compliance `C_d`, m/N: the static compliance of this mode.
    pub compliance_m_per_n: f64,
    state: (DVec3, DVec3),
}

impl Mode {
    /// A mode at rest, the same along every base axis.
    pub const fn at_rest(frequency_hz: f64, damping_ratio: f64, compliance_m_per_n: f64) -> Self {
        Self { frequency_hz, damping_ratio, compliance_m_per_n, state: (DVec3::ZERO, DVec3::ZERO) }
    }

    /// Mode of the demo: 72 Hz, damping ratio 3 %, 0.05 µm/N: 5 µm of motion under 6 N at resonance, like the waviness in the thesis (0.6 to 6.8 µm).
    pub const fn at_72_hz() -> Self {
        Self::at_rest(72.0, 0.03, 0.05e-6)
    }

    /// Advances by `dt_s` under a constant force (base axes, N); returns the displacement at its
    /// end, base axes, m.
    pub fn step(&mut self, force_base: DVec3, dt_s: f64) -> DVec3 {
        let omega = TAU * self.frequency_hz;
        let decay = self.damping_ratio * omega;
        let omega_d = omega * sqrt(1.0 - self.damping_ratio * self.damping_ratio);
        let rest = force_base * self.compliance_m_per_n;
        let (x, v) = (self.state.0 - rest, self.state.1);
        let (sin, cos) = sincos(omega_d * dt_s);
        let fade = exp(-decay * dt_s);
        let position = (x * cos + (v + x * decay) * (sin / omega_d)) * fade;
        let speed = (v * cos - (v * decay + x * omega * omega) * (sin / omega_d)) * fade;
        self.state = (position + rest, speed);
        self.state.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chatter_doubles_as_said_and_then_stays() {
        let chatter = Chatter::at_72_hz(1);
        assert_eq!(chatter.amplitude_n(0.29), 0.0);
        let ratio = chatter.amplitude_n(0.36) / chatter.amplitude_n(0.33);
        assert!((ratio - 2.0).abs() < 1e-12);
        assert_eq!(chatter.amplitude_n(2.0), chatter.limit_n);
    }

    #[test]
    fn a_free_mode_loses_energy_at_the_rate_of_its_damping() {
        let mut mode = Mode::at_72_hz();
        mode.state = (DVec3::X * 1e-6, DVec3::ZERO);
        let omega = TAU * mode.frequency_hz;
        let energy = |m: &Mode| (m.state.0 * omega).length_squared() + m.state.1.length_squared();
        let mut before = energy(&mode);
        let first = before;
        for _ in 0..1000 {
            mode.step(DVec3::ZERO, 1e-3);
            assert!(energy(&mode) <= before);
            before = energy(&mode);
        }
        let expected = -2.0 * 0.03 * omega;
        let rate = libm::log(before / first);
        assert!((rate / expected - 1.0).abs() < 0.01, "{rate} for {expected}");
    }

    #[test]
    fn at_resonance_a_mode_moves_by_its_compliance_over_twice_the_damping() {
        let mut mode = Mode::at_72_hz();
        let (dt, omega) = (1e-5, TAU * 72.0);
        let mut largest = 0.0_f64;
        for k in 0..200_000 {
            let force = DVec3::Y * (omega * f64::from(k) * dt).sin();
            let y = mode.step(force, dt).y.abs();
            if k > 150_000 {
                largest = largest.max(y);
            }
        }
        let expected = mode.compliance_m_per_n / (2.0 * 0.03);
        assert!((largest / expected - 1.0).abs() < 0.01, "{largest} for {expected}");
    }

    #[test]
    fn two_half_steps_are_one_whole_step() {
        let (mut once, mut twice) = (Mode::at_72_hz(), Mode::at_72_hz());
        for force in [DVec3::new(6.0, -2.0, 0.5), DVec3::ZERO, DVec3::new(-1.0, 3.0, 0.0)] {
            let whole = once.step(force, 2e-3);
            twice.step(force, 1e-3);
            assert!((twice.step(force, 1e-3) - whole).length() < 1e-20);
        }
    }

    #[test]
    fn a_steady_force_bends_a_mode_by_its_compliance() {
        let mut mode = Mode::at_72_hz();
        let mut displacement = DVec3::ZERO;
        for _ in 0..5000 {
            displacement = mode.step(DVec3::Z * 10.0, 1e-3);
        }
        assert!((displacement.z - 0.5e-6).abs() < 1e-12);
    }
}
