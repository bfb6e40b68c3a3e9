//! Gains of a joint in the frequency domain: from the path to the correction of its commands (preview), or from a measured error to a change of them (learning).
//!
//! With the plant Ĝ of the model, the spread `U = Σ |∂Ĝ/∂p|² σ_p²` of its uncertain numbers and the weight `R = (f/f_b)⁶` of the third derivative:
//! preview `W − 1` with `W = (Ĝ* + R) / (|Ĝ|² + U + R)`, which minimises `E |1 − G W|² + R |W − 1|²`; learning `L = Ĝ* / (|Ĝ|² + U + R)`,
//! which minimises `E |1 − G L|² + R |L|²`. Both are Wiener's; where the plant is uncertain, the preview attenuates commands that would excite oscillations.
//!
//! The step is scaled by λ ≤ 1 such that it is robust: `|b − λ G x| ≤ |b|` for every G whose parameters deviate by up to a stated
//! fraction, with `b = 1 − G, x = W − 1` in a preview and `b = 1, x = L` in learning, which is robust monotonic convergence. Frequencies of modes deviate together, delays together,
//! lags together. A participation factor deviates by at most three standard uncertainties: above the frequency of a mode it determines the sign of the correction.
//!
//! Valid for linear plants: the RMS over the path cannot increase, its maximum can.

use crate::plant::Plant;
use realfft::num_complex::Complex64;

/// Input from which the commands are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The path, by the predictions of the model.
    Path,
    /// The measured error of a run.
    Error,
}

impl Source {
    /// Bound on the error of the worst plant after a step, relative to that before: just below one
    /// for a preview, which is a single step; lower for learning, which is repeated and should
    /// reduce the error of the worst plant each time.
    fn margin(self) -> f64 {
        match self {
            Self::Path => 0.95,
            Self::Error => 0.75,
        }
    }
}

/// Spacing of the frequencies at which plants are evaluated, Hz: finer than the peak of a mode of 8
/// Hz with 2 % damping.
const SPACING_HZ: f64 = 0.1;
/// Plants are evaluated up to this multiple of the bandwidth; beyond, the weight of the third
/// derivative leaves less than a thousandth.
const BANDS: f64 = 3.5;
/// The share is smoothed over this band, Hz, so that the change of a command extends over about its
/// reciprocal, s.
const SMOOTH_HZ: f64 = 0.8;

/// A design for one joint.
#[derive(Clone, Copy, Debug)]
pub struct Design<'a> {
    /// The joint by the model.
    pub plant: &'a Plant,
    /// Hz.
    pub bandwidth_hz: f64,
    /// Largest relative deviation of its parameters.
    pub robust_to: f64,
    /// Input from which the commands are computed.
    pub source: Source,
}

/// Gains at a set of frequencies.
#[derive(Clone, Debug, PartialEq)]
pub struct Gains {
    /// From the source to the change of the commands.
    pub gains: Vec<Complex64>,
    /// λ.
    pub shares: Vec<f64>,
}

impl Design<'_> {
    /// The gains from the spectrum of the source to that of the change of the commands, at these
    /// frequencies, Hz, and the share λ included in them.
    #[must_use]
    pub fn gains(&self, bins_hz: &[f64]) -> Gains {
        let neighbours = self.plant.perturbed_by_sigma();
        let by_frequency = self.shares(&neighbours);
        let shares: Vec<f64> = bins_hz.iter().map(|hz| share_at(&by_frequency, *hz)).collect();
        let step = |(hz, share): (&f64, &f64)| self.step(*hz, &neighbours) * share;
        let gains = bins_hz.iter().zip(&shares).map(step).collect();
        Gains { gains, shares }
    }

    /// The step at a frequency, before scaling by its share.
    fn step(&self, hz: f64, neighbours: &[Plant]) -> Complex64 {
        let g = self.plant.response(hz);
        // Each parameter is varied to both sides: half of the sum.
        let spread: f64 =
            neighbours.iter().map(|neighbour| (neighbour.response(hz) - g).norm_sqr()).sum::<f64>()
                / 2.0;
        let effort = (hz / self.bandwidth_hz).powi(6);
        let denominator = g.norm_sqr() + spread + effort;
        match self.source {
            Source::Path => (g.conj() - g.norm_sqr() - spread) / denominator,
            Source::Error => g.conj() / denominator,
        }
    }

    /// The share at multiples of [`SPACING_HZ`].
    fn shares(&self, neighbours: &[Plant]) -> Vec<f64> {
        let motors = self.plant.perturbed_motors(self.robust_to);
        let links = self.plant.perturbed_links(self.robust_to);
        let count = (BANDS * self.bandwidth_hz / SPACING_HZ).ceil() as usize;
        let one = Complex64::new(1.0, 0.0);
        let mut shares = vec![1.0];
        for k in 1..=count {
            let hz = k as f64 * SPACING_HZ;
            let step = self.step(hz, neighbours);
            let links: Vec<Complex64> = links.iter().map(|link| link.link_response(hz)).collect();
            let mut share = 1.0_f64;
            for motor in &motors {
                let motor = motor.motor_response(hz);
                for link in &links {
                    let g = motor * link;
                    let before = if self.source == Source::Path { one - g } else { one };
                    let change = g * step;
                    let helps = (before.conj() * change).re;
                    share = share.min(2.0 * self.source.margin() * helps / change.norm_sqr());
                }
            }
            shares.push(share.max(0.0));
        }
        smoothed(&shares)
    }
}

/// The minimum over neighbours, then their mean over the same band: nowhere more than before.
fn smoothed(shares: &[f64]) -> Vec<f64> {
    let half = (SMOOTH_HZ / SPACING_HZ / 2.0).round() as usize;
    let about = |k: usize| k.saturating_sub(half)..(k + half + 1).min(shares.len());
    let minima: Vec<f64> = (0..shares.len())
        .map(|k| shares[about(k)].iter().fold(1.0_f64, |minimum, share| minimum.min(*share)))
        .collect();
    (0..shares.len())
        .map(|k| minima[about(k)].iter().sum::<f64>() / about(k).len() as f64)
        .collect()
}

fn share_at(shares: &[f64], hz: f64) -> f64 {
    let place = hz / SPACING_HZ;
    let (k, last) = (place as usize, shares.len() - 1);
    if k >= last {
        return shares[last];
    }
    shares[k] + (place - k as f64) * (shares[k + 1] - shares[k])
}
