//! Whitening of autocorrelated noise by a linear predictor (Yule-Walker equations, Levinson recursion).
//!
//! The signal from which the predictor was estimated is whitened to unit variance.

/// Order of the autoregressive model.
const ORDER: usize = 24;

/// A linear predictor of a signal from its past.
#[derive(Clone, Debug, PartialEq)]
pub struct Predictor {
    coefficients: Vec<f64>,
    sigma: f64,
}

impl Predictor {
    /// Estimated from noise in separate pieces.
    #[must_use]
    pub fn of(noise: &[Vec<f64>]) -> Self {
        let count: usize = noise.iter().map(Vec::len).sum();
        let product = |lag: usize| -> f64 {
            let lagged_product = |piece: &Vec<f64>| -> f64 {
                piece.iter().skip(lag).zip(piece).map(|(a, b)| a * b).sum()
            };
            noise.iter().map(lagged_product).sum::<f64>() / count.max(1) as f64
        };
        let products: Vec<f64> = (0..=ORDER).map(product).collect();
        let mut coefficients: Vec<f64> = Vec::new();
        // White noise of a millionth of the power avoids a division by zero.
        let mut error = products[0] * (1.0 + 1e-6) + f64::MIN_POSITIVE;
        for order in 1..=ORDER {
            let known: f64 =
                coefficients.iter().enumerate().map(|(k, a)| a * products[order - 1 - k]).sum();
            let turn = (products[order] - known) / error;
            let mirrored: Vec<f64> = coefficients.iter().rev().copied().collect();
            coefficients.iter_mut().zip(mirrored).for_each(|(a, b)| *a -= turn * b);
            coefficients.push(turn);
            error *= 1.0 - turn * turn;
        }
        Self { coefficients, sigma: error.sqrt() }
    }

    /// Whitened pieces, concatenated, each without its first values.
    #[must_use]
    pub fn whiten(&self, pieces: &[Vec<f64>]) -> Vec<f64> {
        let mut all = Vec::new();
        for piece in pieces {
            for k in ORDER..piece.len() {
                let predicted: f64 =
                    self.coefficients.iter().enumerate().map(|(j, a)| a * piece[k - 1 - j]).sum();
                all.push((piece[k] - predicted) / self.sigma);
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    #[test]
    fn noise_with_a_long_memory_comes_out_white() {
        let mut rng = Rng::new(1, 0);
        let (mut a, mut b) = (0.0, 0.0);
        let noise: Vec<f64> = (0..20_000)
            .map(|_| {
                (a, b) = (1.6 * a - 0.8 * b + 3.0 * rng.normal(), a);
                a
            })
            .collect();
        let white = Predictor::of(std::slice::from_ref(&noise)).whiten(&[noise]);
        let n = white.len() as f64;
        let mean =
            |lag: usize| white.iter().skip(lag).zip(&white).map(|(a, b)| a * b).sum::<f64>() / n;
        assert!((mean(0) - 1.0).abs() < 0.03, "{}", mean(0));
        assert!((1..6).all(|lag| mean(lag).abs() < 0.03));
    }
}
