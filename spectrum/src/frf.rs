//! Frequency response functions from impact tests: estimators H1 and H2, coherence over several
//! hits.
//!
//! H1 = ⟨F* X⟩ / ⟨|F|²⟩ (unbiased by noise on the response), H2 = ⟨|X|²⟩ / ⟨X* F⟩ (unbiased by
//! noise on the force); γ² = H1 / H2. The coherence of a single hit is 1 by construction, so it is
//! computed from three hits on. Source: thesis 4.8 to 4.19, corrected; Ewins, Modal Testing,
//! section 3. Valid for linear structures.

use realfft::RealFftPlanner;
use realfft::num_complex::Complex;
use std::f64::consts::TAU;

/// One impact: force and response, sampled synchronously.
#[derive(Clone, Copy, Debug)]
pub struct Hit<'a> {
    /// Hammer force, N.
    pub force: &'a [f64],
    /// Response, in the unit of its kind.
    pub response: &'a [f64],
}

/// What the response sensor measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// m/s².
    Acceleration,
    /// m/s.
    Velocity,
    /// m.
    Displacement,
}

impl Response {
    /// Number of time derivatives of a displacement.
    fn order(self) -> i32 {
        match self {
            Self::Displacement => 0,
            Self::Velocity => 1,
            Self::Acceleration => 2,
        }
    }
}

/// Estimator of the response function.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// For noise on the response; biased low by noise on the force.
    #[default]
    H1,
    /// For noise on the force; biased high by noise on the response.
    H2,
}

/// Least number of hits for a meaningful coherence.
pub const COHERENCE_HITS: usize = 3;

/// Invalid input of a response function.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FrfError {
    /// No hit at all.
    #[error("tap test: no hit was given; record at least one, better {COHERENCE_HITS} or more")]
    NoHits,
    /// Force and response of a hit differ in length, or hits differ from the first one.
    #[error(
        "tap test: hit {hit} has {force} force and {response} response samples, expected {expected} of both; cut all hits alike"
    )]
    Lengths {
        /// Place of the hit, from 0.
        hit: usize,
        /// Force samples.
        force: usize,
        /// Response samples.
        response: usize,
        /// Samples expected.
        expected: usize,
    },
    /// The sampling rate is invalid.
    #[error("tap test: sampling rate {rate_hz} Hz, expected a finite rate above 0")]
    Rate {
        /// The rate given, Hz.
        rate_hz: f64,
    },
}

/// A frequency response function: response per force, over frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct Frf {
    /// Frequencies, Hz.
    pub frequency_hz: Vec<f64>,
    /// H1, response unit per N.
    pub h1: Vec<Complex<f64>>,
    /// H2, response unit per N.
    pub h2: Vec<Complex<f64>>,
    /// Coherence, 0 to 1; `None` below three hits.
    pub coherence: Option<Vec<f64>>,
    /// What the response is.
    pub response: Response,
    /// Number of hits averaged; 0 for a function that was read from a file.
    pub hits: usize,
    /// Decay of the exponential window over force and response, 1/s; 0 for none. The function is
    /// then that at `s = jω + decay`, which conversions take into account and fits subtract.
    pub window_decay_per_s: f64,
}

/// Response function of several hits; no windows are applied. Records contain the whole ring-down,
/// or are already windowed (then [`Frf::window_decay_per_s`] must be set).
///
/// # Errors
/// No hit, unequal lengths, or an invalid rate.
pub fn frf(hits: &[Hit<'_>], rate_hz: f64, response: Response) -> Result<Frf, FrfError> {
    let n = hits.first().ok_or(FrfError::NoHits)?.force.len();
    if !(rate_hz > 0.0 && rate_hz.is_finite()) {
        return Err(FrfError::Rate { rate_hz });
    }
    let plan = RealFftPlanner::new().plan_fft_forward(n.max(2));
    let bins = n.max(2) / 2 + 1;
    let (mut ff, mut xx) = (vec![0.0; bins], vec![0.0; bins]);
    let mut fx = vec![Complex::<f64>::default(); bins];
    for (hit, Hit { force, response }) in hits.iter().enumerate() {
        if force.len() != n || response.len() != n || n < 2 {
            let (force, response) = (force.len(), response.len());
            return Err(FrfError::Lengths { hit, force, response, expected: n.max(2) });
        }
        let transform = |samples: &[f64]| {
            let mut output = plan.make_output_vec();
            // The lengths are those of the plan, so that no error is possible.
            let _ = plan.process(&mut samples.to_vec(), &mut output);
            output
        };
        let (f, x) = (transform(force), transform(response));
        for bin in 0..bins {
            ff[bin] += f[bin].norm_sqr();
            xx[bin] += x[bin].norm_sqr();
            fx[bin] += f[bin].conj() * x[bin];
        }
    }
    let over = |a: Complex<f64>, b: Complex<f64>| {
        if b.norm_sqr() > 0.0 { a / b } else { Complex::default() }
    };
    let coherence = |bin: usize| over(fx[bin].norm_sqr().into(), (ff[bin] * xx[bin]).into()).re;
    Ok(Frf {
        frequency_hz: (0..bins).map(|bin| bin as f64 * rate_hz / n as f64).collect(),
        h1: (0..bins).map(|bin| over(fx[bin], ff[bin].into())).collect(),
        h2: (0..bins).map(|bin| over(xx[bin].into(), fx[bin].conj())).collect(),
        coherence: (hits.len() >= COHERENCE_HITS).then(|| (0..bins).map(coherence).collect()),
        response,
        hits: hits.len(),
        window_decay_per_s: 0.0,
    })
}

impl Frf {
    /// A response function measured by another instrument: both estimators are equal to it, and
    /// there is no coherence.
    #[must_use]
    pub fn from_measured_function(
        frequency_hz: Vec<f64>,
        h: Vec<Complex<f64>>,
        response: Response,
    ) -> Self {
        let (h1, h2) = (h.clone(), h);
        Self { frequency_hz, h1, h2, coherence: None, response, hits: 0, window_decay_per_s: 0.0 }
    }

    /// One estimate, response unit per N.
    #[must_use]
    pub fn h(&self, estimator: Estimator) -> &[Complex<f64>] {
        match estimator {
            Estimator::H1 => &self.h1,
            Estimator::H2 => &self.h2,
        }
    }

    /// As displacement, velocity or acceleration per force, m/N, m/sN, m/s²N (receptance, mobility,
    /// accelerance), by powers of `s = jω + decay` of the window. Zero where the divisor is zero.
    #[must_use]
    pub fn per_force(&self, estimator: Estimator, wanted: Response) -> Vec<Complex<f64>> {
        let power = wanted.order() - self.response.order();
        let one = |(h, f_hz): (&Complex<f64>, &f64)| {
            let s = Complex::new(self.window_decay_per_s, TAU * f_hz);
            if power < 0 && s.norm() == 0.0 { Complex::default() } else { h * s.powi(power) }
        };
        self.h(estimator).iter().zip(&self.frequency_hz).map(one).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Response of a single mode to a unit impulse, sampled: `e^(−ζω t) sin(ω_d t) / ω_d`.
    fn impulse(n: usize, rate_hz: f64, f_hz: f64, damping: f64) -> (Vec<f64>, Vec<f64>) {
        let omega = TAU * f_hz;
        let omega_d = omega * (1.0 - damping * damping).sqrt();
        let mut force = vec![0.0; n];
        force[0] = rate_hz;
        let x = (0..n).map(|i| {
            let t = i as f64 / rate_hz;
            (-damping * omega * t).exp() * (omega_d * t).sin() / omega_d
        });
        (force, x.collect())
    }

    #[test]
    fn the_receptance_of_one_mode_is_the_known_one() {
        let (force, response) = impulse(1 << 15, 4096.0, 72.0, 0.02);
        let hit = Hit { force: &force, response: &response };
        let h = frf(&[hit], 4096.0, Response::Displacement).expect("a response function");
        assert!(h.coherence.is_none(), "one hit has no coherence");
        let omega_n = TAU * 72.0;
        for bin in [400, 560, 576, 590, 800] {
            let omega = TAU * h.frequency_hz[bin];
            let known =
                1.0 / Complex::new(omega_n * omega_n - omega * omega, 0.04 * omega_n * omega);
            assert!((h.h1[bin] - known).norm() < 2e-3 * known.norm().max(1e-6), "{bin}");
        }
        let at_resonance = h.h1[576];
        assert!(at_resonance.im < 0.0 && at_resonance.re.abs() < 0.05 * at_resonance.im.abs());
    }

    #[test]
    fn an_exponential_window_moves_the_function_by_its_decay_and_conversions_know_it() {
        let (mut force, mut response) = impulse(1 << 12, 4096.0, 72.0, 0.002);
        let decay = 8.0;
        for x in [&mut force, &mut response] {
            x.iter_mut().enumerate().for_each(|(i, x)| *x *= (-decay * i as f64 / 4096.0).exp());
        }
        let hit = Hit { force: &force, response: &response };
        let mut h = frf(&[hit], 4096.0, Response::Displacement).expect("a response function");
        h.window_decay_per_s = decay;
        let (wn, zeta) = (TAU * 72.0, 0.002);
        let accelerance = h.per_force(Estimator::H1, Response::Acceleration);
        for bin in [60, 72, 80] {
            let s = Complex::new(decay, TAU * h.frequency_hz[bin]);
            let known = 1.0 / (s * s + 2.0 * zeta * wn * s + wn * wn);
            assert!((h.h1[bin] - known).norm() < 3e-3 * known.norm(), "{bin}");
            assert!(
                (accelerance[bin] - s * s * h.h1[bin]).norm() < 1e-12 * accelerance[bin].norm()
            );
        }
        let again = Frf::from_measured_function(
            h.frequency_hz.clone(),
            accelerance,
            Response::Acceleration,
        );
        let again = Frf { window_decay_per_s: decay, ..again };
        let back = again.per_force(Estimator::H2, Response::Displacement);
        assert!((back[72] - h.h1[72]).norm() < 1e-12 * h.h1[72].norm());
    }

    #[test]
    fn h1_is_below_h2_and_their_ratio_is_the_coherence() {
        let (force, response) = impulse(4096, 4096.0, 72.0, 0.05);
        let noisy: Vec<Vec<f64>> = (0..4)
            .map(|k| {
                let noise = |i: usize| 1e-4 * ((i * (2 * k + 3)) as f64 * 1.7).sin();
                response.iter().enumerate().map(|(i, x)| x + noise(i)).collect()
            })
            .collect();
        let hits: Vec<Hit<'_>> = noisy.iter().map(|x| Hit { force: &force, response: x }).collect();
        let h = frf(&hits, 4096.0, Response::Displacement).expect("a response function");
        let coherence = h.coherence.clone().expect("four hits");
        for ((h1, h2), coherence) in h.h1.iter().zip(&h.h2).zip(coherence).skip(1).take(2000) {
            let ratio = h1.norm() / h2.norm();
            assert!(ratio < 1.0 + 1e-9 && (ratio - coherence).abs() < 1e-9);
        }
    }

    #[test]
    fn hits_of_unequal_length_are_refused() {
        let hit = |n: usize| Hit { force: &[1.0; 8][..n], response: &[0.0; 8] };
        assert!(matches!(frf(&[], 1.0, Response::Velocity), Err(FrfError::NoHits)));
        let unequal = frf(&[hit(8), hit(7)], 1.0, Response::Velocity);
        assert!(matches!(unequal, Err(FrfError::Lengths { hit: 1, force: 7, .. })));
        assert!(frf(&[hit(8)], f64::NAN, Response::Velocity).is_err());
    }
}
