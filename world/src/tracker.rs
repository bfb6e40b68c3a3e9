//! The instrument: a tracker that measures the TCP at its own rate, with noise and quantisation.
//!
//! `measurement = round((p + s z)/d) d` per axis of the measuring frame, z standard normal. s: standard uncertainty · d: resolution.
//!
//! A measurement depends only on the seed and its number, not on the number of calls in between. Drift and loss of the target are not modelled.

use crate::random::{Purpose, stream};
use glam::DVec3;
use physics::Frame;
use rand::RngExt;
use rand_distr::StandardNormal;

/// A tracker that measures the TCP.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracker {
    /// Base coordinates to measuring coordinates.
    pub measuring_from_base: Frame,
    /// Standard uncertainty per axis of the measuring frame, m (docs/reference/recording.md, `sigma`).
    pub sigma_m: DVec3,
    /// Measurements per second, above zero.
    pub rate_hz: f64,
    /// Resolution, m; 0 for none.
    pub resolution_m: f64,
    /// Seed of the noise.
    pub seed: u64,
    taken: u32,
}

impl Tracker {
    /// A tracker without measurements so far, in base axes.
    pub const fn new(sigma_m: DVec3, rate_hz: f64, resolution_m: f64, seed: u64) -> Self {
        Self {
            measuring_from_base: Frame::IDENTITY,
            sigma_m,
            rate_hz,
            resolution_m,
            seed,
            taken: 0,
        }
    }

    /// The measurement at `t_s`, measuring frame, m; `None` before the next one is due. Time must not decrease.
    pub fn read(&mut self, t_s: f64, tcp_base: DVec3) -> Option<DVec3> {
        // Times are sums of samples and deviate from multiples by rounding, so a measurement is due a millionth of its interval early.
        if t_s * self.rate_hz + 1e-6 < f64::from(self.taken) {
            return None;
        }
        let number = libm::floor(t_s * self.rate_hz + 1e-6) as u32;
        self.taken = number.saturating_add(1);
        let mut rng = stream(self.seed, Purpose::Tracker, number);
        let mut draw = || rng.sample::<f64, _>(StandardNormal);
        let noise = self.sigma_m * DVec3::new(draw(), draw(), draw());
        let measured = self.measuring_from_base.point(tcp_base) + noise;
        let rounded = |x: f64| libm::rint(x / self.resolution_m) * self.resolution_m;
        let coarse = || DVec3::new(rounded(measured.x), rounded(measured.y), rounded(measured.z));
        Some(if self.resolution_m > 0.0 { coarse() } else { measured })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_come_at_the_rate_with_the_stated_spread_per_axis() {
        let sigma = DVec3::new(10e-6, 20e-6, 40e-6);
        let mut tracker = Tracker::new(sigma, 250.0, 0.0, 1);
        let tcp = DVec3::new(0.8, 0.1, 0.4);
        let readings: Vec<DVec3> =
            (0..40_000).filter_map(|k| tracker.read(f64::from(k) * 1e-3, tcp)).collect();
        assert_eq!(readings.len(), 10_000);
        let square = readings.iter().map(|r| (*r - tcp) * (*r - tcp)).sum::<DVec3>() / 1e4;
        let ratio = square / (sigma * sigma);
        assert!((ratio - DVec3::ONE).abs().max_element() < 0.06, "{ratio}");
    }

    #[test]
    fn a_reading_does_not_depend_on_how_often_one_looked() {
        let new = || Tracker::new(DVec3::splat(1e-5), 100.0, 1e-6, 4);
        let (mut often, mut seldom) = (new(), new());
        let mut last = None;
        for k in 0..=500 {
            last = often.read(f64::from(k) * 1e-3, DVec3::X).or(last);
        }
        assert_eq!(seldom.read(0.5, DVec3::X), last);
        let digits = last.expect("a reading").x / 1e-6;
        assert!((digits - libm::rint(digits)).abs() < 1e-6);
    }
}
