//! Whitening of autocorrelated noise by a linear predictor (Yule-Walker equations, Levinson recursion).
//!
//! Promises: what the predictor was made of comes out with unit variance and without memory. Never: a signal's meaning.

/// How far it looks back.
const ORDER: usize = 24;

/// A predictor of a signal by its own past.
#[derive(Clone, Debug, PartialEq)]
pub struct Predictor {
    past: Vec<f64>,
    sigma: f64,
}

impl Predictor {
    /// For noise, stretch by stretch.
    #[must_use]
    pub fn of(noise: &[Vec<f64>]) -> Self {
        let count: usize = noise.iter().map(Vec::len).sum();
        let product = |lag: usize| -> f64 {
            let of = |piece: &Vec<f64>| -> f64 {
                piece.iter().skip(lag).zip(piece).map(|(a, b)| a * b).sum()
            };
            noise.iter().map(of).sum::<f64>() / count.max(1) as f64
        };
        let products: Vec<f64> = (0..=ORDER).map(product).collect();
        let mut past: Vec<f64> = Vec::new();
        // A millionth of its power as white noise keeps the recursion from dividing by nothing.
        let mut error = products[0] * (1.0 + 1e-6) + f64::MIN_POSITIVE;
        for order in 1..=ORDER {
            let known: f64 =
                past.iter().enumerate().map(|(k, a)| a * products[order - 1 - k]).sum();
            let turn = (products[order] - known) / error;
            let mirrored: Vec<f64> = past.iter().rev().copied().collect();
            past.iter_mut().zip(mirrored).for_each(|(a, b)| *a -= turn * b);
            past.push(turn);
            error *= 1.0 - turn * turn;
        }
        Self { past, sigma: error.sqrt() }
    }

    /// Stretches whitened, one after the other, each without its first values.
    #[must_use]
    pub fn white(&self, pieces: &[Vec<f64>]) -> Vec<f64> {
        let mut all = Vec::new();
        for piece in pieces {
            for k in ORDER..piece.len() {
                let said: f64 =
                    self.past.iter().enumerate().map(|(j, a)| a * piece[k - 1 - j]).sum();
                all.push((piece[k] - said) / self.sigma);
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Chance;

    #[test]
    fn noise_with_a_long_memory_comes_out_white() {
        let mut chance = Chance::new(1, 0);
        let (mut a, mut b) = (0.0, 0.0);
        let noise: Vec<f64> = (0..20_000)
            .map(|_| {
                (a, b) = (1.6 * a - 0.8 * b + 3.0 * chance.normal(), a);
                a
            })
            .collect();
        let white = Predictor::of(std::slice::from_ref(&noise)).white(&[noise]);
        let n = white.len() as f64;
        let mean =
            |lag: usize| white.iter().skip(lag).zip(&white).map(|(a, b)| a * b).sum::<f64>() / n;
        assert!((mean(0) - 1.0).abs() < 0.03, "{}", mean(0));
        assert!((1..6).all(|lag| mean(lag).abs() < 0.03));
    }
}
