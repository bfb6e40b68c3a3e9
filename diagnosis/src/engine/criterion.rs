//! Penalty of the extended Bayesian information criterion (Schwarz 1978; Chen and Chen 2008), in log-likelihood: `½ k ln n + ln C` for a candidate
//! with `k` parameters out of `C` candidates, on `n` rows.

/// Number of rows and candidates of a selection.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ebic {
    /// Number of independent rows: the number of rows divided by the design effect if rows are correlated.
    pub(crate) rows: f64,
    /// Number of candidates that are compared.
    pub(crate) candidates: usize,
}

impl Ebic {
    /// The penalty of one parameter.
    pub(crate) fn per_parameter(&self) -> f64 {
        0.5 * self.rows.max(2.0).ln()
    }

    /// The penalty of a candidate with this number of parameters.
    pub(crate) fn penalty(&self, parameters: f64) -> f64 {
        parameters * self.per_parameter() + (self.candidates.max(1) as f64).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A parameter without effect gains half of a squared standard normal variate, in log-likelihood; the best of a hundred exceeds the penalty with
    /// a probability below 0.05.
    #[test]
    fn the_best_of_a_hundred_useless_candidates_exceeds_its_penalty_with_a_probability_below_a_twentieth()
     {
        let penalty = Ebic { rows: 1000.0, candidates: 100 }.penalty(1.0);
        // P(z² > 2 penalty) for one candidate.
        let one = libm::erfc((penalty).sqrt());
        assert!(100.0 * one < 0.05, "{}", 100.0 * one);
    }
}
