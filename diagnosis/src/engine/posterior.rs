//! Posterior probabilities of competing hypotheses from their log-likelihoods and penalties.
//!
//! `p_i = exp(−Δ_i) / Σ_k exp(−Δ_k)`, Δ the loss in penalised log-likelihood compared with the selected hypothesis. With the penalty of the Bayesian
//! information criterion these are approximate posterior probabilities under equal priors (Kass and Raftery 1995, section 4).
//!
//! Invariant: they add up to 1.

/// Limit on the gain of an alternative over the selected hypothesis, in log-likelihood; keeps the exponential finite.
const GAIN_MAX: f64 = 20.0;

/// The probability of the selected hypothesis, and of each alternative, from the losses of the alternatives in penalised log-likelihood.
pub(crate) fn posterior(losses: &[f64]) -> (f64, Vec<f64>) {
    let weights: Vec<f64> = losses.iter().map(|loss| libm::exp(-loss.max(-GAIN_MAX))).collect();
    let all = 1.0 + weights.iter().sum::<f64>();
    (1.0 / all, weights.into_iter().map(|weight| weight / all).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_hypotheses_that_explain_as_much_share_their_probability_and_all_add_up_to_one() {
        let (probability, others) = posterior(&[0.0, 3.0_f64.ln(), 100.0]);
        assert!((probability - 3.0 / 7.0).abs() < 1e-12 && (others[1] - 1.0 / 7.0).abs() < 1e-12);
        assert!((probability + others.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        assert_eq!(posterior(&[]).0, 1.0);
        assert!(posterior(&[-1e9]).0 > 0.0);
    }
}
